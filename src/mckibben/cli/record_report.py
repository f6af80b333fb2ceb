"""``record report``: what a recording says, as a page or a PDF file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .words import Json, print_json


def report(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of mckibben: .nc, .csv, .mcap.")],
    out: Annotated[Path, typer.Option(metavar="REPORT", help="An .html or .pdf file.")],
    as_json: Json = False,
) -> None:
    """Write a report: what was done, figures, balances, parameters and their origin, papers."""
    from ..report.document import checked_place
    from ..report.recording_report import write_recording_report

    checked_place(out, field="--out")
    write_recording_report(file, out)
    if as_json:
        print_json({"file": str(out)})
    else:
        typer.echo(f"Written: {out}")
