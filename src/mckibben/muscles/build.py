"""Laws from their parameters or from specimen data, also of a muscle cut to another length; unknown keys are refused."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, cast

import numpy as np

from ..documents import JsonValue
from ..errors import InputError, MissingParametersError
from ..quantities import Quantity, declared, has_dimension, in_si, named_values, parse, shown_unit, with_unit
from ..registry import named_by_person
from ..specimens import Specimen, SpecimenNumber, specimens
from . import dimensions
from .biological import BiologicalMuscle
from .law import TensionLaw
from .laws import LAWS, law_key, law_type
from .learned import LearnedResidual


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


def measured_rest_lengths(spec: Specimen) -> list[float]:
    """Rest lengths of the muscles to which a specimen's laws were fitted [m], rising; none where the file states none."""
    if "measured_rest_lengths" not in spec.properties:
        return []
    value = spec.properties["measured_rest_lengths"].si("m", field="properties.measured_rest_lengths", where=spec.where)
    return sorted(value if isinstance(value, list) else [value])


def at_rest_length(spec: Specimen, law: str, changes: Mapping[str, Any]) -> tuple[Specimen, dict[str, Any]]:
    """Cut a muscle to the ``rest_length`` among some changes of its law; return it with the changes that are left.

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
    return build_law(key, parameters_in_si(key, named_values(parameters, "parameters")))


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


def parameters_in_si(law: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
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
    return biological_from_specimen(spec, spec.law, {}) if spec.kind == "biological" else law_from_specimen(spec)


def biological_from_specimen(spec: Specimen, name: str, changes: dict[str, Any]) -> BiologicalMuscle:
    """The biological muscle of a specimen by one of the laws that it states, with other parameters [SI]."""
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
