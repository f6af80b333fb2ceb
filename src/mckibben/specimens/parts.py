"""Published parts that are no specimens of their own: tubes, gas sources, and ranges of fluidic muscles.

Each file of ``published`` that states a ``kind`` is a table of parts, each with a title, sources and numbers. A number has a
unit, a source, and a mark where no source prints it, as in a specimen's file.
"""

from __future__ import annotations

import functools
from importlib import resources
from typing import NamedTuple

from ..documents import parse_toml
from ..errors import InputError
from ..schema import FileTable, read_table
from .model import SpecimenNumber

SCHEMA = 1
# What parts of each kind may state, with SI units.
KINDS: dict[str, dict[str, str]] = {
    "tube": {
        "inner_diameter": "m", "outer_diameter": "m", "bend_radius": "m", "modulus": "Pa", "density": "kg/m^3",
    },
    "gas_source": {
        "mass": "kg", "volume": "m^3", "pressure": "Pa", "filling": "kg", "gas_constant": "J/(kg*K)", "heat_ratio": "1",
        "filling_work": "J/kg", "free_flow": "m^3/s", "efficiency": "1", "stored_energy": "J", "hottest": "K",
        "low_pressure": "Pa",
    },
    "fluidic_muscle": {
        "bore": "m", "wall_thickness": "m", "shortest_length": "m", "longest_length": "m", "largest_contraction": "1",
        "rated_pressure": "Pa", "fittings_mass": "kg", "mass_per_length": "kg/m",
    },
}  # fmt: skip
WORDS = ("title", "sources", "note", "law", "form")
FILES = {"tube": "tubes", "gas_source": "gas_sources", "fluidic_muscle": "fluidic_muscles"}


class CataloguePart(NamedTuple):
    """A catalogue part: its numbers [SI] by name, and as stated; `law` names the specimen whose law it uses."""

    id: str
    title: str
    sources: tuple[str, ...]
    values: dict[str, float]
    stated: dict[str, SpecimenNumber]
    form: str = ""
    law: str = ""
    note: str = ""

    def inferred(self) -> list[str]:
        """Names of the numbers that no source prints."""
        return [name for name, p in self.stated.items() if p.inferred]


@functools.cache
def parts(kind: str) -> tuple[CataloguePart, ...]:
    """Load all shipped parts of a kind.

    Raises:
        InputError: the kind is unknown.
    """
    if kind not in KINDS:
        raise InputError("kind", kind, known=KINDS)
    name = f"{FILES[kind]}.toml"
    return read_parts((resources.files(__package__) / "published" / name).read_text(encoding="utf-8"), where=name)


def bore_of(name: object) -> float | None:
    """Inner diameter of a shipped tube by its name [m], any case; None if no tube has that name."""
    if not isinstance(name, str):
        return None
    return next((p.values["inner_diameter"] for p in parts("tube") if p.id.lower() == name.strip().lower()), None)


def read_parts(text: str, *, where: str) -> tuple[CataloguePart, ...]:
    """The parts of a file's text; raises `InputError` with the file, the entry and what is allowed."""
    top = FileTable(parse_toml(text, where=where), "", where)
    top.schema(SCHEMA)
    kind = top.word("kind", among=KINDS)
    entries = [key for key, value in top.values.items() if isinstance(value, dict)]
    return tuple(_part(id_, top.table(id_), KINDS[kind]) for id_ in entries)


def _part(id_: str, table: FileTable, units: dict[str, str]) -> CataloguePart:
    table.only((*WORDS, *units), "a part has")
    stated = {
        key: read_table(SpecimenNumber, table.table(key), owner="a number has") for key in table.values if key in units
    }
    values = {}
    for key, one in stated.items():
        value = one.si(units[key], field=table.field(key), where=table.where)
        if not isinstance(value, float) or value < 0.0:
            raise table.fail(key, str(one.value), "must be one number, not negative")
        values[key] = value
    texts = {key: table.text(key) for key in ("form", "law", "note")}
    return CataloguePart(id_, table.word("title"), table.texts("sources"), values, stated, **texts)
