"""The Pareto front: what nothing else beats in every respect."""

from __future__ import annotations

import numpy as np


def dominated(costs: np.ndarray) -> np.ndarray:
    """Which rows another row beats: it is no worse in any column and better in one (n,).

    Rows with a number that is not finite are dominated; equal rows do not dominate each other.

    Args:
        costs: less is better (n, m).
    """
    finite = np.isfinite(costs).all(axis=1)
    found = ~finite
    for i in np.flatnonzero(finite):
        others = costs[finite]
        found[i] = bool(np.any((others <= costs[i]).all(axis=1) & (others < costs[i]).any(axis=1)))
    return found
