"""Calibrations as TOML files (schema 1): one table per channel, every value in words with its unit.

    schema = 1
    rig = "modern"
    created = "2026-03-31T12:00:00+00:00"
    [channels.tension]
    unit = "N"
    sensor = "S/N 123"
    correlation = 0.4                  # of gain and zero
    linearity = "0.02 N"               # largest departure of a point from the line
    [channels.tension.gain]            # also zero and skew, those that were determined
    value = 1.0023
    uncertainty = 0.0002               # standard
    degrees = 14.2                     # of freedom of that; infinitely many where left out
    method = "weights"
    date = "2026-03-31T12:00:00+00:00"
    reference = "M1 masses"
    reference_uncertainty = "0.01 N"   # standard, of each of its values
    scale_uncertainty = 0.0015         # standard, of all of them alike
    valid_for = "365 day"              # for ever where left out
    points = 7

The terms of a channel may come from different days; each says where it comes from.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...documents import read_toml, write_text
from ...errors import InputError
from ...experiments.words import Entry
from ...recordings.calibration import DAY, SCHEMA, TERMS, Calibration, Correction, read_plain

_TOP = ("schema", "rig", "created", "channels")
_CHANNEL = ("unit", "sensor", "correlation", "linearity", *TERMS)
_TERM = (
    "value", "uncertainty", "degrees", "method", "date", "reference", "reference_uncertainty", "scale_uncertainty",
    "valid_for", "points",
)  # fmt: skip


def read_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed; a newer schema is refused.
    """
    where = os.fspath(path)
    document = read_toml(path, field="calibration")
    schema = document.get("schema")
    if isinstance(schema, int) and schema > SCHEMA:
        return read_plain(document, where=where)  # complains about that before any key that this version cannot know
    top = Entry(document, "", where)
    top.only(_TOP)
    channels = top.table("channels")
    plain = {name: _channel(channels.table(name)) for name in channels.values}
    return read_plain({**document, "channels": plain}, where=where)


def write_calibration(calibration: Calibration, path: str | os.PathLike[str]) -> Path:
    """Write a calibration; a file of that name is replaced only when all is written. Reads back exactly.

    Raises:
        InputError: the file cannot be written.
    """
    import tomlkit

    return write_text(path, tomlkit.dumps(document(calibration)), field="calibration")


def merged(path: Path, rig: str, found: Mapping[str, Correction], date: str) -> Calibration:
    """What a file has, with what was determined now; a new calibration where there is no such file.

    Raises:
        InputError: the file is of another rig, or cannot be read.
    """
    before = read_calibration(path) if path.exists() else Calibration(rig=rig, created=date)
    if before.rig != rig:
        raise InputError("rig", rig, f"the calibration is of {before.rig}; allowed is another file", where=str(path))
    return before.updated(found, date)


def document(calibration: Calibration) -> dict[str, Any]:
    """The tables of a file."""
    plain = calibration.plain()
    channels = {}
    for name, table in plain["channels"].items():
        unit = table["unit"]
        out = {k: v for k, v in table.items() if k not in TERMS and v != ""}
        if "linearity" in out:
            out["linearity"] = _words(out["linearity"], unit)
        for term in TERMS:
            if term in table:
                out[term] = _term(table[term], {"gain": "1", "zero": unit, "skew": "s"}[term], unit)
        channels[name] = out
    return {**plain, "channels": channels}


def _term(table: Mapping[str, Any], own: str, unit: str) -> dict[str, Any]:
    plain = ("reference_uncertainty", "scale_uncertainty")
    out = {k: v for k, v in table.items() if v not in ("", math.inf) and not (k in plain and v == 0.0)}
    for key in ("value", "uncertainty"):
        if key in out:
            out[key] = _words(out[key], own)
    if "reference_uncertainty" in out:
        out["reference_uncertainty"] = _words(out["reference_uncertainty"], unit)
    if "valid_for" in out:
        days = out["valid_for"] / DAY
        out["valid_for"] = f"{days:.0f} day" if days == round(days) else _words(out["valid_for"], "s")
    return out


def _words(value: float, unit: str) -> Any:
    """A number that reads back exactly; pure numbers stay numbers."""
    return value if unit == "1" else f"{value!r} {unit}"


def _channel(entry: Entry) -> dict[str, Any]:
    """The plain table of a channel, from its words."""
    entry.only(_CHANNEL, "a channel has")
    out = {k: v for k, v in entry.values.items() if k not in (*TERMS, "linearity")}
    unit = entry.word("unit")
    if "linearity" in entry.values:
        out["linearity"] = entry.number("linearity", unit)
    for term, own in (("gain", "1"), ("zero", unit), ("skew", "s")):
        if term not in entry.values:
            continue
        at = entry.table(term)
        at.only(_TERM, f"{term} has")
        out[term] = dict(at.values)
        for key, si in (("value", own), ("uncertainty", own), ("reference_uncertainty", unit), ("valid_for", "s")):
            if key in at.values:
                out[term][key] = at.number(key, si)
    return out
