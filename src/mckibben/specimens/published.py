"""Published ranges of biological muscle: how far a property spreads between muscles, each number with its source.

They stand beside what is computed of single specimens, and are never computed with. Lengths are over the rest length.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from importlib import resources
from typing import Any

from ..answers import brief
from ..documents import parse_toml
from ..errors import InputError
from ..quantities import to_si
from ..schema import FileTable, Place, entry, flag, read_table, word, words

SCHEMA = 1


def _read_number(raw: Any, place: Place) -> float:
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not math.isfinite(raw):
        raise place.fail(raw, "must be a finite number")
    return float(raw)


@dataclass(frozen=True)
class PublishedRange:
    """A published range of a property, with its sources."""

    property: str
    low: float = entry(_read_number)  # [unit]
    high: float = entry(_read_number)  # [unit]
    unit: str = word("in words, without the rest length that the property may be taken over")
    sources: tuple[str, ...] = words("citation keys", key="source")
    through: str = word("the paper that cites them, where they were not at hand", default="")
    derived: bool = flag("computed by its source of other numbers", default=False)
    note: str = word(default="")

    __repr__ = brief

    def si(self, unit: str) -> tuple[float, float]:
        """Convert both ends to an SI unit; raises `InputError` for another dimension."""
        low, high = (to_si(end, self.unit, unit, field=self.property) for end in (self.low, self.high))
        return low, high


@functools.cache
def published_ranges(name: str = "biological") -> dict[str, PublishedRange]:
    """The ranges of a shipped table by property.

    Raises:
        InputError: if there is no such table.
    """
    file = resources.files(__package__) / "published" / f"{name}.toml"
    if not file.is_file():
        raise InputError("published", name, known=("biological",))
    return read_ranges(file.read_text(encoding="utf-8"), where=f"{name}.toml")


def read_ranges(text: str, *, where: str) -> dict[str, PublishedRange]:
    """The ranges of a file's text; raises `InputError` with the file, the entry and what is allowed."""
    top = FileTable(parse_toml(text, where=where), "", where)
    top.schema(SCHEMA)
    ranges: dict[str, PublishedRange] = {}
    for table in top.listed("range"):
        one = read_table(PublishedRange, table, owner="a range has")
        if one.low > one.high:
            raise table.fail("low", one.low, f"must be at most high, {one.high:g}")
        if one.property in ranges:
            raise table.fail("property", one.property, "it stands twice")
        ranges[one.property] = one
    return ranges
