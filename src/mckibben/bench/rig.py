"""A rig: the hardware of a test machine, its gains and its limits, as an immutable value.

The paper's rig and a modern one ship with the package as TOML files, and users write their own (`rig_file.read_rig`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .. import schema
from .._jax import jnp
from ..assembly.build import rig_cord
from ..assembly.machine import Machine
from ..assembly.muscle_unit import Clamp, MuscleUnit
from ..components import Environment, Module, Scalar, field
from ..components.flow import FlowElement, GasState
from ..components.gas import AIR
from ..engine.native import call_compiled
from ..errors import InputError
from ..experiments.dry_run import Limits
from ..experiments.protocol import Protocol
from ..muscles.elements import Tendon
from ..muscles.worn_braid import WornBraid
from ..pneumatics.circuit import Branch, Circuit
from ..pneumatics.orifice import Leak
from ..pneumatics.valves import OnOffValve, PressureRegulator
from ..pneumatics.volume import Chamber, FixedVolume, HeatModel, MovingVolume, Reservoir
from ..quantities import declared, quantity, with_unit
from ..recordings.calibration import Calibration
from .hardware.computer import Computer
from .hardware.converters import AnalogOut, Converters, Sensor
from .hardware.plant import InstrumentedPlant
from .hardware.stand import Encoder, Frame, Motor, TestStand
from .sensors import LINE, MUSCLE, PORT, VESSEL
from .software.controllers import ForceControl, MotionEstimate, PositionControl, PressureControl
from .software.interlocks import Interlocks


class Plumbing(Module):
    """A way to connect the parts.

        supply - valve - port - [shut-off - line] - tube - muscle
                          |                                  |
                  (accumulator at the valve)     (accumulator at the muscle), leak to the room

    An accumulator adds its volume to the node it is screwed to, whose gas it shares. Where no muscle is connected, an
    accumulator takes its place, as in the pneumatic experiments.

    The valve is the electro-valve, a regulator set by hand, or an element of the user's own with the ports supply, outlet
    and exhaust; the signal ``valve`` is the gauge pressure asked of it.
    """

    valve: FlowElement
    tube: FlowElement
    heat: HeatModel
    supply_pressure: Scalar = quantity("Pa", (0.0, 1e8), "gauge pressure of the supply", typical=(6e5, 1e6))
    port_volume: Scalar = quantity(
        "m^3", (1e-9, 1.0), "outlet of the valve and fittings", typical=(1e-7, 1e-4), default=2e-6
    )
    line_volume: Scalar = quantity(
        "m^3", (1e-9, 1.0), "between a shut-off and the tube", typical=(1e-7, 1e-4), default=1e-6
    )
    valve_accumulator: Scalar = quantity(
        "m^3", (0.0, 1.0), "accumulator at the valve", typical=(1e-6, 1e-3), default=0.0
    )
    muscle_accumulator: Scalar = quantity(
        "m^3", (0.0, 1.0), "accumulator at the muscle, or in its place", typical=(1e-6, 1e-3), default=0.0
    )
    shut_off: OnOffValve | None = None
    leak: Leak | None = None
    has_muscle: bool = field(static=True, kw_only=True, default=True)

    @property
    def tested(self) -> str:
        """Name of the tested node."""
        return MUSCLE if self.has_muscle else VESSEL

    def parts(self) -> frozenset[str]:
        """Parts that a protocol can use, by the names of `Step.needs`."""
        names = {"valve"}
        names |= {"shut-off"} if self.shut_off is not None else set()
        held = float(self.valve_accumulator) + float(self.muscle_accumulator)
        return frozenset(names | ({"accumulators"} if held > 0.0 else set()))

    def signals(self) -> tuple[str, ...]:
        """Names of the driving signals."""
        return ("valve",) if self.shut_off is None else ("valve", "open")

    def circuit(self, units: Mapping[str, MuscleUnit], room: Environment) -> Circuit:
        """Build the circuit, with nodes ``supply``, ``room``, and those of the sketch above."""
        tested = self.tested
        nodes: dict[str, Reservoir | Chamber] = {
            "supply": Reservoir(pressure_abs=self.supply_pressure + room.pressure_abs, temperature=room.temperature),
            "room": Reservoir(pressure_abs=room.pressure_abs, temperature=room.temperature),
            PORT: FixedVolume(volume=self.port_volume + self.valve_accumulator, heat=self.heat),
        }
        if self.has_muscle:
            nodes[tested] = MovingVolume(
                of=units[MUSCLE].law.braid_volume,
                ambient=room.pressure_abs,
                dead_volume=self.muscle_accumulator,
                heat=self.heat,
                signal=f"{MUSCLE}.length",
            )
        else:
            nodes[tested] = FixedVolume(volume=self.muscle_accumulator, heat=self.heat)
        branches = {"valve": Branch(self.valve, ("supply", PORT, "room"), "valve")}
        begins = PORT
        if self.shut_off is not None:
            begins = LINE
            nodes[begins] = FixedVolume(volume=self.line_volume, heat=self.heat)
            branches["shut_off"] = Branch(self.shut_off, (PORT, begins), "open")
        branches["tube"] = Branch(self.tube, (begins, tested))
        if self.leak is not None:
            branches["leak"] = Branch(self.leak, (tested, "room"))
        return Circuit.of(nodes, branches)


SOUND_GRIP = 1e9  # tension that a clamp holds which does not slip [N]
DRIFT = "_drift"  # how the names of drifts end, after the channel


class RigFaults(Module):
    """Faults of a rig, none by default.

    Zero is sound; of the clamp's grip it is `SOUND_GRIP`, which no muscle reaches.

        [faults]                        # of a rig's file
        leak = "0.2 l/min/bar"
        clamp_slack = "0.5 mm"

    | fault | physics |
    |---|---|
    | leak | `Leak` from the muscle's fitting to the room |
    | valve_blockage, valve_sticking | `PressureRegulator.worn`: orifices, and play of the sensed pressure |
    | ..._drift | zero of a sensor, or of the encoder's zero, that moves at a constant rate from the start of the run |
    | clamp_slack | slack length of the tendon between muscle and load |
    | clamp_grip | `assembly.muscle_unit.Clamp`: slips and loses span where the tension passes it |
    | lost_threads, rubber_warming | `muscles.worn_braid` |
    """

    leak: Scalar = quantity(
        "m^3/(s*Pa)", (0.0, 1e-6), "leak of the muscle's fitting, reference air per pressure", symbol="G",
        typical=(1e-12, 1e-9), default=0.0,
    )  # fmt: skip
    valve_blockage: Scalar = quantity("1", (0.0, 0.99), "share of the valve's flow that is blocked", default=0.0)
    valve_sticking: Scalar = quantity("Pa", (0.0, 1e6), "further hysteresis of the valve", default=0.0)
    pressure_drift: Scalar = quantity("Pa/s", (-1e5, 1e5), "drift of the pressure sensor at the muscle", default=0.0)
    valve_pressure_drift: Scalar = quantity(
        "Pa/s", (-1e5, 1e5), "drift of the pressure sensor at the valve", default=0.0
    )
    tension_drift: Scalar = quantity("N/s", (-1e3, 1e3), "drift of the load cell", default=0.0)
    span_drift: Scalar = quantity("m/s", (-0.1, 0.1), "drift of the measured span", default=0.0)
    clamp_slack: Scalar = quantity("m", (0.0, 0.1), "slack of the clamp that holds the muscle", default=0.0)
    clamp_grip: Scalar = quantity(
        "N", (1e-3, SOUND_GRIP), "tension from which on the clamp slips", typical=(10.0, 1e4), default=SOUND_GRIP
    )
    lost_threads: Scalar = quantity("1", (0.0, 0.9), "share of the braid's threads that are lost", default=0.0)
    rubber_warming: Scalar = quantity("K", (0.0, 100.0), "rubber's temperature above room temperature", default=0.0)

    @property
    def present(self) -> dict[str, float]:
        """Faults that there are, by name [SI]."""
        values = {name: float(getattr(self, name)) for name in declared(RigFaults)}
        return {name: value for name, value in values.items() if value != SOUND.get(name, 0.0)}

    def drifts(self) -> dict[str, Scalar]:
        """Rates of the measured channels that drift [unit of the channel/s]."""
        return {n.removesuffix(DRIFT): getattr(self, n) for n in self.present if n.endswith(DRIFT)}

    def on_every_part(self, plumbing: Plumbing, unit: MuscleUnit) -> tuple[Plumbing, MuscleUnit]:
        """Return plumbing and muscle with all faults but the drifts, zero or not, so that values may be traced."""
        valve = self.valve(plumbing) if isinstance(plumbing.valve, PressureRegulator) else plumbing.valve
        return plumbing.replace(valve=valve, leak=self.leaking(plumbing)), unit.replace(
            tendon=self.slack(unit), law=self.worn(unit), clamp=self.slipping()
        )

    def plumbing(self, sound: Plumbing) -> Plumbing:
        """Return plumbing with the faults of valve and fitting; the same object where it has none."""
        present = self.present
        if "valve_blockage" in present or "valve_sticking" in present:
            sound = sound.replace(valve=self.valve(sound))
        return sound.replace(leak=self.leaking(sound)) if "leak" in present else sound

    def valve(self, sound: Plumbing) -> PressureRegulator:
        """Return the valve with its faults.

        Raises:
            InputError: the valve is no pressure regulator, of which these faults are known.
        """
        if not isinstance(sound.valve, PressureRegulator):
            name = "faults.valve_blockage" if "valve_blockage" in self.present else "faults.valve_sticking"
            raise InputError(name, None, "is known of pressure regulators only; the rig has another valve")
        return sound.valve.worn(blockage=self.valve_blockage, sticking=self.valve_sticking)

    def leaking(self, sound: Plumbing) -> Leak:
        """Return the leak of the fitting beside that which the plumbing has: their conductances add."""
        before = 0.0 if sound.leak is None else sound.leak.conductance
        return Leak(conductance=before + self.leak)

    def unit(self, sound: MuscleUnit) -> MuscleUnit:
        """Return the muscle with slack and wear; the same object where it has none."""
        present = self.present
        if "clamp_slack" in present:
            sound = sound.replace(tendon=self.slack(sound))
        if "clamp_grip" in present:
            sound = sound.replace(clamp=self.slipping())
        if "lost_threads" in present or "rubber_warming" in present:
            sound = sound.replace(law=self.worn(sound))
        return sound

    def slack(self, sound: MuscleUnit) -> Tendon:
        """Return the tendon with the slack of the clamp.

        Raises:
            InputError: the muscle has no tendon that a clamp could hold.
        """
        if sound.tendon is None:
            raise InputError(
                "clamp_slack", None, "needs a tendon that the clamp holds, and the muscle has none", where="faults"
            )
        slack: Tendon = sound.tendon.replace(slack_length=sound.tendon.slack_length + self.clamp_slack)
        return slack

    def slipping(self) -> Clamp:
        """Return the clamp with its grip."""
        return Clamp(grip=self.clamp_grip)

    def worn(self, sound: MuscleUnit) -> WornBraid:
        """Return the law of the worn braid."""
        wear = {"lost_threads": self.lost_threads, "warming": self.rubber_warming}
        return WornBraid(sound=sound.law, thread_strain=sound.law.thread_strain, **wear)


SOUND = {"clamp_grip": SOUND_GRIP}  # values that are sound, where it is not zero
FAULTS = tuple(declared(RigFaults))


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
    environment: Environment = dataclasses.field(default_factory=Environment)
    trips: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    hands: tuple[OperatorAction, ...] = ()
    source: str = ""
    note: str = ""
    inferred: tuple[str, ...] = ()
    document: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    where: str = ""
    calibration: Calibration | None = None
    faults: RigFaults = dataclasses.field(default_factory=RigFaults)

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
                raise InputError("plumbing", name, known=self.plumbing, where=self.where)
            return name
        needed = set(protocol.required())
        sorts = [(n, p.parts()) for n, p in self.plumbing.items() if p.has_muscle]
        # a part that nobody asked for would change what is measured, so that an exact match comes first
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

    def limits(self, layout: str) -> Limits:
        """Return the limits of the rig, for the dry run."""
        plumbing = self.plumbing[layout]
        motor, cell = self.motor, self.sensors.get("tension")
        top = min(float(self.valve_out.top), float(plumbing.supply_pressure))
        # A set-point can rise as fast as the gas follows [Pa/s]: by the open valve into the volumes
        room = self.environment
        supply = GasState(plumbing.supply_pressure + room.pressure_abs, room.temperature)
        empty = GasState(room.pressure_abs, room.temperature)
        flow = call_compiled(_fill_flow, plumbing.valve, supply, empty, float(self.valve_out.top))
        volume = plumbing.port_volume + plumbing.valve_accumulator + plumbing.muscle_accumulator + MUSCLE_VOLUME
        return Limits(
            pressure=(max(0.0, float(self.valve_out.low)), top),
            pressure_rate=float(flow / AIR.mass(1.0, volume, room.temperature)),
            burst_pressure=float(self.interlocks.burst_pressure),
            tension=float("inf") if cell is None else float(cell.high),
            motor_force=float("inf") if motor is None else float(motor.largest_force),
            span=(self.shortest, self.longest),
            speed=0.0 if motor is None else float(motor.largest_speed),
            acceleration=float("inf") if motor is None else float(motor.largest_force / motor.mass),
            sample_rates=(float(self.computer.lowest_rate), float(self.computer.highest_rate)),
            resolution=self.resolution(),
            has=self.parts(layout),
        )

    def resolution(self) -> dict[str, float]:
        """Return the smallest step of every measured channel [SI]."""
        resolutions = {name: float(s.resolution) for name, s in self.sensors.items()}
        return resolutions if self.encoder is None else resolutions | {"span": float(self.encoder.resolution)}

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
