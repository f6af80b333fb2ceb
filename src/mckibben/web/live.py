"""The socket of a page: it receives actions, and sends state, messages and samples, at most 60 times a second."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from ..documents import JsonValue, parse_json
from .identity import PageRegistry
from .workspace import Workspace

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

LOGGER = logging.getLogger(__name__)
TICK = 1.0 / 60.0  # time between two looks at what is new [s]
BEAT = 0.1  # time between two states while something moves [s]
LONGEST = 200_000  # characters of an action
FIRST = 10.0  # time for which a new line may say nothing [s]
RATE, BURST = 200.0, 400.0  # messages of a page per second, and at once, beyond which they are read later
AT_ONCE = 32  # actions of a page that are not answered yet, beyond which more get an error; stops have their own count
STOPS = ("emergency_stop", "stop")
SILENT, REPLACED = 4408, 4409  # codes with which a line is closed, beside those of `guard`
_STOPS = ThreadPoolExecutor(2, thread_name_prefix="stop")  # nothing else may keep a stop waiting
_ACTS = ThreadPoolExecutor(4, thread_name_prefix="act")


async def stop_at_once(workspace: Workspace, reason: str) -> str:
    """Press the emergency stop for a client without a page; return the answer."""
    loop = asyncio.get_running_loop()
    answer = await loop.run_in_executor(_STOPS, workspace.act, "nobody", "emergency_stop", {"reason": reason})
    return str(answer["said"])


class Lines:
    """Sockets of all pages; every page has an identity, and one socket.

    Args:
        workspace: state of the server.
        served: address and version, for the footer.
    """

    def __init__(self, workspace: Workspace, served: dict[str, str]) -> None:
        self.workspace, self.served, self.registry = workspace, served, PageRegistry()
        self._open: dict[str, PageConnection] = {}
        self._ending: set[asyncio.Task[None]] = set()

    async def run(self, socket: WebSocket) -> None:
        """Serve an accepted socket until it closes."""
        from starlette.websockets import WebSocketDisconnect

        try:
            hello = _read(await asyncio.wait_for(socket.receive_text(), FIRST))
        except TimeoutError:
            await socket.close(SILENT, f"This line said nothing for {FIRST:.0f} s.")
            return
        except WebSocketDisconnect:
            return
        page, secret = self.registry.admit(str(hello.get("secret", ""))[:100])
        line = PageConnection(socket, self.workspace, page, lambda: self.registry.confirm(page))
        line.remember(hello)
        before, self._open[page] = self._open.get(page), line
        if before is not None:  # a line that the page lost, of which the server has not heard
            ending = asyncio.create_task(before.end(REPLACED, "The page has another line now."))
            self._ending.add(ending)
            ending.add_done_callback(self._ending.discard)
        try:
            await line.run({"page": page, "secret": secret, "saved": self._saved(hello), **self.served})
        finally:
            if self._open.get(page) is line:
                del self._open[page]

    def _saved(self, hello: dict[str, JsonValue]) -> str | None:
        """Name of the file into which an earlier server saved its run, for a page that was connected to it."""
        if not hello.get("server") or hello["server"] == self.workspace.server:
            return None
        return self.workspace.saved_before(str(hello.get("file") or ""))


class PageConnection:
    """Connection of one page.

    Args:
        socket: accepted.
        workspace: state of the server.
        page: public name of its identity.
        confirmed: called when the page has its new secret.
    """

    def __init__(
        self, socket: WebSocket, workspace: Workspace, page: str, confirmed: Callable[[], None] = lambda: None
    ) -> None:
        self.socket, self.workspace, self.page, self._confirmed = socket, workspace, page, confirmed
        self.stream = False
        self._seen, self._told = (0, 0), 0
        self._moving, self._stops, self._acts = False, 0, 0
        self._kept: dict[str, Any] = {}

    def remember(self, hello: dict[str, JsonValue]) -> None:
        """Store what the page has already; a page of another server has nothing."""
        self.stream = bool(hello.get("stream"))
        if hello.get("server") == self.workspace.server:
            self._seen = (_whole(hello.get("epoch")), _whole(hello.get("seen")))
            self._told = _whole(hello.get("log"))

    async def run(self, hello: dict[str, JsonValue]) -> None:
        """Greet the page, and serve it until its socket closes."""
        from starlette.websockets import WebSocketDisconnect

        await self._send({"type": "hello", "server": self.workspace.server, **hello})
        self.workspace.control.join(self.page)
        self.workspace.changed()
        both = [asyncio.create_task(self._hear()), asyncio.create_task(self._tell())]
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in both:
                task.cancel()
            for one in await asyncio.gather(*both, return_exceptions=True):
                if isinstance(one, Exception) and not isinstance(one, WebSocketDisconnect | RuntimeError):
                    LOGGER.error("a page lost its line", exc_info=one)  # it comes back by itself
            self.workspace.control.leave(self.page)
            self.workspace.changed()

    async def end(self, code: int, reason: str) -> None:
        """Close the socket."""
        from starlette.websockets import WebSocketDisconnect

        with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # it is closed
            await self.socket.close(code, reason)

    async def _hear(self) -> None:
        loop = asyncio.get_running_loop()
        tasks: set[asyncio.Task[None]] = set()
        budget, last = BURST, loop.time()
        while True:
            text = await self.socket.receive_text()
            now = loop.time()
            budget, last = min(BURST, budget + (now - last) * RATE) - 1.0, now
            await asyncio.sleep(max(0.0, -budget / RATE))  # others have their turn after every message
            asked = _read(text) if len(text) <= LONGEST else {}
            if "kept" in asked:
                self._confirmed()
                continue
            if "shown" in asked:
                # what is drawn after somebody wanted a stop lets the machine go no further
                if not self._stops:
                    self.workspace.shown(self.page, _whole(asked.get("epoch")), _whole(asked["shown"]))
                continue
            action, words = str(asked.get("act", "")), asked.get("words")
            arguments = {str(k): v for k, v in words.items()} if isinstance(words, dict) else {}
            stops = action in STOPS
            if (self._stops if stops else self._acts) >= AT_ONCE:
                said = f"too many requests: {AT_ONCE} of this page have no answer yet"
                await self._send({"type": "answer", "id": asked.get("id"), "ok": False, "said": said})
                continue
            self._stops += stops
            self._acts += not stops
            future = loop.run_in_executor(_STOPS if stops else _ACTS, self.workspace.act, self.page, action, arguments)
            task = asyncio.create_task(self._answer(asked.get("id"), future, stops))
            tasks.add(task)
            task.add_done_callback(tasks.discard)

    async def _answer(self, number: Any, future: Any, stops: bool) -> None:
        try:
            answer = await future
            await self._send({"type": "answer", "id": number, **answer})
        finally:  # with its answer taken, so that who reads none cannot have any number of them made
            self._stops -= stops
            self._acts -= not stops

    async def _send(self, message: dict[str, JsonValue]) -> None:
        await self._put(json.dumps(message, separators=(",", ":"), default=float))

    async def _put(self, text: str) -> None:
        from starlette.websockets import WebSocketDisconnect

        try:
            await self.socket.send_text(text)
        except (WebSocketDisconnect, RuntimeError):
            pass  # its listener ends

    async def _tell(self) -> None:
        machine, stream, clock = self.workspace.machine, self.workspace.machine.stream, asyncio.get_running_loop().time
        version, beat = None, 0.0
        while True:
            if self.workspace.version != version or (self._moving and clock() - beat > BEAT):
                version, beat = self.workspace.version, clock()
                await self._new(machine, stream)
            if self.stream:
                data, epoch, count = stream.frame(*self._seen)
                if data:
                    await self.socket.send_bytes(data)
                self._seen = (epoch, count)
            await asyncio.sleep(TICK)

    async def _new(self, machine: Any, stream: Any) -> None:
        status = self.workspace.told()
        self._moving = '"moving":true' in status
        for name, part in machine.describe().items():
            if self._kept.get(name) is not part:
                self._kept[name] = part
                await self._send({"type": "part", "name": name, "part": part})
        for kind, one in (("epoch", stream.head()), ("toasts", self.workspace.toasts.plain())):
            key = [(t["number"], t["waits"]) for t in one] if kind == "toasts" else one
            if self._kept.get(kind) != key:
                self._kept[kind] = key
                await self._send({"type": kind, kind: one})
        await self._put(f'{{"type":"status","status":{status}}}')
        log = machine.log(self._told)
        if log:
            self._told = log[-1]["number"]
            await self._send({"type": "log", "log": log})


def _read(text: str) -> dict[str, JsonValue]:
    """An object of JSON; nothing if it is something else."""
    try:
        message = parse_json(text[:LONGEST])
    except (ValueError, RecursionError):
        return {}
    return message if isinstance(message, dict) else {}


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53 else 0
