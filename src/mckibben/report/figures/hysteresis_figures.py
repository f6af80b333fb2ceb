"""Loops of tension over length, from a friction model or from a recording."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...quantities import from_si
from . import style
from .style import COLOURS, INK_2, PANEL


class Loop(NamedTuple):
    """A closed or open path: displacement [m] and force [N] of equal shape (n,), in the order of time."""

    displacement: np.ndarray
    force: np.ndarray
    label: str = ""


@style.styled()
def loop_figure(first: Loop, second: Loop | None = None, *, title: str, note: str = "", zero: bool = True) -> Figure:
    """Force over displacement with arrows along the path; a second loop is dashed.

    Args:
        first: drawn solid.
        second: drawn dashed, such as the same with half the range.
        title: heading.
        note: quieter words after it.
        zero: draw the line of no force.
    """
    fig = style.figure(style.MIDDLE * 0.75, 3.9)
    ax = fig.add_axes((0.12, 0.13, 0.74, 0.70))
    loops = [first] if second is None else [first, second]
    millimetres = from_si(1.0, "m", "mm")
    every_x = np.concatenate([np.asarray(p.displacement) for p in loops]) * millimetres
    every_y = np.concatenate([np.asarray(p.force) for p in loops])
    for values, limits in ((every_x, ax.set_xlim), (every_y, ax.set_ylim)):
        room = 0.06 * (values.max() - values.min()) or 1.0
        limits(values.min() - room, values.max() + room)
    if zero:
        ax.axhline(0.0, color=INK_2, lw=0.7, zorder=1)
    for path, dash in zip(loops, style.RECORDING_DASHES, strict=False):
        x, y = np.asarray(path.displacement) * millimetres, np.asarray(path.force)
        ax.plot(x, y, ls=dash, color=COLOURS["tension"], lw=style.LINE + 0.3, zorder=3)
        _arrows(ax, x, y)
        if path.label:
            i = int(np.argmax(x + 1e-9 * y))
            ax.annotate(
                path.label,
                xy=(x[i], y[i]),
                xytext=(8, -3),
                textcoords="offset points",
                va="center",
                annotation_clip=False,
                fontsize=style.SMALL,
                fontweight="bold",
            )
    style.quantity_axes(ax, x=("Displacement, mm", "length"), y=("Tension, N", "tension"))
    style.heading(ax, title, note, above=24.0)
    return fig


def _arrows(ax: Axes, x: np.ndarray, y: np.ndarray, count: int = 3) -> None:
    """Heads along a path, at equal shares of its drawn length after the first quarter."""
    points = ax.transData.transform(np.stack([x, y], axis=1))
    walked = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    if walked[-1] == 0.0:
        return
    options: dict[str, Any] = {
        "arrowstyle": "-|>,head_width=0.32,head_length=0.7",
        "fc": COLOURS["tension"],
        "ec": PANEL,
        "linewidth": 0.4,
        "mutation_scale": 13,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    for share in (np.arange(count) + 0.6) / count:
        i = int(np.searchsorted(walked, share * walked[-1]))
        i = min(max(i, 1), len(x) - 1)
        step = points[i] - points[i - 1]
        if np.hypot(*step) == 0.0:
            continue
        tail = points[i] - step / np.hypot(*step) * 6.0
        start, end = ax.transData.inverted().transform([tail, points[i]])
        ax.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=options, zorder=4)
