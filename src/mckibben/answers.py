"""What must be said with an answer, kept in the answer itself, so that every face says the same.

An answer is an immutable value with `cautions`, `balances` and `sources`. Where a question returns plain numbers, as
`Muscle.tension` does, its cautions go out as Python warnings by `warn`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, ClassVar

from .citations import reference
from .documents import JsonValue
from .errors import InputError, PlausibilityWarning
from .quantities import from_si, shown_unit, with_unit

NOTEBOOK_ROWS = 10  # of rankings


@dataclass(frozen=True)
class Caution:
    """What must be known before an answer is used.

    Attributes:
        text: a sentence without capital and full stop.
        parameter: name of the parameter that it is about, beside which a face shows it; empty: of the whole answer.

    Examples:
        >>> str(Caution("a pressure of 3 Pa inflates no muscle; was 3 bar meant?", "pressure"))
        'a pressure of 3 Pa inflates no muscle; was 3 bar meant?'
    """

    text: str
    parameter: str = ""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Column:
    """A column of a table: what its values are, and how a person reads one.

    Attributes:
        key: of the values in a row.
        title: words at its head; the key by default.
        unit: SI unit of numbers, ``1`` for pure ones; empty for words.
        shown: unit in which a person reads them, ``%`` for shares; the usual one by default.
        places: format of a number; empty for three digits, or all of a whole number.
        right: whether words stand at the right, as numbers do.
        ends: keys of the ends of a range that is shown in brackets where it is one, or instead of a value.
        missing: stands for what there is not.
        own: key of the SI unit that each row has of its own, as parameters have.
        beside: whether the unit stands beside each number, not at the head.
        most: a larger number is shown as above this one.
        failed: stands for a number that is infinite.
        star: key of what is true where a star stands behind the value.
    """

    key: str
    title: str | None = None
    unit: str = ""
    shown: str = ""
    places: str = ".4g"
    right: bool = False
    ends: tuple[str, str] | None = None
    missing: str = ""
    own: str = ""
    beside: bool = False
    most: float | None = None
    failed: str = ""
    star: str = ""

    @property
    def head(self) -> str:
        """Title with the unit."""
        title = self.key.replace("_", " ") if self.title is None else self.title
        unit = self.shown or shown_unit(self.unit)
        return title if unit in ("", "1") or not title or self.beside else f"{title}, {unit}"

    def cell(self, row: Mapping[str, Any]) -> str:
        """The value of a row as a person reads it, with its range in brackets."""
        if own := row.get(self.own):
            value = row.get(self.key)
            return self.missing if value is None or value != value else with_unit(value, own)
        words = self.text(row.get(self.key)) + "*" * bool(row.get(self.star))
        if self.ends is None or row.get(self.ends[0]) is None:
            return words
        low, high = (self.text(row[end]) for end in self.ends)
        if row.get(self.key) is None:
            return low if low == high else f"{low} to {high}"
        return words if low == high == words else f"{words} ({low} to {high})"

    def text(self, value: Any) -> str:
        """A value as a person reads it; `missing` where there is none or it is not a number."""
        if value is None or value != value:
            return self.missing
        if not self.unit:
            return str(value)
        unit = self.shown or shown_unit(self.unit)
        if self.failed and abs(value) == float("inf"):
            return self.failed
        if self.most is not None and value > self.most:
            return f"> {dataclasses.replace(self, most=None, places='.4g').text(self.most)}"
        number = 100.0 * value if unit == "%" else value if unit == self.unit else from_si(value, self.unit, unit)
        text = f"{number:{self.places or ('.0f' if abs(number) >= 100.0 else '.3g')}}"
        text = text if text.strip("-0.%") else text.lstrip("-")  # what is rounded to zero has no sign
        return f"{text} {unit}" if self.beside and unit not in ("", "1") else text


@dataclass(frozen=True)
class Table:
    """Rows of values [SI] below their columns, with sentences below; whoever shows them asks `heads` and `cells`.

    Attributes:
        title: above it.
        columns: from left to right.
        rows: values by the keys of the columns.
        notes: sentences below it.
        most: rows that a person is shown; all by default.
        below: key of what is said below each row, across the columns; none by default.
    """

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[Mapping[str, Any]]
    notes: tuple[str, ...] = ()
    most: int | None = None
    below: str = ""

    def __repr__(self) -> str:
        return brief(self)

    def _repr_html_(self) -> str:
        def line(tag: str, words: Sequence[str]) -> str:
            aside = (f" style='text-align:{'right' if i in self.right else 'left'}'" for i in range(len(words)))
            return f"<tr>{''.join(f'<{tag}{a}>{escape(w)}</{tag}>' for w, a in zip(words, aside, strict=True))}</tr>"

        across = f"<tr><td colspan={len(self.told)}>"
        said = [f"{across}{escape(str(row[self.below]))}</td></tr>" if self.below else "" for row in self.rows]
        lines = [line("td", row) + more for row, more in zip(self.cells(), said, strict=True)][: self.most]
        notes = "".join(f"<p>{escape(named(note))}</p>" for note in self.notes)
        heading = f"<p><b>{escape(self.title)}</b></p>" if self.title else ""
        return f"{heading}<table>{line('th', self.heads)}{''.join(lines)}</table>{notes}"

    @functools.cached_property  # each cell asks for it
    def told(self) -> list[Column]:
        """Columns that say something in at least one row; all of them where there is no row."""
        return [one for one in self.columns if not self.rows or any(one.cell(row) for row in self.rows)]

    @property
    def heads(self) -> list[str]:
        """Heads of the columns."""
        return [column.head for column in self.told]

    @property
    def right(self) -> list[int]:
        """Columns that stand at the right."""
        return [i for i, column in enumerate(self.told) if column.unit or column.own or column.right]

    def cells(self) -> list[list[str]]:
        """All values as a person reads them."""
        return [[column.cell(row) for column in self.told] for row in self.rows]


def estimates(
    title: str, values: Mapping[str, Any], notes: Sequence[str] = (), *, more: Mapping[str, str] | None = None
) -> Table:
    """Table of parameters with their 95 % intervals.

    Args:
        title: above it.
        values: an estimate by the name of each parameter: ``value``, ``low``, ``high`` and ``unit`` [SI].
        notes: sentences below it.
        more: what is to be said of a parameter, instead of its interval.
    """
    said = more or {}
    rows: list[dict[str, Any]] = [
        {"name": name, "value": e.value, "unit": e.unit, "said": said.get(name, "")}
        | ({} if name in said else {"low": e.low, "high": e.high})
        for name, e in values.items()
    ]
    columns = [Column("name", "parameter"), Column("value", own="unit")]
    if len(said) < len(rows):
        columns += [Column("low", "95 %: from", own="unit"), Column("high", "to", own="unit")]
    columns += [Column("said", "")] if said else []
    return Table(title, tuple(columns), rows, tuple(notes))


class Answer:
    """Base of answers: frozen data classes that carry what must be said with them.

    What a command prints and writes follows from the methods: a subclass has those for which there is something to show.

    Attributes:
        cautions: in the order in which they are shown, each once.
        balances: by name, the share that a balance leaves open [1]; empty where nothing was balanced.
        sources: keys of the references that the numbers rest on.
    """

    cautions: tuple[Caution, ...] = ()
    balances: Mapping[str, float] = {}
    sources: tuple[str, ...] = ()
    units: ClassVar[Mapping[str, str]] = {}  # SI units of the columns of `rows`

    def to_dict(self) -> dict[str, JsonValue]:
        """All of it as plain values [SI], which ``--json`` prints with the cautions as ``warnings``."""
        raise NotImplementedError

    def rows(self) -> Sequence[Mapping[str, JsonValue]]:
        """Rows of the main table [SI], for files and data frames."""
        return ()

    def data(self) -> Mapping[str, Sequence[Any]]:
        """Columns of the main table [SI], as files hold it."""
        rows = self.rows()
        names = dict.fromkeys(name for row in rows for name in row)
        return {name: [row.get(name) for row in rows] for name in names}

    def column_units(self) -> Mapping[str, str]:
        """SI units of the columns of the main table."""
        return self.units

    def tables(self) -> Sequence[Table]:
        """Tables for people, the most important one first."""
        return ()

    def remarks(self) -> Sequence[str]:
        """Sentences below the tables."""
        return ()

    def _repr_html_(self) -> str:
        """What a notebook shows: cautions, tables, sentences, and the picture where there is one."""
        cautions = (f"<p><b>Caution:</b> {escape(one.text)}</p>" for one in self.cautions)
        tables = (one._repr_html_() for one in self.first(NOTEBOOK_ROWS).tables())
        keys = (f"[{key}] {reference(key)}" for key in self.sources)
        remarks = (f"<p>{escape(named(one))}</p>" for one in (*self.remarks(), *keys))
        picture, plot = "", getattr(self, "plot", None)
        with contextlib.suppress(InputError):  # it holds nothing that can be drawn
            text = "" if plot is None else plot()._repr_svg_()
            picture = f"<div>{text[text.index('<svg') :]}</div>" if text else ""
        return "".join([*cautions, *tables, *remarks, picture])

    def first(self, count: int) -> Answer:
        """The same with the first rows of its rankings only."""
        return self

    def failure(self) -> str | None:
        """Why what was asked for was not reached, empty where the tables say it; None if it was."""
        return None


def named(sentence: str, shown: Callable[[str], str] = str) -> str:
    """A sentence whose parameters in braces are called as somebody calls them."""
    return re.sub(r"\{(\w+)\}", lambda found: shown(found[1]), sentence)


def collect(*cautions: Caution | None) -> tuple[Caution, ...]:
    """The cautions that there are, each once, in their order."""
    return tuple(dict.fromkeys(one for one in cautions if one is not None))


def warn(cautions: Iterable[Caution], *, stacklevel: int = 2) -> None:
    """Say cautions as `PlausibilityWarning`, for questions whose answer is a plain number."""
    for caution in cautions:
        warnings.warn(caution.text, PlausibilityWarning, stacklevel=stacklevel + 1)


FEW = 3  # entries that are shown one by one
SHOWN = 80  # characters of a value within `brief`


def brief(value: object) -> str:
    """The representation of a data class or named tuple in one line, however much it holds: `__repr__ = brief`.

    Examples:
        >>> from mckibben.batch import grid
        >>> grid({"rest_length": [0.1 + 0.001 * i for i in range(100)]})
        Variants(columns={'rest_length': array (100,)})
    """
    names = getattr(value, "_fields", None) or [f.name for f in dataclasses.fields(value) if f.repr]  # type: ignore[arg-type]
    return f"{type(value).__name__}({', '.join(f'{name}={_shown(getattr(value, name))}' for name in names)})"


def _shown(value: object) -> str:
    if isinstance(shape := getattr(value, "shape", None), tuple) and shape:
        return f"array {shape}"
    if isinstance(value, Mapping) and len(value) <= FEW:
        text = f"{{{', '.join(f'{key!r}: {_shown(one)}' for key, one in value.items())}}}"
    elif isinstance(value, list | tuple | Mapping | set) and len(value) > FEW and not hasattr(value, "_fields"):
        return f"{len(value):,} entries"
    else:
        text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}.."
