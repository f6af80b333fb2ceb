"""The waveforms: held between samples (constant to prbs), straight between them (ramp to noise), and made of others.

Numbers are in the unit of the signal, times in s, frequencies in 1/s, phases in rad.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ... import schema
from ..._jax import Scalar
from ...documents import JsonValue
from ...errors import InputError
from ...quantities import Quantity
from ...schema import FileTable
from .waveform import (
    JUMP,
    VALUE,
    ReadTable,
    Waveform,
    check_rising,
    read_parts,
    read_share,
    register,
    time_words,
    words,
)

# Feedback taps of shift registers of maximal length, by order.
TAPS = {
    3: (3, 2), 4: (4, 3), 5: (5, 3), 6: (6, 5), 7: (7, 6), 8: (8, 6, 5, 4), 9: (9, 5), 10: (10, 7), 11: (11, 9),
    12: (12, 6, 4, 1), 13: (13, 4, 3, 1), 14: (14, 5, 3, 1), 15: (15, 14), 16: (16, 15, 13, 4),
}  # fmt: skip


def uniform(seed: int, index: np.ndarray) -> np.ndarray:
    """Numbers from 0 to 1 by SplitMix64: one for each index, independent of all others; shape of the indices."""
    # Two rounds: one turns seed and index into a word, the other mixes neighbouring seeds apart.
    mixed = _mix(np.asarray(index).astype(np.uint64) + np.uint64(1) + _mix(np.asarray(seed, np.uint64)))
    return (mixed >> np.uint64(11)).astype(float) * 2.0**-53


@functools.cache
def register_bits(order: int) -> np.ndarray:
    """One period of a shift register that starts with ones, bool (2^order - 1,)."""
    state, bits = (1 << order) - 1, []
    for _ in range((1 << order) - 1):
        bits.append(state & 1)
        new = 0
        for tap in TAPS[order]:
            new ^= state >> (order - tap) & 1
        state = state >> 1 | new << (order - 1)
    return np.array(bits, bool)


def _mix(word: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):  # wrapping round is what it is made of
        word = word * np.uint64(0x9E3779B97F4A7C15)
        word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mix: np.ndarray = word ^ (word >> np.uint64(31))
    return mix


# Knots of the noise per cycle of its cut-off: a cubic B-spline passes sinc(f/knots)^4, half the power at 0.22751.
KNOTS = 1.0 / 0.22751
LASTING = Quantity("s", (1e-9, math.inf), "time of a part of a sequence", "", (1e-3, 100.0))


@register
@dataclass(frozen=True, kw_only=True)
class Constant(Waveform):
    """A constant value."""

    kind: ClassVar[str] = "constant"
    straight: ClassVar[bool] = False
    value: float = schema.number(VALUE)

    def at(self, times: Scalar) -> np.ndarray:
        """The constant value at some times [s]."""
        return np.full(np.shape(times), float(self.value))

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``3 bar``."""
        return words(self.value, unit)


@register
@dataclass(frozen=True, kw_only=True)
class Staircase(Waveform):
    """A staircase: each value holds from its time on. The first time is 0 s."""

    kind: ClassVar[str] = "steps"
    digest_name: ClassVar[str] = "Steps"
    straight: ClassVar[bool] = False
    times: tuple[float, ...] = schema.numbers("s", (0.0, math.inf))
    values: tuple[float, ...] = schema.numbers(VALUE)

    def __post_init__(self) -> None:
        check_rising(self.times, self.values)

    def at(self, times: Scalar) -> np.ndarray:
        """At each time [s] the last value that has begun."""
        begun = np.searchsorted(np.asarray(self.times), np.asarray(times, float) + JUMP, side="right") - 1
        return np.asarray(self.values, float)[np.maximum(begun, 0)]

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``steps 0 bar, 3 bar from 100 ms``."""
        first, *rest = zip(self.values, self.times, strict=True)
        return "steps " + ", ".join(
            [words(first[0], unit), *(f"{words(v, unit)} from {time_words(t)}" for v, t in rest)]
        )


@register
@dataclass(frozen=True, kw_only=True)
class Pulse(Waveform):
    """`high` from a start for a width, `low` before and after."""

    kind: ClassVar[str] = "pulse"
    straight: ClassVar[bool] = False
    start: float = schema.number("s", (0.0, math.inf), default=0.0)
    width: float = schema.number("s", (0.0, math.inf))
    low: float = schema.number(VALUE, default=0.0)
    high: float = schema.number(VALUE)

    def at(self, times: Scalar) -> np.ndarray:
        """Low, high, low, at some times [s]."""
        t = np.asarray(times, float) + JUMP
        return np.where((t >= self.start) & (t < self.start + self.width), float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``pulse from 0 bar to 3 bar at 100 ms for 500 ms``."""
        return f"pulse from {pair(self, unit)} at {time_words(self.start)} for {time_words(self.width)}"


@register
@dataclass(frozen=True, kw_only=True)
class Square(Waveform):
    """High for a share of each cycle, then low."""

    kind: ClassVar[str] = "square"
    straight: ClassVar[bool] = False
    low: float = schema.number(VALUE, default=0.0)
    high: float = schema.number(VALUE)
    frequency: float = schema.number("1/s", (1e-9, math.inf))
    duty: float = schema.number("1", (0.0, 1.0), default=0.5)

    def at(self, times: Scalar) -> np.ndarray:
        """High from 0 s on, at some times [s]."""
        phase = np.mod((np.asarray(times, float) + JUMP) * self.frequency, 1.0)
        return np.where(phase < self.duty, float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``square from 0 bar to 3 bar at 2 Hz, high for 0.5 of each cycle``."""
        return f"square from {pair(self, unit)} at {self.frequency:g} Hz, high for {self.duty:g} of each cycle"

    @property
    def fastest(self) -> float:
        """Frequency [1/s]."""
        return self.frequency


@register
@dataclass(frozen=True, kw_only=True)
class PulseWidth(Waveform):
    """Pulse width modulation: in every carrier cycle high for the share that `duty` has at its beginning.

    The share comes in steps of frequency times the sampling period.
    """

    kind: ClassVar[str] = "pwm"
    straight: ClassVar[bool] = False
    frequency: float = schema.number("1/s", (1e-9, math.inf))
    duty: Waveform = schema.entry(read_share)
    low: float = schema.number(VALUE, default=0.0)
    high: float = schema.number(VALUE, default=1.0)

    def at(self, times: Scalar) -> np.ndarray:
        """High first in every cycle, at some times [s]."""
        place = (np.asarray(times, float) + JUMP) * self.frequency
        cycle = np.floor(place)
        return np.where(place - cycle < self.duty.at(cycle / self.frequency), float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``pwm from 0 to 1 at 50 Hz, duty ramp from 0 to 1 in 2 s``."""
        return f"pwm from {pair(self, unit)} at {self.frequency:g} Hz, duty {self.duty.sentence('1')}"

    @property
    def fastest(self) -> float:
        """Rate of a tenth of a cycle, the coarsest useful resolution [1/s]."""
        return 5.0 * self.frequency


@register
@dataclass(frozen=True, kw_only=True)
class Binary(Waveform):
    """A pseudo-random binary sequence of a shift register, redrawn after each `hold`; its period is 2^order - 1.

    Source of the taps: P. Alfke, Xilinx application note XAPP 052, 1996; each gives the longest sequence of its order.
    """

    kind: ClassVar[str] = "prbs"
    straight: ClassVar[bool] = False
    low: float = schema.number(VALUE)
    high: float = schema.number(VALUE)
    hold: float = schema.number("s", (1e-9, math.inf))
    order: int = schema.whole(min(TAPS), max(TAPS), default=9)
    seed: int = schema.whole(0, 2**32 - 1, default=0)

    def at(self, times: Scalar) -> np.ndarray:
        """The sequence, from a place in it that the seed chooses."""
        bits = register_bits(self.order)
        place = np.floor((np.asarray(times, float) + JUMP) / self.hold).astype(np.int64)
        return np.where(bits[(place + self.seed) % len(bits)], float(self.high), float(self.low))

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``prbs from 0 bar to 3 bar every 20 ms, order 9, seed 0``."""
        return f"prbs from {pair(self, unit)} every {time_words(self.hold)}, order {self.order}, seed {self.seed}"

    @property
    def fastest(self) -> float:
        """Rate of one change per hold [1/s]."""
        return 0.5 / self.hold


def pair(wave: Any, unit: str) -> str:
    """Format the lower and the upper value."""
    return f"{words(wave.low, unit)} to {words(wave.high, unit)}"


@register
@dataclass(frozen=True, kw_only=True)
class Ramp(Waveform):
    """A line from one value to another, constant before and after."""

    kind: ClassVar[str] = "ramp"
    straight: ClassVar[bool] = True
    begin: float = schema.number(VALUE, key="from")
    end: float = schema.number(VALUE, key="to")
    start: float = schema.number("s", (0.0, math.inf), default=0.0)
    duration: float = schema.number("s", (1e-9, math.inf))

    def at(self, times: Scalar) -> np.ndarray:
        """The line between its ends, at some times [s]."""
        share = np.clip((np.asarray(times, float) - self.start) / self.duration, 0.0, 1.0)
        return self.begin + (self.end - self.begin) * share

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``ramp from 0 bar to 5 bar in 2 s``."""
        late = f" at {time_words(self.start)}" if self.start else ""
        return f"ramp from {words(self.begin, unit)} to {words(self.end, unit)} in {time_words(self.duration)}{late}"


@register
@dataclass(frozen=True, kw_only=True)
class Triangle(Waveform):
    """Periodic ramps from low to high and back; `rising` is the share of the cycle that goes up."""

    kind: ClassVar[str] = "triangle"
    straight: ClassVar[bool] = True
    low: float = schema.number(VALUE)
    high: float = schema.number(VALUE)
    frequency: float = schema.number("1/s", (1e-9, math.inf))
    rising: float = schema.number("1", (0.001, 0.999), default=0.5)

    def at(self, times: Scalar) -> np.ndarray:
        """The zigzag, from low at 0 s."""
        phase = np.mod(np.asarray(times, float) * self.frequency, 1.0)
        share = np.where(phase < self.rising, phase / self.rising, (1.0 - phase) / (1.0 - self.rising))
        return self.low + (self.high - self.low) * share

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``triangle from 0 bar to 5 bar at 0.5 Hz``."""
        rising = f", rising for {self.rising:g} of each cycle" if self.rising != 0.5 else ""
        return f"triangle from {pair(self, unit)} at {self.frequency:g} Hz{rising}"

    @property
    def fastest(self) -> float:
        """Rate of the shorter side [1/s]."""
        return 0.5 * self.frequency / min(self.rising, 1.0 - self.rising)


@register
@dataclass(frozen=True, kw_only=True)
class Sine(Waveform):
    """``mean + amplitude sin(2 pi f t + phase)``."""

    kind: ClassVar[str] = "sine"
    straight: ClassVar[bool] = True
    mean: float = schema.number(VALUE, default=0.0)
    amplitude: float = schema.number(VALUE)
    frequency: float = schema.number("1/s", (1e-9, math.inf))
    phase: float = schema.number("rad", default=0.0)

    def at(self, times: Scalar) -> np.ndarray:
        """The sine at some times [s]."""
        return self.mean + self.amplitude * np.sin(2.0 * np.pi * self.frequency * np.asarray(times, float) + self.phase)

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``sine 2 bar +- 1 bar at 0.5 Hz``."""
        phase = f", phase {words(self.phase, 'rad')}" if self.phase else ""
        return f"sine {_swing(self.mean, self.amplitude, unit)} at {self.frequency:g} Hz{phase}"

    @property
    def fastest(self) -> float:
        """Frequency [1/s]."""
        return self.frequency


@register
@dataclass(frozen=True, kw_only=True)
class Chirp(Waveform):
    """A sine whose frequency changes from first to last and then stays; `sweep` is ``linear`` or ``log``."""

    kind: ClassVar[str] = "chirp"
    straight: ClassVar[bool] = True
    mean: float = schema.number(VALUE, default=0.0)
    amplitude: float = schema.number(VALUE)
    first: float = schema.number("1/s", (1e-9, math.inf), key="from")
    last: float = schema.number("1/s", (1e-9, math.inf), key="to")
    duration: float = schema.number("s", (1e-9, math.inf))
    sweep: str = schema.word(default="linear")

    def __post_init__(self) -> None:
        if self.sweep not in ("linear", "log"):
            raise InputError("sweep", self.sweep, "must be linear or log")

    def at(self, times: Scalar) -> np.ndarray:
        """The sine of the frequency's integral, at some times [s]."""
        t = np.asarray(times, float)
        inside, after = np.minimum(t, self.duration), np.maximum(t - self.duration, 0.0)
        ratio = math.log(self.last / self.first)
        if self.sweep == "log" and abs(ratio) > 1e-12:
            cycles = self.first * self.duration / ratio * np.expm1(ratio * inside / self.duration)
        else:
            cycles = self.first * inside + 0.5 * (self.last - self.first) / self.duration * inside**2
        wave: np.ndarray = self.mean + self.amplitude * np.sin(2.0 * np.pi * (cycles + self.last * after))
        return wave

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``chirp 2 bar +- 1 bar from 0.1 Hz to 10 Hz in 20 s``."""
        swing = _swing(self.mean, self.amplitude, unit)
        log = ", logarithmic" if self.sweep == "log" else ""
        return f"chirp {swing} from {self.first:g} Hz to {self.last:g} Hz in {time_words(self.duration)}{log}"

    @property
    def fastest(self) -> float:
        """The higher end [1/s]."""
        return max(self.first, self.last)


@register
@dataclass(frozen=True, kw_only=True)
class MultiSine(Waveform):
    """Sines of one amplitude at several frequencies; Schroeder's phases, which keep the peaks low, unless given.

    Source of the phases -pi k (k - 1)/N: M. R. Schroeder, IEEE Trans. Information Theory 16(1), 1970,
    doi:10.1109/TIT.1970.1054411.
    """

    kind: ClassVar[str] = "multisine"
    straight: ClassVar[bool] = True
    mean: float = schema.number(VALUE, default=0.0)
    amplitude: float = schema.number(VALUE)
    frequencies: tuple[float, ...] = schema.numbers("1/s", (1e-9, math.inf))
    phases: tuple[float, ...] = schema.numbers("rad", default=())

    def __post_init__(self) -> None:
        if self.phases and len(self.phases) != len(self.frequencies):
            raise InputError("phases", len(self.phases), f"must be {len(self.frequencies)}, one per frequency")

    def at(self, times: Scalar) -> np.ndarray:
        """The sum at some times [s]."""
        t, n = np.asarray(times, float), len(self.frequencies)
        phases = self.phases or tuple(-math.pi * k * (k + 1) / n for k in range(n))
        waves = (np.sin(2.0 * np.pi * f * t + phase) for f, phase in zip(self.frequencies, phases, strict=True))
        return self.mean + self.amplitude * sum(waves, np.zeros(t.shape))

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``multisine 2 bar +- 0.1 bar each at 1, 2, 5 Hz``."""
        rates = ", ".join(f"{f:g}" for f in self.frequencies)
        return f"multisine {_swing(self.mean, self.amplitude, unit)} each at {rates} Hz"

    @property
    def fastest(self) -> float:
        """The highest [1/s]."""
        return max(self.frequencies)


@register
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
    low: float = schema.number(VALUE)
    high: float = schema.number(VALUE)
    cutoff: float = schema.number("1/s", (1e-9, math.inf))
    seed: int = schema.whole(0, 2**32 - 1, default=0)

    def at(self, times: Scalar) -> np.ndarray:
        """The spline at times from 0 s on."""
        place = np.asarray(times, float) * (self.cutoff * KNOTS)
        knot = np.floor(place)
        u = place - knot
        weights = ((1 - u) ** 3, (3 * u - 6) * u**2 + 4, ((3 - 3 * u) * u + 3) * u + 1, u**3)
        share = sum(w * uniform(self.seed, knot.astype(np.int64) + i) for i, w in enumerate(weights)) / 6.0
        wave: np.ndarray = self.low + (self.high - self.low) * share
        return wave

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``noise from 1 bar to 3 bar up to 10 Hz, seed 0``."""
        return f"noise from {pair(self, unit)} up to {self.cutoff:g} Hz, seed {self.seed}"

    @property
    def fastest(self) -> float:
        """Three times the cut-off, above which nothing is left [1/s]."""
        return 3.0 * self.cutoff


def _swing(mean: float, amplitude: float, unit: str) -> str:
    return f"{words(mean, unit)} +- {words(amplitude, unit)}"


@register
@dataclass(frozen=True, kw_only=True)
class PointTable(Waveform):
    """Points in time, straight between them or held from each on; the last value stays.

    In a file the points stand in place, or in a table that `file`, `time` and `column` name.
    """

    kind: ClassVar[str] = "table"
    digest_name: ClassVar[str] = "Table"
    times: tuple[float, ...] = schema.numbers("s", (0.0, math.inf))
    values: tuple[float, ...] = schema.numbers(VALUE)
    between: str = schema.word(default="straight")
    file: str = ""

    @classmethod
    def prepared(cls, table: FileTable, unit: str, files: ReadTable | None) -> tuple[FileTable, dict[str, JsonValue]]:
        """Take in the points of the file that a table names; their time then begins at 0 s."""
        if "file" not in table:
            return table, {}
        table.only(("file", "time", "column", "between"), "a table from a file has")
        file, time, column = (table.word(key) if key in table else None for key in ("file", "time", "column"))
        if files is None or file is None:
            raise table.fail("file", file, "no files can be read here")
        at, values = files(file, time, column, unit)
        times = tuple(float(t) - float(at[0]) for t in at)
        fields = {"times": times, "values": tuple(float(v) for v in values), "file": file}
        return table.without("file", "time", "column"), fields

    def __post_init__(self) -> None:
        check_rising(self.times, self.values)
        if self.between not in ("straight", "held"):
            raise InputError("between", self.between, "must be straight or held")

    @property
    def straight(self) -> bool:
        """Whether values between the points are interpolated linearly."""
        return self.between == "straight"

    def at(self, times: Scalar) -> np.ndarray:
        """Interpolated, or the last point."""
        t, values = np.asarray(times, float), np.asarray(self.values, float)
        if self.straight:
            wave: np.ndarray = np.interp(t, self.times, values)
            return wave
        return values[np.maximum(np.searchsorted(np.asarray(self.times), t + JUMP, side="right") - 1, 0)]

    def sentence(self, unit: str) -> str:
        """Describe the waveform, such as ``table of 200 points in 2 s from step.csv, 0 bar to 3 bar, straight``."""
        origin = f" from {self.file}" if self.file else ""
        ends = f"{words(min(self.values), unit)} to {words(max(self.values), unit)}"
        return f"table of {len(self.times)} points in {time_words(self.times[-1])}{origin}, {ends}, {self.between}"


@dataclass(frozen=True, kw_only=True)
class CompoundWaveform(Waveform):
    """A waveform of others, interpolated linearly if one of them is."""

    parts: tuple[Waveform, ...] = schema.entry(read_parts)

    @property
    def straight(self) -> bool:
        """Whether one of the parts is interpolated linearly."""
        return any(p.straight for p in self.parts)

    @property
    def fastest(self) -> float:
        """Rate of the fastest part [1/s]."""
        return max(p.fastest for p in self.parts)


@register
@dataclass(frozen=True, kw_only=True)
class Sum(CompoundWaveform):
    """A sum of waveforms."""

    kind: ClassVar[str] = "sum"

    def at(self, times: Scalar) -> np.ndarray:
        """The sum at some times [s]."""
        return sum((p.at(times) for p in self.parts), np.zeros(np.shape(times)))

    def sentence(self, unit: str) -> str:
        """The parts, joined by plus."""
        return " plus ".join(p.sentence(unit) for p in self.parts)


@register
@dataclass(frozen=True, kw_only=True)
class Sequence(CompoundWaveform):
    """Waveforms one after the other, each with its own time from 0 s on; the last one stays."""

    kind: ClassVar[str] = "sequence"
    lasting: tuple[float, ...] = ()

    @classmethod
    def prepared(cls, table: FileTable, unit: str, files: ReadTable | None) -> tuple[FileTable, dict[str, JsonValue]]:
        """Separate the times of the parts, which each states beside its kind."""
        table.only(("parts",), "a sequence has")
        parts = table.listed("parts")
        for one in parts:
            if "lasts" not in one:
                raise one.fail("lasts", None, "is missing: every part of a sequence needs a duration")
        lasting = [one.number("lasts", "s", declared=LASTING) for one in parts]
        return table.derived({"parts": [one.without("lasts").values for one in parts]}), {"lasting": tuple(lasting)}

    def at(self, times: Scalar) -> np.ndarray:
        """Each part in its turn, at some times [s]."""
        t = np.asarray(times, float)
        starts = np.concatenate([[0.0], np.cumsum(self.lasting[:-1])])
        turn = np.maximum(np.searchsorted(starts, t + JUMP, side="right") - 1, 0)
        elapsed = np.maximum(t - starts[turn], 0.0)
        out = np.zeros(t.shape)
        for i, p in enumerate(self.parts):
            out = np.where(turn == i, p.at(elapsed), out)
        return out

    def sentence(self, unit: str) -> str:
        """The parts with their times, joined by then."""
        timed = zip(self.parts, self.lasting, strict=True)
        return ", then ".join(f"{p.sentence(unit)} for {time_words(t)}" for p, t in timed)
