"""The reference firmware, compiled for a host, in the place of `device.Device`: its hardware is a simulated board.

The library is what `make` builds in ``firmware/``. Its state is one: of several devices in one process, each needs a copy.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

from ....errors import InputError
from .device import Board

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

    Args:
        board: its hardware.
        send: takes the bytes of one frame.
        library: the compiled firmware.

    Raises:
        InputError: if that is none.
    """

    def __init__(self, board: Board, send: Callable[[bytes], None], library: Path | str) -> None:
        self.board, self._send = board, send
        try:
            self._library = ctypes.CDLL(str(library))
            self._library.bench_receive.argtypes = [ctypes.c_char_p, ctypes.c_size_t]
        except (OSError, AttributeError) as error:
            raise InputError("library", str(library), f"allowed is the compiled firmware ({error})") from None
        about, names = board.about, [name.encode() for name in board.welcome.names]
        count = len(names)
        self._about = _About(
            about.firmware.encode(), about.shortest, about.motor_rest, about.encoder, about.motor, count,
            (ctypes.c_uint8 * count)(*board.welcome.bits), (ctypes.c_char_p * count)(*names),
        )  # fmt: skip
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
        """In lock-step: whether the next sample is to be taken."""
        return bool(self._library.bench_due())

    def receive(self, data: bytes) -> None:
        """Bytes from the host."""
        self._library.bench_receive(data, len(data))

    def tick(self) -> None:
        """The next sample."""
        self._library.bench_tick()

    def _read(self, counts: ctypes._Pointer[ctypes.c_uint32], encoder: ctypes._Pointer[ctypes.c_int32]) -> int:
        found = self.board.read()
        if found is None:
            return -1
        for i, count in enumerate(found[0]):
            counts[i] = count
        encoder[0] = found[1]
        return 0
