"""Columns of the comparison, and what is drawn of them: bars, ranges, surfaces, curves, the exported table."""

from __future__ import annotations

import csv
import html
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....errors import InputError
from ....quantities import from_si
from ....recordings import read_recording
from ....registry import plugins
from ....studies.comparison import PROPERTIES, ComparedMuscle, MuscleColumn, MuscleTable, subject
from ....studies.comparison.assisted import steady
from ....studies.comparison.protocols import Trials, trials
from ....studies.comparison.table import LENGTHS, TENSIONS, PropertyRow, column_of, law_column
from ...charts import Axis, Chart, ChartLine
from ...reader import read_outside
from ...shelf import SharedResults

FIRST = ("nylon", "fiberglass", "bridgestone", "fast-fibre")
PROTOCOLS = ("isometric-step", "isokinetic")  # what the charts at the side need
DRIVES, LENGTHS_SHOWN = 11, 41  # of a surface
FASTEST = 10.0  # of the tension against velocity [L0/s]
MOST = 8  # columns
Loop = tuple[np.ndarray, np.ndarray]  # length [m] and tension [N]
SWITCH = 0.15  # after the command at which the drawing goes on with the fall [s]
PAPER = {  # row of Table 1 as it is printed -> property
    "section_area": "section_area", "dynamic_range": "dynamic_range", "max_tension": "maximum_tension",
    "stiffness": "stiffness", "work": "work", "tension_intensity": "tension_intensity",
    "stiffness_intensity": "stiffness_intensity", "work_density": "work_density",
}  # fmt: skip
_results = SharedResults(500)


def subject_of(what: str | Path, pressure: float) -> ComparedMuscle:
    """Muscle at a full pressure [Pa]; made anew where its file has changed."""
    stamp = what.stat().st_mtime_ns if isinstance(what, Path) else 0
    return _results.get((what, stamp, pressure), lambda: subject(what, pressure=pressure))


def column(one: ComparedMuscle) -> MuscleColumn:
    """Compute Table 1 of a muscle by its law."""
    return _results.get((one.spec.where, one.id, one.full), lambda: law_column(one))


def column_of_recording(path: Path) -> MuscleColumn:
    """Compute Table 1 of a recording."""
    return _results.get((path, path.stat().st_mtime_ns), lambda: column_of(path))


def run_of(one: ComparedMuscle, name: str) -> Trials:
    """Run one protocol on one muscle, on the machine that takes it."""
    return _results.get((one.spec.where, one.id, one.full, name), lambda: trials(one, names=(name,)))


def run_known(one: ComparedMuscle, name: str) -> Trials | None:
    """Return the trials if they were run before."""
    known: Trials | None = _results.known((one.spec.where, one.id, one.full, name))
    return known


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


def _printed_rows() -> Mapping[str, Any]:
    """What the papers print, by the name of the row; empty without the package that knows it."""
    rows: Callable[[], Mapping[str, Any]] = plugins("mckibben.printed").get("rows", dict)
    return rows()


def paper_values(identifier: str) -> dict[str, float]:
    """Values that the paper prints of a muscle, by property, in the units of the table."""
    values = {}
    for name, row in _printed_rows().items():
        start, _, last = name.rpartition(".")
        if start == f"table1.{identifier}" and last in PAPER and isinstance(row.paper, float):
            values[PAPER[last]] = row.paper
        elif identifier == "nylon" and name == "energy.maximal.efficiency":
            values["efficiency"] = float(row.paper)
    return values


def loop_of(path: Path) -> Loop:
    """Length [m] and tension [N] of a recording, from the channels that its column is read from."""

    def read() -> Loop:
        record = read_outside(read_recording, path)
        names = [next((n for n in known if n in record), None) for known in (LENGTHS, TENSIONS)]
        if names[0] is None or names[1] is None:
            raise InputError(
                "channel", None, "is missing: the comparison needs a length and a tension", where=path.name
            )
        return record[names[0]], record[names[1]]

    return _results.get(("loop", path, path.stat().st_mtime_ns), read)


def exported(table: MuscleTable) -> bytes:
    """Format the table as CSV with all digits; the published range of biological muscle is at the end."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    # A spreadsheet takes what begins with =, + or @ for a formula.
    names = [c.name if c.name[:1].isalnum() else f"'{c.name}" for c in table.columns]
    writer.writerow(["property", "name", "unit", *names, "biological low", "biological high", "biological sources"])
    for row in table.properties():
        ends, source = row.shown_range(), row.published
        known = None if ends is None or source is None else [*map(repr, ends), " ".join(source.sources)]
        values = ["" if v is None else repr(float(v)) for v in row.shown()]
        writer.writerow([row.property.title, row.property.name, row.property.unit, *values, *(known or ["", "", ""])])
    for one in table.columns:
        for note in one.notes:
            writer.writerow([f"# {one.name}: {note}"])
    return out.getvalue().encode()


def value_of(one: MuscleColumn, name: str) -> float | None:
    """Value of a column in the unit of its property."""
    value = one.values.get(name)
    return None if value is None or value != value else PROPERTIES[name].shown(value)


LETTERS = "ABCDEFGH"
DASHES = {"A": "", "B": "B", "C": "C", "D": "D"}
DASH = "\N{EN DASH}"


def number(value: float | None) -> str:
    """Format a value with three significant digits, as the command line does."""
    if value is None or value != value:
        return DASH
    shown = f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
    return shown.replace("-", "\N{MINUS SIGN}")


def bar(row: PropertyRow, i: int, largest: float, paper: float | None, living: bool) -> str:
    """Draw a cell: the number, a bar on the row's scale, a tick for the paper's value, or the published range."""
    value, ends = row.shown()[i], row.shown_range()
    ranged = living and ends is not None
    beside = published(row) if ranged else "" if paper is None else f"paper {number(paper)}"
    said = f'<span class="pp">{beside}</span>'
    if value is None:
        return f'<b class="none">{DASH}</b>{said}'
    share = 100.0 / largest if largest > 0.0 else 0.0
    marks = ""
    if ranged and ends is not None and ends[0] * share < 100.0:
        begins = _within(ends[0] * share)
        wide = max(_within(ends[1] * share) - begins, 0.8)
        marks = f'<rect x="{begins:.2f}" y="0" width="{wide:.2f}" height="10" fill="none" stroke="var(--ink-3)"/>'
    if paper is not None:
        marks += f'<path d="M{_within(paper * share, 99.5):.2f} 0v10" stroke="var(--ink)" stroke-width="1.5"/>'
    return (
        f'<b>{number(value)}</b><svg height="10" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true"><rect '
        f'y="3" width="100" height="4" fill="var(--sunken)"/><rect y="3" width="{_within(value * share):.2f}" height="4" '
        f'fill="var(--ink-2)"/>{marks}</svg>{said}'
    )


def _within(share: float, most: float = 100.0) -> float:
    """Position on a bar that begins at zero; below zero nothing is drawn, and the number stands above."""
    return min(max(share, 0.0), most) if share == share else 0.0


def published(row: PropertyRow) -> str:
    """Published range of biological muscle, with its sources."""
    ends, p = row.shown_range(), row.published
    if ends is None or p is None:
        return f'<span class="none">{DASH}</span>'
    words = number(ends[0]) if ends[0] == ends[1] else f"{number(ends[0])} to {number(ends[1])}"
    more = html.escape("; ".join(filter(None, [", ".join(p.sources), p.through, p.note])))
    return f'<span title="published: {more}">{words}</span>'


def range_bar(one: MuscleColumn, low: float, high: float, paper: float | None) -> str:
    """Draw the dynamic range as a bar from the shortest to the longest length."""
    ends = [value_of(one, n) for n in ("shortest", "longest")]
    if ends[0] is None or ends[1] is None:
        return f'<b class="none">{DASH}</b>'

    def at(x: float) -> float:
        return _within((x - low) / (high - low) * 100.0) if high > low else 0.0

    said = "" if paper is None else f'<span class="pp" title="its width">paper {number(paper)}</span>'
    return (
        f'<b class="wide">{ends[0]:.2f}{DASH}{ends[1]:.2f}</b><svg height="14" viewBox="0 0 100 14" '
        'preserveAspectRatio="none" aria-hidden="true"><rect y="5" width="100" height="4" fill="var(--sunken)"/>'
        f'<rect x="{at(ends[0]):.2f}" y="5" width="{max(at(ends[1]) - at(ends[0]), 0.0):.2f}" height="4" '
        f'fill="var(--q-length)"/>'
        f'<path d="M{at(1.0):.2f} 1v12" stroke="var(--ink)"/></svg>{said}'
    )


def largest_of(row: PropertyRow, papers: Sequence[float | None]) -> float:
    """End of a row's scale."""
    ends = row.shown_range()
    known = [v for v in (*row.shown(), *papers) if v is not None and v == v]
    largest = max(known, default=0.0)
    return 1.1 * (max(largest, ends[1]) if ends is not None and largest and ends[1] < 1.5 * largest else largest)


def surface_markup(one: ComparedMuscle, letter: str, surface: Surface | None, scale: dict[str, float]) -> str:
    """Element for a surface, which the browser draws."""
    if surface is None:
        return '<p class="small dim">Its section is not known: no tension per section.</p>'
    top, unit = _drive(one)
    tension = from_si(1.0, "N/m^2", "N/cm^2") * surface.tension
    spec = {
        "lengths": np.round(surface.lengths, 5).tolist(),
        "drives": np.round(surface.drives * top, 5).tolist(),
        "tension": np.round(tension, 5).tolist(),
        "unit": unit,
        "scale": scale,
        "of": "activation" if one.fibre is not None else "pressure",
    }
    most = float(np.max(tension))
    label = f"{letter}, {one.spec.title}: tension per section over length and {spec['of']}, up to {most:.3g} N/cm^2"
    packed = html.escape(json.dumps(spec, separators=(",", ":")))
    return (
        f'<div class="surface" tabindex="0" role="img" aria-label="{html.escape(label)}" data-surface="{packed}"></div>'
    )


def surface_chart(one: ComparedMuscle, surface: Surface | None) -> Chart | None:
    """Chart of what a surface shows: tension per section over length, a line for every second drive; None without one."""
    if surface is None:
        return None
    top, unit = _drive(one)
    lines = []
    for i in range(len(surface.drives) - 1, 0, -2):
        tension = from_si(1.0, "N/m^2", "N/cm^2") * surface.tension[i]
        pulls = tension > 0.0
        label = f"{top * surface.drives[i]:.3g}\u2009{unit}"
        lines.append(ChartLine(surface.lengths[pulls], tension[pulls], label, "tension", width=1.25))
    drive = "activation" if one.fibre is not None else "pressure"
    name = f"{one.spec.title}: tension per section at each {drive}"
    across, up = Axis("Length", "L\u2080", "length"), Axis("Tension", "N/cm\u00b2", "tension", low=0.0)
    return Chart(name, name, across, up, lines)


def _drive(one: ComparedMuscle) -> tuple[float, str]:
    return (100.0, "%") if one.fibre is not None else (from_si(one.full, "Pa", "bar"), "bar")


def velocity_chart(muscles: Sequence[tuple[str, ComparedMuscle]]) -> Chart:
    """Chart of relative tension against shortening velocity; circles are runs of the machine."""
    lines = []
    for letter, one in muscles:
        lines.append(_muscle_line(letter, one, *over_velocity(one)))
        ran = run_known(one, "isokinetic")
        if ran is not None and "force_velocity" in ran.curves:
            colour = lines[-1].quantity
            lines.append(ChartLine(*ran.curves["force_velocity"], quantity=colour, line=False, points=True))
    summary = (
        "Tension while shortening steadily at the rest length, fully driven, over that at rest: by the laws, and as "
        "circles or triangles where the machine ran"
    )
    across = Axis("Shortening", "L\u2080/s", low=0.0, high=FASTEST)
    up = Axis("Tension over its largest", "", "tension", low=0.0, high=1.1)
    return Chart("by the laws", summary, across, up, lines, height=240)


def step_chart(muscles: Sequence[tuple[str, ComparedMuscle]]) -> Chart | None:
    """The isometric step of every muscle that ran it: up, and down again after the rise; None if none did."""
    lines = []
    for letter, one in muscles:
        ran = run_known(one, "isometric-step")
        if ran is None or not {"rise", "fall"} <= ran.curves.keys():
            continue
        (up, rising), (down, falling) = ran.curves["rise"], ran.curves["fall"]
        # the machine holds the full drive for longer in between
        first, then = (up >= 0.0) & (up <= SWITCH), (down >= 0.0) & (down <= SWITCH)
        time = 1e3 * np.append(up[first], down[then] + SWITCH)
        lines.append(_muscle_line(letter, one, time, np.append(rising[first], falling[then])))
    if not lines:
        return None
    summary = (
        "Tension of muscles between fixed ends after full drive is switched on, and off after 0.15 s in the drawing"
    )
    across, axis = Axis("Time", "ms", low=0.0, high=300.0), Axis("Tension over its largest", "", "tension", low=0.0)
    return Chart("Isometric step", summary, across, axis, lines, height=200)


def _muscle_line(letter: str, one: ComparedMuscle, x: np.ndarray, y: np.ndarray) -> ChartLine:
    dash, name = DASHES.get(letter, ""), f"{letter} {one.id}"
    return (
        ChartLine(x, y, name, "", dash, 1.5) if one.fibre is not None else ChartLine(x, y, name, "tension", dash, 2.25)
    )


def loops_chart(loops: Sequence[tuple[str, Loop]]) -> Chart:
    """Chart of tension over length of recordings."""
    cm = from_si(1.0, "m", "cm")
    lines = [ChartLine(cm * x, y, name, "tension", dash=DASHES.get(name[:1], "")) for name, (x, y) in loops]
    across, up = Axis("Length", "cm", "length"), Axis("Tension", "N", "tension")
    return Chart("Recordings", "Tension over length as recorded", across, up, lines, height=260)


def efficiencies(table: MuscleTable, letters: Sequence[str], ours: bool) -> str:
    """Draw bars of the efficiencies with published values, and the misprint if its muscle is shown."""
    rows: list[tuple[str, float, float]] = []
    for letter, one in zip(letters, table.columns, strict=True):
        for key, words in (("efficiency", "surroundings"), ("efficiency_accumulator", "accumulator")):
            value = value_of(one, key)
            if value is not None:
                rows.append((f"{letter} {words}", 0.0, value))
    known = table.published.get("efficiency")
    if known is not None:
        low, high = known.si("1")
        rows.append(("Biological, published", low, high))
    if not rows:
        return '<p class="small dim">No efficiency is known here.</p>'
    top, h = 0.6, 24.0
    wide, left = 312.0, 128.0

    def at(x: float) -> float:
        return left + min(max(x, 0.0), top) / top * (wide - left - 34.0)

    # the printed efficiency with an accumulator is wrong
    row = _printed_rows().get("energy.maximal.efficiency_accumulator") if ours else None
    nylon = letters[[c.name for c in table.columns].index("nylon")] if ours else ""
    marked = next((k for k, r in enumerate(rows) if r[0] == f"{nylon} accumulator"), 0)
    out = [
        f'<path d="M{at(x):.1f} 4V{h * len(rows) + 6:.0f}" stroke="var(--grid)"/><text class="tick" x="{at(x):.1f}" '
        f'y="{h * len(rows) + 20:.0f}" text-anchor="middle">{x:g}</text>'
        for x in (0.0, 0.2, 0.4, 0.6)
    ]
    for i, (name, low, high) in enumerate(rows):
        y = h * i + 17.0
        words = number(high) if low == 0.0 else f"{number(low)}{DASH}{number(high)}"
        beside = max(at(high), at(float(np.max(row.paper))) if row is not None and i == marked else 0.0) + 6.0
        out.append(
            f'<text x="0" y="{y + 4:.0f}" class="name">{html.escape(name)}</text><path d="M{at(low):.1f} {y:.0f}'
            f'H{at(high):.1f}" stroke="var(--ink-2)" stroke-width="7"/><text class="tick" x="{beside:.1f}" '
            f'y="{y + 4:.0f}">{words}</text>'
        )
    below = ""
    if row is not None:
        x, y = at(float(np.max(row.paper))), h * marked + 17.0
        out.append(
            f'<path d="M{x:.1f} {y - 9:.0f}v18" stroke="var(--caution-edge)" stroke-width="2" stroke-dasharray="3 2"/>'
        )
        below = (
            f'<p class="small misprint"><b>\u2506 {row.paper}</b> is printed; {html.escape(row.note)}. '
            'Part IV with its own conditions is on <a href="/energy">Energy</a>.</p>'
        )
    label = "; ".join(f"{n}: {number(b) if a == 0.0 else number(a) + ' to ' + number(b)}" for n, a, b in rows)
    size = h * len(rows) + 24.0
    return (
        f'<svg class="eff" viewBox="0 0 {wide:.0f} {size:.0f}" role="img" '
        f'aria-label="Energy efficiency. {html.escape(label)}">{"".join(out)}</svg>{below}'
    )
