"""Elements of a circuit from their tables: what they are, where their ports lead, and what drives them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..errors import InputError, suggest
from ..pneumatics.build import ELEMENTS, build_element, known_keys
from ..pneumatics.circuit import Branch
from ..schema import FileTable
from ..specimens import Specimen, specimen

TWO = ("from", "to")  # the two ports of an element that has no more


class PlannedBranch(NamedTuple):
    """An element with its place in the circuit, and the SI unit of its command."""

    branch: Branch
    unit: str


def read_branch(entry: FileTable, nodes: Sequence[str]) -> PlannedBranch:
    """One element of a kind, joined to nodes.

    Raises:
        InputError: names file, dotted path, value and what is allowed.
    """
    kind = entry.word("kind", among=ELEMENTS)
    ports = ELEMENTS[kind].ports
    keys = TWO if len(ports) == 2 and not set(ports) & set(entry.values) else ports
    ends = tuple(_end(entry, key, keys, nodes) for key in keys)
    spec = _specimen(entry) if "specimen" in entry.values else None
    values = {k: v for k, v in entry.values.items() if k not in ("kind", "command", "specimen", *keys)}
    try:
        element = build_element(kind, values, where=entry.where, specimen=spec)
    except InputError as error:
        key = error.field.removeprefix(f"{kind}.")
        if spec is not None and error.where == (spec.where or spec.id):
            key = "specimen"
        hint = suggest(key, known_keys(kind)) if error.value == "unknown" else ""
        raise InputError(entry.field(key), error.value, hint + error.allowed, where=entry.where) from None
    command = entry.word("command") if "command" in entry.values else None
    return PlannedBranch(Branch(element, ends, command), element.command_unit)


def _end(entry: FileTable, key: str, keys: Sequence[str], nodes: Sequence[str]) -> str:
    if key not in entry.values:
        raise entry.fail(key, "missing", f"its ports are {', '.join(keys)}, and each leads to a node")
    end = entry.values[key]
    if end not in nodes:
        raise entry.fail(key, end, f"{suggest(end, nodes)}known are {', '.join(nodes)}")
    return str(end)


def _specimen(entry: FileTable) -> Specimen:
    wanted = entry.word("specimen")
    try:
        return specimen(wanted)
    except InputError as error:
        raise entry.fail("specimen", wanted, error.allowed) from None
