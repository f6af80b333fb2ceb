"""A joint with muscles around it, each with its own moment arm.

    J dw/dt = sum r_i(q) T_i - c w - k (q - q0) - m g l sin(q) + M,   dq/dt = w
    X_i(q) = X_i0 - integral of r_i from 0 to q,   r_i(q) = a_0 + a_1 q + a_2 q^2 + ...

r_i is the moment arm, X_i the span, m g l sin(q) the moment of a limb that hangs down at angle zero, M from a signal.
A muscle with a positive moment arm turns the joint to positive angles and gets shorter; an antagonist has a negative one.
Range: angles within the stops, which are one-sided springs; the moment arm's curve is a polynomial in the angle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..._jax import Array, jnp
from ...components import Module, Scalar, field
from ...components.system import Value
from ...quantities import quantity
from .load import TOGETHER, Load, Restraint, SpanState, mode_bound

AHEAD = 0.01  # time within which a stop is met that counts among the modes [s]
STOP_STIFFNESS = 2e4  # of a stop unless it is stated [N m/rad]: gives way by 1 mrad to 20 N m


class MomentArm(Module):
    """Moment arm of a muscle over the joint's angle, and its span where the angle is zero."""

    coefficients: Array = quantity("m", (-1.0, 1.0), "a_0, a_1, .. of the curve, per rad^i; shape (n,)", symbol="a")
    span: Scalar = quantity("m", (1e-3, 100.0), "span at angle zero", symbol="X0")

    def arm(self, angle: Scalar) -> Scalar:
        """Moment arm [m] at an angle [rad]."""
        arm: Scalar = _horner([self.coefficients[i] for i in range(self.coefficients.shape[0])], angle)
        return arm

    def at(self, angle: Scalar) -> Scalar:
        """Span [m] at an angle [rad]."""
        terms = [self.coefficients[i] / (i + 1.0) for i in range(self.coefficients.shape[0])]
        span: Scalar = self.span - angle * _horner(terms, angle)
        return span


def unit_arm() -> MomentArm:
    """A moment arm of 1 m at every angle: what pulls there in N is the moment in N m."""
    return MomentArm(coefficients=np.ones(1), span=1.0)


class Hinge(Protocol):
    """Spring and stops of a hinge: stiffnesses [N m/rad], angles [rad]."""

    stiffness: Scalar
    spring_rest: Scalar
    lower_stop: Scalar
    upper_stop: Scalar
    stop_stiffness: Scalar


def _beyond(hinge: Hinge, angle: Scalar) -> Scalar:
    """Angle beyond a stop, signed [rad]."""
    above, below = angle - hinge.upper_stop, angle - hinge.lower_stop
    return jnp.where(above > 0.0, above, jnp.where(below < 0.0, below, 0.0))


def elastic_moment(hinge: Hinge, angle: Scalar) -> Scalar:
    """Moment of spring and stops against an angle [N m]; angle [rad]."""
    return hinge.stiffness * (angle - hinge.spring_rest) + hinge.stop_stiffness * _beyond(hinge, angle)


def elastic_energies(hinge: Hinge, angle: Scalar) -> tuple[Scalar, Scalar]:
    """Energy of the spring, and of the stops [J]; angle [rad]."""
    spring = 0.5 * hinge.stiffness * (angle - hinge.spring_rest) ** 2
    return spring, 0.5 * hinge.stop_stiffness * _beyond(hinge, angle) ** 2


def hinge_stiffness(hinge: Hinge, angle: Scalar, velocity: Scalar) -> Scalar:
    """Stiffness of the spring, and of a stop that is met within `AHEAD` [N m/rad]."""
    ahead = _beyond(hinge, angle + AHEAD * velocity)
    met = (_beyond(hinge, angle) != 0.0) | (ahead != 0.0)
    return hinge.stiffness + jnp.where(met, hinge.stop_stiffness, 0.0)


class JointState(NamedTuple):
    """Angle [rad] and its rate [rad/s]."""

    angle: Scalar
    velocity: Scalar


class JointLoad(Load):
    """A hinge with inertia, and moment arms by the names of its muscles."""

    arms: dict[str, MomentArm]
    inertia: Scalar = quantity("kg*m^2", (1e-7, 1e3), "inertia about the axis", symbol="J", typical=(1e-4, 1.0))
    damping: Scalar = quantity("N*m*s", (0.0, 1e4), "viscous loss", symbol="c", default=0.0)
    stiffness: Scalar = quantity("N*m", (0.0, 1e5), "spring, per rad", symbol="k", default=0.0)
    spring_rest: Scalar = quantity("rad", (-10.0, 10.0), "angle at which the spring is relaxed", default=0.0)
    gravity_moment: Scalar = quantity("N*m", (-1e4, 1e4), "m g l of the limb", default=0.0)
    start: Scalar = quantity("rad", (-10.0, 10.0), "angle at the start", default=0.0)
    lower_stop: Scalar = quantity("rad", (-10.0, 10.0), "smallest angle", default=-2.0)
    upper_stop: Scalar = quantity("rad", (-10.0, 10.0), "largest angle", default=2.0)
    stop_stiffness: Scalar = quantity("N*m", (0.0, 1e8), "of the stops, per rad", default=STOP_STIFFNESS)
    # Name of the signal of an outside moment [N m].
    signal: str | None = field(static=True, kw_only=True, default=None)

    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles around the joint."""
        return tuple(self.arms)

    def one_of(self, muscle: str, name: str) -> Load:
        """Return the joint with one muscle."""
        return self.with_fields(arms={name: self.arms[muscle]})

    def collected(self) -> Load:
        """Return the joint with one muscle of the moment arm 1 m."""
        return self.replace(arms={TOGETHER: unit_arm()})

    def effort(self, state: JointState, tensions: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Moment of the muscles, as a tension at 1 m [N]."""
        return {TOGETHER: self.muscle_moment(state, tensions)}

    def initial(self) -> JointState:
        """State at rest."""
        return JointState(self.start, jnp.zeros(()))

    def spans(self, state: JointState, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Spans from the moment arms."""
        return {n: SpanState(a.at(state.angle), -a.arm(state.angle) * state.velocity) for n, a in self.arms.items()}

    def _outside(self, inputs: Mapping[str, Value]) -> Scalar:
        return jnp.zeros(()) if self.signal is None else inputs[self.signal].value

    def muscle_moment(self, state: JointState, tensions: Mapping[str, Scalar]) -> Scalar:
        """Moment of the muscles [N m]."""
        return sum((a.arm(state.angle) * tensions[n] for n, a in self.arms.items()), start=jnp.zeros(()))

    def rates(self, state: JointState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> JointState:
        """Angular velocity and acceleration."""
        held = (
            elastic_moment(self, state.angle)
            + self.gravity_moment * jnp.sin(state.angle)
            + self.damping * state.velocity
        )
        turning = self.muscle_moment(state, tensions) + self._outside(inputs) - held
        return JointState(state.velocity, turning / self.inertia)

    def max_rate_bound(self, state: JointState, restraints: Mapping[str, Restraint]) -> Scalar:
        """Bound of the hinge on spring, stops, weight, damper and muscles [1/s]."""
        squares = {name: arm.arm(state.angle) ** 2 for name, arm in self.arms.items()}
        stiff = hinge_stiffness(self, state.angle, state.velocity) + jnp.abs(self.gravity_moment)
        stiff = stiff + sum(square * restraints[n].stiffness for n, square in squares.items())
        damping = self.damping + sum(square * restraints[n].damping for n, square in squares.items())
        return mode_bound(self.inertia, stiff, damping)

    def stored_energy(self, state: JointState) -> Scalar:
        """Kinetic, elastic, of the stops, and of the limb's height [J]."""
        elastic, stops = elastic_energies(self, state.angle)
        height = self.gravity_moment * (1.0 - jnp.cos(state.angle))
        return 0.5 * self.inertia * state.velocity**2 + elastic + stops + height

    def powers(
        self, state: JointState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]
    ) -> tuple[Scalar, Scalar]:
        """Power of the external moment, and power lost in the damper [W]."""
        return self._outside(inputs) * state.velocity, self.damping * state.velocity**2

    def outputs(
        self, state: JointState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]
    ) -> dict[str, Scalar]:
        """Angle [rad], its rate [rad/s], and the muscles' moment [N m]."""
        moment = self.muscle_moment(state, tensions)
        return {"angle": state.angle, "angular_velocity": state.velocity, "moment": moment}


def _horner(terms: list[Any], x: Scalar) -> Any:
    value = terms[-1]
    for term in reversed(terms[:-1]):
        value = value * x + term
    return value
