"""Bounded least squares from many starting points, with derivatives by automatic differentiation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .problem import Problem

SEED = 1
CANDIDATES, POLISHED, AGREE = 192, 12, 3
# Two solutions are the same when their sums of squares agree to this share.
SAME = 1e-6


@dataclass(frozen=True)
class Solution:
    """The best solution of a multi-start search."""

    scaled: np.ndarray
    tension: np.ndarray
    jacobian: np.ndarray
    converged: bool
    message: str
    starts: int
    agreeing: int

    def values(self, problem: Problem) -> dict[str, float]:
        """The free parameters [SI]."""
        return {n: float(v) for n, v in zip(problem.free, self.scaled * problem.scale, strict=True)}


def solve(
    problem: Problem, *, train: np.ndarray | None = None, near: Sequence[np.ndarray] = (), search: bool = True, seed: int = SEED
) -> Solution:
    """Fit a problem.

    Args:
        problem: what to fit.
        train: which points count, bool (n,); all where left out. The compiled function is shared by all such subsets.
        near: scaled starting points to try first.
        search: also search from starting points drawn over the usual ranges.
        seed: of that draw.

    Returns:
        The solution with the smallest sum of squares. It is marked converged only if a solver reached its tolerance.
    """
    from scipy.optimize import least_squares

    tension, slopes = problem.functions()
    weight = np.ones(len(problem.points)) if train is None else np.asarray(train, float)
    size = max(problem.points.largest, 1e-9)
    low, high = problem.bounds
    inside = 1e-9 * np.maximum(1.0, np.abs(low)), 1e-9 * np.maximum(1.0, np.abs(high))

    def residual(scaled: np.ndarray) -> np.ndarray:
        misfit = weight * (tension(scaled) - problem.points.tension) / size
        return np.nan_to_num(misfit, nan=1e6, posinf=1e6, neginf=-1e6)

    def derivative(scaled: np.ndarray) -> np.ndarray:
        return np.nan_to_num(weight[:, None] * slopes(scaled) / size, nan=0.0, posinf=0.0, neginf=0.0)

    queue = [np.clip(start, low + inside[0], high - inside[1]) for start in near]
    if search:
        draws = np.clip(problem.starts(CANDIDATES, seed), low + inside[0], high - inside[1])
        cost = [float(np.sum(residual(d) ** 2)) for d in draws]
        queue += list(draws[np.argsort(cost)[:POLISHED]])
    best, costs = None, []
    for start in queue:
        found = least_squares(residual, start, jac=derivative, bounds=(low, high), x_scale="jac", max_nfev=400, ftol=1e-12, xtol=1e-12, gtol=1e-12)
        costs.append(found.cost if found.status > 0 else np.inf)
        if best is None or (found.status > 0, -found.cost) > (best.status > 0, -best.cost):
            best = found
        if sum(c <= min(costs) * (1.0 + SAME) + 1e-30 for c in costs) >= AGREE:
            break
    assert best is not None
    finite = np.isfinite(best.x).all() and best.cost < 1e6
    return Solution(
        scaled=best.x,
        tension=tension(best.x),
        jacobian=slopes(best.x),
        converged=bool(best.status > 0 and finite),
        message=str(best.message).strip("` ."),
        starts=len(costs),
        agreeing=int(sum(c <= min(costs) * (1.0 + SAME) + 1e-30 for c in costs)),
    )
