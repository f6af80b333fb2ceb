"""MATLAB files: written as version 5, read as version 5 and 7.3.

Written are ``time``, a column per channel under a name that MATLAB allows, the struct ``units`` with the unit of each, and
``mckibben``, a line of JSON with names, kinds, meanings and meta. Of another program's file vectors are read, nested structs
too; a struct ``units`` in it says units.
"""

from __future__ import annotations

import os
import re
import struct
import warnings
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..documents import JsonValue
from ..errors import InputError
from ..extras import library
from ._seal import check_self_contained
from ._sidecar import KEY, dumps, loads, one_line, unreadable
from .formats import FileFormat, ForeignColumn, ForeignTable, ImportResult
from .recording import Recording
from .text import plain_names

_LARGEST = 2**31 - 1  # [B] of a variable of version 5
_KEYWORDS = frozenset(
    "break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd"
    " switch try while".split()
)
# Compressed variables have a checksum.
_KEPT: dict[str, Any] = {"long_field_names": True, "do_compression": True}
_PLAIN, _COMPRESSED = 14, 15  # types of variables
_BLOCK = 1 << 20  # [B]
_DEEPEST = 20  # structs in structs


def write_matlab(recording: Recording, path: Path) -> list[str]:
    """Write a ``.mat`` file of version 5; a remark states which names MATLAB would not permit."""
    from scipy.io import savemat

    if len(recording) * 8 > _LARGEST:
        allowed = f"a MATLAB file of version 5 holds {_LARGEST // 8}; take netCDF, which MATLAB reads too"
        raise InputError("samples", len(recording), allowed, where=str(path))
    names = matlab_names(recording.channels)
    columns = {plain: recording[name] for plain, name in zip(names, recording.channels, strict=True)}
    units = {plain: recording.unit(name) for plain, name in zip(names, recording.channels, strict=True)}
    more = {"units": {"time": "s", **units}, KEY: dumps(recording.channels, recording.meta)}
    savemat(path, {"time": recording.time, **columns, **more}, appendmat=False, oned_as="column", **_KEPT)
    renamed = [(name, plain) for name, plain in zip(recording.channels, names, strict=True) if name != plain]
    if not renamed:
        return []
    name, plain = renamed[0]
    example = f"such as {plain} for {name}; mckibben reads the names as they were"
    return [f"{len(renamed)} names are written as MATLAB allows them, {example}"]


def matlab_names(names: Iterable[str]) -> list[str]:
    """Names of channels as MATLAB allows them, none taken twice."""
    reserved = ["time", "units", KEY]
    return plain_names([*reserved, *names], _allowed)[len(reserved) :]


def _allowed(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return f"x{plain}" if plain in _KEYWORDS else plain


def read_matlab(path: Path) -> ImportResult | ForeignTable:
    """Read a recording of mckibben, or of another program's file the vectors, with small values for the metadata.

    Raises:
        InputError: the file cannot be read, or a newer version wrote it.
    """
    where = str(path)
    library("pymatreader", "MATLAB files need", where=where)
    with unreadable("a MATLAB file", where):
        _check_structure(path)
        variables, warned = content(path)
    remarks = list(dict.fromkeys(warned))
    line = variables.get(KEY)
    if isinstance(line, str) and line.startswith("{"):
        sidecar = loads(line, where)
        # the reader makes one number of an array of one
        numbers = {k: np.atleast_1d(v) for k, v in variables.items() if isinstance(v, np.ndarray | int | float)}
        recording = sidecar.from_columns(numbers, "time", matlab_names(sidecar.channels), where)
        return ImportResult(recording, [])
    units = variables.get("units")
    words = {k: v for k, v in units.items() if isinstance(v, str)} if isinstance(units, Mapping) else {}
    columns: list[ForeignColumn] = []
    notes: dict[str, Any] = {}
    for label, value in _leaves({k: v for k, v in sorted(variables.items()) if k != "units" or not words}, "", 0):
        array = np.asarray(value) if isinstance(value, np.ndarray | list) else None
        if array is not None and array.ndim and array.size > 1:
            unit = words.get(label, words.get(label.rpartition(".")[2]))
            columns.append(ForeignColumn(label, array, unit, f"{len(array)} samples"))
        elif isinstance(value, str | int | float | bool | np.number | np.bool_):
            notes[label] = value.item() if isinstance(value, np.generic) else value
    return ForeignTable(columns, {"values": {k.replace("$", "_"): v for k, v in notes.items()}}, remarks)


def content(path: str | Path) -> tuple[dict[str, JsonValue], list[str]]:
    """The variables of a file, and the reader's warnings."""
    import pymatreader

    check_self_contained(path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        variables = pymatreader.read_mat(path)
    return variables, [one_line(w.message) for w in caught if isinstance(w.message, Warning)]


def _check_structure(path: Path) -> None:
    """Refuse a file of version 5 with a variable whose length or checksum is wrong; scipy may crash on it."""
    with open(path, "rb") as stream:
        head, size = stream.read(520), os.fstat(stream.fileno()).st_size
        if head[512:] == b"\x89HDF\r\n\x1a\n":
            return
        if head[124:128] != b"\x00\x01IM":
            # version 4 begins with a small number, and 5 may come from a machine with the other order of bytes
            if len(head) < 20 or not (0 in head[:4] or head[124:128] == b"\x01\x00MI"):
                raise ValueError("its head is none of version 4, 5 or 7.3")
            return
        at = 128
        while at < size:
            stream.seek(at)
            kind, length = struct.unpack("<II", stream.read(8))
            if kind not in (_PLAIN, _COMPRESSED) or at + 8 + length > size:
                raise ValueError("a variable is damaged or cut off")
            if kind == _PLAIN:
                return
            unpacker, left = zlib.decompressobj(), length
            while left:
                block = stream.read(min(left, _BLOCK))
                left -= len(block)
                while block:
                    unpacker.decompress(block, _BLOCK)
                    block = unpacker.unconsumed_tail
            if not unpacker.eof:
                raise ValueError("a variable is cut off")
            at += 8 + length


def _leaves(tree: Mapping[str, JsonValue], before: str, depth: int) -> list[tuple[str, Any]]:
    """All values that are no structs, under their dotted names."""
    leaves: list[tuple[str, Any]] = []
    for key, value in tree.items():
        if key.startswith("__"):
            continue
        if isinstance(value, Mapping) and depth < _DEEPEST:
            leaves += _leaves(dict(sorted(value.items())), f"{before}{key}.", depth + 1)
        else:
            leaves.append((f"{before}{key}", value))
    return leaves


FORMAT = FileFormat(title="MATLAB files", read=read_matlab, write=write_matlab)
