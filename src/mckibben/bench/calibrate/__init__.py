"""Calibration: gain, zero and skew with uncertainties, from readings and a reference, stored in a file.

`session` asks a person for each point and reads the sensors, `estimate` fits, `file` keeps; `recordings.calibration` is what
comes out and `recordings.recalibration` applies it to a recording.
"""

from ..._lazy import lazy_submodules
from .estimate import CalibrationLine, Point, Reference, dead_weights, encoder, pressure_reference, skew, zero
from .session import CalibrationSession, merged, read_calibration, write_calibration
from .sources import HardwareReadings, SimulatedSensors

__all__ = [
    "HardwareReadings",
    "CalibrationLine",
    "Point",
    "Reference",
    "CalibrationSession",
    "SimulatedSensors",
    "dead_weights",
    "encoder",
    "merged",
    "pressure_reference",
    "read_calibration",
    "skew",
    "write_calibration",
    "zero",
]

lazy_submodules(__name__)
