"""Figure of a chart of the web interface: what a page shows as lines over two axes, drawn as the figures of the reports."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...documents import JsonValue
from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Figure

LETTERS: dict[str, Sequence[float]] = {
    "A": (),
    "B": (3.5, 1.8),
    "C": (1.2, 1.8),
    "D": (6.0, 1.8, 1.2, 1.8),
    "E": (8.0, 2.4),
    "F": (3.5, 1.8, 1.2, 1.8, 1.2, 1.8),
}  # dashes, in widths
HEIGHT, LANE, APART = 3.6, 1.0, 0.34  # of a figure, of one of several charts, and between them [inch]
SIDE = 0.03  # share of the axes, within which a line ends at their right side
CHARACTER = 4.9  # mean width of a letter of a label [pt]
LEFT, TOP, BOTTOM = 0.52, 0.46, 0.48  # of a figure, beside its axes [inch]


@style.styled()
def chart_figure(chart: Mapping[str, JsonValue], view: Mapping[str, JsonValue] | None = None) -> Figure:
    """Draw a chart, or charts below each other that share their horizontal axis.

    Args:
        chart: its document, as `web.charts.Chart.document` makes it: name, axes, lines and marks; or name and ``charts``.
        view: ranges of a part, ``x`` and ``y``, two numbers each; all of it where None.
    """
    charts = list(chart.get("charts") or [chart])
    several = len(charts) > 1
    each = LANE if several else HEIGHT - TOP - BOTTOM
    high, width = TOP + BOTTOM + len(charts) * each + (len(charts) - 1) * APART, style.MIDDLE
    labels = [str(line.get("label") or "") for one in charts for line in one["lines"]]
    right = 0.14 + (CHARACTER * max(map(len, labels), default=0) + 6.0 * any(labels)) / 72.0
    fig = style.figure(width, high)
    share = 1.0 - (LEFT + min(right, 0.4 * width)) / width
    for i, one in enumerate(charts):
        low = BOTTOM + (len(charts) - 1 - i) * (each + APART)
        ax = fig.add_axes((LEFT / width, low / high, share, each / high))
        _draw_chart(ax, one, {k: v for k, v in (view or {}).items() if k == "x" or not several})
        if several and i < len(charts) - 1:
            ax.set_xlabel("")
            ax.set_xticklabels([])
    style.heading(fig.axes[0], str(chart["name"]))
    return fig


def _draw_chart(ax: Axes, chart: Mapping[str, Any], view: Mapping[str, Any]) -> None:
    lines = list(chart["lines"])
    (x0, x1), (y0, y1) = _ends(chart, lines, view)
    ax.set_xlim(x0, x1)
    ax.set_ylim(y0, y1)
    for line in lines:
        _draw_line(ax, line)
    style.quantity_axes(ax, x=_title(chart["x"]), y=_title(chart["y"]))
    for mark in chart.get("marks", ()):
        _draw_mark(ax, mark)
    for quantity in dict.fromkeys(line.get("quantity") or "" for line in lines):
        ends = [end for line in lines if (line.get("quantity") or "") == quantity and (end := _end(line, ax))]
        right = [end for end in ends if end[0] > x1 - SIDE * (x1 - x0)]
        style.end_labels(ax, right, quantity=quantity or None)
        for x, y, text in (end for end in ends if end not in right):  # a line that ends within the axes, or above them
            look = {"fontweight": "bold", "color": style.colour(quantity or None), "annotation_clip": False}
            style.beside(ax, text, (x, y), (3, 3), **look)


def _title(axis: Mapping[str, Any]) -> tuple[str, str | None]:
    label = str(axis["label"])
    words = f"{label[:1].upper()}{label[1:]}, {axis['unit']}" if axis.get("unit") else f"{label[:1].upper()}{label[1:]}"
    return words, axis.get("quantity") or None


def _values(values: Sequence[float | None]) -> np.ndarray:
    return np.array([math.nan if v is None else float(v) for v in values])


def _ends(
    chart: Mapping[str, Any], lines: Sequence[Mapping[str, Any]], view: Mapping[str, Any] | None
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Ends of both axes: of the part that is shown, as stated by the axes, or from the values."""
    found = []
    for name in ("x", "y"):
        part = (view or {}).get(name)
        if part is not None:
            found.append((float(part[0]), float(part[1])))
            continue
        values = np.concatenate([_values(line[name]) for line in lines]) if lines else np.array([])
        values = values[np.isfinite(values)]
        low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
        room = (0.05 * (high - low) or 0.05 * abs(high) or 1.0) if name == "y" else 0.0
        axis = chart[name]
        ends = (
            low - room if axis.get("low") is None else float(axis["low"]),
            high + room if axis.get("high") is None else float(axis["high"]),
        )
        found.append(ends if ends[1] > ends[0] else (ends[0] - 0.5, ends[0] + 0.5))
    return found[0], found[1]


def _draw_line(ax: Axes, line: Mapping[str, Any]) -> None:
    quantity = line.get("quantity") or None
    x, y = _values(line["x"]), _values(line["y"])
    dash = line.get("dash") or ""
    dashes: Any = style.DASHES.get(quantity or "", "-") if dash == "own" else "-"
    if LETTERS.get(dash):
        dashes = (0, tuple(LETTERS[dash]))
    colour, opacity = style.colour(quantity), float(line.get("opacity", 1.0))
    width = float(line.get("width", 1.75)) * style.LINE / 1.75
    if line.get("fill"):
        ax.fill(x, y, color=colour, alpha=0.12 * opacity, lw=0)
    if line.get("line", True):
        ax.plot(x, y, ls=dashes, color=colour, lw=width, alpha=opacity)
    if line.get("points"):
        marker = style.MARKERS.get(quantity or "", "o")
        ax.plot(x, y, ls="", marker=marker, mfc=style.PANEL, mec=colour, mew=0.9, alpha=opacity)


def _draw_mark(ax: Axes, mark: Mapping[str, Any]) -> None:
    x, y, text = mark.get("x"), mark.get("y"), str(mark.get("text") or "")
    look: dict[str, Any] = {"color": style.INK_2, "lw": style.HAIR, "ls": (0, (1.0, 2.5))}
    if x is not None and y is None:
        ax.axvline(float(x), **look)
    if y is not None and x is None:
        ax.axhline(float(y), **look)
    low, high = ax.get_xlim()
    shown = x is None or low <= float(x) <= high
    if text and shown:
        blended = ax.get_yaxis_transform() if x is None else ax.get_xaxis_transform() if y is None else ax.transData
        at = (0.0 if x is None else float(x), 1.0 if y is None else float(y))
        style.beside(ax, text, at, (4, -8 if y is None else 5), xycoords=blended, color=style.INK_2)


def _end(line: Mapping[str, Any], ax: Axes) -> tuple[float, float, str] | None:
    """Last shown point of a line with its label; None for one without."""
    x, y = _values(line["x"]), _values(line["y"])
    (low, high), (least, most) = ax.get_xlim(), ax.get_ylim()
    there = np.flatnonzero((x >= low) & (x <= high) & (y >= least) & (y <= most))
    if not line.get("label") or not there.size:
        return None
    return float(x[there[-1]]), float(y[there[-1]]), str(line["label"])
