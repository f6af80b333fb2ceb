"""The host's side of the serial line: bytes of a port, messages, and the sequence of samples.

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

from ....errors import InputError, LineLostError
from ....extras import library
from . import messages
from .messages import BY_ITSELF, DAMAGED, UNANSWERED, VERSION, Fault, Frames, Hello, Message, SampleMessage, Welcome

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
    """Say why a port could not be opened, and what to do."""
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
        if self._descriptor is None:
            return self._slow_read(seconds)
        until = time.perf_counter() + seconds
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

    def _slow_read(self, seconds: float) -> bytes:
        until = time.perf_counter() + seconds
        while True:
            data: bytes = self._port.read(max(getattr(self._port, "in_waiting", 1), 1))
            if data or time.perf_counter() >= until:
                return data or b""


GREETING = (
    0.25  # time between two greetings of a device that does not answer; many restart when their port is opened [s]
)
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
        self.frames, self.unknown, self.received, self.speed = Frames(), 0, 0, baud

    @property
    def undecodable(self) -> int:
        """Number of frames dropped for other reasons than their checksum."""
        return self.frames.undecodable + self.frames.oversized + self.unknown

    @property
    def dropped(self) -> int:
        """Number of dropped frames."""
        return self.undecodable + self.frames.bad_checksum

    def read(self, seconds: float) -> list[Message]:
        """Return the messages that have arrived, or wait a limited time for the first [s].

        Raises:
            OSError, EOFError: if nothing can come any more.
        """
        data = self._wire.read(seconds)
        self.received += len(data)
        arrived = [messages.message_of(frame) for frame in self.frames.feed(data)]
        self.unknown += arrived.count(None)
        return [message for message in arrived if message is not None]

    def write(self, message: Message, *, before: bytes = b"") -> None:
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


def greet(line: SerialLine, seconds: float) -> Welcome:
    """Request the identification of the device.

    Raises:
        LineLostError: if none answers within a time.
        InputError: if it does not speak this version of the protocol.
    """
    ours = int.from_bytes(os.urandom(4), "little")
    until = time.perf_counter() + seconds
    try:
        while (now := time.perf_counter()) < until:
            line.write(Hello(ours, VERSION), before=b"\0")
            again = min(now + GREETING, until)
            while (ahead := again - time.perf_counter()) > 0.0:
                for message in line.read(ahead):
                    if isinstance(message, Welcome) and message.sequence == ours:
                        return _checked(line, message)
    except (OSError, EOFError) as error:
        raise LineLostError(f"{line.name}: unplugged: {reason(error)}") from None
    came = (
        f"{line.received} bytes came that are no message: is its speed {line.speed} bit/s, and is the firmware on it?"
        if line.received
        else "nothing came: is it the board's port, and is the firmware on the board?"
    )
    raise LineLostError(f"{line.name}: no device answered within {seconds:g} s; {came}")


def fit(welcome: Welcome, where: str, *, bits: Mapping[str, int], encoder: bool, motor: bool) -> None:
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


def places(welcome: Welcome, names: Sequence[str], where: str) -> tuple[int, ...]:
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


def _checked(line: SerialLine, welcome: Welcome) -> Welcome:
    if welcome.version != VERSION:
        allowed = f"must be {VERSION}; install the firmware that belongs to this package"
        raise InputError("protocol of the device", welcome.version, allowed, where=line.name)
    if len(set(welcome.names)) != len(welcome.names):
        raise InputError("channels of the device", ", ".join(welcome.names), "each may be there once", where=line.name)
    return welcome


DRIFT = 1e-4  # of the clocks of host and device, as a share of the time
GRACE = 0.25  # share of a period after which a damaged frame is taken for that of the sample that is missing
GRACE_IN_LOCK_STEP = 0.1  # the same where samples have no time [s]


class EndedError(Exception):
    """The run has ended and no more samples come; the message states why."""


class ReceivedSample(NamedTuple):
    """Sample of a device, or its absence: its message, None where it is missing, and how late it came [s]."""

    message: SampleMessage | None
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
        self._queue: deque[tuple[float, SampleMessage | Fault]] = deque()
        self._damaged: float | None = None  # when damage was seen that no sample is known to miss
        self._newest, self._missing = -1, 0
        self._origin = 0.0  # when sample 0 was there, or should have been
        self._first_at = self._newest_at = 0.0  # when sample 0 and the newest one were there

    def put(self, at: float, message: SampleMessage | Fault) -> None:
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
            if isinstance(message, Fault):
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

    def _with(self, message: SampleMessage, at: float) -> ReceivedSample:
        if message.flags & BY_ITSELF:
            raise EndedError("the device vented by itself, for it had no command for too many samples")
        if message.flags:
            self.answers_late += bool(message.flags & UNANSWERED)
            self.answers_damaged += bool(message.flags & DAMAGED)
        self._missing, self._newest = 0, message.sequence
        self._first_at, self._newest_at = at if self._newest == 0 else self._first_at, at
        if self._damaged is not None and at > self._damaged:
            self._damaged = None
        return ReceivedSample(message, 0.0 if self.lock_step else self._late(message.sequence, at))

    def _late(self, sample: int, at: float) -> float:
        """Lateness of a sample [s]; the expected time of later ones follows the device's clock."""
        if sample == 0:
            self._origin = at
        late = at - self._origin - sample * self.period
        if late < 0.0:
            self._origin += late
            return 0.0
        self._origin += min(late, DRIFT * self.period)
        self.late += late > self.period
        return late
