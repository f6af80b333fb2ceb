"""Rates of a system's modes, and the method and step that they permit.

Conservation does not show an unstable step that a saturation hides: the largest eigenvalue of the Jacobian does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .._jax import Tree, flatten_util, jax
from ..components.module import flatten
from ..components.system import System, Value
from .native import call_in_lanes
from .step import rate_of

# The classical Runge-Kutta method damps a real mode of rate r while r h < 2.785.
RK4_LIMIT = 2.78


def fastest_rate(system: System, states: Tree, memory: Tree, inputs: Mapping[str, Value]) -> float:
    """Largest eigenvalue magnitude over several states, and the system's own bound for steeper zones [1/s].

    Args:
        system: whose state equation is examined.
        states: a tree whose leaves have a leading axis, one entry per state.
        memory: the same for the memory.
        inputs: the same for the inputs.
    """
    if flatten(states)[0]:
        matrices, bounds = call_in_lanes(_examined, (system,), (states, memory, inputs))
    else:
        bounds = call_in_lanes(_bound, (system,), (states, memory, inputs))
        matrices = np.zeros((len(bounds), 0, 0))
    sound = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(bounds)
    if not sound.any():
        return float("inf")
    fastest = float(np.abs(np.linalg.eigvals(matrices[sound])).max()) if matrices.shape[1] else 0.0
    return max(fastest, float(bounds[sound].max()))


def _examined(system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> tuple[Tree, Tree]:
    """Jacobian of the state equation, and the system's own bound, at one state."""
    flat, back = flatten_util.ravel_pytree(state)
    rates = jax.jacfwd(lambda v: flatten_util.ravel_pytree(rate_of(system, back(v), memory, inputs))[0])(flat)
    return rates, system.max_rate_bound(state, memory, inputs)


def _bound(system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Any:
    """The bound of a system without states."""
    return system.max_rate_bound(state, memory, inputs)
