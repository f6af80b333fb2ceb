"""Machines behind a microcontroller on a serial line, real and simulated.

`messages` documents the protocol, ``firmware/`` is the device's side of it in C.
"""

from typing import TYPE_CHECKING

from ...._lazy import lazy_submodules
from .link import SerialHardware, SerialStatistics

if TYPE_CHECKING:
    from . import device as device
    from . import microcontroller as microcontroller

__all__ = ["SerialHardware", "SerialStatistics"]

lazy_submodules(__name__)
