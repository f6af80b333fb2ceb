"""The records of the loops' study: a slow loop of pressure and stroke, and two steps of pressure with creep.

They are those of a Festo DMSP-10-250 (tbazina/pam_lqi_pid; no licence stated, not shipped): a folder with
``pressure_stroke_loop.csv`` (``branch`` up or down, ``p_sensor_V``, ``stroke_mm``, ``p_bar_gauge``) and
``step_response_100hz.csv`` (``segment`` step_up or step_down, ``t_since_segment_start_s``, ``stroke_mm``,
``p_bar_sensor``). The sensor's volts are read by its sheet and not cut off at zero, as the table's own pressures are.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import InputError, MissingDataError
from ..identification.path_record import PathRecord
from ..quantities import to_si
from ..recordings.text import check_width, read_rows, to_numbers

LOOP, STEPS = "pressure_stroke_loop.csv", "step_response_100hz.csv"
SEGMENTS = ("step_up", "step_down")
SENSOR, SENSOR_ZERO = 0.9, -1.0  # by its sheet [bar/V], [bar]
AGREES = 1e-3  # between the volts and the table's own pressures, four decimals [bar]


def read_loop(folder: str | Path) -> PathRecord:
    """The loop of a folder, pressures from the sensor's volts.

    Raises:
        MissingDataError: if the file is not there.
        InputError: names file, column and what is wrong.
    """
    path = _file(folder, LOOP)
    words, numbers = _columns(path, "branch", ("p_sensor_V", "stroke_mm", "p_bar_gauge"))
    bar = SENSOR * numbers["p_sensor_V"] + SENSOR_ZERO
    off = float(np.abs(np.maximum(bar, 0.0) - numbers["p_bar_gauge"]).max())
    if off > AGREES:
        allowed = f"allowed is {SENSOR:g} bar/V less {-SENSOR_ZERO:g} bar, which the volts give, to {AGREES:g} bar"
        raise InputError("p_bar_gauge", f"off by {off:.3g} bar", allowed, where=str(path))
    _only(words, ("up", "down"), "branch", path)
    found = PathRecord(
        to_si(1.0, "bar", "Pa", field="pressure") * bar,
        to_si(1.0, "mm", "m", field="stroke") * numbers["stroke_mm"],
        str(path),
    )
    agreed = float(np.mean((found.branch == 1) == (words == "up")))
    if agreed < 0.9:
        allowed = "allowed is up while the pressure rises and down while it falls"
        raise InputError("branch", f"right in {agreed:.0%} of the rows", allowed, where=str(path))
    return found


def read_steps(folder: str | Path) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Time since the step [s], stroke [m] and gauge pressure [Pa] of each segment of a folder; raises as `read_loop`."""
    path = _file(folder, STEPS)
    words, numbers = _columns(path, "segment", ("t_since_segment_start_s", "stroke_mm", "p_bar_sensor"))
    _only(words, SEGMENTS, "segment", path)
    time, stroke = numbers["t_since_segment_start_s"], to_si(1.0, "mm", "m", field="stroke") * numbers["stroke_mm"]
    pressure = to_si(1.0, "bar", "Pa", field="pressure") * numbers["p_bar_sensor"]
    return {s: (time[words == s], stroke[words == s], pressure[words == s]) for s in SEGMENTS}


def _file(folder: str | Path, name: str) -> Path:
    path = Path(folder) / name
    if not path.is_file():
        raise MissingDataError(f"{folder}: no {name}; allowed is a folder that holds {LOOP} and {STEPS}")
    return path


def _columns(path: Path, word: str, names: tuple[str, ...]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A column of words and columns of numbers of a file, each (n,)."""
    where, lines = str(path), read_rows(path, str(path))
    header = [cell.strip() for cell in lines[0][1]] if lines else []
    for name in (word, *names):
        if header.count(name) != 1:
            raise InputError(name, "no column", f"the file has {', '.join(header) or 'nothing'}", where=where)
    rows = lines[1:]
    if not rows:
        raise InputError("file", "0 rows", "allowed is a header and its rows", where=where)
    check_width(rows, len(header), f"the header has {len(header)} columns", where)
    at = {name: header.index(name) for name in (word, *names)}
    count = [n for n, _ in rows]
    words = np.array([row[at[word]].strip() for _, row in rows])
    return words, {n: to_numbers([row[at[n]] for _, row in rows], count, n, where) for n in names}


def _only(words: np.ndarray, allowed: tuple[str, ...], field: str, path: Path) -> None:
    if set(words) != set(allowed):
        told = ", ".join(sorted(set(words)))
        raise InputError(field, told, f"allowed is {' and '.join(allowed)}, each of them", where=str(path))
