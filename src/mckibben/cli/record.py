"""``record``: content of recordings, figures of them, and conversion from and to other formats."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import recordings
from ..analysis import segments as cuts
from ..analysis.loop_residuals import loop_residuals
from ..citations import known_keys, reference
from ..documents import JsonValue
from ..errors import InputError, not_found
from ..experiments import waveforms
from ..quantities import from_si, parse, shown_unit
from ..recordings import mcap
from ..recordings.cautions import MACHINE
from ..recordings.differences import differing
from ..report.figures import analysis_figures, recording_figures, style
from ._outputs import FIGURE, KEPT_RECORDING, OBJECT, TABLE, OutputKinds, Paths, write_recording
from ._terminal import End, FigureLook, FigureWidth, Json, Start, options_named, pairs, print_json, table
from .read import Column, GearRatio, Period, Sheet, Topic, Unit, column_places, format_options

if TYPE_CHECKING:
    from ..recordings import Recording
    from ..recordings.formats import ImportResult


SHOWN = OutputKinds(table=TABLE, result=OBJECT)
PICTURE = OutputKinds(figure=FIGURE)
REPAIRED = OutputKinds(recording=KEPT_RECORDING)
SENTENCE = 280  # characters of a protocol's sentence that a person is shown
STEPS = 40  # rows of steps that a person is shown

File = Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording of mckibben (.nc, .csv or .mcap).")]


AnyFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="Recording of mckibben, or a file of another program of any format.")
]


def show(
    file: AnyFile,
    column: Column = None,
    unit: Unit = None,
    period: Period = None,
    sheet: Sheet = None,
    topic: Topic = None,
    gear_ratio: GearRatio = None,
    out: Annotated[Paths, SHOWN.option()] = None,
    as_json: Json = False,
) -> None:
    """Describe a recording: protocol, muscle, rig, steps, channels, balances, events.

    $ mckibben record show loop.nc
    """
    with SHOWN.files(out) as files:
        description = _description(file, column, unit, period, format_options(sheet, topic, gear_ratio))
        files.write_rows([{"channel": name} | s for name, s in description["channels"].items()])
        files.write_result(description)
        if as_json:
            print_json(description)
        else:
            _print(description)
            files.say()


def _description(
    file: Path, column: list[str] | None, unit: list[str] | None, period: str | None, options: dict[str, Any]
) -> dict[str, Any]:
    """What a file holds, with the remarks of its reader."""
    result = _read(file, column, unit, period, options)
    description = _described(file, result.recording)
    description["warnings"] = [
        *description["warnings"],
        *(r for r in result.remarks if r not in description["warnings"]),
    ]
    return description


Files = Annotated[
    list[Path],
    typer.Argument(metavar="RECORDING", help="Recordings (.nc, .csv or .mcap), or the folder of a sweep, to compare."),
]


def plot(
    file: Files,
    out: Annotated[list[Path], PICTURE.option()],
    channels: Annotated[
        str | None,
        typer.Option(metavar="CHANNELS", help="Channels to draw, separated by commas, such as tension,span."),
    ] = None,
    against: Annotated[
        str | None, typer.Option(metavar="CHANNEL", help="Draw over this channel instead of time, such as span.")
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
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Draw a recording over time, or one channel over another; of several recordings or a sweep their loops.

    $ mckibben record plot loop.nc --against span --out loop.svg
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
        known = recordings.read_recording(file[0])
        parts = _parts(between(known, start, end), label, pairs(case, "--case", "pressure='5 bar'"), bool(against))
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


def between(known: Recording, start: str | None, end: str | None) -> Recording:
    """Samples between the times of ``--from`` and ``--to``."""
    if start is None and end is None:
        return known
    first = None if start is None else parse(start, "s", field="--from", bare=True)
    last = None if end is None else parse(end, "s", field="--to", bare=True)
    try:
        return known.select(first, last)
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


def _described(file: Path, known: Recording) -> dict[str, JsonValue]:
    import numpy as np

    meta, several = known.meta, len(known) > 1
    period = known.period if several else None
    gaps = int((np.diff(known.time) > 1.5 * period).sum()) if period else 0
    document = meta.get("protocol")
    return {
        "file": str(file),
        "title": meta.get("title"),
        "created": meta.get("created"),
        "protocol": document.get("name") if isinstance(document, Mapping) else document,
        "sentence": meta.get("sentence") or meta.get("run") or meta.get("circuit"),
        "specimen": meta.get("specimen"),
        "rig": meta.get("rig"),
        "result": meta.get("result"),
        "message": meta.get("message"),
        "start": float(known.time[0]),
        "end": float(known.time[-1]),
        "duration": known.duration,
        "samples": len(known),
        "sample_rate": 1.0 / period if period else None,
        "gaps": gaps,
        "steps": cuts.steps_of(known) if known.meta.get("steps") else [],
        "varied": cuts.varied(known) if known.meta.get("steps") else {},
        "channels": _channels(known),
        "balance": meta.get("balance"),
        "saturation": meta.get("saturation") or {},
        "events": meta.get("events") or [],
        "warnings": [*(meta.get("warnings") or []), *(c.text for c in known.cautions if c.parameter in MACHINE)],
        "citations": _citations(meta.get("citations")),
    }


def _channels(known: Recording) -> dict[str, dict[str, Any]]:
    import numpy as np

    return {
        name: {**s, "known": float(np.isfinite(known[name]).mean()), "meaning": known.channels[name].meaning}
        for name, s in known.summary().items()
    }


def _citations(keys: Any) -> list[dict[str, str]]:

    listed = [str(key) for key in keys] if isinstance(keys, list) else []
    # a newer version may cite what this one does not know
    return [{"key": key, "reference": reference(key) if key in known_keys() else ""} for key in listed]


def _print(summary: dict[str, Any]) -> None:
    typer.echo(f"{summary['title'] or summary['file']}")
    if summary["sentence"]:
        typer.echo(_shortened(str(summary["sentence"]).removeprefix(f"{summary['title']}. ")))
    about = [[key, _named(summary[key])] for key in ("protocol", "specimen", "rig", "created") if summary[key]]
    rate = summary["sample_rate"]
    clock = f"{summary['samples']} samples from {summary['start']:.6g} s to {summary['end']:.6g} s"
    about.append(["time", clock + (f", every {_time(1.0 / rate)} ({rate:.6g} Hz)" if rate else "")])
    if summary["gaps"]:
        about[-1][1] += f", {summary['gaps']} gap{'s' if summary['gaps'] > 1 else ''}"
    if summary["result"]:
        about.append(["result", ": ".join(str(w) for w in (summary["result"], summary["message"]) if w)])
    if isinstance(summary["balance"], Mapping):
        closed = [f"{k} {v:.1e}" for k, v in summary["balance"].items() if isinstance(v, int | float)]
        about.append(["balance", f"{', '.join(closed)} of what went through"])
    typer.echo("")
    table("", ["", ""], about)
    _print_steps(summary)
    _print_channels(summary["channels"])
    _print_remarks(summary)


def _print_steps(summary: dict[str, Any]) -> None:
    steps, varied = summary["steps"], summary["varied"]
    if not steps:
        return
    rows = []
    for s in steps[:STEPS]:
        case = ", ".join(f"{name} {s['case'][name]}" for name in varied if name in s["case"])
        times = [f"{s[key]:.6g}" for key in ("start", "end")]
        rows.append([str(s["index"]), s["label"], case, *times, s["ended_by"], "" if s["recorded"] else "not recorded"])
    typer.echo("")
    table("", ["step", "label", "case", "from, s", "to, s", "ended by", ""], rows, right=[0, 3, 4])
    if len(steps) > STEPS:
        typer.echo(f"... and {len(steps) - STEPS} more; --json lists all.")


def _print_channels(channels: dict[str, dict[str, Any]]) -> None:

    rows = []
    units = {"kg/s": "g/s", "kg": "g"}
    for name, s in channels.items():
        unit = units.get(s["unit"], shown_unit(s["unit"]))
        nothing = s["known"] == 0.0
        numbers = ["" if nothing else f"{from_si(s[k], s['unit'], unit):.4g}" for k in ("min", "mean", "max")]
        share = "" if s["known"] == 1.0 else "nothing known" if nothing else f"known {100.0 * s['known']:.3g} %"
        rows.append(
            [name, s["kind"], *numbers, "" if unit == "1" else unit, "; ".join(w for w in (s["meaning"], share) if w)]
        )
    typer.echo("")
    table("", ["channel", "kind", "min", "mean", "max", "unit", ""], rows, right=[2, 3, 4])


def _print_remarks(summary: dict[str, Any]) -> None:
    lines = [f"Warning: {_named(w)}" for w in summary["warnings"]]
    for name, s in summary["saturation"].items() if isinstance(summary["saturation"], Mapping) else ():
        if isinstance(s, Mapping) and s.get("sentence"):
            lines.append(f"Saturation: {name} {s['sentence']}.")
        elif isinstance(s, Mapping):
            details = [f"{100.0 * s['share']:.3g} % of its samples"] if _is_number(s.get("share")) else []
            details += [f"first at {s['first']:.6g} s"] if _is_number(s.get("first")) else []
            details += [f"at most {_time(s['longest'])} on end"] if _is_number(s.get("longest")) else []
            lines.append(f"Saturation: {', '.join([str(name), *details])}.")
    for event in summary["events"]:
        if isinstance(event, Mapping) and _is_number(event.get("time")):
            lines.append(f"{event['time']:>9.3f} s  {event.get('text', '')}")
    lines += [f"[{c['key']}] {c['reference']}".rstrip() for c in summary["citations"]]
    if lines:
        typer.echo("\n" + "\n".join(lines))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _time(seconds: float) -> str:

    return waveforms.time_words(seconds)


def _named(value: Any) -> str:
    """Name of a table of the metadata, or the text itself."""
    if isinstance(value, Mapping):
        return str(next((value[key] for key in ("title", "name", "id", "text") if value.get(key)), ", ".join(value)))
    return str(value)


def _shortened(text: str) -> str:
    return text if len(text) <= SENTENCE else text[:SENTENCE].rsplit(" ", 1)[0] + " ..."


def _read(
    file: Path, column: list[str] | None, unit: list[str] | None, period: str | None, options: dict[str, Any]
) -> ImportResult:
    """Read the recording in a file of any format."""
    with options_named(sheet="--sheet NAME"):
        return recordings.read_any(file, **stated_columns(column, unit, period), **options)


def stated_columns(column: list[str] | None, unit: list[str] | None, period: str | None) -> dict[str, JsonValue]:
    """What the options state of the columns of a file of another program."""
    return {
        "columns": column_places(column),
        "units": pairs(unit, "--unit", "tank.pressure=bar") or None,
        "period": None if period is None else parse(period, "s", field="--period", bare=True),
    }


_READ = "File to read: a recording, a log or a file of another program, of any format that `mckibben read` takes."


def convert_file(
    source: Annotated[Path, typer.Argument(metavar="FILE", help=_READ)],
    target: Annotated[
        Path, typer.Argument(metavar="OUT", help="File to write (.nc, .csv, .mcap, .mat, .tdms or .parquet).")
    ],
    column: Column = None,
    unit: Unit = None,
    period: Period = None,
    sheet: Sheet = None,
    topic: Topic = None,
    gear_ratio: GearRatio = None,
    as_json: Json = False,
) -> None:
    """Convert a recording, or a file of another program, to another file format.

    $ mckibben record convert loop.nc loop.parquet
    """
    asked = stated_columns(column, unit, period) | format_options(sheet, topic, gear_ratio)
    with options_named(sheet="--sheet NAME"):
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
        recording = mcap.read_log(log)
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
