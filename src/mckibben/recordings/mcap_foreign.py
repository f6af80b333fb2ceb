"""MCAP files of others: topics of JSON messages, and of ROS 2 messages that hold plain numbers only."""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import parse_json
from ..errors import InputError
from .imports import Given
from .mcap_records import CHANNEL, CHUNK, MESSAGE, SCHEMA, Form, Hole, Record, Topic, form_of, inside, records, topic_of

_STAMP = struct.Struct("<HIQQ")  # topic, number, two times [ns]
_PLAIN = {
    **{"float64": "<f8", "float32": "<f4", "bool": "?", "byte": "u1", "char": "u1"},
    **{f"{sign}int{8 * n}": f"<{sign[:1] or 'i'}{n}" for sign in ("", "u") for n in (1, 2, 4, 8)},
}
_FIELD = re.compile(r"(?P<kind>\w+)\s+(?P<name>\w+)\s*(?:\s-?[\w.+-]+)?")


def columns_of(path: Path) -> tuple[list[Given], list[str]]:
    """The columns of every topic that can be read, named ``topic.field``, and a line for each that cannot.

    The time of a message is that of its logging, from the first message of the file on.

    Raises:
        InputError: the file has no message that can be read.
    """
    topics: dict[int, Topic] = {}
    forms: dict[int, Form] = {}
    messages: dict[int, list[tuple[int, bytes]]] = {}
    lines: list[str] = []
    for record in records(memoryview(path.read_bytes())):
        if isinstance(record, Hole):
            lines.append(f"bytes {record.start} to {record.end} are damaged or cut off; what they held is left out")
            continue
        for one in inside(record.body) if record.opcode == CHUNK else (record,):
            _take(one, topics, forms, messages)
    if not messages:
        raise InputError("file", "no messages", "allowed is an MCAP file with at least one message", where=str(path))
    first = min(stamp for found in messages.values() for stamp, _ in found)
    given: list[Given] = []
    for number, found in messages.items():
        topic = topics.get(number)
        if topic is None:
            lines.append(f"{len(found)} messages of an unknown topic are left out")
            continue
        # Logged at one time: the last one holds.
        found = sorted(dict(found).items())
        fields = _decoded(topic, forms.get(topic.schema), [data for _, data in found])
        if isinstance(fields, str):
            lines.append(f"{topic.name} is left out: {fields}")
            continue
        time = (np.array([stamp for stamp, _ in found], np.uint64) - np.uint64(first)).astype(float) * 1e-9
        stem = re.sub(r"[^\w]+", "_", topic.name).strip("_") or "topic"
        given += [Given(f"{stem}.{name}", values, None, topic.name, time) for name, values in fields.items()]
    if not given:
        raise InputError("topics", "none that can be read", "; ".join(lines)[:300], where=str(path))
    return given, lines


def _take(
    record: Record, topics: dict[int, Topic], forms: dict[int, Form], messages: dict[int, list[tuple[int, bytes]]]
) -> None:
    if record.opcode == CHANNEL and (topic := topic_of(record.body)):
        topics[topic.number] = topic
    elif record.opcode == SCHEMA and (form := form_of(record.body)):
        forms[form.number] = form
    elif record.opcode == MESSAGE and len(record.body) >= _STAMP.size:
        number, _, stamp, _ = _STAMP.unpack_from(record.body)
        messages.setdefault(number, []).append((stamp, bytes(record.body[_STAMP.size :])))


def _decoded(topic: Topic, form: Form | None, found: list[bytes]) -> dict[str, np.ndarray] | str:
    """The fields of a topic's messages, or why they cannot be read."""
    if topic.encoding == "json":
        return _from_json(found)
    if topic.encoding == "cdr" and form is not None and form.encoding == "ros2msg":
        layout = _layout(form.text)
        if layout is None:
            return f"{form.name} holds more than plain numbers"
        if any(len(data) < layout.itemsize or data[1:2] != b"\x01" for data in found):
            return f"its messages are not what {form.name} says"
        table = np.frombuffer(b"".join(data[: layout.itemsize] for data in found), layout)
        return {name: table[name] for name in layout.names or ()}
    return f"its messages are {topic.encoding or 'without a name'}; known are json, and cdr of plain numbers"


def _from_json(found: list[bytes]) -> dict[str, np.ndarray] | str:
    rows: list[dict[str, float | bool]] = []
    for data in found:
        try:
            told = parse_json(data)
        except (ValueError, RecursionError):
            return "a message is no JSON"
        rows.append(dict(_numbers(told, "") if isinstance(told, Mapping) else []))
    names = dict.fromkeys(name for row in rows for name in row)
    if not names:
        return "its messages hold no numbers"
    columns = {}
    for name in names:
        values = [row.get(name) for row in rows]
        flags = all(isinstance(v, bool) for v in values)
        columns[name] = np.array([np.nan if v is None else v for v in values], bool if flags else float)
    return columns


def _numbers(told: Mapping[str, Any], before: str) -> list[tuple[str, float | bool]]:
    found: list[tuple[str, float | bool]] = []
    for key, value in told.items():
        if isinstance(value, Mapping):
            found += _numbers(value, f"{before}{key}.")
        elif isinstance(value, bool | float) or (isinstance(value, int) and abs(value) < 2**1000):
            found.append((f"{before}{key}", value))
    return found


def _layout(text: str) -> np.dtype | None:
    """A ROS 2 message of plain numbers as it lies in CDR behind its four bytes, or None of any other."""
    names: list[str] = []
    kinds: list[str] = []
    places: list[int] = []
    at = 0
    for line in text.splitlines():
        words = line.partition("#")[0].strip()
        if words.startswith("==="):
            break
        if not words or "=" in words:  # a constant
            continue
        field = _FIELD.fullmatch(words)
        if field is None or field["kind"] not in _PLAIN or field["name"] in names:
            return None
        size = np.dtype(_PLAIN[field["kind"]]).itemsize
        at += -at % size
        names.append(field["name"])
        kinds.append(_PLAIN[field["kind"]])
        places.append(4 + at)
        at += size
    if not names:
        return None
    return np.dtype({"names": names, "formats": kinds, "offsets": places, "itemsize": 4 + at})
