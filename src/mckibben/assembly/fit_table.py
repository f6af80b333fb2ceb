"""The [fit] table of a circuit's file: what is free, where the search starts, and how its records are read.

[fit]
free = ["elements.tube.friction_scale", "elements.valve_*.passage.conductance"]
start = { "elements.tube.friction_scale" = 1.2 }
columns = { time = 1, "tank.pressure" = 2 }        # of records that have other names, or no header
units = { "tank.pressure" = "kPa" }
pressure_zero = "9 kPa"                            # what the sensors read at zero
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..schema import FileTable

KEYS = ("free", "start", "columns", "units", "pressure_zero")


@dataclass(frozen=True)
class FitTable:
    """What the file says of a fit; the command line adds to it."""

    free: tuple[str, ...] = ()
    start: dict[str, str | float] = field(default_factory=dict)
    columns: dict[str, str | int] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    pressure_zero: float = 0.0


def read_fit(entry: FileTable) -> FitTable:
    """The table as a value.

    Raises:
        InputError: names the key, its value and what is allowed.
    """
    entry.only(KEYS, "a fit has")
    free = entry.values.get("free", [])
    if not isinstance(free, list) or not all(isinstance(path, str) for path in free):
        raise entry.fail("free", str(free), "must be a list of dotted paths")
    return FitTable(
        free=tuple(free),
        start=_table(entry, "start", (str, int, float), "a value in words"),
        columns=_table(entry, "columns", (str, int), "the name or the number of a column"),
        units=_table(entry, "units", (str,), "a unit in words"),
        pressure_zero=entry.number("pressure_zero", "Pa", 0.0),
    )


def _table(entry: FileTable, key: str, kinds: tuple[type, ...], allowed: str) -> dict[str, Any]:
    values = entry.table(key).values
    for name, value in values.items():
        if not isinstance(value, kinds) or isinstance(value, bool):
            raise entry.fail(f"{key}.{name}", str(value), f"must be {allowed}")
    return dict(values)
