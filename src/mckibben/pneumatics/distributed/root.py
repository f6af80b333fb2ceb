"""The root of one falling relation, bracketed: the speed at an end of the tube."""

from __future__ import annotations

from collections.abc import Callable

from ..._jax import jax, jnp
from ...components import Scalar

# The root is sought until the residual is this share of its largest value. That takes 4-8 steps, and more only at the kink
# of an almost sharp orifice.
ROOT_SHARE, ROOT_STEPS = 1e-13, 40


def falling_root(residual: Callable[[Scalar], Scalar], highest: Scalar) -> tuple[Scalar, Scalar]:
    """Zero of a falling residual in [0, highest], and the remaining residual, 0 if it vanishes.

    Regula falsi in which an end that stays twice counts less: N. Anderson and A. Bjorck, BIT 13, 1973,
    doi:10.1007/BF01951936. It needs no derivative, which an orifice near equal pressures may not have.
    """
    at_zero, at_highest = residual(jnp.zeros_like(highest)), residual(highest)
    enough = ROOT_SHARE * jnp.maximum(jnp.abs(at_zero), jnp.abs(at_highest))

    def narrow(bracket: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        low, high, at_low, at_high, moved, best, least, steps = bracket
        speed = jnp.clip(low + (high - low) * at_low / (at_low - at_high), low, high)
        now = residual(speed)
        up = jnp.where(now > 0.0, 1.0, -1.0)  # which end moves
        # An end that stays twice counts less, so that it does not stay for ever.
        shrink = 1.0 - now / jnp.where(up > 0.0, at_low, at_high)
        shrink = jnp.where(moved == up, jnp.where(shrink > 0.0, shrink, 0.5), 1.0)
        better = jnp.abs(now) < least
        return (
            jnp.where(up > 0.0, speed, low),
            jnp.where(up > 0.0, high, speed),
            jnp.where(up > 0.0, now, shrink * at_low),
            jnp.where(up > 0.0, shrink * at_high, now),
            up,
            jnp.where(better, speed, best),
            jnp.where(better, jnp.abs(now), least),
            steps + 1.0,
        )

    def going(bracket: tuple[Scalar, ...]) -> Scalar:
        return (at_highest < 0.0) & (bracket[6] > enough) & (bracket[7] < ROOT_STEPS)

    zero = jnp.zeros_like(highest)
    start: tuple[Scalar, ...] = (zero, highest, at_zero, at_highest, zero, zero, jnp.abs(at_zero), zero)
    speed = jax.lax.while_loop(going, narrow, start)[5]
    left = jnp.maximum(at_highest, 0.0)
    return jnp.where(left > 0.0, highest, speed), left
