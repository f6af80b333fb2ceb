"""Status, newest samples and messages of a session."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...answers import brief
from ...documents import JsonValue
from ...experiments.waveforms import time_words
from ...quantities import with_unit
from .. import channels
from ..sample_loop import Lateness
from ..sensors import SENSORS

IDLE, MANUAL, RUNNING, STOPPED, LOST, CLOSED = "idle", "manual", "running", "stopped", "lost", "closed"
REMEMBERED = 2000  # messages
SHOWN = ("pressure", "tension", "span")  # of the measured channels, in a line


class Message(NamedTuple):
    """A message of a session.

    Attributes:
        number: counted from 1.
        time: time of the session or of a run [s]; None if it has none.
        kind: ``note``, ``done``, ``caution`` or ``stop``.
        text: a sentence.
    """

    number: int
    time: float | None
    kind: str
    text: str


class Messages:
    """The newest messages of a machine; safe for use by several threads.

    Args:
        told: called with every message.
    """

    def __init__(self, listener: Callable[[Message], None] | None = None) -> None:
        self._lock, self._count, self._told = threading.Lock(), 0, listener
        self._kept: deque[Message] = deque(maxlen=REMEMBERED)

    def say(self, text: str, time: float | None = None, kind: str = "note") -> None:
        """Add a message, at a time [s] if it has one."""
        with self._lock:
            self._count += 1
            message = Message(self._count, time, kind, text)
            self._kept.append(message)
        if self._told is not None:
            self._told(message)

    def after(self, number: int) -> list[Message]:
        """Return the messages after the one with a number, in order."""
        with self._lock:
            return [m for m in self._kept if m.number > number]


class SampleRing:
    """A ring buffer of the newest samples for displays; used under the lock of its owner.

    Args:
        size: samples.
    """

    def __init__(self, size: int) -> None:
        self.size, self.count = size, 0
        self._times = np.zeros(size)
        self._arrays: dict[str, np.ndarray] = {}

    def add(self, times: np.ndarray, arrays: Mapping[str, JsonValue]) -> None:
        """Add samples (n,); a missing channel is NaN."""
        n = len(times)
        if n > self.size:
            self.add(times[: n - self.size], {k: v[: n - self.size] for k, v in arrays.items()})
            times, arrays, n = times[-self.size :], {k: v[-self.size :] for k, v in arrays.items()}, self.size
        for name in arrays:
            if name not in self._arrays:
                self._arrays[name] = np.full(self.size, np.nan)
        first = self.count % self.size
        cut = min(n, self.size - first)
        for row, values in [(self._times, times), *((a, arrays.get(k)) for k, a in self._arrays.items())]:
            column = np.full(n, np.nan) if values is None else values
            row[first : first + cut], row[: n - cut] = column[:cut], column[cut:]
        self.count += n

    def latest(self) -> dict[str, float]:
        """Return the newest sample: ``time`` [s] and every channel [its unit]; empty before the first."""
        if not self.count:
            return {}
        at = (self.count - 1) % self.size
        return {"time": float(self._times[at]), **{name: float(a[at]) for name, a in self._arrays.items()}}

    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the samples after a time [s] that are still kept: times (n,) and channels (n,)."""
        kept = min(self.count, self.size)
        order = (self.count - kept + np.arange(kept)) % self.size
        order = order[np.searchsorted(self._times[order], time, side="right") :]
        return self._times[order], {name: a[order] for name, a in self._arrays.items()}


@dataclass(frozen=True)
class Status:
    """The status of a machine at its newest sample, in SI units; pressures are gauge.

    Attributes:
        state: idle, manual, running, stopped, lost or closed.
        why: what stopped it or how it was lost.
        time: time of the session [s].
        measured: channels.
        set_points: where they are now: of the pressure, and of what the motor controls.
        deadlines: how the manual loop kept them.
        protocol: what runs, with the time done and the longest [s].
        recorded: how long something has been recorded by hand [s]; None if nothing is.
    """

    state: str
    why: str
    time: float
    measured: Mapping[str, float]
    set_points: Mapping[str, float]
    deadlines: Lateness
    protocol: tuple[str, float, float] | None = None
    recorded: float | None = None
    units: Mapping[str, str] = field(default_factory=lambda: {n: u for n, (u, _) in channels.measured().items()})

    __repr__ = brief

    def line(self) -> str:
        """Summarise state and main values in one line."""
        values = [f"{n} {with_unit(self.measured[n], self.units[n])}" for n in SHOWN if n in self.measured]
        return "  ".join([self.doing(), *values, f"{self.time:.1f} s"])

    def doing(self) -> str:
        """Describe the state, with the running protocol."""
        if self.protocol is not None:
            name, done, total = self.protocol
            return f"{self.state} {name} {done:.1f} s of {total:.1f} s"
        return self.state if self.recorded is None else f"{self.state}, recording {self.recorded:.1f} s"

    def lines(self) -> list[str]:
        """Describe the whole status, one line per value."""
        lines = [f"{self.doing()}{': ' if self.why else ''}{self.why}"]
        for name, value in self.measured.items():
            own = SENSORS[name].set_point if name in SENSORS else name
            asked = self.set_points.get(own)
            text = f"{name:<15}{with_unit(value, self.units[name]):>11}"
            lines.append(text if asked is None else f"{text}   set-point {with_unit(asked, self.units[name])}")
        for name in self.set_points.keys() - self.measured.keys():
            unit = channels.COMMANDS[f"command.{name}"][0]
            lines.append(f"{name:<15}{'':>11}   set-point {with_unit(self.set_points[name], unit)}")
        late = self.deadlines
        half, worst = (time_words(float(f"{late.percentiles[i]:.2g}")) for i in (0, 3))
        lateness = f", half of them late by {half} or more, the latest by {worst}" if late.percentiles[3] > 0.0 else ""
        lines.append(f"{self.time:.3f} s; {late.samples} samples by hand{lateness}")
        return lines

    def plain(self) -> dict[str, JsonValue]:
        """Return the status as plain data for JSON."""
        return {
            "state": self.state, "why": self.why, "time": self.time, "measured": dict(self.measured),
            "set_points": dict(self.set_points), "deadlines": self.deadlines._asdict(),
            "protocol": None if self.protocol is None else list(self.protocol), "recorded": self.recorded,
        }  # fmt: skip
