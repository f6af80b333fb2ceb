"""The test machine of a laboratory's screen: chosen, prepared, run, operated by hand and stopped; `machine.Bench` is it."""

from .machine import Bench
from .manual import HardwareSpec

__all__ = ["Bench", "HardwareSpec"]
