"""Waveforms made of others or of measured points: table, sum, sequence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...errors import InputError
from .waveform import JUMP, PARTS, TIME, TIMED, VALUE, WORD, Waveform, check_rising, part, time_words, words


@dataclass(frozen=True, kw_only=True)
class Table(Waveform):
    """Points in time, straight between them or held from each on; the last value stays.

    In a file the points stand in place, or in a table that `file`, `time` and `column` name.
    """

    kind: ClassVar[str] = "table"
    times: tuple[float, ...] = part(TIME, 0.0)
    values: tuple[float, ...] = part(VALUE)
    between: str = part(WORD, default="straight")
    file: str = part(WORD, default="")

    def __post_init__(self) -> None:
        check_rising(self.times, self.values)
        if self.between not in ("straight", "held"):
            raise InputError("between", self.between, "allowed are straight, held")

    @property
    def straight(self) -> bool:
        """As `between` says."""
        return self.between == "straight"

    def at(self, times: Any) -> np.ndarray:
        """Interpolated, or the last point."""
        t, values = np.asarray(times, float), np.asarray(self.values, float)
        if self.straight:
            return np.interp(t, self.times, values)
        return values[np.maximum(np.searchsorted(np.asarray(self.times), t + JUMP, side="right") - 1, 0)]

    def sentence(self, unit: str) -> str:
        """Such as ``table of 200 points in 2 s from step.csv, 0 bar to 3 bar, straight``."""
        origin = f" from {self.file}" if self.file else ""
        ends = f"{words(min(self.values), unit)} to {words(max(self.values), unit)}"
        return f"table of {len(self.times)} points in {time_words(self.times[-1])}{origin}, {ends}, {self.between}"


@dataclass(frozen=True, kw_only=True)
class Sum(Waveform):
    """Several waveforms added; straight where one of them is."""

    kind: ClassVar[str] = "sum"
    parts: tuple[Waveform, ...] = part(PARTS)

    @property
    def straight(self) -> bool:
        """Whether one of them is."""
        return any(p.straight for p in self.parts)

    def at(self, times: Any) -> np.ndarray:
        """The sum."""
        return sum((p.at(times) for p in self.parts), np.zeros(np.shape(times)))

    def sentence(self, unit: str) -> str:
        """The parts, joined by plus."""
        return " plus ".join(p.sentence(unit) for p in self.parts)

    @property
    def fastest(self) -> float:
        """Of the fastest part [1/s]."""
        return max(p.fastest for p in self.parts)


@dataclass(frozen=True, kw_only=True)
class Sequence(Waveform):
    """Waveforms one after the other, each with its own time from 0 s on; the last one stays."""

    kind: ClassVar[str] = "sequence"
    parts: tuple[Waveform, ...] = part(TIMED)
    lasting: tuple[float, ...] = part(TIME, 1e-9)

    @property
    def straight(self) -> bool:
        """Whether one of them is."""
        return any(p.straight for p in self.parts)

    def at(self, times: Any) -> np.ndarray:
        """Each in its turn."""
        t = np.asarray(times, float)
        starts = np.concatenate([[0.0], np.cumsum(self.lasting[:-1])])
        turn = np.maximum(np.searchsorted(starts, t + JUMP, side="right") - 1, 0)
        own = np.maximum(t - starts[turn], 0.0)
        out = np.zeros(t.shape)
        for i, p in enumerate(self.parts):
            out = np.where(turn == i, p.at(own), out)
        return out

    def sentence(self, unit: str) -> str:
        """The parts with their times, joined by then."""
        timed = zip(self.parts, self.lasting, strict=True)
        return ", then ".join(f"{p.sentence(unit)} for {time_words(t)}" for p, t in timed)

    @property
    def fastest(self) -> float:
        """Of the fastest part [1/s]."""
        return max(p.fastest for p in self.parts)
