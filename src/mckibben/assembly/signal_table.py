"""The points of a signal from a measured table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..recordings import read_record


def read_points(
    path: Path, time: str | None, column: str | None, unit: str, *, field: str, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values [unit] of one column.

    Args:
        path: a CSV file as `read_record` takes it.
        time: header of its times; found by itself by default.
        column: header of its values; the only other column by default.
        unit: SI unit of the signal; a pressure is gauge.
        field: dotted path of the signal, for error messages.
        where: the file that names the table, for error messages.

    Raises:
        InputError: names what the table lacks.
    """
    columns = None if column is None else {"value": column} | ({"time": time} if time else {})
    if column is None and time is not None:
        raise InputError(f"{field}.column", None, "must name a column of the header, as time does", where=where)
    record = read_record(path, columns=columns)
    names = record.names()
    if len(names) != 1:
        raise InputError(
            f"{field}.column", None, f"is missing: the table has {', '.join(names)}; name one", where=where
        )
    (name,) = names
    if record.unit(name) != unit or name.endswith("_abs"):
        column_name = f"{name} in {record.unit(name)}"
        gauge = ", gauge" if unit == "Pa" else ""
        raise InputError(f"{field}.column", column_name, f"the signal is in {unit}{gauge}", where=where)
    return record.time, record[name]
