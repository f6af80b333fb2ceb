"""Prediction of points that a fit did not see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..recordings import ForceMap
from .problem import Problem, Solution, solve

# More distinct values than this are gathered into `BINS` groups of equal size.
MOST_GROUPS, BINS = 30, 10


@dataclass(frozen=True)
class CrossValidation:
    """Errors of the taut points, each predicted by a fit without its group [N]; NaN if a fold could not be fitted."""

    scheme: str
    groups: int
    failed: int
    error: np.ndarray

    @property
    def rmse(self) -> float:
        """Root mean square prediction error [N]; infinite if a fold failed."""
        return float(np.sqrt(np.mean(self.error**2))) if not self.failed else float("inf")

    @property
    def max_error(self) -> float:
        """Largest prediction error [N]; infinite if a fold failed."""
        return float(np.abs(self.error).max()) if not self.failed else float("inf")


def groups(points: ForceMap, scheme: str) -> np.ndarray:
    """Group number of each point: by ``pressure``, ``length``, ``rest_length`` or ``block``.

    A block is a patch of neighbouring lengths and pressures, so that leaving it out asks for interpolation over a gap.
    """
    if scheme == "block":
        by_length = _binned(points.length if points.rest_length is None else points.contraction, 3)
        by_pressure = _binned(points.pressure, 3)
        return np.unique(by_length * 3 + by_pressure, return_inverse=True)[1]
    if scheme == "rest_length":
        values = np.zeros(len(points)) if points.rest_length is None else points.rest_length
    else:
        values = getattr(points, scheme)
    distinct, index = np.unique(np.round(values, 9), return_inverse=True)
    return _binned(values, BINS) if len(distinct) > MOST_GROUPS else index


def cross_validate(
    problem: Problem, full: Solution, scheme: str, *, progress: Callable[[], None] | None = None
) -> CrossValidation | None:
    """Leave each group out once, refit, and predict it; None if the table has only one group.

    A fold starts from the full solution, which saves the search and does not move the optimum.
    """
    index, taut = groups(problem.points, scheme), problem.points.taut
    members = np.unique(index[taut])
    if len(members) < 2:
        return None
    error = np.full(len(problem.points), np.nan)
    failed = 0
    for group in members:
        out = index == group
        solution = predict_rest(problem, ~out, near=full)
        failed += solution is None
        if solution is not None:
            error[out] = solution.tension[out] - problem.points.tension[out]
        if progress:
            progress()
    return CrossValidation(scheme=scheme, groups=len(members), failed=failed, error=error[taut])


def predict_rest(problem: Problem, train: np.ndarray, *, near: Solution | None = None) -> Solution | None:
    """Fit to the points in `train` only; None if these are too few or the fit did not converge.

    With a solution `near`, the fit starts there: it decides how long the search takes, not where the optimum lies.
    """
    if int((train & problem.points.taut).sum()) < len(problem.free):
        return None
    start = [] if near is None else [near.scaled]
    solution = solve(problem, train=train, near=start, search=near is None or not near.converged)
    return solution if solution.converged else None


def _binned(values: np.ndarray, bins: int) -> np.ndarray:
    """Group numbers of equal-sized bins; equal values share a bin."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, bins + 1)[1:-1])
    return np.unique(np.searchsorted(edges, values, side="left"), return_inverse=True)[1]
