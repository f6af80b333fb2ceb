"""Devices without a line: driven by hand, or behind a port in memory. And the firmware's own decoder."""

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

from serial_machines import Tiny

from mckibben_hardware.serial_line import messages
from mckibben_hardware.serial_line.device import About, Board, CompiledDevice, Device

NANOSECONDS = 1_000_000


class Desk:
    """A device whose timer is whoever calls `tick`, and whose clock counts the ticks."""

    def __init__(self, machine: Any = None, library: Path | None = None, about: About | None = None) -> None:
        self.ticks = 0
        self.sent = b""
        self.machine = machine or Tiny()
        self.board = Board(self.machine, about or About(), lambda: 7 + self.ticks * NANOSECONDS)
        self.device: Any = (
            Device(self.board, self._take) if library is None else CompiledDevice(self.board, self._take, library)
        )

    def _take(self, data: bytes) -> None:
        self.sent += data

    def say(self, *said: messages.Message) -> list[messages.Message]:
        """What it answers."""
        return self.feed(b"".join(messages.encode(message) for message in said))

    def feed(self, data: bytes) -> list[messages.Message]:
        before = len(self.sent)
        self.device.receive(data)
        return self._heard(before)

    def tick(self) -> list[messages.Message]:
        before, self.ticks = len(self.sent), self.ticks + 1
        self.device.tick()
        return self._heard(before)

    def begin(self, mode: int = messages.FREE, watchdog: int = 2, run: int = 5) -> None:
        (welcome,) = self.say(messages.Hello(1, messages.VERSION))
        assert isinstance(welcome, messages.Welcome)
        assert self.say(messages.Start(run, NANOSECONDS, mode, watchdog)) == []

    def _heard(self, before: int) -> list[Any]:
        heard = messages.Frames()
        found = [messages.message_of(frame) for frame in heard.feed(self.sent[before:])]
        assert heard.damaged == 0
        assert None not in found
        return found


class Direct:
    """A port in memory, without a file descriptor, behind which a device runs in lock-step.

    Args:
        change: what becomes of the bytes of each frame on the way to the host, and of those on the way to the device.
    """

    name = "memory"

    def __init__(self, machine: Any, to_host: Callable[[bytes], bytes], to_device: Callable[[bytes], bytes]) -> None:
        self._to_device, self._bytes = to_device, bytearray()
        self.device = Device(Board(machine, About(), lambda: 0), lambda data: self._bytes.extend(to_host(data)))
        self.closed = False

    @property
    def in_waiting(self) -> int:
        return len(self._bytes)

    def read(self, size: int) -> bytes:
        data = bytes(self._bytes[:size])
        del self._bytes[:size]
        return data

    def write(self, data: bytes) -> None:
        self.device.receive(self._to_device(data))
        while self.device.due:
            self.device.tick()

    def close(self) -> None:
        self.closed = True


_FRAME = ctypes.CFUNCTYPE(
    None, ctypes.c_uint8, ctypes.c_uint32, ctypes.POINTER(ctypes.c_uint8), ctypes.c_size_t
)  # fmt: skip


class Codec:
    """Frames as the firmware writes and reads them."""

    def __init__(self, library: Path) -> None:
        self._library = ctypes.CDLL(str(library))
        self._library.frame_write.restype = ctypes.c_size_t
        self._library.frame_write.argtypes = [
            ctypes.c_uint8, ctypes.c_uint32, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p,
        ]  # fmt: skip
        self._library.frame_code.restype = self._library.frame_uncode.restype = ctypes.c_size_t
        for one in (self._library.frame_code, self._library.frame_uncode):
            one.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p]
        self._library.frame_crc.restype = ctypes.c_uint32
        self._library.frame_crc.argtypes = [ctypes.c_uint32, ctypes.c_char_p, ctypes.c_size_t]
        self._library.host_decode.argtypes = [ctypes.c_char_p, ctypes.c_size_t, _FRAME]

    def crc(self, data: bytes) -> int:
        return int(self._library.frame_crc(0, data, len(data)))

    def coded(self, data: bytes) -> bytes:
        room = ctypes.create_string_buffer(len(data) + len(data) // 254 + 1)
        size = self._library.frame_code(data, len(data), room)
        return room.raw[:size]

    def decoded(self, data: bytes) -> bytes | None:
        room = ctypes.create_string_buffer(len(data) + 1)
        size = self._library.frame_uncode(data, len(data), room)
        return None if size == ctypes.c_size_t(-1).value else room.raw[:size]

    def frame(self, kind: int, sequence: int, payload: bytes) -> bytes:
        room = ctypes.create_string_buffer(messages.LONGEST_CODED + 1)
        size = self._library.frame_write(kind, sequence, payload, len(payload), room)
        return room.raw[:size]

    def decode(self, parts: list[bytes]) -> tuple[list[messages.SerialFrame], tuple[int, ...]]:
        """The frames of a stream, and how many were dropped for which reason."""
        found: list[messages.SerialFrame] = []
        take = _FRAME(
            lambda kind, number, data, size: found.append(messages.SerialFrame(kind, number, _bytes(data, size)))
        )
        self._library.host_decode_begin()
        for part in parts:
            self._library.host_decode(part, len(part), take)
        counts = (ctypes.c_uint32 * 3)()
        self._library.host_decode_counts(counts)
        return found, tuple(counts)


def _bytes(data: Any, size: int) -> bytes:
    return ctypes.string_at(data, size) if size else b""
