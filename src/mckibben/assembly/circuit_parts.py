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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..components import Environment
from ..errors import InputError, MissingParametersError
from ..muscles import law_from_specimen
from ..muscles.build import build_law, needed_words
from ..muscles.law import TensionLaw
from ..muscles.laws import LAWS, law_type
from ..pneumatics.build import ELEMENTS, build_element
from ..pneumatics.circuit import Branch
from ..pneumatics.heat import HeatModel, Isothermal, Polytropic, WallHeat, adiabatic
from ..pneumatics.volume import Chamber, CompliantVolume, FixedVolume, MovingVolume, Reservoir
from ..quantities import declared, shown_unit, with_unit
from ..registry import is_reference
from ..schema import FileTable
from ..specimens import Specimen, specimen

KINDS = ("reservoir", "atmosphere", "volume", "compliant", "muscle", "junction")
HEATS = ("isothermal", "adiabatic", "polytropic", "wall")
STARTS = ("start_pressure", "heat")
SMALLEST = declared(FixedVolume)["size"].bounds[0]  # [m^3], of a junction beside what tubes give it


@dataclass(frozen=True)
class PlannedNode:
    """A node, and what belongs to it but not to the circuit.

    Attributes:
        node: as the circuit takes it.
        kind: as the file names it.
        start: gauge pressure at the start [Pa].
        signal: name of the signal that gives its gauge pressure, its length or its stroke.
        unit: unit of that signal.
        length: length of a muscle that does not move [m].
        law: law of a muscle.
        words: what a sentence says of it.
        needs_volume: whether only its neighbours give it volume.
    """

    node: Reservoir | Chamber
    kind: str
    start: float = 0.0
    signal: str | None = None
    unit: str = "Pa"
    length: float | None = None
    law: TensionLaw | None = None
    words: str = ""
    needs_volume: bool = False


def read_node(name: str, entry: FileTable, room: Environment) -> PlannedNode:
    """Read one node.

    Raises:
        InputError: names file, dotted path, value and what is allowed.
    """
    kind = entry.word("kind", among=KINDS)
    if kind in ("reservoir", "atmosphere"):
        return _reservoir(name, kind, entry, room)
    if kind == "compliant":
        return _compliant(name, entry, room)
    if kind == "muscle":
        return _muscle(name, entry, room)
    return _volume(kind, entry, room)


def start_pressure(entry: FileTable, key: str, room: Environment, default: float | None = None) -> float:
    """A gauge pressure above vacuum [Pa]."""
    value = entry.number(key, "Pa", default)
    lowest = -float(room.pressure_abs)
    if not value > lowest:
        raise entry.fail(
            key, str(entry.values[key]), f"must be a gauge pressure above vacuum, {with_unit(lowest, 'Pa')}"
        )
    return value


def _reservoir(name: str, kind: str, entry: FileTable, room: Environment) -> PlannedNode:
    temperature = declared(Reservoir)["temperature"]
    warm = entry.number("temperature", "K", float(room.temperature), declared=temperature)
    if kind == "atmosphere":
        entry.only(("kind", "temperature"), "an atmosphere has")
        absolute = float(room.pressure_abs)
        return PlannedNode(
            Reservoir(pressure_abs=absolute, temperature=warm), kind, words=f"{with_unit(absolute, 'Pa')} absolute"
        )
    entry.only(("kind", "pressure", "signal", "temperature"), "a reservoir has")
    if "signal" in entry.values:
        if "pressure" in entry.values:
            raise entry.fail("pressure", str(entry.values["pressure"]), "must be a pressure or a signal, not both")
        node = Reservoir(signal=f"{name}.pressure", temperature=warm)
        return PlannedNode(node, kind, signal=entry.word("signal"), words=f"follows {entry.word('signal')}")
    gauge = start_pressure(entry, "pressure", room)
    node = Reservoir(pressure_abs=gauge + float(room.pressure_abs), temperature=warm)
    return PlannedNode(node, kind, words=with_unit(gauge, "Pa"))


def _volume(kind: str, entry: FileTable, room: Environment) -> PlannedNode:
    entry.only(("kind", "volume", *STARTS), f"a {kind} has")
    needs = kind == "junction" and "volume" not in entry.values
    size = SMALLEST if needs else entry.number("volume", "m^3", declared=declared(FixedVolume)["size"])
    heat, words = _heat(entry, room)
    node = FixedVolume(size=size, heat=heat)
    shown = words if needs else f"{with_unit(size, 'm^3')}, {words}"
    return PlannedNode(
        node, kind, start=start_pressure(entry, "start_pressure", room, 0.0), words=shown, needs_volume=needs
    )


def _compliant(name: str, entry: FileTable, room: Environment) -> PlannedNode:
    entry.only(("kind", "volume", "compliance", "swept", "signal", *STARTS), "a compliant volume has")
    known = declared(CompliantVolume)
    size = entry.number("volume", "m^3", declared=known["size"])
    heat, words = _heat(entry, room)
    signal = entry.word("signal") if "signal" in entry.values else None
    if ("swept" in entry.values) != (signal is not None):
        raise entry.fail("swept", None, "goes together with the signal of the stroke: a volume that moves needs both")
    node = CompliantVolume(
        size=size,
        compliance=entry.number("compliance", "m^3/Pa", 0.0, declared=known["compliance"]),
        swept=entry.number("swept", "m^3", 0.0, declared=known["swept"]),
        ambient=float(room.pressure_abs),
        heat=heat,
        signal=None if signal is None else f"{name}.stroke",
    )
    start = start_pressure(entry, "start_pressure", room, 0.0)
    moves = "" if signal is None else f", moved by {signal}"
    said = f"{with_unit(size, 'm^3')}, compliant{moves}, {words}"
    return PlannedNode(node, "compliant", start, signal, "1", words=said)


def _muscle(name: str, entry: FileTable, room: Environment) -> PlannedNode:
    entry.only(("kind", "specimen", "law", "parameters", "length", "signal", "dead_volume", *STARTS), "a muscle has")
    law, title = _law(entry)
    if ("length" in entry.values) == ("signal" in entry.values):
        raise entry.fail(
            "length", None, "is missing: a muscle needs a length, or the signal that gives it, and not both"
        )
    length, signal = None, None
    if "length" in entry.values:
        length = entry.number("length", "m")
        check_length(law, length, entry.field("length"), entry.where)
    else:
        signal = entry.word("signal")
    dead = entry.number("dead_volume", "m^3", 0.0, declared=declared(MovingVolume)["dead"])
    heat, words = _heat(entry, room)
    node = MovingVolume(
        of=law.braid_volume, ambient=float(room.pressure_abs), dead=dead, heat=heat, signal=f"{name}.length"
    )
    place = f"follows {signal}" if length is None else with_unit(length, "m")
    fittings = f", {with_unit(dead, 'm^3')} of fittings" if dead else ""
    start = start_pressure(entry, "start_pressure", room, 0.0)
    return PlannedNode(node, "muscle", start, signal, "m", length, law, words=f"{title}, {place}{fittings}, {words}")


def _law(entry: FileTable) -> tuple[TensionLaw, str]:
    wanted = entry.word("specimen")
    try:
        spec = specimen(wanted)
    except InputError as error:
        raise error.changed(field=entry.field("specimen"), where=entry.where) from None
    name = entry.word("law", spec.law or None, among=None)
    if name not in LAWS:
        raise entry.fail("law", name, f"{spec.id} states", known=spec.laws)
    changes, known = entry.table("parameters"), declared(law_type(name))
    changes.only(known, f"{name} has")
    values = {k: changes.number(k, known[k].unit, declared=known[k]) for k in changes.values}
    try:
        law = law_from_specimen(spec, name, changes=values) if name in spec.laws else build_law(name, values)
    except MissingParametersError as error:
        raise _missing(entry, changes, spec, error) from None
    except InputError as error:
        key = "specimen" if spec.kind != "mckibben" else "law"
        raise error.changed(field=entry.field(key), where=entry.where) from None
    if not law.has_volume():
        raise entry.fail("law", name, "must be a law that knows its volume, such as linear_threshold")
    return law, f"{spec.id} by {name}"


def _missing(entry: FileTable, changes: FileTable, spec: Specimen, error: MissingParametersError) -> InputError:
    """An error message that names the parameters that neither the specimen nor the file states, and how they are given."""
    has = f"states {', '.join(spec.laws)}" if error.law not in spec.laws else "does not state all of it"
    paths = ", ".join(
        f"{changes.path}.{key} = '.. {shown_unit(q.unit)}'".replace(" 1'", "'") for key, q in error.missing
    )
    said = (
        f"{entry.field('law')} is '{error.law}', but the specimen {spec.id} {has}. Missing: {needed_words(error.missing)}. "
        f"State them as {paths}"
    )
    return InputError(entry.field("law"), error.law, f"state {paths}", where=entry.where, sentence=said)


def check_length(law: TensionLaw, length: float, field: str, where: str) -> None:
    """Refuse a length for which a law is not made."""
    low, high = (float(end) for end in law.length_range())
    if not low <= length <= high:
        raise InputError(
            field,
            with_unit(length, "m"),
            f"must be between {with_unit(low, 'm')} and {with_unit(high, 'm')}",
            where=where,
        )


def _heat(entry: FileTable, room: Environment) -> tuple[HeatModel, str]:
    """Read the heat transfer of a volume: the model and its description."""
    raw: Any = entry.values.get("heat", "isothermal")
    if isinstance(raw, Mapping):
        table = entry.table("heat")
    else:
        if raw not in HEATS:
            raise entry.fail("heat", raw, known=HEATS)
        table = FileTable({"kind": raw}, entry.field("heat"), entry.where)
    kind = table.word("kind", among=HEATS)
    if kind == "polytropic":
        table.only(("kind", "exponent"), "polytropic has")
        exponent = table.number("exponent", "1", declared=declared(Polytropic)["exponent"])
        return Polytropic(exponent=exponent), f"polytropic with n = {exponent:g}"
    if kind == "wall":
        table.only(("kind", "conductance", "wall_temperature"), "wall has")
        known = declared(WallHeat)
        conductance = table.number("conductance", "W/K", declared=known["conductance"])
        wall = table.number("wall_temperature", "K", float(room.temperature), declared=known["wall_temperature"])
        return (
            WallHeat(conductance=conductance, wall_temperature=wall),
            f"wall of {conductance:g} W/K at {with_unit(wall, 'K')}",
        )
    table.only(("kind",), f"{kind} has")
    return (Isothermal() if kind == "isothermal" else adiabatic()), kind


TWO_PORTS = ("from", "to")  # the two ports of an element that has no more


class PlannedBranch(NamedTuple):
    """An element with its place in the circuit, and the SI unit of its command."""

    branch: Branch
    unit: str


def read_branch(entry: FileTable, nodes: Sequence[str]) -> PlannedBranch:
    """Read one element and the nodes that it connects.

    Raises:
        InputError: names file, dotted path, value and what is allowed.
    """
    stated = entry.values.get("kind")
    kind = str(stated) if is_reference(stated) else entry.word("kind", among=ELEMENTS)
    ELEMENTS.find(kind, field=entry.field("kind"), where=entry.where or None)
    ports = ELEMENTS[kind].ports
    keys = TWO_PORTS if len(ports) == 2 and not set(ports) & set(entry.values) else ports
    ends = tuple(_end(entry, key, keys, nodes) for key in keys)
    spec = _specimen(entry) if "specimen" in entry.values else None
    values = {k: v for k, v in entry.values.items() if k not in ("kind", "command", "specimen", *keys)}
    try:
        element = build_element(kind, values, where=entry.where, specimen=spec)
    except InputError as error:
        key = error.field.removeprefix(f"{kind}.")
        if spec is not None and error.where == (spec.where or spec.id):
            key = "specimen"
        raise error.changed(field=entry.field(key), where=entry.where) from None
    command = entry.word("command") if "command" in entry.values else None
    return PlannedBranch(Branch(element, ends, command), element.command_unit)


def _end(entry: FileTable, key: str, keys: Sequence[str], nodes: Sequence[str]) -> str:
    if key not in entry.values:
        raise entry.fail(key, None, f"is missing: its ports are {', '.join(keys)}, and each leads to a node")
    end = entry.values[key]
    if end not in nodes:
        raise entry.fail(key, end, known=nodes)
    return str(end)


def _specimen(entry: FileTable) -> Specimen:
    wanted = entry.word("specimen")
    try:
        return specimen(wanted)
    except InputError as error:
        raise error.changed(field=entry.field("specimen"), where=entry.where) from None


FIT_KEYS = ("free", "start", "columns", "units", "pressure_zero")


@dataclass(frozen=True)
class FitTable:
    """The table ``fit`` of a circuit file; the command line adds to it."""

    free: tuple[str, ...] = ()
    start: dict[str, str | float] = field(default_factory=dict)
    columns: dict[str, str | int] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    pressure_zero: float = 0.0


def read_fit(entry: FileTable) -> FitTable:
    """The table as a value.

    Raises:
        InputError: names the key, its value and what is allowed.
    """
    entry.only(FIT_KEYS, "a fit has")
    free = entry.values.get("free", [])
    if not isinstance(free, list) or not all(isinstance(path, str) for path in free):
        raise entry.fail("free", str(free), "must be a list of dotted paths")
    return FitTable(
        free=tuple(free),
        start=_fit_words(entry, "start", (str, int, float), "a value in words"),
        columns=_fit_words(entry, "columns", (str, int), "the name or the number of a column"),
        units=_fit_words(entry, "units", (str,), "a unit in words"),
        pressure_zero=entry.number("pressure_zero", "Pa", 0.0),
    )


def _fit_words(entry: FileTable, key: str, kinds: tuple[type, ...], allowed: str) -> dict[str, Any]:
    values = entry.table(key).values
    for name, value in values.items():
        if not isinstance(value, kinds) or isinstance(value, bool):
            raise entry.fail(f"{key}.{name}", str(value), f"must be {allowed}")
    return dict(values)
