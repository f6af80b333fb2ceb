"""Published parts that are no specimens of their own: tubes, gas sources, and ranges of fluidic muscles.

Each file of ``published`` that states a ``kind`` is a table of parts, each with a title, sources and numbers. A number has a
unit, a source, and a mark where no source prints it, as in a specimen's file.
"""

from __future__ import annotations

import functools
from importlib import resources
from typing import Any, NamedTuple

from ..documents import parse_toml
from ..errors import InputError
from .model import Parameter

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
FILES = {"tube": "tubes", "gas_source": "gas_sources", "fluidic_muscle": "fluidic_muscles"}


class Part(NamedTuple):
    """One part: its numbers [SI] by name, and as stated; `law` names the specimen whose law it borrows."""

    id: str
    title: str
    sources: tuple[str, ...]
    values: dict[str, float]
    stated: dict[str, Parameter]
    form: str = ""
    law: str = ""
    note: str = ""

    def inferred(self) -> list[str]:
        """Names of the numbers that no source prints."""
        return [name for name, p in self.stated.items() if p.inferred]


@functools.cache
def parts(kind: str) -> tuple[Part, ...]:
    """All shipped parts of a kind.

    Raises:
        InputError: the kind is unknown.
    """
    if kind not in KINDS:
        raise InputError("kind", kind, f"known are {', '.join(KINDS)}")
    name = f"{FILES[kind]}.toml"
    return read_parts((resources.files(__package__) / "published" / name).read_text(encoding="utf-8"), where=name)


def read_parts(text: str, *, where: str) -> tuple[Part, ...]:
    """The parts of a file's text; raises `InputError` with the file, the entry and what is allowed."""
    document = parse_toml(text, where=where)
    if document.get("schema") != SCHEMA:
        raise InputError(
            "schema", document.get("schema", "missing"), f"this version reads schema {SCHEMA}", where=where
        )
    kind = document.get("kind")
    if kind not in KINDS:
        raise InputError("kind", kind or "missing", f"known are {', '.join(KINDS)}", where=where)
    entries = {k: v for k, v in document.items() if isinstance(v, dict)}
    return tuple(_part(id_, entry, KINDS[kind], where) for id_, entry in entries.items())


def _part(id_: str, entry: dict[str, Any], units: dict[str, str], where: str) -> Part:
    words = ("title", "sources", "note", "law", "form")
    for key in ("title", "sources"):
        if key not in entry:
            raise InputError(f"{id_}.{key}", "missing", "it is required", where=where)
    stated, values = {}, {}
    for key, raw in entry.items():
        if key in words:
            continue
        if key not in units:
            raise InputError(f"{id_}.{key}", "unknown", f"known are {', '.join([*words, *units])}", where=where)
        one = Parameter.read(raw, field=f"{id_}.{key}", where=where)
        value = one.si(units[key], field=f"{id_}.{key}", where=where)
        if not isinstance(value, float) or value < 0.0:
            raise InputError(f"{id_}.{key}", str(one.value), "allowed is one number, not negative", where=where)
        stated[key], values[key] = one, value
    given = {k: entry.get(k, "") for k in ("form", "law", "note")}
    return Part(id_, entry["title"], tuple(entry["sources"]), values, stated, **given)
