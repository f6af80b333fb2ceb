"""Inputs on the sample clock: held between samples, or straight from one sample to the next, and delayed if need be."""

from __future__ import annotations

from typing import Any

from .._jax import Array, Tree, jnp
from ..components import Module, Scalar, field
from ..components.system import Value as Value
from ..quantities import as_array

ROUNDING = 1e-9  # of a delay over the period, such as 0.07 s of 0.01 s: a jump at a sample is at that sample


class Signal(Module):
    """A sampled signal, shape (samples + 1,) or (samples + 1, ...); the last value ends the last interval.

    A delay [s] need not be a whole number of samples; before its first value a signal has that value. A straight signal is
    differentiable by its delay, a held one is not.
    """

    values: Array = field(converter=as_array)
    straight: bool = field(static=True, default=False)
    delay: Scalar | None = None

    def at(self, index: Tree, share: Scalar, period: Scalar) -> Value:
        """Value at a share of the sample interval that begins at `index`; period of the samples [s]."""
        if self.delay is None:
            return self._between(index, share, period, True)
        whole, rest = self._late(period)
        share = share - rest
        before = share < -ROUNDING
        index = index - whole - jnp.where(before, 1, 0)
        return self._between(jnp.maximum(index, 0), jnp.where(before, share + 1.0, share), period, index >= 0)

    def within(self, index: Tree, begin: Scalar, end: Scalar, share: Scalar, period: Scalar) -> Value:
        """Value at the fraction `share` of a step from `begin` to `end`, which are fractions of the interval at `index`.

        A held signal that is late by a part of a sample may jump inside the step. All stages then see its mean over the
        step, which keeps the second order; at the instant itself, some stages would see the old value and some the new one.
        """
        if self.straight or self.delay is None:
            return self.at(index, begin + (end - begin) * share, period)
        whole, rest = self._late(period)
        old = jnp.clip((rest - begin) / (end - begin), 0.0, 1.0)
        before, after = (self.values[jnp.maximum(index - whole - n, 0)] for n in (1, 0))
        mean = after + old * (before - after)
        return Value(mean, jnp.zeros_like(mean))

    def _late(self, period: Scalar) -> tuple[Tree, Tree]:
        """The delay as whole samples and the share that remains, which may be less than zero by rounding."""
        late = jnp.asarray(self.delay) / period
        whole = jnp.floor(late + ROUNDING)
        return whole.astype(int), late - whole

    def _between(self, index: Tree, share: Scalar, period: Scalar, started: Any) -> Value:
        begin, end = self.values[index], self.values[index + 1]
        if not self.straight:
            return Value(begin, jnp.zeros_like(begin))
        # before its first value a signal rests there
        moved = jnp.where(started, end - begin, 0.0)
        return Value(begin + moved * share, moved / period)

    def delayed(self, delay: Scalar) -> Signal:
        """Return the signal delayed by a time [s]."""
        before = 0.0 if self.delay is None else self.delay
        return Signal(self.values, self.straight, jnp.asarray(before + delay, float))


def held(values: Scalar) -> Signal:
    """A signal that jumps at the samples and is constant between them: a command from a converter."""
    return Signal(as_array(values))


def ramped(values: Scalar) -> Signal:
    """A signal that is straight between the samples: a prescribed motion or a measured pressure."""
    return Signal(as_array(values), straight=True)
