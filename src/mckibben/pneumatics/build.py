"""Pneumatic elements from tables: kinds by name, values with units, and the usual ways to state a size.

A passage (a field that is an `Orifice`) is stated by exactly one of `SIZES`, as a catalogue has it; the signs of the
standard are read as well (`ALIASES`). Definitions and examples: docs/explanation/catalogue-flows.md. An element with two
passages takes these keys for both, or with the name of one in front: ``nominal_flow``, ``vent_nominal_flow``. The times of a
valve's drive stand beside the element's own keys. A diameter may be the name of a tube of the catalogue, ``"PU-4x2"``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

from ..components.flow import FlowElement
from ..components.gas import AIR, REFERENCE_PRESSURE, REFERENCE_TEMPERATURE
from ..documents import JsonValue
from ..errors import InputError, choice
from ..quantities import Quantity, declared, parse, with_unit
from ..registry import Registry
from ..specimens import Specimen
from ..specimens.parts import bore_of
from .compressor import Compressor
from .orifice import Leak, Orifice
from .solenoid import PilotStage, Solenoid
from .tubes import InertialTube, LinearTube, LumpedTube, QuadraticTube
from .valves import CheckValve, OnOffValve, PressureRegulator, QuickExhaust, SpoolValve, ThreeWayValve

# What states a size, and the keys that go with it.
SIZES: dict[str, tuple[str, ...]] = {
    "conductance": (),
    "nominal_flow": (),
    "flow_into_the_room": ("flow_pressure",),
    "Kv": (),
    "Cv": (),
    "hole_diameter": ("discharge",),
}
ALIASES = {"C": "conductance", "b": "critical_ratio"}  # signs of the standard
TITLES = {
    "conductance": "Sonic conductance C",
    "nominal_flow": "Nominal flow, 6 to 5 bar",
    "flow_into_the_room": "Flow into the room",
    "Kv": "Kv, water at 1 bar",
    "Cv": "Cv, water at 1 psi",
    "hole_diameter": "Hole",
}
PREFIXES = ("fill", "vent", "relief", "feed")  # names of passages in front of a key
BARE_UNITS = {"Kv": "m^3/h"}  # of a number without a unit: IEC 60534-1 has Kv in cubic metres per hour

NOMINAL_FLOW = Quantity(
    "m^3/s", (0.0, 10.0), "standard nominal flow, from 6 to 5 bar gauge, as reference air (ANR)", "qnN", (1e-5, 1e-1)
)
FLOW = Quantity("m^3/s", (0.0, 10.0), "volume flow of reference air into the room", "q", (1e-5, 1e-1))
FLOW_PRESSURE = Quantity("Pa", (1.0, 1e8), "gauge pressure at which it flows into the room", "p", (1e5, 1e6))
KV = Quantity("m^3/s", (0.0, 1.0), "flow coefficient, water at a drop of 1 bar", "Kv", (1e-6, 1e-2))
CV = Quantity("1", (0.0, 1e4), "flow coefficient, US gallons of water per minute at 1 psi", "Cv", (0.01, 50.0))
DIAMETER = Quantity("m", (1e-6, 0.1), "inner diameter", "D", (1e-4, 1e-2))
DISCHARGE = Quantity("1", (0.01, 1.0), "discharge coefficient", "Cd", (0.6, 0.95))


@dataclasses.dataclass(frozen=True)
class SizeStatement:
    """A way to state an element other than by its fields: required keys, optional keys, and the conversion."""

    needs: Mapping[str, Quantity]
    may: Mapping[str, Quantity]
    make: Callable[..., Any]


ORIFICE_FIELDS = {name: q for name, q in declared(Orifice).items() if name != "conductance"}
PASSAGE_WAYS = (
    SizeStatement(
        {"nominal_flow": NOMINAL_FLOW},
        ORIFICE_FIELDS,
        lambda nominal_flow, **rest: Orifice.from_nominal_flow(nominal_flow, **rest),
    ),
    SizeStatement(
        {"flow_into_the_room": FLOW, "flow_pressure": FLOW_PRESSURE},
        ORIFICE_FIELDS,
        lambda flow_into_the_room, flow_pressure, **rest: Orifice.from_flow(
            flow_into_the_room, pressure=flow_pressure, **rest
        ),
    ),
    SizeStatement({"Kv": KV}, ORIFICE_FIELDS, lambda Kv, **rest: Orifice.from_kv(Kv, **rest)),
    SizeStatement({"Cv": CV}, ORIFICE_FIELDS, lambda Cv, **rest: Orifice.from_cv(Cv, **rest)),
    SizeStatement(
        {"hole_diameter": DIAMETER},
        {**ORIFICE_FIELDS, "discharge": DISCHARGE},
        lambda hole_diameter, **rest: Orifice.of_hole(hole_diameter, **rest),
    ),
)
LEAK_WAY = SizeStatement(
    {"flow_into_the_room": FLOW, "flow_pressure": FLOW_PRESSURE},
    {},
    lambda flow_into_the_room, flow_pressure: Leak.from_flow(flow_into_the_room, pressure=flow_pressure),
)


def canonical(key: str, prefixes: Iterable[str] = ()) -> str:
    """Key of an alias, with the prefix of a passage kept; other keys unchanged."""
    prefix = _prefix(key, prefixes)
    base = key.removeprefix(prefix)
    return prefix + ALIASES.get(base, base)


def with_aliases(known: Mapping[str, Quantity], prefixes: Iterable[str] = ()) -> dict[str, Quantity]:
    """Known keys, followed by their aliases."""
    keys = dict(known)
    for key, quantity in known.items():
        prefix = _prefix(key, prefixes)
        for alias, name in ALIASES.items():
            if key == prefix + name:
                keys[prefix + alias] = quantity
    return keys


def has_size(names: Iterable[str], prefix: str = "") -> bool:
    """Whether some keys, each in its one name, state a size: of one passage by its prefix, or of all."""
    return any(prefix + size in names for size in SIZES)


def of_passage(key: str) -> bool:
    """Whether a key, in its one name and without a prefix, belongs to any passage alike."""
    return key in ORIFICE_FIELDS or key in SIZES or any(key in more for more in SIZES.values())


def replaced(key: str, names: Collection[str], prefixes: Iterable[str]) -> bool:
    """Whether a key belongs to a size that others state instead."""
    prefix = _prefix(key, prefixes)
    base = key.removeprefix(prefix)
    sizes = [size for size, more in SIZES.items() if base == size or base in more]
    if not sizes or not (has_size(names) or (prefix and has_size(names, prefix))):
        return False
    return base in SIZES or not any(p + size in names for size in sizes for p in ("", prefix))


def one_size(stated: Mapping[str, float], prefix: str, where: str | None) -> None:
    """Refuse a passage whose size is stated more than once [SI]."""
    sizes = [key for key in SIZES if key in stated]
    if len(sizes) > 1:
        units = {"conductance": declared(Orifice)["conductance"].unit} | {
            key: q.unit for way in PASSAGE_WAYS for key, q in way.needs.items()
        }
        allowed = f"{sizes[0]} states the size already: give exactly one of {', '.join(SIZES)}"
        raise InputError(prefix + sizes[1], with_unit(stated[sizes[1]], units[sizes[1]]), allowed, where=where)


def put_value(values: Mapping[str, JsonValue], key: str, value: JsonValue) -> dict[str, JsonValue]:
    """The values of an element, as a file has them, with one replaced or added.

    A key that the file has under its other name keeps that name. A size takes the place of one that is stated in another
    way, with what goes with that.
    """
    prefix, target = _prefix(key, PREFIXES), canonical(key, PREFIXES)
    base, gone = target.removeprefix(prefix), set()
    if base in SIZES:
        others = [size for size in SIZES if size != base]
        gone = {prefix + name for size in others for name in (size, *SIZES[size])}
    kept = {k: v for k, v in values.items() if canonical(k, PREFIXES) not in gone}
    name = next((k for k in kept if canonical(k, PREFIXES) == target), key)
    return kept | {name: value}


def size_as(orifice: Orifice, size: str, *, flow_pressure: float = 6e5) -> float:
    """The size of an orifice as a catalogue would state it.

    Args:
        orifice: whose conductance and critical ratio are taken.
        size: one of `SIZES`.
        flow_pressure: gauge pressure of a flow into the room [Pa].

    Returns:
        The value [SI unit of the key].
    """
    conductance, rest = float(orifice.conductance), {"critical_ratio": float(orifice.critical_ratio)}
    if size == "conductance":
        return conductance
    if size == "hole_diameter":  # the flow goes with the square of a diameter
        return float(1e-3 * (conductance / float(Orifice.of_hole(1e-3).conductance)) ** 0.5)
    way = next(w for w in PASSAGE_WAYS if size in w.needs)
    values = {size: 1e-3} | ({"flow_pressure": flow_pressure} if "flow_pressure" in way.needs else {})
    return 1e-3 * conductance / float(way.make(**values, **rest).conductance)


def _prefix(key: str, prefixes: Iterable[str]) -> str:
    return next((f"{p}_" for p in prefixes if key.startswith(f"{p}_")), "")


# ---- elements by kind


def _required_of_element(kind: Any) -> str | None:
    """What something must be to be a pneumatic element; None where it is one."""
    if not (isinstance(kind, type) and issubclass(kind, FlowElement)):
        return "a class derived from mckibben.components.flow.FlowElement"
    missing = sorted(getattr(kind, "__abstractmethods__", ()))
    return f"complete; missing: {', '.join(missing)}" if missing else None


ELEMENTS: Registry[type[FlowElement]] = Registry(
    "mckibben.valves",
    "kind",
    {
        "orifice": Orifice,
        "leak": Leak,
        "check_valve": CheckValve,
        "on_off_valve": OnOffValve,
        "three_way_valve": ThreeWayValve,
        "spool_valve": SpoolValve,
        "pressure_regulator": PressureRegulator,
        "quick_exhaust": QuickExhaust,
        "compressor": Compressor,
        "linear_tube": LinearTube,
        "quadratic_tube": QuadraticTube,
        "inertial_tube": InertialTube,
        "lumped_tube": LumpedTube,
    },
    accept=_required_of_element,
)

LENGTH = Quantity("m", (1e-4, 100.0), "length", "l", (1e-2, 5.0))
FRICTION = Quantity("1", (1e-4, 1.0), "friction factor", "f", (0.01, 0.05))
ENDS = Quantity("1", (0.0, 1e3), "loss of both ends in velocity heads", "K", (0.5, 5.0))
PRESSURE_ABS = Quantity("Pa", (1.0, 1e8), "absolute pressure at which the turbulent loss is taken", "p", (1e5, 1e6))


def _pipe(
    length: float,
    diameter: float,
    friction: float = 0.024,
    ends: float = 1.5,
    at_pressure_abs: float = REFERENCE_PRESSURE,
) -> dict[str, Any]:
    """Constant coefficients of a pipe: laminar by Hagen and Poiseuille, turbulent at one density."""
    density = AIR.density(at_pressure_abs, REFERENCE_TEMPERATURE)
    return {
        "viscous": 32.0 * AIR.viscosity(REFERENCE_TEMPERATURE) * length / diameter**2,
        "turbulent": 0.5 * density * (friction * length / diameter + ends),
        "area": 0.25 * 3.141592653589793 * diameter**2,
    }


_PIPE = SizeStatement(
    {"length": LENGTH, "diameter": DIAMETER},
    {"friction": FRICTION, "ends": ENDS, "at_pressure_abs": PRESSURE_ABS},
    lambda **stated: QuadraticTube(**_pipe(**stated)),
)
WAYS: dict[str, tuple[SizeStatement, ...]] = {
    "orifice": PASSAGE_WAYS,
    "leak": (LEAK_WAY, SizeStatement({"length": LENGTH, "diameter": DIAMETER}, {}, Leak.of_capillary)),
    "quadratic_tube": (_PIPE,),
    "inertial_tube": (
        dataclasses.replace(
            _PIPE, make=lambda length, **stated: InertialTube(**_pipe(length, **stated), length=length)
        ),
    ),
}


def passages_of(kind: str) -> tuple[str, ...]:
    """The fields of an element that are orifices, whose size a catalogue states; none of an orifice itself."""
    return tuple(f.name for f in dataclasses.fields(ELEMENTS[kind]) if f.type in ("Orifice", Orifice))


def is_driven(kind: str) -> bool:
    """Whether an element has a solenoid, whose times are stated among its keys."""
    return any(f.type in ("Solenoid", Solenoid) for f in dataclasses.fields(ELEMENTS[kind]))


def may_be_piloted(kind: str) -> bool:
    """Whether an element may have a pilot stage, whose pressures are stated among its keys."""
    return any(f.type in ("PilotStage | None", PilotStage) for f in dataclasses.fields(ELEMENTS[kind]))


def build_element(
    kind: str, values: Mapping[str, str | float], *, where: str | None = None, specimen: Specimen | None = None
) -> FlowElement:
    """An element from its kind and its values.

    Args:
        kind: one of `ELEMENTS`.
        values: words with units, such as ``"600 l/min"``; bare numbers for pure numbers only.
        where: place used in an error message.
        specimen: a valve whose published numbers stand for what the values leave out.

    Raises:
        InputError: names the element, the key, its value and what is allowed.
    """
    ELEMENTS.find(kind, where=where)
    if specimen is not None:
        return valve_from_specimen(specimen, kind, values=values, where=where)
    return _build(kind, _numbers(kind, values, where), where)


def valve_from_specimen(
    spec: Specimen,
    kind: str | None = None,
    *,
    effective: bool = False,
    values: Mapping[str, str | float] | None = None,
    where: str | None = None,
) -> FlowElement:
    """A valve as published.

    Args:
        spec: the specimen, as read from a file.
        kind: build this element from its flow instead of the one that the file names; what the file states of the other is
            then left out, but for passages.
        effective: take the effective flow, which was inferred from experiments, instead of the rated one.
        values: what to replace or add, as for `build_element`.
        where: place used in an error message about the values.

    Raises:
        InputError: if it is no valve, its file does not state the flow, or a value is refused.
    """
    place = spec.where or spec.id
    if spec.kind != "valve":
        raise InputError("specimen", spec.id, "must be a valve; it is a muscle", where=place)
    own_kind = spec.element or kind  # a file may leave the element open
    if not own_kind:
        raise InputError("element", None, f"is missing: it must be {choice(ELEMENTS)}", where=place)
    ELEMENTS.find(own_kind, field="element", where=place)
    chosen = kind or own_kind
    ELEMENTS.find(chosen, where=where or place)
    stated = _numbers(chosen, values or {}, where or place)
    given = dict(stated)
    known, wanted = known_keys(own_kind), known_keys(chosen)
    passages = passages_of(own_kind)
    for key, p in spec.valve.items():
        if key not in known:
            raise InputError(f"valve.{key}", None, f"{own_kind} has", known=known, where=place)
        value = p.si(known[key].unit, field=f"valve.{key}", where=place)
        if isinstance(value, list):
            raise InputError(f"valve.{key}", str(p.value), "must be one number", where=place)
        known[key].check(f"valve.{key}", value, where=place)
        target = canonical(key, passages)
        if target in wanted and (chosen == own_kind or of_passage(target)) and not replaced(target, stated, passages):
            given.setdefault(target, value)
    if effective and (has_size(stated) or not passages_of(chosen)):
        raise InputError(
            "effective", None, f"cannot be used: the values state the size, or {chosen} has no flow", where=place
        )
    if "flow_into_the_room" in wanted and (effective or not has_size(given)):
        _state_flow(spec, given, effective, passages_of(chosen))
    if "flow_into_the_room" in given and "flow_pressure" in spec.properties:
        given.setdefault("flow_pressure", spec.property_si("flow_pressure", "Pa"))
    return _build(chosen, given, where or place)


def _state_flow(spec: Specimen, stated: dict[str, float], effective: bool, passages: Sequence[str]) -> None:
    """Add the flow into the atmosphere that a file states as a property; not needed if each passage has its size."""
    name = "effective_flow" if effective else "flow_into_the_room"
    if name not in spec.properties:
        if any(has_size(stated, f"{p}_") for p in passages):
            return
        raise InputError(
            f"properties.{name}",
            None,
            f"is missing: the file must state a size, in [valve] {choice(SIZES)}",
            where=spec.where or spec.id,
        )
    stated["flow_into_the_room"] = spec.property_si(name, "m^3/s")


def known_keys(kind: str) -> dict[str, Quantity]:
    """Keys of an element, with their declarations; other names of a key stand behind it."""
    known = dict(declared(ELEMENTS[kind]))
    if is_driven(kind):
        known |= declared(Solenoid)
    if may_be_piloted(kind):
        known |= declared(PilotStage)
    for way in WAYS.get(kind, ()):
        known |= {**way.needs, **way.may}
    passages = passages_of(kind)
    keys = _passage_keys() if passages else {}
    known |= keys
    if len(passages) > 1:
        known |= {f"{passage}_{key}": q for passage in passages for key, q in keys.items()}
    # The conductance of a leak is a laminar one, and not the standard's.
    return with_aliases(known, passages) if passages or kind == "orifice" else known


def _passage_keys() -> dict[str, Quantity]:
    keys = dict(declared(Orifice))
    for way in PASSAGE_WAYS:
        keys |= {**way.needs, **way.may}
    return keys


def _numbers(kind: str, values: Mapping[str, Any], where: str | None) -> dict[str, float]:
    """Values in SI by key, in its one name; unknown keys, missing units and values out of bounds are named."""
    known, passages = known_keys(kind), passages_of(kind)
    numbers: dict[str, float] = {}
    for key, value in values.items():
        if key not in known:
            said = f"{kind} has"
            if kind.endswith("_tube") and canonical(key) in SIZES:
                part = f"a part that a catalogue states by {key} is an orifice"
                said = f"a tube is stated by its length and bore; {part}; {said}"
            raise InputError(f"{kind}.{key}", None, said, known=known, where=where)
        q, field, target = known[key], f"{kind}.{key}", canonical(key, passages)
        if target in numbers:
            raise InputError(
                field, str(value), f"{target} is stated already, and {key} is another name of it", where=where
            )
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            raise InputError(field, type(value).__name__, "must be a number, or words with a unit", where=where)
        bore = bore_of(value) if target == "diameter" else None  # a tube of the catalogue
        words = with_usual_unit(target, value, passages) if bore is None else f"{bore!r} m"
        numbers[target] = parse(words, q.unit, field=field, where=where)
        q.check(field, numbers[target], where=where)
    return numbers


def with_usual_unit(key: str, value: str | float, passages: Sequence[str] = ()) -> str:
    """Value as text; a bare number gets the unit of the standard that defines the key."""
    words = value if isinstance(value, str) else repr(value)
    base = next((key.removeprefix(f"{p}_") for p in passages if key.startswith(f"{p}_")), key)
    try:
        float(words)
    except ValueError:
        return words
    return f"{words} {BARE_UNITS[base]}" if base in BARE_UNITS else words


def _build(kind: str, given: Mapping[str, float], where: str | None) -> FlowElement:
    rest = dict(given)
    parts: dict[str, Any] = {}
    passages = passages_of(kind)
    shared = {key: rest.pop(key) for key in _passage_keys() if key in rest} if passages else {}
    for passage in passages:
        prefix = f"{passage}_"
        own = {key: rest.pop(prefix + key) for key in _passage_keys() if prefix + key in rest}
        # a passage that states its own size drops the shared one, and what goes with another way to state it
        stated = [size for size in SIZES if size in own]
        kept = {*ORIFICE_FIELDS, *(key for size in stated for key in SIZES[size])} if stated else set(shared)
        common = {k: v for k, v in shared.items() if k in kept}
        parts[passage] = _one(
            Orifice, PASSAGE_WAYS, common | own, f"{kind}.{prefix if len(passages) > 1 else ''}", where
        )
    if is_driven(kind):
        times = {key: rest.pop(key) for key in declared(Solenoid) if key in rest}
        parts["drive"] = _one(Solenoid, (), times, f"{kind}.", where)
    pilot = {key: rest.pop(key) for key in declared(PilotStage) if key in rest} if may_be_piloted(kind) else {}
    if pilot:
        parts["pilot"] = _pilot(pilot, f"{kind}.", where)
    built: FlowElement = _one(ELEMENTS[kind], WAYS.get(kind, ()), rest, f"{kind}.", where, parts)
    return built


def _pilot(pressures: Mapping[str, float], prefix: str, where: str | None) -> PilotStage:
    stage: PilotStage = _one(PilotStage, (), pressures, prefix, where)
    rated, spring = (pressures[key] for key in ("pilot_rated_pressure_abs", "pilot_spring_pressure_abs"))
    if not rated > spring:
        demand = f"must be above the {with_unit(spring, 'Pa')} of pilot_spring_pressure_abs"
        raise InputError(f"{prefix}pilot_rated_pressure_abs", with_unit(rated, "Pa"), demand, where=where)
    return stage


def _one(
    owner: Any,
    ways: tuple[SizeStatement, ...],
    stated: Mapping[str, float],
    prefix: str,
    where: str | None,
    parts: Any = None,
) -> Any:
    """Build an object from its own fields, or from another set of keys; missing or conflicting keys raise an error."""
    fields = declared(owner)
    if owner is Orifice:
        one_size(stated, prefix, where)
    required = [f.name for f in dataclasses.fields(owner) if f.name in fields and f.default is dataclasses.MISSING]
    make, needs, may = owner, required, fields
    for way in ways:  # a key that an element also has as a field, such as a tube's length, decides nothing
        if any(key in stated and key not in fields for key in way.needs):
            make, needs, may = way.make, list(way.needs), {**way.needs, **way.may}
            break
    missing = [key for key in needs if key not in stated]
    if missing:
        others = "".join(f"; or give {' and '.join(way.needs)}" for way in ways if way.make is not make)
        doc = {**fields, **may}[missing[0]].doc
        raise InputError(prefix + missing[0], None, f"is missing: it is the {doc}{others}", where=where)
    for key in stated:
        if key not in may:
            raise InputError(
                prefix + key, None, f"cannot be stated too: with it goes only {', '.join(may)}", where=where
            )
    try:
        return make(**stated, **(parts or {}))
    except InputError as error:
        raise (error.at(where) if where else error) from None
