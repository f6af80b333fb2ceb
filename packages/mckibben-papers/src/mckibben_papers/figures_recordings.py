"""Figs. 3, 4, 10 and 11 of the paper: loops over displacement, steps of the valve and shortening, from recordings."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mckibben.analysis.channels import smoothed, uniform_period
from mckibben.analysis.loops import paths
from mckibben.analysis.steps import CommandStep, find_steps, step_responses
from mckibben.muscles.build import law_from_specimen
from mckibben.quantities import from_si
from mckibben.recordings import Recording
from mckibben.report.figures import style
from mckibben.report.figures.style import COLOURS, INK, INK_2, INK_3, number
from mckibben.specimens import specimen

from . import measured
from .figure_parts import (
    KEY_MARK,
    MARK,
    PRINTED,
    NumberEntry,
    entry,
    key,
    numbers,
    ours,
    panel,
    printed,
    printed_key,
    rest_length,
    right_axis,
    sample,
    shown,
    stack,
    title,
)
from .measured import recorded_sines
from .reproduction import FIVE_BAR, SPAN, TENSION, recording, step_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


CM, BAR = from_si(1.0, "m", "cm"), from_si(1.0, "Pa", "bar")
FEWER = {"precondition": 1, "cycles": 2}  # of recordings that no row needs: the second cycle is like the first
BESIDE, DX = 3.1, 34.0  # with a second axis between [inch, pt]
SHIFT = 0.004  # between the loops of Fig. 4 [m]
POINTS = 81  # of a path
SAMPLES: dict[str, Any] = {"color": COLOURS["tension"], "lw": 0.4, "alpha": 0.3, "zorder": 2}
HALO = {"boxstyle": "square,pad=0.1", "fc": style.PANEL, "ec": "none", "alpha": 0.8}
DASHED = style.RECORDING_DASHES[1]


class RecordedMuscle(NamedTuple):
    """A muscle with the stroke and the rig of its loops."""

    muscle: str
    stroke: str
    rig: str = "paper"


NYLON, SMALL_RANGE = RecordedMuscle("nylon", "large"), RecordedMuscle("nylon", "small")
FIBERGLASS = RecordedMuscle("fiberglass", "fiberglass")
BRIDGESTONE = RecordedMuscle("bridgestone", "bridgestone", measured.MODERN)


def loops_of(subject: RecordedMuscle, pressure: str) -> Recording:
    """Recorded cycles at a pressure; the same that rows use."""
    if pressure == FIVE_BAR or subject == NYLON:
        return measured.triangle(subject.muscle, stroke=subject.stroke, rig=subject.rig, pressure=pressure)
    whole = recording(
        "quasi-static",
        subject.muscle,
        rig=subject.rig,
        range=subject.stroke,
        frequency="1 Hz",
        pressure=pressure,
        **FEWER,
    )
    return step_of(whole, "loops")


# ---- Fig. 3


@style.styled()
def figure_3a() -> Figure:
    """Nylon muscle, large range."""
    fig, ax, other = _quasi_static("3a", NYLON, "Nylon muscle, 1 Hz, large range")
    law = law_from_specimen(specimen(NYLON.muscle))
    span = np.linspace(0.75, 1.1, 2) * rest_length(NYLON.muscle)
    for pressure in (2e5, 3e5, 4e5, 5e5):
        at = np.array([max(span[0], float(np.asarray(law.free_length(pressure)))), span[1]])
        ax.plot((at - rest_length(NYLON.muscle)) * CM, np.asarray(law.tension(at, pressure)), **PRINTED, zorder=5)
    numbers(
        ax,
        [
            entry("Width, 5 bar", "loop.width"),
            entry("Height, 5 bar", "loop.height"),
            entry("Friction", "friction.nylon"),
            entry("Pressure varies by", "loop.pressure_variation", 2),
            entry("Area, 0.25 to 1 Hz", "loop.rate_ratio"),
        ],
        dx=DX,
    )
    _key(ax, [sample("paper: eq. 12, 2–5 bar", **PRINTED)])
    return fig


@style.styled()
def figure_3b() -> Figure:
    """Nylon muscle, small range."""
    fig, ax, _ = _quasi_static("3b", SMALL_RANGE, "Nylon muscle, 1 Hz, small range", ends=False)
    large = loops_of(NYLON, FIVE_BAR)
    look: dict[str, Any] = {"color": INK_3, "lw": 0.7, "ls": DASHED}
    ax.plot(*_mean(large, NYLON), zorder=3, **look)
    ax.set_xlim(-3.6, -1.5)
    numbers(
        ax,
        [
            entry("Width to large range", "loop.small_range_ratio"),
            entry("Rising paths apart", "loop.rising_path_distance", 2),
        ],
        dx=DX,
    )
    _key(ax, [sample("large range, 5 bar", **look)], marks=False)
    return fig


@style.styled()
def figure_3c(figure: str = "3c") -> Figure:
    """Fiberglass muscle."""
    fig, ax, _ = _quasi_static(figure, FIBERGLASS, "Fiberglass muscle, 1 Hz")
    numbers(ax, [entry("Width, 5 bar", "loop.width_fiberglass"), entry("Friction", "friction.fiberglass")], dx=DX)
    _key(ax)
    return fig


@style.styled()
def figure_3d() -> Figure:
    """Bridgestone muscle."""
    fig, ax, _ = _quasi_static("3d", BRIDGESTONE, "Bridgestone muscle, 1 Hz")
    numbers(
        ax,
        [entry("Width, 5 bar", "loop.width_bridgestone"), entry("Friction", "friction.bridgestone")],
        dx=DX,
        remarks=("With a cell of 1 kN: the paper's", "ends at 100 N."),
    )
    _key(ax)
    return fig


@style.styled()
def both_ranges(figure: str) -> Figure:
    """The nylon muscle over both ranges, as the paper of 1994 shows it: large dashed, small full."""
    fig, ax, other = _quasi_static(figure, SMALL_RANGE, "Nylon muscle, 1 Hz, large and small range", named=False)
    look: dict[str, Any] = {"color": COLOURS["tension"], "lw": 0.8, "ls": DASHED}
    for pressure in measured.PRESSURES:
        ax.plot(*_mean(loops_of(NYLON, pressure), NYLON), zorder=3, **look)
        other.plot(*_mean(loops_of(NYLON, pressure), NYLON, "pressure"), color=COLOURS["pressure"], lw=0.8, zorder=2)
        _name(ax, loops_of(NYLON, pressure), NYLON, pressure)
    numbers(
        ax,
        [
            entry("Width, large range", "loop.width"),
            entry("Height, large range", "loop.height"),
            entry("Width, small to large", "loop.small_range_ratio"),
            entry("Rising paths apart", "loop.rising_path_distance", 2),
            entry("Area, 0.25 to 1 Hz", "loop.rate_ratio"),
        ],
        dx=DX,
    )
    _key(ax, [sample("large range", **look)], words="small range")
    return fig


def _curve(record: Recording, subject: RecordedMuscle) -> tuple[np.ndarray, np.ndarray]:
    """Displacement from L0 [cm] and tension [N]."""
    return (record[SPAN] - rest_length(subject.muscle)) * CM, record[TENSION]


def _mean(record: Recording, subject: RecordedMuscle, channel: str = TENSION) -> tuple[np.ndarray, np.ndarray]:
    """The mean cycle, up the rising path and back down the falling one, closed: displacement [cm], and [N] or [bar]."""
    rising, falling = paths(record, length=SPAN, tension=channel)
    low, high = max(rising.length[0], falling.length[0]), min(rising.length[-1], falling.length[-1])
    at = np.linspace(low, high, POINTS)
    x = np.concatenate([at, at[::-1], at[:1]])
    y = np.concatenate([rising.at(at), falling.at(at[::-1]), rising.at(at[:1])])
    return (x - rest_length(subject.muscle)) * CM, y * (BAR if channel == "pressure" else 1.0)


def _quasi_static(
    figure: str, subject: RecordedMuscle, words: str, *, ends: bool = True, named: bool = True
) -> tuple[Figure, Axes, Axes]:
    """Pairs of curves at six pressures: tension at the left axis, pressure at the right one."""
    fig, ax = panel(4.4, beside=BESIDE)
    other = right_axis(ax, "Pressure, bar", "pressure")
    ax.set_zorder(other.get_zorder() + 1)
    top = 0.0
    for pressure in measured.PRESSURES:
        record = loops_of(subject, pressure)
        ax.plot(*_curve(record, subject), gid=f"{pressure}, samples", **SAMPLES)
        x, y = _mean(record, subject)
        ax.plot(x, y, gid=pressure, **ours("tension", lw=1.1))
        other.plot(*_mean(record, subject, "pressure"), color=COLOURS["pressure"], lw=0.8, zorder=2)
        top = max(top, float(y.max()))
    rest, spec = rest_length(subject.muscle), specimen(subject.muscle)
    if ends:
        strongest, upper = printed(f"table1.{subject.muscle}.max_tension"), spec.property_si("upper_length", "m")
        shortest = upper / rest - printed(f"table1.{subject.muscle}.dynamic_range")
        ax.plot([(shortest - 1.0) * rest * CM, (upper - rest) * CM], [0.0, strongest], **MARK, clip_on=False)
        top = max(top, strongest)
    ax.set_ylim(-0.03 * top, 1.08 * top)
    other.set_ylim(-0.03 * 6.5, 1.08 * 6.5)
    style.quantity_axes(ax, x=("Displacement from L₀, cm", "length"), y=("Tension, N", "tension"))
    title(ax, figure, words)
    if named:
        for pressure in measured.PRESSURES[1:]:
            _name(ax, loops_of(subject, pressure), subject, pressure)
    return fig, ax, other


def _name(ax: Axes, record: Recording, subject: RecordedMuscle, pressure: str) -> None:
    x, y = _curve(record, subject)
    near = x > np.quantile(x, 0.9)
    if y[near].max() < 1.0:
        return
    at = float(x[near].mean())
    style.beside(
        ax,
        pressure,
        (at, float(y[near].max())),
        (-10, 3),
        ha="right",
        fontweight="bold",
        color=COLOURS["pressure"],
        zorder=7,
        bbox=HALO,
    )


def _key(ax: Axes, more: Sequence[Any] = (), *, marks: bool = True, words: str = "tension") -> None:
    lines = [
        sample(words, **ours("tension", zorder=1)),
        sample("pressure", color=COLOURS["pressure"], lw=0.6),
        *more,
        *([printed_key("paper, Table 1, 5 bar")] if marks else []),
    ]
    key(ax, lines, dx=DX)


# ---- Fig. 4


@functools.cache
def sines() -> Mapping[float, tuple[Recording, measured.SineLoop]]:
    """Recordings and loops by frequency [Hz]: the twelve of the figure, and the one that reaches 8 L0/s."""
    return {f: (recorded_sines(f), measured.sine(f)) for f in (*measured.FIGURE, measured.FASTEST)}


@style.styled()
def figure_4(figure: str = "4") -> Figure:
    """Twelve loops shifted along the displacement, and the width of each below, over the peak velocity."""
    fig, (top, low) = stack([2.3, 1.0], 5.6, wide=style.WIDE, beside=3.1, gap=0.85)
    rest = rest_length("nylon")
    for i, frequency in enumerate(measured.FIGURE):
        record, one = sines()[frequency]
        middle = 0.5 * (one.loop.raw.length_low + one.loop.raw.length_high)
        x = (record[SPAN] - middle + i * SHIFT) * CM
        top.plot(x, record[TENSION], gid=f"{frequency:g} Hz", **ours("tension", lw=0.7))
        foot, head = float(record[TENSION].min()), float(record[TENSION].max())
        look: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "fontsize": style.SMALL}
        top.annotate(number(frequency), (x.min(), foot), (2, -11), **look, color=INK, fontweight="bold")
        top.annotate(f"{one.velocity:.2f}", (x.max(), head), (0, 4), **look, color=INK_2)
    low_y, high_y = top.get_ylim()
    top.set_ylim(low_y - 6.0, high_y + 4.0)
    across = "Displacement, each loop 0.4 cm further right, cm"
    style.quantity_axes(top, x=(across, "length"), y=("Tension, N", "tension"))
    title(
        top,
        figure,
        "Nylon muscle, 5 bar: sines; below each loop its frequency in Hz, above it the peak velocity in L₀/s",
    )
    all_sines = [one for _, one in sines().values()]
    speed = [s.velocity for s in all_sines]
    raw, fixed = ([getattr(s.loop, n).width * CM for s in all_sines] for n in ("raw", "corrected"))
    low.plot(speed, raw, gid="raw", marker="s", ms=4.0, **ours("tension", ls=DASHED, lw=0.8))
    low.plot(speed[:-1], fixed[:-1], gid="corrected", marker="^", ms=5.0, **ours("tension"))
    low.set_ylim(0.0, 1.15 * max(raw))
    low.set_xlim(0.0, 8.5)
    style.quantity_axes(low, x=("Peak velocity, L₀/s", None), y=("Width of the loop, cm", "length"))
    widths = [
        entry("Spread, corrected", "loop.sine_width_spread", 2),
        NumberEntry("Spread, raw", shown(measured.spread(raw[:-1]), 2)),
        entry("Highest velocity", "loop.max_velocity"),
    ]
    numbers(
        top,
        widths,
        remarks=(
            "Corrected: without the lag of the",
            "cell's filter. At 40 Hz the inertia of",
            "the fittings turns the loop.",
            f"Amplitude {measured.AMPLITUDE:g} L₀, {measured.AMPLITUDE * rest * CM:.2f} cm.",
        ),
    )
    key(
        low,
        [
            sample("corrected", marker="^", ms=5.0, **ours("tension", zorder=1)),
            sample("raw, up to 40 Hz", marker="s", ms=4.0, **ours("tension", ls=DASHED, lw=0.8, zorder=1)),
        ],
    )
    return fig


MS = from_si(1.0, "s", "ms")
BEFORE, AFTER = 0.01, 0.11  # around a step [s]
HIGHEST = 5e5  # full scale of the command [Pa]
WAYS = {True: "Rise", False: "Fall"}
RANGES = {"full": "-", "half": style.RECORDING_DASHES[1]}
TIMES = {
    ("full", True): "rise_full",
    ("half", True): "rise_half",
    ("full", False): "fall_full",
    ("half", False): "fall_half",
}


# ---- Fig. 10


@style.styled()
def figure_10() -> Figure:
    """Command, pressures and tension after a rising and a falling step."""
    fig, axes = stack([0.55, 1.0, 1.25], 6.4, wide=style.WIDE, beside=3.1, columns=(1.0, 1.0), gap=0.42)
    for i, rising in enumerate((True, False)):
        column = axes[i::2]
        for name, dash in RANGES.items():
            _step(column, name, rising, dash)
        for j, ax in enumerate(column):
            ax.set_xlim(-BEFORE * MS, AFTER * MS)
            last = j == 2
            y = (("Command, %", "valve"), ("Gauge pressure, bar", "pressure"), ("Tension, N", "tension"))[j]
            style.quantity_axes(ax, x=("Time after the step, ms" if last else "", None), y=("", None) if i else y)
            ax.tick_params(labelbottom=last, labelleft=not i)
    for left, right in zip(axes[::2], axes[1::2], strict=True):
        limits = [f(left.get_ylim()[k], right.get_ylim()[k]) for k, f in enumerate((min, max))]
        left.set_ylim(*limits)
        right.set_ylim(*limits)
    for ax, rising in zip(axes, WAYS, strict=False):
        style.note(ax, WAYS[rising], x=1.0, ha="right", dy=8.0, color=INK, fontweight="bold")
    title(axes[0], "10", "Nylon muscle at L₀, both ends fixed: steps of full and half range")
    numbers(
        axes[1],
        [
            entry("Command to pressure", "isometric.valve_delay", 2),
            entry("Pressure to tension", "isometric.pressure_to_tension", 2),
            entry("Command to tension", "isometric.total_delay", 2),
            *(entry(f"{WAYS[up]}, {name} range", f"isometric.{row}", 2) for (name, up), row in TIMES.items()),
        ],
    )
    key(
        axes[1],
        [
            sample("command, 100 % is 5 bar", color=COLOURS["valve"], lw=style.LINE),
            sample("pressure at the valve", color=COLOURS["pressure"], lw=0.9, ls=(0, (2.2, 1.4))),
            sample("pressure at the muscle", **ours("pressure", zorder=1)),
            sample("tension", **ours("tension", zorder=1)),
            sample("half range", color=INK_2, lw=0.8),
            printed_key("paper: 90 % or 10 % reached"),
            sample("paper: tension begins", **KEY_MARK | {"marker": "D", "ms": 5.0}),
        ],
        below=160.0,
    )
    return fig


def window(record: Recording, rising: bool) -> tuple[CommandStep, Recording]:
    """The second rising or falling step with the record around it, time counted from the step."""
    step = [s for s in find_steps(record, "valve.command") if (s.after > s.before) == rising][1]
    near = (record.time >= step.time - BEFORE) & (record.time <= step.time + AFTER)
    kept = {n: c.with_values(c.values[near]) for n, c in record.channels.items()}
    return step, Recording(record.time[near] - step.time, kept, record.meta)


def _step(axes: Sequence[Axes], name: str, rising: bool, dash: Any) -> None:
    record = measured.steps(name)
    step, part = window(record, rising)
    time, full = part.time * MS, name == "full"
    thin = style.LINE + 0.2 if full else 0.8
    axes[0].plot(time, part["valve.command"] / HIGHEST * 100.0, drawstyle="steps-post", color=COLOURS["valve"], lw=thin)
    axes[1].plot(
        time, part["valve_pressure"] * BAR, color=COLOURS["pressure"], lw=0.6 * thin, ls=(0, (2.2, 1.4)), zorder=3
    )
    axes[1].plot(time, part["pressure"] * BAR, **ours("pressure", lw=thin))
    axes[2].plot(time, part["tension"], gid=f"{name} {'rise' if rising else 'fall'}", **ours("tension", lw=thin))
    one = next(
        r for r in step_responses(record, command="valve.command", channel="tension") if r.command_time == step.time
    )
    # A rise is printed with its delay after the command; of a fall only its length is, which begins at our onset.
    onset = printed("isometric.total_delay") if rising else one.delay * MS
    at = onset + printed(f"isometric.{TIMES[name, rising]}")
    level = one.before + 0.9 * one.step
    axes[2].plot([at], [level], **MARK)
    if rising and full:
        axes[2].plot([onset], [one.before + one.threshold * one.step], **MARK | {"marker": "D", "ms": 5.0})


# ---- Fig. 11


@style.styled()
def figure_11() -> Figure:
    """Pressure, tension, shortening and power of both printed cases."""
    fig, axes = stack([1.0, 1.0, 1.0, 1.0], 7.6, wide=style.WIDE, beside=3.1, columns=(1.0, 1.0), gap=0.42)
    for i, case in enumerate((measured.LIGHT, measured.FAST)):
        column = axes[i::2]
        _shortening(column, case)
        for j, (ax, y) in enumerate(zip(column, HEADS, strict=True)):
            last = j == len(column) - 1
            style.quantity_axes(ax, x=("Time, s" if last else "", None), y=("", None) if i else y)
            ax.tick_params(labelbottom=last)
        style.note(column[0], f"{case[0]}, {case[1]}", x=1.0, ha="right", dy=8.0, color=INK, fontweight="bold")
    title(axes[0], "11", "Nylon muscle against a controlled tension, pressure a triangle of 0 to 5 bar")
    for ax, (name, words) in zip(axes[1::2], CASES.items(), strict=False):
        numbers(
            ax,
            [
                entry(f"Work, {words}", f"isotonic.work_{name}"),
                entry("Mean power", f"isotonic.mean_power_{name}"),
                entry("Peak power", f"isotonic.peak_power_{name}"),
            ],
        )
    numbers(
        axes[5],
        [
            entry("Tension, rms error", "isotonic.tension_error", 2),
            entry("Mean, per volume", "isotonic.mean_power_density"),
            entry("Peak, per volume", "isotonic.peak_power_density"),
        ],
        remarks=("The legend has 1 Hz for both; its", "14 W need 5 Hz. How the velocity", "was taken is not printed."),
    )
    key(
        axes[7],
        [
            sample("pressure", **ours("pressure", zorder=1)),
            sample("tension", **ours("tension", ls=style.DASHES["tension"], zorder=1)),
            sample("shortening", **ours("length", zorder=1)),
            sample("power", **ours(None, zorder=1)),
            sample("paper: load, mean power", **PRINTED),
            sample("paper: peak power", **PRINTED | {"ls": (0, (1.5, 2.0))}),
        ],
    )
    return fig


HEADS = (
    ("Gauge pressure, bar", "pressure"),
    ("Tension, N", "tension"),
    ("Shortening, cm", "length"),
    ("Power, W", None),
)
CASES = {"10N_1Hz": "10 N", "50N_5Hz": "50 N"}


def power_of(case: tuple[str, str]) -> tuple[np.ndarray, np.ndarray]:
    """Power of shortening over time [W], velocity and tension smoothed as for the rows."""
    record, period = measured.cycles(case), uniform_period(measured.cycles(case))
    wide = measured.power(case).window
    velocity = -smoothed(record[SPAN], period=period, window=wide, derivative=1)
    return record.time - record.time[0], smoothed(record[TENSION], period=period, window=wide) * velocity


def _shortening(axes: Sequence[Axes], case: tuple[str, str]) -> None:
    record, name = measured.cycles(case), dict(zip((measured.LIGHT, measured.FAST), CASES, strict=True))[case]
    time, power = power_of(case)
    cycle = 1.0 / measured.power(case).frequency
    shown = (time >= measured.SKIP * cycle) & (time <= (measured.SKIP + 3.0) * cycle)
    at = time[shown] - time[shown][0]
    axes[0].plot(at, record["pressure"][shown] * BAR, **ours("pressure"))
    axes[1].plot(at, record[TENSION][shown], **ours("tension", ls=style.DASHES["tension"], lw=1.0))
    axes[1].axhline(measured.LOADS[case], zorder=2, **PRINTED)
    axes[2].plot(at, (record[SPAN].max() - record[SPAN][shown]) * CM, **ours("length"))
    axes[3].plot(at, power[shown], gid=f"power {name}", **ours(None, lw=1.0))
    axes[3].axhline(0.0, color=INK_3, lw=style.HAIR)
    axes[3].axhline(printed(f"isotonic.mean_power_{name}"), zorder=5, **PRINTED)
    axes[3].axhline(printed(f"isotonic.peak_power_{name}"), zorder=5, **PRINTED | {"ls": (0, (1.5, 2.0))})
    for ax, low in zip(axes, (0.0, 0.0, 0.0, None), strict=True):
        ax.set_xlim(0.0, at[-1])
        if low is not None:
            ax.set_ylim(low, 1.12 * ax.get_ylim()[1])
