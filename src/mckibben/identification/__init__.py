"""Parameters from measured data: problem, fit, uncertainty, model choice. A file is enough; no bench is needed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules
from ..estimation import Estimate as Estimate
from .fit import SCHEMES as SCHEMES
from .fit import Fit as Fit
from .fit import bound_of as bound_of
from .fit import checked_length_error as checked_length_error
from .fit import degenerate_words as degenerate_words
from .fit import evaluate as evaluate
from .fit import fit_all as fit_all
from .fit import rank as rank
from .posterior import MapSensors as MapSensors
from .posterior import Posterior as Posterior
from .posterior import read_posterior as read_posterior
from .problem import LengthError as LengthError
from .ranking import Ranking as Ranking
from .ranking import fit as fit
from .ranking import load_table as load_table

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

lazy_submodules(__name__)
lazy_names(__name__)
