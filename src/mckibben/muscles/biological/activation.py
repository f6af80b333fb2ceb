"""Activation dynamics: first order, faster up than down.

    da/dt = (u - a) / tau,   tau = rise where u > a, else fall

The excitation u is held within 0 and 1, so an activation that starts there stays there. It stands to a biological
muscle as valve and tube stand to a McKibben muscle: it decides how soon, not how strongly, the muscle pulls. Range: a
lumped description of calcium release and uptake; single twitches and fatigue are beyond it. Fibres differ severalfold
in both time constants. The defaults of the muscle, 15 and 50 ms, are those with which the model of D. G. Thelen,
Journal of Biomechanical Engineering 125(1), 2003, doi:10.1115/1.1531112, is commonly run; here they are marked
inferred.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar


def rate(activation: Scalar, excitation: Scalar, *, rise_time: Scalar, fall_time: Scalar) -> Scalar:
    """da/dt [1/s], the shape of the arguments broadcast.

    Args:
        activation: present activation [1].
        excitation: neural drive [1], limited to 0..1.
        rise_time: time constant while the activation grows [s], positive.
        fall_time: time constant while it falls [s], positive.
    """
    missing = jnp.clip(excitation, 0.0, 1.0) - activation
    return missing / jnp.where(missing > 0.0, rise_time, fall_time)


def advance(activation: Scalar, excitation: Scalar, dt: Scalar, *, rise_time: Scalar, fall_time: Scalar) -> Scalar:
    """The activation after `dt` [s] at constant excitation [1]: the exact solution, for any step >= 0.

    Arguments as in `rate`. The sign of u - a does not change along the exponential, so one time constant holds for the
    whole step.
    """
    missing = jnp.clip(excitation, 0.0, 1.0) - activation
    # dt/tau is at least 0; -expm1 keeps the last digits of a small step.
    return activation - missing * jnp.expm1(-dt / jnp.where(missing > 0.0, rise_time, fall_time))
