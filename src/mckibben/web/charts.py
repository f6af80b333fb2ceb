"""Charts of columns: uPlot draws them in the browser, in the colours, dashes and markers of the quantities.

A chart has a name, a summary and a table of its values. A line alone on its axes is solid; with other quantities it takes
the dash of its own; with other recordings of the same quantity the dash tells the recording, and a letter names it.
"""

from __future__ import annotations

import dataclasses
import html
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..documents import JsonValue
from .elements import Element
from .save import save_menu

if TYPE_CHECKING:
    from ..report.figures.page_charts import Figure

LETTERS = {"A": [], "B": [6, 3], "C": [2, 3], "D": [10, 3, 2, 3]}  # dashes of recordings of the same quantity
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
            x, y = thinned(np.asarray(line.x, float), np.asarray(line.y, float))
            lines.append({**dataclasses.asdict(dataclasses.replace(line, x=[], y=[])), "x": _plain(x), "y": _plain(y)})
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
    """The place of a chart on a page, with the menu that saves it as a figure.

    Args:
        chart: to begin with; None: nothing yet.
        classes: further CSS classes.
    """

    def __init__(self, chart: Chart | None = None, classes: str = "") -> None:
        super().__init__("div", f"chartbox {classes}")
        self.chart = chart
        with self:
            self._picture = Element("div", markup="" if chart is None else chart.markup())
            self._menu = save_menu("chart" if chart is None else chart.name, self._figure)
        self._menu.set(hidden=chart is None)

    def _figure(self, view: dict[str, Any] | None) -> Figure:
        assert self.chart is not None
        return self.chart.figure(view)

    def show_chart(self, chart: Chart) -> None:
        """Show a chart in place of the present one."""
        self.chart = chart
        self._picture.put(chart.markup())
        self._menu.set(hidden=None, data_name=chart.name)


def update(place: ChartPlace, chart: Chart) -> None:
    """Replace a chart."""
    place.show_chart(chart)


def thinned(x: np.ndarray, y: np.ndarray, most: int = MOST) -> tuple[np.ndarray, np.ndarray]:
    """Thin a line to a number of points: of every section the ends and the extremes of x and y."""
    n = len(x)
    if n <= most:
        return x, y
    edges = np.linspace(0, n, most // 6 + 1).astype(int)
    keep = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        part = [f(v[a:b]) for v in (x, y) if np.isfinite(v[a:b]).any() for f in (np.nanargmin, np.nanargmax)]
        keep += sorted({a, b - 1, *(a + int(i) for i in part)})
    return x[keep], y[keep]


def _plain(values: np.ndarray) -> list[float | None]:
    return [float(f"{v:.7g}") if math.isfinite(v) else None for v in values]
