"""The live log of a bench: every sample is in the file within 0.05 s, in a format that survives whatever ends the process.

The file is MCAP (https://mcap.dev). A sample is one message on the topic ``/recording``: the time and each channel as
float64, in the encoding of ROS 2 messages (CDR) whose schema names every field, so that other programs read and plot it.
The head, an attachment with a checksum, holds units, kinds, meanings and the metadata. Samples stand in chunks of at most
0.05 s, each with its checksum; a remark is a message on ``/events``. What `close` adds is an attachment at the end.

What is lost: if the process is killed, at most the last 0.05 s of samples. If the power fails, at most what came since the
last ``fsync``, 1 s by default, which a thread of its own does so that `append` never waits for the disk.
"""

from __future__ import annotations

import os
import re
import struct
import threading
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

import numpy as np

from ..documents import JsonValue
from ..errors import InputError
from .sidecar import dumps
from .table import Channel, check_name, freeze
from .text import plain_names

TOPIC, EVENTS = "/recording", "/events"
HEAD, END = "mckibben.head.json", "mckibben.end.json"  # names of the attachments
CDR = b"\x00\x01\x00\x00"  # of every sample: little endian; the numbers follow without a gap
FLUSH = 0.05  # [s]
SYNC = 1.0  # [s]
_CHUNK = 1 << 20  # [B]; an export is not flushed by time
_LATEST = 2**63 - 1  # [ns]
_EVENT = b"float64 time # [s], as in /recording\nstring text\n"


class LiveLog:
    """A recording that is being written. Safe for use by several threads; closed by `close` or at the end of ``with``.

    Args:
        path: a new file, ``.mcap``; one that is there is never touched.
        channels: by name; unit, kind and meaning are taken, values are not looked at.
        meta: metadata known at the start.
        flush: the file has what is older than this, by the clock of the samples and by that on the wall [s].
        sync: the disk has what is older than this [s]; None leaves it to the operating system.
        start: Unix time of the first sample [ns], for other programs; now by default.

    Raises:
        InputError: a channel or the metadata is not allowed, or the file cannot be made.
    """

    def __init__(
        self,
        path: str | Path,
        channels: Mapping[str, Channel],
        meta: Mapping[str, JsonValue] | None = None,
        *,
        flush: float = FLUSH,
        sync: float | None = SYNC,
        start: int | None = None,
    ) -> None:
        self.path, self._names = Path(path), list(channels)
        for name in channels:
            check_name(name)
        head = dumps(channels, freeze(meta or {}))
        self._flush, self._sync, self._start = flush, sync, start
        self._first = self._last = -np.inf
        self._count, self._pending, self._since = 0, -np.inf, 0.0
        self._lock, self._ended = threading.RLock(), threading.Event()
        self._failed: OSError | None = None
        self._file: BinaryIO | None = None
        try:
            self._file = open(self.path, "xb", buffering=4 * _CHUNK)
            self._begin(head, channels)
        except FileExistsError:
            raise InputError("file", str(path), "it is there already; a log is never written over") from None
        except OSError as error:
            if self._file is not None:
                _let_go(self._file)
                self.path.unlink(missing_ok=True)  # without a head it is none
            raise self._unwritable(error) from None
        self._thread = threading.Thread(target=self._tend, name=f"log {self.path.name}", daemon=True)
        if np.isfinite(flush) or sync is not None:
            self._thread.start()

    def _begin(self, head: str, channels: Mapping[str, Channel]) -> None:
        from mcap.writer import CompressionType, Writer

        assert self._file is not None
        # Without compression a damaged byte costs its chunk and no more, and a sample is found without a decoder. Readers of
        # ROS need the profile and the index of messages.
        self._writer = Writer(self._file, chunk_size=_CHUNK, compression=CompressionType.NONE)
        self._writer.start(profile="ros2", library="mckibben")
        now = clock.time_ns() if self._start is None else self._start
        self._writer.add_attachment(now, now, HEAD, "application/json", head.encode())
        schema = self._writer.register_schema("mckibben/msg/Recording", "ros2msg", _schema(channels).encode())
        # The names once more, in the first chunk: a damaged head then costs the meta only.
        self._topic = self._writer.register_channel(TOPIC, "cdr", schema, {"mckibben": dumps(channels, {})})
        event = self._writer.register_schema("mckibben/msg/Event", "ros2msg", _EVENT)
        self._events = self._writer.register_channel(EVENTS, "cdr", event)
        self._file.flush()
        if self._sync is not None:
            os.fsync(self._file.fileno())
            _sync_folder(self.path.absolute().parent)

    def append(self, times: float | Sequence[float] | np.ndarray, values: Mapping[str, JsonValue] | np.ndarray) -> None:
        """Add one sample, or several.

        Args:
            times: one time, or (m,) [s], later than all before.
            values: by channel, a number or (m,) each [its unit]; or an array (k,) or (m, k) in the order of the channels.

        Raises:
            InputError: a channel is missing or unknown, shapes differ, or the time does not increase, and none of these
                samples is then in the log; or it is closed, or the disk is full.
        """
        with self._lock:
            self._usable()
            rows = self._rows(times, values)
            if not self._count and len(rows):
                self._first = float(rows[0, 0])
                self._start = clock.time_ns() if self._start is None else self._start
            try:
                for row in rows:
                    self._add(row)
            except OSError as error:
                self._failed = error
                raise self._unwritable(error) from None

    def _add(self, row: np.ndarray) -> None:
        at = float(row[0])
        stamp = self._stamp(at)
        self._writer.add_message(self._topic, stamp, CDR + row.tobytes(), stamp, self._count & 0xFFFFFFFF)
        self._count, self._last = self._count + 1, at
        now = clock.monotonic()
        if self._pending == -np.inf:
            self._pending, self._since = at, now
        # A sample's own time decides too, so that a late scheduler costs nothing.
        elif at - self._pending >= self._flush or now - self._since >= self._flush:
            self._out()

    def annotate(self, text: str, time: float) -> None:
        """Add a remark at a time [s]; it becomes one of the metadata's ``events``."""
        with self._lock:
            self._usable()
            if not isinstance(text, str) or not np.isfinite(time):
                raise InputError("remark", repr((text, time)), "must be a text and a finite time [s]")
            letters = text.encode("utf-8", "replace") + b"\0"
            data = CDR + struct.pack("<dI", time, len(letters)) + letters
            stamp = self._stamp(float(time))
            self._writer.add_message(self._events, stamp, data, stamp)
            if self._pending == -np.inf:
                self._pending, self._since = float(time), clock.monotonic()

    def close(
        self, result: str | None = None, message: str | None = None, meta: Mapping[str, JsonValue] | None = None
    ) -> Path:
        """End the log; a second call does nothing.

        Args:
            result: how the run ended, such as ``"DONE"``, for the metadata.
            message: the sentence to that.
            meta: what became known only now, over what was known before.

        Returns:
            The path of the log.
        """
        more = {key: said for key, said in (("result", result), ("message", message)) if said is not None}
        last = freeze({**(meta or {}), **more})
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        with self._lock:
            file, self._file = self._file, None
            if file is None:
                return self.path
            try:
                stamp = self._stamp(self._last)
                self._writer.flush()
                end = dumps({}, last, self._count)
                self._writer.add_attachment(stamp, stamp, END, "application/json", end.encode())
                self._writer.finish()
                file.flush()
                if self._sync is not None:
                    os.fsync(file.fileno())
            except OSError as error:
                raise self._unwritable(error) from None
            finally:
                _let_go(file)
        return self.path

    def __enter__(self) -> Self:
        """The log itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Close the log; an error becomes its message."""
        if kind is None:
            self.close()
        else:
            self.close("INTERRUPTED", " ".join(f"{kind.__name__}: {error}".split()))

    def _rows(self, times: Any, values: Any) -> np.ndarray:
        """Time and values as (m, 1 + k)."""
        at = np.atleast_1d(np.asarray(times, float))
        if at.ndim != 1:
            raise InputError("times", None, f"must be one time, or a list of them, got shape {at.shape}")
        out = np.empty((len(at), 1 + len(self._names)))
        out[:, 0] = at
        try:
            if isinstance(values, Mapping):
                if values.keys() != set(self._names):
                    odd = ", ".join(map(str, set(self._names).symmetric_difference(values)))
                    raise InputError("channels of a sample", odd, f"must be all of {', '.join(self._names)}")
                for i, name in enumerate(self._names, 1):
                    out[:, i] = values[name]
            else:
                array = np.asarray(values, float)
                out[:, 1:] = array[None] if array.ndim == 1 and len(at) == 1 else array.reshape(len(at), -1)
        except (TypeError, ValueError) as error:
            raise InputError("values", " ".join(str(error).split()), "must be a number per channel and time") from None
        # NaN compares false
        if not (np.diff(at, prepend=self._last) > 0.0).all() or not np.isfinite(at).all():
            raise InputError("time", str(times)[:60], f"must be a finite time after {self._last!s} s, increasing")
        return out

    def _stamp(self, at: float) -> int:
        """Unix time of a sample [ns], never before the first; other programs sort by it."""
        start = clock.time_ns() if self._start is None else self._start
        after = (at - self._first) * 1e9 if np.isfinite(self._first) else 0.0
        return min(start + round(min(max(after, 0.0), 9e18)), _LATEST)

    def _out(self) -> None:
        self._writer.flush()
        self._pending = -np.inf

    def _tend(self) -> None:
        """Bring out what a pause of the samples would keep in memory, and let the disk follow."""
        synced = clock.monotonic()
        while not self._ended.wait(self._flush if np.isfinite(self._flush) else SYNC):
            try:
                with self._lock:
                    if self._pending != -np.inf and clock.monotonic() - self._since >= self._flush:
                        self._out()
                if self._sync is not None and self._file and clock.monotonic() - synced >= self._sync:
                    os.fsync(self._file.fileno())
                    synced = clock.monotonic()
            except OSError as error:
                self._failed = error
                return

    def _usable(self) -> None:
        if self._failed is not None:
            raise self._unwritable(self._failed)
        if self._file is None:
            raise InputError("log", str(self.path), "it is closed")

    def _unwritable(self, error: OSError) -> InputError:
        return InputError("file", str(self.path), f"it cannot be written ({error.strerror or error})")


def _schema(channels: Mapping[str, Channel]) -> str:
    """The fields of a sample as a ROS 2 message."""
    described = {n: f"{c.unit}, {c.kind}{c.meaning and ': '}{c.meaning}" for n, c in channels.items()}
    comments = {"time": "s", **described}
    fields = plain_names(comments, lambda name: re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_"))
    return "".join(f"float64 {field} # {n} [{comments[n]}]\n" for field, n in zip(fields, comments, strict=True))


def _sync_folder(folder: Path) -> None:
    """Make the folder entry durable; where folders cannot be opened (Windows) this is not needed."""
    try:
        number = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _let_go(file: BinaryIO) -> None:
    try:
        file.close()
    except OSError:
        pass  # it was told already, or is reported by the function that raised
