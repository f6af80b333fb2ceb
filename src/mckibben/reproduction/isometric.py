"""Fig. 10 of the paper: tension after steps of the valve's command, both ends of the muscle fixed.

Delays are those of the rising steps of the full range; every number is the mean over the recorded steps of its kind.
"""

from __future__ import annotations

import functools

import numpy as np

from ..analysis.steps import IsometricTiming, isometric_timing
from .recorded import recording, reproduces, step_of

CALIBRATED = "flow and dead time of the valve were inferred from these rows"


@functools.cache
def timings(stroke: str) -> tuple[IsometricTiming, ...]:
    """Of every step of one range, ``full`` or ``half`` of the tension."""
    record = step_of(recording("isometric-step"), "steps", range=stroke)
    return isometric_timing(record, command="valve.command", pressure="pressure", tension="tension")


def mean_of(what: str, *, stroke: str = "full", rising: bool = True) -> float:
    """Mean of one number over the rising or the falling steps of a range [s]."""
    return float(np.mean([getattr(t, what) for t in timings(stroke) if t.rising == rising]))


@reproduces("isometric.valve_delay", "s", CALIBRATED)
def valve_delay() -> float:
    """From the command to the pressure at the muscle."""
    return mean_of("valve_delay")


@reproduces("isometric.pressure_to_tension", "s", CALIBRATED)
def pressure_to_tension() -> float:
    """From the pressure to the tension."""
    return mean_of("pressure_to_tension")


@reproduces("isometric.total_delay", "s", CALIBRATED)
def total_delay() -> float:
    """From the command to the tension."""
    return mean_of("total_delay")


@reproduces("isometric.rise_full", "s", CALIBRATED)
def rise_full() -> float:
    """Rise of the tension to 90 %, 5 bar."""
    return mean_of("transition")


@reproduces("isometric.rise_half", "s", CALIBRATED)
def rise_half() -> float:
    """The same to half the tension."""
    return mean_of("transition", stroke="half")


@reproduces("isometric.fall_full", "s", CALIBRATED)
def fall_full() -> float:
    """Fall of the tension to 10 %, from 5 bar."""
    return mean_of("transition", rising=False)


@reproduces("isometric.fall_half", "s", CALIBRATED)
def fall_half() -> float:
    """The same from half the tension."""
    return mean_of("transition", stroke="half", rising=False)
