"""Rigs as TOML files (schema 1): one table per part, every value as text with its unit.

    schema = 1
    name = "paper"
    [computer]
    latency = "1 ms"
    [sensors.pressure]              # and the others of `sensors.SENSORS`: transducer, filter, converter
    low = "0 bar"
    high = "6.8 bar"
    cutoff = "500 Hz"
    [sensors.pressure.converter]
    bits = 8
    low = "0 bar"
    high = "6.8 bar"
    [plumbing.direct]               # one table for each way to join the pneumatic parts, the usual one first
    ...

Every key is a declared parameter of the part that it belongs to; ``inferred`` lists the dotted paths of those that no source
states. A specimen may be a file, and is looked for beside this one.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import os
from collections.abc import Callable, Mapping, Sequence
from importlib import resources
from typing import TYPE_CHECKING, Any, TypeVar, cast

from ..components import Environment, Module
from ..components.flow import FlowElement
from ..documents import JsonValue, parse_toml, path_text, read_toml, with_own_paths
from ..errors import InputError
from ..pneumatics.build import ELEMENTS, build_element, put_value
from ..pneumatics.volume import HeatModel, Isothermal, WallHeat
from ..quantities import Quantity, declared, named_values, parse
from ..recordings.calibration_file import read_calibration
from ..registry import load_reference, with_own_references
from ..schema import FileTable, read_table
from ..specimens import specimen
from .hardware.computer import Computer
from .hardware.converters import AnalogOut, Converter, Sensor
from .hardware.stand import Encoder, Frame, Motor
from .rig import DRIFT, OperatorAction, Plumbing, Rig, RigFaults
from .sensors import SENSORS, SensorKind
from .software.controllers import ForceControl, MotionEstimate, PositionControl, PressureControl
from .software.interlocks import SPAN_TOLERANCE, Interlocks

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SCHEMA = 1
T = TypeVar("T", bound="DataclassInstance")
DERIVED = ("name", "title", "source", "note")  # what a rig with a base states of itself
SECTIONS = (
    "schema", "name", "title", "source", "note", "inferred", "computer", "sensors", "encoder", "outputs", "motor",
    "frame", "plumbing", "control", "interlocks", "environment", "hands", "daq", "faults",
)  # fmt: skip
CONTROLLERS: dict[str, type[Any]] = {"pressure": PressureControl, "position": PositionControl, "force": ForceControl}
# Of the interlocks: from the frame, the sensors, the valve's converter and the motor.
FOLLOWS = (
    "shortest", "longest", "pressure_rail", "pressure_floor", "tension_rail", "tension_floor", "valve_range", "motor_force",
)  # fmt: skip
TRIPS, NEVER = ("trip_below", "trip_above"), (-math.inf, math.inf)  # of a sensor: keys, and what they are when left out
LENGTH = Quantity("m", (1e-3, 100.0), "span that the frame takes", "", (0.05, 1.0))


def rig_names() -> list[str]:
    """Names of the rigs that ship with the package, sorted."""
    folder = resources.files(__package__) / "rigs"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def rig(
    name: str | os.PathLike[str] | Rig,
    changes: Mapping[str, str | float] | None = None,
    calibration: str | os.PathLike[str] | None = None,
) -> Rig:
    """Load a rig by its name or by the path of a ``.toml`` file.

    Args:
        name: ``paper``, ``modern``, a path, or a rig that is to be changed.
        changes: by dotted path of the file, words such as ``{"plumbing.direct.tube.length": "1 m"}``, or numbers of what has
            no unit.
        calibration: file of the calibration of its measured channels.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.

    Examples:
        >>> import mckibben as mk
        >>> mk.rig("modern")
        Rig('modern': Test machine with 16-bit converters and a cell of 1 kN; muscles pull by a cord of 1000 N/cm)
        >>> float(mk.rig("paper", {"plumbing.direct.tube.length": "1 m"}).plumbing["direct"].tube.length)
        1.0
    """
    text = "" if isinstance(name, Rig) else path_text(name, "rig")
    if isinstance(name, Rig):
        document, where = copy.deepcopy(dict(name.document)), name.where or name.name
    elif text.lower().endswith(".toml") or os.sep in text:
        document, where = with_own_references(with_own_paths(read_toml(text, field="rig"), text), text), text
    elif text in (known := rig_names()):
        document, where = _shipped(text), f"{text}.toml"
    else:
        raise InputError("rig", text, "give the path of a .toml file or one of", known=known)
    if "base" in document:
        document = _derived(document, where)
    for path_, value in named_values(changes or {}, "changes").items():
        put_rig_value(document, path_, value, where)
    made = read_rig(document, where=where)
    if calibration is not None:
        return made.calibrated(read_calibration(calibration))
    return made.calibrated(name.calibration) if isinstance(name, Rig) else made


def _shipped(name: str) -> dict[str, JsonValue]:
    """Tables of a rig that ships with the package, without a base."""
    where = f"{name}.toml"
    text = (resources.files(__package__) / "rigs" / where).read_text(encoding="utf-8")
    document: dict[str, JsonValue] = parse_toml(text, where=where)
    return _derived(document, where) if "base" in document else document


def _derived(document: dict[str, JsonValue], where: str) -> dict[str, JsonValue]:
    top = FileTable.of(document, "", where)
    top.only(("schema", "base", "changes", "faults", *DERIVED))
    top.schema(SCHEMA)
    made = _shipped(top.word("base", among=tuple(rig_names())))
    changes = top.table("changes")
    for path in changes.values:
        put_rig_value(made, path, changes.word(path), where)
    own = {key: value for key, value in document.items() if key in DERIVED}
    return made | own | ({"faults": document["faults"]} if "faults" in document else {})


def read_rig(document: Mapping[str, JsonValue], *, where: str = "rig") -> Rig:
    """Read a rig from the tables of its file.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    top = FileTable.of(document, "", where)
    top.only(SECTIONS)
    top.schema(SCHEMA)
    sensors, outputs, control = top.table("sensors"), top.table("outputs"), top.table("control")
    _own_sensors(sensors)
    sensors.only(SENSORS)
    outputs.only(("valve", "motor"))
    control.only(("motion", *CONTROLLERS))
    frame = top.table("frame")
    motor = read_table(Motor, top.table("motor")) if "motor" in document else None
    bounds = [frame.number(key, "m", declared=LENGTH) for key in ("shortest", "longest")]
    room = read_table(Environment, top.table("environment"))
    layouts = top.table("plumbing")
    if not layouts.values:
        raise top.fail("plumbing", None, "is missing: one table for each way to join the pneumatic parts")
    hands = top.listed("hands")
    for table in hands:  # plumbing that an operator is asked to connect must be one of the file
        if "plumbing" in table:
            table.word("plumbing", among=tuple(layouts.values))
    interlocks = top.table("interlocks")  # but for the limits that follow from other parts
    interlocks.only([k for k in declared(Interlocks) if k not in FOLLOWS], "they have")
    if not bounds[0] < bounds[1]:
        raise frame.fail("longest", frame.values["longest"], f"must be more than {frame.values['shortest']}")
    if motor is not None and "motor" not in outputs.values:
        raise outputs.fail("motor", None, "is missing: a motor needs the converter that drives it")
    return Rig(
        name=top.word("name"),
        title=top.word("title"),
        source=top.text("source"),
        note=top.text("note"),
        inferred=_words(top, "inferred"),
        computer=read_table(Computer, top.table("computer")),
        sensors={name: _sensor(sensors.table(name), SENSORS[name].unit) for name in sensors.values},
        trips={name: t for name in sensors.values if (t := _trips(sensors.table(name), SENSORS[name].unit)) != NEVER},
        encoder=read_table(Encoder, top.table("encoder")) if "encoder" in document else None,
        valve_out=_channel_part(AnalogOut, outputs.table("valve"), "Pa"),
        motor_out=_channel_part(AnalogOut, outputs.table("motor"), "N") if motor is not None else None,
        motor=motor,
        frame=read_table(Frame, frame, beside=("shortest", "longest")),
        shortest=bounds[0],
        longest=bounds[1],
        plumbing={name: _plumbing(layouts.table(name), room) for name in layouts.values},
        motion=read_table(MotionEstimate, control.table("motion")),
        **{name: _controller(control.table(name), kind) for name, kind in CONTROLLERS.items()},
        interlocks=read_table(
            Interlocks, interlocks, shortest=bounds[0] - SPAN_TOLERANCE, longest=bounds[1] + SPAN_TOLERANCE
        ),
        environment=room,
        faults=_faults(top.table("faults"), [*sensors.values, *(["span"] if "encoder" in document else [])]),
        hands=tuple(read_table(OperatorAction, table, owner="a hand has") for table in hands),
        document=document,
        where=where,
    )


def with_control(on: Rig, control: Mapping[str, JsonValue], *, where: str) -> Rig:
    """Return a rig with the controllers that a protocol states in place of its own.

    Args:
        on: the rig.
        control: tables by ``pressure``, ``position`` and ``force``. One that names a ``controller`` replaces the rig's;
            another changes the gains that it states.
        where: the protocol, for error messages.

    Raises:
        InputError: there is no such controller, or it has no such parameter.
    """
    if not control:
        return on
    stated = dict(on.document.get("control", {}))
    for name, table in control.items():
        stated[name] = dict(table) if "controller" in table else {**stated.get(name, {}), **table}
    tables = FileTable(stated, "control", where)
    made = {name: _controller(tables.table(name), CONTROLLERS[name]) for name in control}
    replaced = set()
    for name, table in control.items():
        keys = (*on.document.get("control", {}).get(name, {}), *table) if "controller" in table else table
        replaced |= {f"control.{name}.{key}" for key in keys}
    inferred = tuple(path for path in on.inferred if path not in replaced)
    document = {**on.document, "control": stated, "inferred": list(inferred)}
    return dataclasses.replace(on, **made, document=document, inferred=inferred)


def _channel_part(kind: type[T], table: FileTable, unit: str, **parts: Any) -> T:
    return read_table(kind, table, units=dict.fromkeys(("low", "high", "offset", "noise"), unit), **parts)


def _own_sensors(sensors: FileTable) -> None:
    """Declare the sensors whose ``kind`` is of a file of the user's own, such as ``my.py:GAS_TEMPERATURE``."""
    for name in sensors.values:
        table = sensors.table(name)
        if "kind" not in table:
            continue
        reference = table.word("kind")
        kind = load_reference(reference, field=table.field("kind"), where=table.where or None)
        if not isinstance(kind, SensorKind):
            said = f"{reference} must be a mckibben.bench.sensors.SensorKind"
            raise InputError(table.field("kind"), reference, "must be a sensor", where=table.where, sentence=said)
        SENSORS.put(name, kind)


def _controller(table: FileTable, usual: type[T]) -> T:
    """Read a controller of the bench, or the class of the user's own that stands in its place."""
    if "controller" not in table:
        return read_table(usual, table)
    reference = table.word("controller")
    kind = load_reference(reference, field=table.field("controller"), where=table.where or None)
    demand = f"a class derived from mckibben.components.Module with initial and step like those of {usual.__name__}"
    if not (isinstance(kind, type) and issubclass(kind, Module) and all(hasattr(kind, n) for n in ("initial", "step"))):
        said = f"{reference} must be {demand}"
        raise InputError(table.field("controller"), reference, f"must be {demand}", where=table.where, sentence=said)
    made: Any = read_table(kind, table.without("controller"))
    return cast(T, made)


def _faults(table: FileTable, channels: Sequence[str]) -> RigFaults:
    """Read the faults of the rig; only what it measures can drift."""
    faults: RigFaults = read_table(RigFaults, table, owner="a rig can have")
    for channel in faults.drifts():
        if channel not in channels:
            raise table.fail(
                f"{channel}{DRIFT}", None, f"is of a channel that the rig does not measure: {', '.join(channels)}"
            )
    return faults


def _sensor(table: FileTable, unit: str) -> Sensor:
    converter = _channel_part(Converter, table.table("converter"), unit)
    return _channel_part(Sensor, table.without("converter", "kind", *TRIPS), unit, converter=converter)


def _trips(table: FileTable, unit: str) -> tuple[float, float]:
    low, high = (table.number(key, unit, end) for key, end in zip(TRIPS, NEVER, strict=True))
    if not low < high:
        raise table.fail(TRIPS[1], table.values[TRIPS[1]], f"must be more than {TRIPS[0]}")
    return low, high


_PLUMBING = ("supply_pressure", "port_volume", "line_volume", "valve_accumulator", "muscle_accumulator")
_PARTS = ("valve", "tube", "shut_off", "leak")


def _plumbing(entry: FileTable, room: Environment) -> Plumbing:
    entry.only((*_PLUMBING, *_PARTS, "heat", "muscle", "about"))
    muscle = entry.flag("muscle", True)
    usual = {"valve": "pressure_regulator", "tube": "lumped_tube", "shut_off": "on_off_valve", "leak": "leak"}
    needed = ("valve", "tube")
    parts = {n: _element(entry.table(n), kind) for n, kind in usual.items() if n in needed or n in entry.values}
    plain = entry.derived({k: v for k, v in entry.values.items() if k in _PLUMBING})
    made: Plumbing = read_table(Plumbing, plain, heat=_heat(entry, room), has_muscle=muscle, **parts)
    if not muscle and not float(made.muscle_accumulator) > 0.0:
        raise entry.fail("muscle_accumulator", None, "is missing: without a muscle it takes its place")
    return made


# What another element than the usual must be to stand in its place, and whether it is that.
VALVE = "an element with the ports supply, outlet and exhaust, whose command is a gauge pressure (command_unit = 'Pa')"
REPLACEABLE: dict[str, tuple[str, Callable[[type[FlowElement]], bool]]] = {
    "pressure_regulator": (VALVE, lambda kind: len(kind.ports) == 3 and kind.command_unit == "Pa"),
    "lumped_tube": (
        "an element with two ports and no command", lambda kind: len(kind.ports) == 2 and not kind.commanded
    ),
}  # fmt: skip


def _element(entry: FileTable, kind: str) -> Any:
    """Read an element; where another may stand in its place, ``kind`` names that one."""
    spec = None
    if kind in REPLACEABLE and "kind" in entry:
        demand, fits = REPLACEABLE[kind]
        kind = entry.word("kind")
        if not fits(ELEMENTS.find(kind, field=entry.field("kind"), where=entry.where)):
            raise entry.fail("kind", kind, f"must be {demand}")
        entry = entry.without("kind")
    if "specimen" in entry.values:
        try:
            spec = specimen(entry.word("specimen"))
        except InputError as error:
            raise error.changed(field=entry.field("specimen"), where=entry.where) from None
    values = {k: v for k, v in entry.values.items() if k != "specimen"}
    try:
        return build_element(kind, values, where=entry.where, specimen=spec)
    except InputError as error:
        key = error.field.removeprefix(f"{kind}.")
        raise error.changed(field=entry.field(key), where=entry.where) from None


def _heat(entry: FileTable, room: Environment) -> HeatModel:
    """Read ``isothermal``, ``adiabatic``, or the conductance to the walls of each volume."""
    word = entry.word("heat", "0.2 W/K")
    if word == "isothermal":
        return Isothermal()
    if word == "adiabatic":
        return WallHeat(conductance=0.0, wall_temperature=room.temperature)
    q = declared(WallHeat)["conductance"]
    try:
        value = parse(word, q.unit, field=entry.field("heat"), where=entry.where)
    except InputError:
        raise entry.fail("heat", word, "must be isothermal, adiabatic, or a conductance such as '0.2 W/K'") from None
    q.check(entry.field("heat"), value, where=entry.where)
    return WallHeat(conductance=value, wall_temperature=room.temperature)


def _words(entry: FileTable, key: str) -> tuple[str, ...]:
    paths = entry.texts(key, "must be a list of dotted paths")
    for path in paths:
        at: Any = entry.values
        for part in path.split("."):
            if not isinstance(at, Mapping) or part not in at:
                raise entry.fail(key, path, "nothing of that path is stated in the file")
            at = at[part]
    return paths


def put_rig_value(document: dict[str, JsonValue], path: str, value: Any, where: str) -> None:
    """Replace a value in the tables of a rig's file; whole numbers and truth values may be written as text.

    Raises:
        InputError: the path leads through a value that is no table.
    """
    *tables, last = path.split(".")
    at: Any = document
    for part in tables:
        at = at.setdefault(part, {})
        if not isinstance(at, dict):
            raise InputError(path, value, f"{part} is no table", where=where)
    if tables[:1] != ["plumbing"] or tables[2:] not in [[part] for part in _PARTS]:
        at[last] = _plain(value)
        return
    new = put_value(at, last, _plain(value))
    gone = {".".join([*tables, key]) for key in at if key not in new}
    document["inferred"] = [p for p in document.get("inferred", []) if p not in gone]
    at.clear()
    at.update(new)


def _plain(text: Any) -> Any:
    if not isinstance(text, str):
        return text  # a number of Python, of which `int` would cut the fraction off
    if text in ("true", "false"):
        return text == "true"
    try:
        return int(text)
    except ValueError:
        return text
