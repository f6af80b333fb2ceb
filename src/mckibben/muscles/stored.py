"""Energy stored in bladder and braid, by motion and filling: a law has one potential.

U(L, P') = E(L) + P' V - G(L, P'),   dU = F dL + P' dV,   E' the tension without gas, G the gas energy
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._jax import Scalar
from ..components.evaluation import evaluated
from .law import TensionLaw

# Nodes of the quadrature of a law's elastic tension over a piece of length; its kinks are parabolas, met within 1e-8.
NODES, PIECES = 8, 256


def stored_change(law: TensionLaw, start: tuple[float, float], end: tuple[float, float]) -> float:
    """Gain of the energy stored in bladder and braid [J] between two states: braid length [m] and gauge pressure [Pa]."""
    (l0, p0), (l1, p1) = start, end
    elastic = float(_elastic(law, np.linspace(l0, l1, PIECES + 1))[-1])
    return elastic + float(_of_gas(law, l1, p1) - _of_gas(law, l0, p0))


def stored_along(law: TensionLaw, length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Energy stored in bladder and braid (n,) [J], less that of the first state.

    Between the edges of a thousand pieces of length the elastic part is interpolated, within a millionth of its range.

    Args:
        law: law of the muscle.
        length: length of the braid (n,) [m].
        pressure: gauge (n,) [Pa].
    """
    low, high = float(np.min(length)), float(np.max(length))
    edges = np.linspace(low, high if high > low else low + 1e-9, 4 * PIECES + 1)
    energy = np.interp(length, edges, _elastic(law, edges)) + np.asarray(_of_gas(law, length, pressure))
    return np.asarray(energy - energy[0])


def _elastic(law: TensionLaw, edges: np.ndarray) -> np.ndarray:
    """Integral of the tension without gas from the first edge to every edge [J]."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    half = 0.5 * np.diff(edges)
    at = 0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * nodes
    pieces = np.sum(half[:, None] * weights * np.asarray(_without_gas(law, at)), axis=1)
    return np.concatenate([[0.0], np.cumsum(pieces)])


@evaluated
def _without_gas(law: TensionLaw, length: Scalar) -> Any:
    return law.passive_tension(length)


@evaluated
def _of_gas(law: TensionLaw, length: Scalar, pressure: Scalar) -> Any:
    return pressure * law.braid_volume(length, pressure) - law.braid_energy(length, pressure)
