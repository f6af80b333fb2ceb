"""Figs. 1 and 2 of both papers: the muscle's geometry to scale, and the test machine as it is simulated."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mckibben.bench.rig_file import rig
from mckibben.muscles.braid import BraidShape, braid_of
from mckibben.muscles.build import law_from_specimen
from mckibben.muscles.laws.thick_wall import ThickWall
from mckibben.pneumatics.tubes import inertance
from mckibben.quantities import from_si
from mckibben.report.figures import bench_diagram, circuit_diagram, style
from mckibben.report.figures.muscle_figures import muscle_drawing
from mckibben.report.figures.style import COLOURS, INK, INK_2, INK_3, PANEL, number
from mckibben.specimens import specimen
from mckibben.studies.tube_models import AREA, LARGE, PERIOD, SMALL, TubeModelResult
from mckibben.studies.tube_study import QUICK_THERMALS

from . import computed
from .figure_parts import (
    BESIDE,
    NumberEntry,
    as_printed,
    entry,
    key,
    label,
    numbers,
    printed,
    sample,
    shown,
    stack,
    title,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


TRIANGLE = 2.9  # height of the part below the muscle [inch]
SHORT = 0.75  # of the rest length
CM = from_si(1.0, "m", "cm")


@style.styled()
def geometry(figure: str) -> Figure:
    """Draw the nylon muscle at rest and shortened, and its thread unrolled: a triangle of b, L and n pi D."""
    spec = specimen("nylon")
    law, rest = law_from_specimen(spec, "thick_wall"), spec.property_si("rest_length", "m")
    shape = braid_of(law)
    assert isinstance(law, ThickWall) and shape is not None
    lengths = [rest, SHORT * rest]
    fig = muscle_drawing(
        shape, lengths, title=f"{label(figure)}  Geometry of the nylon muscle", remarks=["at rest", "0.75 L₀"]
    )
    wide, tall = fig.get_size_inches()
    high = tall + TRIANGLE
    fig.set_size_inches(wide, high)
    fig.axes[0].set_position((0.0, TRIANGLE / high, 1.0, tall / high))
    room = wide - BESIDE - 0.4
    ax = fig.add_axes((0.2 / wide, 0.15 / high, room / wide, (TRIANGLE - 0.3) / high))
    ax.set_axis_off()
    ax.set_aspect("equal", anchor="NW")
    for length, strength in zip(lengths, (1.0, 0.45), strict=True):
        _triangle(ax, shape, length * CM, strength)
    threads = shape.thread_length * CM
    ax.set_xlim(-1.0, threads + 0.6)
    ax.set_ylim(-3.0, 13.0)
    diameter = threads / (shape.turns * math.pi)
    numbers(
        ax,
        [
            NumberEntry("Thread b, cm", shown(threads, 4) + "‡"),
            NumberEntry("Turns n", shown(shape.turns, 4) + "‡"),
            NumberEntry("D₀ = b/(n π), cm", shown(diameter), "1.66"),
            NumberEntry("Wall tk, cm", shown(float(law.wall_thickness) * CM), "0.0762"),
            *(NumberEntry(f"θ at {number(v * CM)} cm, °", shown(shape.degrees(v))) for v in lengths),
        ],
        remarks=("‡ not printed: inferred from Kg and D₀",),
    )
    return fig


def _triangle(ax: Axes, shape: BraidShape, length: float, strength: float) -> None:
    """Draw one unrolled thread: its length b, along the muscle L, and n turns of the circumference [cm]."""
    from matplotlib.patches import Arc

    threads = shape.thread_length * CM
    around = math.sqrt(threads**2 - length**2)
    look: dict[str, Any] = {"alpha": strength, "solid_capstyle": "round"}
    ax.plot([0.0, length], [0.0, 0.0], color=COLOURS["length"], lw=style.HEAVY, **look)
    ax.plot([length, length], [0.0, around], color=INK_2, lw=style.LINE, **look)
    ax.plot([0.0, length], [0.0, around], color=INK, lw=style.HEAVY, **look)
    angle = math.degrees(math.atan2(around, length))
    size = 4.2 if strength == 1.0 else 5.6
    ax.add_patch(Arc((0.0, 0.0), size, size, theta1=0.0, theta2=angle, color=INK_3, lw=0.9, alpha=strength))
    if strength < 1.0:
        return
    half = math.radians(0.5 * angle)
    words: dict[str, Any] = {"fontsize": style.NORMAL, "color": INK, "ha": "center", "va": "center"}
    ax.text(2.9 * math.cos(half), 2.9 * math.sin(half), "θ", **words)
    ax.text(0.5 * length, -0.9, f"L = {number(length)} cm", **words | {"color": COLOURS["length"]})
    ax.text(length + 0.35, 0.42 * around, f"n π D = {number(around, 1)} cm", **words | {"ha": "left"})
    slope = math.degrees(math.atan2(around, length))
    ax.text(
        0.47 * length + 0.45,
        0.47 * around - 0.75,
        f"b = {number(threads)} cm",
        **words | {"rotation": slope},
        rotation_mode="anchor",
    )
    ax.text(0.5 * length, -2.1, "grey: the same thread at 0.75 L₀", **words | {"fontsize": style.SMALL, "color": INK_3})


@style.styled()
def machine(figure: str) -> Figure:
    """Draw hardware and software of the simulated test machine."""
    return bench_diagram.draw(rig("paper"), title=f"{label(figure)}  Dynamic testing machine")


BAR = from_si(1.0, "Pa", "bar")
LOOKS: dict[str, dict[str, Any]] = {
    "input": {"color": INK_3, "lw": 0.9, "ls": (0, (9, 2, 1.5, 2))},
    "reference": {"color": COLOURS["pressure"], "lw": 2.2, "ls": (0, (3.5, 1.6)), "alpha": 0.75},
    "simulation": {"color": INK, "lw": 0.9, "ls": "-"},
}
# Legends of Figs. 8 and 9: R1 [bar s/cm], R2 [bar s2/cm2]; no rows of their own.
PRINTED = {"8a": (4.91e-6, 2.07e-8), "8b": (4.50e-6, 2.61e-8), "9a": (4.91e-6, 2.07e-8), "9b": (4.91e-6, 2.07e-8)}
TITLES = {LARGE: "10 in³ accumulator", SMALL: "3 in³ accumulator"}


# ---- Fig. 7


@style.styled()
def figure_7a() -> Figure:
    """Draw the circuit as in the simulated machine."""
    bench = rig("paper")
    plumbing = bench.plumbing["10 in3"]
    circuit = plumbing.circuit({}, bench.environment)
    small = bench.plumbing["3 in3"].muscle_accumulator * from_si(1.0, "m^3", "cm^3")
    large = plumbing.muscle_accumulator * from_si(1.0, "m^3", "cm^3")
    subtitles = {
        "valve": "600 l/min at 6.9 bar",
        "port": "sensor of P₁",
        "accumulator": f"{float(large):.0f} or {float(small):.0f} cm³, sensor of P₂",
    }
    return circuit_diagram.draw(circuit, title="Fig. 7a  Valve, tube and accumulator", subtitles=subtitles)


@style.styled()
def figure_7b() -> Figure:
    """Resistance and capacity."""
    return _ladder("7b", "Quadratic model: resistance and capacity (eqs. 18, 20)", inertia=False)


@style.styled()
def figure_7c() -> Figure:
    """Resistance, inertia and capacity."""
    return _ladder("7c", "Inertial model: with the inertia of the gas (eqs. 18, 31)", inertia=True)


def _ladder(figure: str, words: str, *, inertia: bool) -> Figure:
    from matplotlib.patches import Circle

    fig, (ax,) = stack([1.0], 3.1)
    ax.set_axis_off()
    ax.set_xlim(0.0, 100.0)
    ax.set_ylim(0.0, 52.0)
    wire: dict[str, Any] = {"color": INK, "lw": style.LINE, "solid_capstyle": "round", "solid_joinstyle": "round"}
    line, ground, source, store = 38.0, 8.0, 10.0, 88.0
    parts = [(24.0, 44.0), (54.0, 74.0)] if inertia else [(36.0, 60.0)]
    x = source
    for begin, end in parts:
        ax.plot([x, begin], [line, line], **wire)
        x = end
    ax.plot([x, store], [line, line], **wire)
    begin, end = parts[0]
    zig = np.array([0.0, 1, -1, 1, -1, 1, -1, 0]) * 3.2
    ax.plot(begin + (end - begin) * np.array([0.0, 1, 3, 5, 7, 9, 11, 12]) / 12.0, line + zig, **wire)
    ax.annotate(
        "",
        (end - 1.0, line + 8.0),
        (begin + 1.0, line - 8.0),
        arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 0.8},
    )
    _words(ax, 0.5 * (begin + end), line + 10.0, "R₁, R₂")
    if inertia:
        begin, end = parts[1]
        turn = np.linspace(0.0, 4.0 * np.pi, 161)
        ax.plot(begin + (end - begin) * turn / turn[-1], line + 4.0 * np.abs(np.sin(turn)), **wire)
        _words(ax, 0.5 * (begin + end), line + 10.0, "L = l/A")
    ax.plot([source, source], [line, ground], **wire)
    ax.plot([source, store], [ground, ground], **wire)
    middle = 0.5 * (line + ground)
    ax.add_patch(Circle((source, middle), 5.0, fc=PANEL, ec=INK, lw=style.LINE, zorder=3))
    _words(ax, source, middle, "P₁")
    for y in (middle + 1.6, middle - 1.6):
        ax.plot([store - 7.0, store + 7.0], [y, y], **wire | {"lw": 2.0})
    ax.plot([store, store], [line, middle + 1.6], **wire)
    ax.plot([store, store], [middle - 1.6, ground], **wire)
    _words(ax, store + 10.0, middle, "C", ha="left")
    ax.plot([store], [line], "o", ms=4.5, color=INK)
    _words(ax, store, line + 5.0, "P₂")
    for i, wide in enumerate((7.0, 4.6, 2.2)):
        ax.plot([49.0 - wide, 49.0 + wide], [ground - 3.0 - 2.2 * i] * 2, **wire)
    ax.plot([49.0, 49.0], [ground, ground - 3.0], **wire)
    ax.annotate(
        "",
        (20.0, line - 6.0),
        (13.0, line - 6.0),
        arrowprops={"arrowstyle": "-|>", "color": COLOURS["flow"], "lw": 1.2},
    )
    ax.text(
        16.5, line - 9.5, "w", color=COLOURS["flow"], ha="center", va="top", fontsize=style.NORMAL, fontweight="bold"
    )
    entries = [entry("C, 10 in³", "tube.capacitance_10in3"), entry("C, 3 in³", "tube.capacitance_3in3")]
    if inertia:
        entries += [entry("L", "tube.inertance"), entry("L", "tube.inertance_per_cm")]
    numbers(ax, entries)
    title(ax, figure, words)
    return fig


def _words(ax: Axes, x: float, y: float, words: str, *, ha: str = "center") -> None:
    ax.text(x, y, words, ha=ha, va="center", fontsize=style.NORMAL + 1.0, color=INK, zorder=4)


# ---- Figs. 8 and 9


class Pressures(NamedTuple):
    """Choice of a figure: model, accumulator, and whether the model was refitted there."""

    model: str
    accumulator: str
    refitted: bool = False

    def result(self) -> TubeModelResult:
        """Result of the study."""
        return computed.tube_fits().result(QUICK_THERMALS[0], self.model, self.accumulator, refitted=self.refitted)


@style.styled()
def figure_8a() -> Figure:
    """Quadratic model, large accumulator."""
    shows = Pressures("quadratic", LARGE)
    return _responses(
        "8a", shows, "fitted", [entry("rms", "tube.quadratic_rms_10in3"), entry("Lead", "tube.quadratic_lead")]
    )


@style.styled()
def figure_8b() -> Figure:
    """Quadratic model, small accumulator, refitted."""
    return _responses("8b", Pressures("quadratic", SMALL, True), "refitted", [entry("rms", "tube.quadratic_rms_3in3")])


@style.styled()
def figure_9a() -> Figure:
    """Inertial model, large accumulator."""
    return _responses("9a", Pressures("inertial", LARGE), "fitted", [entry("rms", "tube.inertial_rms_10in3")])


@style.styled()
def figure_9b() -> Figure:
    """Draw the inertial model, small accumulator, with its parameters kept."""
    words = "with the parameters of 10 in³"
    return _responses("9b", Pressures("inertial", SMALL), words, [entry("rms", "tube.inertial_rms_3in3")])


def _responses(figure: str, shows: Pressures, words: str, entries: list[NumberEntry]) -> Figure:
    """Draw pressure before and behind the tube, and of the model, on a record of noise and one of steps."""
    fig, axes = stack([1.0, 1.0], 5.6, wide=style.WIDE, beside=3.0, gap=0.5)
    result = shows.result()
    cases = computed.tube_fits().cases[QUICK_THERMALS[0], shows.accumulator]
    for ax, case, compared in zip(axes, cases, result.comparisons, strict=True):
        time, zero = PERIOD * np.arange(len(case.supply)), case.supply.min()
        ax.plot(time, (case.supply - zero) * BAR, zorder=2, gid="input", **LOOKS["input"])
        ax.plot(time, (compared.predicted - zero) * BAR, zorder=4, gid="simulation", **LOOKS["simulation"])
        ax.plot(time, (case.vessel - zero) * BAR, zorder=3, gid="reference", **LOOKS["reference"])
        ax.set_ylim(-0.2, 5.3)
        last = ax is axes[-1]
        rise = float(time[np.argmax(case.supply)])
        ax.set_xlim(*((rise - 0.1, rise + 0.9) if last else (0.0, time[-1])))
        y = "" if last else "Gauge pressure, bar"
        style.quantity_axes(ax, x=("Time, s" if last else "", None), y=(y, "pressure"))
    style.note(axes[1], "steps, expanded in time", x=1.0, y=1.0, ha="right", dx=-3, dy=6)
    model = {"quadratic": "Quadratic model", "inertial": "Inertial model"}[shows.model]
    title(axes[0], figure, f"{model}, {TITLES[shows.accumulator]}, {words}")
    large = shows.accumulator == LARGE
    first = entry("C", f"tube.capacitance_{'10in3' if large else '3in3'}")
    numbers(axes[0], [first, *_resistances(figure, shows), *entries], remarks=REMARKS)
    key(
        axes[1],
        [
            sample("P₁, in front of the tube", **LOOKS["input"]),
            sample("P₂, distributed tube", **LOOKS["reference"]),
            sample("P₂, model", **LOOKS["simulation"]),
        ],
    )
    return fig


REMARKS = (
    "The paper's numbers are of its own",
    "pressures, which are not published;",
    "ours of noise and steps, with the",
    "distributed tube for the measured P₂.",
)


def _resistances(figure: str, shows: Pressures) -> list[NumberEntry]:
    fitted = shows if shows.refitted or shows.accumulator == LARGE else shows._replace(accumulator=LARGE)
    result = fitted.result()
    r1 = from_si(result.value("viscous"), "Pa*s/m", "bar*s/cm")
    r2 = from_si(result.value("turbulent"), "Pa*s^2/m^2", "bar*s^2/cm^2")
    both = zip(("R₁, bar s/cm", "R₂, bar s²/cm²"), (r1, r2), PRINTED[figure], strict=True)
    entries = [NumberEntry(words, shown(value), shown(paper)) for words, value, paper in both]
    if shows.model == "inertial":
        whole = from_si(float(inertance(length=result.value("length"), area=AREA)), "Pa*s^2/kg", "bar*s^2/g")
        entries.append(NumberEntry("L, bar s²/g", shown(whole), as_printed(printed("tube.inertance"))))
    return entries
