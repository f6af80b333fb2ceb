"""``fit``: ranking of laws on a measured table, with intervals and predictions; or fits to printed constraints."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import identification, muscles
from ..documents import JsonValue, read_toml
from ..errors import InputError
from ..quantities import declared, parse, with_unit
from ..report import document, fit_report
from ..report.figures import fit_figures, style
from ..specimens import Specimen
from ._terminal import (
    PICTURES,
    FigureLook,
    FigureWidth,
    Json,
    Set,
    assignments,
    caution,
    options_named,
    pairs,
    print_json,
    progress,
    table,
    writable,
)
from .read import GearRatio, Sheet, Topic, column_places, format_options

if TYPE_CHECKING:
    from ..identification import Ranking
    from ..recordings import ForceMap


def fit(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE..",
            help="Tables of any format, specimens that ship with a force map, or a .toml file of constraints.",
        ),
    ],
    law: Annotated[
        list[str] | None,
        typer.Option("--law", help="Law to fit, all, or one of your own as my.py:MyLaw; repeatable, all by default."),
    ] = None,
    rest_length: Annotated[str | None, typer.Option(help="Rest length of the muscle, such as '300 mm'.")] = None,
    like: Annotated[
        str | None, typer.Option(metavar="SPECIMEN", help="Take known dimensions from this specimen.")
    ] = None,
    change: Set = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=COLUMN", help="Column that holds length, pressure, ...; - for none; repeatable."),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=UNIT", help="Unit of a column whose header has none, such as kPa, or 'kPa abs'."),
    ] = None,
    branch: Annotated[str | None, typer.Option(help="Keep only rows with this value in the branch column.")] = None,
    pressure_zero: Annotated[
        str | None, typer.Option(help="Reading of the pressure channel at zero, such as '9.2 kPa'.")
    ] = None,
    sheet: Sheet = None,
    topic: Topic = None,
    gear_ratio: GearRatio = None,
    slack: Annotated[bool, typer.Option(help="Use slack points to say where a law may not pull.")] = True,
    train_below: Annotated[
        str | None, typer.Option(help="Also fit up to this gauge pressure and predict the points above it.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write a report with figures, .html or .pdf.")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Draw laws and ranking into this SVG, PDF or PNG file.")] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Save the fitted laws as a specimen file.")
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Fit tension laws to a measured table of length, pressure and tension, and rank them."""
    if any(f.endswith(".toml") for f in files):
        _constraints(files, as_json)
        return
    if report is not None:
        document.checked_place(report, field="--report")
    writable("--save", save, ".toml")
    writable("--figure", figure, *PICTURES)
    rest = None if rest_length is None else parse(rest_length, "m", field="--rest-length")
    below = None if train_below is None else parse(train_below, "Pa", field="--train-below")
    if save is not None and len(files) > 1:
        raise InputError("--save", None, "is allowed only with one table")
    reading = {
        "columns": column_places(column) or {},
        "units": pairs(unit, "--unit", "pressure=kPa"),
        "branch": branch,
        "pressure_zero": 0.0 if pressure_zero is None else parse(pressure_zero, "Pa", field="--pressure-zero"),
        **format_options(sheet, topic, gear_ratio),
    }
    with options_named(rest_length="--rest-length '300 mm'", sheet="--sheet NAME"):
        loaded = [identification.load_table(f, rest_length=rest, like=like, **reading) for f in files]
        warnings = [_cautions(points, spec) for points, spec in loaded]
        rankings = [_ranking(points, spec, law, change, below, slack) for points, spec in loaded]
    if report is not None:
        fit_report.write_fit_report(rankings, report)
    if figure is not None:
        style.save(fit_figures.overview(rankings), figure)
    if save is not None:
        rankings[0].save(save)
    if as_json:
        results = [r.to_dict() | {"warnings": w} for r, w in zip(rankings, warnings, strict=True)]
        print_json(results[0] if len(results) == 1 else {"maps": results})
        return
    for ranking in rankings:
        show_ranking(ranking)
    for path in (report, figure, save):
        if path is not None:
            typer.echo(f"Written: {path}")


def _cautions(points: ForceMap, spec: Specimen | None) -> list[str]:
    """Cautions about a table: pressures above those of muscles, and rows that were left out."""
    said = muscles.plausible.pressure_caution(float(points.pressure.max()), spec)
    return caution(*(None if s is None else f"{points.name}: {s}" for s in (*points.remarks, said)))


def _constraints(files: list[str], as_json: bool) -> None:

    if len(files) > 1:
        raise InputError("file", ", ".join(files), "must be one file of constraints, alone")
    fit_constraints_file(Path(files[0]), as_json=as_json)


def _ranking(
    points: ForceMap,
    spec: Specimen | None,
    laws: list[str] | None,
    change: list[str] | None,
    below: float | None,
    slack: bool,
) -> Ranking:
    every = laws is None or "all" in laws
    named = [name for name in laws or [] if name != "all"]
    for name in named:
        muscles.laws.law_type(name)
    known = _known(change, [*muscles.laws.LAWS, *named] if every else named)
    count = len(named) + (len(muscles.laws.LAWS) if every else 0)
    with progress("fitting", count * (1 + len(identification.SCHEMES))) as advance:
        return identification.fit(
            points,
            None if every else named,
            beside=named if every else (),
            like=spec,
            known=known,
            train_below=below,
            slack=slack,
            progress=advance,
        )


def _known(change: list[str] | None, laws: list[str] | None) -> dict[str, float]:
    """Dimensions that are not fitted, from ``--set`` [SI]."""
    dimensions: dict[str, float] = {}
    fields = {k: q for name in (laws or muscles.laws.LAWS) for k, q in declared(muscles.laws.law_type(name)).items()}
    for name, text in assignments(change).items():
        if name not in fields:
            raise InputError(f"--set {name}", text, known=sorted(fields))
        dimensions[name] = parse(text, fields[name].unit, field=f"--set {name}", bare=True)
        fields[name].check(f"--set {name}", dimensions[name])
    return dimensions


def _share(largest: float, newton: float | None) -> str:
    """Error as a share of the largest tension, formatted."""
    if newton is None:
        return "-"
    if not newton < 1e9:
        return "fails"
    return "> 100 %" if newton > largest else f"{100 * newton / largest:.2f} %"


def show_ranking(study: Ranking) -> None:
    """Print the ranking of one table, the best law's parameters, and cautions."""
    largest = study.points.largest
    n = int(study.points.taut.sum())
    share = functools.partial(_share, largest)
    rows = []
    for f in study.fits:
        held = f.holdout.max_error if f.holdout else None
        rows.append(
            [
                f.law,
                str(len(f.parameters)),
                f"{f.rmse:.2f} N",
                share(f.max_error),
                share(f.cv_max_error),
                *(share(f.cross[s].max_error if s in f.cross else None) for s in ("length", "block", "rest_length")),
                share(held),
                f"{f.aicc:.1f}",
                "; ".join([*([] if f.converged else ["did not converge"]), *identification.degenerate_words(f)]),
            ]
        )
    for title, error in study.published:
        rows.append(
            [
                title,
                "0",
                f"{(error**2).mean() ** 0.5:.2f} N",
                share(float(abs(error).max())),
                "-",
                "-",
                "-",
                "-",
                "-",
                "-",
                "",
            ]
        )
    columns = [
        "law",
        "free",
        "rmse",
        "largest",
        "pressure out",
        "length out",
        "block out",
        "muscle out",
        "above",
        "AICc",
        "",
    ]
    keep = [i for i in range(len(columns)) if i < 5 or any(r[i] not in ("-", "") for r in rows)]
    table(
        f"{study.title}: {n} points with tension, largest {largest:.1f} N; errors are the largest, of that",
        [columns[i] for i in keep],
        [[r[i] for i in keep] for r in rows],
        right=[j for j, i in enumerate(keep) if 0 < i < 10],
    )
    best = study.fits[0]

    typer.echo(f"\n{best.law}:")
    for name, e in best.parameters.items():
        if name in best.at_bound:
            typer.echo(f"  {name} = {with_unit(identification.bound_of(best, name), e.unit)}  (at its bound)")
            continue
        typer.echo(
            f"  {name} = {with_unit(e.value, e.unit)}  (95 %: {with_unit(e.low, e.unit)} to {with_unit(e.high, e.unit)})"
        )
    for f in study.fits:
        for warning in f.warnings:
            typer.echo(f"note: {f.law}: {warning}")
    for name, why in study.skipped.items():
        typer.echo(f"left out: {name}: {why}")
    if study.specimen is not None and "martens2017" in study.specimen.sources:
        typer.echo("data: M. Martens, I. Boblan, Actuators 2017, 6(4), 33, CC BY 4.0")
    if len(study.fits) > 1:
        typer.echo("ranked by AICc; a parameter at its bound, or not in the data, is not counted")
    typer.echo("")


def fit_constraints_file(path: Path, *, as_json: bool) -> None:
    """Solve a file of constraints and print the parameters, with what they leave open."""
    where = str(path)
    data = _read(path, where)
    law = _word(data, "law", where)
    fields = declared(muscles.laws.law_type(law))
    known = {k: _value(v, f"known.{k}", _unit(fields, k, where), where) for k, v in data.get("known", {}).items()}
    constraints = []
    for i, entry in enumerate(data.get("constraint", []), 1):
        place = f"constraint {i}"
        _only(entry, {"what", "value", "pressure", "length"}, place, where)
        quantity = _word(entry, "what", where, place)
        if quantity not in identification.constraints.KINDS:
            raise InputError(f"{place}.what", quantity, known=identification.constraints.KINDS, where=where)
        length = entry.get("length")
        constraints.append(
            identification.constraints.Constraint(
                what=quantity,
                value=_value(
                    entry.get("value", ""), f"{place}.value", identification.constraints.KINDS[quantity], where
                ),
                pressure=_value(entry.get("pressure", ""), f"{place}.pressure", "Pa", where),
                length=None if length is None else _value(length, f"{place}.length", "m", where),
            )
        )
    result = identification.constraints.fit_constraints(law, constraints, known=known)
    if as_json:
        parameters = {k: e._asdict() for k, e in result.parameters.items()}
        entry = {
            "law": law,
            "parameters": parameters,
            "known": known,
            "n": len(constraints),
            "warnings": list(result.warnings),
        }
        print_json({"fits": [entry]})
        return
    print(f"{law}, from {len(constraints)} printed constraints:")
    for name, e in result.parameters.items():
        fixed = "" if e.low == e.high else "  (not determined)"
        print(f"  {name} = {with_unit(e.value, e.unit)}{fixed}")
    for warning in result.warnings:
        print(f"note: {warning}")


def _read(path: Path, where: str) -> dict[str, JsonValue]:
    data = read_toml(path)
    _only(data, {"law", "known", "constraint"}, "file", where)
    if not data.get("constraint"):
        raise InputError("constraint", None, "is missing: the file needs one [[constraint]] or more", where=where)
    return data


def _only(entry: dict[str, Any], allowed: set[str], place: str, where: str) -> None:
    for key in entry:
        if key not in allowed:
            raise InputError(f"{place}.{key}", None, known=sorted(allowed), where=where)


def _word(entry: dict[str, Any], key: str, where: str, place: str = "") -> str:
    if not isinstance(entry.get(key), str):
        raise InputError(f"{place}.{key}".lstrip("."), entry.get(key), "must be a name", where=where)
    return str(entry[key])


def _value(text: Any, field: str, unit: str, where: str) -> float:

    return parse(str(text), unit, field=field, where=where)


def _unit(fields: dict[str, Any], name: str, where: str) -> str:
    if name not in fields:
        raise InputError(f"known.{name}", None, known=fields, where=where)
    return str(fields[name].unit)
