"""Figures of working cycles: pressure over volume, tension over length, and efficiency (Figs. 12 and 13 of the paper)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...analysis.energy import CycleLoops, CyclePath, EnergyCurve
from ...analysis.energy_parts import EnergyAccount
from ...quantities import from_si
from . import formats, style
from .style import CAUTION, COLOURS, INK, INK_2, INK_3, PANEL, SMALL, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


HEIGHT, LEFT, FOOT, TOP = 3.75, 0.45, 0.5, 0.82  # [inch]
FILL = 0.13
# Where the letter of a corner stands, right of it and above [pt]; free of both curves.
BESIDE_PISTON = {
    "A": (5, -9),
    "B": (7, 7),
    "C": (-7, 7),
    "D": (-8, -6),
    "A'": (8, 7),
    "D'": (10, 7),
    "E": (5, -9),
    "F": (9, 5),
    "G": (-7, 7),
    "H": (-8, -6),
    "E'": (8, 7),
    "H'": (10, 7),
    "F'": (4, 9),
}
BESIDE_TENDON = {
    "A": (9, -3),
    "B": (8, 6),
    "C": (-7, -6),
    "D": (2, -9),
    "E": (9, -3),
    "F": (8, 6),
    "G": (-7, 7),
    "H": (-8, -6),
}
HALO = {"boxstyle": "square,pad=0.15", "fc": PANEL, "ec": "none", "alpha": 0.85}
SHORTENING = {True: "Maximal shortening at constant pressure", False: "Isotonic shortening"}


class EfficiencyLine(NamedTuple):
    """A curve of efficiency with an optional label; the dash distinguishes curves."""

    words: str
    curve: EnergyCurve
    dash: Any = "-"
    colour: str = INK


class PrintedEfficiency(NamedTuple):
    """A printed efficiency [1] at a gauge pressure [Pa], with a label, and whether it is a misprint."""

    pressure: float
    efficiency: float
    words: str
    misprint: bool = False


# ---- figures


@style.styled()
def loops_figure(loops: Sequence[CycleLoops], *, title: str) -> Figure:
    """Draw cycles as closed paths, piston on the left and tendon on the right; maximal above, isotonic below.

    Args:
        loops: from `cycle_loops`; those of one muscle with and without an accumulator may be given together.
        title: title of the muscle.
    """
    rows = [r for r in ([p for p in loops if p.name == "maximal"], [p for p in loops if p.name != "maximal"]) if r]
    tall = HEIGHT * len(rows)
    fig = style.figure(style.WIDE * 0.8, tall)
    for i, row in enumerate(rows):
        for ax, draw in zip(
            _row(fig, (1.12, 1.0), HEIGHT * (len(rows) - 1 - i)), (draw_piston, draw_tendon), strict=True
        ):
            draw(ax, row)
        shortening = SHORTENING[row[0].name == "maximal"]
        style.heading(fig.axes[2 * i], title if i == 0 else shortening, shortening if i == 0 else "", above=40.0)
    return fig


@style.styled()
def efficiency_figure(lines: Sequence[EfficiencyLine], *, title: str) -> Figure:
    """Draw efficiency over supply pressure, one line per curve."""
    fig = style.figure(style.MIDDLE, HEIGHT)
    ax = fig.add_axes((0.07, FOOT / HEIGHT, 0.77, (HEIGHT - FOOT - TOP) / HEIGHT))
    draw_efficiency(ax, lines)
    style.heading(ax, title, above=40.0)
    return fig


def _row(fig: Figure, shares: tuple[float, ...], above: float) -> list[Axes]:
    """Place panels side by side, `above` the lower edge of the figure [inch]."""
    wide, tall = fig.get_size_inches()
    gap = 0.62
    room = (wide - LEFT - 0.25 - gap * (len(shares) - 1)) / sum(shares)
    x, panels = LEFT, []
    for share in shares:
        panels.append(
            fig.add_axes((x / wide, (above + FOOT) / tall, share * room / wide, (HEIGHT - FOOT - TOP) / tall))
        )
        x += share * room + gap
    return panels


# ---- panels


def draw_piston(ax: Axes, loops: Sequence[CycleLoops]) -> None:
    """Draw absolute pressure over the volume of piston and stretched muscle; the filled area is the input."""
    ml, bar = from_si(1.0, "m^3", "cm^3"), from_si(1.0, "Pa", "bar")
    first = loops[0]
    paths = [(p, p.piston.x * ml, p.piston.y * bar) for p in loops]
    right, top = max(float(x.max()) for _, x, _ in paths), max(float(y.max()) for *_, y in paths)
    ax.set_xlim(0.0, 1.04 * right)
    ax.set_ylim(0.0, 1.16 * top)
    style.quantity_axes(
        ax, x=("Volume of piston and stretched muscle, cm³", None), y=("Absolute pressure, bar", "pressure")
    )
    style.heading(ax, "Air", "the input is the area", above=20.0)
    blue = COLOURS["pressure"]
    ax.fill(*paths[0][1:], color=blue, alpha=FILL, lw=0, zorder=1)
    for loop, x, y in paths:
        valve, main = loop.name == "valve", loop is first
        if valve and first.name == "isotonic" and loop.conditions == first.conditions:
            _wasted(ax, first.piston, loop, ml, bar)
        dash = "-" if main else style.RECORDING_DASHES[1 if loop.conditions.exchange_pressure else 2]
        ax.plot(x, y, color=blue, lw=style.LINE + (0.4 if main else 0.0), ls=dash, zorder=3 if main else 2)
    _corners(ax, [p.piston for p in loops], (ml, bar), BESIDE_PISTON)
    if first.name == "maximal":
        _parts(ax, first, ml, bar)
    _areas(ax, [(_word(p.piston), p.cycle.input) for p in loops])


def draw_tendon(ax: Axes, loops: Sequence[CycleLoops]) -> None:
    """Draw tension over length; the filled area is the output."""
    cm, first = from_si(1.0, "m", "cm"), loops[0]
    x, y = first.tendon.x * cm, first.tendon.y
    room = 0.07 * float(np.ptp(x))
    ax.set_xlim(float(x.min()) - room, float(x.max()) + 1.3 * room)
    ax.set_ylim(-0.1 * float(y.max()), 1.16 * float(y.max()))
    style.quantity_axes(ax, x=("Length, cm", "length"), y=("Tension, N", "tension"))
    style.heading(ax, "Tendon", "the output is the area", above=20.0)
    ax.fill(x, y, color=COLOURS["tension"], alpha=FILL, lw=0, zorder=1)
    ax.plot(x, y, color=COLOURS["tension"], lw=style.LINE + 0.4, zorder=3)
    _corners(ax, [first.tendon], (cm, 1.0), BESIDE_TENDON)
    said = [(_word(first.tendon), first.cycle.output)]
    for other in loops[1:]:
        if abs(other.cycle.output - first.cycle.output) > 5e-4 * abs(first.cycle.output):
            ax.plot(
                other.tendon.x * cm, other.tendon.y, color=COLOURS["tension"], ls=style.RECORDING_DASHES[1], zorder=2
            )
            said.append((_word(other.tendon), other.cycle.output))
    _areas(ax, said, left=True)


def draw_efficiency(ax: Axes, lines: Sequence[EfficiencyLine], marks: Sequence[PrintedEfficiency] = ()) -> None:
    """Draw efficiency over supply pressure, where it is not negative; printed values as marks."""
    bar = from_si(1.0, "Pa", "bar")
    top = max(float(np.nanmax(line.curve.cycles.efficiency)) for line in lines)
    top = 100.0 * max([top, *(m.efficiency for m in marks)])
    ax.set_xlim(0.0, max(float(line.curve.pressure[-1]) for line in lines) * bar)
    ax.set_ylim(0.0, 1.12 * top)
    style.quantity_axes(ax, x=("Gauge pressure of the supply, bar", "pressure"), y=("Efficiency, %", None))
    style.heading(ax, "Over pressure", above=20.0)
    ends = []
    for line in lines:
        x, y = line.curve.pressure * bar, 100.0 * line.curve.cycles.efficiency
        ax.plot(x, y, color=line.colour, ls=line.dash, lw=style.LINE + 0.2, zorder=3)
        ends += [(float(x[-1]), float(y[-1]), line.words)] * bool(line.words)
    for mark in marks:
        at, share = mark.pressure * bar, 100.0 * mark.efficiency
        look: dict[str, Any] = (
            {"marker": "x", "mec": CAUTION} if mark.misprint else {"marker": "o", "mec": INK, "mfc": PANEL}
        )
        ax.plot([at], [share], ls="none", ms=6.5, mew=1.4, zorder=5, **look)
        style.beside(
            ax,
            mark.words,
            (at, share),
            (7, 6 if mark.misprint else -13),
            color=CAUTION if mark.misprint else INK,
            zorder=6,
        )
    style.end_labels(ax, ends, quantity=None, bold=False)


# ---- what stands in a panel


def _word(path: CyclePath) -> str:
    return "".join(path.corners).replace("'", "′")


def _corners(
    ax: Axes, paths: Sequence[CyclePath], scale: tuple[float, float], beside: Mapping[str, tuple[int, int]]
) -> None:
    drawn: list[str] = []
    for path in paths:
        for letter, i in path.corners.items():
            if letter in drawn:
                continue
            drawn.append(letter)
            at = float(path.x[i]) * scale[0], float(path.y[i]) * scale[1]
            ax.plot(*at, "o", ms=4.0, mfc=INK, mec=PANEL, mew=0.6, zorder=6, clip_on=False)
            style.beside(
                ax,
                letter.replace("'", "′"),
                at,
                beside.get(letter, beside[letter[0]]),
                ha="center",
                va="center",
                fontsize=SMALL + 0.5,
                fontweight="bold",
                color=INK,
                zorder=7,
                annotation_clip=False,
            )


def _parts(ax: Axes, loop: CycleLoops, ml: float, bar: float) -> None:
    """Draw the line at V1 that divides the input into compression and shortening (eqs. 34 and 39)."""
    i, low = loop.piston.corners["B"], float(loop.piston.y.min()) * bar
    x, high = float(loop.piston.x[i]) * ml, float(loop.piston.y[i]) * bar
    ax.plot([x, x], [low, high], color=INK_2, lw=0.8, ls=(0, (4, 2)), zorder=2)
    rest = loop.cycle.stretched_volume * ml
    middle = 0.5 * (low + high)
    ax.text(0.5 * (x + rest), middle, "$W_{12}$", ha="center", va="center", fontsize=SMALL + 0.5, color=INK_2)
    across = x + 0.13 * (float(loop.piston.x.max()) * ml - x)
    isotherm = float(np.interp(across, loop.piston.x[: i + 1][::-1] * ml, loop.piston.y[: i + 1][::-1] * bar))
    ax.text(
        across, low + 0.55 * (isotherm - low), "$W_{01}$", ha="center", va="center", fontsize=SMALL + 0.5, color=INK_2
    )


def _wasted(ax: Axes, isotonic: CyclePath, valve: CycleLoops, ml: float, bar: float) -> None:
    """Draw the loss in the valve, the area between both paths: FF'G, and a sliver below F where the bladder fills."""
    end, corner = isotonic.corners["G"] + 1, valve.piston.corners["F'"] + 1
    x = np.concatenate([isotonic.x[:end][::-1], valve.piston.x[:corner]])
    y = np.concatenate([isotonic.y[:end][::-1], valve.piston.y[:corner]])
    ax.fill(x * ml, y * bar, fc="none", ec=INK_3, hatch="////", lw=0, zorder=1.5)
    high, left, right = float(y.max()) * bar, float(isotonic.x[end - 1]) * ml, float(valve.piston.x[corner - 1]) * ml
    ax.annotate(
        f"FF′G {number(valve.cycle.throttling, 2)} J throttled",
        (0.5 * (left + right), 0.97 * high),
        (right + 0.07 * ax.get_xlim()[1], 0.99 * high),
        textcoords="data",
        fontsize=SMALL,
        color=INK_2,
        va="center",
        arrowprops={"arrowstyle": "-", "color": INK_3, "linewidth": 0.6},
        bbox=HALO,
    )


def _areas(ax: Axes, said: Sequence[tuple[str, float]], *, left: bool = False) -> None:
    for i, (word, joules) in enumerate(said):
        style.note(
            ax,
            f"{word}  {number(joules, 2)} J",
            x=0.1 if left else 0.985,
            y=0.8 if left else 0.74,
            dy=-13.0 * i,
            ha="left" if left else "right",
            color=INK,
            bbox=HALO,
            zorder=8,
        )


FLOW_WIDTH, FLOW_HEIGHT = 8.4, 6.6  # [inch]
LEAST_FLOW = 4.6  # width, below which the labels of streams are shorter [inch]
IN_MUSCLE, BACK_TO_GAS = "work in the muscle", "work back to the gas"
MUSCLE = ("shaft_work", "friction", "viscous", "tendon", "muscle", "other_walls")
WORDS = {
    "supply": "supply",
    "machines": "compressors",
    "walls": "warm walls",
    "valve": "valve",
    "tube": "tube",
    "way_in": "valve and tube, on the way in",
    "dead_volume": "dead volume",
    "exhaust": "exhaust",
    "leak": "leak",
    "machine": "compressor losses",
    "mixing": "mixing of hot and cold",
    "heat": "heat to the walls",
    "other_walls": "other walls",
    "friction": "friction",
    "viscous": "damping",
    "shaft_work": "shaft work",
    "gas": "stored in the gas",
    "muscle": "stored in bladder and braid",
    "tendon": "stored in tendon and end",
    "remainder": "remainder",
}
BACK = {
    "shaft_work": "work of the load",
    "gas": "taken from the gas",
    "muscle": "from bladder and braid",
    "tendon": "from tendon and end",
    "supply": "given back to the supply",
}
# Quantity whose colour a stream has, and a hatch by which it is told in grey.
LOOKS: dict[str, tuple[str, str]] = {
    "supply": ("pressure", ""),
    "valve": ("valve", "////"),
    "tube": ("valve", "////"),
    "way_in": ("valve", "////"),
    "dead_volume": ("flow", "...."),
    "exhaust": ("flow", ""),
    "leak": ("flow", "...."),
    "shaft_work": ("tension", ""),
    "friction": ("valve", "xxxx"),
    "viscous": ("valve", "xxxx"),
    "mixing": ("valve", ""),
    "heat": ("valve", ""),
    "gas": ("pressure", "----"),
    "muscle": ("length", "----"),
    "tendon": ("length", "----"),
    IN_MUSCLE: ("tension", ""),
}
LEAST = 5e-4  # share of the whole below which a stream is listed and not drawn


class DrawnStream(NamedTuple):
    """A stream, above zero [J], with a key and a label."""

    key: str
    words: str
    value: float


class Streams(NamedTuple):
    """Streams that enter on the left and leave on the right; both sums are equal."""

    into: tuple[DrawnStream, ...]
    out: tuple[DrawnStream, ...]

    @property
    def whole(self) -> float:
        """Total energy of the streams [J]."""
        return sum(s.value for s in self.into)


def streams(account: EnergyAccount) -> tuple[Streams, Streams]:
    """Streams of the gas and of the muscle; a negative part is drawn on the opposite side with its absolute value."""
    gas: tuple[list[DrawnStream], list[DrawnStream]] = ([], [])
    muscle: tuple[list[DrawnStream], list[DrawnStream]] = ([], [])
    work = 0.0
    for part in account.parts:
        inside = part.name in MUSCLE
        if inside:
            work += part.value if part.side != "into" else -part.value
        sides = muscle if inside else gas
        forward = (part.value > 0.0) != (part.side == "into")
        if part.value:
            words = "the friction's springs" if (part.name, part.side) == ("friction", "stored") else WORDS[part.name]
            back = forward is (part.side == "into") and part.name in BACK
            sides[forward].append(DrawnStream(part.name, BACK[part.name] if back else words, abs(part.value)))
    if work:
        passed = DrawnStream(IN_MUSCLE, IN_MUSCLE if work > 0.0 else BACK_TO_GAS, abs(work))
        gas[work > 0.0].append(passed)
        muscle[work < 0.0].append(passed)
    return Streams(*map(tuple, gas)), Streams(*map(tuple, muscle))


@style.styled()
def energy_flow_figure(account: EnergyAccount, *, title: str = "Where the exergy went") -> Figure:
    """Draw the streams of an account of `analysis.energy_accounts`."""
    _, muscle = streams(account)
    fig = style.figure(FLOW_WIDTH, FLOW_HEIGHT)
    upper = fig.add_axes((0.02, 0.44, 0.96, 0.46))
    lower = fig.add_axes((0.02, 0.05, 0.96, 0.27))
    supply, size = _supply(account), draw_gas_streams(upper, account, title=title)
    width = _draw(lower, muscle, supply)
    grown = f"magnified {number(width / size, 0)} times" if size > 0.0 and width >= 2.0 * size else ""
    style.heading(lower, "The muscle", grown, above=16.0)
    return fig


def draw_gas_streams(ax: Axes, account: EnergyAccount, *, title: str = "Where the exergy went") -> float:
    """Draw the streams of the gas into empty axes; returns how wide a stream of 1 J is [pixels]."""
    size = _draw(ax, streams(account)[0], _supply(account))
    kind = "integrals of the run" if account.parts[0].origin == "integral" else account.parts[0].origin
    style.heading(ax, title, f"exergy in J, share of the supply; {kind}", above=16.0)
    return size


def _supply(account: EnergyAccount) -> float:
    return sum(p.value for p in account.parts if p.name == "supply")


def _draw(ax: Axes, streams: Streams, supply: float) -> float:
    """Draw into empty axes; return the width of a stream of 1 J [pixels]."""
    from matplotlib.patches import Rectangle

    ax.set_axis_off()
    ax.set_xlim(0.0, 1.0)
    whole = streams.whole
    if not whole > 0.0:
        ax.text(0.0, 0.5, "nothing passed", fontsize=SMALL, color=INK_2)
        return 0.0
    drawn = [s for s in streams.out if s.value >= LEAST * whole]
    small = [s for s in (*streams.into, *streams.out) if s.value < LEAST * whole]
    gap = max(0.035, 0.4 / (len(drawn) + 6)) * whole
    height = whole + gap * max(len(drawn) - 1, 0)
    ax.set_ylim(-0.06 * height, 1.02 * height)
    middle = 0.5 * (height - whole)
    sources = [s for s in streams.into if s.value >= LEAST * whole]
    y = middle
    for one in sorted(sources, key=lambda s: s.value):
        _ribbon(ax, (0.17, y, 0.27, y), one)
        _label(ax, 0.16, y + 0.5 * one.value, one, supply, "right")
        y += one.value
    ax.add_patch(Rectangle((0.27, middle), 0.012, whole, facecolor=INK, edgecolor="none", zorder=3))
    left, right, ends = middle, 0.0, []
    for one in sorted(drawn, key=lambda s: s.value):
        _ribbon(ax, (0.282, left, 0.64, right), one)
        ends.append((one, right + 0.5 * one.value))
        left += one.value
        right += one.value + gap
    box = ax.get_window_extent()
    apart = 11.5 * ax.figure.dpi / 72.0 / box.height * 1.08 * height
    for (one, at), place in zip(ends, style.spread([e[1] for e in ends], apart, 0.0, height), strict=True):
        ax.plot([0.641, 0.66], [at, place], color=style.INK_3, lw=0.5, clip_on=False)
        _label(ax, 0.665, place, one, supply, "left")
    if small:
        names = ", ".join(dict.fromkeys(s.words for s in small))
        style.note(ax, f"below {100 * LEAST:.2g} %: {names}", x=0.0, y=0.0, dy=-6.0)
    return float(box.height / (1.08 * height))


def _ribbon(ax: Axes, ends: tuple[float, float, float, float], one: DrawnStream) -> None:
    """Draw a stream from (x, y) to (x, y), its lower edge."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    x0, y0, x1, y1 = ends
    bend = 0.5 * (x1 - x0)
    edge = [(x0, y0), (x0 + bend, y0), (x1 - bend, y1), (x1, y1)]
    back = [(x, y + one.value) for x, y in reversed(edge)]
    curve = [Path.CURVE4] * 3
    path = Path([*edge, *back, edge[0]], [Path.MOVETO, *curve, Path.LINETO, *curve, Path.CLOSEPOLY])
    quantity, hatch = LOOKS.get(one.key, ("valve", ""))
    look: dict[str, Any] = {"facecolor": COLOURS[quantity], "alpha": 0.62 if not hatch else 0.4}
    if one.key == "remainder":
        look = {"facecolor": PANEL, "alpha": 1.0}
    ax.add_patch(PathPatch(path, edgecolor="none", lw=0.0, zorder=2, **look))
    outline: dict[str, Any] = {"facecolor": "none", "edgecolor": COLOURS[quantity], "lw": style.HAIR, "zorder": 2.2}
    ax.add_patch(PathPatch(path, hatch=hatch or None, **outline))


def _label(ax: Axes, x: float, y: float, one: DrawnStream, supply: float, side: str) -> None:
    digits = int(np.clip(2 - np.floor(np.log10(one.value)), 0, 5))
    share = 100.0 * one.value / supply if supply > 0.0 else 0.0
    percentage = f"  {number(share, 1 if share > 1.0 else 2)} %" if share >= 0.01 else ""
    text = f"{one.words}  {number(one.value, digits)} J{percentage}"
    if side == "right":
        text = f"{one.words}\n{number(one.value, digits)} J"
    elif formats.drawn_width(FLOW_WIDTH) < LEAST_FLOW:  # no room for the share of the supply
        text = f"{one.words}  {number(one.value, digits)} J"
    ax.text(x, y, text, fontsize=SMALL, color=INK, ha=side, va="center", clip_on=False)
