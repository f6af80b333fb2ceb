"""Design map: forces of muscles over the stroke with the requirements, and valves and tubes of the chosen one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...quantities import from_si
from ...studies.design import Design, DesignStudy
from ...studies.sizing import Judged, Sizing
from ...studies.sizing.braid import frontier
from ...studies.sizing.candidate import VERDICTS, LawAtPressure
from . import style
from .places import FootRow, Margins, set_margins
from .style import COLOURS, INK, INK_2, INK_3, PANEL, SUNKEN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


POINTS = 129
GRAM, MS = from_si(1.0, "kg", "g"), from_si(1.0, "s", "ms")
MOST = 6  # muscles drawn
KIND_MARKERS = {"pressure_regulator": "s", "spool_valve": "o", "three_way_valve": "^"}
_DASHES = ("-", (0, (8, 2)), (0, (4, 2.3)), (0, (1.2, 1.8)), (0, (5, 1.7, 1.2, 1.7)), (0, (2.5, 1.2)))


@style.styled()
def design_map(sizing: Sizing, *, law: str = "linear_threshold") -> Figure:
    """Draw force over stroke at the required pressure, and response time over the mass of the lines."""
    both = bool(sizing.lines)
    fig = style.figure(style.WIDE if both else style.MIDDLE, 4.6)
    ratios = [1.55, 1.0] if both else [1.0]
    left, right = (0.06, 0.975) if both else (0.085, 0.88)
    grid = fig.add_gridspec(
        1, len(ratios), left=left, right=right, bottom=0.12, top=0.80, wspace=0.38, width_ratios=ratios
    )
    draw_force_over_stroke(fig.add_subplot(grid[0]), sizing, law)
    if both:
        _lines(fig.add_subplot(grid[1]), sizing)
    return fig


def _shown(sizing: Sizing) -> list[Judged]:
    order = list(sizing.muscles)
    first = [next((m for m in order if m.muscle.kind == k), None) for k in ("braid", "specimen", "size")]
    chosen = [m for m in first if m is not None]
    if sizing.chosen not in chosen:
        chosen.insert(0, sizing.chosen)
    rest = [m for m in order if m not in chosen and m.verdict != VERDICTS[2]]
    distinct: list[Judged] = []
    for one in chosen + rest:
        if not any(_alike(one, other) for other in distinct):
            distinct.append(one)
    return distinct[:MOST]


def _alike(a: Judged, b: Judged) -> bool:
    """Whether two lines would coincide."""
    return bool(
        abs(a.largest_force / b.largest_force - 1.0) < 0.02 and abs(a.promised_force / b.promised_force - 1.0) < 0.02
    )


def draw_force_over_stroke(ax: Axes, sizing: Sizing, law: str) -> None:
    """Draw the promised force over the stroke of the best muscles, and the requirement, into axes."""
    wish, cm = sizing.wish, from_si(1.0, "m", "cm")
    shown = _shown(sizing)
    right = 2.0 * wish.stroke
    top = 1.15 * max(2.6 * wish.force, 1.2 * sizing.chosen.end_force)
    ax.set_xlim(0.0, right * cm)
    ax.set_ylim(0.0, top)
    # What does it lies up and to the right of the wish.
    ax.fill_between([wish.stroke * cm, right * cm], wish.force, top, color=SUNKEN, lw=0, zorder=0)
    ax.text(
        (right - 0.02 * wish.stroke) * cm,
        0.985 * top,
        "does it",
        ha="right",
        va="top",
        fontsize=style.SMALL,
        color=INK_3,
    )
    strokes = np.linspace(0.0, right, POINTS)
    for one, dash in zip(shown, _DASHES, strict=False):
        m = one.muscle
        said = LawAtPressure(m.law, wish.pressure).tension(m.longest - strokes) - m.friction
        sure = said - one.error_force
        said, sure = (np.where(v > 0.0, v, np.nan) for v in (said, sure))
        heavy = one is sizing.chosen
        colour = COLOURS["tension"]
        if heavy:
            ax.fill_between(strokes * cm, np.nan_to_num(sure), np.nan_to_num(said), color=colour, alpha=0.13, lw=0)
        ax.plot(
            strokes * cm,
            sure,
            color=colour,
            ls=dash,
            lw=style.HEAVY if heavy else style.LINE,
            alpha=1 if heavy else 0.75,
        )
    if wish.length is not None or wish.diameter is not None:
        some = np.linspace(0.02 * right, right, 49)
        most = frontier(wish, some, law=law)
        most = np.where(most > 0.0, most, np.nan)
        ax.plot(some * cm, most, color=INK_2, lw=1.0, ls=(0, (1, 1.5)))
        over = np.flatnonzero(np.isfinite(most) & (most <= 0.72 * top))
        if over.size:
            i = int(over[0])
            style.beside(
                ax,
                "most that a braid\nin the space promises",
                (some[i] * cm, most[i]),
                (-5, 0),
                ha="right",
                color=INK_2,
                va="center",
                zorder=4,
                bbox={"boxstyle": "round,pad=0.1", "fc": SUNKEN, "ec": "none", "alpha": 0.8},
            )
    _margin(ax, sizing, cm)
    style.quantity_axes(ax, x=("Stroke, cm", "length"), y=("Guaranteed force, N", "tension"))
    bar = from_si(wish.pressure, "Pa", "bar")
    style.heading(
        ax,
        f"Force over stroke at {bar:g} bar",
        f"band: error of the law, {sizing.chosen.muscle.error.share:.0%} of its largest force",
        above=40.0,
    )
    _keyed(ax, shown, sizing)


def _margin(ax: Axes, sizing: Sizing, cm: float) -> None:
    """Draw the requirements, and the margins of the chosen muscle in force and in stroke."""
    wish, one = sizing.wish, sizing.chosen
    x, y = wish.stroke * cm, wish.force
    if one.promised_force > 1.02 * wish.force:
        ax.annotate("", (x, one.promised_force), (x, y), arrowprops={"arrowstyle": "->", "color": INK, "lw": 0.9})
    if one.stroke > 1.02 * wish.stroke:
        ax.annotate("", (one.stroke * cm, y), (x, y), arrowprops={"arrowstyle": "->", "color": INK, "lw": 0.9})
    ax.plot([x], [y], "o", mfc=INK, mec=PANEL, mew=1.2, ms=8.0, zorder=5)
    said = f"required: {wish.force:.4g} N, {x:.3g} cm"
    style.beside(
        ax,
        said,
        (x, y),
        (-8, -12),
        ha="right",
        va="top",
        fontweight="bold",
        color=INK,
        zorder=6,
        bbox={"boxstyle": "round,pad=0.15", "fc": PANEL, "ec": "none", "alpha": 0.85},
    )


def _keyed(ax: Axes, shown: list[Judged], sizing: Sizing) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=COLOURS["tension"], ls=dash, lw=style.HEAVY if one is sizing.chosen else style.LINE)
        for one, dash in zip(shown, _DASHES, strict=False)
    ]
    labels = [f"{m.muscle.id}: {m.verdict}" + (f", {m.worst[0]}" if m.verdict == VERDICTS[2] else "") for m in shown]
    style.key(
        ax,
        handles,
        labels,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.055),
        ncols=3,
        fontsize=style.SMALL - 0.5,
        labelcolor=INK_2,
        borderaxespad=0.0,
        columnspacing=1.4,
        handletextpad=0.6,
        labelspacing=0.25,
        borderpad=0.4,
    )


def _lines(ax: Axes, sizing: Sizing) -> None:
    able = [x for x in sizing.lines if x.to_force is not None]
    if not able:
        style.note(ax, "no line reaches the force", x=0.5, y=0.5, ha="center")
        return
    ax.set_xscale("log")
    ax.set_yscale("log")
    for line in able:
        marker = KIND_MARKERS.get(line.element, "D")
        ax.plot(
            [line.mass * GRAM],
            [(line.to_force or np.nan) * MS],
            marker,
            ms=3.5 + 1.2 * np.log1p(line.power),
            zorder=3,
            mfc=COLOURS["valve"] if line.pareto else PANEL,
            mec=COLOURS["valve"],
            mew=0.9,
        )
    line = able[0]
    style.beside(
        ax,
        f"{line.valve}, {line.tube}",
        (line.mass * GRAM, (line.to_force or np.nan) * MS),
        (-4, 16),
        color=INK,
        va="bottom",
        arrowprops={"arrowstyle": "-", "color": INK_3, "lw": 0.5, "shrinkA": 0, "shrinkB": 3},
        bbox={"boxstyle": "round,pad=0.1", "fc": PANEL, "ec": "none", "alpha": 0.8},
    )
    style.quantity_axes(ax, x=("Mass of valve and tube, g", None), y=("Time to the required force, ms", None))
    for axis in (ax.xaxis, ax.yaxis):
        style.tick_numbers(axis)
    style.heading(ax, f"Lines for {sizing.chosen.muscle.id}", "filled: Pareto-best", above=40.0)
    style.note(ax, "▲ switching  ● proportional  ■ regulator; larger: more power", y=1.0, dy=24.0, dx=0.0)


MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
LISTED, ROWS = 12, 4  # designs of the front that are told, from the fastest on; rows of their list


@style.styled()
def design_front(study: DesignStudy) -> Figure:
    """Draw air per cycle and efficiency over response time; filled are the Pareto-optimal designs."""
    from matplotlib.lines import Line2D

    fig = style.figure(style.WIDE, 5.2)
    grid = fig.add_gridspec(1, 2, left=0.07, right=0.975, bottom=0.29, top=0.80, wspace=0.24)
    done = [d for d in study.designs if np.isfinite(d.response)]
    panels = (
        (
            "Air per cycle, mg",
            [from_si(d.air, "kg", "mg") for d in done],
            "Less air",
            "from the supply, in a working cycle",
        ),
        ("Efficiency, %", [1e2 * d.efficiency for d in done], "More work from it", "work over the exergy of the air"),
    )
    for number, (quantity, values, title, note) in enumerate(panels):
        ax = fig.add_subplot(grid[number])
        _panel(ax, done, values)
        style.quantity_axes(ax, x=("Response to a step of pressure, ms", None), y=(quantity, None))
        style.heading(ax, title, note, above=46.0)
        if number == 0:
            muscles = list(dict.fromkeys(d.muscle for d in study.designs))
            handles = [
                Line2D([], [], marker=MARKERS[i % len(MARKERS)], ls="", mfc=PANEL, mec=COLOURS["valve"], ms=6.0)
                for i in range(len(muscles))
            ]
            handles.append(Line2D([], [], marker="o", ls="", mfc=COLOURS["valve"], mec=COLOURS["valve"], ms=6.0))
            style.key(
                ax,
                handles,
                [*muscles, "filled: beaten by none"],
                loc="lower left",
                bbox_to_anchor=(-0.02, 1.085),
                ncols=len(handles),
                labelcolor=INK_2,
                borderaxespad=0.0,
                columnspacing=1.2,
                handletextpad=0.3,
                handlelength=2.0,
                borderpad=0.4,
            )
    listed = []
    for i, design in enumerate(study.front[:LISTED]):
        x, y = 0.07 + 0.305 * (i // ROWS), 0.145 - 0.035 * (i % ROWS)
        number_text = fig.text(x, y, f"{i + 1}", fontsize=style.SMALL, fontweight="bold", color=INK)
        bore, length = from_si(design.tube_diameter, "m", "mm"), from_si(design.tube_length, "m", "cm")
        flow = from_si(design.valve_flow, "m^3/s", "l/min")
        said = f"{design.muscle}: {flow:.3g} l/min, {bore:.3g} mm, {length:.3g} cm"
        said = said if design.settled else f"{said}, not settled"
        listed.append(FootRow(number_text, fig.text(x + 0.02, y, said, fontsize=style.SMALL, color=INK_2)))
    set_margins(fig, Margins(foot=tuple(listed)))
    return fig


def _panel(ax: Axes, done: list[Design], values: list[float]) -> None:
    muscles = list(dict.fromkeys(d.muscle for d in done))
    ax.set_xscale("log")
    if not done:
        style.note(ax, "no design could be run", x=0.5, y=0.5, ha="center")
        return
    for design, y in zip(done, values, strict=True):
        ax.plot(
            [design.response * MS],
            [y],
            MARKERS[muscles.index(design.muscle) % len(MARKERS)],
            ms=7.0,
            zorder=3,
            mfc=COLOURS["valve"] if design.best else PANEL,
            mec=COLOURS["valve"],
            mew=1.0,
        )
    best = sorted((d.response, y) for d, y in zip(done, values, strict=True) if d.best)[:LISTED]
    for i, (x, y) in enumerate(best, 1):
        style.beside(ax, str(i), (x * MS, y), (-9, 0), color=INK, fontweight="bold", ha="center", va="center", zorder=4)
    ax.margins(x=0.18, y=0.16)
    style.tick_numbers(ax.xaxis)
