"""The ways in which a catalogue states the size of a passage, and their keys in files.

Exactly one of `SIZES` states a size; `Orifice` converts it. The signs of the standard are read as well (`ALIASES`).
Definitions, formulas and examples: docs/explanation/catalogue-flows.md.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, Unpack

from ..documents import JsonValue
from ..errors import InputError
from ..quantities import Quantity, declared, with_unit
from .leak import Leak
from .orifice import Orifice, OrificeOptions

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


def _from_flow(flow_into_the_room: float, flow_pressure: float, **rest: Unpack[OrificeOptions]) -> Orifice:
    return Orifice.from_flow(flow_into_the_room, pressure=flow_pressure, **rest)


def _from_nominal_flow(nominal_flow: float, **rest: Unpack[OrificeOptions]) -> Orifice:
    return Orifice.from_nominal_flow(nominal_flow, **rest)


def _from_kv(Kv: float, **rest: Unpack[OrificeOptions]) -> Orifice:  # noqa: N803, the field's sign
    return Orifice.from_kv(Kv, **rest)


def _from_cv(Cv: float, **rest: Unpack[OrificeOptions]) -> Orifice:  # noqa: N803
    return Orifice.from_cv(Cv, **rest)


def _of_hole(hole_diameter: float, **rest: Unpack[OrificeOptions]) -> Orifice:
    return Orifice.of_hole(hole_diameter, **rest)


def _leak_from_flow(flow_into_the_room: float, flow_pressure: float) -> Leak:
    return Leak.from_flow(flow_into_the_room, pressure=flow_pressure)


ORIFICE_FIELDS = {name: q for name, q in declared(Orifice).items() if name != "conductance"}
PASSAGE_WAYS = (
    SizeStatement({"nominal_flow": NOMINAL_FLOW}, ORIFICE_FIELDS, _from_nominal_flow),
    SizeStatement({"flow_into_the_room": FLOW, "flow_pressure": FLOW_PRESSURE}, ORIFICE_FIELDS, _from_flow),
    SizeStatement({"Kv": KV}, ORIFICE_FIELDS, _from_kv),
    SizeStatement({"Cv": CV}, ORIFICE_FIELDS, _from_cv),
    SizeStatement({"hole_diameter": DIAMETER}, {**ORIFICE_FIELDS, "discharge": DISCHARGE}, _of_hole),
)
LEAK_WAY = SizeStatement({"flow_into_the_room": FLOW, "flow_pressure": FLOW_PRESSURE}, {}, _leak_from_flow)


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

    Args:
        values: by key.
        key: that is set.
        value: as text.
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
