"""Calibration: gain, zero and skew with uncertainties, from readings and a reference.

`session` asks a person for each point and reads the sensors, `estimate` fits. What comes out is a
`mckibben.recordings.calibration.Calibration`, which `mckibben.recordings` keeps in files and applies to recordings.
"""

from mckibben._lazy import lazy_submodules

from .estimate import CalibrationLine as CalibrationLine
from .estimate import Point as Point
from .estimate import Reference as Reference
from .estimate import dead_weights as dead_weights
from .estimate import encoder as encoder
from .estimate import pressure_reference as pressure_reference
from .estimate import skew as skew
from .estimate import zero as zero
from .session import CalibrationOutcome as CalibrationOutcome
from .session import CalibrationSession as CalibrationSession
from .session import HardwareReadings as HardwareReadings
from .session import SimulatedPerson as SimulatedPerson
from .session import SimulatedSensors as SimulatedSensors

lazy_submodules(__name__)
