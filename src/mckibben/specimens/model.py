"""What a specimen file may contain."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from typing import Any

from ..errors import InputError

SCHEMA = 1
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
KINDS = ("mckibben", "biological", "valve")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Parameter:
    """One number of a specimen, or a list of them, as its source states it."""

    value: float | list[float]
    unit: str
    source: str = ""
    inferred: bool = False
    note: str = ""
    range: tuple[float, float] | None = None

    @classmethod
    def read(cls, raw: Any, *, field: str, where: str | None = None) -> Parameter:
        """One from a table of a file.

        Raises:
            InputError: names the key, and what is allowed.
        """
        own = _keys(cls, raw, field, where)
        value, span = own["value"], own.get("range")
        numbers = value if isinstance(value, list) else [value]
        if not numbers or not all(map(_is_number, numbers)):
            raise _bad(f"{field}.value", value, "a number, or a list of numbers", where)
        if not all(math.isfinite(v) for v in numbers):
            raise _bad(f"{field}.value", value, "a finite number", where)
        if span is not None and not (isinstance(span, list | tuple) and len(span) == 2 and all(map(_is_number, span))):
            raise _bad(f"{field}.range", span, "two numbers", where)
        for key in ("unit", "source", "note"):
            _word(own, key, field, where)
        if not isinstance(own.get("inferred", False), bool):
            raise _bad(f"{field}.inferred", own["inferred"], "true or false", where)
        return cls(**own | ({} if span is None else {"range": (float(span[0]), float(span[1]))}))

    def stated(self) -> dict[str, Any]:
        """What was stated, without what was left out."""
        fields = dataclasses.fields(self)
        return {f.name: getattr(self, f.name) for f in fields if getattr(self, f.name) != f.default}

    def si(self, unit: str, *, field: str, where: str | None = None) -> float | list[float]:
        """The value in an SI unit; raises `InputError` when the dimension is another."""
        from ..quantities import to_si

        if isinstance(self.value, list):
            return [to_si(v, self.unit, unit, field=field, where=where) for v in self.value]
        return to_si(self.value, self.unit, unit, field=field, where=where)


Group = dict[str, Parameter]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Specimen:
    """A muscle or a valve as published: its dimensions, and the parameters of every law that was stated for it.

    A valve names the pneumatic element that it is, and states that element's parameters in the group `valve`.
    """

    schema: int = SCHEMA
    id: str
    kind: str
    title: str
    sources: list[str]
    law: str = ""
    element: str = ""
    note: str = ""
    properties: Group = dataclasses.field(default_factory=dict)
    laws: dict[str, Group] = dataclasses.field(default_factory=dict)
    friction: dict[str, Group] = dataclasses.field(default_factory=dict)
    valve: Group = dataclasses.field(default_factory=dict)
    map: str | None = None
    where: str = ""

    @classmethod
    def read(cls, raw: Mapping[str, Any], *, where: str) -> Specimen:
        """One from the tables of a file.

        Raises:
            InputError: names the file, the key, its value, and what is allowed.
        """
        own = _keys(cls, raw, "", where)
        for key in ("id", "kind", "title", "law", "element", "note", "map"):
            _word(own, key, "", where)
        if not _ID.fullmatch(own["id"]):
            raise _bad("id", own["id"], "letters, digits, dots, dashes and underscores, a letter or digit first", where)
        if own["kind"] not in KINDS:
            raise _bad("kind", own["kind"], ", ".join(KINDS), where)
        if not isinstance(own["sources"], list) or not all(isinstance(s, str) for s in own["sources"]):
            raise _bad("sources", own["sources"], "a list of citation keys", where)
        for key in ("properties", "valve"):
            own[key] = _group(own.get(key, {}), key, where)
        for key in ("laws", "friction"):
            named = _table(own.get(key, {}), key, where)
            own[key] = {name: _group(group, f"{key}.{name}", where) for name, group in named.items()}
        return cls(**own | {"where": where})

    def stated(self) -> dict[str, Any]:
        """All of it as plain tables."""
        return dataclasses.asdict(self)

    def source(self) -> str:
        """The first source, as a citation key."""
        return self.sources[0]

    def inferred(self) -> list[str]:
        """Dotted paths of all numbers that no source prints; those of the default law first."""
        order = [self.law] * bool(self.law) + [name for name in self.laws if name != self.law]
        groups: dict[str, Group] = {"properties": self.properties}
        groups |= {f"laws.{name}": self.laws[name] for name in order}
        groups |= {f"friction.{name}": group for name, group in self.friction.items()}
        groups["valve"] = self.valve
        return [f"{path}.{name}" for path, group in groups.items() for name, p in group.items() if p.inferred]

    def property_si(self, name: str, unit: str) -> float:
        """A scalar property in an SI unit."""
        if name not in self.properties:
            raise InputError(f"properties.{name}", "missing", "this step needs it", where=self.where or self.id)
        value = self.properties[name].si(unit, field=f"properties.{name}", where=self.where or self.id)
        assert isinstance(value, float)
        return value


def _bad(field: str, value: Any, allowed: str, where: str | None) -> InputError:
    shown = value if isinstance(value, str | int | float) else type(value).__name__
    return InputError(field or "file", shown, f"allowed is {allowed}", where=where)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _table(raw: Any, field: str, where: str | None) -> Mapping[str, Any]:
    if not isinstance(raw, Mapping):
        raise _bad(field, raw, "a table", where)
    return raw


def _keys(kind: type, raw: Any, field: str, where: str | None) -> dict[str, Any]:
    """The entries of a table, of which none is unknown and none that is needed is missing."""
    own, known = dict(_table(raw, field, where)), {f.name: f for f in dataclasses.fields(kind)}
    prefix = f"{field}." if field else ""
    for key in own:
        if key not in known:
            raise InputError(f"{prefix}{key}", "unknown", "no such key in a specimen file", where=where)
    for key, f in known.items():
        needed = f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING
        if needed and key not in own:
            raise InputError(f"{prefix}{key}", "missing", "it is required", where=where)
    return own


def _word(own: Mapping[str, Any], key: str, field: str, where: str | None) -> None:
    if key in own and not isinstance(own[key], str):
        raise _bad(f"{field}.{key}" if field else key, own[key], "a text", where)


def _group(raw: Any, field: str, where: str | None) -> Group:
    table = _table(raw, field, where)
    return {name: Parameter.read(entry, field=f"{field}.{name}", where=where) for name, entry in table.items()}
