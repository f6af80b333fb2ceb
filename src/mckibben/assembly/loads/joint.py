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
from ...errors import InputError
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


class ChainState(NamedTuple):
    """Angle [rad] and angular velocity [rad/s] of each joint."""

    angle: tuple[Scalar, ...]
    velocity: tuple[Scalar, ...]


class ChainLink(Module):
    """One link, and the hinge at its near end."""

    length: Scalar = quantity("m", (1e-3, 100.0), "from its hinge to that of the next link", symbol="l")
    mass: Scalar = quantity("kg", (1e-6, 1e4), "mass", symbol="m", typical=(0.01, 100.0))
    centre: Scalar = quantity("m", (0.0, 100.0), "distance of the centre of mass from the hinge", symbol="d")
    inertia: Scalar = quantity(
        "kg*m^2", (0.0, 1e3), "inertia about the centre of mass", symbol="J", typical=(1e-5, 1.0)
    )
    damping: Scalar = quantity("N*m*s", (0.0, 1e4), "viscous loss of the hinge", symbol="c", default=0.0)
    stiffness: Scalar = quantity("N*m", (0.0, 1e5), "spring of the hinge, per rad", symbol="k", default=0.0)
    spring_rest: Scalar = quantity("rad", (-10.0, 10.0), "angle at which the spring is relaxed", default=0.0)
    start: Scalar = quantity("rad", (-10.0, 10.0), "angle at the start", default=0.0)
    lower_stop: Scalar = quantity("rad", (-10.0, 10.0), "smallest angle", default=-2.0)
    upper_stop: Scalar = quantity("rad", (-10.0, 10.0), "largest angle", default=2.0)
    stop_stiffness: Scalar = quantity("N*m", (0.0, 1e8), "of the stops, per rad", default=STOP_STIFFNESS)
    # Name of the signal of an outside moment on the hinge [N m].
    signal: str | None = field(static=True, kw_only=True, default=None)


class LinkChain(Load):
    """Links by name, and for each muscle its moment arms by the names of the links at whose hinges it turns.

        sum_j a_ij cos(t_i - t_j) t_j'' = Q_i - sum_j a_ij sin(t_i - t_j) t_j'^2 - g b_i sin(t_i)
        t_i = q_1 + .. + q_i,  Q_i = M_i - M_(i+1),  M_i = sum r_i T - c_i w_i - k_i (q_i - q_i0) - stops + M_i,outside
        a_ij = sum_k m_k d_ki d_kj, and the link's own inertia where i = j,   b_i = sum_k m_k d_ki

    q_i is the angle of joint i, t_i the direction of link i from straight down, d_ki the length of link i for k > i,
    the distance of its centre of mass for k = i, and zero for k < i. The mass matrix couples the links. A muscle's span
    is its span at all angles zero less the integral of each of its moment arms. Source: the equations of Lagrange of a
    plane multiple pendulum. Range: angles within the stops, which are one-sided springs; a moment arm depends on the
    angle of its own joint.

    The hinge of a link is the one at its near end. All arms of a muscle that crosses several joints have the same span:
    its span where every angle is zero.
    """

    links: dict[str, ChainLink]
    arms: dict[str, dict[str, MomentArm]]
    # Names of the links from the ground outwards.
    order: tuple[str, ...] = field(static=True, kw_only=True)
    gravity: Scalar = quantity(
        "m/s^2", (0.0, 100.0), "acceleration of gravity, down at angle zero", symbol="g", default=0.0
    )

    def __check_init__(self) -> None:
        """Refuse links out of order, a muscle without a joint, and one about a joint that is none."""
        if sorted(self.order) != sorted(self.links) or not self.order:
            raise InputError("order", ", ".join(self.order), f"must name {', '.join(self.links)}", where="chain")
        for name, about in self.arms.items():
            if not about or not set(about) <= set(self.links):
                crossed = ", ".join(about) or "none"
                raise InputError(f"joints of {name}", crossed, f"must be among {', '.join(self.order)}", where="chain")

    @property
    def _ordered(self) -> list[ChainLink]:
        return [self.links[name] for name in self.order]

    def muscles(self) -> tuple[str, ...]:
        """Those around its joints."""
        return tuple(self.arms)

    def one_of(self, muscle: str, name: str) -> Load:
        """Return the chain with one muscle."""
        return self.with_fields(arms={name: self.arms[muscle]})

    def collected(self) -> Load:
        """Return the chain with one muscle of the moment arm 1 m about each joint."""
        return self.replace(arms={f"{TOGETHER}.{joint}": {joint: unit_arm()} for joint in self.order})

    def effort(self, state: ChainState, tensions: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Moment of the muscles about each joint, as a tension at 1 m [N]."""
        moments = self.muscle_moments(state, tensions)
        return {f"{TOGETHER}.{joint}": moment for joint, moment in zip(self.order, moments, strict=True)}

    def signals(self) -> tuple[str, ...]:
        """The outside moments."""
        return tuple(link.signal for link in self._ordered if link.signal is not None)

    def initial(self) -> ChainState:
        """At rest."""
        return ChainState(tuple(link.start for link in self._ordered), tuple(jnp.zeros(()) for _ in self.order))

    def spans(self, state: ChainState, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """From the moment arms about all joints that each muscle crosses."""
        spans = {}
        for name, about in self.arms.items():
            crossed = [(self.order.index(joint), arm) for joint, arm in about.items()]
            span, rate = crossed[0][1].span, jnp.zeros(())
            for j, arm in crossed:
                span = span + (arm.at(state.angle[j]) - arm.span)
                rate = rate - arm.arm(state.angle[j]) * state.velocity[j]
            spans[name] = SpanState(span, rate)
        return spans

    def muscle_moments(self, state: ChainState, tensions: Mapping[str, Scalar]) -> list[Scalar]:
        """Moment of the muscles about each joint [N m]."""
        moments: list[Scalar] = [jnp.zeros(()) for _ in self.order]
        for name, about in self.arms.items():
            for joint, arm in about.items():
                j = self.order.index(joint)
                moments[j] = moments[j] + arm.arm(state.angle[j]) * tensions[name]
        return moments

    def _outside(self, link: ChainLink, inputs: Mapping[str, Value]) -> Scalar:
        return jnp.zeros(()) if link.signal is None else inputs[link.signal].value

    def _couplings(self) -> tuple[list[list[Scalar]], list[Scalar]]:
        """Factors a_ij of the mass matrix [kg m^2], with the links' own inertia, and b_i of the weight [kg m]."""
        links = self._ordered
        number = len(links)
        beyond = [sum((link.mass for link in links[i + 1 :]), start=jnp.zeros(())) for i in range(number)]
        weights = [link.mass * link.centre + beyond[i] * link.length for i, link in enumerate(links)]
        factors: list[list[Scalar]] = [
            [weights[max(i, j)] * links[min(i, j)].length for j in range(number)] for i in range(number)
        ]
        for i, link in enumerate(links):
            factors[i][i] = link.inertia + link.mass * link.centre**2 + beyond[i] * link.length**2
        return factors, weights

    def rates(self, state: ChainState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> ChainState:
        """Angular velocities and accelerations of the joints."""
        moments = self.muscle_moments(state, tensions)
        for i, link in enumerate(self._ordered):
            angle, velocity = state.angle[i], state.velocity[i]
            moments[i] = (
                moments[i] + self._outside(link, inputs) - elastic_moment(link, angle) - link.damping * velocity
            )
        return ChainState(tuple(state.velocity), tuple(self._accelerations(state, moments)))

    def _accelerations(self, state: ChainState, moments: list[Scalar]) -> list[Scalar]:
        """Angular accelerations of the joints under moments about them [N m]."""
        factors, weights = self._couplings()
        directions, turning = _running_sums(state.angle), _running_sums(state.velocity)
        number = len(self.order)
        matrix: list[list[Scalar]] = [[jnp.zeros(()) for _ in range(number)] for _ in range(number)]
        loads: list[Scalar] = []
        for i in range(number):
            load = moments[i] - (moments[i + 1] if i + 1 < number else 0.0)
            load = load - self.gravity * weights[i] * jnp.sin(directions[i])
            matrix[i][i] = factors[i][i]
            for j in range(number):
                if j != i:
                    apart = directions[i] - directions[j]
                    matrix[i][j] = factors[i][j] * jnp.cos(apart)
                    load = load - factors[i][j] * jnp.sin(apart) * turning[j] * turning[j]
            loads.append(load)
        accelerations = _solve_positive(matrix, loads)
        return [a - (accelerations[i - 1] if i else 0.0) for i, a in enumerate(accelerations)]

    def max_rate_bound(self, state: ChainState, restraints: Mapping[str, Restraint]) -> Scalar:
        """Bound of the links on springs, stops, weight, dampers and muscles [1/s], by the norm of their matrices."""
        number = len(self.order)
        still = state._replace(velocity=tuple(jnp.zeros(()) for _ in self.order))
        unit: list[list[Scalar]] = [
            [jnp.ones(()) if i == j else jnp.zeros(()) for j in range(number)] for i in range(number)
        ]
        rest = self._accelerations(still, [jnp.zeros(())] * number)
        yields = [[jnp.abs(a - r) for a, r in zip(self._accelerations(still, u), rest, strict=True)] for u in unit]
        weights, zero = self._couplings()[1], jnp.zeros(())
        stiff: list[list[Scalar]] = [[zero] * number for _ in range(number)]
        damping: list[list[Scalar]] = [[zero] * number for _ in range(number)]
        for i, link in enumerate(self._ordered):
            stiff[i][i] = hinge_stiffness(link, state.angle[i], state.velocity[i])
            damping[i][i] = link.damping + zero
            for j in range(number):  # the weight of each link beyond both hinges
                stiff[i][j] = stiff[i][j] + self.gravity * sum(weights[max(i, j) :], start=zero)
        for name, about in self.arms.items():
            arms = {self.order.index(joint): arm for joint, arm in about.items()}
            sizes = {j: jnp.abs(arm.arm(state.angle[j])) for j, arm in arms.items()}
            for i, one in sizes.items():
                for j, other in sizes.items():
                    stiff[i][j] = stiff[i][j] + one * other * restraints[name].stiffness
                    damping[i][j] = damping[i][j] + one * other * restraints[name].damping

        def norm(matrix: list[list[Scalar]]) -> Scalar:
            """Largest sum of a row of the sizes of (inverse mass) x matrix."""
            rows = [
                sum(yields[k][i] * matrix[k][j] for k in range(number) for j in range(number)) for i in range(number)
            ]
            return jnp.stack(rows).max()

        return mode_bound(jnp.ones(()), norm(stiff), norm(damping))

    def tip(self, state: ChainState) -> tuple[Scalar, Scalar]:
        """Place of the last link's end from the first hinge: across, towards which positive angles turn, and upwards [m]."""
        directions = _running_sums(state.angle)
        across = height = jnp.zeros(())
        for link, direction in zip(self._ordered, directions, strict=True):
            across = across + link.length * jnp.sin(direction)
            height = height - link.length * jnp.cos(direction)
        return across, height

    def stored_energy(self, state: ChainState) -> Scalar:
        """Kinetic, of springs and stops, and of the links' height [J]."""
        factors, weights = self._couplings()
        directions, turning = _running_sums(state.angle), _running_sums(state.velocity)
        energy = jnp.zeros(())
        for i, link in enumerate(self._ordered):
            for j in range(len(self.order)):
                energy = energy + 0.5 * factors[i][j] * jnp.cos(directions[i] - directions[j]) * turning[i] * turning[j]
            energy = energy + sum(elastic_energies(link, state.angle[i]))
            energy = energy + self.gravity * weights[i] * (1.0 - jnp.cos(directions[i]))
        return energy

    def powers(
        self, state: ChainState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]
    ) -> tuple[Scalar, Scalar]:
        """Of the outside moments, and lost in the hinges [W]."""
        entered = lost = jnp.zeros(())
        for link, velocity in zip(self._ordered, state.velocity, strict=True):
            entered = entered + self._outside(link, inputs) * velocity
            lost = lost + link.damping * velocity**2
        return entered, lost

    def outputs(
        self, state: ChainState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]
    ) -> dict[str, Scalar]:
        """Angle [rad], its rate [rad/s] and the muscles' moment [N m] of each joint by the name of its link; the tip [m]."""
        across, height = self.tip(state)
        outputs: dict[str, Scalar] = {"tip_across": across, "tip_height": height}
        moments = self.muscle_moments(state, tensions)
        for name, angle, velocity, moment in zip(self.order, state.angle, state.velocity, moments, strict=True):
            outputs |= {f"angle_{name}": angle, f"angular_velocity_{name}": velocity, f"moment_{name}": moment}
        return outputs


def _running_sums(values: tuple[Scalar, ...]) -> list[Scalar]:
    sums = [values[0]]
    for value in values[1:]:
        sums.append(sums[-1] + value)
    return sums


def _solve_positive(matrix: list[list[Scalar]], loads: list[Scalar]) -> list[Scalar]:
    """Solution of a positive definite system of some equations, by elimination, which needs no pivots there."""
    rows, right = [list(row) for row in matrix], list(loads)
    number = len(rows)
    for k in range(number):
        for i in range(k + 1, number):
            share = rows[i][k] / rows[k][k]
            rows[i] = [x - share * y if j > k else x for j, (x, y) in enumerate(zip(rows[i], rows[k], strict=True))]
            right[i] = right[i] - share * right[k]
    solution: list[Scalar] = [jnp.zeros(())] * number
    for k in reversed(range(number)):
        rest = right[k]
        for j in range(k + 1, number):
            rest = rest - rows[k][j] * solution[j]
        solution[k] = rest / rows[k][k]
    return solution
