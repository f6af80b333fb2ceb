"""Rows and figures of the papers for the browser; numbers, units and verdicts are worded as in the report."""

from __future__ import annotations

from typing import Any

from ....documents import JsonValue
from ....report.blocks import minus, significant, unit_text
from ....report.paper_figures import CONFERENCE, FIGURES, PaperFigure
from ....report.reproduction_report import PARTS, PREDICTIONS, difference, printed
from ....reproduction import PrintedRow, RowOutcome
from ....reproduction.rows import (
    BASES,
    KINDS,
    accepted_band,
    all_rows,
    headline,
    is_prediction,
    kind_of,
    needs_recording,
    said_of,
)
from .state import Reproduction

# What a row is by its print alone shows before it is computed.
FORETOLD = "predictions"  # group of rows that is listed first
EXPECTED = {"erratum": "misprint", "open": "open", "synthetic": "synthetic"}


def fixed_document() -> dict[str, JsonValue]:
    """Constant part of the document: parts, their rows, and figures."""
    return {
        "kinds": [{"key": k.key, "one": k.verdict, "many": k.counted[1], "meaning": k.meaning} for k in KINDS.values()],
        "parts": [{"id": k, "title": v} for k, v in {FORETOLD: PREDICTIONS, **PARTS}.items()],
        "rows": [_row(r) for r in sorted(all_rows(), key=lambda r: is_prediction(r) and r.expect == "open")],
        "figures": [
            {"id": f.id, "name": named(f), "title": f.title, "rows": f.rows, "recordings": f.recordings, "part": f.part}
            for f in FIGURES.values()
        ],
    }


def _row(row: PrintedRow) -> dict[str, JsonValue]:
    first = row.what.split(" ", 1)[0]  # a symbol such as dF/dL keeps its letters
    description = row.what[:1].upper() + row.what[1:] if first.isalpha() and first.islower() else row.what
    figures = [f.id for f in FIGURES.values() if row.id in f.rows]
    return {
        "id": row.id,
        "part": FORETOLD if is_prediction(row) else row.part,
        "what": minus(description),
        "paper": printed(row.paper),
        "unit": unit_text(row.unit),
        "kind": _expected(row),
        "recordings": needs_recording(row),
        "figures": figures,
        "note": said(said_of(row)),
    }


def _expected(row: PrintedRow) -> str:
    if row.repeats or not row.printed:
        return "repeats" if row.repeats else "unprinted"
    return EXPECTED.get(row.expect) or KINDS[BASES[row.basis]].key


def outcome_document(outcome: RowOutcome) -> dict[str, JsonValue]:
    """Result of a row; ``place`` is our value on its tolerance, from -1 to 1 between the ends."""
    row, ours = outcome.row, outcome.ours
    content: dict[str, Any] = {"kind": kind_of(outcome).key, "note": said(outcome.note)}
    if ours is not None:
        content |= {"ours": significant(ours), "value": ours, "difference": difference(row, ours)}
        allowed = accepted_band(row)
        if allowed is not None and allowed[1] > 0.0:
            content |= {"place": (ours - allowed[0]) / allowed[1], "half": significant(allowed[1], 2)}
    return content


def said(note: str) -> str:
    """Format a note as HTML."""
    return minus(note.replace("+-", "\u00b1").replace("`", ""))


def state_document(all_: Reproduction) -> dict[str, JsonValue]:
    """Changing part of the document: outcomes, failures, and running jobs."""
    left = all_.left()
    return {
        "outcomes": {k: outcome_document(v) for k, v in list(all_.outcomes.items())},
        "failed": dict(all_.failed),
        "wanted": list(all_.wanted),
        "now": all_.now,
        "words": all_.words,
        "headline": headline(list(all_.outcomes.values())) if all_.outcomes else "",
        "left": None if left is None else round(left),
        "asked": dict(all_.asked),
    }


def named(figure: PaperFigure) -> str:
    """Number of a figure as printed in the papers."""
    year, _, number = figure.id.rpartition("-")
    name = f"Table {number.removeprefix('table')}" if number.startswith("table") else f"Fig. {number}"
    return f"{name} of {year}" if figure.paper == CONFERENCE else name
