"""How close elements can bring a McKibben muscle to a biological one: least squares over their parameters.

Four curves are compared, each over the tension at the rest length:
    force_length     fully driven, from the shortest to the longest length of the target's dynamic range
    passive          not driven, the same lengths
    force_velocity   fully driven at the rest length, shortening up to the target's largest velocity
    twitch           isometric, after the same pulse of the command
The residuals are the differences of the curves, each divided by the root of its number of points, so that every curve has
the same weight and the cost is the sum of the mean squares. Bounds are those that the elements declare.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ...analysis.biology import dynamic_range
from ...analysis.segments import segments
from ...bench.rig_file import rig as rig_of
from ...components import paths
from ...errors import InputError
from ...experiments.read import with_values
from ...recordings import Recording
from .assisted import Assisted, steady, with_spring
from .protocols import normalised, record_of, rig_for
from .search import DRAWS, EVALUATIONS, FREE, Curve, Goal, Search, Tuned
from .subject import Subject

TWITCH = "isometric-twitch"
POINTS = {"force_length": 50, "passive": 25, "force_velocity": 33}
BEFORE, AFTER = 0.02, 0.35  # of the twitch, from the command on [s]


class Match(NamedTuple):
    """What was reached.

    Attributes:
        muscle: the McKibben muscle.
        target: the biological one.
        before: as built.
        after: with the elements found.
        parameters: of the elements.
        rms_before: root of the mean square difference of each curve [1], by name.
        rms_after: the same with the elements.
        target_curves: x and y by name; lengths in L0, velocities in L0/s, times in s, tensions over that at rest length.
        curves_before: of the muscle as built.
        curves_after: with the elements.
        simulated: the twitch with the elements on the test machine, circuit and all, where it was run.
        rms_simulated: its difference from the target [1]; NaN where it was not run.
    """

    muscle: Subject
    target: Subject
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

    @property
    def hits(self) -> tuple[Tuned, ...]:
        """Parameters that ended at a bound."""
        return tuple(p for p in self.parameters if p.hit)


def match(
    muscle: Subject,
    target: Subject,
    *,
    records: Mapping[str, Recording] | None = None,
    rig: str | None = None,
    free: Mapping[str, float] = FREE,
    draws: int = DRAWS,
    evaluations: int = EVALUATIONS,
    simulate: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Match:
    """Search the elements' parameters with which a McKibben muscle comes closest to a biological one.

    The search begins at the muscle as built and at `draws` points within the usual ranges; the best result counts, and the
    muscle as built where nothing is better.

    Args:
        muscle: braided.
        target: biological.
        records: of the isometric twitch by the id of the muscle, where it was recorded already.
        rig: on which it is recorded; as `rig_for` says where left out.
        free: parameters to search with the sizes from which on each is searched by its logarithm; some of `FREE`.
        draws: starts beside the muscle as built.
        evaluations: most of each start.
        simulate: run the twitch with the elements found on the test machine.
        progress: is told what comes next.

    Raises:
        InputError: the muscles are not one of each kind, or `free` names something else.
    """
    if muscle.unit is None or target.fibre is None:
        raise InputError("muscles", f"{muscle.id} and {target.id}", "allowed is a McKibben and a biological muscle")
    for path in free:
        if path not in FREE:
            raise InputError("free", path, f"allowed are {', '.join(FREE)}")
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
    search = Search(before, goal, dict(free), _bounds(muscle, before, free))
    best = search.run(draws, evaluations, tell)
    after = search.muscle(best)
    found = Match(
        muscle, target, before, after, search.tuned(best), search.rms(search.start), search.rms(best), goal.curves,
        search.curves(search.start), search.curves(best),
    )  # fmt: skip
    if not simulate:
        return found
    tell(f"{muscle.id} with elements: twitch")
    return simulated(found, rig=on)


def goal_of(muscle: Subject, target: Subject, own: Recording, wanted: Recording) -> Goal:
    """What is to be reached: the target's curves, with the pressure that the muscle's own twitch had."""
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
        "force_velocity": (speeds, pull / target.full_tension), "twitch": (time, twitch),
    }  # fmt: skip
    name = "muscle.pressure" if "muscle.pressure" in part else "pressure"
    return Goal(curves, np.asarray(part[name]), part.period, muscle.full)


def _bounds(muscle: Subject, before: Assisted, free: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """As declared; the span at rest within what the braid can take, from its free length on."""
    found = {path: paths.declaration(before, path).bounds for path in free}
    if "rest_span" in found:
        found["rest_span"] = 1.02 * float(muscle.law.free_length(muscle.full)), 1.3 * muscle.upper_length
    return found


def simulated(found: Match, *, rig: str) -> Match:
    """The same with the twitch run on a test machine: circuit, volume and all; the delay adds to the valve's dead time."""
    muscle = found.muscle
    wanted = with_values(normalised(TWITCH, muscle), {"span": f"{float(found.after.rest_span)!r} m"})
    plain = rig_of(rig)
    layout = plain.layout(wanted)
    dead = float(plain.plumbing[layout].valve.delay() or 0.0) + float(found.after.delay)
    late = rig_of(rig, {f"plumbing.{layout}.valve.dead_time": f"{dead!r} s"})
    record = record_of(muscle, wanted, rig=late, unit=found.after.unit)
    start = float(segments(record, "twitch")[0].time[0])
    time, target = found.target_curves["twitch"]
    pull = float(steady(found.after.unit, found.after.rest_span, muscle.full)[0])
    own = np.interp(time, record.time - start, record["muscle.tension"]) / pull
    return found._replace(simulated=(time, own), rms_simulated=float(np.sqrt(np.mean((own - target) ** 2))))
