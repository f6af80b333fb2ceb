"""Machines from specimens: single muscles, antagonist pairs on a joint, any number on a shared supply.

Values that no source prints are inferred, and stand in `INFERRED` with their range. Each muscle has a line: a valve between
supply, its port and the room, and a tube from the port to the muscle.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any, Final, Literal, NamedTuple

from ..components import Environment, MemoryElement, paths
from ..components.flow import FlowElement
from ..documents import JsonValue
from ..errors import InputError, each_once, refuse_unknown
from ..muscles import Muscle
from ..muscles.build import at_rest_length
from ..muscles.dimensions import REST_LENGTH
from ..muscles.elements import Tendon
from ..muscles.law import THREAD_STRAIN, law_name
from ..muscles.muscle import built_muscle
from ..muscles.plausible import LARGEST_STRAIN, largest_strain
from ..pneumatics.circuit import Branch, Circuit
from ..pneumatics.orifice import Orifice
from ..pneumatics.tubes import LumpedTube
from ..pneumatics.volume import Chamber, FixedVolume, HeatModel, MovingVolume, Reservoir, WallHeat
from ..quantities import Quantity, parse, with_unit
from ..specimens import Specimen, muscle_specimen
from .loads import JointLoad, Load, MomentArm
from .machine import Machine
from .muscle_unit import SLACK_TIME, STOP_TRAVEL, MuscleUnit, Wrap


class InferredNumber(NamedTuple):
    """A number that no source prints: value [SI], the range in which it may lie, and where it comes from."""

    value: float
    range: tuple[float, float]
    note: str


INFERRED: dict[str, InferredNumber] = {
    "end_mass": InferredNumber(0.02, (0.005, 0.1), "kg; a fitting of a muscle of 1 cm diameter, before a tendon"),
    "viscosity": InferredNumber(
        0.2,
        (0.0, 1.0),
        "N s/m; 0.35 would add a count of the paper's cell at 8 L0/s, and nothing viscous was seen there",
    ),
    "stop_damping": InferredNumber(100.0, (10.0, 300.0), "N s/m; a braid pulled taut does not bounce"),
    "stop_travel": InferredNumber(STOP_TRAVEL, (3e-4, 3e-3), "m; over which a braid is pulled taut"),
    "tendon_stiffness": InferredNumber(1e5, (3e4, 1e6), "N/m; a cord of 20 cm and the frame of the test machine"),
    "tendon_toe": InferredNumber(5e-4, (1e-4, 2e-3), "m; the stretch over which that cord stiffens"),
    "tendon_loss": InferredNumber(0.2, (0.0, 1.0), "s/m; that cord, taut, hardly rings"),
    "port_volume": InferredNumber(2e-6, (1e-6, 1e-5), "m^3; the valve's outlet and fittings"),
    "heat_conductance": InferredNumber(0.2, (0.05, 1.0), "W/K; between adiabatic and isothermal"),
    "tube_length": InferredNumber(0.5, (0.1, 2.0), "m; what the printed times of the nylon muscle allow"),
    "tube_diameter": InferredNumber(3.175e-3, (2e-3, 6e-3), "m; 1/8 inch"),
    "valve_flow": InferredNumber(
        105e-3 / 60.0,
        (1.6e-3, 2.1e-3),
        "m^3/s at 6.9 bar; printed delay and rise of the nylon muscle with isothermal gas",
    ),
    "valve_flow_pressure": InferredNumber(6.9e5, (6e5, 7e5), "Pa; where that flow is meant"),
}
LINE_VALVE = "an element with the ports supply, work and exhaust that a command drives"
Valve = FlowElement | tuple[Orifice, Orifice]


def is_line_valve(valve: object) -> bool:
    """Whether an element can stand between a supply, one muscle and the exhaust: three ports, and a command."""
    if not isinstance(valve, FlowElement):
        return False
    return len(valve.ports) == 3 and (valve.commanded or valve.command_unit != "1")


def _usual(name: str) -> float:
    return INFERRED[name].value


def rig_cord() -> Tendon:
    """The cord between a muscle and the load of the paper's test machine; its numbers are `INFERRED`."""
    return Tendon(stiffness=_usual("tendon_stiffness"), toe_length=_usual("tendon_toe"), loss=_usual("tendon_loss"))


def unit_from_specimen(
    spec: Specimen | str | os.PathLike[str],
    *,
    law: str | None = None,
    friction: str | None = None,
    rubs: bool = True,
    creep: MemoryElement | None = None,
    tendon: Tendon | None = None,
    wrap: Wrap | None = None,
    changes: Mapping[str, JsonValue] | None = None,
    **mechanics: float,
) -> MuscleUnit:
    """A muscle from a specimen, tied to its anchors unless it has a tendon; what the specimen does not state is `INFERRED`.

    Args:
        spec: a McKibben specimen, its id, or its file.
        law: one of the laws it states; its default law by default.
        friction: one of the frictions it states; where left out Maxwell-slip, and if only Coulomb's is stated, Maxwell-slip
            elements with its limit, since a friction without memory chatters at rest.
        rubs: False for a muscle without friction.
        creep: viscoelastic elements beside the braid.
        tendon: between the muscle and the load; none by default, as `rig_cord` is that of the test machine.
        wrap: a bone that the muscle lies over.
        changes: parameters of the law to replace, by field name [SI].
        **mechanics: as `unit_from_muscle` has them.

    Raises:
        InputError: if the specimen is no McKibben muscle, or states something else than what was requested.
    """
    stated = spec if isinstance(spec, Specimen) else muscle_specimen(spec)
    if stated.kind != "mckibben":
        raise InputError("specimen", stated.id, f"must be a McKibben muscle; it is {stated.kind}", where=stated.where)
    chosen = built_muscle(stated, law=law, friction=friction, creep=creep, **dict(changes or {}))
    where = stated.where or stated.id
    return unit_from_muscle(chosen, rubs=rubs, tendon=tendon, wrap=wrap, where=where, **mechanics)


def unit_parameter(unit: MuscleUnit, path: str) -> Quantity:
    """The declaration of a muscle's parameter by its path; every specimen has a rest length, also where its law has none."""
    path = _full_path(unit, path)
    return REST_LENGTH if path == "law.rest_length" else paths.declaration(unit, path)


def _full_path(unit: MuscleUnit, path: str) -> str:
    """The path of a parameter, of which one of the law may lack ``law.``, as it does where no unit is around the law."""
    known = {"law.rest_length", *(name for name, _ in paths.parameters(unit))}
    return f"law.{path}" if path not in known and f"law.{path}" in known else path


def with_parameters(
    spec: Specimen | None, unit: MuscleUnit, values: Mapping[str, float | str], *, law: str | None = None
) -> tuple[Specimen | None, MuscleUnit]:
    """Replace parameters of a muscle by their paths; another rest length cuts it, see `muscles.build.at_rest_length`.

    Args:
        spec: of which the muscle was built, if it was.
        unit: the muscle.
        values: by path, such as ``law.rest_length``: numbers [SI] or text with a unit.
        law: with which it was built; its default law if left out.

    Raises:
        InputError: a path is unknown, or a value out of bounds, as ``muscle.PATH``.
    """
    others: dict[str, float] = {}
    for path, value in values.items():
        declared = unit_parameter(unit, path)
        number = parse(value, declared.unit, field=f"muscle.{path}") if isinstance(value, str) else value
        declared.check(f"muscle.{path}", number)
        full = each_once("parameters of the muscle", [*others, _full_path(unit, path)])[-1]
        others[full] = number
    if "law.rest_length" in others:
        if spec is None:
            raise InputError("muscle.law.rest_length", None, "is allowed only of a specimen, which is cut to it")
        name = law or spec.law
        spec, _ = at_rest_length(spec, name, {"rest_length": others.pop("law.rest_length")})
        unit = unit_from_specimen(spec, law=name, tendon=unit.tendon)
    changed: MuscleUnit = paths.put(unit, others)
    return spec, changed


def unit_from_muscle(
    muscle: Muscle,
    *,
    rubs: bool = True,
    tendon: Tendon | None = None,
    wrap: Wrap | None = None,
    where: str | None = None,
    **mechanics: float,
) -> MuscleUnit:
    """A muscle tied to its anchors, or between an end mass and a tendon; what is left out is `INFERRED`.

    Args:
        muscle: its law, friction and creep; no biological one.
        rubs: False for a muscle without friction.
        tendon: between the muscle and the load; none by default.
        wrap: a bone that the muscle lies over.
        where: place used in a complaint.
        **mechanics: ``viscosity`` and ``stop_damping`` [N s/m], ``stop_travel`` [m]; with a tendon ``end_mass`` [kg],
            without one ``slack_damping`` [N s/m], which follows from the law where it is left out; ``largest_strain`` [1],
            as the specimen states it.

    Raises:
        InputError: if the muscle is biological, or states something else than what was asked for.
    """
    if muscle.is_biological:
        raise InputError("muscle", muscle.title, "must be a McKibben muscle; it is biological", where=where)
    usual: dict[str, Any] = {name: _usual(name) for name in ("viscosity", "stop_damping", "stop_travel")}
    usual["largest_strain"] = largest_strain(muscle.specimen)
    usual |= {"slack_damping": None} if tendon is None else {"end_mass": _usual("end_mass")}
    for name in mechanics:
        if name in ("end_mass", "slack_damping") and name not in usual:
            one = "a muscle without tendon has none" if tendon is None else "a muscle with a tendon has none"
            raise InputError(name, None, f"must be left out: {one}", where=where)
    refuse_unknown(mechanics, usual, where=where)
    return MuscleUnit(
        law=muscle.law,
        tendon=tendon,
        friction=muscle.friction if rubs else None,
        creep=muscle.creep,
        wrap=wrap,
        **(usual | mechanics),
    )


def rig_unit(muscle: MuscleUnit | Muscle | Specimen | str, *, law: str | None = None) -> MuscleUnit:
    """A muscle on a test rig, which holds it by `rig_cord`; a unit stays as it is, with the tendon that it has or has not.

    Args:
        muscle: a unit, a muscle, or a specimen or its id.
        law: one of the laws that a specimen states; its default law by default.
    """
    if isinstance(muscle, MuscleUnit):
        return muscle
    if isinstance(muscle, Muscle):
        return unit_from_muscle(muscle, tendon=rig_cord())
    return unit_from_specimen(muscle, law=law, tendon=rig_cord())


NO_TUBE: Final = "none"  # stands for a valve that sits on its muscle


class AirLine(NamedTuple):
    """Components between the supply and one muscle; omitted ones are `INFERRED`.

    Attributes:
        valve: an element with the ports supply, work and exhaust, driven by the signal ``<muscle>.valve``; or two
            restrictions, fill and vent, driven by ``<muscle>.fill`` and ``<muscle>.vent``.
        tube: between the valve's port and the muscle; ``"none"`` for a valve that sits on the muscle.
        port_volume: at the valve [m^3]; without a tube it belongs to the muscle's.
        heat: heat of the gas in port and muscle.
        dead_volume: volume of the muscle's fittings [m^3].
    """

    valve: Valve | None = None
    tube: FlowElement | Literal["none"] | None = None
    port_volume: float | None = None
    heat: HeatModel | None = None
    dead_volume: float = 0.0


def circuit_for(
    units: Mapping[str, MuscleUnit],
    *,
    supply: Reservoir | float,
    line: AirLine | Mapping[str, AirLine] = AirLine(),  # noqa: B008
    environment: Environment | None = None,
    tank: Chamber | None = None,
    feed: FlowElement | None = None,
) -> Circuit:
    """A supply, and a line to each muscle.

    The nodes are ``supply``, ``room``, ``<muscle>.port`` and ``<muscle>``, and ``tank`` where there is one.

    Args:
        units: the muscles by name.
        supply: a reservoir, or its gauge pressure [Pa].
        line: line of every muscle, or by the name of each.
        environment: the room.
        tank: a volume behind the supply that the muscles share, so that they feel each other.
        feed: from the supply to the tank, needed with one.

    Raises:
        InputError: if a muscle has no line, a valve has other ports, or tank and feed do not come together.
    """
    room = environment or Environment()
    source = supply
    if not isinstance(source, Reservoir):
        source = Reservoir(pressure_abs=source + room.pressure_abs, temperature=room.temperature)
    if (tank is None) != (feed is None):
        missing, other = ("feed", "tank") if feed is None else ("tank", "feed")
        raise InputError(missing, None, f"is missing: it goes together with {other}", where="circuit")
    nodes: dict[str, Reservoir | Chamber] = {
        "supply": source,
        "room": Reservoir(pressure_abs=room.pressure_abs, temperature=room.temperature),
    }
    branches: dict[str, Branch] = {}
    if tank is not None and feed is not None:
        nodes["tank"] = tank
        branches["feed"] = Branch(feed, ("supply", "tank"))
    for name, unit in units.items():
        parts = line if isinstance(line, AirLine) else line.get(name)
        if parts is None:
            raise InputError(f"line of {name}", None, "is missing: every muscle needs one", where="circuit")
        _add(nodes, branches, name, unit, parts, room, "supply" if tank is None else "tank")
    return Circuit.of(nodes, branches)


def _add(
    nodes: dict[str, Reservoir | Chamber],
    branches: dict[str, Branch],
    name: str,
    unit: MuscleUnit,
    line: AirLine,
    room: Environment,
    source: str,
) -> None:
    direct = line.tube == NO_TUBE
    port = name if direct else f"{name}.port"
    wall = WallHeat(conductance=_usual("heat_conductance"), wall_temperature=room.temperature)
    heat = wall if line.heat is None else line.heat
    size = _usual("port_volume") if line.port_volume is None else line.port_volume
    if not direct:
        nodes[port] = FixedVolume(volume=size, heat=heat)
    dead_volume = line.dead_volume + size if direct else line.dead_volume
    nodes[name] = MovingVolume(
        of=unit.law.braid_volume, ambient=room.pressure_abs, dead_volume=dead_volume, heat=heat, signal=f"{name}.length"
    )
    valve = line.valve
    if valve is None:
        usual = Orifice.from_flow(_usual("valve_flow"), pressure=_usual("valve_flow_pressure"))
        valve = (usual, usual)
    if isinstance(valve, tuple):
        branches[f"{name}.fill"] = Branch(valve[0], (source, port), f"{name}.fill")
        branches[f"{name}.vent"] = Branch(valve[1], (port, "room"), f"{name}.vent")
    elif is_line_valve(valve):
        branches[f"{name}.valve"] = Branch(valve, (source, port, "room"), f"{name}.valve")
    else:
        demand = f"must be {LINE_VALVE}, or two orifices"
        raise InputError(f"valve of {name}", type(valve).__name__, demand, where="circuit")
    if isinstance(line.tube, str):
        return
    tube = line.tube or LumpedTube(
        length=_usual("tube_length"), diameter=_usual("tube_diameter"), wall_temperature=room.temperature
    )
    branches[f"{name}.tube"] = Branch(tube, (port, name))


def single_muscle(
    unit: MuscleUnit | Specimen | str,
    load: Load,
    *,
    supply: Reservoir | float,
    environment: Environment | None = None,
    **line: JsonValue,
) -> Machine:
    """Build a machine of one muscle, under the name that the load gives it; for other arguments see `AirLine`."""
    names = load.muscles()
    if len(names) != 1:
        raise InputError("load", ", ".join(names), "must hold one muscle", where="single muscle")
    return several({names[0]: unit}, load, supply=supply, line=_line(line), environment=environment)


def antagonist_pair(
    flexor: MuscleUnit | Specimen | str,
    extensor: MuscleUnit | Specimen | str,
    *,
    supply: Reservoir | float,
    flexor_arm: MomentArm,
    extensor_arm: MomentArm,
    inertia: float,
    joint: Mapping[str, JsonValue] | None = None,
    environment: Environment | None = None,
    **line: JsonValue,
) -> Machine:
    """Build a machine of two muscles, ``flexor`` and ``extensor``, around a joint.

    Args:
        flexor: turns the joint to positive angles.
        extensor: turns it back.
        supply: a reservoir, or its gauge pressure [Pa].
        flexor_arm: moment arm, positive at angle zero.
        extensor_arm: moment arm, negative at angle zero.
        inertia: about the axis [kg m^2].
        joint: what else `JointLoad` has, by name.
        environment: the room.
        **line: as `AirLine` has it, for both.

    Raises:
        InputError: if the moment arms do not have opposite signs.
    """
    for name, arm, sign in (("flexor", flexor_arm, 1.0), ("extensor", extensor_arm, -1.0)):
        at = float(arm.arm(0.0))
        if not sign * at > 0.0:
            demand = f"must be {'a positive' if sign > 0.0 else 'a negative'} moment arm at angle zero [m]"
            raise InputError(f"{name}_arm", at, demand, where="antagonist pair")
    load = JointLoad(arms={"flexor": flexor_arm, "extensor": extensor_arm}, inertia=inertia, **dict(joint or {}))
    units = {"flexor": flexor, "extensor": extensor}
    return several(units, load, supply=supply, line=_line(line), environment=environment)


def several(
    units: Mapping[str, MuscleUnit | Specimen | str],
    load: Load,
    *,
    supply: Reservoir | float,
    line: AirLine | Mapping[str, AirLine] = AirLine(),  # noqa: B008
    environment: Environment | None = None,
    tank: Chamber | None = None,
    feed: FlowElement | None = None,
) -> Machine:
    """Any number of muscles on one supply; the arguments are those of `circuit_for` and `unit_from_specimen`."""
    built = {n: u if isinstance(u, MuscleUnit) else unit_from_specimen(u) for n, u in units.items()}
    circuit = circuit_for(built, supply=supply, line=line, environment=environment, tank=tank, feed=feed)
    return Machine.of(circuit, built, load, environment)


def _line(options: Mapping[str, Any]) -> AirLine:
    refuse_unknown(options, AirLine._fields, "a line has", where="line")
    return AirLine(**options)


# ---- numbers in a system that nobody stated for it


class Assumption(NamedTuple):
    """A number that was left at its default."""

    parameter: str  # dotted path, or the name of the argument
    value: float  # [unit]
    unit: str  # SI unit
    note: str  # where it comes from, one phrase

    def __str__(self) -> str:
        return f"{self.parameter} {with_unit(self.value, self.unit)}"


def inferred_assumption(parameter: str, key: str) -> Assumption:
    """The assumption of one of the numbers of `INFERRED`."""
    stated = INFERRED[key]
    unit, _, note = stated.note.partition("; ")
    low, high = stated.range
    return Assumption(parameter, stated.value, unit.split(" at ")[0].replace(" ", "*"), f"{note}; {low:g} to {high:g}")


def unit_assumptions(
    name: str, unit: MuscleUnit, muscle: str | Specimen | Muscle, *, usual_tendon: bool
) -> tuple[Assumption, ...]:
    """What a muscle that was named by its specimen or law has beside it.

    Args:
        name: of the muscle.
        unit: the muscle in a machine.
        muscle: as it was named; what it or its file states was not assumed.
        usual_tendon: whether only the stiffness of its tendon was stated.
    """
    # What a person has stated of a muscle, or its file does, was not assumed
    law = law_name(unit.law)
    spec = muscle if isinstance(muscle, Specimen) else muscle.specimen if isinstance(muscle, Muscle) else None
    spec = muscle_specimen(muscle) if isinstance(muscle, str) else spec
    of_file = set() if spec is None else {*spec.properties, *spec.laws.get(law, {})}
    at, stated = f"units.{name}", of_file | set(muscle.stated if isinstance(muscle, Muscle) else ())
    made = [inferred_assumption(f"{at}.{key}", key) for key in ("viscosity", "stop_damping", "stop_travel")]
    for field, value, usual, note in (
        ("largest_strain", unit.largest_strain, LARGEST_STRAIN, "beyond the longest length; where aramid yarn breaks"),
        ("law.thread_strain", unit.law.thread_strain, THREAD_STRAIN, "of the threads at 10 bar, a seventh of that"),
    ):
        if float(value) == usual and field.rpartition(".")[2] not in stated:
            made.append(Assumption(f"{at}.{field}", usual, "1", note))
    if unit.tendon is None:
        note = f"what relaxes the slack braid in {with_unit(SLACK_TIME, 's')} where it is stiffest"
        return (*made, Assumption(f"{at}.slack_damping", float(unit.slack_damping), "N*s/m", note))
    made.append(inferred_assumption(f"{at}.end_mass", "end_mass"))
    if usual_tendon:
        made += [
            inferred_assumption(f"{at}.tendon.{n}", f"tendon_{k}") for n, k in (("toe_length", "toe"), ("loss", "loss"))
        ]
    return tuple(made)


def assumption_table(assumptions: Iterable[Assumption]) -> dict[str, JsonValue]:
    """Assumptions as a table of a recording's metadata or a description."""
    return {a.parameter: {"value": a.value, "unit": a.unit, "note": a.note} for a in assumptions}
