"""Files of MATLAB, LabVIEW (TDMS) and Parquet, each with a line of JSON from which it reads back exactly; and of others.

MATLAB files are written as version 5, and read as version 5 and 7.3. Written are ``time``, a column per channel under a
name that MATLAB allows, the struct ``units`` with the unit of each, and ``mckibben``, a line of JSON with names, kinds,
meanings and meta. Of another program's file vectors are read, nested structs too; a struct ``units`` in it says units.

Of a TDMS file written are a group ``recording`` with the channel ``time`` and one of each channel's name, with the
properties ``unit_string``, ``description`` and ``kind``, and at the root title and ``mckibben``, a line of JSON with the
metadata.

A Parquet file has a column ``name [unit]`` per channel after ``time [s]``, and a line of JSON in the file's metadata.
Spreadsheets, and the recordings of physiology (EDF, BDF), motion capture (C3D) and vehicles (MDF), are only read.
"""

from __future__ import annotations

import logging
import os
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import ErrorKeepingFile, JsonValue
from ..errors import InputError
from ..extras import library
from ..isolation import check_unpacked
from .labels import time_column
from .sidecar import KEY, dumps, loads, one_line, unreadable
from .store import check_self_contained
from .table import FileFormat, ForeignColumn, ForeignTable, Samples, StoredRecording, si_of
from .text import TEXT_OPTIONS, Rows, mostly_numbers, plain_names, read_text_table, said_of, table_of_rows, with_points

_LARGEST = 2**31 - 1  # [B] of a variable of version 5
_KEYWORDS = frozenset(
    "break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd"
    " switch try while".split()
)
# Compressed variables have a checksum.
_KEPT: dict[str, Any] = {"long_field_names": True, "do_compression": True}
_PLAIN, _COMPRESSED = 14, 15  # types of variables
_BLOCK = 1 << 20  # [B]
_DEEPEST = 20  # structs in structs


def write_matlab(recording: Samples, path: Path) -> list[str]:
    """Write a ``.mat`` file of version 5; a remark states which names MATLAB would not permit."""
    from scipy.io import savemat

    if len(recording.time) * 8 > _LARGEST:
        allowed = f"a MATLAB file of version 5 holds {_LARGEST // 8}; take netCDF, which MATLAB reads too"
        raise InputError("samples", len(recording.time), allowed, where=str(path))
    names = matlab_names(recording.channels)
    channels = dict(zip(names, recording.channels.values(), strict=True))
    columns = {plain: channel.values for plain, channel in channels.items()}
    units = {plain: channel.unit for plain, channel in channels.items()}
    more = {"units": {"time": "s", **units}, KEY: dumps(recording.channels, recording.meta)}
    savemat(path, {"time": recording.time, **columns, **more}, appendmat=False, oned_as="column", **_KEPT)
    renamed = [(name, plain) for name, plain in zip(recording.channels, names, strict=True) if name != plain]
    if not renamed:
        return []
    name, plain = renamed[0]
    example = f"such as {plain} for {name}; mckibben reads the names as they were"
    return [f"{len(renamed)} names are written as MATLAB allows them, {example}"]


def matlab_names(names: Iterable[str]) -> list[str]:
    """Names of channels as MATLAB allows them, none taken twice."""
    reserved = ["time", "units", KEY]
    return plain_names([*reserved, *names], _allowed)[len(reserved) :]


def _allowed(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return f"x{plain}" if plain in _KEYWORDS else plain


def read_matlab(path: Path) -> StoredRecording | ForeignTable:
    """Read a recording of mckibben, or of another program's file the vectors, with small values for the metadata.

    Raises:
        InputError: the file cannot be read, or a newer version wrote it.
    """
    where = str(path)
    library("pymatreader", "MATLAB files need", where=where)
    with unreadable("a MATLAB file", where):
        _check_structure(path)
        variables, warned = content(path)
    remarks = list(dict.fromkeys(warned))
    line = variables.get(KEY)
    if isinstance(line, str) and line.startswith("{"):
        sidecar = loads(line, where)
        # the reader makes one number of an array of one
        numbers = {k: np.atleast_1d(v) for k, v in variables.items() if isinstance(v, np.ndarray | int | float)}
        return sidecar.from_columns(numbers, "time", matlab_names(sidecar.channels), where)
    units = variables.get("units")
    words = {k: v for k, v in units.items() if isinstance(v, str)} if isinstance(units, Mapping) else {}
    columns: list[ForeignColumn] = []
    notes: dict[str, Any] = {}
    for label, value in _leaves({k: v for k, v in sorted(variables.items()) if k != "units" or not words}, "", 0):
        if isinstance(value, Mapping):
            columns += _logged(label, value)
            continue
        array = _array(value)
        if array is not None and array.ndim == 2 and 1 < min(array.shape) <= min(MOST_ROWS, max(array.shape) // 2):
            columns += _matrix(label, array if array.shape[0] >= array.shape[1] else array.T)
            if columns[-1].clock.endswith("evenly"):
                remarks.append(f"the first row or column of {label} rises evenly, and is taken as the time in s")
        elif array is not None and array.ndim and array.size > 1:
            unit = words.get(label, words.get(label.rpartition(".")[2]))
            columns.append(ForeignColumn(label, array, unit, f"{len(array)} samples"))
        elif isinstance(value, str | int | float | bool | np.number | np.bool_):
            notes[label] = value.item() if isinstance(value, np.generic) else value
    return ForeignTable(columns, {"values": {k.replace("$", "_"): v for k, v in notes.items()}}, remarks)


MOST_ROWS = 64  # columns of a matrix that are channels; more are a picture or a table of another kind


def _array(value: Any) -> np.ndarray | None:
    if not isinstance(value, np.ndarray | list):
        return None
    try:
        return np.asarray(value)
    except ValueError:  # rows of unequal lengths
        return None


def _matrix(label: str, array: np.ndarray) -> list[ForeignColumn]:
    """Columns of a matrix (n, k); where the first rises evenly, it is the time, as To File of Simulink writes it."""
    steps = np.diff(array[:, 0]) if array.dtype.kind in "fiu" else np.zeros(1)
    timed = bool(len(steps) > 1 and steps.min() > 0.0 and np.ptp(steps) <= 1e-3 * steps.mean())
    clock = f"{len(array)} samples" + (", evenly" if timed else "")
    first = [ForeignColumn(f"{label}_time", array[:, 0], "s", clock)] if timed else []
    return [
        *first,
        *(ForeignColumn(f"{label}_{at + 1}", array[:, at], None, clock) for at in range(int(timed), array.shape[1])),
    ]


def _is_logged(value: Mapping[str, Any]) -> bool:
    """Whether a struct is a Structure With Time of Simulink, or a record of dSPACE's ControlDesk."""
    return {"time", "signals"} <= {*value} or (
        isinstance(value.get("X"), Mapping | list) and isinstance(value.get("Y"), Mapping | list)
    )


def _structs(value: Any) -> list[dict[str, Any]]:
    """An array of structs as a list, whether the reader gives a list of structs or a struct of lists."""
    if isinstance(value, list):
        return [dict(one) for one in value if isinstance(one, Mapping)]
    several = [v for k, v in value.items() if k in ("label", "Name") and isinstance(v, list)]
    several = several or [v for k, v in value.items() if k in ("values", "Data") and isinstance(v, list)]
    if not several:
        return [dict(value)]
    count = len(several[0])
    return [
        {k: v[i] if len(v) == count else v for k, v in value.items() if hasattr(v, "__len__")} for i in range(count)
    ]


def _logged(label: str, value: Mapping[str, Any]) -> list[ForeignColumn]:
    """Columns of a Structure With Time, or of a record of ControlDesk, whose signals each have an axis of times."""
    columns: list[ForeignColumn] = []
    if "signals" in value:
        time = np.ravel(np.asarray(value["time"], float))
        columns.append(ForeignColumn(f"{label}.time", time, "s", f"{len(time)} samples"))
        for count, signal in enumerate(_structs(value["signals"]), 1):
            values = np.asarray(signal.get("values"), float)
            name = signal.get("label")
            name = name.strip() if isinstance(name, str) and name.strip() else f"signal {count}"
            values = values.reshape(len(time), -1) if values.size % max(len(time), 1) == 0 else values[:, None]
            names = [name] if values.shape[1] == 1 else [f"{name} {at}" for at in range(1, values.shape[1] + 1)]
            columns += [
                ForeignColumn(f"{label}.{one}", values[:, at], None, f"{len(values)} samples")
                for at, one in enumerate(names)
            ]
        return columns
    axes = _structs(value["X"])
    for signal in _structs(value["Y"]):
        values = np.ravel(np.asarray(signal["Data"], float))
        axis = np.ravel(np.asarray(axes[int(np.ravel(signal.get("XIndex", 1))[0]) - 1]["Data"], float))
        # "Model Root"/Pressure/Out1: the name of the block says what it is.
        parts = [part for part in str(signal.get("Name", "")).replace('"', "").split("/") if part]
        name = next(
            (part for part in reversed(parts) if not re.fullmatch(r"Out\d*|In\d*|Value", part)),
            f"signal {len(columns)}",
        )
        unit = signal.get("Unit")
        columns.append(
            ForeignColumn(
                f"{label}.{name}",
                values,
                unit if isinstance(unit, str) and unit else None,
                f"{len(axis)} samples",
                axis,
            )
        )
    return columns


def content(path: str | Path) -> tuple[dict[str, JsonValue], list[str]]:
    """The variables of a file, and the reader's warnings."""
    import pymatreader

    check_self_contained(path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            variables = pymatreader.read_mat(path)
        except ValueError:  # it cannot hold signals of unequal widths in one array
            from scipy.io import loadmat

            loaded = loadmat(path, struct_as_record=False, squeeze_me=True)
            variables = {name: _unpacked(value) for name, value in loaded.items() if not name.startswith("__")}
    return variables, [one_line(w.message) for w in caught if isinstance(w.message, Warning)]


def _unpacked(value: Any) -> Any:
    """What scipy reads of a variable as mappings, lists and arrays."""
    names = getattr(value, "_fieldnames", None)
    if names is not None:
        return {name: _unpacked(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [_unpacked(one) for one in value.ravel()]
    return value


def _check_structure(path: Path) -> None:
    """Refuse a file of version 5 with a variable whose length or checksum is wrong; scipy may crash on it."""
    with open(path, "rb") as stream:
        head, size = stream.read(520), os.fstat(stream.fileno()).st_size
        if head[512:] == b"\x89HDF\r\n\x1a\n":
            return
        if head[124:128] != b"\x00\x01IM":
            # version 4 begins with a small number, and 5 may come from a machine with the other order of bytes
            if len(head) < 20 or not (0 in head[:4] or head[124:128] == b"\x01\x00MI"):
                raise ValueError("its head is none of version 4, 5 or 7.3")
            return
        at = 128
        while at < size:
            stream.seek(at)
            kind, length = struct.unpack("<II", stream.read(8))
            if kind not in (_PLAIN, _COMPRESSED) or at + 8 + length > size:
                raise ValueError("a variable is damaged or cut off")
            if kind == _PLAIN:
                return
            unpacker, left = zlib.decompressobj(), length
            while left:
                block = stream.read(min(left, _BLOCK))
                left -= len(block)
                while block:
                    unpacker.decompress(block, _BLOCK)
                    block = unpacker.unconsumed_tail
            if not unpacker.eof:
                raise ValueError("a variable is cut off")
            at += 8 + length


def _leaves(tree: Mapping[str, JsonValue], before: str, depth: int) -> list[tuple[str, Any]]:
    """All values that are no structs, under their dotted names."""
    leaves: list[tuple[str, Any]] = []
    for key, value in tree.items():
        if key.startswith("__"):
            continue
        if isinstance(value, Mapping) and depth < _DEEPEST and not _is_logged(value):
            leaves += _leaves(dict(sorted(_end_to_end(value).items())), f"{before}{key}.", depth + 1)
        else:
            leaves.append((f"{before}{key}", value))
    return leaves


def _end_to_end(value: Mapping[str, Any]) -> Mapping[str, Any]:
    """An array of structs, such as one for each trial, as one: vectors one after another, numbers with each sample."""
    columns = {k: [np.ravel(one) for one in v] for k, v in value.items() if isinstance(v, list)}
    numbers = {k: v for k, v in columns.items() if all(one.dtype.kind in "fiub" for one in v)}
    counts = {len(v) for v in columns.values()}
    if len(counts) != 1 or counts == {1} or len(numbers) < 2:
        return value
    sizes = [max(len(one) for one in several) for several in zip(*numbers.values(), strict=True)]
    if any(len(one) not in (1, n) for v in numbers.values() for one, n in zip(v, sizes, strict=True)) or max(sizes) < 2:
        return value
    repeated = {k: [np.resize(one, n) for one, n in zip(v, sizes, strict=True)] for k, v in numbers.items()}
    return {**value, **{k: np.concatenate(v) for k, v in repeated.items()}}


MATLAB = FileFormat(title="MATLAB files", read=read_matlab, write=write_matlab)


GROUP = "recording"
# Where LabVIEW, DAQmx and DIAdem say the unit of a channel.
_UNITS = ("unit_string", "NI_UnitDescription", "NI_ChannelUnit", "unit")


def write_tdms(recording: Samples, path: Path) -> list[str]:
    """Write a ``.tdms`` file."""
    nptdms = library("nptdms", "TDMS files need", where=str(path))
    root = {KEY: dumps(recording.channels, recording.meta)}
    title = recording.meta.get("title")
    if isinstance(title, str) and title:
        root["title"] = title
    parts = [
        nptdms.RootObject(root),
        nptdms.GroupObject(GROUP, {}),
        nptdms.ChannelObject(GROUP, "time", recording.time, {"unit_string": "s"}),
    ]
    for name, c in recording.channels.items():
        properties = {"unit_string": c.unit, "kind": c.kind, "description": c.meaning or name}
        parts.append(nptdms.ChannelObject(GROUP, name, c.values, properties))
    # A stream, for of a path the library would make an index file of the same name beside it.
    with open(path, "wb") as stream, nptdms.TdmsWriter(stream) as writer:
        writer.write_segment(parts)
    return []


def read_tdms(path: Path) -> StoredRecording | ForeignTable:
    """Read a recording of mckibben, or of another program's file the channels, with its properties for the metadata.

    Raises:
        InputError: the file cannot be read, or a newer version wrote it.
    """
    where = str(path)
    nptdms = library("nptdms", "TDMS files need", where=where)
    with unreadable("a TDMS file", where):
        with open(path, "rb") as stream, _library_log("nptdms") as logged:
            file = nptdms.TdmsFile.read(stream)
        line = file.properties.get(KEY)
        if isinstance(line, str):
            columns = {channel.name: np.asarray(channel[:]) for channel in file[GROUP].channels()}
        else:
            starts = [c.properties.get("wf_start_time") for group in file.groups() for c in group.channels()]
            known = [start.astype("datetime64[ns]") for start in starts if isinstance(start, np.datetime64)]
            # Start times are one clock only where all channels have one.
            begun = min(known) if known and len(known) == len(starts) else None
            groups = [_group(group, bool(logged), begun) for group in file.groups()]
            if len(groups) > 1:
                groups = [_own_times(columns) for columns in groups]
            foreign = [column for columns in groups for column in columns]
            properties = {str(k).replace("$", "_"): _plain(v) for k, v in file.properties.items()}
    if isinstance(line, str):
        if logged:
            raise InputError("file", None, f"is damaged or cut off ({logged[0]})", where=where)
        sidecar = loads(line, where)
        return sidecar.from_columns(columns, "time", list(sidecar.channels), where)
    return ForeignTable(foreign, {"properties": properties}, list(dict.fromkeys(logged)))


@contextmanager
def _library_log(package: str) -> Iterator[list[str]]:
    """Catch what the library writes to its log while it reads, as lines; it would print them."""
    lines: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: lines.append(record.getMessage()[:200])  # type: ignore[method-assign]
    # Each module of a library may have a log of its own, and the one above them none.
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == package]
    logs = [logging.getLogger(name) for name in names]
    before = [log.handlers for log in logs]
    for log in logs:
        log.handlers = [handler]
    try:
        yield lines
    finally:
        for log, handlers in zip(logs, before, strict=True):
            log.handlers = handlers


def _group(group: Any, cut_off: bool, begun: np.datetime64 | None) -> list[ForeignColumn]:
    """Channels of a group; of a truncated file, as many samples as all of them have."""
    columns = {channel.name: np.asarray(channel[:]) for channel in group.channels()}
    most = min(map(len, columns.values()), default=0) if cut_off else None
    return [_column(group.name, channel, columns[channel.name][:most], begun) for channel in group.channels()]


def _column(group: str, channel: Any, values: np.ndarray, begun: np.datetime64 | None) -> ForeignColumn:
    properties = channel.properties
    unit = next((str(properties[key]) for key in _UNITS if properties.get(key)), None)
    step, offset, start = (properties.get(f"wf_{key}") for key in ("increment", "start_offset", "start_time"))
    time, clock = None, f"{len(values)} samples"
    if isinstance(step, float) and step > 0.0 and np.isfinite(step):
        begin = float(offset or 0.0)
        if begun is not None and isinstance(start, np.datetime64):
            begin += (start.astype("datetime64[ns]") - begun).astype("int64") * 1e-9
        time = begin + step * np.arange(len(values))
        clock += f" every {step:g} s from {begin:g} s"
    return ForeignColumn(f"{group}.{channel.name}", values, unit, clock, time)


def _own_times(columns: list[ForeignColumn]) -> list[ForeignColumn]:
    """The channels of a group that has a channel of times: these are theirs, and each group is a clock of its own."""
    at = time_column([column.label.rpartition(".")[2] for column in columns])
    if at is None or any(column.time is not None for column in columns):
        return columns
    stamps = columns[at].values
    if stamps.dtype.kind not in "fiu" or len(stamps) < 2 or not (np.diff(stamps) > 0).all():
        return columns
    time = stamps * si_of(columns[at].unit or "s", field="unit of time")[1]
    group = columns[at].label.rpartition(".")[0]
    return [
        c._replace(time=time, clock=f"{c.clock} of {group}")
        for i, c in enumerate(columns) if i != at and len(c.values) == len(time)
    ]  # fmt: skip


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic) and value.dtype.kind in "fiub":
        return value.item()
    return value if isinstance(value, str | int | float | bool) else str(value)


TDMS = FileFormat(title="TDMS files", read=read_tdms, write=write_tdms, requires="nptdms")


def write_parquet(recording: Samples, path: Path) -> list[str]:
    """Write a ``.parquet`` file."""
    polars = library("polars", "Parquet files need", where=str(path))
    columns = {f"{name} [{c.unit}]": c.values for name, c in recording.channels.items()}
    table = polars.DataFrame({"time [s]": recording.time, **columns})
    with ErrorKeepingFile(path) as stream:
        table.write_parquet(stream, metadata={KEY: dumps(recording.channels, recording.meta)})
    return []


def read_parquet(path: Path) -> StoredRecording | ForeignTable:
    """Read a recording of mckibben, or the columns of another program's table.

    Raises:
        InputError: the file cannot be read, or a newer version wrote it.
    """
    where = str(path)
    polars = library("polars", "Parquet files need", where=where)
    with unreadable("a Parquet file", where):
        line = polars.read_parquet_metadata(path).get(KEY)
        table = polars.read_parquet(path, glob=False)
        columns = {name: np.asarray(table[name].to_numpy()) for name in table.columns}
    if line is None:
        return ForeignTable([ForeignColumn(n, values, None, f"{len(values)} samples") for n, values in columns.items()])
    sidecar = loads(line, where)
    names = [f"{name} [{c.unit}]" for name, c in sidecar.channels.items()]
    return sidecar.from_columns(columns, "time [s]", names, where)


PARQUET = FileFormat(title="Parquet files", read=read_parquet, write=write_parquet, requires="polars")


def read_spreadsheet(
    path: Path, sheet: str | int | None = None, decimal: str | None = None, header: str | Sequence[str] | None = None
) -> ForeignTable:
    """Read the cells of a sheet as a table.

    Args:
        path: the file.
        sheet: name, or number from 1; by default the only one with rows of numbers. A range of cells of it, such as
            ``Data!B4:E60``, or ``B4:E60`` of the only one, leaves out what stands around.
        decimal: decimal mark of numbers that are texts in the sheet.
        header: names of the columns with their units, see `table_of_rows`.

    Raises:
        InputError: the file cannot be read, there is no such sheet, or several have cells and none is named.
    """
    where = str(path)
    calamine = library("python_calamine", "Spreadsheets need", where=where)
    cells = _CELLS.fullmatch(sheet) if isinstance(sheet, str) else None
    with open(path, "rb") as stream:
        begun = stream.read(4)
    if sheet is None and path.suffix.lower() == ".xls" and begun.isascii() and begun[:2] != b"PK":
        # LabVIEW and others give text this name, so that Excel opens it; a sheet begins with bytes that no text has
        table = read_text_table(path, decimal=decimal, header=header)
        return table._replace(remarks=["the file is a text, and no sheet", *table.remarks])
    with unreadable("a spreadsheet", where):
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as packed:
                check_unpacked(0.25 * sum(one.file_size for one in packed.infolist()))  # most of it is tags
        book = calamine.CalamineWorkbook.from_path(where)
        names = list(book.sheet_names)
        asked = _asked(names, cells["sheet"] if cells and sheet not in names else sheet, where)
        filled = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in asked}
    if cells and sheet not in names:
        filled = {name: _inside(rows, cells, where) for name, rows in filled.items()}
    tables = {name: _texts_with_points(rows, decimal, where) for name, rows in filled.items()}
    tables = {
        name: [(i, row) for i, row in rows if any(row) and not row[0].startswith("#")] for name, rows in tables.items()
    }
    tables = {name: rows for name, rows in tables.items() if rows}
    remarks: list[str] = []
    if len(tables) > 1:
        measured = {name: rows for name, rows in tables.items() if any(mostly_numbers(row) for _, row in rows)}
        if len(measured) == 1:
            remarks = [
                f"sheet {name} is left out: it has no rows of numbers" for name in tables if name not in measured
            ]
            tables = measured
    if len(tables) > 1:
        problem = f"the sheets {', '.join(tables)} have tables; say which one is meant"
        raise InputError("sheet", ", ".join(tables), problem, sentence=problem, where=where, remedy="sheet")
    if not tables:
        raise InputError("file", None, "is empty", where=where)
    ((name, rows),) = tables.items()
    # columns at the left and right in which all cells are blank are no part of the table
    used = [i for i in range(len(rows[0][1])) if any(row[i] for _, row in rows)]
    rows = [(n, row[used[0] : used[-1] + 1]) for n, row in rows]
    table = table_of_rows(rows, where, decimal=".", header=header)
    return table._replace(notes={**table.notes, "sheet": name}, remarks=[*remarks, *table.remarks])


_CELLS = re.compile(r"(?:'?(?P<sheet>[^!]+?)'?!)?\$?([A-Za-z]{1,3})\$?(\d+):\$?([A-Za-z]{1,3})\$?(\d+)")


def _inside(rows: Sequence[Sequence[Any]], cells: re.Match[str], where: str) -> list[list[Any]]:
    """The cells of a sheet with those outside of a range blank, so that rows keep their numbers."""
    left, right = (
        sum((ord(c) - 64) * 26**i for i, c in enumerate(reversed(cells[k].upper()))) for k in (2, 4)
    )  # columns from 1
    top, bottom = int(cells[3]), int(cells[5])
    kept = [
        [cell if top <= i <= bottom and left <= j <= right else "" for j, cell in enumerate(row, 1)]
        for i, row in enumerate(rows, 1)
    ]
    if not any(cell not in ("", None) for row in kept for cell in row):
        raise InputError("sheet", cells[0], "must be a range that holds cells, such as 'Data!B4:E60'", where=where)
    return kept


def sheet_names(path: Path) -> list[str]:
    """Names of the sheets that have cells."""
    where = str(path)
    calamine = library("python_calamine", "Spreadsheets need", where=where)
    with unreadable("a spreadsheet", where):
        book = calamine.CalamineWorkbook.from_path(where)
        return [name for name in book.sheet_names if book.get_sheet_by_name(name).to_python(nrows=1)]


def _asked(names: list[str], sheet: str | int | None, where: str) -> list[str]:
    if sheet is None:
        return names
    if isinstance(sheet, int) or (sheet.isdecimal() and sheet not in names):
        if 1 <= int(sheet) <= len(names):
            return [names[int(sheet) - 1]]
        raise InputError("sheet", int(sheet), f"must be between 1 and {len(names)}", where=where)
    if sheet not in names:
        raise InputError("sheet", sheet, known=names, where=where)
    return [sheet]


def _texts_with_points(rows: Sequence[Sequence[object]], decimal: str | None, where: str) -> Rows:
    """The rows of a sheet as texts; numbers that are texts in the sheet have one decimal mark, which may be a comma."""
    texts = [[cell if isinstance(cell, str) else "" for cell in column] for column in zip(*rows, strict=True)]
    labels = [f"column {at}" for at in range(1, len(texts) + 1)]
    plain, _ = with_points(texts, range(1, len(rows) + 1), labels, decimal, where)
    return [
        (i, [_cell_text(text if isinstance(cell, str) else cell) for cell, text in zip(row, changed, strict=True)])
        for i, (row, changed) in enumerate(zip(rows, zip(*plain, strict=True), strict=False), 1)
    ]


def _cell_text(cell: object) -> str:
    if isinstance(cell, float):
        return repr(int(cell)) if cell.is_integer() and abs(cell) < 1e15 else repr(cell)
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, datetime | date | time):
        return cell.isoformat(sep=" ") if isinstance(cell, datetime) else cell.isoformat()
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    return str(cell).strip()


SPREADSHEETS = FileFormat(
    title="Spreadsheets", read=read_spreadsheet, options=("sheet", *TEXT_OPTIONS), parts=sheet_names
)


def read_edf(path: Path) -> ForeignTable:
    """Read the signals of physiology, each with its unit and rate, and the annotations; not the name of the person.

    Raises:
        InputError: the file cannot be read, or was interrupted.
    """
    where = str(path)
    edfio = library("edfio", "EDF files need", where=where)
    with unreadable("an EDF file", where):
        file = (edfio.read_bdf if path.suffix.lower() == ".bdf" else edfio.read_edf)(path, header_encoding="latin-1")
        signals = [(one.label, one.data, one.physical_dimension, one.sampling_frequency) for one in file.signals]
        whole, events = file.is_continuous, [{"time": one.onset, "text": one.text} for one in file.annotations]
    if not whole:
        problem = "its recording was interrupted (EDF+D); export it as continuous EDF, a file for each part"
        raise InputError("file", None, sentence=problem, where=where)
    return ForeignTable([_sampled(*signal) for signal in signals], {"events": events} if events else {})


def _sampled(label: str, values: np.ndarray, unit: str | None, rate: float) -> ForeignColumn:
    """A column of samples at a rate [Hz], without times where the file states none."""
    time = np.arange(len(values)) / rate if rate > 0.0 else None
    return ForeignColumn(label, values, unit or None, f"{len(values)} samples at {rate:g} Hz", time)


EDF = FileFormat(title="EDF files", read=read_edf)


def read_c3d(path: Path) -> ForeignTable:
    """Read the points of a motion capture, three coordinates each, and the analogue channels, on a clock of their own.

    Raises:
        InputError: the file cannot be read.
    """
    where = str(path)
    ezc3d = library("ezc3d", "C3D files need", where=where)
    with unreadable("a C3D file", where):
        file = ezc3d.c3d(where)
        data, stated = file["data"], file["parameters"]
        columns = []
        for group, samples in (("POINT", data["points"][:3]), ("ANALOG", data["analogs"])):
            said = {name: list(one["value"]) for name, one in stated.get(group, {}).items() if name[:2] != "__"}
            labels = [label for name in ("LABELS", "LABELS2", "LABELS3") for label in said.get(name, [])]
            units, rate = said.get("UNITS", []), float((said.get("RATE") or [0.0])[0])
            for at in range(samples.shape[1]):
                label = labels[at] if at < len(labels) and labels[at] else f"{group.lower()} {at + 1}"
                unit = units[at] if at < len(units) else units[0] if units and group == "POINT" else None
                for axis, along in zip(".x .y .z".split() if group == "POINT" else [""], samples[:, at], strict=True):
                    columns.append(_sampled(f"{label}{axis}", along, unit, rate))
    return ForeignTable(columns)


C3D = FileFormat(title="C3D files", read=read_c3d)


def read_mdf(path: Path) -> ForeignTable:
    """Read the channels of numbers of a measurement of vehicles (``.mf4``, ``.mdf``), each group on its own clock.

    Raises:
        InputError: the file cannot be read.
    """
    where = str(path)
    asammdf = library("asammdf", "MDF files need", instead="export it as CSV or MATLAB from its program", where=where)
    columns, words = [], []
    with unreadable("an MDF file", where), _library_log("asammdf") as logged, asammdf.MDF(path) as file:
        for signal in file.iter_channels(skip_master=True, copy_master=False):
            at, values = signal.group_index, signal.samples
            # a group without a name is told from others by its number
            group = file.groups[at].channel_group.acq_name or f"group {at + 1}"
            label = f"{group}.{signal.name}" if len(file.groups) > 1 else signal.name
            if values.ndim != 1 or values.dtype.kind not in "fiub":
                words.append(label)
            elif len(values):
                clock = f"{len(values)} samples of {group}"
                columns.append(ForeignColumn(label, values, signal.unit or None, clock, signal.timestamps))
    remarks = said_of(words, "left out: a sample is not one number")
    return ForeignTable(columns, {}, [*remarks, *dict.fromkeys(logged)])


MDF = FileFormat(title="MDF files", read=read_mdf)
