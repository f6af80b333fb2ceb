"""A simulated microcontroller: the device's side of a serial line, which hosts any `device.DeviceMachine`.

Its state machine is `device.Device`, or the reference firmware compiled for a host. It samples by its own timer, or in
lock-step as fast as commands come. A system keeps a process from its ticks now and then; they are made up for as fast as the
host answers, so that it does not lose the line for it.

It stands behind a pseudo-terminal, whose name a host opens like any port. In a thread its timer suffers from whatever else
its process does; for a separate process, the machine comes from a function that can be pickled, for it starts again there.
Range: systems with pseudo-terminals (not Windows).
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import select
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from mckibben.errors import LineLostError

from . import messages
from .device import About, Board, CompiledDevice, Device, DeviceMachine

NEVER = 3600.0  # longest time for which it sleeps [s]
_CHUNK = 4096  # [B]
_ROOM = 1 << 16  # [B] that may wait to be sent; what comes then is dropped


class Faults(NamedTuple):
    """Faults to simulate, for tests.

    Attributes:
        at: by sample, what happens to its frame: ``checksum``, ``lost``, ``repeated``, ``late`` (with all that follow),
            ``silent`` (no frame any more) or ``unplug``.
        delay: delay of a late frame [s].
        version: version of the protocol that WELCOME claims.
    """

    at: Mapping[int, str] = {}
    delay: float = 0.0
    version: int = messages.VERSION


class DeviceReport(NamedTuple):
    """Timing of a device: number of timer ticks, the lateness of each [s], and frames dropped for lack of room."""

    ticks: int
    lateness: tuple[float, ...]
    dropped: int


class Microcontroller:
    """A device at the end of a line.

    Args:
        machine: that it samples and drives.
        line: file descriptor of its end; `run` closes it.
        about: its identification.
        library: the compiled firmware, or None for the state machine in Python.
        faults: simulated faults.
        spin: time before a tick from which it does not sleep [s].

    Attributes:
        board: the machine and its outputs.
        lateness: lateness of the ticks by the timer [s].
    """

    def __init__(
        self,
        machine: DeviceMachine,
        line: int,
        *,
        about: About | None = None,
        library: Path | str | None = None,
        faults: Faults | None = None,
        spin: float = 0.0,
    ) -> None:
        self.board = Board(machine, about or About(), time.perf_counter_ns)
        self.device: Device | CompiledDevice = (
            Device(self.board, self._send) if library is None else CompiledDevice(self.board, self._send, library)
        )
        self._line, self._spin, self._faults = line, spin, faults or Faults()
        os.set_blocking(line, False)
        self._wake, self._waker = os.pipe()
        self._out: deque[tuple[float, bytes]] = deque()  # not before a time [s]
        self._held = 0.0  # nothing is sent before this time [s]
        self._stopped = self._ended = self._silent = False
        self._ending = threading.Lock()  # a closed descriptor may be somebody else's by now
        self._starts = self._deadline = self._ticked = 0  # runs begun; the next tick and the newest [ns]
        self._dropped = 0
        self.lateness: list[float] = []

    @property
    def report(self) -> DeviceReport:
        """Timing of the device."""
        return DeviceReport(len(self.lateness), tuple(self.lateness), self._dropped)

    def run(self) -> None:
        """Run until `stop` or the end of the connection."""
        try:
            while not self._stopped:
                self._listen()
                now = time.perf_counter_ns()
                if self.board.starts != self._starts:
                    self._starts, self._deadline, self._ticked = self.board.starts, now, 0
                if self.board.clocked and now >= self._due():
                    self.lateness.append((now - self._deadline) * 1e-9)
                    self._deadline += self.board.period
                    self._ticked = now
                    self.device.tick()
                self._flush()
        finally:
            self.board.stop()
            with self._ending:
                self._stopped = self._ended = True
                for descriptor in (self._line, self._wake, self._waker):
                    os.close(descriptor)

    def stop(self) -> None:
        """Make `run` return; callable from any thread."""
        self._stopped = True
        with self._ending:
            if not self._ended:
                os.write(self._waker, b"\0")

    def _due(self) -> int:
        """Time of the timer's next sample [ns]; it waits one period for the answer to the previous one."""
        return self._deadline if self.board.told else max(self._deadline, self._ticked + self.board.period)

    def _listen(self) -> None:
        """Wait for bytes, a tick, or room to send; return the bytes for the device."""
        seconds = NEVER
        if self.board.clocked:
            seconds = (self._due() - time.perf_counter_ns()) * 1e-9 - self._spin
        if self._out:
            seconds = min(seconds, max(self._out[0][0] - time.perf_counter(), 1e-3))
        ready, _, _ = select.select([self._line, self._wake], [], [], max(seconds, 0.0))
        if self._line in ready:
            try:
                data = os.read(self._line, _CHUNK)
            except BlockingIOError:
                return
            except OSError:
                self._stopped = True  # nobody holds the other end
                return
            # Process bytes frame by frame; in lock-step each command gets its sample before the next frame is read
            *ended, rest = data.split(b"\0")
            for part in ended:
                self.device.receive(part + b"\0")
                while self.device.due and not self._stopped:
                    self.device.tick()
            self.device.receive(rest)

    def _send(self, data: bytes) -> None:
        """Send a frame, unless a simulated fault affects it."""
        faults, count = self._faults, 1
        if faults.at or faults.version != messages.VERSION:
            frame = messages.Frames().feed(data)[0]
            message = messages.message_of(frame)
            if isinstance(message, messages.Welcome) and faults.version != messages.VERSION:
                data = messages.frame(
                    frame.kind, frame.sequence, faults.version.to_bytes(2, "little") + frame.payload[2:]
                )
            fault = faults.at.get(message.sequence, "") if isinstance(message, messages.SampleMessage) else ""
            if fault == "unplug":
                self._stopped = True
            self._silent = self._silent or fault in ("silent", "unplug")
            self._held = time.perf_counter() + faults.delay if fault == "late" else self._held
            if fault == "checksum":
                body = bytearray(messages.decoded(data[:-1]) or b"")
                body[-1] ^= 1
                data = messages.coded(bytes(body)) + b"\0"
            count = 0 if fault == "lost" or self._silent else 2 if fault == "repeated" else 1
        if sum(len(part) for _, part in self._out) + len(data) > _ROOM:
            self._dropped += 1
            return
        self._out.extend([(self._held, data)] * count)
        self._flush()

    def _flush(self) -> None:
        while self._out and self._out[0][0] <= time.perf_counter():
            at, data = self._out.popleft()
            try:
                data = data[os.write(self._line, data) :]
            except BlockingIOError:
                self._out.appendleft((at, data))
                return
            except OSError:
                self._stopped = True
                return
            if data:
                self._out.appendleft((at, data))


SPIN = 1e-4  # time before a tick from which a process does not sleep, for the system wakes it late [s]
BEGINNING = 60.0  # time in which a process must have begun, imports included [s]


class Attached(NamedTuple):
    """A simulated microcontroller in a thread, and the port to open."""

    port: str
    microcontroller: Microcontroller


@contextlib.contextmanager
def in_thread(machine: DeviceMachine, **options: Any) -> Iterator[Attached]:
    """Host a machine behind a pseudo-terminal, in a thread of this process.

    Args:
        machine: that is hosted.
        options: options of `Microcontroller`.
    """
    line, other, port = _pair()
    microcontroller = Microcontroller(machine, line, **options)

    def serve() -> None:
        try:
            microcontroller.run()
        finally:
            os.close(other)

    thread = threading.Thread(target=serve, name="microcontroller", daemon=True)
    thread.start()
    try:
        yield Attached(port, microcontroller)
    finally:
        microcontroller.stop()
        thread.join()


class Hosted:
    """A simulated microcontroller in a separate process: the port to open; afterwards, its report."""

    def __init__(self, port: str) -> None:
        self.port = port
        self.report: DeviceReport | None = None


@contextlib.contextmanager
def in_process(factory: Callable[..., DeviceMachine], *arguments: Any, **options: Any) -> Iterator[Hosted]:
    """Host a machine behind a pseudo-terminal, in a separate process.

    Args:
        factory: makes the machine there.
        arguments: arguments of the factory.
        options: options of `Microcontroller`.

    Raises:
        LineLostError: if it does not start.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, factory, arguments, options), daemon=True)
    process.start()
    theirs.close()
    try:
        said: str | LineLostError = LineLostError("simulated microcontroller: it did not start")
        with contextlib.suppress(OSError, EOFError):
            if ours.poll(BEGINNING):
                said = ours.recv()
        if not isinstance(said, str):
            raise said
        hosted = Hosted(said)
        yield hosted
        with contextlib.suppress(OSError, EOFError):  # it may have ended by itself
            with contextlib.suppress(OSError):
                ours.send("stop")
            hosted.report = ours.recv() if ours.poll(BEGINNING) else None
    finally:
        ours.close()
        process.join(2.0)
        if process.is_alive():
            process.kill()
            process.join()


def _serve(
    line: Connection, factory: Callable[..., DeviceMachine], arguments: tuple[Any, ...], options: dict[str, Any]
) -> None:
    """Run the process until it is told to stop, or its parent has ended."""
    try:
        end, other, port = _pair()
        microcontroller = Microcontroller(factory(*arguments), end, **({"spin": SPIN} | options))
    except Exception as error:  # told where it was begun
        line.send(LineLostError(f"simulated microcontroller: it did not start: {error}"))
        return

    def wait() -> None:
        with contextlib.suppress(EOFError, OSError):
            line.recv()
        microcontroller.stop()

    threading.Thread(target=wait, daemon=True).start()
    line.send(port)
    microcontroller.run()
    os.close(other)
    with contextlib.suppress(OSError):
        line.send(microcontroller.report)


def _pair() -> tuple[int, int, str]:
    """Open a raw pseudo-terminal: the device's end, the other, and the path for the host."""
    import tty

    line, other = os.openpty()
    tty.setraw(other)
    return line, other, os.ttyname(other)
