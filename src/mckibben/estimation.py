"""One estimation for every fit: named parameters, least squares from several starts, and what the data say of each.

A fit declares its `Parameter`s (bounds, scale, whether it is searched in its logarithm, prior), and a residual with its
derivative by the scaled parameters. `Estimation.search` descends from each start, and the least cost counts. `conclude`
refuses a search that led nowhere, and states intervals, correlation and warnings in the same way for every fit. `akaike`
compares fits, and `PartialFit` tells errors of what a fit saw from errors of what it predicts.

A fit sees what it is shown and nothing else: scales, bounds and starts are taken from the shown samples, too.

A solver reports success as soon as it can go no further, also where it never moved because the derivatives that it was given
say that nothing changes. Such a fit returns its first guesses, with intervals, and looks like a finding: `require_influence`
and `require_progress` refuse it.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from .errors import ConvergenceError, InputError

# Columns of the derivative that agree to 1 in 10^3 in direction (correlation beyond 0.999) are reported as one.
INSEPARABLE = 0.999
# A direction in parameter space this much weaker than the strongest is not determined by float64 data at all.
UNDETERMINED = 1e-7
# Share of the others' change, at least which a parameter changes with them unseen, to be named among them: 1 in 10^3, as
# above. Rounding of the projector is far below its square: 2e-16 over UNDETERMINED.
INVOLVED = 1e-3
# A difference of AICc up to this does not tell two models apart (Burnham and Anderson, 2002).
INDIFFERENT = 2.0
# Of a 95 % interval of a Gaussian.
NORMAL_QUANTILE = 1.96
STANDSTILL = 1e-8  # change of a scaled parameter below which it has not moved: solvers start this much inside of bounds
AT_BOUND = 1e-6  # distance from a bound, in scaled parameters, at which a parameter lies on it
# A fit may end where it began only at a minimum. There no parameter by itself lowers the sum of squares by more than a
# millionth, its cosine with the residual squared, or none would be moved by more than a millionth of its size.
FLAT_COSINE, FLAT_STEP = 1e-3, 1e-6
MISSED = 0.03  # share of what a record spans beyond which lasting errors are said: several times that of usual sensors
FEWEST = 8  # samples of which one can say whether errors last
NAMED = 3  # parameters that a sentence names


class Estimate(NamedTuple):
    """A fitted parameter with its 95 % interval [unit]."""

    value: float
    low: float
    high: float
    unit: str


Search = Literal["share", "log", "log1p"]


class Parameter(NamedTuple):
    """A parameter to estimate, and how it is searched.

    Attributes:
        start: value to begin with [unit].
        low: lower bound [unit].
        high: upper bound [unit].
        unit: of the value.
        size: value [unit] that is one where the value itself is searched, zero in its logarithm.
        search: what the solver sees of `value / size`: the ``share`` itself, its ``log`` where the parameter is positive by
            nature, or ``log1p`` where it may be zero and range over orders of magnitude.
        prior: mean and standard deviation of a Gaussian prior [unit]; None for none.
    """

    start: float
    low: float
    high: float
    unit: str
    size: float = 1.0
    search: Search = "share"
    prior: tuple[float, float] | None = None

    def scaled(self, value: float) -> float:
        """What the solver sees of a value [unit]; minus infinity of the logarithm of zero."""
        with np.errstate(divide="ignore"):
            share = value / self.size
            return float(
                np.log(share) if self.search == "log" else np.log1p(share) if self.search == "log1p" else share
            )

    def value(self, scaled: Any, xp: Any = np) -> Any:
        """Value [unit] of what the solver sees, by NumPy or by JAX."""
        with np.errstate(over="ignore"):
            return self.size * {"share": xp.asarray, "log": xp.exp, "log1p": xp.expm1}[self.search](scaled)


Parameters = Mapping[str, Parameter]


def bounds_of(parameters: Parameters) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds of the scaled parameters, (p,) each."""
    ends = np.array([(p.scaled(p.low), p.scaled(p.high)) for p in parameters.values()]).reshape(-1, 2)
    return ends[:, 0], ends[:, 1]


class Descent(NamedTuple):
    """End of a descent: scaled parameters (p,) at start and end, half the sum of squares, and the solver's message."""

    start: np.ndarray
    x: np.ndarray
    cost: float
    converged: bool
    message: str
    evaluations: int
    residual: np.ndarray
    jacobian: np.ndarray


def descend(
    residual: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    *,
    jacobian: Callable[[np.ndarray], np.ndarray] | None = None,
    bounds: tuple[Any, Any] = (-np.inf, np.inf),
    margin: Any = 0.0,
    x_scale: Any = "jac",
    **options: Any,
) -> Descent:
    """Descend to a minimum of the sum of squares by SciPy's trust region.

    Args:
        residual: of scaled parameters (p,), finite everywhere, (n,).
        start: where it begins (p,).
        jacobian: derivative of the residual (n, p); by differences where left out.
        bounds: of the scaled parameters.
        margin: distance from the bounds within which no descent begins: there the solver would not move.
        x_scale: of SciPy.
        **options: ``max_nfev``, ``xtol``, ``ftol`` and ``gtol`` of SciPy.
    """
    from scipy import optimize

    begin = np.clip(start, bounds[0] + margin, bounds[1] - margin)
    end = optimize.least_squares(
        residual, begin, jac="2-point" if jacobian is None else jacobian, bounds=bounds, x_scale=x_scale, **options
    )
    message = str(end.message).replace("`", "").strip(" .")
    return Descent(begin, end.x, float(end.cost), bool(end.status > 0), message, int(end.nfev), end.fun, end.jac)


def descend_linear(matrix: np.ndarray, target: np.ndarray, low: np.ndarray, *, tol: float = 1e-10) -> Descent:
    """Solve the linear least squares of matrix @ x = target with lower bounds (p,), by bounded variables."""
    from scipy import optimize

    end = optimize.lsq_linear(matrix, target, bounds=(low, np.inf), method="bvls", tol=tol)
    residual = matrix @ end.x - target
    return Descent(
        end.x, end.x, float(end.cost), bool(end.status > 0), str(end.message), int(end.nit), residual, matrix
    )


def descend_in_lanes(
    residual: Callable[[np.ndarray], np.ndarray],
    starts: np.ndarray,
    *,
    step: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    rounds: int,
    least: float = 1e-9,
) -> tuple[np.ndarray, np.ndarray]:
    """Descend from many starts at once by Gauss-Newton, with one prediction of all lanes in each round.

    Derivatives are differences over a step; a lane whose last step made it worse goes half of it back.

    Args:
        residual: of parameters (lanes, sets, p), (lanes, sets, n); a lane that cannot be predicted is NaN.
        starts: where each lane begins (lanes, p).
        step: of the differences (p,).
        bounds: lower and upper (p,).
        rounds: steps of each lane.
        least: effect squared of a parameter below which it counts as this.

    Returns:
        The best parameters of each lane (lanes, p) and their sums of squares (lanes,), infinite where none was predicted.
    """
    at, best, sums = starts, starts, np.full(len(starts), np.inf)
    count = starts.shape[1]
    for last in (*[False] * rounds, True):
        moves = np.zeros((1, count)) if last else np.vstack([np.zeros(count), np.diag(step)])
        rows = residual(at[:, None, :] + moves)
        squares = np.nan_to_num((rows[:, 0] ** 2).sum(axis=1), nan=np.inf)
        better = squares < sums
        sums, best = np.where(better, squares, sums), np.where(better[:, None], at, best)
        if not last:
            slopes = (rows[:, 1:] - rows[:, :1]) / step[:, None]
            pull = -(rows[:, :1] * slopes).sum(axis=-1)
            normal = (slopes[:, :, None] * slopes[:, None]).sum(axis=-1)
            known = np.isfinite(normal).all(axis=(1, 2), keepdims=True)
            normal = np.where(known, normal, np.eye(count))
            normal, pull = normal + np.eye(count) * np.maximum(least - normal, 0.0), np.nan_to_num(pull)
            if count > 1:
                # parameters that act alike share what they do, where rounding would leave nothing to divide by
                normal = normal + np.eye(count) * (1e-12 * normal)
            change = np.linalg.solve(normal, pull[..., None])[..., 0]
            at = np.clip(best + np.where(better[:, None], change, 0.5 * (at - best)), *bounds)
    return best, sums


@dataclass(frozen=True)
class Estimation:
    """Least squares of named parameters.

    Attributes:
        parameters: by name, in the order in which the solver sees them.
        residual: of the shown samples by the scaled parameters (n,); finite everywhere.
        jacobian: its derivative (n, p).
        margin: distance from the bounds within which no descent begins.
        options: of `descend`.
        covariance: of the errors of the residuals (n, n); independent and equal where left out.
    """

    parameters: Parameters
    residual: Callable[[np.ndarray], np.ndarray]
    jacobian: Callable[[np.ndarray], np.ndarray]
    margin: float | np.ndarray = 1e-9
    options: Mapping[str, Any] = field(default_factory=dict)
    covariance: np.ndarray | None = None

    def descend(self, start: np.ndarray) -> Descent:
        """Descend from scaled parameters (p,)."""
        bounds, residual, jacobian = bounds_of(self.parameters), self.residual, self.jacobian
        if self.covariance is not None:
            # Rows in standard deviations of independent errors, so that their sum of squares is that of the correlated ones.
            whiten = np.linalg.inv(np.linalg.cholesky(self.covariance))
            residual, jacobian = (
                functools.partial(lambda rows, x: whiten @ rows(x), rows) for rows in (residual, jacobian)
            )
        return descend(residual, start, jacobian=jacobian, bounds=bounds, margin=self.margin, **dict(self.options))

    def search(self, starts: Iterable[np.ndarray]) -> Descent:
        """Descend from each start; the least cost counts, of equal ones the first."""
        return min(map(self.descend, starts), key=lambda descent: descent.cost)


@dataclass(frozen=True)
class Conclusion:
    """What an estimation says of its parameters.

    Attributes:
        parameters: with their 95 % intervals [unit].
        half: half widths of these in what the solver sees (p,).
        correlation: of the parameters (p, p).
        warnings: as text.
    """

    parameters: dict[str, Estimate]
    half: np.ndarray
    correlation: np.ndarray
    warnings: tuple[str, ...]


def conclude(
    parameters: Parameters,
    best: Descent,
    jacobian: np.ndarray,
    residual: np.ndarray,
    *,
    subject: str | None = None,
    series: Sequence[np.ndarray] = (),
    within: bool = False,
    may_stand: bool = False,
) -> Conclusion:
    """State intervals, correlation and warnings at the end of a search.

    Args:
        parameters: by name.
        best: end of the search.
        jacobian: derivative of the prediction of the shown samples by the scaled parameters (n, p); any unit.
        residual: prediction less measurement of these (n,), in the same unit.
        subject: what was fitted; where it is named, a search that led nowhere is refused in a sentence about it.
        series: residuals that follow one another, of each series; they widen the intervals. None where all are independent.
        within: cut the intervals at the bounds.
        may_stand: the search had no more than one evaluation, and may end where it began.

    Raises:
        InputError: a parameter on which no residual depends.
        ConvergenceError: the search ended where it began.
    """
    names = tuple(parameters)
    if subject is not None:
        require_influence(jacobian, names, subject=subject)
        if not may_stand:
            require_progress(best.start, best.x, jacobian, residual, bounds_of(parameters), subject=subject)
    spread = uncertainty(jacobian, residual, names)
    half = spread.quantile * spread.standard_error
    if series:
        half = half * widening(series)
    estimates = {}
    for (name, p), x, h in zip(parameters.items(), best.x, half, strict=True):
        low, high = sorted((float(p.value(x - h)), float(p.value(x + h))))
        if within:
            low, high = max(low, p.low), min(high, p.high)
        estimates[name] = Estimate(float(p.value(x)), low, high, p.unit)
    return Conclusion(estimates, half, spread.correlation, spread.warnings)


def at_bounds(parameters: Parameters, x: np.ndarray, *, share: float = 0.0) -> tuple[str, ...]:
    """Names of the parameters whose scaled values lie on a bound: nearer than 1e-6, or than a share of their range."""
    low, high = bounds_of(parameters)
    room = np.minimum(x - low, high - x)
    near = room / np.maximum(high - low, 1e-30) < share if share else room < AT_BOUND
    return tuple(name for name, on in zip(parameters, near, strict=True) if on)


class Inseparable(NamedTuple):
    """Parameters that data do not tell apart.

    Attributes:
        names: of the parameters.
        correlation: largest of any two of them, with its sign; None where one may change with the others unseen, and no
            correlation says it.
    """

    names: tuple[str, ...]
    correlation: float | None

    def __str__(self) -> str:
        *first, last = self.names
        which = f"{', '.join(first)} and {last} apart"
        if self.correlation is None:
            return f"the data cannot tell {which}"
        most = f"{self.correlation:+.4f}" if len(self.names) == 2 else f"{abs(self.correlation):.4f} at most"
        return f"the data can hardly tell {which} (correlation {most})"


@dataclass(frozen=True)
class Uncertainty:
    """Standard errors [scaled], correlation matrix, what the data do not tell apart, and warnings, which say that too."""

    standard_error: np.ndarray
    correlation: np.ndarray
    quantile: float
    warnings: tuple[str, ...]
    inseparable: tuple[Inseparable, ...] = ()


def uncertainty(
    jacobian: np.ndarray, residual: np.ndarray, names: tuple[str, ...], confidence: float = 0.95
) -> Uncertainty:
    """Linearised intervals of a least-squares solution.

    Args:
        jacobian: derivative of the prediction to each parameter, (n, p); any scaling.
        residual: prediction less measurement, (n,).
        names: names of the parameters, for the warnings.
        confidence: confidence of the two-sided interval.

    Returns:
        Student's t quantile for n - p degrees of freedom; standard errors are infinite for parameters in an undetermined
        direction. Residuals are taken as independent, so that systematic misfit makes the intervals too narrow.
    """
    from scipy.special import stdtrit

    n, p = jacobian.shape
    degrees = max(n - p, 1)
    size, strength, directions = determined(jacobian)
    dead = size == 0.0
    variance = float(residual @ residual) / degrees
    inverse = (directions.T / strength**2) @ directions
    error = np.sqrt(variance * np.diag(inverse)) / np.where(dead, 1.0, size)
    spread = np.sqrt(np.diag(inverse))
    correlation = inverse / np.where(spread > 0, spread, 1.0)[:, None] / np.where(spread > 0, spread, 1.0)[None]
    warnings = [f"the data do not contain {name}" for name, d in zip(names, dead, strict=True) if d]
    groups = []
    for group in open_groups(directions):
        error[list(group)] = np.inf
        if len(group) > 1:
            groups.append(Inseparable(tuple(names[i] for i in group), None))
    groups += _hardly_told(correlation, names, np.isfinite(error))
    warnings += map(str, groups)
    quantile = float(stdtrit(degrees, 0.5 + confidence / 2.0))
    return Uncertainty(error, correlation, quantile, tuple(warnings), tuple(groups))


def _hardly_told(correlation: np.ndarray, names: tuple[str, ...], known: np.ndarray) -> list[Inseparable]:
    """Groups of parameters that correlate by more than `INSEPARABLE`, among those with an interval, `known` (p,)."""
    size = np.abs(correlation) * (known & known[:, None])
    np.fill_diagonal(size, 0.0)
    groups = []
    for group in _chained(size > INSEPARABLE):
        inside = np.ix_(group, group)
        most = np.unravel_index(np.argmax(size[inside]), (len(group), len(group)))
        groups.append(Inseparable(tuple(names[i] for i in group), float(correlation[inside][most])))
    return groups


def _chained(joined: np.ndarray) -> tuple[tuple[int, ...], ...]:
    """Indices of each group of which every member is joined to another one, by bool (p, p), in ascending order."""
    joined = joined | np.diag(joined.any(axis=1))
    for _ in joined:  # a chain of p parameters is closed after p steps
        joined = joined @ joined
    return tuple(dict.fromkeys(tuple(np.flatnonzero(row).tolist()) for row in joined if row.any()))


def determined(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions in parameter space, each parameter in units of its effect, that data determine.

    Args:
        jacobian: derivative of the prediction to each parameter, (n, p); any scaling.

    Returns:
        Norm of each column (p,), strength of each direction (k,) and the directions, orthonormal (k, p).
    """
    size = np.linalg.norm(jacobian, axis=0)
    _, strength, directions = np.linalg.svd(jacobian / np.where(size == 0.0, 1.0, size), full_matrices=False)
    strong = strength >= UNDETERMINED * max(strength[0], 1e-300)
    return size, strength[strong], directions[strong]


def open_groups(directions: np.ndarray) -> tuple[tuple[int, ...], ...]:
    """Groups of parameters whose changes cancel within the group; one alone changes nothing.

    They follow from the projector onto what the directions leave open. A basis of that space, of which a singular value
    decomposition returns any, mixes independent groups and may pass by a parameter.

    Args:
        directions: orthonormal, all that the data determine (k, p).

    Returns:
        Indices of each group, in ascending order.
    """
    projector = np.eye(directions.shape[1]) - directions.T @ directions
    involved = np.diag(projector) > INVOLVED**2
    return _chained((np.abs(projector) > INVOLVED**2) & involved & involved[:, None])


def posterior_uncertainty(covariance: np.ndarray, names: tuple[str, ...]) -> Uncertainty:
    """Intervals of parameters with priors, from their covariance at the most probable values.

    Args:
        covariance: of the parameters, (p, p); any scaling.
        names: names of the parameters, for the warnings.
    """
    error = np.sqrt(np.diag(covariance))
    size = np.where(error > 0.0, error, 1.0)
    correlation = covariance / size[:, None] / size
    groups = tuple(_hardly_told(correlation, names, np.isfinite(error)))
    return Uncertainty(error, correlation, NORMAL_QUANTILE, tuple(map(str, groups)), groups)


def widening(residuals: Sequence[np.ndarray]) -> float:
    """Factor on standard errors for residuals that follow one another: sqrt((1 + r)/(1 - r)), r at a lag of one sample."""
    top = sum(float(r[1:] @ r[:-1]) for r in residuals)
    bottom = sum(float(r @ r) for r in residuals)
    r = min(max(top / bottom, 0.0), 0.9999) if bottom > 0.0 else 0.0
    return float(np.sqrt((1.0 + r) / (1.0 - r)))


def akaike(error: np.ndarray, parameters: float, *, resolution: float = 1e-15) -> float:
    """Akaike's criterion with the correction for small samples (AICc) of errors (n,); infinite where they are too few.

    The noise level counts as a parameter, and belongs to `parameters`. Root mean square errors below `resolution` (in the
    unit of the errors) count as that: what is left of an exact fit is rounding, whose size says nothing.
    """
    n, k = error.size, parameters
    least = resolution**2
    variance = max(float(np.mean(error**2)), least) if n else least
    return n * float(np.log(variance)) + 2.0 * k * n / (n - k - 1.0) if n > k + 1 else float("inf")


class PartialFit(abc.ABC):
    """A fit to some samples of a record, and its prediction of all; `train`, bool (n,), is what it saw."""

    train: np.ndarray

    @property
    @abc.abstractmethod
    def error(self) -> np.ndarray:
        """Error of every sample (n,)."""

    def rmse(self, *, seen: bool) -> float:
        """Root mean square error of the samples that the fit saw, or of those that it did not; NaN if there are none."""
        some = self.error[self.train == seen]
        return float(np.sqrt(np.mean(some**2))) if some.size else float("nan")

    def max_error(self, *, seen: bool) -> float:
        """Largest of those errors; NaN if there are none."""
        some = self.error[self.train == seen]
        return float(np.abs(some).max()) if some.size else float("nan")


def require_influence(jacobian: np.ndarray, names: Sequence[str], *, subject: str) -> None:
    """Refuse free parameters on which no residual depends.

    Args:
        jacobian: derivative of the residuals to each free parameter at the solution, (n, p); any scaling.
        names: names of the parameters.
        subject: was fitted, for the sentence.

    Raises:
        InputError: names the parameters whose columns are zero.
    """
    dead = [name for name, column in zip(names, np.asarray(jacobian).T, strict=True) if not np.any(column)]
    if dead:
        one = len(dead) == 1
        raise InputError(
            "free",
            listed(dead),
            f"the data of {subject} do not depend on {'it' if one else 'them'}, so no fit can find "
            f"{'it: fix this parameter' if one else 'them: fix these parameters'}, or begin with other values",
        )


def require_progress(
    start: np.ndarray,
    end: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    subject: str,
) -> None:
    """Refuse a fit that ended where it began, unless it began at a minimum.

    Args:
        start: scaled parameters at the first evaluation (p,).
        end: the same at the solution (p,).
        jacobian: derivative of the residual to the scaled parameters at the solution, (n, p).
        residual: at the solution, (n,).
        bounds: bounds of the scaled parameters, lower and upper (p,) each.
        subject: was fitted, for the sentence.

    Raises:
        ConvergenceError: says that the values are the first guesses.
    """
    moved = np.abs(end - start) > STANDSTILL * np.maximum(1.0, np.abs(start))
    if moved.any():
        return
    slope, size = jacobian.T @ residual, np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    outward = ((end - bounds[0] < AT_BOUND) & (slope > 0.0)) | ((bounds[1] - end < AT_BOUND) & (slope < 0.0))
    cosine = np.abs(slope) / (size * max(float(np.linalg.norm(residual)), 1e-300))
    step = np.abs(slope) / size**2
    if ((cosine > FLAT_COSINE) & (step > FLAT_STEP) & ~outward).any():
        raise ConvergenceError(
            f"The fit of {subject} ended where it began, and its first guesses are no minimum; begin with other values."
        )


def misfit(subject: str, measured: np.ndarray, error: np.ndarray) -> list[str]:
    """Say that a model does not describe a record, where its errors are large and no noise.

    Args:
        subject: what was recorded.
        measured: its samples, one after the other, shape (n,), in any unit.
        error: of the model at each, shape (n,), in the same unit.

    Returns:
        One sentence where the error is more than `MISSED` of what the samples span and lasts from sample to sample; else
        nothing. By J. von Neumann's ratio, Ann. Math. Stat. 12, 1941, 367, squared differences of neighbours over squares:
        2 for white noise, below 2 - 2.56/sqrt(n) in one of ten records of it.
    """
    rms, spanned, n = float(np.sqrt(np.mean(error**2))), float(np.ptp(measured)), len(error)
    lasts = np.sum(np.diff(error) ** 2) < min(1.5, 2.0 - 2.56 / np.sqrt(max(n, 1))) * np.sum(error**2)
    if n < FEWEST or rms <= MISSED * spanned or not lasts:
        return []
    by = f"{100.0 * rms / spanned:.2g} % of what it spans" if spanned else "more than what it spans"
    lasting = "on one side for several samples at a time, as noise is not; intervals hold for a model that describes it"
    return [f"the model does not describe the record: it misses {subject} by {by}, rms, {lasting}"]


def listed(names: Sequence[str]) -> str:
    """Some names, and how many more there are."""
    few, more = list(names[:NAMED]), len(names) - NAMED
    return ", ".join(few) if more <= 0 else f"{', '.join(few)} and {more} more"
