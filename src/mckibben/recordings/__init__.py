"""Recordings: measured and simulated data, their formats and storage."""

from .._lazy import lazy_submodules
from ._text_records import read_record
from .files import convert, read_any, read_recording, write
from .force_map import ForceMap, read_force_map
from .live_log import LiveLog
from .recording import Channel, Note, Recording

__all__ = [
    "Channel",
    "ForceMap",
    "LiveLog",
    "Note",
    "Recording",
    "convert",
    "read_any",
    "read_force_map",
    "read_record",
    "read_recording",
    "write",
]

lazy_submodules(__name__)
