"""A simulated microcontroller behind a pseudo-terminal, whose name a host opens like any port.

In a thread its timer suffers from whatever else its process does; for a process of its own, the machine comes from a
function that can be pickled, for it begins anew there. Range: systems with pseudo-terminals (not Windows).
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import threading
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from ....errors import LineLostError
from .device import DeviceMachine
from .microcontroller import DeviceReport, Microcontroller

SPIN = 1e-4  # time before a tick from which a process does not sleep, for the system wakes it late [s]
BEGINNING = 60.0  # time in which a process must have begun, imports included [s]


class Attached(NamedTuple):
    """A simulated microcontroller in a thread: the port to open, and itself."""

    port: str
    microcontroller: Microcontroller


@contextlib.contextmanager
def in_thread(machine: DeviceMachine, **options: Any) -> Iterator[Attached]:
    """A machine behind a pseudo-terminal, in a thread of this process.

    Args:
        machine: that is hosted.
        options: of `Microcontroller`.
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
    """A simulated microcontroller in a process of its own: the port to open; afterwards, its report."""

    def __init__(self, port: str) -> None:
        self.port = port
        self.report: DeviceReport | None = None


@contextlib.contextmanager
def in_process(factory: Callable[..., DeviceMachine], *arguments: Any, **options: Any) -> Iterator[Hosted]:
    """A machine behind a pseudo-terminal, in a process of its own.

    Args:
        factory: makes the machine there.
        arguments: of the factory.
        options: of `Microcontroller`.

    Raises:
        LineLostError: if it does not begin.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, factory, arguments, options), daemon=True)
    process.start()
    theirs.close()
    try:
        hosted = Hosted(_begun(ours))
        yield hosted
        with contextlib.suppress(OSError, EOFError):  # it may have ended by itself
            hosted.report = _asked(ours)
    finally:
        ours.close()
        process.join(2.0)
        if process.is_alive():
            process.kill()
            process.join()


def _begun(line: Connection) -> str:
    """The port of a process that has begun."""
    with contextlib.suppress(OSError, EOFError):
        if line.poll(BEGINNING):
            said: str | LineLostError = line.recv()
            if isinstance(said, str):
                return said
            raise said
    raise LineLostError("simulated microcontroller: it does not begin")


def _asked(line: Connection) -> DeviceReport | None:
    """The report of a process that is told to stop, or has stopped."""
    with contextlib.suppress(OSError):
        line.send("stop")
    return line.recv() if line.poll(BEGINNING) else None


def _serve(
    line: Connection, factory: Callable[..., DeviceMachine], arguments: tuple[Any, ...], options: dict[str, Any]
) -> None:
    """The process: until it is told to stop, or whoever began it is gone."""
    try:
        end, other, port = _pair()
        microcontroller = Microcontroller(factory(*arguments), end, **({"spin": SPIN} | options))
    except Exception as error:  # told where it was begun
        line.send(LineLostError(f"simulated microcontroller: it does not begin: {error}"))
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
    """A pseudo-terminal that changes no byte: the device's end, the other, and the name under which a host opens that."""
    import tty

    line, other = os.openpty()
    tty.setraw(other)
    return line, other, os.ttyname(other)
