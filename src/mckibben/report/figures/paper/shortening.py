"""Figs. 10 and 11 of the paper: tension after steps of the valve, and shortening against a controlled tension."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ....analysis.channels import smoothed, uniform_period
from ....analysis.steps import Step, find_steps, step_responses
from ....quantities import from_si
from ....recordings import Recording
from ....reproduction import isotonic
from ....reproduction.recorded import SPAN, TENSION, recording, step_of
from .. import style
from ..style import COLOURS, INK, INK_2, INK_3
from .common import MARK, PRINTED, entry, key, numbers, ours, printed, printed_key, sample, stack, title

BAR, CM, MS = from_si(1.0, "Pa", "bar"), from_si(1.0, "m", "cm"), from_si(1.0, "s", "ms")
BEFORE, AFTER = 0.01, 0.11  # around a step [s]
HIGHEST = 5e5  # full scale of the command [Pa]
WAYS = {True: "Rise", False: "Fall"}
RANGES = {"full": "-", "half": style.RECORDING_DASHES[1]}
TIMES = {
    ("full", True): "rise_full", ("half", True): "rise_half", ("full", False): "fall_full", ("half", False): "fall_half",
}  # fmt: skip


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
            last, y = (
                j == 2,
                (("Command, %", "valve"), ("Gauge pressure, bar", "pressure"), ("Tension, N", "tension"))[j],
            )
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
        axes[1], [
            entry("Command to pressure", "isometric.valve_delay", 2),
            entry("Pressure to tension", "isometric.pressure_to_tension", 2),
            entry("Command to tension", "isometric.total_delay", 2),
            *(entry(f"{WAYS[up]}, {name} range", f"isometric.{row}", 2) for (name, up), row in TIMES.items()),
        ],
    )  # fmt: skip
    diamond = {name: v for name, v in MARK.items() if name != "zorder"} | {"marker": "D", "ms": 5.0}
    key(
        axes[1], [
            sample("command, 100 % is 5 bar", color=COLOURS["valve"], lw=style.LINE),
            sample("pressure at the valve", color=COLOURS["pressure"], lw=0.9, ls=(0, (2.2, 1.4))),
            sample("pressure at the muscle", **ours("pressure", zorder=1)),
            sample("tension", **ours("tension", zorder=1)),
            sample("half range", color=INK_2, lw=0.8),
            printed_key("paper: 90 % or 10 % reached"),
            sample("paper: tension begins", **diamond),
        ], below=160.0,
    )  # fmt: skip
    return fig


def steps_of(name: str) -> Recording:
    """The recorded steps of a range."""
    return step_of(recording("isometric-step"), "steps", range=name)


def window(record: Recording, rising: bool) -> tuple[Step, Recording]:
    """The second step that rises or falls, and what was recorded around it, its time counted from the step."""
    step = [s for s in find_steps(record, "valve.command") if (s.after > s.before) == rising][1]
    near = (record.time >= step.time - BEFORE) & (record.time <= step.time + AFTER)
    kept = {n: c.with_values(c.values[near]) for n, c in record.channels.items()}
    return step, Recording(record.time[near] - step.time, kept, record.meta)


def _step(axes: Sequence[Axes], name: str, rising: bool, dash: Any) -> None:
    record = steps_of(name)
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
    for i, case in enumerate((isotonic.LIGHT, isotonic.FAST)):
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
            ax, [
                entry(f"Work, {words}", f"isotonic.work_{name}"), entry("Mean power", f"isotonic.mean_power_{name}"),
                entry("Peak power", f"isotonic.peak_power_{name}"),
            ],
        )  # fmt: skip
    numbers(
        axes[5], [
            entry("Tension, rms error", "isotonic.tension_error", 2),
            entry("Mean, per volume", "isotonic.mean_power_density"),
            entry("Peak, per volume", "isotonic.peak_power_density"),
        ], remarks=("The legend has 1 Hz for both; its", "14 W need 5 Hz. How the velocity", "was taken is not printed."),
    )  # fmt: skip
    key(
        axes[7], [
            sample("pressure", **ours("pressure", zorder=1)),
            sample("tension", **ours("tension", ls=style.DASHES["tension"], zorder=1)),
            sample("shortening", **ours("length", zorder=1)), sample("power", **ours(None, zorder=1)),
            sample("paper: load, mean power", **PRINTED), sample("paper: peak power", **PRINTED | {"ls": (0, (1.5, 2.0))}),
        ],
    )  # fmt: skip
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
    record, period = isotonic.cycles(case), uniform_period(isotonic.cycles(case))
    wide = isotonic.power(case).window
    velocity = -smoothed(record[SPAN], period=period, window=wide, derivative=1)
    return record.time - record.time[0], smoothed(record[TENSION], period=period, window=wide) * velocity


def _shortening(axes: Sequence[Axes], case: tuple[str, str]) -> None:
    record, name = isotonic.cycles(case), dict(zip((isotonic.LIGHT, isotonic.FAST), CASES, strict=True))[case]
    time, power = power_of(case)
    cycle = 1.0 / isotonic.power(case).frequency
    shown = (time >= isotonic.SKIP * cycle) & (time <= (isotonic.SKIP + 3.0) * cycle)
    at = time[shown] - time[shown][0]
    axes[0].plot(at, record["pressure"][shown] * BAR, **ours("pressure"))
    axes[1].plot(at, record[TENSION][shown], **ours("tension", ls=style.DASHES["tension"], lw=1.0))
    axes[1].axhline(isotonic.LOADS[case], zorder=2, **PRINTED)
    axes[2].plot(at, (record[SPAN].max() - record[SPAN][shown]) * CM, **ours("length"))
    axes[3].plot(at, power[shown], gid=f"power {name}", **ours(None, lw=1.0))
    axes[3].axhline(0.0, color=INK_3, lw=style.HAIR)
    axes[3].axhline(printed(f"isotonic.mean_power_{name}"), zorder=5, **PRINTED)
    axes[3].axhline(printed(f"isotonic.peak_power_{name}"), zorder=5, **PRINTED | {"ls": (0, (1.5, 2.0))})
    for ax, low in zip(axes, (0.0, 0.0, 0.0, None), strict=True):
        ax.set_xlim(0.0, at[-1])
        if low is not None:
            ax.set_ylim(low, 1.12 * ax.get_ylim()[1])
