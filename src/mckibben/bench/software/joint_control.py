"""Control of angle and stiffness of a joint by the pressures of two muscles: feedforward by laws, feedback of the angle.

    p = c +- d,   c = c(q*, K*),   d = d(q*, K*) + m/a(q*, K*)
    m = J q*'' + kp (q* - q) + kd (q*' - q') + I,   dI/dt = ki (q* - q),   |I| <= trim limit

c and d are the common pressure and half the difference that hold the pair at angle and stiffness (`assembly.pair_map`), a
the moment per difference; so the gains are those of a joint and not of a muscle. The set-points K* and q* are approached
through two equal lags, and q*'' and q*' are of that approach: a step would ask the valves for what they cannot. A valve that
is at the end of its range takes no part while the other still does; when both are, the integral stands still.
Range: angles and stiffnesses of the map. The stiffness is that of the muscles: who pushes slowly feels the feedback beside
it, and in the end the integral moves the joint back. With the loop off, or too quick for the valves, the muscles alone are
felt. As a rule kd and the damping of the joint together should exceed kp times the lag of the pressures.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ..._jax import Tree, jnp
from ...assembly.pair_map import PairMap
from ...components import Module, Scalar
from ...components.system import Software
from ...quantities import quantity
from .controllers import MotionEstimate, MotionState, PressureControl, TrimState, bounded, first_trim, next_trim


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
    """Control of a joint: feedforward by the map of the pair, PID on the angle, a trim of each pressure."""

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
