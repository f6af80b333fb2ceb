"""Identification problem: a law, its known and free parameters, the data; and its solution.

The solution is a bounded least squares from many starting points, with derivatives by automatic differentiation.

A law may have Gaussian priors of its parameters, and a table an error of each set length, with a standard deviation: one
muscle that is mounted at a length is off by the same distance at every pressure. Both make the solution the most
probable one. Errors along one curve of tension over pressure are not independent, as noise would be, so that a
curve counts as `CURVE_POINTS` independent points at most; the noise is that which is left over, `LEAST_NOISE` or more.

How far a length that is yet to be set may be off follows from the lengths at which tension was measured. The error of a set
length is that of the muscle, which all its set lengths share (where its rest length was measured, how it sits in its
fittings), and one of its own:

    d_jk = m_j + u_jk,   m_j ~ N(0, s_m^2),   u_jk ~ N(0, s_u^2)

Both deviations are averaged over their posterior. With the law linearised at its fit their likelihood follows in closed
form; the priors are half-Cauchy, as wide as the stated error. Where few muscles were measured, the data hardly bound how
far muscles differ, and the tails say so.
"""

from __future__ import annotations

import abc
import functools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, jax
from ..answers import brief
from ..documents import JsonValue
from ..engine.native import EngineFunction, compile_function
from ..errors import InputError, each_once
from ..estimation import Descent, Estimate, Parameter, bounds_of, descend
from ..muscles.build import construct, required_fields
from ..muscles.law import TensionLaw
from ..muscles.laws import law_type
from ..muscles.muscle import Muscle
from ..quantities import Quantity, declared
from ..recordings import ForceMap

Formula = Callable[..., np.ndarray]
# Independent points along a curve of tension over pressure at one length, of as many as were measured.
CURVE_POINTS = 3.0
FIRST_NOISE, LEAST_NOISE, PASSES = 0.01, 0.002, 3  # noise as a share of the largest tension; descents that estimate it
# Longest length of usual muscles [m], and from which ratio to it one is of another size.
USUAL_LENGTH, OTHER_SIZE = 0.3, 2.0
SAME_LENGTH = 1e-6  # rest lengths that differ by no more are one [m]
LENGTH_STEP = 1e-6  # of the difference by which a tension is derived to the length [m]
LEVELS = np.geomspace(0.02, 20.0, 25)  # of both deviations, in stated errors
CONFIDENCE = 0.95
HALVINGS = 60  # of the bracket of a quantile, down to rounding
# More distinct values than this are gathered into `BINS` groups of equal size.
MOST_GROUPS, BINS = 30, 10


@dataclass(frozen=True)
class Problem:
    """Least squares of a law's tension against a force map.

    Residuals are unweighted: sensor noise and the rounding of lengths do not shrink with the tension, and errors are
    judged against the largest tension. `points` are the taut ones, and the slack ones that say where the law may not pull
    (`ForceMap.informative_slack`), at zero tension. `known` holds fixed parameters [SI], scalars or one value per point.
    """

    law: str
    free: tuple[str, ...]
    known: Mapping[str, Any]
    points: ForceMap
    length_error: float = 0.0  # standard deviation of the error of each set length [m]
    __repr__ = brief

    @classmethod
    def of(
        cls,
        law: str,
        points: ForceMap,
        *,
        known: Mapping[str, Scalar] | None = None,
        free: tuple[str, ...] | None = None,
        slack: bool = True,
        length_error: float = 0.0,
    ) -> Problem:
        """Set up a problem, with the rest length and the upper working length taken from the table where it has them.

        Raises:
            InputError: if a parameter that the law needs is neither free nor known.
        """
        kind = law_type(law)
        fields = declared(kind)
        parameters = {k: v for k, v in dict(known or {}).items() if k in fields}
        if points.diameter is not None and "rest_diameter" in fields:
            parameters.setdefault("rest_diameter", points.diameter)
        free = tuple(each_once("free", free or _freed(kind, parameters, points)))
        if "rest_length" in fields and "rest_length" not in parameters and "rest_length" not in free:
            if points.rest_length is None:
                allowed = f"is missing: the law {law} needs the rest length, or a column rest_length"
                raise InputError("rest_length", None, allowed, where=points.name, remedy="rest_length")
            parameters["rest_length"] = points.rest_length
        if "upper_length" in fields:
            # Every measured point has to lie in the working range, each muscle in its own.
            longest: Any = float(points.length.max()) if len(points) else 0.0
            if points.rest_length is not None:
                longest = np.array([points.length[points.rest_length == r].max() for r in points.rest_length])
            parameters["upper_length"] = np.maximum(np.asarray(parameters.get("upper_length", 0.0), float), longest)
        for name in required_fields(kind):
            if name not in parameters and name not in free:
                raise InputError(
                    name,
                    None,
                    f"is missing: the law {law} needs it ({fields[name].doc})",
                    where=points.name,
                    remedy=f"parameter {name}",
                )
        if not free:
            stated = ", ".join(name for name in kind.fitted if name in parameters)
            problem = f"is nothing: {stated} of the law {law} are all stated, so there is nothing to fit"
            raise InputError("free", None, problem, where=points.name)
        taut = int(points.taut.sum())
        if taut < len(free) + 2:
            need = f"{len(free) + 2} or more with tension for the {len(free)} free parameters of the law {law}"
            raise InputError("points", None, f"must be {need}, got {taut}", where=points.name)
        keep = points.taut | (points.informative_slack & slack)
        fixed = {k: (np.asarray(v)[keep] if np.ndim(v) else float(v)) for k, v in parameters.items() if k not in free}
        counted = replace(points.select(keep), tension=np.maximum(points.tension[keep], 0.0))
        return cls(law=law, free=tuple(free), known=fixed, points=counted, length_error=float(length_error))

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Declarations of the free parameters."""
        fields = declared(law_type(self.law))
        return {name: fields[name] for name in self.free}

    @functools.cached_property
    def typical(self) -> dict[str, tuple[float, float]]:
        """Usual range of each free parameter, for a muscle of the size of the data [SI].

        The declared ranges are of muscles of some 30 cm. One of another order of size is similar to them at the same
        pressures, so that what has metres in it changes by their power; a newton is a pascal times a square metre.
        """
        factors = {name: self._size ** _power_of_length(q.unit) for name, q in self.quantities.items()}
        return {n: (q.typical[0] * factors[n], q.typical[1] * factors[n]) for n, q in self.quantities.items()}

    @functools.cached_property
    def _size(self) -> float:
        """Longest length of the data over that of usual muscles [1]; 1 where they are of the same order."""
        size = float(self.points.length.max()) / USUAL_LENGTH if len(self.points) else 1.0
        return 1.0 if 1.0 / OTHER_SIZE < size < OTHER_SIZE else size

    @functools.cached_property
    def parameters(self) -> dict[str, Parameter]:
        """The free parameters, each in the size of its usual range, so that the values that are searched are about one."""
        priors = law_type(self.law).priors
        return {
            name: Parameter(
                0.5 * (ends[0] + ends[1]), *q.bounds, q.unit, max(abs(b) for b in ends), prior=priors.get(name)
            )
            for (name, q), ends in zip(self.quantities.items(), self.typical.values(), strict=True)
        }

    @functools.cached_property
    def scale(self) -> np.ndarray:
        """Size of each free parameter."""
        return np.array([p.size for p in self.parameters.values()])

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Declared bounds over `scale`."""
        return bounds_of(self.parameters)

    def starts(self, count: int, seed: int) -> np.ndarray:
        """Starting points from the usual ranges by a Latin hypercube, over `scale`, shape (count, free)."""
        unit = latin_hypercube(count, len(self.free), seed)
        columns = []
        for u, (low, high) in zip(unit.T, self.typical.values(), strict=True):
            logarithmic = low > 0.0 and high / low > 20.0
            columns.append(low * (high / low) ** u if logarithmic else low + (high - low) * u)
        scaled: np.ndarray = np.stack(columns, axis=1) / self.scale
        if self._size != 1.0 and "turns" in self.free:
            # A long muscle of a usual diameter is as likely as a similar one: its threads turn more often.
            scaled[1::2, self.free.index("turns")] *= self._size
        return scaled

    def candidates(self, seed: int) -> tuple[np.ndarray, np.ndarray]:
        """Starting points within the bounds, over `scale`, and the tension of each at all points [N]: (m, free), (m, n)."""
        if seed not in self._candidates:  # cross-validations share them: they know no tension that was measured
            low, high = self.bounds
            inside = 1e-9 * np.maximum(1.0, np.abs(low)), 1e-9 * np.maximum(1.0, np.abs(high))
            draws = np.clip(self.starts(CANDIDATES, seed), low + inside[0], high - inside[1])
            force = self.functions()[0]
            self._candidates[seed] = draws, np.array([force(one) for one in draws])
        return self._candidates[seed]

    @functools.cached_property
    def _candidates(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        return {}

    @property
    def priors(self) -> list[tuple[int, float, float]]:
        """Place, mean and standard deviation of those free parameters that have a prior [SI]."""
        return [(i, *p.prior) for i, p in enumerate(self.parameters.values()) if p.prior is not None]

    @property
    def curves(self) -> np.ndarray:
        """Number of the curve of each point, (n,): points of one rest length at one length."""
        rest = np.zeros(len(self.points)) if self.points.rest_length is None else self.points.rest_length
        both = np.round(np.stack([rest, self.points.length], axis=1), 9)
        return np.unique(both, axis=0, return_inverse=True)[1].reshape(-1)

    def functions(self) -> tuple[Formula, Formula]:
        """Signed braid tension [N] and its derivative to the scaled parameters at all points: (n,) and (n, free).

        Both take a shift of the lengths [m], (n,), as a second argument.
        """
        n = len(self.points)
        run, run_slopes = _compiled(law_type(self.law), self.free, tuple(sorted(self.known)))
        known = tuple(np.broadcast_to(np.asarray(self.known[name], float), (n,)) for name in sorted(self.known))
        length, pressure = np.asarray(self.points.length, float), np.asarray(self.points.pressure, float)

        def force(scaled: np.ndarray, shift: Any = 0.0) -> np.ndarray:
            return np.broadcast_to(run(scaled * self.scale, known, length + shift, pressure, lanes=n, threads=1), (n,))

        def slopes(scaled: np.ndarray, shift: Any = 0.0) -> np.ndarray:
            columns = np.asarray(run_slopes(scaled * self.scale, known, length + shift, pressure, lanes=n, threads=1))
            columns = columns if columns.ndim == 2 else columns[:, None]  # the same at all points
            return np.asarray(np.broadcast_to(columns, (len(self.free), n)).T * self.scale)

        return force, slopes

    @property
    def runs_by_xla(self) -> bool:
        """Whether no kernel can evaluate the law."""
        return any(f.engine == "xla" for f in _compiled(law_type(self.law), self.free, tuple(sorted(self.known))))


def _power_of_length(unit: str) -> float:
    """The power of metres in a unit: 2 of N, 1 of N/m, 0 of Pa, -1 of Pa/m."""
    terms = re.findall(r"([*/]?)([A-Za-z]+)(?:\^([\d.]+))?", unit)
    signs = {"/": -1.0}
    return sum(
        signs.get(sign, 1.0) * {"m": 1.0, "N": 2.0}.get(name, 0.0) * float(power or 1.0) for sign, name, power in terms
    )


def latin_hypercube(count: int, axes: int, seed: int) -> np.ndarray:
    """Points (count, axes) in the unit cube, one in each of `count` equal parts of every axis.

    The draws are those of `scipy.stats.qmc.LatinHypercube`; SciPy's statistics would take longer to load than a fit takes.
    """
    chance = np.random.default_rng(seed)
    shares = chance.uniform(size=(count, axes))
    parts = np.tile(np.arange(1, count + 1), (axes, 1))
    for row in parts:
        chance.shuffle(row)
    return np.asarray((parts.T - shares) / count)


def _freed(kind: type[TensionLaw], parameters: Mapping[str, Scalar], points: ForceMap) -> tuple[str, ...]:
    """Parameters of a law that are free by default.

    A dimension that nobody gave is freed in place of what it would make redundant; a parameter that so few lengths cannot
    show is not, nor one that belongs to a single muscle where several were measured.
    """
    lengths = len(np.unique(np.round(points.length[points.taut], 6)))
    free = [name for name in kind.fitted if name not in parameters and lengths >= kind.lengths_needed.get(name, 0)]
    if points.rest_length is not None and len(points) and np.ptp(points.rest_length) > SAME_LENGTH:
        free = [name for name in free if name not in kind.of_one_muscle]
    for name, instead_of in kind.fitted_if_unknown.items():
        if name not in parameters:
            free = [f for f in free if f not in instead_of] + [name]
    return tuple(free)


@functools.lru_cache(maxsize=64)
def _compiled(
    kind: type[TensionLaw], free: tuple[str, ...], known: tuple[str, ...]
) -> tuple[EngineFunction, EngineFunction]:
    examples = np.zeros(len(free)), tuple(0.0 for _ in known), 0.0, 0.0
    run, run_slopes = (
        compile_function(functools.partial(function, kind, free, known), *examples, title=function.__name__)
        for function in (tension_at, slopes_at)
    )
    return run, run_slopes


def tension_at(
    kind: type[TensionLaw],
    free: tuple[str, ...],
    known: tuple[str, ...],
    values: Any,
    fixed: Any,
    length: Scalar,
    pressure: Scalar,
) -> Any:
    """Signed tension of the braid by a law with free and known parameters [N]."""
    parameters = dict(zip(free, values, strict=True)) | dict(zip(known, fixed, strict=True))
    return construct(kind, parameters).braid_tension(length, pressure)


def slopes_at(kind: Any, free: Any, known: Any, values: Any, fixed: Any, length: Scalar, pressure: Scalar) -> Any:
    """Derivative of `tension_at` by the free parameters (free,)."""
    return jax.jacfwd(lambda v: tension_at(kind, free, known, v, fixed, length, pressure))(values)


SEED = 1
CANDIDATES, POLISHED, AGREE = 192, 12, 3
# Two solutions are the same when their sums of squares agree to this share.
SAME = 1e-6


class LengthEvidence(NamedTuple):
    """What the data say about p parameters and the errors of c set lengths, linearised at a fit.

    Attributes:
        information: of the data (p + c, p + c), the errors last, in stated errors.
        pull: information times the values that data and the parameters' priors ask for (p + c,).
        prior: information of the parameters' priors (p, p).
        muscle: number of the muscle of each set length (c,).
        stated: standard deviation of an error as stated [m].
    """

    information: np.ndarray
    pull: np.ndarray
    prior: np.ndarray
    muscle: np.ndarray
    stated: float

    def reach(self) -> tuple[float, float]:
        """Half width of the 95 % interval of a length yet to be set, of a fitted muscle and of another one [m]."""
        muscles = len(set(self.muscle.tolist()))
        pairs = [(own, whole) for own in LEVELS for whole in (LEVELS if muscles > 1 else LEVELS[:1])]
        # Half-Cauchy densities times the deviations, because the levels are even in the logarithm.
        logs = np.array([0.5 * self._evidence(*p) + sum(math.log(s / (1.0 + s * s)) for s in p) for p in pairs])
        chance = np.exp(logs - logs.max())
        chance /= chance.sum()
        own, whole = np.array(pairs).T
        return self.stated * _half_width(own, chance), self.stated * _half_width(np.hypot(own, whole), chance)

    def _evidence(self, own: float, whole: float) -> float:
        """Twice the log likelihood of the two deviations, but for a constant."""
        count, curves = len(self.prior), len(self.muscle)
        covariance = own**2 * np.eye(curves) + whole**2 * (self.muscle[:, None] == self.muscle)
        inner = self.information.copy()
        inner[:count, :count] += self.prior
        inner[count:, count:] += np.linalg.inv(covariance)
        sizes = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
        return float(self.pull @ np.linalg.solve(inner, self.pull) - sizes)


def _half_width(deviations: np.ndarray, chance: np.ndarray) -> float:
    """What a mixture of normal variables without mean exceeds, to either side, in 5 % of cases."""
    low, high = 0.0, 10.0 * float(deviations.max())
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        outside = sum(c * math.erfc(middle / (s * math.sqrt(2.0))) for s, c in zip(deviations, chance, strict=True))
        low, high = (middle, high) if outside > 1.0 - CONFIDENCE else (low, middle)
    return high


@dataclass(frozen=True)
class LinearPosterior:
    """What priors and data say together, linearised at the solution.

    Attributes:
        covariance: of the scaled parameters (free, free).
        shifts: error of the set length of each curve, with its standard deviation [m], each (curves,).
        effective: number of parameters and length errors that the data determine rather than their priors.
        noise: share of the largest tension.
        lengths: what the data say about the errors of set lengths; None without such errors.
    """

    covariance: np.ndarray
    shifts: tuple[np.ndarray, np.ndarray]
    effective: float
    noise: float
    lengths: LengthEvidence | None = None


@dataclass(frozen=True)
class Solution:
    """The best solution of a multi-start search; `posterior` where the problem has priors."""

    start: np.ndarray
    scaled: np.ndarray
    tension: np.ndarray
    jacobian: np.ndarray
    converged: bool
    message: str
    starts: int
    agreeing: int
    posterior: LinearPosterior | None = None

    def values(self, problem: Problem) -> dict[str, float]:
        """The free parameters [SI]."""
        return {n: float(v) for n, v in zip(problem.free, self.scaled * problem.scale, strict=True)}


def solve(
    problem: Problem,
    *,
    train: np.ndarray | None = None,
    near: Sequence[np.ndarray] = (),
    search: bool = True,
    seed: int = SEED,
) -> Solution:
    """Fit a problem.

    Args:
        problem: the problem to solve.
        train: which points count, bool (n,); all by default. The compiled function is shared by all such subsets, and the
            tension of the others moves no bit of the solution.
        near: scaled starting points to try first.
        search: also search from starting points drawn over the usual ranges.
        seed: seed of that draw.

    Returns:
        The solution with the smallest sum of squares. It is marked converged only if a solver reached its tolerance.
    """
    force, slopes = problem.functions()
    weight = np.ones(len(problem.points)) if train is None else np.asarray(train, float)
    low, high = problem.bounds
    inside = 1e-9 * np.maximum(1.0, np.abs(low)), 1e-9 * np.maximum(1.0, np.abs(high))
    queue = [np.clip(start, low + inside[0], high - inside[1]) for start in near]
    descend = _Descent(problem, force, slopes, weight)
    if search:
        draws, pulls = problem.candidates(seed)
        cost = np.sum(descend.misfit(descend.whole(draws), unilateral=False, force=pulls) ** 2, axis=-1)
        queue += list(draws[np.argsort(cost)[:POLISHED]])
    solutions = []
    for start in queue:
        solutions.append(descend(start))
        if _agreeing(solutions) >= AGREE:
            break
    best = min(solutions, key=lambda f: (not f.converged, f.cost))
    if descend.informed:
        for _ in range(PASSES):
            descend.estimate_noise(best.x)
            best = descend(best.x, start_with=best)
    scaled, shift = descend.parts(best.x)
    pull = np.maximum(force(scaled, shift), 0.0)
    return Solution(
        start=best.start,
        scaled=scaled,
        tension=pull,
        jacobian=np.where(pull > 0.0, 1.0, 0.0)[:, None] * slopes(scaled, shift),
        converged=bool(best.converged and np.isfinite(best.x).all() and best.cost < 1e6),
        message=best.message,
        starts=len(solutions),
        agreeing=_agreeing(solutions),
        posterior=replace(descend.posterior(best.x), lengths=descend.length_evidence(best.x))
        if descend.informed
        else None,
    )


def _agreeing(values: Sequence[Descent]) -> int:
    costs = [f.cost if f.converged else np.inf for f in values]
    return sum(c <= min(costs) * (1.0 + SAME) + 1e-30 for c in costs)


class _Descent:
    """Two descents from one start: with the signed force of the braid, whose derivative never vanishes, then as measured.

    The second sees what the sensor sees, max(F, 0), so that a law is not blamed for how slack it would be.

    Its vector holds the scaled parameters and, where lengths have errors, those in standard deviations, one for each curve.
    """

    def __init__(self, problem: Problem, force: Formula, slopes: Formula, weight: np.ndarray) -> None:
        self.problem, self.force, self.slopes, self.weight = problem, force, slopes, weight
        # What does not count is neither a scale nor a number: the tension of a hidden point may be anything.
        self.seen = weight > 0.0
        self.tension = np.where(self.seen, problem.points.tension, 0.0)
        self.taut = self.seen & problem.points.taut
        self.size = max(float(self.tension.max()), 1e-9)
        self.noise = FIRST_NOISE
        self.priors = problem.priors
        self.informed = bool(self.priors) or problem.length_error > 0.0
        self.last: dict[bytes, np.ndarray] = {}
        self.count = len(problem.free)
        if self.informed:
            self.curve = problem.curves
            number = np.bincount(self.curve, weights=weight)
            self.weight = weight * np.sqrt(np.minimum(1.0, CURVE_POINTS / np.maximum(number, 1.0)))[self.curve]
        self.shifts = int(self.curve.max()) + 1 if problem.length_error > 0.0 else 0

    def whole(self, vector: np.ndarray) -> np.ndarray:
        """A vector, or several (.., p), with all length errors, zero where it has none."""
        missing = self.count + self.shifts - vector.shape[-1]
        return np.concatenate([vector, np.zeros((*vector.shape[:-1], missing))], axis=-1) if missing else vector

    def parts(self, vector: np.ndarray) -> tuple[np.ndarray, Any]:
        """Scaled parameters, and the shift of the length of each point [m]."""
        shift = self.problem.length_error * vector[self.count :][self.curve] if self.shifts else 0.0
        return vector[: self.count], shift

    def braid(self, vector: np.ndarray) -> np.ndarray:
        """Signed force at all points [N], kept of the last vector: a descent asks for it again with the derivative."""
        if (key := vector.tobytes()) not in self.last:
            self.last = {key: self.force(*self.parts(vector))}
        return self.last[key]

    def misfit(self, vector: np.ndarray, *, unilateral: bool, force: np.ndarray | None = None) -> np.ndarray:
        force = self.braid(vector) if force is None else force
        # A slack point says nothing about a signed force but that it is not positive.
        pull = np.maximum(force, 0.0) if unilateral else np.where(self.taut, force, np.maximum(force, 0.0))
        errors = np.nan_to_num(self.weight * (pull - self.tension) / self.size, nan=1e6, posinf=1e6, neginf=-1e6)
        return np.concatenate([errors, self.noise * self._surprise(vector)], axis=-1) if self.informed else errors

    def _surprise(self, vector: np.ndarray) -> np.ndarray:
        """Distance of parameters and length errors from their priors, in standard deviations."""
        rest = vector[..., self.count :]
        off = [(vector[..., i] * self.problem.scale[i] - mean) / sd for i, mean, sd in self.priors]
        return np.concatenate([np.stack(off, axis=-1), rest], axis=-1) if off else rest

    def derivative(self, vector: np.ndarray, *, unilateral: bool) -> np.ndarray:
        scaled, shift = self.parts(vector)
        pulling = (self.braid(vector) > 0.0) | (self.taut & (not unilateral))
        columns = self.slopes(scaled, shift)
        if self.shifts:
            step = LENGTH_STEP
            stiffness = (self.force(scaled, shift + step) - self.force(scaled, shift - step)) / (2.0 * step)
            each = np.zeros((len(stiffness), self.shifts))
            each[np.arange(len(stiffness)), self.curve] = self.problem.length_error * stiffness
            columns = np.concatenate([columns, each], axis=1)
        rows = np.nan_to_num((self.weight * pulling)[:, None] * columns / self.size, nan=0.0, posinf=0.0, neginf=0.0)
        return np.concatenate([rows, self.noise * self._prior_rows()]) if self.informed else rows

    def length_evidence(self, vector: np.ndarray) -> LengthEvidence | None:
        """What the data say about the errors of set lengths, linearised at a solution; None without such errors."""
        if not self.shifts:
            return None
        count, priors = len(self.problem.points), len(self.priors)
        rows, left = self.derivative(vector, unilateral=True), self.misfit(vector, unilateral=True)
        seen, held = rows[:count] / self.noise, rows[count : count + priors, : self.count] / self.noise
        pull = seen.T @ (seen @ vector - left[:count] / self.noise)
        pull[: self.count] += held.T @ (held @ vector[: self.count] - left[count : count + priors] / self.noise)
        rest = self.problem.points.rest_length
        first = [int(np.flatnonzero(self.curve == c)[0]) for c in range(self.shifts)]
        muscle = np.zeros(self.shifts, int) if rest is None else np.unique(rest[first], return_inverse=True)[1]
        return LengthEvidence(seen.T @ seen, pull, held.T @ held, muscle, self.problem.length_error)

    def _prior_rows(self) -> np.ndarray:
        rows = np.zeros((len(self.priors) + self.shifts, self.count + self.shifts))
        for row, (i, _, sd) in zip(rows, self.priors, strict=False):
            row[i] = self.problem.scale[i] / sd
        rows[len(self.priors) :, self.count :] = np.eye(self.shifts)
        return rows

    def estimate_noise(self, vector: np.ndarray) -> None:
        """Take what a solution leaves of the points as the noise."""
        left = self.misfit(vector, unilateral=True)[: len(self.problem.points)]
        degrees = max(float(np.sum(self.weight**2)) - self.posterior(vector).effective, 1.0)
        self.noise = max(float(np.sqrt(left @ left / degrees)), LEAST_NOISE)

    def posterior(self, vector: np.ndarray) -> LinearPosterior:
        """Covariance of parameters and length errors at a solution, and how many of them the data determine."""
        rows = self.derivative(vector, unilateral=True)
        held = rows[len(self.problem.points) :]
        inverse = np.linalg.pinv(rows.T @ rows)
        spread = self.noise * np.sqrt(np.diag(inverse))[self.count :] * self.problem.length_error
        return LinearPosterior(
            covariance=self.noise**2 * inverse[: self.count, : self.count],
            shifts=(self.problem.length_error * vector[self.count :], spread),
            effective=float(vector.size - np.trace(inverse @ (held.T @ held))),
            noise=self.noise,
        )

    def __call__(self, start: np.ndarray, *, start_with: Descent | None = None) -> Descent:
        first, start = start[: self.count], self.whole(start)
        low, high = self.problem.bounds
        bounds = np.append(low, np.full(self.shifts, -np.inf)), np.append(high, np.full(self.shifts, np.inf))
        for unilateral in (False, True):
            end = descend(
                functools.partial(self.misfit, unilateral=unilateral),
                start,
                jacobian=functools.partial(self.derivative, unilateral=unilateral),
                bounds=bounds,
                max_nfev=400,
                ftol=1e-12,
                xtol=1e-12,
                gtol=1e-12,
            )
            start = end.x
            if np.all(self.braid(start)[self.seen] > 0.0):
                break  # nothing is slack, and the second descent would be the first again
        return end._replace(start=first if start_with is None else start_with.start)


@dataclass(frozen=True)
class CrossValidation:
    """Errors of the taut points, each predicted by a fit without its group [N]; NaN if a fold could not be fitted."""

    scheme: str
    groups: int
    failed: int
    error: np.ndarray

    @property
    def rmse(self) -> float:
        """Root mean square prediction error [N]; infinite if a fold failed."""
        return float(np.sqrt(np.mean(self.error**2))) if not self.failed else float("inf")

    @property
    def max_error(self) -> float:
        """Largest prediction error [N]; infinite if a fold failed."""
        return float(np.abs(self.error).max()) if not self.failed else float("inf")


def groups(points: ForceMap, scheme: str) -> np.ndarray:
    """Group number of each point: by ``pressure``, ``length``, ``rest_length`` or ``block``.

    A block is a patch of neighbouring lengths and pressures, so that leaving it out asks for interpolation over a gap.
    """
    if scheme == "block":
        by_length = _binned(points.length if points.rest_length is None else points.contraction, 3)
        by_pressure = _binned(points.pressure, 3)
        return np.unique(by_length * 3 + by_pressure, return_inverse=True)[1]
    if scheme == "rest_length":
        values = np.zeros(len(points)) if points.rest_length is None else points.rest_length
    else:
        values = getattr(points, scheme)
    distinct, index = np.unique(np.round(values, 9), return_inverse=True)
    return _binned(values, BINS) if len(distinct) > MOST_GROUPS else index


def cross_validate(
    problem: Problem, scheme: str, *, progress: Callable[[], None] | None = None
) -> CrossValidation | None:
    """Leave each group out once, search anew without it, and predict it; None if the table has only one group."""
    index, taut = groups(problem.points, scheme), problem.points.taut
    members = np.unique(index[taut])
    if len(members) < 2:
        return None
    error = np.full(len(problem.points), np.nan)
    failed = 0
    for group in members:
        out = index == group
        solution = predict_rest(problem, ~out)
        failed += solution is None
        if solution is not None:
            error[out] = solution.tension[out] - problem.points.tension[out]
        if progress:
            progress()
    return CrossValidation(scheme=scheme, groups=len(members), failed=failed, error=error[taut])


def predict_rest(problem: Problem, train: np.ndarray) -> Solution | None:
    """Fit to the points in `train` only; None if these are too few or the fit did not converge."""
    if int((train & problem.points.taut).sum()) < len(problem.free):
        return None
    solution = solve(problem, train=train)
    return solution if solution.converged else None


def _binned(values: np.ndarray, bins: int) -> np.ndarray:
    """Group numbers of equal-sized bins; equal values share a bin."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, bins + 1)[1:-1])
    return np.unique(np.searchsorted(edges, values, side="left"), return_inverse=True)[1]


class ErrorMeasures:
    """Measures of the errors of a predicted tension [N], mixed into classes that have them as `error`."""

    error: np.ndarray

    @property
    def rmse(self) -> float:
        """Root mean square error [N]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def max_error(self) -> float:
        """Largest error [N]."""
        return float(np.abs(self.error).max())


class LengthError(NamedTuple):
    """Error of one set length of one muscle: what is added to it, with its 95 % interval [m].

    `rest_length` is NaN where the table has none.
    """

    rest_length: float
    length: float
    added: float
    low: float
    high: float


class FittedLaw(ErrorMeasures, abc.ABC):
    """A law with the numbers that a fit found, see `Fit`: from which its posterior, its errors and its friction follow."""

    law: str
    parameters: dict[str, Estimate]
    known: dict[str, Any]
    points: ForceMap
    converged: bool
    not_contained: tuple[str, ...]
    length_errors: tuple[LengthError, ...]

    @abc.abstractmethod
    def build(self, **changes: JsonValue) -> TensionLaw:
        """The law with these numbers; `changes` replace parameters."""

    @property
    @abc.abstractmethod
    def muscle(self) -> Muscle:
        """A muscle with this law, and with what friction and creep is known."""
