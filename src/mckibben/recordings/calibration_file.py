"""Calibrations as files.

A calibration is kept as a TOML file (schema 1): one table per channel, every value as text with its unit.

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
    degrees = 14.2                     # of freedom of that; infinitely many by default
    method = "weights"
    date = "2026-03-31T12:00:00+00:00"
    reference = "M1 masses"
    reference_uncertainty = "0.01 N"   # standard, of each of its values
    scale_uncertainty = 0.0015         # standard, of all of them alike
    valid_for = "365 day"              # for ever by default
    points = 7

The terms of a channel may come from different days; each says where it comes from.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from ..documents import JsonValue, read_toml, write_text
from ..errors import InputError
from .calibration import DAY, TERMS, Calibration, Correction, correction_table, read_plain


def read_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed; a newer schema is refused.
    """
    where = os.fspath(path)
    return read_plain(read_toml(path, field="calibration"), where=where, bare=False)


def write_calibration(calibration: Calibration, path: str | os.PathLike[str]) -> Path:
    """Write a calibration, atomically; it reads back exactly.

    Raises:
        InputError: the file cannot be written.
    """
    import tomlkit

    return write_text(path, tomlkit.dumps(document(calibration)), field="calibration")


def merged(path: Path, rig: str, corrections: Mapping[str, Correction], date: str) -> Calibration:
    """Return the calibration of a file, updated with new corrections; a new calibration if there is no such file.

    Raises:
        InputError: the file is of another rig, or cannot be read.
    """
    before = read_calibration(path) if path.exists() else Calibration(rig=rig, created=date)
    if before.rig != rig:
        raise InputError("rig", rig, f"the calibration is of {before.rig}; choose another file", where=str(path))
    return before.updated(corrections, date)


def document(calibration: Calibration) -> dict[str, JsonValue]:
    """Tables of a calibration file."""
    channels = {name: correction_table(one, bare=False) for name, one in calibration.corrections.items()}
    for table in channels.values():
        for term in TERMS:
            if term in table and "valid_for" in table[term]:
                days = float(table[term]["valid_for"].removesuffix(" s")) / DAY
                if days == round(days):
                    table[term]["valid_for"] = f"{days:.0f} day"
    return {**calibration.plain(), "channels": channels}
