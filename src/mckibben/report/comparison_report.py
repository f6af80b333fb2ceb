"""Report of a comparison: tables, figures, remarks, and references.

`comparison_report` takes any tables and figures; `muscle_comparison` makes them of the comparison of muscles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..quantities import with_unit
from ..studies.comparison.match import Match
from ..studies.comparison.table import MuscleTable, PropertyRow
from .blocks import (
    Block,
    Cite,
    Figure,
    Heading,
    KeyValues,
    Paragraph,
    References,
    ReportTable,
    Section,
    TableCell,
    TableColumn,
    TableRow,
    Text,
)
from .document import Document
from .figures.comparison_figures import table_figure
from .words import minus, significant, unit_text, versions_text

CURVES = {"force_length": "Force over length", "passive": "Passive force", "force_velocity": "Force over velocity"}
PAPER = "chou1996"


def comparison_report(
    title: str,
    tables: Sequence[ReportTable],
    figures: Sequence[Figure] = (),
    *,
    lead: Text = "",
    remarks: Sequence[tuple[str, Text]] = (),
    details: Sequence[Block] = (),
    keys: Sequence[str] = (),
) -> Document:
    """Build a report of tables and figures.

    Args:
        title: title of the report.
        tables: in their order.
        figures: below them.
        lead: summary under the title.
        remarks: remarks of what or whom, and what is to be said.
        details: blocks after the figures, such as what a search reached.
        keys: keys of the papers.
    """
    said = (Heading("Remarks"), KeyValues(tuple(remarks))) if remarks else ()
    sections = [Section("Side by side", (*tables, *said), "table")]
    sections += [Section("Figures", tuple(figures), "figures")] if figures else []
    sections += [Section("Details", tuple(details), "details")] if details else []
    sections += [Section("Papers", (References(tuple(dict.fromkeys(keys))),), "papers")] if keys else []
    sections.append(Section("Versions", (KeyValues((("Computed by", versions_text()),)),), "versions"))
    return Document(title, tuple(sections), lead)


def muscle_comparison(found: MuscleTable) -> Document:
    """Build the report of a comparison of muscles, with its figure where any of them has a law to draw."""
    names = [c.name for c in found.columns]
    rows = found.properties()
    keys = dict.fromkeys([PAPER, *(k for r in rows if r.published for k in r.published.sources)])
    columns = (
        TableColumn("", wide=True),
        TableColumn("Unit"),
        *(TableColumn(n, number=True) for n in names),
        TableColumn("Biological, published", number=True),
    )
    table = ReportTable(columns, tuple(_row(r) for r in rows), "Table 1 of the paper, for these muscles")
    pictures = []
    if found.muscles:
        drawn = table_figure(found)
        caption = (
            "Normalised. McKibben muscles have the colour of tension, biological ones ink; a letter ends each line."
        )
        pictures.append(Figure(drawn, caption, f"Curves of {', '.join(names)}; the table has the numbers."))
    remarks = [(c.name, f"{c.title}, from {c.kind}" + "".join(f"; {n}" for n in c.notes)) for c in found.columns]
    details = [block for m in found.matches for block in _match(m)]
    lead = "L₀ is each muscle's own resting length, F₀ its tension there; a dash says that the property is not known."
    return comparison_report(
        f"Muscles side by side: {', '.join(names)}",
        [table],
        pictures,
        lead=lead,
        remarks=remarks,
        details=details,
        keys=[*keys],
    )


def _row(row: PropertyRow) -> TableRow:
    ends = row.shown_range()
    published: Text = ""
    note = ""
    if ends is not None and row.published is not None:
        words = significant(ends[0], 3) if ends[0] == ends[1] else " to ".join(significant(e, 3) for e in ends)
        published = (words, "\N{THIN SPACE}", Cite(tuple(row.published.sources)))
        note = row.published.note
    values = (TableCell("\N{EN DASH}") if v is None else significant(v, 3) for v in row.shown())
    return TableRow((row.property.title, unit_text(row.property.unit), *values, published), note=note)


def _match(match: Match) -> list[Block]:
    title = f"{match.muscle.id} with elements, towards {match.target.id}"
    rows = tuple(
        TableRow(
            (
                CURVES.get(n, "Together" if n == "all" else n.replace("_", " ")),
                significant(match.rms_before[n], 3),
                significant(match.rms_after[n], 3),
            )
        )
        for n in match.rms_before
    )
    curves = ReportTable(
        (TableColumn("Curve"), TableColumn("As built", number=True), TableColumn("With elements", number=True)),
        rows,
        "Root mean square difference over the tension at rest length",
    )
    elements = tuple(TableRow((p.title, *_values(p.start, p.value, unit=p.unit), _hit(p))) for p in match.parameters)
    columns = (
        TableColumn("Element"),
        TableColumn("As built", number=True),
        TableColumn("Found", number=True),
        TableColumn("", wide=True),
    )
    blocks: list[Block] = [Heading(title), curves, ReportTable(columns, elements)]
    if match.simulated is not None:
        words = f"The twitch with elements on the test machine, circuit and all: {significant(match.rms_simulated, 3)}."
        blocks.append(Paragraph(words))
    return blocks


def _values(*values: float, unit: str) -> list[str]:
    return [minus(with_unit(v, unit)) for v in values]


def _hit(p: Any) -> str:
    ends = {"low": ("lower", p.low), "high": ("upper", p.high)}
    return f"at its {ends[p.hit][0]} bound, {minus(with_unit(ends[p.hit][1], p.unit))}" if p.hit in ends else ""
