"""Parameters from measured data: problem, fit, uncertainty, model choice. A file is enough; no bench is needed."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from .._lazy import lazy_submodules
from .fit import SCHEMES, Fit, bound_of, degenerate_words, evaluate, fit_all, rank
from .ranking import Ranking, fit, load_table
from .uncertainty import Estimate

if TYPE_CHECKING:
    from . import circuit_fit as circuit_fit
    from . import constraints as constraints
    from . import hysteresis_fit as hysteresis_fit
    from . import trial as trial
    from .circuit_fit import CircuitFit, fit_circuit
    from .trial import Trial

__all__ = [
    "SCHEMES",
    "bound_of",
    "degenerate_words",
    "CircuitFit",
    "Estimate",
    "Fit",
    "Ranking",
    "Trial",
    "evaluate",
    "fit",
    "fit_all",
    "fit_circuit",
    "load_table",
    "rank",
]
_MODULES = {
    "CircuitFit": "circuit_fit",
    "Trial": "trial",
    "fit_circuit": "circuit_fit",
}  # a fit of a law needs no circuit


def __getattr__(name: str) -> object:
    """Load the fit of circuits when it is first used."""
    if name in _MODULES:
        return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


lazy_submodules(__name__)
