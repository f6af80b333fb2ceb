"""The answer of a sizing as tables of text, the same for the command line, reports and the web interface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from ...answers import Column, Table
from ...identification.posterior import Band
from ...quantities import with_unit
from .candidate import Judged
from .lines import NOT_KNOWN, LineResult
from .requirements import ALLOWED
from .size import Sizing
from .sources import SourceResult

SHOWN = ("force", "stroke", "length", "diameter", "speed")  # margins with a column of their own


def tables_of(sizing: Sizing) -> list[Table]:
    """All tables of an answer that have something to say."""
    tables = [muscle_table(sizing)]
    if sizing.lines:
        tables.append(line_table(sizing))
    if sizing.lengths:
        tables.append(length_table(sizing))
    if sizing.gas_sources:
        tables.append(source_table(sizing))
    if sizing.daily is not None and sizing.gas_sources:
        tables.append(day_table(sizing))
    return tables


def question(sizing: Sizing) -> str:
    """The requirements as words."""
    return ", ".join(f"{n.replace('_', ' ')} {_asked(n, v)}" for n, v in sizing.wish.parts().items())


def _asked(name: str, value: float) -> str:
    return f"{value / 3600.0:.3g} h" if name == "working_time" else with_unit(value, ALLOWED[name][0], 3)


# ---- muscles


def muscle_table(sizing: Sizing) -> Table:
    """Candidates with their margins, and what the inferred numbers leave for the chosen one."""
    shown = sizing.muscles[: sizing.shown]
    notes = [_braid_words(one) for one in shown if one.muscle.kind == "braid"][:1]
    notes += range_words(sizing)
    notes += posterior_words(sizing)
    if not sizing.reached:
        notes += [
            f"What would do: {m.sentence()}" if m.reachable else f"Not by itself: {m.part}" for m in sizing.misses
        ]
    columns = (
        Column("muscle"),
        Column("verdict", "does it"),
        Column("promised_force", "promised", "N", places=".1f"),
        Column("end_force", "law says", "N", places=".1f"),
        Column("error", unit="1", places=".1%"),
        *(Column(f"{name}_margin", name, "1", places="+.0%") for name in SHOWN),
        Column("overall_length", "long", "m", "cm", ".1f"),
        Column("diameter", "wide", "m", "mm", ".1f"),
        Column("mass", "mass", "kg", "g", ".3g"),
        Column("air", "air", "kg", "mg", ".0f"),
    )
    rows = [
        {
            "muscle": one.muscle.id,
            "verdict": one.verdict,
            "promised_force": one.promised_force,
            "end_force": one.end_force,
            "error": one.muscle.error.share,
            **{f"{name}_margin": margin for name, margin in one.margins.items()},
            "overall_length": one.muscle.overall_length,
            "diameter": one.muscle.diameter,
            "mass": one.muscle.mass,
            "air": one.air,
        }
        for one in shown
    ]
    title = f"Muscles for {question(sizing)} (margins beyond the error of the law)"
    return Table(title, columns, rows, tuple(notes))


def _braid_words(one: Judged) -> str:
    d = one.muscle.dimensions
    return (
        f"{one.muscle.id}: threads of {with_unit(d['thread_length'], 'm')} in {d['turns']:.2f} turns, "
        f"{with_unit(d['diameter_90'], 'm')} wide at 90 degrees; {with_unit(d['braid_angle'], 'rad', 3)} at its longest, "
        f"{with_unit(d['longest_length'], 'm')}, {with_unit(d['end_angle'], 'rad', 3)} at the end; "
        f"rest length {with_unit(d['rest_length'], 'm')}."
    )


def range_words(sizing: Sizing) -> list[str]:
    """What the inferred numbers leave for the chosen muscle and its line, as sentences."""
    spread = sizing.spread
    if spread is None:
        return []
    m, (low, high), (least, most) = sizing.chosen, spread.force, spread.air
    if spread.from_numbers:
        said = (
            f"{m.muscle.id}: with the inferred numbers in their ranges ({_names(spread.from_numbers)}) the force at the end "
            f"of the stroke is {_ends(low, high)} N, the air of a cycle {_ends(1e6 * least, 1e6 * most)} mg."
        )
    else:
        said = f"{m.muscle.id}: no number of its law is inferred."
    words = [said]
    if spread.without_range:
        words.append(f"Inferred without a range, and not in these: {_names(spread.without_range)}.")
    if sizing.time_range is not None and sizing.line is not None:
        shortest, longest = (ms(t) if t < float("inf") else "never" for t in sizing.time_range)
        words.append(f"{sizing.line.valve} with {sizing.line.tube}: to the force in {shortest} to {longest} ms.")
    return words


def posterior_words(sizing: Sizing) -> list[str]:
    """Force and stroke by the posterior of the chosen muscle's law, as sentences."""
    answer = sizing.samples
    if answer is None:
        return []
    force, stroke = _with_ends(answer.force, 1.0, "N"), _with_ends(answer.stroke, 100.0, "cm")
    words = [
        f"{sizing.chosen.muscle.id}, by the posterior of {answer.law}: force at the end of the stroke {force}, "
        f"stroke to the force {stroke}; enough in {100.0 * answer.reached:.3g} % of the samples."
    ]
    if not answer.within:
        words.append(
            "The end of the stroke or the pressure lies beyond the measured map, where the intervals are a guess."
        )
    return words


def _with_ends(band: Band, factor: float, unit: str) -> str:
    """Median of a band with its ends, as words; the factor converts it to the unit."""
    low, median, high = (factor * float(end) for end in band)
    return f"{median:.3g} {unit} ({_ends(low, high)} with 95 %)"


def _ends(low: float, high: float) -> str:
    first, last = f"{low:.3g}", f"{high:.3g}"
    return first if first == last else f"{first} to {last}"


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(name.replace("_", " ") for name in names)


# ---- lines


def line_table(sizing: Sizing) -> Table:
    """Valves and tubes of the chosen muscle."""
    shown = sizing.lines[: sizing.shown]
    notes = ["best: no other line is as good in time, mass, power, air and flexibility of its tube at once."]
    late = [f"{one.valve} with {one.tube}" for one in shown if not one.settled]
    if late:
        said = "their times are" if len(late) > 1 else "its times are"
        notes.append(f"The tension has not settled behind {', '.join(late)}: {said} of a step under way.")
    if any(line.not_stated for line in shown):
        notes.append("Not known: mass or power of a valve of one's own were not given; the ranking takes usual ones.")
    columns = (
        Column("valve"),
        Column("tube"),
        *TIMES,
        Column("valve_mass", "valve", "kg", "g", ".0f", missing=NOT_KNOWN),
        Column("power", "valve", "W", "W", ".1f", missing=NOT_KNOWN),
        Column("stiffness", "bend", "N*m^2", "N*cm^2", ".1f"),
        Column("air", "air", "kg", "mg", ".0f"),
        Column("leak", "leak", "kg/s", "mg/s", ".0f"),
        Column("speed", "speed", "m/s", "cm/s", ".0f"),
        Column("best", right=True),
    )
    rows = [
        {
            **_line(line),
            "valve_mass": None if "mass" in line.not_stated else line.valve_mass,
            "power": None if "power" in line.not_stated else line.power,
            "best": ("*" if line.pareto else "") + ("" if line.keeps_up else " too slow"),
        }
        for line in shown
    ]
    return Table(f"Valves and tubes for {sizing.chosen.muscle.id}", columns, rows, tuple(notes))


TIMES = tuple(
    Column(name, name.replace("_", " "), "s", "ms", ".1f", missing="never") for name in ("to_force", "rise", "fall")
)


def _line(line: LineResult) -> dict[str, Any]:
    names = ("valve", "tube", "tube_length", "to_force", "rise", "fall", "stiffness", "air", "leak", "speed")
    return {name: getattr(line, name) for name in names}


def length_table(sizing: Sizing) -> Table:
    """The best valve behind tubes of other lengths."""
    order = sorted(sizing.lengths, key=lambda x: (x.tube, x.tube_length))
    columns = (
        Column("tube"),
        Column("tube_length", "length", "m"),
        *TIMES,
        Column("air", "air", "kg", "mg", ".0f"),
    )
    return Table(f"{sizing.lengths[0].valve} behind other tubes", columns, [_line(one) for one in order])


def ms(value: float | None) -> str:
    """A time in milliseconds; ``never`` if it does not end."""
    return "never" if value is None else f"{1e3 * value:.1f}"


# ---- gas sources


def source_table(sizing: Sizing) -> Table:
    """Gas sources of the chosen muscle, each number with the range that inferred numbers leave in brackets."""
    why = [f"{one.title}: {one.note}." for one in sizing.gas_sources if not one.able]
    if any(one.form == "bottle" and one.able for one in sizing.gas_sources):
        why.append("The gas of a bottle is throttled from its pressure: most of the filling's work is lost.")
    columns = (
        Column("title", "gas source"),
        Column("does", "does it"),
        _ranged("energy", "a cycle", "J", "J"),
        Column("efficiency", unit="1", shown="%", places=".1f"),
        _ranged("cycles", "cycles", "1"),
        _ranged("run_time", "lasts", "s", "min"),
        Column("mass", unit="kg", shown="kg", places=".3g"),
        Column("duty", "runs", "1", "%", ".0f"),
    )
    rows = [{**row, "does": _does(one)} for one, row in zip(sizing.gas_sources, _sources(sizing), strict=True)]
    notes = (*why, _piston_words(sizing), "In brackets: what the inferred numbers leave.")
    return Table(f"Gas sources for {sizing.chosen.muscle.id}", columns, rows, notes)


def _does(one: SourceResult) -> str:
    return ("yes" if one.surely else "perhaps") if one.able else "no"


def _sources(sizing: Sizing) -> Iterator[dict[str, Any]]:
    """Gas sources as rows, with the ends of their ranges."""
    for one in sizing.gas_sources:
        row = asdict(one)
        for name in ("energy", "cycles", "run_time", "daily", "fillings"):
            row[f"{name}_low"], row[f"{name}_high"] = row[f"{name}_range"] or (None, None)
        yield row


def _ranged(key: str, title: str, unit: str, shown: str = "") -> Column:
    return Column(key, title, unit, shown, "", ends=(f"{key}_low", f"{key}_high"))


def day_table(sizing: Sizing) -> Table:
    """Energy, and fillings or charges, of a day for each source that can do it."""
    columns = (
        Column("title", "gas source"),
        _ranged("daily", "a day", "J", "W h"),
        _ranged("fillings", "fillings or charges a day", "1"),
    )
    rows = [row for row in _sources(sizing) if row["able"] and row["daily"] is not None]
    return Table(" ".join(daily_words(sizing)), columns, rows)


def ranged(value: float | None, ends: tuple[float, float] | None, unit: str, shown: str) -> str:
    """A value with its range in brackets; nothing where there is no value."""
    low, high = ends or (None, None)
    return _ranged("value", "", unit, shown).cell({"value": value, "value_low": low, "value_high": high})


def daily_words(sizing: Sizing) -> list[str]:
    """What a day takes, as sentences."""
    day = sizing.daily
    if day is None:
        return []
    low, high = day.air_range
    said = (
        f"A day of {_asked('working_time', day.working_time)}: {day.cycles:.0f} cycles, {day.air:.3g} kg of air "
        f"({low:.3g} to {high:.3g} kg), {ranged(day.volume, None, 'm^3', 'l')} l at the reference atmosphere"
    )
    if day.valve_energy is not None:
        said += f"; {day.valve_energy / 3600.0:.3g} W h for the valve, if it is held all the time"
    return [f"{said}."]


def _piston_words(sizing: Sizing) -> str:
    plain, again = sizing.piston["surroundings"], sizing.piston["accumulator"]
    if plain is None:
        return "The paper's cycle of maximal shortening is not possible with this muscle."
    said = f"The paper's cycle of maximal shortening: {plain[0]:.2f} J in, {plain[1]:.2f} J out"
    if again is None:
        return said + "; without a threshold there is no accumulator to go back to."
    return said + f"; with an accumulator at the threshold {again[0]:.2f} J in, {again[1]:.2f} J out."
