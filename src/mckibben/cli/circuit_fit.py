"""``circuit fit``: a circuit's parameters from records, and how well they predict others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .circuit import Change, File, circuit, planned
from .words import Json, caution, options_named, pairs, print_json, table, told, writable

if TYPE_CHECKING:
    from ..assembly.circuit_file import CircuitPlan
    from ..identification import CircuitFit, Trial


def add_to(app: typer.Typer) -> None:
    """Add the commands for circuits, this one among them."""
    circuit.command("fit")(fit)
    app.add_typer(circuit)


def fit(
    file: File,
    records: Annotated[list[Path], typer.Argument(metavar="RECORD..", help="Recordings, or measured CSV tables.")],
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH", help="Parameter to fit, such as elements.tube.friction_scale; * stands for several."
        ),
    ] = None,
    predict: Annotated[
        list[Path] | None, typer.Option(metavar="RECORD", help="Record to predict with what was fitted.")
    ] = None,
    start: Annotated[list[str] | None, typer.Option(metavar="PATH=VALUE", help="First guess of a parameter.")] = None,
    column: Annotated[
        list[str] | None, typer.Option(metavar="NAME=COLUMN", help="Which column is tank.pressure, time, ...")
    ] = None,
    unit: Annotated[
        list[str] | None, typer.Option(metavar="NAME=UNIT", help="Unit of a column whose header has none.")
    ] = None,
    change: Change = None,
    figure: Annotated[Path | None, typer.Option(help="Draw measured and predicted into this SVG or PNG file.")] = None,
    as_json: Json = False,
) -> None:
    """Fit a circuit's parameters to records of its pressures, and predict other records with them."""
    from ..identification import fit_circuit

    writable("--figure", figure, ".svg", ".png")
    plan = planned(file, change)
    wanted = list(free or plan.fit.free)
    if not wanted:
        raise InputError(
            "--free", "nothing", "allowed is a dotted path, here or as free = [..] in [fit]", where=str(file)
        )
    reading = _reading(plan, column, unit)
    for option, words in (("--column", column), ("--unit", unit)):
        if words and (own := next(filter(_is_own, [*records, *(predict or [])]), None)):
            allowed = "a recording of mckibben says these itself; they are for files of others"
            raise InputError(option, words[0], allowed, where=str(own))
    trials = [_trial(plan, path, reading) for path in records]
    others = [_trial(plan, path, reading) for path in predict or []]
    with told("fitting") as tell:
        found = fit_circuit(
            trials, wanted, predict=others, start=_starts(plan, wanted, start), step=plan.step, progress=tell
        )
    if figure is not None:
        from ..report.figures import circuit_fit_figures, style

        style.save(circuit_fit_figures.overview(found, [*trials, *others], title=plan.title), figure)
    if as_json:
        print_json(fit_json(found))
        return
    show_fit(found, plan.title)
    if figure is not None:
        typer.echo(f"Written: {figure}")


def _reading(plan: CircuitPlan, column: list[str] | None, unit: list[str] | None) -> dict[str, Any]:
    given: dict[str, str | int] = dict(plan.fit.columns)
    for name, place in pairs(column, "--column", "tank.pressure=2").items():
        given[name] = int(place) if place.isdigit() else place
    units = plan.fit.units | pairs(unit, "--unit", "tank.pressure=kPa")
    return {"columns": given or None, "units": units or None, "pressure_zero": plan.fit.pressure_zero}


def _trial(plan: CircuitPlan, path: Path, reading: dict[str, Any]) -> Trial:
    from ..identification.trial import trial_from_record
    from ..recordings import read_record, read_recording

    if _is_own(path):
        record = read_recording(path)
    else:
        with options_named():
            record = read_record(path, ambient=float(plan.environment.pressure_abs), **reading)
        caution(*(f"{path}: {said}" for said in record.meta["source"].get("left_out", [])))
    return trial_from_record(plan, record, name=str(path))


def _is_own(path: Path) -> bool:
    """Whether a file was saved by this laboratory, and carries its own units."""
    return path.suffix == ".nc" or (path.suffix == ".csv" and _is_recording(path))


def _is_recording(path: Path) -> bool:
    """Whether a CSV file was saved by this laboratory, and carries its own units."""
    try:
        with path.open(encoding="utf-8") as stream:
            return stream.readline().startswith("# mckibben")
    except (OSError, UnicodeDecodeError):
        return False


def _starts(plan: CircuitPlan, wanted: list[str], start: list[str] | None) -> dict[str, float]:
    from ..components import paths
    from ..identification.circuit_fit import DELAY
    from ..identification.trial import matching
    from ..quantities import parse

    found = {}
    for name, words in {**plan.fit.start, **pairs(start, "--start", "elements.tube.ends=2")}.items():
        if name not in wanted:
            if name in plan.fit.start and not pairs(start, "--start", "").get(name):
                continue  # the file's guess for a parameter that is not asked for this time
            raise InputError("--start", name, f"it is not free; free are {', '.join(wanted)}")
        path = matching(name, plan.circuit, tuple(plan.signals))[0]
        unit = DELAY.unit if path.startswith("signals.") else paths.declaration(plan.circuit, path).unit
        found[name] = parse(str(words), unit, field=f"start of {name}", bare=True)
    return found


def fit_json(found: CircuitFit) -> dict[str, Any]:
    """A fit as one object, SI."""
    return {
        "parameters": {name: e._asdict() for name, e in found.parameters.items()},
        "errors": [e._asdict() for e in found.errors],
        "rms": {"fitted": found.rms(), "predicted": found.rms(fitted=False)},
        "converged": found.converged,
        "message": found.message,
        "evaluations": found.evaluations,
        "warnings": list(found.warnings),
    }


def show_fit(found: CircuitFit, title: str) -> None:
    """Print parameters, the errors of every record, and what is to be noted."""
    from ..quantities import with_unit

    rows = [
        [name, with_unit(e.value, e.unit), f"{with_unit(e.low, e.unit)} to {with_unit(e.high, e.unit)}"]
        for name, e in found.parameters.items()
    ]
    table(title, ["parameter", "value", "95 %"], rows, right=[1, 2])
    rows = []
    for e in found.errors:
        lead = "-" if e.lead is None else f"{round(1e3 * e.lead, 1) + 0.0:+.1f} ms"
        used = "fitted" if e.fitted else "predicted"
        channel = e.channel.removesuffix(".pressure_abs")
        rows.append([Path(e.trial).name, channel, used, with_unit(e.rms, "Pa"), with_unit(e.largest, "Pa"), lead])
    table("", ["record", "pressure of", "", "rms", "largest", "model leads"], rows, right=[3, 4, 5])
    if not found.converged:
        typer.echo(f"The search did not converge: {found.message}.")
    for warning in found.warnings:
        typer.echo(f"note: {warning}")
