"""Text of other programs in any dialect: where in its rows names, units and numbers stand, and how these are written."""

from __future__ import annotations

import collections
import csv
import gzip
import itertools
import re
import unicodedata
import zlib
from collections.abc import Callable, Container, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..documents import no_file
from ..errors import InputError
from ..isolation import call_outside, check_unpacked
from . import instruments
from .table import ForeignColumn, ForeignTable

Rows = list[tuple[int, list[str]]]
MARKS = ("\t", ";", ",", "|", None)  # None stands for blanks
MOST_NAMED = 8  # rows that a remark names
MISSING = frozenset(
    ("", "nan", "na", "n/a", "#n/a", "null", "none", "--")
)  # cells of R, MATLAB, pandas and spreadsheets without a value
OVERLOAD = frozenset(
    "inf +inf -inf infinity -infinity ∞ +∞ -∞ ol +ol -ol ovl ovld ovf overload overrange over overflow #num! #div/0!".split()
)  # cells of oscilloscopes, loggers and multimeters beyond their range
TEXT_OPTIONS = ("decimal", "header")  # of `table_of_rows`
_BLOCK = 1 << 20  # [B]
_LOOKED_AT = 200  # lines that decide on the dialect and on the place of the header
_SEPARATOR = re.compile(r'"?sep=.?"?', re.I)  # the first line of some files of spreadsheets
_GROUP = "[ '\u2019\u00a0\u202f]"  # what parts thousands beside a comma or a point
# A number by its decimal mark; the other mark, or a blank, may part thousands. None begins with 0 and a group: 0.123 is one.
_WRITTEN = {
    mark: re.compile(
        rf"[-+]?(?=.*\d)(?:[1-9]\d{{0,2}}(?:{re.escape(other)}\d{{3}})+|[1-9]\d{{0,2}}(?:{_GROUP}\d{{3}})+|\d*)"
        rf"(?:{re.escape(mark)}\d*)?(?:[eE][-+]?\d+)?"
    )
    for mark, other in ((".", ","), (",", "."))
}
_LIKE_NUMBER = re.compile(rf"[-+]?(?:\d|[.,]\d)(?:[\d.,]|{_GROUP})*(?:[eE][-+]?\d+)?")
_RULE = re.compile(r":?[-=*_+~]{2,}:?")  # a line drawn below a header, with the colons of Markdown
_DATE = re.compile(r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}([T ].*)?|\d{1,2}-[A-Za-z]{3}-\d{2,4}.*|\d{1,2}:\d\d.*")
# What a row of units below the names may hold; one of these is needed, and any short word may stand beside it.
_UNIT_WORDS = frozenset(
    "s ms us min h m mm cm um in inch N kN mN lbf kgf Pa kPa MPa hPa bar mbar psi V mV A mA % - 1 °C degC K Hz deg rad g"
    " kg".split()
)
# A word and its unit in brackets; it never goes back over a text, so that no line takes more than proportional time.
_WORD = re.compile(r"\S++(?:\s{1,9}+[\[(][^\[\])]{0,60}+[\])])?")
_LONGEST_LINE = 1 << 20  # letters
_SHORT = re.compile(r"[\[(]?[^\s\[\]()]{0,10}(?: ?\(?(?:abs|g|gauge|rel)\)?)?[\])]?")


def read_rows(path: Path, where: str) -> Rows:
    """Read the rows of a text file (``.gz`` too) without blank lines and lines that begin with #, each with its number.

    Tabs, semicolons, commas or blanks part the cells: whichever parts most lines into as many. The text is UTF-8, UTF-16 or,
    where it is neither, that of Windows (cp1252).

    Args:
        path: the file.
        where: how errors name it.

    Raises:
        InputError: there is no such file, or it is no text.
    """
    rows = call_outside(row_list, path, where)
    return [(number, cells) for number, cells in rows]


def row_list(path: Path, where: str) -> list[list[Any]]:
    """`read_rows` in the process that calls it."""
    return [list(row) for row in _read_cells(path, where)[0]]


def _read_cells(path: Path, where: str) -> tuple[Rows, list[str], str | None]:
    """The rows, the cells of the last comment before them, where some programs write the names, and what parts cells."""
    if not path.is_file():
        raise no_file(where)
    try:
        return _cells(path)
    except (UnicodeDecodeError, EOFError, OSError, zlib.error, csv.Error) as error:
        problem = f"the file is unreadable as a CSV text file: {error}"
        raise InputError("file", "unreadable", "must be a text file", sentence=problem, where=where) from None


def read_text_table(path: Path, decimal: str | None = None, header: str | Sequence[str] | None = None) -> ForeignTable:
    """Read a text file as a table; see `read_rows` and `table_of_rows`.

    Raises:
        InputError: there is no such file, it is no text, or it has no table.
    """
    rows, comment, mark = _read_cells(path, str(path))
    known = instruments.plain(rows)
    # Where a comma parts the cells, and no cell is quoted for one, only a point can be the decimal mark.
    certain = mark == "," and not any("," in cell for _, row in known.rows for cell in row)
    stated = decimal or known.decimal or ("." if certain else None)
    table = table_of_rows(known.rows, str(path), decimal=stated, header=header)
    table = table._replace(notes={**known.notes, **table.notes}, remarks=[*known.remarks, *table.remarks])
    if table.named or len(comment) != len(table.columns) or not _all_words(comment):
        return table
    named = zip(table.columns, comment, strict=True)
    return table._replace(columns=[c._replace(label=plain_text(label)) for c, label in named], named=True)


def _cells(path: Path) -> tuple[Rows, list[str], str | None]:
    opener: Any = gzip.open if path.suffix == ".gz" else open
    if opener is gzip.open:
        with opener(path, "rb") as stream:
            while stream.read(_BLOCK):
                check_unpacked(stream.tell())
    with opener(path, "rb") as stream:
        start = stream.read(4096)
    encodings = ("utf-8-sig", "cp1252")
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encodings = ("utf-16", "utf-16")
    elif start.count(0) > len(start) // 3 and not (start[::2].strip(b"\0") and start[1::2].strip(b"\0")):
        # every other byte is zero: UTF-16 without its mark
        encodings = ("utf-16-le", "utf-16-le") if start[0] else ("utf-16-be", "utf-16-be")
    elif b"\0" in start:
        raise csv.Error("it holds binary data")
    for encoding in encodings:
        try:
            with opener(path, "rt", encoding=encoding, newline="") as stream:
                comments = itertools.takewhile(lambda line: not _counts(line), stream)
                comment = [line.strip()[1:].strip() for line in comments if line.strip()[:1] == "#"][-1:]
                stream.seek(0)
                mark = _mark(list(itertools.islice((line for line in stream if _counts(line)), _LOOKED_AT)))
                stream.seek(0)
                cells = csv.reader(stream, delimiter=mark) if mark else map(_words, stream)
                rows = [
                    (n, row) for n, row in enumerate(cells, 1) if any(map(str.strip, row)) and not _is_comment(row[0])
                ]
                if mark == "|":  # of Markdown, where it also begins and ends each row
                    rows = [(n, row[1:-1] if not row[0].strip() and not row[-1].strip() else row) for n, row in rows]
                names = list(csv.reader(comment, delimiter=mark)) if mark else list(map(_words, comment))
                return rows, names[0] if names else [], mark
        except UnicodeDecodeError:
            if encoding == encodings[-1]:
                raise
    raise AssertionError


def _is_comment(text: str) -> bool:
    first = text.lstrip("\ufeff \t")[:1]
    return first == "#" or (first in '"sS' and _SEPARATOR.fullmatch(text.strip()) is not None)


def _counts(line: str) -> bool:
    return bool(line.strip()) and not _is_comment(line)


def _mark(lines: Sequence[str]) -> str | None:
    """What parts the cells: the mark by which most lines have as many; None for blanks."""
    best, most = None, 0
    stated = lines[0].removeprefix("LabVIEW Measurement")[:1] if lines else ""
    for mark in (stated,) if stated and stated in ("\t", ";", ",") and lines[0][0] == "L" else MARKS:
        rows = csv.reader(lines, delimiter=mark) if mark else map(_words, lines)
        widths = collections.Counter(len(row) for row in rows if len(row) > 1)
        count = max(widths.values(), default=0)
        if count > (most if mark else 1.1 * most):  # words of a header may be parted by blanks, and its cells by tabs
            best, most = mark, count
    return best


def _words(line: str) -> list[str]:
    if len(line) > _LONGEST_LINE:
        raise csv.Error(f"a line is longer than {_LONGEST_LINE} letters")
    if '"' in line:
        return next(csv.reader([line.strip()], delimiter=" ", skipinitialspace=True), [])
    # "time [s]" is one header, and numbers hold no brackets.
    return _WORD.findall(line) if "[" in line or "(" in line else line.split()


def table_of_rows(
    rows: Rows, where: str, *, decimal: str | None = None, header: str | Sequence[str] | None = None
) -> ForeignTable:
    """Find header, units and numbers in rows of cells.

    Lines before the header are kept as the note ``preamble``; a row of units below the names counts to the header. Rows
    that hold no numbers, summaries below the numbers, and repetitions of the header, are left out and named in a remark.

    Args:
        rows: cells with the number of their row, none of them blank throughout.
        where: how errors name the file.
        decimal: the decimal mark, ``.`` or ``,``; by default the one that all numbers of the table fit.
        header: names of the columns with their units, over those of the file, or where it has none; one text has commas.

    Returns:
        The columns as cells in words, numbers with decimal points and without what parts thousands.

    Raises:
        InputError: the first row is neither names nor numbers, a row has too few or too many cells, or the decimal mark
            is not clear.
    """
    if decimal not in (None, ".", ","):
        raise InputError("decimal", decimal, known=(".", ","), where=where)
    rows = [(n, row) for n, row in rows if not all(_RULE.fullmatch(cell.strip() or "--") for cell in row)]
    if not rows:
        return ForeignTable([], {}, [], rows=(), named=True)
    begin, lines = _begin_of_numbers(rows)
    names = _header(rows, begin, lines, where) if header is None else _stated_header(header, rows[begin][1], where)
    preamble = [" ".join(cell for cell in map(str.strip, row) if cell) for _, row in rows[: begin - lines]]
    width = len(names) if names is not None else len(rows[begin][1])
    table, remarks = _without_words(rows[begin:], [row for _, row in rows[begin - lines : begin]], width)
    filled = any(row[-1].strip() for _, row in table)  # not by a mark at the end of each line
    if names is not None and filled and all(len(row) == width + 1 for _, row in table):
        firsts = [row[0].strip() for _, row in table]
        if firsts == [str(i) for i in range(1, len(table) + 1)] or not any(map(is_number, firsts)):
            names, width = ["", *names], width + 1  # R numbers or names its rows, and not their column
    words = _columns_of_words(table, width)
    beside = [cell.strip() for _, row in table for cell in row[width:] if cell.strip()]
    if names is not None and beside and not any(map(_like_number, beside)):
        remarks.append(f"beside the table is left out: {'; '.join(beside)[:80]}")
        table = [(n, row[:width]) for n, row in table]
    fitting = []
    for n, row in table:
        if len(row) > width and not any(map(str.strip, row[width:])):
            row = row[:width]
        elif len(row) < width and words.issuperset(range(len(row), width)):
            row = [*row, *[""] * (width - len(row))]  # a comment that only some rows have
        fitting.append((n, row))
    check_width(
        fitting,
        width,
        f"the header has {width} column{'s' if width > 1 else ''}" if names else f"the first row has {width}",
        where,
    )
    labels = names if names is not None else [f"column {at}" for at in range(1, width + 1)]
    cells = list(zip(*(row for _, row in fitting), strict=True)) or [() for _ in labels]
    numbers = [n for n, _ in fitting]
    cells, labels = _without_units(cells, labels)
    plain, said = with_points(cells, numbers, labels, decimal, where)
    columns = [ForeignColumn(label, np.array(column, object)) for label, column in zip(labels, plain, strict=True)]
    notes = {"preamble": preamble} if preamble else {}
    return ForeignTable(columns, notes, [*remarks, *said], rows=numbers, named=names is not None)


_WITH_UNIT = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?) ([^\W\d_][^\s\d]{0,9})")


def _without_units(cells: list[tuple[str, ...]], labels: Sequence[str]) -> tuple[list[tuple[str, ...]], list[str]]:
    """The cells of columns that repeat their unit behind each number, as "0.01 sec", without it; it goes into the label."""
    plain, named = list(cells), list(labels)
    for at, column in enumerate(cells):
        found = [_WITH_UNIT.fullmatch(cell.strip()) for cell in column if cell.strip().lower() not in MISSING]
        units = {one[2] if one else "" for one in found}
        if len(units) == 1 and "" not in units and "[" not in named[at] and "(" not in named[at]:
            named[at] = f"{named[at]} [{units.pop()}]"
            plain[at] = tuple(one[1] if (one := _WITH_UNIT.fullmatch(cell.strip())) else cell for cell in column)
    return plain, named


def _stated_header(header: str | Sequence[str], row: list[str], where: str) -> list[str]:
    names = [plain_text(name) for name in (header.split(",") if isinstance(header, str) else header)]
    if len(names) != len(_stripped(row)):
        problem = f"must name each column, and the file has {len(_stripped(row))}; such as 'time [ms], pressure [bar]'"
        raise InputError("header", ", ".join(names), problem, where=where)
    return names


def _columns_of_words(rows: Rows, width: int) -> set[int]:
    """Columns of the table with words, and without a number."""
    cells = {at: [row[at] for _, row in rows if len(row) > at and row[at].strip()] for at in range(width)}
    return {at for at, filled in cells.items() if filled and not any(map(_like_number, filled))}


def _begin_of_numbers(rows: Rows) -> tuple[int, int]:
    """Where the numbers begin, and how many rows before it are the header: 0, 1, or 2 with a row of units."""
    numeric = [mostly_numbers(row) for _, row in rows[:_LOOKED_AT]]
    widths = [len(_stripped(row)) for _, row in rows[:_LOOKED_AT]]
    for at in range(1, len(numeric)):
        fits = len(rows[at][1]) == len(rows[at - 1][1]) or widths[at - 1] in (widths[at], widths[at] - 1)
        if numeric[at] and fits and widths[at] > 1 and _all_words(rows[at - 1][1]):
            two = at > 1 and _all_words(rows[at - 2][1]) and len(rows[at - 2][1]) == len(rows[at - 1][1])
            return at, 2 if two and _is_units(rows[at - 1][1]) else 1
    at = next((at for at, width in enumerate(widths) if width > 1), 0)
    if at and numeric[at] and len(rows[0][1]) == 1:  # lines of a terminal's log above numbers without a header
        return at, 0
    if _all_words(rows[0][1]) or not numeric[0]:
        return 1, 1
    return 0, 0


def _header(rows: Rows, begin: int, lines: int, where: str) -> list[str] | None:
    """The names of the columns with their units, or None where the file has none."""
    if not lines:
        number, first = rows[begin]
        words = [cell for cell in first if cell.strip() and not is_number(cell) and not _like_number(cell)]
        if words:
            demand = "must be a row of names, or one of numbers where there is no header"
            raise InputError(f"row {number}", words[0], demand, where=where, remedy="header")
        return None
    number, names = rows[begin - lines]
    cells = [plain_text(cell) for cell in _stripped(names)]
    wrong = next((cell for cell in cells if is_number(cell)), None)
    if wrong is not None and lines == 1 and not _all_words(names):
        word = next(cell for cell in cells if not is_number(cell))
        demand = "must be a row of names, or one of numbers where there is no header"
        raise InputError(f"row {number}", word, demand, where=where, remedy="header")
    if lines == 2:
        units = [cell.strip().strip("[]()").strip() for cell in rows[begin - 1][1]]
        cells += [""] * (len(_stripped(rows[begin - 1][1])) - len(cells))
        cells = [
            f"{name} [{unit}]" if unit and name else name
            for name, unit in itertools.zip_longest(cells, units[: len(cells)], fillvalue="")
        ]
    return cells


def _without_words(rows: Rows, header: list[list[str]], width: int) -> tuple[Rows, list[str]]:
    """The rows without repetitions of the header, text lines, and summaries below the numbers; a remark for each kind."""
    again = [n for n, row in rows if row in header]
    kept = [(n, row) for n, row in rows if row not in header]
    remarks = [rows_left_out(again, "the header once more")] if again else []
    # A summary stands below the last number, and has a word where all rows above it have numbers: "Max", "Peak force".
    words = _columns_of_words(kept[:_LOOKED_AT], width)
    first = next((at for at in range(width) if at not in words), 0)
    end = len(kept)
    while end > 1 and (len(kept[end - 1][1]) <= first or _is_word(kept[end - 1][1][first])):
        end -= 1
    if not any(len(row) > first and _is_word(row[first]) for _, row in kept[: min(end, 2)]):
        for n, row in kept[end:]:
            reason = "it holds no numbers" if _all_words(row) else "it is below the rows of numbers"
            remarks.append(f"row {n} is left out: {reason} ({' '.join(' '.join(row).split())[:60]})")
        kept = kept[:end]
    texts = [n for n, row in kept if _all_words(row) and any(_is_word(cell) for cell in row)]
    if texts:
        remarks.append(rows_left_out(texts, "a line of text"))
        kept = [(n, row) for n, row in kept if n not in {*texts}]
    return kept, remarks


def _is_word(cell: str) -> bool:
    """Whether a cell is a word without digits, and none that stands for a number."""
    cell = cell.strip().lower()
    return cell not in MISSING and cell not in OVERLOAD and not any(map(str.isdigit, cell))


def _stripped(row: list[str]) -> list[str]:
    """A row without blank cells at its end."""
    end = len(row)
    while end and not row[end - 1].strip():
        end -= 1
    return row[:end]


def _all_words(row: list[str]) -> bool:
    return not any(is_number(cell) or _like_number(cell) for cell in row)


def mostly_numbers(row: list[str]) -> bool:
    """Whether more than half of a row's cells are numbers or dates, blank ones apart."""
    cells = [cell for cell in row if cell.strip().lower() not in MISSING]
    return 2 * sum(map(_like_number, cells)) > len(cells)


def _like_number(cell: str) -> bool:
    cell = cell.strip()
    return _LIKE_NUMBER.fullmatch(cell) is not None or _DATE.fullmatch(cell) is not None


def _is_units(row: list[str]) -> bool:
    cells = [cell.strip() for cell in row]
    known = sum(cell.strip("[]()").split(" ")[0] in _UNIT_WORDS for cell in cells)
    return known > 0 and all(_SHORT.fullmatch(cell) for cell in cells) and 2 * known >= sum(map(bool, cells))


class _Witness(NamedTuple):
    """A number of the table and where it stands."""

    cell: str
    row: int
    column: str


def with_points(
    columns: Sequence[Sequence[str]], rows: Sequence[int], labels: Sequence[str], decimal: str | None, where: str
) -> tuple[list[Sequence[str]], list[str]]:
    """The cells of all columns with decimal points and without what parts thousands: one way of writing for a table.

    Returns:
        The columns, and a sentence where marks part thousands.

    Raises:
        InputError: no way of writing fits all numbers, or both ways do and would give other numbers.
    """
    if decimal != "," and not any(
        "," in c or c.count(".") > 1 or _GROUPED.search(c) for cells in columns for c in cells
    ):
        # Points alone, as nearly always: they are decimal where one number says so, as 0.5, 12.25 or 1013.2.
        pointed = (c.strip() for cells in columns for c in cells if "." in c)
        if decimal or any(_like_number(c) and not _WRITTEN[","].fullmatch(c) for c in pointed):
            return [*columns], []
    marked = [
        at for at, column in enumerate(columns)
        if any("," in c or "." in c or _GROUPED.search(c) for c in column) and not _dated(column)
    ]  # fmt: skip
    decimal = decimal or _decimal_mark([(columns[at], labels[at]) for at in marked], rows, where)
    group = "." if decimal == "," else ","
    parted: _Witness | None = None
    plain: list[Sequence[str]] = list(columns)
    for at in marked:
        cells = [cell.strip() for cell in columns[at]]
        for i, cell in enumerate(cells):
            if _SIMPLE[decimal].fullmatch(cell):
                cells[i] = cell.replace(decimal, ".")
            elif not _like_number(cell):
                continue
            elif _WRITTEN[decimal].fullmatch(cell) or _ZERO.fullmatch(cell):
                cells[i] = _BLANKS.sub("", cell).replace(group, "").replace(decimal, ".")
                if parted is None and group in cell:
                    parted = _Witness(cell, rows[i], f"{cells[i]}")
            else:  # of the other way of writing, where the mark is stated
                demand = f"must be a number with a decimal {_NAMES[decimal]}"
                raise InputError(f"{labels[at]}, row {rows[i]}", cell, demand, where=where, remedy="decimal")
        plain[at] = cells
    if parted is None:
        return plain, []
    return plain, [
        f"the decimal mark of the file is the {_NAMES[decimal]}, and a {_NAMES[group]} parts thousands: "
        f"{parted.cell} in row {parted.row} is {parted.column}"
    ]


def _decimal_mark(columns: Sequence[tuple[Sequence[str], str]], rows: Sequence[int], where: str) -> str:
    """The decimal mark that all numbers of some columns with their labels fit.

    Raises:
        InputError: none does, or both do and would give other numbers.
    """
    only: dict[str, _Witness] = {}  # the first number that fits one way of writing alone, by its decimal mark
    count = collections.Counter[str]()
    both: _Witness | None = None
    for cells, label in columns:
        for cell, row in zip(cells, rows, strict=True):
            cell = cell.strip()
            mark = "," if "," in cell else "."
            if mark in only and _SIMPLE[mark].fullmatch(cell):  # no witness for the other mark, whatever it is
                count[mark] += 1
            elif mark in cell and _like_number(cell):
                fits = [one for one, written in _WRITTEN.items() if written.fullmatch(cell)]
                if len(fits) == 1:
                    only.setdefault(fits[0], _Witness(cell, row, label))
                    count[fits[0]] += 1
                elif fits and both is None:
                    both = _Witness(cell, row, label)
    if len(only) == 2:
        odd, usual = (only[mark] for mark in sorted(only, key=lambda mark: count[mark]))
        other = "" if usual.column == odd.column else f" of {usual.column}"
        demand = "a file is read with one decimal mark: write all its numbers with a point, or all with a comma"
        place = f"{odd.column}, row {odd.row}"
        problem = f"{place}: {odd.cell!r} is no number beside {usual.cell!r} in row {usual.row}{other}; {demand}"
        raise InputError(place, odd.cell, demand, sentence=problem, where=where)
    if both is not None and not only:
        mark = "." if "." in both.cell else ","
        small, large = both.cell.replace(",", "."), re.sub("[.,]", "", both.cell)
        problem = (
            f"{both.column}, row {both.row}: {both.cell!r} is {small} if the {_NAMES[mark]} is the decimal mark, and "
            f"{large} if it parts thousands; all numbers of the file fit both"
        )
        raise InputError("decimal", None, problem, sentence=problem, where=where, remedy="decimal")
    return next(iter(only), ".")


_NAMES = {".": "point", ",": "comma"}
_ZERO = re.compile(r"[-+]?0(?:[.,]000)+")
_GROUPED = re.compile(rf"\d{_GROUP}\d")
_BLANKS = re.compile(_GROUP)
_SIMPLE = {mark: re.compile(rf"[-+]?\d*{re.escape(mark)}\d+(?:[eE][-+]?\d+)?") for mark in ".,"}


def _dated(column: Sequence[str]) -> bool:
    first = next((cell.strip() for cell in column if cell.strip()), "")
    return _DATE.fullmatch(first) is not None


def plain_text(cell: str) -> str:
    """A cell without blanks around it, each letter in its usual code (NFC): an accent may be written as one or two."""
    return unicodedata.normalize("NFC", cell.strip())


def check_width(rows: Rows, width: int, wanted: str, where: str) -> None:
    """Refuse the first row that does not have `width` cells; `wanted` states the reason."""
    for number, row in rows:
        if len(row) != width:
            count = f"{len(row)} cell{'s' if len(row) != 1 else ''}"
            problem = f"row {number} has {count}, and {wanted}"
            raise InputError(f"row {number}", count, wanted, sentence=problem, where=where)


def rows_left_out(numbers: Sequence[int], reason: str) -> str:
    """The sentence that rows are left out: ``row 7 is left out: force is blank``."""
    if len(numbers) == 1:
        return f"row {numbers[0]} is left out: {reason}"
    named = ", ".join(map(str, numbers[:MOST_NAMED])) + (", .." if len(numbers) > MOST_NAMED else "")
    return f"{len(numbers)} rows are left out, {named}: {reason}"


def said_of(names: Sequence[str], what: str) -> list[str]:
    """The sentences ``a is left out: ..``, one for each channel; of many channels one for all of them."""
    if len(names) <= MOST_NAMED:
        return [f"{name} is {what}" for name in names]
    return [f"{', '.join(names[:MOST_NAMED])} and {len(names) - MOST_NAMED} more are {what}"]


def split_header(cell: str, words: Container[str]) -> tuple[str, list[str]]:
    """Split a header to its stem in lower case and the suffixes: ``pressure_kPa_gauge`` -> pressure, [kPa, gauge].

    Args:
        cell: the header.
        words: what counts as a unit.
    """
    parts = [w for w in re.split(r"[\s_\[\]()/\\,;:\"#]+|^\W+", cell) if w]
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
        raise InputError(f"{column}, row {line}", cell, "must be a number", where=where) from None
    if not np.isfinite(out).all():
        i = int(np.argmin(np.isfinite(out)))
        raise InputError(f"{column}, row {lines[i]}", cells[i], "must be a finite number", where=where)
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
