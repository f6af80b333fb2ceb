"""The command that this package adds to ``mckibben``: ``reproduce``, the papers' numbers row by row, and their figures."""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mckibben.cli._outputs import FIGURE, OBJECT, REPORT, TABLE, OutputFiles, OutputKinds, Paths
from mckibben.cli._progress import progress
from mckibben.cli._terminal import FigureLook, FigureWidth, Json, print_json
from mckibben.documents import JsonValue
from mckibben.errors import InputError, not_found
from mckibben.report import blocks as words_module
from mckibben.report import document as document_module
from mckibben.report import document_pdf
from mckibben.report.figures import style

from . import report as papers
from . import reproduction
from . import rows as printed_rows

if TYPE_CHECKING:
    from .figures import PaperFigure
    from .report import Drawn
    from .rows import RowOutcome

OUT = OutputKinds(report=REPORT, table=TABLE, result=OBJECT)
REPORTS = ("reproduction.html", "reproduction.pdf")  # what --out writes
WIDTH = 120  # of the table, if the terminal states no other
GAP = "  "


def reproduce_papers(
    part: Annotated[
        str | None, typer.Option(metavar="CHAPTER", help="Compute only this part: I, II, III, IV or discussion.")
    ] = None,
    row: Annotated[
        list[str] | None,
        typer.Option(
            "--row", metavar="ROW", help="Compute only rows whose name begins like this, such as table1.nylon."
        ),
    ] = None,
    figure: Annotated[
        list[str] | None,
        typer.Option(
            "--figure",
            metavar="FIGURE",
            help="Compute only this figure and its rows, such as 3a, and draw it into the folder of --out.",
        ),
    ] = None,
    format_: Annotated[
        str,
        typer.Option("--format", metavar="FORMAT", help="Format of figures in a folder of --out: svg, pdf or png."),
    ] = "svg",
    pdf: Annotated[bool, typer.Option(help="Write the PDF report beside the HTML one into a folder of --out.")] = True,
    recordings: Annotated[
        bool, typer.Option(help="Leave out rows that need recordings of the test machine, which take minutes.")
    ] = True,
    save_recordings: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder into which the recordings behind the rows are written (.nc)."),
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option(folder="both reports, or with --figure the figures in --format,")] = None,
    as_json: Json = False,
) -> None:
    """Compute the papers' numbers and report whether each value is reproduced.

    Predictions come first: inputs that are not printed are inferred from all other rows, and the one left out is predicted,
    with its sensitivity to each. Where it differs it is open, with the input that would have to change and by how much.
    Other numbers follow from printed coefficients by the paper's own equations.

    The exit code is 1 when such a value is not reproduced, or one lies outside what we take the papers' words to mean.
    Rows of loops, friction, steps and power come from recordings of the simulated machine, which take minutes;
    --no-recordings leaves them out.

    $ mckibben reproduce --part IV --no-recordings --out energy.html
    """
    # Whatever can be refused is refused before anything is loaded or computed, which takes minutes.
    printed_rows.select(part, row)
    if f".{format_}" not in FIGURE:
        raise InputError("--format", format_, known=[one[1:] for one in FIGURE])
    _check_folder(save_recordings, recordings)
    with OUT.files(out, folder=True) as files:
        if len(files["folder"]) > 1:
            raise InputError("--out", str(files["folder"][1]), "must be one folder, beside files")
        folder = files["folder"][0] if files["folder"] else None
        places = _places(files["report"], folder, pdf=pdf, figures_only=bool(figure))
        pictures: list[PaperFigure] = []
        if figure or places:
            pictures = papers.chosen_figures(figure, part=part, rows=row, recordings=recordings)
        # None stands for all rows, an empty list for none
        rows = [*(row or []), *dict.fromkeys(r for p in pictures for r in p.rows)] if figure else row
        outcomes, drawn = _done(part, rows, pictures, recordings, save_recordings)
        written: list[str] = []
        if places:
            left_out = "" if recordings else papers.LEFT_OUT
            document = papers.reproduction_report(outcomes, drawn, left_out=left_out)
            written = [str(document.write(place)) for place in places]
        for one in drawn if figure else []:
            path = (folder or Path()) / f"figure-{one.of.id}.{format_}"
            style.save(one.picture, path)
            written.append(str(path))
        written += [] if save_recordings is None else [str(save_recordings)]
        _say(files, outcomes, written, as_json=as_json)
    if any(o.ok is False for o in outcomes):
        raise typer.Exit(1)


def _check_folder(place: Path | None, recordings: bool) -> None:
    if place is None:
        return
    if not recordings:
        raise InputError("--save-recordings", None, "is allowed only without --no-recordings")
    if not str(place).strip() or (place.exists() and not place.is_dir()):
        raise InputError("--save-recordings", str(place), "must be a folder")
    if not place.absolute().parent.is_dir():
        raise not_found(place.absolute().parent, "folder")


def _places(report: list[Path], out: Path | None, *, pdf: bool, figures_only: bool) -> list[Path]:
    """Paths of the reports, checked before a folder is made."""
    named = [document_module.checked_place(path, field="--out") for path in report]
    names = [] if out is None or figures_only else [name for name in REPORTS if pdf or not name.endswith(".pdf")]
    if any(name.endswith(".pdf") for name in names):
        document_pdf.compiler("--no-pdf writes the HTML report alone")
    if out is not None:
        if out.exists() and not out.is_dir():
            raise InputError("--out", str(out), "must be a folder; it is a file")
        if not out.absolute().parent.is_dir():
            raise not_found(out.absolute().parent, "folder")
        out.mkdir(exist_ok=True)
    return named + [document_module.checked_place(out / name, field="--out") for name in names if out is not None]


def _done(
    part: str | None, rows: list[str] | None, pictures: list[PaperFigure], recordings: bool, save: Path | None
) -> tuple[list[RowOutcome], list[Drawn]]:
    asked = [] if rows == [] else printed_rows.select(part, rows)
    recorded = [r.id for r in asked] if recordings else []
    with reproduction.helped(recorded), progress("reproducing", len(asked) + len(pictures)) as advance:
        outcomes: list[RowOutcome] = []
        if asked:
            outcomes = reproduction.reproduce(
                part,
                rows,
                progress=lambda r: advance(r.id),
                tell=lambda words: advance(words, 0),
                recordings=recordings,
                save=save,
            )
        if not pictures:
            return outcomes, []
        with reproduction.told(lambda words: advance(words, 0)):
            return outcomes, papers.draw(pictures, lambda f: advance(f"figure {f.id}: {f.title}"))


# ---- output


def _say(files: OutputFiles, outcomes: list[RowOutcome], written: list[str], *, as_json: bool) -> None:
    """Write table and result, and print the verdicts and which files were written."""
    content = _document(outcomes)
    files.write_rows(content["rows"])
    files.write_result(content)
    written = written + [str(path) for kind in ("table", "result") for path in files[kind] if path in files.named()]
    if as_json:
        print_json(content | ({"files": written} if written else {}))
        return
    _print(outcomes)
    for path in written:
        typer.echo(f"Written: {path}")


def _document(outcomes: list[RowOutcome]) -> dict[str, Any]:
    """What ``--json`` prints."""
    kinds = {
        t.kind.key: {"rows": t.rows, "lowest": t.lowest, "highest": t.highest} for t in printed_rows.tallies(outcomes)
    }
    rows = [_as_json(o) for o in papers.predictions_first(outcomes)]
    failed = sum(o.ok is False for o in outcomes)
    return {"headline": printed_rows.headline(outcomes), "kinds": kinds, "failed": failed, "rows": rows}


def _as_json(o: RowOutcome) -> dict[str, JsonValue]:
    return {
        "id": o.row.id,
        "paper": o.row.paper,
        "ours": o.ours,
        "unit": o.row.unit,
        "expect": o.row.expect,
        "ok": o.ok,
        "basis": o.row.basis,
        "inputs": o.row.inputs,
        "calibrated": o.row.calibrated,
        "verdict": o.verdict,
        "kind": printed_rows.kind_of(o).key,
        "difference": printed_rows.relative_difference(o.row, o.ours),
        "tolerance": printed_rows.relative_tolerance(o.row),
        "reason": o.row.reason,
        "told": None if o.prediction is None else o.prediction.told,
        "spread": None if o.prediction is None else o.prediction.spread,
        "rows": 0 if o.prediction is None else len(o.prediction.by),
        "sensitivities": "" if o.prediction is None else o.prediction.inputs_text(o.row),
        "needed": "" if o.prediction is None or o.prediction.needed is None else str(o.prediction.needed),
        "note": o.note,
    }


# ---- for a person


def _print(outcomes: list[RowOutcome]) -> None:
    from rich.console import Console

    if not outcomes:
        typer.echo("No row is asked for.")
        return
    outcomes = papers.predictions_first(outcomes)
    wide = Console().width if sys.stdout.isatty() else WIDTH
    lines = [_cells(o) for o in outcomes]
    heads = ["row", "paper", "ours", "unit", "difference", "verdict"]
    widths = [max(len(cells[i]) for cells in [heads, *lines]) for i in range(len(heads))]
    title = ""
    for o, cells in zip(outcomes, lines, strict=True):
        if papers.title_of(o.row) != title:
            typer.echo(("\n" if title else "") + papers.title_of(o.row))
            typer.echo(_line(heads, widths))
            title = papers.title_of(o.row)
        typer.echo(_line(cells, widths))
        for line in textwrap.wrap(o.note, max(wide - 4, 40)):
            typer.echo(f"    {line}")
    typer.echo("")
    for line in textwrap.wrap(printed_rows.headline(outcomes), max(wide, 40)):
        typer.echo(line)


def _cells(o: RowOutcome) -> list[str]:
    ours = "–" if o.ours is None else words_module.significant(o.ours)
    unit = "" if o.row.unit == "-" else o.row.unit
    return [o.row.id, papers.printed(o.row.paper), ours, unit, papers.difference(o.row, o.ours), o.verdict]


def _line(cells: list[str], widths: list[int]) -> str:
    right = (1, 2, 4)
    parts = (c.rjust(w) if i in right else c.ljust(w) for i, (c, w) in enumerate(zip(cells, widths, strict=True)))
    return GAP.join(parts).rstrip()
