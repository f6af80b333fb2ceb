"""Parquet files: a column ``name [unit]`` per channel after ``time [s]``, and a line of JSON in the file's metadata."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..documents import ErrorKeepingFile
from ..extras import library
from ._sidecar import KEY, dumps, loads, unreadable
from .formats import FileFormat, ForeignColumn, ForeignTable, ImportResult
from .recording import Recording


def write_parquet(recording: Recording, path: Path) -> list[str]:
    """Write a ``.parquet`` file."""
    polars = library("polars", "Parquet files need", where=str(path))
    columns = {f"{name} [{c.unit}]": c.values for name, c in recording.channels.items()}
    table = polars.DataFrame({"time [s]": recording.time, **columns})
    with ErrorKeepingFile(path) as stream:
        table.write_parquet(stream, metadata={KEY: dumps(recording.channels, recording.meta)})
    return []


def read_parquet(path: Path) -> ImportResult | ForeignTable:
    """Read a recording of mckibben, or the columns of another program's table.

    Raises:
        InputError: the file cannot be read, or a newer version wrote it.
    """
    where = str(path)
    polars = library("polars", "Parquet files need", where=where)
    with unreadable("a Parquet file", where):
        line = polars.read_parquet_metadata(path).get(KEY)
        table = polars.read_parquet(path, glob=False)
        columns = {name: np.asarray(table[name].to_numpy()) for name in table.columns}
    if line is None:
        return ForeignTable([ForeignColumn(n, values, None, f"{len(values)} samples") for n, values in columns.items()])
    sidecar = loads(line, where)
    names = [f"{name} [{c.unit}]" for name, c in sidecar.channels.items()]
    return ImportResult(sidecar.from_columns(columns, "time [s]", names, where), [])


FORMAT = FileFormat(title="Parquet files", read=read_parquet, write=write_parquet, requires="polars")
