"""Text tables of others: the cells of a CSV file with the rows they come from, and headers that hold a unit."""

from __future__ import annotations

import csv
import gzip
import itertools
import re
import unicodedata
import zlib
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError

Rows = list[tuple[int, list[str]]]
MARKS = "\t;,"
MOST_NAMED = 8  # rows that a remark names
_SEPARATOR = re.compile(r'"?sep=.?"?', re.I)  # the first line of some files of spreadsheets
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?|[-+]?\d+,")
_DECIMAL_POINT = re.compile(r"[-+]?\d*\.\d+(?:[eE][-+]?\d+)?|[-+]?\d+\.")


def read_rows(path: Path, where: str) -> Rows:
    """The rows of a text table (``.gz`` too) without blank lines and lines that begin with #, each with its number.

    Tabs, semicolons, commas or blanks part the cells: whichever parts the first two rows into as many. The text is UTF-8 or,
    where it is not, that of Windows (cp1252). Where no comma parts the cells, a comma within a number is its decimal point.

    Args:
        path: the file.
        where: how error messages name it.

    Raises:
        InputError: there is no such file, it is no text, or a column has numbers with points and with commas.
    """
    if not path.is_file():
        raise InputError("file", where, "no such file")
    try:
        rows, mark = _cells(path)
    except (UnicodeDecodeError, EOFError, OSError, zlib.error, csv.Error) as error:
        raise InputError("file", "unreadable", f"allowed is a CSV text file ({error})", where=where) from None
    return rows if mark == "," else _with_points(rows, where)


def _cells(path: Path) -> tuple[Rows, str | None]:
    """The rows, and what parts their cells; None for blanks."""
    opener: Any = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rb") as stream:
        start = stream.read(4096)
    encodings = ("utf-8-sig", "cp1252")
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encodings = ("utf-16", "utf-16")
    elif b"\0" in start:
        raise csv.Error("it holds binary data")
    for encoding in encodings:
        try:
            with opener(path, "rt", encoding=encoding, newline="") as stream:
                mark = _mark(list(itertools.islice((line for line in stream if _counts(line)), 2)))
                stream.seek(0)
                cells = csv.reader(stream, delimiter=mark) if mark else map(_words, stream)
                rows = enumerate(cells, 1)
                return [(n, row) for n, row in rows if any(map(str.strip, row)) and not _is_remark(row[0])], mark
        except UnicodeDecodeError:
            if encoding == encodings[-1]:
                raise
    raise AssertionError


def _is_remark(text: str) -> bool:
    first = text.lstrip()[:1]
    return first == "#" or (first in '"sS' and _SEPARATOR.fullmatch(text.strip()) is not None)


def _counts(line: str) -> bool:
    return bool(line.strip()) and not _is_remark(line)


def _mark(lines: Sequence[str]) -> str | None:
    """Find the separator of the first lines: one that splits them into equally many cells, else the first that occurs."""
    there = [mark for mark in MARKS if any(mark in line.strip() for line in lines[:1])]
    for mark in there:
        widths = [len(row) for row in csv.reader(lines, delimiter=mark)]
        if len(set(widths)) == 1 and widths[0] > 1:
            return mark
    return there[0] if there else None


def _with_points(rows: Rows, where: str) -> Rows:
    """The rows with points in numbers that have a comma."""
    if not any("," in cell for _, row in rows for cell in row):
        return rows
    for at in range(max(len(row) for _, row in rows)):
        column = [(n, row[at].strip()) for n, row in rows if len(row) > at]
        commas = [n for n, cell in column if _DECIMAL_COMMA.fullmatch(cell)]
        points = [n for n, cell in column if commas and _DECIMAL_POINT.fullmatch(cell)]
        if points:
            cells = dict(column)
            examples = f"{cells[points[0]]} in row {points[0]}, {cells[commas[0]]} in row {commas[0]}"
            allowed = "one column has decimal points and decimal commas; allowed is one of the two"
            raise InputError(f"column {at + 1}", examples, allowed, where=where)
        wrong = set(commas)
        for n, row in rows if wrong else ():
            if n in wrong:
                row[at] = row[at].replace(",", ".")
    return rows


def _words(line: str) -> list[str]:
    # "time [s]" is one header, and numbers hold no brackets.
    return re.findall(r"\S+(?:\s+[\[(][^\])]*[\])])?", line) if "[" in line or "(" in line else line.split()


def plain_text(cell: str) -> str:
    """A cell without blanks around it, each letter in its usual code (NFC): an accent may be written as one or two."""
    return unicodedata.normalize("NFC", cell.strip())


def check_width(rows: Rows, width: int, wanted: str, where: str) -> None:
    """Refuse the first row that has not `width` cells; `wanted` states why it should."""
    for number, row in rows:
        if len(row) != width:
            raise InputError(f"row {number}", f"{len(row)} cells", wanted, where=where)


def without_blanks(rows: Rows, columns: Mapping[int, str], where: str) -> tuple[Rows, list[str]]:
    """The rows of which no cell is blank that is used, and a sentence for what was left out.

    Args:
        rows: with their numbers.
        columns: number of each column that is used, from 0, and its label.
        where: how error messages name the file.

    Raises:
        InputError: a column is blank in more than half of the rows.
    """
    blank: dict[str, list[int]] = {}
    for number, row in rows:
        for at, label in columns.items():
            if not row[at].strip():
                blank.setdefault(label, []).append(number)
    for label, numbers in blank.items():
        if 2 * len(numbers) > len(rows):
            allowed = "too many; allowed is a column with a value in most rows"
            raise InputError(label, f"blank in {len(numbers)} of {len(rows)} rows", allowed, where=where)
    left = {number for numbers in blank.values() for number in numbers}
    return [(n, row) for n, row in rows if n not in left], [_left_out(label, n) for label, n in blank.items()]


def _left_out(label: str, numbers: list[int]) -> str:
    named = ", ".join(map(str, numbers[:MOST_NAMED])) + (", .." if len(numbers) > MOST_NAMED else "")
    if len(numbers) == 1:
        return f"row {named} is left out: {label} is blank"
    return f"{len(numbers)} rows are left out, {named}: {label} is blank"


def split_header(cell: str, words: Container[str]) -> tuple[str, list[str]]:
    """Split a header to its stem in lower case and the suffixes: ``pressure_kPa_gauge`` -> pressure, [kPa, gauge].

    Args:
        cell: the header.
        words: what counts as a unit.
    """
    parts = [w for w in re.split(r"[\s_\[\]()/,;:]+", cell) if w]
    tail: list[str] = []
    while len(parts) > 1 and (parts[-1] in words or parts[-1].lower() in ("gauge", "abs", "absolute", "rel", "g")):
        tail.insert(0, parts.pop())
    return "_".join(parts).lower(), tail


def to_numbers(cells: Sequence[str], lines: Sequence[int], column: str, where: str) -> np.ndarray:
    """Cells as finite numbers (n,), or `InputError` with the row of the first that is none."""
    try:
        out = np.fromiter(map(float, cells), float, len(cells))
    except ValueError:
        cell, line = next((c, n) for c, n in zip(cells, lines, strict=True) if not is_number(c))
        raise InputError(f"{column}, row {line}", cell, "allowed is a number", where=where) from None
    if not np.isfinite(out).all():
        i = int(np.argmin(np.isfinite(out)))
        raise InputError(f"{column}, row {lines[i]}", cells[i], "allowed is a finite number", where=where)
    return out


def is_number(cell: str) -> bool:
    """Whether a cell reads as a number, NaN and infinities among them."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def plain_names(names: Iterable[str], plain: Callable[[str], str], longest: int = 63) -> list[str]:
    """Names as another format allows them, each once; `plain` maps a name to letters that it allows."""
    allowed_names: list[str] = []
    for name in names:
        stem = plain(name)[: longest - 4].rstrip("_")
        stem = stem if re.match(r"[a-z]", stem, re.I) else f"x{stem}"
        taken, count = stem, 1
        while taken in allowed_names:
            count += 1
            taken = f"{stem}_{count}"
        allowed_names.append(taken)
    return allowed_names
