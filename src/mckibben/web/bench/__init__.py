"""The test machine of the laboratory's screen: selection, runs, manual operation and stops, in `machine.Bench`."""

from .machine import Bench
from .manual import HardwareSpec

__all__ = ["Bench", "HardwareSpec"]
