"""The search behind `match`: what is free, the curves as a function of it, and bounded least squares from several starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ...components import paths
from .assisted import Assisted, steady, twitch_of
from .protocols import Curve

# What is free, and the size [SI] from which on it is searched by its logarithm: u = log(1 + p/size).
FREE = {
    "unit.law.spring.rest_length": 0.1,
    "unit.law.spring.stiffness": 10.0,
    "unit.law.spring.cubic_stiffness": 1e3,
    "unit.viscosity": 0.1,
    "unit.tendon.stiffness": 1e2,
    "unit.tendon.toe_length": 1e-4,
    "delay": 1e-3,
    "rest_span": 0.1,
}
NAMES = {
    "unit.law.spring.rest_length": "parallel spring, rest length",
    "unit.law.spring.stiffness": "parallel spring, stiffness",
    "unit.law.spring.cubic_stiffness": "parallel spring, cubic stiffness",
    "unit.viscosity": "parallel damper, damping",
    "unit.tendon.stiffness": "series tendon, stiffness",
    "unit.tendon.toe_length": "series tendon, toe",
    "delay": "delay of the command",
    "rest_span": "span at rest",
}
CURVES = ("force_length", "passive", "force_velocity", "twitch")
DRAWS, SEED = 4, 1  # starts beside the bare muscle
EVALUATIONS = 40  # most of each start
HIT = 1e-3  # of the range of u: nearer than that a parameter is at its bound


class Tuned(NamedTuple):
    """One parameter: where it began and ended, and between which bounds [unit]; `hit` is ``low``, ``high`` or empty."""

    path: str
    title: str
    unit: str
    start: float
    value: float
    low: float
    high: float
    hit: str


class Goal(NamedTuple):
    """The target's curves, and what the muscle is driven with."""

    curves: Mapping[str, Curve]
    pressure: np.ndarray  # course in the twitch [Pa]
    period: float  # of its samples [s]
    full: float  # [Pa]


def curves_of(muscle: Assisted, goal: Goal) -> dict[str, Any]:
    """The muscle's curves at the places of the target's, over its own tension at the rest span [1]."""
    unit, rest = muscle.unit, muscle.rest_span
    pull, _ = steady(unit, rest, goal.full)
    pull = jnp.maximum(pull, 1e-3)  # a search may pass where nothing pulls
    lengths, speeds = (goal.curves[n][0] for n in ("force_length", "force_velocity"))
    return {
        "force_length": steady(unit, lengths * rest, goal.full)[0] / pull,
        "passive": steady(unit, goal.curves["passive"][0] * rest, 0.0)[0] / pull,
        "force_velocity": steady(unit, rest, goal.full, -speeds * rest, jnp.where(speeds > 0.0, -1.0, 0.0))[0] / pull,
        "twitch": twitch_of(muscle, jnp.asarray(goal.pressure), goal.period) / pull,
    }


class Search:
    """The least squares over u = log(1 + p/size)."""

    def __init__(
        self, before: Assisted, goal: Goal, free: dict[str, float], bounds: dict[str, tuple[float, float]]
    ) -> None:
        self.before, self.goal, self.free, self.bounds = before, goal, free, bounds
        self.sizes = np.array(list(free.values()))
        self.low, self.high = (np.log1p(np.array([b[i] for b in bounds.values()]) / self.sizes) for i in (0, 1))
        self.start = np.log1p(np.array([float(paths.get(before, path)) for path in free]) / self.sizes)
        self._residuals = jax.jit(self._all)
        self._slopes = jax.jit(jax.jacfwd(self._all))
        self._curves = jax.jit(lambda u: curves_of(self.muscle(u), self.goal))

    def muscle(self, u: Any) -> Assisted:
        """The muscle at a point."""
        values = jnp.asarray(self.sizes) * jnp.expm1(jnp.asarray(u))
        changed: Assisted = paths.put(self.before, {path: values[i] for i, path in enumerate(self.free)})
        return changed

    def _all(self, u: Any) -> Any:
        own = curves_of(self.muscle(u), self.goal)
        parts = [(own[n] - self.goal.curves[n][1]) / np.sqrt(len(self.goal.curves[n][1])) for n in CURVES]
        return jnp.concatenate(parts)

    def residuals(self, u: Any) -> np.ndarray:
        """Of all curves; huge where a point has no solution."""
        return np.nan_to_num(np.asarray(self._residuals(u)), nan=10.0, posinf=10.0, neginf=-10.0)

    def slopes(self, u: Any) -> np.ndarray:
        """Their derivatives."""
        return np.nan_to_num(np.asarray(self._slopes(u)), nan=0.0, posinf=0.0, neginf=0.0)

    def run(self, draws: int, evaluations: int, tell: Callable[[str], None]) -> np.ndarray:
        """The best point of all starts."""
        from scipy.optimize import least_squares

        inside = 1e-6 * (self.high - self.low)
        best, cost = self.start, float(np.sum(self.residuals(self.start) ** 2))
        for number, first in enumerate([self.start, *self._drawn(draws)], 1):
            tell(f"search {number} of {draws + 1}, rms so far {np.sqrt(cost / len(CURVES)):.3f}")
            begin = np.clip(first, self.low + inside, self.high - inside)
            found = least_squares(
                self.residuals, begin, jac=self.slopes, bounds=(self.low, self.high), max_nfev=evaluations,
                xtol=1e-6, ftol=1e-5, gtol=1e-8,
            )  # fmt: skip
            if 2.0 * found.cost < cost:
                best, cost = found.x, 2.0 * float(found.cost)
        return best

    def _drawn(self, draws: int) -> list[np.ndarray]:
        """Points within the usual ranges; where none is declared, near the muscle as built."""
        chance, low, high = np.random.default_rng(SEED), [], []
        for i, path in enumerate(self.free):
            q = paths.declaration(self.before, path)
            usual = q.typical != q.bounds
            ends = np.log1p(np.array(q.typical) / self.sizes[i]) if usual else self.start[i] + np.array([-0.3, 0.3])
            low.append(ends[0])
            high.append(ends[1])
        return [chance.uniform(low, high) for _ in range(draws)]

    def curves(self, u: Any) -> dict[str, Curve]:
        """At the places of the target's."""
        own = self._curves(u)
        return {n: (self.goal.curves[n][0], np.asarray(own[n])) for n in CURVES}

    def rms(self, u: Any) -> dict[str, float]:
        """Of each curve, and ``all``: the root of the mean of their squares."""
        found = {n: float(np.sqrt(np.mean((y - self.goal.curves[n][1]) ** 2))) for n, (_, y) in self.curves(u).items()}
        return found | {"all": float(np.sqrt(np.mean(np.square(list(found.values())))))}

    def tuned(self, u: np.ndarray) -> tuple[Tuned, ...]:
        """The parameters at a point."""
        found, near = [], HIT * (self.high - self.low)
        for i, path in enumerate(self.free):
            low, high = self.bounds[path]
            hit = "low" if u[i] - self.low[i] < near[i] else "high" if self.high[i] - u[i] < near[i] else ""
            first, last = (float(self.sizes[i] * np.expm1(v[i])) for v in (self.start, u))
            unit = paths.declaration(self.before, path).unit
            found.append(Tuned(path, NAMES[path], unit, first, last, low, high, hit))
        return tuple(found)
