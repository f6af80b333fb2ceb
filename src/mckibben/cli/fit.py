"""``fit``: from a measured table to laws, ranked, with intervals and predictions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from . import ranking
from .words import Json, Set, assignments, caution, options_named, pairs, print_json, progress, writable

if TYPE_CHECKING:
    from ..recordings import ForceMap
    from ..specimens import Specimen


def add_to(app: typer.Typer) -> None:
    """Add this command to the table."""
    app.command("fit")(fit)


def fit(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE..", help="CSV, MAT, TDMS tables, specimens that ship with a map, or a .toml of constraints."
        ),
    ],
    law: Annotated[
        list[str] | None, typer.Option("--law", help="Law to fit; repeat for several. All where left out.")
    ] = None,
    rest_length: Annotated[str | None, typer.Option(help="Rest length of the muscle, such as '300 mm'.")] = None,
    like: Annotated[
        str | None, typer.Option(metavar="SPECIMEN", help="Take known dimensions from this specimen.")
    ] = None,
    change: Set = None,
    column: Annotated[
        list[str] | None, typer.Option(metavar="NAME=COLUMN", help="Which column is length, pressure, ...; - for none.")
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=UNIT", help="Unit of a column whose header has none, such as kPa, or 'kPa abs'."),
    ] = None,
    branch: Annotated[str | None, typer.Option(help="Keep only rows with this value in the branch column.")] = None,
    pressure_zero: Annotated[
        str | None, typer.Option(help="Reading of the pressure channel at zero, such as '9.2 kPa'.")
    ] = None,
    slack: Annotated[bool, typer.Option(help="Use slack points to say where a law may not pull.")] = True,
    train_below: Annotated[
        str | None, typer.Option(help="Also train up to this gauge pressure and predict above it.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a report with figures, .html or .pdf.")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw laws and ranking into this SVG or PNG file.")] = None,
    save: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="Save the fitted laws as a specimen.")] = None,
    as_json: Json = False,
) -> None:
    """Fit tension laws to a measured table of length, pressure and tension, and rank them."""
    from ..quantities import parse

    if any(f.endswith(".toml") for f in files):
        _constraints(files, as_json)
        return
    if report is not None:
        from ..report.document import checked_place

        checked_place(report, field="--report")
    writable("--save", save, ".toml")
    writable("--figure", figure, ".svg", ".png")
    rest = None if rest_length is None else parse(rest_length, "m", field="--rest-length")
    below = None if train_below is None else parse(train_below, "Pa", field="--train-below")
    if save is not None and len(files) > 1:
        raise InputError("--save", str(save), "allowed with one table")
    reading = {
        "columns": pairs(column, "--column", "pressure=p_kPa"),
        "units": pairs(unit, "--unit", "pressure=kPa"),
        "branch": branch,
        "pressure_zero": 0.0 if pressure_zero is None else parse(pressure_zero, "Pa", field="--pressure-zero"),
    }
    with options_named(rest_length="--rest-length '300 mm'"):
        loaded = [_load(f, rest, like, reading) for f in files]
        warnings = [_cautions(points, spec) for points, spec in loaded]
        studies = [_study(points, spec, law, change, below, slack) for points, spec in loaded]
    if report is not None:
        from ..report.fit_report import write_fit_report

        write_fit_report(studies, report)
    if figure is not None:
        from ..report.figures import fit_figures, style

        style.save(fit_figures.overview(studies), figure)
    if save is not None:
        from ..report.specimen_file import write_specimen

        write_specimen(studies[0].fits, studies[0].specimen, save)
    if as_json:
        results = [ranking.as_json(s) | {"warnings": w} for s, w in zip(studies, warnings, strict=True)]
        print_json(results[0] if len(results) == 1 else {"maps": results})
        return
    for study in studies:
        ranking.show(study)
    for path in (report, figure, save):
        if path is not None:
            typer.echo(f"Written: {path}")


def _cautions(points: ForceMap, spec: Specimen | None) -> list[str]:
    """What is to be minded of a table: pressures beyond those that muscles take, and rows that were left out."""
    from ..muscles.plausible import pressure_caution

    said = pressure_caution(float(points.pressure.max()), spec)
    return caution(*(None if s is None else f"{points.name}: {s}" for s in (*points.remarks, said)))


def _constraints(files: list[str], as_json: bool) -> None:
    from .constraints import fit_constraints_file

    if len(files) > 1:
        raise InputError("file", ", ".join(files), "allowed is one file of constraints, alone")
    fit_constraints_file(Path(files[0]), as_json=as_json)


def _load(file: str, rest: float | None, like: str | None, reading: dict[str, Any]) -> tuple[ForceMap, Specimen | None]:
    from ..recordings import read_force_map
    from ..specimens import map_file, specimen, specimen_ids

    path: Any = file
    spec = None if like is None else specimen(like)
    if not Path(file).suffix and file.lower() in [i.lower() for i in specimen_ids()]:
        spec = specimen(file)
        path = map_file(spec)
        rest = rest or spec.property_si("rest_length", "m")
    points = read_force_map(path, rest_length=rest, **reading)
    return points, spec


def _study(
    points: ForceMap,
    spec: Specimen | None,
    laws: list[str] | None,
    change: list[str] | None,
    below: float | None,
    slack: bool,
) -> Any:
    from ..identification import fit_all
    from ..identification.fit import SCHEMES
    from ..muscles.laws import LAWS, law_type
    from ..report.study import Study, published_of

    for name in laws or []:
        law_type(name)
    chosen = None if laws is None or "all" in laws else laws
    known = _known(spec, change, laws)
    skipped: dict[str, str] = {}
    with progress("fitting", len(chosen or LAWS) * (1 + len(SCHEMES))) as advance:
        fits = fit_all(
            points, laws=chosen, known=known, skipped=skipped, train_below=below, slack=slack, progress=advance
        )
    return Study(
        title=spec.title if spec else points.name,
        specimen=spec,
        points=points,
        fits=fits,
        published=published_of(spec, points),
        skipped=skipped,
    )


def _known(spec: Specimen | None, change: list[str] | None, laws: list[str] | None) -> dict[str, Any]:
    """Dimensions that are not fitted: from the specimen, then from ``--set``."""
    from ..muscles.laws import LAWS, law_type
    from ..quantities import declared, parse
    from ..report.study import known_of

    found: dict[str, Any] = {**known_of(spec)}
    fields = {k: q for name in (laws or LAWS) if name in LAWS for k, q in declared(law_type(name)).items()}
    for name, text in assignments(change).items():
        if name not in fields:
            raise InputError(f"--set {name}", text, f"known are {', '.join(sorted(fields))}")
        found[name] = parse(text, fields[name].unit, field=f"--set {name}", bare=True)
        fields[name].check(f"--set {name}", found[name])
    return found
