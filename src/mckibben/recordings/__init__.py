"""What happened: measured and simulated data, and how they are read and stored."""

from .convert import convert
from .force_map import ForceMap
from .live_log import LiveLog
from .read_record import read_record
from .recording import Channel, Recording
from .store import read_recording
from .tables import read_force_map

__all__ = [
    "Channel",
    "ForceMap",
    "LiveLog",
    "Recording",
    "convert",
    "read_force_map",
    "read_record",
    "read_recording",
]
