"""Recordings: measured and simulated data, their formats and storage."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules
from .files import FileReading, convert, read, read_any, read_record, read_recording, understand, write
from .force_map import ForceMap, read_force_map
from .live_log import LiveLog
from .recording import Channel, Note, Recording

if TYPE_CHECKING:
    from .columns import COLUMNS as COLUMNS
    from .columns import TIMES as TIMES
    from .formats import FileFormat as FileFormat
    from .formats import ForeignColumn as ForeignColumn
    from .formats import ForeignTable as ForeignTable
    from .recalibration import saturated as saturated

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
        "formats": ["FileFormat", "ForeignColumn", "ForeignTable"],
        "recalibration": ["saturated"],
    },
)
