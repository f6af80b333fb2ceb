"""Spreadsheets (``.xlsx``, ``.xls``, ``.ods``): one sheet, as a table of cells."""

from __future__ import annotations

import zipfile
from datetime import date, datetime, time, timedelta
from pathlib import Path

from ..errors import InputError
from ..extras import library
from ..isolation import check_unpacked
from ._sidecar import unreadable
from .formats import FileFormat, ForeignTable
from .text import mostly_numbers, table_of_rows


def read_spreadsheet(path: Path, sheet: str | int | None = None) -> ForeignTable:
    """Read the cells of a sheet as a table.

    Args:
        path: the file.
        sheet: name, or number from 1; by default the only one with rows of numbers.

    Raises:
        InputError: the file cannot be read, there is no such sheet, or several have cells and none is named.
    """
    where = str(path)
    calamine = library("python_calamine", "Spreadsheets need", where=where)
    with unreadable("a spreadsheet", where):
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as packed:
                check_unpacked(0.25 * sum(one.file_size for one in packed.infolist()))  # most of it is tags
        book = calamine.CalamineWorkbook.from_path(where)
        names = list(book.sheet_names)
        filled = {
            name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in _asked(names, sheet, where)
        }
    tables = {
        name: [(i, [_text(cell) for cell in row]) for i, row in enumerate(rows, 1)] for name, rows in filled.items()
    }
    tables = {
        name: [(i, row) for i, row in rows if any(row) and not row[0].startswith("#")] for name, rows in tables.items()
    }
    tables = {name: rows for name, rows in tables.items() if rows}
    remarks: list[str] = []
    if len(tables) > 1:
        measured = {name: rows for name, rows in tables.items() if any(mostly_numbers(row) for _, row in rows)}
        if len(measured) == 1:
            remarks = [
                f"sheet {name} is left out: it has no rows of numbers" for name in tables if name not in measured
            ]
            tables = measured
    if len(tables) > 1:
        problem = f"the sheets {', '.join(tables)} have tables; say which one is meant"
        raise InputError("sheet", ", ".join(tables), problem, sentence=problem, where=where, remedy="sheet")
    if not tables:
        raise InputError("file", None, "is empty", where=where)
    ((name, rows),) = tables.items()
    table = table_of_rows(_trimmed(rows), where)
    return table._replace(notes={**table.notes, "sheet": name}, remarks=[*remarks, *table.remarks])


def sheet_names(path: Path) -> list[str]:
    """Names of the sheets that have cells."""
    where = str(path)
    calamine = library("python_calamine", "Spreadsheets need", where=where)
    with unreadable("a spreadsheet", where):
        book = calamine.CalamineWorkbook.from_path(where)
        return [name for name in book.sheet_names if book.get_sheet_by_name(name).to_python(nrows=1)]


def _asked(names: list[str], sheet: str | int | None, where: str) -> list[str]:
    if sheet is None:
        return names
    if isinstance(sheet, int) or (sheet.isdecimal() and sheet not in names):
        if 1 <= int(sheet) <= len(names):
            return [names[int(sheet) - 1]]
        raise InputError("sheet", int(sheet), f"must be between 1 and {len(names)}", where=where)
    if sheet not in names:
        raise InputError("sheet", sheet, known=names, where=where)
    return [sheet]


def _trimmed(rows: list[tuple[int, list[str]]]) -> list[tuple[int, list[str]]]:
    """The rows without columns at the left and right in which all cells are blank."""
    filled = [i for i in range(len(rows[0][1])) if any(row[i] for _, row in rows)]
    return [(n, row[filled[0] : filled[-1] + 1]) for n, row in rows]


def _text(cell: object) -> str:
    if isinstance(cell, float):
        return repr(int(cell)) if cell.is_integer() and abs(cell) < 1e15 else repr(cell)
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, datetime | date | time):
        return cell.isoformat(sep=" ") if isinstance(cell, datetime) else cell.isoformat()
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    return str(cell).strip()


FORMAT = FileFormat(title="Spreadsheets", read=read_spreadsheet, options=("sheet",), parts=sheet_names)
