"""Sizing: candidates of muscles, their lines, and gas sources with the number of cycles per filling or battery."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ... import verbs
from ...analysis.energy import Conditions, cycle_muscle, energy_cycle
from ...answers import collect
from ...errors import InputError, MckibbenError
from ...identification.posterior import Band, Posterior, read_posterior
from ...muscles.plausible import pressure_caution
from ...quantities import with_unit
from ...specimens import Specimen, specimen_ids
from ...specimens.parts import parts
from . import catalogue
from .braid import OBJECTIVES, design
from .braid_law import BRAID_LAWS
from .candidate import VERDICTS, Candidate, Judged, judged, ranked
from .lines import LENGTHS, LineResult, dead_volume, lines_for, time_range
from .own_parts import battery_of, tank_of, valve_of
from .requirements import Requirements, Shortfall, parse_space
from .sources import daily_use, sources_for
from .spread import spread_of
from .tables import PosteriorAnswer, Sizing


def piston_cycle(muscle: Judged, wish: Requirements, *, accumulator: bool) -> tuple[float, float] | None:
    """Input and output of the paper's cycle of maximal shortening, quasi-stationary and isothermal [J]; None if it has none.

    With an accumulator the air goes back to the threshold of the muscle's law; None if it has no threshold.
    """
    try:
        moving = cycle_muscle(muscle.muscle.law)
        back = float(moving.threshold()) if accumulator else 0.0
        if accumulator and not 0.0 < back < wish.pressure:
            return None
        between = Conditions(
            pressure=wish.pressure,
            stretched_length=muscle.muscle.longest,
            ambient=wish.environment,
            exchange_pressure=back,
            friction=muscle.muscle.friction,
        )
        cycle = energy_cycle(moving, "maximal", between)
    except MckibbenError:
        return None
    return cycle.input, cycle.output


Progress = Callable[[str], None]

EXAMPLES = {"force": "50 N", "stroke": "3 cm", "pressure": "5 bar", "tube_length": "50 cm"}
GRAVITY = 9.80665  # [m/s^2]
MOST_TRIED = 3  # muscles whose speed is looked for


@verbs.verb
def size(
    wish: Requirements | None = None,
    *,
    force: verbs.WorkingForce | None = None,
    load: verbs.Mass | None = None,
    stroke: verbs.Stroke | None = None,
    pressure: verbs.Pressure = "5 bar",
    space: verbs.SpaceText | None = None,
    length: verbs.OverallLength | None = None,
    diameter: verbs.Diameter | None = None,
    speed: verbs.WorkingSpeed | None = None,
    rate: verbs.CycleRate | None = None,
    working_time: verbs.TimePerDay | None = None,
    tube_length: verbs.TubeLength = "50 cm",
    valve: verbs.ValveName | Sequence[verbs.ValveName] | None = None,
    battery: verbs.Energy | None = None,
    tank: verbs.TankText | None = None,
    muscle: verbs.MuscleName | None = None,
    posterior: verbs.PosteriorFile | None = None,
    law: verbs.LawName = "linear_threshold",
    lines: bool = True,
    progress: Progress | None = None,
) -> Sizing:
    """Find the muscle, valve, tube and gas source for a force and a stroke.

    At a command line the exit code is 2 when no muscle meets the requirements.

    Args:
        wish: the requirements; by default composed of those that follow.
        force: force at the end of the stroke [N], while the muscle shortens, such as '50 N'.
        load: mass that hangs on the muscle [kg], instead of a force, such as '5 kg'.
        stroke: distance by which the muscle shortens [m], such as '3 cm'.
        pressure: gauge pressure at which it does so [Pa], such as '5 bar'.
        space: largest length and diameter, such as '20 cm x 3 cm', instead of both.
        length: largest overall length, fittings included [m], such as '20 cm'.
        diameter: largest outer diameter, when contracted [m], such as '3 cm'.
        speed: speed of shortening with that force [m/s], such as '10 cm/s'.
        rate: frequency of working cycles [1/s], such as '1 Hz'.
        working_time: time at work each day [s], such as '8 h', for the energy and air of a day.
        tube_length: length of tube between valve and muscle [m].
        valve: valve to try instead of all that ship: a name, a .toml file, or numbers of its catalogue, such as
            'Cv=0.3, switching_time=8 ms'.
        battery: battery of your own for a small compressor and the valve [J], such as '100 Wh'.
        tank: tank of air of your own, such as '2 l at 200 bar'.
        muscle: candidate, or .toml file of a muscle, for which valves and gas sources are sought.
        posterior: result of `mckibben fit --posterior --out fit.json`, for 95 % bands of the answer.
        law: law of the braids: linear_threshold, thick_wall or ideal.
        lines: look for valves and tubes, which are simulated.
        progress: called with a description of the next stage.

    Raises:
        InputError: force or stroke is missing, a value is out of bounds, or a law, muscle or valve is unknown.

    Examples:
        >>> import mckibben as mk
        >>> found = mk.size(force="50 N", stroke="3 cm", lines=False)
        >>> found.reached
        True
    """
    stated = {
        "force": force, "stroke": stroke, "load": load, "length": length, "diameter": diameter, "speed": speed,
        "rate": rate, "working_time": working_time,
    }  # fmt: skip
    if not (wish is None or isinstance(wish, Requirements)):
        raise InputError("wish", None, f"must be Requirements, got {wish!r}; a force is given as force=")
    for name, value in {"space": space, "muscle": muscle, "tank": tank, "law": law}.items():
        if not (value is None or isinstance(value, str)):
            raise InputError(name, None, f"must be text, got {value!r}")
    if isinstance(valve, Mapping) or not (valve is None or isinstance(valve, Iterable)):
        raise InputError("valve", None, f"must be the name of a valve, or several, got {valve!r}")
    for name, value in (stated | {"pressure": pressure, "tube_length": tube_length}).items():
        if not (value is None or isinstance(value, str)) and (isinstance(value, bool) or np.ndim(value)):
            raise InputError(name, None, f"must be one number or words with a unit, got {value!r}")
    for name, value in (stated | {"space": space}).items():
        if wish is not None and value is not None:
            raise InputError(name, str(value), "must be left out beside a wish, which states it")
        if space is not None and name in ("length", "diameter") and value is not None:
            raise InputError(name, str(value), "must be left out beside a space, which states both")
    for name, needing in (("speed", speed), ("valve", valve)):
        if needing is not None and not lines:
            raise InputError(name, None, "is allowed only without {lines=False}, which leaves valves and tubes out")
    if wish is None:
        wish = _requirements(
            {
                "force": _force_of(force, load),
                "stroke": stroke,
                "pressure": pressure,
                **dict(
                    zip(
                        ("length", "diameter"), (length, diameter) if space is None else parse_space(space), strict=True
                    )
                ),
                "speed": speed,
                "frequency": rate,
                "tube_length": tube_length,
                "working_time": working_time,
            },
            spaced=space is not None,
        )
    said = pressure_caution(wish.pressure, text=verbs.typed(pressure))
    if law not in BRAID_LAWS:
        raise InputError("law", law, known=BRAID_LAWS)
    _check_muscle(muscle)
    if posterior is not None and muscle is None:
        raise InputError("posterior", None, "is allowed only with {muscle}, whose law was fitted")
    drawn = posterior if posterior is None or isinstance(posterior, Posterior) else read_posterior(posterior)
    own_valves = None if valve is None else [valve_of(one) for one in ([valve] if isinstance(valve, str) else valve)]
    own_sources = [battery_of(battery)] if battery is not None else []
    own_sources += [tank_of(tank, wish.environment)] if tank is not None else []
    tell = progress or (lambda _: None)
    tell("braids")
    candidates: list[Candidate] = []
    misses: tuple[Shortfall, ...] = ()
    for objective in OBJECTIVES:
        one, missing = design(wish, law=law, objective=objective, fitting=not candidates and not misses)
        if one is None:
            misses = missing
            break
        candidates.append(one)
    tell("specimens")
    candidates += catalogue.of_specimens(wish)
    if muscle is not None and muscle.lower().endswith(".toml"):
        own_candidate = catalogue.of_file(muscle, wish)
        candidates = [one for one in candidates if one.id != own_candidate.id] + [own_candidate]
        muscle = own_candidate.id
    tell("fluidic muscles")
    candidates += catalogue.of_sizes(wish)
    order = ranked([judged(one, wish) for one in candidates])
    chosen = _chosen(order, muscle)
    if drawn is not None:
        drawn.check_muscle(chosen.muscle.law, chosen.muscle.id)
    best: list[LineResult] = []
    other: list[LineResult] = []
    times = None
    if lines:
        order, chosen, best = _with_lines(order, chosen, muscle is None, wish, tell, own_valves)
        if best and best[0].to_force is not None:
            valves = [next((v for v in own_valves or () if v.id == best[0].valve), best[0].valve)]
            other = lines_for(chosen, wish, valves=valves, lengths=LENGTHS, progress=tell)
            times = time_range(chosen, wish, valves[0], best[0])
    if wish.speed is not None and chosen.speed is not None and chosen.speed < wish.speed:
        misses = (*misses, Shortfall("speed", wish.speed, chosen.speed or None))
    line = next((one for one in best if one.to_force is not None), None)
    does = chosen.verdict != VERDICTS[2]  # else there is no work whose energy could be told
    spread = spread_of(chosen, wish, 0.0 if line is None else dead_volume(line)) if does else None
    sources = sources_for(chosen, wish, line, own=own_sources, spread=spread) if does else []
    air = chosen.air if line is None else line.air
    ways = ("surroundings", "accumulator")
    return Sizing(
        wish,
        tuple(order),
        tuple(misses),
        chosen,
        tuple(best),
        tuple(other),
        tuple(sources),
        {n: piston_cycle(chosen, wish, accumulator=n == "accumulator") if does else None for n in ways},
        law,
        spread,
        times,
        None if spread is None else daily_use(wish, air, spread.air, line),
        {one.id: one for one in own_valves or ()},
        None if drawn is None else answer_of_posterior(drawn, chosen.muscle, wish),
        collect(said),
    )


def stages(*, lines: bool = True, speed: bool = False) -> int:
    """Largest number of progress reports of `size`, with valves and tubes, and where a speed is required."""
    tried = 2 * MOST_TRIED if speed else 1
    return 3 + (tried + 1 if lines else 0)


def _force_of(force: Any, load: Any) -> Any:
    """The force, or the weight of the load [N]."""
    if load is None:
        return force
    if force is not None:
        raise InputError("load", None, "must be given without a force: it is the mass whose weight is the force")
    if not 0.0 < load < 1e5:
        raise InputError("load", with_unit(load, "kg"), "must be above 0 kg, up to 1e+05 kg")
    return load * GRAVITY


def _check_muscle(name: str | None) -> None:
    """Refuse the name of a muscle that is no candidate, before anything is computed."""
    if name is None or name.lower().endswith(".toml"):
        return
    ranges = [part.id for part in parts("fluidic_muscle")]
    known = [*(f"braid-{objective}" for objective in OBJECTIVES), *specimen_ids("mckibben"), *ranges]
    lower = name.lower()
    if lower not in (one.lower() for one in known) and not any(lower.startswith(f"{r.lower()}-") for r in ranges):
        raise InputError("muscle", name, "the candidates are", known=known)


def _requirements(values: Mapping[str, Any], *, spaced: bool) -> Requirements:
    """The requirements; errors name what was given: the space instead of its length and diameter, rate for frequency."""
    for name, example in EXAMPLES.items():
        if values[name] is None:
            words = name.replace("_", " ")
            raise InputError(
                name, "missing", f"must be a {words}", sentence=f"Sizing needs a {words}, such as {example!r}"
            )
    try:
        return Requirements(**values)
    except InputError as error:
        given = {"frequency": "rate"} | ({"length": "space", "diameter": "space"} if spaced else {})
        raise error.changed(field=given.get(error.field, error.field)) from None


def _with_lines(
    order: list[Judged],
    chosen: Judged,
    free: bool,
    wish: Requirements,
    tell: Progress,
    valves: Sequence[Specimen] | None,
) -> tuple[list[Judged], Judged, list[LineResult]]:
    """Lines of the chosen muscle; if it does not reach the required speed, and none was given, also of the next ones."""
    tried = [m for m in order if m.verdict != VERDICTS[2]][:MOST_TRIED] if free else [chosen]
    fastest, best = chosen, list[LineResult]()
    for one in tried:
        if one.verdict == VERDICTS[2]:
            break
        results = lines_for(one, wish, valves=valves, progress=tell)
        if wish.speed is None:
            return order, one, results
        faster = one.with_speed(max((v.speed for v in results if v.speed is not None), default=0.0), wish.speed)
        order = [faster if m is one else m for m in order]
        if not best or faster.margins["speed"] > fastest.margins["speed"]:
            fastest, best = faster, results
        if faster.margins["speed"] >= 0.0:
            break
    run = [m for m in order if m.speed is not None]  # of the others nobody knows whether they are fast enough
    return [*ranked(run), *(m for m in order if m.speed is None)], fastest, best


def _chosen(order: list[Judged], name: str | None) -> Judged:
    if name is None:
        return order[0]
    for one in order:
        if one.muscle.id.lower() == name.lower():
            return one
    for one in order:  # the cut of a range that was named
        if one.muscle.kind == "size" and one.muscle.id.lower().startswith(f"{name.lower()}-"):
            return one
    raise InputError("muscle", name, "the candidates are", known=[one.muscle.id for one in order])


# ---- force and stroke from the posterior of a law, with what the law has no parameter for

SAMPLES, STROKE_LENGTHS = 400, 64  # samples of the posterior, and lengths between which the end of a stroke lies


def answer_of_posterior(posterior: Posterior, muscle: Candidate, wish: Requirements) -> PosteriorAnswer:
    """Answer of a muscle's posterior to the requirements.

    The discrepancy of a sample is one draw along the whole stroke: a law that is too weak is so throughout.

    Args:
        posterior: samples of the muscle's law.
        muscle: the candidate, whose longest length and friction count.
        wish: force, stroke and pressure.
    """
    rows = posterior.rows(min(SAMPLES, len(posterior)))
    low = min(float(posterior.points.length.min()), muscle.longest - 1.5 * wish.stroke)
    # a fitted law ends at the longest measured length, from which on it states nothing
    lengths = np.linspace(low, min(muscle.longest, float(posterior.points.length.max())), STROKE_LENGTHS)
    pressures = np.full(STROKE_LENGTHS, wish.pressure)
    pull = posterior.signed_tensions(lengths, pressures)[rows]
    passive = np.maximum(posterior.signed_tensions(lengths, np.zeros(STROKE_LENGTHS))[rows], 0.0)
    mean, deviation = posterior.discrepancy_along(rows, *(np.tile(x, (len(rows), 1)) for x in (lengths, pressures)))
    chance = np.random.default_rng(posterior.seed).standard_normal((len(rows), 1))
    force = pull - passive + mean + deviation * chance - muscle.friction
    end = muscle.longest - wish.stroke
    forces = np.array([np.interp(end, lengths, row) for row in force])
    strokes = np.array([muscle.longest - _last_below(wish.force, lengths, row) for row in force])
    points = posterior.points
    within = points.pressure.min() <= wish.pressure <= points.pressure.max()
    within &= points.length.min() <= end <= points.length.max()
    return PosteriorAnswer(
        law=posterior.law,
        force=_band(forces),
        stroke=_band(strokes),
        reached=float(np.mean(forces >= wish.force)),
        within=bool(within),
    )


def _band(values: np.ndarray) -> Band:
    return Band(*np.quantile(values, (0.025, 0.5, 0.975)))


def _last_below(force: float, lengths: np.ndarray, forces: np.ndarray) -> float:
    """Longest length at which a muscle pulls no more than a force [m]; the shortest of the lengths if there is none."""
    weak = np.flatnonzero(forces <= force)
    if not weak.size:
        return float(lengths[0])
    if weak[-1] == len(lengths) - 1:
        return float(lengths[-1])
    at = slice(weak[-1], weak[-1] + 2)
    return float(np.interp(force, forces[at], lengths[at]))
