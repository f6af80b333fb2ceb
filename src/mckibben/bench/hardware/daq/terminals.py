"""Terminals of a data acquisition card, each with the scale of its counts; all levels in [V].

    count = clip(floor((u - low)/q + 1/2), 0, 2^bits - 1),   u(count) = low + count q,   q = (high - low)/2^bits

These counts are those of the rig's converters (`analogue.Scale`, here in plain floats for one level at a time), not those of
the card: a card of 16 bits over 20 V may stand for a converter of 12 bits over 5 V, and what it shows is rounded to the
nearest count.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

from .... import schema
from ....errors import InputError
from ....quantities import Quantity
from ..analogue import BITS
from ..motor import BITS as COUNTER_BITS

LEVEL = Quantity("V", (-100.0, 100.0), "level at a terminal", "", (-10.0, 10.0))
TERMINALS = ("default", "rse", "nrse", "differential", "pseudodifferential")
DECODINGS = ("X1", "X2", "X4")
LEVELS = ("high", "low")
LOCAL = "local"
GRPC = "grpc://"
DEVICE = r"[^/,:\s]+"
INPUT = (rf"{DEVICE}/(ai\d+|_\w+)", "an analogue input such as 'Dev1/ai0'")
OUTPUT = (rf"{DEVICE}/ao\d+", "an analogue output such as 'Dev1/ao0'")
LINE = (rf"{DEVICE}/port\d+/line\d+", "a digital line such as 'Dev1/port0/line0'")
COUNTER = (rf"{DEVICE}/ctr\d+", "a counter such as 'Dev1/ctr0'")
TERMINAL = (rf"/{DEVICE}/[^,:\s]+", "a terminal such as '/Dev1/PFI8'")
SERVER = (rf"{GRPC}[^/\s:]+:\d+", "'local', or a device server such as 'grpc://192.168.1.20:31763'")


def _read_range(raw: Any, place: schema.Place) -> tuple[float, ...]:
    if not isinstance(raw, list) or len(raw) != 2:
        raise place.fail(raw, "must be a list of two levels such as ['-10 V', '10 V']")
    return tuple(schema.read_number(level, "V", LEVEL.bounds, place.field, place.where) for level in raw)


@dataclass(frozen=True, kw_only=True)
class Analog:
    """An analogue terminal, in [V]: its name, the scale of its counts, and the range that the card is set to."""

    channel: str
    low: float = schema.number("V", LEVEL.bounds, "level that stands for count 0")
    high: float = schema.number("V", LEVEL.bounds, "level that would stand for the count after the highest")
    bits: int
    range: tuple[float, float] | None = schema.entry(_read_range, default=None)
    terminal: str = "default"

    def __post_init__(self) -> None:
        """Refuse what no converter has."""
        if type(self.bits) is not int or not BITS[0] <= self.bits <= BITS[1]:
            raise InputError("bits", str(self.bits), f"must be a whole number from {BITS[0]} to {BITS[1]}")
        for key, level in (("low", self.low), ("high", self.high), *(("range", r) for r in self.range or ())):
            LEVEL.check(key, level)
        if not self.low < self.high:
            raise InputError("high", f"{self.high:g} V", f"must be more than low, {self.low:g} V")
        least, most = self.span
        if not (least <= self.low and self.high <= most):
            wide = f"from {self.low:g} V or less to {self.high:g} V or more"
            raise InputError("range", f"{least:g} V to {most:g} V", f"must be {wide}, for it holds low to high")
        among("terminal", self.terminal, TERMINALS)

    @property
    def span(self) -> tuple[float, float]:
        """The range that the card is set to [V]."""
        return (self.low, self.high) if self.range is None else self.range

    @property
    def step(self) -> float:
        """One count [V]."""
        return (self.high - self.low) / 2.0**self.bits

    def count(self, volts: float) -> int:
        """The count nearest to a level [V], at the rail beyond the scale. A level that is no number is a `ValueError`."""
        found = (volts - self.low) / self.step + 0.5
        last = (1 << self.bits) - 1
        return 0 if found < 1.0 else last if found >= last else math.floor(found)

    def volts(self, count: int) -> float:
        """The level [V] that stands for a count, of the nearest one that there is."""
        return self.low + min(max(count, 0), (1 << self.bits) - 1) * self.step


@dataclass(frozen=True, kw_only=True)
class Drive(Analog):
    """The output to the motor's amplifier, and the level at which the motor does not pull [V]."""

    rest: float = schema.number("V", LEVEL.bounds, "level at which the motor does not pull")

    def __post_init__(self) -> None:
        """Refuse a rest that the output cannot take."""
        super().__post_init__()
        if not self.low <= self.rest < self.high:
            raise InputError("rest", f"{self.rest:g} V", f"must be from {self.low:g} V to below {self.high:g} V")


@dataclass(frozen=True, kw_only=True)
class ShutOff:
    """The digital line of the shut-off valve, and the level at which that is open."""

    line: str
    open_at: str = "high"

    def __post_init__(self) -> None:
        """Refuse what is no line and no level."""
        named("line", self.line, LINE)
        among("open_at", self.open_at, LEVELS)

    def level(self, opened: bool) -> bool:
        """Whether the line is high."""
        return opened == (self.open_at == "high")


@dataclass(frozen=True, kw_only=True)
class Counter:
    """The counter of a quadrature encoder; a and b are terminals, the counter's own where they are empty."""

    counter: str
    decoding: str = "X4"
    bits: int = 32
    a: str = ""
    b: str = ""

    def __post_init__(self) -> None:
        """Refuse what no counter has."""
        named("counter", self.counter, COUNTER)
        among("decoding", self.decoding, DECODINGS)
        low, high = COUNTER_BITS
        if type(self.bits) is not int or not low <= self.bits <= high:
            raise InputError("bits", str(self.bits), f"must be a whole number from {low} to {high}")
        for key in ("a", "b"):
            if getattr(self, key):
                named(key, getattr(self, key), TERMINAL)

    def signed(self, position: float) -> int:
        """The count for a position in ticks, whether the card shows what is below zero as negative or wrapped around."""
        size = 1 << self.bits
        return (round(position) + size // 2) % size - size // 2


def named(key: str, value: str, kind: tuple[str, str]) -> None:
    """Refuse a name that is not of a kind."""
    if not isinstance(value, str) or re.fullmatch(kind[0], value) is None:
        raise InputError(key, value, f"must be {kind[1]}")


def among(key: str, value: str, known: tuple[str, ...]) -> None:
    """Refuse a word that is not known."""
    if value not in known:
        raise InputError(key, value, f"known are {', '.join(known)}")


def chassis(terminal: str) -> str:
    """Device of a terminal; of a module, the chassis that it is plugged into, which has the clocks."""
    return re.sub(r"Mod\d+$", "", terminal.split("/")[0])
