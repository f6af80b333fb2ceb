"""``sweep``: a protocol on many variants of a rig and a muscle, on all cores or many machines, into one store."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import batch
from ..quantities import with_unit
from ._progress import progress
from ._terminal import Json, caution, print_json, table

if TYPE_CHECKING:
    from ..batch.drive import SweepReport
    from ..batch.sweep import Sweep


def sweep(
    file: Annotated[
        Path, typer.Argument(metavar="SWEEP", help="Sweep file with the variants and the outputs to keep.")
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FOLDER", help="Folder of the results; an interrupted sweep resumes from it."),
    ],
    scheduler: Annotated[
        str,
        typer.Option(
            metavar="SCHEDULER",
            help="Where variants run: Dask or a pool of processes on this machine, this process, or a Dask scheduler such as tcp://host:8786.",
        ),
    ] = "dask",
    workers: Annotated[
        int, typer.Option(metavar="N", min=0, help="Number of processes on this machine; 0 for one per core.")
    ] = 0,
    dry: Annotated[bool, typer.Option("--dry-run", help="Report what would be run, without running it.")] = False,
    as_json: Json = False,
) -> None:
    """Run a protocol on many variants of a rig and a muscle; resumable, results in zarr.

    $ mckibben sweep tubes.toml --out results
    """
    wanted, team = batch.sweep.read_sweep(file), batch.drive.Workers(scheduler, workers)
    if dry:
        _tell(wanted, as_json)
        return
    stored = {"variants": 0, "of": 0}

    def saved() -> str:
        if not stored["variants"]:
            return f"no variant was done{'; ' + str(out) + ' is as it was' if not stored['of'] else ''}"
        done = f"{stored['variants']:,} of {stored['of']:,} variants are in {out}"
        return f"{done}, and the same command goes on with the rest"

    with progress("sweep", 1.0, saved=saved) as bar:

        def tell(done: float, total: int) -> None:
            bar.reached(done, total, f"{math.floor(done):,} of {total:,} variants")

        def keep(count: int) -> None:
            stored.update(variants=count, of=len(wanted.variants))

        report = batch.drive.run_sweep(wanted, out, workers=team, progress=tell, stored=keep)
    caution(*(c.text for c in report.cautions))
    if as_json:
        print_json(
            {
                "runs": report.runs,
                "failed": report.failed,
                "unmeasured": report.unmeasured,
                "warnings": [c.text for c in report.cautions],
                "store": report.store,
                "muscle_seconds_per_second": report.rate,
                "new": report.new,
                "codes": report.codes,
                "seconds": report.seconds,
            }
        )
    else:
        _print(wanted, report)
    if report.failed or report.unmeasured:
        raise typer.Exit(1)


def _tell(wanted: Sweep, as_json: bool) -> None:
    first = wanted.check()
    duration = first.bench.plan.duration
    columns: dict[str, Any] = {}
    for path, values in wanted.variants.columns.items():
        low_high = wanted.ranges.get(path)
        words = list(dict.fromkeys(values)) if low_high is None else []
        columns[path] = {"unit": wanted.template.settings[path].unit, "range": low_high, "words": words}
    if as_json:
        print_json(
            {
                "result": "ready",
                "variants": len(wanted.variants),
                "duration": duration,
                "hash": wanted.digest,
                "parameters": columns,
                "outputs": [o.name for o in wanted.template.outputs],
            }
        )
        return
    typer.echo(
        f"{len(wanted.variants):,} variants of {wanted.template.protocol.title!r}, the first of {duration:.4g} s."
    )
    table("", ["parameter", "values"], [[p, _range(c)] for p, c in columns.items()])
    typer.echo(f"Kept: {', '.join(o.name for o in wanted.template.outputs)}")


def _range(column: dict[str, Any]) -> str:

    if column["range"] is None:
        return ", ".join(column["words"][:8]) + (" .." if len(column["words"]) > 8 else "")
    return " to ".join(with_unit(x, column["unit"] or "1") for x in column["range"])


def _print(wanted: Sweep, report: SweepReport) -> None:

    rows = [
        [name.replace("_", " "), f"{n:,}", batch.VariantOutcome[name.upper()].sentence]
        for name, n in report.codes.items()
    ]
    table(f"{wanted.title or wanted.template.protocol.title}: {report.runs:,} variants", ["", "", ""], rows, right=(1,))
    if report.new:
        typer.echo(f"\n{report.new:,} run now, {report.rate:.3g} s of muscle per second.")
    typer.echo(f"Written: {report.store}")
