"""Waveforms that are straight between samples: ramp, triangle, sine, chirp, multisine, noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...errors import InputError
from .random import uniform
from .switched import pair
from .waveform import ANGLE, RATE, SHARE, TIME, VALUE, WHOLE, WORD, Waveform, part, time_words, words

# Knots of the noise per cycle of its cut-off: a cubic B-spline passes sinc(f/knots)^4, half the power at 0.22751.
KNOTS = 1.0 / 0.22751


@dataclass(frozen=True, kw_only=True)
class Ramp(Waveform):
    """A line from one value to another, constant before and after."""

    kind: ClassVar[str] = "ramp"
    straight: ClassVar[bool] = True
    begin: float = part(VALUE, key="from")
    end: float = part(VALUE, key="to")
    start: float = part(TIME, 0.0, default=0.0)
    duration: float = part(TIME, 1e-9)

    def at(self, times: Any) -> np.ndarray:
        """The line between its ends."""
        share = np.clip((np.asarray(times, float) - self.start) / self.duration, 0.0, 1.0)
        return self.begin + (self.end - self.begin) * share

    def sentence(self, unit: str) -> str:
        """Such as ``ramp from 0 bar to 5 bar in 2 s``."""
        late = f" at {time_words(self.start)}" if self.start else ""
        return f"ramp from {words(self.begin, unit)} to {words(self.end, unit)} in {time_words(self.duration)}{late}"


@dataclass(frozen=True, kw_only=True)
class Triangle(Waveform):
    """From low to high and back, each cycle; `rising` is the share of the cycle that goes up."""

    kind: ClassVar[str] = "triangle"
    straight: ClassVar[bool] = True
    low: float = part(VALUE)
    high: float = part(VALUE)
    frequency: float = part(RATE, 1e-9)
    rising: float = part(SHARE, 0.001, 0.999, default=0.5)

    def at(self, times: Any) -> np.ndarray:
        """The zigzag, from low at 0 s."""
        phase = np.mod(np.asarray(times, float) * self.frequency, 1.0)
        share = np.where(phase < self.rising, phase / self.rising, (1.0 - phase) / (1.0 - self.rising))
        return self.low + (self.high - self.low) * share

    def sentence(self, unit: str) -> str:
        """Such as ``triangle from 0 bar to 5 bar at 0.5 Hz``."""
        rising = f", rising for {self.rising:g} of each cycle" if self.rising != 0.5 else ""
        return f"triangle from {pair(self, unit)} at {self.frequency:g} Hz{rising}"

    @property
    def fastest(self) -> float:
        """Of its shorter side [1/s]."""
        return 0.5 * self.frequency / min(self.rising, 1.0 - self.rising)


@dataclass(frozen=True, kw_only=True)
class Sine(Waveform):
    """``mean + amplitude sin(2 pi f t + phase)``."""

    kind: ClassVar[str] = "sine"
    straight: ClassVar[bool] = True
    mean: float = part(VALUE, default=0.0)
    amplitude: float = part(VALUE)
    frequency: float = part(RATE, 1e-9)
    phase: float = part(ANGLE, default=0.0)

    def at(self, times: Any) -> np.ndarray:
        """The sine."""
        return self.mean + self.amplitude * np.sin(2.0 * np.pi * self.frequency * np.asarray(times, float) + self.phase)

    def sentence(self, unit: str) -> str:
        """Such as ``sine 2 bar +- 1 bar at 0.5 Hz``."""
        phase = f", phase {words(self.phase, 'rad')}" if self.phase else ""
        return f"sine {_swing(self.mean, self.amplitude, unit)} at {self.frequency:g} Hz{phase}"

    @property
    def fastest(self) -> float:
        """Its frequency [1/s]."""
        return self.frequency


@dataclass(frozen=True, kw_only=True)
class Chirp(Waveform):
    """A sine whose frequency goes from one to another, and stays there; `sweep` is ``linear`` or ``log``."""

    kind: ClassVar[str] = "chirp"
    straight: ClassVar[bool] = True
    mean: float = part(VALUE, default=0.0)
    amplitude: float = part(VALUE)
    first: float = part(RATE, 1e-9, key="from")
    last: float = part(RATE, 1e-9, key="to")
    duration: float = part(TIME, 1e-9)
    sweep: str = part(WORD, default="linear")

    def __post_init__(self) -> None:
        if self.sweep not in ("linear", "log"):
            raise InputError("sweep", self.sweep, "allowed are linear, log")

    def at(self, times: Any) -> np.ndarray:
        """The sine of the frequency's integral."""
        t = np.asarray(times, float)
        inside, after = np.minimum(t, self.duration), np.maximum(t - self.duration, 0.0)
        ratio = math.log(self.last / self.first)
        if self.sweep == "log" and abs(ratio) > 1e-12:
            cycles = self.first * self.duration / ratio * np.expm1(ratio * inside / self.duration)
        else:
            cycles = self.first * inside + 0.5 * (self.last - self.first) / self.duration * inside**2
        return self.mean + self.amplitude * np.sin(2.0 * np.pi * (cycles + self.last * after))

    def sentence(self, unit: str) -> str:
        """Such as ``chirp 2 bar +- 1 bar from 0.1 Hz to 10 Hz in 20 s``."""
        swing = _swing(self.mean, self.amplitude, unit)
        log = ", logarithmic" if self.sweep == "log" else ""
        return f"chirp {swing} from {self.first:g} Hz to {self.last:g} Hz in {time_words(self.duration)}{log}"

    @property
    def fastest(self) -> float:
        """The higher end [1/s]."""
        return max(self.first, self.last)


@dataclass(frozen=True, kw_only=True)
class MultiSine(Waveform):
    """Sines of one amplitude at several frequencies; Schroeder's phases, which keep the peaks low, unless given.

    Source of the phases -pi k (k - 1)/N: M. R. Schroeder, IEEE Trans. Information Theory 16(1), 1970,
    doi:10.1109/TIT.1970.1054411.
    """

    kind: ClassVar[str] = "multisine"
    straight: ClassVar[bool] = True
    mean: float = part(VALUE, default=0.0)
    amplitude: float = part(VALUE)
    frequencies: tuple[float, ...] = part(RATE, 1e-9)
    phases: tuple[float, ...] = part(ANGLE, default=())

    def __post_init__(self) -> None:
        if self.phases and len(self.phases) != len(self.frequencies):
            raise InputError("phases", len(self.phases), f"allowed are {len(self.frequencies)}, one per frequency")

    def at(self, times: Any) -> np.ndarray:
        """The sum."""
        t, n = np.asarray(times, float), len(self.frequencies)
        phases = self.phases or tuple(-math.pi * k * (k + 1) / n for k in range(n))
        waves = (np.sin(2.0 * np.pi * f * t + phase) for f, phase in zip(self.frequencies, phases, strict=True))
        return self.mean + self.amplitude * sum(waves, np.zeros(t.shape))

    def sentence(self, unit: str) -> str:
        """Such as ``multisine 2 bar +- 0.1 bar each at 1, 2, 5 Hz``."""
        rates = ", ".join(f"{f:g}" for f in self.frequencies)
        return f"multisine {_swing(self.mean, self.amplitude, unit)} each at {rates} Hz"

    @property
    def fastest(self) -> float:
        """The highest [1/s]."""
        return max(self.frequencies)


@dataclass(frozen=True, kw_only=True)
class Noise(Waveform):
    """Band-limited noise that never leaves its bounds, with half its power density left at the cut-off.

    A uniform cubic B-spline whose coefficients are independent and uniform between the bounds: 1/0.22751 of them per cycle
    of the cut-off. Its spectrum is sinc(0.22751 f/cutoff)^8: -3 dB at the cut-off, -13 dB at twice and -33 dB at three
    times that. Coefficient k is the SplitMix64 hash of the seed and k, so it needs no generator's state and is equal on all
    machines. Source of the hash: G. L. Steele, D. Lea and C. H. Flood, OOPSLA 2014, doi:10.1145/2660193.2660195.
    """

    kind: ClassVar[str] = "noise"
    straight: ClassVar[bool] = True
    low: float = part(VALUE)
    high: float = part(VALUE)
    cutoff: float = part(RATE, 1e-9)
    seed: int = part(WHOLE, 0, 2**32 - 1, default=0)

    def at(self, times: Any) -> np.ndarray:
        """The spline at times from 0 s on."""
        place = np.asarray(times, float) * (self.cutoff * KNOTS)
        knot = np.floor(place)
        u = place - knot
        weights = ((1 - u) ** 3, (3 * u - 6) * u**2 + 4, ((3 - 3 * u) * u + 3) * u + 1, u**3)
        share = sum(w * uniform(self.seed, knot.astype(np.int64) + i) for i, w in enumerate(weights)) / 6.0
        return self.low + (self.high - self.low) * share

    def sentence(self, unit: str) -> str:
        """Such as ``noise from 1 bar to 3 bar up to 10 Hz, seed 0``."""
        return f"noise from {pair(self, unit)} up to {self.cutoff:g} Hz, seed {self.seed}"

    @property
    def fastest(self) -> float:
        """Three times the cut-off, above which nothing is left [1/s]."""
        return 3.0 * self.cutoff


def _swing(mean: float, amplitude: float, unit: str) -> str:
    return f"{words(mean, unit)} +- {words(amplitude, unit)}"
