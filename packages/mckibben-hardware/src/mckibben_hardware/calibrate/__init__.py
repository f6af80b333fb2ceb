"""Calibration: gain, zero and skew with uncertainties, from readings and a reference.

`session` asks a person for each point and reads the sensors, `estimate` fits. What comes out is a
`mckibben.recordings.calibration.Calibration`, which `mckibben.recordings` keeps in files and applies to recordings.
"""

from mckibben._lazy import lazy_submodules

from .estimate import CalibrationLine, Point, Reference, dead_weights, encoder, pressure_reference, skew, zero
from .session import CalibrationOutcome, CalibrationSession, HardwareReadings, SimulatedPerson, SimulatedSensors

__all__ = [
    "HardwareReadings",
    "CalibrationLine",
    "CalibrationOutcome",
    "Point",
    "Reference",
    "CalibrationSession",
    "SimulatedPerson",
    "SimulatedSensors",
    "dead_weights",
    "encoder",
    "pressure_reference",
    "skew",
    "zero",
]

lazy_submodules(__name__)
