"""Inputs on the sample clock: held between samples, or straight from one sample to the next."""

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
    """One value per sample, shape (samples + 1,) or (samples + 1, ...); the last one ends the last interval."""

    values: Scalar
    straight: bool = eqx.field(static=True, default=False)

    def at(self, index: Any, share: Any, period: Any) -> Value:
        """Value at a share of the sample interval that begins at `index`; period of the samples [s]."""
        begin, end = self.values[index], self.values[index + 1]
        if self.straight:
            return Value(begin + (end - begin) * share, (end - begin) / period)
        return Value(begin, jnp.zeros_like(begin))


def held(values: Any) -> Signal:
    """A signal that jumps at the samples and is constant between them: a command from a converter."""
    return Signal(jnp.asarray(values, float))


def ramped(values: Any) -> Signal:
    """A signal that is straight between the samples: a prescribed motion or a measured pressure."""
    return Signal(jnp.asarray(values, float), straight=True)
