"""Settings of a sweep: dotted paths as of ``mckibben run --set``, with values as numbers or words.

| path | what it is |
|---|---|
| ``pressure`` | a parameter, choice or setting of the protocol |
| ``rig.plumbing.direct.tube.length`` | a key of the rig's file |
| ``muscle.law.passive_stiffness`` | a declared parameter of the muscle |
| ``muscle``, ``rig``, ``plumbing``, ``noise_seed`` | the specimen, the rig, its way to join the parts, a seed |
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..assembly.build import unit_parameter
from ..assembly.muscle_unit import MuscleUnit
from ..bench.rig import Rig
from ..bench.rig_file import LENGTH
from ..bench.sensors import SENSORS
from ..components import Environment
from ..documents import JsonValue
from ..errors import InputError
from ..experiments.amounts import read_amount
from ..experiments.protocol import Protocol
from ..experiments.read import SETTINGS
from ..pneumatics.build import ELEMENTS, known_keys
from ..quantities import Quantity, declared, parse, split_values
from ..schema import shown

WORDS = ("muscle", "rig", "plumbing", "noise_seed")
_ELEMENTS = ("valve", "tube", "shut_off", "leak")
_OF_CHANNEL = ("low", "high", "offset", "noise")  # in the unit of the channel, which the declaration does not know


class Setting(NamedTuple):
    """One path: its SI unit, empty for words, and its declaration if it has one."""

    path: str
    unit: str = ""
    quantity: Quantity | None = None

    def read(self, raw: object, *, where: str | None = None) -> float | str:
        """Read a value of a file: SI, or the text itself (also for lengths in rest lengths).

        Raises:
            InputError: names the path, the value and what is allowed.
        """
        if isinstance(raw, list | tuple):
            return ", ".join(self._text(one, where) for one in raw)
        text = self._text(raw, where)
        if not self.unit:
            return text
        if self.quantity is None:  # of a protocol, whose lengths may be in rest lengths
            values = split_values(text, field=self.path, where=where)
            amounts = [read_amount(v, self.unit, field=self.path, where=where) for v in values or [text]]
            return text if len(amounts) > 1 or amounts[0].unit != self.unit else amounts[0].value
        value = parse(text, self.unit, field=self.path, where=where)
        self.quantity.check(self.path, value, where=where)
        return value

    def text(self, raw: object, *, where: str | None = None) -> str:
        """Format a value of a file, checked as `read` checks it."""
        self.read(raw, where=where)
        return ", ".join(self._text(one, where) for one in (raw if isinstance(raw, list | tuple) else [raw]))

    def _text(self, raw: object, where: str | None) -> str:
        if isinstance(raw, bool):
            return "true" if raw else "false"
        if not isinstance(raw, str | int | float) or raw == "":
            raise InputError(self.path, shown(raw), "must be a number with its unit in words, or a word", where=where)
        return str(raw)

    def words(self, value: JsonValue) -> str:
        """Format a value for ``--set``; it reads back bit for bit."""
        if isinstance(value, str):
            return value
        return repr(float(value)) if self.unit in ("", "1") else f"{float(value)!r} {self.unit}"

    def check(self, low: float, high: float, *, where: str | None = None) -> None:
        """Refuse a range beyond the bounds of the declaration [SI]."""
        for value in (low, high):
            if not math.isfinite(value):
                raise InputError(self.path, value, "must be a finite number", where=where)
            if self.quantity is not None:
                self.quantity.check(self.path, value, where=where)


def setting(path: str, protocol: Protocol, rig: Rig, unit: MuscleUnit, *, where: str | None = None) -> Setting:
    """Find the setting of a dotted path.

    Args:
        path: dotted.
        protocol: that is swept.
        rig: it runs on.
        unit: the muscle.
        where: file, for error messages.

    Raises:
        InputError: names a path that is unknown, with the nearest known ones.
    """
    if path in WORDS:
        return Setting(path)
    if path.startswith("muscle."):
        path_in_muscle = path.removeprefix("muscle.")
        try:
            quantity = unit_parameter(unit, path_in_muscle)
        except InputError as error:
            raise error.changed(value=path, where=where) from None
        return Setting(path, quantity.unit, quantity)
    if path.startswith("rig."):
        setting_of_rig = _of_rig(rig, path.removeprefix("rig."))
        if setting_of_rig is None and not _stated(rig.document, path.removeprefix("rig.")):
            raise InputError(
                path, None, f"is not a path of the rig: {_rig_hint(rig, path.removeprefix('rig.'))}", where=where
            )
        return Setting(path) if setting_of_rig is None else Setting(path, setting_of_rig.unit, setting_of_rig)
    known = protocol.variables()
    if path not in (*known, *SETTINGS):
        problem = f"other paths begin with rig. or muscle.; {protocol.name} has"
        raise InputError("parameter", path, problem, known=[*known, *SETTINGS], where=where)
    units = {p.name: p.unit for p in protocol.parameters if p.unit != "word"}
    return Setting(path, units.get(path, "1/s" if path == "sample_rate" else ""))


def _of_rig(rig: Rig, path: str) -> Quantity | None:
    """The declaration of a number of the rig's file, None if it is a word or of no known part."""
    table, _, key = path.rpartition(".")
    names = table.split(".")
    if names[0] == "frame" and key in ("shortest", "longest"):
        return LENGTH
    if names[0] == "plumbing" and len(names) == 3 and names[1] in rig.plumbing and names[2] in _ELEMENTS:
        element = getattr(rig.plumbing[names[1]], names[2])
        kind = next((k for k, t in ELEMENTS.items() if t is type(element)), None)
        return None if kind is None else known_keys(kind).get(key)
    owner, unit = _owner(rig, names)
    q = None if owner is None else declared(owner).get(key)
    if q is not None and unit and q.unit == "1" and key in _OF_CHANNEL:
        return q._replace(unit=unit)
    return q


def _owner(rig: Rig, names: list[str]) -> tuple[Any, str]:
    """Part of a rig that a table of its file describes, and the unit of its channel."""
    at: Any
    if names[0] == "sensors" and len(names) > 1 and names[1] in rig.sensors:
        at = rig.sensors[names[1]]
        return (at.converter if names[2:] == ["converter"] else at if len(names) == 2 else None), SENSORS[names[1]].unit
    if names[0] == "outputs":
        both = {"valve": (rig.valve_out, "Pa"), "motor": (rig.motor_out, "N")}
        return both.get(".".join(names[1:]), (None, ""))
    if names[0] == "plumbing" and len(names) == 2:
        return rig.plumbing.get(names[1]), ""
    if names[0] == "control" and len(names) == 2:
        return getattr(rig, names[1], None), ""
    if len(names) == 1 and names[0] in ("computer", "encoder", "motor", "frame", "interlocks", "environment"):
        return (Environment if names[0] == "environment" else getattr(rig, names[0])), ""
    return None, ""


def _stated(document: Mapping[str, Any], path: str) -> bool:
    at: Any = document
    for part in path.split("."):
        if not isinstance(at, Mapping) or part not in at:
            return False
        at = at[part]
    return not isinstance(at, Mapping)


def _rig_hint(rig: Rig, path: str) -> str:
    known: list[str] = []

    def below(at: Mapping[str, Any], prefix: str) -> None:
        for key, value in at.items():
            if isinstance(value, Mapping):
                below(value, f"{prefix}{key}.")
            else:
                known.append(f"rig.{prefix}{key}")

    below({k: v for k, v in rig.document.items() if k not in ("inferred", "hands", "schema", "name")}, "")
    import difflib

    some = difflib.get_close_matches(f"rig.{path}", known, n=3) or known[:3]
    return f"no such parameter; near are {', '.join(some)}"
