"""Measured records of others: CSV files of channels over time, with a header that holds units or without one.

All numbers become SI here, once. What a record of air and muscles cannot be is refused: times that repeat or go back,
gaps, pressures below vacuum, cells that are no finite number, rows of unequal length.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..quantities import with_unit
from .recording import Channel, Recording, check_name
from .text import Rows, check_width, is_number, read_rows, split_header, to_numbers
from .units import is_pressure, si_of

TIMES = ("time", "t", "timestamp")
# Between samples; more, and samples were lost. Stamps rounded to the last digit reach 1.5 to 2 times the median.
LARGEST_GAP = 3.0
FEWEST = 3
# Units that a header may hold after an underscore; in brackets any unit is read.
_UNDERSCORED = frozenset(
    "Pa kPa MPa hPa bar mbar psi bara barg psia psig s ms us m mm cm N kN mN V mV A mA K degC kg g rad deg Hz percent"
    " fraction".split()
)
_BRACKETS = re.compile(r"(?P<name>.*?\S)\s*[\[(](?P<unit>[^\[\]()]+(?:\([^()]*\))?)[\])]\s*")
_ABSOLUTE, _GAUGE = ("abs", "absolute", "a"), ("gauge", "rel", "g")
_PRESSURE_WORD = re.compile(r"([kMh]?Pa|m?bar|psi|atm|Torr|mmHg|N/m\^2|N/mm\^2|kgf/cm\^2)\b")
_SUFFIXED = ("bara", "barg", "mbara", "mbarg", "psia", "psig")


class _Column(NamedTuple):
    """Where a channel is found: number from 0, the words for complaints, its unit, absolute or gauge where that is said."""

    at: int
    label: str
    unit: str | None = None
    reference: str | None = None


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

    Commas, semicolons, tabs or blanks part the cells; lines that begin with # are skipped. With a header such as
    ``time [s], tank.pressure_abs [kPa]`` or ``t,pressure_bar_gauge,valve.command_V`` every column becomes a channel of that
    name in lower case. A pressure is gauge unless its name ends in ``_abs``.

    Args:
        path: the file.
        columns: channel name -> header or number of the column from 1; then only these, and the time, are read. A file
            without a header needs it. The time's name is ``time``.
        units: channel name -> unit in words, over the header; a time without a unit is in seconds.
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
    found = _chosen(header, len(rows[0][1]), dict(columns or {}), period is None, where)
    for field, named in (("units", units), ("pressure_zero", zeros if isinstance(zeros, Mapping) else {})):
        for name in named:
            if name not in found:
                raise InputError(field, name, f"the channels are {', '.join(found)}", where=where)
    for name in (required,) if isinstance(required, str) else required:
        if name not in found:
            has = ", ".join(n for n in found if n != "time") or "none"
            raise InputError(name, "no column", f"it is required, and the file has {has}", where=where)
    time = _time(found.pop("time", None), units.get("time"), period, rows, where)
    channels = _channels(found, units, zeros, ambient, rows, where)
    return Recording(time, channels, {"title": Path(path).name, "source": _source(path, found, units, zeros)})


def _channels(
    found: Mapping[str, _Column],
    units: Mapping[str, str],
    zeros: float | Mapping[str, float],
    ambient: float,
    rows: Rows,
    where: str,
) -> dict[str, Channel]:
    if not found:
        raise InputError("channels", "none", "allowed is at least one column beside the time", where=where)
    channels = {}
    for name, column in found.items():
        values, unit = _values(name, column, units.get(name), rows, where)
        if is_pressure(unit):
            if not name.endswith("_abs"):
                values = values - _zero(name, zeros, where)
            _check_vacuum(name, column, values, ambient, rows, where)
        channels[name] = Channel(values, unit, "command" if name.split(".")[-1] == "command" else "measured")
    _check_alive(channels, where)
    return channels


def _table(path: Path, where: str) -> tuple[list[str] | None, Rows]:
    """The header, if there is one, and the rows of numbers."""
    rows = read_rows(path, where, sniff=True)
    if not rows:
        raise InputError("file", "empty", f"allowed are {FEWEST} samples or more", where=where)
    number, first = rows[0]
    header = None
    words = [cell for cell in first if not is_number(cell)]
    if len(words) == len(first):
        header, rows = [cell.strip() for cell in first], rows[1:]
    elif words:
        allowed = "allowed is a row of names, or one of numbers where there is no header"
        raise InputError(f"row {number}", words[0], allowed, where=where)
    if len(rows) < FEWEST:
        raise InputError("file", f"{len(rows)} samples", f"allowed are {FEWEST} or more", where=where)
    width = f"the header has {len(first)} columns" if header else f"the first row has {len(first)}"
    check_width(rows, len(first), width, where)
    return header, rows


def _chosen(
    header: list[str] | None, width: int, columns: dict[str, str | int], timed: bool, where: str
) -> dict[str, _Column]:
    """The columns by channel name, the time among them if there is one; not `timed`, it must be asked for by name."""
    if header is None and not columns:
        allowed = "a file without a header needs them, such as {'time': 1, 'tank.pressure': 2}"
        raise InputError("columns", "not given", allowed, where=where)
    described = [_described(i, cell) for i, cell in enumerate(header or [""] * width)]
    found: dict[str, _Column] = {}
    for name, wanted in columns.items():
        if name != "time":
            check_name(name, where)
        found[name] = described[_index(name, wanted, header, width, described, where)][1]
    for stem, column in described:
        # A column without a name is a row number, or a mark at the end of each line.
        if not stem or (columns and ("time" in columns or stem not in TIMES or not timed)):
            continue
        name = "time" if stem in TIMES else stem
        if name in found:
            told = f"{found[name].label}, {column.label}"
            raise InputError(name, told, f"two columns; name one with columns={{'{name}': ..}}", where=where)
        if name != "time":
            check_name(name, where)
        found[name] = column
    for name, column in found.items():
        if column.reference is not None and (column.reference == "absolute") != name.endswith("_abs"):
            allowed = f"the header says {column.reference}; names of absolute pressures, and only these, end in _abs"
            raise InputError(f"columns, {name}", column.label, allowed, where=where)
    return found


def _index(
    name: str, wanted: Any, header: list[str] | None, width: int, described: list[tuple[str, _Column]], where: str
) -> int:
    if isinstance(wanted, int) and not isinstance(wanted, bool):
        if not 1 <= wanted <= width:
            raise InputError(f"columns, {name}", wanted, f"allowed is 1 to {width}", where=where)
        return wanted - 1
    if header is None:
        raise InputError(f"columns, {name}", str(wanted), f"no header; allowed is a number, 1 to {width}", where=where)
    match = [i for i, cell in enumerate(header) if cell == wanted]
    match = match or [i for i, (stem, _) in enumerate(described) if stem == wanted]
    if len(match) != 1:
        told = f"the file has {', '.join(header)}" if not match else "two columns have it; give a number from 1"
        raise InputError(f"columns, {name}", str(wanted), told, where=where)
    return match[0]


def _described(at: int, cell: str) -> tuple[str, _Column]:
    """A header as the name of its channel and a column: ``Tank.Pressure_abs [kPa]`` -> tank.pressure_abs, kPa, absolute."""
    label = cell or f"column {at + 1}"
    bracket = _BRACKETS.fullmatch(cell)
    unit: str | None
    if bracket and bracket["unit"].strip():
        stem, tail = split_header(bracket["name"], ())
        unit = bracket["unit"].strip()
        head, *words = re.sub(r"[()]", " ", unit).split() or [unit]
        if {word.lower() for word in words} <= {*_ABSOLUTE, *_GAUGE}:  # [bar abs], [bar(g)], but not [Pa s]
            unit = head
        else:
            words = []
        said = [word.lower() for word in (*tail, *words)]
    else:
        stem, tail = split_header(cell, _UNDERSCORED)
        words = [word for word in tail if word in _UNDERSCORED]
        if len(words) > 1 and words != [words[0], "g"]:
            # Is velocity_m_s in m/s, torque_N_m in N/m? Only brackets can say.
            return "_".join([stem, *tail]).lower(), _Column(at, label)
        unit = words[0] if words else None
        said = [word.lower() for word in tail if word != unit]
    if unit in _SUFFIXED:
        unit, suffix = unit[:-1], unit[-1]
        said.append("abs" if suffix == "a" else "gauge")
    if unit is not None and not _PRESSURE_WORD.match(unit):
        # The gauge of "strain_gauge [V]" and the like belongs to the name.
        return "_".join([stem, *said]), _Column(at, label, unit)
    if any(word in _ABSOLUTE for word in said):
        return stem + "_abs", _Column(at, label, unit, "absolute")
    return stem, _Column(at, label, unit, "gauge" if said else None)


def _zero(name: str, zeros: float | Mapping[str, float], where: str) -> float:
    zero = zeros.get(name, 0.0) if isinstance(zeros, Mapping) else zeros
    if not math.isfinite(zero):
        raise InputError("pressure_zero", zero, "allowed is a finite pressure [Pa]", where=where)
    return zero


def _values(name: str, column: _Column, given: str | None, rows: Rows, where: str) -> tuple[np.ndarray, str]:
    """The numbers of a column and their SI unit."""
    unit = given or column.unit
    if unit is None:
        allowed = f"write it into the header, such as '{name} [kPa]', or give units={{'{name}': ..}}"
        raise InputError(f"unit of {name}", "no unit", allowed, where=where)
    si, scale, offset = si_of(unit, field=f"unit of {name} ({column.label})", where=where)
    numbers = to_numbers([row[column.at] for _, row in rows], [n for n, _ in rows], column.label, where)
    return numbers * scale + offset, si


def _time(column: _Column | None, given: str | None, period: float | None, rows: Rows, where: str) -> np.ndarray:
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
        allowed = "name it with columns={'time': ..}, or give the period [s] of the samples"
        raise InputError("time", "no column", allowed, where=where)
    time, unit = _values("time", column, given or column.unit or "s", rows, where)
    if unit != "s":
        raise InputError(column.label, given or column.unit, "allowed is a time such as s or ms", where=where)
    steps = np.diff(time)
    if not (steps > 0.0).all():
        i = int(np.argmin(steps > 0.0))
        told = f"{time[i + 1]!s} s after {time[i]!s} s"
        allowed = "allowed are increasing times, each once"
        raise InputError(f"{column.label}, row {rows[i + 1][0]}", told, allowed, where=where)
    usual = float(np.median(steps))
    # Stamps are decimals: an interval of three times the median may be a bit longer in binary.
    if steps.max() > LARGEST_GAP * usual * (1.0 + 1e-9) + 4.0 * np.spacing(np.abs(time).max()):
        i = int(steps.argmax())
        told = f"{steps[i]:.6g} s after the row before, at {time[i + 1]:.6g} s"
        allowed = f"a gap; allowed is {LARGEST_GAP:g} times the usual interval, {LARGEST_GAP * usual:.6g} s"
        raise InputError(f"{column.label}, row {rows[i + 1][0]}", told, allowed, where=where)
    return time


def _check_vacuum(name: str, column: _Column, values: np.ndarray, ambient: float, rows: Rows, where: str) -> None:
    absolute = name.endswith("_abs")
    lowest = 0.0 if absolute else -ambient
    if values.min() < lowest:
        i = int(np.argmax(values < lowest))
        kind = "absolute" if absolute else "gauge"
        allowed = f"below vacuum; allowed is {with_unit(lowest, 'Pa')} {kind} or more; wrong unit, or zero?"
        field = f"{name} ({column.label}), row {rows[i][0]}"
        raise InputError(field, with_unit(float(values[i]), "Pa"), allowed, where=where)


def _check_alive(channels: Mapping[str, Channel], where: str) -> None:
    sensors = {n: c for n, c in channels.items() if c.kind != "command"} or channels
    if all(np.ptp(c.values) == 0.0 for c in sensors.values()):
        name, channel = next(iter(sensors.items()))
        value = f"{with_unit(float(channel.values[0]), channel.unit)} throughout"
        raise InputError(name, value, "no channel changes; allowed is a record in which something happens", where=where)


def _source(path: str | Path, found: Mapping[str, _Column], units: Mapping[str, str], zero: Any) -> dict[str, Any]:
    """Where the channels come from, for the meta."""
    told = {name: {"column": c.label, "unit": units.get(name) or c.unit} for name, c in found.items()}
    return {"file": Path(path).name, "columns": told, "pressure_zero": zero}
