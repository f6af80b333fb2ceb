"""The end non-linearity nl(L) of eq. 12: the stiff end of the stroke, where the braid is no cylinder any more.

Chou and Hannaford name it and leave it out of their regular range. Here it is a one-sided parabola: zero with zero slope
inside the working range, so that no printed value changes, and stiffening beyond.
"""

from __future__ import annotations

from .._jax import jnp
from ..components import Scalar


def stop_tension(length: Scalar, *, begins_at: Scalar, stiffness: Scalar) -> Scalar:
    """nl(L) = knl max(L - Lnl, 0)^2 [N]; lengths [m], stiffness knl [N/m^2]."""
    beyond = length - begins_at
    beyond = jnp.where(beyond < 0.0, 0.0, beyond)
    return stiffness * (beyond * beyond)
