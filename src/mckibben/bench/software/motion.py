"""Velocity from a span that an encoder counts: the difference over a sample, through one pole.

    raw_k = (x_k - x_{k-1})/dt,   v_k = v_{k-1} + (1 - exp(-2 pi f dt)) (raw_k - v_{k-1})

It is late by half a sample and the pole's 1/(2 pi f). A count of size r makes a ripple of at most r/dt times the pole's
share: 2e-5 m at 1 kHz and 200 1/s is 1.4 cm/s. Range: any sampling period.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import jax.numpy as jnp

from ...components import Module, Scalar
from ...quantities import quantity


class MotionState(NamedTuple):
    """Span of the sample before [m] and the velocity [m/s]."""

    span: Scalar
    velocity: Scalar


class MotionEstimate(Module):
    """How fast the span changes, as far as counts can tell."""

    cutoff: Scalar = quantity("1/s", (0.1, 1e5), "corner of the velocity filter", symbol="f", default=200.0)

    def initial(self, span: Any) -> MotionState:
        """At rest at a span [m]."""
        start = jnp.asarray(span, float)
        return MotionState(start, jnp.zeros_like(start))

    def step(self, state: MotionState, span: Any, dt: Any) -> tuple[MotionState, Scalar]:
        """One sample later: the new state and the velocity [m/s], positive lengthening.

        Args:
            state: of `initial` or of the sample before.
            span: measured [m].
            dt: sampling period [s].
        """
        share = 1.0 - jnp.exp(-2.0 * math.pi * self.cutoff * dt)
        velocity = state.velocity + share * ((span - state.span) / dt - state.velocity)
        return MotionState(jnp.asarray(span, float), velocity), velocity
