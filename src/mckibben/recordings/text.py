"""Text tables of others: the cells of a CSV file with the rows they come from, and headers that hold a unit."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections.abc import Callable, Container, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError

Rows = list[tuple[int, list[str]]]


def read_rows(path: Path, where: str, *, sniff: bool = False) -> Rows:
    """The rows of a text table (``.gz`` too) without blank lines and lines that begin with #, each with its number.

    Args:
        path: the file.
        where: how complaints name it.
        sniff: let the first row say whether tabs, semicolons, commas or blanks part the cells; else commas do.
    """
    if not path.is_file():
        raise InputError("file", where, "no such file")
    opener: Any = gzip.open if path.suffix == ".gz" else open
    try:
        with opener(path, "rt", encoding="utf-8-sig", newline="") as stream:
            mark: str | None = ","
            if sniff:
                first = next((line for line in stream if line.strip() and not line.lstrip().startswith("#")), ",")
                mark = next((mark for mark in "\t;," if mark in first.strip()), None)
                stream.seek(0)
            cells = csv.reader(stream, delimiter=mark) if mark else map(_words, stream)
            return [(n, row) for n, row in enumerate(cells, 1) if row and not row[0].lstrip().startswith("#")]
    except (UnicodeDecodeError, EOFError, OSError, zlib.error, csv.Error) as error:
        raise InputError("file", "unreadable", f"allowed is a CSV text file ({error})", where=where) from None


def _words(line: str) -> list[str]:
    # "time [s]" is one header, and numbers hold no brackets.
    return re.findall(r"\S+(?:\s+[\[(][^\])]*[\])])?", line) if "[" in line or "(" in line else line.split()


def check_width(rows: Rows, width: int, wanted: str, where: str) -> None:
    """Refuse the first row that has not `width` cells; `wanted` says why it should."""
    for number, row in rows:
        if len(row) != width:
            raise InputError(f"row {number}", f"{len(row)} cells", wanted, where=where)


def split_header(cell: str, words: Container[str]) -> tuple[str, list[str]]:
    """A header as its stem in lower case and the words after it: ``pressure_kPa_gauge`` -> pressure, [kPa, gauge].

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
    found: list[str] = []
    for name in names:
        stem = plain(name)[: longest - 4].rstrip("_")
        stem = stem if re.match(r"[a-z]", stem, re.I) else f"x{stem}"
        taken, count = stem, 1
        while taken in found:
            count += 1
            taken = f"{stem}_{count}"
        found.append(taken)
    return found
