"""The test machine of the web interface: selection, runs, manual operation and stops, in `machine.Bench`."""

from .machine import Bench
from .manual import HardwareSpec

__all__ = ["Bench", "HardwareSpec"]
