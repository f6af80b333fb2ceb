"""Fig. 4 of the paper: loops of small sines at 5 bar, and the velocity up to which nothing viscous is seen in them.

The position loop follows 10 Hz and 40 Hz with another amplitude than 1 Hz. As a person at the machine would do, a sine that
came out off by more than a twentieth is asked for again, by as much smaller or larger.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

from ..analysis.lag import CorrectedLoop
from ..analysis.loops import loop, peak_velocity
from ..assembly.build import INFERRED
from ..bench.rig_file import rig
from ..errors import ConvergenceError
from ..recordings import Recording
from ..specimens import specimen
from .quasi_static import without_lag
from .recorded import SPAN, recording, reproduces, step_of
from .rows import Found

FIGURE = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)  # of the twelve only the ends are printed [Hz]
FASTEST = 40.0  # [Hz]; the text's 8 L0/s at the amplitude of the figure
AMPLITUDE = 0.0318  # 0.2 L0/s at 1 Hz [L0]
CYCLES = 8
OFF, TRIES = 0.05, 4  # error of the amplitude from which a sine is repeated [1], and how often at most


class Sine(NamedTuple):
    """One frequency.

    Attributes:
        loop: of the tension.
        velocity: peak that was reached [L0/s].
        pressure_gap: pressure on the rising path less that on the falling one, at mid-range [Pa].
    """

    loop: CorrectedLoop
    velocity: float
    pressure_gap: float


def _words(frequency: float) -> str:
    return f"{frequency:g} Hz"


def recorded_sines(frequency: float) -> Recording:
    """The sine of a frequency [Hz] with about the amplitude of the figure.

    Raises:
        ConvergenceError: no amplitude that was asked for gave it.
    """
    words = _words(frequency)
    every = tuple(_words(f) for f in (*FIGURE, FASTEST))
    record = step_of(recording("sinusoids", frequency=every, cycles=CYCLES), "sines", frequency=words)
    asked = AMPLITUDE
    for _ in range(TRIES):
        raw = without_lag(record).raw
        share = (raw.length_high - raw.length_low) / (2.0 * AMPLITUDE * _rest_length())
        if abs(share - 1.0) <= OFF:
            return record
        asked /= share
        again = recording(
            "sinusoids",
            frequency=words,
            amplitude=f"{asked:.5f} L0",
            cycles=CYCLES,
            precondition=_precondition(frequency),
        )
        record = step_of(again, "sines")
    raise ConvergenceError(f"no sine of {words} had an amplitude of {AMPLITUDE:g} L0 within {OFF:g} of it")


def _precondition(frequency: float) -> int:
    """Cycles before the recorded ones, a second or more: the gas has to find its mean."""
    return max(2, math.ceil(frequency))


def _rest_length() -> float:
    return specimen("nylon").property_si("rest_length", "m")


@functools.cache
def sine(frequency: float) -> Sine:
    """The loop at a frequency [Hz]."""
    record = recorded_sines(frequency)
    gas = loop(record, length=SPAN, tension="pressure")
    return Sine(without_lag(record), peak_velocity(record, length=SPAN) / _rest_length(), gas.height)


def spread(values: list[float]) -> float:
    """Largest less smallest over the mean [1]."""
    return (max(values) - min(values)) * len(values) / sum(values)


DAMPING = INFERRED["viscosity"].value
CALIBRATED = f"internal damping of {DAMPING:g} N s/m was inferred from the paper's seeing no viscous friction"


@reproduces("loop.sine_width_spread", "1", CALIBRATED)
def sine_width_spread() -> Found:
    """Spread of the widths of the twelve sines."""
    sines = [sine(f) for f in FIGURE]
    raw, fixed = [s.loop.raw.width for s in sines], [s.loop.corrected.width for s in sines]
    first, last = sines[0].velocity, sines[-1].velocity
    gaps = [1e-5 * s.pressure_gap for s in sines]
    return Found(
        spread(fixed),
        f"{100 * fixed[0]:.3f} cm at {first:.2f} L0/s, {100 * fixed[-1]:.3f} cm at {last:.2f} L0/s; "
        f"raw {100 * raw[0]:.3f} and {100 * raw[-1]:.3f} cm, spread {spread(raw):.2f}. What widens the loops is gas: while "
        f"the muscle lengthens its pressure is {gaps[0]:.3f} bar higher at 1 Hz and up to {max(gaps):.3f} bar at the others",
    )


def widening(frequency: float) -> float:
    """Width that the height of the raw loop at a frequency [Hz], less that of the slowest sine, makes [m].

    Taken at the stiffness of the slowest sine: the inertia of the fittings turns a fast loop flatter, and so makes it wider
    across without any loss.
    """
    slow = sine(FIGURE[0]).loop.raw
    return (sine(frequency).loop.raw.height - slow.height) / slow.stiffness


def measurable() -> float:
    """Width that one count of the cell makes at the stiffness of the slowest sine [m]."""
    return float(rig("paper").sensors["tension"].resolution) / sine(FIGURE[0]).loop.raw.stiffness


@reproduces("loop.max_velocity", "1/s", CALIBRATED)
def max_velocity() -> Found:
    """Largest peak velocity of the sines whose raw loop is not wider than the slowest by what a count of the cell makes."""
    narrow = [f for f in (*FIGURE, FASTEST) if widening(f) < measurable()]
    fast, slow = sine(FASTEST).loop, sine(FIGURE[0]).loop
    return Found(
        max(sine(f).velocity for f in narrow),
        f"raw height {slow.raw.height:.2f} N at 1 Hz, {fast.raw.height:.2f} N at 40 Hz; without the lag of the cell's "
        f"filter {slow.corrected.height:.2f} and {fast.corrected.height:.2f} N: what gas and damping add, it hides. "
        f"The raw loop is {100 * fast.raw.width:.3f} cm wide at 40 Hz, {100 * slow.raw.width:.3f} cm at 1 Hz, for the "
        "inertia of the fittings turns it",
    )
