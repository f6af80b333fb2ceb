"""Uncertainty of parameters and quality of fits: intervals, correlations, Akaike's criterion, errors."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

# Columns of the derivative that agree to 1 in 10^3 in direction (correlation beyond 0.999) are reported as one.
INSEPARABLE = 0.999
# A direction in parameter space this much weaker than the strongest is not determined by float64 data at all.
UNDETERMINED = 1e-7
# Share of the others' change, at least which a parameter changes with them unseen, to be named among them: 1 in 10^3, as
# above. Rounding of the projector is far below its square: 2e-16 over UNDETERMINED.
INVOLVED = 1e-3
# A difference of AICc up to this does not tell two models apart (Burnham and Anderson, 2002).
INDIFFERENT = 2.0
# Of a 95 % interval of a Gaussian.
NORMAL_QUANTILE = 1.96


class Estimate(NamedTuple):
    """A fitted parameter with its 95 % interval [unit]."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors [scaled], correlation matrix, and warnings."""

    standard_error: np.ndarray
    correlation: np.ndarray
    quantile: float
    warnings: tuple[str, ...]


def uncertainty(
    jacobian: np.ndarray, residual: np.ndarray, names: tuple[str, ...], confidence: float = 0.95
) -> Uncertainty:
    """Linearised intervals of a least-squares solution.

    Args:
        jacobian: derivative of the prediction to each parameter, (n, p); any scaling.
        residual: prediction less measurement, (n,).
        names: names of the parameters, for the warnings.
        confidence: confidence of the two-sided interval.

    Returns:
        Student's t quantile for n - p degrees of freedom; standard errors are infinite for parameters in an undetermined
        direction. Residuals are taken as independent, so that systematic misfit makes the intervals too narrow.
    """
    from scipy.special import stdtrit

    n, p = jacobian.shape
    degrees = max(n - p, 1)
    size, strength, directions = determined(jacobian)
    dead = size == 0.0
    variance = float(residual @ residual) / degrees
    inverse = (directions.T / strength**2) @ directions
    error = np.sqrt(variance * np.diag(inverse)) / np.where(dead, 1.0, size)
    spread = np.sqrt(np.diag(inverse))
    correlation = inverse / np.where(spread > 0, spread, 1.0)[:, None] / np.where(spread > 0, spread, 1.0)[None]
    warnings = [f"the data do not contain {name}" for name, d in zip(names, dead, strict=True) if d]
    for group in open_groups(directions):
        error[list(group)] = np.inf
        if len(group) > 1:
            warnings.append(f"the data cannot tell {_listed([names[i] for i in group])} apart")
    for i in range(p):
        for j in range(i):
            if abs(correlation[i, j]) > INSEPARABLE and np.isfinite(error[[i, j]]).all():
                warnings.append(
                    f"the data can hardly tell {names[j]} and {names[i]} apart (correlation {correlation[i, j]:+.4f})"
                )
    return Uncertainty(error, correlation, float(stdtrit(degrees, 0.5 + confidence / 2.0)), tuple(warnings))


def determined(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions in parameter space, each parameter in units of its effect, that data determine.

    Args:
        jacobian: derivative of the prediction to each parameter, (n, p); any scaling.

    Returns:
        Norm of each column (p,), strength of each direction (k,) and the directions, orthonormal (k, p).
    """
    size = np.linalg.norm(jacobian, axis=0)
    _, strength, directions = np.linalg.svd(jacobian / np.where(size == 0.0, 1.0, size), full_matrices=False)
    strong = strength >= UNDETERMINED * max(strength[0], 1e-300)
    return size, strength[strong], directions[strong]


def open_groups(directions: np.ndarray) -> tuple[tuple[int, ...], ...]:
    """Groups of parameters whose changes cancel within the group; one alone changes nothing.

    They follow from the projector onto what the directions leave open. A basis of that space, of which a singular value
    decomposition returns any, mixes independent groups and may pass by a parameter.

    Args:
        directions: orthonormal, all that the data determine (k, p).

    Returns:
        Indices of each group, in ascending order.
    """
    projector = np.eye(directions.shape[1]) - directions.T @ directions
    involved = np.diag(projector) > INVOLVED**2
    joined = (np.abs(projector) > INVOLVED**2) & involved & involved[:, None]
    for _ in projector:  # a chain of p parameters is closed after p steps
        joined = joined @ joined
    return tuple(dict.fromkeys(tuple(np.flatnonzero(row).tolist()) for row in joined if row.any()))


def posterior_uncertainty(covariance: np.ndarray, names: tuple[str, ...]) -> Uncertainty:
    """Intervals of parameters with priors, from their covariance at the most probable values.

    Args:
        covariance: of the parameters, (p, p); any scaling.
        names: names of the parameters, for the warnings.
    """
    error = np.sqrt(np.diag(covariance))
    size = np.where(error > 0.0, error, 1.0)
    correlation = covariance / size[:, None] / size
    warnings = [
        f"the data can hardly tell {names[j]} and {names[i]} apart (correlation {correlation[i, j]:+.4f})"
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > INSEPARABLE
    ]
    return Uncertainty(error, correlation, NORMAL_QUANTILE, tuple(warnings))


def widening(residuals: Sequence[np.ndarray]) -> float:
    """Factor on standard errors for residuals that follow one another: sqrt((1 + r)/(1 - r)), r at a lag of one sample."""
    top = sum(float(r[1:] @ r[:-1]) for r in residuals)
    bottom = sum(float(r @ r) for r in residuals)
    r = min(max(top / bottom, 0.0), 0.9999) if bottom > 0.0 else 0.0
    return float(np.sqrt((1.0 + r) / (1.0 - r)))


def _listed(names: list[str]) -> str:
    return ", ".join(names[:-1]) + " and " + names[-1]


def akaike(error: np.ndarray, parameters: float, *, resolution: float = 1e-15) -> float:
    """Akaike's criterion with the correction for small samples (AICc) of errors (n,); infinite where they are too few.

    The noise level counts as a parameter, and belongs to `parameters`. Root mean square errors below `resolution` (in the
    unit of the errors) count as that: what is left of an exact fit is rounding, whose size says nothing.
    """
    n, k = error.size, parameters
    least = resolution**2
    variance = max(float(np.mean(error**2)), least) if n else least
    return n * float(np.log(variance)) + 2.0 * k * n / (n - k - 1.0) if n > k + 1 else float("inf")


class PartialFit(abc.ABC):
    """A fit to some samples of a record, and its prediction of all; `train`, bool (n,), is what it saw."""

    train: np.ndarray

    @property
    @abc.abstractmethod
    def error(self) -> np.ndarray:
        """Error of every sample (n,)."""

    def rmse(self, *, seen: bool) -> float:
        """Root mean square error of the samples that the fit saw, or of those that it did not; NaN if there are none."""
        some = self.error[self.train == seen]
        return float(np.sqrt(np.mean(some**2))) if some.size else float("nan")

    def max_error(self, *, seen: bool) -> float:
        """Largest of those errors; NaN if there are none."""
        some = self.error[self.train == seen]
        return float(np.abs(some).max()) if some.size else float("nan")
