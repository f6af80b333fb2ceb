"""Published ranges of biological muscle: how far a property spreads between muscles, each number with its source.

They stand beside what is computed of single specimens, and are never computed with. Lengths are over the rest length.
"""

from __future__ import annotations

import functools
import math
from importlib import resources
from typing import Any, NamedTuple

from ..documents import parse_toml
from ..errors import InputError

SCHEMA = 1
_KEYS = ("property", "low", "high", "unit", "source", "through", "derived", "note")


class PublishedRange(NamedTuple):
    """From where to where a property lies, as its sources print it, and what they are."""

    property: str
    low: float  # [unit]
    high: float  # [unit]
    unit: str  # in words, without the rest length that the property may be taken over
    sources: tuple[str, ...]  # citation keys
    through: str = ""  # the paper that cites them, where they were not at hand
    derived: bool = False  # computed by its source of other numbers
    note: str = ""

    def si(self, unit: str) -> tuple[float, float]:
        """Both ends in an SI unit; raises `InputError` when the dimension is another."""
        from ..quantities import to_si

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
        raise InputError("published", name, "known is biological")
    return read_ranges(file.read_text(encoding="utf-8"), where=f"{name}.toml")


def read_ranges(text: str, *, where: str) -> dict[str, PublishedRange]:
    """The ranges of a file's text; raises `InputError` with the file, the entry and what is allowed."""
    document = parse_toml(text, where=where)
    if document.get("schema") != SCHEMA:
        raise InputError(
            "schema", document.get("schema", "missing"), f"this version reads schema {SCHEMA}", where=where
        )
    found: dict[str, PublishedRange] = {}
    for i, entry in enumerate(document.get("range", []), 1):
        one = _range(entry, f"range.{i}", where)
        if one.property in found:
            raise InputError(f"range.{i}.property", one.property, "it stands twice", where=where)
        found[one.property] = one
    return found


def _range(entry: dict[str, Any], field: str, where: str) -> PublishedRange:
    for key in entry:
        if key not in _KEYS:
            raise InputError(f"{field}.{key}", "unknown", f"known are {', '.join(_KEYS)}", where=where)
    for key in ("property", "low", "high", "unit", "source"):
        if key not in entry:
            raise InputError(f"{field}.{key}", "missing", "it is required", where=where)
    low, high = (_number(entry[key], f"{field}.{key}", where) for key in ("low", "high"))
    if low > high:
        raise InputError(f"{field}.low", low, f"allowed is at most high, {high:g}", where=where)
    sources, rest = tuple(entry["source"]), {k: entry[k] for k in ("through", "derived", "note") if k in entry}
    return PublishedRange(entry["property"], low, high, entry["unit"], sources, **rest)


def _number(value: Any, field: str, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(field, str(value), "allowed is a finite number", where=where)
    return float(value)
