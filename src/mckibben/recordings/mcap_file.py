"""MCAP files: logs of a bench, closed or cut off or damaged, and recordings exported as such."""

from __future__ import annotations

import struct
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..documents import parse_json
from ..errors import InputError
from .live_log import CDR, END, EVENTS, HEAD, TOPIC, LiveLog
from .mcap_records import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    MESSAGE,
    Hole,
    Record,
    attachment,
    record_in,
    records,
    topic_of,
)
from .recording import Recording
from .sidecar import KEY, Sidecar, retold

_SAMPLE_ID, _EVENT_ID = 1, 2  # as the live log numbers its topics; needed where the chunk that says so is damaged
_STAMPS = 22  # [B] of a message before its data: topic, number, two times
_TOLD = 5  # holes that are told one by one
_BLOCK = 4096  # samples that an export hands over at once


class Log(NamedTuple):
    """What was read of a log: the recording, whether the log is whole, and a line for each thing that is not."""

    recording: Recording
    whole: bool
    remarks: list[str]


class _Found:
    """What is gathered on the way through a file."""

    def __init__(self) -> None:
        self.head: Sidecar | None = None
        self.names: Sidecar | None = None
        self.end: Sidecar | None = None
        self.parts: list[np.ndarray] = []  # of samples: number, time and values
        self.events: list[dict[str, Any]] = []
        self.holes: list[tuple[Hole, int]] = []
        self.sample, self.event = _SAMPLE_ID, _EVENT_ID


def read_log(path: str | Path) -> Log:
    """Read a log of a bench, or a recording exported as MCAP, in whatever state it is.

    Only samples whose checksum agrees are given back. What the log lost also stands in the meta's ``warnings``; remarks made
    while it ran are in ``events``.

    Raises:
        InputError: there is no such file, no sample of it can be read, it is no log of mckibben, or of a newer version.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("file", str(path), "no such file")
    if not path.stat().st_size:
        raise InputError("file", "empty", "allowed is an MCAP file", where=str(path))
    try:
        return _log(_gathered(memoryview(path.read_bytes()), str(path)), str(path))
    except RecursionError:
        raise InputError("meta", "nested too deeply", "allowed is what JSON of a run holds", where=str(path)) from None


def is_log(path: Path) -> bool:
    """Whether an MCAP file is of mckibben: one of two places in its beginning says so, and one may be damaged."""
    with open(path, "rb") as stream:
        begin = stream.read(4096)
    return struct.pack("<I", len(KEY)) + KEY.encode() in begin[:64] or HEAD.encode() in begin


def write_log(recording: Recording, path: Path) -> None:
    """Write a recording as a closed log."""
    start = 0
    try:
        start = max(int(datetime.fromisoformat(str(recording.meta.get("created"))).timestamp() * 1e9), 0)
    except (ValueError, OverflowError, OSError):
        pass  # without a date, the log begins at 1970 for other programs
    log = LiveLog(path, recording.channels, recording.meta, flush=np.inf, sync=None, start=start)
    columns = [c.values for c in recording.channels.values()]
    for i in range(0, len(recording), _BLOCK):
        part = slice(i, i + _BLOCK)
        time = recording.time[part]
        log.append(time, np.stack([c[part] for c in columns], axis=1) if columns else np.empty((len(time), 0)))
    log.close()


def _gathered(data: memoryview, where: str) -> _Found:
    found = _Found()
    for record in records(data):
        if isinstance(record, Hole):
            # After the end only the indexes follow, which nothing here needs.
            if found.end is None:
                found.holes.append((record, len(found.parts)))
        elif record.opcode == ATTACHMENT:
            name, content = attachment(record.body)
            if name in (HEAD, END):
                told = retold(content.decode("utf-8", "replace"), where)
                if name == HEAD:
                    found.head = found.head or told
                else:
                    found.end = told
        elif record.opcode == CHUNK:
            _take(found, record.body, where)
    return found


def _take(found: _Found, chunk: memoryview, where: str) -> None:
    """Samples, events and names of a sound chunk."""
    record = record_in(chunk, 0)
    while record is not None:
        after = record.end
        if record.opcode == CHANNEL:
            _take_topic(found, record.body, where)
        elif record.opcode == MESSAGE and len(record.body) >= _STAMPS:
            (topic,) = struct.unpack_from("<H", record.body)
            if topic == found.sample:
                rows, after = _samples(chunk, record)
                found.parts.append(rows)
            elif topic == found.event:
                found.events += _event(bytes(record.body[_STAMPS:]))
        record = record_in(chunk, after)


def _take_topic(found: _Found, body: memoryview, where: str) -> None:
    topic = topic_of(body)
    if topic is not None and topic.name == TOPIC and KEY in topic.metadata:
        found.sample, found.names = topic.number, retold(topic.metadata[KEY], where)
    elif topic is not None and topic.name == EVENTS:
        found.event = topic.number


def _samples(chunk: memoryview, first: Record) -> tuple[np.ndarray, int]:
    """The run of samples that begins with a record, and where it ends: all of one length, read at once.

    Returns:
        (m, 2 + k): the sample's number in the log, its time [s], its values; and an offset.
    """
    size, numbers = first.end - first.at, (len(first.body) - _STAMPS - len(CDR)) // 8
    if numbers < 1 or len(first.body) != _STAMPS + len(CDR) + 8 * numbers:
        return np.empty((0, 0)), first.end
    layout = np.dtype([("head", "V11"), ("count", "<u4"), ("stamps", "V16"), ("cdr", "V4"), ("row", "<f8", (numbers,))])
    table = np.frombuffer(chunk, layout, (len(chunk) - first.at) // size, first.at)
    # Opcode, length and topic say what a record is.
    same = (table["head"] == table["head"][0]) & (table["cdr"] == np.void(CDR))
    count = len(same) if same.all() else int(np.argmin(same))
    return np.column_stack([table["count"][:count], table["row"][:count]]), first.at + size * max(count, 1)


def _event(data: bytes) -> list[dict[str, Any]]:
    try:
        told = parse_json(data)
        return [{"time": float(told["time"]), "text": str(told["text"])}]
    except (ValueError, TypeError, KeyError, RecursionError):
        return []


def _log(found: _Found, where: str) -> Log:
    known = found.head or found.names
    if known is None:
        allowed = "this is no log of mckibben, or both places that name its channels are damaged"
        raise InputError("file", "without a head", allowed, where=where)
    rows, dropped = _ordered(found.parts, 2 + len(known.channels))
    if not len(rows):
        raise InputError("file", "no samples", "allowed is a log that has at least one whole chunk", where=where)
    remarks = _remarks(found, rows, dropped)
    meta = {**known.meta, **(found.end.meta if found.end else {})}
    for key, more in (("events", found.events), ("warnings", remarks)):
        if more:
            before = meta.get(key, [])
            before = before if isinstance(before, list) else [before]
            meta[key] = [*before, *(new for new in more if not any(_told(new, old) for old in before))]
    try:
        recording = Sidecar(known.channels, meta).recording(rows[:, 1], list(rows[:, 2:].T))
    except InputError as error:
        raise error.at(where) from None
    return Log(recording, not remarks, remarks)


def _told(new: Any, old: Any) -> bool:
    """Whether a remark is among what `close` added, perhaps with more."""
    return new == old or (isinstance(new, dict) and isinstance(old, dict) and new.items() <= old.items())


def _ordered(parts: list[np.ndarray], width: int) -> tuple[np.ndarray, int]:
    """All samples (n, width) of the right width whose time increases, and how many others there were."""
    fitting = [part for part in parts if part.shape[1] == width]
    rows = np.concatenate(fitting) if fitting else np.empty((0, width))
    time = np.where(np.isfinite(rows[:, 1]), rows[:, 1], -np.inf)
    latest = np.maximum.accumulate(time) if len(time) else time
    keep = time > np.concatenate(([-np.inf], latest[:-1]))
    return rows[keep], sum(map(len, parts)) - int(keep.sum())


def _remarks(found: _Found, rows: np.ndarray, dropped: int) -> list[str]:
    """A line for each thing that is not whole; the samples' numbers in the log tell which are missing."""
    lines = []
    if found.head is None:
        lines.append("the head of the log is damaged: title, parameters and the rest of its meta are lost")
    number, time = rows[:, 0], rows[:, 1]
    missing = np.diff(number, prepend=-1.0) - 1.0
    gaps = np.flatnonzero(missing > 0.0)
    for i in gaps[:_TOLD]:
        after = f"between {time[i - 1]:.6g} s and" if i else "before"
        lines.append(f"{missing[i]:.0f} samples {after} {time[i]:.6g} s are lost")
    if len(gaps) > _TOLD:
        lines.append(f"{missing[gaps[_TOLD:]].sum():.0f} more samples are lost, in {len(gaps) - _TOLD} places")
    last = 0 if found.end is None or found.end.samples is None else found.end.samples - 1 - int(number[-1])
    if last > 0:
        lines.append(f"{last} samples after {time[-1]:.6g} s are lost")
    if dropped:
        lines.append(f"{dropped} samples whose time does not increase, or of another width, were left out")
    # What follows the last sample of a log that was not closed is the tail that any end of a process leaves.
    inner = [hole for hole, parts in found.holes if parts < len(found.parts) or found.end is not None]
    if inner:
        told = ", ".join(f"{hole.start} to {hole.end}" for hole in inner[:_TOLD])
        lines.append(f"damaged bytes of the log: {told}{' and more' if len(inner) > _TOLD else ''}")
    if found.end is None:
        tail = sum(hole.end - hole.start for hole, parts in found.holes if parts == len(found.parts))
        torn = f"; its last {tail} bytes are no whole chunk" if tail else ""
        lines.append(f"the log was not closed: what came after {time[-1]:.6g} s is lost{torn}")
    return lines
