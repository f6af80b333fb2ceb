"""The answer of a sizing as tables of text, the same for the command line, reports and the web interface."""

from __future__ import annotations

from typing import NamedTuple

from ...identification.posterior import Band
from ...quantities import from_si, with_unit
from .candidate import Judged
from .lines import LineResult
from .requirements import ALLOWED
from .size import Sizing
from .sources import SourceResult

SHOWN = ("force", "stroke", "length", "diameter", "speed")  # margins with a column of their own


class SizingTable(NamedTuple):
    """A table of text.

    Attributes:
        title: heading.
        columns: headings of the columns; numbers have their unit there.
        rows: cells.
        text_columns: number of columns of words, which stand first; the others are numbers.
        notes: sentences below the table.
    """

    title: str
    columns: list[str]
    rows: list[list[str]]
    text_columns: int = 1
    notes: tuple[str, ...] = ()


def tables_of(sizing: Sizing, top: int = 5) -> list[SizingTable]:
    """All tables of an answer that have something to say, with at most `top` rows of muscles and lines."""
    tables = [muscle_table(sizing, top)]
    if sizing.lines:
        tables.append(line_table(sizing, top))
    if sizing.lengths:
        tables.append(length_table(sizing))
    if sizing.sources:
        tables.append(source_table(sizing))
    if sizing.daily is not None and sizing.sources:
        tables.append(day_table(sizing))
    return tables


def question(sizing: Sizing) -> str:
    """The requirements as words."""
    return ", ".join(f"{n.replace('_', ' ')} {_asked(n, v)}" for n, v in sizing.wish.parts().items())


def _asked(name: str, value: float) -> str:
    return f"{value / 3600.0:.3g} h" if name == "working_time" else with_unit(value, ALLOWED[name][0], 3)


# ---- muscles


def muscle_table(sizing: Sizing, top: int) -> SizingTable:
    """Candidates with their margins, and what the inferred numbers leave for the chosen one."""
    columns = [
        "muscle", "does it", "promised, N", "law says, N", "error", *SHOWN, "long, cm", "wide, mm", "mass, g", "air, mg",
    ]  # fmt: skip
    notes = [_braid_words(one) for one in sizing.muscles[:top] if one.muscle.kind == "braid"][:1]
    notes += range_words(sizing)
    notes += posterior_words(sizing)
    if not sizing.reached:
        notes += [
            f"What would do: {m.sentence()}" if m.reachable else f"Not by itself: {m.part}" for m in sizing.misses
        ]
    return SizingTable(
        f"Muscles for {question(sizing)} (margins beyond the error of the law)",
        columns,
        [_muscle_row(one) for one in sizing.muscles[:top]],
        2,
        tuple(notes),
    )


def _muscle_row(one: Judged) -> list[str]:
    m = one.muscle
    return [
        m.id,
        one.verdict,
        f"{one.promised_force:.1f}",
        f"{one.end_force:.1f}",
        f"{m.error.share:.1%}",
        *(_percent(one.margins[n]) if n in one.margins else "" for n in SHOWN),
        f"{100 * m.overall_length:.1f}",
        f"{1e3 * m.diameter:.1f}",
        "" if m.mass is None else f"{1e3 * m.mass:.3g}",
        f"{1e6 * one.air:.0f}",
    ]


def _percent(margin: float) -> str:
    return f"{round(margin, 2) + 0.0:+.0%}"


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


def line_table(sizing: Sizing, top: int) -> SizingTable:
    """Valves and tubes of the chosen muscle."""
    columns = [
        "valve", "tube", "to force, ms", "rise, ms", "fall, ms", "valve, g", "W", "bend, N cm2", "air, mg", "leak, mg/s",
        "speed, cm/s", "best",
    ]  # fmt: skip
    notes = ["best: no other line is as good in time, mass, power, air and flexibility of its tube at once."]
    late = [f"{one.valve} with {one.tube}" for one in sizing.lines[:top] if not one.settled]
    if late:
        said = "their times are" if len(late) > 1 else "its times are"
        notes.append(f"The tension has not settled behind {', '.join(late)}: {said} of a step under way.")
    if any(line.not_stated for line in sizing.lines[:top]):
        notes.append("Not known: mass or power of a valve of one's own were not given; the ranking takes usual ones.")
    title = f"Valves and tubes for {sizing.chosen.muscle.id}"
    return SizingTable(title, columns, [_line_row(one) for one in sizing.lines[:top]], 2, tuple(notes))


def _line_row(line: LineResult) -> list[str]:
    return [
        line.valve,
        line.tube,
        *_times(line),
        line.valve_mass_shown,
        line.power_shown,
        f"{1e4 * line.stiffness:.1f}",
        f"{1e6 * line.air:.0f}",
        f"{1e6 * line.leak:.0f}",
        "" if line.speed is None else f"{100 * line.speed:.0f}",
        ("*" if line.pareto else "") + ("" if line.keeps_up else " too slow"),
    ]


def length_table(sizing: Sizing) -> SizingTable:
    """The best valve behind tubes of other lengths."""
    order = sorted(sizing.lengths, key=lambda x: (x.tube, x.tube_length))
    rows = [[x.tube, with_unit(x.tube_length, "m"), *_times(x), f"{1e6 * x.air:.0f}"] for x in order]
    columns = ["tube", "length", "to force, ms", "rise, ms", "fall, ms", "air, mg"]
    return SizingTable(f"{sizing.lengths[0].valve} behind other tubes", columns, rows)


def _times(line: LineResult) -> list[str]:
    return [ms(line.to_force), ms(line.rise), ms(line.fall)]


def ms(value: float | None) -> str:
    """A time in milliseconds; ``never`` if it does not end."""
    return "never" if value is None else f"{1e3 * value:.1f}"


# ---- gas sources


def source_table(sizing: Sizing) -> SizingTable:
    """Gas sources of the chosen muscle, each number with the range that inferred numbers leave in brackets."""
    columns = ["gas source", "does it", "J a cycle", "efficiency, %", "cycles", "lasts, min", "mass, kg", "runs, %"]
    why = [f"{one.title}: {one.note}." for one in sizing.sources if not one.able]
    if any(one.form == "bottle" and one.able for one in sizing.sources):
        why.append("The gas of a bottle is throttled from its pressure: most of the filling's work is lost.")
    notes = (*why, _piston_words(sizing), "In brackets: what the inferred numbers leave.")
    return SizingTable(
        f"Gas sources for {sizing.chosen.muscle.id}", columns, [_source_row(one) for one in sizing.sources], 2, notes
    )


def _source_row(one: SourceResult) -> list[str]:
    return [
        one.title,
        ("yes" if one.surely else "perhaps") if one.able else "no",
        ranged(one.energy, one.energy_range),
        f"{100 * one.efficiency:.1f}",
        ranged(one.cycles, one.cycles_range),
        ranged(one.run_time, one.run_time_range, 1.0 / 60.0),
        "" if one.mass is None else f"{one.mass:.3g}",
        "" if one.duty is None else f"{100 * one.duty:.0f}",
    ]


def day_table(sizing: Sizing) -> SizingTable:
    """Energy, and fillings or charges, of a day for each source that can do it."""
    hours = 1.0 / 3600.0
    rows = [
        [one.title, ranged(one.daily, one.daily_range, hours), ranged(one.fillings, one.fillings_range)]
        for one in sizing.sources
        if one.able and one.daily is not None
    ]
    columns = ["gas source", "W h a day", "fillings or charges a day"]
    return SizingTable(" ".join(daily_words(sizing)), columns, rows, 1)


def ranged(value: float | None, ends: tuple[float, float] | None, scale: float = 1.0) -> str:
    """A value with its range in brackets, both times a scale; nothing where there is no value."""
    if value is None:
        return ""
    words = _number(value * scale)
    low, high = (words, words) if ends is None else (_number(end * scale) for end in ends)
    return words if low == high == words else f"{words} ({low} to {high})"


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def daily_words(sizing: Sizing) -> list[str]:
    """What a day takes, as sentences."""
    day = sizing.daily
    if day is None:
        return []
    low, high = day.air_range
    said = (
        f"A day of {_asked('working_time', day.working_time)}: {day.cycles:.0f} cycles, {day.air:.3g} kg of air "
        f"({low:.3g} to {high:.3g} kg), {_number(from_si(day.volume, 'm^3', 'l'))} l at the reference atmosphere"
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
