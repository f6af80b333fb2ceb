"""What a table of somebody else holds, before anything is refused: header, some rows, and what the header seems to mean."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from .tables import COLUMNS, recognised, rows_of, unit_of


class Preview(NamedTuple):
    """A look into a table.

    Args:
        header: cells of the header.
        rows: cells of the first rows.
        total: how many rows there are.
        meant: what a column holds -> its cell of the header, as far as the header says it and says it once.
    """

    header: list[str]
    rows: list[list[str]]
    total: int
    meant: dict[str, str]


def preview(path: str | Path, rows: int = 60) -> Preview:
    """Look into a table that `read_force_map` may read.

    Raises:
        InputError: there is no such file, or it is no table at all.
    """
    header, lines = rows_of(Path(path), str(path))
    meant = {what: match[0] for what, match in recognised(header).items() if len(match) == 1}
    if "length" in meant:
        meant.pop("contraction", None)
    return Preview(header, [row for _, row in lines[:rows]], len(lines), meant)


def told_unit(column: str, what: str) -> str:
    """The unit that a header says, as ``--unit`` takes it; nothing where it says none."""
    if what not in COLUMNS:
        return ""
    unit, absolute = unit_of(column, what)
    return f"{unit} abs" if unit and absolute and what == "pressure" else unit or ""
