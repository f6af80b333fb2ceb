"""Laws and muscles from specimen data; unknown keys are refused, not ignored."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, cast

import numpy as np

from ..accessors import implementation
from ..components import Hysteresis, MemoryElement
from ..documents import JsonValue
from ..errors import InputError, MissingParametersError
from ..quantities import Quantity, declared, has_dimension, in_si, named_values, parse, shown_unit, with_unit
from ..registry import is_reference, named_by_person
from ..specimens import Specimen, SpecimenNumber, muscle_specimen, specimens
from . import dimensions
from .biological import BiologicalMuscle
from .elements import MaxwellChain
from .evidence import check_geometry, measured_rest_lengths
from .hysteresis import HYSTERESES, Coulomb, FrictionLimit, MaxwellSlip
from .law import TensionLaw
from .laws import LAWS, law_key, law_type
from .learned import LearnedResidual
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
    spec, changes = at_rest_length(spec, name, changes or {})
    known = law_type(name)  # an unknown name is a better complaint than a missing one
    if name not in spec.laws:
        said = f"{spec.id} states {', '.join(spec.laws)}; fit {known.title} to it first"
        raise InputError("law", name, said, where=spec.where)
    parameters, units = {}, {key: q.unit for key, q in declared(known).items()}
    for key, number in spec.laws[name].items():
        field = f"laws.{name}.{key}"
        if key not in units:
            raise InputError(field, None, f"{name} has", known=units, where=spec.where)
        parameters[key] = number.si(units[key], field=field, where=spec.where)
    built = build_law(name, parameters | changes, where=spec.where or spec.id)
    return LearnedResidual.stated(built, spec.residual, where=spec.where or spec.id) if name == spec.law else built


SAME_REST_LENGTH = 1e-9  # share by which two rest lengths differ that are the same in other units
# Properties of a muscle that go with its rest length, and the power; parameters of a law say so in their declaration.
_ALONG = {
    "rest_length": 1, "upper_length": 1, "stretched_length": 1, "shortest_measured_length": 1,
    "longest_measured_length": 1, "creep_stiffness": -1,
}  # fmt: skip
# Travels of a friction are along the axis, so that its numbers go as the length in their unit; forces and pressures stay.
_ALONG_UNIT = {"m": 1, "m/Pa": 1, "N/m": -1}


def at_rest_length(spec: Specimen, law: str, changes: Mapping[str, Any]) -> tuple[Specimen, dict[str, Any]]:
    """The same muscle cut to the rest length among some changes, and the changes that are left.

    All that goes with the length goes with it: lengths, turns, volume and stiffness of the law, friction and creep. Ends
    stay as they are, seats and inactive lengths, so that with them a short muscle is weaker at the same contraction.

    Args:
        spec: the muscle.
        law: name of the law that is used.
        changes: parameters of that law by name [SI].

    Raises:
        InputError: the law's coefficients are of one length; names laws and specimens that do it.
    """
    left = dict(changes)
    if spec.kind != "mckibben" or law not in spec.laws or "rest_length" not in left:
        return spec, left
    stated, wanted = spec.laws[law].get("rest_length"), left.pop("rest_length")
    whole = rest_length_of(spec) if stated is None else float(str(stated.si("m", field=f"laws.{law}.rest_length")))
    dimensions.REST_LENGTH.check(f"{law}.rest_length", wanted, where=spec.where or spec.id)
    ratio = float(wanted) / whole
    if abs(ratio - 1.0) < SAME_REST_LENGTH:
        return spec, left
    if "calibrated" in spec.between:
        said = f"must be {with_unit(whole, 'm')}: {spec.id} is one muscle, calibrated by readings; cut its make instead"
        raise InputError(f"{law}.rest_length", with_unit(float(wanted), "m"), said, where=spec.where)
    if spec.residual:
        said = f"must be {with_unit(whole, 'm')}: the residual of {spec.id} was learned on one muscle; take its make"
        raise InputError(f"{law}.rest_length", with_unit(float(wanted), "m"), said, where=spec.where)
    if not law_type(law).any_length and len(measured_rest_lengths(spec)) < 2:
        raise _of_one_length(law, whole, float(wanted), _others_of(spec), where=spec.where or spec.id)
    laws = {name: group for name, group in spec.laws.items() if name == law or law_type(name).any_length}

    rest = SpecimenNumber(value=float(wanted), unit="m", note="cut to length")
    whole_number = stated or spec.properties.get("rest_length")

    def cut(
        group: Mapping[str, SpecimenNumber], along: Callable[[str, SpecimenNumber], int]
    ) -> dict[str, SpecimenNumber]:
        def one(name: str, number: SpecimenNumber) -> SpecimenNumber:
            # Equal to the rest length to the bit, or the muscle would be overstretched at rest.
            if whole_number is not None and (number.value, number.unit) == (whole_number.value, whole_number.unit):
                return rest if along(name, number) == 1 else number
            return _scaled(number, ratio ** along(name, number))

        return {name: one(name, number) for name, number in group.items()}

    def by_unit(_: str, number: SpecimenNumber) -> int:
        return next((power for unit, power in _ALONG_UNIT.items() if has_dimension(f"1 {number.unit}", unit)), 0)

    def by_parameter(law: str, key: str, _: SpecimenNumber) -> int:
        known = declared(law_type(law))
        return known[key].along if key in known else 0  # an unknown one is refused where the law is built

    properties = cut(spec.properties, lambda name, _: _ALONG.get(name, 0))
    if not spec.errors:  # a file that says nothing of what was measured is taken to be of the length that it states
        properties.setdefault("measured_rest_lengths", SpecimenNumber(value=whole, unit="m", note="before it was cut"))
    spec = dataclasses.replace(
        spec,
        law=law,
        map=None,  # of the whole muscle
        properties=properties | {"rest_length": rest},
        laws={n: cut(group, functools.partial(by_parameter, n)) for n, group in laws.items()},
        errors={name: group for name, group in spec.errors.items() if name in laws},
        friction={name: cut(group, by_unit) for name, group in spec.friction.items()},
    )
    return spec, left


def cut_parameters(
    law: str, parameters: Mapping[str, float], changes: Mapping[str, float], whole: Sequence[float]
) -> dict[str, float]:
    """Parameters of a law [SI] as of a muscle cut to the rest length among some changes; without one as they are.

    Args:
        law: its name.
        parameters: of the muscles that were measured.
        changes: among them, perhaps, the rest length.
        whole: rest lengths of the measured muscles [m]; where they are several, all share the parameters.

    Raises:
        InputError: the law's coefficients are of one length.
    """
    wanted, rests = changes.get("rest_length"), np.unique(np.asarray(whole, float))
    if wanted is None or rests.size != 1 or abs(float(wanted) / rests[0] - 1.0) < SAME_REST_LENGTH:
        return dict(parameters)
    if not law_type(law).any_length:
        raise _of_one_length(law, float(rests[0]), float(wanted), [A_FIT])
    known = declared(law_type(law))
    cut = {name: value * (float(wanted) / float(rests[0])) ** known[name].along for name, value in parameters.items()}
    equal = (n for n in cut if n != "turns" and parameters[n] == rests[0] and known[n].along == 1)
    return cut | dict.fromkeys(equal, float(wanted))  # to the bit, as in `at_rest_length`


def _scaled(number: SpecimenNumber, factor: float) -> SpecimenNumber:
    if factor == 1.0:
        return number
    value = [factor * v for v in number.value] if isinstance(number.value, list) else factor * number.value
    ends = None if number.range is None else (factor * number.range[0], factor * number.range[1])
    said = f"{number.note}; scaled with the rest length" if number.note else "scaled with the rest length"
    return dataclasses.replace(number, value=value, range=ends, inferred=True, note=said)


A_FIT = "a fit of a law that goes with the length, such as hyperelastic_braid"


def _others_of(spec: Specimen) -> list[str]:
    laws = [name for name in spec.laws if law_type(name).any_length]
    bore = None if "rest_inner_diameter" not in spec.properties else spec.property_si("rest_inner_diameter", "m")
    others = [] if bore is None else [s for s in specimens() if len(measured_rest_lengths(s)) > 1 and s.id != spec.id]
    alike = [s.id for s in others if s.property_si("rest_inner_diameter", "m") == bore]
    more = [f"the specimen {name}, fitted to several lengths" for name in alike]
    return [f"the law {laws[0]} of {spec.id}" if laws else A_FIT, *more]


def _of_one_length(law: str, whole: float, wanted: float, others: list[str], where: str | None = None) -> InputError:
    shown, own = with_unit(wanted, "m"), with_unit(whole, "m")
    said = f"rest_length must be {own}, got {shown}: the coefficients of {law} are of one length. Use {' or '.join(others)}"
    return InputError(f"{law}.rest_length", shown, f"must be {own}", where=where, sentence=said)


def law(name: str | type[TensionLaw], parameters: Mapping[str, JsonValue]) -> TensionLaw:
    """A law from its name, or its class, and parameters [SI].

    Args:
        name: of a law of the package or of an installed one, or a class in a file such as ``my.py:MyLaw``.
        parameters: by name: numbers [SI] or text with a unit.

    Raises:
        InputError: a parameter is missing, unknown or out of bounds.

    Examples:
        >>> import mckibben as mk
        >>> law = mk.law("ideal", {"thread_length": 0.16, "turns": 3.2})
        >>> round(float(law.tension(0.13, 3e5)), 2)
        58.52
    """
    named_by_person(name)
    key = law_key(name)
    return build_law(key, _in_si(key, named_values(parameters, "parameters")))


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
    if any(f.name == "volume_known" for f in dataclasses.fields(kind)):
        options["volume_known"] = "rest_volume" in parameters
    return kind(**dict(parameters), **options)


def required_fields(kind: type[TensionLaw]) -> list[str]:
    """Declared parameters of a law that have no default."""
    return [f.name for f in dataclasses.fields(kind) if "quantity" in f.metadata and not _has_default(f)]


def default_parameters(kind: type[TensionLaw]) -> dict[str, float]:
    """Declared parameters of a law that have a default, with that default [SI]."""
    return {
        f.name: float(cast(float, f.default))
        for f in dataclasses.fields(kind)
        if "quantity" in f.metadata and _has_default(f)
    }


def _has_default(field: Any) -> bool:
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
    if not (creep is None or isinstance(creep, MemoryElement)):
        raise InputError("creep", None, f"must be an element such as MaxwellChain, got {creep!r}")
    if not (friction is None or isinstance(friction, str | Hysteresis)):
        raise InputError("friction", None, f"must be a friction such as MaxwellSlip, or its name, got {friction!r}")
    for key, value in parameters.items():
        if not isinstance(value, str) and np.ndim(value):
            raise InputError(key, None, f"must be one number, got {value!r}")
    if isinstance(name, str) and name in LAWS:
        if law is not None:
            raise InputError("law", None, f"is allowed only with a specimen; {name} is a law itself")
        built = build_law(name, _in_si(name, parameters))
        check_geometry(built, rest_length_of(None, built))
        return Muscle(built, _own(friction), creep, stated=tuple(parameters))
    spec = name if isinstance(name, Specimen) else muscle_specimen(name)
    chosen = (law if isinstance(law, str) else LAWS.stated_as(law, spec.laws)) if law else spec.law
    spec, changes = at_rest_length(spec, chosen, _in_si(chosen, parameters))
    if spec.kind == "biological":
        fibre = cast(TensionLaw, _biological(spec, chosen, changes))  # it answers the questions of a law
        return Muscle(fibre, _own(friction), creep, specimen=spec)
    built = law_from_specimen(spec, chosen, changes=changes)
    check_geometry(built, rest_length_of(spec, built))
    chain = creep or _stated_creep(spec)
    return Muscle(built, _usual_friction(spec, friction), chain, specimen=spec, stated=tuple(parameters))


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
    known = {"rest_length": dimensions.REST_LENGTH} | known  # a specimen has one even where its law has none
    return {
        key: in_si(value, known[key].unit, field=f"{law}.{key}") if key in known else value
        for key, value in parameters.items()
    }


def changed_parameters(
    changes: Mapping[str, float | str] | None, law: str, of: Specimen | None = None
) -> dict[str, float]:
    """Parameters of a law [SI], and of its specimen, as a person changes them; text without a unit is taken as SI."""
    fibre = of is not None and of.kind == "biological"
    known = declared(BiologicalMuscle if fibre else law_type(law))
    known = known if of is None else {"rest_length": dimensions.REST_LENGTH} | known
    numbers = {}
    for name, value in named_values(changes or {}, "parameters").items():
        if name not in known:
            raise InputError(f"parameters.{name}", value, f"{law} has", known=known)
        field = f"parameters.{name}"
        numbers[name] = parse(value, known[name].unit, field=field, bare=True) if isinstance(value, str) else value
    return numbers


def _own(friction: str | Hysteresis | None) -> Hysteresis | None:
    if not isinstance(friction, str):
        return friction
    if is_reference(friction):
        return _build_friction(friction, {}, "friction", None)
    raise InputError("friction", friction, "must be a friction such as MaxwellSlip; only specimens state one by name")


def _usual_friction(spec: Specimen, friction: str | Hysteresis | None) -> Hysteresis | None:
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


def from_specimen(spec: Specimen, law: str | None = None, friction: str | None = None) -> Any:
    """A `Muscle` of a McKibben specimen, or the `BiologicalMuscle` of a biological one.

    Args:
        spec: the specimen, as read from a file.
        law: one of the laws it states; its default law by default.
        friction: one of the frictions it states; the first by default, none if it states none.
    """
    if spec.kind == "biological":
        return _biological(spec, law or spec.law, {})
    chosen = friction or next(iter(spec.friction), None)
    return Muscle(
        law=law_from_specimen(spec, law),
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
    has_limit = any(f.name == "limit" for f in dataclasses.fields(kind))
    known = {key: q.unit for key, q in declared(kind).items()} | (_LIMIT_UNITS if has_limit else {})
    whole = {f.name for f in dataclasses.fields(kind) if f.type in ("int", int)}
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
    for key, value in changes.items():
        if key not in known:
            raise InputError(f"{name}.{key}", None, known=known, where=spec.where)
        known[key].check(f"{name}.{key}", value, where=spec.where)
    return BiologicalMuscle(**(parameters | changes))
