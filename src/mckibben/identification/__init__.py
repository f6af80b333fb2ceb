"""Parameters from measured data: problem, fit, uncertainty, model choice. A file is enough; no bench is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules
from ..estimation import Estimate
from .fit import (
    SCHEMES,
    Fit,
    bound_of,
    checked_length_error,
    degenerate_words,
    evaluate,
    fit_all,
    rank,
)
from .posterior import MapSensors, Posterior, read_posterior
from .problem import LengthError
from .ranking import Ranking, fit, load_table

if TYPE_CHECKING:
    from . import circuit_fit as circuit_fit
    from . import constraints as constraints
    from . import hysteresis_fit as hysteresis_fit
    from . import next_points as next_points
    from . import path_record as path_record
    from . import record_posterior as record_posterior
    from . import shared_hysteresis as shared_hysteresis
    from . import trial as trial
    from .circuit_fit import CircuitFit as CircuitFit
    from .circuit_fit import fit_circuit as fit_circuit
    from .constraints import Constraint as Constraint
    from .constraints import fit_constraints as fit_constraints
    from .shared_hysteresis import SharedHysteresis as SharedHysteresis
    from .shared_hysteresis import braid_length as braid_length
    from .shared_hysteresis import braid_path as braid_path
    from .shared_hysteresis import fit_shared_hysteresis as fit_shared_hysteresis
    from .shared_hysteresis import resistance as resistance
    from .trial import Trial as Trial

__all__ = [
    "CircuitFit",
    "Constraint",
    "Estimate",
    "Fit",
    "MapSensors",
    "Posterior",
    "LengthError",
    "Ranking",
    "SCHEMES",
    "SharedHysteresis",
    "Trial",
    "bound_of",
    "braid_length",
    "braid_path",
    "checked_length_error",
    "degenerate_words",
    "evaluate",
    "fit",
    "fit_all",
    "fit_circuit",
    "fit_constraints",
    "fit_shared_hysteresis",
    "load_table",
    "rank",
    "read_posterior",
    "resistance",
]

lazy_submodules(__name__)
lazy_names(
    __name__,
    {
        "circuit_fit": ["CircuitFit", "fit_circuit"],
        "constraints": ["Constraint", "fit_constraints"],
        "shared_hysteresis": ["SharedHysteresis", "braid_length", "braid_path", "fit_shared_hysteresis", "resistance"],
        "trial": ["Trial"],
    },
)
