"""Data acquisition cards of National Instruments as `interface.Hardware`; they need the extra ``daq``.

Importing this loads nothing of NI: `nidaqmx` is loaded when a card is opened.
"""

from .hardware import DaqHardware as DaqHardware
from .hardware import OverrunError as OverrunError
from .simulated import SimulatedDevice as SimulatedDevice
from .wiring import Analog as Analog
from .wiring import CardWiring as CardWiring
from .wiring import Counter as Counter
from .wiring import Drive as Drive
from .wiring import ShutOff as ShutOff
from .wiring import wiring as wiring
