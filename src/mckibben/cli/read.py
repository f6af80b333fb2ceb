"""``read``: what a file of another program holds, and how it is understood."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import recordings
from ..documents import JsonValue
from ..quantities import from_si, parse, shown_unit
from ._outputs import OBJECT, TABLE, OutputFiles, OutputKinds, Paths
from ._terminal import Json, RestLength, options_named, pairs, print_json, table

if TYPE_CHECKING:
    from ..recordings import FileReading, ForceMap, Recording

OUT = OutputKinds(table=TABLE, result=OBJECT)
PREAMBLE = 6  # lines before a header that a person is shown
Column = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=COLUMN",
        help="Column that holds length, contraction, pressure, force, time or a channel, by label or number, such as "
        "force='F [N]'.",
    ),
]
Unit = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=UNIT",
        help="Unit of a column for which the file states none, such as force=N or 'pressure=kPa abs'.",
    ),
]
Period = Annotated[
    str | None, typer.Option(metavar="TIME", help="Sample interval of a file without a time column, such as '2 ms'.")
]
Sheet = Annotated[str | None, typer.Option(metavar="SHEET", help="Sheet of a spreadsheet, by name or number.")]
Topic = Annotated[str | None, typer.Option(metavar="TOPIC", help="Topic of a bag of ROS or an MCAP file.")]
GearRatio = Annotated[
    str | None, typer.Option(metavar="NUMBER", help="Gear ratio of the lever that recorded a .ddf file.")
]
Branch = Annotated[
    str | None, typer.Option(metavar="LABEL", help="Keep only rows with this value in the branch column.")
]
PressureZero = Annotated[
    str | None, typer.Option(metavar="PRESSURE", help="Reading of the pressure channels at zero, such as '9.2 kPa'.")
]


def format_options(sheet: str | None, topic: str | None, gear_ratio: str | None) -> dict[str, JsonValue]:
    """The options of a file format that were stated."""
    options = {"sheet": sheet, "topic": topic, "gear_ratio": gear_ratio}
    return {name: value for name, value in options.items() if value is not None}


def column_places(words: list[str] | None) -> dict[str, str | int] | None:
    """The columns of ``--column``, numbers as such."""
    named = pairs(words, "--column", "force='F [N]'")
    return {name: int(place) if place.isdecimal() else place for name, place in named.items()} or None


def read_file(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File of any format that mckibben reads.")],
    column: Column = None,
    unit: Unit = None,
    rest_length: RestLength = None,
    period: Period = None,
    branch: Branch = None,
    pressure_zero: PressureZero = None,
    kind: Annotated[
        str | None,
        typer.Option("--as", metavar="KIND", help="Read as a map or as a recording, where both are possible."),
    ] = None,
    sheet: Sheet = None,
    topic: Topic = None,
    gear_ratio: GearRatio = None,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Read a file of another program and show its columns, units, and the rows left out.

    $ mckibben read measured.csv --rest-length '300 mm' --unit force=N --out map.csv
    """
    with OUT.files(out) as files, options_named(rest_length="--rest-length '300 mm'", sheet="--sheet NAME"):
        reading = recordings.understand(
            file,
            columns=column_places(column),
            units=pairs(unit, "--unit", "force=N") or None,
            rest_length=None if rest_length is None else parse(rest_length, "m", field="--rest-length"),
            period=None if period is None else parse(period, "s", field="--period", bare=True),
            branch=branch,
            pressure_zero=0.0 if pressure_zero is None else parse(pressure_zero, "Pa", field="--pressure-zero"),
            kind=kind,  # type: ignore[arg-type]
            **format_options(sheet, topic, gear_ratio),
        )
        summary = _summary(file, reading)
        _write(reading.data, files)
        files.write_result(summary)
        if as_json:
            print_json(summary)
        else:
            _print(summary)
            files.say()


def _write(data: ForceMap | Recording, files: OutputFiles) -> None:
    """Write the table in SI units: of a map length, pressure and tension, of a recording time and channels."""
    if isinstance(data, recordings.ForceMap):
        columns = {"length": data.length, "pressure": data.pressure, "tension": data.tension}
        units = {"length": "m", "pressure": "Pa", "tension": "N"}
    else:
        columns = {"time": data.time, **{name: data[name] for name in data.names()}}
        units = {"time": "s", **{name: data.unit(name) for name in data.names()}}
    files.write_columns(columns, units)


def _summary(file: Path, reading: FileReading) -> dict[str, JsonValue]:
    data = reading.data
    if isinstance(data, recordings.ForceMap):
        values = {"length": data.length, "pressure": data.pressure, "tension": data.tension}
        ranges = {
            name: {"unit": unit, "min": float(column.min()), "max": float(column.max())}
            for (name, column), unit in zip(values.items(), ("m", "Pa", "N"), strict=True)
        }
    else:
        ranges = {name: {key: s[key] for key in ("unit", "min", "max")} for name, s in data.summary().items()}
        ranges = {"time": {"unit": "s", "min": float(data.time[0]), "max": float(data.time[-1])}, **ranges}
    return {
        "file": str(file),
        "format": reading.format,
        "kind": "map" if isinstance(data, recordings.ForceMap) else "recording",
        "rows": len(data),
        "columns": [use._asdict() for use in reading.columns],
        "values": ranges,
        "remarks": list(reading.remarks),
        "notes": dict(reading.notes),
    }


def _print(summary: dict[str, Any]) -> None:
    kind = "force map" if summary["kind"] == "map" else "recording"
    typer.echo(f"{summary['file']}: a {kind} of {summary['rows']} {'points' if kind == 'force map' else 'samples'}\n")
    rows = []
    for use in summary["columns"]:
        label = use["label"].replace("[", "\\[") or "(no name)"  # no markup of rich
        rows.append([label, use["name"] or "not used", use["unit"] if use["name"] else ""])
    table("", ["column", "read as", "unit"], rows)
    typer.echo("")
    ranges = []
    for name, one in summary["values"].items():
        unit = shown_unit(one["unit"])
        numbers = [f"{from_si(one[key], one['unit'], unit):.4g}" for key in ("min", "max")]
        ranges.append([name, *numbers, "" if unit == "1" else unit])
    table("", ["quantity", "min", "max", "unit"], ranges, right=[1, 2])
    lines = [f"Note: {line}" for line in summary["remarks"]]
    preamble = summary["notes"].get("preamble", [])
    lines += [f"Before the header: {line}" for line in preamble[:PREAMBLE]]
    if len(preamble) > PREAMBLE:
        lines.append(f"Before the header: {len(preamble) - PREAMBLE} more lines; --json has all.")
    if lines:
        typer.echo("\n" + "\n".join(lines))
