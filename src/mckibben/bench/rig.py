"""A rig: the hardware of a test machine, its gains and its limits, as an immutable value.

The paper's rig and a modern one ship with the package as TOML files, and users write their own (`rig_file.read_rig`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import jax.numpy as jnp

from ..assembly.machine import Machine
from ..assembly.muscle_unit import MuscleUnit
from ..components import Environment
from ..errors import InputError
from ..experiments.limits import Limits
from ..experiments.protocol import Protocol
from ..experiments.waveforms import near
from .hardware.analogue import AnalogOut, Sensor
from .hardware.computer import Computer
from .hardware.converters import Converters
from .hardware.frame import Frame, TestStand
from .hardware.motor import Encoder, Motor
from .hardware.plant import Rigged
from .hardware.pneumatics import MUSCLE, Plumbing
from .software.controllers import ForceControl, PositionControl, PressureControl
from .software.interlocks import Interlocks
from .software.motion import MotionEstimate


@dataclass(frozen=True)
class Hand:
    """What a person does when a protocol asks for it: joins other parts, or changes the muscle.

    `friction` is the friction afterwards, over that of the untreated muscle.
    """

    ask: str
    plumbing: str = ""
    friction: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Rig:
    """The hardware of a test machine with its software's settings.

    `plumbing` holds the ways to join the pneumatic parts by name, the usual one first. `shortest` and `longest` bound the
    span that the frame takes [m]. `inferred` are the dotted paths of what no source states.
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
    hands: tuple[Hand, ...] = ()
    source: str = ""
    note: str = ""
    inferred: tuple[str, ...] = ()
    document: Mapping[str, Any] = field(default_factory=dict)
    where: str = ""

    def hand(self, ask: str) -> Hand:
        """What a person does for an ask; nothing where the rig does not know it."""
        return next((h for h in self.hands if h.ask == ask), Hand(ask))

    def layout(self, protocol: Protocol, name: str | None = None) -> str:
        """The plumbing that a protocol runs on: the one named, else the first that has all it needs.

        Raises:
            InputError: if there is none of that name.
        """
        if name is not None:
            if name not in self.plumbing:
                known = list(self.plumbing)
                raise InputError("plumbing", name, f"{near(name, known)}known are {', '.join(known)}", where=self.where)
            return name
        needed = set(protocol.required())
        sorts = [(n, p.parts()) for n, p in self.plumbing.items() if p.has_muscle]
        exact = [n for n, parts in sorts if needed & _CHOICES == parts & _CHOICES]
        enough = [n for n, parts in sorts if needed & _CHOICES <= parts]
        return (exact or enough or list(self.plumbing))[0]

    def parts(self, layout: str) -> frozenset[str]:
        """Sensors and parts that a protocol can use, in the words of `experiments.read.NEEDS`."""
        found = set(self.plumbing[layout].parts()) | {"plate", "person"}
        found |= {f"{n} sensor" for n in ("pressure", "tension") if n in self.sensors}
        found |= {"motor"} if self.motor is not None else set()
        found |= {"span sensor"} if self.encoder is not None else set()
        return frozenset(found)

    def limits(self, layout: str, *, burst_pressure: float = float("inf")) -> Limits:
        """What the rig allows, for the check before anything moves."""
        plumbing = self.plumbing[layout]
        motor, cell = self.motor, self.sensors.get("tension")
        top = min(float(self.valve_out.top), float(plumbing.supply_pressure))
        still = motor is None
        return Limits(
            pressure=(max(0.0, float(self.valve_out.low)), top), pressure_rate=self._pressure_rate(plumbing),
            burst_pressure=min(burst_pressure, float(self.interlocks.burst_pressure)),
            tension=float("inf") if cell is None else float(cell.high),
            motor_force=float("inf") if motor is None else float(motor.largest_force),
            span=(self.shortest, self.longest), speed=0.0 if motor is None else float(motor.largest_speed),
            acceleration=float("inf") if still or motor is None else float(motor.largest_force / motor.mass),
            sample_rates=(float(self.computer.lowest_rate), float(self.computer.highest_rate)),
            resolution=self.resolution(), has=self.parts(layout),
        )  # fmt: skip

    def resolution(self) -> dict[str, float]:
        """Smallest step of every measured channel [SI]."""
        found = {name: float(s.resolution) for name, s in self.sensors.items()}
        return found if self.encoder is None else found | {"span": float(self.encoder.resolution)}

    def _pressure_rate(self, plumbing: Plumbing) -> float:
        """Steepest change of a set-point that the gas can follow [Pa/s]: choked flow into what has to be filled."""
        from ..pneumatics.gas import REFERENCE_DENSITY

        gas = 287.05 * float(self.environment.temperature)
        supply = float(plumbing.supply_pressure + self.environment.pressure_abs)
        flow = float(plumbing.valve.fill.conductance) * REFERENCE_DENSITY * supply
        volume = float(plumbing.port_volume + plumbing.valve_accumulator + plumbing.muscle_accumulator)
        return flow * gas / (volume + MUSCLE_VOLUME)

    def machine(self, layout: str, unit: MuscleUnit | None, *, start: float, moves: bool) -> Machine:
        """Circuit, muscle and stand.

        Args:
            layout: name of the plumbing.
            unit: the muscle, where the plumbing has one.
            start: span at the start [m].
            moves: whether the motor holds the end; else it is fixed to a plate.
        """
        plumbing = self.plumbing[layout]
        units = {MUSCLE: unit} if plumbing.has_muscle and unit is not None else {}
        stand = TestStand(
            held=tuple(units), frame=self.frame, motor=self.motor if moves else None, start=jnp.asarray(float(start))
        )
        return Machine.of(plumbing.circuit(units, self.environment), units, stand, self.environment)

    def converters(self, mounted: float) -> Converters:
        """What the counts of its inputs and outputs stand for; the encoder is zeroed at a span [m]."""
        return Converters(
            analog={n: s.converter for n, s in self.sensors.items()}, encoder=self.encoder, valve=self.valve_out,
            motor=self.motor_out, mounted=jnp.asarray(float(mounted)), gain={}, zero={},
        )  # fmt: skip

    def plant(self, machine: Machine, layout: str, *, mounted: float) -> Rigged:
        """The machine behind its converters; the encoder was zeroed at a span [m]."""
        return Rigged(
            machine=machine, tested=self.plumbing[layout].tested, sensors=dict(self.sensors),
            converters=self.converters(mounted),
        )  # fmt: skip

    def watch(self, layout: str, *, tension: bool = True) -> Interlocks:
        """The interlocks with the ends of the sensors' ranges; without the tension where its saturation was accepted."""
        ends = {}
        for name, sensor in self.sensors.items():
            if name in ("pressure", "tension"):
                ends[f"{name}_rail"] = sensor.converter.top
                if float(sensor.converter.low) < float(
                    sensor.low
                ):  # a live zero: an intact sensor never reads below it
                    ends[f"{name}_floor"] = 0.5 * (sensor.converter.low + sensor.low)
        force = {} if self.motor is None else {"motor_force": self.motor.largest_force}
        watching: Interlocks = self.interlocks.replace(
            valve_range=self.valve_out.high, watch_tension=tension, **ends, **force
        )
        return watching


_CHOICES = frozenset(("accumulators", "shut-off"))
MUSCLE_VOLUME = 1.5e-5  # of gas in a muscle and half its tube, for the rate that a valve can follow [m^3]
