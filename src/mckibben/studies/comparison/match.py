"""Search behind `match`: free parameters, their curves, and bounded least squares from several starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..._jax import Scalar, jax, jnp
from ...analysis.characteristics import dynamic_range
from ...analysis.segments import segments
from ...answers import Column, Table, brief
from ...bench.rig_file import rig as rig_of
from ...components import paths
from ...documents import JsonValue
from ...errors import InputError, choice
from ...estimation import Estimation, Parameter, bounds_of
from ...experiments.read import with_values
from ...quantities import with_unit
from ...recordings import Recording
from .assisted import Assisted, steady, twitch_of, with_spring
from .protocols import Curve, normalised, record_of, rig_for
from .table import ComparedMuscle

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
STAGES = DRAWS + 3  # progress reports of `match`: two twitches, and a search from every start
HIT = 1e-3  # of the range of u: nearer than that a parameter is at its bound


class Tuned(NamedTuple):
    """One tuned parameter: its values before and after, and bounds [unit]; `hit` is ``low``, ``high`` or empty."""

    path: str
    title: str
    unit: str
    start: float
    value: float
    low: float
    high: float
    hit: str


class Goal(NamedTuple):
    """Curves of the target, and the drive of the muscle."""

    curves: Mapping[str, Curve]
    pressure: np.ndarray  # course in the twitch [Pa]
    period: float  # of its samples [s]
    full: float  # [Pa]


def curves_of(muscle: Assisted, goal: Goal) -> dict[str, JsonValue]:
    """Curves of the muscle at the abscissae of the target's, over its own tension at the rest span [1]."""
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
    """Least-squares search over u = log(1 + p/size)."""

    def __init__(
        self, before: Assisted, goal: Goal, free: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]
    ) -> None:
        self.before, self.goal = before, goal
        self.parameters = {
            path: Parameter(
                float(paths.get(before, path)), *bounds[path], paths.declaration(before, path).unit, size, "log1p"
            )
            for path, size in free.items()
        }
        self.low, self.high = bounds_of(self.parameters)
        self.start = np.array([p.scaled(p.start) for p in self.parameters.values()])
        self._curves = jax.jit(lambda u: curves_of(self.muscle(u), self.goal))

    def muscle(self, u: Scalar) -> Assisted:
        """Muscle at a point of the search."""
        sizes = jnp.asarray([p.size for p in self.parameters.values()])
        values = sizes * jnp.expm1(jnp.asarray(u))
        changed: Assisted = paths.put(self.before, {path: values[i] for i, path in enumerate(self.parameters)})
        return changed

    def run(self, draws: int, evaluations: int, tell: Callable[[str], None]) -> np.ndarray:
        """Search from the muscle as built and from points drawn within the usual ranges; return the best point."""

        def off(u: Scalar) -> Any:
            curves = curves_of(self.muscle(u), self.goal)
            parts = [(curves[n] - self.goal.curves[n][1]) / np.sqrt(len(self.goal.curves[n][1])) for n in CURVES]
            return jnp.concatenate(parts)

        compiled, slopes = jax.jit(off), jax.jit(jax.jacfwd(off))

        # a very large value where a point has no solution, so that the search avoids it
        def residual(u: np.ndarray) -> np.ndarray:
            return np.asarray(np.nan_to_num(np.asarray(compiled(u)), nan=10.0, posinf=10.0, neginf=-10.0))

        def jacobian(u: np.ndarray) -> np.ndarray:
            return np.asarray(np.nan_to_num(np.asarray(slopes(u)), nan=0.0, posinf=0.0, neginf=0.0))

        chance, low, high = np.random.default_rng(SEED), [], []
        for (path, p), start in zip(self.parameters.items(), self.start, strict=True):
            q = paths.declaration(self.before, path)
            usual = q.typical != q.bounds  # else points are drawn near the muscle as built
            ends = np.log1p(np.array(q.typical) / p.size) if usual else start + np.array([-0.3, 0.3])
            low.append(ends[0])
            high.append(ends[1])
        options = {"x_scale": 1.0, "max_nfev": evaluations, "xtol": 1e-6, "ftol": 1e-5, "gtol": 1e-8}
        margin = 1e-6 * (self.high - self.low)
        estimation = Estimation(self.parameters, residual, jacobian, margin, options)
        best: np.ndarray = self.start
        cost = float(np.sum(residual(best) ** 2))
        for number, first in enumerate([best, *(chance.uniform(low, high) for _ in range(draws))], 1):
            tell(f"search {number} of {draws + 1}, rms so far {np.sqrt(cost / len(CURVES)):.3f}")
            end = estimation.descend(first)
            if 2.0 * end.cost < cost:
                best, cost = end.x, 2.0 * end.cost
        return best

    def curves(self, u: Scalar) -> dict[str, Curve]:
        """Curves at the abscissae of the target's."""
        curves = self._curves(u)
        return {n: (self.goal.curves[n][0], np.asarray(curves[n])) for n in CURVES}

    def rms(self, u: Scalar) -> dict[str, float]:
        """Root mean square residual of each curve, and of all together under ``all``."""
        errors = {n: float(np.sqrt(np.mean((y - self.goal.curves[n][1]) ** 2))) for n, (_, y) in self.curves(u).items()}
        return errors | {"all": float(np.sqrt(np.mean(np.square(list(errors.values())))))}

    def tuned(self, u: np.ndarray) -> tuple[Tuned, ...]:
        """Parameters at a point."""
        tuned, near = [], HIT * (self.high - self.low)
        for i, (path, p) in enumerate(self.parameters.items()):
            hit = "low" if u[i] - self.low[i] < near[i] else "high" if self.high[i] - u[i] < near[i] else ""
            first, last = (float(p.value(v[i])) for v in (self.start, u))
            tuned.append(Tuned(path, NAMES[path], p.unit, first, last, p.low, p.high, hit))
        return tuple(tuned)


TWITCH = "isometric-twitch"
POINTS = {"force_length": 50, "passive": 25, "force_velocity": 33}
BEFORE, AFTER = 0.02, 0.35  # of the twitch, from the command on [s]


class Match(NamedTuple):
    """Result of a match.

    Attributes:
        muscle: the McKibben muscle.
        target: the biological one.
        before: as built.
        after: with the elements found.
        parameters: parameters of the elements.
        rms_before: root of the mean square difference of each curve [1], by name.
        rms_after: the same with the elements.
        target_curves: x and y by name; lengths in L0, velocities in L0/s, times in s, tensions over that at rest length.
        curves_before: curves before of the muscle as built.
        curves_after: with the elements.
        simulated: the twitch with the elements on the test machine, circuit and all, where it was run.
        rms_simulated: its difference from the target [1]; NaN if it was not run.
    """

    muscle: ComparedMuscle
    target: ComparedMuscle
    before: Assisted
    after: Assisted
    parameters: tuple[Tuned, ...]
    rms_before: Mapping[str, float]
    rms_after: Mapping[str, float]
    target_curves: Mapping[str, Curve]
    curves_before: Mapping[str, Curve]
    curves_after: Mapping[str, Curve]
    simulated: Curve | None = None
    rms_simulated: float = float("nan")

    def __repr__(self) -> str:
        return brief(self)

    def to_dict(self) -> dict[str, JsonValue]:
        """Differences before and after, and the tuned parameters, as plain values."""
        return {
            "muscle": self.muscle.id,
            "target": self.target.id,
            "before": dict(self.rms_before),
            "after": dict(self.rms_after),
            "twitch_simulated": self.rms_simulated,
            "parameters": [p._asdict() for p in self.parameters],
        }

    def tables(self) -> list[Table]:
        """Differences of the curves before and after, and the elements."""
        titles = {"force_length": "force-length", "force_velocity": "force-velocity", "all": "together"}
        curves = [
            {"curve": titles.get(n, n), "before": before, "after": self.rms_after[n]}
            for n, before in self.rms_before.items()
        ]
        columns = (
            Column("curve"),
            Column("before", "as built", "1", places=".3f"),
            Column("after", "with elements", "1", places=".3f"),
        )
        run = f"The twitch with elements on the test machine, circuit and all: {self.rms_simulated:.3f}."
        title = (
            f"{self.muscle.id} with elements, towards {self.target.id}: rms difference over the tension at rest length"
        )
        tuned = []
        for p in self.parameters:  # at a bound the search stops a rounding before it
            value, bound = {"": (p.value, ""), "low": (p.low, "lower")}.get(p.hit, (p.high, "upper"))
            start, found = (with_unit(v, p.unit) for v in (p.start, value))
            tuned.append({"title": p.title, "start": start, "value": found, "bound": bound})
        elements = (
            Column("title", "element"),
            Column("start", "as built", right=True),
            Column("value", "found", right=True),
            Column("bound", "at its bound"),
        )
        return [Table(title, columns, curves, () if self.simulated is None else (run,)), Table("", elements, tuned)]

    @property
    def hits(self) -> tuple[Tuned, ...]:
        """Parameters that ended at a bound."""
        return tuple(p for p in self.parameters if p.hit)


def match(
    muscle: ComparedMuscle,
    target: ComparedMuscle,
    *,
    records: Mapping[str, Recording] | None = None,
    rig: str | None = None,
    free: Mapping[str, float] = FREE,
    draws: int = DRAWS,
    evaluations: int = EVALUATIONS,
    simulate: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Match:
    """Search the parameters of added elements with which a McKibben muscle comes closest to a biological one.

    The search begins at the muscle as built and at `draws` points within the usual ranges; the best result counts, and the
    muscle as built where nothing is better.

    Args:
        muscle: braided.
        target: biological.
        records: records of the isometric twitch by the id of the muscle, where it was recorded already.
        rig: on which it is recorded; as `rig_for` says by default.
        free: parameters to search with the sizes from which on each is searched by its logarithm; some of `FREE`.
        draws: starts beside the muscle as built.
        evaluations: most of each start.
        simulate: run the twitch with the elements found on the test machine.
        progress: called with a description of the next stage.

    Raises:
        InputError: the muscles are not one of each kind, or `free` names something else.
    """
    if muscle.unit is None or target.fibre is None:
        raise InputError(
            "muscles", None, f"must be a McKibben and a biological muscle, got {muscle.id} and {target.id}"
        )
    for path in free:
        if path not in FREE:
            raise InputError("free", path, f"must be {choice(FREE)}")
    tell = progress or (lambda _: None)
    on = rig or rig_for([muscle], [TWITCH])
    tell(f"{muscle.id} and {target.id}: twitch")
    known = dict(records or {})
    for one in (muscle, target):
        if one.id not in known:
            known[one.id] = record_of(one, normalised(TWITCH, one), rig=on)
    goal = goal_of(muscle, target, known[muscle.id], known[target.id])
    unit = with_spring(muscle.unit, rest_length=muscle.rest_length)
    before = Assisted(unit=unit, rest_span=muscle.rest_length)
    bounds = {path: paths.declaration(before, path).bounds for path in free}
    if "rest_span" in bounds:  # within the braid's range, from its free length on
        bounds["rest_span"] = 1.02 * float(muscle.law.free_length(muscle.full)), 1.3 * muscle.upper_length
    search = Search(before, goal, free, bounds)
    best = search.run(draws, evaluations, tell)
    after = search.muscle(best)
    result = Match(
        muscle,
        target,
        before,
        after,
        search.tuned(best),
        search.rms(search.start),
        search.rms(best),
        goal.curves,
        search.curves(search.start),
        search.curves(best),
    )
    if not simulate:
        return result
    tell(f"{muscle.id} with elements: twitch")
    return simulated(result, rig=on)


def goal_of(muscle: ComparedMuscle, target: ComparedMuscle, own: Recording, wanted: Recording) -> Goal:
    """The goal of a match: the target's curves, with the pressure of the muscle's own twitch."""
    fibre = target.fibre
    assert fibre is not None
    ends = dynamic_range(fibre.active_curve)
    lengths = {n: np.linspace(ends.shortest, ends.longest, POINTS[n]) for n in ("force_length", "passive")}
    speeds = np.linspace(0.0, float(fibre.maximum_velocity), POINTS["force_velocity"])
    pull = np.asarray(fibre.tension(fibre.rest_length, 1.0, -speeds * float(fibre.rest_length)))
    start = float(segments(own, "twitch")[0].time[0])
    part = own.select(start - BEFORE, start + AFTER)
    time = part.time - start
    begin = float(segments(wanted, "twitch")[0].time[0])
    twitch = np.interp(time, wanted.time - begin, wanted["tension"]) / target.full_tension
    curves = {
        "force_length": (lengths["force_length"], target.tension(lengths["force_length"])),
        "passive": (lengths["passive"], target.tension(lengths["passive"], 0.0)),
        "force_velocity": (speeds, pull / target.full_tension),
        "twitch": (time, twitch),
    }
    name = "muscle.pressure" if "muscle.pressure" in part else "pressure"
    return Goal(curves, np.asarray(part[name]), part.period, muscle.full)


def simulated(match: Match, *, rig: str) -> Match:
    """Repeat the twitch on a simulated test machine: circuit, volume and all; the delay adds to the valve's dead time."""
    muscle = match.muscle
    wanted = with_values(normalised(TWITCH, muscle), {"span": f"{float(match.after.rest_span)!r} m"})
    plain = rig_of(rig)
    layout = plain.layout(wanted)
    dead = float(plain.plumbing[layout].valve.delay() or 0.0) + float(match.after.delay)
    late = rig_of(rig, {f"plumbing.{layout}.valve.dead_time": f"{dead!r} s"})
    record = record_of(muscle, wanted, rig=late, unit=match.after.unit)
    start = float(segments(record, "twitch")[0].time[0])
    time, target = match.target_curves["twitch"]
    pull = float(steady(match.after.unit, match.after.rest_span, muscle.full)[0])
    tension = np.interp(time, record.time - start, record["muscle.tension"]) / pull
    return match._replace(simulated=(time, tension), rms_simulated=float(np.sqrt(np.mean((tension - target) ** 2))))
