"""The two formats of mckibben: netCDF for work, CSV for other programs; and HDF5 of other programs.

Recordings come back from both exactly as they were saved.

netCDF: a coordinate ``time`` [s], one variable per channel with the attributes ``units``, ``long_name`` and ``kind``, and
the global attributes ``schema`` and ``meta`` (JSON); at its end a seal, which other programs do not see. CSV: the lines
``# schema: 1``, ``# channels: {..}`` (kind and meaning) and ``# meta: {..}``, each JSON in one line, then the header
``time [s],tank.pressure [Pa],..`` and the numbers in the shortest form that reads back exactly.

The seal of a netCDF file is a digest of all before it, which HDF5 does not look at: a file whose seal is whole is as it
was written, unless somebody forged it. It is no reason to trust a file: whatever HDF5 parses, it parses in a process that
may be ended.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..documents import ErrorKeepingFile
from ..errors import InputError
from .labels import time_column
from .sidecar import SCHEMA, check_schema, file_attributes, one_line, parse, to_json, unreadable
from .table import Channel, FileFormat, ForeignColumn, ForeignTable, Samples, StoredRecording, channel_attributes, si_of
from .text import TEXT_OPTIONS, read_text_table

BROKEN_SEAL = "The file is not as it was written: it is damaged, or another program changed it."
CSV_HEAD = "# mckibben recording"


class Variable(NamedTuple):
    """A variable of a netCDF file: names of its dimensions, its numbers, and its attributes."""

    dims: tuple[str, ...]
    values: np.ndarray
    attrs: dict[str, Any]


class NetCDF(NamedTuple):
    """Content of a netCDF file."""

    variables: dict[str, Variable]
    attrs: dict[str, Any]


UNITS = ("units", "unit", "Units", "Unit")  # attributes that state a unit


class Dataset(NamedTuple):
    """A data set of an HDF5 file: path in the file, values, attributes in words, and those of its group."""

    name: str
    values: np.ndarray
    attrs: dict[str, str]
    around: dict[str, str]


def content(path: str | Path) -> tuple[list[Dataset], dict[str, str]]:
    """The data sets of a file, and the attributes of its root."""
    import h5py

    check_self_contained(path)
    sets: list[Dataset] = []
    with h5py.File(path, "r") as file:

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiubV" and item.ndim:
                sets.append(Dataset(name, item[...], _words(item.attrs), _words(item.parent.attrs)))

        file.visititems(visit)
        return sets, _words(file.attrs)


def _words(attrs: Any) -> dict[str, str]:
    return {str(k): v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v)[:200] for k, v in attrs.items()}


def read_hdf5(path: Path) -> ForeignTable:
    """Read the rows of numbers of a file; groups become the first words of the labels.

    Raises:
        InputError: the file cannot be read, or takes its numbers from other files.
    """
    with unreadable("an HDF5 file", str(path)):
        sets, attributes = content(path)
    columns: list[ForeignColumn] = []
    remarks: list[str] = []
    rates: list[str] = []
    for one in sets:
        label = one.name.replace("/", ".")
        unit = next((one.attrs[key] for key in UNITS if one.attrs.get(key)), None)
        clock = f"{one.name.rpartition('/')[0]} {len(one.values)} samples".strip()
        if one.values.dtype.names:
            fields = [f for f in one.values.dtype.names if one.values.dtype[f].kind in "fiub" and one.values.ndim == 1]
            columns += [ForeignColumn(f"{label}.{f}", one.values[f], None, clock) for f in fields]
        elif one.values.ndim == 1 or (one.values.ndim == 2 and 1 in one.values.shape):
            clock = clock.replace(f" {len(one.values)} ", f" {one.values.size} ")
            step, said = _interval(attributes | one.around | one.attrs)
            time = None if step is None else step * np.arange(one.values.size)
            clock += "" if step is None else f" every {step:g} s"
            rates += [said] if said and said not in rates else []
            columns.append(ForeignColumn(label, one.values.ravel(), unit, clock, time))
        else:
            shape = " x ".join(map(str, one.values.shape))
            remarks.append(f"{label} is left out: its shape is {shape}, and a channel is one row of numbers")
    timed = time_column([column.label.rpartition(".")[2] for column in columns]) is not None
    return ForeignTable(columns, {"attributes": attributes} if attributes else {}, remarks + ([] if timed else rates))


def _interval(attrs: Mapping[str, str]) -> tuple[float | None, str]:
    """Interval of the samples [s] by an attribute for their rate or interval, and its sentence; None where none says it."""
    for known, units, power in ((RATES, ("Hz", "1/s"), -1.0), (INTERVALS, ("s",), 1.0)):
        for key, value in attrs.items():
            if re.sub(r"[\W_]", "", key).lower() in known:
                with contextlib.suppress(ValueError, ZeroDivisionError, InputError):
                    number, _, unit = value.strip("[] ").partition(" ")
                    kind, scale, _ = si_of(unit or units[0], field=key)
                    step: float = (float(number) * scale) ** power
                    if kind in units and np.isfinite(step) and step > 0.0:
                        return step, f"samples are {step:g} s apart, by the attribute {key} ({value})"
    return None, ""


RATES = ("samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "fs")
INTERVALS = ("sampleinterval", "samplinginterval", "sampleperiod", "samplingperiod", "wfincrement", "dt")
SEAL = b"\nmckibben-seal:"
SEAL_DIGEST = 32  # [B]
SEAL_BLOCK = 1 << 20


def seal(path: Path) -> None:
    """Append a seal to a file."""
    digest = _digest(path, os.path.getsize(path))
    with open(path, "ab") as stream:
        stream.write(SEAL + digest)


def sealed(path: Path) -> bool | None:
    """Whether a file is as it was when its seal was put; None if it has none."""
    size = os.path.getsize(path) - SEAL_DIGEST - len(SEAL)
    if size < 0:
        return None
    with open(path, "rb") as stream:
        stream.seek(size)
        end = stream.read()
    return end[len(SEAL) :] == _digest(path, size) if end.startswith(SEAL) else None


def check_self_contained(path: str | os.PathLike[str]) -> None:
    """Refuse an HDF5 file with links to other files.

    Raises:
        ValueError: names the variable.
    """
    import h5py

    if not h5py.is_hdf5(path):
        return
    with h5py.File(path, "r") as file:
        groups, known = [file["/"]], set()
        while groups:
            group = groups.pop()
            for name in group:
                link = group.get(name, getlink=True)
                if isinstance(link, h5py.ExternalLink):
                    raise ValueError(f"{name} lies in another file, {link.filename}")
                if isinstance(link, h5py.SoftLink):
                    continue  # what it leads to is met, too
                item = group[name]
                if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
                    raise ValueError(f"the numbers of {name} lie in another file")
                address = h5py.h5o.get_info(item.id).addr
                if isinstance(item, h5py.Group) and address not in known:
                    known.add(address)
                    groups.append(item)


def _digest(path: Path, size: int) -> bytes:
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while size > 0 and (block := stream.read(min(SEAL_BLOCK, size))):
            digest.update(block)
            size -= len(block)
    return digest.digest()


def write_netcdf(recording: Samples, path: Path) -> list[str]:
    """Write a ``.nc`` file."""
    # Not by xarray, which takes two seconds to be there: a command that saves a recording would take twice as long.
    import h5netcdf

    with ErrorKeepingFile(path) as stream, h5netcdf.File(stream, "w") as file:
        file.dimensions = {"time": recording.time.size}
        file.attrs.update(file_attributes(recording.meta))
        time = file.create_variable("time", ("time",), data=recording.time)
        time.attrs.update({"units": "s", "long_name": "time"})
        for name, channel in recording.channels.items():
            variable = file.create_variable(name, ("time",), data=channel.values)
            variable.attrs.update(channel_attributes(name, channel))
    seal(path)
    return []


def loaded(path: str | Path) -> NetCDF:
    """A netCDF file as it is."""
    import h5netcdf

    check_self_contained(path)
    with h5netcdf.File(path, "r", decode_vlen_strings=True) as file:
        variables = {n: Variable(tuple(v.dimensions), v[...], dict(v.attrs)) for n, v in file.variables.items()}
        return NetCDF(variables, dict(file.attrs))


def read_netcdf(path: Path) -> StoredRecording | ForeignTable:
    """Read a ``.nc`` file, of mckibben or of another program; a broken seal is a warning in the metadata."""
    whole = sealed(path)
    with unreadable("a netCDF file"):
        file = loaded(path)
    if file.attrs.get("schema") is None and file.variables:
        return _foreign_netcdf(file)
    check_schema(file.attrs.get("schema"))
    meta = parse(file.attrs.get("meta"), "meta")
    channels: dict[str, Channel] = {}
    for name, variable in file.variables.items():
        if variable.dims != ("time",):
            raise InputError(f"variable {name}", None, f"must have the dimension time, got {variable.dims}")
        if name != "time":
            of = {key: str(variable.attrs.get(key, "")) for key in ("units", "kind", "long_name")}
            meaning = "" if of["long_name"] == name else of["long_name"]
            channels[str(name)] = Channel(variable.values, of["units"], of["kind"], meaning)
    if "time" not in file.variables:
        raise InputError("time", None, "is missing: a recording has the coordinate time")
    if whole is False:
        meta = {**meta, "warnings": [*meta.get("warnings", ()), BROKEN_SEAL]}
    return StoredRecording(file.variables["time"].values, channels, meta)


def _foreign_netcdf(file: NetCDF) -> ForeignTable:
    """The variables over one dimension of another program's file, with the unit that the attribute ``units`` states."""
    columns, remarks = [], []
    for name, variable in file.variables.items():
        if len(variable.dims) != 1 or variable.values.dtype.kind not in "fiub":
            remarks.append(f"{name} is left out: it is no row of numbers over one dimension")
            continue
        unit = str(variable.attrs.get("units", "")).partition(" since ")[0] or None
        columns.append(
            ForeignColumn(str(name), variable.values, {"seconds": "s"}.get(unit or "", unit), variable.dims[0])
        )
    notes = {str(key): str(value)[:200] for key, value in file.attrs.items() if isinstance(value, str | int | float)}
    return ForeignTable(columns, {"attributes": notes} if notes else {}, remarks)


def write_csv(recording: Samples, path: Path) -> list[str]:
    """Write a ``.csv`` file."""
    about = {name: {"kind": c.kind, "meaning": c.meaning} for name, c in recording.channels.items()}
    header = ["time [s]", *(f"{name} [{c.unit}]" for name, c in recording.channels.items())]
    table = np.stack([recording.time, *(c.values for c in recording.channels.values())], axis=1)
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(
            f"{CSV_HEAD}\n# schema: {SCHEMA}\n# channels: {to_json(about)}\n# meta: {to_json(recording.meta)}\n"
        )
        stream.write(",".join(header) + "\n")
        for row in table:
            # repr of a float is the shortest text that reads back to the same bits.
            stream.write(",".join(map(repr, row.tolist())) + "\n")
    return []


def is_recording_csv(path: Path) -> bool:
    """Whether a CSV file is a recording of mckibben, by its first line."""
    if path.suffix.lower() != ".csv":
        return False
    with open(path, "rb") as stream:
        return stream.readline(200).removeprefix(b"\xef\xbb\xbf").strip() == CSV_HEAD.encode()


def read_csv(path: Path, **stated: Any) -> StoredRecording | ForeignTable:
    """Read a ``.csv`` file: a recording that `write_csv` wrote, or a text table of another program as is `stated`."""
    if not is_recording_csv(path):
        return read_text_table(path, **stated)
    try:
        with open(path, encoding="utf-8-sig", newline="\n") as stream:
            head, header = _csv_head(stream)
            check_schema(parse(head.get("schema"), "schema"))
            table = _csv_numbers(stream, len(head) + 2, header)
    except UnicodeDecodeError as error:
        raise InputError("file", None, f"cannot be read as a CSV text file ({error})") from None
    if header[0] != "time [s]":
        raise InputError("header", header[0], "must be 'time [s]' first")
    about = parse(head.get("channels"), "channels")
    channels: dict[str, Channel] = {}
    for i, cell in enumerate(header[1:], 1):
        name, _, unit = cell.rpartition(" [")
        of = about.get(name) if isinstance(about, Mapping) else None
        if not isinstance(of, Mapping) or not unit.endswith("]"):
            raise InputError("header", cell, "must be 'name [unit]' with a name that the line '# channels' knows")
        channels[name] = Channel(table[:, i], unit[:-1], of.get("kind", ""), of.get("meaning", ""))
    return StoredRecording(table[:, 0], channels, parse(head.get("meta"), "meta"))


def _csv_head(stream: io.TextIOBase) -> tuple[dict[str, str], list[str]]:
    """Read the comment lines by their key, and the cells of the header; the stream is then at the numbers."""
    head: dict[str, str] = {}
    for number, line in enumerate(stream):
        line = line.rstrip("\r\n")
        if number == 0 and line != CSV_HEAD:
            allowed = f"a recording begins with {CSV_HEAD!r}; a table of others is converted into one first"
            raise InputError("first line", line[:60], allowed)
        if not line.startswith("#"):
            return head, next(csv.reader([line]), [""])
        key, _, text = line[2:].partition(": ")
        head[key] = text
    raise InputError("file", None, "has no numbers: it ends before them")


def _csv_numbers(stream: io.TextIOBase, before: int, header: list[str]) -> np.ndarray:
    first = stream.readline()
    if not first.strip():
        raise InputError("file", None, "must have at least one sample")
    try:
        rest = (line for lines in ((first,), stream) for line in lines)
        table = np.loadtxt(rest, delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        raise InputError(
            "numbers", None, f"cannot be read: {one_line(error)} after the {before} lines of the head"
        ) from None
    if table.shape[1] != len(header):
        raise InputError("numbers", None, f"must have {len(header)} columns, as the header has, got {table.shape[1]}")
    return table


NETCDF = FileFormat(title="netCDF files", read=read_netcdf, write=write_netcdf)
CSV = FileFormat(title="CSV files", read=read_csv, write=write_csv, options=TEXT_OPTIONS)
TEXT = FileFormat(title="Text files", read=read_text_table, options=TEXT_OPTIONS)
HDF5 = FileFormat(title="HDF5 files", read=read_hdf5)
