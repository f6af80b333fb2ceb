"""Computations of the comparison: columns, surfaces, curves, the exported table."""

from __future__ import annotations

import csv
import io
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....documents import JsonValue
from ....errors import InputError
from ....recordings import read_recording
from ....specimens.published import published_ranges
from ....studies.comparison import PROPERTIES, ComparedMuscle, MuscleColumn, MuscleTable, subject
from ....studies.comparison.assisted import steady
from ....studies.comparison.protocols import Trials, trials
from ....studies.comparison.table import LENGTHS, TENSIONS, PropertyRow, column_of, law_column
from ...reader import read_outside

if TYPE_CHECKING:
    from ....reproduction.rows import PrintedRow

FIRST = ("nylon", "fiberglass", "bridgestone", "fast-fibre")
PROTOCOLS = ("isometric-step", "isokinetic")  # what the charts at the side need
DRIVES, LENGTHS_SHOWN = 11, 41  # of a surface
FASTEST = 10.0  # of the tension against velocity [L0/s]
MOST = 8  # columns
PAPER = {  # row of the reproduction -> property
    "section_area": "section_area", "dynamic_range": "dynamic_range", "max_tension": "maximum_tension",
    "stiffness": "stiffness", "work": "work", "tension_intensity": "tension_intensity",
    "stiffness_intensity": "stiffness_intensity", "work_density": "work_density",
}  # fmt: skip
MISPRINT = "energy.maximal.efficiency_accumulator"
_kept: dict[Any, Any] = {}
_guards: dict[Any, threading.Lock] = {}
_guard = threading.Lock()


def _once(key: Any, make: Callable[[], object]) -> Any:
    """Result shared by all visitors, computed once; errors are not cached."""
    with _guard:
        lock = _guards.setdefault(key, threading.Lock())
    with lock:
        if key not in _kept:
            _kept[key] = make()
        return _kept[key]


def subject_of(what: str | Path, pressure: float) -> ComparedMuscle:
    """Muscle at a full pressure [Pa]; cached while its file is unchanged."""
    stamp = what.stat().st_mtime_ns if isinstance(what, Path) else 0
    muscle: ComparedMuscle = _once(("subject", str(what), stamp, pressure), lambda: subject(what, pressure=pressure))
    return muscle


def column(one: ComparedMuscle) -> MuscleColumn:
    """Compute Table 1 of a muscle by its law."""
    result: MuscleColumn = _once(("column", one.spec.where, one.id, one.full), lambda: law_column(one))
    return result


def recorded(path: Path) -> MuscleColumn:
    """Compute Table 1 of a recording."""
    result: MuscleColumn = _once(("recording", str(path), path.stat().st_mtime_ns), lambda: column_of(path))
    return result


def run_of(one: ComparedMuscle, name: str) -> Trials:
    """Run one protocol on one muscle, on the machine that takes it."""
    result: Trials = _once(("run", one.spec.where, one.id, one.full, name), lambda: trials(one, names=(name,)))
    return result


def run_known(one: ComparedMuscle, name: str) -> Trials | None:
    """Return the trials if they were run before."""
    return _kept.get(("run", one.spec.where, one.id, one.full, name))


def table(columns: Sequence[MuscleColumn]) -> MuscleTable:
    """Table of columns with the published values of biological muscle."""
    return MuscleTable(tuple(columns), published_ranges())


def with_runs(one: ComparedMuscle, of_law: MuscleColumn) -> MuscleColumn:
    """Column of a law with the results of its protocols."""
    values, notes, kind = dict(of_law.values), of_law.notes, of_law.kind
    for name in PROTOCOLS:
        runs = run_known(one, name)
        if runs is not None:
            values |= runs.values
            notes, kind = notes + tuple(n for n in runs.notes if n not in notes), "law and protocols"
    return MuscleColumn(of_law.name, of_law.title, kind, values, notes)


class Surface(NamedTuple):
    """Tension per section [N/m^2] over length over L0 [1] and drive [1], (drives, lengths)."""

    lengths: np.ndarray
    drives: np.ndarray
    tension: np.ndarray


def surface(one: ComparedMuscle) -> Surface | None:
    """Compute the surface of a muscle from its free length, fully driven, to its longest working length.

    None without a section.
    """
    if one.section_area is None:
        return None
    low = float(column(one).values["shortest"])
    lengths = np.linspace(low, one.upper_length / one.rest_length, LENGTHS_SHOWN)
    drives = np.linspace(0.0, 1.0, DRIVES)
    pull = one.tension(lengths[None, :], drives[:, None]) * one.full_tension / one.section_area
    return Surface(lengths, drives, pull)


def over_velocity(one: ComparedMuscle) -> tuple[np.ndarray, np.ndarray]:
    """Relative tension at the rest length during steady shortening [L0/s], by the law with friction and viscosity."""
    speeds = np.linspace(0.0, FASTEST, 101)
    if one.fibre is not None:
        tension = np.asarray(one.fibre.tension(one.rest_length, 1.0, -speeds * one.rest_length))
        return speeds, tension / one.full_tension

    assert one.unit is not None
    way = np.where(speeds > 0.0, -1.0, 0.0)
    pull, _ = steady(one.unit, one.rest_length, one.full, -speeds * one.rest_length, way)
    return speeds, np.asarray(pull) / one.full_tension


def paper_values(identifier: str) -> dict[str, float]:
    """Values that the paper prints of a muscle, by property, in the units of the table."""
    from ....reproduction.rows import all_rows

    values = {}
    for row in all_rows():
        start, _, last = row.id.rpartition(".")
        if start == f"table1.{identifier}" and last in PAPER and isinstance(row.paper, float):
            values[PAPER[last]] = row.paper
        elif identifier == "nylon" and row.id == "energy.maximal.efficiency":
            values["efficiency"] = float(row.paper)  # type: ignore[arg-type]
    return values


def misprint() -> PrintedRow:
    """Row of the efficiency with an accumulator, whose printed value is wrong."""
    from ....reproduction.rows import all_rows

    return next(r for r in all_rows() if r.id == MISPRINT)


def loop_of(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Length [m] and tension [N] of a recording, from the channels that its column is read from."""

    def read() -> tuple[np.ndarray, np.ndarray]:
        record = read_outside(read_recording, path)
        names = [next((n for n in known if n in record), None) for known in (LENGTHS, TENSIONS)]
        if names[0] is None or names[1] is None:
            raise InputError(
                "channel", None, "is missing: the comparison needs a length and a tension", where=path.name
            )
        return record[names[0]], record[names[1]]

    loop: tuple[np.ndarray, np.ndarray] = _once(("loop", str(path), path.stat().st_mtime_ns), read)
    return loop


def exported(table: MuscleTable) -> bytes:
    """Format the table as CSV with all digits; the published range of biological muscle is at the end."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    # A spreadsheet takes what begins with =, + or @ for a formula.
    names = [c.name if c.name[:1].isalnum() else f"'{c.name}" for c in table.columns]
    writer.writerow(["property", "name", "unit", *names, "biological low", "biological high", "biological sources"])
    for row in table.rows():
        ends = row.shown_range()
        published = (
            ["", "", ""]
            if ends is None or row.published is None
            else [*map(repr, ends), " ".join(row.published.sources)]
        )
        values = ["" if v is None else repr(float(v)) for v in row.shown()]
        writer.writerow([row.property.title, row.property.name, row.property.unit, *values, *published])
    for one in table.columns:
        for note in one.notes:
            writer.writerow([f"# {one.name}: {note}"])
    return out.getvalue().encode()


def shown_rows(table: MuscleTable) -> list[PropertyRow]:
    """Rows drawn as lines; the ends of the dynamic range share one of them, efficiencies are at the side."""
    apart = ("shortest", "longest", "efficiency", "efficiency_accumulator")
    return [r for r in table.rows() if r.property.name not in apart]


def value_of(one: MuscleColumn, name: str) -> float | None:
    """Value of a column in the unit of its property."""
    value = one.values.get(name)
    return None if value is None or value != value else PROPERTIES[name].shown(value)


def plain(values: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
    """Convert arrays to lists with as many digits as a drawing needs."""
    return {k: np.round(v, 5).tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}
