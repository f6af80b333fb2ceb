"""Content of specimen files."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..accessors import implementation
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import to_si
from ..schema import FileTable, Place, entry, read_table, word, write_table

if TYPE_CHECKING:
    from ..recordings import ForceMap

SCHEMA = 1
_ID = r"[A-Za-z0-9][A-Za-z0-9._-]*"
KINDS = ("mckibben", "biological", "valve")


def _read_value(raw: Any, place: Place) -> float | list[float]:
    numbers = raw if isinstance(raw, list) else [raw]
    if not numbers or not all(map(_is_number, numbers)):
        raise place.fail(raw, "must be a number, or a list of numbers")
    if not all(math.isfinite(v) for v in numbers):
        raise place.fail(raw, "must be a finite number")
    value: float | list[float] = raw
    return value


def _read_range(raw: Any, place: Place) -> tuple[float, float]:
    if not (isinstance(raw, list | tuple) and len(raw) == 2 and all(map(_is_number, raw))):
        raise place.fail(raw, "must be two numbers")
    return float(raw[0]), float(raw[1])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclasses.dataclass(frozen=True, kw_only=True)
class SpecimenNumber:
    """A number of a specimen, or a list of them, as its source states it."""

    value: float | list[float] = entry(_read_value)
    unit: str = word("of the value")
    source: str = word("citation key", default="")
    inferred: bool = False
    note: str = word("beside it", default="")
    range: tuple[float, float] | None = entry(_read_range, write=lambda ends, _: list(ends), default=None)

    def stated(self) -> dict[str, JsonValue]:
        """Return the stated fields only."""
        return write_table(self) | ({} if self.range is None else {"range": self.range})

    def si(self, unit: str, *, field: str, where: str | None = None) -> float | list[float]:
        """The value in an SI unit; raises `InputError` when the dimension is another."""
        if isinstance(self.value, list):
            return [to_si(v, self.unit, unit, field=field, where=where) for v in self.value]
        return to_si(self.value, self.unit, unit, field=field, where=where)


Group = dict[str, SpecimenNumber]


def _read_groups(raw: Any, place: Place) -> dict[str, Group]:
    groups = FileTable.of(raw, place.field, place.where or "")
    return {name: _read_group(group, place.below(name)) for name, group in groups.values.items()}


def _read_group(raw: Any, place: Place) -> Group:
    group = FileTable.of(raw, place.field, place.where or "")
    return {name: read_table(SpecimenNumber, group.table(name), owner="a number has") for name in group.values}


def _read_sources(raw: Any, place: Place) -> list[str]:
    if not isinstance(raw, list) or not all(isinstance(s, str) for s in raw):
        raise place.fail(raw, "must be a list of citation keys")
    return raw


@dataclasses.dataclass(frozen=True, kw_only=True)
class Specimen:
    """A muscle or a valve as published: its dimensions, and the parameters of every law that was stated for it.

    A valve names the pneumatic element that it is, and states that element's parameters in the group `valve`. `errors`
    states by law how far its tension is from what was measured or printed, see `specimens.load.KNOWN_ERRORS`, and `between`
    how far another muscle of the make differs, see `specimens.load.KNOWN_BETWEEN`.

    Examples:
        >>> import mckibben as mk
        >>> nylon = mk.specimen("nylon")
        >>> nylon.property_si("rest_length", "m")
        0.14
        >>> mk.specimen("DMSP-20-300").force_map()
        ForceMap('DMSP-20-300_force_map.csv': 126 points, 60 with tension, largest 1654 N)
    """

    schema: int = SCHEMA
    id: str = word(pattern=_ID, demand="letters, digits, dots, dashes and underscores, a letter or digit first")
    kind: str = word(among=KINDS)
    title: str = word()
    sources: list[str] = entry(_read_sources)
    law: str = word(default="")
    element: str = word(default="")
    note: str = word(default="")
    properties: Group = entry(_read_group, default_factory=dict)
    laws: dict[str, Group] = entry(_read_groups, default_factory=dict)
    friction: dict[str, Group] = entry(_read_groups, default_factory=dict)
    errors: dict[str, Group] = entry(_read_groups, default_factory=dict)
    valve: Group = entry(_read_group, default_factory=dict)
    between: Group = entry(_read_group, default_factory=dict)
    map: str | None = word(default=None)
    where: str = ""

    def __repr__(self) -> str:
        laws = f", laws {', '.join(self.laws)}" if self.laws else ""
        return f"Specimen({self.id!r}: {self.title}; {self.kind}{laws})"

    def __hash__(self) -> int:
        return hash((self.id, self.law, self.where))  # its tables have no hash

    @classmethod
    def read(cls, raw: Mapping[str, JsonValue], *, where: str) -> Specimen:
        """Make one of the tables of a file.

        Raises:
            InputError: names the file, the key, its value, and what it must be.
        """
        return read_table(cls, FileTable(raw, "", where), owner="a specimen has", where=where)

    def stated(self) -> dict[str, JsonValue]:
        """Return the stated fields as plain tables."""
        return dataclasses.asdict(self)

    def source(self) -> str:
        """The first source, as a citation key; empty if the file names none."""
        return self.sources[0] if self.sources else ""

    def inferred(self) -> list[str]:
        """Dotted paths of all numbers that no source prints; those of the default law first."""
        order = [self.law] * bool(self.law) + [name for name in self.laws if name != self.law]
        groups: dict[str, Group] = {"properties": self.properties}
        groups |= {f"laws.{name}": self.laws[name] for name in order}
        groups |= {f"friction.{name}": group for name, group in self.friction.items()}
        groups["valve"] = self.valve
        return [f"{path}.{name}" for path, group in groups.items() for name, p in group.items() if p.inferred]

    def force_map(self) -> ForceMap:
        """The measured force map that ships with the specimen.

        Raises:
            InputError: the specimen ships without one; names those that ship with one.
        """
        path = implementation("specimens.load:map_file")(self)
        points: ForceMap = implementation("recordings.force_map:read_force_map")(
            path, rest_length=self.property_si("rest_length", "m")
        )
        return points

    def property_si(self, name: str, unit: str) -> float:
        """A scalar property in an SI unit."""
        if name not in self.properties:
            raise InputError(f"properties.{name}", None, "is missing: this step needs it", where=self.where or self.id)
        value = self.properties[name].si(unit, field=f"properties.{name}", where=self.where or self.id)
        assert isinstance(value, float)
        return value
