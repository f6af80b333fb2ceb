"""MCAP files: logs of a bench, closed, cut off or damaged, recordings exported as such, and files of other programs.

Of another program's file messages of JSON, protobuf and ROS 2 are read.
"""

from __future__ import annotations

import dataclasses
import math
import struct
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import JsonValue, no_file, parse_json
from ..errors import InputError, MissingLibraryError
from ..isolation import call_outside
from .live_log import CDR, END, EVENTS, HEAD, TOPIC, LiveLog
from .mcap_records import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    MESSAGE,
    SCHEMA,
    ByteGap,
    McapRecord,
    MessageSchema,
    Topic,
    attachment,
    read_schema,
    read_topic,
    record_at,
    records,
    records_inside,
)
from .messages import (
    JOINT_REMARK,
    LoggedMessage,
    json_message,
    message_columns,
    protobuf_decoder,
    ros_decoder,
    ros_message,
    ros_units,
)
from .sidecar import KEY, Sidecar, loads, undecodable
from .table import FileFormat, ForeignColumn, ForeignTable, Samples, StoredRecording

_SAMPLE_ID, _EVENT_ID = 1, 2  # as the live log numbers its topics; needed where the chunk that says so is damaged
_STAMPS = 22  # [B] of a message before its data: topic, number, two times
_MOST_GAPS = 5  # that are named one by one
_BLOCK = 4096  # samples that an export hands over at once
_STAMP = struct.Struct("<HIQQ")  # topic, number, two times [ns]


class _LogParts:
    """The pieces of a log, gathered on the way through its file."""

    def __init__(self) -> None:
        self.head: Sidecar | None = None
        self.names: Sidecar | None = None
        self.end: Sidecar | None = None
        self.samples: list[np.ndarray] = []  # of samples: number, time and values
        self.events: list[dict[str, Any]] = []
        self.gaps: list[tuple[ByteGap, int]] = []
        self.sample, self.event = _SAMPLE_ID, _EVENT_ID


def read_log(path: str | Path) -> StoredRecording:
    """Read a log of a bench, or a recording exported as MCAP, in whatever state it is.

    Only samples whose checksum agrees are given back. What the log lost also stands in the meta's ``warnings``; remarks made
    while it ran are in ``events``.

    Raises:
        InputError: there is no such file, no sample of it can be read, it is no log of mckibben, or of a newer version.
    """
    path = Path(path)
    if not path.is_file():
        raise no_file(path)
    if not path.stat().st_size:
        raise InputError("file", None, "is empty", where=str(path))
    return call_outside(parse_log, path)


def parse_log(path: Path) -> StoredRecording:
    """`read_log` in the process that calls it."""
    try:
        return _log(_gather(memoryview(path.read_bytes()), str(path)), str(path))
    except RecursionError:
        raise InputError("meta", None, "is nested too deeply for the JSON of a run", where=str(path)) from None


def is_log(path: Path) -> bool:
    """Whether an MCAP file is of mckibben: two places near its start state so, of which one may be damaged."""
    with open(path, "rb") as stream:
        begin = stream.read(4096)
    return struct.pack("<I", len(KEY)) + KEY.encode() in begin[:64] or HEAD.encode() in begin


def write_log(recording: Samples, path: Path) -> list[str]:
    """Write a recording as a closed log."""
    start = 0
    try:
        start = max(int(datetime.fromisoformat(str(recording.meta.get("created"))).timestamp() * 1e9), 0)
    except (ValueError, OverflowError, OSError):
        pass  # without a date, the log begins at 1970 for other programs
    live = LiveLog(path, recording.channels, recording.meta, flush=np.inf, sync=None, start=start)
    columns = [c.values for c in recording.channels.values()]
    for i in range(0, len(recording.time), _BLOCK):
        part = slice(i, i + _BLOCK)
        time = recording.time[part]
        live.append(time, np.stack([c[part] for c in columns], axis=1) if columns else np.empty((len(time), 0)))
    live.close()
    return []


def _gather(data: memoryview, where: str) -> _LogParts:
    log = _LogParts()
    for record in records(data):
        if isinstance(record, ByteGap):
            # After the end only the indexes follow, which nothing here needs.
            if log.end is None:
                log.gaps.append((record, len(log.samples)))
        elif record.opcode == ATTACHMENT:
            name, content = attachment(record.body)
            if name in (HEAD, END):
                sidecar = loads(content.decode("utf-8", "replace"), where)
                if name == HEAD:
                    log.head = log.head or sidecar
                else:
                    log.end = sidecar
        elif record.opcode == CHUNK:
            _add_chunk(log, record.body, where)
    return log


def _add_chunk(log: _LogParts, chunk: memoryview, where: str) -> None:
    """Samples, events and names of a sound chunk."""
    record = record_at(chunk, 0)
    while record is not None:
        after = record.end
        if record.opcode == CHANNEL:
            _add_topic(log, record.body, where)
        elif record.opcode == MESSAGE and len(record.body) >= _STAMPS:
            (topic,) = struct.unpack_from("<H", record.body)
            if topic == log.sample:
                rows, after = _samples(chunk, record)
                log.samples.append(rows)
            elif topic == log.event:
                log.events += _read_event(bytes(record.body[_STAMPS:]))
        record = record_at(chunk, after)


def _add_topic(log: _LogParts, body: memoryview, where: str) -> None:
    topic = read_topic(body)
    if topic is not None and topic.name == TOPIC and KEY in topic.metadata:
        log.sample, log.names = topic.number, loads(topic.metadata[KEY], where)
    elif topic is not None and topic.name == EVENTS:
        log.event = topic.number


def _samples(chunk: memoryview, first: McapRecord) -> tuple[np.ndarray, int]:
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


def _read_event(data: bytes) -> list[dict[str, JsonValue]]:
    try:
        time, length = struct.unpack_from("<dI", data, len(CDR))
        text = data[len(CDR) + 12 :]
        whole = data.startswith(CDR) and len(text) == length and text.endswith(b"\0") and math.isfinite(time)
        return [{"time": time, "text": text[:-1].decode()}] if whole else []
    except (ValueError, struct.error):
        return []


def _log(log: _LogParts, where: str) -> StoredRecording:
    known = log.head or log.names
    if known is None:
        allowed = "has no head: this is no log of mckibben, or both places that name its channels are damaged"
        raise InputError("file", None, allowed, where=where)
    rows, dropped = _in_order(log.samples, 2 + len(known.channels))
    if not len(rows):
        raise InputError("file", None, "has no samples: a log needs at least one whole chunk", where=where)
    remarks = _remarks(log, rows, dropped)
    meta = {**known.meta, **(log.end.meta if log.end else {})}
    for key, more in (("events", log.events), ("warnings", remarks)):
        if more:
            before = meta.get(key, [])
            before = before if isinstance(before, list) else [before]
            meta[key] = [*before, *(new for new in more if not any(_is_among(new, old) for old in before))]
    try:
        recording = Sidecar(known.channels, meta).recording(rows[:, 1], list(rows[:, 2:].T))
    except InputError as error:
        raise error.at(where) from None
    return dataclasses.replace(recording, remarks=remarks)


def _is_among(new: Any, old: Any) -> bool:
    """Whether a remark is among what `close` added, perhaps with more."""
    return new == old or (isinstance(new, dict) and isinstance(old, dict) and new.items() <= old.items())


def _in_order(parts: list[np.ndarray], width: int) -> tuple[np.ndarray, int]:
    """Samples (n, width) of the right width whose time increases, and the number of others."""
    fitting = [part for part in parts if part.shape[1] == width]
    rows = np.concatenate(fitting) if fitting else np.empty((0, width))
    time = np.where(np.isfinite(rows[:, 1]), rows[:, 1], -np.inf)
    latest = np.maximum.accumulate(time) if len(time) else time
    keep = time > np.concatenate(([-np.inf], latest[:-1]))
    return rows[keep], sum(map(len, parts)) - int(keep.sum())


def _remarks(log: _LogParts, rows: np.ndarray, dropped: int) -> list[str]:
    """A line for each thing that is not whole; the samples' numbers in the log tell which are missing."""
    lines = []
    if log.head is None:
        lines.append("the head of the log is damaged: title, parameters and the rest of its meta are lost")
    number, time = rows[:, 0], rows[:, 1]
    missing = np.diff(number, prepend=-1.0) - 1.0
    gaps = np.flatnonzero(missing > 0.0)
    for i in gaps[:_MOST_GAPS]:
        after = f"between {time[i - 1]:.6g} s and" if i else "before"
        lines.append(f"{missing[i]:.0f} samples {after} {time[i]:.6g} s are lost")
    if len(gaps) > _MOST_GAPS:
        lines.append(
            f"{missing[gaps[_MOST_GAPS:]].sum():.0f} more samples are lost, in {len(gaps) - _MOST_GAPS} places"
        )
    last = 0 if log.end is None or log.end.samples is None else log.end.samples - 1 - int(number[-1])
    if last > 0:
        lines.append(f"{last} samples after {time[-1]:.6g} s are lost")
    if dropped:
        lines.append(f"{dropped} samples whose time does not increase, or of another width, were left out")
    # What follows the last sample of a log that was not closed is the tail that any end of a process leaves.
    inner = [gap for gap, parts in log.gaps if parts < len(log.samples) or log.end is not None]
    if inner:
        places = ", ".join(f"{gap.start} to {gap.end}" for gap in inner[:_MOST_GAPS])
        lines.append(f"damaged bytes of the log: {places}{' and more' if len(inner) > _MOST_GAPS else ''}")
    if log.end is None:
        tail = sum(gap.end - gap.start for gap, parts in log.gaps if parts == len(log.samples))
        torn = f"; its last {tail} bytes are no whole chunk" if tail else ""
        lines.append(f"the log was not closed: what came after {time[-1]:.6g} s is lost{torn}")
    return lines


def read_foreign(path: Path, topic: str | None = None) -> ForeignTable:
    """Read the columns of every topic that can be read, named ``topic.field``, and a line for each that cannot.

    The time of a message is its own stamp, if it has one, else that of its logging, from the first message of the file on.

    Args:
        path: the file.
        topic: read this topic only.

    Raises:
        InputError: the file has no message that can be read, or no such topic.
    """
    where = str(path)
    topics: dict[int, Topic] = {}
    schemas: dict[int, MessageSchema] = {}
    messages: dict[int, list[tuple[int, bytes]]] = {}
    lines: list[str] = []
    for record in records(memoryview(path.read_bytes())):
        if isinstance(record, ByteGap):
            lines.append(f"bytes {record.start} to {record.end} are damaged or cut off; what they held is left out")
            continue
        for one in records_inside(record.body) if record.opcode == CHUNK else (record,):
            _add_record(one, topics, schemas, messages)
    if not messages:
        problem = "the MCAP file has no message that can be read"
        raise InputError("file", "no messages", problem, sentence=problem, where=where)
    names = sorted({one.name for one in topics.values()})
    if topic is not None and topic not in names:
        raise InputError("topic", topic, known=names, where=where)
    first = min(stamp for pairs in messages.values() for stamp, _ in pairs)
    columns: list[ForeignColumn] = []
    for number, pairs in messages.items():
        channel = topics.get(number)
        if channel is None:
            lines.append(f"{len(pairs)} messages of an unknown topic are left out")
            continue
        if topic not in (None, channel.name):
            continue
        # Logged at one time: the last one holds.
        pairs = sorted(dict(pairs).items())
        try:
            decoded, units = _decode(channel, schemas.get(channel.schema), [data for _, data in pairs], where)
        except ValueError as error:
            if isinstance(error, MissingLibraryError):
                raise
            lines.append(f"{channel.name} is left out: {error}")
            continue
        columns += message_columns(channel.name, decoded, [stamp for stamp, _ in pairs], first, units)
        skipped = dict.fromkeys(field for message in decoded for field in message.skipped)
        lines += [f"{channel.name}.{field} is left out: it is a list" for field in skipped]
        if schemas.get(channel.schema) and schemas[channel.schema].name.endswith("/JointState"):
            lines.append(f"{channel.name}: {JOINT_REMARK}")
    if not columns:
        raise InputError("topics", None, f"cannot be read: {'; '.join(lines)[:300]}", where=where)
    return ForeignTable(columns, {}, lines)


def _add_record(
    record: McapRecord,
    topics: dict[int, Topic],
    schemas: dict[int, MessageSchema],
    messages: dict[int, list[tuple[int, bytes]]],
) -> None:
    if record.opcode == CHANNEL and (topic := read_topic(record.body)):
        topics[topic.number] = topic
    elif record.opcode == SCHEMA and (schema := read_schema(record.body)):
        schemas[schema.number] = schema
    elif record.opcode == MESSAGE and len(record.body) >= _STAMP.size:
        number, _, stamp, _ = _STAMP.unpack_from(record.body)
        messages.setdefault(number, []).append((stamp, bytes(record.body[_STAMP.size :])))


def _decode(
    topic: Topic, schema: MessageSchema | None, payloads: list[bytes], where: str
) -> tuple[list[LoggedMessage], dict[str, str]]:
    """The messages of a topic, and the units of their fields; `ValueError` says why they cannot be read."""
    units: dict[str, str] = {}
    if topic.encoding == "json":
        try:
            decoded = [json_message(parse_json(data)) for data in payloads]
        except (ValueError, RecursionError):
            raise ValueError("a message is no JSON") from None
    elif topic.encoding == "cdr" and schema is not None and schema.encoding == "ros2msg":
        decode = ros_decoder(schema.name, schema.text, where=where)
        with undecodable(f"its messages are not what {schema.name} says"):
            objects = [decode(data) for data in payloads]
        units = ros_units(getattr(objects[0], "__msgtype__", schema.name), objects[0])
        decoded = [ros_message(one) for one in objects]
    elif topic.encoding == "protobuf" and schema is not None and schema.encoding == "protobuf" and schema.data:
        decode = protobuf_decoder(schema.name, schema.data, where=where)
        with undecodable(f"its messages are not what {schema.name} says"):
            decoded = [decode(data) for data in payloads]
    else:
        known = "known are json, cdr of ROS 2 and protobuf, each with its schema"
        raise ValueError(f"its messages are {topic.encoding or 'without a name'}; {known}")
    if not any(message.numbers for message in decoded):
        raise ValueError("its messages hold no numbers")
    return decoded, units


def _read(path: Path, topic: str | None = None) -> StoredRecording | ForeignTable:
    return read_log(path) if is_log(path) else read_foreign(path, topic)


def topic_names(path: Path) -> list[str]:
    """Names of the topics of a file of another program; none of a log of mckibben, which is read whole."""
    topics: dict[int, Topic] = {}
    for record in records(memoryview(path.read_bytes())):
        if isinstance(record, ByteGap):
            continue
        for one in records_inside(record.body) if record.opcode == CHUNK else (record,):
            if one.opcode == CHANNEL and (topic := read_topic(one.body)):
                topics[topic.number] = topic
    names = {topic.name for topic in topics.values()}
    return [] if TOPIC in names else sorted(names)


FORMAT = FileFormat(title="MCAP files", read=_read, write=write_log, options=("topic",), parts=topic_names)
