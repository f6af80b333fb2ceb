"""The testing frame with the motor: what the muscle is mounted on, as the load of an `assembly.Machine`.

    X = x - u,   m_f du'/dt = T - k u - c u',   m dv/dt = (pull of the motor) - T

The muscle's anchor on the frame yields by u towards the motor, so that its span X is shorter than what the encoder makes of
the pulley's position x; at rest u = T/k. Without a motor the other end is fixed to a plate and x is constant. Range: one
mode of the frame; the cord between pulley and muscle is the muscle's tendon.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

from ..._jax import Tree, jnp
from ...assembly.loads import Load, SpanState
from ...components import Module, Scalar, field
from ...components.system import Value
from ...errors import InputError
from ...quantities import quantity
from .motor import Motor


class Frame(Module):
    """Stiffness and damping of the machine's frame; the defaults are inferred for a plate of steel."""

    stiffness: Scalar = quantity("N/m", (1e3, 1e9), "of the anchor", symbol="k", typical=(1e5, 1e7), default=1e6)
    mass: Scalar = quantity("kg", (1e-2, 1e4), "that swings with the anchor", symbol="m", default=2.0)
    damping: Scalar = quantity("N*s/m", (0.0, 1e6), "of the anchor's motion", symbol="c", default=140.0)

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
    """A frame that holds a muscle, or none, with a motor or a fixed plate at the other end."""

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
