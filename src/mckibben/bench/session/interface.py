"""The interface of a session, which consoles, pages and Bluesky devices use wherever the machine's process is.

With it go the status, samples and messages that a session tells, and the limits and rates of manual operation.
"""

from __future__ import annotations

import abc
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from ..._jax import jnp
from ...answers import brief
from ...assembly.accounts import Accounts
from ...documents import JsonValue
from ...errors import InputError
from ...experiments.amounts import CHANNELS, read_amount
from ...experiments.dry_run import check
from ...experiments.protocol import Protocol
from ...experiments.read import build_protocol
from ...experiments.waveforms import time_words
from ...quantities import with_unit
from .. import channels
from ..hardware.simulated import Clock, SimulatedHardware
from ..prepare import PreparedRun, prepare_on_machine
from ..rig import Rig
from ..sample_loop import Lateness
from ..segment import SegmentMachine, software_of, timing_of
from ..sensors import SENSORS
from ..software.interlocks import EmergencyStop
from ..software.loop import BenchSoftware
from ..software.sequencer import SPAN, TENSION, VELOCITY, Manual

if TYPE_CHECKING:
    from ...recordings.recording import Recording
    from ..protocol_run import Display, Progress, RunState


IDLE, MANUAL, RUNNING, STOPPED, LOST, CLOSED = "idle", "manual", "running", "stopped", "lost", "closed"
REMEMBERED = 2000  # messages
SHOWN = ("pressure", "tension", "span")  # of the measured channels, in a line


class Message(NamedTuple):
    """A message of a session."""

    number: int  # counted from 1
    time: float | None  # time of the session or of a run [s]; None if it has none
    kind: str  # ``note``, ``done``, ``caution`` or ``stop``
    text: str  # a sentence


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
    """A ring buffer of the newest samples for displays; used under the lock of its owner."""

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


# ---- manual operation


HOLD = 5.0  # time for which set-points are held without a hand [s]
RATE = 1000.0  # samples per second, where the computer can [1/s]
MODES = {"span": SPAN, "velocity": VELOCITY, "tension": TENSION}


def session_rate(rig: Rig) -> float:
    """Return the usual sample rate of a session on a rig [1/s]."""
    return min(max(RATE, float(rig.computer.lowest_rate)), float(rig.computer.highest_rate))


def prepare_for_session(protocol: Protocol, rig: Rig, **options: object) -> PreparedRun:
    """Make the dry run of a protocol for a session that is not open yet, as `Session.prepare` will.

    Raises:
        InputError: names what cannot be read.
    """
    manual = build_protocol(_manual_operation("1 L0", session_rate(rig)), where="session")
    return prepare_on_machine(protocol, session_rate(rig), rig=rig, plumbing=rig.layout(manual), **options)


class ManualSetup:
    """A rig with a muscle, ready to be operated by hand.

    Args:
        rig: the rig.
        span: at which the muscle is mounted, as text or [m]; the rest length by default.
        rate: samples per second [1/s].
        hold: time for which set-points are held without a hand [s].
        **options: of `prepare`: muscle, unit, plumbing, seed, step.

    Raises:
        InputError: names what is unknown, or that the machine may not even stand there.
    """

    def __init__(
        self, rig: Rig, *, span: float | str | None = None, rate: float | None = None, hold: float = HOLD,
        **options: object,
    ) -> None:  # fmt: skip
        self.rig, self.rate = rig, session_rate(rig) if rate is None else rate
        place = "1 L0" if span is None else span if isinstance(span, str) else f"{span!r} m"
        operation = build_protocol(_manual_operation(place, self.rate), where="session")
        self.prepared: PreparedRun = prepare_on_machine(operation, self.rate, rig=rig, **options)
        check(list(self.prepared.findings), where="session")
        self.options = {**options, "rig": rig, "plumbing": self.prepared.layout}  # of every run on this machine
        self.timing, (self.segment,) = timing_of(self.prepared), tuple(self.prepared.segments())
        self.limits = rig.limits(self.prepared.layout)
        self.manual = Manual.of(self.limits, hold=hold)
        self.watch = rig.watch(self.prepared.layout)
        self.converters = rig.converters(self.segment.start_span)
        part = self.segment
        self.machine = rig.machine(part.layout, self.prepared.unit, start=part.start_span, moves=part.moves)
        self._own: SegmentMachine | None = None
        self._simulated: SimulatedHardware | None = None

    def simulated(self, clock: Clock | None) -> SimulatedHardware:
        """Set up the simulated machine, vented, with the muscle mounted."""
        self._own = SegmentMachine(self.prepared, 0, self.segment, self.timing)
        self._simulated = SimulatedHardware(self._own.at_interface(), clock)
        return self._simulated

    def software(self) -> BenchSoftware:
        """Build the software of manual operation; it begins vented, at the present span."""
        software = software_of(self.prepared, self.segment, self.timing)
        return software.replace(sequencer=self.manual, start_motor=jnp.asarray(jnp.nan))

    def amount(self, name: str, value: float | str) -> float:
        """Read a set-point, as text or SI, and check it against the limits of the rig [SI].

        Raises:
            InputError: names what is allowed.
        """
        unit = CHANNELS[name]
        rest = self.prepared.plan.rest_length
        si = read_amount(value, unit, field=name).si(rest) if isinstance(value, str) else float(value)
        if name != "pressure" and self.rig.motor is None:
            raise InputError(name, with_unit(si, unit), f"the rig {self.rig.name} has no motor")
        low, high = self.allowed(name)
        if not low <= si <= high:
            ends = f"{with_unit(low, unit)} to {with_unit(high, unit)}"
            raise InputError(name, with_unit(si, unit), f"the rig {self.rig.name} allows {ends} by hand")
        return si

    def allowed(self, name: str) -> tuple[float, float]:
        """Return the limits of a set-point [SI]."""
        limits, speed = self.limits, float(self.manual.speed)
        if name == "pressure":
            return limits.pressure[0], min(limits.pressure[1], limits.burst_pressure)
        if name == "span":
            return limits.span
        if name == "velocity":
            return -speed, speed
        return 0.0, min(limits.tension, limits.motor_force, float(self.watch.most_tension))

    def closed(self, begin: np.ndarray | None, end: np.ndarray | None) -> Accounts | None:
        """Close the accounts of a simulated machine between two of its states; None of a real one."""
        if self._own is None or self._simulated is None or begin is None or end is None:
            return None
        machine = self._simulated.machine
        return self._own.closed(machine.carry(end), machine.carry(begin))


def _manual_operation(span: str, rate: float) -> dict[str, JsonValue]:
    return {
        "schema": 1, "name": "manual", "title": "Manual operation", "sample_rate": f"{rate!r} Hz",
        "note": "Set-points were given by hand; the events tell which, and when.",
        "steps": [{"label": "by hand, beginning with", "pressure": "0 bar", "span": span, "for": "1 s"}],
    }  # fmt: skip


# ---- the session


class MachineSession(abc.ABC):
    """A machine to be operated: `Session` owns it in this process, `SessionProxy` reaches one in another process.

    Attributes:
        rig: whose machine it is.
        button: the emergency stop; another one after every reset.
        ready: whether the machine is sampled and can be operated by hand.
        period: period of the samples of a machine that is ready [s].
    """

    rig: Rig
    button: EmergencyStop
    ready: bool
    period: float

    @abc.abstractmethod
    def make_ready(self) -> None:
        """Set up the machine and begin to sample it by hand; once.

        Raises:
            MckibbenError: if the rig does not allow it, or the machine is not there.
        """

    @property
    @abc.abstractmethod
    def setup(self) -> ManualSetup:
        """Limits, rates and channels of manual operation.

        Raises:
            InputError: if the machine is there for runs only.
        """

    @property
    @abc.abstractmethod
    def simulated(self) -> bool:
        """Whether the machine is a simulated one."""

    @abc.abstractmethod
    def set_speed(self, speed: float) -> None:
        """Let a simulated machine go on at another speed over the wall clock.

        Raises:
            InputError: if the machine is a real one.
        """

    @property
    @abc.abstractmethod
    def gone(self) -> str:
        """Whether the machine is ``lost`` or ``closed``; nothing while it is there."""

    @property
    @abc.abstractmethod
    def why(self) -> str:
        """Reason for which the machine is stopped; empty while it is not stopped."""

    @property
    @abc.abstractmethod
    def busy(self) -> bool:
        """Whether manual commands are pending, or the machine is under pressure."""

    @abc.abstractmethod
    def status(self) -> Status:
        """Return the status of the machine at its newest sample, or the last one of a lost machine."""

    @abc.abstractmethod
    def latest(self) -> dict[str, float]:
        """Return the newest sample: ``time`` of the session [s] and every channel [SI]; empty if there is none."""

    @abc.abstractmethod
    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the samples after a time [s], as far as they are kept: times (n,) and channels (n,)."""

    @abc.abstractmethod
    def messages(self, after: int = 0) -> list[Message]:
        """Return the messages after the one with a number."""

    @abc.abstractmethod
    def note(self, text: str, kind: str = "note") -> None:
        """Add a message at the time of the newest sample; a recording keeps it, too."""

    @abc.abstractmethod
    def wait(self, seconds: float) -> None:
        """Wait for a time of the machine [s]; return earlier if it is stopped or lost meanwhile."""

    @abc.abstractmethod
    def set(self, **wanted: float | str) -> None:
        """Ask for a ``pressure``, and for one of ``span``, ``velocity`` and ``tension``, as text or SI.

        The set-points go there no faster than `ManualSetup.manual` allows.

        Raises:
            InputError: if the rig does not allow it, or the machine is not in manual mode.
        """

    @abc.abstractmethod
    def vent(self) -> None:
        """Vent at the manual rate; a velocity ends, a span or tension is held."""

    @abc.abstractmethod
    def emergency_stop(self, reason: str = "the button was pressed") -> None:
        """Vent and brake the motor at the next sample, also during a run; the machine stays stopped until `reset`."""

    @abc.abstractmethod
    def reset(self) -> None:
        """Return to manual mode after a stop, vented, with the motor in place.

        Raises:
            InputError: if it is not stopped.
        """

    @abc.abstractmethod
    def control_lost(self) -> None:
        """Note that the client in control disconnected: hold, then vent."""

    @abc.abstractmethod
    def control_back(self) -> None:
        """Note that a client is in control again; the set-points hold, unless the machine has vented."""

    @abc.abstractmethod
    def run(
        self, protocol: Protocol | str | PreparedRun, *, new_machine: bool = False, clock: Clock | None = None,
        log: str | Path | None = None, accept_saturation: bool = False, begun: Callable[[RunState], None] | None = None,
        progress: Progress | None = None, display: Display | None = None, ask: Callable[[str], None] | None = None,
    ) -> Recording:  # fmt: skip
        """Run a protocol, and come back to manual mode, holding the last set-points.

        The machine first goes by hand to where the protocol begins. The recording and other errors are those of `run.run`.

        Args:
            protocol: itself, its name, or what `prepare` made of it.
            new_machine: run on a machine that is set up for this run: a simulated one is made again, with a muscle at rest
                where the protocol begins; a real one is started, its encoder zeroed where the operator mounted the muscle.
                What is operated by hand stands still meanwhile.
            clock: of the time of a simulated machine in this process that is made again; None: as fast as it goes, whole
                chunks at once.
            log: a new ``.mcap`` file, see `run.run`.
            accept_saturation: go on where only the load cell's range would be exceeded.
            begun: given the state of the run when the machine is where it begins.
            progress: told how far it is [s], and the longest time [s].
            display: shown every chunk.
            ask: told what a person has to do; returns when it is done.

        Raises:
            InputError: a finding of the dry run, after which nothing moves; or the machine is not in manual mode.
        """

    @abc.abstractmethod
    def start_recording(self, log: str | Path | None = None) -> None:
        """Record every sample from the next one on, runs included, with `log` also into a new ``.mcap`` file."""

    @abc.abstractmethod
    def stop_recording(self) -> Recording:
        """End the recording, and return what was recorded.

        Raises:
            InputError: if nothing was.
        """

    @abc.abstractmethod
    def close(self) -> None:
        """Stop runs, vent, and release the machine; may be called twice."""

    def require_manual(self, action: str) -> None:
        """Raise an error unless set-points may be given by hand: the machine is ready, and no run or stop holds it.

        Raises:
            InputError: says what keeps the machine from it, and what would help.
        """
        self._require_there(action)
        self._require_ready(action)
        if (running := self.status().protocol) is not None:
            raise InputError(action, None, f"must wait: {running[0]} is running; stop it first")
        self._require_no_stop(action)

    def _require_there(self, action: str) -> None:
        if self.gone:
            why = f": {self.why}" if self.why else ""
            raise InputError(action, None, f"is not possible: the machine is {self.gone}{why}")

    def _require_ready(self, action: str) -> None:
        if not self.ready:
            problem = "the session was opened for runs only; open it with by_hand=True to operate the machine by hand"
            raise InputError(action, None, f"is not possible: {problem}")

    def _require_no_stop(self, action: str) -> None:
        if self.why:
            raise InputError(action, None, f"must wait: the machine is stopped ({self.why}); reset it first")

    def prepare(self, protocol: Protocol | str, accept_saturation: bool = False) -> PreparedRun:
        """Make the dry run of a protocol for this machine, in this process; nothing moves."""
        setup = self.setup
        return prepare_on_machine(protocol, setup.rate, accept_saturation=accept_saturation, **setup.options)

    def __enter__(self) -> Self:
        """Return the session itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Vent and close; at once after an error."""
        if kind is not None:
            self.button.press(f"the session ended with {kind.__name__}")
        self.close()
