"""Bounded least squares from many starting points, with derivatives by automatic differentiation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .problem import Problem

SEED = 1
CANDIDATES, POLISHED, AGREE = 192, 12, 3
# Two solutions are the same when their sums of squares agree to this share.
SAME = 1e-6


@dataclass(frozen=True)
class Solution:
    """The best solution of a multi-start search."""

    start: np.ndarray
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
    problem: Problem,
    *,
    train: np.ndarray | None = None,
    near: Sequence[np.ndarray] = (),
    search: bool = True,
    seed: int = SEED,
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
    force, slopes = problem.functions()
    weight = np.ones(len(problem.points)) if train is None else np.asarray(train, float)
    low, high = problem.bounds
    inside = 1e-9 * np.maximum(1.0, np.abs(low)), 1e-9 * np.maximum(1.0, np.abs(high))
    queue = [np.clip(start, low + inside[0], high - inside[1]) for start in near]
    descend = _Descent(problem, force, slopes, weight)
    if search:
        draws = np.clip(problem.starts(CANDIDATES, seed), low + inside[0], high - inside[1])
        cost = [float(np.sum(descend.misfit(d, unilateral=False) ** 2)) for d in draws]
        queue += list(draws[np.argsort(cost)[:POLISHED]])
    found = []
    for start in queue:
        found.append(descend(start))
        found[-1].start = start
        if _agreeing(found) >= AGREE:
            break
    best = min(found, key=lambda f: (f.status <= 0, f.cost))
    pull = np.maximum(force(best.x), 0.0)
    return Solution(
        start=best.start,
        scaled=best.x,
        tension=pull,
        jacobian=np.where(pull > 0.0, 1.0, 0.0)[:, None] * slopes(best.x),
        converged=bool(best.status > 0 and np.isfinite(best.x).all() and best.cost < 1e6),
        message=str(best.message).strip("` ."),
        starts=len(found),
        agreeing=_agreeing(found),
    )


def _agreeing(found: Sequence[Any]) -> int:
    costs = [f.cost if f.status > 0 else np.inf for f in found]
    return sum(c <= min(costs) * (1.0 + SAME) + 1e-30 for c in costs)


class _Descent:
    """Two descents from one start: with the signed force of the braid, whose derivative never vanishes, then as measured.

    The second sees what the sensor sees, max(F, 0), so that a law is not blamed for how slack it would be.
    """

    def __init__(self, problem: Problem, force: Any, slopes: Any, weight: np.ndarray) -> None:
        self.problem, self.force, self.slopes, self.weight = problem, force, slopes, weight
        self.size = max(problem.points.largest, 1e-9)

    def misfit(self, scaled: np.ndarray, *, unilateral: bool) -> np.ndarray:
        force = self.force(scaled)
        taut = self.problem.points.taut
        # A slack point tells nothing about a signed force but that it is not positive.
        pull = np.maximum(force, 0.0) if unilateral else np.where(taut, force, np.maximum(force, 0.0))
        return np.nan_to_num(
            self.weight * (pull - self.problem.points.tension) / self.size, nan=1e6, posinf=1e6, neginf=-1e6
        )

    def derivative(self, scaled: np.ndarray, *, unilateral: bool) -> np.ndarray:
        seen = self.force(scaled) > 0.0
        if not unilateral:
            seen = seen | self.problem.points.taut
        return np.nan_to_num(
            (self.weight * seen)[:, None] * self.slopes(scaled) / self.size, nan=0.0, posinf=0.0, neginf=0.0
        )

    def __call__(self, start: np.ndarray) -> Any:
        from scipy import optimize

        for unilateral in (False, True):
            found = optimize.least_squares(
                self.misfit,
                start,
                jac=self.derivative,
                bounds=self.problem.bounds,
                x_scale="jac",
                max_nfev=400,
                ftol=1e-12,
                xtol=1e-12,
                gtol=1e-12,
                kwargs={"unilateral": unilateral},
            )
            start = found.x
            if np.all(self.force(start)[self.weight > 0] > 0.0):
                break  # nothing is slack, and the second descent would be the first again
        return found
