"""Machines behind a microcontroller on a serial line, real and simulated.

`messages` documents the protocol, ``firmware/`` is the device's side of it in C.
"""

from typing import TYPE_CHECKING

from mckibben._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from . import device as device
    from . import microcontroller as microcontroller
    from .device import About as About
    from .link import SerialHardware as SerialHardware
    from .microcontroller import in_thread as in_thread

lazy_submodules(__name__)
lazy_names(__name__)
