"""Sizing: candidates of muscles, their lines, and gas sources with the number of cycles per filling or battery.

    bottle       work of filling it for the gas that a cycle takes; what is left below the supply's pressure is lost
    compressor   isothermal R T ln r at best; adiabatic, and with its efficiency, as the compressor of the circuits
    heated       a closed gas between a cold low pressure and the hot high one, with a reservoir beside the muscle:
                 Th = T0 P (V1 + Vr)/(Px (V2 + Vr)),   Q = m cv (Th - T0) + P (V1 - V2)

V2 and V1 are the muscle's volumes at both ends, P and Px absolute. The work of a cycle is the wished force times the stroke.
Range: ideal gases; bottles at the temperature of the room, though a fast draught of CO2 cools them. The heated reservoir
gives all its heat back to the room each cycle. Source of the choice: the discussion of C.-P. Chou and B. Hannaford, 1996,
doi:10.1109/70.481753; the formulas are those of an ideal gas.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ...accessors import Accessor, implementation
from ...analysis.energy import Conditions, cycle_muscle, energy_cycle
from ...components.flow import GasState
from ...errors import InputError, MckibbenError
from ...extras import library
from ...pneumatics.compressor import Compressor
from ...pneumatics.gas import AIR, REFERENCE_DENSITY
from ...quantities import in_si, with_unit
from ...specimens.parts import CataloguePart, parts
from . import catalogue
from .braid import OBJECTIVES, design
from .braid_law import BRAID_LAWS
from .candidate import VERDICTS, Candidate, Ends, Judged, judged, ranked
from .lines import LENGTHS, LineResult, lines_for
from .requirements import ALLOWED, Requirements, Shortfall


@dataclass(frozen=True)
class SourceResult:
    """Performance of a gas source.

    Attributes:
        id: of the part.
        title: description.
        form: ``bottle``, ``compressor`` or ``heated``.
        energy: that a cycle costs at the source [J].
        isothermal: what it would cost with an ideal compressor of constant temperature [J].
        adiabatic: the same without heat exchange [J]; None if there is no compressor.
        efficiency: force times stroke over `energy` [1].
        gas: mass that a cycle takes [kg].
        cycles: cycles of one filling or battery; None if it does not end.
        run_time: at the wished frequency [s]; None if neither is known.
        mass: mass of the source [kg]; None if unknown.
        able: whether it can do it at the wished frequency.
        note: why not, or what to know.
        temperature: highest of the gas [K]; None if it is that of the room.
        inferred: numbers that no source prints.
    """

    id: str
    title: str
    form: str
    energy: float
    isothermal: float | None
    adiabatic: float | None
    efficiency: float
    gas: float
    cycles: int | None
    run_time: float | None
    mass: float | None
    able: bool
    note: str
    temperature: float | None
    inferred: tuple[str, ...]


def sources_for(muscle: Judged, wish: Requirements, line: LineResult | None) -> list[SourceResult]:
    """Evaluate every shipped source for the air that muscle and line take; sufficient ones first, by their energy."""
    air, pressure = (muscle.air, wish.pressure) if line is None else (line.air, line.supply)
    make = {"bottle": _bottle, "compressor": _compressor, "heated": _heated}
    results = [make[p.form](p, muscle, wish, air, pressure) for p in parts("gas_source")]
    return sorted(results, key=lambda s: (not s.able, s.energy))


def _work(wish: Requirements) -> float:
    return wish.force * wish.stroke


def _isothermal(part: CataloguePart, wish: Requirements, pressure: float) -> float:
    """Least work to compress gas from atmospheric to a gauge pressure [J/kg]."""
    room = float(wish.environment.pressure_abs)
    return part.values["gas_constant"] * float(wish.environment.temperature) * math.log1p(pressure / room)


def _bottle(part: CataloguePart, muscle: Judged, wish: Requirements, air: float, pressure: float) -> SourceResult:
    v = part.values
    room, warm = float(wish.environment.pressure_abs), float(wish.environment.temperature)
    gas = air * float(AIR.gas_constant) / v["gas_constant"]
    left = (pressure + room) * v["volume"] / (v["gas_constant"] * warm)
    cycles = max(0, int((v["filling"] - left) / gas))
    energy = gas * v["filling_work"]
    enough = v["pressure"] > pressure and cycles > 0
    return SourceResult(
        part.id,
        part.title,
        part.form,
        energy,
        gas * _isothermal(part, wish, pressure),
        None,
        _work(wish) / energy,
        gas,
        cycles,
        None if wish.frequency is None else cycles / wish.frequency,
        v["mass"],
        enough,
        "throttled from its pressure: most of the filling's work is lost" if enough else "empty before a cycle is done",
        None,
        tuple(part.inferred()),
    )


def _compressor(part: CataloguePart, muscle: Judged, wish: Requirements, air: float, pressure: float) -> SourceResult:
    v = part.values
    ideal = air * adiabatic_work(wish, pressure)
    energy = ideal / v["efficiency"]
    stored = v.get("stored_energy")
    cycles = None if stored is None else int(stored / energy)
    drawn = None if wish.frequency is None else air * wish.frequency / REFERENCE_DENSITY
    able = drawn is None or drawn <= v["free_flow"]
    share = "" if drawn is None else f"runs {drawn / v['free_flow']:.0%} of the time"
    run_time = None if cycles is None or wish.frequency is None else cycles / wish.frequency
    return SourceResult(
        part.id,
        part.title,
        part.form,
        energy,
        air * _isothermal(part, wish, pressure),
        ideal,
        _work(wish) / energy,
        air,
        cycles,
        run_time,
        v["mass"],
        able,
        share if able else "delivers too little for that frequency",
        None,
        tuple(part.inferred()),
    )


def adiabatic_work(wish: Requirements, pressure: float) -> float:
    """Work to compress ambient air to a gauge pressure without heat exchange and losses [J/kg]."""
    machine = Compressor(displacement=1e-5, speed=150.0, clearance=0.0, efficiency=1.0)
    room, warm = float(wish.environment.pressure_abs), float(wish.environment.temperature)
    gas = (GasState(room, warm), GasState(pressure + room, warm))
    (flow,) = machine.flows(gas, (), 1.0, 1.0)
    return float(machine.shaft_power(gas, (), 1.0, 1.0) / flow)


def _heated(part: CataloguePart, muscle: Judged, wish: Requirements, air: float, pressure: float) -> SourceResult:
    v, p = part.values, wish.pressure
    room, cold = float(wish.environment.pressure_abs), float(wish.environment.temperature)
    ends = Ends(muscle.muscle.law, p)
    long_, short = muscle.muscle.longest, muscle.muscle.longest - wish.stroke
    low = min(v["low_pressure"], 0.5 * p)
    v2, v1 = ends.volume(long_, low), ends.volume(short)
    reservoir = v1  # as large as the muscle; a larger one is cooler and wastes more heat
    gas = (low + room) * (v2 + reservoir) / (v["gas_constant"] * cold)
    hot = cold * (p + room) * (v1 + reservoir) / ((low + room) * (v2 + reservoir))
    heat = gas * v["gas_constant"] / (v["heat_ratio"] - 1.0) * (hot - cold) + (p + room) * (v1 - v2)
    able = hot <= v["hottest"]
    reach = v["hottest"] / cold * (low + room) * (v2 + reservoir) / (v1 + reservoir) - room
    note = "closed: no gas is used up"
    if not able:
        least, most = with_unit(low, "Pa", 3), with_unit(reach, "Pa", 2)
        note = f"{hot:.0f} K is needed, {v['hottest']:.0f} K is borne: that makes {most} of {least}"
    return SourceResult(
        part.id,
        part.title,
        part.form,
        heat,
        None,
        None,
        _work(wish) / heat,
        0.0,
        None,
        None,
        None,
        able,
        note,
        hot,
        tuple(part.inferred()),
    )


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
if TYPE_CHECKING:
    import pandas

    from ...report.figures.plots import SizingPlots

EXAMPLES = {"force": "50 N", "stroke": "3 cm"}
MOST_TRIED = 3  # muscles whose speed is looked for


@dataclass(frozen=True, eq=False, repr=False)
class Sizing:
    """Result of sizing.

    Attributes:
        wish: the requirements.
        muscles: every candidate, the best first.
        misses: what stands in the way of a braid, or of the speed; empty if one does it.
        chosen: for which lines and sources were looked for; the best, or the one asked for.
        lines: valves with tubes for it, the best first; empty if none were looked for.
        lengths: the best valve with tubes of other lengths.
        sources: sources of gas, those that can do it first.
        piston: input and output of the paper's cycle of maximal shortening without and with an accumulator [J].
        law: of the braids.
    """

    wish: Requirements
    muscles: tuple[Judged, ...]
    misses: tuple[Shortfall, ...]
    chosen: Judged
    lines: tuple[LineResult, ...]
    lengths: tuple[LineResult, ...]
    sources: tuple[SourceResult, ...]
    piston: dict[str, tuple[float, float] | None]
    law: str = BRAID_LAWS[0]

    plot: ClassVar[Accessor[SizingPlots]] = Accessor("report.figures.plots:SizingPlots")

    @property
    def best(self) -> Judged:
        """The best candidate."""
        return self.muscles[0]

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per candidate, best first: verdict, force [N], stroke [m], length and diameter [m], mass [kg].

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        rows = [
            {
                "muscle": one.muscle.id,
                "verdict": one.verdict,
                "promised_force": one.promised_force,
                "end_force": one.end_force,
                "stroke": one.stroke,
                "length": one.muscle.overall_length,
                "diameter": one.muscle.diameter,
                "mass": one.muscle.mass,
            }
            for one in self.muscles
        ]
        frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(rows)
        return frame.set_index("muscle")

    def __repr__(self) -> str:
        verdict = f"best {self.best.muscle.id}: {self.best.verdict}" if self.reached else self.sentence()
        return f"Sizing({len(self.muscles)} muscles, {len(self.lines)} lines, {verdict})"

    def _repr_html_(self) -> str:
        return str(implementation("report.figures.plots:sizing_html")(self))

    @property
    def reached(self) -> bool:
        """Whether some muscle is sufficient, beyond the error of its law or by its law; with a speed, one that was run."""
        lined = self.wish.speed is None or not self.lines
        return any(m.verdict != VERDICTS[2] for m in self.muscles if lined or m.speed is not None)

    @property
    def nearest(self) -> Judged:
        """Candidate that comes nearest to the requirements."""
        return self.chosen if "speed" in self.chosen.margins else self.muscles[0]

    def sentence(self) -> str:
        """Describe the obstacle, and the change that would make the requirements reachable."""
        one = self.nearest
        part, margin = one.worst
        said = f"nothing reaches it; nearest is {one.muscle.id}, whose {part} falls short by {-margin:.0%}"
        could = [m for m in self.misses if m.reachable is not None]
        return said + (f"; what would do: {could[0].sentence()}" if could else "")


def size(
    wish: Requirements | None = None,
    *,
    force: float | str | None = None,
    stroke: float | str | None = None,
    pressure: float | str = "5 bar",
    length: float | str | None = None,
    diameter: float | str | None = None,
    speed: float | str | None = None,
    rate: float | str | None = None,
    tube_length: float | str = "50 cm",
    law: str = BRAID_LAWS[0],
    muscle: str | None = None,
    lines: bool = True,
    progress: Progress | None = None,
) -> Sizing:
    """Find the muscle, valve, tube and gas source for a force and a stroke.

    Args:
        wish: the requirements; by default composed of those that follow.
        force: force at the end of the stroke, while the muscle shortens [N].
        stroke: distance by which the muscle shortens [m].
        pressure: gauge pressure at which it does so [Pa].
        length: largest overall length, fittings included [m].
        diameter: largest outer diameter, when contracted [m].
        speed: speed of shortening with that force [m/s].
        rate: frequency of working cycles [1/s].
        tube_length: length of tube between valve and muscle [m].
        law: law of `BRAID_LAWS`, for the braids.
        muscle: id of the candidate, or a specimen file, for which lines and sources are looked for; the best by default.
        lines: look for valves and tubes.
        progress: called with a description of the next stage.

    Raises:
        InputError: force or stroke is missing, a value is out of bounds, the law is unknown, or no candidate has that id.

    Examples:
        >>> import mckibben as mk
        >>> found = mk.size(force="50 N", stroke="3 cm", lines=False)
        >>> found.reached
        True
    """
    if wish is None:
        wish = _requirements(
            force=force,
            stroke=stroke,
            pressure=pressure,
            length=length,
            diameter=diameter,
            speed=speed,
            frequency=rate,
            tube_length=tube_length,
        )
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
        candidates, muscle = (
            [one for one in candidates if one.id != own_candidate.id] + [own_candidate],
            own_candidate.id,
        )
    tell("fluidic muscles")
    candidates += catalogue.of_sizes(wish)
    order = ranked([judged(one, wish) for one in candidates])
    chosen = _chosen(order, muscle)
    best: list[LineResult] = []
    other: list[LineResult] = []
    if lines:
        order, chosen, best = _with_lines(order, chosen, muscle is None, wish, tell)
        if best and best[0].to_force is not None:
            other = lines_for(chosen, wish, valves=[best[0].valve], lengths=LENGTHS, progress=tell)
    if wish.speed is not None and chosen.speed is not None and chosen.speed < wish.speed:
        misses = (*misses, Shortfall("speed", wish.speed, chosen.speed or None))
    line = next((one for one in best if one.to_force is not None), None)
    does = chosen.verdict != VERDICTS[2]  # else there is no work whose energy could be told
    sources = sources_for(chosen, wish, line) if does else []
    ways = ("surroundings", "accumulator")
    piston = {n: piston_cycle(chosen, wish, accumulator=n == "accumulator") if does else None for n in ways}
    return Sizing(wish, tuple(order), tuple(misses), chosen, tuple(best), tuple(other), tuple(sources), piston, law)


def _requirements(**values: float | str | None) -> Requirements:
    """The requirements of numbers [SI] and texts with units."""
    for name in ("force", "stroke"):
        if values[name] is None:
            raise InputError(
                name, "missing", f"must be a {name}", sentence=f"Sizing needs a {name}, such as {EXAMPLES[name]!r}"
            )
    si = {n: None if v is None else float(in_si(v, ALLOWED[n][0], field=n)) for n, v in values.items()}
    return Requirements(**si)  # type: ignore[arg-type]


def _with_lines(
    order: list[Judged], chosen: Judged, free: bool, wish: Requirements, tell: Progress
) -> tuple[list[Judged], Judged, list[LineResult]]:
    """Lines of the chosen muscle; if it does not reach the required speed, and none was given, also of the next ones."""
    tried = [m for m in order if m.verdict != VERDICTS[2]][:MOST_TRIED] if free else [chosen]
    fastest, best = chosen, list[LineResult]()
    for one in tried:
        if one.verdict == VERDICTS[2]:
            break
        results = lines_for(one, wish, progress=tell)
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
    raise InputError("muscle", name, "the candidates are", known=[one.muscle.id for one in order])
