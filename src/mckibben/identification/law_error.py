"""How far a fitted law is wrong at a length and pressure, as far as its points tell.

What a law leaves of the points to which it was fitted says little of its errors elsewhere: its parameters bend to the
points, and neighbouring errors are alike, so that many points are not as many independent ones. As for a posterior
(`sampler`), the measured tension is the law's, plus a discrepancy that is smooth over contraction and pressure, plus noise;
the law is linearised at its fit with its parameters free, as far as they have no prior (`trend_errors`). So the deviation of
a predicted tension grows away from the points, by the discrepancy and by what the parameters do there.
Nothing is fitted anew, and nothing sampled: sizes of noise and discrepancy and its two correlation lengths are averaged over
a grid, by their restricted likelihood and the priors of `sampler`. Lengths along contraction and pressure differ, because
one error of a set length is shared by all pressures at it, and lengths are few.
Range: errors that the points do not show, such as those of a prior or of a form that the measured lengths cannot tell from
another one, are in no interval.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..recordings import ForceMap
from . import sampler
from .posterior import DISCREPANCY, UNKNOWN_SENSOR, map_coordinates, rests_of
from .problem import Problem
from .trend_errors import TrendErrors

if TYPE_CHECKING:
    from .fit import Fit

LENGTHS = (0.15, 0.3, 0.6, 1.2)  # correlation lengths that are tried, of the ranges of contraction and pressure
NOISES = np.geomspace(0.1, 10.0, 9)  # factors of the noise
AMPLITUDES = np.geomspace(1e-3, 0.3, 10)  # of the discrepancy, of the largest tension
MOST = 300  # points that are compared; of more, evenly so many
LIGHTEST = 1e-3  # share of the largest weight below which a cell of the grid is left out
HALVINGS = 40  # of the bracket of a quantile, to a share of 1e-12


@dataclass(frozen=True)
class _Cell:
    """A cell of the grid: its weight, correlation lengths, sizes and errors."""

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
    def of(cls, fit: Fit) -> LawError:
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
    for name, (mean, deviation) in problem.priors.items():
        i = problem.free.index(name)
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
