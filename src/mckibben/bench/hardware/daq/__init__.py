"""Data acquisition cards of National Instruments, as a machine at the hardware border; needs the extra ``daq``.

Importing this loads nothing of NI: `nidaqmx` is loaded when a card is opened.
"""

from .complaints import OverrunError
from .hardware import DaqHardware, DaqStatistics
from .simulated import SimulatedDevice
from .terminals import Analog, Counter, Drive, ShutOff
from .wiring import CardWiring, wiring

__all__ = [
    "Analog",
    "Counter",
    "DaqHardware",
    "Drive",
    "OverrunError",
    "ShutOff",
    "SimulatedDevice",
    "DaqStatistics",
    "CardWiring",
    "wiring",
]
