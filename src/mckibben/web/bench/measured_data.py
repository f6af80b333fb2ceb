"""A user's own measured data on the bench, laid over the simulated loop and strips.

The page draws and subtracts; what a file means, and where its time begins, is decided here.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...analysis.channels import Cycle, find_cycles
from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ...formats.labels import quantity_of
from ...formats.registry import part_options, parts_of
from ...muscles.muscle import built_muscle
from ...recordings import ForceMap, Recording, read
from ...recordings.force_map import ALIASES
from ...specimens import Specimen
from ..charts import plain_numbers
from ..reader import check_rows, read_outside
from ..stream import places
from ..workspace import Workspace

MOST_ROWS = 5_000_000  # of a file that is read
GRID, LEAST, OVERLAP = 1500, 8, 0.7  # steps, least number, and shared part of two curves that are laid over each other
MOST = 20_000  # samples that a page is sent
UNITS = {"pressure": "Pa", "tension": "N", "length": "m"}
QUANTITIES = ("pressure", "tension", "length")


def measured_data(
    path: Path, part: str, spec: Specimen, curves: Mapping[str, JsonValue] | None = None
) -> dict[str, JsonValue]:
    """Read a file of measurements for the bench, in a separate process if it is large.

    Args:
        path: a recording, or a file of another program that `recordings.read` takes.
        part: sheet or topic, where one is chosen.
        spec: the muscle on the bench, whose rest length a contraction refers to.
        curves: expected channels of the dry run, on whose time the data are put; None: they stay where they are.

    Returns:
        ``time`` [s] or None, ``pressure``, ``tension`` and ``length`` [SI] (n,) as far as they were measured; ``shift``,
        added to the time it meets the dry run [s]; ``cycle``, the first and last sample of the last full cycle;
        of a map without time ``law``, the tension of the muscle's law at each of its points [N]; ``option`` and ``parts``,
        the sheets or topics that can be chosen, and ``part``, the chosen one.

    Raises:
        InputError: the file cannot be read, or has no tension; says what is missing.
    """
    option, parts = read_outside(parts_of, path)
    for tried in [part] if part or not parts else ["", *parts]:
        try:
            plain = dict(_kept(str(path), path.stat().st_mtime_ns, tried, built_muscle(spec).rest_length))
            break
        except MckibbenError:
            if tried == (part if part or not parts else parts[-1]):
                raise
    if plain["time"] is None:
        known = plain["length"] is not None and plain["pressure"] is not None
        points = (np.asarray(plain[name]) for name in ("length", "pressure"))
        plain["law"] = plain_numbers(built_muscle(spec).tension(*points)) if known else None
    elif curves:
        plain["shift"] = _shift(plain, curves)
    return {**plain, "name": path.name, "option": option, "parts": parts, "part": tried}


def find(workspace: Workspace, name: str) -> Path:
    """Path of a recording, or of an uploaded file, by its name; refused if there is none."""
    try:
        return workspace.recordings.found(name)
    except InputError:
        return workspace.uploads.found(name)


@functools.lru_cache(maxsize=8)
def _kept(path: str, changed: int, part: str, rest_length: float | None) -> dict[str, Any]:
    columns: dict[str, Any] = read_outside(_columns, Path(path), part, rest_length)
    return columns


def _shift(plain: Mapping[str, Any], curves: Mapping[str, Any]) -> float:
    """Shift of the time for which the measured length, else pressure or tension, is nearest to the expected one [s]."""
    for name in ("length", "pressure", "tension"):
        if plain[name] is None or curves.get(name) is None:
            continue
        both = [np.array([one["time"], one[name]], float) for one in (plain, curves)]  # None becomes NaN
        (t, y), (at, expected) = (one[:, np.isfinite(one).all(axis=0)] for one in both)
        if len(t) < LEAST or len(at) < LEAST or np.ptp(expected) <= 0.0:
            continue
        step = max(t[-1] - t[0], at[-1] - at[0]) / GRID
        own = np.interp(np.arange(t[0], t[-1], step), t, y)
        other = np.interp(np.arange(at[0], at[-1], step), at, expected)
        # so many steps of the shorter one must lie beside the longer one
        need = max(LEAST // 2, round(OVERLAP * min(len(own), len(other))))
        lags = np.arange(need - len(own), len(other) - need + 1)
        errors = [np.mean((own[max(0, -k) : len(other) - k] - other[max(0, k) : k + len(own)]) ** 2) for k in lags]
        best = int(np.argmin(errors))
        a, b, c = (errors[min(max(best + i, 0), len(errors) - 1)] for i in (-1, 0, 1))
        between = 0.5 * (a - c) / (a - 2.0 * b + c) if a > b < c else 0.0  # of the parabola through the three
        return float(at[0] - t[0] + step * (lags[best] + between))
    return 0.0


def _columns(path: Path, part: str, rest_length: float | None) -> dict[str, Any]:
    check_rows(path, MOST_ROWS, "the bench")
    try:
        data = read(path, rest_length=rest_length, **part_options(path, part))
    except InputError as error:
        if error.field not in ("rest_length", "rest length"):
            raise
        data = read(path, **part_options(path, part))
    if isinstance(data, ForceMap):
        some = _some(len(data))
        columns = {name: plain_numbers(getattr(data, name)[some]) for name in QUANTITIES}
        return {"time": None, **columns, "cycle": None}
    return _of_recording(data)


def _of_recording(record: Recording) -> dict[str, Any]:
    # what another program has named, such as ``force`` and ``position``, with the right unit; else as recordings name it
    named: dict[str, str] = {}
    for name in record.names():
        quantity = ALIASES.get(words := quantity_of(name.rpartition(".")[2]) or "", words)
        if record.unit(name) == UNITS.get(quantity):
            named.setdefault(quantity, name)
    there = {**named, **places(record)}
    if "tension" not in there:
        raise InputError("tension", None, "is missing: the bench compares tensions")
    some = _some(len(record))
    columns = {name: plain_numbers(record[there[name]][some]) if name in there else None for name in QUANTITIES}
    cycles: tuple[Cycle, ...] = ()
    if "length" in there:
        try:
            cycles = find_cycles(record[there["length"]])
        except MckibbenError:
            pass  # it does not go to and fro
    step = some[1] - some[0] if len(some) > 1 else 1
    last = [int(cycles[-1].start // step), int(min(cycles[-1].end // step, len(some) - 1))] if cycles else None
    return {"time": plain_numbers(record.time[some]), **columns, "cycle": last}


def _some(count: int) -> np.ndarray:
    return np.arange(0, count, max(1, -(-count // MOST)))
