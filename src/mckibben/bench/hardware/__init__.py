"""Parts of a test machine: computer, converters and sensors, the stand with its motor, and the machine as a whole."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_names, lazy_submodules
from .computer import Computer
from .converters import AnalogOut, Converter, Sensor
from .stand import Encoder, Frame, FrameState, Motor, MotorPowers, StandState, TestStand

if TYPE_CHECKING:
    from .backends import HardwareRequest as HardwareRequest
    from .backends import connected as connected
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
        "backends": ["HardwareRequest", "connected"],
        "interface": ["Hardware"],
    },
)
