"""Interfaces that the rooms above share, and nothing that computes physics.

JAX is used through `mckibben._jax`, which switches it to float64 and loads it when it is first needed.
"""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules
from .derivative import derivative
from .element import Advanced, ForceElement, Hysteresis, MemoryElement
from .environment import Environment
from .module import AbstractVar, Module, Scalar, field, jit_arrays

if TYPE_CHECKING:
    from . import paths as paths
    from .flow import FlowElement as FlowElement
    from .flow import GasState as GasState
    from .flow import TwoPort as TwoPort

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
lazy_names(
    __name__,
    {
        "flow": ["FlowElement", "GasState", "TwoPort"],
    },
)
