"""Parameters from measured data: problem, fit, uncertainty, model choice. A file is enough; no bench is needed."""

from .fit import Estimate, Fit, evaluate, fit, fit_all, rank

__all__ = ["Estimate", "Fit", "evaluate", "fit", "fit_all", "rank"]
