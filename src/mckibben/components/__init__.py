"""Interfaces that the rooms above share, and nothing that computes physics.

JAX is used through `mckibben._jax`, which switches it to float64 and loads it when it is first needed.
"""

from typing import TYPE_CHECKING

from .._lazy import lazy_submodules
from .element import Advanced, ForceElement, Hysteresis, MemoryElement
from .flow import Environment, FlowElement, GasState, TwoPort
from .module import AbstractVar, Module, Scalar, derivative, field, jit_arrays

if TYPE_CHECKING:
    from . import paths as paths

__all__ = [
    "AbstractVar",
    "Advanced",
    "Environment",
    "FlowElement",
    "ForceElement",
    "GasState",
    "Hysteresis",
    "MemoryElement",
    "Module",
    "Scalar",
    "TwoPort",
    "derivative",
    "field",
    "jit_arrays",
]

lazy_submodules(__name__)
