"""Checks of a step's pressure: range of the valve, burst, and changes that the valve cannot follow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .found import Found
from .limits import Limits
from .plan import PlannedStep, Reach
from .steps import Follow, Go
from .waveforms import time_words
from .waveforms.waveform import words

SLACK = 1.0 + 1e-6  # rounding of a difference of two set-points, relative


def pressure(step: PlannedStep, limits: Limits, dt: float) -> Iterator[Found]:
    """Everything wrong with the pressure of a step."""
    command = step.step.pressure
    if step.pressure is None or command is None:
        return  # what is kept was judged where it was set
    low, high = limits.pressure
    reach = step.pressure_reach
    if isinstance(command, Go):
        reach = Reach(command.to.value, command.to.value)
    if reach.high > high:
        yield Found("pressure", _bar(reach.high), f"the regulator allows up to {_bar(high)}")
    if reach.low < low:
        yield Found("pressure", _bar(reach.low), f"the regulator allows {_bar(low)} or more")
    if reach.high > limits.burst_pressure:
        yield Found("pressure", _bar(reach.high), f"the muscle bursts at {_bar(limits.burst_pressure)}")
    if isinstance(step.pressure, np.ndarray):
        held = isinstance(command, Follow) and not command.waveform.straight
        before = step.pressure_before.low if step.pressure_before.known else step.pressure[0]
        values = np.append(before, step.pressure)
        yield from _jumps(values, limits, dt) if held else _slopes(values, limits, dt)


def _slopes(values: np.ndarray, limits: Limits, dt: float) -> Iterator[Found]:
    """A waveform that goes along lines says that the pressure shall follow it."""
    change = np.abs(np.diff(values))
    if change[0] > limits.pressure_rate * dt * SLACK:
        ends = f"{_bar(values[0])} to {_bar(values[1])}"
        yield Found(
            "pressure", f"a jump from {ends}", f"the valve follows {_rate(limits)}; begin at {_bar(values[0])}",
            f"the set-point jumps from {ends} where the waveform begins; the valve follows {_rate(limits)}",
        )  # fmt: skip
    steepest = float(change[1:].max(initial=0.0)) / dt
    if steepest > limits.pressure_rate * SLACK:
        yield Found(
            "pressure", f"{_bar(steepest)}/s steep", f"the valve follows {_rate(limits)}",
            f"the set-point changes by {_bar(steepest)}/s; the valve follows {_rate(limits)}",
        )  # fmt: skip


def _jumps(values: np.ndarray, limits: Limits, dt: float) -> Iterator[Found]:
    """A waveform that is held jumps on purpose, but the valve has to get there before the next jump."""
    change = np.diff(values)
    at = np.flatnonzero(change)
    for i, following in zip(at, at[1:], strict=False):
        need, lasts = abs(change[i]) / limits.pressure_rate, (following - i) * dt
        if need > lasts * SLACK:
            need = float(f"{need:.3g}")
            ends = f"{_bar(values[i])} to {_bar(values[i + 1])}"
            yield Found(
                "pressure", f"a jump from {ends} for {time_words(lasts)}", f"the valve needs {time_words(need)}",
                f"the set-point jumps from {ends} for {time_words(lasts)}; the valve needs {time_words(need)}",
            )  # fmt: skip
            return


def _bar(value: float) -> str:
    return words(value, "Pa")


def _rate(limits: Limits) -> str:
    return f"{_bar(limits.pressure_rate)}/s"
