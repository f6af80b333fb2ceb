"""Columns of other programs become channels: what a header means, one clock, SI units, and what is refused.

Text, MATLAB, TDMS, Parquet and MCAP files are taken apart by their readers; from there on all are treated alike.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..quantities import with_unit
from .formats import ForeignColumn, ImportResult
from .recording import Channel, Recording, check_name
from .text import split_header
from .units import is_pressure, si_of

AMBIENT = 101325.0  # [Pa], says where vacuum is
TIMES = ("time", "t", "timestamp")
# Units that a header may hold after an underscore; in brackets any unit is read.
_UNDERSCORED = frozenset(
    "Pa kPa MPa hPa bar mbar psi bara barg psia psig s ms us m mm cm N kN mN V mV A mA K degC kg g rad deg Hz percent"
    " fraction".split()
)
_BRACKETS = re.compile(r"(?P<name>.*?\S)\s*[\[(](?P<unit>[^\[\]()]+(?:\([^()]*\))?)[\])]\s*")
_ABSOLUTE, _GAUGE = ("abs", "absolute", "a"), ("gauge", "rel", "g")
_PRESSURE_WORD = re.compile(r"([kMh]?Pa|m?bar|psi|atm|Torr|mmHg|N/m\^2|N/mm\^2|kgf/cm\^2)\b")
_SUFFIXED = ("bara", "barg", "mbara", "mbarg", "psia", "psig")


class ColumnSource(NamedTuple):
    """Source of a channel: column number from 0, name for messages, unit, and absolute or gauge if stated."""

    at: int
    label: str
    unit: str | None = None
    reference: str | None = None


def parse_header(at: int, cell: str) -> tuple[str, ColumnSource]:
    """Read a header as channel name and column: ``Tank.Pressure_abs [kPa]`` -> tank.pressure_abs, kPa, absolute."""
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
            return "_".join([stem, *tail]).lower(), ColumnSource(at, label)
        unit = words[0] if words else None
        said = [word.lower() for word in tail if word != unit]
    if unit in _SUFFIXED:
        unit, suffix = unit[:-1], unit[-1]
        said.append("abs" if suffix == "a" else "gauge")
    if unit is not None and not _PRESSURE_WORD.match(unit):
        # The gauge of "strain_gauge [V]" and the like belongs to the name.
        return "_".join([stem, *said]), ColumnSource(at, label, unit)
    if any(word in _ABSOLUTE for word in said):
        return stem + "_abs", ColumnSource(at, label, unit, "absolute")
    return stem, ColumnSource(at, label, unit, "gauge" if said else None)


def choose_columns(
    header: list[str] | None, width: int, columns: dict[str, str | int], timed: bool, where: str
) -> dict[str, ColumnSource]:
    """Choose the columns by channel name, the time among them if there is one.

    Args:
        header: cells such as ``Tank.Pressure [kPa]``, or none.
        width: number of columns.
        columns: channel name -> cell, name that a cell tells, or number from 1; empty for all.
        timed: a column named time is the time; else it must be asked for by name.
        where: how error messages name the file.
    """
    if header is None and not columns:
        allowed = "a file without a header needs the number of each column, such as time 1 and tank.pressure 2"
        raise InputError("columns", "not given", allowed, where=where, remedy="column time")
    known = [parse_header(i, cell) for i, cell in enumerate(header or [""] * width)]
    chosen: dict[str, ColumnSource] = {}
    for name, wanted in columns.items():
        if name != "time":
            check_name(name, where)
        chosen[name] = known[_index(name, wanted, header, width, known, where)][1]
    for stem, column in known:
        # A column without a name is a row number, or a mark at the end of each line.
        if not stem or (columns and ("time" in columns or stem not in TIMES or not timed)):
            continue
        name = "time" if stem in TIMES else stem
        if name in chosen:
            both = f"{chosen[name].label}, {column.label}"
            raise InputError(
                name, both, "two columns have this name; say which one is meant", where=where, remedy=f"column {name}"
            )
        if name != "time":
            check_name(name, where)
        chosen[name] = column
    for name, column in chosen.items():
        if column.reference is not None and (column.reference == "absolute") != name.endswith("_abs"):
            allowed = f"the header says {column.reference}; names of absolute pressures, and only these, end in _abs"
            raise InputError(f"columns, {name}", column.label, allowed, where=where)
    return chosen


def _index(
    name: str, wanted: Any, header: list[str] | None, width: int, known: list[tuple[str, ColumnSource]], where: str
) -> int:
    if isinstance(wanted, int) and not isinstance(wanted, bool):
        if not 1 <= wanted <= width:
            raise InputError(f"columns, {name}", wanted, f"allowed is 1 to {width}", where=where)
        return wanted - 1
    if header is None:
        raise InputError(f"columns, {name}", str(wanted), f"no header; allowed is a number, 1 to {width}", where=where)
    match = [i for i, cell in enumerate(header) if cell == wanted]
    match = match or [i for i, (stem, _) in enumerate(known) if stem == wanted]
    if len(match) != 1:
        reason = f"the file has {', '.join(header)}" if not match else "two columns have it; give a number from 1"
        raise InputError(f"columns, {name}", str(wanted), reason, where=where)
    return match[0]


def check_vacuum(
    name: str, label: str, values: np.ndarray, ambient: float, place: Callable[[int], str], where: str
) -> None:
    """Refuse a pressure below vacuum [Pa]; `place` describes the position of value i, NaN are ignored."""
    absolute = name.endswith("_abs")
    lowest = 0.0 if absolute else -ambient
    below = values < lowest
    if below.any():
        i = int(np.argmax(below))
        kind = "absolute" if absolute else "gauge"
        allowed = f"below vacuum; allowed is {with_unit(lowest, 'Pa')} {kind} or more; wrong unit, or zero?"
        raise InputError(f"{name} ({label}){place(i)}", with_unit(float(values[i]), "Pa"), allowed, where=where)


def assemble(
    path: Path,
    foreign: Sequence[ForeignColumn],
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
    notes: Mapping[str, Any] | None = None,
) -> ImportResult:
    """Combine the columns of another program to a recording: one clock, SI units, names of this package.

    Args:
        path: the file, for messages and the metadata.
        foreign: columns of the file.
        columns: channel name -> label or number of a column from 1; empty for all.
        units: channel name or label -> unit as text, over what the file says; a time without a unit is in seconds.
        period: interval of the samples [s] where the file has no time.
        notes: further content of the file, for the metadata.

    Raises:
        InputError: names file, column, value and what is allowed.
    """
    where = str(path)
    usable = [column for column in foreign if column.values.dtype.kind in "fiubM" and column.values.ndim == 1]
    remarks = [f"{g.label} is left out: {_why(g.values)}" for g in foreign if not any(g is column for column in usable)]
    if not usable:
        raise InputError("columns", "none", "allowed is a file with at least one column of numbers", where=where)
    usable = without_common_prefix(usable)
    sources = _sources_of(usable, dict(columns or {}), period is None, where)
    words = _units(sources, usable, dict(units or {}), where)
    clock, left = _clock(sources, usable, bool(columns), where)
    remarks += left
    time, start = _time(sources.pop("time", None), usable, clock, words, period, where)
    channels: dict[str, Channel] = {}
    for name, column in sources.items():
        channels[name] = _channel(name, column, usable[column.at], words.get(name), where)
    if not channels:
        raise InputError("channels", "none", "allowed is at least one column beside the time", where=where)
    about = {n: {"column": usable[c.at].label, "unit": words.get(n)} for n, c in sources.items()}
    source = {"file": path.name, "columns": about, **({"start": start} if start else {}), **(notes or {})}
    try:
        return ImportResult(Recording(time, channels, {"title": path.name, "source": source}), remarks)
    except InputError as error:
        raise error.at(where) from None


def _why(values: np.ndarray) -> str:
    if values.ndim != 1:
        return f"its shape is {' x '.join(map(str, values.shape))}, and a channel is one row of numbers"
    return "it holds no real numbers"


def without_common_prefix(foreign: Sequence[ForeignColumn]) -> list[ForeignColumn]:
    """Drop the struct, group or topic that all labels begin with."""
    first = foreign[0].label.partition(".")[0] + "."
    if not all(one.label.startswith(first) and len(one.label) > len(first) for one in foreign):
        return list(foreign)
    return [one._replace(label=one.label[len(first) :]) for one in foreign]


def _sources_of(
    foreign: Sequence[ForeignColumn], columns: dict[str, str | int], timed: bool, where: str
) -> dict[str, ColumnSource]:
    labels = [one.label for one in foreign]
    # A label is found as the file writes it; what the header's words mean decides only then.
    asked = {n: labels.index(c) + 1 if isinstance(c, str) and labels.count(c) == 1 else c for n, c in columns.items()}
    cells = [f"{g.label} [{g.unit}]" if g.unit and "[" not in g.label else g.label for g in foreign]
    return choose_columns(cells, len(cells), asked, timed, where)


def _units(
    sources: Mapping[str, ColumnSource], foreign: Sequence[ForeignColumn], units: dict[str, str], where: str
) -> dict[str, str | None]:
    """Unit of each channel that is read, including the time."""
    labels = {foreign[column.at].label: name for name, column in sources.items()}
    words = {name: column.unit for name, column in sources.items()}
    for key, unit in units.items():
        name = key if key in sources else labels.get(key)
        if name is None:
            raise InputError("unit", key, f"the columns are {', '.join(sources)}", where=where)
        words[name] = unit
    return words


def _clock(
    sources: dict[str, ColumnSource], foreign: Sequence[ForeignColumn], chosen: bool, where: str
) -> tuple[str, list[str]]:
    """Common clock of all channels; columns with other clocks are removed if the file states which is which."""
    clocks = dict.fromkeys(foreign[column.at].clock for column in sources.values())
    if len(clocks) == 1:
        return next(iter(clocks)), []
    if chosen or "time" not in sources:
        told = "; ".join(
            f"{clock}: {', '.join(n for n, c in sources.items() if foreign[c.at].clock == clock)[:80]}"
            for clock in clocks
        )
        allowed = "a recording has one time; choose columns that share theirs"
        raise InputError("columns", f"of {len(clocks)} clocks ({told})", allowed, where=where, remedy="column NAME")
    kept = foreign[sources["time"].at].clock
    others = [name for name, column in sources.items() if foreign[column.at].clock != kept]
    lines = [f"{foreign[sources[n].at].label} is left out: its samples are not those of the time" for n in others]
    for name in others:
        del sources[name]
    return kept, lines


def _time(
    column: ColumnSource | None,
    foreign: Sequence[ForeignColumn],
    clock: str,
    words: Mapping[str, str | None],
    period: float | None,
    where: str,
) -> tuple[np.ndarray, str | None]:
    """The time [s], and the date of its beginning where the file has dates."""
    count, implied = next((len(g.values), g.time) for g in foreign if g.clock == clock)
    if period is not None:
        if column is not None:
            allowed = f"the file has the time {foreign[column.at].label}; give one of the two"
            raise InputError("period", period, allowed, where=where)
        if not (math.isfinite(period) and period > 0.0):
            raise InputError("period", period, "allowed is a time above 0 s", where=where)
        return np.arange(count) * float(period), None
    if column is None:
        if implied is not None:
            return implied, None
        allowed = f"known are columns named {', '.join(TIMES)}; say which one it is, or state the period of the samples"
        raise InputError("time", "no column", allowed, where=where, remedy="column time")
    values = foreign[column.at].values
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


def _channel(name: str, column: ColumnSource, foreign: ForeignColumn, unit: str | None, where: str) -> Channel:
    values = foreign.values
    if values.dtype.kind == "M":
        allowed = "only the time is a date; read the column as the time"
        raise InputError(f"{name} ({foreign.label})", "dates", allowed, where=where, remedy="column time")
    if unit is None and values.dtype.kind == "b":
        unit = "1"
    if unit is None:
        allowed = "say it: bar, kPa, N, mm, V, 1, .."
        raise InputError(f"unit of {name} ({foreign.label})", "no unit", allowed, where=where, remedy=f"unit {name}")
    si, scale, offset = si_of(unit, field=f"unit of {name} ({foreign.label})", where=where)
    numbers = values.astype(float)
    if scale != 1.0 or offset:
        numbers = numbers * scale + offset
    if is_pressure(si):
        check_vacuum(name, foreign.label, numbers, AMBIENT, lambda i: f", sample {i + 1}", where)
    kind = "command" if name.split(".")[-1] == "command" else "measured"
    return Channel(numbers, si, kind)
