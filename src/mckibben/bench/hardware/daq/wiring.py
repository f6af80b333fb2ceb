"""Which terminals of a data acquisition card are which part of the machine, and what their levels count.

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
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ....errors import InputError
from ....schema import FileTable, read_table
from .terminals import (
    INPUT,
    LOCAL,
    OUTPUT,
    SERVER,
    TERMINAL,
    Analog,
    Counter,
    Drive,
    ShutOff,
    chassis,
    named,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CardWiring:
    """All terminals of a machine.

    Attributes:
        inputs: analogue channels by name, in the order in which the card scans them; all of one device or chassis.
        valve: output to the valve, whose count 0 vents.
        motor: output to the motor's amplifier, of the same device or chassis as the valve's.
        shut_off: line of the shut-off valve.
        encoder: counter of the encoder, sampled by the clock of the inputs.
        clock: terminal of that clock; that of the inputs' device where it is empty.
        connection: ``local``, or ``grpc://host:port`` of a device server.
        where: what complaints name.

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
            raise InputError(error.field, error.value, error.allowed, where=self.where) from None

    def _check(self) -> None:
        if not self.inputs:
            raise InputError("inputs", "none", "must be one or more: their clock is the machine's")
        for name, entry in self.inputs.items():
            named(f"inputs.{name}.channel", entry.channel, INPUT)
        for key, out in (("valve", self.valve), ("motor", self.motor)):
            if out is not None:
                named(f"{key}.channel", out.channel, OUTPUT)
        if self.clock:
            named("clock", self.clock, TERMINAL)
        if self.connection != LOCAL:
            named("connection", self.connection, SERVER)
        seen: dict[str, str] = {}
        for path, terminal in self.terminals().items():
            if terminal.lower() in seen:
                raise InputError(path, terminal, f"it is taken by {seen[terminal.lower()]}")
            seen[terminal.lower()] = path
        clocked = [f"inputs.{n}.channel" for n in self.inputs] + (["encoder.counter"] if self.encoder else [])
        self._together([path for path in clocked if not (self.clock and path == "encoder.counter")])
        self._together(["valve.channel"] + (["motor.channel"] if self.motor else []))

    def _together(self, paths: list[str]) -> None:
        terminals = self.terminals()
        owner = chassis(terminals[paths[0]])
        for path in paths[1:]:
            if chassis(terminals[path]).lower() != owner.lower():
                allowed = f"must be one of {owner}, as {paths[0]} is: they share one clock"
                raise InputError(path, terminals[path], allowed)

    def terminals(self) -> dict[str, str]:
        """Names of the physical channels by the path of their entry."""
        found = {f"inputs.{n}.channel": entry.channel for n, entry in self.inputs.items()}
        found["valve.channel"] = self.valve.channel
        if self.motor is not None:
            found["motor.channel"] = self.motor.channel
        if self.shut_off is not None:
            found["shut_off.line"] = self.shut_off.line
        if self.encoder is not None:
            found["encoder.counter"] = self.encoder.counter
        return found

    @property
    def sample_clock(self) -> str:
        """Terminal of the clock that samples the inputs."""
        return self.clock or f"/{chassis(next(iter(self.inputs.values())).channel)}/ai/SampleClock"


def wiring(table: Mapping[str, Any], *, where: str = "wiring", path: str = "daq") -> CardWiring:
    """A wiring from its table, as it stands at the top of this file.

    Args:
        table: what TOML gives for ``[daq]``.
        where: file, for complaints.
        path: of the table, for complaints.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    top = FileTable.of(table, path, where)
    top.only(("connection", "clock", "inputs", "valve", "motor", "shut_off", "encoder"))
    for key in ("inputs", "valve"):
        if key not in top:
            raise top.fail(key, "missing", "it is required")
    parts: dict[str, Any] = {"inputs": {n: read_table(Analog, one) for n, one in top.tables("inputs")}}
    kinds: dict[str, type[Any]] = {"valve": Analog, "motor": Drive, "shut_off": ShutOff, "encoder": Counter}
    for key, kind in kinds.items():
        output: dict[str, Any] = {"terminal": "default"} if issubclass(kind, Analog) else {}  # of inputs alone
        if key in top:
            parts[key] = read_table(kind, top.table(key), **output)
    words: dict[str, Any] = {key: top.word(key) for key in ("connection", "clock") if key in top}
    try:
        return CardWiring(**parts, **words, where=f"{where} [{path}]")
    except InputError as error:
        raise InputError(top.field(error.field), error.value, error.allowed, where=where) from None
