"""Specimen files: what they hold, and how they are found, read and written."""

from __future__ import annotations

import dataclasses
import functools
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import recordings
from ..documents import JsonValue, parse_toml, path_text, read_text, write_text
from ..errors import InputError, not_found
from ..quantities import to_si
from ..registry import with_own_references
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
    states by law how far its tension is from what was measured or printed, see `KNOWN_ERRORS`, `between`
    how far another muscle of the make differs, see `KNOWN_BETWEEN`, and `residual` what was learned beside its default law,
    see `muscles.learned`.

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
    residual: Group = entry(_read_group, default_factory=dict)
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
        return recordings.read_force_map(map_file(self), rest_length=self.property_si("rest_length", "m"))

    def property_si(self, name: str, unit: str) -> float:
        """A scalar property in an SI unit."""
        if name not in self.properties:
            raise InputError(f"properties.{name}", None, "is missing: this step needs it", where=self.where or self.id)
        value = self.properties[name].si(unit, field=f"properties.{name}", where=self.where or self.id)
        assert isinstance(value, float)
        return value


FOLDER_VARIABLE = "MCKIBBEN_SPECIMENS"
LONGEST = 100  # letters of an id; longer ones are no name of a file

# Properties that a specimen may state beside its laws, with their SI units.
KNOWN_PROPERTIES = {
    "rest_length": "m",
    "upper_length": "m",
    "stretched_length": "m",
    "largest_strain": "1",  # of the braid beyond the longest length of its law, at which its threads break
    "diameter_shortened": "m",
    "outer_diameter": "m",
    "thread_diameter": "m",
    "thread_length": "m",  # of a braid whose law states none
    "turns": "1",
    "bladder_thickness": "m",
    "shore_hardness": "1",
    "rest_inner_diameter": "m",
    "wall_thickness": "m",
    "rest_angle": "rad",
    "section_area": "m^2",
    "burst_pressure": "Pa",
    "rated_pressure": "Pa",
    "coulomb_friction": "N",
    "creep_stiffness": "N/m",  # of Maxwell elements beside the braid, as many as time constants
    "creep_time_constants": "s",
    "leak_decay": "1/s",  # share of the pressure that the shut muscle loses per second
    "measured_rest_lengths": "m",  # of the muscles to which the laws were fitted, one or several
    "highest_measured_pressure": "Pa",  # gauge; of the points to which the laws were fitted
    "shortest_measured_length": "m",
    "longest_measured_length": "m",
    "tension_uncertainty": "N",  # half width of the 95 % interval of a predicted tension
    "flow_into_the_room": "m^3/s",
    "flow_pressure": "Pa",
    "effective_flow": "m^3/s",
    "mass": "kg",
    "length": "m",
    "width": "m",
    "height": "m",
    "current": "A",
    "voltage": "V",
}

# Errors that a specimen may state of each of its laws, as shares of the largest measured tension [1], and where one is from.
KNOWN_ERRORS = {
    "rms": "1",
    "largest": "1",
    "other_muscle": "1",  # the largest on another muscle of the make
    "other_length": "1",  # the largest at a rest length to which the law was not fitted
    "other_length_at": "m",  # that rest length
}

# Standard deviations by which one muscle of the make differs from another, see `identification.between.Between`.
BETWEEN_COMPONENTS = {
    "whole_length": "m",
    "below_rest": "m",
    "set_length": "m",
    "gain": "1",
    "branch": "1",
    "pressure_shape": "1",
    "noise": "1",
}
# Half widths of the 95 % interval of muscles of a make whose differences are not known, over the largest tension [1].
BETWEEN_SHARES = ("same_rig", "elsewhere", "calibrated")
KNOWN_BETWEEN = BETWEEN_COMPONENTS | dict.fromkeys(BETWEEN_SHARES, "1")
# What a specimen states that was calibrated by readings of one muscle; a parameter as it was before is "before_NAME".
READINGS = {"reading_lengths": "m", "reading_pressures": "Pa", "reading_tensions": "N"}
BEFORE = "before_"

MUSCLES = ("mckibben", "biological")  # kinds of specimens that are muscles


def specimen(name: str | os.PathLike[str], *, kinds: Sequence[str] = KINDS) -> Specimen:
    """Load a specimen by its id (any case) or by the path of a ``.toml`` file.

    Args:
        name: the id, or the path.
        kinds: kinds of specimens that are proposed where there is none of that name.

    Raises:
        InputError: if it is unknown, or the file is not a valid specimen; names the file, the field and the value.

    Examples:
        >>> import mckibben as mk
        >>> mk.specimen("nylon").title
        'Nylon shell muscle of Chou and Hannaford'
    """
    text = path_text(name, "specimen")
    if text.lower().endswith(".toml") or os.sep in text:
        return _read(read_text(text, field="specimen"), where=text)
    if (one := find_specimen(text)) is None:
        known = [s.id for s in specimens() if s.kind in kinds]
        raise InputError("specimen", text, "give a .toml file or one of", known=known)
    return one


def find_specimen(name: str) -> Specimen | None:
    """The specimen of an id (any case), None if there is none; of the shipped ones no file but its own is read."""
    return (None if os.environ.get(FOLDER_VARIABLE) else _shipped(name.lower())) or _by_id().get(name.lower())


def muscle_specimen(name: str | os.PathLike[str]) -> Specimen:
    """Load a specimen where a muscle is wanted, so that only muscles are proposed for a name that there is none of."""
    return specimen(name, kinds=MUSCLES)


def specimens() -> list[Specimen]:
    """Load all shipped specimens and those of the user's folders."""
    return list(_by_id().values())


def specimen_ids(kind: str | None = None) -> list[str]:
    """Their ids, of one kind where it is given."""
    return [s.id for s in specimens() if kind in (None, s.kind)]


def map_file(spec: Specimen) -> Path:
    """The measured force map that ships with a specimen."""
    if spec.map is None:
        with_map = [s.id for s in specimens() if s.map]
        said = f"{spec.id} ships without a force map; those that ship with one are {', '.join(with_map)}"
        raise InputError("specimen", spec.id, sentence=said)
    return Path(str(resources.files(__package__) / "maps" / spec.map))


@functools.cache
def _shipped(name: str) -> Specimen | None:
    """A shipped specimen by its id in small letters, which is the name of its file; None if there is none."""
    if not name.replace("-", "").replace("_", "").isalnum() or len(name) > LONGEST:
        return None
    file = resources.files(__package__) / "data" / f"{name}.toml"
    return _read(file.read_text(encoding="utf-8"), where=file.name) if file.is_file() else None


def _by_id() -> dict[str, Specimen]:
    return _all(os.environ.get(FOLDER_VARIABLE, ""))


@functools.lru_cache(maxsize=4)
def _all(folders: str) -> dict[str, Specimen]:
    specimens_by_id: dict[str, Specimen] = {}
    for where, text in _files(folders):
        one = _read(text, where=where)
        if one.id.lower() in specimens_by_id:
            raise InputError("id", one.id, "another specimen has that id", where=where)
        specimens_by_id[one.id.lower()] = one
    return specimens_by_id


def _files(folders: str) -> Iterator[tuple[str, str]]:
    shipped = resources.files(__package__) / "data"
    for file in sorted(shipped.iterdir(), key=lambda one: one.name):
        if file.name.endswith(".toml"):
            yield file.name, file.read_text(encoding="utf-8")
    for folder in filter(None, folders.split(os.pathsep)):
        if not Path(folder).is_dir():
            raise not_found(folder, "folder", where=FOLDER_VARIABLE)
        for path in sorted(Path(folder).glob("*.toml")):
            yield str(path), read_text(path)


def _read(text: str, *, where: str) -> Specimen:
    table = FileTable(with_own_references(parse_toml(text, where=where), where), "", where)
    table.schema(SCHEMA)
    one = Specimen.read(table.values, where=where)
    if one.kind != "valve" and (one.element or one.valve):
        field = "element" if one.element else "valve"
        raise table.fail(field, None, "is allowed only in the file of a valve")
    if one.kind != "valve" and one.law not in one.laws:
        raise table.fail("law", one.law, "the file states", known=one.laws)
    properties = table.table("properties")
    properties.only(KNOWN_PROPERTIES)
    for name, stated in one.properties.items():
        value = stated.si(KNOWN_PROPERTIES[name], field=properties.field(name), where=where)
        if isinstance(value, float) and value < 0.0:
            raise properties.fail(name, value, "must be a number that is not negative")
    between = table.table("between")
    between.only((*KNOWN_BETWEEN, *READINGS, *(key for key in between.values if key.startswith(BEFORE))))
    for name, stated in one.between.items():
        if name not in KNOWN_BETWEEN:
            continue
        value = stated.si(KNOWN_BETWEEN[name], field=between.field(name), where=where)
        if not isinstance(value, float) or value < 0.0:
            raise between.fail(name, str(stated.value), "must be one number that is not negative")
    errors = table.table("errors")
    errors.only(one.laws, "the file states the laws")
    rests = one.properties.get("measured_rest_lengths")
    measured = [] if rests is None else rests.si("m", field="properties.measured_rest_lengths", where=where)
    for law, group in one.errors.items():
        errors.table(law).only(KNOWN_ERRORS)
        for name, stated in group.items():
            value = stated.si(KNOWN_ERRORS[name], field=errors.table(law).field(name), where=where)
            if not isinstance(value, float) or value < 0.0:
                raise errors.table(law).fail(
                    name, str(stated.value), "must be one share of the largest tension, not negative"
                )
            if name == "other_length_at" and (not value > 0.0 or measured in (value, [value])):
                raise errors.table(law).fail(
                    name, str(stated.value), "must be a length other than the only measured one"
                )
    return one


# ---- written


def specimen_toml(spec: Specimen, *, heading: str = "") -> str:
    """The text of a specimen's file; `specimen` reads it back.

    Args:
        spec: any specimen.
        heading: comment above it.
    """
    import tomlkit

    out = tomlkit.document()
    if heading:
        out.add(tomlkit.comment(heading))
    for name in ("schema", "id", "kind", "title", "sources", "law", "element", "note", "map"):
        if (value := getattr(spec, name)) not in ("", None):
            out[name] = value
    groups = {"properties": spec.properties, "valve": spec.valve, "between": spec.between, "residual": spec.residual}
    for name, group in groups.items():
        if group:
            out[name] = _lines(group)
    for name, several in (("laws", spec.laws), ("errors", spec.errors), ("friction", spec.friction)):
        if several:
            table = tomlkit.table(is_super_table=True)
            for kind, group in several.items():
                table[kind] = _lines(group)
            out[name] = table
    return tomlkit.dumps(out)


def save_specimen(spec: Specimen, path: str | os.PathLike[str], *, heading: str = "") -> None:
    """Write a specimen's file, whole or not at all."""
    write_text(path, specimen_toml(spec, heading=heading))


def _lines(group: dict[str, SpecimenNumber]) -> Any:
    """One line for each number."""
    import tomlkit

    table = tomlkit.table()
    for key, number in group.items():
        entry = tomlkit.inline_table()
        entry.update(write_table(number))
        table[key] = entry
    return table
