"""Loops of tension over length, from a friction model or from a recording."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

from ...quantities import from_si
from . import style
from .style import COLOURS, INK_2

# A slender head that points up, notched behind: an equilateral triangle would not say which way it points.
HEAD = Path([(0.0, 1.0), (0.62, -0.8), (0.0, -0.5), (-0.62, -0.8), (0.0, 1.0)])


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
    for share in (np.arange(count) + 0.6) / count:
        i = min(max(int(np.searchsorted(walked, share * walked[-1])), 1), len(x) - 1)
        # The direction over a few points, for that of one step may be lost in noise.
        step = points[min(i + 1, len(x) - 1)] - points[max(i - 2, 0)]
        turned = float(np.degrees(np.arctan2(step[1], step[0]))) - 90.0
        head = MarkerStyle(HEAD, transform=Affine2D().rotate_deg(turned))
        ax.plot([x[i]], [y[i]], marker=head, ms=14, mfc=COLOURS["tension"], mec="none", mew=0.0, zorder=4)
