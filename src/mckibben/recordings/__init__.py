"""What happened: measured and simulated data, and how they are read and stored."""

from .force_map import ForceMap
from .read_record import read_record
from .recording import Channel, Recording
from .store import read_recording
from .tables import read_force_map

__all__ = ["Channel", "ForceMap", "Recording", "read_force_map", "read_record", "read_recording"]
