"""Motor at the end of a muscle: current loop, voltage limit, pulley, friction, and encoder.

    L di/dt = V - R i - k w,   V = clip(R i + k w + 2 pi fb L (i* - i), -U, U),   w = v/r
    m dv/dt = k i/r - c v - Fc v/sqrt(v^2 + vs^2) - T,   m = J/r^2

v is the speed of the pulley's rim and positive where the muscle gets longer, and so is the current i. The amplifier's
current loop has the bandwidth fb as long as its supply U suffices; against the back-EMF k w it does not, and the current
falls: no free pulley runs faster than U r/k for long. i* is the current asked for within the amplifier's limit, and within
what its own watch over the speed allows: +-I (vmax - +-v)/(0.2 vmax), so that from 0.8 vmax on the driving current is taken
back, is nothing at vmax, and beyond brakes. Without it a slack muscle would be met again at many metres a second.

Range: mean values over the switching of the amplifier; no cogging, no warming, a cord that does not slip. Torque constant,
radius, current limit and encoder: machine and results of C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation
12(1), 1996, doi:10.1109/70.481753 (260 N pulled, 24 A, pulley of 4 cm, 1600 steps per turn, 24 bits); the inertia is the
one that explains their isotonic runs. The other defaults are usual for a fast disc motor of that size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from ..._jax import Tree, jnp
from ...assembly.loads import Load, SpanState
from ...components import Module, Scalar, field
from ...components.system import Value
from ...errors import InputError
from ...quantities import quantity

BITS = (4, 48)


def _radius() -> Any:
    return quantity("m", (1e-3, 1.0), "radius of the pulley", symbol="r", typical=(5e-3, 0.1), default=0.02)


class Encoder(Module):
    """An incremental encoder on the motor's shaft, with a counter that wraps around."""

    steps_per_turn: int = field(static=True, kw_only=True, default=1600)
    edges: int = field(static=True, kw_only=True, default=4)  # counts per step: 1, 2 or 4
    counter_bits: int = field(static=True, kw_only=True, default=24)
    pulley_radius: Scalar = _radius()

    def __check_init__(self) -> None:
        """Refuse invalid numbers of an encoder."""
        for name, ok, allowed in (
            ("steps_per_turn", lambda n: 1 <= n <= 10_000_000, "a whole number from 1 to 10000000"),
            ("edges", lambda n: n in (1, 2, 4), "1, 2 or 4 counts per step"),
            ("counter_bits", lambda n: BITS[0] <= n <= BITS[1], f"a whole number from {BITS[0]} to {BITS[1]}"),
        ):
            value = getattr(self, name)
            if type(value) is not int or not ok(value):
                raise InputError(name, str(value), f"must be {allowed}", where="Encoder")

    @property
    def resolution(self) -> Scalar:
        """Travel per count [m]."""
        return 2.0 * math.pi * self.pulley_radius / (self.steps_per_turn * self.edges)

    def travel(self) -> Scalar:
        """Largest travel from the zero, in either direction, before the counter wraps [m]."""
        return 2.0 ** (self.counter_bits - 1) * self.resolution

    def count(self, position: Scalar, zero: Scalar) -> Scalar:
        """Counter at a position, zeroed at another [m]: signed whole number, two's complement, as a float."""
        counted = jnp.floor((position - zero) / self.resolution + 0.5)
        size = 2.0**self.counter_bits
        return counted - size * jnp.floor(counted / size + 0.5)

    def span(self, count: Scalar, zero: Scalar) -> Scalar:
        """Position of a count [m], within half the resolution."""
        return zero + count * self.resolution


class MotorPowers(NamedTuple):
    """Power balance of the motor [W]: electrical = copper + mechanical + rate of change of the coil's energy."""

    electrical: Scalar
    copper: Scalar
    mechanical: Scalar  # of the air gap; friction is taken from it
    friction: Scalar


class Motor(Module):
    """A direct-current motor with amplifier and pulley; forces and speeds are those of the pulley's rim."""

    torque_constant: Scalar = quantity(
        "N*m/A",
        (1e-4, 100.0),
        "torque per current, and back-EMF per speed",
        symbol="k",
        typical=(0.02, 2.0),
        default=0.22,
    )
    resistance: Scalar = quantity("ohm", (1e-3, 1e3), "of the coil", symbol="R", typical=(0.1, 10.0), default=0.8)
    inductance: Scalar = quantity("H", (1e-6, 1.0), "of the coil", symbol="L", typical=(1e-5, 1e-2), default=2e-4)
    supply_voltage: Scalar = quantity(
        "V", (1.0, 1e3), "of the amplifier, either way", symbol="U", typical=(12.0, 200.0), default=48.0
    )
    current_limit: Scalar = quantity(
        "A", (1e-2, 1e3), "of the amplifier, either way", symbol="I", typical=(1.0, 100.0), default=24.0
    )
    current_bandwidth: Scalar = quantity(
        "1/s", (1.0, 5e3), "of the amplifier's current loop, Hz", symbol="fb", typical=(100.0, 3e3), default=1000.0
    )
    inertia: Scalar = quantity(
        "kg*m^2", (1e-7, 10.0), "of rotor and pulley", symbol="J", typical=(1e-5, 1e-3), default=3e-5
    )
    pulley_radius: Scalar = _radius()
    viscous: Scalar = quantity(
        "N*s/m", (0.0, 1e3), "loss by speed, at the pulley", symbol="c", typical=(0.02, 20.0), default=0.2
    )
    coulomb: Scalar = quantity(
        "N", (0.0, 1e3), "dry friction, at the pulley", symbol="Fc", typical=(0.05, 20.0), default=1.0
    )
    friction_speed: Scalar = quantity(
        "m/s",
        (1e-4, 1.0),
        "speed at which the dry friction is 0.7 of the whole",
        symbol="vs",
        typical=(1e-3, 0.1),
        default=0.01,
    )
    speed_limit: Scalar = quantity(
        "m/s",
        (1e-2, 100.0),
        "at which the amplifier drives no more, at the pulley",
        symbol="vmax",
        typical=(0.1, 20.0),
        default=3.0,
    )
    speed_band: Scalar = quantity(
        "1", (0.01, 1.0), "share of the speed limit over which the driving current is taken back", default=0.2
    )

    @property
    def mass(self) -> Scalar:
        """Inertia as a mass at the pulley [kg]."""
        return self.inertia / self.pulley_radius**2

    @property
    def force_per_current(self) -> Scalar:
        """k/r [N/A]."""
        return self.torque_constant / self.pulley_radius

    @property
    def largest_force(self) -> Scalar:
        """Stall force, within the limits of current and voltage [N]."""
        most = self.supply_voltage / self.resistance
        return self.force_per_current * jnp.where(most < self.current_limit, most, self.current_limit)

    @property
    def no_load_speed(self) -> Scalar:
        """Speed at which the back-EMF equals the supply voltage [m/s]."""
        return self.supply_voltage / self.force_per_current

    @property
    def largest_speed(self) -> Scalar:
        """Largest speed: the lower of no-load speed and speed limit [m/s]."""
        free = self.no_load_speed
        return jnp.where(free < self.speed_limit, free, self.speed_limit)

    def force_to_current(self, force: Scalar) -> Scalar:
        """Current for a force at the pulley [A], within the amplifier's limit; friction is not compensated."""
        return _within(force / self.force_per_current, self.current_limit)

    def allowed_current(self, velocity: Scalar, asked_current: Scalar) -> Scalar:
        """Current that the speed limiter permits at a velocity [m/s] [A]."""
        slope = self.current_limit / (self.speed_band * self.speed_limit)
        asked = _within(asked_current, self.current_limit)
        most = _within(slope * (self.speed_limit - velocity), self.current_limit)
        least = _within(-slope * (self.speed_limit + velocity), self.current_limit)
        return jnp.where(asked > most, most, jnp.where(asked < least, least, asked))

    def voltage(self, current: Scalar, velocity: Scalar, asked_current: Scalar) -> Scalar:
        """Voltage at the coil, within the supply [V]."""
        missing = self.allowed_current(velocity, asked_current) - current
        wanted = 2.0 * math.pi * self.current_bandwidth * self.inductance * missing
        return _within(wanted + self._standing(current, velocity), self.supply_voltage)

    def rates(self, current: Scalar, velocity: Scalar, asked_current: Scalar) -> Scalar:
        """Rate of the current, di/dt [A/s].

        Args:
            current: in the coil [A].
            velocity: velocity of the pulley's rim [m/s].
            asked_current: set-point of the current loop [A].
        """
        spare = self.voltage(current, velocity, asked_current) - self._standing(current, velocity)
        return spare / self.inductance

    def _standing(self, current: Scalar, velocity: Scalar) -> Scalar:
        """Voltage for a constant current [V]: k w is (k/r) v."""
        return self.resistance * current + self.force_per_current * velocity

    def friction(self, velocity: Scalar) -> Scalar:
        """Friction force at the pulley, against the motion [N]."""
        dry = velocity / jnp.sqrt(velocity * velocity + self.friction_speed**2)
        return self.viscous * velocity + self.coulomb * dry

    def pull(self, current: Scalar, velocity: Scalar) -> Scalar:
        """Force of the pulley on its cord and its own inertia, minus friction [N]."""
        return self.force_per_current * current - self.friction(velocity)

    def powers(self, current: Scalar, velocity: Scalar, asked_current: Scalar) -> MotorPowers:
        """Power drawn from the amplifier, and its division."""
        return MotorPowers(
            electrical=self.voltage(current, velocity, asked_current) * current,
            copper=self.resistance * current * current,
            mechanical=self.force_per_current * current * velocity,
            friction=self.friction(velocity) * velocity,
        )


def _within(value: Scalar, limit: Scalar) -> Scalar:
    return jnp.where(value > limit, limit, jnp.where(value < -limit, -limit, value))


class Frame(Module):
    """Stiffness and damping of the machine's frame; the defaults are inferred for a plate of steel."""

    stiffness: Scalar = quantity("N/m", (1e3, 1e9), "of the anchor", symbol="k", typical=(1e5, 1e7), default=1e6)
    mass: Scalar = quantity(
        "kg", (1e-2, 1e4), "that swings with the anchor", symbol="m", typical=(0.1, 100.0), default=2.0
    )
    damping: Scalar = quantity(
        "N*s/m", (0.0, 1e6), "of the anchor's motion", symbol="c", typical=(5.0, 5e3), default=140.0
    )

    def rates(self, state: FrameState | StandState, pull: Scalar) -> FrameState:
        """Rates of change of deflection and velocity under the tension of the muscle [N]."""
        held = self.stiffness * state.deflection + self.damping * state.deflection_velocity
        return FrameState(state.deflection_velocity, (pull - held) / self.mass)

    def stored_energy(self, state: FrameState | StandState) -> Scalar:
        """Kinetic and elastic energy [J]."""
        energy: Scalar = 0.5 * self.mass * state.deflection_velocity**2 + 0.5 * self.stiffness * state.deflection**2
        return energy

    def lost_power(self, state: FrameState | StandState) -> Scalar:
        """Power that the damping loses [W]."""
        lost: Scalar = self.damping * state.deflection_velocity**2
        return lost


class FrameState(NamedTuple):
    """Without a motor: the anchor's deflection towards the muscle's other end [m] and its rate [m/s]."""

    deflection: Scalar
    deflection_velocity: Scalar


class StandState(NamedTuple):
    """Position of the pulley's rim [m] and velocity [m/s], current [A], deflection of the frame [m] and its rate [m/s]."""

    position: Scalar
    velocity: Scalar
    current: Scalar
    deflection: Scalar
    deflection_velocity: Scalar


class TestStand(Load):
    """A frame that holds a muscle, or none, with a motor or a fixed plate at the other end.

        X = x - u,   m_f du'/dt = T - k u - c u',   m dv/dt = (pull of the motor) - T

    The muscle's anchor on the frame yields by u towards the motor, so that its span X is shorter than what the encoder
    makes of the pulley's position x; at rest u = T/k. Without a motor the other end is fixed to a plate and x is
    constant. Range: one mode of the frame; the cord between pulley and muscle is the muscle's tendon.
    """

    __test__: ClassVar[bool] = False  # test runners: its name begins like a test's, and it is none

    held: tuple[str, ...] = field(static=True, kw_only=True)
    frame: Frame = field(kw_only=True, default_factory=Frame)
    motor: Motor | None = field(kw_only=True, default=None)
    start: Scalar = quantity("m", (1e-3, 100.0), "span at the start, and position of a fixed end", symbol="x")
    # Name of the signal of the force asked of the motor [N], positive where it lengthens; unused without a motor.
    signal: str | None = field(static=True, kw_only=True, default="motor")

    def __check_init__(self) -> None:
        """Refuse more than one muscle, and a motor without a signal."""
        if len(self.held) > 1:
            raise InputError("held", ", ".join(self.held), "must be one muscle or none", where="TestStand")
        if self.motor is not None and self.signal is None:
            raise InputError("signal", None, "is missing: a motor needs the name of one", where="TestStand")

    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles, one or none."""
        return self.held

    def signals(self) -> tuple[str, ...]:
        """Signals of the motor, if there is one."""
        return () if self.motor is None or self.signal is None else (self.signal,)

    def initial(self) -> StandState | FrameState:
        """State at rest: relaxed frame, motor without current."""
        zero = jnp.zeros(())
        if self.motor is None:
            return FrameState(zero, zero)
        return StandState(self.start, zero, zero, zero, zero)

    def position(self, state: Tree) -> Scalar:
        """Position of the end that the motor moves, as the encoder measures it [m]."""
        return self.start if self.motor is None else state.position

    def spans(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Span of the muscle, reduced by the frame's deflection."""
        velocity = jnp.zeros(()) if self.motor is None else state.velocity
        span = SpanState(self.position(state) - state.deflection, velocity - state.deflection_velocity)
        return {name: span for name in self.held}

    def asked_current(self, inputs: Mapping[str, Value]) -> Scalar:
        """Set-point of the motor's current loop [A]; empty without a motor."""
        if self.motor is None or self.signal is None:
            return jnp.zeros(())
        return self.motor.force_to_current(inputs[self.signal].value)

    def rates(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> Tree:
        """Rates of change of the states of frame and motor."""
        pull = sum((tensions[n] for n in self.held), start=jnp.zeros(()))
        frame = self.frame.rates(state, pull)
        if self.motor is None:
            return frame
        push = (self.motor.pull(state.current, state.velocity) - pull) / self.motor.mass
        current = self.motor.rates(state.current, state.velocity, self.asked_current(inputs))
        return StandState(state.velocity, push, current, *frame)

    def stored_energy(self, state: Tree) -> Scalar:
        """Kinetic energy of frame and motor, elastic energy of the frame [J].

        That of the coil is excluded, see `powers`.
        """
        frame = self.frame.stored_energy(state)
        energy: Scalar = frame if self.motor is None else frame + 0.5 * self.motor.mass * state.velocity**2
        return energy

    def powers(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Scalar, Scalar]:
        """Electrical power of the motor, k i w, and the power lost by its friction and the frame [W]."""
        lost = self.frame.lost_power(state)
        if self.motor is None:
            return jnp.zeros(()), lost
        motor = self.motor.powers(state.current, state.velocity, self.asked_current(inputs))
        return motor.mechanical, lost + motor.friction

    def outputs(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Deflection of the frame [m]; with a motor position [m], velocity [m/s] and current [A] too."""
        if self.motor is None:
            return {"deflection": state.deflection}
        return {
            "position": state.position,
            "velocity": state.velocity,
            "current": state.current,
            "deflection": state.deflection,
        }
