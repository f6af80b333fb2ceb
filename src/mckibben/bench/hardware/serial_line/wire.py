"""Bytes to and from a port, without waiting longer than asked.

Where the port has a file descriptor, the system is asked directly; elsewhere (Windows) the port's own read and write are.
"""

from __future__ import annotations

import contextlib
import os
import select
import sys
import time
from typing import Any

from ....errors import InputError
from ....extras import library

BITS_PER_SECOND = 1_000_000  # what a port is opened with; a USB port or a pseudo-terminal does not look at it
_CHUNK = 4096  # [B]
_SLICE = 2e-4  # time of a wait that is shorter than what `poll` can wait [s]
_SLOW_READ = 0.01  # [s], of a port without a file descriptor


def open_port(port: str, baud: int) -> Any:
    """A serial port for us alone.

    Raises:
        InputError: if there is none, or pyserial is not installed.
    """
    serial = library("serial", "Machines on a serial port need", where=port)
    alone: Any = {"exclusive": True} if os.name == "posix" else {}
    try:
        opened = serial.Serial(port, baud, timeout=_SLOW_READ, write_timeout=0.1, **alone)
    except (OSError, ValueError) as error:  # SerialException is an OSError
        reason = " ".join(str(error).split())
        raise InputError("port", port, f"allowed is a serial port that can be opened ({reason})") from None
    if sys.platform == "linux":
        with contextlib.suppress(OSError, ValueError, AttributeError):  # an adapter may hold bytes back for 16 ms
            opened.set_low_latency_mode(True)
    return opened


class Wire:
    """A port, of which all that is needed are `read`, `write` and `close`, and `fileno` where it has one."""

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
        """What is there; where nothing is, what comes first within a time; empty if nothing comes.

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
        """Give bytes away.

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
        """Let go of the port."""
        with contextlib.suppress(OSError):
            self._port.close()

    def _slow_read(self, seconds: float) -> bytes:
        until = time.perf_counter() + seconds
        while True:
            data: bytes = self._port.read(max(getattr(self._port, "in_waiting", 1), 1))
            if data or time.perf_counter() >= until:
                return data or b""
