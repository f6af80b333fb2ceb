"""Protocol files with waveforms in other files, whose points are included in the protocol.

    pressure = { kind = "table", file = "walk.csv", time = "t [s]", column = "p [bar]" }

What was recorded with a protocol then holds all of it. Files are those that `recordings.read_record` opens; a path is taken
from the folder of the protocol.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...assembly.signal_table import read_points
from ...documents import read_toml
from ...errors import InputError
from ...experiments import read
from ...experiments.amounts import COMMANDED
from ...experiments.protocol import Protocol


def read_protocol(path: str | os.PathLike[str]) -> Protocol:
    """Read a protocol and the waveforms that it names.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    where = os.fspath(path)
    document = read.with_own_controllers(read_toml(path, field="protocol"), where)
    for section in ("first", "steps", "last"):
        if isinstance(document.get(section), list):
            document[section] = _steps(document[section], section, where)
    return read.build_protocol(document, where=where)


def _steps(steps: list[Any], path: str, where: str) -> list[Any]:
    rows = []
    for number, step in enumerate(steps, 1):
        if isinstance(step, Mapping):
            place = f"{path}.{number}"
            step = {
                key: _steps(value, f"{place}.{key}", where)
                if key == "steps" and isinstance(value, list)
                else _taken_in(value, COMMANDED[key], f"{place}.{key}", where)
                if key in COMMANDED
                else value
                for key, value in step.items()
            }
        rows.append(step)
    return rows


def _taken_in(value: Any, unit: str, field: str, where: str) -> Any:
    """Include the points of the files that a waveform's tables name."""
    if isinstance(value, list):
        return [_taken_in(v, unit, field, where) for v in value]
    if not isinstance(value, Mapping):
        return value
    if value.get("kind") != "table" or "file" not in value:
        return {k: _taken_in(v, unit, f"{field}.{k}", where) for k, v in value.items()}
    known = ("kind", "file", "time", "column", "between")
    for key, raw in value.items():
        if key not in known:
            raise InputError(f"{field}.{key}", None, "a table from a file has", known=known, where=where)
        if not isinstance(raw, str):
            raise InputError(f"{field}.{key}", str(raw), "must be a word", where=where)
    file = Path(where).parent / value["file"]
    times, values = read_points(file, value.get("time"), value.get("column"), unit, field=field, where=where)
    inside = {"kind": "table", "between": value.get("between", "straight")}
    return inside | {
        "times": [f"{float(t) - float(times[0])!r} s" for t in times],
        "values": [f"{float(v)!r} {unit}" for v in values],
    }
