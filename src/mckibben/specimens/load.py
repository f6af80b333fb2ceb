"""Finding and reading specimen files."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path

from ..documents import parse_toml, read_text
from ..errors import InputError, not_found
from ..registry import with_own_references
from ..schema import FileTable
from .model import KINDS, SCHEMA, Specimen

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

# Errors that a specimen may state of each of its laws, as shares of the largest measured tension [1].
KNOWN_ERRORS = {
    "rms": "1",
    "largest": "1",
    "other_muscle": "1",  # the largest on another muscle of the make
    "other_length": "1",  # the largest at a rest length to which the law was not fitted
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
# Half widths of the 95 % interval of another muscle of the make, as shares of the largest tension [1].
BETWEEN_SHARES = ("same_rig", "elsewhere", "after_one_reading", "after_two_readings", "calibrated")
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
    if not isinstance(name, str | os.PathLike):
        raise InputError("specimen", None, f"must be an id or the path of a .toml file, got {name!r}")
    text = os.fspath(name)
    if text.lower().endswith(".toml") or os.sep in text:
        path = Path(text)
        if not path.is_file():
            raise not_found(text, "specimen file")
        return _read(read_text(path), where=str(path))
    if not os.environ.get(FOLDER_VARIABLE):
        alone = _shipped(text.lower())
        if alone is not None:
            return alone
    specimens_by_id = _by_id()
    if text.lower() not in specimens_by_id:
        known = [s.id for s in specimens_by_id.values() if s.kind in kinds]
        raise InputError("specimen", text, "give a .toml file or one of", known=known)
    return specimens_by_id[text.lower()]


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
    for entry in sorted(shipped.iterdir(), key=lambda e: e.name):
        if entry.name.endswith(".toml"):
            yield entry.name, entry.read_text(encoding="utf-8")
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
    for law, group in one.errors.items():
        errors.table(law).only(KNOWN_ERRORS)
        for name, stated in group.items():
            value = stated.si(KNOWN_ERRORS[name], field=errors.table(law).field(name), where=where)
            if not isinstance(value, float) or value < 0.0:
                raise errors.table(law).fail(
                    name, str(stated.value), "must be one share of the largest tension, not negative"
                )
    return one
