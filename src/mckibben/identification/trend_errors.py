"""Errors of a prediction whose parameters are free: linearised at a fit, with the discrepancy and the noise of `sampler`.

With the derivatives J of a prediction m at a fit x, and a normal prior of the change dx of the parameters, uniform for most,

    y = m(x) + J dx + d + e,     d ~ N(0, s^2 C),     e ~ N(0, k^2 S)

A least squares fit bends the parameters so as to take up the discrepancy, and what it leaves looks like noise. So dx is
integrated out of the likelihood of the sizes k and s (restricted likelihood), and is estimated beside d.
Sources: H. D. Patterson and R. Thompson, Biometrika 58(3), 1971 (restricted likelihood); C. E. Rasmussen and
C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, section 2.7 (explicit basis functions).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from . import sampler


class SolvedTrend(NamedTuple):
    """The most probable change of the parameters for some sizes of noise and discrepancy.

    Attributes:
        change: of the parameters (q,).
        information: on it (q, q).
        left: residuals without it, as independent errors (n,).
        precision: inverse variance of these errors (n,).
    """

    change: np.ndarray
    information: np.ndarray
    left: np.ndarray
    precision: np.ndarray


class TrendErrors(NamedTuple):
    """Residuals and derivatives as independent errors.

    Attributes:
        modes: noise and discrepancy as independent errors.
        residual: measurement less prediction (n,).
        trend: derivatives of the prediction (n, q).
        information: of the prior of the change of the parameters (q, q); zero where it is uniform.
        pull: information times the mean of that prior (q,).
    """

    modes: sampler.ErrorModes
    residual: np.ndarray
    trend: np.ndarray
    information: np.ndarray
    pull: np.ndarray

    @classmethod
    def of(
        cls,
        modes: sampler.ErrorModes,
        residual: np.ndarray,
        trend: np.ndarray,
        prior: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> TrendErrors:
        """Of measured residuals (n,) and derivatives (n, q), with the information and pull of a prior, if there is one."""
        count = trend.shape[1]
        information, pull = prior or (np.zeros((count, count)), np.zeros(count))
        return cls(modes, modes.directions @ residual, modes.directions @ trend, information, pull)

    def solve(self, noise: float, amplitude: float) -> SolvedTrend:
        """Find the change of the parameters for a factor k of the noise and an amplitude s of the discrepancy."""
        precision = 1.0 / (noise**2 + amplitude**2 * self.modes.values)
        weighted = self.trend.T * precision
        information = weighted @ self.trend + self.information
        change = np.linalg.solve(information, weighted @ self.residual + self.pull)
        return SolvedTrend(change, information, self.residual - self.trend @ change, precision)

    def score(self, noise: float, amplitude: float) -> float:
        """Logarithm of the restricted likelihood of k and s, but for a constant."""
        solved = self.solve(noise, amplitude)
        independent = float(sampler.marginal(self.modes.values, solved.left, noise, amplitude))
        prior = solved.change @ (0.5 * self.information @ solved.change - self.pull)
        return independent - float(prior) - 0.5 * float(np.linalg.slogdet(solved.information)[1])

    def predict(
        self, onto: np.ndarray, trend: np.ndarray, noise: float, amplitude: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of what parameters and discrepancy add to a prediction at places (m,).

        Args:
            onto: correlation of the discrepancy at the places with the modes (m, n).
            trend: derivatives of the prediction there (m, q).
            noise: factor k of the noise.
            amplitude: s of the discrepancy.
        """
        solved = self.solve(noise, amplitude)
        precision = sampler.Precision(solved.precision[None], None, None)
        mean, deviation = sampler.discrepancy_given(precision, onto, solved.left[None], np.array([amplitude]))
        # what the discrepancy does not follow of a change of the parameters
        rest = trend - amplitude**2 * (onto * solved.precision) @ self.trend
        by_parameters = (rest * np.linalg.solve(solved.information, rest.T).T).sum(axis=1)
        return trend @ solved.change + mean[0], np.sqrt(deviation[0] ** 2 + np.maximum(by_parameters, 0.0))


def orthonormal_trend(slopes: np.ndarray, rows: np.ndarray, weakest: float) -> np.ndarray:
    """What the parameters can do to a prediction (n, q): combinations of derivatives, orthonormal at some samples.

    Args:
        slopes: derivatives at all samples (n, p).
        rows: the samples at which they are orthonormal.
        weakest: share of the strongest combination below which one is left out.
    """
    size = np.linalg.norm(slopes[rows], axis=0)
    scaled = slopes[:, size > 0.0] / size[size > 0.0]
    _, strength, directions = np.linalg.svd(scaled[rows], full_matrices=False)
    kept = strength > weakest * strength[0]
    made: np.ndarray = scaled @ (directions[kept].T / strength[kept])
    return made
