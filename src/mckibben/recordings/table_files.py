"""Tables of length, pressure and tension that are no CSV files: MATLAB, TDMS and Parquet files, and recordings.

Their columns become a header with units and rows of cells, so that what a header means is told in one place for all.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .text import Rows

OTHERS = (".mat", ".tdms", ".parquet", ".nc", ".mcap")
MOST_ROWS = 400  # of a recording: its samples follow one another so closely that more say nothing more


def table_of(path: Path, where: str) -> tuple[list[str], Rows]:
    """The header and the rows of a file of `OTHERS`; of a recording every so-manieth sample, at most `MOST_ROWS`.

    Columns of other lengths than most of them are left out.

    Raises:
        InputError: there is no such file, it cannot be read, or no table is in it.
    """
    if not path.is_file():
        raise InputError("file", where, "no such file")
    columns = _columns(path)
    counts = [len(values) for _, values in columns]
    if not counts:
        raise InputError("columns", "none", "allowed is a file with at least one column of numbers", where=where)
    most = max(sorted(set(counts)), key=counts.count)
    kept = [(label, values) for label, values in columns if len(values) == most]
    cells = [_cells(values) for _, values in kept]
    return [label for label, _ in kept], [(n, list(row)) for n, row in enumerate(zip(*cells, strict=True), 1)]


def _columns(path: Path) -> list[tuple[str, np.ndarray]]:
    """Label with unit, and values (n,), of each column."""
    from .imports import stripped
    from .matlab import read_matlab
    from .parquet import read_parquet
    from .recording import Recording
    from .store import read_recording
    from .tdms import read_tdms

    readers: dict[str, Any] = {".mat": read_matlab, ".tdms": read_tdms, ".parquet": read_parquet}
    found = readers.get(path.suffix.lower(), read_recording)(path)
    if isinstance(found, Recording):
        every = -(-len(found) // MOST_ROWS)
        return [(f"{name} [{c.unit}]", c.values[::every]) for name, c in found.channels.items()]
    given = [one for one in found[0] if one.values.ndim == 1 and one.values.dtype.kind in "fiubUO"]
    if given:
        given = stripped(given)
    return [(f"{g.label} [{g.unit}]" if g.unit and "[" not in g.label else g.label, g.values) for g in given]


def _cells(values: np.ndarray) -> list[str]:
    if values.dtype.kind in "UO":
        return [str(v) for v in values]
    # repr of a float is the shortest text that reads back to the same bits
    return [repr(v) for v in values.astype(float).tolist()]
