"""Smooth growth of openings from 0 to 1: choices between branches, so that no derivative is halved at a tie."""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar


def share(x: Scalar) -> Scalar:
    """A number held to 0 to 1."""
    return between(x, 0.0, 1.0)


def eased(x: Scalar) -> Scalar:
    """Smooth step from 0 at x = 0 to 1 at x = 1; its slope is at most `EASED_SLOPE`."""
    y = share(x)
    return y * y * (3.0 - 2.0 * y)


EASED_SLOPE = 1.5


def switched(command: Scalar) -> Scalar:
    """Command of what is on or off, 1 above a half and else 0; what is no number stays none."""
    command = jnp.asarray(command, float)
    return jnp.where(command > 0.5, 1.0, jnp.where(command <= 0.5, 0.0, command))


def between(x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """A number held between two bounds."""
    x = jnp.asarray(x, float)
    x = jnp.where(x > high, high, x)
    return jnp.where(x < low, low, x)
