"""TDMS files of LabVIEW and DIAdem.

Written are a group ``recording`` with the channel ``time`` and one of each channel's name, with the properties
``unit_string``, ``description`` and ``kind``, and at the root title and ``mckibben``, a line of JSON with the metadata.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..extras import library
from ._sidecar import KEY, dumps, loads, unreadable
from .formats import FileFormat, ForeignColumn, ForeignTable, ImportResult
from .recording import Recording

GROUP = "recording"
# Where LabVIEW, DAQmx and DIAdem say the unit of a channel.
_UNITS = ("unit_string", "NI_UnitDescription", "NI_ChannelUnit", "unit")


def write_tdms(recording: Recording, path: Path) -> list[str]:
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


def read_tdms(path: Path) -> ImportResult | ForeignTable:
    """Read a recording of mckibben, or of another program's file the channels, with its properties for the metadata.

    Raises:
        InputError: the file cannot be read, or a newer version wrote it.
    """
    where = str(path)
    nptdms = library("nptdms", "TDMS files need", where=where)
    with unreadable("a TDMS file", where):
        with open(path, "rb") as stream, _library_log() as logged:
            file = nptdms.TdmsFile.read(stream)
        line = file.properties.get(KEY)
        if isinstance(line, str):
            columns = {channel.name: np.asarray(channel[:]) for channel in file[GROUP].channels()}
        else:
            foreign = [column for group in file.groups() for column in _group(group, bool(logged))]
            properties = {str(k).replace("$", "_"): _plain(v) for k, v in file.properties.items()}
    if isinstance(line, str):
        if logged:
            raise InputError("file", None, f"is damaged or cut off ({logged[0]})", where=where)
        sidecar = loads(line, where)
        return ImportResult(sidecar.from_columns(columns, "time", list(sidecar.channels), where), [])
    return ForeignTable(foreign, {"properties": properties}, list(dict.fromkeys(logged)))


@contextmanager
def _library_log() -> Iterator[list[str]]:
    """Catch what the library writes to its log while it reads, as lines; it would print them."""
    lines: list[str] = []
    handler = logging.Handler()
    handler.emit = lambda record: lines.append(record.getMessage()[:200])  # type: ignore[method-assign]
    logs = [log for name in list(logging.root.manager.loggerDict) if (log := _log(name)) is not None]
    before = [log.handlers for log in logs]
    for log in logs:
        log.handlers = [handler]
    try:
        yield lines
    finally:
        for log, handlers in zip(logs, before, strict=True):
            log.handlers = handlers


def _log(name: str) -> logging.Logger | None:
    """One of the library's modules; each has a log of its own, and the one above them none."""
    return logging.getLogger(name) if name.startswith("nptdms.") else None


def _group(group: Any, cut_off: bool) -> list[ForeignColumn]:
    """Channels of a group; of a truncated file, as many samples as all of them have."""
    columns = {channel.name: np.asarray(channel[:]) for channel in group.channels()}
    most = min(map(len, columns.values()), default=0) if cut_off else None
    return [_column(group.name, channel, columns[channel.name][:most]) for channel in group.channels()]


def _column(group: str, channel: Any, values: np.ndarray) -> ForeignColumn:
    properties = channel.properties
    unit = next((str(properties[key]) for key in _UNITS if properties.get(key)), None)
    step, offset = properties.get("wf_increment"), properties.get("wf_start_offset", 0.0)
    time, clock = None, f"{len(values)} samples"
    if isinstance(step, float) and step > 0.0 and np.isfinite(step):
        time = float(offset) + step * np.arange(len(values))
        clock += f" every {step:g} s from {offset:g} s"
    return ForeignColumn(f"{group}.{channel.name}", values, unit, clock, time)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic) and value.dtype.kind in "fiub":
        return value.item()
    return value if isinstance(value, str | int | float | bool) else str(value)


FORMAT = FileFormat(title="TDMS files", read=read_tdms, write=write_tdms, requires="nptdms")
