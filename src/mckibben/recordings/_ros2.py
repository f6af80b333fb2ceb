"""Bags of ROS 2 (``.db3``) and ROS 1 (``.bag``), read by rosbags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import InputError
from ..extras import library
from ..isolation import lacks_memory
from ._messages import JOINTS, LoggedMessage, message_columns, ros_message, ros_units
from ._sidecar import one_line, unreadable
from .formats import FileFormat, ForeignColumn, ForeignTable

JOINT_REMARK = "positions of joints are read as rad and efforts as N m, as of joints that turn"


def read_bag(path: Path, topic: str | None = None) -> ForeignTable:
    """Read the columns of every topic, named ``topic.field``, and a line for each that cannot be read.

    Args:
        path: the file.
        topic: read this topic only.

    Raises:
        InputError: the file cannot be read, has no such topic, or no message of numbers.
    """
    where = str(path)
    highlevel = library("rosbags.highlevel", "Bags of ROS need", where=where)
    messages: dict[str, list[tuple[int, LoggedMessage]]] = {}
    kinds: dict[str, tuple[str, dict[str, str]]] = {}
    broken: dict[str, str] = {}
    with unreadable("a bag of ROS", where):
        with _open(highlevel, path) as reader:
            topics = sorted(reader.topics)
            if topic is not None and topic not in topics:
                raise InputError("topic", topic, known=topics, where=where)
            wanted = [c for c in reader.connections if topic in (None, c.topic)]
            for connection, stamp, data in reader.messages(connections=wanted) if wanted else ():
                if connection.topic in broken:
                    continue
                try:
                    message = reader.deserialize(data, connection.msgtype)
                except Exception as error:  # what rosbags meets in a message of another kind
                    if lacks_memory(error):
                        raise
                    broken[connection.topic] = one_line(error) or type(error).__name__
                    continue
                messages.setdefault(connection.topic, []).append((stamp, ros_message(message)))
                kinds.setdefault(connection.topic, (connection.msgtype, ros_units(connection.msgtype, message)))
    remarks = [f"{name} is left out: {reason}" for name, reason in broken.items()]
    if not messages:
        raise InputError("file", None, "has no message that can be read", where=where)
    first = min(stamp for pairs in messages.values() for stamp, _ in pairs)
    columns: list[ForeignColumn] = []
    for name, pairs in messages.items():
        kind, units = kinds[name]
        pairs = sorted(dict(pairs).items())
        made = message_columns(name, [m for _, m in pairs], [stamp for stamp, _ in pairs], first, units)
        columns += made
        if not made:
            remarks.append(f"{name} is left out: {kind} holds no numbers")
        remarks += [
            f"{name}.{field} is left out: it is a list"
            for field in dict.fromkeys(f for _, m in pairs for f in m.skipped)
        ]
        if kind == JOINTS:
            remarks.append(f"{name}: {JOINT_REMARK}")
    return ForeignTable(columns, {"topics": {name: kind for name, (kind, _) in kinds.items()}}, remarks)


def _open(highlevel: Any, path: Path) -> Any:
    """A reader of a bag; one without definitions of its messages is read by those of the latest ROS 2."""
    reader = highlevel.AnyReader([path])
    try:
        reader.open()
        reader.close()
    except highlevel.AnyReaderError:
        from rosbags.typesys import Stores, get_typestore

        store = Stores.ROS1_NOETIC if path.suffix == ".bag" else Stores.LATEST
        return highlevel.AnyReader([path], default_typestore=get_typestore(store))
    return highlevel.AnyReader([path])


def topic_names(path: Path) -> list[str]:
    """Names of the topics of a bag."""
    where = str(path)
    highlevel = library("rosbags.highlevel", "Bags of ROS need", where=where)
    with unreadable("a bag of ROS", where), _open(highlevel, path) as reader:
        return sorted(reader.topics)


FORMAT = FileFormat(title="Bags of ROS", read=read_bag, options=("topic",), parts=topic_names)
