"""The host's side of the serial line: a machine behind a microcontroller as `interface.Hardware`.

The device is the clock: it sends a sample every period, and `wait` gives them one after the other. What is lost or damaged
on the way is counted and never made up: the sample is still taken, with the newest reading and `fresh` False. The loop is
over, and the machine told to vent, when more than `patience` samples in a row are missing, when nothing comes for a time,
when the port is gone, and when the device has stopped or vented by itself. That time is one of the device: an emulated board
whose second takes eight of the wall clock may be silent for eight times as long. A real board's second takes one.

Lateness is counted from the first sample on by the clock of the host. The clocks of host and device may differ by 1e-4 of
the time: by so much the time expected of a sample follows those that come later, and at once those that come earlier.

Where the port has a file descriptor, the system is asked directly; elsewhere (Windows) the port's own read and write are.
Writing is safe for several threads. Frames are sorted as they come into those taken, lost, repeated and late.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from mckibben.bench.hardware.interface import Hardware
from mckibben.documents import JsonValue
from mckibben.errors import InputError, LineLostError
from mckibben.extras import library

from . import messages

BITS_PER_SECOND = 1_000_000  # what a port is opened with; a USB port or a pseudo-terminal does not look at it
_CHUNK = 4096  # [B]
_SLICE = 2e-4  # time of a wait that is shorter than what `poll` can wait [s]
_SLOW_READ = 0.01  # [s], of a port without a file descriptor


def open_port(port: str, baud: int) -> Any:
    """Open a serial port for exclusive use.

    Raises:
        InputError: if there is none, or pyserial is not installed.
    """
    serial = library("serial", "Machines on a serial port need", where=port)
    alone: Any = {"exclusive": True} if os.name == "posix" else {}
    try:
        opened = serial.Serial(port, baud, timeout=_SLOW_READ, write_timeout=0.1, **alone)
    except (OSError, ValueError) as error:  # SerialException is an OSError
        allowed = f"must be a serial port that can be opened; {_closed_because(port, error)}"
        raise InputError("port", port, allowed) from None
    if sys.platform == "linux":
        with contextlib.suppress(OSError, ValueError, AttributeError):  # an adapter may hold bytes back for 16 ms
            opened.set_low_latency_mode(True)
    return opened


def _closed_because(port: str, error: OSError | ValueError) -> str:
    import serial.tools.list_ports

    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        ports = sorted(one.device for one in serial.tools.list_ports.comports())
        said = f"there is none of this name: {'connected are ' + ', '.join(ports) if ports else 'none is connected'}"
        return said + ("; a speed behind @ is a whole number of bits per second" if "@" in port else "")
    if number == errno.EACCES:
        return "you lack the permission: on Linux join the group of the port, such as dialout, and log in again"
    if "lock" in str(error) or number in (errno.EBUSY, errno.EAGAIN):
        return "another program has it open"
    if "Inappropriate ioctl" in str(error):
        return "this is no serial port"
    return reason(error)


class Wire:
    """A port with `read`, `write`, `close`, and `fileno` if available."""

    def __init__(self, port: Any) -> None:
        self._port = port
        self._descriptor: int | None = None
        with contextlib.suppress(AttributeError, OSError, ValueError):
            self._descriptor = port.fileno() if hasattr(select, "poll") else None
        if self._descriptor is not None:
            os.set_blocking(self._descriptor, False)
            self._readable = select.poll()
            self._readable.register(self._descriptor, select.POLLIN)

    def read(self, seconds: float) -> bytes:
        """Return the bytes that have arrived, or wait a limited time for the first ones; empty on time-out.

        Raises:
            OSError, EOFError: if nothing can come any more.
        """
        until = time.perf_counter() + seconds
        while self._descriptor is None:  # a port that cannot be asked whether there is something waits a little itself
            came: bytes = self._port.read(max(getattr(self._port, "in_waiting", 1), 1))
            if came or time.perf_counter() >= until:
                return came or b""
        while not self._readable.poll(max(int(seconds * 1e3), 0)):
            seconds = until - time.perf_counter()
            if seconds <= 0.0:
                return b""
            if seconds < 1e-3:
                time.sleep(min(seconds, _SLICE))
        try:
            data = os.read(self._descriptor, _CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise EOFError("the other end is gone")
        return data

    def write(self, data: bytes, seconds: float) -> None:
        """Write bytes.

        Raises:
            OSError: if that is not possible within a time.
        """
        if self._descriptor is None:
            self._port.write(data)
            return
        until = time.perf_counter() + seconds
        while data:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:
                ahead = until - time.perf_counter()
                if ahead <= 0.0:
                    raise TimeoutError("nobody takes what is written") from None
                select.select([], [self._descriptor], [], ahead)

    def close(self) -> None:
        """Release the port."""
        with contextlib.suppress(OSError):
            self._port.close()


# Time between two greetings of a device that does not answer; many restart when their port is opened [s].
GREETING = 0.25
WRITING = 0.1  # longest time for which a message may wait to be written [s]


class SerialLine:
    """A port that carries messages.

    Attributes:
        name: name of the port, for errors.
        unknown: sound frames that are no message.
        received: bytes that have come.
        speed: bits per second with which the port was opened.

    Raises:
        InputError: if the port cannot be opened.
    """

    def __init__(self, port: str | Any, baud: int) -> None:
        self.name = port if isinstance(port, str) else str(getattr(port, "name", "port"))
        self._wire = Wire(open_port(port, baud) if isinstance(port, str) else port)
        self._writing = threading.RLock()  # a signal may write in the middle of another message
        self.frames, self.unknown, self.received, self.speed = messages.Frames(), 0, 0, baud

    @property
    def undecodable(self) -> int:
        """Number of frames dropped for other reasons than their checksum."""
        return self.frames.undecodable + self.frames.oversized + self.unknown

    @property
    def dropped(self) -> int:
        """Number of dropped frames."""
        return self.undecodable + self.frames.bad_checksum

    def read(self, seconds: float) -> list[messages.Message]:
        """Return the messages that have arrived, or wait a limited time for the first [s].

        Raises:
            OSError, EOFError: if nothing can come any more.
        """
        data = self._wire.read(seconds)
        self.received += len(data)
        arrived = [messages.message_of(frame) for frame in self.frames.feed(data)]
        self.unknown += arrived.count(None)
        return [message for message in arrived if message is not None]

    def write(self, message: messages.Message, *, before: bytes = b"") -> None:
        """Write a message; with `before`, a zero first, so that it is read after a truncated one.

        Raises:
            OSError: if nobody takes it.
        """
        data = before + messages.encode(message)
        with self._writing:
            self._wire.write(data, WRITING)

    def close(self) -> None:
        """Release the port."""
        self._wire.close()


def greet(line: SerialLine, seconds: float) -> messages.Welcome:
    """Request the identification of the device.

    Raises:
        LineLostError: if none answers within a time.
        InputError: if it does not speak this version of the protocol.
    """
    ours = int.from_bytes(os.urandom(4), "little")
    until = time.perf_counter() + seconds
    try:
        while (now := time.perf_counter()) < until:
            line.write(messages.Hello(ours, messages.VERSION), before=b"\0")
            again = min(now + GREETING, until)
            while (ahead := again - time.perf_counter()) > 0.0:
                for message in line.read(ahead):
                    if isinstance(message, messages.Welcome) and message.sequence == ours:
                        if message.version != messages.VERSION:
                            allowed = f"must be {messages.VERSION}; install the firmware that belongs to this package"
                            field = "protocol of the device"
                            raise InputError(field, message.version, allowed, where=line.name)
                        if len(set(message.names)) != len(message.names):
                            field, names = "channels of the device", ", ".join(message.names)
                            raise InputError(field, names, "each may be there once", where=line.name)
                        return message
    except (OSError, EOFError) as error:
        raise LineLostError(f"{line.name}: unplugged: {reason(error)}") from None
    came = (
        f"{line.received} bytes came that are no message: is its speed {line.speed} bit/s, and is the firmware on it?"
        if line.received
        else "nothing came: is it the board's port, and is the firmware on the board?"
    )
    raise LineLostError(f"{line.name}: no device answered within {seconds:g} s; {came}")


def fit(welcome: messages.Welcome, where: str, *, bits: Mapping[str, int], encoder: bool, motor: bool) -> None:
    """Refuse a device whose converters or outputs differ from the required ones.

    Raises:
        InputError: if so.
    """
    for name, bits_there in zip(welcome.names, welcome.bits, strict=True):
        if bits.get(name, bits_there) != bits_there:
            raise InputError(f"bits of {name}", bits_there, f"the rig has {bits[name]}", where=where)
    for part, needed, there in (("encoder", encoder, welcome.encoder), ("motor", motor, welcome.motor)):
        if needed and not there:
            raise InputError(part, None, "is missing on the device: the rig has one", where=where)


def places(welcome: messages.Welcome, names: Sequence[str], where: str) -> tuple[int, ...]:
    """Indices of channels among those of the device.

    Raises:
        InputError: if some are not there.
    """
    has = welcome.names
    absent = [name for name in names if name not in has]
    if absent:
        allowed = f"the rig needs {', '.join(absent)} too"
        raise InputError("channels of the device", ", ".join(has) or None, allowed, where=where)
    return tuple(has.index(name) for name in names)


def reason(error: BaseException) -> str:
    """Describe an error of the system in one line."""
    return " ".join(str(error).split())


DRIFT = 1e-4  # of the clocks of host and device, as a share of the time
GRACE = 0.25  # share of a period after which a damaged frame is taken for that of the sample that is missing
GRACE_IN_LOCK_STEP = 0.1  # the same where samples have no time [s]


class EndedError(Exception):
    """The run has ended and no more samples come; the message states why."""


class ReceivedSample(NamedTuple):
    """Sample of a device, or its absence: its message, None where it is missing, and how late it came [s]."""

    message: messages.SampleMessage | None
    lateness: float


class Arrivals:
    """Samples of one run, in order.

    Args:
        period: period of the samples [s].
        lock_step: whether the simulation waits for each sample, so that no sample can be late.
        patience: samples in a row that may be missing.

    Attributes:
        lost: samples whose frame did not arrive, or arrived damaged.
        repeated: frames of samples that had already arrived.
        late: frames that came more than a period late; dropped if their sample had been counted as lost.
        answers_late: samples to which the device had no answer when it took the next one.
        answers_damaged: samples for which the device received a damaged answer.
    """

    def __init__(self, period: float, lock_step: bool, patience: int) -> None:
        self.period, self.lock_step, self.patience = period, lock_step, patience
        self.lost = self.repeated = self.late = self.answers_late = self.answers_damaged = 0
        self._queue: deque[tuple[float, messages.SampleMessage | messages.Fault]] = deque()
        self._damaged: float | None = None  # when damage was seen that no sample is known to miss
        self._newest, self._missing = -1, 0
        self._origin = 0.0  # when sample 0 was there, or should have been
        self._first_at = self._newest_at = 0.0  # when sample 0 and the newest one were there

    def put(self, at: float, message: messages.SampleMessage | messages.Fault) -> None:
        """Add a message with its time of arrival [s]."""
        self._queue.append((at, message))

    def damage(self, at: float) -> None:
        """Note damaged bytes, and their time [s]."""
        self._damaged = at

    def take(self, sample: int) -> ReceivedSample | None:
        """Take a sample, or None if it can still arrive.

        Raises:
            EndedError: if it cannot.
        """
        while self._queue:
            at, message = self._queue[0]
            if isinstance(message, messages.Fault):
                raise EndedError(f"the device has stopped: {message.text or 'fault'} (code {message.code})")
            ahead = message.sequence - sample
            if ahead > 0:
                return self.without(sample, at, ahead)
            self._queue.popleft()
            if ahead == 0:
                return self._with(message, at)
            if message.sequence > self._newest:
                self.late += 1
            else:
                self.repeated += 1
        return None

    def slowness(self, beside: float) -> float:
        """Time of the wall clock per time of the device from its first sample to the newest, at least 1.

        Args:
            beside: time added to that of the device, so that a pause in the first samples counts for little [s].
        """
        device = max(self._newest, 0) * self.period + beside
        return max((self._newest_at - self._first_at) / device, 1.0) if device > 0.0 else 1.0

    def given_up(self, sample: int) -> float | None:
        """Time at which a damaged sample is given up [s]; None if no damage was received."""
        if self._damaged is None:
            return None
        if self.lock_step or self._newest < 0:
            return self._damaged + GRACE_IN_LOCK_STEP
        return max(self._damaged, self._origin + (sample + GRACE) * self.period)

    def without(self, sample: int, at: float, ahead: int = 1) -> ReceivedSample:
        """Give up a missing sample, the first of `ahead`, at a time [s].

        Raises:
            EndedError: if too many are.
        """
        if self._newest < 0:
            raise EndedError("the first sample is missing")
        if self._missing + ahead > self.patience:
            raise EndedError(f"{self._missing + ahead} samples are missing before sample {sample + ahead}")
        self._missing += 1
        self.lost += 1
        self._damaged = None  # this was it
        return ReceivedSample(None, 0.0 if self.lock_step else max(at - self._origin - sample * self.period, 0.0))

    def _with(self, message: messages.SampleMessage, at: float) -> ReceivedSample:
        if message.flags & messages.BY_ITSELF:
            raise EndedError("the device vented by itself, for it had no command for too many samples")
        if message.flags:
            self.answers_late += bool(message.flags & messages.UNANSWERED)
            self.answers_damaged += bool(message.flags & messages.DAMAGED)
        self._missing, self._newest = 0, message.sequence
        self._first_at, self._newest_at = at if self._newest == 0 else self._first_at, at
        if self._damaged is not None and at > self._damaged:
            self._damaged = None
        if self.lock_step:
            return ReceivedSample(message, 0.0)
        if message.sequence == 0:
            self._origin = at
        late = at - self._origin - message.sequence * self.period
        # the expected time of later samples follows the device's clock: at once where one is early, else slowly
        self._origin += late if late < 0.0 else min(late, DRIFT * self.period)
        self.late += late > self.period
        return ReceivedSample(message, max(late, 0.0))


# ---- the machine


SILENT = 3.0  # periods for which nothing may come at least
LONGEST = 2**32 - 1  # period [ns]


class SerialStatistics(NamedTuple):
    """Counts of received, lost and damaged frames of a run."""

    samples: int  # that were taken
    lost: int  # number of these whose frame did not come, or damaged
    repeated: int  # frames of samples that had been there, dropped
    late: int  # frames that came more than a period late; dropped where their sample had been given up
    bad_checksum: int  # frames with a wrong checksum
    undecodable: int  # other bytes that are no frame, or none that is known
    answers_late: int  # samples that the device had no answer to when it took the next one
    answers_damaged: int  # samples between which the device got damaged frames


class SerialHardware(Hardware):
    """A machine behind a serial line, whose device was identified and suits.

    Args:
        port: name of a serial port, or an object with `read`, `write`, `close` and `fileno`.
        channels: analogue channels that are needed, in the order wanted; the device may have more. None: those it has.
        bits: bits of the converter of each channel, by name; None: as the device says.
        encoder: whether one is needed.
        motor: whether one is needed.
        lock_step: the device waits for every command, as only a simulated machine can.
        watchdog: periods after its newest command at which the device vents by itself, at least 2. A sample that is lost
            without a trace is known by the next one, so that patience for one needs 3.
        patience: samples in a row that may be missing.
        timeout: time of the device for which nothing may come, or three periods where that is longer [s].
        greeting: time within which the device must answer first [s].
        baud: bits per second of the port.

    Attributes:
        fresh: whether the newest sample was read, not repeated.
        time: time of the newest reading by the device's clock, of any origin [s].
        welcome: identification of the device.

    Raises:
        InputError: if the port cannot be opened, or the device is not the one that is needed.
        LineLostError: if it does not answer.
    """

    def __init__(
        self,
        port: str | Any,
        channels: Sequence[str] | None = None,
        *,
        bits: Mapping[str, int] | None = None,
        encoder: bool = False,
        motor: bool = False,
        lock_step: bool = False,
        watchdog: int = 3,
        patience: int = 2,
        timeout: float = 1.0,
        greeting: float = 5.0,
        baud: int = BITS_PER_SECOND,
    ) -> None:
        if not 2 <= watchdog < 2**16:
            raise InputError("watchdog", watchdog, "must be a number of samples from 2 to 65535")
        self.lock_step, self.watchdog, self.patience, self.timeout = lock_step, watchdog, patience, timeout
        self._line = SerialLine(port, baud)
        self.name = self._line.name
        try:
            self.welcome: messages.Welcome = greet(self._line, greeting)
            fit(self.welcome, self.name, bits=bits or {}, encoder=encoder, motor=motor)
            names = self.welcome.names if channels is None else tuple(channels)
            self._places = places(self.welcome, names, self.name)
        except BaseException:
            self._line.close()
            raise
        super().__init__(
            names, encoder=self.welcome.encoder, motor=self.welcome.motor, motor_rest=self.welcome.motor_rest
        )
        self._run = int.from_bytes(os.urandom(2), "little")
        self._lost_by: str | None = None
        self._closed = False
        self._forget(0.0)

    @property
    def identity(self) -> dict[str, JsonValue]:
        """Port, speed, and what the device answered when it was greeted."""
        return {"port": self.name, "speed": self._line.speed} | self.welcome._asdict()

    @property
    def statistics(self) -> SerialStatistics:
        """Statistics of the latest run."""
        line, of, (bad, other) = self._line, self._arrivals, self._before
        damaged = line.frames.bad_checksum - bad, line.undecodable - other + self._strange
        counts = self._taken, of.lost, of.repeated, of.late
        return SerialStatistics(*counts, *damaged, of.answers_late, of.answers_damaged)

    def start(self, period: float) -> None:
        """Zero the encoder and begin to sample with a period [s]; refuses one that the device cannot do."""
        self._alive()
        nanoseconds = round(period * 1e9) if 0.0 < period * 1e9 <= LONGEST else 0
        if nanoseconds < max(self.welcome.shortest, 1):
            allowed = f"must be between {self.welcome.shortest * 1e-09:g} s and {LONGEST * 1e-09:.3g} s"
            raise InputError("period", period, allowed, where=self.name)
        self._forget(nanoseconds * 1e-9)
        self._run = (self._run + 1) % 2**16
        self.venting = False
        mode = messages.LOCK_STEP if self.lock_step else messages.FREE
        self._write(messages.Start(self._run, nanoseconds, mode, self.watchdog))

    def wait(self, sample: int) -> float:
        """Wait until a sample has arrived, counted from 0; return its lateness [s]."""
        self._alive()
        try:
            taken = self._wait(sample)
        except EndedError as error:
            raise self._lose(str(error)) from None
        message = taken.message
        self.fresh = message is not None
        if message is not None:
            counts = message.counts
            self.counts = tuple([counts[i] for i in self._places])
            self.time = message.time * 1e-9
            if self.has_encoder:
                self.edges = message.encoder
        self._sample = sample
        self._taken += 1
        return taken.lateness

    def send(self) -> None:
        """Make the outputs written since the sample take effect."""
        self._alive()
        count, opened = (0, True) if self.venting else (self.valve, self.opened)
        self._write(messages.CommandMessage(self._sample, count, self.motor, opened))

    def close(self) -> None:
        """Vent, and release the machine; may be called twice."""
        if not self._closed:
            self.vent()
            with contextlib.suppress(OSError):
                self._line.write(messages.Stop())
            self._closed = True
            self._line.close()

    def _wait(self, sample: int) -> ReceivedSample:
        arrivals = self._arrivals
        silence = max(self.timeout, SILENT * arrivals.period) * arrivals.slowness(self.timeout)
        until, looked = time.perf_counter() + silence, False
        while (taken := arrivals.take(sample)) is None:
            now, given_up = time.perf_counter(), arrivals.given_up(sample)
            if given_up is not None and now >= given_up:
                return arrivals.without(sample, now)
            if looked:
                raise EndedError(f"nothing came for {silence:.3g} s at sample {sample}")
            looked = now >= until  # once more, for it may have been this computer that paused
            self._receive(max((until if given_up is None else min(given_up, until)) - now, 0.0))
        return taken

    def _receive(self, seconds: float) -> None:
        before = self._line.dropped
        try:
            arrived = self._line.read(seconds)
        except (OSError, EOFError) as error:
            raise EndedError(f"unplugged: {reason(error)}") from None
        now, channels, strange = time.perf_counter(), len(self.welcome.names), self._strange
        for message in arrived:
            if isinstance(message, messages.Fault):
                self._arrivals.put(now, message)
            # samples of another number are of an earlier run
            elif isinstance(message, messages.SampleMessage) and message.run == self._run:
                if len(message.counts) == channels:
                    self._arrivals.put(now, message)
                else:
                    self._strange += 1
        if self._line.dropped > before or self._strange > strange:
            self._arrivals.damage(now)

    def _forget(self, period: float) -> None:
        self._arrivals = Arrivals(period, self.lock_step, self.patience)
        self._before = (self._line.frames.bad_checksum, self._line.undecodable)
        self._taken = self._strange = 0  # samples; frames with another number of channels
        self._sample = 0
        self.fresh, self.time = False, 0.0

    def _alive(self) -> None:
        if self._lost_by is not None or self._closed:
            raise LineLostError(self._lost_by or f"{self.name}: it was closed")

    def _lose(self, problem: str) -> LineLostError:
        if self._lost_by is None:
            action = "it was told to vent" if self._vent_now() else "it could not be told to vent, and must by itself"
            self._lost_by = f"{self.name}: {problem}; {action}"
        return LineLostError(self._lost_by)

    def _vent_now(self) -> bool:
        with contextlib.suppress(OSError):
            if not self._closed:
                self._line.write(messages.Vent(), before=b"\0")
                return True
        return False

    def _write(self, message: messages.Start | messages.CommandMessage) -> None:
        try:
            self._line.write(message)
        except OSError as error:
            raise self._lose(f"unplugged: {reason(error)}") from None
