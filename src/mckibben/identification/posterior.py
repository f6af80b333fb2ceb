"""Posterior of a fit: samples of its parameters, joint intervals, and bands of what it predicts.

A confidence interval of least squares assumes that the law is right and the errors are independent. Here the law may be
wrong: a smooth discrepancy over contraction and pressure takes up what it has no parameter for, and its size is found from
the data (`sampler` states the likelihood). Intervals of parameters become wider by as much as the discrepancy can stand for
them, and bands of the tension hold the discrepancy: narrow where there are points, wide away from them.
Points of one run share an error of their own (zero of a sensor, temperature, rate, how the muscle settled): where a map was
measured in several runs, its size is found too, and many points of a run do not pass for as many independent ones.
Range: static maps; a hysteresis between rising and falling pressure counts as noise.
"""

from __future__ import annotations

import abc
import functools
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from .._jax import jax
from ..accessors import Accessor
from ..answers import Column, Table
from ..documents import JsonValue, parse_json, read_text
from ..engine.native import differentiable
from ..errors import ConvergenceError, InputError
from ..estimation import Estimate
from ..extras import library
from ..muscles.build import build_law, cut_parameters
from ..muscles.law import TensionLaw
from ..muscles.laws import law_type
from ..quantities import declared, in_si, with_unit
from ..recordings import ForceMap
from . import sampler
from .problem import FittedLaw, Problem, slopes_at, tension_at

if TYPE_CHECKING:
    from ..accessors import PosteriorPlots

# Scale of the prior of the discrepancy's amplitude, as a share of the largest tension.
DISCREPANCY = 0.02
# Standard deviation of the tension where no sensor is known, as a share of the largest tension; its size is then fitted.
UNKNOWN_SENSOR = 2e-3
# Scale of the prior of the error that the points of a run share, as a share of the largest tension.
RUN_ERROR = 5e-3
ANOTHER_MUSCLE = (
    0.3  # rms of the measured points that a law misses, of the largest tension, above which it is another muscle
)


@dataclass(frozen=True, kw_only=True)
class MapSensors:
    """Standard uncertainties of a force map's values: noise of each value, and errors that all values share.

    Attributes:
        tension: noise of a tension [N].
        pressure: noise of a pressure [Pa].
        length: noise of a length [m].
        tension_gain: error of the load cell's gain, a share.
        tension_zero: error of its zero [N].
        pressure_zero: error of the pressure sensor's zero [Pa].
        length_zero: error of the length's zero [m].

    Examples:
        >>> from mckibben.identification.posterior import MapSensors
        >>> MapSensors(tension=0.5, pressure=200.0).tension
        0.5
    """

    tension: float
    pressure: float = 0.0
    length: float = 0.0
    tension_gain: float = 0.0
    tension_zero: float = 0.0
    pressure_zero: float = 0.0
    length_zero: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0.0):
                raise InputError(f"sensors.{name}", float(value), "must be 0 or more")
        if self.tension == 0.0:
            raise InputError("sensors.tension", self.tension, "must be more than 0 N")

    def errors(self, tension: np.ndarray, by_length: np.ndarray, by_pressure: np.ndarray) -> SensorErrors:
        """Errors of measured tensions.

        Args:
            tension: predicted (n,) [N].
            by_length: derivative to the length (n,) [N/m].
            by_pressure: derivative to the pressure (n,) [m^2].
        """
        each = self.tension**2 + (by_length * self.length) ** 2 + (by_pressure * self.pressure) ** 2
        shared = np.stack(
            [
                self.tension_gain * tension,
                np.full(len(tension), self.tension_zero),
                self.pressure_zero * by_pressure,
                self.length_zero * by_length,
            ]
        )
        return SensorErrors(np.sqrt(each), shared[np.any(shared != 0.0, axis=1)])


class SensorErrors(NamedTuple):
    """Standard uncertainties of measured tensions [N].

    Attributes:
        noise: of each by itself (n,).
        shared: those that all have in common, one per row (m, n).
    """

    noise: np.ndarray
    shared: np.ndarray

    @property
    def covariance(self) -> np.ndarray:
        """Covariance (n, n) [N^2]."""
        return np.asarray(np.diag(self.noise**2) + self.shared.T @ self.shared)


class RunCovariance(NamedTuple):
    """What the errors of runs add to readings at points (m,), given the data.

    Attributes:
        mean: of each sample (d, m) [N].
        across: covariance of the discrepancy at a point, by rows, with the error of a reading (m, m) [N^2].
        errors: covariance of the errors of readings (m, m) [N^2].
    """

    mean: np.ndarray
    across: np.ndarray
    errors: np.ndarray


class Band(NamedTuple):
    """Quantiles of a prediction at each point (n,): lower end, median and upper end."""

    low: np.ndarray
    median: np.ndarray
    high: np.ndarray


class ParameterSamples(abc.ABC):
    """Samples of a posterior: values of each parameter [SI], (d,) each, of which the same row of all is one sample."""

    samples: Mapping[str, np.ndarray]
    noise: np.ndarray
    seed: int
    r_hat: float
    effective: float
    divergences: int
    worst: str

    @abc.abstractmethod
    def unit_of(self, name: str) -> str:
        """Unit of a parameter."""

    def __len__(self) -> int:
        return len(self.noise)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against the use of the samples, as text; empty if nothing does."""
        return sampler.mixing_warnings(self.r_hat, self.effective, self.divergences, len(self), self.worst)

    def intervals(self, confidence: float = 0.95) -> dict[str, Estimate]:
        """Median of each parameter with its interval between equal tails [SI]."""
        return self._ends(0.5 - 0.5 * confidence)

    def joint_intervals(self, confidence: float = 0.95) -> dict[str, Estimate]:
        """Intervals that hold all parameters of a sample at once, for a share `confidence` of the samples [SI].

        Each is wider than that of `intervals`: the ends lie at the same rank in all parameters.
        """
        values = np.stack(list(self.samples.values()))
        rank = np.argsort(np.argsort(values, axis=1), axis=1) / max(values.shape[1] - 1, 1)
        return self._ends(float(np.quantile(np.minimum(rank, 1.0 - rank).min(axis=0), 1.0 - confidence)))

    def table(self, title: str, *sentences: str) -> Table:
        """Median and intervals of each parameter, with sentences and what speaks against the samples below.

        Args:
            title: of what the samples are.
            *sentences: above the warnings.
        """
        names = Column("name", "parameter"), Column("value", "median", own="unit")
        each = Column("low", "95 %: from", own="unit"), Column("high", "to", own="unit")
        joint = Column("joint_low", "95 % of all at once: from", own="unit"), Column("joint_high", "to", own="unit")
        rows = [{"name": name} | ends for name, ends in self._plain_intervals().items()]
        notes = (*sentences, *(f"note: {one}" for one in self.warnings))
        return Table(f"{title}, {len(self)} samples", (*names, *each, *joint), rows, notes)

    def _ends(self, tail: float) -> dict[str, Estimate]:
        quantiles = {name: np.quantile(column, (0.5, tail, 1.0 - tail)) for name, column in self.samples.items()}
        return {
            name: Estimate(float(ends[0]), float(ends[1]), float(ends[2]), self.unit_of(name))
            for name, ends in quantiles.items()
        }

    def _plain_intervals(self) -> dict[str, dict[str, JsonValue]]:
        joint = self.joint_intervals()
        return {
            n: e._asdict() | {"joint_low": joint[n].low, "joint_high": joint[n].high}
            for n, e in self.intervals().items()
        }

    def _plain_mixing(self) -> dict[str, JsonValue]:
        names = ("seed", "r_hat", "effective", "divergences", "worst")
        return {name: getattr(self, name) for name in names} | {"warnings": list(self.warnings)}


@dataclass(frozen=True, repr=False)
class Posterior(ParameterSamples):
    """Samples of the parameters of a law that was fitted to a force map.

    Attributes:
        law: name of the law.
        samples: values of each parameter [SI], (d,) each; the same row of all of them is one sample.
        noise: factor on the noise of the sensors (d,).
        amplitude: standard deviation of the discrepancy (d,) [N].
        known: parameters that were not fitted [SI].
        points: with tension, to which the law was fitted.
        errors: of the sensors at these points.
        length: correlation length of the discrepancy, of the range of the contraction and of the pressure.
        seed: of the samples.
        r_hat: largest ratio of the variances between and within the chains; 1 where they agree.
        effective: fewest independent samples of a parameter.
        divergences: count of the samples at which the sampler lost its path.
        worst: name of the parameter on which the chains agree least.
        run: standard deviation of the error that all points of a run share (d,) [N]; None where the points are of one run,
            which says nothing of others.
    """

    law: str
    samples: Mapping[str, np.ndarray]
    noise: np.ndarray
    amplitude: np.ndarray
    known: Mapping[str, Any]
    points: ForceMap
    errors: SensorErrors
    length: float
    seed: int
    r_hat: float
    effective: float
    divergences: int
    worst: str = ""
    run: np.ndarray | None = None

    plot: ClassVar[Accessor[PosteriorPlots]] = Accessor("PosteriorPlots")
    """Plots: called, the tension with its bands; ``plot.parameters`` the parameters by pairs."""

    def __repr__(self) -> str:
        return (
            f"Posterior({self.law!r}, {len(self)} samples of {len(self.samples)} parameters, "
            f"discrepancy {np.median(self.amplitude):.3g} N)"
        )

    def tables(self) -> list[Table]:
        """The parameters, with the size of what the law has no parameter for, and of the noise, below."""
        size, noise = float(np.median(self.amplitude)), float(np.median(self.noise * self.sensor_noise))
        said = [
            f"What the law has no parameter for: {size:.3g} N ({100.0 * size / self.points.largest:.2g} % of the largest "
            f"tension); noise of the tension: {noise:.3g} N."
        ]
        if self.run is not None and self.points.run is not None:
            count = len(np.unique(self.points.run))
            said.append(f"Error that the points of one run share, from {count} runs: {self.run_error:.3g} N.")
        return [self.table(f"posterior of {self.law}", *said)]

    @property
    def sensor_noise(self) -> float:
        """Standard deviation of a measured tension by its sensors, before the factors `noise` [N]."""
        return float(np.sqrt(np.mean(self.errors.noise**2)))

    @property
    def run_error(self) -> float:
        """Median of the standard deviation of the error that all points of a run share [N]; 0 where it is not known."""
        return 0.0 if self.run is None else float(np.median(self.run))

    def unit_of(self, name: str) -> str:
        """Unit of a parameter."""
        return declared(law_type(self.law))[name].unit

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of the parameters (p, p)."""
        return np.atleast_2d(np.corrcoef(np.stack(list(self.samples.values()))))

    def laws(self, count: int | None = None, **changes: Any) -> list[TensionLaw]:
        """The law with the parameters of some samples.

        Args:
            count: count of the samples, evenly from all of them; all by default.
            **changes: parameters that replace fitted or known ones [SI], such as the rest length.
        """
        known = _whole(self.known)
        rests = np.ravel(self.known.get("rest_length", ()))
        return [
            build_law(
                self.law,
                cut_parameters(
                    self.law, known | {n: float(v[i]) for n, v in self.samples.items()}, changes, rests.tolist()
                )
                | changes,
            )
            for i in self.rows(count)
        ]

    def check_muscle(self, law: TensionLaw, name: str) -> None:
        """Refuse a muscle that is not the one whose posterior this is, by its tensions at the measured points.

        Args:
            law: of the muscle.
            name: of the muscle, for the sentence.

        Raises:
            InputError: its tensions miss the measured ones by more than `ANOTHER_MUSCLE` of the largest.
        """
        points = self.points.select(self.points.taut)
        miss = np.asarray(law.tension(points.length, points.pressure)) - points.tension
        share = float(np.sqrt(np.mean(miss**2)) / np.max(points.tension))
        if not share <= ANOTHER_MUSCLE:
            most = "more than the largest" if share > 1.0 else f"{100.0 * share:.2g} % rms of the largest"
            said = (
                f"the posterior is not that of the muscle {name}, whose tensions miss the {len(points)} measured points of "
                f"the posterior by {most}; take the specimen that the same fit saves"
            )
            problem = "must be that of the muscle"
            raise InputError("posterior", name, problem, sentence=said, remedy="specimen")

    def beyond(self, length: Any, pressure: Any) -> str | None:
        """Caution about points outside of the measured map, where the intervals are a guess; None if all are within.

        Args:
            length: [m].
            pressure: gauge [Pa].
        """
        beyond = []
        for name, values, measured, unit in (
            ("length", length, self.points.length, "m"),
            ("pressure", pressure, self.points.pressure, "Pa"),
        ):
            low, high = float(measured.min()), float(measured.max())
            slack = 0.02 * high  # spans and pressures as set and as measured differ a little
            wrong = [float(v) for v in np.atleast_1d(values) if not low - slack <= float(v) <= high + slack]
            if wrong:
                ends = f"{with_unit(low, unit, 3)} to {with_unit(high, unit, 3)}"
                beyond.append(f"a {name} of {with_unit(wrong[-1], unit, 4)} is outside of the measured {ends}")
        return f"{' and '.join(beyond)}, where the intervals are a guess" if beyond else None

    def rows(self, count: int | None = None) -> np.ndarray:
        """Places of some samples, evenly from all of them.

        Raises:
            InputError: there are fewer.
        """
        if count is None:
            return np.arange(len(self))
        if not 1 <= count <= len(self):
            raise InputError("count", count, f"must be between 1 and {len(self)}, the samples of the posterior")
        return np.asarray(np.linspace(0, len(self) - 1, count).round().astype(int))

    def tension(
        self,
        length: Any,
        pressure: Any,
        *,
        confidence: float = 0.95,
        measured: bool = False,
        discrepancy: bool = True,
        **changes: Any,
    ) -> Band:
        """Tension with its band [N].

        Args:
            length: of the muscle, [m] or text with a unit, shape (q,) or one value.
            pressure: gauge pressure, [Pa] or text with a unit, likewise.
            confidence: share of the samples within the band, at each point by itself.
            measured: with the noise of the load cell and the error of a run, as a further run would show it.
            discrepancy: with what the law has no parameter for; without it the band is that of the law alone.
            **changes: parameters that replace known ones [SI].

        Examples:
            >>> import mckibben as mk
            >>> fitted = mk.fit("DMSP-20-300", law="linear_threshold", schemes=())
            >>> posterior = fitted.posterior(draws=100, warm_up=100)    # doctest: +SKIP
            >>> posterior.tension(0.28, 3e5)                            # doctest: +SKIP
        """
        given = in_si(length, "m", field="length"), in_si(pressure, "Pa", field="pressure")
        lengths, pressures = np.broadcast_arrays(*(np.atleast_1d(np.asarray(values, float)) for values in given))
        drawn = self.signed_tensions(lengths, pressures, **changes)
        chance = np.random.default_rng(self.seed)
        if discrepancy and self.amplitude.any():
            mean, deviation = self._discrepancy(lengths, pressures, changes.get("rest_length"))
            drawn = drawn + mean + deviation * chance.standard_normal(drawn.shape)
        drawn = np.maximum(drawn, 0.0)
        if measured:
            drawn = drawn + self.noise[:, None] * self.sensor_noise * chance.standard_normal(drawn.shape)
            if self.run is not None:
                drawn = drawn + (self.run * chance.standard_normal(len(self)))[:, None]
        tail = 0.5 - 0.5 * confidence
        return Band(*np.quantile(drawn, (tail, 0.5, 1.0 - tail), axis=0))

    def signed_tensions(self, length: np.ndarray, pressure: np.ndarray, **changes: Any) -> np.ndarray:
        """Signed tension by the law of every sample at points (q,), shape (d, q) [N]; negative where the braid is slack."""
        if "rest_length" in changes and np.unique(np.ravel(self.known.get("rest_length", ()))).size == 1:
            return np.stack([np.asarray(law.braid_tension(length, pressure)) for law in self.laws(**changes)])
        points = ForceMap("", length, pressure, np.ones(len(length)))
        free = {name: self.samples[name] for name in self.samples if name not in changes}
        known = _whole(self.known) | {k: v for k, v in changes.items() if k in declared(law_type(self.law))}
        problem = Problem(self.law, tuple(free), known, points)
        force, _ = problem.functions()
        values = np.stack(list(free.values()), axis=1) / problem.scale
        return np.stack([force(row) for row in values])

    @functools.cached_property
    def _residuals(self) -> np.ndarray:
        problem = Problem(self.law, tuple(self.samples), dict(self.known), self.points)
        force, _ = problem.functions()
        values = np.stack(list(self.samples.values()), axis=1) / problem.scale
        residuals: np.ndarray = self.points.tension - np.stack([force(row) for row in values])
        return residuals

    def discrepancy_along(
        self, rows: np.ndarray, length: np.ndarray, pressure: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the discrepancy along the runs of some samples, given the data.

        Args:
            rows: places of the samples (r,).
            length: of the muscle at each instant of each run (r, q) [m].
            pressure: gauge pressure, likewise [Pa].

        Returns:
            Both (r, q) [N].
        """
        if not self.amplitude.any():
            return np.zeros(length.shape), np.zeros(length.shape)
        both = [
            self._discrepancy(each, at, None, rows=np.array([row]))
            for row, each, at in zip(rows, length, pressure, strict=True)
        ]
        return np.concatenate([mean for mean, _ in both]), np.concatenate([deviation for _, deviation in both])

    def mean_discrepancy(self, length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Mean of the discrepancy at points (q,), given the data, of every sample (d, q) [N]."""
        if not self.amplitude.any():
            return np.zeros((len(self), len(length)))
        return self._discrepancy(length, pressure, None)[0]

    def discrepancy_covariance(self, length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Covariance of the discrepancy between points (q,), given the data, for its median amplitude (q, q) [N^2]."""
        if not self.amplitude.any():
            return np.zeros((len(length), len(length)))
        there = self._places(length, pressure, None)
        size, onto = float(np.median(self.amplitude)) ** 2, self._onto(there)
        known = size**2 * onto @ self._median_precision.times(onto).T
        return np.asarray(size * sampler.matern(there, there, self.length) - known)

    def run_covariance(
        self, length: np.ndarray, pressure: np.ndarray, runs: Sequence[str] | np.ndarray | None = None
    ) -> RunCovariance:
        """Errors of runs in readings at points (m,), given the data, for the median sizes of all errors.

        Args:
            length: [m].
            pressure: gauge [Pa].
            runs: label of the run of each reading (m,): of a run of the data, of whose error they tell, or of a new one;
                one new run of all readings by default.
        """
        count = len(length)
        nothing = RunCovariance(np.zeros((len(self), count)), np.zeros((count, count)), np.zeros((count, count)))
        if self.run is None or self._run_modes is None:
            return nothing
        size, labels = self.run_error**2, np.zeros(count) if runs is None else np.asarray(runs)
        prior = size * (labels[:, None] == labels)
        if runs is None:
            return nothing._replace(errors=prior)
        known = run_columns(self.points.run)[0]
        member = (labels[:, None] == known).astype(float) @ self._run_modes.T  # (m, n): covariance with the modes
        residuals = self._residuals @ self._modes.directions.T
        mean = self.run[:, None] ** 2 * self._precision().times(residuals) @ member.T
        explained = self._median_precision.times(member).T
        size_of_discrepancy = float(np.median(self.amplitude)) ** 2
        across = -size * size_of_discrepancy * self._onto(self._places(length, pressure, None)) @ explained
        return RunCovariance(mean, across, np.asarray(prior - size**2 * member @ explained))

    def _discrepancy(
        self, length: np.ndarray, pressure: np.ndarray, rest: Any, *, rows: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the discrepancy at points (q,), given the data, of samples (d, q) [N]."""
        some = np.arange(len(self)) if rows is None else rows
        residuals = self._residuals[some] @ self._modes.directions.T
        onto = self._onto(self._places(length, pressure, rest))
        return sampler.discrepancy_given(self._precision(some), onto, residuals, self.amplitude[some])

    def _places(self, length: np.ndarray, pressure: np.ndarray, rest: Any) -> np.ndarray:
        rests = rests_of(self.points, len(length), rest)
        return map_coordinates(ForceMap("", length, pressure, np.ones(len(length)), rest_length=rests), self._scale)[0]

    def _onto(self, places: np.ndarray) -> np.ndarray:
        """Correlation of the discrepancy at places with the modes of the data (q, n)."""
        here, _ = map_coordinates(self.points)
        return np.asarray(sampler.matern(places, here, self.length) @ self._modes.directions.T)

    @functools.cached_property
    def _scale(self) -> np.ndarray:
        return map_coordinates(self.points)[1]

    def _precision(self, rows: np.ndarray | None = None) -> sampler.Precision:
        """Inverse covariance of the modes of some samples."""
        some = slice(None) if rows is None else rows
        run = None if self.run is None else self.run[some]
        return sampler.Precision.of(self._modes.values, self.noise[some], self.amplitude[some], self._run_modes, run)

    @functools.cached_property
    def _median_precision(self) -> sampler.Precision:
        """Inverse covariance of the modes for the median sizes of all errors; of one sample."""
        noise, amplitude, run = (
            None if one is None else np.array([np.median(one)]) for one in (self.noise, self.amplitude, self.run)
        )
        assert noise is not None and amplitude is not None
        return sampler.Precision.of(self._modes.values, noise, amplitude, self._run_modes, run)

    @functools.cached_property
    def _run_modes(self) -> np.ndarray | None:
        """What the error of each run adds to the modes (n, r); None where runs have none of their own."""
        return None if self.run is None else self._modes.directions @ run_columns(self.points.run)[1]

    @functools.cached_property
    def _modes(self) -> sampler.ErrorModes:
        here, _ = map_coordinates(self.points)
        return sampler.ErrorModes.of(self.errors.covariance, sampler.matern(here, here, self.length))

    def to_dict(self) -> dict[str, JsonValue]:
        """Samples, intervals and what the bands are made of, as plain values [SI], for JSON."""
        arrays = {k: getattr(self.points, k) for k in ("length", "pressure", "tension", "rest_length", "diameter")}
        return {
            "law": self.law,
            "intervals": self._plain_intervals(),
            "correlation": self.correlation.tolist(),
            "discrepancy": float(np.median(self.amplitude)),
            "noise": float(np.median(self.noise) * self.sensor_noise),
            "samples": {n: v.tolist() for n, v in self.samples.items()},
            "noise_samples": self.noise.tolist(),
            "discrepancy_samples": self.amplitude.tolist(),
            "correlation_length": self.length,
            "known": {n: np.asarray(v).tolist() for n, v in self.known.items()},
            "points": {k: None if v is None else np.asarray(v).tolist() for k, v in arrays.items()},
            "runs": None if self.points.run is None else [str(label) for label in self.points.run],
            "run_error": None if self.run is None else self.run_error,
            "run_samples": None if self.run is None else self.run.tolist(),
            "sensor_noise": self.errors.noise.tolist(),
            "shared_errors": self.errors.shared.tolist(),
            **self._plain_mixing(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Posterior:
        """A posterior of what `to_dict` returned.

        Raises:
            InputError: a value is missing or of another kind.
        """
        try:
            arrays = {k: None if v is None else np.asarray(v, float) for k, v in values["points"].items()}
            law = str(values["law"])
            fields = declared(law_type(law))
            samples = {str(n): np.asarray(v, float) for n, v in values["samples"].items()}
            for name, column in samples.items():
                fields[name].check(f"posterior.{name}", column)
            runs, run = values.get("runs"), values.get("run_samples")
            known = {n: np.asarray(v, float) if np.ndim(v) else float(v) for n, v in values["known"].items()}
            made = cls(
                law=law,
                samples=samples,
                noise=np.asarray(values["noise_samples"], float),
                amplitude=np.asarray(values["discrepancy_samples"], float),
                known=known,
                points=ForceMap("posterior", run=None if runs is None else np.array(runs, str), **arrays),  # type: ignore[arg-type]
                errors=SensorErrors(
                    np.asarray(values["sensor_noise"], float),
                    np.asarray(values["shared_errors"], float).reshape(-1, len(values["sensor_noise"])),
                ),
                length=float(values["correlation_length"]),
                seed=int(values["seed"]),
                r_hat=float(values["r_hat"]),
                effective=float(values["effective"]),
                divergences=int(values["divergences"]),
                worst=str(values.get("worst", "")),
                run=None if run is None else np.asarray(run, float),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError("posterior", None, f"must be a posterior as `Fit.posterior` draws it: {error!r}") from None
        shapes = {len(made.noise), len(made.amplitude), *map(len, samples.values())}
        if made.run is not None:
            shapes.add(len(made.run))
            if made.points.run is None or len(made.points.run) != len(made.points):
                raise InputError("posterior.runs", None, "must have the run of each point")
        if len(shapes) != 1 or len(made.errors.noise) != len(made.points) or not len(made):
            raise InputError("posterior", None, "must have as many values of each parameter as samples")
        return made


def posterior_of_fit(
    fit: FittedLaw,
    *,
    sensors: MapSensors | None = None,
    slack: ForceMap | None = None,
    discrepancy: float | None = None,
    runs: Sequence[str] | np.ndarray | None = None,
    draws: int = sampler.DRAWS,
    chains: int = sampler.CHAINS,
    warm_up: int = sampler.WARM_UP,
    seed: int = 0,
) -> Posterior:
    """Draw from the posterior of a fit's parameters.

    Args:
        fit: a fit that converged.
        sensors: standard uncertainties of the map's values; the noise of the tension is found from the data where left out.
        slack: points without tension that say where the law may not pull.
        discrepancy: scale of the prior of the discrepancy's standard deviation [N]; by default 2 % of the largest
            tension, and 0 for a law that is known to be right.
        runs: label of the run in which each point of the fit was measured (n,); those of the map by default. The points of
            a run share an error, if there are several.
        draws: count of the samples.
        chains: chains that run beside each other.
        warm_up: samples of each chain that adapt the step and are left out.
        seed: same seed, same samples.

    Raises:
        ConvergenceError: the fit did not converge.
        MissingLibraryError: NumPyro is not installed; it comes with the extra ``posterior``.
    """
    if not fit.converged:
        raise ConvergenceError(f"The fit of the law {fit.law} did not converge, so there is nothing to sample.")
    points, free = fit.points, tuple(fit.parameters)
    every = points if slack is None else ForceMap.joined([points, slack], points.name)
    # the points of a table without tension are of its largest muscle
    more = len(every) - len(points)
    known = {k: np.append(v, np.full(more, np.max(v))) if np.ndim(v) else v for k, v in fit.known.items()}
    problem = Problem(fit.law, free, known, every)
    start = np.array([fit.parameters[n].value for n in free]) / problem.scale
    predicted, by_length, by_pressure = (column[: len(points)] for column in _input_slopes(problem, start))
    top = points.largest
    of = sensors or MapSensors(tension=UNKNOWN_SENSOR * top)
    errors = of.errors(predicted, by_length, by_pressure)
    amplitude = DISCREPANCY * top if discrepancy is None else float(discrepancy)
    if not (np.isfinite(amplitude) and amplitude >= 0.0):
        raise InputError("discrepancy", amplitude, "must be 0 N or more")
    if runs is not None:
        if len(runs) != len(points):
            raise InputError("runs", len(runs), f"must be {len(points)} labels, one of each point with tension")
        points = replace(points, run=np.array([str(label) for label in runs]))
    labels, columns = run_columns(points.run)
    several = columns if len(labels) > 1 else None
    coordinates, _ = map_coordinates(points)
    residual = points.tension - predicted
    sizes = sampler.error_sizes(
        residual,
        coordinates,
        errors.covariance,
        max(5.0 * amplitude, 1e-6 * top),
        noise_known=sensors is not None,
        runs=several,
    )
    smooth = sampler.matern(coordinates, coordinates, sizes.length)
    slopes = problem.functions()[1](start)[: len(points)]
    whole = sizes.covariance(errors.covariance, smooth, amplitude, several)
    low, high = sampler.around(start, slopes, whole, *_plausible(problem, start))
    evidence = sampler.Evidence(
        **_model_of(problem),
        measured=points.tension,
        modes=sampler.ErrorModes.of(errors.covariance, smooth),
        slack_variance=np.full(len(every) - len(points), of.tension**2),
        low=low,
        high=high,
        start=start,
        noise_known=sensors is not None,
        amplitude=amplitude,
        runs=columns[:, :0] if several is None else several,
        run_scale=RUN_ERROR * top,
    )
    drawn = sampler.sample(evidence, draws=draws, chains=chains, warm_up=warm_up, seed=seed)
    return Posterior(
        law=fit.law,
        samples=dict(zip(free, (drawn.parameters * problem.scale).T, strict=True)),
        noise=drawn.noise,
        amplitude=drawn.amplitude,
        known=dict(fit.known),
        points=points,
        errors=errors,
        length=sizes.length,
        seed=seed,
        r_hat=drawn.r_hat,
        effective=drawn.effective,
        divergences=drawn.divergences,
        worst=(*free, "the noise")[drawn.worst],
        run=drawn.run,
    )


def run_columns(labels: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Labels of the runs (r,), and 1 where a point is of a run, else 0 (n, r); no column where runs are not known."""
    if labels is None:
        return np.zeros(0, str), np.zeros((0, 0))
    known = np.unique(labels)
    return known, (np.asarray(labels)[:, None] == known).astype(float)


FEWEST_DRAWS, MOST_DRAWS = 100, 100_000


def check_draws(draws: int, *, field: str = "draws") -> None:
    """Refuse a count of samples that is out of range, and ask for the library that draws them, before anything else."""
    if not FEWEST_DRAWS <= draws <= MOST_DRAWS:
        raise InputError(field, draws, f"must be between {FEWEST_DRAWS} and {MOST_DRAWS}")
    library("numpyro", "Samples of a posterior need")


def read_posterior(path: str | os.PathLike[str], *, law: str | None = None) -> Posterior:
    """Read the posterior in the file of a fit, which ``mckibben fit --posterior --out fit.json`` has written.

    Args:
        path: path of the file.
        law: whose posterior; the first in the file by default.

    Raises:
        InputError: it is no such file, or has no posterior of that law.
    """
    where, text = os.fspath(path), read_text(path, form="JSON")
    try:
        content: Any = parse_json(text)
        fits = [f for one in content.get("maps", [content]) for f in one["fits"]]
        having = {str(f["law"]): f["posterior"] for f in reversed(fits) if f.get("posterior")}
    except (KeyError, TypeError, AttributeError, ValueError):
        said = f"{where} is not the result of a fit with samples of its posterior; save a fit that has them"
        raise InputError("posterior", where, "must be such a file", sentence=said, remedy="posterior") from None
    if not having:
        said = f"{where} is the result of a fit without samples of its posterior; save one that has them"
        raise InputError("posterior", where, "must be a fit with one", sentence=said, remedy="posterior")
    name = list(having)[-1] if law is None else law
    if name not in having:
        raise InputError("posterior.law", name, known=sorted(having), where=where)
    try:
        return Posterior.from_dict(having[name])
    except InputError as error:
        raise error.changed(where=where) from None


def _model_of(problem: Problem) -> dict[str, Any]:
    """Model and inputs of the `Evidence`: a kernel that XLA calls itself, or the law where only XLA can evaluate it."""
    points, known = problem.points, tuple(sorted(problem.known))
    inputs = {
        "scale": problem.scale,
        "known": tuple(np.broadcast_to(np.asarray(problem.known[n], float), (len(points),)) for n in known),
        "length": np.asarray(points.length, float),
        "pressure": np.asarray(points.pressure, float),
    }
    count = 0 if problem.runs_by_xla else len(points)
    return {"model": _law_model(law_type(problem.law), problem.free, known, count), "inputs": inputs}


@functools.lru_cache(maxsize=64)
def _law_model(kind: type[TensionLaw], free: tuple[str, ...], known: tuple[str, ...], count: int) -> sampler.Model:
    """Tensions of a law at a count of points, by a kernel with its derivatives; by XLA where the count is 0."""
    if not count:
        over = jax.vmap(functools.partial(tension_at, kind, free, known), in_axes=(None, 0, 0, 0))
        return lambda x, inputs: over(x * inputs["scale"], inputs["known"], inputs["length"], inputs["pressure"])
    column = np.zeros(count)
    examples = np.zeros(len(free)), tuple(column for _ in known), column, column
    kernel = differentiable(functools.partial(_at_points, kind, free, known), *examples, engine="native")

    def both(x: Any, inputs: Any) -> Any:
        force, slopes = kernel(x * inputs["scale"], inputs["known"], inputs["length"], inputs["pressure"])
        return sampler.finite(force, slopes * inputs["scale"])

    predict = jax.custom_vjp(lambda x, inputs: both(x, inputs)[0])
    predict.defvjp(both, lambda slopes, up: (up @ slopes, None))
    return predict


def _at_points(kind: Any, free: Any, known: Any, values: Any, fixed: Any, length: Any, pressure: Any) -> Any:
    """Tension [N] at all points (n,), and its derivatives by the free parameters (n, free)."""

    def at(point: Any) -> Any:
        return tuple(of(kind, free, known, values, *point) for of in (tension_at, slopes_at))

    return jax.lax.map(at, (fixed, length, pressure))


def _plausible(problem: Problem, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of scaled parameters (p,): the usual range with its width to either side, or twice the fitted value from it."""
    low, high = problem.bounds
    typical = np.array(list(problem.typical.values())) / problem.scale[:, None]
    room = np.ptp(typical, axis=1)
    below = np.minimum(typical[:, 0] - room, start - 2.0 * np.abs(start))
    above = np.maximum(typical[:, 1] + room, start + 2.0 * np.abs(start))
    return np.maximum(low, below), np.minimum(high, above)


def _input_slopes(problem: Problem, start: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tension [N] and its derivatives to length [N/m] and pressure [m^2] at all points, by central differences."""
    points = problem.points
    step_length, step_pressure = 1e-4 * float(np.ptp(points.length) or 1e-2), 1e-4 * float(points.pressure.max())

    def force(length: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        moved = ForceMap("", length, pressure, points.tension)
        return Problem(problem.law, problem.free, problem.known, moved).functions()[0](start)

    ends = [force(points.length + s * step_length, points.pressure) for s in (-1.0, 1.0)]
    sides = [force(points.length, points.pressure + s * step_pressure) for s in (-1.0, 1.0)]
    by_length = (ends[1] - ends[0]) / (2.0 * step_length)
    by_pressure = (sides[1] - sides[0]) / (2.0 * step_pressure)
    return force(points.length, points.pressure), np.nan_to_num(by_length), np.nan_to_num(by_pressure)


def map_coordinates(points: ForceMap, scale: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Length over rest length, and pressure, each over its range in the data (n, 2); and that scale (2, 2)."""
    lengths = points.length if points.rest_length is None else points.length / points.rest_length
    raw = np.stack([lengths, points.pressure], axis=1)
    if scale is None:
        room = np.ptp(raw, axis=0)
        scale = np.stack([raw.min(axis=0), np.where(room > 0.0, room, np.maximum(np.abs(raw).max(axis=0), 1e-12))])
    return (raw - scale[0]) / scale[1], scale


def rests_of(points: ForceMap, count: int, rest: Any) -> np.ndarray | None:
    """Rest lengths of a count of further points (count,): as stated, or that of the longest muscle [m]."""
    if points.rest_length is None:
        return None
    return np.full(count, float(points.rest_length.max() if rest is None else rest))


def _whole(known: Mapping[str, Any]) -> dict[str, Any]:
    """Known parameters as one number each: the largest where they differ between points."""
    return {k: float(np.max(v)) for k, v in known.items()}
