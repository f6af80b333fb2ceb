"""State machine of a device on the serial line, and the board with a simulated machine.

`Device` says byte for byte what `firmware/bench.c` says, which a test compares; `CompiledDevice` is the latter.
The protocol is that of `messages`. Nothing here knows time but by the clock it is given, nor the machine's physics.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

from mckibben.bench.hardware.interface import CountedMachine
from mckibben.errors import InputError

from . import messages

MOST_CHANNELS = 32
LEAST_WATCHDOG = 2  # [samples]; with 1, a command would be too old at the next sample
LAST = 2**32 - 1  # sample
WORD = 2**32


class DeviceMachine(CountedMachine, Protocol):
    """The machine that a device samples and drives; it states the bits of its converters.

    Attributes:
        period: period of the samples, set where a run begins, when it also zeroes its encoder [s].
    """

    period: float

    @property
    def bits(self) -> tuple[int, ...]:
        """Bits of the converter of each channel."""


class About(NamedTuple):
    """Identification of a device."""

    firmware: str = "mckibben reference 1"  # name and version of the firmware
    shortest: int = 100_000  # period it can sample with [ns]
    encoder: bool = True  # whether there is one
    motor: bool = True  # whether there is one
    motor_rest: int = 0  # count at which the motor does nothing


class Board:
    """A machine with held outputs, as a device's hardware sees it.

    Attributes:
        outputs: that are held: counts of valve and motor, and whether the shut-off is open.
        told: whether outputs were put since the newest sample.
        starts: how many runs were begun.
        clocked: whether the timer runs.
        failed: error that ended the machine, if any.
    """

    def __init__(self, machine: DeviceMachine, about: About, clock: Callable[[], int]) -> None:
        names, bits = tuple(machine.names), tuple(machine.bits)
        if not len(names) == len(set(names)) == len(bits) <= MOST_CHANNELS:
            raise InputError("names", names, f"must be at most {MOST_CHANNELS} different ones, each with its bits")
        self.machine, self.about, self.clock = machine, about, clock
        has = about.shortest, about.encoder, about.motor, about.motor_rest
        self.welcome = messages.Welcome(0, messages.VERSION, *has, bits, about.firmware, names)
        try:
            messages.encode(self.welcome)
        except ValueError:
            raise InputError("names", names, "must be names of 255 bytes, together below a frame's 1024") from None
        self.outputs = (0, about.motor_rest, True)
        self.told = False
        self.starts = 0
        self.period = 0  # [ns]
        self.clocked = False
        self.failed: Exception | None = None
        self._begun = False

    def start(self, period: int, clocked: bool) -> None:
        """Start a run with a period [ns]; its first sample comes without an advance."""
        self.machine.period = period / 1e9
        self.period, self.clocked, self._begun = period, clocked, False
        self.starts += 1

    def stop(self) -> None:
        """Stop the timer."""
        self.clocked = False

    def write(self, valve: int, motor: int, opened: bool) -> None:
        """Set the outputs."""
        self.outputs, self.told = (valve, motor, opened), True

    def read(self) -> tuple[list[int], int] | None:
        """Return the counts of the next sample, or None if the machine failed."""
        try:
            if self._begun:
                self.machine.advance(*self.outputs)
            self._begun = True
            self.told = False
            counts, encoder = self.machine.sample()
            held = [min(max(int(count), 0), WORD - 1) for count in counts]
            return held, (int(encoder) + WORD // 2) % WORD - WORD // 2
        except Exception as error:  # whatever it is, a device has to say so and to vent
            self.failed = error
            return None


class Device:
    """The state machine in Python."""

    def __init__(self, board: Board, send: Callable[[bytes], None]) -> None:
        self.board, self._send = board, send
        self._frames = messages.Frames()
        self._dropped = self._told = 0  # frames dropped: unknown ones, and all until the newest sample
        self._greeted = self.running = self.due = False
        self._vented = self._by_itself = False
        self._run = self._mode = self._watchdog = self._silent = 0
        self._next = self._unanswered = 0  # next sample; the oldest that a command may answer
        self._valve, self._motor, self._open = board.outputs

    def receive(self, data: bytes) -> None:
        """Process bytes from the host."""
        for frame in self._frames.feed(data):
            message = messages.message_of(frame)
            match message:
                case messages.CommandMessage():
                    self._command(message)
                case messages.Vent():
                    self._vented = True
                    self._write(0, self._motor, True)
                case messages.Stop():
                    self._halt()
                case messages.Hello():
                    self._halt()
                    self._greeted = message.version == messages.VERSION
                    self._tell(self.board.welcome._replace(sequence=message.sequence))
                case messages.Start():
                    self._start(message)
                case _:
                    self._dropped += 1

    def tick(self) -> None:
        """Process the next sample: called by the timer, or in lock-step when it is `due`."""
        if not self.running or (self._mode == messages.LOCK_STEP and not self.due):
            return
        number, flags = self._next, 0
        time = number * self.board.period if self._mode == messages.LOCK_STEP else self.board.clock()
        read = self.board.read()
        if read is None:
            self._fault(messages.HARDWARE, "the machine cannot be read")
            return
        counts, encoder = read
        if self._mode == messages.FREE and number > 0:
            self._silent += 1
            if self._silent >= self._watchdog:
                self._vented = self._by_itself = True
                self._rest()
            if self._unanswered != number:
                flags |= messages.UNANSWERED
        dropped = self._frames.damaged + self._dropped
        flags |= messages.DAMAGED if dropped != self._told else 0
        flags |= (messages.VENTED if self._vented else 0) | (messages.BY_ITSELF if self._by_itself else 0)
        self._told, self.due = dropped, False
        self._tell(messages.SampleMessage(number, self._run, time, flags, encoder, tuple(counts)))
        self._next = number + 1
        if self._next == LAST:
            self._fault(messages.END, "a run has no more samples")

    def _start(self, start: messages.Start) -> None:
        self._halt()
        if not self._greeted:
            self._fault(messages.WRONG_VERSION, "not the version of the protocol")
            return
        slow = start.period >= self.board.about.shortest and start.period > 0
        watched = start.mode == messages.LOCK_STEP or (start.mode == messages.FREE and start.watchdog >= LEAST_WATCHDOG)
        if not (slow and watched):
            self._fault(messages.REFUSED, "this period, mode or watchdog is not possible")
            return
        self._run, self._mode, self._watchdog = start.run % 2**16, start.mode, start.watchdog
        self._next = self._unanswered = self._silent = 0
        self._vented = self._by_itself = False
        self.running, self.due = True, start.mode == messages.LOCK_STEP
        self._told = self._frames.damaged + self._dropped
        self.board.start(start.period, start.mode == messages.FREE)

    def _command(self, command: messages.CommandMessage) -> None:
        if not self.running or not self._unanswered <= command.sequence < self._next:
            return
        self._unanswered, self._silent = command.sequence + 1, 0
        self.due = self._mode == messages.LOCK_STEP
        valve, opened = (0, True) if self._vented else (command.valve, command.opened)
        self._write(valve, self._motor if self._by_itself else command.motor, opened)

    def _write(self, valve: int, motor: int, opened: bool) -> None:
        self._valve, self._motor, self._open = valve, motor, opened
        self.board.write(valve, motor, opened)

    def _rest(self) -> None:
        self._write(0, self.board.about.motor_rest, True)

    def _halt(self) -> None:
        self.running = self.due = False
        self.board.stop()
        self._rest()

    def _fault(self, code: int, text: str) -> None:
        self._halt()
        self._tell(messages.Fault(self._next, code, text))

    def _tell(self, message: messages.Message) -> None:
        self._send(messages.encode(message))


_START = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_int)
_STOP = ctypes.CFUNCTYPE(None)
_READ = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.POINTER(ctypes.c_uint32), ctypes.POINTER(ctypes.c_int32))
_WRITE = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_int)
_SEND = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_uint8), ctypes.c_size_t)
_NOW = ctypes.CFUNCTYPE(ctypes.c_uint64)


class _About(ctypes.Structure):
    _fields_ = [
        ("firmware", ctypes.c_char_p),
        ("shortest", ctypes.c_uint32),
        ("motor_rest", ctypes.c_uint32),
        ("encoder", ctypes.c_uint8),
        ("motor", ctypes.c_uint8),
        ("channels", ctypes.c_uint8),
        ("bits", ctypes.POINTER(ctypes.c_uint8)),
        ("names", ctypes.POINTER(ctypes.c_char_p)),
    ]


class _Calls(ctypes.Structure):
    _fields_ = [("start", _START), ("stop", _STOP), ("read", _READ), ("write", _WRITE), ("send", _SEND), ("now", _NOW)]


class CompiledDevice:
    """The state machine in C; behaves as `device.Device`.

    Raises:
        InputError: if that is none.
    """

    def __init__(self, board: Board, send: Callable[[bytes], None], library: Path | str) -> None:
        self.board, self._send = board, send
        try:
            self._library = ctypes.CDLL(str(library))
            self._library.bench_receive.argtypes = [ctypes.c_char_p, ctypes.c_size_t]
        except (OSError, AttributeError) as error:
            raise InputError("library", str(library), f"must be the compiled firmware ({error})") from None
        about, names = board.about, [name.encode() for name in board.welcome.names]
        count = len(names)
        has, bits = (about.shortest, about.motor_rest, about.encoder, about.motor), (ctypes.c_uint8 * count)
        named = (ctypes.c_char_p * count)(*names)
        self._about = _About(about.firmware.encode(), *has, count, bits(*board.welcome.bits), named)
        self._calls = _Calls(
            _START(lambda period, clocked: board.start(period, bool(clocked))),
            _STOP(board.stop),
            _READ(self._read),
            _WRITE(lambda valve, motor, opened: board.write(valve, motor, bool(opened))),
            _SEND(lambda data, size: self._send(ctypes.string_at(data, size))),
            _NOW(board.clock),
        )
        self._library.host_begin(ctypes.byref(self._about), ctypes.byref(self._calls))

    @property
    def due(self) -> bool:
        """Whether the next sample is to be taken, in lock-step."""
        return bool(self._library.bench_due())

    def receive(self, data: bytes) -> None:
        """Process bytes from the host."""
        self._library.bench_receive(data, len(data))

    def tick(self) -> None:
        """Process the next sample."""
        self._library.bench_tick()

    def _read(self, counts: ctypes._Pointer[ctypes.c_uint32], encoder: ctypes._Pointer[ctypes.c_int32]) -> int:
        sampled = self.board.read()
        if sampled is None:
            return -1
        for i, count in enumerate(sampled[0]):
            counts[i] = count
        encoder[0] = sampled[1]
        return 0
