"""Data files of Aurora Scientific's Dynamic Muscle Control (``.ddf``), in the layout that workloopR describes.

The head states sampling frequency, reference values, calibration of each channel and the protocol; volts follow. A value is
(volts + offset) * scale. Comments and protocol may be missing, and decimal commas stand where no number has a point.
Reference: V. B. Baliga, S. Senthivasan, J. Open Source Softw., doi:10.21105/joss.01856.
"""

from __future__ import annotations

import codecs
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from .table import FileFormat, ForeignColumn, ForeignTable, si_of
from .text import to_numbers

# Names by the dimension of the first two inputs and outputs: the lever's length and force, as workloopR names them.
_NAMES = {"m": "length", "N": "force"}
_FASTEST = 1e7  # samples per second of any converter of a muscle lever, and above


class _Parts(NamedTuple):
    """A file's head, calibration by channel, protocol lines, channels, rows of cells with their numbers, and remarks."""

    head: dict[str, str]
    calibration: dict[str, tuple[str, float, float]]
    protocol: list[str]
    header: list[str]
    rows: list[tuple[int, list[str]]]
    remarks: list[str]


def read_ddf(path: Path, gear_ratio: float | str = 1.0) -> ForeignTable:
    """Read time, length, force and stimulus of a muscle lever.

    Args:
        path: the file.
        gear_ratio: of a lever that moves the muscle less than its motor: lengths are divided by it, forces multiplied.

    Returns:
        The channels that have a unit, their commands, and the stimulus; head, protocol and references as notes.

    Raises:
        InputError: it is no such file, a part of its head is missing, a cell is no number, or a sample was lost.
    """
    where = str(path)
    ratio = _number(gear_ratio, "gear_ratio", where)
    if not ratio > 0.0:
        raise InputError("gear_ratio", gear_ratio, "must be greater than 0", where=where)
    lines = _lines(path, where)
    title = next((line for line in lines if line.strip()), "").strip()
    if "dmc" not in title.lower() or "data file" not in title.lower():
        raise InputError("first line", title[:60], "must name a DMC Data File", where=where)
    parts = _parts(lines, where)
    rate = _rate(parts.head, where)
    numbers, cells = [number for number, _ in parts.rows], [row for _, row in parts.rows]
    remarks = list(parts.remarks)
    if len(cells) > 1 and not any(cell.strip("0.") for cell in cells[-1][1:]):
        remarks.append(f"row {numbers[-1]} is left out: the last sample holds zeros only")
        numbers, cells = numbers[:-1], cells[:-1]
    # After a lost or a repeated sample everything would be timed wrong.
    wrong = np.flatnonzero(np.diff(to_numbers([row[0] for row in cells], numbers, "Sample", where)) != 1.0)
    if len(wrong):
        at = int(wrong[0]) + 1
        sample, before = cells[at][0], cells[at - 1][0]
        problem = f"row {numbers[at]} is sample {sample} after {before}; samples must be numbered one by one"
        raise InputError("Sample", sample, problem, sentence=problem, where=where)
    time = np.arange(len(cells)) / rate
    columns: list[ForeignColumn] = []
    for at, channel in enumerate(parts.header[1:], 1):
        stimulus = channel.startswith("Stim")
        unit, scale, offset = ("1", 1.0, 0.0) if stimulus else parts.calibration.get(channel, ("", 0.0, 0.0))
        if not unit or scale == 0.0:
            if unit or channel not in parts.calibration:
                lack = f"its scale is {scale:g}" if unit else "Calibration Data does not name it"
                remarks.append(f"channel {channel} is left out: {lack}")
            continue
        values = to_numbers([row[at] for row in cells], numbers, channel, where)
        name = "stimulus" if stimulus else channel.lower()
        if not stimulus:
            values = (values + offset) * scale
            if unit != "TTL":
                name = _NAMES.get(si_of(unit, field=f"Units of {channel}")[0], name)
        if name in ("length", "force"):
            values = values / ratio if name == "length" else values * ratio
        label = f"{name}.command" if channel.startswith("AO") else name
        taken = [column.label for column in columns]
        label = label if label not in taken else f"{label}.{channel.lower()}"
        columns.append(ForeignColumn(label, values, "1" if unit == "TTL" else unit, "samples", time))
    notes = {"program": title, "head": parts.head, "protocol": parts.protocol, "gear_ratio": ratio}
    return ForeignTable(columns, notes, remarks)


def _lines(path: Path, where: str) -> list[str]:
    """Lines of the text, which is that of Windows (cp1252), or UTF-8 or UTF-16 where it says so."""
    content = path.read_bytes()
    marks = ((codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"), (codecs.BOM_UTF8, "utf-8-sig"))
    encoding = next((name for mark, name in marks if content.startswith(mark)), "cp1252")
    try:
        return content.decode(encoding).splitlines()
    except UnicodeDecodeError:
        if encoding != "cp1252":
            raise InputError("file", None, f"must be text in {encoding}, as it begins", where=where) from None
        return content.decode("latin-1").splitlines()


def _rate(head: Mapping[str, str], where: str) -> float:
    key = "Sample Frequency (Hz)"
    if key not in head:
        raise InputError(key, None, "is missing: samples have no times without it", where=where)
    rate = _number(head[key], key, where)
    if not 0.0 < rate <= _FASTEST:
        raise InputError(key, rate, f"must be above 0 and at most {_FASTEST:g}", where=where)
    return rate


def _parts(lines: list[str], where: str) -> _Parts:
    """Split a file; comments may hold any text, so its parts are sought from both ends towards them."""
    first = _place(lines, "Calibration Data", range(len(lines)), where)
    data = _place(lines, "Test Data", range(first, len(lines)), where)
    begin = next((i for i in range(data, len(lines)) if _cells(lines[i])[0] == "Sample"), None)
    if begin is None:
        problem = "has no header: its first line must name the channels, beginning with Sample"
        raise InputError("Test Data", None, problem, where=where)
    data = _place(lines, "Test Data", range(begin, first, -1), where)
    unit = lines[data].partition(" in ")[2].strip(" :\t")
    if unit and not unit.lower().startswith("v"):
        raise InputError("Test Data", f"in {unit}", "must be in Volts", where=where)
    rows = [(i, _cells(lines[i])) for i in range(begin, len(lines)) if lines[i].strip()]
    header, rows = rows[0][1], [(i + 1, row) for i, row in rows[1:]]
    if not rows:
        raise InputError("Test Data", None, "is empty: it must have at least one sample", where=where)
    for twice in (name for name in header if header.count(name) > 1):
        raise InputError("header of Test Data", twice, "must name each channel once", where=where)
    for number, row in rows:
        if len(row) != len(header):
            problem = f"row {number} has {len(row)} cells, and the header has {len(header)} columns"
            raise InputError(f"row {number}", f"{len(row)} cells", problem, sentence=problem, where=where)
    cells = [cell for _, row in rows for cell in row]
    # Numbers with commas, and none with a point.
    comma = any("," in cell for cell in cells) and not any("." in cell for cell in cells)
    if comma:
        rows = [(number, [cell.replace(",", ".") for cell in row]) for number, row in rows]
    remarks = ["numbers have decimal commas"] if comma else []
    protocol = next((i for i in range(data, first, -1) if lines[i].startswith("Protocol Array")), None)
    if protocol is None:
        remarks.append("it has no Protocol Array: what was done to the muscle is not known")
    comments = next((i for i in range(first, data) if lines[i].startswith("Test Comments")), protocol or data)
    head = (line.split(":", 1) for line in lines[1:first] if ":" in line)
    return _Parts(
        {key.strip(): value.strip().replace(*(",." if comma else "..")) for key, value in head},
        _calibration(lines[first + 1 : comments], comma, where),
        [] if protocol is None else [" ".join(s.split()) for s in lines[protocol + 1 : data] if s.strip()],
        header,
        rows,
        remarks,
    )


def _place(lines: list[str], name: str, among: range, where: str) -> int:
    place = next((i for i in among if lines[i].startswith(name)), None)
    if place is None:
        problem = f"the part {name} is missing; the file is cut off, or no DMC Data File"
        raise InputError(name, "missing", problem, sentence=problem, where=where)
    return place


def _cells(line: str) -> list[str]:
    """Cells between tabs; blanks around them and tabs at the end mean nothing."""
    return [cell.strip() for cell in line.rstrip().split("\t")]


def _calibration(lines: Sequence[str], comma: bool, where: str) -> dict[str, tuple[str, float, float]]:
    """Unit, scale [unit/V] and offset [V] of each channel; an unused channel has no unit, and its numbers mean nothing."""
    table = {row[0].split(" (")[0]: row[1:] for row in ([c.strip() for c in line.split("\t")] for line in lines)}
    for name in ("Channel", "Units", "Scale", "Offset"):
        if name not in table:
            raise InputError(f"{name} of Calibration Data", None, "is missing: each channel needs it", where=where)
    channels = [name for name in table["Channel"] if name]
    for name in ("Units", "Scale", "Offset"):
        table[name] += [""] * (len(channels) - len(table[name]))
    calibration = {}
    for channel, unit, *values in zip(channels, table["Units"], table["Scale"], table["Offset"], strict=False):
        points = [value.replace(",", ".") if comma else value for value in values]
        fields = (f"Scale of {channel}", f"Offset of {channel}")
        scale, offset = (_number(v, f, where) if unit else 0.0 for v, f in zip(points, fields, strict=True))
        calibration[channel] = (unit, scale, offset)
    return calibration


def _number(text: object, field: str, where: str) -> float:
    try:
        value = float(str(text))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(field, str(text) or "missing", "must be a number", where=where)
    return value


FORMAT = FileFormat(title="DMC data files", read=read_ddf, options=("gear_ratio",))
