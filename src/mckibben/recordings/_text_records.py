"""Measured records as text tables: channels over time, with a header that holds units or without one.

All numbers become SI here, once. What a record of air and muscles cannot be is refused: times that repeat or go back,
gaps, pressures below vacuum, cells that are no finite number, rows of unequal length.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..quantities import with_unit
from .columns import ColumnSource, check_vacuum, choose_columns
from .recording import Channel, Recording
from .text import Rows, check_width, is_number, plain_text, read_rows, to_numbers, without_blanks
from .units import is_pressure, si_of

# Between samples; more, and samples were lost. Stamps rounded to the last digit reach 1.5 to 2 times the median.
LARGEST_GAP = 3.0
FEWEST = 3


def read_record(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
    pressure_zero: float | Mapping[str, float] = 0.0,
    ambient: float = 101325.0,
    required: Iterable[str] = (),
) -> Recording:
    """Read a measured record from a text table (``.csv``, ``.txt``, also ``.gz``).

    It is read as `text.read_rows` does; rows with a blank cell in a column that is read are left out, and named in the meta
    under ``source.left_out``. With a header such as
    ``time [s], tank.pressure_abs [kPa]`` or ``t,pressure_bar_gauge,valve.command_V`` every column becomes a channel of that
    name in lower case. A pressure is gauge unless its name ends in ``_abs``.

    Args:
        path: the file.
        columns: channel name -> header or number of the column from 1; then only these, and the time, are read. A file
            without a header needs it. The time's name is ``time``.
        units: channel name -> unit as text, over the header; a time without a unit is in seconds.
        period: interval of the samples [s] where the file has no time; the first is then at 0 s.
        pressure_zero: what gauge pressures read at zero [Pa], one for all or by channel; it is subtracted.
        ambient: environment pressure, which says where vacuum is [Pa].
        required: channels that must be there.

    Returns:
        Channels of kind "measured" ("command" where the last part of the name is that), all SI.

    Raises:
        InputError: names file, row, field, value and what is allowed.
    """
    where = str(path)
    units, zeros = dict(units or {}), pressure_zero
    if not (math.isfinite(ambient) and ambient > 0.0):
        raise InputError("ambient", ambient, "allowed is a pressure above 0 Pa", where=where)
    header, rows = _table(Path(path), where)
    places = {n: plain_text(c) if isinstance(c, str) else c for n, c in (columns or {}).items()}
    sources = choose_columns(header, len(rows[0][1]), places, period is None, where)
    rows, left_out = without_blanks(rows, {column.at: column.label for column in sources.values()}, where)
    for field, named in (("units", units), ("pressure_zero", zeros if isinstance(zeros, Mapping) else {})):
        for name in named:
            if name not in sources:
                raise InputError(field, name, f"the channels are {', '.join(sources)}", where=where)
    for name in (required,) if isinstance(required, str) else required:
        if name not in sources:
            has = ", ".join(n for n in sources if n != "time") or "none"
            raise InputError(name, "no column", f"it is required, and the file has {has}", where=where)
    time = _time(sources.pop("time", None), units.get("time"), period, rows, where)
    channels = _channels(sources, units, zeros, ambient, rows, where)
    source = _source(path, sources, units, zeros) | ({"left_out": left_out} if left_out else {})
    return Recording(time, channels, {"title": Path(path).name, "source": source})


def _channels(
    sources: Mapping[str, ColumnSource],
    units: Mapping[str, str],
    zeros: float | Mapping[str, float],
    ambient: float,
    rows: Rows,
    where: str,
) -> dict[str, Channel]:
    if not sources:
        raise InputError("channels", "none", "allowed is at least one column beside the time", where=where)
    channels = {}
    for name, column in sources.items():
        values, unit = _values(name, column, units.get(name), rows, where)
        if is_pressure(unit):
            if not name.endswith("_abs"):
                values = values - _zero(name, zeros, where)
            check_vacuum(name, column.label, values, ambient, lambda i: f", row {rows[i][0]}", where)
        channels[name] = Channel(values, unit, "command" if name.split(".")[-1] == "command" else "measured")
    _check_alive(channels, where)
    return channels


def _table(path: Path, where: str) -> tuple[list[str] | None, Rows]:
    """The header, if there is one, and the rows of numbers."""
    rows = read_rows(path, where)
    if not rows:
        raise InputError("file", "empty", f"allowed are {FEWEST} samples or more", where=where)
    number, first = rows[0]
    header = None
    words = [cell for cell in first if not is_number(cell)]
    if len(words) == len(first):
        header, rows = [plain_text(cell) for cell in first], rows[1:]
    elif words:
        allowed = "allowed is a row of names, or one of numbers where there is no header"
        raise InputError(f"row {number}", words[0], allowed, where=where)
    if len(rows) < FEWEST:
        raise InputError("file", f"{len(rows)} samples", f"allowed are {FEWEST} or more", where=where)
    width = f"the header has {len(first)} columns" if header else f"the first row has {len(first)}"
    check_width(rows, len(first), width, where)
    return header, rows


def _zero(name: str, zeros: float | Mapping[str, float], where: str) -> float:
    zero = zeros.get(name, 0.0) if isinstance(zeros, Mapping) else zeros
    if not math.isfinite(zero):
        raise InputError("pressure_zero", zero, "allowed is a finite pressure [Pa]", where=where)
    return zero


def _values(name: str, column: ColumnSource, given: str | None, rows: Rows, where: str) -> tuple[np.ndarray, str]:
    """The numbers of a column and their SI unit."""
    unit = given or column.unit
    if unit is None:
        allowed = f"write it into the header, such as '{name} [kPa]', or say it"
        raise InputError(f"unit of {name}", "no unit", allowed, where=where, remedy=f"unit {name}")
    si, scale, offset = si_of(unit, field=f"unit of {name} ({column.label})", where=where)
    numbers = to_numbers([row[column.at] for _, row in rows], [n for n, _ in rows], column.label, where)
    return numbers * scale + offset, si


def _time(column: ColumnSource | None, given: str | None, period: float | None, rows: Rows, where: str) -> np.ndarray:
    """The clock of a record [s], checked."""
    if period is not None:
        if column is not None:
            raise InputError(
                "period", period, f"the file has the time {column.label}; give one of the two", where=where
            )
        if not (math.isfinite(period) and period > 0.0):
            raise InputError("period", period, "allowed is a time above 0 s", where=where)
        return np.arange(len(rows)) * float(period)
    if column is None:
        allowed = "say which column it is, or state the period of the samples"
        raise InputError("time", "no column", allowed, where=where, remedy="column time")
    time, unit = _values("time", column, given or column.unit or "s", rows, where)
    if unit != "s":
        raise InputError(column.label, given or column.unit, "allowed is a time such as s or ms", where=where)
    steps = np.diff(time)
    if not (steps > 0.0).all():
        i = int(np.argmin(steps > 0.0))
        distance = f"{time[i + 1]!s} s after {time[i]!s} s"
        allowed = "allowed are increasing times, each once"
        raise InputError(f"{column.label}, row {rows[i + 1][0]}", distance, allowed, where=where)
    usual = float(np.median(steps))
    # Stamps are decimals: an interval of three times the median may be a bit longer in binary.
    if steps.max() > LARGEST_GAP * usual * (1.0 + 1e-9) + 4.0 * np.spacing(np.abs(time).max()):
        i = int(steps.argmax())
        distance = f"{steps[i]:.6g} s after the row before, at {time[i + 1]:.6g} s"
        allowed = f"a gap; allowed is {LARGEST_GAP:g} times the usual interval, {LARGEST_GAP * usual:.6g} s"
        raise InputError(f"{column.label}, row {rows[i + 1][0]}", distance, allowed, where=where)
    return time


def _check_alive(channels: Mapping[str, Channel], where: str) -> None:
    sensors = {n: c for n, c in channels.items() if c.kind != "command"} or channels
    if all(np.ptp(c.values) == 0.0 for c in sensors.values()):
        name, channel = next(iter(sensors.items()))
        value = f"{with_unit(float(channel.values[0]), channel.unit)} throughout"
        raise InputError(name, value, "no channel changes; allowed is a record in which something happens", where=where)


def _source(
    path: str | Path, sources: Mapping[str, ColumnSource], units: Mapping[str, str], zero: float | Mapping[str, float]
) -> dict[str, Any]:
    """Origin of the channels, for the metadata."""
    columns = {name: {"column": c.label, "unit": units.get(name) or c.unit} for name, c in sources.items()}
    return {"file": Path(path).name, "columns": columns, "pressure_zero": zero}
