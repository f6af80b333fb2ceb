"""Linear least squares with intervals, for the numbers that analyses read off straight lines and planes.

Intervals hold for independent errors of one size: two-sided, from Student's t with n - p degrees of freedom.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError


class Interval(NamedTuple):
    """A number with the ends of its confidence interval, all in one unit."""

    value: float
    low: float
    high: float


class LinearFit(NamedTuple):
    """Coefficients (p,), their covariance (p, p), root mean square of the residual, and the t quantile."""

    values: np.ndarray
    covariance: np.ndarray
    rms: float
    quantile: float

    def interval(self, value: float, gradient: np.ndarray) -> Interval:
        """Interval of a function of the coefficients from its value and its gradient (p,), to first order."""
        half = self.quantile * float(np.sqrt(max(gradient @ self.covariance @ gradient, 0.0)))
        return Interval(float(value), float(value) - half, float(value) + half)

    def coefficient(self, index: int) -> Interval:
        """Estimate one coefficient with its interval."""
        return self.interval(float(self.values[index]), np.eye(len(self.values))[index])


def t_quantile(degrees: int, confidence: float) -> float:
    """Student's t beyond which the two-sided rest lies [1]."""
    from scipy.special import stdtrit

    if not 0.0 < confidence < 1.0:
        raise InputError("confidence", confidence, "must be above 0 and below 1")
    return float(stdtrit(degrees, 0.5 + 0.5 * confidence))


def linear_fit(matrix: np.ndarray, target: np.ndarray, *, subject: str, confidence: float = 0.95) -> LinearFit:
    """Least squares of matrix @ values = target.

    Args:
        matrix: (n, p), columns of any scale.
        target: (n,).
        subject: the points, for error messages.
        confidence: confidence of the two-sided intervals.

    Raises:
        InputError: fewer points than p + 1, or points that do not tell the coefficients apart.
    """
    n, p = matrix.shape
    if n <= p:
        raise InputError(subject, None, f"must be {p + 1} or more, got {n}")
    if not (np.isfinite(matrix).all() and np.isfinite(target).all()):
        raise InputError(subject, None, "must be finite numbers")
    size = np.linalg.norm(matrix, axis=0)
    u, strength, directions = np.linalg.svd(matrix / np.where(size > 0.0, size, 1.0), full_matrices=False)
    if strength[-1] < 1e-9 * strength[0]:
        raise InputError(subject, None, f"do not vary enough to tell {p} numbers apart")
    half = directions.T / strength
    values = half @ (u.T @ target) / size
    residual = target - matrix @ values
    variance = float(residual @ residual) / (n - p)
    covariance = variance * (half @ half.T) / np.outer(size, size)
    return LinearFit(values, covariance, float(np.sqrt(np.mean(residual**2))), t_quantile(n - p, confidence))
