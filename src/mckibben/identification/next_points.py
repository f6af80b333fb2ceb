"""The points of length and pressure at which a further measurement teaches most, and the protocol that visits them.

A posterior says how far its samples disagree about the tension at every point that could be measured. The data tie the
discrepancy to the parameters, so each sample predicts the tension of its law together with its discrepancy; what the data
leave open of the discrepancy is a covariance beside. From both follows what a set of measurements would leave, in the linear
approximation: of the parameters (the mutual information of parameters and measurements is largest), or of the tension at
stated points (the mean variance is smallest). Two laws are told apart by the distance of their predictions, in standard
deviations of what both leave open and of the noise. All readings of the measurement are those of one new run, and share the
error that runs have, where the data tell its size. Points are taken one after the other, each the one that gains most per
second of machine time, until the budget is spent; then single points are exchanged as long as that gains.
Every point is reached with rising pressure after the muscle was vented at its length, so that all lie on one branch of the
hysteresis, and is held before it counts, so that creep has passed.
Range: the linear approximation is that of the posterior's samples; no point lies outside of the measured range of
contraction and pressure, because a muscle that has survived one pressure need not survive a higher one.
Source: V. V. Fedorov, Theory of Optimal Experiments, Academic Press 1972; D. V. Lindley, Ann. Math. Stat. 27(4), 1956;
of two laws W. G. Hunter and A. M. Reiner, Technometrics 7(3), 1965.
"""

from __future__ import annotations

import abc
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..estimation import Estimate
from .posterior import Posterior

GRID = (7, 9)  # lengths and pressures of the candidates
MOVE, VENT, READ = 2.0, 3.0, 1.0  # time to a point, to an empty muscle at another length, and of a reading [s]
RATE = 100.0  # samples per second of the protocol, which every rig takes [1/s]
SWEEPS = 3  # exchanges of every point, at most
UNCHANGED = 0.95  # of the width of an interval: what is left of one that measurements do not narrow


@dataclass(frozen=True)
class Candidates:
    """Points that could be measured, with what the samples of a posterior say of them.

    Attributes:
        length: (m,) [m].
        pressure: gauge (m,) [Pa].
        predicted: covariance between them of the tension that the samples predict (m, m) [N^2].
        discrepancy: covariance of what the data leave open of the discrepancy (m, m) [N^2].
        parameters: covariance of the reading that is predicted with each parameter (m, p).
        spread: covariance of the parameters (p, p).
        noise: standard deviation of a reading [N].
        runs: what the errors of runs add to the covariance of readings (m, m) [N^2].
        across: what they add to the covariance of the tension at a point, by rows, with readings (m, m) [N^2].
    """

    length: np.ndarray
    pressure: np.ndarray
    predicted: np.ndarray
    discrepancy: np.ndarray
    parameters: np.ndarray
    spread: np.ndarray
    noise: float
    runs: np.ndarray | float = 0.0
    across: np.ndarray | float = 0.0

    def readings(self, chosen: list[int]) -> np.ndarray:
        """Covariance of readings at some points [N^2]."""
        some = np.ix_(chosen, chosen)
        errors = self.noise**2 * np.eye(len(chosen)) + (
            self.runs[some] if isinstance(self.runs, np.ndarray) else self.runs
        )
        return np.asarray(self.predicted[some] + self.discrepancy[some] + errors)

    def information(self, chosen: list[int]) -> float:
        """Mutual information of the parameters and readings at some points [nat]."""
        if not chosen:
            return 0.0
        readings, known = self.readings(chosen), self.parameters[chosen] @ self._directions
        # the covariance of readings whose parameters are known; no difference of numbers near 1, however much they tell
        return float(0.5 * (np.linalg.slogdet(readings)[1] - np.linalg.slogdet(readings - known @ known.T)[1]))

    def widths(self, chosen: list[int]) -> np.ndarray:
        """Share of the width of each parameter's interval that readings at some points leave (p,)."""
        across = self.parameters[chosen]
        explained = np.einsum("ij,ij->j", across, np.linalg.solve(self.readings(chosen), across))
        variance = np.diag(self.spread)
        known = np.divide(explained, variance, out=np.zeros(len(variance)), where=variance > 0.0)
        return np.asarray(np.sqrt(np.maximum(1.0 - known, 0.0)))

    @functools.cached_property
    def _directions(self) -> np.ndarray:
        """Combinations of the parameters with unit variance, independent of each other (p, at most p)."""
        scale = np.sqrt(np.diag(self.spread))
        scale = np.where(scale > 0.0, scale, np.inf)
        values, vectors = np.linalg.eigh(self.spread / np.outer(scale, scale))
        kept = values > 1e-12
        return np.asarray(vectors[:, kept] / np.sqrt(values[kept]) / scale[:, None])

    def left(self, chosen: list[int], at: np.ndarray) -> float:
        """Mean variance of the tension at some points, after readings at others [N^2]."""
        whole = self.predicted + self.discrepancy
        if not chosen:
            return float(np.diag(whole)[at].mean())
        across = (whole + self.across)[at][:, chosen]
        known = np.einsum("ij,ji->i", across, np.linalg.solve(self.readings(chosen), across.T))
        return float((np.diag(whole)[at] - known).mean())


@dataclass(frozen=True)
class LawContrast:
    """Tension that two laws expect at points that could be measured.

    Attributes:
        length: (m,) [m].
        pressure: gauge (m,) [Pa].
        tensions: by each law, with its discrepancy (2, m) [N].
        open: covariance between readings at the points, of what a law leaves open of the tension and of the error of the
            run, mean of both laws (m, m) [N^2].
        noise: standard deviation of a reading [N].
    """

    length: np.ndarray
    pressure: np.ndarray
    tensions: np.ndarray
    open: np.ndarray
    noise: float

    @property
    def deviations(self) -> np.ndarray:
        """Expected difference of one reading at each point, in its standard deviations (m,)."""
        return np.asarray((self.tensions[1] - self.tensions[0]) / np.sqrt(np.diag(self.open) + self.noise**2))

    def distance(self, chosen: list[int]) -> float:
        """Squared distance of the readings that the laws expect at some points, in standard deviations."""
        if not chosen:
            return 0.0
        difference = (self.tensions[1] - self.tensions[0])[chosen]
        covariance = self.open[np.ix_(chosen, chosen)] + self.noise**2 * np.eye(len(chosen))
        return float(difference @ np.linalg.solve(covariance, difference))


class PlannedPoints(abc.ABC):
    """Points (k,) in the order in which a protocol visits them, and how long each is held before its reading."""

    length: np.ndarray
    pressure: np.ndarray
    wait: float

    def __len__(self) -> int:
        return len(self.length)

    def protocol(self) -> str:
        """The protocol as a TOML file that ``mckibben run`` takes."""
        return protocol_of_points(self.length, self.pressure, self.wait)


@dataclass(frozen=True)
class NextExperiment(PlannedPoints):
    """Points to measure next, in the order in which the protocol visits them.

    Attributes:
        length: (k,) [m].
        pressure: gauge (k,) [Pa].
        duration: machine time [s].
        wait: hold of each point before its reading [s].
        information: expected gain about the parameters [nat].
        intervals: 95 % interval of each parameter now [SI].
        expected: factor of the width of each interval that is expected to be left.
        deviation: root mean square uncertainty of the tension at all candidates, now and as expected afterwards [N].
    """

    length: np.ndarray
    pressure: np.ndarray
    duration: float
    wait: float
    information: float
    intervals: dict[str, Estimate]
    expected: dict[str, float]
    deviation: tuple[float, float]

    @property
    def narrows(self) -> bool:
        """Whether the interval of a parameter is expected to become narrower at all."""
        return min(self.expected.values()) < UNCHANGED


@dataclass(frozen=True)
class LawTest(PlannedPoints):
    """Points that tell two laws apart, in the order in which the protocol visits them.

    Attributes:
        laws: names of both.
        length: (k,) [m].
        pressure: gauge (k,) [Pa].
        tensions: expected by each law (2, k) [N].
        deviations: difference of them in standard deviations of one reading (k,).
        distance: of all readings together, in standard deviations.
        duration: machine time [s].
        wait: hold of each point before its reading [s].
    """

    laws: tuple[str, str]
    length: np.ndarray
    pressure: np.ndarray
    tensions: np.ndarray
    deviations: np.ndarray
    distance: float
    duration: float
    wait: float

    @property
    def recognised(self) -> float:
        """Probability that the readings speak for the right law, if one of both is right: 0.5 for a guess."""
        return 0.5 * math.erfc(-0.5 * self.distance / math.sqrt(2.0))


def protocol_of_points(lengths: np.ndarray, pressures: np.ndarray, wait: float) -> str:
    """Protocol that visits points in their order, as a TOML file.

    Args:
        lengths: (k,) [m].
        pressures: gauge (k,) [Pa].
        wait: hold of each point before its reading [s].
    """
    lines = [
        "schema = 1",
        'name = "next"',
        f'title = "The next {len(lengths)} points"',
        f'sample_rate = "{RATE:g} Hz"',
        'needs = ["pressure sensor", "span sensor", "tension sensor"]',
    ]
    before = float("nan")
    for i, (length, pressure) in enumerate(zip(lengths, pressures, strict=True), 1):
        if length != before:
            lines += _step("vent", f'span = {{ to = "{length:.6g} m", in = "{VENT:g} s" }}',
                           f'pressure = {{ to = "0 bar", in = "{VENT / 3.0:g} s" }}')  # fmt: skip
        lines += _step("approach", f'pressure = {{ to = "{pressure:.6g} Pa", in = "{MOVE:g} s" }}')
        if wait > 0.0:
            lines += _step("wait", f'for = "{wait:g} s"')
        lines += ["", "[[steps]]", f'label = "point {i}"', f'for = "{READ:g} s"']
        before = length
    lines += ["", "[[last]]", 'label = "vent"', 'pressure = { to = "0 bar", in = "1 s" }', "record = false"]
    return "\n".join(lines) + "\n"


def _step(label: str, *content: str) -> list[str]:
    return ["", "[[steps]]", f'label = "{label}"', *content, "record = false"]


def candidates_of(
    posterior: Posterior,
    length: np.ndarray,
    pressure: np.ndarray,
    *,
    noise: float | None = None,
    runs: Sequence[str] | np.ndarray | None = None,
) -> Candidates:
    """What a posterior says of points that could be measured, (m,) each.

    Args:
        posterior: samples from the measurements so far.
        length: [m].
        pressure: gauge [Pa].
        noise: standard deviation of a reading [N]; that of the posterior by default.
        runs: label of the run of each reading, which may be one of the measurements so far; one new run by default.
    """
    tension = posterior.signed_tensions(length, pressure) + posterior.mean_discrepancy(length, pressure)
    centred = tension - tension.mean(axis=0)
    errors = posterior.run_covariance(length, pressure, runs)
    error = errors.mean - errors.mean.mean(axis=0)
    together = centred.T @ error / len(centred)
    values = np.stack(list(posterior.samples.values()), axis=1)
    values = values - values.mean(axis=0)
    return Candidates(
        length=length,
        pressure=pressure,
        predicted=centred.T @ centred / len(centred),
        discrepancy=posterior.discrepancy_covariance(length, pressure),
        parameters=(centred + error).T @ values / len(centred),
        spread=values.T @ values / len(values),
        noise=noise or _noise(posterior),
        runs=errors.errors + errors.across + errors.across.T + together + together.T + error.T @ error / len(error),
        across=errors.across + together,
    )


def contrast_of(
    posteriors: Sequence[Posterior], length: np.ndarray, pressure: np.ndarray, *, noise: float | None = None
) -> LawContrast:
    """What the posteriors of two laws say of points that could be measured, (m,) each.

    Args:
        posteriors: of two laws, from the same measurements.
        length: [m].
        pressure: gauge [Pa].
        noise: standard deviation of a reading [N]; the larger one of the posteriors by default.
    """
    means, spreads = [], []
    for one in posteriors:
        tension = one.signed_tensions(length, pressure) + one.mean_discrepancy(length, pressure)
        centred = tension - tension.mean(axis=0)
        means.append(tension.mean(axis=0))
        whole = centred.T @ centred / len(centred) + one.discrepancy_covariance(length, pressure)
        spreads.append(whole + one.run_covariance(length, pressure).errors)
    return LawContrast(
        length=length,
        pressure=pressure,
        tensions=np.stack(means),
        open=np.mean(spreads, axis=0),
        noise=noise or max(_noise(one) for one in posteriors),
    )


def _noise(posterior: Posterior) -> float:
    return float(np.median(posterior.noise) * posterior.sensor_noise)


def choose(
    candidates: Candidates, *, budget: float, wait: float, about: np.ndarray | None = None, every: bool = False
) -> list[int]:
    """Choose points one after the other, each the one that gains most per second.

    Args:
        candidates: that could be measured.
        budget: machine time [s].
        wait: hold of each point before its reading [s].
        about: places of the candidates whose tension is asked for; the parameters by default.
        every: take a point once only, as from a table that was measured before.

    Raises:
        InputError: the budget is too short for one point.
    """

    def gain(chosen: list[int]) -> float:
        return candidates.information(chosen) if about is None else -candidates.left(chosen, about)

    return _greedy(gain, candidates.length, budget=budget, wait=wait, every=every)


def _greedy(
    gain: Callable[[list[int]], float], length: np.ndarray, *, budget: float, wait: float, every: bool = False
) -> list[int]:
    """Places of points with these lengths, each the one that raises `gain` most per second, until the budget is spent."""
    chosen: list[int] = []
    spent = 0.0
    while True:
        now = gain(chosen)
        best: tuple[float, int, float] | None = None
        for i in range(len(length)):
            if every and i in chosen:
                continue
            cost = duration(length[[*chosen, i]], wait) - spent
            if spent + cost > budget:
                continue
            rate = (gain([*chosen, i]) - now) / cost
            if best is None or rate > best[0]:
                best = (rate, i, cost)
        if best is None:
            break
        chosen.append(best[1])
        spent += best[2]
    if not chosen:
        least = VENT + MOVE + wait + READ + 1.0
        raise InputError("budget", f"{budget:g} s", f"must be {least:g} s or more, the time of one point")
    return _exchanged(gain, length, chosen, budget=budget, wait=wait, every=every)


def _exchanged(
    gain: Callable[[list[int]], float],
    length: np.ndarray,
    chosen: list[int],
    *,
    budget: float,
    wait: float,
    every: bool,
) -> list[int]:
    """The same count of points after exchanges of single ones, each to the one that gains most."""
    now = gain(chosen)
    for _ in range(SWEEPS):
        before = now
        for place in range(len(chosen)):
            for i in range(len(length)):
                trial = [*chosen[:place], i, *chosen[place + 1 :]]
                if i in chosen and (every or i == chosen[place]) or duration(length[trial], wait) > budget:
                    continue
                value = gain(trial)
                if value > now:
                    chosen, now = trial, value
        if now - before <= 1e-6 * abs(now):
            break
    return chosen


def duration(lengths: np.ndarray, wait: float) -> float:
    """Machine time of points with these lengths (k,) [m], each length in one go [s]."""
    return len(np.unique(lengths)) * VENT + len(lengths) * (MOVE + wait + READ) + 1.0


def ordered(length: np.ndarray, pressure: np.ndarray, chosen: list[int]) -> list[int]:
    """Points from the longest length to the shortest, at each with rising pressure."""
    return sorted(chosen, key=lambda i: (-length[i], pressure[i]))


def _reachable(
    posteriors: Sequence[Posterior],
    lengths: tuple[float, float] | None,
    highest_pressure: float | None,
    highest_tension: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Length and pressure of a grid of points within a map at which the muscle pulls and the machine bears it, (m,) each.

    Raises:
        InputError: the machine can reach no point.
    """
    points = posteriors[0].points
    low, high = float(points.length.min()), float(points.length.max())
    if lengths is not None:
        low, high = max(low, lengths[0]), min(high, lengths[1])
    top = min(float(points.pressure.max()), highest_pressure or np.inf)
    bottom = float(points.pressure.min())
    if low > high or bottom > top:
        raise InputError("rig", None, "must reach a length and a pressure of the map")
    length, pressure = (
        x.ravel() for x in np.meshgrid(np.linspace(low, high, GRID[0]), np.linspace(bottom, top, GRID[1]))
    )
    safe = np.ones(len(length), bool)
    for posterior in posteriors:
        band = posterior.tension(length, pressure)
        safe &= (band.high < highest_tension) & (band.median > 0.0)
    if not safe.any():
        raise InputError("rig", None, "must bear the tension of a point of the map")
    return length[safe], pressure[safe]


def next_experiment(
    posterior: Posterior,
    *,
    budget: float,
    wait: float = 3.0,
    lengths: tuple[float, float] | None = None,
    highest_pressure: float | None = None,
    highest_tension: float = np.inf,
    question: tuple[float, float] | None = None,
    noise: float | None = None,
) -> NextExperiment:
    """The measurement that teaches most within a budget of machine time.

    Where no point narrows the interval of a parameter, those are taken that leave least of the map's uncertainty.

    Args:
        posterior: samples from the measurements so far.
        budget: machine time [s].
        wait: hold of each point before its reading, for creep [s].
        lengths: shortest and longest that the machine can set [m].
        highest_pressure: of the machine [Pa].
        highest_tension: of the machine [N]; no point whose tension may be higher is chosen.
        question: length [m] and pressure [Pa] at which the tension is asked for; the parameters by default.
        noise: standard deviation of a reading [N].

    Raises:
        InputError: the budget is too short, or the machine can reach no point.
    """
    length, pressure = _reachable([posterior], lengths, highest_pressure, highest_tension)
    count = len(length)
    if question is not None:
        length, pressure = np.append(length, question[0]), np.append(pressure, question[1])
    every = candidates_of(posterior, length, pressure, noise=noise)
    asked = np.arange(count, len(length)) if question is not None else np.arange(count)
    places = length[:count]
    chosen = _greedy(every.information, places, budget=budget, wait=wait) if question is None else []
    if question is not None or every.widths(chosen).min() >= UNCHANGED:
        chosen = _greedy(lambda some: -every.left(some, asked), places, budget=budget, wait=wait)
    chosen = ordered(length, pressure, chosen)
    return NextExperiment(
        length=length[chosen],
        pressure=pressure[chosen],
        duration=duration(length[chosen], wait),
        wait=wait,
        information=every.information(chosen),
        intervals=posterior.intervals(),
        expected=dict(zip(posterior.samples, every.widths(chosen).tolist(), strict=True)),
        deviation=(float(np.sqrt(every.left([], asked))), float(np.sqrt(every.left(chosen, asked)))),
    )


def law_test(
    posteriors: Sequence[Posterior],
    *,
    budget: float,
    wait: float = 3.0,
    lengths: tuple[float, float] | None = None,
    highest_pressure: float | None = None,
    highest_tension: float = np.inf,
    noise: float | None = None,
) -> LawTest:
    """The measurement that tells two laws apart best within a budget of machine time.

    Args:
        posteriors: of two laws, from the same measurements.
        budget: machine time [s].
        wait: hold of each point before its reading, for creep [s].
        lengths: shortest and longest that the machine can set [m].
        highest_pressure: of the machine [Pa].
        highest_tension: of the machine [N]; no point whose tension may be higher by one of the laws is chosen.
        noise: standard deviation of a reading [N].

    Raises:
        InputError: the laws were not fitted to the same points, the budget is too short, or the machine can reach no point.
    """
    first, second = posteriors
    same = [
        np.array_equal(getattr(first.points, name), getattr(second.points, name))
        for name in ("length", "pressure", "tension")
    ]
    if not all(same):
        raise InputError("laws", f"{first.law},{second.law}", "must be fitted to the same points")
    length, pressure = _reachable(posteriors, lengths, highest_pressure, highest_tension)
    every = contrast_of(posteriors, length, pressure, noise=noise)
    chosen = ordered(length, pressure, _greedy(every.distance, length, budget=budget, wait=wait))
    return LawTest(
        laws=(first.law, second.law),
        length=length[chosen],
        pressure=pressure[chosen],
        tensions=every.tensions[:, chosen],
        deviations=every.deviations[chosen],
        distance=math.sqrt(every.distance(chosen)),
        duration=duration(length[chosen], wait),
        wait=wait,
    )


def continuous_optimum(slopes: np.ndarray, iterations: int = 3000) -> np.ndarray:
    """Weights of the D-optimal continuous design over candidates, by the multiplicative algorithm.

    No design of any number of points has a larger determinant of its information per point.

    Args:
        slopes: derivative of the prediction to the parameters at each candidate (m, p).
        iterations: of the algorithm.
    """
    weights = np.full(len(slopes), 1.0 / len(slopes))
    for _ in range(iterations):
        inverse = np.linalg.inv(slopes.T @ (weights[:, None] * slopes))
        weights = weights * np.einsum("ij,jk,ik->i", slopes, inverse, slopes) / slopes.shape[1]
    return weights
