"""The newest samples for all pages, as binary frames that a page draws directly.

A frame is the identity of its server, four whole numbers and then the channels one after the other, little endian:

    server 8 bytes, epoch u32, first sample u32, samples n u32, channels m u32, values f32 (m, n)

An epoch is one run, or one stretch by hand; its samples are `period` [s] apart, and sample 0 is at 0 s. The values are SI.
Epochs are counted from 1 by every server: without its identity one of them may be taken for that of another server.
"""

from __future__ import annotations

import secrets
import struct
import threading
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..documents import JsonValue

CHANNELS = ("pressure", "tension", "length", "flow", "valve", "set_pressure", "set_length")
HEAD = struct.Struct("<8sIIII")
KEPT = 60_000  # samples that a page which lost the line gets again


class Stream:
    """Samples of the newest epoch; memory is bounded.

    Args:
        kept: samples.

    Attributes:
        server: identity of the server whose stream it is: 16 hexadecimal digits, drawn again by every one.
    """

    def __init__(self, kept: int = KEPT) -> None:
        self.server = secrets.token_hex(8)
        self._lock, self._size = threading.Lock(), kept
        self._ring = np.full((len(CHANNELS), kept), np.nan, np.float32)
        self.epoch, self.count, self.period, self._start = 0, 0, 1e-3, 0
        self.about: dict[str, Any] = {"kind": "none", "name": ""}
        self._made: tuple[tuple[int, int, int], bytes] | None = None

    def begin(self, kind: str, name: str, period: float, start: int = 0) -> int:
        """Begin an epoch: ``run`` or ``hand``, with its name, the sample period [s] and its first number."""
        with self._lock:
            self.epoch, self.count, self.period, self._start = self.epoch + 1, start, period, start
            self.about = {"kind": kind, "name": name}
            return self.epoch

    def add(self, columns: Mapping[str, JsonValue]) -> None:
        """Add samples (n,) of every channel [SI]; a missing one is NaN."""
        n = len(next(iter(columns.values())))
        block = np.full((len(CHANNELS), n), np.nan, np.float32)
        for row, name in enumerate(CHANNELS):
            if name in columns:
                block[row] = columns[name]
        with self._lock:
            block = block[:, -self._size :]
            at = (self.count + n - block.shape[1] + np.arange(block.shape[1])) % self._size
            self._ring[:, at] = block
            self.count += n

    def head(self) -> dict[str, JsonValue]:
        """Properties of the epoch that a page needs."""
        with self._lock:
            return {"epoch": self.epoch, "period": self.period, **self.about}

    def frame(self, epoch: int, seen: int) -> tuple[bytes, int, int]:
        """Samples of an epoch that a page with `seen` samples does not have yet.

        Returns:
            The bytes, empty if there is nothing new; the epoch and the samples that it has then.
        """
        with self._lock:
            first = seen if epoch == self.epoch else 0
            first = max(first, self.count - self._size, self._start)
            n = self.count - first
            if n <= 0:
                return b"", self.epoch, self.count
            key = (self.epoch, first, n)
            if self._made is None or self._made[0] != key:
                at = (first + np.arange(n)) % self._size
                head = HEAD.pack(bytes.fromhex(self.server), self.epoch, first, n, len(CHANNELS))
                self._made = key, head + self._ring[:, at].astype("<f4", copy=False).tobytes()
            return self._made[1], self.epoch, self.count

    def newest(self, n: int) -> dict[str, np.ndarray]:
        """Return the last n samples of every channel [SI], or all available ones."""
        with self._lock:
            n = min(n, self.count - self._start, self._size)
            at = (self.count - n + np.arange(n)) % self._size
            return {name: self._ring[i, at] for i, name in enumerate(CHANNELS)}

    def latest(self) -> dict[str, float]:
        """Return the newest sample of every channel [SI]; empty before the first."""
        with self._lock:
            if self.count == self._start:
                return {}
            at = (self.count - 1) % self._size
            return {n: float(self._ring[i, at]) for i, n in enumerate(CHANNELS)}


def unpacked(frame: bytes) -> tuple[int, int, dict[str, np.ndarray]]:
    """Decode a frame: epoch, number of its first sample and channels (n,)."""
    _, epoch, first, n, m = HEAD.unpack_from(frame)
    values = np.frombuffer(frame, "<f4", n * m, HEAD.size).reshape(m, n)
    return epoch, first, dict(zip(CHANNELS, values, strict=False))
