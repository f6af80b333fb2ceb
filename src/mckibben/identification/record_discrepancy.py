"""Prediction of records by a fitted model and by its discrepancy, which is smooth along the record.

The errors of a model that is slightly wrong are alike from sample to sample, so that shown samples say how wrong it is at
their hidden neighbours. The likelihood is that of `sampler`, as for the posterior of records, but with the prediction
linearised at the fit and its parameters free: with the derivatives J of the prediction m at the fit x,

    y = m(x) + J dx + d + e,     d ~ N(0, s^2 C),     e ~ N(0, k^2 S)

A least squares fit bends the parameters so as to take up the discrepancy, and what it leaves looks like noise. So dx is
integrated out before the sizes k and s and the correlation length are chosen as those under which the shown values are the
most probable (restricted maximum likelihood), and is estimated beside d. Near shown values the prediction follows them; away
from them d falls to zero and the model is left. Where no discrepancy is in the data, s is nearly zero and the prediction is
that of the fit.
Range: the sizes count as known once they are found, so that deviations are a little too small where few values are shown.
Sources: H. D. Patterson and R. Thompson, Biometrika 58(3), 1971 (restricted likelihood); C. E. Rasmussen and
C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, section 2.7 (explicit basis functions).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError
from . import sampler
from .posterior import Band
from .record_posterior import DISCREPANCY, LENGTHS, NOISE, evenly, record_places
from .uncertainty import UNDETERMINED

if TYPE_CHECKING:
    from .record_posterior import RecordProblem

MOST = 600  # values that are compared; of more, evenly so many
NOISES = 0.01, 30.0  # of the factor of an unknown noise
KNOWN = 0.8, 1.25  # of that of a known one
LEAST, MOST_SIZE = 1e-3, 5.0  # of the discrepancy, in scales of its prior; the least is as good as none


class RecordPrediction(NamedTuple):
    """Values of records by a fitted model and its discrepancy, given the values that the fit saw.

    Attributes:
        predicted: of all samples (n,) [unit].
        deviation: standard deviation of the true value (n,) [unit].
        discrepancy: standard deviation of the discrepancy away from the shown samples [unit].
        length: its correlation length, of the length of a record.
        noise: standard deviation of a measured value [unit].
        evidence: logarithm of how much more probable the shown values are with a discrepancy than without.
        unit: of the values.
    """

    predicted: np.ndarray
    deviation: np.ndarray
    discrepancy: float
    length: float
    noise: float
    evidence: float
    unit: str

    def band(self, confidence: float = 0.95, *, measured: bool = False) -> Band:
        """Band of the values of all records (n,) [unit].

        Args:
            confidence: probability that a value lies within, at each by itself.
            measured: with the noise of the sensor, as a further reading would show it.
        """
        from scipy.special import ndtri

        half = float(ndtri(0.5 + 0.5 * confidence)) * np.hypot(self.deviation, self.noise if measured else 0.0)
        return Band(self.predicted - half, self.predicted, self.predicted + half)


def predict_records(problem: RecordProblem, *, noise: float | None = None) -> RecordPrediction:
    """Predict all values of records by a fitted model and a discrepancy that is smooth along each record.

    Args:
        problem: what was fitted, at its fit.
        noise: standard deviation of the sensor [unit]; found from the data where left out.
    """
    if noise is not None and not (np.isfinite(noise) and noise > 0.0):
        raise InputError("noise", noise, f"must be more than 0 {problem.unit}")
    seen = np.flatnonzero(problem.used)
    rows = seen[evenly(len(seen), min(MOST, len(seen)))]
    places = record_places(problem.group)
    span = float(np.ptp(problem.measured[rows]))
    size = noise or NOISE * span
    fitted, trend = problem.model.predict(problem.start), _trend(problem.model.slopes(problem.start), rows)
    shown = _Shown(
        places[rows], size**2 * np.eye(len(rows)), problem.measured[rows] - fitted[rows], trend[rows], noise is not None
    )
    best, none = max(
        (shown.likeliest(length, DISCREPANCY * span) for length in LENGTHS), key=lambda both: both[0].score
    )
    errors = shown.errors(best.length)
    left, information, change = errors.without_trend(best.noise, best.amplitude)
    precision = sampler.Precision.of(errors.modes.values, np.array([best.noise]), np.array([best.amplitude]))
    onto = sampler.matern(places, places[rows], best.length) @ errors.modes.directions.T
    mean, deviation = sampler.discrepancy_given(precision, onto, left[None], np.array([best.amplitude]))
    # what the discrepancy does not follow of a change of the parameters
    open_trend = trend - best.amplitude**2 * (onto * precision.inverse[0]) @ errors.trend
    by_parameters = (open_trend * np.linalg.solve(information, open_trend.T).T).sum(axis=1)
    return RecordPrediction(
        predicted=fitted + trend @ change + mean[0],
        deviation=np.sqrt(deviation[0] ** 2 + np.maximum(by_parameters, 0.0)),
        discrepancy=best.amplitude,
        length=best.length,
        noise=size * best.noise,
        evidence=best.score - none,
        unit=problem.unit,
    )


class _Sizes(NamedTuple):
    """Sizes of noise (a factor) and discrepancy at one correlation length, and the logarithm of their likelihood."""

    length: float
    noise: float
    amplitude: float
    score: float


class _Errors(NamedTuple):
    """Residuals and trend of shown values, as independent errors for one correlation length."""

    modes: sampler.ErrorModes
    residual: np.ndarray
    trend: np.ndarray

    def without_trend(self, noise: float, amplitude: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals less the trend, information on its coefficients (q, q), and its coefficients (q,), for some sizes."""
        weighted = self.trend.T / (noise**2 + amplitude**2 * self.modes.values)
        information = weighted @ self.trend
        change = np.linalg.solve(information, weighted @ self.residual)
        return self.residual - self.trend @ change, information, change

    def score(self, noise: float, amplitude: float) -> float:
        """Logarithm of the restricted likelihood of some sizes, but for a constant."""
        left, information, _ = self.without_trend(noise, amplitude)
        independent = float(sampler.marginal(self.modes.values, left, noise, amplitude))
        return independent - 0.5 * float(np.linalg.slogdet(information)[1])


class _Shown(NamedTuple):
    """Shown values: places, covariance of their sensors, residuals, and trend."""

    places: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    trend: np.ndarray
    noise_known: bool

    def errors(self, length: float) -> _Errors:
        """Independent errors for a correlation length."""
        modes = sampler.ErrorModes.of(self.covariance, sampler.matern(self.places, self.places, length))
        return _Errors(modes, modes.directions @ self.residual, modes.directions @ self.trend)

    def likeliest(self, length: float, amplitude: float) -> tuple[_Sizes, float]:
        """The most probable sizes at a correlation length, and the score without a discrepancy.

        Args:
            length: of the length of a record.
            amplitude: scale of the discrepancy [unit].
        """
        from scipy import optimize

        errors = self.errors(length)

        def cost(logs: np.ndarray) -> float:
            return -errors.score(*np.exp(logs))

        low, high = (float(end) for end in np.log(KNOWN if self.noise_known else NOISES))
        least, most = (float(end) for end in np.log([LEAST * amplitude, MOST_SIZE * amplitude]))
        starts = [np.array([n, s]) for n in np.linspace(low, high, 5)[1:-1] for s in np.linspace(least, most, 5)[1:]]
        bounds = [(low, high), (least, most)]
        found = optimize.minimize(cost, min(starts, key=cost), bounds=bounds, method="L-BFGS-B")
        alone = optimize.minimize_scalar(lambda log: cost(np.array([log, least])), bounds=(low, high), method="bounded")
        noise, size = np.exp(found.x)
        return _Sizes(length, float(noise), float(size), -float(found.fun)), -float(alone.fun)


def _trend(slopes: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """What the parameters can do to the prediction (n, q): combinations of derivatives, orthonormal at some samples."""
    size = np.linalg.norm(slopes[rows], axis=0)
    scaled = slopes[:, size > 0.0] / size[size > 0.0]
    _, strength, directions = np.linalg.svd(scaled[rows], full_matrices=False)
    kept = strength > UNDETERMINED * strength[0]
    made: np.ndarray = scaled @ (directions[kept].T / strength[kept])
    return made
