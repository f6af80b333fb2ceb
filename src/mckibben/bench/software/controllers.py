"""Controllers on the sample clock: pressure by the valve, span or tension by the motor, and the velocity estimate.

Each controller has `initial() -> state` and a pure `step(state, .., dt, active) -> (state, output)`. While `active` is 0 the
trim is held where a beginning controller asks for what the muscle pulls, so that a change of mode does not jump; the output
of an inactive controller means nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..._jax import Tree, jnp
from ...assembly.pair_map import PairMap
from ...components import Module, Scalar
from ...components.system import Software
from ...quantities import quantity


class TrimState(NamedTuple):
    """Integral part of the output [unit of the output]."""

    trim: Scalar


def first_trim(trim: Scalar = 0.0) -> TrimState:
    """Initial integral state of a controller [unit of the output]."""
    return TrimState(jnp.asarray(trim, float))


def bounded(x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """Limit a value to low..high."""
    return jnp.where(x > high, high, jnp.where(x < low, low, x))


def next_trim(
    state: TrimState,
    growth: Scalar,
    active: Scalar,
    *,
    wanted: Scalar,
    low: Scalar,
    high: Scalar,
    limit: Scalar,
    rest: Scalar = 0.0,
) -> TrimState:
    """Compute the trim at the next sample.

    Args:
        state: the trim of this sample.
        growth: gain times error times sampling period; where it is no number, it adds nothing.
        active: 1 or 0.
        wanted: output before it is bounded; where it is beyond, only a growth that brings it back counts.
        low: least output.
        high: largest output.
        limit: largest trim of either sign.
        rest: trim while the controller is inactive, with which it begins.
    """
    in_vain = ~jnp.isfinite(growth) | ((wanted > high) & (growth > 0.0)) | ((wanted < low) & (growth < 0.0))
    grown = bounded(state.trim + jnp.where(in_vain, 0.0, growth), -limit, limit)
    return TrimState(jnp.where(jnp.asarray(active) > 0, grown, rest))


class MotionState(NamedTuple):
    """Span of the previous sample [m] and the velocity [m/s]."""

    span: Scalar
    velocity: Scalar


class MotionEstimate(Module):
    """Velocity estimate from a counted span: the difference over a sample, filtered by one pole.

        raw_k = (x_k - x_{k-1})/dt,   v_k = v_{k-1} + (1 - exp(-2 pi f dt)) (raw_k - v_{k-1})

    It is late by half a sample and the pole's 1/(2 pi f). A count of size r makes a ripple of at most r/dt times the pole's
    share: 2e-5 m at 1 kHz and 200 1/s is 1.4 cm/s. Range: any sampling period.
    """

    cutoff: Scalar = quantity("1/s", (0.1, 1e5), "corner of the velocity filter", symbol="f", default=200.0)

    def initial(self, span: Scalar) -> MotionState:
        """State at rest at a span [m]."""
        start = jnp.asarray(span, float)
        return MotionState(start, jnp.zeros_like(start))

    def step(self, state: MotionState, span: Scalar, dt: Scalar) -> tuple[MotionState, Scalar]:
        """Advance by one sample; return the new state and the velocity [m/s], positive lengthening.

        Args:
            state: state of `initial` or of the sample before.
            span: measured [m].
            dt: sampling period [s].
        """
        share = 1.0 - jnp.exp(-2.0 * math.pi * self.cutoff * dt)
        velocity = state.velocity + share * ((span - state.span) / dt - state.velocity)
        return MotionState(jnp.asarray(span, float), velocity), velocity


class PressureControl(Module):
    """Pressure control by the valve: feedforward and an integral trim, bounded by the valve; gauge pressures.

        u = r + I,   dI/dt = ki (r - p),   |I| <= trim limit

    The valve is itself a regulator. The paper's machine sent it the set-point only (part II and III of the report); ki =
    0 does the same. The limit of the trim is its anti-windup: during a step the muscle lags, and what the valve will
    reach by itself is not to be added again. Range: stable for ki below about 0.4/(dead time and lag of valve, tube and
    sensor).
    """

    ki: Scalar = quantity("1/s", (0.0, 1e4), "integral gain of the pressure", default=0.0)
    trim_limit: Scalar = quantity("Pa", (0.0, 1e7), "largest correction of the set-point", default=5e4)
    low: Scalar = quantity("Pa", (-1e5, 1e7), "least pressure asked of the valve", default=0.0)
    high: Scalar = quantity("Pa", (1.0, 1e8), "largest pressure asked of the valve", default=1e6)

    def initial(self) -> TrimState:
        """State without trim."""
        return first_trim()

    def step(
        self, state: TrimState, set_point: Scalar, pressure: Scalar, dt: Scalar, active: Scalar = 1.0
    ) -> tuple[TrimState, Scalar]:
        """Compute one sample: the new state and the commanded pressure of the valve [Pa].

        Args:
            state: state of `initial` or of the sample before.
            set_point: set point of the pressure [Pa].
            pressure: measured [Pa].
            dt: sampling period [s].
            active: 1 while the pressure is controlled, 0 while the muscle is shut off.
        """
        wanted = set_point + state.trim
        growth = self.ki * dt * (set_point - pressure)
        after = next_trim(state, growth, active, wanted=wanted, low=self.low, high=self.high, limit=self.trim_limit)
        return after, bounded(wanted, self.low, self.high)


class PositionControl(Module):
    """Span control by the motor: the muscle's pull and the inertia are fed forward, the rest is fed back.

        f = s T + m a + kp (x - X) + kd (v - V) + I,   dI/dt = ki (x - X),   |f| <= limit

    with the set-point x and its v and a, and X, V and T measured. The motor carries the muscle, so a share s of the
    measured tension takes most of its stiffness out of the loop; as the tension is late, the whole of it would take the
    damping out too. It begins with the rest of the tension as its integral: f = T then, and nothing jumps. Velocity mode
    is the same with a set-point that grows by the set velocity. Range of the default gains, by the eigenvalues of the
    sampled loop with one sample of latency, 200 1/s filters of tension and velocity and a current loop of 800 1/s: at 1
    kHz or more every error decays with 24 1/s or faster for 50 g to 0.15 kg at the pulley and springs to 20 N/mm. At 75
    g, 600 samples/s are the least.
    """

    kp: Scalar = quantity("N/m", (0.0, 1e7), "gain of the span", default=3000.0)
    kd: Scalar = quantity("N*s/m", (0.0, 1e5), "gain of the velocity", default=16.0)
    ki: Scalar = quantity("N/(m*s)", (0.0, 1e9), "integral gain of the span", default=1e5)
    tension_share: Scalar = quantity("1", (0.0, 1.0), "share of the tension that is fed forward", default=0.9)
    mass: Scalar = quantity("kg", (0.0, 1e3), "inertia that is fed forward", default=0.075)
    force_limit: Scalar = quantity("N", (1e-3, 1e6), "largest force asked of the motor", default=264.0)

    def initial(self, tension: Scalar = math.nan) -> TrimState:
        """Initial integral state, with the share of a tension [N] that is not fed forward, so that it holds the muscle.

        NaN: of the tension that is measured at the first sample, all that a real machine can know.
        """
        return first_trim((1.0 - self.tension_share) * tension)

    def step(
        self,
        state: TrimState,
        set_point: Scalar,
        set_velocity: Scalar,
        set_acceleration: Scalar,
        span: Scalar,
        velocity: Scalar,
        tension: Scalar,
        dt: Scalar,
        active: Scalar = 1.0,
    ) -> tuple[TrimState, Scalar]:
        """Compute one sample: the new state and the commanded force of the motor [N], positive lengthening.

        Args:
            state: state of `initial` or of the sample before.
            set_point: set point of the span [m].
            set_velocity: its velocity [m/s], positive lengthening.
            set_acceleration: its acceleration [m/s^2].
            span: measured [m].
            velocity: velocity of the measured span [m/s].
            tension: measured [N]; zero where nothing measures it.
            dt: sampling period [s].
            active: 1 while the span or the velocity is controlled, else 0.
        """
        error = set_point - span
        rest = (1.0 - self.tension_share) * tension
        state = TrimState(jnp.where(jnp.isnan(state.trim), rest, state.trim))
        forward = self.tension_share * tension + self.mass * set_acceleration
        wanted = forward + self.kp * error + self.kd * (set_velocity - velocity) + state.trim
        low, high = -self.force_limit, self.force_limit
        growth = self.ki * dt * error
        after = next_trim(state, growth, active, wanted=wanted, low=low, high=high, limit=self.force_limit, rest=rest)
        return after, bounded(wanted, low, high)


class ForceControl(Module):
    """Tension control by the motor: PI on the measured tension with damping, bounded by the motor's force.

        f = r + kp (r - T) + I - kd V,   dI/dt = ki (r - T),   |I| <= trim limit,   |f| <= force limit

    V is positive lengthening. Feedback of the force lessens the inertia of the motor that the muscle feels to m/(1 +
    kp), but it is late: on a muscle of stiffness K, a lag t takes kp K t from the damping. With the paper's rig (75 g at
    the pulley, filter of 200 1/s, a sample of latency at 1 kHz, 8-bit converters) and the nylon muscle, kp 0.3 with ki
    10 1/s and kd 3 N s/m is stable without any friction; 0.5 needs friction and bounces, 1 is unstable. The trim carries
    the friction of the motor; it is limited since nothing else bounds it while the muscle is slack, where the tension
    stays below the set-point.
    """

    kp: Scalar = quantity("1", (0.0, 100.0), "gain of the tension", default=0.3)
    ki: Scalar = quantity("1/s", (0.0, 1e4), "integral gain of the tension", default=10.0)
    kd: Scalar = quantity("N*s/m", (0.0, 1e4), "damping of the velocity", default=3.0)
    trim_limit: Scalar = quantity("N", (0.0, 1e6), "largest correction by the integral", default=30.0)
    force_limit: Scalar = quantity("N", (1e-3, 1e6), "largest force asked of the motor", default=264.0)

    def initial(self) -> TrimState:
        """State without trim."""
        return first_trim()

    def step(
        self, state: TrimState, set_point: Scalar, tension: Scalar, velocity: Scalar, dt: Scalar, active: Scalar = 1.0
    ) -> tuple[TrimState, Scalar]:
        """Compute one sample: the new state and the commanded force of the motor [N], positive lengthening.

        Args:
            state: state of `initial` or of the sample before.
            set_point: set point of the tension [N].
            tension: measured [N].
            velocity: velocity of the measured span [m/s], positive lengthening.
            dt: sampling period [s].
            active: 1 while the tension is controlled, else 0.
        """
        error = set_point - tension
        wanted = set_point + self.kp * error + state.trim - self.kd * velocity
        low, high = -self.force_limit, self.force_limit
        growth = self.ki * dt * error
        after = next_trim(state, growth, active, wanted=wanted, low=low, high=high, limit=self.trim_limit)
        return after, bounded(wanted, low, high)


# ---- angle and stiffness of a joint


class Approach(NamedTuple):
    """A set-point in transition: value, and its rate [per s]."""

    value: Scalar
    rate: Scalar


class JointControlState(NamedTuple):
    """Set-points in transition, motion of the joint [rad], integral of the angle [N m], trims of the pressures [Pa]."""

    angle: Approach
    stiffness: Approach
    motion: MotionState
    trim: TrimState
    flexor: TrimState
    extensor: TrimState


class JointCommands(NamedTuple):
    """Commanded pressures of the valves [Pa], their targets, set-points in force [rad], [N m/rad]."""

    flexor: Scalar
    extensor: Scalar
    flexor_set: Scalar
    extensor_set: Scalar
    angle: Scalar
    stiffness: Scalar


class JointControl(Module):
    """Control of a joint: feedforward by the map of the pair, PID on the angle, a trim of each pressure.

        p = c +- d,   c = c(q*, K*),   d = d(q*, K*) + m/a(q*, K*)
        m = J q*'' + kp (q* - q) + kd (q*' - q') + I,   dI/dt = ki (q* - q),   |I| <= trim limit

    c and d are the common pressure and half the difference that hold the pair at angle and stiffness
    (`assembly.pair_map`), a the moment per difference; so the gains are those of a joint and not of a muscle. The
    set-points K* and q* are approached through two equal lags, and q*'' and q*' are of that approach: a step would ask
    the valves for what they cannot. A valve that is at the end of its range takes no part while the other still does;
    when both are, the integral stands still. Range: angles and stiffnesses of the map. The stiffness is that of the
    muscles: who pushes slowly feels the feedback beside it, and in the end the integral moves the joint back. With the
    loop off, or too quick for the valves, the muscles alone are felt. As a rule kd and the damping of the joint
    together should exceed kp times the lag of the pressures.
    """

    pair: PairMap
    motion: MotionEstimate
    valve: PressureControl
    kp: Scalar = quantity("N*m", (0.0, 1e5), "gain of the angle, per rad", default=1.5)
    ki: Scalar = quantity("N*m/s", (0.0, 1e6), "integral gain of the angle, per rad", default=15.0)
    kd: Scalar = quantity("N*m*s", (0.0, 1e4), "gain of the angular velocity, per rad", default=0.06)
    inertia: Scalar = quantity("kg*m^2", (0.0, 1e3), "inertia that is fed forward, with a jump at a step", default=0.0)
    lag: Scalar = quantity("s", (1e-3, 10.0), "of each of the two through which set-points go", default=0.04)
    trim_limit: Scalar = quantity("N*m", (0.0, 1e5), "largest correction by the integral", default=1.0)

    def initial(self, angle: Scalar = 0.0, stiffness: Scalar = 0.0) -> JointControlState:
        """State at rest at an angle [rad], with a stiffness [N m/rad]."""
        at, stiff = (Approach(jnp.asarray(x, float), jnp.zeros(())) for x in (angle, stiffness))
        pressure = self.valve.initial()
        return JointControlState(at, stiff, self.motion.initial(angle), first_trim(), pressure, pressure)

    def step(
        self,
        state: JointControlState,
        set_angle: Scalar,
        set_stiffness: Scalar,
        angle: Scalar,
        flexor: Scalar,
        extensor: Scalar,
        dt: Scalar,
        active: Scalar = 1.0,
    ) -> tuple[JointControlState, JointCommands]:
        """Compute one sample: the new state and the commands of the valves.

        Args:
            state: state of `initial` or of the sample before.
            set_angle: set angle of the joint [rad].
            set_stiffness: set stiffness of the joint [N m/rad].
            angle: measured [rad].
            flexor: its pressure, measured [Pa gauge].
            extensor: its pressure, measured [Pa gauge].
            dt: sampling period [s].
            active: 1 while the angle is fed back; 0 leaves what the laws say, and the integral ready to begin without a
                jump.
        """
        turning, acceleration = _approached(state.angle, set_angle, self.lag, dt)
        stiffening, _ = _approached(state.stiffness, set_stiffness, self.lag, dt)
        motion, velocity = self.motion.step(state.motion, angle, dt)
        point = self.pair.at(turning.value, stiffening.value)
        error = turning.value - angle
        back = self.kp * error + self.kd * (turning.rate - velocity)
        on = jnp.asarray(active) > 0
        ahead = point.difference * point.moment_per_difference + self.inertia * acceleration
        wanted = ahead + jnp.where(on, back + state.trim.trim, 0.0)
        # beyond this difference both valves are at an end
        above, below = self.valve.high - point.common, point.common - self.valve.low
        most = point.moment_per_difference * jnp.where(above > below, above, below)
        trim = next_trim(
            state.trim,
            self.ki * dt * error,
            active,
            wanted=wanted,
            low=-most,
            high=most,
            limit=self.trim_limit,
            rest=-back,
        )
        apart = bounded(wanted, -most, most) / point.moment_per_difference
        flexor_set = bounded(point.common + apart, self.valve.low, self.valve.high)
        extensor_set = bounded(point.common - apart, self.valve.low, self.valve.high)
        flexed, flexor_asked = self.valve.step(state.flexor, flexor_set, flexor, dt)
        extended, extensor_asked = self.valve.step(state.extensor, extensor_set, extensor, dt)
        after = JointControlState(turning, stiffening, motion, trim, flexed, extended)
        return after, JointCommands(
            flexor_asked, extensor_asked, flexor_set, extensor_set, turning.value, point.stiffness
        )


def _approached(state: Approach, target: Any, lag: Any, dt: Scalar) -> tuple[Approach, Scalar]:
    """Set-point at the next sample, and its second rate [per s^2]; exact for a constant target."""
    away = state.value - target
    slope = state.rate + away / lag
    left = jnp.exp(-dt / lag)
    value = target + (away + slope * dt) * left
    rate = (state.rate - slope * dt / lag) * left
    return Approach(value, rate), (target - value) / (lag * lag) - 2.0 * rate / lag


class JointSoftware(Software):
    """Software with one controller.

    The row of a sample has ``angle``, ``stiffness``, ``moment``, and ``active``, 1 or 0.
    """

    control: JointControl
    start_angle: Any = 0.0
    start_stiffness: Any = 0.0

    def initial(self, measured: Mapping[str, Scalar]) -> Tree:
        """State at rest at the first set-points."""
        return self.control.initial(self.start_angle, self.start_stiffness)

    def step(
        self, state: Tree, measured: Mapping[str, Scalar], row: Tree, dt: Scalar
    ) -> tuple[Tree, dict[str, Scalar], dict[str, Scalar]]:
        """Compute one sample: commands ``flexor`` and ``extensor`` [Pa] and the row's ``moment``.

        All set-points are reported.
        """
        after, asked = self.control.step(
            state,
            row["angle"],
            row["stiffness"],
            measured["angle"],
            measured["flexor_pressure"],
            measured["extensor_pressure"],
            dt,
            row["active"],
        )
        shown = {
            "command.angle": row["angle"],
            "command.stiffness": row["stiffness"],
            "approach.angle": asked.angle,
            "approach.stiffness": asked.stiffness,
            "command.flexor_pressure": asked.flexor_set,
            "command.extensor_pressure": asked.extensor_set,
            "loop.active": jnp.asarray(row["active"], float),
        }
        commands = {"flexor": asked.flexor, "extensor": asked.extensor, "moment": row["moment"]}
        return after, commands, shown
