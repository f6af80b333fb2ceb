"""``record``: figures and reports of recordings, and conversion from and to other formats."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import recordings
from ..analysis import segments as cuts
from ..analysis.loops import loop_residuals
from ..documents import JsonValue
from ..errors import InputError, not_found
from ..quantities import parse
from ..recordings.files import read_log, select_between
from ..recordings.provenance import differing
from ..report.figures import analysis_figures, recording_figures, style
from ._outputs import FIGURE, KEPT_RECORDING, REPORT, OutputKinds, Paths, write_recording
from ._reading import (
    Column,
    Decimal,
    End,
    GearRatio,
    Header,
    Period,
    Scale,
    Sheet,
    Start,
    Topic,
    Unit,
    column_places,
    format_options,
    stated_columns,
)
from ._terminal import FigureLook, FigureWidth, Json, options_named, pairs, print_json, table

if TYPE_CHECKING:
    from ..recordings import Recording


PICTURE = OutputKinds(figure=FIGURE)
REPORTED = OutputKinds(report=REPORT)
REPAIRED = OutputKinds(recording=KEPT_RECORDING)

File = Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording of mckibben (.nc, .csv or .mcap).")]
Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="RECORDING", help="Recordings or a file of any format, or the folder of a sweep, to compare."
    ),
]


def plot(
    file: Files,
    out: Annotated[list[Path], PICTURE.option()],
    channels: Annotated[
        str | None,
        typer.Option(
            "--channels", "--y", metavar="CHANNELS", help="Channels to draw, separated by commas, such as tension,span."
        ),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(
            "--against", "--x", metavar="CHANNEL", help="Draw over this channel instead of time, such as span."
        ),
    ] = None,
    label: Annotated[str | None, typer.Option(metavar="LABEL", help="Draw only steps with this label.")] = None,
    case: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Draw only steps of this case, such as pressure='5 bar'."),
    ] = None,
    start: Start = None,
    end: End = None,
    title: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Title of the figure; by default the recording's own.")
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw measured data of any format over the loop, with residuals and their rms."
        ),
    ] = None,
    column: Column = None,
    unit: Unit = None,
    scale: Scale = None,
    period: Period = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Draw a recording over time, or one channel over another; of several recordings or a sweep their loops.

    $ mckibben record plot loop.nc --against span --out loop.svg

    $ mckibben record plot machine.csv --x span --y force --out pull.svg
    """
    with PICTURE.files(out) as files:
        if measured is not None or len(file) > 1 or file[0].is_dir():
            drawn, content = _compare(file, measured, channels, against or "span", title, column, unit)
            files.write("figure", lambda path: style.save(drawn, path))
            if as_json:
                print_json({"file": str(out[0])} | content)
            else:
                for words in content.get("words", ()):
                    typer.echo(words)
                files.say()
            return
        known = recordings.read_any(file[0], **stated_columns(column, unit, scale, period)).recording
        of_case = pairs(case, "--case", "pressure='5 bar'")
        whole = _parts(_between(known, start, end), label, of_case, bool(against))
        parts = [run for part in whole for run in part.runs] if against else whole
        names = None if channels is None else [n.strip() for n in channels.split(",") if n.strip()]
        if names == []:
            raise InputError("--channels", channels, "must be names of channels, parted by commas")

        if against is None:
            drawn = recording_figures.time_figure(parts, channels=names, title=title)
        else:
            drawn = recording_figures.against_figure(parts, against, channels=names, title=title)
        files.write("figure", lambda path: style.save(drawn, path))
        if as_json:
            print_json(
                {
                    "file": str(out[0]),
                    "segments": len(parts),
                    "samples": sum(len(p) for p in parts),
                    "start": float(parts[0].time[0]),
                    "end": float(parts[-1].time[-1]),
                }
            )
        else:
            files.say()


def _compare(
    files: list[Path],
    measured: Path | None,
    channels: str | None,
    across: str,
    title: str | None,
    column: list[str] | None,
    unit: list[str] | None,
) -> tuple[Any, dict[str, Any]]:
    """The figure of several loops, or of a loop with measured data over it, and its numbers."""
    channel = "tension" if channels is None else channels.strip()
    if measured is None:
        if len(files) == 1:
            loops, x, y = analysis_figures.loops_of_sweep(files[0], across=across, channel=channel)
        else:
            known = [recordings.read_recording(file) for file in files]
            loops, x, y = analysis_figures.loops_of_recordings(known, across=across, channel=channel)
            title = title or str(known[0].meta.get("title", ""))
        drawn = analysis_figures.swept_loops_figure(loops, x, y, title=title or "")
        return drawn, {"loops": [one.words for one in loops]}
    if len(files) > 1:
        raise InputError("--measured", None, "is allowed only with one recording")
    data = recordings.read(measured, columns=column_places(column), units=pairs(unit, "--unit", "tension=N") or None)
    simulated = recordings.read_recording(files[0])
    residuals = loop_residuals(simulated, data, across=across, channel=channel)
    drawn = analysis_figures.measured_loop_figure(simulated, data, across=across, channel=channel, title=title)
    words = [analysis_figures.residual_words(residuals, recording_figures.panels(simulated, [channel])[0])]
    return drawn, {"rms": residuals.rms, "relative_rms": residuals.relative, "words": words}


SUFFIXES = (".nc", ".csv", ".mcap")


def list_recordings(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with recordings (.nc, .csv or .mcap).")],
    everything: Annotated[
        bool, typer.Option("--all", help="Show every entry of the metadata that differs, results too.")
    ] = False,
    as_json: Json = False,
) -> None:
    """List the recordings of a folder by what differs between them.

    $ mckibben record list .
    """
    if not folder.is_dir():
        raise not_found(folder, "folder")
    known: dict[str, Recording] = {}
    for file in sorted(folder.iterdir()):
        if file.suffix.lower() not in SUFFIXES:
            continue
        try:
            known[file.name] = recordings.read_recording(file)
        except InputError as error:
            typer.echo(f"mckibben: {file.name} is left out: {error}", err=True)
    if not known:
        raise InputError("FOLDER", str(folder), f"must hold recordings ({', '.join(SUFFIXES)})")
    columns = differing([one.meta for one in known.values()], everything=everything)
    rows = [
        {"file": name, "duration": one.duration, "samples": len(one)} | {k: v[i] for k, v in columns.items()}
        for i, (name, one) in enumerate(known.items())
    ]
    if as_json:
        print_json({"folder": str(folder), "differing": list(columns), "recordings": rows})
        return
    shown = [[str(row["file"]), f"{row['duration']:.4g}", *(str(row[c]) for c in columns)] for row in rows]
    table("", ["recording", "duration, s", *columns], shown, right=[1])
    same = "" if columns or len(known) < 2 else "\nThe recordings were set up alike; --all shows results."
    typer.echo(f"\n{len(known)} recording{'s' if len(known) > 1 else ''}.{same}")


def _between(known: Recording, start: str | None, end: str | None) -> Recording:
    """Samples between the times of ``--from`` and ``--to``."""
    first, last = (
        None if t is None else parse(t, "s", field=name, bare=True) for t, name in ((start, "--from"), (end, "--to"))
    )
    try:
        return select_between(known, first, last)
    except InputError as error:
        raise error.changed(field="--from, --to") from None


def _parts(known: Recording, label: str | None, case: Mapping[str, str], apart: bool) -> list[Recording]:
    """Requested steps; by default all of them if they shall be distinguished, else the whole recording."""
    if label is not None or case or (apart and known.meta.get("steps")):
        try:
            return cuts.segments(known, label, **case)
        except InputError as error:
            options = {"label": "--label", "case": "--case"} | {name: f"--case {name}" for name in case}
            raise error.changed(field=options.get(error.field, error.field)) from None
    return [known]


_READ = "File to read: a recording, a log or a file of another program, of any format that `mckibben read` takes."


def convert_file(
    source: Annotated[Path, typer.Argument(metavar="FILE", help=_READ)],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="File to write (.nc, .csv, .mcap, .mat, .tdms, .parquet, or .zip for an RO-Crate)."
        ),
    ],
    column: Column = None,
    unit: Unit = None,
    scale: Scale = None,
    period: Period = None,
    decimal: Decimal = None,
    header: Header = None,
    sheet: Sheet = None,
    topic: Topic = None,
    gear_ratio: GearRatio = None,
    as_json: Json = False,
) -> None:
    """Convert a recording, or a file of another program, to another file format.

    $ mckibben record convert loop.nc loop.parquet
    """
    asked = stated_columns(column, unit, scale, period)
    asked |= format_options(decimal=decimal, header=header, sheet=sheet, topic=topic, gear_ratio=gear_ratio)
    with options_named(sheet="--sheet NAME", decimal="--decimal . or --decimal ,", header="--header 'NAME [UNIT], ..'"):
        read = recordings.convert(source, target, **asked)
    if as_json:
        print_json({**_written(source, target, read.recording), "warnings": read.remarks})
        return
    _print_written(target, read.recording)
    for remark in read.remarks:
        typer.echo(f"Note: {remark}")


def repair(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of a bench (.mcap) that is cut off or damaged.")],
    out: Annotated[Paths, REPAIRED.option(note="By default a .nc file beside the log.")] = None,
    as_json: Json = False,
) -> None:
    """Recover a recording from the log of a killed process.

    The log itself is not changed.

    $ mckibben record repair killed.mcap --out killed.nc
    """
    beside = log.with_suffix(".nc")
    if not out and beside.exists():
        raise InputError("file", str(beside), "this file exists already; choose a name with --out")
    with REPAIRED.files(out or [beside]) as files:
        recording = read_log(log)
        files.write("recording", lambda path: write_recording(recording.recording, path))
        target = files["recording"][0]
        if as_json:
            content = _written(log, target, recording.recording)
            print_json({**content, "whole": recording.whole, "lost": recording.remarks})
            return
        for path in files.named():
            _print_written(path, recording.recording)
        typer.echo(
            "The log was complete." if recording.whole else "\n".join(f"Note: {remark}" for remark in recording.remarks)
        )


def _written(source: Path, target: Path, known: Recording) -> dict[str, JsonValue]:
    return {
        "file": str(target),
        "source": str(source),
        "samples": len(known),
        "start": float(known.time[0]),
        "end": float(known.time[-1]),
        "channels": {name: {"unit": c.unit, "kind": c.kind} for name, c in known.channels.items()},
    }


def _print_written(target: Path, known: Recording) -> None:
    count = len(known.channels)
    span = f"{len(known)} samples of {count} channel{'s' if count != 1 else ''}"
    typer.echo(f"Written: {target}, {span}, {known.time[0]:.6g} s to {known.time[-1]:.6g} s")


def report(
    file: File,
    out: Annotated[list[Path], REPORTED.option()],
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Write a report of a recording: figures, balances, parameters, references.

    $ mckibben record report loop.nc --out loop.html
    """
    from ..report import document, recording_report

    with REPORTED.files(out) as files:
        for place in files["report"]:
            document.checked_place(place, field="--out")
        files.write("report", lambda path: recording_report.write_recording_report(file, path))
        if as_json:
            print_json({"file": str(out[0])})
        else:
            files.say()
