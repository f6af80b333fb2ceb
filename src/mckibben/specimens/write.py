"""Writing of specimen files."""

from __future__ import annotations

import os
from typing import Any

from ..documents import write_text
from ..schema import write_table
from .model import Specimen, SpecimenNumber


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
