"""Columns of others become a recording: one clock, SI units, names as the laboratory writes them.

MATLAB, TDMS, Parquet and MCAP files of others are taken apart by their readers into `Given` columns; what a header's words
mean, and what is refused, is the same for all, and the same as in text tables.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from .headers import TIMES, Column, check_vacuum, choose
from .recording import Channel, Recording
from .units import is_pressure, si_of

AMBIENT = 101325.0  # [Pa], says where vacuum is


class Given(NamedTuple):
    """A column of a file.

    Args:
        label: its name there.
        values: (n,) numbers, flags or dates.
        unit: in words, where the file says one beside the name.
        clock: columns that share their samples share this word.
        time: (n,) [s] where the file implies it, by a rate or by stamps.
    """

    label: str
    values: np.ndarray
    unit: str | None = None
    clock: str = ""
    time: np.ndarray | None = None


class Imported(NamedTuple):
    """A recording, and a line for each thing that was not taken over as it is."""

    recording: Recording
    remarks: list[str]


def assembled(
    path: Path,
    given: Sequence[Given],
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
    notes: Mapping[str, Any] | None = None,
) -> Imported:
    """Make a recording of somebody else's columns.

    Args:
        path: the file, for complaints and the meta.
        given: its columns.
        columns: channel name -> label or number of a column from 1; empty for all.
        units: channel name or label -> unit in words, over what the file says; a time without a unit is in seconds.
        period: interval of the samples [s] where the file has no time.
        notes: what else the file says, for the meta.

    Raises:
        InputError: names file, column, value and what is allowed.
    """
    where = str(path)
    usable = [one for one in given if one.values.dtype.kind in "fiubM" and one.values.ndim == 1]
    remarks = [f"{g.label} is left out: {_why(g.values)}" for g in given if not any(g is one for one in usable)]
    if not usable:
        raise InputError("columns", "none", "allowed is a file with at least one column of numbers", where=where)
    usable = stripped(usable)
    found = _found(usable, dict(columns or {}), period is None, where)
    words = _units(found, usable, dict(units or {}), where)
    clock, left = _clock(found, usable, bool(columns), where)
    remarks += left
    time, start = _time(found.pop("time", None), usable, clock, words, period, where)
    channels: dict[str, Channel] = {}
    for name, column in found.items():
        channels[name] = _channel(name, column, usable[column.at], words.get(name), where)
    if not channels:
        raise InputError("channels", "none", "allowed is at least one column beside the time", where=where)
    told = {n: {"column": usable[c.at].label, "unit": words.get(n)} for n, c in found.items()}
    source = {"file": path.name, "columns": told, **({"start": start} if start else {}), **(notes or {})}
    try:
        return Imported(Recording(time, channels, {"title": path.name, "source": source}), remarks)
    except InputError as error:
        raise error.at(where) from None


def _why(values: np.ndarray) -> str:
    if values.ndim != 1:
        return f"its shape is {' x '.join(map(str, values.shape))}, and a channel is one row of numbers"
    return "it holds no real numbers"


def stripped(given: Sequence[Given]) -> list[Given]:
    """Without the struct, group or topic in front of every name."""
    first = given[0].label.partition(".")[0] + "."
    if not all(one.label.startswith(first) and len(one.label) > len(first) for one in given):
        return list(given)
    return [one._replace(label=one.label[len(first) :]) for one in given]


def _found(given: Sequence[Given], columns: dict[str, str | int], timed: bool, where: str) -> dict[str, Column]:
    labels = [one.label for one in given]
    # A label is found as the file writes it; what the header's words mean decides only then.
    asked = {n: labels.index(c) + 1 if isinstance(c, str) and labels.count(c) == 1 else c for n, c in columns.items()}
    cells = [f"{g.label} [{g.unit}]" if g.unit and "[" not in g.label else g.label for g in given]
    return choose(cells, len(cells), asked, timed, where)


def _units(
    found: Mapping[str, Column], given: Sequence[Given], units: dict[str, str], where: str
) -> dict[str, str | None]:
    """The unit in words of each channel that is read, the time among them."""
    labels = {given[column.at].label: name for name, column in found.items()}
    words = {name: column.unit for name, column in found.items()}
    for key, unit in units.items():
        name = key if key in found else labels.get(key)
        if name is None:
            raise InputError("unit", key, f"the columns are {', '.join(found)}", where=where)
        words[name] = unit
    return words


def _clock(found: dict[str, Column], given: Sequence[Given], chosen: bool, where: str) -> tuple[str, list[str]]:
    """The one clock of all channels; columns of others are taken out of `found`, if the file has a time that says which."""
    clocks = dict.fromkeys(given[column.at].clock for column in found.values())
    if len(clocks) == 1:
        return next(iter(clocks)), []
    if chosen or "time" not in found:
        told = "; ".join(
            f"{clock}: {', '.join(n for n, c in found.items() if given[c.at].clock == clock)[:80]}" for clock in clocks
        )
        allowed = "a recording has one time; choose columns that share theirs"
        raise InputError("columns", f"of {len(clocks)} clocks ({told})", allowed, where=where, remedy="column NAME")
    kept = given[found["time"].at].clock
    others = [name for name, column in found.items() if given[column.at].clock != kept]
    lines = [f"{given[found[n].at].label} is left out: its samples are not those of the time" for n in others]
    for name in others:
        del found[name]
    return kept, lines


def _time(
    column: Column | None,
    given: Sequence[Given],
    clock: str,
    words: Mapping[str, str | None],
    period: float | None,
    where: str,
) -> tuple[np.ndarray, str | None]:
    """The time [s], and the date of its beginning where the file has dates."""
    count, implied = next((len(g.values), g.time) for g in given if g.clock == clock)
    if period is not None:
        if column is not None:
            allowed = f"the file has the time {given[column.at].label}; give one of the two"
            raise InputError("period", period, allowed, where=where)
        if not (math.isfinite(period) and period > 0.0):
            raise InputError("period", period, "allowed is a time above 0 s", where=where)
        return np.arange(count) * float(period), None
    if column is None:
        if implied is not None:
            return implied, None
        allowed = f"known are columns named {', '.join(TIMES)}; say which one it is, or state the period of the samples"
        raise InputError("time", "no column", allowed, where=where, remedy="column time")
    values = given[column.at].values
    if values.dtype.kind == "M":
        return _seconds(values), str(values[0]) if len(values) else None
    unit, scale, offset = si_of(words.get("time") or "s", field=f"unit of time ({column.label})", where=where)
    if unit != "s":
        raise InputError(
            f"unit of time ({column.label})", words["time"], "allowed is a time such as s or ms", where=where
        )
    return values * scale + offset if scale != 1.0 or offset else values.astype(float), None


def _seconds(dates: np.ndarray) -> np.ndarray:
    """Seconds since the first of some dates."""
    known = dates.astype("datetime64[ns]")
    return np.where(np.isnat(known), np.nan, (known - known[:1]).astype("int64") * 1e-9)


def _channel(name: str, column: Column, given: Given, unit: str | None, where: str) -> Channel:
    values = given.values
    if values.dtype.kind == "M":
        allowed = "only the time is a date; read the column as the time"
        raise InputError(f"{name} ({given.label})", "dates", allowed, where=where, remedy="column time")
    if unit is None and values.dtype.kind == "b":
        unit = "1"
    if unit is None:
        allowed = "say it: bar, kPa, N, mm, V, 1, .."
        raise InputError(f"unit of {name} ({given.label})", "no unit", allowed, where=where, remedy=f"unit {name}")
    si, scale, offset = si_of(unit, field=f"unit of {name} ({given.label})", where=where)
    numbers = values.astype(float)
    if scale != 1.0 or offset:
        numbers = numbers * scale + offset
    if is_pressure(si):
        check_vacuum(name, given.label, numbers, AMBIENT, lambda i: f", sample {i + 1}", where)
    kind = "command" if name.split(".")[-1] == "command" else "measured"
    return Channel(numbers, si, kind)
