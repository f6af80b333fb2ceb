"""Pneumatics: gas, orifices, valves, tubes, volumes, and circuits of them."""

from .gas import AIR, Gas

__all__ = ["AIR", "Gas"]
