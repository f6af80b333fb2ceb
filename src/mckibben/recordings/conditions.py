"""Conditions of recordings: muscle, rig, protocol and its numbers, and by which of them recordings differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..documents import JsonValue
from ..errors import InputError
from ..quantities import with_unit

FIRST = ("muscle", "protocol", "rig", "plumbing", "circuit", "result")  # of a recording, in this order
MOST = 6  # numbers of the machine that tell recordings apart, beyond which they are too many to be told


def conditions(meta: Mapping[str, JsonValue]) -> dict[str, str]:
    """The conditions of a recording as text, by name: muscle, protocol, rig, and the numbers of the protocol.

    Args:
        meta: its metadata.
    """
    protocol = _table(meta.get("protocol"))
    specimen = meta.get("specimen")
    words = {
        "muscle": str(_table(specimen).get("id") or ("" if isinstance(specimen, Mapping) else specimen or "")),
        "protocol": str(protocol.get("name") or (meta["protocol"] if isinstance(meta.get("protocol"), str) else "")),
        **{name: str(meta[name]) for name in FIRST[2:] if isinstance(meta.get(name), str)},
    }
    for name, parameter in _table(protocol.get("parameters")).items():
        value = _table(parameter).get("value")
        if value is not None:
            words[name] = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
    for section in ("choices", "chosen"):
        words |= {name: str(value) for name, value in _table(protocol.get(section)).items() if isinstance(value, str)}
    if isinstance(meta.get("seed"), int):
        words["seed"] = str(meta["seed"])
    return {name: value for name, value in words.items() if value}


def machine_numbers(meta: Mapping[str, JsonValue]) -> dict[str, str]:
    """The numbers of the machine of a recording as text with units, by their path, such as ``circuit.tube.length``."""
    numbers = {}
    for path, number in _table(meta.get("parameters")).items():
        value, unit = _table(number).get("value"), str(_table(number).get("unit") or "")
        if isinstance(value, int | float) and not isinstance(value, bool):
            try:
                numbers[path] = with_unit(float(value), unit) if unit and unit != "1" else f"{value:.4g}"
            except InputError:
                numbers[path] = f"{value:.4g} {unit}"
    return numbers


def differing(recordings: Sequence[Mapping[str, str]]) -> list[str]:
    """Names of the conditions that are not the same in all recordings, in their order."""
    names = dict.fromkeys(name for one in recordings for name in one)
    return [name for name in names if len({one.get(name) for one in recordings}) > 1]


def told_apart(metas: Sequence[Mapping[str, JsonValue]]) -> list[dict[str, str]]:
    """What distinguishes each recording: the conditions that differ, else a few numbers of the machine."""
    for read in (conditions, machine_numbers):
        told = [read(meta) for meta in metas]
        names = differing(told)
        if names and (read is conditions or len(names) <= MOST):
            return [{name: one[name] for name in names if name in one} for one in told]
    return [{} for _ in metas]


def _table(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
