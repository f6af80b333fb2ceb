"""Pareto front of muscles, tubes and valves: what a faster response costs in air, and in efficiency."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from ...quantities import from_si
from ...studies.design import Design, DesignStudy
from . import style
from .style import COLOURS, INK, INK_2, PANEL

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
LISTED, ROWS = 12, 4  # designs of the front that are told, from the fastest on; rows of their list


@style.styled()
def design_front(study: DesignStudy) -> Figure:
    """Air per cycle and efficiency over the response; filled are the designs that no other beats in all three."""
    fig = style.figure(style.WIDE, 5.2)
    grid = fig.add_gridspec(1, 2, left=0.07, right=0.975, bottom=0.29, top=0.80, wspace=0.24)
    done = [d for d in study.designs if np.isfinite(d.response)]
    panels = (
        ("Air per cycle, mg", [1e6 * d.air for d in done], "Less air", "from the supply, in a working cycle"),
        ("Efficiency, %", [1e2 * d.efficiency for d in done], "More work from it", "work over the exergy of the air"),
    )
    for number, (what, values, title, note) in enumerate(panels):
        ax = fig.add_subplot(grid[number])
        _panel(ax, done, values)
        style.quantity_axes(ax, x=("Response to a step of pressure, ms", None), y=(what, None))
        style.heading(ax, title, note, above=46.0)
        if number == 0:
            _keyed(ax, study)
    for i, design in enumerate(study.front[:LISTED]):
        x, y = 0.07 + 0.305 * (i // ROWS), 0.145 - 0.035 * (i % ROWS)
        fig.text(x, y, f"{i + 1}", fontsize=style.SMALL, fontweight="bold", color=INK)
        fig.text(x + 0.02, y, _words(design), fontsize=style.SMALL, color=INK_2)
    return fig


def _panel(ax: Axes, done: list[Design], values: list[float]) -> None:
    muscles = list(dict.fromkeys(d.muscle for d in done))
    ax.set_xscale("log")
    if not done:
        style.note(ax, "no design could be run", x=0.5, y=0.5, ha="center")
        return
    for design, y in zip(done, values, strict=True):
        ax.plot(
            [1e3 * design.response], [y], MARKERS[muscles.index(design.muscle) % len(MARKERS)], ms=7.0, zorder=3,
            mfc=COLOURS["valve"] if design.best else PANEL, mec=COLOURS["valve"], mew=1.0,
        )  # fmt: skip
    best = sorted((d.response, y) for d, y in zip(done, values, strict=True) if d.best)[:LISTED]
    for i, (x, y) in enumerate(best, 1):
        ax.annotate(
            str(i), (1e3 * x, y), xytext=(-9, 0), textcoords="offset points", fontsize=style.SMALL, color=INK,
            fontweight="bold", ha="center", va="center", zorder=4,
        )  # fmt: skip
    ax.margins(x=0.18, y=0.16)
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: style.number(value)))
    ax.xaxis.set_minor_formatter(NullFormatter())


def _words(design: Design) -> str:
    bore, length = from_si(design.tube_diameter, "m", "mm"), from_si(design.tube_length, "m", "cm")
    said = f"{design.muscle}: {from_si(design.valve_flow, 'm^3/s', 'l/min'):.3g} l/min, {bore:.3g} mm, {length:.3g} cm"
    return said if design.settled else f"{said}, not settled"


def _keyed(ax: Axes, study: DesignStudy) -> None:
    from matplotlib.lines import Line2D

    muscles = list(dict.fromkeys(d.muscle for d in study.designs))
    handles = [
        Line2D([], [], marker=MARKERS[i % len(MARKERS)], ls="", mfc=PANEL, mec=COLOURS["valve"], ms=6.0)
        for i in range(len(muscles))
    ]
    handles.append(Line2D([], [], marker="o", ls="", mfc=COLOURS["valve"], mec=COLOURS["valve"], ms=6.0))
    ax.legend(
        handles, [*muscles, "filled: beaten by none"], loc="lower left", bbox_to_anchor=(-0.02, 1.085),
        ncols=len(handles), fontsize=style.SMALL, frameon=False, labelcolor=INK_2, borderaxespad=0.0, columnspacing=1.2,
        handletextpad=0.3,
    )  # fmt: skip
