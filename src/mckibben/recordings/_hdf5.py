"""HDF5 files of other programs: rows of numbers and fields of tables, with the units that attributes state."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ._seal import check_self_contained
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
