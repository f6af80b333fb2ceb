"""The air of a simulation: a supply, and for each muscle a valve and a tube; or a circuit from a file."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from .._jax import Tree
from ..answers import Caution, brief, collect
from ..assembly.build import (
    INFERRED,
    LINE_VALVE,
    NO_TUBE,
    AirLine,
    Assumption,
    circuit_for,
    inferred_assumption,
    is_line_valve,
)
from ..assembly.circuit_file import CircuitPlan, driven, read_circuit
from ..assembly.muscle_unit import MuscleUnit
from ..components import Environment
from ..components.flow import FlowElement
from ..errors import InputError
from ..muscles.plausible import LEAST_PRESSURE, argument_cautions, pressure_caution, room_caution
from ..pneumatics.build import build_element, valve_from_specimen
from ..pneumatics.circuit import Circuit
from ..pneumatics.orifice import Orifice
from ..pneumatics.tubes import LumpedTube
from ..pneumatics.valves import PressureRegulator
from ..pneumatics.volume import HeatModel, MovingVolume, WallHeat
from ..quantities import amount, with_unit
from ..registry import is_reference, named_by_person
from ..slips import size_caution
from ..specimens import specimen, specimen_ids
from ..specimens.parts import bore_of
from .mechanisms import Amount, Stated, in_si
from .stepping import CommandInput

REGULATOR = "regulator"  # a valve that is none of a catalogue: a fast proportional regulator of usual size
REGULATOR_BAND = 0.2e5  # error at which it is fully open [Pa]
REGULATOR_LAG = 2e-3  # [s]
USUAL_TUBE = INFERRED["tube_length"].value, INFERRED["tube_diameter"].value  # [m]
USUAL_PORT = INFERRED["port_volume"].value  # [m^3]
USUAL_HEAT = INFERRED["heat_conductance"].value  # [W/K]
FREE = (-math.inf, math.inf)
TUBE_LENGTHS, TUBE_BORES = (1e-2, 100.0), (5e-4, 0.1)  # that are usual [m]


class AirCircuit(NamedTuple):
    """A circuit that supplies the muscles of a mechanism.

    Attributes:
        circuit: with a node of each muscle's name.
        drives: the commands of its valves and sources.
        starts: gauge pressures of chambers at the start, where the circuit states them [Pa].
        feeding: for each other chamber the muscle whose pressure it has at the start.
        begins: commands at the start, where the circuit states them [SI].
        settles: commands that begin at the gauge pressure of a muscle, by the muscle's name.
        environment: the surroundings.
        document: what a recording says of it.
        assumptions: what was left at a default.
        cautions: what can hardly be meant.
    """

    circuit: Circuit
    drives: tuple[CommandInput, ...]
    starts: dict[str, float]
    feeding: dict[str, str]
    begins: dict[str, float]
    settles: dict[str, str]
    environment: Environment
    document: dict[str, Any]
    assumptions: tuple[Assumption, ...] = ()
    cautions: tuple[Caution, ...] = ()

    def __repr__(self) -> str:
        return brief(self)


@dataclass(frozen=True)
class Air(Stated):
    """A supply, and for each muscle a valve and a tube of its own.

        mk.Air(supply="6 bar", valve="mpye-5-1/8", tube=("1 m", "4 mm"))

    The name of a muscle commands its valve: ``sim.step(flexor=0.3)``. A spool valve fills from 0 to 1 and vents from 0 to
    -1, a 3/2 valve fills at 1, a regulator takes the gauge pressure [Pa]. What is left at its default is among the
    `assumptions` of a simulation.

    Args:
        supply: gauge pressure [Pa].
        valve: id of a published valve, such as ``"MPYE-5-1-8-LF"`` (without LF or HF, the one of low flow); ``"regulator"``
            for a fast proportional regulator (105 l/min at 6.9 bar, fully open at an error of 0.2 bar, lag 2 ms); the path
            of a specimen's file; a class in a file such as ``"my.py:MyValve"``; or an element with the ports supply, work
            and exhaust.
        tube: length and bore [m] of the tube from each valve to its muscle, the bore perhaps by the name of a tube such as
            ``"PU-4x2"``; or an element with two ports; or ``"none"`` for a valve that sits on the muscle.
        port_volume: between valve and tube [m^3]; None for the default, as for tube and heat.
        heat: how the gas in ports and muscles exchanges heat: a conductance of the wall [W/K], or a model of heat.
        environment: the room.

    Examples:
        >>> import mckibben as mk
        >>> mk.Air(supply="6 bar", valve="mpye-5-1/8", tube=("1 m", "4 mm")).supply
        '6 bar'
    """

    supply: Amount = amount("Pa", (LEAST_PRESSURE, 3e6), default=6e5)
    valve: str | FlowElement = "MPYE-5-1-8-LF"
    tube: tuple[Amount, Amount] | FlowElement | Literal["none"] | None = USUAL_TUBE
    port_volume: Amount | None = amount("m^3", (1e-8, 1e-3), default=USUAL_PORT)
    heat: Amount | HeatModel | None = amount("W/K", (1e-3, 50.0), default=USUAL_HEAT)
    environment: Environment | None = None

    def build(self, units: Mapping[str, MuscleUnit]) -> AirCircuit:
        """The circuit of some muscles.

        Raises:
            InputError: names what does not fit.
        """
        room = Environment() if self.environment is None else self.environment
        if not isinstance(room, Environment):
            raise InputError("environment", None, f"must be an Environment, got {room!r}")
        valve = self._valve()
        supply, vacuum = self.si("supply"), -float(room.pressure_abs)
        if not supply >= vacuum:
            problem = f"must be a gauge pressure of vacuum, {with_unit(vacuum, 'Pa')}, or more"
            raise InputError("supply", with_unit(supply, "Pa"), problem)
        line = AirLine(
            valve=valve,
            tube=self._tube(room),
            heat=self._heat(room),
            port_volume=None if self.port_volume is None else self.si("port_volume"),
        )
        circuit = circuit_for(units, supply=supply, line=line, environment=room)
        unit = valve.command_unit
        meaning = "gauge pressure asked of the valve of" if unit == "Pa" else "command of the valve of"
        return AirCircuit(
            circuit=circuit,
            drives=tuple(
                CommandInput(
                    name,
                    f"{name}.valve",
                    unit=unit,
                    meaning=f"{meaning} {name}",
                    range=valve.command_range,
                    hard=not valve.saturates,
                )
                for name in units
            ),
            starts={},
            feeding={f"{name}.port": name for name in units},
            begins={},
            settles={name: name for name in units} if unit == "Pa" else {},
            environment=room,
            document=self._document(supply),
            assumptions=self._assumptions(),
            cautions=self._cautions(supply),
        )

    def _assumptions(self) -> tuple[Assumption, ...]:
        # the very objects that are the defaults: who states a number that equals one has not left it out
        made = [
            inferred_assumption(f"air.{name.replace('_', '.') if name.startswith('tube') else name}", name)
            for name, left in (
                ("tube_length", self.tube is None or self.tube is USUAL_TUBE),
                ("tube_diameter", self.tube is None or self.tube is USUAL_TUBE),
                ("port_volume", self.port_volume is None or self.port_volume is USUAL_PORT),
                ("heat_conductance", self.heat is None or self.heat is USUAL_HEAT),
            )
            if left
        ]
        if self.valve == REGULATOR:
            made += [
                inferred_assumption("air.valve.flow", "valve_flow"),
                Assumption("air.valve.band", REGULATOR_BAND, "Pa", "error of the pressure at which it is fully open"),
                Assumption("air.valve.lag", REGULATOR_LAG, "s", "lag of its set-point"),
            ]
        return tuple(made)

    def _cautions(self, supply: float) -> tuple[Caution, ...]:
        """What can hardly be meant, among it a supply that inflates nothing."""
        said: list[Caution | None] = [*argument_cautions(self), room_caution(self.environment or Environment())]
        if supply <= 0.0:
            said.append(Caution(f"a supply of {with_unit(supply, 'Pa')} inflates no muscle", "supply"))
        elif not any(one is not None and one.parameter == "supply" for one in said):
            said.append(pressure_caution(supply, text=str(self.supply), name="supply"))
        if isinstance(self.tube, tuple | list):
            length, bore = self.tube
            said.append(size_caution(length, "m", name="length of the tube", usual=TUBE_LENGTHS))
            if bore_of(bore) is None:
                said.append(size_caution(bore, "m", name="bore of the tube", usual=TUBE_BORES))
        return collect(*said)

    def _valve(self) -> FlowElement:
        if not isinstance(self.valve, str):
            if not is_line_valve(self.valve):
                raise InputError("valve", type(self.valve).__name__, f"must be the id of a valve, or {LINE_VALVE}")
            return self.valve
        if self.valve == REGULATOR:
            flow = Orifice.from_flow(INFERRED["valve_flow"].value, pressure=INFERRED["valve_flow_pressure"].value)
            return PressureRegulator(fill=flow, relief=flow, band=REGULATOR_BAND, lag=REGULATOR_LAG)
        named_by_person(self.valve)
        own = is_reference(self.valve)
        built = build_element(self.valve, {}) if own else valve_from_specimen(specimen(published_valve(self.valve)))
        if not is_line_valve(built):
            raise InputError("valve", self.valve, f"must be {LINE_VALVE}")
        return built

    def _tube(self, room: Environment) -> FlowElement | Literal["none"] | None:
        if self.tube is None or isinstance(self.tube, FlowElement):
            return self.tube
        if isinstance(self.tube, str) and self.tube == NO_TUBE:
            return NO_TUBE
        if not isinstance(self.tube, tuple | list) or len(self.tube) != 2:
            raise InputError("tube", str(self.tube), "must be a length and a bore, such as ('1 m', '4 mm')")
        named = bore_of(self.tube[1])
        length = in_si(self.tube[0], "m", "length of the tube")
        diameter = in_si(self.tube[1], "m", "bore of the tube") if named is None else named
        sizes = {"length": f"{length!r} m", "diameter": f"{diameter!r} m"}
        tube = build_element("lumped_tube", sizes, where="tube")
        assert isinstance(tube, LumpedTube)
        return tube.replace(wall_temperature=room.temperature)

    def _heat(self, room: Environment) -> HeatModel | None:
        if self.heat is None or isinstance(self.heat, HeatModel):
            return self.heat
        return WallHeat(conductance=self.si("heat"), wall_temperature=room.temperature)

    def _document(self, supply: float) -> dict[str, Tree]:
        valve = published_valve(self.valve) if isinstance(self.valve, str) else type(self.valve).__name__
        return {"supply": with_unit(supply, "Pa"), "valve": valve}


def published_valve(name: str) -> str:
    """The id of a published valve from the name that its maker prints; a size without its flow means the low one.

    Raises:
        InputError: there is none; names the nearest.
    """
    if name == REGULATOR or name.endswith(".toml") or is_reference(name):
        return name
    known = {one.lower(): one for one in specimen_ids("valve")}
    wanted = name.strip().lower().replace("/", "-")
    choices = [wanted, f"{wanted}-lf"]
    found = next((known[one] for one in choices if one in known), None)
    if found is None:
        raise InputError("valve", name, known=[*known.values(), REGULATOR])
    return found


def air_circuit(air: object, units: Mapping[str, MuscleUnit]) -> AirCircuit:
    """The circuit of some muscles from an `Air`, a plan, or the path of a circuit file; None stands for the usual air.

    Raises:
        InputError: the file is no circuit, or lacks a muscle.
    """
    if air is None or isinstance(air, Air):
        return (air or Air()).build(units)
    if isinstance(air, str | os.PathLike):
        air = read_circuit(Path(air))
    if not isinstance(air, CircuitPlan):
        raise InputError("air", type(air).__name__, "must be an Air, or the path of a circuit file")
    return _planned(air, units)


def _planned(plan: CircuitPlan, units: Mapping[str, MuscleUnit]) -> AirCircuit:
    """A circuit file whose nodes of the kind muscle are the muscles; its signals become commands, by their names."""
    nodes = {name for name, node in plan.circuit.nodes.items() if isinstance(node, MovingVolume)}
    if nodes != set(units):
        has = ", ".join(sorted(nodes)) or "no muscle"
        raise InputError("nodes", has, f"must have a muscle node for each of {', '.join(units)}", where=plan.where)
    drives = []
    for name, signal in plan.signals.items():
        for target in plan.inputs_of(name):
            owner, _, end = target.rpartition(".")
            if owner in units and end == "length":
                continue  # the mechanism decides how long a muscle is
            drives.append(
                CommandInput(
                    name,
                    target,
                    gauge=end == "pressure" and owner in plan.nodes,
                    straight=end == "stroke",
                    unit=signal.unit,
                    meaning=f"command of {', '.join(signal.drives)}",
                    range=valve.command_range if (valve := driven(plan, target)) else FREE,
                    hard=valve is not None and not valve.saturates,
                )
            )
    commanded = {drive.command for drive in drives}
    first = {name: float(values[0]) for name, values in plan.values().items() if name in commanded}
    document = {"circuit": plan.title, "file": Path(plan.where).name}
    return AirCircuit(
        plan.circuit, tuple(drives), plan.starts, {}, first, {}, plan.environment, document, cautions=plan.cautions
    )
