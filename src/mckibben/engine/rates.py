"""Rates of a system's modes, and the method and step that they permit.

Conservation does not show an unstable step that a saturation hides: the largest eigenvalue of the Jacobian does.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._jax import flatten_util, jax, jit
from ..components.system import System
from .step import rate_of

# The classical Runge-Kutta method damps a real mode of rate r while r h < 2.785.
RK4_LIMIT = 2.78


def fastest_rate(system: System, states: Any, memory: Any, inputs: Any) -> float:
    """Largest eigenvalue magnitude over several states, and the system's own bound for steeper zones [1/s].

    Args:
        system: whose state equation is examined.
        states: a tree whose leaves have a leading axis, one entry per state.
        memory: the same for the memory.
        inputs: the same for the inputs.
    """
    matrices, bounds = (np.asarray(x) for x in _examined(system, states, memory, inputs))
    sound = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(bounds)
    if not sound.any():
        return float("inf")
    fastest = float(np.abs(np.linalg.eigvals(matrices[sound])).max()) if matrices.shape[1] else 0.0
    return max(fastest, float(bounds[sound].max()))


@jit
def _examined(system: System, states: Any, memory: Any, inputs: Any) -> tuple[Any, Any]:
    """Jacobians of the state equation, and the system's own bounds, at each of several states."""

    def one(state: Any, z: Any, u: Any) -> Any:
        flat, back = flatten_util.ravel_pytree(state)
        return jax.jacfwd(lambda v: flatten_util.ravel_pytree(rate_of(system, back(v), z, u))[0])(
            flat
        ), system.max_rate_bound(state, z, u)

    return jax.vmap(one)(states, memory, inputs)
