"""Tables of results as files: CSV, JSON, spreadsheet or Parquet, a column per quantity with its unit in the header."""

from __future__ import annotations

import csv
import html
import io
import json
import math
import re
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..documents import ErrorKeepingFile, write_whole
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
        MissingLibraryError: .parquet needs polars, which comes with the extra ``formats``.
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
        return write_whole(path, lambda part: part.write_bytes(_spreadsheet([heads, *rows])))
    table = library("polars", "Parquet files need", where=str(path)).DataFrame(dict(zip(heads, cells, strict=True)))
    return write_whole(path, lambda part: _save(table.write_parquet, part))


# The least that is a spreadsheet (ISO/IEC 29500, Office Open XML), by the names of its parts.
_OPEN, _KIND = "http://schemas.openxmlformats.org", "application/vnd.openxmlformats-"
_MAIN, _LINKS = f"{_OPEN}/spreadsheetml/2006/main", f"{_OPEN}/package/2006/relationships"
_LINKED = f"{_OPEN}/officeDocument/2006/relationships"
_PARTS = {
    "[Content_Types].xml": f'<Types xmlns="{_OPEN}/package/2006/content-types">'
    f'<Default Extension="rels" ContentType="{_KIND}package.relationships+xml"/>'
    f'<Override PartName="/xl/workbook.xml" ContentType="{_KIND}officedocument.spreadsheetml.sheet.main+xml"/>'
    f'<Override PartName="/xl/sheet.xml" ContentType="{_KIND}officedocument.spreadsheetml.worksheet+xml"/></Types>',
    "_rels/.rels": f'<Relationships xmlns="{_LINKS}">'
    f'<Relationship Id="a" Type="{_LINKED}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
    "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_LINKS}">'
    f'<Relationship Id="a" Type="{_LINKED}/worksheet" Target="sheet.xml"/></Relationships>',
    "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_LINKED}">'
    '<sheets><sheet name="mckibben" sheetId="1" r:id="a"/></sheets></workbook>',
}
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # what XML cannot have


def _spreadsheet(rows: Sequence[Sequence[Any]]) -> bytes:
    """A spreadsheet of one sheet, made in memory: libraries make it on a disk, and leave tracebacks where that is full."""
    lines = "".join(f"<row>{''.join(map(_sheet_cell, row))}</row>" for row in rows)
    sheet = f'<worksheet xmlns="{_MAIN}"><sheetData>{lines}</sheetData></worksheet>'
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as book:
        for name, text in {**_PARTS, "xl/sheet.xml": sheet}.items():
            book.writestr(name, f'<?xml version="1.0" encoding="UTF-8" standalone="yes"?>{text}'.encode())
    return file.getvalue()


def _sheet_cell(value: Any) -> str:
    if value is None:
        return "<c/>"
    if isinstance(value, bool):
        return f'<c t="b"><v>{int(value)}</v></c>'
    if isinstance(value, int | float):
        return f"<c><v>{value!r}</v></c>"
    words = html.escape(_UNPRINTABLE.sub("\ufffd", str(value)), quote=False)
    return f'<c t="inlineStr"><is><t xml:space="preserve">{words}</t></is></c>'


def _save(save: Callable[[Any], object], path: Path) -> None:
    """Write by a library that leaves a traceback, or no word, where the disk is full."""
    with ErrorKeepingFile(path) as stream:
        save(stream)


def _cell(value: Any) -> Any:
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, list | tuple):
        return "; ".join(map(str, value))
    return None if isinstance(value, float) and not math.isfinite(value) else value
