"""The test machine of a laboratory's screen: chosen, prepared, run, operated by hand and stopped; `machine.Bench` is it."""

from .by_hand import Real
from .machine import Bench

__all__ = ["Bench", "Real"]
