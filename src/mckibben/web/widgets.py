"""The building blocks of the pages: panels, buttons, lists, dialogs, sentences; their look is in ``static/lab.css``."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from .elements import Element, call_script
from .shell import PAGES, frame

SIGNS = {
    "caution": '<svg width="14" height="13" viewBox="0 0 12 11" aria-hidden="true"><path d="M6 .5l5.500 10H.500z" '
    'fill="var(--caution-edge)"/></svg>',
    "stop": '<svg width="13" height="13" viewBox="0 0 12 12" aria-hidden="true"><path d="M4 0h4l4 4v4l-4 4H4L0 8V4z" '
    'fill="var(--stop)"/></svg>',
    "field": '<svg width="13" height="13" aria-hidden="true"><circle cx="6.5" cy="6.5" r="6" fill="none" '
    'stroke="currentColor" stroke-width="1.3"/><path d="M6.5 3v4.500M6.5 9v1.500" stroke="currentColor" '
    'stroke-width="1.5"/></svg>',
}


@contextmanager
def page_frame(
    module: str, title: str = "", sub: str = "", *, sheets: tuple[str, ...] = (), scripts: tuple[str, ...] = ()
) -> Iterator[Element]:
    """A page in the shell, with its name in a bar; yields that bar's place for buttons.

    Args:
        module: of `pages`, which says which page it is.
        title: heading; the page's name where left out.
        sub: a few words beside it.
        sheets: further style sheets of `static`.
        scripts: further modules of `static`.
    """
    (one,) = (p for p in PAGES if p.module == module)
    frame(one, sheets=sheets, scripts=scripts)
    with Element("div", "content").set(id="content", tabindex=-1) as main:
        with Element("div", "bar2"):
            with Element("h1"):
                text("span", title or one.name)
            text("span", sub, "sub")
            bar = Element("div", "row wrap").style(margin_left="auto")
    with main, Element("div", "page"):
        yield bar


def box(tag: str, classes: str = "") -> Element:
    """An element that others are put into."""
    return Element(tag, classes)


def text(tag: str, words: object, classes: str = "") -> Element:
    """An element of text."""
    return Element(tag, classes, words=words)


def raw(markup: str, tag: str = "div", classes: str = "") -> Element:
    """HTML that this program wrote itself; never with anything of a user in it that is not escaped."""
    return Element(tag, classes, markup=markup)


@contextmanager
def panel(title: str = "", sub: str = "", step: int = 0) -> Iterator[Element]:
    """A panel with a heading, and inside its body; yields the heading's place for buttons."""
    with box("section", "panel") as one:
        if title:
            one.set(aria_label=title)
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


def button(
    words: str, click: Callable[..., object] | None = None, *, primary: bool = False, small: bool = False,
    quiet: bool = False, key: str = "",
) -> Element:  # fmt: skip
    """A button; its words are a verb."""
    kinds = [k for k, on in (("pri", primary), ("s", small), ("q", quiet)) if on]
    markup = html.escape(words) + (f" <kbd>{html.escape(key)}</kbd>" if key else "")
    made = raw(markup, "button", " ".join(["btn", *kinds])).set(type="button")
    return made if click is None else made.on("click", click)


def segments(names: Mapping[str, str], chosen: str, change: Callable[[str], object], label: str) -> Element:
    """A row of buttons of which one is pressed: value -> words."""
    buttons: dict[str, Element] = {}

    def choose(value: str) -> object:
        for name, element in buttons.items():
            element.set(aria_pressed="true" if name == value else "false")
        return change(value)

    with box("div", "seg s").set(role="group", aria_label=label) as one:
        for value, words in names.items():
            pressed = "true" if value == chosen else "false"
            buttons[value] = text("button", words).set(type="button", aria_pressed=pressed)
            buttons[value].on("click", lambda v=value: choose(v))
    return one


def select(
    options: Mapping[str, str], chosen: str, change: Callable[[str], object], label: str, classes: str = ""
) -> Element:
    """A list of which one is chosen: value -> words; a quantity's class (P, F, L, q, v) colours it."""
    with box("div", "field s"):
        with box("select", classes).set(aria_label=label) as one:
            for value, words in options.items():
                text("option", words).set(value=value, selected=value == chosen)
        one.on_value("change", lambda value: change(str(value)))
    return one


def check(words: str, on: bool, change: Callable[[bool], object], more: str = "") -> Element:
    """A box that is ticked or not, with words behind it, and more at the end of the line."""
    with box("label", "row") as one:
        box("input").set(type="checkbox", checked=on).on_value("change", lambda value: change(bool(value)))
        text("span", words)
        if more:
            text("span", more, "faint grow num")
    return one


def note(words: str, kind: str = "caution") -> Element:
    """A caution (``caution``), or what stopped something (``stop``)."""
    with box("div", "note stop" if kind == "stop" else "note").set(role="note") as one:
        raw(SIGNS[kind], "span")
        text("span", words)
    return one


def empty(words: str, button_words: str = "", go: str | Callable[..., object] | None = None) -> Element:
    """One sentence, and the button that fills the place; `go` is an address or what a click does."""
    with box("div", "empty") as one:
        text("p", words)
        if isinstance(go, str):
            text("a", button_words, "btn").set(href=go)
        elif go is not None:
            button(button_words, go)
    return one


def refused(words: str) -> Element:
    """A sentence beside what was refused."""
    with box("div", "err").set(role="alert") as one:
        raw(SIGNS["field"], "span")
        text("span", words)
    return one


@contextmanager
def loading(words: str, share: float | None = None, classes: str = "") -> Iterator[Element]:
    """What is being done, with a line that moves or shows how much of it is done; further elements go below."""
    with box("div", f"loading {classes}").set(role="status") as one, box("div"):
        text("span", words)
        moving = "<i></i>" if share is None else f'<i class="share" style="width:{100.0 * share:.0f}%"></i>'
        raw(moving, "div", "line")
        yield one


def table(
    columns: Sequence[str], rows: Sequence[Sequence[object]], *, right: Sequence[int] = (), name: str = ""
) -> Element:
    """A table; `right` are the columns of numbers."""
    with box("div", "scroll-x") as one, box("table").set(aria_label=name):
        with box("thead"), box("tr"):
            for i, column in enumerate(columns):
                text("th", column, "num" if i in right else "").set(scope="col")
        with box("tbody"):
            for row in rows:
                with box("tr"):
                    for i, value in enumerate(row):
                        text("td", value, "num" if i in right else "")
    return one


class Dialog:
    """A native dialog, which Esc closes while nothing moves; elements of its ``with`` block go into its body.

    Args:
        title: its heading.
        classes: further ones of the element.
        body: those of its body.
        once: take it out of the page when it is closed.
    """

    def __init__(self, title: str, classes: str = "ask", body: str = "bd stack", *, once: bool = False) -> None:
        self._once = once
        with box("dialog", classes).set(aria_label=title) as self._element:
            with box("div", "hd"):
                with box("h2"):
                    text("span", title)
                box("span", "grow")
                button("Close", self.close, small=True, quiet=True)
            self.body = box("div", body)
        if once:
            self._element.on("close", self._element.delete)
        self._answer: Element | None = None

    def __enter__(self) -> Dialog:
        self.body.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self.body.__exit__(*error)

    def open(self) -> None:
        """Show it."""
        self.answer("")
        call_script("openDialog", self._element.number)

    def close(self) -> None:
        """Take it away."""
        call_script("closeDialog", self._element.number)
        if self._once:
            self._element.delete()

    def answer(self, words: str) -> None:
        """A sentence below its fields; no words take it away."""
        if self._answer is None:
            if not words:
                return
            with self.body:
                self._answer = box("div")
        self._answer.clear()
        if words:
            with self._answer:
                refused(words)

    def place_for_answers(self) -> None:
        """Put sentences here, and not at the end."""
        self._answer = box("div")


class TypedField:
    """A field of words in a dialog: `value` is what stands in it."""

    def __init__(
        self, label: str, value: str = "", *, unit: str = "", about: str = "", done: Callable[[], object] | None = None
    ) -> None:
        self.value = value
        with box("label", "typed"):
            text("span", label)
            with box("span", "field s"):
                self._input = box("input").set(value=value, autocomplete="off")
                if unit:
                    text("span", unit, "u")
            if about:
                text("span", about, "about")
        self._input.on_value("input", self._typed)
        if done is not None:
            self._input.on("enter", done)

    def _typed(self, value: object) -> None:
        self.value = str(value)

    def set(self, value: str) -> None:
        """Put other words into it."""
        self.value = value
        self._input.set(value=value)


def link(**state: object) -> None:
    """Put parts of the view's state into the address of the page; None takes one out."""
    call_script("link", state)


def tell(words: str) -> None:
    """A line at the foot of the page that goes by itself."""
    call_script("tell", words)
