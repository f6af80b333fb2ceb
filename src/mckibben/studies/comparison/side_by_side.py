"""The verb `compare`: muscles by their laws, recordings beside them, and on request equal protocols and a match."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..._lazy import LazyModule
from ...accessors import Accessor, implementation
from ...answers import Answer, Caution, Column, Table, collect
from ...documents import JsonValue
from ...errors import InputError, each_once
from ...extras import library
from ...muscles import Muscle
from ...muscles.evidence import law_cautions
from ...muscles.plausible import free_length_caution, pressure_caution
from ...specimens import Specimen, muscle_specimen
from ...specimens.published import PublishedRange, published_ranges
from ...verbs import LawName, MuscleName, NamedValues, Pressure, RecordingFile, RigName, typed, verb
from .table import (
    PROPERTIES,
    STATIC,
    Comparable,
    ComparedMuscle,
    MuscleColumn,
    PropertyRow,
    column_of,
    law_column,
    subject,
)

if TYPE_CHECKING:
    import pandas

    from ...accessors import ComparisonPlots
    from . import match as matching
    from . import protocols as equal_protocols
    from .match import Match
    from .protocols import Trials
else:  # what runs protocols and searches takes a second to import
    matching, equal_protocols = (LazyModule(f"{__package__}.{name}") for name in ("match", "protocols"))


@dataclass(frozen=True, repr=False)
class MuscleTable(Answer):
    """Columns of muscles; rows are the properties that any of them has, or that are published."""

    columns: tuple[MuscleColumn, ...]
    published: Mapping[str, PublishedRange]
    muscles: tuple[ComparedMuscle, ...] = field(default=(), compare=False)  # of the columns that are no recordings
    trials: tuple[Trials, ...] = field(default=(), compare=False)  # their protocols, where these were run
    matches: tuple[Match, ...] = field(default=(), compare=False)  # with elements, where these were searched
    cautions: tuple[Caution, ...] = field(default=(), compare=False)

    plot: ClassVar[Accessor[ComparisonPlots]] = Accessor("ComparisonPlots")
    """The muscles' static curves side by side, see `report.figures.plots`."""

    def properties(self) -> tuple[PropertyRow, ...]:
        """All rows that are not empty, in the order of `PROPERTIES`."""
        rows = []
        for name, prop in PROPERTIES.items():
            values = tuple(c.values.get(name) for c in self.columns)
            if any(v is not None for v in values) or (name in self.published and prop in STATIC):
                rows.append(PropertyRow(prop, values, self.published.get(name)))
        return tuple(rows)

    def to_dataframe(self) -> pandas.DataFrame:
        """One row per property, with its unit and one column per muscle.

        Raises:
            MissingLibraryError: pandas is not installed; it comes with the extra ``data``.
        """
        frame: pandas.DataFrame = library("pandas", "Data frames need").DataFrame(self.rows())
        return frame.set_index(["property", "unit"])

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write a report with table and figure to an ``.html`` or ``.pdf`` file; returns its path."""
        return Path(implementation("muscle_comparison")(self).write(Path(path)))

    def __repr__(self) -> str:
        return f"MuscleTable({', '.join(column.name for column in self.columns)}: {len(self.properties())} properties)"

    def rows(self) -> list[dict[str, Any]]:
        """A row per property, in the unit that it is shown in."""
        names = [column.name for column in self.columns]
        return [
            {"property": row.property.title, "unit": row.property.unit, **dict(zip(names, row.shown(), strict=True))}
            for row in self.properties()
        ]

    def to_dict(self) -> dict[str, JsonValue]:
        """Values of all properties in the units that they are shown in, and what each column is from."""
        rows = []
        for row in self.properties():
            one: dict[str, Any] = {"property": row.property.name, "unit": row.property.unit, "values": row.shown()}
            one |= {"title": row.property.title, "published": None}
            ends, p = row.shown_range(), row.published
            if ends is not None and p is not None:
                one["published"] = {"low": ends[0], "high": ends[1], "sources": list(p.sources)}
                one["published"] |= {"through": p.through, "derived": p.derived, "note": p.note}
            rows.append(one)
        out: dict[str, Any] = {
            "columns": [c.name for c in self.columns],
            "rows": rows,
            "about": [{"title": c.title, "from": c.kind, "notes": list(c.notes)} for c in self.columns],
        }
        return out | ({"match": [match.to_dict() for match in self.matches]} if self.matches else {})

    def tables(self) -> list[Table]:
        """The muscles side by side, and what elements bring them close to a biological one."""
        names = [column.name for column in self.columns]
        columns = [Column("title", ""), Column("unit")]
        columns += [Column(f"value {i}", name, "1", places="", missing="\N{EN DASH}") for i, name in enumerate(names)]
        columns += [Column("published", "biological, published", "1", places="", ends=("low", "high"))]
        rows = []
        for row in self.properties():
            one: dict[str, Any] = {"title": row.property.title, "unit": row.property.unit}
            one |= {f"value {i}": value for i, value in enumerate(row.shown())}
            rows.append(one | dict(zip(("low", "high"), row.shown_range() or (None, None), strict=True)))
        notes = tuple(f"{column.name}: {note}." for column in self.columns for note in column.notes)
        return [
            Table("Muscles side by side", tuple(columns), rows, notes),
            *(t for m in self.matches for t in m.tables()),
        ]

    @property
    def sources(self) -> tuple[str, ...]:  # type: ignore[override]
        """Keys of the paper, and of what published ranges rest on."""
        ranges = [row.published for row in self.properties() if row.published is not None]
        return tuple(dict.fromkeys(["chou1996", *(key for one in ranges for key in one.sources)]))


@verb
def compare(
    *muscles: MuscleName,
    recordings: Sequence[RecordingFile] = (),
    pressure: Pressure = "5 bar",
    protocols: bool = False,
    stimulation: NamedValues | None = None,
    match: MuscleName | None = None,
    rig: RigName | None = None,
    law: LawName | None = None,
    progress: Callable[[str], None] | None = None,
) -> MuscleTable:
    """Compare muscles with each other, and with published biological muscle.

    The rows are those of the paper's Table 1.

    Args:
        muscles: specimens by id or .toml file; in Python also muscles, or a list of them.
        recordings: recording to show as a further column, with the names of its muscle's rest length.
        pressure: gauge pressure that counts as the full drive of McKibben muscles [Pa].
        protocols: also run twitch, step, release, force-velocity and work loop on each muscle.
        stimulation: stimulate biological muscles in the work loop: phase, duty, rate or width, such as phase='60 deg'
            or duty=0.3.
        match: also search elements that bring each McKibben muscle close to this biological one.
        rig: rig for protocols and match; by default the paper's where its range allows.
        law: law to use for the muscles that state it instead of their default.
        progress: called with a description of the next stage, at most `stages` times.

    Raises:
        InputError: nothing to compare, what a muscle or a recording lacks, or options that exclude each other.

    Examples:
        >>> import mckibben as mk
        >>> mk.compare("nylon", "fast-fibre")
        MuscleTable(nylon, fast-fibre: 16 properties)
    """
    if rig is not None and not protocols and match is None:
        raise InputError("rig", None, "is allowed only with {protocols} or {match}, which run on it")
    if stimulation is not None:
        if not protocols:
            raise InputError("stimulation", None, "is allowed only with {protocols}, whose work loop it drives")
        equal_protocols.stimulated_loop(stimulation)
    full = float(pressure)
    subjects = _subjects(muscles, full, law)
    braided = [s for s in subjects if s.unit is not None]
    said = collect(*(one for s in braided for one in _cautions(s, full, typed(pressure))))
    target = None if match is None else _target(match, subjects)
    columns = [law_column(s) for s in subjects] + [column_of(file) for file in recordings]
    names = _apart(one.name for one in columns)
    columns = [one._replace(name=name) for one, name in zip(columns, names, strict=True)]
    if not columns:
        raise InputError("muscles", None, "are missing: a specimen's id or file, or a recording")
    done: list[Trials] = []
    if protocols:
        on = rig or equal_protocols.rig_for(subjects)
        for one in subjects:
            done.append(equal_protocols.trials(one, rig=on, stimulation=stimulation, progress=progress))
        columns[: len(done)] = [trial.column() for trial in done]
    matches: list[Match] = []
    if target is not None:
        twitch = matching.TWITCH
        records = {t.muscle.id: t.records[twitch] for t in done if twitch in t.records}
        matches = [matching.match(s, target, records=records, rig=rig, progress=progress) for s in braided]
    return MuscleTable(tuple(columns), published_ranges(), tuple(subjects), tuple(done), tuple(matches), said)


def stages(muscles: Sequence[Specimen], *, protocols: bool = False, match: str | None = None) -> int:
    """Largest number of progress reports of `compare`."""
    runs = len(muscles) * len(equal_protocols.NAMES) if protocols else 0
    searches = 0 if match is None else sum(one.kind == "mckibben" for one in muscles) * matching.STAGES
    return runs + searches


def _subjects(
    muscles: Sequence[Comparable | Iterable[Comparable]], pressure: float, law: str | None
) -> list[ComparedMuscle]:
    """Load the muscles with their full drive [Pa]; with a law where they state it."""
    single = (str, os.PathLike, Specimen, Muscle, ComparedMuscle)
    for one in muscles:
        if not isinstance(one, (*single, Iterable)):
            raise InputError("muscles", None, f"must be names of muscles, files or muscles, got {one!r}")
    listed = each_once("muscles", (one for m in muscles for one in ([m] if isinstance(m, single) else m)))
    read = [muscle_specimen(one) if isinstance(one, str | os.PathLike) else one for one in listed]
    laws = dict.fromkeys(name for one in read if isinstance(one, Specimen) for name in one.laws)
    if law is not None and law not in laws:
        raise InputError("law", law, f"the muscles state {', '.join(laws) or 'no law'}")
    subjects = []
    for one in read:
        if not isinstance(one, ComparedMuscle):
            chosen = law if isinstance(one, Specimen) and law in one.laws else None
            one = subject(one, pressure=pressure, law=chosen)
        subjects.append(one)
    specs = [
        dataclasses.replace(s.spec, id=name) for s, name in zip(subjects, _apart(s.id for s in subjects), strict=True)
    ]
    return [dataclasses.replace(s, spec=spec) for s, spec in zip(subjects, specs, strict=True)]


def _apart(names: Iterable[str]) -> list[str]:
    """Names told apart: that of a muscle and the same with other numbers, or of files of two folders, ends in -2."""
    listed = list(names)
    return [f"{one}-{n}" if (n := listed[: i + 1].count(one)) > 1 else one for i, one in enumerate(listed)]


def _cautions(subject: ComparedMuscle, pressure: float, text: str | None) -> tuple[Caution, ...]:
    """Cautions about a braided muscle at its highest pressure [Pa]: its law, and how far it shortens."""
    assert subject.unit is not None
    law, spec = subject.unit.law, subject.spec
    at_pressure = (pressure_caution(pressure, spec, text=text), free_length_caution(law, [pressure], spec))
    return collect(*at_pressure, *law_cautions(spec, law))


def _target(name: str, subjects: Sequence[ComparedMuscle]) -> ComparedMuscle:
    target = subject(name)
    if target.fibre is None:
        raise InputError("match", name, "must be a biological muscle; it is a McKibben muscle")
    if not any(s.unit is not None for s in subjects):
        raise InputError("match", name, "must be a McKibben muscle among those compared")
    return target
