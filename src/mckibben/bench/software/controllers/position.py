"""Span by the motor: what the muscle pulls and the inertia are fed forward, the rest is fed back.

    f = s T + m a + kp (x - X) + kd (v - V) + I,   dI/dt = ki (x - X),   |f| <= limit

with the set-point x and its v and a, and X, V and T measured. The motor carries the muscle, so a share s of the measured
tension takes most of its stiffness out of the loop; as the tension is late, the whole of it would take the damping out too.
It begins with the rest of the tension as its integral: f = T then, and nothing jumps.
Velocity mode is the same with a set-point that grows by the set velocity. Range of the default gains, by the eigenvalues of
the sampled loop with one sample of latency, 200 1/s filters of tension and velocity and a current loop of 800 1/s: at 1 kHz
or more every error decays with 24 1/s or faster for 50 g to 0.15 kg at the pulley and springs to 20 N/mm. At 75 g, 600
samples/s are the least.
"""

from __future__ import annotations

from typing import Any

from ....components import Module, Scalar
from ....quantities import quantity
from .trim import TrimState, bounded, first_trim, next_trim


class PositionControl(Module):
    """Feedforward, proportional, derivative and integral, bounded by the motor's force."""

    kp: Scalar = quantity("N/m", (0.0, 1e7), "gain of the span", default=3000.0)
    kd: Scalar = quantity("N*s/m", (0.0, 1e5), "gain of the velocity", default=16.0)
    ki: Scalar = quantity("N/(m*s)", (0.0, 1e9), "integral gain of the span", default=1e5)
    tension_share: Scalar = quantity("1", (0.0, 1.0), "share of the tension that is fed forward", default=0.9)
    mass: Scalar = quantity("kg", (0.0, 1e3), "inertia that is fed forward", default=0.075)
    force_limit: Scalar = quantity("N", (1e-3, 1e6), "largest force asked of the motor", default=264.0)

    def initial(self, tension: Any = 0.0) -> TrimState:
        """With the share of a tension [N] that is not fed forward: it begins with a force that holds the muscle."""
        return first_trim((1.0 - self.tension_share) * tension)

    def step(
        self,
        state: TrimState,
        set_point: Any,
        set_velocity: Any,
        set_acceleration: Any,
        span: Any,
        velocity: Any,
        tension: Any,
        dt: Any,
        active: Any = 1.0,
    ) -> tuple[TrimState, Scalar]:
        """One sample: the new state and the force asked of the motor [N], positive lengthening.

        Args:
            state: of `initial` or of the sample before.
            set_point: of the span [m].
            set_velocity: its velocity [m/s], positive lengthening.
            set_acceleration: its acceleration [m/s^2].
            span: measured [m].
            velocity: of the measured span [m/s].
            tension: measured [N]; zero where nothing measures it.
            dt: sampling period [s].
            active: 1 while the span or the velocity is controlled, else 0.
        """
        error = set_point - span
        forward = self.tension_share * tension + self.mass * set_acceleration
        wanted = forward + self.kp * error + self.kd * (set_velocity - velocity) + state.trim
        low, high = -self.force_limit, self.force_limit
        growth = self.ki * dt * error
        rest = (1.0 - self.tension_share) * tension
        after = next_trim(state, growth, active, wanted=wanted, low=low, high=high, limit=self.force_limit, rest=rest)
        return after, bounded(wanted, low, high)
