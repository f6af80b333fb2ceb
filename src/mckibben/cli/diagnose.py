"""``diagnose``: faults of a rig from a recording of its normal operation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..studies import diagnosis
from ._outputs import OBJECT, TABLE, OutputKinds, Paths
from ._terminal import Json, caution, print_json, table

if TYPE_CHECKING:
    from ..studies.diagnosis.fault_fit import Diagnosis

OUT = OutputKinds(table=TABLE, result=OBJECT)


def diagnose_recording(
    file: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording of a normal run: .nc, .csv, ..")],
    muscle: Annotated[
        str | None,
        typer.Option(
            "--muscle",
            metavar="SPECIMEN",
            help="Sound muscle: id or .toml file; by default as the recording states it.",
        ),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option(
            "--rig",
            metavar="RIG",
            help="Sound rig: paper, modern, or a .toml file; by default as the recording states it.",
        ),
    ] = None,
    plumbing: Annotated[
        str | None,
        typer.Option(
            metavar="PLUMBING",
            help="Plumbing that joins the rig's pneumatic parts; by default as the recording states it.",
        ),
    ] = None,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Find a fault of a rig from a recording of its normal operation.

    Each fault is fitted alone to pressures and tension, given the recorded command of the valve and the span: a leak, a
    blocked or sticking valve, a drifting sensor, a slack or slipping clamp, lost threads, warm rubber. Of what this
    recording or rig cannot show it says so.

    $ mckibben diagnose work-loop.nc
    """
    with OUT.files(out) as files:
        result = diagnosis.fault_fit.diagnose(file, rig, muscle=muscle, plumbing=plumbing)
        rows = [
            {"fault": one.name, **one.estimate._asdict(), "ratio": one.ratio, "aicc": one.aicc, "limit": one.limit}
            for one in result.faults
        ]
        files.write_rows(rows, {})
        content = {"file": str(file), **result.to_dict()}
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            caution(*result.cautions)
            _print(result)
            files.say()


def _print(result: Diagnosis) -> None:
    typer.echo(result.sentence)
    typer.echo("")
    rows = []
    for one in result.faults:
        value, low, high = (diagnosis.fault_fit.shown(one.name, v) for v in one.estimate[:3])
        limit = diagnosis.fault_fit.shown(one.name, one.limit)
        rows.append([one.title, value, f"{low} to {high}", limit, f"{one.ratio:.1f}"])
    columns = ["each fault alone", "value", "95 %", "seen from", "likelihood ratio"]
    table("", columns, rows, right=range(1, 5))
    typer.echo("".join(f"\n{sentence}" for sentence in result.not_judged), nl=bool(result.not_judged))
    typer.echo(f"\nA fault is reported from a likelihood ratio of {result.threshold:.0f} on; {result.blocks} readings.")
