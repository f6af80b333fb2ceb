"""Drawings of the comparison: bars, ranges, surfaces, curves."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence

import numpy as np

from ....quantities import from_si, with_unit
from ....studies.comparison import ComparedMuscle, MuscleColumn, MuscleTable
from ....studies.comparison.table import PropertyRow
from ...charts import Axis, Chart, ChartLine
from . import jobs

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
    value = row.shown()[i]
    ends = row.shown_range()
    if value is None and living and ends is not None:
        return f'<b class="none">{DASH}</b><span class="pp">{published(row)}</span>'
    if value is None:
        beside = f'<span class="pp">{"" if paper is None else f"paper {number(paper)}"}</span>'
        return f'<b class="none">{DASH}</b>{beside}'
    share = 100.0 / largest if largest > 0.0 else 0.0
    tick = (
        ""
        if paper is None
        else f'<path d="M{_within(paper * share, 99.5):.2f} 0v10" stroke="var(--ink)" stroke-width="1.5"/>'
    )
    band = ""
    if living and ends is not None and ends[0] * share < 100.0:
        begins = _within(ends[0] * share)
        wide = max(_within(ends[1] * share) - begins, 0.8)
        band = f'<rect x="{begins:.2f}" y="0" width="{wide:.2f}" height="10" fill="none" stroke="var(--ink-3)"/>'
    drawn = (
        '<svg height="10" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true"><rect y="3" width="100" '
        f'height="4" fill="var(--sunken)"/><rect y="3" width="{_within(value * share):.2f}" height="4" fill="var(--ink-2)"/>'
        f"{band}{tick}</svg>"
    )
    said = f'<span class="pp">{"" if paper is None else f"paper {number(paper)}"}</span>'
    if living and ends is not None:
        said = f'<span class="pp">{published(row)}</span>'
    return f"<b>{number(value)}</b>{drawn}{said}"


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
    ends = [jobs.value_of(one, n) for n in ("shortest", "longest")]
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


def surface_markup(one: ComparedMuscle, letter: str, surface: jobs.Surface | None, scale: dict[str, float]) -> str:
    """Element for a surface, which the browser draws."""
    if surface is None:
        return '<p class="small dim">Its section is not known: no tension per section.</p>'
    unit = "%" if one.fibre is not None else "bar"
    top = 100.0 if one.fibre is not None else from_si(one.full, "Pa", "bar")
    spec = jobs.plain(
        {
            "lengths": surface.lengths,
            "drives": surface.drives * top,
            "tension": from_si(1.0, "N/m^2", "N/cm^2") * surface.tension,
            "unit": unit,
            "scale": scale,
            "of": "activation" if one.fibre is not None else "pressure",
        }
    )
    most = float(np.max(spec["tension"]))
    label = f"{letter}, {one.spec.title}: tension per section over length and {spec['of']}, up to {most:.3g} N/cm^2"
    packed = html.escape(json.dumps(spec, separators=(",", ":")))
    return (
        f'<div class="surface" tabindex="0" role="img" aria-label="{html.escape(label)}" data-surface="{packed}"></div>'
    )


def surface_chart(one: ComparedMuscle, surface: jobs.Surface | None) -> Chart | None:
    """Chart of what a surface shows: tension per section over length, a line for every second drive; None without one."""
    if surface is None:
        return None
    living = one.fibre is not None
    top, unit = (100.0, "%") if living else (from_si(one.full, "Pa", "bar"), "bar")
    lines = []
    for i in range(len(surface.drives) - 1, 0, -2):
        tension = from_si(1.0, "N/m^2", "N/cm^2") * surface.tension[i]
        pulls = tension > 0.0
        label = f"{top * surface.drives[i]:.3g}\u2009{unit}"
        lines.append(ChartLine(surface.lengths[pulls], tension[pulls], label, "tension", width=1.25))
    drive = "activation" if living else "pressure"
    name = f"{one.spec.title}: tension per section at each {drive}"
    return Chart(
        name, name, Axis("Length", "L\u2080", "length"), Axis("Tension", "N/cm\u00b2", "tension", low=0.0), lines
    )


def velocity_chart(muscles: Sequence[tuple[str, ComparedMuscle]]) -> Chart:
    """Chart of relative tension against shortening velocity; circles are runs of the machine."""
    lines = []
    for letter, one in muscles:
        x, y = jobs.over_velocity(one)
        braided = one.fibre is None
        name = f"{letter} {one.id}"
        lines.append(
            ChartLine(
                x, y, name, "tension" if braided else "", dash=DASHES.get(letter, ""), width=2.25 if braided else 1.5
            )
        )
        ran = jobs.run_known(one, "isokinetic")
        if ran is not None and "force_velocity" in ran.curves:
            lines.append(
                ChartLine(*ran.curves["force_velocity"], quantity="tension" if braided else "", line=False, points=True)
            )
    summary = "Tension while shortening steadily at the rest length, fully driven, over that at rest: by the laws" + (
        ", and as circles or triangles where the machine ran"
    )
    return Chart(
        "by the laws",
        summary,
        Axis("Shortening", "L\u2080/s", low=0.0, high=jobs.FASTEST),
        Axis("Tension over its largest", "", "tension", low=0.0, high=1.1),
        lines,
        height=240,
    )


def step_chart(muscles: Sequence[tuple[str, ComparedMuscle]]) -> Chart | None:
    """The isometric step of every muscle that ran it: up, and down again after the rise; None if none did."""
    lines = []
    for letter, one in muscles:
        ran = jobs.run_known(one, "isometric-step")
        if ran is None or not {"rise", "fall"} <= ran.curves.keys():
            continue
        braided = one.fibre is None
        time, pull = _joined(ran.curves["rise"], ran.curves["fall"])
        lines.append(
            ChartLine(
                time,
                pull,
                f"{letter} {one.id}",
                "tension" if braided else "",
                dash=DASHES.get(letter, ""),
                width=2.25 if braided else 1.5,
            )
        )
    if not lines:
        return None
    summary = (
        "Tension of muscles between fixed ends after full drive is switched on, and off after 0.15 s in the drawing"
    )
    return Chart(
        "Isometric step",
        summary,
        Axis("Time", "ms", low=0.0, high=300.0),
        Axis("Tension over its largest", "", "tension", low=0.0),
        lines,
        height=200,
    )


SWITCH = 0.15  # after the command at which the drawing goes on with the fall [s]


def _joined(rise: tuple[np.ndarray, np.ndarray], fall: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Concatenate rise and fall; the machine holds the full drive for longer in between."""
    up, down = rise[0] <= SWITCH, fall[0] <= SWITCH
    up &= rise[0] >= 0.0
    down &= fall[0] >= 0.0
    return 1e3 * np.append(rise[0][up], fall[0][down] + SWITCH), np.append(rise[1][up], fall[1][down])


def loops_chart(loops: Sequence[tuple[str, tuple[np.ndarray, np.ndarray]]]) -> Chart:
    """Chart of tension over length of recordings."""
    lines = [
        ChartLine(from_si(1.0, "m", "cm") * x, y, name, "tension", dash=DASHES.get(name[:1], ""))
        for name, (x, y) in loops
    ]
    return Chart(
        "Recordings",
        "Tension over length as recorded",
        Axis("Length", "cm", "length"),
        Axis("Tension", "N", "tension"),
        lines,
        height=260,
    )


def efficiencies(table: MuscleTable, letters: Sequence[str], ours: bool) -> str:
    """Draw bars of the efficiencies with published values, and the misprint if its muscle is shown."""
    rows: list[tuple[str, float, float]] = []
    for letter, one in zip(letters, table.columns, strict=True):
        for key, words in (("efficiency", "surroundings"), ("efficiency_accumulator", "accumulator")):
            value = jobs.value_of(one, key)
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

    row = jobs.misprint() if ours else None
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


def sizes(one: ComparedMuscle) -> str:
    """Lengths of a muscle at rest and fully shortened, as text."""
    shortest = float(jobs.column(one).values["shortest"]) * one.rest_length
    return f"{with_unit(one.rest_length, 'm', 3)} at rest, {with_unit(shortest, 'm', 3)} fully shortened"
