"""Figures of a joint with two muscles over time: angle, stiffness, set-points, pressures, and external moment."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...quantities import from_si
from ...recordings.recording import Recording
from . import style
from .provenance import describe, recording_source
from .recording_figures import checked_names, envelope
from .style import DASHES, SMALL, SUNKEN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


WIDTH = 8.4  # [inch]


class _Line(NamedTuple):
    """A channel, its label in the key, and whether it is a set-point or the second of two."""

    name: str
    words: str
    look: str = "solid"


class _Panel(NamedTuple):
    heading: str
    quantity: str | None
    scale: float
    lines: tuple[_Line, ...]
    height: float = 1.0


ANGLE = (_Line("command.angle", "set-point", "asked"), _Line("angle", "measured"))
STIFFNESS = (_Line("command.stiffness", "set-point", "asked"), _Line("joint.stiffness", "of the muscles"))
PRESSURES = (_Line("flexor_pressure", "flexor"), _Line("extensor_pressure", "extensor", "second"))
MOMENT = (_Line("moment.command", "from outside"),)
_LOOKS: dict[str, dict[str, Any]] = {
    "solid": {"lw": style.LINE + 0.2, "linestyle": "-", "zorder": 2.4},
    "second": {"lw": style.LINE + 0.2, "linestyle": style.RECORDING_DASHES[1], "zorder": 2.4},
    "asked": {"lw": style.LINE, "linestyle": DASHES["length"], "zorder": 2.6, "alpha": 0.55},
}


@style.styled()
def joint_figure(record: Recording, *, title: str | None = None) -> Figure:
    """Draw angle, stiffness, pressures, and external moment over time; grey while the loop is off.

    Args:
        record: such as `bench.joint_run.run_joint` gives.
        title: instead of the recording's own.

    Raises:
        InputError: if a channel is missing.
    """
    bar = from_si(1.0, "Pa", "bar")
    drawn = [
        _Panel("Angle, rad", None, 1.0, ANGLE, 1.25),
        _Panel("Stiffness, N m/rad", None, 1.0, STIFFNESS),
        _Panel("Pressure, bar", "pressure", bar, PRESSURES),
        _Panel("Moment, N m", None, 1.0, MOMENT, 0.6),
    ]
    checked_names(record, [line.name for p in drawn for line in p.lines])
    if not np.any(record["moment.command"]):
        drawn = drawn[:-1]
    top, each, gap, foot = 0.62, 1.3, 0.42, 0.5  # [inch]
    heights = [each * p.height for p in drawn]
    height = top + sum(heights) + gap * (len(drawn) - 1) + foot
    fig = style.figure(WIDTH, height)
    y = height - top
    for i, (panel, own) in enumerate(zip(drawn, heights, strict=True)):
        ax = fig.add_axes((0.065, (y - own) / height, 0.755, own / height))
        y -= own + gap
        _draw(ax, record, panel)
        last = i == len(drawn) - 1
        style.quantity_axes(ax, x=("Time, s" if last else "", None), y=(panel.heading, panel.quantity))
        if not last:
            ax.tick_params(labelbottom=False)
        if i == 0:
            style.heading(ax, str(record.meta.get("title", "")) if title is None else title, above=24.0)
    describe(fig, recording_source(record))
    return fig


def _draw(ax: Axes, record: Recording, panel: _Panel) -> None:
    colour = style.colour(panel.quantity)
    for line in panel.lines:
        ax.plot(
            *envelope(record.time, record[line.name] * panel.scale), color=colour, label=line.words, **_LOOKS[line.look]
        )
    low, high = ax.get_ylim()
    ax.set_ylim(0.0 if 0.0 < low < 0.6 * high else low, high)
    ax.set_xlim(float(record.time[0]), float(record.time[-1]))
    for start, end in _off(record):
        ax.axvspan(start, end, facecolor=SUNKEN, edgecolor="none", zorder=0.5)
        if panel.lines is ANGLE:
            where = ax.get_xaxis_transform()
            ax.text(start, 0.02, " loop off", transform=where, fontsize=SMALL, color=style.INK_2, va="bottom")
    ax.legend(
        frameon=False,
        fontsize=SMALL,
        handlelength=2.6,
        labelspacing=0.35,
        borderpad=0.2,
        loc="upper left",
        bbox_to_anchor=(1.005, 1.1),
        labelcolor=colour,
    )


def _off(record: Recording) -> list[tuple[float, float]]:
    """Intervals in which the angle is not fed back: starts and ends [s]."""
    if "loop.active" not in record:
        return []
    off = np.concatenate([[False], record["loop.active"] < 0.5, [False]])
    begins, ends = np.flatnonzero(~off[:-1] & off[1:]), np.flatnonzero(off[:-1] & ~off[1:])
    last = len(record) - 1
    return [(float(record.time[a]), float(record.time[min(int(b), last)])) for a, b in zip(begins, ends, strict=True)]
