"""Printed constraints as a TOML file for ``fit``: what a paper says of a muscle where it prints no table.

law = "linear_threshold"

[known]
rest_length = "14.7 cm"

[[constraint]]
what = "stiffness"          # or tension, free_length, volume
value = "74.1 N/cm"
pressure = "5 bar"
length = "13 cm"            # a free length needs none
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..documents import read_toml
from ..errors import InputError
from .words import print_json


def fit_constraints_file(path: Path, *, as_json: bool) -> None:
    """Solve a file of constraints and print the parameters, with what they leave open."""
    from ..identification.constraints import KINDS, Constraint, fit_constraints
    from ..muscles.laws import law_type
    from ..quantities import declared, with_unit

    where = str(path)
    data = _read(path, where)
    law = _word(data, "law", where)
    fields = declared(law_type(law))
    known = {k: _value(v, f"known.{k}", _unit(fields, k, where), where) for k, v in data.get("known", {}).items()}
    constraints = []
    for i, entry in enumerate(data.get("constraint", []), 1):
        place = f"constraint {i}"
        _only(entry, {"what", "value", "pressure", "length"}, place, where)
        what = _word(entry, "what", where, place)
        if what not in KINDS:
            raise InputError(f"{place}.what", what, f"known are {', '.join(KINDS)}", where=where)
        length = entry.get("length")
        constraints.append(
            Constraint(
                what=what,
                value=_value(entry.get("value", ""), f"{place}.value", KINDS[what], where),
                pressure=_value(entry.get("pressure", ""), f"{place}.pressure", "Pa", where),
                length=None if length is None else _value(length, f"{place}.length", "m", where),
            )
        )
    found = fit_constraints(law, constraints, known=known)
    if as_json:
        parameters = {k: e._asdict() for k, e in found.parameters.items()}
        entry = {
            "law": law,
            "parameters": parameters,
            "known": known,
            "n": len(constraints),
            "warnings": list(found.warnings),
        }
        print_json({"fits": [entry]})
        return
    print(f"{law}, from {len(constraints)} printed constraints:")
    for name, e in found.parameters.items():
        fixed = "" if e.low == e.high else "  (not determined)"
        print(f"  {name} = {with_unit(e.value, e.unit)}{fixed}")
    for warning in found.warnings:
        print(f"note: {warning}")


def _read(path: Path, where: str) -> dict[str, Any]:
    data = read_toml(path)
    _only(data, {"law", "known", "constraint"}, "file", where)
    if not data.get("constraint"):
        raise InputError("constraint", "none", "allowed is one or more [[constraint]]", where=where)
    return data


def _only(entry: dict[str, Any], allowed: set[str], place: str, where: str) -> None:
    for key in entry:
        if key not in allowed:
            raise InputError(f"{place}.{key}", "unknown", f"known are {', '.join(sorted(allowed))}", where=where)


def _word(entry: dict[str, Any], key: str, where: str, place: str = "") -> str:
    if not isinstance(entry.get(key), str):
        raise InputError(f"{place}.{key}".lstrip("."), entry.get(key, "missing"), "allowed is a name", where=where)
    return str(entry[key])


def _value(text: Any, field: str, unit: str, where: str) -> float:
    from ..quantities import parse

    return parse(str(text), unit, field=field, where=where)


def _unit(fields: dict[str, Any], name: str, where: str) -> str:
    if name not in fields:
        raise InputError(f"known.{name}", "unknown", f"known are {', '.join(fields)}", where=where)
    return str(fields[name].unit)
