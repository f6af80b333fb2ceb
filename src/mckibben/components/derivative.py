"""The derivative of an elementwise formula, the one way it is taken in this package."""

from __future__ import annotations

from collections.abc import Callable

from .._jax import jax, jnp
from .module import Scalar


def derivative(function: Callable[[Scalar], Scalar], at: Scalar) -> Scalar:
    """df/dx of an elementwise function, of the shape of ``x`` (no loop and no vmap: one forward tangent)."""
    x = jnp.asarray(at, float)
    slope: Scalar = jax.jvp(function, (x,), (jnp.ones_like(x),))[1]
    return slope
