"""Interfaces that the rooms above share, and nothing that computes physics.

Importing this package switches JAX to float64 once for the whole package: an energy balance to 1e-10 has no meaning
in float32, and no other place may set it.
"""

import jax

jax.config.update("jax_enable_x64", True)

from .derivative import derivative  # noqa: E402
from .element import Advanced, ForceElement, Hysteresis, MemoryElement  # noqa: E402
from .environment import Environment  # noqa: E402
from .module import AbstractVar, Module, Scalar, field, jit_arrays  # noqa: E402

__all__ = [
    "AbstractVar", "Advanced", "Environment", "ForceElement", "Hysteresis", "MemoryElement", "Module", "Scalar", "field",
    "derivative", "jit_arrays",
]  # fmt: skip
