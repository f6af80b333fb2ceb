"""Adam, by which the networks of the benchmark learn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..._jax import jax, jnp

DECAY_FIRST, DECAY_SECOND, SMALL, CLIP = 0.9, 0.999, 1e-8, 1.0


def adam(value_and_slope: Callable[[Any], Any], start: Any, *, steps: int, rate: float, until: Any = None) -> Any:
    """Descend with a rate that falls to zero by a cosine, and gradients clipped to a norm of one.

    Args:
        value_and_slope: of the weights; the value is what is returned for each step.
        start: weights, a dict of arrays.
        steps: number of steps.
        rate: first rate.
        until: step from which the weights stay as they are; `steps` by default.

    Returns:
        The weights, and the value before each step.

    Source: D. P. Kingma and J. Ba, Adam: a method for stochastic optimization, ICLR 2015.
    """
    last = steps if until is None else until
    tree = jax.tree_util.tree_map

    def step(carry: Any, i: Any) -> Any:
        weights, first, second = carry
        value, slope = value_and_slope(weights)
        norm = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree_util.tree_leaves(slope)))
        slope = tree(lambda g: jnp.nan_to_num(g * jnp.minimum(1.0, CLIP / (norm + SMALL))), slope)
        first = tree(lambda m, g: DECAY_FIRST * m + (1.0 - DECAY_FIRST) * g, first, slope)
        second = tree(lambda v, g: DECAY_SECOND * v + (1.0 - DECAY_SECOND) * g * g, second, slope)
        count = i + 1.0
        pace = jnp.where(i < last, rate * 0.5 * (1.0 + jnp.cos(jnp.pi * i / steps)), 0.0)

        def moved(w: Any, m: Any, v: Any) -> Any:
            size = jnp.sqrt(v / (1.0 - DECAY_SECOND**count)) + SMALL
            return (w - pace * (m / (1.0 - DECAY_FIRST**count)) / size).astype(w.dtype)

        return (tree(moved, weights, first, second), first, second), value

    zero = tree(jnp.zeros_like, start)
    carry, values = jax.lax.scan(step, (start, zero, zero), jnp.arange(steps, dtype=jnp.float32))
    return carry[0], values
