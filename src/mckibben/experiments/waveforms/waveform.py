"""What a waveform is, and how its numbers become words."""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ...errors import InputError
from ...quantities import with_unit

VALUE, TIME, RATE, SHARE, ANGLE = "value", "s", "1/s", "1", "rad"  # VALUE: in the unit of the signal
WORD, WHOLE, PARTS, TIMED = "word", "whole", "parts", "timed"  # neither: text, integers, waveforms, and pieces of time
RELATIVE = {"L0": "m", "L0/s": "m/s"}  # a muscle's own units, and what they are once its rest length is known
JUMP = 1e-9  # [s]; a sample so close before a jump stands for it: 0.3 is no whole number of milliseconds in binary


def part(unit: str, low: float = -math.inf, high: float = math.inf, *, key: str = "", **options: Any) -> Any:
    """A field of a waveform: its unit, its inclusive bounds, and its key in a file where that is a word of Python."""
    return field(metadata={"unit": unit, "bounds": (low, high), "key": key}, **options)


@dataclass(frozen=True, kw_only=True)
class Waveform(abc.ABC):
    """Values over time from 0 s on."""

    kind: ClassVar[str]

    @property
    @abc.abstractmethod
    def straight(self) -> bool:
        """Whether it goes along a line between samples; else each sample is held."""

    @abc.abstractmethod
    def at(self, times: Any) -> np.ndarray:
        """Values at times [s], in the unit of the signal; shape of the times."""

    @abc.abstractmethod
    def sentence(self, unit: str) -> str:
        """In words, for a signal of an SI unit."""

    @property
    def fastest(self) -> float:
        """Highest frequency that samples must resolve [1/s]; zero where only jumps would ask for one."""
        return 0.0


def words(value: float, unit: str) -> str:
    """A value as a person reads it; in rest lengths where the unit is one of `RELATIVE`."""
    if unit in RELATIVE:
        return f"{float(value):.4g} {unit}"
    return with_unit(float(value), unit)


def time_words(seconds: float) -> str:
    """A time in the unit that fits: ``50 us``, ``1 ms``, ``2 s``."""
    for limit, factor, unit in ((1e-3, 1e6, "us"), (1.0, 1e3, "ms")):
        if 0.0 < abs(seconds) < limit * (1.0 - 1e-9):
            return f"{seconds * factor:.6g} {unit}"
    return f"{seconds:.6g} s"


def check_rising(times: tuple[float, ...], values: tuple[float, ...]) -> None:
    """Refuse a table whose times do not rise from 0 s, or that has not as many values."""
    if len(times) != len(values):
        raise InputError("values", len(values), f"allowed are {len(times)}, one for each of the times")
    if times[0] != 0.0:
        raise InputError("times", time_words(times[0]), "allowed is 0 s as the first of them")
    for a, b in zip(times, times[1:], strict=False):
        if not b > a:
            raise InputError("times", time_words(b), f"allowed is a time after {time_words(a)}: they rise")
