"""Friction and relaxation of a muscle from its tension along a path of spans that the motor drives.

While the span L(t) is driven at a constant pressure, the tension is

    T = F(L, P') + f(z) + sum k_i z_i,    dz_i/dt = dL/dt - z_i/tau_i

with F the tension law, f a friction with memory and Maxwell elements k_i, tau_i. At one length and pressure F is the same
whether the muscle lengthens or shortens, so the difference of both branches holds friction and relaxation alone: no law is
needed. While the span stands still the friction stands still too, and what changes is the relaxation, whose z_i follow from
the path. Their stiffnesses k_i >= 0 are a linear problem.
Range: slow paths, so that the pressure is held; an end of the tendon that does not move.
Source: W. N. Findley, J. S. Lai and K. Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, North-Holland 1976,
chapter 5; F. Al-Bender, V. Lampaert and J. Swevers, IEEE Trans. Automatic Control 50(11), 2005.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .. import estimation
from .._jax import Array, Tree, jax, jnp
from ..answers import brief
from ..errors import InputError
from ..estimation import NORMAL_QUANTILE, Estimate, Estimation, Parameter, at_bounds, conclude, descend_linear, widening
from ..muscles.elements import MaxwellChain
from ..muscles.hysteresis import FrictionLimit, MaxwellSlip

ELEMENTS = 6  # of the friction
FEWEST = 12
WINDOW = (1.0, 30.0)  # times after a step of the span between which the relaxation is stated [s]
PER_DECADE = 4  # elements of the relaxation
HISTORY = 0.1  # standard error of the share of the path before the stretch that reached the muscle
UNSEEN = 0.1  # standard error of the relaxation, a share: friction holds some of it while the cord shortens
AT_PRESSURE = 5e5  # at which the travels of the friction are meant [Pa]
# Of the friction: limit without and per pressure, travel, ratio of the travels.
FRICTION = {
    "constant": Parameter(1.0, 5e-3, 1e3, "N"),
    "per_pressure": Parameter(5e-6, 0.0, 1e-3, "m^2"),
    "shortest": Parameter(5e-4, 1e-5, 5e-3, "m", search="log"),
    "spread": Parameter(10.0, 1.0, 50.0, "1", search="log"),
}
# Travels of the first and of the last element from which the search begins [m]. Loops that do not reverse the friction in
# full have a minimum on either side of the last travel that is true; the wrong one leaves the widths of the loops hardly
# worse, and their middle, of which the law is made, off by four times as much.
SHORTEST, LONGEST = (2.5e-4, 1e-3), (1e-3, 2e-3, 4e-3, 8e-3, 16e-3)


class SpanPath(NamedTuple):
    """A path of spans from rest, (n,): time [s], span [m] and gauge pressure [Pa]."""

    time: np.ndarray
    span: np.ndarray
    pressure: np.ndarray


@dataclass(frozen=True)
class RelaxationFit:
    """Relaxation of the tension after a stretch.

    Attributes:
        stiffness: of each Maxwell element [N/m].
        total: tension per step of the span that relaxes between the times `WINDOW` after it, with its 95 % interval [N/m].
        time_constants: of the elements [s].
        rmse: of the tension while the span stood still [N].
    """

    stiffness: np.ndarray
    total: Estimate
    time_constants: np.ndarray
    rmse: float

    def chain(self) -> MaxwellChain | None:
        """The elements that carry anything; None where none does."""
        used = self.stiffness > 1e-6 * max(self.total.value, 1e-9)
        if not used.any():
            return None
        return MaxwellChain(stiffness=self.stiffness[used], time_constant=self.time_constants[used])


@dataclass(frozen=True)
class BranchFit:
    """Friction from the difference of the tension between both branches.

    Attributes:
        parameters: ``constant`` [N], ``per_pressure`` [m^2], ``shortest`` [m] and ``spread`` [1], with 95 % intervals.
        rmse: of the differences [N].
        warnings: as text.
        middle: standard errors of its mean over both branches, which no difference shows: a column for each of as many
            independent directions (k, p) [N].
    """

    parameters: dict[str, Estimate]
    rmse: float
    warnings: tuple[str, ...]
    middle: np.ndarray

    __repr__ = brief

    def friction(self) -> MaxwellSlip:
        """The fitted friction."""
        return _friction({name: e.value for name, e in self.parameters.items()})


def fit_relaxation(
    path: SpanPath,
    tension: np.ndarray,
    still: np.ndarray,
    *,
    stretch: int | None = None,
    pressure_slope: tuple[float, float] | None = None,
    span_slope: tuple[float, float] | None = None,
    shortest: float = 0.5,
    longest: float = 30.0,
) -> RelaxationFit:
    """Fit the relaxation of the tension while the span stands still after a stretch.

    What a hold tells is how much relaxes between a time after its begin and its end, not the sum of the elements, of which
    those that are faster or slower than the hold hardly change it. The interval of that total is its profile likelihood:
    all totals for which some distribution over the time constants, with no stiffness negative, fits hardly worse than the
    best. Three things are fitted beside it, with priors: the tension that a change of pressure makes, that which a span that
    is not held exactly makes, and the share of the path before the stretch that reached the muscle, which `HISTORY` spreads
    about 1 because a cord lengthens as the muscle is filled. `UNSEEN` is added to the interval: the friction of the muscle
    holds back part of the force that relaxes.

    Args:
        path: from a time at which the muscle was relaxed.
        tension: (n,) [N].
        still: samples that are fitted, bool (n,).
        stretch: first sample of the stretch; the path before it is taken as exact if left out.
        pressure_slope: tension per pressure at this length and its standard error [m^2]; pressures are taken as constant if
            left out.
        span_slope: tension per span and its standard error [N/m]; the span is taken as constant if left out.
        shortest: time constant of the fastest element [s].
        longest: time constant of the slowest element [s].

    Raises:
        InputError: there are too few samples.
    """
    count = 1 + round(PER_DECADE * float(np.log10(longest / shortest)))
    if int(still.sum()) < count + FEWEST:
        raise InputError("samples", int(still.sum()), f"must be {count + FEWEST} or more at a span that stands still")
    chain = MaxwellChain.geometric(stiffness=float(count), shortest=shortest, longest=longest, elements=count)
    whole = np.asarray(_compiled().deflections(chain, *_steps(path)))[still]
    earlier = np.zeros_like(whole)
    if stretch is not None:
        before = path._replace(span=np.where(np.arange(len(path.span)) < stretch, path.span, path.span[stretch]))
        earlier = np.asarray(_compiled().deflections(chain, *_steps(before)))[still]
    # the pressure settles: without its noise it is a constant and decays of many time constants
    since = path.time[still] - path.time[still][0]
    decays = np.column_stack([np.ones(len(since)), np.exp(-since[:, None] / np.geomspace(0.1, 30.0, 6))])
    moved = decays @ np.linalg.lstsq(decays, path.pressure[still], rcond=1e-9)[0]
    changes = np.column_stack([moved - moved[-1], path.span[still] - np.median(path.span[still])])
    slopes, spreads = np.array([pressure_slope or (0.0, 0.0), span_slope or (0.0, 0.0)]).T
    wanted = tension[still] - changes @ slopes
    times = np.asarray(chain.time_constant)
    weights = np.exp(-WINDOW[0] / times) - np.exp(-WINDOW[1] / times)
    likelihood = _RelaxationLikelihood(weights, whole, earlier, changes, wanted, spreads, stretch is not None)
    return likelihood.fit(np.asarray(chain.time_constant))


class _RelaxationLikelihood:
    """Likelihood of the total stiffness, with the distribution over the elements as it fits best.

    Args:
        whole: deflections of all elements (n, elements) [m].
        earlier: those from the path before the stretch (n, elements) [m].
        changes: of the pressure [Pa] and of the span [m], (n, 2).
        wanted: tension less what these are expected to make (n,) [N].
        spreads: standard errors of the tension per pressure [m^2] and per span [N/m].
        history: whether the share of the earlier path is uncertain.
    """

    def __init__(
        self,
        weights: np.ndarray,
        whole: np.ndarray,
        earlier: np.ndarray,
        changes: np.ndarray,
        wanted: np.ndarray,
        spreads: np.ndarray,
        history: bool,
    ) -> None:
        self.weights = weights
        self.count, self.samples, self.history = whole.shape[1], len(wanted), history
        self.size = max(float(np.abs(whole).max()), 1e-12)
        levers = np.maximum(np.abs(changes).max(axis=0), (1.0, 1e-9))
        columns = [np.ones(len(wanted)), *(changes / levers).T, *((whole - earlier) / self.size).T]
        self.head = 1 + len(levers)  # columns before those of the elements
        matrix = np.column_stack([*columns, *(earlier / self.size).T, wanted - wanted.mean()])
        self.triangle = np.asarray(np.linalg.qr(matrix, mode="r"))
        self.spreads = spreads * levers  # of the columns of the changes [N]
        self.matrix, self.mean = matrix, float(wanted.mean())
        self.noise = 1.0
        solution = self.solve(1.0, None)[0]
        error = self._error(solution, 1.0)
        self.noise = max(float(np.std(error)) * widening([error]), 1e-9)  # of one sample, as if all were independent

    def _error(self, solution: np.ndarray, share: float) -> np.ndarray:
        n, m, at = self.count, self.matrix, self.head
        elements = m[:, at : at + n] + share * m[:, at + n : at + 2 * n]
        error: np.ndarray = m[:, :at] @ solution[:at] + elements @ solution[at:] - m[:, -1]
        return error

    def solve(self, share: float, total: float | None) -> tuple[np.ndarray, float]:
        """Best solution with a share of the earlier path and a total, free if None; and its cost, as -2 log likelihood."""
        n, r, at = self.count, self.triangle, self.head
        matrix, wanted = np.column_stack([r[:, :at], r[:, at : at + n] + share * r[:, at + n : at + 2 * n]]), r[:, -1]
        matrix, wanted = matrix / self.noise, wanted / self.noise
        prior = np.zeros((self.head - 1, matrix.shape[1]))
        prior[:, 1 : self.head] = np.diag(1.0 / np.maximum(self.spreads, 1e-9))
        rows, values = [matrix, prior], [wanted, np.zeros(len(prior))]
        if total is not None:
            bound = np.zeros((1, matrix.shape[1]))
            weight = 1e4 * max(float(np.abs(matrix).max()), 1.0)
            bound[0, self.head :] = weight * self.weights
            rows.append(bound)
            values.append(np.array([weight * total * self.size]))
        low = np.array([-np.inf] * self.head + [0.0] * self.count)
        solution = descend_linear(np.vstack(rows), np.concatenate(values), low).x
        cost = float(np.sum((matrix @ solution - wanted) ** 2) + np.sum((prior @ solution) ** 2))
        return solution, cost + ((share - 1.0) / HISTORY) ** 2

    def profile(self, total: float | None) -> tuple[np.ndarray, float, float]:
        """Best solution of all shares of the earlier path, its cost and the share."""
        shares = 1.0 + HISTORY * np.linspace(-2.0, 2.0, 9) if self.history else np.ones(1)
        costs = [(*self.solve(float(share), total), float(share)) for share in shares]
        return min(costs, key=lambda one: one[1])

    def fit(self, time_constants: np.ndarray) -> RelaxationFit:
        """The elements, and their total with its interval."""
        from scipy import optimize

        solution, least, share = self.profile(None)
        stiffness = solution[self.head :] / self.size
        total = float(stiffness @ self.weights)

        def beyond(value: float) -> float:
            return self.profile(max(value, 0.0))[1] - least - NORMAL_QUANTILE**2

        step = max(0.05 * total, 3.0 * self.noise / (self.size * self.samples**0.5))
        low = 0.0
        if total > 0.0 and beyond(0.0) > 0.0:
            low = float(optimize.brentq(beyond, 0.0, total, xtol=2e-3 * step, maxiter=40))
        top = total + step
        while beyond(top) < 0.0 and top < 1e3 * (total + step):
            top = total + 2.0 * (top - total)
        high = float(optimize.brentq(beyond, total, top, xtol=2e-3 * step, maxiter=40))
        unseen = NORMAL_QUANTILE * UNSEEN * total
        low = max(total - float(np.hypot(total - low, unseen)), 0.0)
        high = total + float(np.hypot(high - total, unseen))
        error = self._error(solution, share)
        return RelaxationFit(
            stiffness, Estimate(total, low, high, "N/m"), time_constants, float(np.sqrt(np.mean(error**2)))
        )


def fit_branches(
    path: SpanPath,
    rising: np.ndarray,
    falling: np.ndarray,
    difference: np.ndarray,
    *,
    relaxation: MaxwellChain | None = None,
) -> BranchFit:
    """Fit a Maxwell-slip friction to the tension's difference between lengthening and shortening.

    Args:
        path: the whole path, from rest.
        rising: samples of the path while lengthening, (k,).
        falling: samples at the same lengths while shortening, (k,).
        difference: tension while lengthening less that while shortening (k,) [N].
        relaxation: what relaxes beside the friction, as `fit_relaxation` found it.

    Raises:
        InputError: there are too few pairs.
    """
    if len(difference) < FEWEST:
        raise InputError("pairs", len(difference), f"must be {FEWEST} or more, of lengths on both branches")
    steps = _steps(path)
    known = np.zeros(len(path.time)) if relaxation is None else relaxation_force(path, relaxation)
    wanted = difference - (known[rising] - known[falling])

    def error_of(x: np.ndarray) -> np.ndarray:
        force = np.asarray(_compiled().friction(x, *steps))
        return np.asarray(force[rising] - force[falling] - wanted)

    def slopes(x: np.ndarray) -> np.ndarray:
        force = np.asarray(_compiled().friction_slopes(x, *steps))
        return np.asarray(force[rising] - force[falling])

    # half of the friction from its limit without pressure and half from its growth, in the size of the differences
    half = 0.25 * max(float(np.median(wanted)), 0.1)
    limits = half, half / max(float(path.pressure.max()), 1.0)
    travels = ((a, max(b / a, 1.0)) for a in SHORTEST for b in LONGEST)
    search = Estimation(FRICTION, error_of, slopes, options={"max_nfev": 60})
    starts = (zip(FRICTION.values(), (*limits, *travel), strict=True) for travel in travels)
    best = search.search(np.array([p.scaled(value) for p, value in start]) for start in starts)
    error = error_of(best.x)
    by_all = np.asarray(_compiled().friction_slopes(best.x, *steps))
    found = conclude(FRICTION, best, by_all[rising] - by_all[falling], error, series=[error], within=True)
    bound = [f"{n} lies on its bound" for n in at_bounds(FRICTION, best.x, share=1e-4)]
    # a braid without friction has none of it, from where it is counted
    bound += estimation.misfit("the difference of both branches", np.append(wanted, 0.0), error)
    size, axes = np.linalg.eigh(found.correlation)
    deviations = np.where(np.isfinite(found.half), found.half / NORMAL_QUANTILE, 0.0)
    middle = 0.5 * (by_all[rising] + by_all[falling]) * deviations @ (axes * np.sqrt(np.maximum(size, 0.0)))
    return BranchFit(found.parameters, float(np.sqrt(np.mean(error**2))), (*found.warnings, *bound), middle)


def friction_force(path: SpanPath, friction: MaxwellSlip) -> np.ndarray:
    """Force of a friction along a path from rest (n,) [N]."""
    return np.asarray(_compiled().force(friction, *_steps(path)))


def relaxation_force(path: SpanPath, chain: MaxwellChain) -> np.ndarray:
    """Force of Maxwell elements along a path from rest (n,) [N]."""
    forces: np.ndarray = np.asarray(_compiled().deflections(chain, *_steps(path))) @ np.asarray(chain.stiffness)
    return forces


def _steps(path: SpanPath) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Steps of span [m] and time [s], and pressures at their begins and ends [Pa], (n,) each."""
    ends = np.asarray(path.pressure, float)
    begins = np.concatenate([ends[:1], ends[:-1]])
    return np.diff(path.span, prepend=path.span[0]), np.diff(path.time, prepend=path.time[0]), begins, ends


def _friction(p: dict[str, Any]) -> MaxwellSlip:
    limit = FrictionLimit(constant=p["constant"], per_pressure=p["per_pressure"])
    longest = p["shortest"] * p["spread"]
    return MaxwellSlip.geometric(
        limit, elements=ELEMENTS, shortest=p["shortest"], longest=longest, at_pressure=AT_PRESSURE
    )


def _deflections(chain: MaxwellChain, dx: Array, dt: Array, *_: Array) -> Array:
    """Deflection of every Maxwell element along a path (n, elements) [m]."""

    def step(state: Tree, at: tuple[Array, Array]) -> tuple[Tree, Tree]:
        after = chain.advance(state, at[0], duration=at[1]).state
        return after, after

    rows: Array = jax.lax.scan(step, chain.initial(), (dx, dt))[1]
    return rows


def _force(friction: MaxwellSlip, dx: Array, _: Array, begins: Array, ends: Array) -> Array:
    def step(state: Tree, at: tuple[Array, Array, Array]) -> tuple[Tree, Array]:
        moved = friction.advance(state, at[0], start_pressure=at[1], end_pressure=at[2], duration=0.0)
        force: Array = jnp.asarray(friction.force(moved.state, pressure=at[2]))
        return moved.state, force

    start = friction.initial() + 0.0 * jnp.sum(friction.stiffness)
    forces: Array = jax.lax.scan(step, start, (dx, begins, ends))[1]
    return forces


def _force_of(x: Array, *steps: Array) -> Array:
    return _force(_friction({n: p.value(x[i], jnp) for i, (n, p) in enumerate(FRICTION.items())}), *steps)


class _Functions(NamedTuple):
    deflections: Any
    force: Any
    friction: Any
    friction_slopes: Any


@functools.cache
def _compiled() -> _Functions:
    return _Functions(jax.jit(_deflections), jax.jit(_force), jax.jit(_force_of), jax.jit(jax.jacfwd(_force_of)))
