"""``record energy`` and ``record report``: what is computed of a recording, beside what it holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..analysis.energy_accounts import energy_account
from ..errors import InputError
from ..quantities import parse
from ..recordings import read_recording
from ..report.document import checked_place
from ..report.figures.energy_figures import energy_flow_figure
from ..report.figures.recording_figures import write
from ..report.recording_report import write_recording_report
from ._terminal import Json, print_json, table, writable

if TYPE_CHECKING:
    from ..analysis.energy_parts import EnergyAccount

CYCLES = 20  # rows of cycles that a person is shown


def energy(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of mckibben: .nc, .csv, .mcap.")],
    figure: Annotated[Path | None, typer.Option(metavar="PICTURE", help="An .svg, .png or .pdf file.")] = None,
    start: Annotated[str | None, typer.Option("--from", metavar="TIME", help="From this time on [s].")] = None,
    end: Annotated[str | None, typer.Option("--to", metavar="TIME", help="Up to this time [s].")] = None,
    measured: Annotated[bool, typer.Option("--measured", help="Estimate from measured channels alone.")] = False,
    muscle: Annotated[
        str | None, typer.Option(metavar="SPECIMEN", help="Whose law gives the volume, with measured channels.")
    ] = None,
    accumulator: Annotated[
        str | None, typer.Option(metavar="PRESSURE", help="What an exhaust accumulator at it would save [gauge].")
    ] = None,
    as_json: Json = False,
) -> None:
    """Account for the exergy of a recording: supply, losses and shaft work."""
    writable("--figure", figure, ".svg", ".png", ".pdf")
    first, last = (
        None if t is None else parse(t, "s", field=name, bare=True) for t, name in ((start, "--from"), (end, "--to"))
    )
    at = None if accumulator is None else parse(accumulator, "Pa", field="--accumulator", bare=True)
    record = read_recording(file)
    options: dict[str, Any] = {} if muscle is None else {"muscle": muscle}
    if muscle is not None and not measured and record.meta.get("energy"):
        raise InputError("--muscle", muscle, "allowed with --measured, for the recording carries its own law")
    account = energy_account(record, start=first, end=last, measured=measured, **options)
    saving = None if at is None else account.saved_by_accumulator(at)
    if figure is not None:
        title = record.meta.get("title")
        write(energy_flow_figure(account, **({"title": str(title)} if title else {})), figure)
    if as_json:
        told = account.document() | {"file": str(file), "figure": None if figure is None else str(figure)}
        print_json(told | {"saving": None if saving is None else saving._asdict()})
        return
    _print(account)
    if saving is not None:
        typer.echo(
            f"\nAn exhaust accumulator at {saving.pressure / 1e3:.4g} kPa would keep at most {saving.exergy:.4g} J, "
            f"{100.0 * saving.share:.3g} % of the supply's, in {1e3 * saving.air:.4g} g of air."
        )
    if figure is not None:
        typer.echo(f"\nWritten: {figure}")


def _print(account: EnergyAccount) -> None:
    supply = next((p.value for p in account.parts if p.name == "supply"), float("nan"))
    words = {"into": "in", "out": "out", "stored": "gained", "remainder": "left"}
    shares = {p: f"{100.0 * p.value / supply:.2f}" if supply > 0.0 else "" for p in account.parts}
    rows = [
        [words[p.side], p.name, f"{p.value:.5g}", shares[p], p.origin, p.meaning]
        for p in account.parts
        if p.value or p.name in ("supply", "shaft_work", "remainder")
    ]
    table(f"Exergy, {account.kind}", ["", "part", "J", "%", "from", ""], rows, right=[2, 3])
    told = ", ".join(f"{100.0 * v:.3g} % of the {name}" for name, v in account.efficiencies().items() if v == v)
    typer.echo(f"\nAir drawn: {1e3 * account.air:.4g} g. Shaft work: {told or 'no supply to compare it with'}.")
    if account.cycles:
        typer.echo("")
        cycles = [
            [f"{c.start:.4g}", f"{c.end:.4g}", f"{1e3 * c.air:.4g}", f"{c.supply:.4g}", f"{c.shaft_work:.4g}",
             f"{c.work_out:.4g}", f"{100.0 * c.efficiency:.2f}", f"{c.parts[-1].value:.2g}"]
            for c in account.cycles[:CYCLES]
        ]  # fmt: skip
        heads = [
            "from, s",
            "to, s",
            "air, g",
            "supply, J",
            "shaft work, J",
            "work out, J",
            "efficiency, %",
            "remainder, J",
        ]
        table("Cycles, from samples", heads, cycles, right=range(len(heads)))
        if len(account.cycles) > CYCLES:
            typer.echo(f"... and {len(account.cycles) - CYCLES} more; --json lists all.")
    if account.unknown:
        typer.echo(f"\nUnknown, and not zero: {', '.join(account.unknown)}.")
    for note in account.notes:
        typer.echo(f"Note: {note}.")


def report(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording of mckibben: .nc, .csv, .mcap.")],
    out: Annotated[Path, typer.Option(metavar="REPORT", help="An .html or .pdf file.")],
    as_json: Json = False,
) -> None:
    """Write a report of a recording: figures, balances, parameters, references."""
    checked_place(out, field="--out")
    write_recording_report(file, out)
    if as_json:
        print_json({"file": str(out)})
    else:
        typer.echo(f"Written: {out}")
