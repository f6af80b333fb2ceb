"""HDF5 files of other programs, with the units that attributes state; and what guards files that HDF5 reads.

The seal of a netCDF file is a digest of all before it, which HDF5 does not look at: a file whose seal is whole is as it
was written, unless somebody forged it. It is no reason to trust a file: whatever HDF5 parses, it parses in a process that
may be ended.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ._sidecar import unreadable
from .formats import FileFormat, ForeignColumn, ForeignTable

UNITS = ("units", "unit", "Units", "Unit")  # attributes that state a unit


class Dataset(NamedTuple):
    """A data set of an HDF5 file: path in the file, values, and attributes in words."""

    name: str
    values: np.ndarray
    attrs: dict[str, str]


def content(path: str | Path) -> tuple[list[Dataset], dict[str, str]]:
    """The data sets of a file, and the attributes of its root."""
    import h5py

    check_self_contained(path)
    sets: list[Dataset] = []
    with h5py.File(path, "r") as file:

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiubV" and item.ndim:
                sets.append(Dataset(name, item[...], _words(item.attrs)))

        file.visititems(visit)
        return sets, _words(file.attrs)


def _words(attrs: Any) -> dict[str, str]:
    return {str(k): v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v)[:200] for k, v in attrs.items()}


def read_hdf5(path: Path) -> ForeignTable:
    """Read the rows of numbers of a file; groups become the first words of the labels.

    Raises:
        InputError: the file cannot be read, or takes its numbers from other files.
    """
    with unreadable("an HDF5 file", str(path)):
        sets, attributes = content(path)
    columns: list[ForeignColumn] = []
    remarks: list[str] = []
    for one in sets:
        label = one.name.replace("/", ".")
        unit = next((one.attrs[key] for key in UNITS if one.attrs.get(key)), None)
        clock = f"{one.name.rpartition('/')[0]} {len(one.values)} samples".strip()
        if one.values.dtype.names:
            fields = [f for f in one.values.dtype.names if one.values.dtype[f].kind in "fiub" and one.values.ndim == 1]
            columns += [ForeignColumn(f"{label}.{f}", one.values[f], None, clock) for f in fields]
        elif one.values.ndim == 2 and 1 in one.values.shape:
            columns.append(
                ForeignColumn(
                    label, one.values.ravel(), unit, clock.replace(f" {len(one.values)} ", f" {one.values.size} ")
                )
            )
        elif one.values.ndim == 1:
            columns.append(ForeignColumn(label, one.values, unit, clock))
        else:
            shape = " x ".join(map(str, one.values.shape))
            remarks.append(f"{label} is left out: its shape is {shape}, and a channel is one row of numbers")
    return ForeignTable(columns, {"attributes": attributes} if attributes else {}, remarks)


FORMAT = FileFormat(title="HDF5 files", read=read_hdf5)


SEAL = b"\nmckibben-seal:"
SEAL_DIGEST = 32  # [B]
SEAL_BLOCK = 1 << 20


def seal(path: Path) -> None:
    """Append a seal to a file."""
    digest = _digest(path, os.path.getsize(path))
    with open(path, "ab") as stream:
        stream.write(SEAL + digest)


def sealed(path: Path) -> bool | None:
    """Whether a file is as it was when its seal was put; None if it has none."""
    size = os.path.getsize(path) - SEAL_DIGEST - len(SEAL)
    if size < 0:
        return None
    with open(path, "rb") as stream:
        stream.seek(size)
        end = stream.read()
    return end[len(SEAL) :] == _digest(path, size) if end.startswith(SEAL) else None


def check_self_contained(path: str | os.PathLike[str]) -> None:
    """Refuse an HDF5 file with links to other files.

    Raises:
        ValueError: names the variable.
    """
    import h5py

    if not h5py.is_hdf5(path):
        return
    with h5py.File(path, "r") as file:
        groups, known = [file["/"]], set()
        while groups:
            group = groups.pop()
            for name in group:
                link = group.get(name, getlink=True)
                if isinstance(link, h5py.ExternalLink):
                    raise ValueError(f"{name} lies in another file, {link.filename}")
                if isinstance(link, h5py.SoftLink):
                    continue  # what it leads to is met, too
                item = group[name]
                if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
                    raise ValueError(f"the numbers of {name} lie in another file")
                address = h5py.h5o.get_info(item.id).addr
                if isinstance(item, h5py.Group) and address not in known:
                    known.add(address)
                    groups.append(item)


def _digest(path: Path, size: int) -> bytes:
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while size > 0 and (block := stream.read(min(SEAL_BLOCK, size))):
            digest.update(block)
            size -= len(block)
    return digest.digest()
