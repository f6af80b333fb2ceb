"""The frame of every page: top bar with the pages, state block and emergency stop; footer; keys; theme."""

from __future__ import annotations

import functools
import html
from collections.abc import Mapping
from importlib import resources
from typing import TYPE_CHECKING, NamedTuple

from ..report.figures.colours import style_sheet
from .elements import PageDocument, page_document

if TYPE_CHECKING:
    from starlette.requests import Request

TITLE = "McKibben muscle test bench"


class Page(NamedTuple):
    """One of the pages.

    Attributes:
        path: path of its address.
        name: in the top bar.
        module: module of `pages` that builds it.
        key: that leads there after G.
    """

    path: str
    name: str
    module: str
    key: str


PAGES = (
    Page("/", "Bench", "bench", "B"), Page("/fit", "Fit", "fit", "F"), Page("/compare", "Compare", "compare", "C"),
    Page("/energy", "Energy", "energy", "E"), Page("/circuit", "Circuit", "circuit", "I"),
    Page("/size", "Size", "size", "S"),
    Page("/paper", "The paper", "paper", "P"), Page("/recordings", "Recordings", "recordings", "R"),
)  # fmt: skip
SHEETS = ("tokens.css", "uplot/uPlot.min.css", "lab.css")
SCRIPTS = ("js/lab.js", "js/charts.js")
HOME = "/static/lab"  # of the sheets and scripts; their modules name each other by relative paths


@functools.cache
def piece(name: str) -> str:
    """Text of a file of `static`."""
    return (resources.files(__package__) / "static" / name).read_text(encoding="utf-8")


def frame(page: Page, *, sheets: tuple[str, ...] = (), scripts: tuple[str, ...] = ()) -> None:
    """Set the frame of the page under construction.

    Args:
        page: the page.
        sheets: further style sheets of `static`.
        scripts: further modules of `static`.
    """
    built = page_document()
    built.module, built.sheets, built.scripts = page.module, sheets, ("js/elements.js", *scripts)


def written(built: PageDocument) -> str:
    """HTML of a page that was built."""
    (page,) = (p for p in PAGES if p.module == built.module)
    return document(page, built.html(), sheets=built.sheets, scripts=built.scripts, key=built.key)


def document(
    page: Page, content: str, *, sheets: tuple[str, ...] = (), scripts: tuple[str, ...] = (), key: str = ""
) -> str:
    """HTML of a page.

    Args:
        page: the page.
        content: HTML between top bar and footer.
        sheets: further style sheets of `static`.
        scripts: further modules of `static`.
        key: key of its document; nothing for a page whose content is drawn by scripts of its own.
    """
    body = f' data-document="{key}"' if key else ' class="raw"'
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{page.name} \u00b7 {TITLE}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="{HOME}/favicon.svg">{_head(sheets, scripts)}</head>'
        f"<body{body}>{_mark(page)}{_around(page)}{content}</body></html>"
    )


def _head(sheets: tuple[str, ...], scripts: tuple[str, ...]) -> str:
    tags = [f'<link rel="stylesheet" href="{HOME}/{s}">' for s in (*SHEETS, *sheets)]
    tags += [f'<script type="module" src="{HOME}/{s}"></script>' for s in (*SCRIPTS, *scripts)]
    early = (  # before anything is drawn, so that a dark page never begins light
        'const t=new URLSearchParams(location.search).get("theme")??sessionStorage.getItem("mckibben-theme");'
        'if(t==="dark"||t==="light")document.documentElement.dataset.theme=t;'
        'if((new URLSearchParams(location.search).get("projector")??sessionStorage.getItem("mckibben-projector"))==="1")'
        'document.documentElement.dataset.projector="1"'
    )
    return f"<script>{early}</script><style>{style_sheet()}</style>{''.join(tags)}"


def _mark(page: Page) -> str:
    return f'<script>document.body.dataset.page="{page.module}"</script>'


def _around(page: Page) -> str:
    tabs = [f'<a href="{p.path}"{" aria-current=page" if p == page else ""}>{html.escape(p.name)}</a>' for p in PAGES]
    return piece("head.html").replace("{tabs}", "".join(tabs))


def asked(request: Request, *names: str) -> dict[str, str]:
    """Parameters of a page's address, those of the given names only."""
    query: Mapping[str, str] = request.query_params
    return {n: query[n][:400] for n in names if n in query}
