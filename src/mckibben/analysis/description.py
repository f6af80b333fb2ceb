"""What a recording holds, and how a file of another program is understood."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import recordings, verbs
from ..answers import Answer, Caution, Column, Table
from ..citations import known_keys, reference
from ..documents import JsonValue
from ..experiments.waveforms import time_words
from ..quantities import from_si, shown_unit
from ..recordings.files import path_of
from ..recordings.provenance import MACHINE
from .segments import steps_of, varied

SENTENCE = 280  # characters of a protocol's sentence that a person is shown
STEPS = 40  # rows of steps that a person is shown
PREAMBLE = 6  # lines before a header that a person is shown
FLOWS = {"kg/s": "g/s", "kg": "g"}  # units in which a person reads those of gas


@dataclass(frozen=True)
class RecordingDescription(Answer):
    """What a recording holds: what `describe_recording` finds.

    Attributes:
        content: by name: protocol, specimen, rig, times [s], steps, channels with their smallest, mean and largest
            values [SI], balance, saturation, events, warnings and citations.
        cautions: none; what is said against the recording is its own content, as ``warnings``.
    """

    content: Mapping[str, Any]
    cautions: tuple[Caution, ...] = field(default=())

    def to_dict(self) -> dict[str, JsonValue]:
        """The content as plain values."""
        return dict(self.content)

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per channel."""
        return [{"channel": name} | one for name, one in self.content["channels"].items()]

    def tables(self) -> list[Table]:
        """What the recording is of, its steps, and its channels."""
        about = [{"name": name, "value": value} for name, value in self._about() if value]
        title = str(self.content["title"] or self.content["file"] or "Recording")
        sentence = str(self.content["sentence"] or "").removeprefix(f"{title}. ")
        if len(sentence) > SENTENCE:
            sentence = sentence[:SENTENCE].rsplit(" ", 1)[0] + " ..."
        title = f"{title}\n{sentence}" if sentence else title
        tables = [Table(title, (Column("name", ""), Column("value", "")), about)]
        return [*tables, *([self._steps()] if self.content["steps"] else []), self._channels()]

    def _about(self) -> Iterator[tuple[str, str]]:
        known = self.content
        for key in ("protocol", "specimen", "rig", "created"):
            yield key, _named(known[key]) if known[key] else ""
        rate, gaps = known["sample_rate"], known["gaps"]
        clock = f"{known['samples']} samples from {known['start']:.6g} s to {known['end']:.6g} s"
        clock += f", every {time_words(1.0 / rate)} ({rate:.6g} Hz)" if rate else ""
        yield "time", clock + (f", {gaps} gap{'s' if gaps > 1 else ''}" if gaps else "")
        yield "result", ": ".join(str(w) for w in (known["result"], known["message"]) if w) if known["result"] else ""
        if isinstance(known["balance"], Mapping):
            closed = [f"{k} {v:.1e}" for k, v in known["balance"].items() if isinstance(v, int | float)]
            yield "balance", f"{', '.join(closed)} of what went through"

    def _steps(self) -> Table:
        names = self.content["varied"]
        rows = [
            {**s, "case": ", ".join(f"{name} {s['case'][name]}" for name in names if name in s["case"])}
            | {"recorded": "" if s["recorded"] else "not recorded"}
            for s in self.content["steps"]
        ]
        times = (Column("start", "from", "s", places=".6g"), Column("end", "to", "s", places=".6g"))
        columns = (Column("index", "step", right=True), Column("label"), Column("case"), *times)
        return Table("", (*columns, Column("ended_by"), Column("recorded", "")), rows, most=STEPS)

    def _channels(self) -> Table:
        rows = []
        for name, s in self.content["channels"].items():
            nothing = s["known"] == 0.0
            share = "" if s["known"] == 1.0 else "nothing known" if nothing else f"known {100.0 * s['known']:.3g} %"
            meaning = "; ".join(words for words in (s["meaning"], share) if words)
            shown = shown_numbers(s, ("min", "mean", "max"), FLOWS.get(s["unit"]))
            if nothing:
                shown = {"unit": shown["unit"]}
            rows.append({"channel": name, "kind": s["kind"], "meaning": meaning} | shown)
        numbers = (Column(key, right=True) for key in ("min", "mean", "max"))
        return Table("", (Column("channel"), Column("kind"), *numbers, Column("unit"), Column("meaning", "")), rows)

    def remarks(self) -> list[str]:
        """Warnings, saturated channels, events, and the papers that the run cites."""
        known = self.content
        lines = [f"Warning: {_named(one)}" for one in known["warnings"]]
        for name, s in known["saturation"].items() if isinstance(known["saturation"], Mapping) else ():
            if isinstance(s, Mapping) and s.get("sentence"):
                lines.append(f"Saturation: {name} {s['sentence']}.")
            elif isinstance(s, Mapping):
                details = [f"{100.0 * s['share']:.3g} % of its samples"] if _is_number(s.get("share")) else []
                details += [f"first at {s['first']:.6g} s"] if _is_number(s.get("first")) else []
                details += [f"at most {time_words(s['longest'])} on end"] if _is_number(s.get("longest")) else []
                lines.append(f"Saturation: {', '.join([str(name), *details])}.")
        for event in known["events"]:
            if isinstance(event, Mapping) and _is_number(event.get("time")):
                lines.append(f"{event['time']:>9.3f} s  {event.get('text', '')}")
        return lines + [f"[{one['key']}] {one['reference']}".rstrip() for one in known["citations"]]


@verbs.verb
def describe_recording(recording: verbs.DataFile, *, read: verbs.Reading | None = None) -> RecordingDescription:
    """Describe a recording: protocol, muscle, rig, steps, channels, balances, events.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        read: how the file of another program is understood: parameters of `describe_file`, such as ``{"period": "2 ms"}``.

    Raises:
        InputError: the file cannot be read as a recording; says what to state.

    Examples:
        >>> import mckibben as mk
        >>> recording = mk.Recording([0.0, 0.1, 0.2], {"span": mk.Channel([0.12, 0.13, 0.12], "m")})
        >>> describe_recording(recording).content["samples"]
        3
    """
    result = recordings.read_any(recording, **(read or {}))
    known = result.recording
    meta, period = known.meta, known.period if len(known) > 1 else None
    document, stepped = meta.get("protocol"), bool(meta.get("steps"))
    warnings = [*(meta.get("warnings") or []), *(c.text for c in known.cautions if c.parameter in (*MACHINE, "source"))]
    keys = meta.get("citations")
    content = {
        "file": path_of(recording),
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
        "gaps": int((np.diff(known.time) > 1.5 * period).sum()) if period else 0,
        "steps": steps_of(known) if stepped else [],
        "varied": varied(known) if stepped else {},
        "channels": {
            name: {**s, "known": float(np.isfinite(known[name]).mean()), "meaning": known.channels[name].meaning}
            for name, s in known.summary().items()
        },
        "balance": meta.get("balance"),
        "saturation": meta.get("saturation") or {},
        "events": meta.get("events") or [],
        "warnings": [*warnings, *(remark for remark in result.remarks if remark not in warnings)],
        # A newer version may cite what this one does not know.
        "citations": [
            {"key": key, "reference": reference(key) if key in known_keys() else ""}
            for key in map(str, keys if isinstance(keys, list) else [])
        ],
    }
    return RecordingDescription(content)


@dataclass(frozen=True)
class FileDescription(Answer):
    """How a file of another program is understood: what `describe_file` finds.

    Attributes:
        file: path of the file.
        reading: the content with columns, units, and a line for each thing that was left out.
        cautions: none; what was left out is said as remarks.
    """

    file: str | None
    reading: recordings.FileReading
    cautions: tuple[Caution, ...] = field(default=())

    @property
    def is_map(self) -> bool:
        """Whether the content is a force map, not a recording."""
        return isinstance(self.reading.data, recordings.ForceMap)

    def data(self) -> dict[str, Any]:
        """Columns in SI units: of a map length, pressure and tension, of a recording time and channels."""
        content = self.reading.data
        if isinstance(content, recordings.ForceMap):
            return {"length": content.length, "pressure": content.pressure, "tension": content.tension}
        return {"time": content.time} | {name: content[name] for name in content.names()}

    def column_units(self) -> dict[str, str]:
        """SI units of the columns."""
        content = self.reading.data
        if isinstance(content, recordings.ForceMap):
            return {"length": "m", "pressure": "Pa", "tension": "N"}
        return {"time": "s"} | {name: content.unit(name) for name in content.names()}

    def ranges(self) -> dict[str, dict[str, Any]]:
        """Unit, smallest and largest value of each column that was read [SI]."""
        content, columns = self.reading.data, self.data()
        known = columns if isinstance(content, recordings.ForceMap) else {"time": columns["time"]}
        of = {n: {"min": float(np.min(column)), "max": float(np.max(column))} for n, column in known.items()}
        ranges: dict[str, dict[str, Any]] = {n: {"unit": self.column_units()[n], **ends} for n, ends in of.items()}
        if isinstance(content, recordings.Recording):
            ranges |= {n: {key: s[key] for key in ("unit", "min", "max")} for n, s in content.summary().items()}
        return ranges

    def to_dict(self) -> dict[str, JsonValue]:
        """Format, columns as they are in the file, and ranges of what was read."""
        reading = self.reading
        return {
            "file": self.file,
            "format": reading.format,
            "kind": "map" if self.is_map else "recording",
            "rows": len(reading.data),
            "columns": [use._asdict() for use in reading.columns],
            "values": self.ranges(),
            "remarks": list(reading.remarks),
            "notes": dict(reading.notes),
        }

    def tables(self) -> list[Table]:
        """What each column is read as, and the ranges of the quantities."""
        rows = [
            {"label": use.label or "(no name)", "name": use.name or "not used", "unit": use.unit if use.name else ""}
            for use in self.reading.columns
        ]
        kind, of = ("force map", "points") if self.is_map else ("recording", "samples")
        title = f"{self.file}: a {kind} of {len(self.reading.data)} {of}"
        ends = [{"name": name} | shown_numbers(one, ("min", "max")) for name, one in self.ranges().items()]
        numbers = (Column("min", right=True), Column("max", right=True))
        return [
            Table(title, (Column("label", "column"), Column("name", "read as"), Column("unit")), rows),
            Table("", (Column("name", "quantity"), *numbers, Column("unit")), ends),
        ]

    def remarks(self) -> list[str]:
        """What was left out, and the lines before the header."""
        preamble = self.reading.notes.get("preamble", [])
        lines = [f"Note: {line}" for line in self.reading.remarks]
        lines += [f"Before the header: {line}" for line in preamble[:PREAMBLE]]
        more = len(preamble) - PREAMBLE
        return lines + ([f"Before the header: {more} more lines; --json has all."] if more > 0 else [])


@verbs.verb
def describe_file(
    file: verbs.DataFile,
    *,
    columns: verbs.FileColumns | None = None,
    units: verbs.FileUnits | None = None,
    scales: verbs.FileScales | None = None,
    rest_length: verbs.Length | None = None,
    period: verbs.Time | None = None,
    branch: verbs.Label | None = None,
    pressure_zero: verbs.Pressure | None = None,
    pressure: verbs.FilePressures | None = None,
    length_zero: verbs.Lengths | None = None,
    kind: verbs.FileKind | None = None,
    decimal: verbs.DecimalMark | None = None,
    header: verbs.Header | None = None,
    sheet: verbs.Sheet | None = None,
    topic: verbs.Topic | None = None,
    gear_ratio: verbs.PlainNumber | None = None,
    **options: JsonValue,
) -> FileDescription:
    r"""Read a file of another program and show its columns, units, and the rows left out.

    Args:
        file: file of any format that mckibben reads; a folder or a quoted pattern of files with one pressure each.
        columns: column that holds length, contraction, pressure, force, time or a channel, by label or number, such as
            force='F [N]'.
        units: unit of a column for which the file states none, such as force=N or 'pressure=kPa abs'.
        scales: what a raw signal stands for, such as 'pressure=2 bar/V - 1 bar' or 'force=0.5 N/count'.
        rest_length: rest length of the muscle [m], such as '300 mm'.
        period: sample interval of a file without a time column [s], such as '2 ms'.
        branch: keep only rows with this value in the branch column.
        pressure_zero: reading of the pressure channels at zero [Pa], such as '9.2 kPa'.
        pressure: gauge pressure of a map without such a column [Pa], of several files one for each in the order of their
            names, such as '1 bar, 3 bar'; by default that in the head or the name of each.
        length_zero: length of the muscle where the length column reads zero [m], such as '300 mm', or one for each file; by
            default that in the head.
        kind: read as a map or as a recording, where both are possible.
        decimal: decimal mark of a text, where its numbers fit both a point and a comma.
        header: names of the columns with their units, where the file has none, such as 'time_ms, pressure_bar'.
        sheet: sheet of a spreadsheet, by name or number, or a range of its cells, such as 'Data!B4:E60'.
        topic: topic of a bag of ROS or an MCAP file.
        gear_ratio: gear ratio of the lever that recorded a .ddf file.
        **options: of a format that another package adds.

    Raises:
        InputError: one sentence with file, place and remedy.

    Examples:
        >>> from pathlib import Path
        >>> _ = Path("map.csv").write_text("length [mm],pressure [bar],force [N]\n120,3,20.5\n130,3,35.1\n")
        >>> describe_file("map.csv").ranges()["tension"]["max"]
        35.1
    """
    reading = recordings.understand(
        file, columns=columns, units=units, scales=scales, rest_length=rest_length, period=period, branch=branch,
        pressure_zero=pressure_zero or 0.0, pressure=pressure, length_zero=length_zero,
        kind=kind, decimal=decimal, header=header, sheet=sheet, topic=topic,
        gear_ratio=gear_ratio, **options,
    )  # fmt: skip
    return FileDescription(path_of(file), reading)


def shown_numbers(values: Mapping[str, Any], keys: Sequence[str], unit: str | None = None) -> dict[str, str]:
    """Numbers of a quantity as a person reads them, with their unit."""
    shown = unit or shown_unit(values["unit"])
    numbers = {key: f"{from_si(values[key], values['unit'], shown):.4g}" for key in keys}
    return numbers | {"unit": "" if shown == "1" else shown}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _named(value: Any) -> str:
    """Name of a table of the metadata, or the text itself."""
    if isinstance(value, Mapping):
        return str(next((value[key] for key in ("title", "name", "id", "text") if value.get(key)), ", ".join(value)))
    return str(value)
