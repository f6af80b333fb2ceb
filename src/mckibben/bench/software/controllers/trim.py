"""The integral of a controller, which stands still where it could only push an output further beyond its limits."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from ....components import Scalar


class TrimState(NamedTuple):
    """What the integral adds to the output [unit of the output]."""

    trim: Scalar


def first_trim(trim: Any = 0.0) -> TrimState:
    """That of a controller that begins [unit of the output]."""
    return TrimState(jnp.asarray(trim, float))


def bounded(x: Any, low: Any, high: Any) -> Scalar:
    """The nearest value within low..high."""
    return jnp.where(x > high, high, jnp.where(x < low, low, x))


def next_trim(
    state: TrimState, growth: Any, active: Any, *, wanted: Any, low: Any, high: Any, limit: Any, rest: Any = 0.0
) -> TrimState:
    """The trim one sample later.

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
