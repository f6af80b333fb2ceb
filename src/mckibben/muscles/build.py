"""Laws and muscles from specimen data; unknown keys are refused, not ignored."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..quantities import declared
from ..specimens import Specimen
from .law import TensionLaw
from .laws import LAWS, law_type


def law_from_specimen(spec: Specimen, law: str | None = None, *, changes: Mapping[str, Any] | None = None) -> TensionLaw:
    """The tension law of a specimen.

    Args:
        spec: what was read from a specimen file.
        law: one of the laws that the file states; its default law where left out.
        changes: parameters to replace, by field name [SI].

    Raises:
        InputError: names the file, the parameter, its value and what is allowed.
    """
    name = law or spec.law
    if name not in spec.laws:
        known = law_type(name)  # an unknown name is a better complaint than a missing one
        raise InputError("law", name, f"{spec.id} states {', '.join(spec.laws)}; fit {known.title} to it first", where=spec.where)
    group = spec.laws[name]
    given = {key: p.si(_unit_of(name, key, spec.where), field=f"laws.{name}.{key}", where=spec.where) for key, p in group.items()}
    return build_law(name, given | dict(changes or {}), where=spec.where or spec.id)


def build_law(name: str, parameters: Mapping[str, Any], *, where: str | None = None) -> TensionLaw:
    """A law from its name and parameters [SI]; missing, unknown and out-of-bounds ones are named."""
    kind = law_type(name)
    known = declared(kind)
    for key in parameters:
        if key not in known:
            raise InputError(f"{name}.{key}", "unknown", f"{name} has {', '.join(known)}", where=where)
    required = [name for name in required_fields(kind) if name not in parameters]
    if required:
        raise InputError(f"{name}.{required[0]}", "missing", f"it is {known[required[0]].doc}", where=where)
    for key, value in parameters.items():
        known[key].check(f"{name}.{key}", value, where=where)
    return construct(kind, parameters)


def construct(kind: type[TensionLaw], parameters: Mapping[str, Any]) -> TensionLaw:
    """A law from complete parameters [SI], unchecked, so that they may be traced.

    Whether a law knows its volume is part of its structure: it does if a rest volume is among the parameters.
    """
    options: dict[str, Any] = {}
    if any(f.name == "volume_known" for f in _fields(kind)):
        options["volume_known"] = "rest_volume" in parameters
    return kind(**dict(parameters), **options)


def required_fields(kind: type[TensionLaw]) -> list[str]:
    """Declared parameters of a law that have no default."""
    return [f.name for f in _fields(kind) if "quantity" in f.metadata and not _has_default(f)]


def law_names() -> list[str]:
    """All tension laws by name."""
    return list(LAWS)


def _unit_of(law: str, key: str, where: str) -> str:
    known = declared(law_type(law))
    if key not in known:
        raise InputError(f"laws.{law}.{key}", "unknown", f"{law} has {', '.join(known)}", where=where)
    return known[key].unit


def _fields(kind: type) -> tuple[Any, ...]:
    import dataclasses

    return dataclasses.fields(kind)


def _has_default(field: Any) -> bool:
    import dataclasses

    return field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
