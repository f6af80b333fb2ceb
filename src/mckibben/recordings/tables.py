"""Tables of results as files: CSV, JSON, spreadsheet or Parquet, a column per quantity with its unit in the header."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..documents import write_whole
from ..errors import InputError
from ..extras import library

TABLES = (".csv", ".json", ".xlsx", ".parquet")  # suffixes of the files that `write_table` writes


def write_table(
    columns: Mapping[str, Iterable[object]], path: str | Path, *, units: Mapping[str, str] | None = None
) -> Path:
    """Write columns of equal length in the format of the suffix, atomically.

    Args:
        columns: values by name, numbers in SI or words; None and nan leave a cell empty.
        path: ends in .csv, .json, .xlsx or .parquet. JSON is one object with a list per column.
        units: SI units by name of the column; a header reads ``length [m]``.

    Raises:
        InputError: the suffix is none of these, or the file cannot be written.
        MissingLibraryError: .xlsx needs openpyxl, .parquet needs polars; both come with the extra ``formats``.
    """
    path, known = Path(path), units or {}
    if path.suffix not in TABLES:
        raise InputError("suffix", path.suffix or str(path), known=TABLES, where=str(path))
    heads = [name if known.get(name, "1") == "1" else f"{name} [{known[name]}]" for name in columns]
    cells = [[_cell(value) for value in values] for values in columns.values()]
    rows = list(zip(*cells, strict=True))
    if path.suffix == ".csv":
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([heads, *rows])
        return write_whole(path, lambda part: part.write_bytes(text.getvalue().encode()))
    if path.suffix == ".json":
        content = json.dumps(dict(zip(heads, cells, strict=True)), ensure_ascii=False) + "\n"
        return write_whole(path, lambda part: part.write_bytes(content.encode()))
    if path.suffix == ".xlsx":
        book = library("openpyxl", "Spreadsheets need", where=str(path)).Workbook(write_only=True)
        sheet = book.create_sheet("mckibben")
        for row in [heads, *rows]:
            sheet.append(list(row))
        return write_whole(path, book.save)
    table = library("polars", "Parquet files need", where=str(path)).DataFrame(dict(zip(heads, cells, strict=True)))
    return write_whole(path, table.write_parquet)


def _cell(value: Any) -> Any:
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, list | tuple):
        return "; ".join(map(str, value))
    return None if isinstance(value, float) and not math.isfinite(value) else value
