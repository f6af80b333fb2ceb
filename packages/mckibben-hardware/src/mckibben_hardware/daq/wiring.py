"""Assignment of the terminals of a data acquisition card to parts of the machine, and the scale of their levels.

A table of TOML:

    [daq]
    connection = "local"                 # the driver on this computer, or "grpc://host:port" of a device server
    clock = "/Dev1/ai/SampleClock"       # terminal of the inputs' sample clock, if it is not that of their device
    [daq.inputs.pressure]                # one table per analogue channel, in the order in which the card scans them
    channel = "Dev1/ai0"
    low = "0 V"                          # what stands for count 0
    high = "10 V"                        # what would stand for the count after the highest
    bits = 16
    range = ["-10 V", "10 V"]            # that the card is set to; low to high where it is left out
    terminal = "differential"            # or default, rse, nrse, pseudodifferential
    [daq.valve]                          # the same without a terminal
    [daq.motor]                          # the same, and
    rest = "0 V"                         # where the motor does not pull
    [daq.shut_off]
    line = "Dev1/port0/line0"
    open_at = "high"                     # or low
    [daq.encoder]
    counter = "Dev1/ctr0"
    decoding = "X4"                      # counts per step: X1, X2, X4
    bits = 32                            # after which the count wraps around
    a = "/Dev1/PFI8"                     # terminals of the two signals, those of the counter where they are left out
    b = "/Dev1/PFI10"

Each terminal has the scale of its counts, with levels in [V]:

    count = clip(floor((u - low)/q + 1/2), 0, 2^bits - 1),   u(count) = low + count q,   q = (high - low)/2^bits

These counts are those of the rig's converters (`Scale`, here in plain floats for one level at a time), not those of
the card: a card of 16 bits over 20 V may stand for a converter of 12 bits over 5 V, and what it shows is rounded to the
nearest count.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mckibben import schema
from mckibben.bench.hardware.converters import BITS
from mckibben.bench.hardware.stand import BITS as COUNTER_BITS
from mckibben.documents import JsonValue
from mckibben.errors import InputError
from mckibben.quantities import Quantity
from mckibben.schema import FileTable, read_table

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
        """Refuse invalid values of a converter."""
        if type(self.bits) is not int or not BITS[0] <= self.bits <= BITS[1]:
            raise InputError("bits", str(self.bits), f"must be a whole number from {BITS[0]} to {BITS[1]}")
        for key, level in (("low", self.low), ("high", self.high), *(("range", r) for r in self.range or ())):
            LEVEL.check(key, level)
        if not self.low < self.high:
            raise InputError("high", None, f"must be more than low, {self.low:g} V, got {self.high:g} V")
        least, most = self.span
        if not (least <= self.low and self.high <= most):
            wide = f"from {self.low:g} V or less to {self.high:g} V or more"
            raise InputError("range", None, f"must be {wide}, for it holds low to high, got {least:g} V to {most:g} V")
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
        count = (volts - self.low) / self.step + 0.5
        last = (1 << self.bits) - 1
        return 0 if count < 1.0 else last if count >= last else math.floor(count)

    def volts(self, count: int) -> float:
        """Level [V] of a count, or of the nearest existing one."""
        return self.low + min(max(count, 0), (1 << self.bits) - 1) * self.step


@dataclass(frozen=True, kw_only=True)
class Drive(Analog):
    """The output to the motor's amplifier, and the level at which the motor does not pull [V]."""

    rest: float = schema.number("V", LEVEL.bounds, "level at which the motor does not pull")

    def __post_init__(self) -> None:
        """Refuse a rest that the output cannot take."""
        super().__post_init__()
        if not self.low <= self.rest < self.high:
            raise InputError("rest", None, f"must be from {self.low:g} V to below {self.high:g} V, got {self.rest:g} V")


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
        """Raise an error for a value that no counter has."""
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
        raise InputError(key, value, known=known)


def chassis(terminal: str) -> str:
    """Device of a terminal; of a module, the chassis that it is plugged into, which has the clocks."""
    return re.sub(r"Mod\d+$", "", terminal.split("/")[0])


@dataclass(frozen=True, kw_only=True)
class CardWiring:
    """All connected terminals of a machine.

    Attributes:
        inputs: analogue channels by name, in the order in which the card scans them; all of one device or chassis.
        valve: output to the valve, whose count 0 vents.
        motor: output to the motor's amplifier, of the same device or chassis as the valve's.
        shut_off: line of the shut-off valve.
        encoder: counter of the encoder, sampled by the clock of the inputs.
        clock: terminal of that clock; that of the inputs' device where it is empty.
        connection: ``local``, or ``grpc://host:port`` of a device server.
        where: name for error messages.

    Raises:
        InputError: names the field, the value and what is allowed.
    """

    inputs: Mapping[str, Analog]
    valve: Analog
    motor: Drive | None = None
    shut_off: ShutOff | None = None
    encoder: Counter | None = None
    clock: str = ""
    connection: str = LOCAL
    where: str = field(default="wiring", compare=False)

    def __post_init__(self) -> None:
        """Refuse terminals of the wrong kind, used twice, or not driven by one clock."""
        try:
            self._check()
        except InputError as error:
            raise error.changed(where=self.where) from None

    def _check(self) -> None:
        if not self.inputs:
            raise InputError("inputs", None, "must be one or more: their clock is the machine's")
        for name, entry in self.inputs.items():
            named(f"inputs.{name}.channel", entry.channel, INPUT)
        for key, out in (("valve", self.valve), ("motor", self.motor)):
            if out is not None:
                named(f"{key}.channel", out.channel, OUTPUT)
        if self.clock:
            named("clock", self.clock, TERMINAL)
        if self.connection != LOCAL:
            named("connection", self.connection, SERVER)
        users: dict[str, str] = {}
        for path, terminal in self.terminals().items():
            if terminal.lower() in users:
                raise InputError(path, terminal, f"it is taken by {users[terminal.lower()]}")
            users[terminal.lower()] = path
        clocked = [f"inputs.{n}.channel" for n in self.inputs] + (["encoder.counter"] if self.encoder else [])
        self._together([path for path in clocked if not (self.clock and path == "encoder.counter")])
        self._together(["valve.channel"] + (["motor.channel"] if self.motor else []))

    def _together(self, paths: list[str]) -> None:
        terminals = self.terminals()
        owner = chassis(terminals[paths[0]])
        for path in paths[1:]:
            if chassis(terminals[path]).lower() != owner.lower():
                allowed = f"must be one of {owner}, as {paths[0]} is; they share one clock"
                raise InputError(path, terminals[path], allowed)

    def terminals(self) -> dict[str, str]:
        """Names of the physical channels by the path of their entry."""
        terminals = {f"inputs.{n}.channel": entry.channel for n, entry in self.inputs.items()}
        terminals["valve.channel"] = self.valve.channel
        if self.motor is not None:
            terminals["motor.channel"] = self.motor.channel
        if self.shut_off is not None:
            terminals["shut_off.line"] = self.shut_off.line
        if self.encoder is not None:
            terminals["encoder.counter"] = self.encoder.counter
        return terminals

    @property
    def sample_clock(self) -> str:
        """Terminal of the clock that samples the inputs."""
        return self.clock or f"/{chassis(next(iter(self.inputs.values())).channel)}/ai/SampleClock"


def wiring(table: Mapping[str, JsonValue], *, where: str = "wiring") -> CardWiring:
    """Read a wiring from its table, which is described at the top of this file.

    Args:
        table: content of the TOML table ``[daq]``.
        where: file, for error messages.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    top = FileTable.of(table, "daq", where)
    top.only(("connection", "clock", "inputs", "valve", "motor", "shut_off", "encoder"))
    for key in ("inputs", "valve"):
        if key not in top:
            raise top.fail(key, None, "is missing")
    parts: dict[str, Any] = {"inputs": {n: read_table(Analog, one) for n, one in top.tables("inputs")}}
    kinds: dict[str, type[Any]] = {"valve": Analog, "motor": Drive, "shut_off": ShutOff, "encoder": Counter}
    for key, kind in kinds.items():
        output: dict[str, Any] = {"terminal": "default"} if issubclass(kind, Analog) else {}  # of inputs alone
        if key in top:
            parts[key] = read_table(kind, top.table(key), **output)
    words: dict[str, Any] = {key: top.word(key) for key in ("connection", "clock") if key in top}
    try:
        return CardWiring(**parts, **words, where=f"{where} [daq]")
    except InputError as error:
        raise error.changed(field=top.field(error.field), where=where) from None
