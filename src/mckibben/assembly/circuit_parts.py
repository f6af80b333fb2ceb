"""The parts of a circuit from their tables: nodes, the elements that join them, and the [fit] table.

A [fit] table says what is free, where the search starts, and how the records of the circuit are read:

    [fit]
    free = ["elements.tube.friction_scale", "elements.valve_*.passage.conductance"]
    start = { "elements.tube.friction_scale" = 1.2 }
    columns = { time = 1, "tank.pressure" = 2 }        # of records that have other names, or no header
    units = { "tank.pressure" = "kPa" }
    pressure_zero = "9 kPa"                            # what the sensors read at zero
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from .. import schema
from ..answers import brief
from ..components import Environment
from ..errors import InputError, MissingParametersError
from ..muscles import law_from_specimen
from ..muscles.build import build_law, needed_words
from ..muscles.law import TensionLaw
from ..muscles.laws import LAWS, law_type
from ..pneumatics.build import ELEMENTS, build_element
from ..pneumatics.circuit import Branch
from ..pneumatics.volume import (
    Chamber,
    CompliantVolume,
    FixedVolume,
    HeatModel,
    Isothermal,
    MovingVolume,
    Polytropic,
    Reservoir,
    WallHeat,
    adiabatic,
)
from ..quantities import declared, shown_unit, with_unit
from ..schema import Place, read_number
from ..specimens import Specimen, specimen

SMALLEST = declared(FixedVolume)["volume"].bounds[0]  # [m^3], of a junction beside what tubes give it


@dataclass(frozen=True)
class PlannedNode:
    """A node, and what belongs to it but not to the circuit."""

    node: Reservoir | Chamber  # as the circuit takes it
    kind: str  # as the file names it
    start: float = 0.0  # gauge pressure at the start [Pa]
    signal: str | None = None  # name of the signal that gives its gauge pressure, its length or its stroke
    unit: str = "Pa"  # unit of that signal
    length: float | None = None  # length of a muscle that does not move [m]
    law: TensionLaw | None = None  # law of a muscle
    specimen: Specimen | None = None  # of which a number of the law is left
    words: str = ""  # what a sentence says of it
    needs_volume: bool = False  # whether only its neighbours give it volume

    __repr__ = brief


# ---- heat


@dataclass(frozen=True)
class _IsothermalTable:
    """The gas keeps its temperature."""

    def model(self, room: Environment) -> tuple[HeatModel, str]:
        return Isothermal(), "isothermal"


@dataclass(frozen=True)
class _AdiabaticTable:
    """No heat passes."""

    def model(self, room: Environment) -> tuple[HeatModel, str]:
        return adiabatic(), "adiabatic"


@dataclass(frozen=True)
class _PolytropicTable:
    """A polytropic change."""

    exponent: float = schema.like(Polytropic, "exponent")

    def model(self, room: Environment) -> tuple[HeatModel, str]:
        return Polytropic(exponent=self.exponent), f"polytropic with n = {self.exponent:g}"


@dataclass(frozen=True)
class _WallTable:
    """A wall that takes heat, at the temperature of the surroundings unless stated."""

    conductance: float = schema.like(WallHeat, "conductance")
    wall_temperature: float | None = schema.like(WallHeat, "wall_temperature", default=None)

    def model(self, room: Environment) -> tuple[HeatModel, str]:
        wall = float(room.temperature) if self.wall_temperature is None else self.wall_temperature
        model = WallHeat(conductance=self.conductance, wall_temperature=wall)
        return model, f"wall of {self.conductance:g} W/K at {with_unit(wall, 'K')}"


# Each states the heat transfer of a gas, as a model and in words, in its surroundings.
HeatTable = _IsothermalTable | _AdiabaticTable | _PolytropicTable | _WallTable
HEATS = {
    "isothermal": _IsothermalTable,
    "adiabatic": _AdiabaticTable,
    "polytropic": _PolytropicTable,
    "wall": _WallTable,
}


def _read_heat(raw: Any, place: Place) -> HeatTable:
    if not isinstance(raw, Mapping) and raw not in HEATS:
        raise place.fail(raw, known=HEATS)
    table: HeatTable = schema.read_part(HEATS, raw if isinstance(raw, Mapping) else {"kind": raw}, place)
    return table


# ---- nodes


class NodeTable(abc.ABC):
    """A node as its table states it."""

    @abc.abstractmethod
    def planned(self, name: str, place: Place, room: Environment) -> PlannedNode:
        """The node of a circuit in these surroundings; raises `InputError` about its `place` in the file."""


@dataclass(frozen=True, kw_only=True)
class _AtmosphereTable(NodeTable):
    """The surroundings."""

    temperature: float | None = schema.like(Reservoir, "temperature", default=None)

    def planned(self, name: str, place: Place, room: Environment) -> PlannedNode:
        absolute = float(room.pressure_abs)
        node = Reservoir(pressure_abs=absolute, temperature=_first(self.temperature, room.temperature))
        return PlannedNode(node, "atmosphere", words=f"{with_unit(absolute, 'Pa')} absolute")


@dataclass(frozen=True, kw_only=True)
class _ReservoirTable(NodeTable):
    """A node of given pressure."""

    pressure: float | None = schema.number("Pa", doc="gauge pressure", default=None)
    signal: str | None = None
    temperature: float | None = schema.like(Reservoir, "temperature", default=None)

    def planned(self, name: str, place: Place, room: Environment) -> PlannedNode:
        warm = _first(self.temperature, room.temperature)
        if self.signal is not None:
            if self.pressure is not None:
                stated = with_unit(self.pressure, "Pa")
                raise place.below("pressure").fail(stated, "must be a pressure or a signal, not both")
            node = Reservoir(signal=f"{name}.pressure", temperature=warm)
            return PlannedNode(node, "reservoir", signal=self.signal, words=f"follows {self.signal}")
        if self.pressure is None:
            raise place.below("pressure").fail(None, "is missing")
        gauge = _above_vacuum(self.pressure, place.below("pressure"), room)
        node = Reservoir(pressure_abs=gauge + float(room.pressure_abs), temperature=warm)
        return PlannedNode(node, "reservoir", words=with_unit(gauge, "Pa"))


@dataclass(frozen=True, kw_only=True)
class _ChamberTable(NodeTable):
    """A node that stores gas."""

    start_pressure: float = schema.number("Pa", doc="gauge pressure at the start", default=0.0)
    heat: HeatTable = schema.entry(_read_heat, "heat transfer of the gas", default=_IsothermalTable())

    def start(self, place: Place, room: Environment) -> float:
        """The gauge pressure at the start [Pa], which must be above vacuum."""
        return _above_vacuum(self.start_pressure, place.below("start_pressure"), room)


@dataclass(frozen=True, kw_only=True)
class _VolumeTable(_ChamberTable):
    """A rigid volume; a junction if its neighbours may give it all of it."""

    kind: ClassVar[str] = "volume"
    volume: float | None = schema.like(FixedVolume, "volume", default=None)

    def planned(self, name: str, place: Place, room: Environment) -> PlannedNode:
        needs = self.kind == "junction" and self.volume is None
        if self.volume is None and not needs:
            raise place.below("volume").fail(None, "is missing")
        heat, words = self.heat.model(room)
        size = SMALLEST if self.volume is None else self.volume
        shown = words if needs else f"{with_unit(size, 'm^3')}, {words}"
        node = FixedVolume(volume=size, heat=heat)
        return PlannedNode(node, self.kind, start=self.start(place, room), words=shown, needs_volume=needs)


@dataclass(frozen=True, kw_only=True)
class _JunctionTable(_VolumeTable):
    """A place where elements join."""

    kind: ClassVar[str] = "junction"


@dataclass(frozen=True, kw_only=True)
class _CompliantTable(_ChamberTable):
    """A volume that gives way to pressure, and may be moved by a signal."""

    volume: float = schema.like(CompliantVolume, "volume")
    compliance: float = schema.like(CompliantVolume, "compliance", default=0.0)
    swept: float | None = schema.like(CompliantVolume, "swept", default=None)
    saturation: float = schema.like(CompliantVolume, "saturation", default=0.0)
    signal: str | None = None

    def planned(self, name: str, place: Place, room: Environment) -> PlannedNode:
        heat, words = self.heat.model(room)
        if (self.swept is None) != (self.signal is None):
            problem = "goes together with the signal of the stroke: a volume that moves needs both"
            raise place.below("swept").fail(None, problem)
        node = CompliantVolume(
            volume=self.volume,
            compliance=self.compliance,
            swept=_first(self.swept, 0.0),
            saturation=self.saturation,
            ambient=float(room.pressure_abs),
            heat=heat,
            signal=None if self.signal is None else f"{name}.stroke",
        )
        moves = "" if self.signal is None else f", moved by {self.signal}"
        said = f"{with_unit(self.volume, 'm^3')}, compliant{moves}, {words}"
        return PlannedNode(node, "compliant", self.start(place, room), self.signal, "1", words=said)


@dataclass(frozen=True, kw_only=True)
class _MuscleNodeTable(_ChamberTable):
    """A muscle of a length, or of one that a signal gives."""

    specimen: str
    law: str = ""
    parameters: dict[str, str | float] = schema.by_name((str, int, float), "a value with its unit")
    length: float | None = schema.number("m", doc="length of the muscle", default=None)
    signal: str | None = None
    dead_volume: float = schema.like(MovingVolume, "dead_volume", default=0.0)

    def planned(self, name: str, place: Place, room: Environment) -> PlannedNode:
        law, title, spec = self._law(place)
        if (self.length is None) == (self.signal is None):
            problem = "is missing: a muscle needs a length, or the signal that gives it, and not both"
            raise place.below("length").fail(None, problem)
        if self.length is not None:
            check_length(law, self.length, place.below("length").field, place.where or "")
        heat, words = self.heat.model(room)
        ambient, dead = float(room.pressure_abs), self.dead_volume
        node = MovingVolume(of=law.braid_volume, ambient=ambient, dead_volume=dead, heat=heat, signal=f"{name}.length")
        at = f"follows {self.signal}" if self.length is None else with_unit(self.length, "m")
        fittings = f", {with_unit(dead, 'm^3')} of fittings" if dead else ""
        said = f"{title}, {at}{fittings}, {words}"
        return PlannedNode(node, "muscle", self.start(place, room), self.signal, "m", self.length, law, spec, said)

    def _law(self, place: Place) -> tuple[TensionLaw, str, Specimen | None]:
        spec = _specimen(self.specimen, place.below("specimen"))
        name = self.law or spec.law
        if not name:
            raise place.below("law").fail(None, "is missing")
        if name not in LAWS:
            if not (stated := [one for one in spec.laws if one in LAWS]):
                raise place.below("specimen").fail(spec.id, f"must be a McKibben muscle; it is {spec.kind}")
            raise place.below("law").fail(name, f"{spec.id} states", known=stated)
        changes, known = place.below("parameters"), declared(law_type(name))
        changes.table(self.parameters).only(known, f"{name} has")
        values = {
            key: read_number(raw, known[key].unit, known[key].bounds, changes.below(key).field, place.where)
            for key, raw in self.parameters.items()
        }
        try:
            law = law_from_specimen(spec, name, changes=values) if name in spec.laws else build_law(name, values)
        except MissingParametersError as error:
            raise _missing(place, spec, error) from None
        except InputError as error:
            key = "specimen" if spec.kind != "mckibben" else "law"
            raise error.changed(field=place.below(key).field, where=place.where) from None
        if not law.has_volume():
            raise place.below("law").fail(name, "must be a law that knows its volume, such as linear_threshold")
        # a specimen of which no number of the law is left gives nothing but a name, and it would be a wrong one
        if values and not spec.laws.get(name, {}).keys() - values.keys():
            return law, f"own numbers by {name}", None
        return law, f"{spec.id}{' with own numbers' if values else ''} by {name}", spec


NODES = {
    "reservoir": _ReservoirTable,
    "atmosphere": _AtmosphereTable,
    "volume": _VolumeTable,
    "compliant": _CompliantTable,
    "muscle": _MuscleNodeTable,
    "junction": _JunctionTable,
}


def _first(stated: float | None, usual: Any) -> float:
    return float(usual) if stated is None else stated


def _above_vacuum(value: float, place: Place, room: Environment) -> float:
    lowest = -float(room.pressure_abs)
    if not value > lowest:
        raise place.fail(with_unit(value, "Pa"), f"must be a gauge pressure above vacuum, {with_unit(lowest, 'Pa')}")
    return value


def _specimen(name: str, place: Place) -> Specimen:
    try:
        return specimen(name)
    except InputError as error:
        raise error.changed(field=place.field, where=place.where) from None


def _missing(place: Place, spec: Specimen, error: MissingParametersError) -> InputError:
    """An error message that names the parameters that neither the specimen nor the file states, and how they are given."""
    has = f"states {', '.join(spec.laws)}" if error.law not in spec.laws else "does not state all of it"
    at, field = place.below("parameters").field, place.below("law").field
    paths = ", ".join(f"{at}.{key} = '.. {shown_unit(q.unit)}'".replace(" 1'", "'") for key, q in error.missing)
    said = (
        f"{field} is '{error.law}', but the specimen {spec.id} {has}. Missing: {needed_words(error.missing)}. "
        f"State them as {paths}"
    )
    return InputError(field, error.law, f"state {paths}", where=place.where, sentence=said)


def check_length(law: TensionLaw, length: float, field: str, where: str) -> None:
    """Refuse a length for which a law is not made."""
    low, high = (float(end) for end in law.length_range())
    if not low <= length <= high:
        allowed = f"must be between {with_unit(low, 'm')} and {with_unit(high, 'm')}"
        raise InputError(field, with_unit(length, "m"), allowed, where=where)


# ---- elements

TWO_PORTS = ("from", "to")  # the two ports of an element that has no more


class PlannedBranch(NamedTuple):
    """An element with its place in the circuit, and the SI unit of its command."""

    branch: Branch
    unit: str


def _read_kind(raw: Any, place: Place) -> str:
    if not isinstance(raw, str):
        raise place.fail(raw, known=ELEMENTS)
    ELEMENTS.find(raw, field=place.field, where=place.where)
    return raw


@dataclass(frozen=True, kw_only=True)
class ElementTable:
    """An element as its table states it: its kind, and the keys of that kind, among them the nodes of its ports."""

    kind: str = schema.entry(_read_kind, "kind of the element, such as lumped_tube")
    command: str | None = None
    specimen: str | None = None
    stated: Mapping[str, Any] = schema.rest()

    def planned(self, place: Place, nodes: Sequence[str]) -> PlannedBranch:
        """The element between its nodes; raises `InputError` about its `place` in the file."""
        ports = ELEMENTS[self.kind].ports
        # `b` is also a critical pressure ratio: an element that is between `from` and `to` has no port of another name.
        named = set(ports) <= set(self.stated) and not set(TWO_PORTS) & set(self.stated)
        keys = TWO_PORTS if len(ports) == 2 and not named else ports
        ends = tuple(self._end(key, keys, place, nodes) for key in keys)
        spec = None if self.specimen is None else _specimen(self.specimen, place.below("specimen"))
        values = {key: value for key, value in self.stated.items() if key not in keys}
        try:
            element = build_element(self.kind, values, where=place.where, specimen=spec)
        except InputError as error:
            key = error.field.removeprefix(f"{self.kind}.")
            if spec is not None and error.where == (spec.where or spec.id):
                key = "specimen"
            raise error.changed(field=place.below(key).field, where=place.where) from None
        return PlannedBranch(Branch(element, ends, self.command), element.command_unit)

    def _end(self, key: str, keys: Sequence[str], place: Place, nodes: Sequence[str]) -> str:
        if key not in self.stated:
            problem = f"is missing: its ports are {', '.join(keys)}, and each leads to a node"
            raise place.below(key).fail(None, problem)
        if self.stated[key] not in nodes:
            raise place.below(key).fail(self.stated[key], known=nodes)
        return str(self.stated[key])


@dataclass(frozen=True, kw_only=True)
class FitTable:
    """The table ``fit`` of a circuit file; the command line adds to it."""

    free: tuple[str, ...] = schema.words("dotted paths", default=())
    start: dict[str, str | float] = schema.by_name((str, int, float), "a value in words")
    columns: dict[str, str | int] = schema.by_name((str, int), "the name or the number of a column")
    units: dict[str, str] = schema.by_name((str,), "a unit in words")
    pressure_zero: float = schema.number("Pa", doc="what the sensors read at zero", default=0.0)

    __repr__ = brief
