"""Parts of a test machine: computer, converters and sensors, the stand with its motor, and the machine as a whole."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_names, lazy_submodules
from .computer import Computer as Computer
from .converters import AnalogOut as AnalogOut
from .converters import Converter as Converter
from .converters import Sensor as Sensor
from .stand import Encoder as Encoder
from .stand import Frame as Frame
from .stand import FrameState as FrameState
from .stand import Motor as Motor
from .stand import StandState as StandState
from .stand import TestStand as TestStand

if TYPE_CHECKING:
    from .backends import HardwareRequest as HardwareRequest
    from .backends import connected as connected
    from .interface import Hardware as Hardware


lazy_submodules(__name__)
lazy_names(__name__)
