"""Data files of Aurora Scientific's Dynamic Muscle Control (``.ddf``), in the layout that workloopR describes.

The head states sampling frequency, reference values, calibration of each channel and the protocol; volts follow. A value is
(volts + offset) * scale. Reference: V. B. Baliga, S. Senthivasan, J. Open Source Softw., doi:10.21105/joss.01856.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..documents import JsonValue
from ..errors import InputError
from .formats import FileFormat, ForeignColumn, ForeignTable
from .text import to_numbers

# Names by unit of the first two inputs and outputs: the lever's length and force, as workloopR names them.
_NAMES = {"mm": "length", "mN": "force"}


def read_ddf(path: Path, gear_ratio: float | str = 1.0) -> ForeignTable:
    """Read time, length, force and stimulus of a muscle lever.

    Args:
        path: the file.
        gear_ratio: of a lever that moves the muscle less than its motor: lengths are divided by it, forces multiplied.

    Returns:
        The channels that have a unit, their commands, and the stimulus; head, protocol and references as notes.

    Raises:
        InputError: it is no such file, a part of its head is missing, or a cell is no number.
    """
    where = str(path)
    ratio = _number(gear_ratio, "gear_ratio", where)
    if not ratio > 0.0:
        raise InputError("gear_ratio", gear_ratio, "must be greater than 0", where=where)
    lines = path.read_bytes().decode("cp1252").splitlines()
    if not lines or "DMC" not in lines[0] or "Data File" not in lines[0]:
        raise InputError("first line", (lines or [""])[0][:60], "must name a DMC Data File", where=where)
    parts = _parts(lines, where)
    rate = _number(parts["head"].get("Sample Frequency (Hz)", ""), "Sample Frequency (Hz)", where)
    if not rate > 0.0:
        raise InputError("Sample Frequency (Hz)", rate, "must be greater than 0", where=where)
    calibration, first, rows = parts["calibration"], parts["first"], parts["rows"]
    header, cells = rows[0], rows[1:]
    if not cells:
        raise InputError("Test Data", None, "is empty: it must have at least one sample", where=where)
    for number, row in enumerate(cells, first + 1):
        if len(row) != len(header):
            problem = f"row {number} has {len(row)} cells, and the header has {len(header)} columns"
            raise InputError(f"row {number}", f"{len(row)} cells", problem, sentence=problem, where=where)
    remarks = []
    if len(cells) > 1 and not any(cell.strip("0.\t ") for cell in cells[-1][1:]):
        remarks.append(f"row {first + len(cells)} is left out: the last sample holds zeros only")
        cells = cells[:-1]
    numbers = list(range(first + 1, first + 1 + len(cells)))
    time = np.arange(len(cells)) / rate
    columns: list[ForeignColumn] = []
    for at, channel in enumerate(header):
        unit, scale, offset = calibration.get(channel, ("", 0.0, 0.0))
        if channel != "Stim" and (not unit or channel == "Sample" or scale == 0.0):
            continue
        volts = to_numbers([row[at] for row in cells], numbers, channel, where)
        values = volts if channel == "Stim" else (volts + offset) * scale
        name = _NAMES.get(unit, channel.lower())
        if name in ("length", "force"):
            values = values / ratio if name == "length" else values * ratio
        label = "stimulus" if channel == "Stim" else f"{name}.command" if channel.startswith("AO") else name
        taken = [column.label for column in columns]
        columns.append(
            ForeignColumn(label if label not in taken else f"{label}.{channel.lower()}", values,
                          "1" if channel == "Stim" or unit == "TTL" else unit, "samples", time)
        )  # fmt: skip
    notes = {"program": lines[0].strip(), "head": parts["head"], "protocol": parts["protocol"], "gear_ratio": ratio}
    return ForeignTable(columns, notes, remarks)


def _parts(lines: list[str], where: str) -> dict[str, JsonValue]:
    """Head, calibration by channel, protocol lines, and the rows of data with the number of their header's line."""
    at: dict[str, int] = {}
    for name in ("Calibration Data", "Protocol Array", "Test Data"):
        place = next((i for i, line in enumerate(lines) if line.startswith(name)), None)
        if place is None:
            problem = f"the part {name} is missing; the file is cut off, or no DMC Data File"
            raise InputError(name, "missing", problem, sentence=problem, where=where)
        at[name] = place
    head = dict(line.split(":", 1) for line in lines[1 : at["Calibration Data"]] if ":" in line)
    comments = next((i for i, line in enumerate(lines) if line.startswith("Test Comments")), at["Protocol Array"])
    table = {
        row[0].split(" (")[0]: row[1:]
        for row in (line.split("\t") for line in lines[at["Calibration Data"] + 1 : comments])
    }
    for name in ("Channel", "Units", "Scale", "Offset"):
        if name not in table:
            raise InputError(f"{name} of Calibration Data", None, "is missing: each channel needs it", where=where)
    calibration = {
        channel: (
            unit.strip(),
            _number(scale, f"Scale of {channel}", where),
            _number(offset, f"Offset of {channel}", where),
        )
        for channel, unit, scale, offset in zip(
            table["Channel"], table["Units"], table["Scale"], table["Offset"], strict=False
        )
    }
    protocol = [" ".join(line.split()) for line in lines[at["Protocol Array"] + 1 : at["Test Data"]] if line.strip()]
    begin = next((i for i in range(at["Test Data"] + 1, len(lines)) if lines[i].startswith("Sample")), None)
    if begin is None:
        raise InputError(
            "Test Data",
            None,
            "has no header: its first line must name the channels, beginning with Sample",
            where=where,
        )
    rows = [line.rstrip("\r").split("\t") for line in lines[begin:] if line.strip()]
    return {
        "head": {k.strip(): v.strip() for k, v in head.items()}, "calibration": calibration, "protocol": protocol,
        "first": begin + 1, "rows": rows,
    }  # fmt: skip


def _number(text: object, field: str, where: str) -> float:
    try:
        value = float(str(text))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(field, str(text) or "missing", "must be a number", where=where)
    return value


FORMAT = FileFormat(title="DMC data files", read=read_ddf, options=("gear_ratio",))
