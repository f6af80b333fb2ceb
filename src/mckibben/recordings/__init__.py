"""Recordings: measured and simulated data, their formats and storage."""

from .._lazy import lazy_submodules
from .files import FileReading, convert, read, read_any, read_record, read_recording, understand, write
from .force_map import ForceMap, read_force_map
from .live_log import LiveLog
from .recording import Channel, Note, Recording

__all__ = [
    "Channel",
    "FileReading",
    "ForceMap",
    "LiveLog",
    "Note",
    "Recording",
    "convert",
    "read",
    "read_any",
    "read_force_map",
    "read_record",
    "read_recording",
    "understand",
    "write",
]

lazy_submodules(__name__)
