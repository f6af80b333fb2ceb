"""A machine behind a microcontroller on a serial line, and one that is simulated there.

`messages` documents the protocol, ``firmware/`` is the device's side of it in C.
"""

from .link import SerialHardware, SerialStatistics

__all__ = ["SerialHardware", "SerialStatistics"]
