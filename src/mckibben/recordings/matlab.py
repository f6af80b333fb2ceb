"""MATLAB files: written as version 5, read as version 5 and 7.3.

Written are ``time``, a column per channel under a name that MATLAB allows, the struct ``units`` with the unit of each, and
``mckibben``, a line of JSON with names, kinds, meanings and meta. Of somebody else's file vectors are read, nested structs
too; a struct ``units`` in it says units.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .extras import needed
from .imports import Given
from .recording import Recording
from .sidecar import KEY, one_line, retold, told
from .text import plain_names

_LARGEST = 2**31 - 1  # [B] of a variable of version 5
_DEEPEST = 20  # structs in structs


def write_matlab(recording: Recording, path: Path) -> None:
    """Write a ``.mat`` file of version 5."""
    from scipy.io import savemat

    if len(recording) * 8 > _LARGEST:
        allowed = f"a MATLAB file of version 5 holds {_LARGEST // 8}; take netCDF, which MATLAB reads too"
        raise InputError("samples", len(recording), allowed, where=str(path))
    names = matlab_names(recording.channels)
    columns = {plain: recording[name] for plain, name in zip(names, recording.channels, strict=True)}
    units = {plain: recording.unit(name) for plain, name in zip(names, recording.channels, strict=True)}
    more = {"units": {"time": "s", **units}, KEY: told(recording.channels, recording.meta)}
    savemat(path, {"time": recording.time, **columns, **more}, appendmat=False, long_field_names=True, oned_as="column")


def matlab_names(names: Iterable[str]) -> list[str]:
    """Names of channels as MATLAB allows them, none taken twice."""
    own = ["time", "units", KEY]
    return plain_names([*own, *names], lambda name: re.sub(r"[^A-Za-z0-9_]", "_", name))[len(own) :]


def read_matlab(path: Path) -> Recording | tuple[list[Given], dict[str, Any], list[str]]:
    """A recording of mckibben, or of somebody else's file the columns, the small things for the meta, and remarks.

    Raises:
        InputError: the file cannot be read, or a newer version wrote it.
    """
    where = str(path)
    reader = needed("pymatreader", "pymatreader", "MATLAB files", where)
    remarks: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as told_of:
            warnings.simplefilter("always")
            found = reader.read_mat(path)
        remarks += dict.fromkeys(one_line(w.message) for w in told_of if isinstance(w.message, Warning))
    except Exception as error:  # whatever scipy and h5py meet in a broken file
        raise InputError("file", "unreadable", f"allowed is a MATLAB file ({one_line(error)})", where=where) from None
    line = found.get(KEY)
    if isinstance(line, str) and line.startswith("{"):
        known = retold(line, where)
        # the reader makes one number of an array of one
        numbers = {k: np.atleast_1d(v) for k, v in found.items() if isinstance(v, np.ndarray | int | float)}
        return known.of(numbers, "time", matlab_names(known.channels), where)
    units = found.get("units")
    words = {k: v for k, v in units.items() if isinstance(v, str)} if isinstance(units, Mapping) else {}
    given: list[Given] = []
    notes: dict[str, Any] = {}
    for label, value in _leaves({k: v for k, v in sorted(found.items()) if k != "units" or not words}, "", 0):
        array = np.asarray(value) if isinstance(value, np.ndarray | list) else None
        if array is not None and array.ndim and array.size > 1:
            unit = words.get(label, words.get(label.rpartition(".")[2]))
            given.append(Given(label, array, unit, f"{len(array)} samples"))
        elif isinstance(value, str | int | float | bool | np.number | np.bool_):
            notes[label] = value.item() if isinstance(value, np.generic) else value
    return given, {"values": {k.replace("$", "_"): v for k, v in notes.items()}}, remarks


def _leaves(found: Mapping[str, Any], before: str, depth: int) -> list[tuple[str, Any]]:
    """Everything that is no struct, under its dotted name."""
    leaves: list[tuple[str, Any]] = []
    for key, value in found.items():
        if key.startswith("__"):
            continue
        if isinstance(value, Mapping) and depth < _DEEPEST:
            leaves += _leaves(dict(sorted(value.items())), f"{before}{key}.", depth + 1)
        else:
            leaves.append((f"{before}{key}", value))
    return leaves
