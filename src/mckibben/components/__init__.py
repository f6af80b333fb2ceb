"""Interfaces that the rooms above share, and nothing that computes physics.

JAX is used through `mckibben._jax`, which switches it to float64 and loads it when it is first needed.
"""

from typing import TYPE_CHECKING

from .._lazy import lazy_submodules
from .derivative import derivative
from .element import Advanced, ForceElement, Hysteresis, MemoryElement
from .environment import Environment
from .module import AbstractVar, Module, Scalar, field, jit_arrays

if TYPE_CHECKING:
    from . import paths as paths

__all__ = [
    "AbstractVar", "Advanced", "Environment", "ForceElement", "Hysteresis", "MemoryElement", "Module", "Scalar", "field",
    "derivative", "jit_arrays",
]  # fmt: skip

lazy_submodules(__name__)
