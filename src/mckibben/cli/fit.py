"""``fit``: ranking of laws on a measured table, with intervals and predictions; or fits to printed constraints."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import identification, muscles
from .._lazy import LazyModule
from ..bench import rig_file
from ..documents import JsonValue, read_toml
from ..errors import InputError
from ..quantities import declared, parse, with_unit
from ..report import document, fit_report
from ..report.figures import fit_figures, style
from ..specimens import Specimen
from . import _fit_hysteresis, _fit_loop
from ._outputs import FIGURE, OBJECT, REPORT, SPECIMEN, TABLE, OutputKinds, Paths
from ._progress import progress
from ._samples import HEADS, checked_draws, interval_rows
from ._terminal import (
    FigureLook,
    FigureWidth,
    Json,
    RestLength,
    Set,
    assignments,
    caution,
    options_named,
    pairs,
    print_json,
    table,
)
from .read import Branch, GearRatio, PressureZero, Sheet, Topic, column_places, format_options

if TYPE_CHECKING:
    import numpy as np

    from ..bench.rig import Rig
    from ..identification import Ranking
    from ..identification.posterior import Posterior
    from ..recordings import ForceMap, Recording
else:
    np = LazyModule("numpy")

DRAWS = 2000
OUT = OutputKinds(report=REPORT, figure=FIGURE, specimen=SPECIMEN, table=TABLE, result=OBJECT)


def fit(
    tables: Annotated[
        list[str],
        typer.Argument(
            metavar="TABLE",
            help="Tables of any format, specimens that ship with a force map, or a .toml file of constraints.",
        ),
    ],
    rig: Annotated[
        str | None,
        typer.Option("--rig", metavar="RIG", help="Test machine whose sensors measured the table, for their noise."),
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(
            "--law",
            metavar="LAW",
            help="Law to fit, or one of your own as my.py:MyLaw; 'all', and by default, all laws.",
        ),
    ] = None,
    rest_length: RestLength = None,
    like: Annotated[
        str | None, typer.Option(metavar="SPECIMEN", help="Take known dimensions from this specimen.")
    ] = None,
    change: Set = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=COLUMN", help="Column that holds length, pressure, .., such as force=3; - for none."
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=UNIT", help="Unit of a column whose header has none, such as 'pressure=kPa abs'."),
    ] = None,
    branch: Branch = None,
    pressure_zero: PressureZero = None,
    sheet: Sheet = None,
    topic: Topic = None,
    gear_ratio: GearRatio = None,
    slack: Annotated[bool, typer.Option(help="Use slack points to say where a law may not pull.")] = True,
    train_below: Annotated[
        str | None,
        typer.Option(
            metavar="PRESSURE",
            help="Also fit up to this gauge pressure, such as '4 bar', and predict the points above it.",
        ),
    ] = None,
    posterior: Annotated[
        bool,
        typer.Option(
            "--posterior",
            help="Draw from the posterior of the best law, or of each of several --law: joint intervals, "
            "and bands that allow for a law that is wrong.",
        ),
    ] = False,
    draws: Annotated[int, typer.Option("--draws", metavar="N", help="Number of samples of the posterior.")] = DRAWS,
    runs: Annotated[
        bool,
        typer.Option("--runs", help="The tables are runs of one muscle: fit them together; each run has an error."),
    ] = False,
    friction: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL",
            help="Fit a friction with memory to a loop of pressure and stroke instead: bouc_wen, dahl, maxwell_slip or all.",
        ),
    ] = None,
    creep: Annotated[
        bool,
        typer.Option("--creep", help="Fit creep beside the friction of --friction, from the times of the samples."),
    ] = False,
    length_error: Annotated[
        str | None,
        typer.Option(
            metavar="SIZE",
            help="Standard deviation of the error of each set length, such as '0.5 mm', to find these errors too.",
        ),
    ] = None,
    hysteresis: Annotated[
        list[str] | None,
        typer.Option(
            "--hysteresis",
            metavar="RECORD",
            help="Recordings of the same muscles in motion, a folder of them, or a quoted pattern: also fit one friction "
            "with memory and one creep of all muscles, as far as these tell of them.",
        ),
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Fit tension laws to a measured table of length, pressure and tension, and rank them.

    $ mckibben fit measured.csv --rest-length '300 mm' --out report.html --out my-muscle.toml
    $ mckibben fit measured.csv --rest-length '300 mm' --law linear_threshold --posterior --out fit.json
    $ mckibben fit loop.csv --friction bouc_wen --posterior --out loop.svg
    $ mckibben fit loop.csv --friction all --creep
    $ mckibben fit three.csv --law seated_braid --hysteresis 'runs/*.csv' --out muscles.toml
    """
    if posterior:
        checked_draws(draws)
    if rig is not None and not posterior:
        raise InputError("--rig", rig, "is allowed only with --posterior")
    if creep and friction is None:
        raise InputError("--creep", None, "is allowed only with --friction")
    if hysteresis:
        _check_hysteresis(tables, friction, runs=runs)
    if any(f.endswith(".toml") for f in tables):
        if out:
            raise InputError("--out", str(out[0]), "is allowed only with tables: printed constraints are not drawn")
        _constraints(tables, as_json)
        return
    with OUT.files(out) as files:
        if friction is not None:
            zero = 0.0 if pressure_zero is None else parse(pressure_zero, "Pa", field="--pressure-zero")
            units = pairs(unit, "--unit", "pressure=kPa")
            _fit_loop.fit_friction(
                tables,
                friction,
                {"columns": column_places(column), "units": units, "pressure_zero": zero},
                creep=creep,
                like=like,
                law=law,
                change=change,
                posterior=posterior,
                draws=draws,
                files=files,
                as_json=as_json,
            )
            return
        for place in files["report"]:
            document.checked_place(place, field="--out")
        if files["specimen"] and len(tables) > 1 and not runs:
            raise InputError("--out", str(files["specimen"][0]), "is allowed only with one table")
        rankings, warnings = _ranked(
            tables, law, rest_length, like, change, column, unit, branch, pressure_zero, train_below, slack=slack,
            length_error=length_error, runs=runs, hysteresis=hysteresis, **format_options(sheet, topic, gear_ratio),
        )  # fmt: skip
        samples = (
            [_posteriors(ranking, rig, draws, every=len(law or ()) > 1) for ranking in rankings] if posterior else []
        )
        files.write("report", lambda path: fit_report.write_fit_report(rankings, path))
        one = samples[0][rankings[0].best.law] if len(samples) == 1 else None
        # drawn only where it is asked for: that takes longer than a fit
        files.write(
            "figure",
            lambda path: style.save(fit_figures.overview(rankings) if one is None else fit_figures.bands(one), path),
        )
        files.write("specimen", rankings[0].save)
        if files["table"]:
            files.write_rows(
                [
                    {
                        "table": ranking.title,
                        "law": fit.law,
                        "rmse": fit.rmse,
                        "max_error": fit.max_error,
                        "cv_rmse": fit.cv_rmse,
                        "cv_max_error": fit.cv_max_error,
                        "aicc": fit.aicc,
                        "converged": fit.converged,
                        "parameters": [f"{name} = {with_unit(e.value, e.unit)}" for name, e in fit.parameters.items()],
                    }
                    for ranking in rankings
                    for fit in ranking.fits
                ],
                {"rmse": "N", "max_error": "N", "cv_rmse": "N", "cv_max_error": "N"},
            )
        results: list[dict[str, Any]] = [r.to_dict() | {"warnings": w} for r, w in zip(rankings, warnings, strict=True)]
        for result, of in zip(results, samples, strict=False):
            for fit in result["fits"]:
                if fit["law"] in of:
                    fit["posterior"] = of[fit["law"]].to_dict()
        content = results[0] if len(results) == 1 else {"maps": results}
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        for i, ranking in enumerate(rankings):
            show_ranking(ranking)
            for one in samples[i].values() if samples else ():
                show_posterior(one)
        files.say()


def _check_hysteresis(tables: list[str], friction: str | None, *, runs: bool) -> None:
    """Refuse recordings that belong to no single fit of a law."""
    if friction is not None:
        raise InputError("--hysteresis", None, "is allowed only without --friction, which is fitted to a loop alone")
    if len(tables) > 1 and not runs or any(f.endswith(".toml") for f in tables):
        raise InputError(
            "--hysteresis", None, "is allowed only with one table, which may hold several muscles, or --runs"
        )


def _posteriors(ranking: Ranking, rig: str | None, draws: int, *, every: bool) -> dict[str, Posterior]:
    """Samples of the best law of a table, or of every law that converged, with the noise of a named rig's sensors."""
    sensors = None if rig is None else map_sensors(rig_file.rig(rig))
    slack = ranking.points.select(ranking.points.informative_slack)
    fits = [f for f in ranking.fits if f.converged or f is ranking.best] if every else [ranking.best]
    return {f.law: f.posterior(sensors=sensors, slack=slack if len(slack) else None, draws=draws) for f in fits}


def map_sensors(rig: Rig) -> identification.posterior.MapSensors:
    """Standard uncertainties of a value that a rig's sensors have read once.

    A count of a converter or an encoder adds the standard deviation of its rounding, 1/sqrt(12) of it.
    """
    rounding = 12.0**-0.5
    noise = {name: math.hypot(float(one.noise), rounding * float(one.resolution)) for name, one in rig.sensors.items()}
    for name in ("tension", "pressure"):
        if name not in noise:
            raise InputError("--rig", rig.name, f"has no sensor of the {name}")
    length = 0.0 if rig.encoder is None else rounding * float(rig.encoder.resolution)
    return identification.posterior.MapSensors(tension=noise["tension"], pressure=noise["pressure"], length=length)


def show_posterior(samples: Posterior) -> None:
    """Print median and intervals of a posterior's parameters, its discrepancy, and cautions."""
    rows = interval_rows(samples.intervals(), samples.joint_intervals())
    table(f"posterior of {samples.law}, {len(samples)} samples", HEADS, rows, right=range(1, 6))
    size, noise = float(np.median(samples.amplitude)), float(np.median(samples.noise * samples.sensor_noise))
    largest = samples.points.largest
    typer.echo(
        f"What the law has no parameter for: {size:.3g} N ({100.0 * size / largest:.2g} % of the largest tension); "
        f"noise of the tension: {noise:.3g} N."
    )
    if samples.run is not None and samples.points.run is not None:
        count = len(np.unique(samples.points.run))
        typer.echo(f"Error that the points of one run share, from {count} runs: {samples.run_error:.3g} N.")
    for warning in samples.warnings:
        typer.echo(f"note: {warning}")
    typer.echo("")


def _ranked(
    tables: list[str],
    law: list[str] | None,
    rest_length: str | None,
    like: str | None,
    change: list[str] | None,
    column: list[str] | None,
    unit: list[str] | None,
    branch: str | None,
    pressure_zero: str | None,
    train_below: str | None,
    *,
    slack: bool,
    length_error: str | None,
    runs: bool,
    hysteresis: list[str] | None,
    **options: Any,
) -> tuple[list[Ranking], list[list[str]]]:
    """Read the tables and rank the laws on each; with the cautions about each table."""
    rest = None if rest_length is None else parse(rest_length, "m", field="--rest-length")
    below = None if train_below is None else parse(train_below, "Pa", field="--train-below")
    if length_error is not None:
        identification.checked_length_error(length_error, field="--length-error")
    reading = {
        "columns": column_places(column) or {},
        "units": pairs(unit, "--unit", "pressure=kPa"),
        "branch": branch,
        "pressure_zero": 0.0 if pressure_zero is None else parse(pressure_zero, "Pa", field="--pressure-zero"),
        **options,
    }
    recordings = None
    if hysteresis:
        zero = reading["pressure_zero"]
        recordings = identification.shared_hysteresis.read_recordings(hysteresis, pressure_zero=zero)
    with options_named(rest_length="--rest-length '300 mm'", sheet="--sheet NAME"):
        loaded = [identification.load_table(f, rest_length=rest, like=like, **reading) for f in tables]
        if runs:
            loaded = [_of_one_muscle(loaded)]
        warnings = [_cautions(points, spec) for points, spec in loaded]
        rankings = [
            _ranking(points, spec, law, change, below, slack, length_error, recordings) for points, spec in loaded
        ]
        return rankings, warnings


def _of_one_muscle(loaded: list[tuple[ForceMap, Specimen | None]]) -> tuple[ForceMap, Specimen | None]:
    """All tables as one, of which each is a run."""
    if len(loaded) < 2:
        raise InputError("--runs", None, "is allowed only with two tables or more")
    return type(loaded[0][0]).joined([points for points, _ in loaded], f"{len(loaded)} runs"), loaded[0][1]


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
    length_error: str | None,
    recordings: dict[str, Recording] | None,
) -> Ranking:
    every = laws is None or "all" in laws
    named = [name for name in laws or [] if name != "all"]
    for name in named:
        muscles.laws.law_type(name)
    known = _known(change, [*muscles.laws.LAWS, *named] if every else named)
    count = len(named) + (len(muscles.laws.LAWS) if every else 0)
    forms = 0 if recordings is None else 2 * len(identification.shared_hysteresis.FRICTIONS)
    with progress("fitting", count * (1 + len(identification.SCHEMES)) + forms) as advance:
        return identification.fit(
            points,
            None if every else named,
            beside=named if every else (),
            like=spec,
            known=known,
            train_below=below,
            slack=slack,
            length_error=length_error,
            hysteresis=recordings,
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


def _assumptions(study: Ranking) -> list[str]:
    """Sizes that laws took from their defaults, one line each, with the options that state them or let them be fitted."""
    laws: dict[tuple[str, str, str], list[str]] = {}
    for fit in study.fits:
        kind = muscles.laws.law_type(fit.law)
        fields = declared(kind)
        for name, value in fit.assumed.items():
            beside = [size for size, of in kind.fitted_if_unknown.items() if name in of and size in fit.parameters]
            fitted = "".join(f", or fit it by --set {size}=.." for size in beside)
            laws.setdefault((name, with_unit(value, fields[name].unit), fitted), []).append(fit.law)
    lines = []
    for (name, shown, fitted), names in laws.items():
        of = "" if len(study) == 1 else f" ({', '.join(names)})"
        lines.append(f"assumed, as not stated: {name} = {shown}{of}; state it by --set {name}='{shown}'{fitted}")
    return lines


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
    for shift in best.length_errors:
        low, added, high = (f"{1e3 * value:+.2f} mm" for value in (shift.low, shift.added, shift.high))
        of = "" if math.isnan(shift.rest_length) else f" of {1e3 * shift.rest_length:.6g} mm"
        typer.echo(f"  length {1e3 * shift.length:.6g} mm{of}: {added}  (95 %: {low} to {high})")
    if best.effective is not None:
        typer.echo(f"  {best.effective:.1f} of these are determined by the data rather than their priors")
    for line in _assumptions(study):
        typer.echo(line)
    for f in study.fits:
        for warning in f.warnings:
            typer.echo(f"note: {f.law}: {warning}")
    if best.hysteresis is not None:
        _fit_hysteresis.show_hysteresis(best.hysteresis)
    short = [name for name, why in study.skipped.items() if f"law {name} needs the rest length" in why]
    if short:
        typer.echo(f"left out without --rest-length, or a column rest_length: {', '.join(short)}")
    for name, why in study.skipped.items():
        if name not in short:
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
