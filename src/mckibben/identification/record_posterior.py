"""Posterior of parameters that were fitted to records: loops of friction with memory, and pressures of circuits.

The likelihood is that of `sampler`: measured values are the prediction, plus a discrepancy that is smooth along the record,
plus noise. Neighbouring errors of a model that is slightly wrong are alike, and the discrepancy takes them up, so that a
long record does not make intervals narrower than its model deserves. Parameters are uniform before the data in what the
fit searches: the logarithm of those that are positive by nature, others themselves, within `REACH` of the fitted values.
A run of a circuit is dear, so samples are drawn with the prediction linearised at the fit, then weighed by the likelihood of
their own predictions and drawn anew by these weights (D. B. Rubin, J. Am. Stat. Assoc. 82(398), 1987). Where too few of them
keep a weight, the prediction is too far from linear, and every step of the sampler makes a prediction of its own.
Range: of a long record evenly `MOST` values are used.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .._jax import Array
from ..answers import Table
from ..documents import JsonValue
from ..errors import ConvergenceError, InputError
from ..estimation import Parameters, bounds_of
from ..quantities import with_unit
from . import sampler
from .posterior import Band, ParameterSamples

MOST = 240  # values that are compared
LENGTHS = (0.01, 0.03, 0.1, 0.3)  # correlation lengths of the discrepancy that are tried, of the length of a record
DISCREPANCY, NOISE = 0.02, 2e-3  # prior scales, as shares of the range of the measured values
REACH = 5.0, 20.0  # of a parameter before the data: to either side in its logarithm, and in multiples of its size
PREDICTED = 100  # samples whose prediction is kept, for bands
LINEAR = 0.1  # share of the samples that must keep a weight, for the linearised prediction to do
CHAINS, WARM_UP, DRAWS = 2, 300, 1000


class RecordProblem(NamedTuple):
    """What was fitted to a record: parameters at their fitted values, their prediction, and the measured values.

    Attributes:
        parameters: by name.
        start: fitted values, scaled (p,).
        model: prediction of all values (n,) by scaled parameters, and its derivatives (n, p).
        measured: (n,) [SI].
        group: number of the record and channel of each value (n,).
        used: which values the fit saw, bool (n,).
        unit: of the values.
    """

    parameters: Parameters
    start: np.ndarray
    model: sampler.HostModel
    measured: np.ndarray
    group: np.ndarray
    used: np.ndarray
    unit: str


@dataclass(frozen=True, repr=False)
class RecordPosterior(ParameterSamples):
    """Samples of the parameters of a model that was fitted to records.

    Attributes:
        samples: values of each parameter [SI], (d,) each; the same row of all of them is one sample.
        units: of the parameters.
        noise: standard deviation of a measured value (d,) [unit].
        amplitude: standard deviation of the discrepancy (d,) [unit].
        measured: values of all records (n,) [unit].
        group: number of the record and channel of each value (n,).
        predicted: by the model, of samples evenly from all (e, n) [unit].
        discrepancy: its mean and standard deviation given the data, of the same samples (2, e, n) [unit].
        unit: of the values.
        length: correlation length of the discrepancy, of the length of a record.
        seed: of the samples.
        r_hat: largest ratio of the variances between and within the chains; 1 where they agree.
        effective: fewest independent samples of a parameter.
        divergences: count of the samples at which the sampler lost its path.
        worst: name of the parameter on which the chains agree least.
    """

    samples: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    noise: np.ndarray
    amplitude: np.ndarray
    measured: np.ndarray
    group: np.ndarray
    predicted: np.ndarray
    discrepancy: np.ndarray
    unit: str
    length: float
    seed: int
    r_hat: float
    effective: float
    divergences: int
    worst: str = ""

    def __repr__(self) -> str:
        size = f"{self.discrepancy_size:.3g} {self.unit}"
        return f"RecordPosterior({len(self)} samples of {len(self.samples)} parameters, discrepancy {size})"

    def tables(self, subject: str) -> list[Table]:
        """The parameters, with the size of the discrepancy and of the noise below.

        Args:
            subject: what has no parameter for the discrepancy, such as "the circuit".
        """
        size, noise = (with_unit(value, self.unit, 3) for value in (self.discrepancy_size, self.noise_size))
        said = f"What {subject} has no parameter for: {size}; noise of a reading: {noise}."
        return [self.table("posterior", said)]

    @property
    def discrepancy_size(self) -> float:
        """Median of the discrepancy's standard deviation [unit]."""
        return float(np.median(self.amplitude))

    @property
    def noise_size(self) -> float:
        """Median of the standard deviation of a measured value [unit]."""
        return float(np.median(self.noise))

    def unit_of(self, name: str) -> str:
        """Unit of a parameter."""
        return self.units[name]

    def band(self, confidence: float = 0.95, *, measured: bool = False) -> Band:
        """Band of the values of all records (n,) [unit].

        Args:
            confidence: share of the samples within the band, at each value by itself.
            measured: with the noise of the sensor, as a further reading would show it.
        """
        chance, (mean, deviation) = np.random.default_rng(self.seed), self.discrepancy
        drawn = self.predicted + mean + deviation * chance.standard_normal(mean.shape)
        if measured:
            noise = self.noise[evenly(len(self), len(drawn))]
            drawn = drawn + noise[:, None] * chance.standard_normal(mean.shape)
        tail = 0.5 - 0.5 * confidence
        return Band(*np.quantile(drawn, (tail, 0.5, 1.0 - tail), axis=0))

    def to_dict(self) -> dict[str, JsonValue]:
        """Samples, intervals and size of the discrepancy as plain values [SI], for JSON."""
        return {
            "intervals": self._plain_intervals(),
            "discrepancy": self.discrepancy_size,
            "noise": self.noise_size,
            "unit": self.unit,
            "samples": {n: v.tolist() for n, v in self.samples.items()},
            "noise_samples": self.noise.tolist(),
            "discrepancy_samples": self.amplitude.tolist(),
            "correlation_length": self.length,
            **self._plain_mixing(),
        }


def check_converged(converged: bool, subject: str, purpose: str = "to sample") -> None:
    """Refuse to go on from a fit that did not converge; raises `ConvergenceError`."""
    if not converged:
        raise ConvergenceError(f"{subject} did not converge, so there is nothing {purpose}.")


def seen_rows(problem: RecordProblem, noise: float | None, most: int) -> np.ndarray:
    """Indices of the values that the fit saw, evenly at most so many; refuses a noise that is none."""
    if noise is not None and not (np.isfinite(noise) and noise > 0.0):
        raise InputError("noise", noise, f"must be more than 0 {problem.unit}")
    seen = np.flatnonzero(problem.used)
    rows: np.ndarray = seen[evenly(len(seen), min(most, len(seen)))]
    return rows


def posterior_of_records(
    problem: RecordProblem, *, noise: float | None, draws: int, warm_up: int = WARM_UP, seed: int
) -> RecordPosterior:
    """Draw from the posterior of the parameters of a problem; see `LoopFit.posterior` for the arguments."""
    rows = seen_rows(problem, noise, MOST)
    places = record_places(problem.group)
    span = float(np.ptp(problem.measured[rows]))
    size, amplitude = noise or NOISE * span, DISCREPANCY * span
    covariance = size**2 * np.eye(len(rows))
    residual = problem.measured[rows] - problem.model.predict(problem.start)[rows]
    sizes = sampler.error_sizes(
        residual,
        places[rows],
        covariance,
        max(5.0 * amplitude, 1e-9 * span),
        noise_known=noise is not None,
        tried=LENGTHS,
    )
    smooth = sampler.matern(places[rows], places[rows], sizes.length)
    modes = sampler.ErrorModes.of(covariance, smooth)
    at, slopes = problem.model.predict(problem.start)[rows], problem.model.slopes(problem.start)[rows]
    errors = sizes.covariance(covariance, smooth, amplitude)
    logs = [p.search == "log" for p in problem.parameters.values()]
    reach = np.where(logs, REACH[0], REACH[1] * np.maximum(np.abs(problem.start), 1.0))
    low, high = bounds_of(problem.parameters)
    low, high = np.maximum(low, problem.start - reach), np.minimum(high, problem.start + reach)
    low, high = sampler.around(problem.start, slopes, errors, low, high)
    evidence = sampler.Evidence(
        model=_linear,
        inputs={"at": problem.start, "value": at, "slopes": slopes},
        measured=problem.measured[rows],
        modes=modes,
        slack_variance=np.zeros(0),
        low=low,
        high=high,
        start=problem.start,
        noise_known=noise is not None,
        amplitude=amplitude,
    )
    drawn = sampler.sample(evidence, draws=draws, chains=CHAINS, warm_up=warm_up, seed=seed)
    predicted = np.stack([problem.model.predict(x) for x in drawn.parameters])
    weights = _weights(evidence, drawn, predicted[:, rows])
    effective = float(1.0 / (weights**2).sum())
    if effective >= LINEAR * len(weights):
        kept = _resampled(weights, seed)
        drawn = drawn._replace(
            parameters=drawn.parameters[kept],
            noise=drawn.noise[kept],
            amplitude=drawn.amplitude[kept],
            effective=min(drawn.effective, effective),
        )
        predicted = predicted[kept]
    else:
        exact = sampler.HostModel(lambda x: problem.model.predict(x)[rows], lambda x: problem.model.slopes(x)[rows])
        model = sampler.host_model(len(rows), len(problem.start))
        evidence = replace(evidence, model=model, inputs={}, host=exact)
        drawn = sampler.sample(evidence, draws=draws, chains=CHAINS, warm_up=warm_up, seed=seed)
        predicted = np.stack([problem.model.predict(x) for x in drawn.parameters])
    some = evenly(len(drawn.noise), min(PREDICTED, len(drawn.noise)))
    predicted = predicted[some]
    onto = sampler.matern(places, places[rows], sizes.length) @ modes.directions.T
    error = (problem.measured[rows] - predicted[:, rows]) @ modes.directions.T
    precision = sampler.Precision.of(modes.values, drawn.noise[some], drawn.amplitude[some])
    return RecordPosterior(
        samples={n: p.value(x) for (n, p), x in zip(problem.parameters.items(), drawn.parameters.T, strict=True)},
        units={n: p.unit for n, p in problem.parameters.items()},
        noise=size * drawn.noise,
        amplitude=drawn.amplitude,
        measured=problem.measured,
        group=problem.group,
        predicted=predicted,
        discrepancy=np.stack(sampler.discrepancy_given(precision, onto, error, drawn.amplitude[some])),
        unit=problem.unit,
        length=sizes.length,
        seed=seed,
        r_hat=drawn.r_hat,
        effective=drawn.effective,
        divergences=drawn.divergences,
        worst=(*problem.parameters, "the noise")[drawn.worst],
    )


def _linear(x: Array, inputs: Any) -> Array:
    """Prediction by its value and derivatives at the fit."""
    predicted: Array = inputs["value"] + inputs["slopes"] @ (x - inputs["at"])
    return predicted


def _weights(evidence: sampler.Evidence, drawn: sampler.Draws, predicted: np.ndarray) -> np.ndarray:
    """Weights (d,) of samples that were drawn with the linearised prediction, by their own predictions (d, n)."""
    linear = evidence.inputs["value"] + (drawn.parameters - evidence.inputs["at"]) @ evidence.inputs["slopes"].T
    gain = np.empty(len(predicted))
    for i, (one, other) in enumerate(zip(predicted, linear, strict=True)):
        scores = [
            sampler.marginal(
                evidence.modes.values,
                evidence.modes.directions @ (evidence.measured - values),
                drawn.noise[i],
                drawn.amplitude[i],
            )
            for values in (one, other)
        ]
        gain[i] = scores[0] - scores[1]
    gain = np.nan_to_num(gain, nan=-np.inf)
    weights = np.exp(gain - gain.max())
    return np.asarray(weights / weights.sum())


def record_places(group: np.ndarray) -> np.ndarray:
    """Place of each value along its record from 0 to 1, and a coordinate by which records lie far from each other (n, 2)."""
    along = np.empty(len(group))
    for one in np.unique(group):
        members = group == one
        along[members] = np.linspace(0.0, 1.0, int(members.sum()))
    return np.stack([along, 1e3 * group], axis=1)


@functools.cache
def evenly(count: int, few: int) -> np.ndarray:
    """Places of a few of a count of values, evenly from all (few,)."""
    return np.linspace(0, count - 1, few).round().astype(int)


def _resampled(weights: np.ndarray, seed: int) -> np.ndarray:
    """Places of as many samples, each as often as its weight says, in their order."""
    steps = (np.arange(len(weights)) + np.random.default_rng(seed).uniform()) / len(weights)
    return np.minimum(np.searchsorted(np.cumsum(weights), steps), len(weights) - 1)
