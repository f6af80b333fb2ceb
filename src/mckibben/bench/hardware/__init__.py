"""The parts of a test machine, one file each: computer, converters and sensors, motor and encoder, frame."""

from .analogue import AnalogOut, Converter, Sensor
from .computer import Computer
from .frame import Frame, FrameState, StandState, TestStand
from .motor import Encoder, Motor, MotorPowers

__all__ = [
    "AnalogOut",
    "Computer",
    "Converter",
    "Encoder",
    "Frame",
    "FrameState",
    "Motor",
    "MotorPowers",
    "Sensor",
    "StandState",
    "TestStand",
]
