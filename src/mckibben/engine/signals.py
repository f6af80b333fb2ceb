"""Inputs on the sample clock: held between samples, or straight from one sample to the next, and delayed if need be."""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from ..components import Module, Scalar


class Value(NamedTuple):
    """What a system sees of a signal: its value, and its rate of change [1/s] (zero while held)."""

    value: Scalar
    rate: Scalar


class Signal(Module):
    """One value per sample, shape (samples + 1,) or (samples + 1, ...); the last one ends the last interval.

    A delay [s] need not be a whole number of samples; before its first value a signal has that value. A straight signal is
    differentiable by its delay, a held one is not.
    """

    values: Scalar
    straight: bool = eqx.field(static=True, default=False)
    delay: Scalar | None = None

    def at(self, index: Any, share: Any, period: Any) -> Value:
        """Value at a share of the sample interval that begins at `index`; period of the samples [s]."""
        if self.delay is not None:
            # In whole samples and a rest, so that a step's last stage still sees its own interval.
            late = self.delay / period
            whole = jnp.floor(late + 1e-9)
            share = share - jnp.maximum(late - whole, 0.0)
            index = index - whole.astype(int) - jnp.where(share < 0.0, 1, 0)
            share = jnp.where(index < 0, 0.0, jnp.where(share < 0.0, share + 1.0, share))
            early = index < 0
            index = jnp.maximum(index, 0)
        begin, end = self.values[index], self.values[index + 1]
        if not self.straight:
            return Value(begin, jnp.zeros_like(begin))
        rate = (end - begin) / period
        if self.delay is not None:
            rate = jnp.where(early, 0.0, rate)
        return Value(begin + (end - begin) * share, rate)

    def delayed(self, delay: Any) -> Signal:
        """The same signal later by a time [s]."""
        before = 0.0 if self.delay is None else self.delay
        return Signal(self.values, self.straight, jnp.asarray(before + delay, float))


def held(values: Any) -> Signal:
    """A signal that jumps at the samples and is constant between them: a command from a converter."""
    return Signal(jnp.asarray(values, float))


def ramped(values: Any) -> Signal:
    """A signal that is straight between the samples: a prescribed motion or a measured pressure."""
    return Signal(jnp.asarray(values, float), straight=True)
