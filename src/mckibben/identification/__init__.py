"""Parameters from measured data: problem, fit, uncertainty, model choice. A file is enough; no bench is needed."""

from .circuit_fit import CircuitFit, fit_circuit
from .fit import Fit, evaluate, fit, fit_all, rank
from .trial import Trial
from .uncertainty import Estimate

__all__ = ["CircuitFit", "Estimate", "Fit", "Trial", "evaluate", "fit", "fit_all", "fit_circuit", "rank"]
