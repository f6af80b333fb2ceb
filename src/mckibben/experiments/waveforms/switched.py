"""Waveforms that are held between samples: constant, steps, pulse, square, pulse width modulation, random binary."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from .random import TAPS, register_bits
from .waveform import JUMP, PARTS, RATE, SHARE, TIME, VALUE, WHOLE, Waveform, check_rising, part, time_words, words


@dataclass(frozen=True, kw_only=True)
class Constant(Waveform):
    """One value."""

    kind: ClassVar[str] = "constant"
    straight: ClassVar[bool] = False
    value: float = part(VALUE)

    def at(self, times: Any) -> np.ndarray:
        """The value."""
        return np.full(np.shape(times), float(self.value))

    def sentence(self, unit: str) -> str:
        """Such as ``3 bar``."""
        return words(self.value, unit)


@dataclass(frozen=True, kw_only=True)
class Steps(Waveform):
    """A staircase: from each time on, the value beside it. The first time is 0 s."""

    kind: ClassVar[str] = "steps"
    straight: ClassVar[bool] = False
    times: tuple[float, ...] = part(TIME, 0.0)
    values: tuple[float, ...] = part(VALUE)

    def __post_init__(self) -> None:
        check_rising(self.times, self.values)

    def at(self, times: Any) -> np.ndarray:
        """The last value that has begun."""
        begun = np.searchsorted(np.asarray(self.times), np.asarray(times, float) + JUMP, side="right") - 1
        return np.asarray(self.values, float)[np.maximum(begun, 0)]

    def sentence(self, unit: str) -> str:
        """Such as ``steps 0 bar, 3 bar from 100 ms``."""
        first, *rest = zip(self.values, self.times, strict=True)
        return "steps " + ", ".join(
            [words(first[0], unit), *(f"{words(v, unit)} from {time_words(t)}" for v, t in rest)]
        )


@dataclass(frozen=True, kw_only=True)
class Pulse(Waveform):
    """`high` from a start for a width, `low` before and after."""

    kind: ClassVar[str] = "pulse"
    straight: ClassVar[bool] = False
    start: float = part(TIME, 0.0, default=0.0)
    width: float = part(TIME, 0.0)
    low: float = part(VALUE, default=0.0)
    high: float = part(VALUE)

    def at(self, times: Any) -> np.ndarray:
        """Low, high, low."""
        t = np.asarray(times, float) + JUMP
        return np.where((t >= self.start) & (t < self.start + self.width), float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Such as ``pulse from 0 bar to 3 bar at 100 ms for 500 ms``."""
        return f"pulse from {pair(self, unit)} at {time_words(self.start)} for {time_words(self.width)}"


@dataclass(frozen=True, kw_only=True)
class Square(Waveform):
    """High for a share of each cycle, then low."""

    kind: ClassVar[str] = "square"
    straight: ClassVar[bool] = False
    low: float = part(VALUE, default=0.0)
    high: float = part(VALUE)
    frequency: float = part(RATE, 1e-9)
    duty: float = part(SHARE, 0.0, 1.0, default=0.5)

    def at(self, times: Any) -> np.ndarray:
        """High from 0 s on."""
        phase = np.mod((np.asarray(times, float) + JUMP) * self.frequency, 1.0)
        return np.where(phase < self.duty, float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Such as ``square from 0 bar to 3 bar at 2 Hz, high for 0.5 of each cycle``."""
        return f"square from {pair(self, unit)} at {self.frequency:g} Hz, high for {self.duty:g} of each cycle"

    @property
    def fastest(self) -> float:
        """Its frequency [1/s]."""
        return self.frequency


@dataclass(frozen=True, kw_only=True)
class PulseWidth(Waveform):
    """Pulse width modulation: in every carrier cycle high for the share that `duty` has at its beginning.

    The share comes in steps of frequency times the sampling period.
    """

    kind: ClassVar[str] = "pwm"
    straight: ClassVar[bool] = False
    frequency: float = part(RATE, 1e-9)
    duty: Waveform = part(PARTS)
    low: float = part(VALUE, default=0.0)
    high: float = part(VALUE, default=1.0)

    def at(self, times: Any) -> np.ndarray:
        """High first in every cycle."""
        place = (np.asarray(times, float) + JUMP) * self.frequency
        cycle = np.floor(place)
        return np.where(place - cycle < self.duty.at(cycle / self.frequency), float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Such as ``pwm from 0 to 1 at 50 Hz, duty ramp from 0 to 1 in 2 s``."""
        return f"pwm from {pair(self, unit)} at {self.frequency:g} Hz, duty {self.duty.sentence('1')}"

    @property
    def fastest(self) -> float:
        """Of a tenth of a cycle, the coarsest share that is of use [1/s]."""
        return 5.0 * self.frequency


@dataclass(frozen=True, kw_only=True)
class Binary(Waveform):
    """A pseudo-random binary sequence of a shift register: low or high anew after each `hold`; it repeats after 2^order - 1.

    Source of the taps: P. Alfke, Xilinx application note XAPP 052, 1996; each gives the longest sequence of its order.
    """

    kind: ClassVar[str] = "prbs"
    straight: ClassVar[bool] = False
    low: float = part(VALUE)
    high: float = part(VALUE)
    hold: float = part(TIME, 1e-9)
    order: int = part(WHOLE, min(TAPS), max(TAPS), default=9)
    seed: int = part(WHOLE, 0, 2**32 - 1, default=0)

    def at(self, times: Any) -> np.ndarray:
        """The sequence, from a place in it that the seed chooses."""
        bits = _sequence(self.order)
        place = np.floor((np.asarray(times, float) + JUMP) / self.hold).astype(np.int64)
        return np.where(bits[(place + self.seed) % len(bits)], float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Such as ``prbs from 0 bar to 3 bar every 20 ms, order 9, seed 0``."""
        return f"prbs from {pair(self, unit)} every {time_words(self.hold)}, order {self.order}, seed {self.seed}"

    @property
    def fastest(self) -> float:
        """One change per hold [1/s]."""
        return 0.5 / self.hold


@functools.cache
def _sequence(order: int) -> np.ndarray:
    return register_bits(order)


def pair(wave: Any, unit: str) -> str:
    """The lower and the upper value in words."""
    return f"{words(wave.low, unit)} to {words(wave.high, unit)}"
