"""``record convert`` and ``record repair``: from one file to another, and what is left of a log that was cut off."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .words import Json, options_named, pairs, print_json

if TYPE_CHECKING:
    from ..recordings import Recording

_READ = ".nc, .csv, .txt, .mcap, .mat, .tdms or .parquet; recordings, logs, tables of others."


def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help=_READ)],
    target: Annotated[Path, typer.Argument(metavar="OUT", help=".nc, .csv, .mcap, .mat, .tdms or .parquet.")],
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=COLUMN", help="Which column is tank.pressure, time, ..; then only these are read."),
    ] = None,
    unit: Annotated[
        list[str] | None, typer.Option(metavar="COLUMN=UNIT", help="Unit of a column of which the file says none.")
    ] = None,
    period: Annotated[
        str | None, typer.Option(metavar="TIME", help="Interval of the samples, where the file has no time.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a recording, or a file of somebody else, as another kind of file."""
    from ..quantities import parse
    from ..recordings import convert

    places: dict[str, str | int] = {}
    for name, place in pairs(column, "--column", "tank.pressure=2").items():
        places[name] = int(place) if place.isdecimal() else place
    asked: dict[str, Any] = {
        "columns": places or None,
        "units": pairs(unit, "--unit", "tank.pressure=bar") or None,
        "period": None if period is None else parse(period, "s", field="--period", bare=True),
    }
    with options_named():
        read = convert(source, target, **asked)
    if as_json:
        print_json({**_said(source, target, read.recording), "warnings": read.remarks})
        return
    _print(target, read.recording)
    for remark in read.remarks:
        typer.echo(f"Note: {remark}")


def repair(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log of a bench, .mcap, cut off or damaged.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Where to, .nc or .csv; beside the log, .nc, where left out.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Save as a recording what is left of a log whose process was killed; the log itself is not touched."""
    from ..recordings.mcap import read_log

    target = log.with_suffix(".nc") if out is None else out
    if target.suffix.lower() not in (".nc", ".csv"):
        raise InputError("--out", str(target), "allowed is a name that ends in .nc or .csv")
    if out is None and target.exists():
        raise InputError("file", str(target), "it is there already; say another name, or this one, with --out")
    found = read_log(log)
    found.recording.save(target)
    if as_json:
        print_json({**_said(log, target, found.recording), "whole": found.whole, "lost": found.remarks})
        return
    _print(target, found.recording)
    typer.echo("The log was whole." if found.whole else "\n".join(f"Note: {remark}" for remark in found.remarks))


def _said(source: Path, target: Path, known: Recording) -> dict[str, Any]:
    return {
        "file": str(target),
        "source": str(source),
        "samples": len(known),
        "start": float(known.time[0]),
        "end": float(known.time[-1]),
        "channels": {name: {"unit": c.unit, "kind": c.kind} for name, c in known.channels.items()},
    }


def _print(target: Path, known: Recording) -> None:
    count = len(known.channels)
    span = f"{len(known)} samples of {count} channel{'s' if count != 1 else ''}"
    typer.echo(f"Written: {target}, {span}, {known.time[0]:.6g} s to {known.time[-1]:.6g} s")
