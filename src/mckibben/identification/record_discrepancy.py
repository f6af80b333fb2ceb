"""Prediction of records by a fitted model and by its discrepancy, which is smooth along the record.

The errors of a model that is slightly wrong are alike from sample to sample, so that shown samples say how wrong it is at
their hidden neighbours. The likelihood is that of `sampler`, as for the posterior of records, with the prediction linearised
at the fit and its parameters free (`trend_errors`): the sizes of noise and discrepancy and the correlation length are those
under which the shown values are the most probable. Near shown values the prediction follows them; away from them the
discrepancy falls to zero and the model is left. Where no discrepancy is in the data, the prediction is that of the fit.
Range: the sizes count as known once they are found, so that deviations are a little too small where few values are shown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import sampler
from .posterior import Band
from .record_posterior import DISCREPANCY, LENGTHS, NOISE, record_places, seen_rows
from .trend_errors import TrendErrors, orthonormal_trend
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
    rows = seen_rows(problem, noise, MOST)
    places = record_places(problem.group)
    span = float(np.ptp(problem.measured[rows]))
    size = noise or NOISE * span
    fitted = problem.model.predict(problem.start)
    trend = orthonormal_trend(problem.model.slopes(problem.start), rows, UNDETERMINED)
    shown = _Shown(
        places[rows], size**2 * np.eye(len(rows)), problem.measured[rows] - fitted[rows], trend[rows], noise is not None
    )
    best, none = max(
        (shown.likeliest(length, DISCREPANCY * span) for length in LENGTHS), key=lambda both: both[0].score
    )
    errors = shown.errors(best.length)
    onto = sampler.matern(places, places[rows], best.length) @ errors.modes.directions.T
    added, deviation = errors.predict(onto, trend, best.noise, best.amplitude)
    return RecordPrediction(
        predicted=fitted + added,
        deviation=deviation,
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


class _Shown(NamedTuple):
    """Shown values: places, covariance of their sensors, residuals, and trend."""

    places: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray
    trend: np.ndarray
    noise_known: bool

    def errors(self, length: float) -> TrendErrors:
        """Independent errors for a correlation length."""
        modes = sampler.ErrorModes.of(self.covariance, sampler.matern(self.places, self.places, length))
        return TrendErrors.of(modes, self.residual, self.trend)

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
