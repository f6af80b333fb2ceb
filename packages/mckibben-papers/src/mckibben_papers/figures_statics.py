"""Figs. 5, 6, 12 and 13 of the paper and Table 1: laws, the linear model and its fit, working cycles, all muscles."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mckibben.analysis import characteristics
from mckibben.analysis.energy import CycleLoops, cycle_loops, energy_curve
from mckibben.documents import JsonValue
from mckibben.muscles import braid
from mckibben.muscles.braid import stop_tension
from mckibben.muscles.build import law_from_specimen
from mckibben.muscles.laws.ideal import Ideal
from mckibben.muscles.laws.linear_threshold import LinearThreshold
from mckibben.muscles.laws.thick_wall import ThickWall
from mckibben.quantities import from_si
from mckibben.report.figures import energy_figures, style
from mckibben.specimens import specimen

from . import computed, measured, part4
from .figure_parts import (
    KEY_MARK,
    MARK,
    PRINTED,
    NumberEntry,
    as_printed,
    entry,
    key,
    label,
    mark,
    numbers,
    ours,
    outcome,
    panel,
    printed,
    printed_key,
    rest_length,
    right_axis,
    sample,
    shown,
    title,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ENDS = {"marker": "o", "ms": 4.5, "mfc": style.PANEL, "mew": 1.0, "markevery": [0, -1]}  # of a printed stretch
SHORTEST, SAMPLES = 0.09, 141  # lengths that are drawn begin here [m]
TALL = 3.0  # of Figs. 5a to e [inch]
WALL = style.RECORDING_DASHES[1]  # with wall thickness, dashed as in the paper
CM, BAR = from_si(1.0, "m", "cm"), from_si(1.0, "Pa", "bar")


@functools.cache
def laws() -> tuple[Ideal, ThickWall]:
    """The nylon muscle without and with the thickness of its wall."""
    without, wall = (law_from_specimen(specimen("nylon"), name) for name in ("ideal", "thick_wall"))
    assert isinstance(without, Ideal) and isinstance(wall, ThickWall)
    return without, wall


@functools.cache
def linear() -> LinearThreshold:
    """The linear law of the nylon muscle, its numbers as printed."""
    law = law_from_specimen(specimen("nylon"))
    assert isinstance(law, LinearThreshold)
    return law


def _shape() -> dict[str, JsonValue]:
    _, wall = laws()
    return {"thread_length": wall.thread_length, "turns": wall.turns, "wall_thickness": wall.wall_thickness}


def lengths() -> np.ndarray:
    """Braid lengths of Fig. 5, up to the upper working length [m]."""
    return np.linspace(SHORTEST, float(laws()[1].upper_length), SAMPLES)


def _over_length(
    figure: str, words: str, y: tuple[str, str | None], without: Any, wall: Any | None
) -> tuple[Figure, Axes, list[Any]]:
    """Draw a panel of Fig. 5 with one or two curves; return the entries of its key."""
    fig, ax = panel(TALL)
    at = lengths() * CM
    ax.plot(at, np.asarray(without), gid="without wall", **ours(y[1]))
    handles = [sample("without wall thickness", **ours(y[1], zorder=1))]
    if wall is not None:
        ax.plot(at, np.asarray(wall), gid="with wall", **ours(y[1], ls=WALL))
        handles.append(sample("with wall thickness", **ours(y[1], ls=WALL, zorder=1)))
    ax.set_xlim(at[0] - 0.15, at[-1] + 0.25)
    style.quantity_axes(ax, x=("Length, cm", "length"), y=y)
    title(ax, figure, words)
    return fig, ax, handles


@style.styled()
def figure_5a() -> Figure:
    """Braid angle over length."""
    threads = laws()[0].thread_length
    angle = np.degrees(np.asarray(braid.angle(lengths(), thread_length=threads)))
    fig, ax, handles = _over_length("5a", "Nylon muscle: angle of the braid", ("Braid angle, °", None), angle, None)
    free = printed("static.zero_force_angle")
    ax.axhline(free, **PRINTED)
    at = float(braid.length_at(math.radians(free), thread_length=threads)) * CM
    ax.plot([at], [free], **MARK)
    ax.set_ylim(0.0, 65.0)
    numbers(
        ax, [entry("Angle of no tension", "static.zero_force_angle")], remarks=("wall thickness leaves it as it is",)
    )
    key(ax, [sample("cos θ = L/b", **ours(None, zorder=1)), printed_key("paper: no tension", line=True)])
    return fig


@style.styled()
def figure_5b() -> Figure:
    """Diameter over length."""
    shape, at = _shape(), lengths()
    outer = braid.diameter(at, thread_length=shape["thread_length"], turns=shape["turns"])
    inner = np.asarray(braid.inner_diameter(at, **shape)) * CM
    fig, ax, handles = _over_length(
        "5b", "Nylon muscle: diameter", ("Diameter, cm", "length"), np.asarray(outer) * CM, inner
    )
    free = printed("static.zero_tension_length") * rest_length("nylon")
    measured = specimen("nylon").property_si("diameter_shortened", "m") * CM
    ax.plot([free * CM], [measured], **MARK)
    ax.set_ylim(0.0, 1.55)
    diameter = float(braid.inner_diameter(free, **shape)) * CM
    numbers(ax, [NumberEntry("Inside at 0.75 L₀, cm", shown(diameter), shown(measured, 2))])
    key(ax, [*handles, printed_key("paper: 5 bar, no load")])
    return fig


@style.styled()
def figure_5c() -> Figure:
    """Volume over length."""
    shape, at, ml = _shape(), lengths(), from_si(1.0, "m^3", "cm^3")
    whole = braid.volume(at, thread_length=shape["thread_length"], turns=shape["turns"])
    inside = np.asarray(braid.inner_volume(at, **shape)) * ml
    fig, ax, handles = _over_length("5c", "Nylon muscle: volume", ("Volume, cm³", None), np.asarray(whole) * ml, inside)
    ax.set_ylim(0.0, 16.5)
    rest = rest_length("nylon")
    volume = float(braid.inner_volume(rest, **shape)) * ml
    inferred = float(linear().rest_volume) * ml
    ax.plot([rest * CM], [inferred], **MARK | {"marker": "D", "ms": 5.0})
    numbers(
        ax,
        [NumberEntry("Inside at L₀, cm³", shown(volume), shown(inferred) + "‡")],
        remarks=("‡ inferred from the printed", "   8.86 J of Part IV, not printed"),
    )
    key(ax, [*handles, sample("from Part IV", **KEY_MARK | {"marker": "D", "ms": 5.0})])
    return fig


@style.styled()
def figure_5d() -> Figure:
    """Tension per pressure over length."""
    per_bar, at = from_si(1.0, "N/Pa", "N/bar"), lengths()
    curves = [np.asarray(law.active_tension(at, computed.PRESSURE)) / computed.PRESSURE * per_bar for law in laws()]
    fig, ax, handles = _over_length(
        "5d", "Nylon muscle: tension per pressure", ("Tension per pressure, N/bar", "tension"), *curves
    )
    ax.axhline(0.0, color=style.INK_3, lw=style.HAIR)
    rest = rest_length("nylon")
    ends = [np.asarray(law.active_tension(rest, computed.PRESSURE)) / computed.PRESSURE * per_bar for law in laws()]
    free = [float(np.asarray(law.free_length(computed.PRESSURE))) / rest for law in laws()]
    numbers(
        ax,
        [
            *(
                NumberEntry(f"At L₀, {w} wall, N/bar", shown(float(end)))
                for w, end in zip(("without", "with"), ends, strict=True)
            ),
            *(NumberEntry(f"Free, {w} wall, L₀", shown(f)) for w, f in zip(("without", "with"), free, strict=True)),
        ],
        remarks=("The measured 0.75 L₀ holds the bladder,", "which these laws leave out."),
    )
    key(ax, handles)
    return fig


@style.styled()
def figure_5e() -> Figure:
    """Stiffness per pressure over length."""
    at, low, high = lengths(), min(computed.LENGTHS), max(computed.LENGTHS)
    curves = [np.asarray(law.braid_stiffness(at, computed.PRESSURE)) / computed.PRESSURE for law in laws()]
    curves[1] = np.where(at < laws()[1].upper_length, curves[1], np.nan)  # the stop begins there
    fig, ax, handles = _over_length(
        "5e", "Nylon muscle: stiffness per pressure", ("Stiffness per pressure Kg, cm", None), *(c * CM for c in curves)
    )
    ax.plot([low * CM, high * CM], [printed("static.stiffness_per_pressure")] * 2, **PRINTED | ENDS, zorder=5)
    ax.set_ylim(0.0, 0.75)
    inside = (at >= low - 1e-9) & (at <= high + 1e-9)
    spans = [f"{100.0 * np.ptp(c[inside]) / c[inside].mean():.0f} %" for c in curves]
    numbers(
        ax,
        [
            entry("Kg", "static.stiffness_per_pressure"),
            NumberEntry("Spread, with wall", spans[1]),
            NumberEntry("the same, without", spans[0]),
        ],
        remarks=(f"of {len(computed.LENGTHS)} lengths, 10–14 cm; Kg: slope of dF/dP′",),
    )
    key(ax, [*handles, sample("paper: constant", **PRINTED | ENDS)])
    return fig


# ---- the linear model


@style.styled()
def figure_6a(figure: str = "6a") -> Figure:
    """The linear model at 5 bar: total, active, passive and non-linear term."""
    law = linear()
    fig, ax = panel(3.9)
    at = np.linspace(0.095, 0.1555, 243)
    beyond = np.asarray(stop_tension(at, begins_at=law.upper_length, stiffness=law.stop_stiffness))
    active = np.asarray(law.active_tension(at, computed.PRESSURE))
    passive = np.asarray(law.elastic_tension(at)) - beyond
    terms = (
        ("total", active + passive + beyond, ours("tension", lw=style.HEAVY + 0.3)),
        ("active: Kg (P′ − Pth)(L − Lmin)", active, ours("tension", ls=WALL)),
        ("passive: Kp (L − L₀)", passive, ours("tension", ls=style.RECORDING_DASHES[2])),
        ("non-linear: nl(L), inferred", beyond, ours(None, color=style.INK_3, ls=(0, (5, 1.7, 1.2, 1.7)))),
    )
    for words, curve, look in terms:
        ax.plot(at * CM, curve, gid=words.split(":")[0], **look)
    ax.axhline(0.0, color=style.INK_3, lw=style.HAIR, zorder=1)
    rest = float(law.rest_length) * CM
    marks = {0.75 * rest: 0.0, 1.1 * rest: printed("static.max_tension")}
    ax.plot(list(marks), list(marks.values()), **MARK)
    ax.set_xlim(9.3, 15.7)
    ax.set_ylim(-30.0, 150.0)
    style.quantity_axes(ax, x=("Length, cm", "length"), y=("Tension, N", "tension"))
    title(ax, figure, "Linear model of the nylon muscle at 5 bar (eq. 12a)")
    numbers(
        ax,
        [
            entry("Stiffness", "static.stiffness_5bar", 2),
            entry("Stiffness", "static.stiffness_5bar_per_length"),
            entry("Tension, 1.1 L₀", "static.max_tension"),
            entry("No tension", "static.zero_tension_length", 2),
            entry("Work", "static.work_per_cycle", 2),
            entry("Pth", "static.threshold_pressure"),
            entry("Kp", "static.passive_stiffness"),
        ],
    )
    key(ax, [*(sample(w, **look | {"zorder": 1}) for w, _, look in terms), printed_key("paper, Table 1")])
    return fig


@style.styled()
def figure_6b(figure: str = "6b") -> Figure:
    """Ten points of the recordings, eq. 13 through them, and with the printed numbers."""
    points, fit = measured.ten_points(measured.LENGTH), measured.fits().corrected
    length, pressure, tension = (np.array([getattr(p, n) for p in points]) for n in ("length", "pressure", "tension"))
    fig, ax = panel(4.2, beside=3.1)
    law, span = linear(), np.linspace(length.min() - 0.004, length.max() + 0.003, 2)
    levels = sorted({round(float(p) * BAR) for p in pressure})
    for level in levels:
        ax.plot(span * CM, np.asarray(law.tension(span, level / BAR)), **PRINTED, zorder=2)
    cross: dict[str, Any] = {"ls": "none", "ms": 7.0, "mew": 1.4, "zorder": 6}
    ax.plot(length * CM, tension, marker="+", color=style.COLOURS["tension"], gid="tension", **cross)
    looks = MARK | {"ms": 8.5, "mfc": "none", "mec": style.INK_2, "mew": 0.9, "zorder": 5}
    ax.plot(length * CM, fit.tension(length, pressure), gid="eq. 13", **looks)
    ax.set_ylim(0.0, 84.0)
    ax.set_xlim(float(span[0]) * CM - 0.1, float(span[1]) * CM + 0.1)
    style.quantity_axes(ax, x=("Length, cm", "length"), y=("Tension, N", "tension"))
    other = right_axis(ax, "Pressure, bar", "pressure")
    other.plot(length * CM, pressure * BAR, marker="x", color=style.COLOURS["pressure"], gid="pressure", **cross)
    other.set_ylim(0.0, 7.0)
    title(ax, figure, "Eq. 13 through ten points, nylon muscle")
    beside = 34.0
    numbers(
        ax,
        [
            entry("Kg", "static.fit_Kg"),
            entry("Pa", "static.fit_Pa", 2),
            entry("Lmin", "static.fit_Lmin"),
            entry("Fa", "static.fit_Fa"),
            NumberEntry("rms, N", shown(fit.rms, 2)),
        ],
        dx=beside,
    )
    plain = {k: v for k, v in looks.items() if k != "zorder"}
    key(
        ax,
        [
            sample("sampled pressure", marker="x", color=style.COLOURS["pressure"], ls="none", ms=7.0, mew=1.4),
            sample("sampled tension", marker="+", color=style.COLOURS["tension"], ls="none", ms=7.0, mew=1.4),
            sample("eq. 13, fitted", **plain),
            printed_key("paper: eq. 13 at " + ", ".join(map(str, levels)) + " bar", line=True),
        ],
        dx=beside,
    )
    return fig


NO_FRICTION, POTENTIAL = style.RECORDING_DASHES[1], style.RECORDING_DASHES[2]
CYCLE_HEIGHT, ABOVE = 4.0, 36.0  # of the figures [inch], and of their titles over the axes [pt]


@style.styled()
def figure_12a() -> Figure:
    """Pressure over volume of the maximal cycle."""
    rows = [("ABCD", "energy.maximal.input"), ("A′BCD′", "energy.maximal.input_accumulator")]
    words = "Maximal shortening at constant pressure: compressor"
    return _cycles("12a", energy_figures.draw_piston, ("maximal",), words, rows)


@style.styled()
def figure_12b() -> Figure:
    """Tension over length of the maximal cycle."""
    rows = [
        ("Output", "energy.maximal.output"),
        ("Ea", "energy.maximal.efficiency"),
        ("Ea, accumulator", "energy.maximal.efficiency_accumulator"),
    ]
    return _cycles(
        "12b", energy_figures.draw_tendon, ("maximal",), "Maximal shortening at constant pressure: muscle", rows
    )


@style.styled()
def figure_12c() -> Figure:
    """Efficiency of the maximal cycle over pressure."""
    fig, ax = panel(CYCLE_HEIGHT, beside=3.85)
    # As printed, and with friction and the volume of the potential.
    looks = (
        ("paper", True, "-", style.INK),
        ("paper", False, NO_FRICTION, style.INK),
        ("potential", True, POTENTIAL, style.INK_3),
    )
    energy_figures.draw_efficiency(ax, _efficiency_lines(looks), _printed_marks())
    ax.set_ylim(0.0, 80.0)  # without friction and with the accumulator the threshold would come to 100 %
    title(ax, "12c", "Maximal shortening at constant pressure: efficiency Ea", above=ABOVE)
    rows = [
        ("Ea, 5 bar", "efficiency"),
        ("Ea, accumulator", "efficiency_accumulator"),
        ("Largest at", "best_pressure"),
        ("Largest Wa/W₁₂", "output_below_W12"),
    ]
    numbers(ax, [entry(words, f"energy.maximal.{name}") for words, name in rows], dx=82.0)
    key(
        ax,
        [
            sample("with 2.5 N of friction", color=style.INK, lw=style.LINE),
            sample("without", color=style.INK, ls=NO_FRICTION),
            sample("volume of the potential", color=style.INK_3, ls=POTENTIAL),
        ],
        dx=82.0,
    )
    return fig


def _efficiency_lines(looks: Sequence[tuple[str, bool, Any, str]]) -> list[energy_figures.EfficiencyLine]:
    """Curves of Fig. 12c for looks of a volume, of whether there is friction, a dash and a colour; the first has words."""
    lines: list[energy_figures.EfficiencyLine] = []
    for volume, friction, dash, colour in looks:
        for accumulator, words in ((False, "surroundings"), (True, "accumulator")):
            muscle, between = part4.muscle(volume), part4.conditions(accumulator=accumulator, friction=friction)
            low = 1e-3 + float(muscle.threshold())
            at = low + (10e5 - low) * np.linspace(0.0, 1.0, 121)[1:] ** 2  # dense where it rises
            curve = energy_curve(muscle, "maximal", at, between)
            lines.append(energy_figures.EfficiencyLine(words if len(lines) < 2 else "", curve, dash, colour))
    return lines


def _printed_marks() -> list[energy_figures.PrintedEfficiency]:
    """Printed efficiencies of the maximal cycle at 5 bar."""
    right, wrong = (part4.printed(f"maximal.efficiency{more}") for more in ("", "_accumulator"))
    joules = part4.printed("maximal.output") / part4.printed("maximal.input_accumulator")
    return [
        energy_figures.PrintedEfficiency(part4.PRESSURE, right, f"printed {100.0 * right:.0f} %"),
        energy_figures.PrintedEfficiency(
            part4.PRESSURE,
            wrong,
            f"printed {100.0 * wrong:.0f} %, from its joules {100.0 * joules:.0f} %",
            misprint=True,
        ),
    ]


@style.styled()
def figure_13a() -> Figure:
    """Pressure over volume of the isotonic cycles."""
    rows = [
        ("EFGH", "energy.isotonic.input"),
        ("E′FGH′", "energy.isotonic.input_accumulator"),
        ("EF′GH", "energy.valve.input"),
        ("E′F′GH′", "energy.valve.input_accumulator"),
    ]
    return _cycles("13a", energy_figures.draw_piston, ("isotonic", "valve"), "Isotonic shortening: compressor", rows)


@style.styled()
def figure_13b() -> Figure:
    """Tension over length of the isotonic cycles."""
    rows = [
        ("Output", "energy.isotonic.output"),
        ("Eb", "energy.isotonic.efficiency"),
        ("Eb, accumulator", "energy.isotonic.efficiency_accumulator"),
        ("Ec", "energy.valve.efficiency"),
        ("Ec, accumulator", "energy.valve.efficiency_accumulator"),
    ]
    return _cycles("13b", energy_figures.draw_tendon, ("isotonic", "valve"), "Isotonic shortening: muscle", rows)


def _cycles(
    figure: str,
    draw: Callable[[Axes, list[CycleLoops]], object],
    names: Sequence[str],
    words: str,
    rows: Sequence[tuple[str, str]],
) -> Figure:
    """Draw cycles at 5 bar, each exchanging gas with the surroundings and with the accumulator."""
    fig, ax = panel(CYCLE_HEIGHT)
    draw(ax, [cycle_loops(part4.muscle(), n, part4.conditions(accumulator=a)) for n in names for a in (False, True)])
    title(ax, figure, words, above=ABOVE)
    numbers(ax, [entry(w, r) for w, r in rows])
    return fig


MUSCLES = {"nylon": "Nylon shell", "fiberglass": "Fiberglass shell", "bridgestone": "Bridgestone"}
COLUMNS = (0.3, 2.5, 4.5, 6.3, 8.2)  # where the columns begin [inch]
ROW, HEAD, FOOT = 0.27, 0.95, 0.75  # [inch]


class TableEntry(NamedTuple):
    """Our value and the printed one as text, either empty.

    A mark as of `Entry`, or ``‡`` for values taken from the paper.
    """

    ours: str = ""
    paper: str = ""
    mark: str = ""


def cells() -> list[tuple[str, str, tuple[TableEntry, ...]]]:
    """The rows in the paper's order: property, unit, and a cell for each muscle and for biological muscle."""
    bio = computed.biological()
    ends = characteristics.dynamic_range(bio.active_curve)
    top, speed = style.number(computed.INTENSITY * from_si(1.0, "N/m^2", "N/cm^2")), style.number(computed.FASTEST)
    each = tuple(MUSCLES)
    blank = (TableEntry(), TableEntry())
    return [
        ("Resting length (L₀)", "cm", (*(_taken(style.number(rest_length(m) * CM)) for m in each), TableEntry())),
        (
            "Dynamic range",
            "L₀",
            (*(_range(m) for m in each), TableEntry(f"{ends.shortest:.3f}–{ends.longest:.3f}", "0.64–1.12")),
        ),
        ("Maximum tension", "N", (*(_cell(f"table1.{m}.max_tension") for m in each), TableEntry())),
        ("Stiffness", "N/L₀", (*(_cell(f"table1.{m}.stiffness") for m in each), TableEntry())),
        ("Work per cycle", "N L₀", (*(_cell(f"table1.{m}.work") for m in each), TableEntry())),
        ("Cross section area", "cm²", (*(_cell(f"table1.{m}.section_area") for m in each), TableEntry())),
        ("Tension intensity", "N/cm²", (*(_cell(f"table1.{m}.tension_intensity") for m in each), _taken(top))),
        (
            "Stiffness intensity",
            "N/(L₀ cm²)",
            (*(_cell(f"table1.{m}.stiffness_intensity") for m in each), _cell("biology.stiffness_intensity")),
        ),
        (
            "Work density per cycle",
            "J/cm³",
            (*(_cell(f"table1.{m}.work_density") for m in each), _cell("biology.work_density")),
        ),
        ("Coulomb friction", "N", (*(_cell(f"friction.{m}") for m in each), TableEntry("0", "0"))),
        ("Maximum velocity", "L₀/s", (_fastest(), *blank, _taken(f"2–8 or {speed}"))),
        ("Average power density", "W/cm³", (_cell("isotonic.mean_power_density"), *blank, TableEntry())),
        (
            "Peak power density",
            "W/cm³",
            (_cell("isotonic.peak_power_density"), *blank, _cell("biology.peak_power_density")),
        ),
        ("Energy efficiency", "-", (_efficiency(), *blank, TableEntry("", "0.2–0.25"))),
    ]


def _taken(words: str) -> TableEntry:
    return TableEntry(words, words, "‡")


def _cell(identifier: str, digits: int = 3) -> TableEntry:
    one = outcome(identifier)
    assert one.ours is not None
    return TableEntry(shown(one.ours, digits), as_printed(one.row.paper), mark(one.row))


def _range(muscle: str) -> TableEntry:
    """Working range: the lower end where the law's tension ends at 5 bar, the upper end as given."""
    column = computed.table1(muscle)
    shortest, upper = (v / column.rest_length for v in (column.zero_tension_length, column.upper_length))
    width = outcome(f"table1.{muscle}.dynamic_range").row.paper
    assert isinstance(width, float)
    return TableEntry(
        f"{shortest:.3f}–{upper:.2f}", f"{style.number(round(upper - width, 3))}–{style.number(round(upper, 3))}"
    )


def _fastest() -> TableEntry:
    """A velocity up to which no viscous friction was seen, so a lower limit."""
    cell = _cell("loop.max_velocity", 2)
    return TableEntry(f"> {cell.ours}", f"> {cell.paper}", cell.mark)


def _efficiency() -> TableEntry:
    """Range of efficiencies with the accumulator; 0.49 is the misprint of Part IV."""
    low, high = (outcome(f"energy.{name}.efficiency_accumulator") for name in ("valve", "maximal"))
    assert low.ours is not None and high.ours is not None
    words = "–".join(as_printed(o.row.paper) for o in (low, high))
    return TableEntry(f"{low.ours:.2f}–{high.ours:.2f}", words, "†")


@style.styled()
def table(figure: str) -> Figure:
    """Draw the table, our values in bold and the printed ones in brackets."""
    rows = cells()
    high = HEAD + ROW * len(rows) + FOOT
    fig = style.drawing(style.WIDE, high)
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    ax.set_xlim(0.0, style.WIDE)
    ax.set_ylim(high, 0.0)
    ax.text(COLUMNS[0], 0.25, label(figure), fontsize=style.NORMAL, fontweight="bold", va="center")
    words = "McKibben and biological muscles at 5 bar: ours, and printed in brackets"
    ax.text(COLUMNS[0] + 1.1, 0.25, words, fontsize=style.SMALL, color=style.INK_3, va="center")
    for x, words in zip(COLUMNS, ("", *MUSCLES.values(), "Biological muscles"), strict=True):
        ax.text(x, HEAD - 0.2, words, fontsize=style.SMALL, fontweight="bold", va="center", color=style.INK_2)
    lines = [HEAD - 0.05, HEAD + ROW * len(rows) + 0.02]
    for y in lines:
        ax.plot([COLUMNS[0], style.WIDE - 0.3], [y, y], color=style.INK_3, lw=0.8)
    for i, (words, unit, row) in enumerate(rows):
        y = HEAD + ROW * (i + 0.5)
        head = words if unit == "-" else f"{words}, {unit}"
        ax.text(COLUMNS[0], y, head, fontsize=style.SMALL, va="center_baseline", color=style.INK)
        for x, cell in zip(COLUMNS[1:], row, strict=True):
            _write(ax, x, y, cell)
        if i:
            ax.plot([COLUMNS[0], style.WIDE - 0.3], [HEAD + ROW * i] * 2, color=style.RULE, lw=style.HAIR, zorder=1)
    foot = (
        "* an input of ours was inferred from the print   ‡ ours is taken from the paper   "
        "† misprint: 2.59 J over 5.50 J is 0.471   § open",
        "Friction of fiberglass and Bridgestone and all powers come from recordings; their notes are with the rows.",
    )
    for i, words in enumerate(foot):
        ax.text(COLUMNS[0], high - FOOT + 0.28 + 0.2 * i, words, fontsize=style.SMALL, color=style.INK_3, va="center")
    return fig


def _write(ax: Axes, x: float, y: float, cell: TableEntry) -> None:
    look: dict[str, Any] = {"fontsize": style.SMALL, "va": "center_baseline"}
    paper = f"({cell.paper})" if cell.paper else ""
    if not cell.ours:
        ax.text(x, y, paper or "–", color=style.INK_3 if not paper else style.INK_2, **look)
        return
    first = ax.text(x, y, cell.ours + cell.mark.replace("†", ""), color=style.INK, fontweight="bold", **look)
    colour = style.CAUTION if cell.mark == "†" else style.INK_2
    style.beside(
        ax, paper + ("†" if cell.mark == "†" else ""), (1.0, 0.0), (6, 0), xycoords=first, va="bottom", color=colour
    )
