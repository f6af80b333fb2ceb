"""The seven channels of the web interface: the newest samples for all pages, and what the last whole cycle says.

Samples go out as binary frames that a page draws directly: the identity of the server, four whole numbers and then the
channels one after the other, little endian:

    server 8 bytes, epoch u32, first sample u32, samples n u32, channels m u32, values f32 (m, n)

An epoch is one run, or one stretch by hand; its samples are `period` [s] apart, and sample 0 is at 0 s. The values are SI.
Epochs are counted from 1 by every server: without its identity one of them may be taken for that of another server.
"""

from __future__ import annotations

import contextlib
import secrets
import struct
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..analysis.channels import choose_channel
from ..analysis.loops import closed_area
from ..analysis.shortening import shortening_power
from ..bench.rig import Rig
from ..components.gas import AIR
from ..documents import JsonValue
from ..errors import InputError, MckibbenError
from ..quantities import from_si, shown_unit
from ..recordings import Channel, Recording

CHANNELS = ("pressure", "tension", "length", "flow", "valve", "set_pressure", "set_length")
HEAD = struct.Struct("<8sIIII")
KEPT = 60_000  # samples that a page which lost the line gets again


class Stream:
    """Samples of the newest epoch; memory is bounded."""

    def __init__(self, kept: int = KEPT) -> None:
        self.server = secrets.token_hex(8)
        self._lock, self._size = threading.Lock(), kept
        self._ring = np.full((len(CHANNELS), kept), np.nan, np.float32)
        self.epoch, self.count, self.period, self._start = 0, 0, 1e-3, 0
        self.about: dict[str, Any] = {"kind": "none", "name": ""}
        self._made: tuple[tuple[int, int, int], bytes] | None = None

    def begin(self, kind: str, name: str, period: float, start: int = 0) -> int:
        """Begin an epoch: ``run`` or ``hand``, with its name, the sample period [s] and its first number."""
        with self._lock:
            self.epoch, self.count, self.period, self._start = self.epoch + 1, start, period, start
            self.about = {"kind": kind, "name": name}
            return self.epoch

    def add(self, columns: Mapping[str, JsonValue]) -> None:
        """Add samples (n,) of every channel [SI]; a missing one is NaN."""
        n = len(next(iter(columns.values())))
        block = np.full((len(CHANNELS), n), np.nan, np.float32)
        for row, name in enumerate(CHANNELS):
            if name in columns:
                block[row] = columns[name]
        with self._lock:
            block = block[:, -self._size :]
            at = (self.count + n - block.shape[1] + np.arange(block.shape[1])) % self._size
            self._ring[:, at] = block
            self.count += n

    def head(self) -> dict[str, JsonValue]:
        """Properties of the epoch that a page needs."""
        with self._lock:
            return {"epoch": self.epoch, "period": self.period, **self.about}

    def frame(self, epoch: int, seen: int) -> tuple[bytes, int, int]:
        """Samples of an epoch that a page with `seen` samples does not have yet.

        Returns:
            The bytes, empty if there is nothing new; the epoch and the samples that it has then.
        """
        with self._lock:
            first = seen if epoch == self.epoch else 0
            first = max(first, self.count - self._size, self._start)
            n = self.count - first
            if n <= 0:
                return b"", self.epoch, self.count
            key = (self.epoch, first, n)
            if self._made is None or self._made[0] != key:
                at = (first + np.arange(n)) % self._size
                head = HEAD.pack(bytes.fromhex(self.server), self.epoch, first, n, len(CHANNELS))
                self._made = key, head + self._ring[:, at].astype("<f4", copy=False).tobytes()
            return self._made[1], self.epoch, self.count

    def newest(self, n: int) -> dict[str, np.ndarray]:
        """Return the last n samples of every channel [SI], or all available ones."""
        with self._lock:
            n = min(n, self.count - self._start, self._size)
            at = (self.count - n + np.arange(n)) % self._size
            return {name: self._ring[i, at] for i, name in enumerate(CHANNELS)}

    def latest(self) -> dict[str, float]:
        """Return the newest sample of every channel [SI]; empty before the first."""
        with self._lock:
            if self.count == self._start:
                return {}
            at = (self.count - 1) % self._size
            return {n: float(self._ring[i, at]) for i, n in enumerate(CHANNELS)}


TUBE = "tube.mass_flow"
# Channel of a run by the name of `CHANNELS`.
RECORDED = {
    "pressure": "pressure", "tension": "tension", "length": "span", "set_pressure": "command.pressure",
    "set_length": "command.span",
}  # fmt: skip
# Of every channel: SI unit of the stream, and the unit and factor of the screen.
UNITS = {"pressure": "Pa", "tension": "N", "length": "m", "flow": "m^3/s", "valve": "1"}
SHOWN = {"flow": "L/min", "valve": "%"}


class Columns:
    """Conversion of a rig's channels to those of the web interface."""

    def __init__(self, rig: Rig) -> None:
        self.top = float(rig.valve_out.high)
        room = rig.environment
        self.density = float(AIR.density(room.pressure_abs, room.temperature))

    def of(self, arrays: Mapping[str, JsonValue]) -> dict[str, np.ndarray]:
        """Return columns (n,) by the names of `stream.CHANNELS` [SI]; the flow is in terms of ambient air [m^3/s]."""
        columns = {shown: np.asarray(arrays[name], float) for shown, name in RECORDED.items() if name in arrays}
        if "valve.command" in arrays:
            columns["valve"] = np.asarray(arrays["valve.command"], float) / self.top
        # the mass flow towards the muscle: of its tube, or what the valve lets in less what it lets out
        into = [n for n in arrays if n.endswith("supply_to_outlet.mass_flow")]
        out = [n for n in arrays if n.endswith("outlet_to_exhaust.mass_flow")]
        if TUBE in arrays:
            columns["flow"] = np.asarray(arrays[TUBE], float) / self.density
        elif into and out:
            flow = np.asarray(arrays[into[0]], float) - np.asarray(arrays[out[0]], float)
            columns["flow"] = flow / self.density
        return columns


def factors() -> dict[str, dict[str, JsonValue]]:
    """Return the displayed unit of every quantity, and its factor from SI."""
    units: dict[str, dict[str, JsonValue]] = {}
    for name, si in UNITS.items():
        unit = SHOWN.get(name, shown_unit(si))
        units[name] = {"unit": unit, "factor": 100.0 if unit == "%" else from_si(1.0, si, unit.replace("L", "l"))}
    return units


LEAST_SAMPLES = 16  # samples of a cycle


def of_cycle(columns: dict[str, np.ndarray], period: float, frequency: float) -> list[dict[str, JsonValue]]:
    """Compute work, power and air of the last cycle.

    Args:
        columns: columns of the last two cycles and some samples, (n,) each [SI].
        period: period of the samples [s].
        frequency: frequency of the cycles [Hz].

    Returns:
        Name, value, unit and places of each number that could be had; nothing if the cycle has too few samples. The
        work is positive where the muscle does it.
    """
    n = round(1.0 / (frequency * period))
    length, tension = columns["length"].astype(float), columns["tension"].astype(float)
    if n < LEAST_SAMPLES or len(length) < n or not (np.isfinite(length).all() and np.isfinite(tension).all()):
        return []
    work = -closed_area(length[-n:], tension[-n:])
    rows = [_measure("Work per cycle", work, "J", 2)]
    try:
        channels = {"length": Channel(length, "m", "measured"), "tension": Channel(tension, "N", "measured")}
        record = Recording(period * np.arange(len(length)), channels, {})
        power = shortening_power(record, length="length", tension="tension", frequency=frequency)
        rows.append(_measure("Mean power while shortening", power.mean_power, "W", 2))
        rows.append(_measure("Peak power", power.largest_power, "W", 2))
    except MckibbenError:
        pass  # not yet two turns of a kind
    flow = columns["flow"][-n:].astype(float)
    if np.isfinite(flow).all():
        air = from_si(float(np.sum(np.maximum(flow, 0.0)) * period), "m^3", "cm^3")
        rows.append(_measure("Air per cycle, as in the room", air, "cm\u00b3", 1))
    rows.append(_measure("Highest tension", float(tension[-n:].max()), "N", 1))
    return rows


def _measure(name: str, value: float, unit: str, places: int) -> dict[str, JsonValue]:
    return {"name": name, "value": value, "unit": unit, "places": places}


def channel(record: Recording, names: Sequence[str]) -> str:
    """The first of some channels that a recording has; nothing if it has none."""
    return next((n for n in names if n in record and np.isfinite(record[n]).any()), "")


def places(record: Recording) -> dict[str, str]:
    """Channels of length, pressure and tension, measured ones first; of a file of others by their names or units."""
    from ..studies.comparison.table import LENGTHS, PRESSURES, TENSIONS

    named = {"length": LENGTHS, "pressure": PRESSURES, "tension": TENSIONS}
    channels = {quantity: channel(record, names) for quantity, names in named.items()}
    if "source" in record.meta:
        for quantity in [quantity for quantity, name in channels.items() if not name]:
            with contextlib.suppress(InputError):
                channels[quantity] = choose_channel(record, quantity)
    return {quantity: name for quantity, name in channels.items() if name}
