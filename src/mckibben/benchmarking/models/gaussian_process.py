"""Gaussian process: a linear and a squared exponential kernel with a length for each input, by marginal likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..records import BenchmarkRecord
from .columns import LAGS, Points, RecordColumns

TUNED, MOST, ROWS = 500, 1500, 4000  # points to choose the kernel by, to predict from, and predicted at once
STARTS = ((0.0, 0.0), (1.0, -2.0))  # logarithm of the lengths, and of the variance of the linear kernel
BOUNDS = (-6.0, 8.0)
JITTER = 1e-8


class GaussianProcess:
    """Gaussian process with noise; records in time give earlier inputs and the time as further inputs.

    Source: C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, chapter 5.
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose the kernel by the marginal likelihood of the training samples, and condition on them."""
        from scipy import optimize

        self.columns = RecordColumns.of(train, most=MOST, lags=LAGS)
        points = Points.of(self.columns, train, most=MOST)
        some = np.random.default_rng(0).permutation(len(points.inputs))[:TUNED]
        inputs, targets = points.inputs[some], points.targets[some]
        count = inputs.shape[1]
        solutions = [
            optimize.minimize(
                likelihood,
                np.r_[np.full(count, length), 0.0, linear, -4.0],
                args=(inputs, targets),
                jac=True,
                method="L-BFGS-B",
                bounds=[BOUNDS] * count + [(-8.0, 8.0)] * 2 + [(-14.0, 2.0)],
                options={"maxiter": 80},
            )
            for length, linear in STARTS
        ]
        self.chosen = min(solutions, key=lambda s: float(s.fun)).x
        self.inputs = points.inputs
        covariance = kernel(self.chosen, self.inputs, self.inputs)
        covariance[np.diag_indices_from(covariance)] += np.exp(self.chosen[-1]) + JITTER
        self.weights = np.linalg.solve(covariance, points.targets)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Mean of the process at the samples of a record."""
        inputs = self.columns.inputs(record)
        blocks = [inputs[i : i + ROWS] for i in range(0, len(inputs), ROWS)]
        return self.columns.predicted(
            np.concatenate([kernel(self.chosen, block, self.inputs) @ self.weights for block in blocks])
        )


def kernel(chosen: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Covariance without noise (n, m) of inputs (n, d) and (m, d), by logarithms of d lengths, two variances and noise."""
    covariance: np.ndarray = _radial(chosen, a, b) + np.exp(chosen[-2]) * (1.0 + a @ b.T)
    return covariance


def _radial(chosen: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    u, v = a / np.exp(chosen[:-3]), b / np.exp(chosen[:-3])
    squares = np.maximum((u**2).sum(axis=1)[:, None] + (v**2).sum(axis=1) - 2.0 * u @ v.T, 0.0)
    return np.asarray(np.exp(chosen[-3] - 0.5 * squares))


def likelihood(chosen: np.ndarray, inputs: np.ndarray, targets: np.ndarray) -> tuple[float, np.ndarray]:
    """Negative logarithm of the marginal likelihood, but for a constant, and its derivative."""
    from scipy import linalg

    radial = _radial(chosen, inputs, inputs)
    linear = np.exp(chosen[-2]) * (1.0 + inputs @ inputs.T)
    noise = np.exp(chosen[-1])
    covariance = radial + linear + (noise + JITTER) * np.eye(len(inputs))
    try:
        factor = linalg.cho_factor(covariance, lower=True)
    except linalg.LinAlgError:
        return 1e10, np.zeros_like(chosen)
    weights, count = linalg.cho_solve(factor, targets), targets.shape[1]
    value = 0.5 * float(np.sum(targets * weights)) + count * float(np.log(np.diag(factor[0])).sum())
    slope = 0.5 * (count * linalg.cho_solve(factor, np.eye(len(inputs))) - weights @ weights.T)
    shaped = slope * radial
    scaled = inputs / np.exp(chosen[:-3])
    # Sum of shaped_ij (x_i - x_j)^2 for each input, without a matrix for each.
    lengths = 2.0 * (shaped.sum(axis=1) @ scaled**2 - np.sum(scaled * (shaped @ scaled), axis=0))
    return value, np.r_[lengths, shaped.sum(), np.sum(slope * linear), noise * np.trace(slope)]
