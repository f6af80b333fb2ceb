"""A rig: the hardware of a test machine, its gains and its limits, as an immutable value.

The paper's rig and a modern one ship with the package as TOML files, and users write their own (`rig_file.read_rig`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .. import schema
from .._jax import Scalar, jnp
from ..assembly.build import rig_cord
from ..assembly.machine import Machine
from ..assembly.muscle_unit import MuscleUnit
from ..components import Environment
from ..components.flow import FlowElement, GasState
from ..engine.native import call_compiled
from ..errors import InputError
from ..experiments.dry_run import Limits
from ..experiments.protocol import Protocol
from ..pneumatics.gas import AIR
from ..quantities import with_unit
from ..recordings.calibration import Calibration
from .faults import RigFaults
from .hardware.analogue import AnalogOut, Sensor
from .hardware.computer import Computer
from .hardware.converters import Converters
from .hardware.frame import Frame, TestStand
from .hardware.motor import Encoder, Motor
from .hardware.plant import InstrumentedPlant
from .hardware.pneumatics import MUSCLE, Plumbing
from .software.controllers import ForceControl, MotionEstimate, PositionControl, PressureControl
from .software.interlocks import Interlocks

CHOICES = frozenset(("accumulators", "shut-off"))  # parts by which a way to join them is chosen
MUSCLE_VOLUME = 1.5e-5  # of gas in a muscle and half its tube, for the rate that a valve can follow [m^3]


def _fill_flow(valve: FlowElement, supply: GasState, room: GasState, command: Scalar) -> Scalar:
    """Mass flow [kg/s] of a valve into an empty outlet once it has long been asked for a gauge pressure [Pa]."""
    gas = (supply, room, room)
    return valve.flows(gas, valve.settled(command), valve.initial_memory(gas), command)[0]


@dataclass(frozen=True)
class OperatorAction:
    """An action that a protocol asks the operator to do: connect other parts, or change the muscle.

    Attributes:
        ask: the words by which a protocol asks for it.
        plumbing: name of the way to join the parts afterwards; empty if it stays.
        friction: friction of the muscle afterwards, over that of the untreated muscle [1].
    """

    ask: str
    plumbing: str = ""
    friction: float = schema.number("1", (0.0, 10.0), "friction over that of the untreated muscle", default=1.0)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """The hardware of a test machine with its software's settings.

    `plumbing` holds the ways to join the pneumatic parts by name, the usual one first. `shortest` and `longest` bound the
    span that the frame takes [m]. `inferred` lists the paths of values without a source. `calibration` is what comparing
    the channels with references found. `faults` are those that the simulated machine has. A muscle that is mounted by its
    specimen or its law pulls by the cord of the test machine, `assembly.build.rig_cord`; a `MuscleUnit` by what it has.
    """

    name: str
    title: str
    computer: Computer
    sensors: Mapping[str, Sensor]
    encoder: Encoder | None
    valve_out: AnalogOut
    motor_out: AnalogOut | None
    motor: Motor | None
    frame: Frame
    shortest: float
    longest: float
    plumbing: Mapping[str, Plumbing]
    motion: MotionEstimate
    pressure: PressureControl
    position: PositionControl
    force: ForceControl
    interlocks: Interlocks
    environment: Environment = field(default_factory=Environment)
    trips: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    hands: tuple[OperatorAction, ...] = ()
    source: str = ""
    note: str = ""
    inferred: tuple[str, ...] = ()
    document: Mapping[str, Any] = field(default_factory=dict)
    where: str = ""
    calibration: Calibration | None = None
    faults: RigFaults = field(default_factory=RigFaults)

    def __repr__(self) -> str:
        cord = with_unit(float(rig_cord().stiffness), "N/m")
        return f"Rig({self.name!r}: {self.title}; muscles pull by a cord of {cord})"

    def operator_action(self, ask: str) -> OperatorAction | None:
        """Return the operator action for a request of a protocol; None if the rig does not know it."""
        return next((h for h in self.hands if h.ask == ask), None)

    def layout(self, protocol: Protocol, name: str | None = None) -> str:
        """Plumbing of a protocol: the named one, else the first with all required parts.

        Raises:
            InputError: if there is none of that name.
        """
        if name is not None:
            if name not in self.plumbing:
                known = list(self.plumbing)
                raise InputError("plumbing", name, known=known, where=self.where)
            return name
        needed = set(protocol.required())
        sorts = [(n, p.parts()) for n, p in self.plumbing.items() if p.has_muscle]
        exact = [n for n, parts in sorts if needed & CHOICES == parts & CHOICES]
        enough = [n for n, parts in sorts if needed & CHOICES <= parts]
        return (exact or enough or list(self.plumbing))[0]

    def parts(self, layout: str) -> frozenset[str]:
        """Sensors and parts that a protocol can use, by the names of `Step.needs`."""
        names = set(self.plumbing[layout].parts()) | {"plate", "person"}
        names |= {f"{n} sensor" for n in self.sensors}
        names |= {"motor"} if self.motor is not None else set()
        names |= {"span sensor"} if self.encoder is not None else set()
        return frozenset(names)

    def limits(self, layout: str, *, burst_pressure: float = float("inf")) -> Limits:
        """Return the limits of the rig, for the dry run."""
        plumbing = self.plumbing[layout]
        motor, cell = self.motor, self.sensors.get("tension")
        top = min(float(self.valve_out.top), float(plumbing.supply_pressure))
        still = motor is None
        return Limits(
            pressure=(max(0.0, float(self.valve_out.low)), top),
            pressure_rate=self._pressure_rate(plumbing),
            burst_pressure=min(burst_pressure, float(self.interlocks.burst_pressure)),
            tension=float("inf") if cell is None else float(cell.high),
            motor_force=float("inf") if motor is None else float(motor.largest_force),
            span=(self.shortest, self.longest),
            speed=0.0 if motor is None else float(motor.largest_speed),
            acceleration=float("inf") if still or motor is None else float(motor.largest_force / motor.mass),
            sample_rates=(float(self.computer.lowest_rate), float(self.computer.highest_rate)),
            resolution=self.resolution(),
            has=self.parts(layout),
        )

    def resolution(self) -> dict[str, float]:
        """Return the smallest step of every measured channel [SI]."""
        resolutions = {name: float(s.resolution) for name, s in self.sensors.items()}
        return resolutions if self.encoder is None else resolutions | {"span": float(self.encoder.resolution)}

    def _pressure_rate(self, plumbing: Plumbing) -> float:
        """Largest rate of a set-point that the gas can follow [Pa/s]: by the open valve into the volumes."""
        room = self.environment
        supply = GasState(plumbing.supply_pressure + room.pressure_abs, room.temperature)
        empty = GasState(room.pressure_abs, room.temperature)
        flow = call_compiled(_fill_flow, plumbing.valve, supply, empty, float(self.valve_out.top))
        volume = plumbing.port_volume + plumbing.valve_accumulator + plumbing.muscle_accumulator + MUSCLE_VOLUME
        return float(flow / AIR.mass(1.0, volume, room.temperature))

    def machine(self, layout: str, unit: MuscleUnit | None, *, start: float, moves: bool) -> Machine:
        """Build the machine of circuit, muscle and stand.

        Args:
            layout: name of the plumbing.
            unit: the muscle, where the plumbing has one.
            start: span at the start [m].
            moves: whether the motor holds the end; else it is fixed to a plate.
        """
        plumbing = self.faults.plumbing(self.plumbing[layout])
        units = {MUSCLE: self.faults.unit(unit)} if plumbing.has_muscle and unit is not None else {}
        stand = TestStand(
            held=tuple(units), frame=self.frame, motor=self.motor if moves else None, start=jnp.asarray(float(start))
        )
        return Machine.of(plumbing.circuit(units, self.environment), units, stand, self.environment)

    def calibrated(self, calibration: Calibration | None) -> Rig:
        """Return the rig with a calibration of its measured channels.

        Raises:
            InputError: if a channel is none of the rig, or the calibration is of another rig.
        """
        if calibration is None:
            return self
        if calibration.rig != self.name:
            raise InputError(
                "rig", calibration.rig, f"the calibration has to be of the rig {self.name}", where="calibration"
            )
        known = list(self.resolution())
        for name in calibration.corrections:
            if name not in known:
                raise InputError("channel", name, "the rig measures", known=known, where="calibration")
        return dataclasses.replace(self, calibration=calibration)

    def true(self, channel: str, indicated: Scalar) -> Scalar:
        """Return the calibrated value of a channel for its nominal one [SI]."""
        corrections = {} if self.calibration is None else self.calibration.corrections
        return corrections[channel].true(indicated) if channel in corrections else indicated

    def converters(self, mounted: float) -> Converters:
        """Return the scales of inputs and outputs; the encoder is zeroed at a span [m]."""
        corrections = {} if self.calibration is None else self.calibration.corrections
        return Converters(
            analog={n: s.converter for n, s in self.sensors.items()},
            encoder=self.encoder,
            valve=self.valve_out,
            motor=self.motor_out,
            mounted=jnp.asarray(float(mounted)),
            gain={n: jnp.asarray(c.gain) for n, c in corrections.items()},
            zero={n: jnp.asarray(c.zero) for n, c in corrections.items()},
        )

    def plant(self, machine: Machine, layout: str, *, mounted: float) -> InstrumentedPlant:
        """Return the machine with its sensors and converters; the encoder is zeroed at a span [m]."""
        return InstrumentedPlant(
            machine=machine,
            tested=self.plumbing[layout].tested,
            sensors=dict(self.sensors),
            converters=self.converters(mounted),
        )

    def watch(self, layout: str, *, tension: bool = True) -> Interlocks:
        """Return the interlocks with the ranges of the sensors; without the tension if its saturation was accepted."""
        ends = {}
        for name in ("pressure", "tension"):
            if name in self.sensors:
                sensor = self.sensors[name]
                low, converter = sensor.low, sensor.converter
                ends[f"{name}_rail"] = self.true(name, converter.top)
                if float(converter.low) < float(low):  # a live zero: an intact sensor never reads below it
                    ends[f"{name}_floor"] = self.true(name, 0.5 * (converter.low + low))
        force = {} if self.motor is None else {"motor_force": self.motor.largest_force}
        watching: Interlocks = self.interlocks.replace(
            valve_range=self.valve_out.high, watch_tension=tension, sensors=dict(self.trips), **ends, **force
        )
        return watching
