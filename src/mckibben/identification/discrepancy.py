"""How far a fitted model is wrong where it was not shown: discrepancy and noise, with the parameters of the model free.

With the derivatives J of a prediction m at a fit x, and a normal prior of the change dx of the parameters, uniform for most,

    y = m(x) + J dx + d + e,     d ~ N(0, s^2 C),     e ~ N(0, k^2 S)

A least squares fit bends the parameters so as to take up the discrepancy, and what it leaves looks like noise. So dx is
integrated out of the likelihood of the sizes k and s (restricted likelihood), and is estimated beside d. What a fit leaves
of its points says little of its errors elsewhere: neighbouring errors are alike, so that many points are not as many
independent ones, and the deviation of a prediction grows away from the points.

Of a law (`LawError`), d is smooth over contraction and pressure. Nothing is fitted anew, and nothing sampled: sizes of noise
and discrepancy and its two correlation lengths are averaged over a grid, by their likelihood and the priors of `sampler`.
Lengths along contraction and pressure differ, because one error of a set length is shared by all pressures at it, and
lengths are few. Errors that the points do not show, such as those of a prior or of a form that the measured lengths cannot
tell from another one, are in no interval.

Of records (`predict_records`), d is smooth along each record: shown samples say how wrong the model is at their hidden
neighbours. The sizes are those under which the shown values are the most probable. Near shown values the prediction follows
them; away from them the discrepancy falls to zero and the model is left. Where no discrepancy is in the data, the prediction
is that of the fit. The sizes count as known once they are found, so that deviations are a little too small where few values
are shown.
Sources: H. D. Patterson and R. Thompson, Biometrika 58(3), 1971 (restricted likelihood); C. E. Rasmussen and
C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, section 2.7 (explicit basis functions).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..estimation import UNDETERMINED
from ..recordings import ForceMap
from . import record_posterior, sampler
from .posterior import DISCREPANCY, UNKNOWN_SENSOR, Band, map_coordinates, rests_of
from .problem import FittedLaw, Problem
from .record_posterior import RecordProblem

LENGTHS = (0.15, 0.3, 0.6, 1.2)  # correlation lengths that are tried, of the ranges of contraction and pressure
NOISES = np.geomspace(0.1, 10.0, 9)  # factors of the noise
AMPLITUDES = np.geomspace(1e-3, 0.3, 10)  # of the discrepancy, of the largest tension
MOST = 300  # points that are compared; of more, evenly so many
LIGHTEST = 1e-3  # share of the largest weight below which a cell of the grid is left out
HALVINGS = 40  # of the bracket of a quantile, to a share of 1e-12
RECORD_VALUES = 600  # values of records that are compared; of more, evenly so many
RECORD_NOISES = 0.01, 30.0  # of the factor of an unknown noise
RECORD_KNOWN = 0.8, 1.25  # of that of a known one
LEAST_SIZE, MOST_SIZE = 1e-3, 5.0  # of the discrepancy, in scales of its prior; the least is as good as none


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


@dataclass(frozen=True)
class _Cell:
    weight: float
    lengths: np.ndarray
    noise: float
    amplitude: float
    errors: TrendErrors


@dataclass(frozen=True)
class LawError:
    """Errors of a fitted law by the points to which it was fitted.

    Attributes:
        points: that were compared.
        places: of them, contraction and pressure in their ranges (n, 2).
        scale: of the places.
        free: the parameters that the points determine, of all fitted ones, bool (p,).
        size: of the derivative by each of them (q,).
        noise: standard deviation of a tension that is multiplied by a factor [N].
        cells: what the points leave of the grid.
    """

    points: ForceMap
    places: np.ndarray
    scale: np.ndarray
    free: np.ndarray
    size: np.ndarray
    noise: float
    cells: tuple[_Cell, ...]

    @classmethod
    def of(cls, fit: FittedLaw) -> LawError:
        """Weigh the sizes of noise and discrepancy by the points of a fit."""
        problem = Problem(fit.law, tuple(fit.parameters), fit.known, fit.points)
        values = np.array([e.value for e in fit.parameters.values()])
        slopes = problem.functions()[1](values / problem.scale) / problem.scale
        rows = np.linspace(0, len(fit.points) - 1, min(MOST, len(fit.points))).round().astype(int)
        points, residual, slopes = fit.points.select(rows), -np.asarray(fit.error)[rows], slopes[rows]
        size = np.linalg.norm(slopes, axis=0)
        free = (size > 0.0) & ~np.isin(list(fit.parameters), fit.not_contained)
        trend, largest = slopes[:, free] / size[free], fit.points.largest
        places, scale = map_coordinates(points)
        noise = UNKNOWN_SENSOR * largest
        covariance, prior = noise**2 * np.eye(len(rows)), _prior(problem, values, size, free)
        cells = []
        for pair in itertools.product(LENGTHS, LENGTHS):
            lengths = np.array(pair)
            modes = sampler.ErrorModes.of(covariance, sampler.matern(places / lengths, places / lengths, 1.0))
            errors = TrendErrors.of(modes, residual, trend, prior)
            for factor, amplitude in itertools.product(NOISES, AMPLITUDES * largest):
                known = sampler.log_prior_of_size(np.log(amplitude), amplitude, DISCREPANCY * largest, np)
                known -= 0.5 * np.log(factor) ** 2  # as for a posterior without known sensors
                cells.append(_Cell(errors.score(factor, amplitude) + known, lengths, factor, amplitude, errors))
        most = max(cell.weight for cell in cells)
        weighed = [
            _Cell(float(np.exp(c.weight - most)), c.lengths, c.noise, c.amplitude, c.errors)
            for c in cells
            if c.weight > most + np.log(LIGHTEST)
        ]
        return cls(points, places, scale, free, size[free], noise, tuple(weighed))

    def half_width(
        self, length: np.ndarray, pressure: np.ndarray, slopes: np.ndarray, rest: float | None
    ) -> np.ndarray:
        """Half width of the 95 % interval around the law of a further reading (q,) [N].

        Args:
            length: of the fitted muscle, or of another one of which `rest` is the rest length (q,) [m].
            pressure: gauge (q,) [Pa].
            slopes: derivatives of the tension there by all fitted parameters (q, p).
            rest: rest length of the muscle [m]; of the fitted one, or the longest, where None.
        """
        at = ForceMap("", length, pressure, np.ones(len(length)), rest_length=rests_of(self.points, len(length), rest))
        places, trend = map_coordinates(at, self.scale)[0], slopes[:, self.free] / self.size
        means, deviations, onto = [], [], {}
        for cell in self.cells:
            key = tuple(cell.lengths)
            if key not in onto:
                near = sampler.matern(places / cell.lengths, self.places / cell.lengths, 1.0)
                onto = {key: near @ cell.errors.modes.directions.T}
            mean, deviation = cell.errors.predict(onto[key], trend, cell.noise, cell.amplitude)
            means.append(mean)
            deviations.append(np.hypot(deviation, cell.noise * self.noise))
        weights = np.array([cell.weight for cell in self.cells])
        return _mixture_half_width(weights / weights.sum(), np.array(means), np.array(deviations))


def _prior(problem: Problem, values: np.ndarray, size: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Information of the parameters' priors, and that times the change to their means, in units of the trend."""
    information, pull = np.zeros(len(values)), np.zeros(len(values))
    for i, mean, deviation in problem.priors:
        if free[i]:
            information[i] = (size[i] * deviation) ** -2.0
            pull[i] = information[i] * size[i] * (mean - values[i])
    return np.diag(information[free]), pull[free]


def _mixture_half_width(weights: np.ndarray, means: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Half width (q,) around zero that holds 95 % of a mixture of normal variables, means and deviations (m, q)."""
    from scipy.special import ndtr

    low = np.zeros(means.shape[1])
    high = (np.abs(means) + 10.0 * deviations).max(axis=0)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        inside = ndtr((middle - means) / deviations) - ndtr((-middle - means) / deviations)
        enough = weights @ inside > 0.95
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return np.asarray(high)


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
    rows = record_posterior.seen_rows(problem, noise, RECORD_VALUES)
    places = record_posterior.record_places(problem.group)
    span = float(np.ptp(problem.measured[rows]))
    size = noise or record_posterior.NOISE * span
    fitted = problem.model.predict(problem.start)
    trend = orthonormal_trend(problem.model.slopes(problem.start), rows, UNDETERMINED)
    shown = _Shown(
        places[rows], size**2 * np.eye(len(rows)), problem.measured[rows] - fitted[rows], trend[rows], noise is not None
    )
    best, none = max(
        (shown.likeliest(length, record_posterior.DISCREPANCY * span) for length in record_posterior.LENGTHS),
        key=lambda both: both[0].score,
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

        low, high = (float(end) for end in np.log(RECORD_KNOWN if self.noise_known else RECORD_NOISES))
        least, most = (float(end) for end in np.log([LEAST_SIZE * amplitude, MOST_SIZE * amplitude]))
        starts = [np.array([n, s]) for n in np.linspace(low, high, 5)[1:-1] for s in np.linspace(least, most, 5)[1:]]
        bounds = [(low, high), (least, most)]
        found = optimize.minimize(cost, min(starts, key=cost), bounds=bounds, method="L-BFGS-B")
        alone = optimize.minimize_scalar(lambda log: cost(np.array([log, least])), bounds=(low, high), method="bounded")
        noise, size = np.exp(found.x)
        return _Sizes(length, float(noise), float(size), -float(found.fun)), -float(alone.fun)
