"""Data acquisition cards of National Instruments as `interface.Hardware`; they need the extra ``daq``.

Importing this loads nothing of NI: `nidaqmx` is loaded when a card is opened.
"""

from .hardware import DaqHardware, OverrunError
from .simulated import SimulatedDevice
from .wiring import Analog, CardWiring, Counter, Drive, ShutOff, wiring

__all__ = [
    "Analog",
    "Counter",
    "DaqHardware",
    "Drive",
    "OverrunError",
    "ShutOff",
    "SimulatedDevice",
    "CardWiring",
    "wiring",
]
