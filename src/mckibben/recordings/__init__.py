"""Recordings: measured and simulated data, their formats and storage."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .calibration import saturated as saturated
    from .columns import COLUMNS as COLUMNS
    from .columns import TIMES as TIMES
    from .files import FileReading as FileReading
    from .files import convert as convert
    from .files import read as read
    from .files import read_any as read_any
    from .files import read_record as read_record
    from .files import read_recording as read_recording
    from .files import understand as understand
    from .files import write as write
    from .force_map import ForceMap as ForceMap
    from .force_map import read_force_map as read_force_map
    from .formats import FileFormat as FileFormat
    from .formats import ForeignColumn as ForeignColumn
    from .formats import ForeignTable as ForeignTable
    from .live_log import LiveLog as LiveLog
    from .recording import Channel as Channel
    from .recording import Note as Note
    from .recording import Recording as Recording

__all__ = [
    "COLUMNS",
    "Channel",
    "FileFormat",
    "FileReading",
    "ForceMap",
    "ForeignColumn",
    "ForeignTable",
    "LiveLog",
    "Note",
    "Recording",
    "TIMES",
    "convert",
    "read",
    "read_any",
    "read_force_map",
    "read_record",
    "read_recording",
    "saturated",
    "understand",
    "write",
]

lazy_submodules(__name__)
lazy_names(
    __name__,
    {
        "columns": ["COLUMNS", "TIMES"],
        "files": [
            "FileReading",
            "convert",
            "read",
            "read_any",
            "read_record",
            "read_recording",
            "understand",
            "write",
        ],
        "force_map": ["ForceMap", "read_force_map"],
        "live_log": ["LiveLog"],
        "recording": ["Channel", "Note", "Recording"],
        "formats": ["FileFormat", "ForeignColumn", "ForeignTable"],
        "calibration": ["saturated"],
    },
)
