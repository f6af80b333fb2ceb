"""Files of all formats: read, written and converted.

| suffix | read | written | needs |
|---|---|---|---|
| ``.nc`` | of mckibben and of other programs | all that a recording holds | |
| ``.csv`` | of mckibben and of other programs, text of any dialect | all | |
| ``.txt``, ``.tsv``, ``.dat``, ``.asc``, ``.csv.gz``, ``.txt.gz`` | text of any dialect | | |
| ``.lvm``, ``.tra``, ``.sto``, ``.mot`` | text of LabVIEW, testXpert and OpenSim | | |
| ``.xlsx``, ``.xls``, ``.ods`` | a sheet of a spreadsheet | | python-calamine |
| ``.mcap`` | logs of mckibben, closed or not; messages of JSON, protobuf and ROS 2 | all | rosbags, mcap-protobuf-support |
| ``.db3``, ``.bag`` | bags of ROS 2 and ROS 1 | | rosbags |
| ``.mat`` | of mckibben and of other programs, versions 5 and 7.3 | all, version 5 | pymatreader to read |
| ``.h5``, ``.hdf5`` | rows of numbers in HDF5 | | |
| ``.tdms`` | of mckibben and of other programs | all | npTDMS |
| ``.parquet`` | of mckibben and of other programs | all | polars |
| ``.ddf`` | of Aurora Scientific's DMC, the muscle lever | | |
| ``.edf``, ``.bdf`` | signals of physiology | | edfio |
| ``.c3d`` | points and channels of a motion capture | | ezc3d |
| ``.mf4``, ``.mdf`` | measurements of vehicles (ASAM MDF) | | asammdf |
| ``.zip`` | RO-Crates of mckibben | all, as data repositories take it | |

Further formats come from other packages: see `mckibben.formats.registry`. What the columns of a table mean is decided in
`mckibben.formats.columns`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ..documents import JsonValue, no_file, path_text, write_whole
from ..errors import InputError
from ..formats import mcap
from ..formats.clock import is_date
from ..formats.columns import AMBIENT, assemble, channel_columns, date_column, table_labels
from ..formats.labels import likely_columns, parse_header, quantity_of, time_column
from ..formats.registry import format_of, load, writer_of
from ..formats.table import ForeignTable, StoredRecording
from ..quantities import in_si, named_values, told_apart, with_unit
from ..slips import USUAL_ROOM
from .force_map import (
    TEXT_QUANTITIES,
    ForceMap,
    choose_map_columns,
    even_table,
    map_and_table,
    map_of_table,
    read_force_map,
    series_files,
    unit_of,
    unpivoted,
)
from .recording import Recording

RECORDINGS = (".nc", ".csv", ".mcap")  # suffixes that `read_recording` takes
NEEDED = ("length", "contraction", "pressure", "tension")  # of which a force map needs three


class ImportResult(NamedTuple):
    """A recording, and a line for each thing that was not taken over as it is."""

    recording: Recording
    remarks: list[str]


class LogContent(NamedTuple):
    """The content of a log: the recording, whether the log is whole, and a line for each thing that is not."""

    recording: Recording
    whole: bool
    remarks: list[str]


class ColumnUse(NamedTuple):
    """A column of a file and what is read from it.

    Args:
        label: the label in the file.
        name: channel or quantity that is read from it; empty where it is not used.
        unit: unit in words, as it was understood; empty where there is none.
    """

    label: str
    name: str
    unit: str


class FileReading(NamedTuple):
    """The content of a file, and how it was understood.

    Args:
        data: the content.
        format: the kind of file, such as ``"TDMS files"``.
        columns: the columns of the file in their order.
        remarks: a line for each thing that was left out or changed.
        notes: what else the file says, such as the lines before its header.
    """

    data: ForceMap | Recording
    format: str
    columns: tuple[ColumnUse, ...]
    remarks: tuple[str, ...]
    notes: Mapping[str, Any]


def read(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    scales: Mapping[str, str] | None = None,
    rest_length: float | str | None = None,
    period: float | str | None = None,
    branch: str | None = None,
    pressure_zero: float | str = 0.0,
    ambient: float | str = AMBIENT,
    pressure: float | str | Sequence[float | str] | None = None,
    length_zero: float | str | Sequence[float | str] | None = None,
    kind: Literal["map", "recording"] | None = None,
    **options: JsonValue,
) -> ForceMap | Recording:
    r"""Read a file of any format: a force map, or a recording where the file has a time.

    Text tables of any dialect, spreadsheets, MATLAB, HDF5, netCDF, TDMS, Parquet, MCAP, bags of ROS, Aurora's ``.ddf``, and
    what mckibben saves. Columns are recognised by name and unit; a contraction stands for a length where the rest length is
    known::

        table = mk.read("map.xlsx", rest_length="300 mm", columns={"force": "F [N]"})
        recording = mk.read("bag.mcap")

    Args:
        path: the file; of a testing machine that writes one for each pressure the folder, or a pattern of names.
        columns: ``length``, ``contraction``, ``pressure``, ``force``, ``time``, or a channel name -> label of its column, or
            its number from 1, where the file uses other names.
        units: the same -> unit in words, where the file states none or a wrong one of the same kind.
        scales: channel name -> what a raw signal stands for, such as ``"2 bar/V - 1 bar"`` or ``"4.9 mbar/count"``.
        rest_length: rest length of the muscle [m], or text such as ``"300 mm"``.
        period: interval of the samples [s] of a file without a time, or text such as ``"2 ms"``.
        branch: of a force map, keep only the rows whose branch column has this value.
        pressure_zero: reading of the gauge pressures at zero [Pa], or text; it is subtracted.
        ambient: environment pressure [Pa], or text.
        pressure: gauge pressure of a force map without such a column [Pa], of several files one for each in the order of
            their names, such as ``"1 bar, 3 bar"``; by default that in the head or the name of each.
        length_zero: length of the muscle where the length column reads zero [m], one or one for each file; by default that
            in the head.
        kind: ``"map"`` or ``"recording"``, where the file could be both.
        options: options of the format: ``decimal`` of a text, its decimal mark; ``header`` of a text or a sheet, the names
            of its columns with their units, such as ``"time [ms], pressure [bar]"``; ``sheet`` of a spreadsheet (name or
            number from 1, or a range of cells such as ``"Data!B4:E60"``), ``gear_ratio`` of a ``.ddf`` file, ``topic`` of a
            bag or an MCAP file.

    Returns:
        A `ForceMap` where the columns are those of a map, a `Recording` where there is a time.

    Raises:
        InputError: one sentence with file, place and remedy.

    Examples:
        >>> import mckibben as mk
        >>> from pathlib import Path
        >>> _ = Path("map.csv").write_text("Länge;Druck;Kraft\nmm;bar;N\n120;3;20,5\n130;3;35,1\n", encoding="cp1252")
        >>> mk.read("map.csv", rest_length="140 mm")
        ForceMap('map.csv': 2 points, 2 with tension, largest 35.1 N)
    """
    return understand(
        path, columns=columns, units=units, scales=scales, rest_length=rest_length, period=period, branch=branch,
        pressure_zero=pressure_zero, ambient=ambient, pressure=pressure,
        length_zero=length_zero, kind=kind, **options,
    ).data  # fmt: skip


def understand(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    scales: Mapping[str, str] | None = None,
    rest_length: float | str | None = None,
    period: float | str | None = None,
    branch: str | None = None,
    pressure_zero: float | str = 0.0,
    ambient: float | str = AMBIENT,
    pressure: float | str | Sequence[float | str] | None = None,
    length_zero: float | str | Sequence[float | str] | None = None,
    kind: Literal["map", "recording"] | None = None,
    **options: JsonValue,
) -> FileReading:
    """Read a file as `read` does, and report columns, units, and what was left out and why."""
    path = Path(path_text(path))
    if kind not in (None, "map", "recording"):
        raise InputError("kind", kind, known=("map", "recording"))
    for name, mapping in (("columns", columns), ("units", units), ("scales", scales)):
        if mapping is not None:
            named_values(mapping, name)
    step = None if period is None else float(in_si(period, "s", field="period"))
    zero, air = float(in_si(pressure_zero, "Pa", field="pressure_zero")), float(in_si(ambient, "Pa", field="ambient"))
    if not USUAL_ROOM[0] <= air <= USUAL_ROOM[1]:
        got, low, high = told_apart("Pa", air, *USUAL_ROOM)
        raise InputError("ambient", got, f"must be the absolute pressure of the room, from {low} to {high}")
    rest = None if rest_length is None else float(in_si(rest_length, "m", field="rest_length"))
    of_map: dict[str, Any] = {
        "columns": columns, "units": units, "rest_length": rest, "branch": branch, "pressure_zero": zero, "ambient": air,
    }  # fmt: skip
    several = series_files(path) if kind != "recording" else []
    if kind == "recording" and (pressure is not None or length_zero is not None):
        option = "length_zero" if pressure is None else "pressure"
        raise InputError(option, None, "is for a force map, and this is read as a recording", where=str(path))
    if several or pressure is not None or length_zero is not None:
        points, table = map_and_table(path, of_map, pressure, length_zero, options)
        first = format_of(path)
        title = f"{len(several)} files" if several else first.title if first is not None else ""
        return FileReading(points, title, _map_uses(table, columns or {}, units or {}), points.remarks, {})
    content = load(path, **options)
    file_format = format_of(path)
    title = "folder" if file_format is None else file_format.title
    if not isinstance(content, ForeignTable):
        if kind == "map":
            points = read_force_map(path, **of_map)
            return FileReading(points, title, _channel_uses(content), (*content.remarks, *points.remarks), {})
        for option, value in {"column": columns, "unit": units, "scale": scales, "period": step}.items():
            if value:
                problem = "a recording of mckibben says these itself; they are for files of others"
                shown = ", ".join(value) if isinstance(value, Mapping) else with_unit(value, "s")
                raise InputError(option, shown, problem, where=str(path))
        return FileReading(_recording(content), title, _channel_uses(content), tuple(content.remarks), {})
    if kind != "recording" and content.rows is not None:
        content = unpivoted(content)
    if (kind or _kind_of(content, columns or {}, step, str(path))) == "recording":
        stored = assemble(
            path, content, columns=columns, units=units, scales=scales, period=step, pressure_zero=zero, ambient=air
        )
        uses = _recording_uses(content, stored, units or {}, (columns or {}).get("time") or date_column(content))
        return FileReading(_recording(stored), title, uses, (*content.remarks, *stored.remarks), content.notes)
    if scales:
        raise InputError(
            "scale", ", ".join(scales), "is for the channels of a recording, and this is a map", where=str(path)
        )
    table = content if content.rows is not None else even_table(content, str(path))
    points = map_of_table(path, table, **of_map)
    return FileReading(points, title, _map_uses(table, columns or {}, units or {}), points.remarks, content.notes)


def _kind_of(table: ForeignTable, columns: Mapping[str, str | int], period: float | None, where: str) -> str:
    """Whether a table is a recording or a map.

    Raises:
        InputError: it has neither a time nor the columns of a map.
    """
    labels = table_labels(table)
    timed = any(quantity_of(parse_header(0, label.rpartition(".")[2])[0]) == "time" for label in labels)
    timed = timed or time_column([label.rpartition(".")[2] for label in labels]) is not None
    if period is not None or "time" in columns or timed or any(c.time is not None for c in table.columns):
        return "recording"
    if not table.columns or not len(table.columns[0].values):
        problem = "no row of numbers was found; the file must have a header and rows of numbers"
        if table.rows is None:
            problem = "no channel of numbers was found in it"
        raise InputError("file", "empty", problem, sentence=problem, where=where)
    if not table.named:
        problem = "the file has no header; name its columns and their units, such as 'time [ms], pressure [bar]'"
        raise InputError("header", None, problem, sentence=problem, where=where, remedy="header")
    usable = table if table.rows is not None else even_table(table, where)
    try:
        choose_map_columns(table_labels(usable), columns, where)
    except InputError:
        recognised = {quantity_of(parse_header(0, label)[0]) for label in table_labels(usable)} & {*NEEDED}
        if date_column(table) is not None:
            return "recording"
        if columns or (len(recognised) >= 2 and recognised & {"length", "contraction"}):
            raise
        needs = "a recording needs a time, or the period of its samples, a force map length, pressure and force"
        needs += "; name the columns"
        likely = likely_columns(table_labels(usable))
        if len(likely) > 1:
            needs += f" (by their units {', '.join(f'{column} may be the {one}' for one, column in likely.items())})"
        problem = f"the columns are {', '.join(labels)}; {needs}"
        remedy = f"column {next(iter(likely)) if len(likely) > 1 else 'time'}"
        raise InputError("columns", ", ".join(labels), needs, sentence=problem, where=where, remedy=remedy) from None
    return "map"


def _recording(stored: StoredRecording) -> Recording:
    return Recording(stored.time, stored.channels, stored.meta)


def _channel_uses(recording: StoredRecording) -> tuple[ColumnUse, ...]:
    channels = recording.channels.items()
    return (ColumnUse("time", "time", "s"), *(ColumnUse(name, name, channel.unit) for name, channel in channels))


def _recording_uses(
    table: ForeignTable, recording: StoredRecording, units: Mapping[str, str], time: str | int | None
) -> tuple[ColumnUse, ...]:
    source = recording.meta["source"]["columns"]
    used = {about["column"]: (name, about["unit"]) for name, about in source.items()}
    shorter = {id(column.values): column.label for column in channel_columns(table)}
    uses = []
    for at, (column, label) in enumerate(zip(table.columns, table_labels(table), strict=True), 1):
        stem, parsed = parse_header(0, label)
        name, unit = used.get(shorter.get(id(column.values), column.label), ("", parsed.unit))
        if not name and (time in (at, label, stem) or quantity_of(stem.rpartition(".")[2]) == "time"):
            name, unit = "time", units.get("time") or parsed.unit or ("date" if is_date(column.values) else "s")
        uses.append(ColumnUse(column.label, name, unit or ""))
    return tuple(uses)


def _map_uses(table: ForeignTable, columns: Mapping[str, str | int], units: Mapping[str, str]) -> tuple[ColumnUse, ...]:
    labels = table_labels(table)
    chosen = {label: quantity for quantity, label in choose_map_columns(labels, columns, "").items()}
    units_by_name = {{"force": "tension"}.get(name, name): unit for name, unit in units.items()}
    uses = []
    for column, label in zip(table.columns, labels, strict=True):
        quantity = chosen.get(label, "")
        unit, absolute = unit_of(label, quantity)
        unit = units_by_name.get(quantity) or (
            "" if quantity in TEXT_QUANTITIES or unit is None else f"{unit} abs" if absolute else unit
        )
        uses.append(ColumnUse(column.label, quantity, unit))
    return tuple(uses)


def read_recording(path: str | Path | Recording) -> Recording:
    """Read a recording: netCDF and CSV as `Recording.save` wrote them, or the live log of a bench (``.mcap``).

    What a log lost, because it was never closed or is damaged, stands in the metadata's ``warnings``. What is a recording
    already passes as it is.

    Raises:
        InputError: there is no such file, it is no recording, or a newer version wrote it.

    Examples:
        >>> import mckibben as mk
        >>> recording = mk.Recording([0.0, 0.1, 0.2], {"span": mk.Channel([0.12, 0.13, 0.12], "m")})
        >>> path = recording.save("steps.csv")
        >>> mk.read_recording(path) == recording
        True
    """
    if isinstance(path, Recording):
        return path
    path = Path(path_text(path, "recording"))
    if not path.is_file():
        raise no_file(path)
    if (suffix := path.suffix.lower()) not in RECORDINGS:
        if format_of(path) is None:
            raise InputError("suffix", path.suffix or str(path), known=RECORDINGS, where=str(path))
        problem = f"a file {suffix} is converted into a recording of mckibben first (mckibben record convert)"
        raise InputError("file", path.name, sentence=problem, where=str(path))
    # A log that is damaged where it says that it is one still has its samples.
    content = mcap.read_log(path) if suffix == ".mcap" else load(path)
    if isinstance(content, ForeignTable):
        problem = (
            "this is no recording of mckibben; a table of others is converted into one first (mckibben record convert)"
        )
        raise InputError("file", path.name, problem, sentence=problem, where=str(path))
    return _recording(content)


def read_log(path: str | Path) -> LogContent:
    """Read a log of a bench in whatever state it is, see `mckibben.formats.mcap.read_log`.

    Raises:
        InputError: there is no such file, no sample of it can be read, it is no log of mckibben, or of a newer version.
    """
    stored = mcap.read_log(path)
    return LogContent(_recording(stored), not stored.remarks, stored.remarks)


def path_of(source: str | Path | Recording) -> str | None:
    """The path of what a recording is read from; None of what is a recording already."""
    return None if isinstance(source, Recording) else str(Path(source))


@contextlib.contextmanager
def naming_file(source: str | Path | Recording) -> Iterator[None]:
    """Name a recording's file in errors about what is in it."""
    try:
        yield
    except InputError as error:
        raise error if (path := path_of(source)) is None else error.at(path) from None


def select_between(recording: Recording, start: float | str | None, end: float | str | None) -> Recording:
    """Samples from a time to another [s]; all of them where neither is stated."""
    if start is None and end is None:
        return recording
    try:
        return recording.select(*(None if at is None else float(at) for at in (start, end)))
    except InputError as error:
        raise error.changed(field="{start}, {end}") from None


def read_any(path: str | Path | Recording, **options: Any) -> ImportResult:
    """Read a recording of mckibben, or a file of another program as a recording, with a line for each thing left out.

    The options are those of `read`.
    """
    if isinstance(path, Recording):
        return ImportResult(path, [])
    reading = understand(path, kind="recording", **options)
    assert isinstance(reading.data, Recording)
    return ImportResult(reading.data, list(reading.remarks))


def read_record(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
    pressure_zero: float | Mapping[str, float] = 0.0,
    ambient: float = AMBIENT,
    required: Iterable[str] = (),
) -> Recording:
    """Read a measured record for a fit: the file of any format must have no gaps, and something must change in it.

    Args:
        path: the file.
        columns: channel name -> header or number of the column from 1; then only these, and the time, are read. A file
            without a header needs it. The time's name is ``time``.
        units: channel name -> unit in words, over the header; a time without a unit is in seconds.
        period: interval of the samples [s] where the file has no time; the first is then at 0 s.
        pressure_zero: what gauge pressures read at zero [Pa], one for all or by channel; it is subtracted.
        ambient: environment pressure, which says where vacuum is [Pa].
        required: channels that must be there.

    Returns:
        Channels of kind "measured" ("command" where the last part of the name is that), all SI.

    Raises:
        InputError: names file, row, field, value and what is allowed.
    """
    path = Path(path)
    content = load(path)
    if isinstance(content, ForeignTable):
        content = assemble(
            path, content, columns=columns, units=units, period=period, pressure_zero=pressure_zero, ambient=ambient,
            required=required, strict=True,
        )  # fmt: skip
    return _recording(content)


def read_points(
    path: Path, time: str | None, column: str | None, unit: str, *, field: str, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values [unit] of one column.

    Args:
        path: a CSV file as `read_record` takes it.
        time: header of its times; found by itself by default.
        column: header of its values; the only other column by default.
        unit: SI unit of the signal; a pressure is gauge.
        field: dotted path of the signal, for error messages.
        where: the file that names the table, for error messages.

    Raises:
        InputError: names what the table lacks.
    """
    columns = None if column is None else {"value": column} | ({"time": time} if time else {})
    if column is None and time is not None:
        raise InputError(f"{field}.column", None, "must name a column of the header, as time does", where=where)
    record = read_record(path, columns=columns)
    names = record.names()
    if len(names) != 1:
        raise InputError(
            f"{field}.column", None, f"is missing: the table has {', '.join(names)}; name one", where=where
        )
    (name,) = names
    if record.unit(name) != unit or name.endswith("_abs"):
        column_name = f"{name} in {record.unit(name)}"
        gauge = ", gauge" if unit == "Pa" else ""
        raise InputError(f"{field}.column", column_name, f"the signal is in {unit}{gauge}", where=where)
    return record.time, record[name]


def write(recording: Recording, path: str | Path) -> list[str]:
    """Write a recording in the format of the suffix, atomically.

    Returns:
        A line for each thing that the format holds otherwise than a recording does.

    Raises:
        InputError: the suffix is unknown, or the file cannot be written.
    """
    path = Path(path)
    write_part = writer_of(path).write
    assert write_part is not None
    remarks: list[str] = []
    write_whole(path, lambda part: remarks.extend(write_part(recording, part)))
    return remarks


def convert(
    source: str | Path,
    target: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    scales: Mapping[str, str] | None = None,
    period: float | str | None = None,
    **options: JsonValue,
) -> ImportResult:
    """Read a file, and write it in the format of the target's suffix, atomically.

    Args:
        source: source of mckibben or of another program.
        target: ends in the suffix of a format that is written.
        columns: of another program's file, channel name -> label or number of the column from 1; then only these are read.
        units: units of another program's file, channel name -> unit as text, where the file states none or a wrong one.
        scales: channel name -> what a raw signal of another program's file stands for, as `read` takes it.
        period: period of another program's file without a time, the interval of the samples [s].
        options: options of the source's format, as `read` takes them.

    Returns:
        The recording, and a line for each thing that was lost or changed on the way.

    Raises:
        InputError: names file, column, value and what is allowed.
    """
    target = Path(target)
    target_format = writer_of(target)
    if not target.absolute().parent.is_dir():
        raise InputError("file", str(target), f"there is no folder {target.parent}")
    if target.exists() and Path(source).exists() and target.samefile(source):
        raise InputError("file", str(target), "this is the file being read; choose another name")
    target_format.check_libraries(str(target))
    result = read_any(source, columns=columns, units=units, scales=scales, period=period, **options)
    return ImportResult(result.recording, [*result.remarks, *write(result.recording, target)])
