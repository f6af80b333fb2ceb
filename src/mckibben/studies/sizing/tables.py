"""The answer of a sizing, and its tables of text: the same for the command line, reports and the web interface."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from ...accessors import Accessor
from ...answers import Answer, Caution, Column, Table
from ...documents import JsonValue
from ...extras import library
from ...identification.posterior import Band
from ...quantities import with_unit
from ...specimens import Specimen
from .as_files import circuit_of, specimen_of
from .braid_law import BRAID_LAWS
from .candidate import VERDICTS, Judged
from .lines import NOT_KNOWN, LineResult
from .requirements import ALLOWED, Requirements, Shortfall
from .sources import DailyUse, SourceResult
from .spread import InferredRanges

if TYPE_CHECKING:
    import pandas

    from ...accessors import SizingPlots

SHOWN = ("force", "stroke", "length", "diameter", "speed")  # margins with a column of their own


class PosteriorAnswer(NamedTuple):
    """Force and stroke from the samples of a posterior, with 95 % intervals.

    Attributes:
        law: name of the law.
        force: at the end of the wished stroke, less friction: low, median and high [N].
        stroke: until the force is the wished one [m], likewise.
        reached: share of the samples in which the muscle meets force and stroke.
        within: whether the wished pressure and the end of the stroke lie within the measured map.
    """

    law: str
    force: Band
    stroke: Band
    reached: float
    within: bool

    def to_dict(self) -> dict[str, JsonValue]:
        """Plain values [SI], for JSON."""
        both = {name: {k: float(v) for k, v in getattr(self, name)._asdict().items()} for name in ("force", "stroke")}
        return {"law": self.law, **both, "reached": self.reached, "within": self.within}


@dataclass(frozen=True, eq=False, repr=False)
class Sizing(Answer):
    """Result of sizing.

    Attributes:
        wish: the requirements.
        muscles: every candidate, the best first.
        misses: what stands in the way of a braid, or of the speed; empty if one does it.
        chosen: for which lines and sources were looked for; the best, or the one asked for.
        lines: valves with tubes for it, the best first; empty if none were looked for.
        lengths: the best valve with tubes of other lengths.
        gas_sources: sources of gas, those that can do it first.
        piston: input and output of the paper's cycle of maximal shortening without and with an accumulator [J].
        law: of the braids.
        spread: ranges that inferred numbers leave for the chosen muscle; None if no muscle does it.
        time_range: shortest and longest time of the best line to the force, within its inferred numbers [s].
        daily: what a day takes; None without a frequency and a working time.
        valves: specimens of the valves of the user's own, by the names in `lines`.
        samples: force and stroke of the chosen muscle by the posterior of its law; None if none was given.
        cautions: what can hardly be meant of the requirements.
        shown: number of muscles, lines and lengths in tables and JSON; all by default.
    """

    wish: Requirements
    muscles: tuple[Judged, ...]
    misses: tuple[Shortfall, ...]
    chosen: Judged
    lines: tuple[LineResult, ...]
    lengths: tuple[LineResult, ...]
    gas_sources: tuple[SourceResult, ...]
    piston: dict[str, tuple[float, float] | None]
    law: str = BRAID_LAWS[0]
    spread: InferredRanges | None = None
    time_range: tuple[float, float] | None = None
    daily: DailyUse | None = None
    valves: Mapping[str, Specimen] = field(default_factory=dict)
    samples: PosteriorAnswer | None = None
    cautions: tuple[Caution, ...] = ()
    shown: int | None = None

    plot: ClassVar[Accessor[SizingPlots]] = Accessor("SizingPlots")

    @property
    def line(self) -> LineResult | None:
        """The best valve and tube that reach the force; None if none was looked for, or none does."""
        return next((one for one in self.lines if one.to_force is not None), None)

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

    def to_specimen(self) -> Specimen:
        """The chosen muscle as a specimen, which every command and page takes."""
        return specimen_of(self.chosen.muscle, self.wish.pressure)

    def to_circuit(self) -> dict[str, JsonValue]:
        """The chosen muscle behind the best valve and tube, as the tables of a circuit's file.

        The muscle is held at the end of its stroke, the valve opens after 20 ms.

        Raises:
            InputError: no valve and tube were looked for, or none reaches the force.
        """
        return circuit_of(self.chosen, self.wish, self.line, self.valves)

    def first(self, count: int) -> Sizing:
        """The same with `count` muscles, lines and lengths in tables and JSON."""
        return replace(self, shown=count)

    def tables(self) -> list[Table]:
        """Muscles, and for the chosen one valves with tubes, other tubes, gas sources and what a day takes."""
        return tables_of(self)

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per muscle, as in `to_dict`."""
        rows = []
        for one in self.muscles[: self.shown]:
            low, high = one.interval or (None, None)
            plain = one.to_dict() | {"interval": [], "interval_low": low, "interval_high": high}
            rows.append({name: value for name, value in plain.items() if not isinstance(value, dict | list)})
        return rows

    def failure(self) -> str | None:
        """The sentence where nothing reaches it."""
        return None if self.reached else self.sentence()

    def to_dict(self) -> dict[str, JsonValue]:
        """The whole answer as plain values in SI, for JSON."""
        top = self.shown
        return {
            "reached": self.reached,
            "wish": self.wish.parts(),
            "muscles": [one.to_dict() for one in self.muscles[:top]],
            "chosen": self.chosen.muscle.id,
            "interval": self.chosen.interval_words,
            "misses": [
                {"part": m.part, "asked": m.asked, "reachable": m.reachable, "sentence": m.sentence()}
                for m in self.misses
            ],
            "lines": [line.to_dict() for line in self.lines[:top]],
            "lengths": [line.to_dict() for line in self.lengths[:top]],
            "sources": [asdict(one) for one in self.gas_sources],
            "piston": {k: None if v is None else {"input": v[0], "output": v[1]} for k, v in self.piston.items()},
            "ranges": None if self.spread is None else self.spread._asdict() | {"to_force": self.time_range},
            "daily": None if self.daily is None else asdict(self.daily),
            "posterior": None if self.samples is None else self.samples.to_dict(),
            "sentence": None if self.reached else self.sentence(),
        }

    def __repr__(self) -> str:
        verdict = f"best {self.best.muscle.id}: {self.best.verdict}" if self.reached else self.sentence()
        return f"Sizing({len(self.muscles)} muscles, {len(self.lines)} lines, {verdict})"

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
    known = any(one.interval is not None for one in shown)
    notes = [_braid_words(one) for one in shown if one.muscle.kind == "braid"][:1]
    notes += [f"{sizing.chosen.muscle.id}, one muscle: {sizing.chosen.interval_words}."]
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
        *([Column("both", "one muscle, 95 %", "N", places=".0f", ends=("low", "high"), missing="unknown")] * known),
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
            **dict(zip(("low", "high"), one.interval or (), strict=False)),
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
    columns = (Column("tube"), Column("tube_length", "length", "m"), *TIMES, Column("air", "air", "kg", "mg", ".0f"))
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
    does = [("yes" if one.surely else "perhaps") if one.able else "no" for one in sizing.gas_sources]
    rows = [{**row, "does": word} for word, row in zip(does, _sources(sizing), strict=True)]
    notes = (*why, _piston_words(sizing), "In brackets: what the inferred numbers leave.")
    return Table(f"Gas sources for {sizing.chosen.muscle.id}", columns, rows, notes)


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
