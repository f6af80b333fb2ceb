"""Parts of a test machine, one file each: computer, converters and sensors, motor and encoder, frame."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_names, lazy_submodules
from .analogue import AnalogOut, Converter, Sensor
from .computer import Computer
from .frame import Frame, FrameState, StandState, TestStand
from .motor import Encoder, Motor, MotorPowers

if TYPE_CHECKING:
    from . import connect as connect
    from . import serial_line as serial_line
    from .connect import HardwareRequest as HardwareRequest
    from .connect import connected as connected
    from .interface import Hardware as Hardware

__all__ = [
    "AnalogOut",
    "Computer",
    "Converter",
    "Encoder",
    "Frame",
    "FrameState",
    "Hardware",
    "HardwareRequest",
    "Motor",
    "MotorPowers",
    "Sensor",
    "StandState",
    "TestStand",
    "connected",
]

lazy_submodules(__name__)
lazy_names(
    __name__,
    {
        "connect": ["HardwareRequest", "connected"],
        "interface": ["Hardware"],
    },
)
