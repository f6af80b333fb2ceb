"""Tension by the motor: PI on the measured tension with a damping of the velocity.

    f = r + kp (r - T) + I - kd V,   dI/dt = ki (r - T),   |I| <= trim limit,   |f| <= force limit

V is positive lengthening. Feedback of the force lessens the inertia of the motor that the muscle feels to m/(1 + kp), but it
is late: on a muscle of stiffness K, a lag t takes kp K t from the damping. With the paper's rig (75 g at the pulley, filter
of 200 1/s, a sample of latency at 1 kHz, 8-bit converters) and the nylon muscle, kp 0.3 with ki 10 1/s and kd 3 N s/m is
stable without any friction; 0.5 needs friction and bounces, 1 is unstable. The trim carries the friction of the motor; it is
limited since nothing else bounds it while the muscle is slack, where the tension stays below the set-point.
"""

from __future__ import annotations

from typing import Any

from ....components import Module, Scalar
from ....quantities import quantity
from .trim import TrimState, bounded, first_trim, next_trim


class ForceControl(Module):
    """Feedforward, proportional and integral on the tension, damped, bounded by the motor's force."""

    kp: Scalar = quantity("1", (0.0, 100.0), "gain of the tension", default=0.3)
    ki: Scalar = quantity("1/s", (0.0, 1e4), "integral gain of the tension", default=10.0)
    kd: Scalar = quantity("N*s/m", (0.0, 1e4), "damping of the velocity", default=3.0)
    trim_limit: Scalar = quantity("N", (0.0, 1e6), "largest correction by the integral", default=30.0)
    force_limit: Scalar = quantity("N", (1e-3, 1e6), "largest force asked of the motor", default=264.0)

    def initial(self) -> TrimState:
        """Without a trim."""
        return first_trim()

    def step(
        self, state: TrimState, set_point: Any, tension: Any, velocity: Any, dt: Any, active: Any = 1.0
    ) -> tuple[TrimState, Scalar]:
        """One sample: the new state and the force asked of the motor [N], positive lengthening.

        Args:
            state: of `initial` or of the sample before.
            set_point: of the tension [N].
            tension: measured [N].
            velocity: of the measured span [m/s], positive lengthening.
            dt: sampling period [s].
            active: 1 while the tension is controlled, else 0.
        """
        error = set_point - tension
        wanted = set_point + self.kp * error + state.trim - self.kd * velocity
        low, high = -self.force_limit, self.force_limit
        growth = self.ki * dt * error
        after = next_trim(state, growth, active, wanted=wanted, low=low, high=high, limit=self.trim_limit)
        return after, bounded(wanted, low, high)
