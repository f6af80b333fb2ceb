"""Charts of columns, drawn by uPlot in the colours, dashes and markers of the quantities, and the figures saved from them.

A chart has a name, a summary and a table of its values. A line alone on its axes is solid; with other quantities it takes
the dash of its own; with other recordings of the same quantity the dash tells the recording, and a letter names it.
"""

from __future__ import annotations

import asyncio
import dataclasses
import html
import json
import math
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

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
    """Build the menu of the chart of a panel, in its heading."""
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
    """Draw a chart that a page sends as JSON, in the format, width and style that it asks for; see `figure_file`."""
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
    ends = (None if axis.get(k) is None else float(axis[k]) for k in ("low", "high"))
    return dataclasses.asdict(Axis(str(axis["label"])[:80], str(axis.get("unit") or "")[:40], _quantity(axis), *ends))


def _line(line: Mapping[str, Any]) -> dict[str, Any]:
    x, y = ([None if v is None else float(v) for v in line[axis]] for axis in ("x", "y"))
    if len(x) != len(y):
        raise ValueError("x and y differ in length")
    words = {"label": str(line.get("label") or "")[:80], "dash": str(line.get("dash") or "")[:4]}
    numbers = {"width": float(line.get("width", 1.75)), "opacity": float(line.get("opacity", 1.0))}
    flags = {"points": bool(line.get("points")), "line": bool(line.get("line", True)), "fill": bool(line.get("fill"))}
    return {"x": x, "y": y, "quantity": _quantity(line), **words, **numbers, **flags}


# Dashes of recordings of the same quantity.
LETTERS = {"A": [], "B": [6, 3], "C": [2, 3], "D": [10, 3, 2, 3], "E": [14, 4], "F": [6, 3, 2, 3, 2, 3]}
MOST = 4000  # points of a line that are sent


@dataclass(frozen=True)
class Axis:
    """An axis.

    Attributes:
        label: title of the chart.
        unit: as text; it stands once, in the title.
        quantity: one of `save.QUANTITIES`, which colours the title; ink by default.
        low: where it begins; from the values by default.
        high: where it ends.
    """

    label: str
    unit: str = ""
    quantity: str = ""
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class ChartLine:
    """A line or cloud of points; its x need not increase, so that it can be a loop.

    Attributes:
        x: (n,) in the axis's unit.
        y: (n,).
        label: at its end; nothing by default.
        quantity: its colour; ink by default.
        dash: ``own`` of the quantity, a letter of `LETTERS`, or nothing: solid.
        width: [px].
        points: draw the quantity's markers.
        line: draw the line.
        fill: shade what it encloses.
        opacity: opacity of all of it.
        course: time, x and y (m,) of all that the line is a part of, on the axis of the charts over time, whose cursor and
            zoom it follows; none by default.
    """

    x: Sequence[float] | np.ndarray
    y: Sequence[float] | np.ndarray
    label: str = ""
    quantity: str = ""
    dash: str = ""
    width: float = 1.75
    points: bool = False
    line: bool = True
    fill: bool = False
    opacity: float = 1.0
    course: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None


@dataclass(frozen=True)
class Mark:
    """A mark: ``x`` (a vertical line), ``y`` (a horizontal line), or a text at a point."""

    text: str
    x: float | None = None
    y: float | None = None
    stop: bool = False


@dataclass(frozen=True)
class Chart:
    """Content of a chart.

    Attributes:
        name: name of it, for everybody.
        summary: in a sentence, for who cannot see it.
        x: axis.
        y: axis.
        lines: in the order in which they are drawn.
        marks: notes.
        height: [px].
    """

    name: str
    summary: str
    x: Axis
    y: Axis
    lines: Sequence[ChartLine]
    marks: Sequence[Mark] = field(default_factory=tuple)
    height: int = 280

    def document(self) -> dict[str, JsonValue]:
        """JSON document for the browser; long lines are thinned, their extremes kept."""
        lines = []
        for line in self.lines:
            x, y = map(plain_numbers, thinned(np.asarray(line.x, float), np.asarray(line.y, float)))
            course = None
            if line.course is not None:
                time, *places = line.course
                *places, time = thinned(*places, time)
                course = [plain_numbers(v) for v in (time, *places)]
            plain = dataclasses.asdict(dataclasses.replace(line, x=[], y=[], course=None))
            lines.append({**plain, "x": x, "y": y, "course": course})
        return {
            "name": self.name,
            "summary": self.summary,
            "x": dataclasses.asdict(self.x),
            "y": dataclasses.asdict(self.y),
            "lines": lines,
            "marks": [dataclasses.asdict(m) for m in self.marks],
            "height": self.height,
            "dashes": LETTERS,
        }

    def figure(self, view: dict[str, JsonValue] | None = None) -> Figure:
        """Draw the chart, or the part ``x`` and ``y`` of it, as a figure."""
        from ..report.figures.page_charts import chart_figure

        return chart_figure(self.document(), view)

    def show(self) -> ChartPlace:
        """Add the chart to the page; replace it with `update`."""
        return ChartPlace(self)

    def markup(self) -> str:
        """Element that the browser draws into."""
        spec = html.escape(json.dumps(self.document(), separators=(",", ":"), allow_nan=False))
        label = html.escape(f"{self.name}. {self.summary}")
        return f'<figure class="chart" role="group" aria-label="{label}" data-chart="{spec}"></figure>'


class ChartPlace(Element):
    """The place of a chart on a page, with the menu that saves it as a figure."""

    def __init__(self, chart: Chart | None = None, classes: str = "") -> None:
        super().__init__("div", f"chartbox {classes}")
        self.chart = chart
        with self:
            self.picture = Element("div", markup="" if chart is None else chart.markup())
            self.menu = save_menu("chart" if chart is None else chart.name, self._figure)
        self.menu.set(hidden=chart is None)

    def _figure(self, view: dict[str, Any] | None) -> Figure:
        assert self.chart is not None
        return self.chart.figure(view)


def update(place: ChartPlace, chart: Chart) -> None:
    """Replace a chart."""
    place.chart = chart
    place.picture.put(chart.markup())
    place.menu.set(hidden=None, data_name=chart.name)


def thinned(*columns: np.ndarray, most: int = MOST) -> tuple[np.ndarray, ...]:
    """Thin a line to a number of points: of every section the ends and the extremes of x and y, its first two columns."""
    n = len(columns[0])
    if n <= most:
        return columns
    edges = np.linspace(0, n, most // 6 + 1).astype(int)
    keep = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        part = [f(v[a:b]) for v in columns[:2] if np.isfinite(v[a:b]).any() for f in (np.nanargmin, np.nanargmax)]
        keep += sorted({a, b - 1, *(a + int(i) for i in part)})
    return tuple(column[keep] for column in columns)


def plain_numbers(values: Any, digits: int = 7) -> list[float | None]:
    """Numbers for JSON, with so many digits; None for what is not finite."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(values, float).tolist()]
