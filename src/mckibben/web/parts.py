"""The components of the screen as NiceGUI elements with plain tags; their look stands in ``static/lab.css``.

Text is always text: what a user typed, or a file holds, never becomes HTML.
"""

from __future__ import annotations

import asyncio
import html
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import MckibbenError
from .shell import PAGES, frame

if TYPE_CHECKING:
    from nicegui.element import Element

PROGRESS = 0.25  # time between two words on how far a file is read [s]
AWAY = 5.0  # time for which a page may lose its line before what it reads is stopped [s]
SIGNS = {
    "caution": '<svg width="14" height="13" viewBox="0 0 12 11" aria-hidden="true"><path d="M6 .5l5.500 10H.500z" '
    'fill="var(--caution-edge)"/></svg>',
    "stop": '<svg width="13" height="13" viewBox="0 0 12 12" aria-hidden="true"><path d="M4 0h4l4 4v4l-4 4H4L0 8V4z" '
    'fill="var(--stop)"/></svg>',
    "field": '<svg width="13" height="13" aria-hidden="true"><circle cx="6.5" cy="6.5" r="6" fill="none" '
    'stroke="currentColor" stroke-width="1.3"/><path d="M6.5 3v4.500M6.5 9v1.500" stroke="currentColor" '
    'stroke-width="1.5"/></svg>',
}
_LINE = 'fill="none" stroke="var(--ink)"'
# Of a row of the reproduction, and of any other check: shape and word, never a colour alone.
VERDICTS = {
    "holds": ("holds", f'<path d="M1 7l4 4 7-9" {_LINE} stroke-width="2"/>'),
    "calibrated": (
        "holds, calibrated",
        '<circle cx="6.5" cy="6.5" r="6" fill="none" stroke="var(--ink-2)" stroke-dasharray="2 2"/>'
        f'<path d="M3 7l3 3 4-6" {_LINE} stroke-width="1.6"/>',
    ),
    "misprint": ("misprint, corrected", f'<path d="M6.5 1l6 11H.5z" {_LINE} stroke-width="1.5"/>'),
    "open": ("open", f'<circle cx="6.5" cy="6.5" r="5" {_LINE} stroke-width="1.6"/>'),
    "synthetic": ("synthetic", f'<path d="M6.5 0l6.5 6.5L6.5 13 0 6.5z" {_LINE} stroke-width="1.5"/>'),
    "short": ("falls short", '<path d="M4 0h5l4 4v5l-4 4H4L0 9V4z" fill="var(--stop)"/>'),
    "to come": ("to come", '<path d="M1 7h2M5.5 7h2M10 7h2" stroke="var(--ink-2)" stroke-width="2"/>'),
}


@contextmanager
def page(module: str, title: str = "", sub: str = "", **frame_options: Any) -> Iterator[Element]:
    """A page in the shell, with its name in a bar; yields that bar's place for buttons.

    Args:
        module: of `pages`, which says which page it is.
        title: heading; the page's name where left out.
        sub: a few words beside it.
        **frame_options: of `shell.frame`.
    """
    (one,) = (p for p in PAGES if p.module == module)
    frame(one, **frame_options)
    with box("div", "content").props("id=content tabindex=-1") as main:
        with box("div", "bar2"):
            with box("h1"):
                text("span", title or one.name)
            text("span", sub, "sub")
            bar = box("div", "row wrap").style("margin-left:auto")
    with main, box("div", "page"):
        yield bar


def box(tag: str, classes: str = "") -> Element:
    """An element that others are put into."""
    from nicegui import ui

    return ui.element(tag).classes(classes)


def text(tag: str, words: Any, classes: str = "") -> Element:
    """An element of text."""
    from .components import markup_type

    return markup_type()(html.escape(str(words)), tag=tag, sanitize=False).classes(classes)


def raw(markup: str, tag: str = "div", classes: str = "") -> Element:
    """HTML that this program wrote itself; never with anything of a user in it that is not escaped."""
    from .components import markup_type

    return markup_type()(markup, tag=tag, sanitize=False).classes(classes)


@contextmanager
def panel(title: str = "", sub: str = "", step: int = 0) -> Iterator[Element]:
    """A panel with a heading, and inside its body; yields the heading's place for buttons."""
    with box("section", "panel") as one:
        if title:
            one.props(f'aria-label="{html.escape(title)}"')
            with box("div", "hd"):
                if step:
                    text("span", step, "step")
                with box("h2"):
                    text("span", title)
                    if sub:
                        text("small", sub)
                box("span", "grow")
                head = box("div", "row")
        else:
            head = box("div")
        with box("div", "bd"):
            yield head


def on_value(element: Element, event: str, do: Callable[[Any], Any], throttle: float = 0.0) -> None:
    """Listen to an event that carries a value; see `components.on_value`."""
    from .components import on_value

    on_value(element, event, do, throttle)


def call(name: str, *given: Any) -> None:
    """Call a function of the page by its name; see `components.call`."""
    from .components import call

    call(name, *given)


def button(words: str, click: Callable[..., Any] | None = None, *, primary: bool = False, small: bool = False,
           quiet: bool = False, key: str = "") -> Element:  # fmt: skip
    """A button; its words are a verb."""
    kinds = [k for k, on in (("pri", primary), ("s", small), ("q", quiet)) if on]
    markup = html.escape(words) + (f" <kbd>{html.escape(key)}</kbd>" if key else "")
    found = raw(markup, "button", " ".join(["btn", *kinds])).props("type=button")
    return found if click is None else found.on("click", lambda: click())


def segments(names: Mapping[str, str], chosen: str, change: Callable[[str], Any], label: str) -> Element:
    """A row of which one is pressed: value -> words."""
    with box("div", "seg s").props(f'role=group aria-label="{html.escape(label)}"') as one:
        all_: dict[str, Element] = {}

        def choose(value: str) -> None:
            for name, b in all_.items():
                b.props(f"aria-pressed={'true' if name == value else 'false'}")
            change(value)

        for value, words in names.items():
            all_[value] = text("button", words).props(
                f"type=button aria-pressed={'true' if value == chosen else 'false'}"
            )
            all_[value].on("click", lambda v=value: choose(v))
    return one


def select(
    options: Mapping[str, str], chosen: str, change: Callable[[str], Any], label: str, classes: str = ""
) -> Element:
    """A list of which one is chosen: value -> words; a quantity's class (P, F, L, q, v) colours it."""
    with box("div", "field s"):
        with box("select", classes).props(f'aria-label="{html.escape(label)}"') as one:
            for value, words in options.items():
                item = text("option", words).props(f'value="{html.escape(value)}"')
                if value == chosen:
                    item.props("selected")
        on_value(one, "lab-change", lambda e: change(str(e.args)))
    return one


def check(words: str, on: bool, change: Callable[[bool], Any], more: str = "") -> Element:
    """A box that is ticked or not, with words behind it, and more at the end of the line."""
    with box("label", "row") as one:
        ticked = box("input").props("type=checkbox" + (" checked" if on else ""))
        on_value(ticked, "lab-change", lambda e: change(bool(e.args)))
        text("span", words)
        if more:
            text("span", more, "faint grow num")
    return one


def note(words: str, kind: str = "caution") -> Element:
    """A caution (``caution``), or what stopped something (``stop``)."""
    with box("div", "note stop" if kind == "stop" else "note").props("role=note") as one:
        raw(SIGNS[kind], "span")
        text("span", words)
    return one


def empty(words: str, button_words: str = "", go: str | Callable[..., Any] | None = None) -> Element:
    """One sentence, and the button that fills the place; `go` is an address or what a click does."""
    with box("div", "empty") as one:
        text("p", words)
        if isinstance(go, str):
            text("a", button_words, "btn").props(f'href="{html.escape(go)}"')
        elif go is not None:
            button(button_words, go)
    return one


def verdict(kind: str, words: str = "") -> Element:
    """A sign of `VERDICTS` with its word."""
    own, sign = VERDICTS[kind]
    markup = (
        f'<svg width="13" height="13" viewBox="0 0 13 13" aria-hidden="true">{sign}</svg>{html.escape(words or own)}'
    )
    return raw(markup, "span", "verdict")


def table(columns: Sequence[str], rows: Sequence[Sequence[Any]], *, right: Sequence[int] = (), name: str = "",
          pick: Callable[[int], Any] | None = None, chosen: int | None = None) -> Element:  # fmt: skip
    """A table; `right` are the columns of numbers, `pick` is told the row that is clicked or entered."""
    with box("div", "scroll-x") as one, box("table").props(f'aria-label="{html.escape(name)}"'):
        with box("thead"), box("tr"):
            for i, column in enumerate(columns):
                text("th", column, "num" if i in right else "").props("scope=col")
        with box("tbody"):
            for n, row in enumerate(rows):
                with box("tr", "sel" if n == chosen else "") as line:
                    if pick is not None:
                        line.classes("pick").props("tabindex=0")
                        line.on("click", lambda n=n: pick(n)).on("keydown.enter", lambda n=n: pick(n))
                    for i, value in enumerate(row):
                        text("td", value, "num" if i in right else "")
    return one


async def doing(place: Element, words: str, work: Callable[..., Any], *given: Any) -> Any:
    """Do what takes a while in another thread; `place` keeps its size and says what is done.

    Returns:
        What `work` returns; None where it was refused, with the sentence in the place.
    """
    place.clear()
    with place, box("div", "loading").props("role=status"):
        with box("div"):
            text("span", words)
            raw("<i></i>", "div", "line")
    try:
        found = await asyncio.to_thread(work, *given)
    except MckibbenError as error:
        place.clear()
        with place:
            refused(str(error))
        return None
    place.clear()
    return found


def refused(words: str) -> Element:
    """A sentence beside what was refused."""
    with box("div", "err").props("role=alert") as one:
        raw(SIGNS["field"], "span")
        text("span", words)
    return one


async def read_with_progress(
    place: Element, words: str, work: Callable[..., Any], path: Path, *given: Any, passes: int = 1
) -> Any:
    """Read a file, in a process of its own where it is large; `place` says how far it is, and has a button that stops it.

    A page that is left for longer than `AWAY` stops it too.

    Args:
        place: keeps its size; empty afterwards.
        words: that say what is done.
        work: function of a module that is given the path and `given`.
        path: the file.
        given: further arguments.
        passes: how often the function reads the file.

    Raises:
        MckibbenError: as `work` does, or that it was stopped.
    """
    from nicegui import context

    from .reader import ReaderProcess, is_small

    place.clear()
    if is_small(path):
        with place, box("div", "loading").props("role=status"), box("div"):
            text("span", words)
            raw("<i></i>", "div", "line")
        try:
            return await asyncio.to_thread(work, path, *given)
        finally:
            place.clear()
    one, client = ReaderProcess(work, path, *given, passes=passes), context.client
    with place, box("div", "reading").props("role=status"):
        said = raw(html.escape(words), "span")
        line = raw("<i></i>", "div", "line")
        button("Stop reading", one.stop, small=True)
    done = asyncio.ensure_future(asyncio.to_thread(one.result))
    away = 0.0
    try:
        while not (await asyncio.wait({done}, timeout=PROGRESS))[0]:
            away = 0.0 if client.has_socket_connection else away + PROGRESS
            if away > AWAY or client.is_deleted:
                one.stop()
                continue
            left = "" if one.left is None else f", about {one.left:.0f}\u2009\u2060s left"
            said.set_content(html.escape("Waiting for another file" if one.waits else f"{words}{left}"))  # type: ignore[attr-defined]
            line.set_content(f'<i style="width:{100.0 * one.share:.0f}%"></i>')  # type: ignore[attr-defined]
        return done.result()
    finally:
        one.stop()
        if not client.is_deleted:
            place.clear()


class Incoming:
    """A file that a page sent: its name and a copy of its own, which is there until `close`, or until nobody has it."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.path = name, folder / f"given{Path(name).suffix.lower()}"
        self.close = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    def content(self) -> bytes:
        """All of it; for small ones."""
        return self.path.read_bytes()


def upload(words: str, take: Callable[[Incoming], Any], endings: Sequence[str]) -> Element:
    """A place to drop a file, or to choose one; `take` is given it, and may raise `InputError`."""
    from .components import file_picker_type
    from .shelf import LARGEST, check_size, fitting

    too_large = (
        f"the file has another ending than {', '.join(endings)}, or more than {LARGEST >> 20} MB; nothing was stored"
    )
    with box("div", "drop") as one:
        with box("div", "grow"):
            text("span", words)
            said = box("div")
        file = file_picker_type()(auto_upload=True, max_file_size=LARGEST, on_rejected=lambda: answer(too_large)).props(
            f'accept="{",".join(endings)}"'
        )
        file.style("display:none")
        button("Choose", lambda: file.run_method("pickFiles"), small=True)

    def answer(sentence: str) -> None:
        said.clear()
        with said:
            refused(sentence)

    async def came(event: Any) -> None:
        said.clear()
        try:
            check_size(event.file.name, event.file.size(), LARGEST)
            one = Incoming(fitting(event.file.name), Path(tempfile.mkdtemp(prefix="mckibben-")))
            await event.file.save(one.path)
            event.file = None  # the copy that the framework keeps goes
            done = take(one)
            if asyncio.iscoroutine(done):
                await done
        except MckibbenError as error:
            answer(str(error))
        finally:
            file.reset()

    file.on_upload(came)
    return one.props(f"data-takes={file.id}")


def link(**state: Any) -> None:
    """Put parts of the view's state into the address of the page; None takes one out."""
    call("link", state)


def tell(words: str) -> None:
    """A line at the foot of the page that goes by itself."""
    call("tell", words)


def download(name: str, data: bytes) -> None:
    """Let the browser save something."""
    from nicegui import ui

    ui.download.content(data, name)
