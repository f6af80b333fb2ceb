"""Recordings on disk: netCDF for work, CSV for other programs. Both give back exactly what was saved.

netCDF: a coordinate ``time`` [s], one variable per channel with the attributes ``units``, ``long_name`` and ``kind``, and
the global attributes ``schema`` and ``meta`` (JSON); at its end a seal, which other programs do not see. CSV: the lines
``# schema: 1``, ``# channels: {..}`` (kind and meaning) and ``# meta: {..}``, each JSON in one line, then the header
``time [s],tank.pressure [Pa],..`` and the numbers in the shortest form that reads back exactly.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..documents import ErrorKeepingFile, write_whole
from ..errors import InputError
from .meta import to_json
from .outside import check_self_contained, read_outside, seal, sealed
from .recording import Channel, Recording
from .sidecar import SCHEMA, check_schema, one_line, parsed

if TYPE_CHECKING:
    import xarray

BROKEN_SEAL = "The file is not as it was written: it is damaged, or another program changed it."
CSV_HEAD = "# mckibben recording"
# What h5py and h5netcdf raise on files that are no netCDF, or broken.
_BROKEN = (OSError, ValueError, KeyError, RuntimeError, TypeError, AttributeError)


def save(recording: Recording, path: str | Path) -> Path:
    """Write a recording; the suffix, ``.nc`` or ``.csv``, says how. A reader never meets half a file.

    Returns:
        The path written.

    Raises:
        InputError: the suffix is unknown, or the file cannot be written.
    """
    path = Path(path)
    write = _known(path, _WRITERS)
    return write_whole(path, lambda part: write(recording, part))


def read_recording(path: str | Path) -> Recording:
    """Read a recording: netCDF and CSV as `Recording.save` wrote them, or the live log of a bench (``.mcap``).

    What a log lost, because it was never closed or is damaged, stands in the meta's ``warnings``.

    Raises:
        InputError: there is no such file, it is no recording, or a newer version wrote it.
    """
    path = Path(path)
    read = _known(path, _READERS)
    if not path.is_file():
        raise InputError("file", str(path), "no such file")
    try:
        return read(path)
    except InputError as error:
        raise error if error.where else error.at(str(path)) from None


def as_dataset(recording: Recording) -> xarray.Dataset:
    """The recording as an xarray dataset: coordinate ``time`` [s], a variable per channel, the meta as attributes."""
    import xarray as xr

    file = _netcdf(recording)
    variables = {name: (v.dims, v.values, v.attrs) for name, v in file.variables.items()}
    return xr.Dataset(variables, coords={"time": variables.pop("time")}, attrs=file.attrs)


class Variable(NamedTuple):
    """A variable of a netCDF file: names of its dimensions, its numbers, and its attributes."""

    dims: tuple[str, ...]
    values: np.ndarray
    attrs: dict[str, Any]


class NetCDF(NamedTuple):
    """What a netCDF file has."""

    variables: dict[str, Variable]
    attrs: dict[str, Any]


def _netcdf(recording: Recording) -> NetCDF:
    """What a recording is as one."""
    variables = {"time": Variable(("time",), recording.time, {"units": "s", "long_name": "time"})}
    for name, c in recording.channels.items():
        variables[name] = Variable(
            ("time",), c.values, {"units": c.unit, "long_name": c.meaning or name, "kind": c.kind}
        )
    # Title and date once more in plain words, for whoever looks into the file with another program.
    plain = {key: recording.meta[key] for key in ("title", "created") if _is_line(recording.meta.get(key))}
    return NetCDF(variables, {**plain, "schema": SCHEMA, "meta": to_json(recording.meta)})


def _write_netcdf(recording: Recording, path: Path) -> None:
    # Not by xarray, which takes two seconds to be there: a command that saves a recording would take twice as long.
    import h5netcdf

    whole = _netcdf(recording)
    with ErrorKeepingFile(path) as stream, h5netcdf.File(stream, "w") as file:
        file.dimensions = {"time": recording.time.size}
        file.attrs.update(whole.attrs)
        for name, variable in whole.variables.items():
            made = file.create_variable(name, variable.dims, data=variable.values)
            made.attrs.update(variable.attrs)
    seal(path)


def loaded(path: str | Path) -> NetCDF:
    """A netCDF file as it is."""
    import h5netcdf

    check_self_contained(path)
    with h5netcdf.File(path, "r", decode_vlen_strings=True) as file:
        variables = {n: Variable(tuple(v.dimensions), v[...], dict(v.attrs)) for n, v in file.variables.items()}
        return NetCDF(variables, dict(file.attrs))


def _read_netcdf(path: Path) -> Recording:
    whole = sealed(path)
    try:
        file = loaded(path) if whole else read_outside(loaded, path)
    except _BROKEN as error:
        raise InputError("file", "unreadable", f"allowed is a netCDF file ({one_line(error)})") from None
    check_schema(file.attrs.get("schema"))
    meta = parsed(file.attrs.get("meta"), "meta")
    channels: dict[str, Channel] = {}
    for name, variable in file.variables.items():
        if variable.dims != ("time",):
            raise InputError(f"variable {name}", f"over {variable.dims}", "allowed is the dimension time")
        if name != "time":
            of = {key: str(variable.attrs.get(key, "")) for key in ("units", "kind", "long_name")}
            meaning = "" if of["long_name"] == name else of["long_name"]
            channels[str(name)] = Channel(variable.values, of["units"], of["kind"], meaning)
    if "time" not in file.variables:
        raise InputError("time", "no variable", "a recording has the coordinate time")
    if whole is False:
        meta = {**meta, "warnings": [*meta.get("warnings", ()), BROKEN_SEAL]}
    return Recording(file.variables["time"].values, channels, meta)


def _write_csv(recording: Recording, path: Path) -> None:
    told = {name: {"kind": c.kind, "meaning": c.meaning} for name, c in recording.channels.items()}
    header = ["time [s]", *(f"{name} [{c.unit}]" for name, c in recording.channels.items())]
    table = np.stack([recording.time, *(c.values for c in recording.channels.values())], axis=1)
    with open(path, "w", encoding="utf-8", newline="\n") as stream:
        stream.write(
            f"{CSV_HEAD}\n# schema: {SCHEMA}\n# channels: {to_json(told)}\n# meta: {to_json(recording.meta)}\n"
        )
        stream.write(",".join(header) + "\n")
        for row in table:
            # repr of a float is the shortest text that reads back to the same bits.
            stream.write(",".join(map(repr, row.tolist())) + "\n")


def _read_csv(path: Path) -> Recording:
    try:
        with open(path, encoding="utf-8-sig", newline="\n") as stream:
            head, header = _csv_head(stream)
            check_schema(parsed(head.get("schema"), "schema"))
            table = _csv_numbers(stream, len(head) + 2, header)
    except UnicodeDecodeError as error:
        raise InputError("file", "unreadable", f"allowed is a CSV text file ({error})") from None
    if header[0] != "time [s]":
        raise InputError("header", header[0], "allowed is 'time [s]' first")
    told = parsed(head.get("channels"), "channels")
    channels: dict[str, Channel] = {}
    for i, cell in enumerate(header[1:], 1):
        name, _, unit = cell.rpartition(" [")
        of = told.get(name) if isinstance(told, Mapping) else None
        if not isinstance(of, Mapping) or not unit.endswith("]"):
            raise InputError("header", cell, "allowed is 'name [unit]' with a name that the line '# channels' knows")
        channels[name] = Channel(table[:, i], unit[:-1], of.get("kind", ""), of.get("meaning", ""))
    return Recording(table[:, 0], channels, parsed(head.get("meta"), "meta"))


def _csv_head(stream: io.TextIOBase) -> tuple[dict[str, str], list[str]]:
    """The comment lines by their key, and the header's cells; the stream then stands at the numbers."""
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
    raise InputError("file", "no header", "it ends before its numbers")


def _csv_numbers(stream: io.TextIOBase, before: int, header: list[str]) -> np.ndarray:
    first = stream.readline()
    if not first.strip():
        raise InputError("file", "no samples", "allowed is at least one")
    try:
        rest = (line for lines in ((first,), stream) for line in lines)
        table = np.loadtxt(rest, delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        raise InputError("numbers", "unreadable", f"{one_line(error)} after the {before} lines of the head") from None
    if table.shape[1] != len(header):
        raise InputError("numbers", f"{table.shape[1]} columns", f"the header has {len(header)}")
    return table


def _is_line(text: Any) -> bool:
    return isinstance(text, str) and bool(text) and text.isprintable()


def _known(path: Path, ways: Mapping[str, Callable[..., Any]]) -> Callable[..., Any]:
    way = ways.get(path.suffix.lower())
    if way is None:
        raise InputError("suffix", path.suffix or str(path), f"known are {', '.join(ways)}", where=str(path))
    return way


def _read_log(path: Path) -> Recording:
    from .mcap_file import read_log

    return read_log(path).recording


_WRITERS = {".nc": _write_netcdf, ".csv": _write_csv}
_READERS = {".nc": _read_netcdf, ".csv": _read_csv, ".mcap": _read_log}
