"""Headers of others: which channel, unit and reference of a pressure the name of a column tells, and what it may hold."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..quantities import with_unit
from .recording import check_name
from .text import split_header

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


class Column(NamedTuple):
    """Where a channel is found: number from 0, the words for complaints, its unit, absolute or gauge where that is said."""

    at: int
    label: str
    unit: str | None = None
    reference: str | None = None


def described(at: int, cell: str) -> tuple[str, Column]:
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
            return "_".join([stem, *tail]).lower(), Column(at, label)
        unit = words[0] if words else None
        said = [word.lower() for word in tail if word != unit]
    if unit in _SUFFIXED:
        unit, suffix = unit[:-1], unit[-1]
        said.append("abs" if suffix == "a" else "gauge")
    if unit is not None and not _PRESSURE_WORD.match(unit):
        # The gauge of "strain_gauge [V]" and the like belongs to the name.
        return "_".join([stem, *said]), Column(at, label, unit)
    if any(word in _ABSOLUTE for word in said):
        return stem + "_abs", Column(at, label, unit, "absolute")
    return stem, Column(at, label, unit, "gauge" if said else None)


def choose(
    header: list[str] | None, width: int, columns: dict[str, str | int], timed: bool, where: str
) -> dict[str, Column]:
    """The columns by channel name, the time among them if there is one.

    Args:
        header: cells such as ``Tank.Pressure [kPa]``, or none.
        width: number of columns.
        columns: channel name -> cell, name that a cell tells, or number from 1; empty for all.
        timed: a column named time is the time; else it must be asked for by name.
        where: how complaints name the file.
    """
    if header is None and not columns:
        allowed = "a file without a header needs the number of each column, such as time 1 and tank.pressure 2"
        raise InputError("columns", "not given", allowed, where=where, remedy="column time")
    known = [described(i, cell) for i, cell in enumerate(header or [""] * width)]
    found: dict[str, Column] = {}
    for name, wanted in columns.items():
        if name != "time":
            check_name(name, where)
        found[name] = known[_index(name, wanted, header, width, known, where)][1]
    for stem, column in known:
        # A column without a name is a row number, or a mark at the end of each line.
        if not stem or (columns and ("time" in columns or stem not in TIMES or not timed)):
            continue
        name = "time" if stem in TIMES else stem
        if name in found:
            told = f"{found[name].label}, {column.label}"
            raise InputError(
                name, told, "two columns have this name; say which one is meant", where=where, remedy=f"column {name}"
            )
        if name != "time":
            check_name(name, where)
        found[name] = column
    for name, column in found.items():
        if column.reference is not None and (column.reference == "absolute") != name.endswith("_abs"):
            allowed = f"the header says {column.reference}; names of absolute pressures, and only these, end in _abs"
            raise InputError(f"columns, {name}", column.label, allowed, where=where)
    return found


def _index(
    name: str, wanted: Any, header: list[str] | None, width: int, known: list[tuple[str, Column]], where: str
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
        told = f"the file has {', '.join(header)}" if not match else "two columns have it; give a number from 1"
        raise InputError(f"columns, {name}", str(wanted), told, where=where)
    return match[0]


def check_vacuum(
    name: str, label: str, values: np.ndarray, ambient: float, place: Callable[[int], str], where: str
) -> None:
    """Refuse a pressure below vacuum [Pa]; `place` words where value i stands, NaN are passed over."""
    absolute = name.endswith("_abs")
    lowest = 0.0 if absolute else -ambient
    below = values < lowest
    if below.any():
        i = int(np.argmax(below))
        kind = "absolute" if absolute else "gauge"
        allowed = f"below vacuum; allowed is {with_unit(lowest, 'Pa')} {kind} or more; wrong unit, or zero?"
        raise InputError(f"{name} ({label}){place(i)}", with_unit(float(values[i]), "Pa"), allowed, where=where)
