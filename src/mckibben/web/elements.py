"""Pages whose elements live on the server: a tree of tags, sent as HTML and updated over a socket.

A page that is requested becomes a `PageDocument` with a tree of `Element`. The first answer is its whole HTML, so that it
stands before any script runs; what changes later goes over the document's WebSocket as a few kinds of operations, which
``static/js/elements.js`` carries out. Events of the browser come back over the same line. All of it is used from the
server's event loop only; what takes long is awaited in a thread.

Attributes and texts are escaped here, once: what a user typed, or a file holds, never becomes HTML or code.
"""

from __future__ import annotations

import asyncio
import html
import inspect
import json
import logging
import re
import secrets
from collections import deque
from collections.abc import Callable, Coroutine
from contextvars import ContextVar
from typing import TYPE_CHECKING, Self

from ..documents import JsonValue, parse_json

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

LOGGER = logging.getLogger(__name__)
AWAY = 30.0  # time for which a page that lost its line finds its document again [s]
MOST_BATCHES = 500  # of operations, that are kept for a page that lost its line
MOST_DOCUMENTS = 64
LONGEST_EVENT = 4_000_000  # characters of what an event may carry
VOID = ("input", "br", "hr", "img")  # tags without content
Handler = Callable[..., object]
_stack: ContextVar[tuple[Element, ...]] = ContextVar("places that new elements go to", default=())


class Element:
    """An HTML element of a page. It is added to the element whose ``with`` block it is created in.

    Args:
        tag: such as ``div``.
        classes: CSS classes, with blanks between them.
        words: text inside.
        markup: HTML inside that this program wrote itself; never with anything of a user in it that is not escaped.
        document: that it is the root of; else that of its place.
    """

    def __init__(
        self,
        tag: str,
        classes: str = "",
        *,
        words: object = None,
        markup: str | None = None,
        document: PageDocument | None = None,
    ) -> None:
        parent = None if document is not None else place()
        self.document: PageDocument = document or parent.document  # type: ignore[union-attr]
        self.tag, self.parent, self.children = tag, parent, list[Element]()
        self.number = self.document.next_number()
        self._classes = dict.fromkeys(classes.split())
        self._attributes: dict[str, str] = {}
        self._styles: dict[str, str] = {}
        self._handlers: dict[str, Handler] = {}
        self._told: dict[str, str] = {}  # attributes that the browser has
        self._inside = html.escape(str(words)) if words is not None else markup
        if parent is not None:
            parent.children.append(self)
            self.document.record("insert", self)

    def __enter__(self) -> Self:
        """Make this element the parent of those created in the block."""
        _stack.set((*_stack.get(), self))
        return self

    def __exit__(self, *_: object) -> None:
        _stack.set(_stack.get()[:-1])

    def set(self, **attributes: object) -> Self:
        """Set attributes: ``aria_label`` is ``aria-label``; True is an attribute without a value, None removes it."""
        for name, value in attributes.items():
            name = name.rstrip("_").replace("_", "-")
            if name == "value":
                self._told.pop(name, None)  # a person may have typed something else meanwhile
            if value is None or value is False:
                self._attributes.pop(name, None)
            else:
                self._attributes[name] = "" if value is True else str(value)
        self.document.record("attributes", self)
        return self

    def data(self, name: str, document: object) -> Self:
        """Pass a document to the script that draws this element, as JSON in ``data-<name>``."""
        return self.set(**{f"data-{name}": json.dumps(document, separators=(",", ":"), allow_nan=False)})

    def classed(self, name: str, on: bool = True) -> Self:
        """Add a CSS class, or remove it."""
        if on:
            self._classes[name] = None
        else:
            self._classes.pop(name, None)
        self.document.record("attributes", self)
        return self

    def style(self, **properties: str | None) -> Self:
        """Set CSS properties: ``margin_left="auto"``; None removes one."""
        for name, value in properties.items():
            name = name.replace("_", "-")
            if value is None:
                self._styles.pop(name, None)
            else:
                self._styles[name] = value
        self.document.record("attributes", self)
        return self

    def on(self, event: str, do: Callable[..., object]) -> Self:
        """Call a function at an event: ``click``, ``enter``, ``space``, ``close``."""
        self._handlers[event] = lambda _: do()
        self.document.record("attributes", self)
        return self

    def on_value(self, event: str, do: Callable[[JsonValue], object], wait: float = 0.0) -> Self:
        """Call a function with the value of an event: of a field, or the ``detail`` of a script's event.

        Args:
            event: ``change``, ``input`` or ``entered`` (by Enter) of a field; or one that a script of ``static/js`` sends.
            do: given the value, of any of JSON's types.
            wait: shortest time between two of them [s].
        """
        self._handlers[event] = do
        if wait:
            self._attributes["data-wait"] = f"{1e3 * wait:.0f}"
        self.document.record("attributes", self)
        return self

    def say(self, words: object) -> None:
        """Replace the content by text."""
        self.put(html.escape(str(words)))

    def put(self, markup: str) -> None:
        """Replace the content by HTML generated by this program."""
        if markup != self._inside:
            self._inside = markup
            self.document.record("inside", self)

    def clear(self) -> None:
        """Remove the content."""
        for child in self.children:
            child.forget()
        self.children = []
        self._inside = None
        self.document.record("clear", self)

    def delete(self) -> bool:
        """Remove the element from the page; False if it was gone already."""
        if self.parent is None or self not in self.parent.children:
            return False
        self.parent.children.remove(self)
        self.document.record("remove", self)
        self.forget()
        return True

    def forget(self) -> None:
        """Unregister the element and its content from events."""
        self.document.elements.pop(self.number, None)
        for child in self.children:
            child.forget()

    @property
    def inside(self) -> str:
        """HTML of the content."""
        return "".join(child.html() for child in self.children) if self._inside is None else self._inside

    def handler(self, event: str) -> Handler | None:
        """Handler of an event."""
        return self._handlers.get(event)

    def attributes(self) -> dict[str, str]:
        """All attributes as the browser has them."""
        attributes = dict(self._attributes)
        if self._classes:
            attributes["class"] = " ".join(self._classes)
        if self._styles:
            attributes["style"] = ";".join(f"{name}:{value}" for name, value in self._styles.items())
        if self._handlers:
            attributes["data-on"] = " ".join(self._handlers)
        attributes["data-id"] = str(self.number)
        return attributes

    def changes(self) -> dict[str, str | None]:
        """Attributes that differ from those of the browser; None for removed ones."""
        now, before = self.attributes(), self._told
        self._told = now
        gone: dict[str, str | None] = {name: None for name in before if name not in now}
        return gone | {name: value for name, value in now.items() if before.get(name) != value}

    def html(self) -> str:
        """HTML of the element with its content."""
        self._told = self.attributes()
        words = "".join(f' {name}="{html.escape(value)}"' for name, value in self._told.items())
        if self.tag in VOID:
            return f"<{self.tag}{words}>"
        return f"<{self.tag}{words}>{self.inside}</{self.tag}>"


class Timer:
    """Calls a function repeatedly, while `active` and while the page exists."""

    def __init__(self, document: PageDocument, period: float, do: Callable[[], object], active: bool = True) -> None:
        self.active = active

        async def run() -> None:
            while not document.closed:
                await asyncio.sleep(period)
                if self.active and document.connected:
                    await document.call(do)

        document.spawn(run())


class PageDocument:
    """A page of one visitor, from the request until the page is closed.

    Attributes:
        key: secret name of the document, by which the page's line, uploads and downloads find it.
        root: element that holds the page.
        module, sheets, scripts: of the page, for its head.
        connected: whether the page has a line now.
        closed: whether the page is gone.
    """

    def __init__(self) -> None:
        self.key = secrets.token_urlsafe(18)
        self.elements: dict[int, Element] = {}
        self.module, self.sheets, self.scripts = "", tuple[str, ...](), tuple[str, ...]()
        self.connected = self.closed = False
        self.downloads: dict[str, tuple[str, bytes]] = {}
        self._count = self._sent = 0
        self._records: list[tuple[str, Element]] = []
        self._calls: list[list[object]] = []
        self._batches: deque[tuple[int, str]] = deque(maxlen=MOST_BATCHES)
        self._news, self._arrived = asyncio.Event(), asyncio.Event()
        self._written = self._due = False  # whether the first HTML went out; whether a flush will come
        self._tasks: set[asyncio.Task[None]] = set()
        self._ends: list[Callable[[], object]] = []
        self.root = Element("main", document=self)

    # ---- what pages use

    def spawn(self, work: Coroutine[object, object, None]) -> None:
        """Run a coroutine beside the page; its failure is logged."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._done)

    def _done(self, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and task.exception() is not None:
            LOGGER.error("a page failed", exc_info=task.exception())

    def when_connected(self, do: Callable[[], object]) -> None:
        """Call a function once the page is connected, within the present element."""

        async def begin() -> None:
            await self._arrived.wait()
            await self.call(do)

        self.spawn(begin())

    def on_close(self, do: Callable[[], object]) -> None:
        """Call a function when the page is closed; a short loss of the connection does not close it."""
        self._ends.append(do)

    def call_script(self, name: str, *arguments: object) -> None:
        """Call a function of the page's scripts by its name in ``calls``, with JSON arguments."""
        self._calls.append([name, *arguments])
        self._flush_soon()

    async def call(self, do: Callable[..., object], *arguments: object) -> None:
        """Call a function or a coroutine of the page."""
        result = do(*arguments)
        if inspect.isawaitable(result):
            await result

    # ---- what elements use

    def next_number(self) -> int:
        """Number for a new element."""
        self._count += 1
        return self._count

    def record(self, kind: str, element: Element) -> None:
        """Note that an element is new or has changed; it is sent when the present code has run."""
        if kind == "insert":
            self.elements[element.number] = element
        if self._written and not self.closed:
            self._records.append((kind, element))
            self._flush_soon()

    def _flush_soon(self) -> None:
        if not self._due and self._written and not self.closed:
            self._due = True
            asyncio.get_running_loop().call_soon(self._flush)

    def _flush(self) -> None:
        self._due = False
        operations = [*_operations(self._records), *(["call", *call] for call in self._calls)]
        self._records, self._calls = [], []
        if operations:
            self._sent += 1
            self._batches.append((self._sent, json.dumps({"n": self._sent, "do": operations}, separators=(",", ":"))))
            self._news.set()

    # ---- what the server uses

    def html(self) -> str:
        """The first HTML of the page; later changes are sent over its socket."""
        self._written = True
        text = self.root.html()
        self._flush_soon()  # calls that were made meanwhile
        return text

    async def serve(self, socket: WebSocket) -> None:
        """Serve an accepted socket of the page until it closes."""
        from starlette.websockets import WebSocketDisconnect

        try:
            received = int(parse_json(await socket.receive_text()).get("seen", 0))
        except (WebSocketDisconnect, ValueError, TypeError, AttributeError):
            return
        first = self._batches[0][0] if self._batches else self._sent + 1
        if received + 1 < first and received < self._sent:
            await socket.send_text('{"reload":true}')  # the page missed more than is kept
            return
        self.connected = True
        self._arrived.set()
        try:
            await until_one_ends(self._hear(socket), self._tell(socket, received))
        finally:
            self.connected = False

    async def _tell(self, socket: WebSocket, seen: int) -> None:
        while not self.closed:
            self._news.clear()
            for number, text in [*self._batches]:
                if number > seen:
                    await socket.send_text(text)
                    seen = number
            await self._news.wait()

    async def _hear(self, socket: WebSocket) -> None:
        while True:
            text = await socket.receive_text()
            try:
                message = parse_json(text) if len(text) <= LONGEST_EVENT else {}
                number, event, value = message["event"]
            except (ValueError, TypeError, KeyError):
                continue
            element = self.elements.get(number) if isinstance(number, int) else None
            handler = None if element is None else element.handler(str(event))
            if element is not None and handler is not None:
                self.spawn(self.handle(element, handler, value))

    async def handle(self, element: Element, handler: Handler, value: object) -> None:
        """Call a handler within the parent of its element."""
        with element.parent or self.root:
            await self.call(handler, value)

    def close(self) -> None:
        """Close the page."""
        if self.closed:
            return
        self.closed = True
        self._news.set()
        for end in self._ends:
            end()
        for task in self._tasks:
            task.cancel()


async def until_one_ends(*work: Coroutine[object, object, None]) -> None:
    """Hear and tell over a socket until one of them ends, as it does where the line is lost."""
    from starlette.websockets import WebSocketDisconnect

    both = [asyncio.create_task(one) for one in work]
    try:
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in both:
            task.cancel()
        for result in await asyncio.gather(*both, return_exceptions=True):
            if isinstance(result, Exception) and not isinstance(result, WebSocketDisconnect | RuntimeError):
                LOGGER.error("a page lost its line", exc_info=result)  # it comes back by itself


def _operations(records: list[tuple[str, Element]]) -> list[list[object]]:
    """Operations of a flush: a new or changed element is sent once, in its final state."""
    fresh = {element.number for kind, element in records if kind == "insert"}
    gone = {element.number for kind, element in records if kind == "remove"}

    def within(element: Element | None, among: set[int]) -> bool:
        while element is not None:
            if element.number in among:
                return True
            element = element.parent
        return False

    operations: list[list[object]] = []
    for kind, element in records:
        if within(element.parent, fresh):
            continue  # its place is told with all that is in it
        attached = element.number in element.document.elements or element.parent is None
        if kind == "insert":
            if attached and element.parent is not None:
                operations.append(["insert", element.parent.number, element.html()])
        elif element.number in fresh:
            continue
        elif kind == "remove":
            operations.append(["remove", element.number])
        elif kind == "clear":
            operations.append(["inside", element.number, ""])
        elif attached and element.number not in gone:
            if kind == "inside":
                operations.append(["inside", element.number, element.inside])
            elif changes := element.changes():
                operations.append(["attributes", element.number, changes])
    return operations


def place() -> Element:
    """Parent of new elements."""
    stack = _stack.get()
    if not stack:
        raise RuntimeError("an element was made outside of a page")
    return stack[-1]


def page_document() -> PageDocument:
    """Document under construction, or whose event is being handled."""
    return place().document


def call_script(name: str, *arguments: object) -> None:
    """Call a function of the page's scripts by its name; see `PageDocument.call_script`."""
    page_document().call_script(name, *arguments)


class Documents:
    """Documents of all pages of a server, by key; closed when their page does not reconnect."""

    def __init__(self) -> None:
        self._documents: dict[str, PageDocument] = {}
        self._ends: dict[str, asyncio.TimerHandle] = {}

    def open(self) -> PageDocument:
        """Create a document for a requested page."""
        document = PageDocument()
        self._documents[document.key] = document
        self._await(document)
        while len(self._documents) > MOST_DOCUMENTS:
            self._close(next((d for d in self._documents.values() if not d.connected), document))
        return document

    def find(self, key: str) -> PageDocument | None:
        """Document of a key."""
        return self._documents.get(key) if re.fullmatch(r"[\w-]{1,64}", key) else None

    async def serve(self, document: PageDocument, socket: WebSocket) -> None:
        """Serve a socket of a document until it closes, then wait for another one."""
        self._ends.pop(document.key).cancel() if document.key in self._ends else None
        try:
            await document.serve(socket)
        finally:
            if document.key in self._documents and not document.connected:
                self._await(document)

    def close_all(self) -> None:
        """Close all pages when the server ends."""
        for document in list(self._documents.values()):
            self._close(document)

    def _await(self, document: PageDocument) -> None:
        if document.key in self._ends:
            self._ends[document.key].cancel()
        self._ends[document.key] = asyncio.get_running_loop().call_later(AWAY, self._close, document)

    def _close(self, document: PageDocument) -> None:
        self._documents.pop(document.key, None)
        handle = self._ends.pop(document.key, None)
        if handle is not None:
            handle.cancel()
        document.close()
