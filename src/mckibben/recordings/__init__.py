"""What happened: measured and simulated data, and how they are read and stored."""

from .force_map import ForceMap
from .tables import read_force_map

__all__ = ["ForceMap", "read_force_map"]
