"""Instrumented plants: circuit, muscle and stand, and their sensors and converters.

Measured are ``pressure`` at the muscle and ``valve_pressure`` at the valve (gauge) [Pa], ``tension`` [N] and ``span`` [m],
as far as the rig has the sensors. The software commands ``valve`` [Pa], ``motor`` [N at the pulley] and, where there is a
shut-off, ``open`` (1 or 0).

Of an antagonist pair on a joint, ``angle`` [rad] by an encoder on the joint's axis, and ``flexor_pressure`` and
``extensor_pressure`` (gauge) [Pa] at the muscles are measured. The software commands ``flexor`` and ``extensor`` [Pa], one
valve each. An outside ``moment`` [N m] passes unconverted: it comes from the world and not from a computer.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping

from ..._jax import Tree, jnp
from ...assembly.machine import Machine
from ...assembly.pair_map import NAMES, joint_stiffness
from ...components import Scalar, field
from ...components.system import Moment, Plant, Value
from ...engine.signals import Signal
from ..sensors import SENSORS
from .converters import AnalogOut, Converters, Sensor
from .stand import Encoder, TestStand


class MeasuredPlant(Plant):
    """A machine with analogue sensors whose filters have states.

    Its state holds the machine's and the conditioned signal of every analogue sensor. A row of a sample has ``draws``, a
    normal draw per analogue sensor, and may have ``lost``, 1 where its wire is open, and ``drift``, by which the zero of a
    channel has moved [unit of the channel].
    """

    machine: Machine
    sensors: dict[str, Sensor]

    @abc.abstractmethod
    def seen(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Physical values at the analogue sensors, from the machine's state [SI]."""

    def initial(self, pressures: Mapping[str, float], inputs: Mapping[str, Value]) -> tuple[Tree, Tree]:
        """State and memory at rest, at absolute pressures [Pa]."""
        state, memory = self.machine.initial(pressures, inputs)
        signals = self.seen(state, memory, inputs)
        return {"machine": state, "sensors": {n: s.initial(signals[n]) for n, s in self.sensors.items()}}, memory

    def at_rest(self, commands: Mapping[str, float], pressures: Mapping[str, float]) -> tuple[Tree, Tree]:
        """State and memory at rest after commands [SI] have lasted, at gauge pressures of all volumes [Pa]."""
        held = {n: Signal(jnp.full((2,), v)) for n, v in self.convert(commands).items()}
        inputs = {n: Value(s.values[0], jnp.zeros(())) for n, s in self.commands(held).items()}
        room = float(self.machine.environment.pressure_abs)
        return self.initial({n: room + p for n, p in pressures.items()}, inputs)

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Commands of the machine."""
        return self.machine.commands(signals)

    def analogue(self, state: Tree, memory: Tree, inputs: Mapping[str, Value], row: Tree) -> dict[str, Scalar]:
        """Analogue channels, and for each ``<channel>.code``, the count of its converter."""
        signals = self.seen(state["machine"], memory, inputs)
        lost, drift = row.get("lost", {}), row.get("drift", {})
        channels: dict[str, Scalar] = {}
        for name, sensor in self.sensors.items():
            draw = row["draws"][name]
            if name in drift:
                sensor = sensor.with_fields(offset=sensor.offset + drift[name])
            value, code = sensor.reading(state["sensors"][name], signals[name], draw, lost.get(name, 0.0))
            channels |= {name: value, f"{name}.code": code}
        return channels

    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of change of the machine's state and of the filters before the converters."""
        signals = self.seen(state["machine"], memory, inputs)
        return {
            "machine": self.machine.rate(state["machine"], memory, inputs),
            "sensors": {n: s.rate(state["sensors"][n], signals[n]) for n, s in self.sensors.items()},
        }

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Integrands of the machine's accounts."""
        return self.machine.integrands(state["machine"], memory, inputs)

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Advance the memory of the machine."""
        return self.machine.advance_memory(
            memory, Moment(start.state["machine"], start.inputs), Moment(end.state["machine"], end.inputs), duration
        )

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Outputs of the machine."""
        return self.machine.outputs(state["machine"], memory, inputs)

    def max_rate_bound(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Scalar:
        """Upper bound of the fastest rate of the machine and the sensors' filters [1/s]."""
        bounds = [self.machine.max_rate_bound(state["machine"], memory, inputs)]
        bounds += [2.0 * jnp.pi * s.cutoff for s in self.sensors.values()]
        return jnp.stack([jnp.asarray(b) for b in bounds]).max()

    def overloaded(self, outputs: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Of the machine."""
        return self.machine.overloaded(outputs)

    def admissible(self, state: Tree) -> Scalar:
        """Whether every volume holds gas above vacuum."""
        return self.machine.admissible(state["machine"])


class InstrumentedPlant(MeasuredPlant):
    """A machine with sensors and converters; the encoder has a separate entry in ``lost``."""

    tested: str = field(static=True)
    converters: Converters

    def _stand(self) -> TestStand:
        assert isinstance(self.machine.load, TestStand)
        return self.machine.load

    def convert(self, commands: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Values held by the output converters, for the signals of the machine."""
        held = self.converters.held(self.converters.write(commands))
        needed = self.machine.signals()
        return {n: v for n, v in held.items() if n == "valve" or n in needed}

    def seen(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Physical values at the sensors, as `bench.sensors` declares them [SI]."""
        return {name: SENSORS[name].true_value(self, state, memory, inputs) for name in self.sensors}

    def sense(self, state: Tree, memory: Tree, inputs: Mapping[str, Value], row: Tree) -> dict[str, Scalar]:
        """Measured channels, and for each ``<channel>.code``, its count."""
        analogue = self.analogue(state, memory, inputs, row)
        counts = {name: analogue[f"{name}.code"] for name in self.sensors}
        encoder = self.converters.encoder
        if encoder is not None:
            position = self._stand().position(state["machine"]["load"])
            position = position + row["drift"]["span"] if "span" in row.get("drift", {}) else position
            # a lost encoder counts nothing any more
            count = encoder.count(position, self.converters.mounted)
            counts["span"] = jnp.where(row["lost"]["span"] > 0.5, 0.0, count)
        return self.converters.read(counts) | {f"{n}.code": c for n, c in counts.items()}

    def max_rate_bound(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Scalar:
        """Upper bound of the fastest rate of the machine, the filters and the motor's current loop [1/s]."""
        bound, motor = super().max_rate_bound(state, memory, inputs), self._stand().motor
        return bound if motor is None else jnp.maximum(bound, 2.0 * jnp.pi * motor.current_bandwidth)


PRESSURES = {name: f"{name}_pressure" for name in NAMES}  # channels by muscle
MOMENT = "moment"  # signal of the joint


class RiggedJoint(MeasuredPlant):
    """A machine of `assembly.build.antagonist_pair` with sensors and output converters.

    Its valves are driven by ``flexor.valve`` and ``extensor.valve``, its joint by ``moment``. The encoder has a pulley of
    1 m radius, at which a metre is a radian. It was zeroed at angle zero.
    """

    encoder: Encoder
    valve_out: AnalogOut

    def convert(self, commands: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Values held by the output converters, and the external moment."""
        held = {f"{n}.valve": self.valve_out.output(commands[n]) for n in NAMES}
        return {**held, MOMENT: commands[MOMENT]}

    def seen(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Gauge pressures in the muscles [Pa]."""
        return {channel: self.machine.gauge(state, name) for name, channel in PRESSURES.items()}

    def sense(self, state: Tree, memory: Tree, inputs: Mapping[str, Value], row: Tree) -> dict[str, Scalar]:
        """Measured channels, and for each pressure ``<channel>.code``, the count of its converter."""
        count = self.encoder.count(state["machine"]["load"].angle, 0.0)
        return {**self.analogue(state, memory, inputs, row), "angle": self.encoder.span(count, 0.0)}

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Outputs of the machine, and two stiffnesses of the joint [N m/rad]: for slow and for quick displacements."""
        stiffness = joint_stiffness(self.machine, state["machine"], memory, inputs)
        stiffnesses = {
            "joint.stiffness": stiffness.relaxed_at_pressure,
            "joint.quick_stiffness": stiffness.short_at_mass,
        }
        return super().outputs(state, memory, inputs) | stiffnesses
