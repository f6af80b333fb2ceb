"""Calibration: gain, zero and skew with uncertainties, from readings and a reference.

`session` asks a person for each point and reads the sensors, `estimate` fits. What comes out is a
`mckibben.recordings.calibration.Calibration`, which `mckibben.recordings` keeps in files and applies to recordings.
"""

from mckibben._lazy import lazy_submodules

from .session import CalibrationSession as CalibrationSession
from .session import SimulatedPerson as SimulatedPerson
from .session import SimulatedSensors as SimulatedSensors

lazy_submodules(__name__)
