"""Valves and tubes for a muscle: speed, mass, air consumption and stiffness, weighted as in the paper's discussion.

A larger valve answers faster and is heavier and hungrier, often heavier than the muscle; a wider tube is less viscous and
stiffer, and holds more air. Times come from runs of the circuit with the muscle's own moving volume (`circuit`), at the
length where it begins and where it ends:

    rise        tension from 10 to 90 %, held at its longest
    to_force    from the command until it pulls with the wished force and its friction, held at the end of the stroke
    fall        from 90 to 10 %, held at its longest
    speed       at which it still pulls so at the end of the stroke, drawn from its longest with the valve open

The tension to which rise and fall are taken is that of a run in which it settles; a line that never does is marked.

A line is Pareto-best if no other is as good in every one of `WEIGHED` and better in one. The score is the sum of the
logarithms of each over the best there is: all weigh alike, and that is a choice.
Source of what is weighed: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996,
doi:10.1109/70.481753, and the discussion of the longer report.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from ...answers import brief
from ...assembly.build import INFERRED as ASSEMBLED
from ...components.gas import REFERENCE_DENSITY
from ...documents import JsonValue
from ...pneumatics.build import valve_from_specimen
from ...pneumatics.tubes import LumpedTube
from ...pneumatics.valves import PressureRegulator
from ...specimens import Specimen, specimen, specimen_ids
from ...specimens.parts import CataloguePart, parts
from ._circuit import Course, Lane, courses, settled_courses
from .candidate import Judged, air_of_cycle, unit_of
from .own_parts import not_stated
from .requirements import Requirements

TUBES = ("PU-4x2", "PA-4x2.5", "paper-1/8", "PU-6x4", "PU-8x5")
LENGTHS = (0.2, 1.0, 2.0)  # that the best valve is also tried with [m]
ABOVE = 1.9e5  # of a regulator's supply over its set pressure, as in the paper: 6.9 bar for 5 [Pa]
SPEEDS = (1.0 / 32.0, 0.125, 0.5, 1.0, 2.0, 4.0, 8.0)  # tried, over the wished one
WEIGHED = ("to_force", "mass", "power", "air", "stiffness")
NOT_KNOWN = "not known"
MOST_DRAWN = 6  # lines whose speed is looked for
LEAST = {"power": 0.1, "stiffness": 1e-4, "mass": 1e-3, "to_force": 1e-4, "air": 1e-9}  # floors of the score [SI]


Both = tuple[Course, Course]  # of a held muscle: as long as filling takes, and until its tension settles


@dataclass(frozen=True)
class LineResult:
    """A valve and a tube for a muscle.

    Times [s]; None if it never gets there. Masses [kg], `box` the size of the valve [m^3], `power` electrical [W],
    `stiffness` of the tube against bending E I [N m^2], `bend_radius` the least [m], `air` of a cycle with valve and tube
    [kg], `leak` while holding [kg/s], `supply` gauge pressure [Pa]. `keeps_up` says whether rise and fall fit into a cycle,
    `settled` whether the tension came to rest, without which its times are of a step under way,
    `element` the kind of the valve. `not_stated` names those of mass and power that nobody gave of a valve of one's own:
    usual ones stand for them in the ranking, and `to_dict` and tables do not show them.
    """

    valve: str
    tube: str
    tube_length: float
    rise: float | None
    to_force: float | None
    fall: float | None
    mass: float
    valve_mass: float
    box: float
    power: float
    stiffness: float
    bend_radius: float
    air: float
    leak: float
    supply: float
    keeps_up: bool
    inferred: tuple[str, ...]
    settled: bool = True
    speed: float | None = None
    pareto: bool = False
    score: float = math.inf
    element: str = ""
    not_stated: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """As plain values in SI, None for what nobody gave."""
        hidden = {"mass": ("mass", "valve_mass"), "power": ("power",)}
        return asdict(self) | {key: None for name in self.not_stated for key in hidden[name]}

    @property
    def power_shown(self) -> str:
        """Power of the valve in W."""
        return NOT_KNOWN if "power" in self.not_stated else f"{self.power:.1f}"

    @property
    def valve_mass_shown(self) -> str:
        """Mass of the valve in g."""
        return NOT_KNOWN if "mass" in self.not_stated else f"{1e3 * self.valve_mass:.0f}"

    __repr__ = brief


def lines_for(
    muscle: Judged,
    wish: Requirements,
    *,
    valves: Sequence[str | Specimen] | None = None,
    tubes: Sequence[str] = TUBES,
    lengths: Sequence[float] | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[LineResult]:
    """Evaluate every valve with every tube, best first; speeds only for Pareto-optimal ones, if a speed is required.

    Args:
        muscle: for which.
        wish: pressure, force, stroke, speed and frequency.
        valves: specimens or their ids; all shipped ones by default.
        tubes: ids of parts.
        lengths: lengths of tubes, instead of the wish's [m]; no speeds are then looked for.
        progress: called with a description of the next stage.
    """
    tell = progress or (lambda _: None)
    named = valves if valves is not None else specimen_ids("valve")
    wanted = [specimen(v) if isinstance(v, str) else v for v in named]
    known = {p.id: p for p in parts("tube")}
    pairs = [(v, known[t], x) for x in lengths or (wish.tube_length,) for v in wanted for t in tubes]
    tell(f"{muscle.muscle.id}: {len(pairs)} lines")
    ends = (muscle.muscle.longest, muscle.muscle.longest - wish.stroke)
    lanes = [_lane(muscle, wish, *pair, at) for pair in pairs for at in ends]
    done = courses(lanes)
    rest = settled_courses(lanes, done)
    both = list(zip(done, rest, strict=True))  # each as it was, and until it settles
    results = [_found(muscle, wish, *pair, both[2 * i], both[2 * i + 1], lanes[2 * i]) for i, pair in enumerate(pairs)]
    ranked = rank(results)
    if wish.speed is None or lengths is not None:
        return ranked
    best = [line for line in ranked if line.pareto and line.keeps_up][:MOST_DRAWN]
    tell(f"{muscle.muscle.id}: speed of {len(best)} lines")
    fast = speeds_of(muscle, wish, best, {v.id: v for v in wanted})
    by = {(line.valve, line.tube): v for line, v in zip(best, fast, strict=True)}
    return [replace(line, speed=by.get((line.valve, line.tube))) for line in ranked]


_valve = functools.lru_cache(64)(valve_from_specimen)  # each stands in many lines of an answer


def _lane(
    muscle: Judged, wish: Requirements, valve: Specimen, tube: CataloguePart, length: float, at: float, **more: float
) -> Lane:
    element = _valve(valve)
    regulated = isinstance(element, PressureRegulator)
    pipe = LumpedTube(
        length=length, diameter=tube.values["inner_diameter"], wall_temperature=wish.environment.temperature
    )
    supply = wish.pressure + (ABOVE if regulated else 0.0)
    return Lane(unit_of(muscle.muscle), element, pipe, wish.pressure, supply, at, environment=wish.environment, **more)


def _found(
    muscle: Judged,
    wish: Requirements,
    valve: Specimen,
    tube: CataloguePart,
    length: float,
    long_: Both,
    short: Both,
    lane: Lane,
) -> LineResult:
    wanted = wish.force + muscle.muscle.friction + muscle.passive
    rise, fall = _transitions(*long_) if long_[0].sound else (None, None)
    v = tube.values
    inner, outer = v["inner_diameter"], v["outer_diameter"]
    section = 0.25 * math.pi * (outer**2 - inner**2)
    valve_mass = valve.property_si("mass", "kg")
    dead = 0.25 * math.pi * inner**2 * length + ASSEMBLED["port_volume"].value  # as `dead_volume` of the result
    share = float(getattr(lane.valve, "leakage", 0.0))
    passage = lane.valve.fill  # type: ignore[attr-defined]
    absolute = lane.supply + float(wish.environment.pressure_abs)
    busy = None if rise is None or fall is None else rise / 0.8 + fall / 0.8
    return LineResult(
        valve=valve.id,
        tube=tube.id,
        tube_length=length,
        rise=rise,
        to_force=next((t for c in short if c.sound and (t := _reached(c, wanted)) is not None), None),
        fall=fall,
        mass=valve_mass + section * length * v["density"],
        valve_mass=valve_mass,
        box=math.prod(valve.property_si(side, "m") for side in ("length", "width", "height")),
        power=valve.property_si("current", "A") * valve.property_si("voltage", "V"),
        stiffness=v["modulus"] * math.pi / 64.0 * (outer**4 - inner**4),
        bend_radius=v["bend_radius"],
        air=air_of_cycle(muscle.muscle, wish, dead),
        leak=share * float(passage.conductance) * REFERENCE_DENSITY * absolute,
        supply=lane.supply,
        keeps_up=wish.frequency is None or (busy is not None and busy * wish.frequency <= 1.0),
        inferred=(*(f"{valve.id}.{n}" for n in valve.inferred()), *(f"{tube.id}.{n}" for n in tube.inferred())),
        settled=all(c.settled for _, c in (long_, short) if c.sound),
        element=valve.element,
        not_stated=not_stated(valve),
    )


def dead_volume(line: LineResult) -> float:
    """Volume of the tube and of the valve's port [m^3]."""
    inner = next(p for p in parts("tube") if p.id == line.tube).values["inner_diameter"]
    return 0.25 * math.pi * inner**2 * line.tube_length + ASSEMBLED["port_volume"].value


# Numbers of a valve with which it fills faster; with more of all its other numbers it is slower.
FASTER_WITH_MORE = ("nominal_flow", "conductance", "flow_into_the_room", "Kv", "Cv", "hole_diameter", "critical_ratio")
SLOWER_WITH_MORE = ("opening_dead_time", "opening_time", "lag", "dead_time", "linear_band")


def time_range(
    muscle: Judged, wish: Requirements, valve: str | Specimen, line: LineResult
) -> tuple[float, float] | None:
    """Shortest and longest time of a line to the required force, its inferred numbers at the ends of their ranges [s].

    Args:
        muscle: which.
        wish: pressure, force and stroke.
        valve: of the line.
        line: evaluated with the numbers as they are.

    Returns:
        None if the line never gets there, or no inferred number of the valve has a range.
    """
    spec = specimen(valve) if isinstance(valve, str) else valve
    tube = next(p for p in parts("tube") if p.id == line.tube)
    moved = [n for n, p in spec.valve.items() if p.inferred and p.range and n in (*FASTER_WITH_MORE, *SLOWER_WITH_MORE)]
    if line.to_force is None or not moved:
        return None
    at = muscle.muscle.longest - wish.stroke
    lanes = [_lane(muscle, wish, _moved(spec, moved, fast=fast), tube, line.tube_length, at) for fast in (True, False)]
    wanted = wish.force + muscle.muscle.friction + muscle.passive
    times = []
    done = courses(lanes)
    for course, rest in zip(done, settled_courses(lanes, done), strict=True):
        times.append(next((t for c in (course, rest) if c.sound and (t := _reached(c, wanted)) is not None), math.inf))
    return min(times[0], line.to_force), max(times[1], line.to_force)


def _moved(spec: Specimen, names: Sequence[str], *, fast: bool) -> Specimen:
    """A valve whose inferred numbers stand at the end of their range that makes it fast, or slow."""
    valve = dict(spec.valve)
    for name in names:
        low, high = sorted(spec.valve[name].range or ())
        valve[name] = replace(valve[name], value=high if (name in FASTER_WITH_MORE) is fast else low)
    return replace(spec, valve=valve)


def _transitions(course: Course, rest: Course) -> tuple[float | None, float | None]:
    """Times from 10 to 90 % of the settled tension, rising and falling [s]; from the longer course if necessary."""
    top = rest.top
    if not top > 0.0:
        return None, None
    if not (course.tension[course.time < course.turn] >= 0.9 * top).any():
        course = rest
    before = course.time < course.turn
    up, t = course.tension[before], course.time[before]
    rise = _passing(t, up, 0.9 * top, 1.0) - _passing(t, up, 0.1 * top, 1.0)
    down, later = course.tension[~before], course.time[~before]
    if down[-1] > 0.1 * top:
        return rise, None
    return rise, _passing(later, down, 0.1 * top, -1.0) - _passing(later, down, 0.9 * top, -1.0)


def _passing(time: np.ndarray, values: np.ndarray, level: float, side: float) -> float:
    """Time at which a course first passes a level, upwards or downwards, interpolated between samples [s]."""
    over = side * (values - level) >= 0.0
    i = int(np.argmax(over))
    if i == 0:
        return float(time[0])
    a, b = values[i - 1], values[i]
    return float(time[i - 1] + (level - a) / (b - a) * (time[i] - time[i - 1]))


def _reached(course: Course, wanted: float) -> float | None:
    before = course.time < course.turn
    up = course.tension[before]
    return _passing(course.time[before], up, wanted, 1.0) if bool((up >= wanted).any()) else None


def speeds_of(
    muscle: Judged, wish: Requirements, lines: Sequence[LineResult], valves: Mapping[str, Specimen]
) -> list[float]:
    """Speed up to which each line keeps the required force at the end of the stroke [m/s].

    At most eight times the required.
    """
    assert wish.speed is not None
    known = {p.id: p for p in parts("tube")}
    tried = [s * wish.speed for s in SPEEDS]
    lanes = [
        _lane(
            muscle,
            wish,
            valves[line.valve],
            known[line.tube],
            line.tube_length,
            muscle.muscle.longest,
            stroke=wish.stroke,
            speed=v,
        )
        for line in lines
        for v in tried
    ]
    done = courses(lanes)
    wanted = wish.force + muscle.muscle.friction + muscle.passive
    speeds, end = [], muscle.muscle.longest - wish.stroke
    for i in range(len(lines)):
        some = done[i * len(tried) : (i + 1) * len(tried)]
        at_end = [int(np.argmax(c.length <= end + 1e-9 + 1e-6 * end)) if c.sound else 0 for c in some]
        over = np.array([c.tension[k] - wanted if c.sound else np.nan for c, k in zip(some, at_end, strict=True)])
        keeps = np.flatnonzero(~(over >= 0.0))
        if not keeps.size:
            speeds.append(tried[-1])
        elif keeps[0] == 0:
            speeds.append(0.0)
        else:
            k = int(keeps[0])
            share = over[k - 1] / (over[k - 1] - over[k]) if np.isfinite(over[k]) else 0.0
            speeds.append(float(tried[k - 1] * (tried[k] / tried[k - 1]) ** share))
    return speeds


def rank(lines: Sequence[LineResult]) -> list[LineResult]:
    """Sort lines: sufficient and fast enough ones first, then by score; with Pareto marks."""
    able = [line for line in lines if line.to_force is not None]
    if not able:
        return list(lines)
    table = np.array([[max(float(getattr(line, n)), LEAST[n]) for n in WEIGHED] for line in able])
    score = np.log(table / table.min(axis=0)).sum(axis=1)
    results = []
    for i, line in enumerate(able):
        as_good = (table <= table[i] * (1.0 + 1e-9)).all(axis=1)
        better = (table < table[i] * (1.0 - 1e-9)).any(axis=1)
        results.append(replace(line, pareto=not bool((as_good & better).any()), score=float(score[i])))
    results.sort(key=lambda line: (not line.keeps_up, line.score))
    return [*results, *(line for line in lines if line.to_force is None)]
