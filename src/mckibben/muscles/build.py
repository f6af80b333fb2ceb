"""Laws and muscles from specimen data; unknown keys are refused, not ignored."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import numpy as np

from ..accessors import implementation
from ..components import Hysteresis, MemoryElement
from ..documents import JsonValue
from ..errors import InputError, MissingParametersError
from ..quantities import Quantity, declared, in_si, shown_unit
from ..registry import is_reference, named_by_person
from ..specimens import Specimen, SpecimenNumber, muscle_specimen
from .biological import BiologicalMuscle
from .creep import MaxwellChain
from .hysteresis import HYSTERESES, Coulomb, FrictionLimit, MaxwellSlip
from .law import TensionLaw
from .laws import LAWS, law_key, law_type
from .muscle import Muscle


def law_from_specimen(
    spec: Specimen, law: str | None = None, *, changes: Mapping[str, JsonValue] | None = None
) -> TensionLaw:
    """The tension law of a specimen.

    Args:
        spec: the specimen, as read from a file.
        law: one of the laws that the file states; its default law by default.
        changes: parameters to replace, by field name [SI].

    Raises:
        InputError: names the file, the parameter, its value and what is allowed.
    """
    if spec.kind == "valve":
        raise InputError("specimen", spec.id, "must be a muscle; it is a valve", where=spec.where)
    name = law or spec.law
    if name not in spec.laws:
        known = law_type(name)  # an unknown name is a better complaint than a missing one
        raise InputError(
            "law", name, f"{spec.id} states {', '.join(spec.laws)}; fit {known.title} to it first", where=spec.where
        )
    group = spec.laws[name]
    parameters = {
        key: p.si(_unit_of(name, key, spec.where), field=f"laws.{name}.{key}", where=spec.where)
        for key, p in group.items()
    }
    return build_law(name, parameters | dict(changes or {}), where=spec.where or spec.id)


def law(name: str | type[TensionLaw], parameters: Mapping[str, JsonValue]) -> TensionLaw:
    """A law from its name, or its class, and parameters [SI].

    Args:
        name: of a law of the package or of an installed one, or a class in a file such as ``my.py:MyLaw``.
        parameters: by name [SI].

    Raises:
        InputError: a parameter is missing, unknown or out of bounds.

    Examples:
        >>> import mckibben as mk
        >>> law = mk.law("ideal", {"thread_length": 0.16, "turns": 3.2})
        >>> round(float(law.tension(0.13, 3e5)), 2)
        58.52
    """
    named_by_person(name)
    return build_law(law_key(name), parameters)


def build_law(name: str, parameters: Mapping[str, JsonValue], *, where: str | None = None) -> TensionLaw:
    """The law of a name that may stand in a file; `where` is what errors name as their place. Raises as `law` does."""
    kind = law_type(name)
    known = declared(kind)
    for key in parameters:
        if key not in known:
            raise InputError(f"{name}.{key}", None, f"{name} has", known=known, where=where)
    missing = missing_parameters(name, parameters)
    if missing:
        needs = f"the law {name} needs {needed_words(missing)}"
        raise MissingParametersError(name, missing, needs, where=where)
    for key, value in parameters.items():
        known[key].check(f"{name}.{key}", value, where=where)
    return construct(kind, parameters)


def missing_parameters(name: str, stated: Iterable[str]) -> list[tuple[str, Quantity]]:
    """The parameters without a default that a law needs and that are not given, with their declarations."""
    kind, present = law_type(name), set(stated)
    known = declared(kind)
    return [(key, known[key]) for key in required_fields(kind) if key not in present]


def needed_words(missing: Sequence[tuple[str, Quantity]]) -> str:
    """Parameters with their meanings and units: ``thread_length (length of one thread, in cm) and turns (..)``."""
    said = [f"{key} ({q.doc}, {'a number' if q.unit == '1' else f'in {shown_unit(q.unit)}'})" for key, q in missing]
    return said[0] if len(said) == 1 else f"{', '.join(said[:-1])} and {said[-1]}"


def construct(kind: type[TensionLaw], parameters: Mapping[str, JsonValue]) -> TensionLaw:
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


def default_parameters(kind: type[TensionLaw]) -> dict[str, float]:
    """Declared parameters of a law that have a default, with that default [SI]."""
    return {f.name: float(f.default) for f in _fields(kind) if "quantity" in f.metadata and _has_default(f)}


def law_names() -> list[str]:
    """Names of all tension laws."""
    return list(LAWS)


def _unit_of(law: str, key: str, where: str) -> str:
    known = declared(law_type(law))
    if key not in known:
        raise InputError(f"laws.{law}.{key}", None, f"{law} has", known=known, where=where)
    return known[key].unit


def _fields(kind: type) -> tuple[Any, ...]:
    import dataclasses

    return dataclasses.fields(kind)


def _has_default(field: Any) -> bool:
    import dataclasses

    return field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING


def built_muscle(
    name: str | os.PathLike[str] | Specimen,
    *,
    law: str | type[TensionLaw] | None = None,
    friction: str | Hysteresis | None = None,
    creep: MemoryElement | None = None,
    **parameters: Any,
) -> Muscle:
    """A muscle as `MuscleFactory` makes it, of names that may stand in a file and allow no code."""
    if isinstance(name, str) and name in LAWS:
        if law is not None:
            raise InputError("law", None, f"is allowed only with a specimen; {name} is a law itself")
        return Muscle(build_law(name, _in_si(name, parameters)), _own(friction), creep)
    spec = name if isinstance(name, Specimen) else muscle_specimen(name)
    chosen = (law if isinstance(law, str) else LAWS.stated_as(law, spec.laws)) if law else spec.law
    changes = _in_si(chosen, parameters)
    if spec.kind == "biological":
        fibre = cast(TensionLaw, _biological(spec, chosen, changes))  # it answers the questions of a law
        return Muscle(fibre, _own(friction), creep, specimen=spec)
    built = law_from_specimen(spec, chosen, changes=changes)
    return Muscle(built, _usual_friction(spec, friction), creep or _stated_creep(spec), specimen=spec)


class MuscleFactory:
    """Makes a `Muscle` of what names one: a specimen's id, a ``.toml`` file, or a law and its parameters."""

    def __call__(
        self,
        name: str | os.PathLike[str] | Specimen,
        *,
        law: str | type[TensionLaw] | None = None,
        friction: str | Hysteresis | None = None,
        creep: MemoryElement | None = None,
        **parameters: Any,
    ) -> Muscle:
        """A muscle from a specimen, or from a law.

        Args:
            name: id of a specimen, path of a ``.toml`` file, a specimen that was read, or the name of a law.
            law: one of the laws that the specimen states, or the class of one that it states as ``my.py:MyLaw``; its default
                law where left out.
            friction: one of the frictions that the specimen states, a friction, or a class in a file such as
                ``my.py:MyFriction``. Where left out the specimen's own such class, else Maxwell-slip, and where only
                Coulomb's is stated Maxwell-slip elements with its limit, for a friction without memory chatters at rest.
            creep: viscoelastic elements beside the braid.
            **parameters: of the law, in place of those that the specimen states: numbers [SI] or text with a unit.

        Raises:
            InputError: the name is unknown, or names a valve; or a parameter is missing, unknown or out of bounds.

        Examples:
            >>> import mckibben as mk
            >>> mk.muscle("nylon")
            Muscle('nylon', linear_threshold + MaxwellSlip, 14 cm at rest)
            >>> mk.muscle("ideal", thread_length="16 cm", turns=3.2)
            Muscle(own, ideal)
        """
        named_by_person(name, law, friction)
        return built_muscle(name, law=law, friction=friction, creep=creep, **parameters)

    def from_braid(self, **dimensions: float | str) -> Muscle:
        """A muscle from the dimensions of its sleeve and bladder, with nothing measured.

        Args:
            **dimensions: ``rest_length``, ``diameter``, ``braid_angle``, ``thread_diameter`` and ``bladder_thickness``, and
                ``shore``, see `muscles.sleeve.from_braid`.

        Raises:
            InputError: a dimension is missing, unknown or out of its bounds, or bladder and threads fill the braid.

        Examples:
            >>> import mckibben as mk
            >>> mk.muscle.from_braid(rest_length="300 mm", diameter="12 mm", braid_angle="25 deg", thread_diameter="0.25 mm",
            ...     bladder_thickness="1 mm")
            Muscle('braid', linear_threshold + MaxwellSlip, 30 cm at rest)
        """
        from_braid: Any = implementation("muscles.sleeve:from_braid")
        try:
            inspect.signature(from_braid).bind(**dimensions)
        except TypeError:
            known = inspect.signature(from_braid).parameters
            for name in dimensions:
                if name not in known:
                    raise InputError("dimension", name, known=known) from None
            missing = [n for n, p in known.items() if p.default is p.empty and n not in dimensions]
            raise InputError("dimensions", None, f"of a braid are incomplete without {', '.join(missing)}") from None
        return self(from_braid(**dimensions))


muscle = MuscleFactory()
"""A muscle by name, see `MuscleFactory`: ``mckibben.muscle("nylon")``, ``mckibben.muscle.from_braid(..)``."""


def _in_si(law: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as people give them, in SI; those that the law does not have pass, to be refused with the rest."""
    known = declared(BiologicalMuscle if law not in LAWS else law_type(law)) if parameters else {}
    return {
        key: in_si(value, known[key].unit, field=f"{law}.{key}") if key in known else value
        for key, value in parameters.items()
    }


def _own(friction: str | Hysteresis | None) -> Hysteresis | None:
    if isinstance(friction, str):
        if is_reference(friction):
            return _build_friction(friction, {}, "friction", None)
        raise InputError(
            "friction", friction, "must be a friction such as MaxwellSlip; only specimens state one by name"
        )
    return friction


def _usual_friction(spec: Specimen, friction: str | Hysteresis | None) -> Hysteresis | None:
    """The friction with which a muscle is simulated, see `MuscleFactory`."""
    if isinstance(friction, Hysteresis):
        return friction
    own = next((name for name in spec.friction if is_reference(name)), None)
    usual = "maxwell_slip" if "maxwell_slip" in spec.friction else next(iter(spec.friction), None)
    chosen = friction or own or usual
    if chosen is None:
        return None
    if chosen not in spec.friction and is_reference(chosen):
        return _own(chosen)
    built = _stated_friction(spec, chosen)
    return MaxwellSlip.geometric(built.limit) if isinstance(built, Coulomb) and friction is None else built


def _stated_creep(spec: Specimen) -> MemoryElement | None:
    """The Maxwell elements that a specimen states among its properties; None where it states none."""
    if "creep_stiffness" not in spec.properties:
        return None
    where = spec.where or spec.id
    values = {}
    for name, unit in (("creep_stiffness", "N/m"), ("creep_time_constants", "s")):
        if name not in spec.properties:
            raise InputError(f"properties.{name}", None, "is missing: creep has stiffnesses and times", where=where)
        value = spec.properties[name].si(unit, field=f"properties.{name}", where=where)
        values[name] = np.atleast_1d(np.asarray(value, float))
    stiffness, times = values.values()
    if stiffness.shape != times.shape:
        allowed = f"must be as many as creep_stiffness, {len(stiffness)}, got {len(times)}"
        raise InputError("properties.creep_time_constants", None, allowed, where=where)
    known = declared(MaxwellChain)
    for name, numbers in (("stiffness", stiffness), ("time_constant", times)):
        known[name].check(f"creep.{name}", numbers, where=where)
    return MaxwellChain(stiffness=stiffness, time_constant=times)


def from_specimen(
    spec: Specimen,
    law: str | None = None,
    friction: str | None = None,
    *,
    changes: Mapping[str, JsonValue] | None = None,
) -> Any:
    """A `Muscle` of a McKibben specimen, or the `BiologicalMuscle` of a biological one.

    Args:
        spec: the specimen, as read from a file.
        law: one of the laws it states; its default law by default.
        friction: one of the frictions it states; the first by default, none if it states none.
        changes: parameters of the law to replace, by field name [SI].
    """
    if spec.kind == "biological":
        return _biological(spec, law or spec.law, dict(changes or {}))
    chosen = friction or next(iter(spec.friction), None)
    return Muscle(
        law=law_from_specimen(spec, law, changes=changes),
        friction=None if chosen is None else _stated_friction(spec, chosen),
        specimen=spec,
    )


# Rest length over the longest length that a law is made for, where neither file nor law state one; 0.91 of the nylon muscle.
REST_SHARE = 0.9


def rest_length_of(spec: Specimen | None, law: TensionLaw | None = None) -> float:
    """Rest length of a muscle [m]: as its file states it, else as its law does, else 0.9 of the law's longest length.

    Args:
        spec: what was read from a file, if anything was.
        law: law of the muscle; the default law of the file if omitted.
    """
    if spec is not None and "rest_length" in spec.properties:
        return spec.property_si("rest_length", "m")
    built = _own_law(spec) if law is None else law
    stated = getattr(built, "rest_length", None)
    return REST_SHARE * float(built.length_range()[1]) if stated is None else float(stated)


def upper_length_of(spec: Specimen | None, law: TensionLaw | None = None) -> float:
    """Upper working length of a muscle [m]: as its file states it, else the longest length that its law is made for."""
    if spec is not None and "upper_length" in spec.properties:
        return spec.property_si("upper_length", "m")
    return float((_own_law(spec) if law is None else law).length_range()[1])


def _own_law(spec: Specimen | None) -> Any:
    if spec is None:
        raise InputError("muscle", None, "must be a specimen or a law")
    muscle = from_specimen(spec)
    return getattr(muscle, "law", muscle)


# Parameters of the limit of a friction, and of Maxwell-slip elements with spread travels, in a specimen file; SI units.
_LIMIT_UNITS = {"constant": "N", "per_pressure": "m^2"}
_SPREAD_UNITS = {"elements": "1", "shortest": "m", "longest": "m", "at_pressure": "Pa"}


def _stated_friction(spec: Specimen, name: str) -> Hysteresis:
    if name not in spec.friction:
        raise InputError("friction", name, f"{spec.id} states", known=spec.friction, where=spec.where)
    return _build_friction(name, spec.friction[name], f"friction.{name}", spec.where)


def _build_friction(name: str, stated: Mapping[str, SpecimenNumber], path: str, where: str | None) -> Hysteresis:
    """A friction from the numbers that a file states; what it declares beyond has its defaults."""
    kind = HYSTERESES.find(name, field=path, where=where)
    has_limit = any(f.name == "limit" for f in _fields(kind))
    known = {key: q.unit for key, q in declared(kind).items()} | (_LIMIT_UNITS if has_limit else {})
    whole = {f.name for f in _fields(kind) if f.type in ("int", int)}
    known |= dict.fromkeys(whole, "1")
    if kind is MaxwellSlip:
        known |= _SPREAD_UNITS
        whole.add("elements")
    parameters: dict[str, Any] = {}
    for key, number in stated.items():
        if key not in known:
            raise InputError(f"{path}.{key}", None, f"{name} has", known=known, where=where)
        value = number.si(known[key], field=f"{path}.{key}", where=where)
        if key in declared(kind):
            declared(kind)[key].check(f"{path}.{key}", value, where=where)
        parameters[key] = int(value) if key in whole and not isinstance(value, list) else value
    if has_limit:
        limit = {key: parameters.pop(key, 0.0) for key in _LIMIT_UNITS}
        parameters["limit"] = FrictionLimit(**limit)
    # Elements of equal force with spread travels are how a source states Maxwell-slip; single stiffnesses are measured.
    make: Any = MaxwellSlip.geometric if kind is MaxwellSlip and "stiffness" not in parameters else kind
    try:
        built: Hysteresis = make(**parameters)
    except TypeError as error:
        raise InputError(path, ", ".join(parameters), str(error).split(") ")[-1], where=where) from None
    return built


def _biological(spec: Specimen, name: str, changes: dict[str, Any]) -> BiologicalMuscle:
    if name not in spec.laws:
        raise InputError("law", name, f"{spec.id} states", known=spec.laws, where=spec.where)
    known = declared(BiologicalMuscle)
    parameters: dict[str, Any] = {}
    for key, p in spec.laws[name].items():
        if key not in known:
            raise InputError(f"laws.{name}.{key}", None, known=known, where=spec.where)
        parameters[key] = p.si(known[key].unit, field=f"laws.{name}.{key}", where=spec.where)
        known[key].check(f"{name}.{key}", parameters[key], where=spec.where)
    return BiologicalMuscle(**(parameters | changes))
