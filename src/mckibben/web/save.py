"""Figures saved from pages: the menu of a chart, and the file that the figures of the package draw of it."""

from __future__ import annotations

import asyncio
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ..documents import JsonValue, parse_json
from ..errors import InputError, MckibbenError
from .elements import Element
from .shelf import plain
from .transfers import download
from .widgets import tell

if TYPE_CHECKING:
    from ..report.figures.page_charts import Figure

FORMATS = ("svg", "pdf", "png")
QUANTITIES = ("pressure", "tension", "length", "flow", "valve")
_ONE = threading.Lock()  # settings of matplotlib are those of all threads
LARGEST_CHART = 16 * 2**20  # document that a browser sends [B]
MOST_VALUES = 400_000  # numbers of a chart that a browser sends to be drawn
Draw = Callable[[dict[str, Any] | None], "Figure"]
MakeFile = Callable[[str, object], tuple[str, bytes]]


def save_menu(name: str, draw: Draw | None = None, *, make: MakeFile | None = None) -> Element:
    """Build the menu of a chart, which its ``chartbox`` contains.

    Args:
        name: name of the chart, and of its file.
        draw: given the part that is shown, ``x`` and ``y`` with two numbers each, or None for all of it; draws the figure.
        make: in place of `draw`, makes the file of a name and a wish, see `figure_file`.
    """
    menu = Element("div", "savefig").set(data_name=name)

    def made(shown: str, wish: object) -> tuple[str, bytes]:
        return make(shown, wish) if make is not None else figure_file(shown, cast(Draw, draw), wish)

    async def save(wish: object) -> None:
        try:
            shown = menu.attributes()["data-name"]
            file, data = await asyncio.to_thread(made, shown, wish)
        except MckibbenError as error:
            tell(str(error))
            return
        download(file, data)

    return menu.on_value("save", save)


def saveable(head: Element, name: str, draw: Draw) -> Element:
    """Build the menu of the chart of a panel, in its heading.

    Args:
        head: place of the panel's buttons, as `widgets.panel` yields it.
        name: name of the chart.
        draw: draws the figure, see `save_menu`.
    """
    outer = head.parent
    while outer is not None and outer.tag != "section":
        outer = outer.parent
    if outer is not None:
        outer.classed("chartbox")
    with head:
        return save_menu(name, draw)


def figure_file(name: str, draw: Draw, wish: object) -> tuple[str, bytes]:
    """Draw a figure as a file.

    Args:
        name: name of the chart.
        draw: draws the figure, see `save_menu`.
        wish: ``format`` of `FORMATS`, ``width``, ``style``, and ``view``, the part that is shown; from a browser.

    Returns:
        Name and content of the file.

    Raises:
        InputError: if there is no such format, width or style.
    """
    from ..report.figures.formats import applied, named_style
    from ..report.figures.style import save

    chosen: Mapping[str, Any] = wish if isinstance(wish, Mapping) else {}
    suffix = str(chosen.get("format", ""))
    if suffix not in FORMATS:
        raise InputError("format", suffix[:20], known=FORMATS)
    style, width = str(chosen.get("style", "print"))[:20], str(chosen.get("width", "column"))[:20]
    with tempfile.TemporaryDirectory() as folder, _ONE, applied(named_style(style, width=width)):
        place = Path(folder) / f"{plain(name, 'chart').lower()}.{suffix}"
        save(draw(part_of(chosen.get("view"))), place)
        return place.name, place.read_bytes()


def part_of(view: object) -> dict[str, list[float]] | None:
    """Shown part of a chart as a browser states it; None for all of it, and for what is no part."""
    if not isinstance(view, Mapping):
        return None
    part = {}
    for axis in ("x", "y"):
        ends = view.get(axis)
        if isinstance(ends, list) and len(ends) == 2 and all(isinstance(v, int | float) for v in ends):
            part[axis] = [float(v) for v in ends]
    return part or None


def sent_figure(body: bytes) -> tuple[str, bytes]:
    """Draw a chart that a page sends as JSON, in the format, width and style that it asks for; see `figure_file`.

    Raises:
        InputError: if it is no chart, or there is no such format, width or style.
    """
    from ..report.figures.page_charts import chart_figure

    try:
        wish = parse_json(body)
    except ValueError:
        wish = {}
    chart = sent_chart(wish.get("chart") if isinstance(wish, dict) else None)
    return figure_file(chart["name"], lambda view: chart_figure(chart, view), wish)


def sent_chart(document: object) -> dict[str, JsonValue]:
    """Check the document of a chart that a script of a page has drawn from samples that it has.

    Raises:
        InputError: if it is no chart, or has too many values.
    """
    if not isinstance(document, Mapping):
        raise InputError("chart", None, "must be the document of a chart")
    if isinstance(document.get("charts"), list):
        name = str(document.get("name") or "charts")[:120]
        return {"name": name, "charts": [sent_chart(one) for one in document["charts"][:12]]}
    try:
        lines = [_line(line) for line in document["lines"]]
        axes = {axis: _axis(document[axis]) for axis in "xy"}
        marks = [{k: mark.get(k) for k in ("text", "x", "y", "stop")} for mark in document.get("marks", [])]
        chart = {"name": str(document["name"])[:120], **axes, "lines": lines, "marks": marks}
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InputError("chart", None, f"must be the document of a chart ({error})") from None
    if sum(len(line["x"]) for line in lines) > MOST_VALUES:
        raise InputError("chart", None, f"must have at most {MOST_VALUES} values")
    return chart


def _quantity(document: Mapping[str, Any]) -> str:
    quantity = str(document.get("quantity") or "")
    return quantity if quantity in QUANTITIES else ""


def _axis(axis: Mapping[str, Any]) -> dict[str, Any]:
    ends = {k: None if axis.get(k) is None else float(axis[k]) for k in ("low", "high")}
    return {
        "label": str(axis["label"])[:80],
        "unit": str(axis.get("unit") or "")[:40],
        "quantity": _quantity(axis),
        **ends,
    }


def _line(line: Mapping[str, Any]) -> dict[str, Any]:
    x, y = ([None if v is None else float(v) for v in line[axis]] for axis in ("x", "y"))
    if len(x) != len(y):
        raise ValueError("x and y differ in length")
    words = {
        "label": str(line.get("label") or "")[:80],
        "quantity": _quantity(line),
        "dash": str(line.get("dash") or "")[:4],
    }
    numbers = {"width": float(line.get("width", 1.75)), "opacity": float(line.get("opacity", 1.0))}
    flags = {"points": bool(line.get("points")), "line": bool(line.get("line", True)), "fill": bool(line.get("fill"))}
    return {"x": x, "y": y, **words, **numbers, **flags}
