"""Building blocks of the pages: frame, panels, buttons, lists, dialogs, messages; styled by ``static/lab.css``."""

from __future__ import annotations

import functools
import html
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import resources
from typing import TYPE_CHECKING, NamedTuple

from ..nomenclature import GLOSSARY
from ..report.blocks import unit_text
from ..report.figures.colours import style_sheet
from .elements import Element, PageDocument, call_script, page_document

if TYPE_CHECKING:
    from starlette.requests import Request

TITLE = "McKibben muscle test bench"


class Page(NamedTuple):
    """One of the pages; `extra` brings the package that announces it, where that is installed by itself."""

    path: str
    name: str
    module: str
    key: str
    extra: str = ""


PAGES = (
    Page("/", "Bench", "bench", "B"), Page("/fit", "Fit", "fit", "F"), Page("/compare", "Compare", "compare", "C"),
    Page("/energy", "Energy", "energy", "E"), Page("/circuit", "Circuit", "circuit", "I"),
    Page("/size", "Size", "size", "S"),
    Page("/paper", "The paper", "paper", "P", "papers"), Page("/recordings", "Recordings", "recordings", "R"),
)  # fmt: skip
SHEETS = ("tokens.css", "uplot/uPlot.min.css", "lab.css")
SCRIPTS = ("js/lab.js", "js/charts.js", "js/glossary.js")
HOME = "/static/lab"  # of the sheets and scripts; their modules name each other by relative paths


@functools.cache
def piece(name: str) -> str:
    """Text of a file of `static`."""
    return (resources.files(__package__) / "static" / name).read_text(encoding="utf-8")


def written(built: PageDocument) -> str:
    """HTML of a page that was built."""
    (page,) = (p for p in PAGES if p.module == built.module)
    return document(page, built.html(), sheets=built.sheets, scripts=built.scripts, key=built.key)


def document(
    page: Page, content: str, *, sheets: tuple[str, ...] = (), scripts: tuple[str, ...] = (), key: str = ""
) -> str:
    """HTML of a page."""
    tags = [f'<link rel="stylesheet" href="{HOME}/{s}">' for s in (*SHEETS, *sheets)]
    tags += [f'<script type="module" src="{HOME}/{s}"></script>' for s in (*SCRIPTS, *scripts)]
    early = (  # before anything is drawn, so that a dark page never begins light
        'const t=new URLSearchParams(location.search).get("theme")??sessionStorage.getItem("mckibben-theme");'
        'if(t==="dark"||t==="light")document.documentElement.dataset.theme=t;'
        'if((new URLSearchParams(location.search).get("projector")??sessionStorage.getItem("mckibben-projector"))==="1")'
        'document.documentElement.dataset.projector="1"'
    )
    tabs = [
        f'<a href="{p.path}" data-key="{p.key.lower()}"{" aria-current=page" if p == page else ""}>{html.escape(p.name)}</a>'
        for p in PAGES
    ]
    head = piece("head.html").replace("{tabs}", "".join(tabs)).replace("{names}", ", ".join(p.name for p in PAGES))
    head = head.replace("{keys}", " ".join(f"<kbd>{p.key}</kbd>" for p in PAGES))
    words = (
        f"<div><dt>{w}</dt><dd>{html.escape(e.sentence)} <i>docs/{e.page}.md</i></dd></div>"
        for w, e in GLOSSARY.items()
    )
    head = head.replace("{words}", "".join(words))
    body = f'data-document="{key}"' if key else 'class="raw"'
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{page.name} \u00b7 {TITLE}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="{HOME}/favicon.svg"><script>{early}</script><style>{style_sheet()}</style>{"".join(tags)}'
        f"</head><body {body}>"
        f'<script>document.body.dataset.page="{page.module}"</script>'
        f"{head}{content}</body></html>"
    )


def asked(request: Request, *names: str) -> dict[str, str]:
    """Parameters of a page's address, those of the given names only."""
    query: Mapping[str, str] = request.query_params
    return {n: query[n][:400] for n in names if n in query}


THIN = "\u2009\u2060"  # between a number and its unit
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
    module: str, sub: str = "", *, sheets: tuple[str, ...] = (), scripts: tuple[str, ...] = ()
) -> Iterator[Element]:
    """Build a page in the frame, with its name in a header; yields the header's place for buttons."""
    (one,) = (p for p in PAGES if p.module == module)
    built = page_document()
    built.module, built.sheets, built.scripts = module, sheets, ("js/elements.js", *scripts)
    with Element("div", "content").set(id="content", tabindex=-1) as main:
        with Element("div", "bar2"):
            with Element("h1"):
                text("span", one.name)
            text("span", sub, "sub")
            bar = Element("div", "row wrap").style(margin_left="auto")
    with main, Element("div", "page"):
        yield bar


box = Element  # for others


def text(tag: str, words: object, classes: str = "") -> Element:
    """Build an element of text."""
    return Element(tag, classes, words=words)


def raw(markup: str, tag: str = "div", classes: str = "") -> Element:
    """Add HTML generated by this program; text of users must be escaped before."""
    return Element(tag, classes, markup=markup)


@contextmanager
def panel(title: str = "", sub: str = "", step: int = 0) -> Iterator[Element]:
    """Build a panel with a heading; yields the heading's place for buttons, elements go into the body."""
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
    words: str,
    click: Callable[..., object] | None = None,
    *,
    primary: bool = False,
    small: bool = False,
    quiet: bool = False,
    key: str = "",
) -> Element:
    """Build a button; its label is a verb."""
    kinds = [k for k, on in (("pri", primary), ("s", small), ("q", quiet)) if on]
    markup = html.escape(words) + (f" <kbd>{html.escape(key)}</kbd>" if key else "")
    made = raw(markup, "button", " ".join(["btn", *kinds])).set(type="button")
    return made if click is None else made.on("click", click)


def segments(names: Mapping[str, str], chosen: str, change: Callable[[str], object], label: str) -> Element:
    """Build a row of buttons of which one is pressed: value -> label."""
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
    """Build a drop-down list: value -> label; a quantity's class (P, F, L, q, v) colours it."""
    with box("div", "field s"):
        with box("select", classes).set(aria_label=label) as one:
            for value, words in options.items():
                text("option", words).set(value=value, selected=value == chosen)
        one.on_value("change", lambda value: change(str(value)))
    return one


def check(words: str, on: bool, change: Callable[[bool], object]) -> Element:
    """Build a check box with a label."""
    with box("label", "row") as one:
        box("input").set(type="checkbox", checked=on).on_value("change", lambda value: change(bool(value)))
        text("span", words)
    return one


def ended(words: object) -> str:
    """Words with a full stop, where they do not ask."""
    said = str(words).rstrip(".")
    return f"{said}{'' if said.endswith('?') else '.'}"


def sentence(words: object) -> str:
    """Words with a capital and a full stop."""
    said = ended(words)
    return f"{said[:1].upper()}{said[1:]}"


def grouped(value: float | None, places: int = 2) -> str:
    """Number with fixed decimals, in groups of three, with a typographic minus; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "\u2013"
    digits = f"{abs(value):,.{places}f}".replace(",", "\u2009")
    return ("\u2212" if value < 0.0 and float(f"{value:.{places}f}") != 0.0 else "") + digits


def file_size(size: int) -> str:
    """Size of a file [B] as text."""
    return f"{size / 2**20:.3g}{THIN}MB" if size >= 2**20 else f"{max(size / 2**10, 0.1):.3g}{THIN}kB"


def note(words: str, kind: str = "caution") -> Element:
    """Build a caution (``caution``), or the reason of a stop (``stop``)."""
    with box("div", "note stop" if kind == "stop" else "note").set(role="note") as one:
        raw(SIGNS[kind], "span")
        text("span", words)
    return one


def empty(words: str, button_words: str = "", go: str | Callable[..., object] | None = None) -> Element:
    """Build an empty state: one sentence and a button; `go` is an address or a function called on a click."""
    with box("div", "empty") as one:
        text("p", words)
        if isinstance(go, str):
            text("a", button_words, "btn").set(href=go)
        elif go is not None:
            button(button_words, go)
    return one


def refused(words: str) -> Element:
    """Build a message beside what was refused."""
    with box("div", "err").set(role="alert") as one:
        raw(SIGNS["field"], "span")
        text("span", words)
    return one


def say_refused(place: Element, words: object) -> None:
    """Show in a place why something was refused, and nothing else; empty words leave it empty."""
    place.clear()
    if words:
        with place:
            refused(str(words))


@contextmanager
def loading(words: str, share: float | None = None, classes: str = "") -> Iterator[Element]:
    """Show work in progress with a moving line, or a line of the completed share; further elements go below."""
    with box("div", f"loading {classes}").set(role="status") as one, box("div"):
        text("span", words)
        moving = "<i></i>" if share is None else f'<i class="share" style="width:{100.0 * share:.0f}%"></i>'
        raw(moving, "div", "line")
        yield one


def table(
    columns: Sequence[str], rows: Sequence[Sequence[object]], *, right: Sequence[int] = (), name: str = ""
) -> Element:
    """Build a table; `right` are the columns of numbers."""
    # wider than a phone: who has no mouse scrolls it by the arrows
    one = box("div", "scroll-x").set(tabindex="0", role="group", aria_label=name)
    with one, box("table").set(aria_label=name):
        with box("thead"), box("tr"):
            for i, column in enumerate(columns):
                title, comma, unit = column.rpartition(", ")
                text("th", title + comma + (unit_text(unit) if comma else unit), "num" if i in right else "").set(
                    scope="col"
                )
        with box("tbody"):
            for row in rows:
                with box("tr"):
                    for i, value in enumerate(row):
                        text("td", value, "num" if i in right else "")
    return one


class Dialog:
    """A native dialog, which Esc closes while nothing moves; elements of its ``with`` block go into its body."""

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
        """Show the dialog."""
        self.answer("")
        call_script("openDialog", self._element.number)

    def close(self) -> None:
        """Hide the dialog."""
        call_script("closeDialog", self._element.number)
        if self._once:
            self._element.delete()

    def answer(self, words: str) -> None:
        """Show a message below the fields; an empty one removes it."""
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
        """Show messages here, and not at the end."""
        self._answer = box("div")


class TypedField:
    """A text field in a dialog: `value` is its text."""

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
        self._input.on_value("input", lambda value: setattr(self, "value", str(value)))
        if done is not None:
            self._input.on("enter", done)

    def set(self, value: str) -> None:
        """Set the text of the field."""
        self.value = value
        self._input.set(value=value)


def link(**state: object) -> None:
    """Set parameters of the page's address; None removes one."""
    call_script("link", state)


def tell(words: str) -> None:
    """Show a passing notice at the foot of the page."""
    call_script("tell", words)
