"""Reading a table of words: every key by its dotted path, with what is allowed where something is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..quantities import Quantity, parse
from .waveforms import near


@dataclass(frozen=True)
class Entry:
    """A table of a file: its values, its dotted path, and the file."""

    values: Mapping[str, Any]
    path: str
    where: str

    @classmethod
    def of(cls, value: Any, path: str, where: str) -> Entry:
        """The same of a value that must be a table."""
        if not isinstance(value, Mapping):
            raise InputError(path, shown(value), "allowed is a table", where=where)
        return cls(value, path, where)

    def field(self, key: str) -> str:
        """The dotted path of a key."""
        return f"{self.path}.{key}" if self.path else key

    def fail(self, key: str, value: Any, allowed: str) -> InputError:
        """A complaint about a key, to be raised."""
        return InputError(self.field(key), shown(value), allowed, where=self.where)

    def only(self, known: Iterable[str], what: str = "") -> None:
        """Refuse keys that are not known."""
        names = list(known)
        for key in self.values:
            if key not in names:
                raise self.fail(key, "unknown", f"{near(key, names)}{what or 'known are'} {', '.join(names)}")

    def word(self, key: str, default: str | None = None, *, among: Iterable[str] | None = None) -> str:
        """A text, one of some where they are given."""
        value = self.values.get(key, default)
        if value is None:
            names = "" if among is None else f"; known are {', '.join(among)}"
            raise self.fail(key, "missing", f"it is required{names}")
        if not isinstance(value, str) or not value.strip():
            raise self.fail(key, value, "allowed is a word")
        if among is not None and value not in among:
            raise self.fail(key, value, f"{near(value, among)}known are {', '.join(among)}")
        return value

    def text(self, key: str) -> str:
        """A text, or nothing where it is left out."""
        return self.word(key) if key in self.values else ""

    def number(self, key: str, unit: str, default: float | None = None, *, declared: Quantity | None = None) -> float:
        """A number with its unit in words, as SI, within the bounds of a declaration."""
        if key not in self.values and default is not None:
            return default
        raw = self.values.get(key)
        if raw is None:
            raise self.fail(key, "missing", "it is required")
        if isinstance(raw, bool) or not isinstance(raw, str | int | float):
            raise self.fail(key, raw, "allowed is a number with its unit in words")
        value = parse(str(raw), unit, field=self.field(key), where=self.where)
        if declared is not None:
            declared.check(self.field(key), value, where=self.where)
        return value

    def table(self, key: str) -> Entry:
        """A table below; empty where it is left out."""
        return Entry.of(self.values.get(key, {}), self.field(key), self.where)


def shown(value: Any) -> Any:
    """A value as a complaint shows it."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return f"{type(value).__name__} {value}"
    return value
