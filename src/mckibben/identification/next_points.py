"""The points of length and pressure at which a further measurement teaches most, and the protocol that visits them.

A posterior says how far its samples disagree about the tension at every point that could be measured. From the covariance
of the law's tension and of the discrepancy over all candidates follows what a set of measurements would leave, in the linear
approximation: of the parameters (the mutual information of parameters and measurements is largest), or of the tension at
stated points (the mean variance is smallest). Points are taken one after the other, each the one that gains most per second
of machine time, until the budget is spent.
Every point is reached with rising pressure after the muscle was vented at its length, so that all lie on one branch of the
hysteresis, and is held before it counts, so that creep has passed.
Range: the linear approximation is that of the posterior's samples; no point lies outside of the measured range of
contraction and pressure, because a muscle that has survived one pressure need not survive a higher one.
Source: V. V. Fedorov, Theory of Optimal Experiments, Academic Press 1972; D. V. Lindley, Ann. Math. Stat. 27(4), 1956.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .posterior import Posterior
from .uncertainty import Estimate

GRID = (7, 9)  # lengths and pressures of the candidates
MOVE, VENT, READ = 2.0, 3.0, 1.0  # time to a point, to an empty muscle at another length, and of a reading [s]


@dataclass(frozen=True)
class Candidates:
    """Points that could be measured, with what the samples of a posterior say of them.

    Attributes:
        length: (m,) [m].
        pressure: gauge (m,) [Pa].
        law: covariance of the law's tension between them (m, m) [N^2].
        discrepancy: covariance of the discrepancy given the data (m, m) [N^2].
        parameters: covariance of the tension with each parameter (m, p).
        noise: standard deviation of a reading [N].
    """

    length: np.ndarray
    pressure: np.ndarray
    law: np.ndarray
    discrepancy: np.ndarray
    parameters: np.ndarray
    noise: float

    def information(self, chosen: list[int]) -> float:
        """Mutual information of the parameters and readings at some points [nat]."""
        nuisance = self.discrepancy[np.ix_(chosen, chosen)] + self.noise**2 * np.eye(len(chosen))
        whole = nuisance + self.law[np.ix_(chosen, chosen)]
        return float(0.5 * (np.linalg.slogdet(whole)[1] - np.linalg.slogdet(nuisance)[1]))

    def left(self, chosen: list[int], at: np.ndarray) -> float:
        """Mean variance of the tension at some points, after readings at others [N^2]."""
        whole = self.law + self.discrepancy
        if not chosen:
            return float(np.diag(whole)[at].mean())
        noisy = whole[np.ix_(chosen, chosen)] + self.noise**2 * np.eye(len(chosen))
        across = whole[at][:, chosen]
        return float((np.diag(whole)[at] - np.einsum("ij,ji->i", across, np.linalg.solve(noisy, across.T))).mean())


@dataclass(frozen=True)
class NextExperiment:
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

    def __len__(self) -> int:
        return len(self.length)

    def protocol(self) -> str:
        """The protocol as a TOML file that ``mckibben run`` takes."""
        lines = [
            "schema = 1",
            'name = "next"',
            f'title = "The next {len(self)} points"',
            'needs = ["pressure sensor", "span sensor", "tension sensor"]',
        ]
        before = float("nan")
        for i, (length, pressure) in enumerate(zip(self.length, self.pressure, strict=True), 1):
            if length != before:
                lines += _step("vent", f'span = {{ to = "{length:.6g} m", in = "{VENT:g} s" }}',
                               f'pressure = {{ to = "0 bar", in = "{VENT / 3.0:g} s" }}')  # fmt: skip
            lines += _step("approach", f'pressure = {{ to = "{pressure:.6g} Pa", in = "{MOVE:g} s" }}')
            if self.wait > 0.0:
                lines += _step("wait", f'for = "{self.wait:g} s"')
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
    correlated: bool = False,
) -> Candidates:
    """What a posterior says of points that could be measured, (m,) each.

    Args:
        posterior: samples from the measurements so far.
        length: [m].
        pressure: gauge [Pa].
        noise: standard deviation of a reading [N]; that of the posterior by default.
        correlated: count that the data so far tie the discrepancy to the parameters, so that the tension is known better
            than either; the choice does without, and what is expected of it counts it.
    """
    tension = posterior.signed_tensions(length, pressure)
    if correlated:
        tension = tension + posterior.mean_discrepancy(length, pressure)
    centred = tension - tension.mean(axis=0)
    values = np.stack(list(posterior.samples.values()), axis=1)
    return Candidates(
        length=length,
        pressure=pressure,
        law=centred.T @ centred / len(centred),
        discrepancy=posterior.discrepancy_covariance(length, pressure),
        parameters=centred.T @ (values - values.mean(axis=0)) / len(centred),
        noise=noise or float(np.median(posterior.noise) * posterior.sensor_noise),
    )


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
    chosen: list[int] = []
    spent = 0.0
    while True:
        now = candidates.information(chosen) if about is None else -candidates.left(chosen, about)
        best: tuple[float, int, float] | None = None
        for i in range(len(candidates.length)):
            if every and i in chosen:
                continue
            cost = duration(candidates, [*chosen, i], wait) - spent
            if spent + cost > budget:
                continue
            after = candidates.information([*chosen, i]) if about is None else -candidates.left([*chosen, i], about)
            rate = (after - now) / cost
            if best is None or rate > best[0]:
                best = (rate, i, cost)
        if best is None:
            break
        chosen.append(best[1])
        spent += best[2]
    if not chosen:
        least = VENT + MOVE + wait + READ + 1.0
        raise InputError("budget", f"{budget:g} s", f"must be {least:g} s or more, the time of one point")
    return chosen


def duration(candidates: Candidates, chosen: list[int], wait: float) -> float:
    """Machine time of some points in the order of `ordered` [s]."""
    lengths = len({float(candidates.length[i]) for i in chosen})
    return lengths * VENT + len(chosen) * (MOVE + wait + READ) + 1.0


def ordered(candidates: Candidates, chosen: list[int]) -> list[int]:
    """Points from the longest length to the shortest, at each with rising pressure."""
    return sorted(chosen, key=lambda i: (-candidates.length[i], candidates.pressure[i]))


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
    points = posterior.points
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
    band = posterior.tension(length, pressure)
    safe = (band.high < highest_tension) & (band.median > 0.0)
    if not safe.any():
        raise InputError("rig", None, "must bear the tension of a point of the map")
    length, pressure = length[safe], pressure[safe]
    about = None
    if question is not None:
        length, pressure = np.append(length, question[0]), np.append(pressure, question[1])
        about = np.array([len(length) - 1])
    every = candidates_of(posterior, length, pressure, noise=noise)
    reachable = Candidates(
        length=every.length[: safe.sum()],
        pressure=every.pressure[: safe.sum()],
        law=every.law,
        discrepancy=every.discrepancy,
        parameters=every.parameters,
        noise=every.noise,
    )
    chosen = ordered(reachable, choose(reachable, budget=budget, wait=wait, about=about))
    every = candidates_of(posterior, length, pressure, noise=noise, correlated=True)
    whole = every.law + every.discrepancy
    noisy = whole[np.ix_(chosen, chosen)] + every.noise**2 * np.eye(len(chosen))
    across = every.parameters[chosen]
    variance = np.array([values.var() for values in posterior.samples.values()])
    left = variance - np.einsum("ij,ij->j", across, np.linalg.solve(noisy, across))
    all_points = np.arange(len(length)) if about is None else about
    return NextExperiment(
        length=every.length[chosen],
        pressure=every.pressure[chosen],
        duration=duration(every, chosen, wait),
        wait=wait,
        information=every.information(chosen),
        intervals=posterior.intervals(),
        expected=dict(zip(posterior.samples, np.sqrt(np.maximum(left, 0.0) / variance).tolist(), strict=True)),
        deviation=(float(np.sqrt(every.left([], all_points))), float(np.sqrt(every.left(chosen, all_points)))),
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
