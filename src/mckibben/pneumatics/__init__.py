"""Pneumatics: gas, orifices, valves, tubes, volumes, and circuits of them."""

from .._lazy import lazy_submodules
from .gas import AIR, Gas

__all__ = ["AIR", "Gas"]

lazy_submodules(__name__)
