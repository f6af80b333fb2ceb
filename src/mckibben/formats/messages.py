"""Messages of ROS, protobuf and JSON as columns of numbers, with the units that the standard messages of ROS define.

They come from MCAP files, and from bags of ROS 2 (``.db3``) and ROS 1 (``.bag``), read by rosbags.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..documents import JsonValue
from ..errors import InputError
from ..extras import library
from ..isolation import lacks_memory
from .sidecar import one_line, undecodable, unreadable
from .table import FileFormat, ForeignColumn, ForeignTable

Number = float | bool
# Type of message -> unit of its fields, as the comments of its definition state; that of a FluidPressure is absolute.
ROS_UNITS = {
    "geometry_msgs/msg/Wrench": {"force": "N", "torque": "N m"},
    "geometry_msgs/msg/Twist": {"linear": "m/s", "angular": "rad/s"},
    "geometry_msgs/msg/Point": {"x": "m", "y": "m", "z": "m"},
    "sensor_msgs/msg/FluidPressure": {"fluid_pressure": "Pa abs", "variance": "Pa^2"},
    "sensor_msgs/msg/JointState": {"position": "rad", "velocity": "rad/s", "effort": "N m"},
    "sensor_msgs/msg/Temperature": {"temperature": "degC", "variance": "K^2"},
    "sensor_msgs/msg/RelativeHumidity": {"relative_humidity": "1", "variance": "1"},
    "sensor_msgs/msg/Imu": {"linear_acceleration": "m/s^2", "angular_velocity": "rad/s", "orientation": "1"},
    "sensor_msgs/msg/Range": {"range": "m", "min_range": "m", "max_range": "m", "field_of_view": "rad"},
    "std_msgs/msg/Bool": {"data": "1"},
}  # fmt: skip
JOINTS = "sensor_msgs/msg/JointState"
_DEEPEST = 20  # messages in messages


class LoggedMessage(NamedTuple):
    """One message: its numbers by dotted name, its own time stamp [ns], and the fields that were passed over."""

    numbers: dict[str, Number]
    stamp: int | None = None
    skipped: tuple[str, ...] = ()


def message_columns(
    topic: str, messages: Sequence[LoggedMessage], logged: Sequence[int], first: int, units: Mapping[str, str]
) -> list[ForeignColumn]:
    """The columns of one topic, named ``topic.field``.

    Args:
        topic: the name of the topic.
        messages: decoded, in the order of their logging.
        logged: when each was logged [ns].
        first: when the first message of the file was logged [ns].
        units: field, or the first word of its dotted name -> unit in words.

    Returns:
        Columns over the stamps of the messages if these increase, else over the times of logging, from `first` on.
    """
    stamps = [m.stamp for m in messages]
    stamped = all(stamp for stamp in stamps) and all(a < b for a, b in zip(stamps, stamps[1:], strict=False))  # type: ignore[operator]
    ticks = [stamp or 0 for stamp in stamps] if stamped else list(logged)
    begin = first if min(ticks) >= first or not stamped else min(ticks)
    if stamped and abs(ticks[0] - logged[0]) > 60e9:  # another clock than that of the file
        begin = ticks[0]
    time = np.array([tick - begin for tick in ticks], float) * 1e-9
    stem = re.sub(r"[^\w]+", "_", topic).strip("_") or "topic"
    columns = []
    for name in dict.fromkeys(name for message in messages for name in message.numbers):
        values = [message.numbers.get(name) for message in messages]
        flags = all(isinstance(v, bool) for v in values)
        array = np.array([np.nan if v is None else v for v in values], bool if flags else float)
        unit = units.get(name, units.get(name.partition(".")[0]))
        columns.append(ForeignColumn(f"{stem}.{name}", array, unit, topic, time))
    return columns


def json_message(message: object) -> LoggedMessage:
    """The numbers of a message of JSON, nested by dots; lists are skipped."""
    numbers: dict[str, Number] = {}
    skipped: list[str] = []
    if isinstance(message, Mapping):
        _json_numbers(message, "", numbers, skipped)
    return LoggedMessage(numbers, None, tuple(skipped))


def _json_numbers(
    message: Mapping[str, JsonValue], before: str, numbers: dict[str, Number], skipped: list[str]
) -> None:
    for key, value in message.items():
        name = f"{before}{key}"
        if isinstance(value, Mapping):
            _json_numbers(value, f"{name}.", numbers, skipped)
        elif isinstance(value, bool | float) or (isinstance(value, int) and abs(value) < 2**1000):
            numbers[name] = value
        elif isinstance(value, list) and value:
            skipped.append(name)


def ros_message(message: object) -> LoggedMessage:
    """Numbers of a decoded ROS message; of joints by the joints' names, other lists are skipped."""
    numbers: dict[str, Number] = {}
    skipped: list[str] = []
    joints = list(getattr(message, "name", ())) if _kind(message) == JOINTS else []
    _ros_numbers(message, "", numbers, skipped, joints, 0)
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    stamped = None if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)
    return LoggedMessage(numbers, stamped or None, tuple(skipped))


def _kind(message: Any) -> str:
    return str(getattr(message, "__msgtype__", ""))


def _ros_numbers(
    message: Any, before: str, numbers: dict[str, Number], skipped: list[str], joints: list[str], depth: int
) -> None:
    for field in dataclasses.fields(message):
        name, value = f"{before}{field.name}", getattr(message, field.name)
        if field.name in ("header", "__msgtype__") or isinstance(value, str) or field.name.isupper():
            continue  # names in capitals are constants
        if dataclasses.is_dataclass(value):
            if depth < _DEEPEST:
                _ros_numbers(value, f"{name}.", numbers, skipped, joints, depth + 1)
        elif isinstance(value, np.ndarray | list):
            if joints and len(value) == len(joints) and field.name != "name":
                numbers |= {f"{name}.{joint}": float(v) for joint, v in zip(joints, value, strict=True)}
            elif len(value) and field.name != "name":
                skipped.append(name)
        elif isinstance(value, bool | int | float | np.number | np.bool_):
            numbers[name] = bool(value) if isinstance(value, bool | np.bool_) else float(value)


def ros_units(kind: str, message: object) -> dict[str, str]:
    """The units of a message's fields by dotted name, as far as the standard messages define them."""
    units = dict(ROS_UNITS.get(kind, {}))
    if dataclasses.is_dataclass(message):
        for field in dataclasses.fields(message):
            value = getattr(message, field.name)
            for name, unit in ROS_UNITS.get(_kind(value), {}).items():
                units[f"{field.name}.{name}"] = unit
                for axis in "xyz":
                    units[f"{field.name}.{name}.{axis}"] = unit
    return units


def ros_decoder(kind: str, text: str, *, where: str) -> Callable[[bytes], object]:
    """A function that decodes the CDR of a message of ROS 2.

    Args:
        kind: name of the message, such as ``sensor_msgs/msg/FluidPressure``.
        text: its definition, with those that it uses.
        where: file, for messages.

    Raises:
        MissingLibraryError: rosbags is not installed.
        ValueError: the definition cannot be read.
    """
    typesys = library("rosbags.typesys", "Messages of ROS need", where=where)
    package, _, name = kind.replace("/msg/", "/").rpartition("/")
    full = f"{package}/msg/{name}"
    with undecodable():
        types = typesys.get_types_from_msg(text, full)
        store = typesys.get_typestore(typesys.Stores.EMPTY)
        store.register(types)
        store.get_msgdef(full)
        used = {kind for definition in types.values() for kind in re.findall(r"'(\w+/msg/\w+)'", repr(definition[1]))}
        missing = any(kind not in store.fielddefs for kind in used)
    if missing:
        store = typesys.get_typestore(typesys.Stores.LATEST)
        store.register(types)
    return lambda data: store.deserialize_cdr(data, full)


def protobuf_decoder(name: str, schema: bytes, *, where: str) -> Callable[[bytes], LoggedMessage]:
    """A function that decodes a message of protobuf.

    Raises:
        MissingLibraryError: mcap-protobuf-support is not installed.
        ValueError: the schema cannot be read.
    """
    from mcap.records import Schema

    module = library("mcap_protobuf.decoder", "Messages of protobuf need", where=where)
    with undecodable():
        decode = module.DecoderFactory().decoder_for(
            "protobuf", Schema(id=1, name=name, encoding="protobuf", data=schema)
        )

    def message(data: bytes) -> LoggedMessage:
        numbers: dict[str, Number] = {}
        stamps: list[int] = []
        skipped: list[str] = []
        _proto_numbers(decode(data), "", numbers, stamps, skipped, 0)
        return LoggedMessage(numbers, stamps[0] if stamps else None, tuple(skipped))

    return message


def _proto_numbers(
    message: Any, before: str, numbers: dict[str, Number], stamps: list[int], skipped: list[str], depth: int
) -> None:
    for field in message.DESCRIPTOR.fields:
        name, value = f"{before}{field.name}", getattr(message, field.name)
        if field.message_type is not None and field.message_type.full_name == "google.protobuf.Timestamp":
            if not before and message.HasField(field.name):
                stamps.append(value.seconds * 10**9 + value.nanos)
        elif hasattr(value, "DESCRIPTOR"):
            if depth < _DEEPEST:
                _proto_numbers(value, f"{name}.", numbers, stamps, skipped, depth + 1)
        elif isinstance(value, bool | int | float):
            numbers[name] = value if isinstance(value, bool) else float(value)
        elif not isinstance(value, str | bytes) and len(value):
            skipped.append(name)


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
        with _bag_reader(highlevel, path) as reader:
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


def _bag_reader(highlevel: Any, path: Path) -> Any:
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
    with unreadable("a bag of ROS", where), _bag_reader(highlevel, path) as reader:
        return sorted(reader.topics)


BAGS = FileFormat(title="Bags of ROS", read=read_bag, options=("topic",), parts=topic_names)
