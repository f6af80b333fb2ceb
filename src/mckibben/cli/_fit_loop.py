"""``fit --friction``: friction with memory from a loop of pressure and stroke, with intervals or a posterior."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from .. import identification, muscles
from ..errors import InputError
from ..quantities import parse, with_unit
from ..report.figures import fit_figures, style
from ..specimens import muscle_specimen
from ._outputs import OutputFiles
from ._samples import show_samples
from ._terminal import assignments, print_json, table

if TYPE_CHECKING:
    from ..identification.hysteresis_fit import LoopFit
    from ..muscles.law import TensionLaw

ALL = "all"


def fit_friction(
    tables: list[str],
    friction: str,
    reading: dict[str, Any],
    *,
    creep: bool,
    like: str | None,
    law: list[str] | None,
    change: list[str] | None,
    posterior: bool,
    draws: int,
    files: OutputFiles,
    as_json: bool,
) -> None:
    """Fit a friction to a loop, print and write it.

    Args:
        tables: the one file of the loop.
        friction: model of friction, or ``all`` of those without kinks, of which the best is taken.
        reading: options of `read_path`.
        creep: whether creep is fitted beside the friction.
        like: specimen whose law balances the loop; a smooth curve by default.
        law: name of that law.
        change: parameters that are known, as ``name=value``.
        posterior: whether to draw samples.
        draws: count of the samples.
        files: what is written.
        as_json: print one JSON object instead of tables.
    """
    if len(tables) > 1:
        raise InputError("file", ", ".join(tables), "must be one loop, alone")
    for kind in ("report", "specimen"):
        if files[kind]:
            raise InputError("--out", None, f"is allowed only without --friction for the {kind} {files[kind][0]}")
    record = identification.path_record.read_path(tables[0], timed=creep, **reading)
    known = ({"creep": float("nan")} if creep else {}) | _known(friction, change)
    options: dict[str, Any] = {"law": _law(like, law), "known": known}
    if friction == ALL:
        found = identification.hysteresis_fit.fit_loops(record, **options)[0]
    else:
        found = identification.hysteresis_fit.fit_loop(record, model=friction, **options)
    samples = found.posterior(draws=draws) if posterior else None
    content = {
        "friction": found.model,
        "parameters": {name: e._asdict() for name, e in found.parameters.items()},
        "known": found.known,
        "curve": found.curve.tolist(),
        "rmse": found.rmse(seen=True),
        "max_error": found.max_error(seen=True),
        "n": len(found.record.stroke),
        "converged": found.converged,
        "warnings": list(found.warnings),
        "posterior": None if samples is None else samples.to_dict(),
    }
    files.write("figure", lambda path: style.save(fit_figures.loop_bands(found, samples), path))
    files.write_rows([{"parameter": name} | e._asdict() for name, e in found.parameters.items()])
    files.write_result(content)
    if as_json:
        print_json(content)
        return
    _show(found, tables[0])
    if samples is not None:
        show_samples(samples, "the friction")
    files.say()


def _law(like: str | None, law: list[str] | None) -> TensionLaw | None:
    if like is None:
        if law:
            raise InputError("--law", None, "is allowed beside --friction only with --like, the specimen that has it")
        return None
    if law is not None and len(law) > 1:
        raise InputError("--law", ", ".join(law), "must be one law beside --friction")
    spec = muscle_specimen(like)
    return muscles.build.law_from_specimen(spec, law[0] if law else None)


def _known(friction: str, change: list[str] | None) -> dict[str, float]:
    """Parameters that are not fitted [SI], from ``--set``."""
    models = identification.hysteresis_fit.MODELS
    if friction not in (*models, ALL):
        raise InputError("--friction", friction, known=[*models, ALL])
    named = models if friction == ALL else {friction: models[friction]}
    units = {name: free.unit for _, every in named.values() for name, free in every.items()}
    units |= {"load": "N", "start_length": "m", "spring": "N/m", "pressure_zero": "Pa", "creep": "N/m"}
    known = {}
    for name, text in assignments(change).items():
        if name not in units:
            raise InputError(f"--set {name}", text, known=sorted(units))
        known[name] = parse(text, units[name], field=f"--set {name}", bare=True)
    return known


def _show(found: LoopFit, name: str) -> None:
    rows = [
        [key, with_unit(e.value, e.unit), with_unit(e.low, e.unit), with_unit(e.high, e.unit)]
        for key, e in found.parameters.items()
    ]
    title = f"{Path(name).name}: {found.model}, {len(found.record.stroke)} samples of a loop"
    table(title, ["parameter", "value", "95 %: from", "to"], rows, right=[1, 2, 3])
    errors = [with_unit(value, "m", 3) for value in (found.rmse(seen=True), found.max_error(seen=True))]
    typer.echo(f"Error of the stroke: {errors[0]} rms, {errors[1]} at most.")
    for warning in found.warnings:
        typer.echo(f"note: {warning}")
