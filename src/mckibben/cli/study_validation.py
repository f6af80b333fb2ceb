"""``study validation`` in words, as JSON, and as the page of the documentation with its figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .words import table

if TYPE_CHECKING:
    from ..identification import Fit
    from ..studies.validation import StaticResult, Validation


def write_page(found: Validation, path: Path) -> list[Path]:
    """Write the page, and its figure beside it where there is a static data set; returns what was written."""
    from .. import __version__
    from ..documents import write_text
    from ..studies.validation_page import page

    figure = path.with_name(f"{path.stem}-errors.svg")
    if found.static:
        from ..report.figures import style
        from ..report.figures.validation_figures import errors_figure

        style.save(errors_figure(found), figure)
    text = page(found, figure=figure.name if found.static else "", version=__version__)
    write_text(path, text)
    return [path, figure] if found.static else [path]


def validation_json(found: Validation) -> dict[str, Any]:
    """Everything in SI units."""
    from .study_loops import loops_json

    return {
        "static": [_static_json(r) for r in found.static],
        "loops": loops_json(found.loops) if found.loops else None,
        "jumps": [j._asdict() for j in found.jumps],
        "absent": found.absent,
    }


def _static_json(r: StaticResult) -> dict[str, Any]:
    from .ranking import fit_json

    return {
        "name": r.of.name,
        "title": r.of.title,
        "source": r.of.source,
        "licence": r.of.licence,
        "points": len(r.points),
        "taut": int(r.points.taut.sum()),
        "largest_tension": r.points.largest,
        "branches_apart": None if r.apart is None else {"half_rms": r.apart[0], "half_largest": r.apart[1]},
        "fits": [fit_json(f) for f in r.fits],
        "unfitted": [
            {"law": u.title, "origin": u.origin, "rmse": u.rmse, "max_error": u.max_error} for u in r.unfitted
        ],
        "skipped": r.skipped,
    }


def show_validation(found: Validation) -> None:
    """One table per data set, then loops and jumps, then what was not at hand."""
    from ..quantities import from_si
    from ..studies.validation_page import share

    for r in found.static:
        rows = [_row(f, r.points.largest) for f in r.fits]
        rows += [
            [u.title, "0", f"{u.rmse:.2f} N", share(u.max_error, r.points.largest), "-", "-", "-", u.origin]
            for u in r.unfitted
        ]
        title = f"{r.of.title}: {int(r.points.taut.sum())} points with tension, largest {r.points.largest:.1f} N"
        columns = ["law", "free", "rmse", "largest", "pressure out, rms", "pressure out", "above 4 bar", ""]
        table(title, columns, rows, right=range(1, 7))
        typer.echo("")
    if found.loops:
        worst = found.loops.worst
        typer.echo(
            f"Loop of a DMSP-10-250: width of the unseen loop off by at most {100.0 * abs(worst.error):.1f} % mid-range"
        )
    for j in found.jumps:
        typer.echo(f"Jump {j.name} from the others: {from_si(j.rms, 'Pa', 'mbar'):.0f} mbar rms")
    for what, file in found.absent.items():
        typer.echo(f"not at hand: {what} ({file})")


def _row(f: Fit, largest: float) -> list[str]:
    from ..studies.validation_page import share

    held = share(f.holdout.max_error if f.holdout else None, largest)
    crossed = [share(f.cv_rmse, largest), share(f.cv_max_error, largest), held]
    told = "" if f.converged else "did not converge"
    return [f.law, str(len(f.parameters)), f"{f.rmse:.2f} N", share(f.max_error, largest), *crossed, told]
