"""Analogue input and output: transducer, filter and converter, and the converter that holds an output.

    Converter:   n = clip(round((x - low)/q), 0, 2^bits - 1),   x(n) = low + n q,   q = (high - low)/2^bits
    Filter:      dy/dt = 2 pi fc (sat(x) - y)
    Reading:     (1 + g) y(t + ts) + b + s d,   y(t + ts) = y + (1 - exp(-2 pi fc ts)) (sat(x) - y)

A converter shows its highest value one count below `high`, as binary converters do: so zero is a count wherever the range
is symmetric about it. Each channel converts a skew ts after the sample; its filtered signal is then taken as if the signal
stood still meanwhile, which misses terms of second order in ts. sat limits to the transducer's range, g and b are errors
of gain and offset, s the noise's rms value and d a draw of the normal distribution that the caller brings. Range: one
pole; white noise; no drift. The paper's machine has 8 bits, 0 to 6.8 bar and 0 to 100 N: C.-P. Chou and B. Hannaford, IEEE
Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..._jax import is_traced, jnp
from ...components import Module, Scalar, field
from ...components.programs import evaluated
from ...errors import InputError
from ...quantities import quantity
from .stand import Encoder

BITS = (2, 24)
LARGEST = 1e9  # of the ranges below, which are in the unit of their channel, SI


class Scale(Module):
    """Scale of integer counts; low and high in the unit of the channel."""

    bits: int = field(static=True, kw_only=True, default=8)
    low: Scalar = quantity("1", (-LARGEST, LARGEST), "value of count zero, in the unit of the channel")
    high: Scalar = quantity("1", (-LARGEST, LARGEST), "one count above the highest, in the unit of the channel")

    def __check_init__(self) -> None:
        """Refuse an invalid number of bits, and a reversed range."""
        kind = type(self).__name__
        if type(self.bits) is not int or not BITS[0] <= self.bits <= BITS[1]:
            raise InputError("bits", str(self.bits), f"must be a whole number from {BITS[0]} to {BITS[1]}", where=kind)
        _rising(self.low, self.high, kind)

    @property
    def counts(self) -> float:
        """Number of counts, 2^bits."""
        return 2.0**self.bits

    @property
    def resolution(self) -> Scalar:
        """One count [unit of the channel]."""
        return (self.high - self.low) / self.counts

    @property
    def top(self) -> Scalar:
        """Highest value of the scale [unit of the channel]."""
        return self.value(self.counts - 1.0)

    @evaluated
    def code(self, value: Scalar) -> Scalar:
        """Nearest count to a value, a whole number as a float, limited to the range. NaN stays NaN."""
        count = jnp.floor((value - self.low) / self.resolution + 0.5)
        last = self.counts - 1.0
        return jnp.where(count < 0.0, 0.0, jnp.where(count > last, last, count))

    @evaluated
    def value(self, code: Scalar) -> Scalar:
        """Convert a count to the value of the channel [unit of the channel]."""
        return self.low + code * self.resolution


class Converter(Scale):
    """Analogue-to-digital converter."""

    skew: Scalar = quantity("s", (0.0, 1e-2), "time after the sample at which this channel converts", default=0.0)


class AnalogOut(Scale):
    """Digital-to-analogue converter, which holds its value until the next one."""

    @evaluated
    def count(self, command: Scalar) -> Scalar:
        """Count for a command [unit of the channel]; for NaN the count nearest to zero."""
        return self.code(jnp.where(jnp.isfinite(command), command, 0.0))

    def output(self, command: Scalar) -> Scalar:
        """Held value for a command [unit of the channel]."""
        return self.value(self.count(command))


class Sensor(Module):
    """A transducer with amplifier and filter, and its converter; low to noise in the unit of the channel.

    Its converter may reach beyond the transducer's range: with a live zero, readings below the range tell a broken one.
    """

    converter: Converter = field(kw_only=True)
    low: Scalar = quantity("1", (-LARGEST, LARGEST), "lowest that the transducer sees, in the unit of the channel")
    high: Scalar = quantity("1", (-LARGEST, LARGEST), "highest that the transducer sees, in the unit of the channel")
    offset: Scalar = quantity(
        "1", (-LARGEST, LARGEST), "reading at zero, in the unit of the channel", symbol="b", default=0.0
    )
    gain_error: Scalar = quantity("1", (-0.9, 10.0), "error of the gain, as a share of it", symbol="g", default=0.0)
    noise: Scalar = quantity("1", (0.0, LARGEST), "rms noise, in the unit of the channel", symbol="s", default=0.0)
    # A faster pole than the highest is none to steps of 50 us, and would not be stable with them.
    cutoff: Scalar = quantity(
        "1/s", (0.01, 8e3), "corner frequency of the filter, Hz", symbol="fc", typical=(20.0, 2e3), default=1000.0
    )

    def __check_init__(self) -> None:
        """Refuse a reversed range."""
        _rising(self.low, self.high, "Sensor")

    @property
    def resolution(self) -> Scalar:
        """One count [unit of the channel]."""
        return self.converter.resolution

    def seen(self, x: Scalar) -> Scalar:
        """Output of the transducer for a true value, saturated at the ends of its range."""
        return jnp.where(x < self.low, self.low, jnp.where(x > self.high, self.high, x))

    def initial(self, x: Scalar) -> Scalar:
        """Filtered signal, settled at a true value."""
        return self.seen(x)

    def rate(self, y: Scalar, x: Scalar) -> Scalar:
        """Rate of the filtered signal y at a true value x [unit of the channel/s]."""
        return 2.0 * math.pi * self.cutoff * (self.seen(x) - y)

    def reading(self, y: Scalar, x: Scalar, draw: Scalar = 0.0, lost: Scalar = 0.0) -> tuple[Scalar, Scalar]:
        """Reading of the computer, and its count.

        Args:
            y: filtered signal at the sample.
            x: true value at the sample.
            draw: draw of the normal distribution of variance 1, new for each sample.
            lost: 1 where a wire is open, which drives the converter to its upper rail; else 0.
        """
        share = -jnp.expm1(-2.0 * math.pi * self.cutoff * self.converter.skew)
        late = y + share * (self.seen(x) - y)
        code = self.converter.code((1.0 + self.gain_error) * late + self.offset + self.noise * draw)
        code = jnp.where(jnp.asarray(lost) > 0.5, self.converter.counts - 1.0, code)
        return self.converter.value(code), code


def _rising(low: Scalar, high: Scalar, where: str) -> None:
    if is_traced(low) or is_traced(high) or not hasattr(low, "shape"):
        return
    if not np.all(np.asarray(low) < np.asarray(high)):
        raise InputError("high", float(np.min(high)), f"must be more than low, {float(np.max(low)):.6g}", where=where)


SPAN = "span"
OUTPUTS = ("valve", "motor", "open")


class Converters(Module):
    """Inputs and outputs of a rig as its software knows them.

        measured = gain (low + n q - zero)        a channel without a calibration has gain 1 and zero 0
        span = mounted + n r              with gain: mounted + gain n r, since the encoder is zeroed where it is mounted

    One for every machine, simulated or real: where the counts are the same, so are the measured channels, to the last
    bit.

    Attributes:
        analog: wiring of every analogue channel.
        encoder: encoder of the span, where there is one.
        valve: output to the valve.
        motor: output to the motor; None passes the force [N] as it is, which no real machine can.
        mounted: span at which the encoder was zeroed [m].
        gain: gain of the calibrated channels, true over indicated.
        zero: their reading at zero [unit of the channel].
    """

    analog: dict[str, Converter]
    encoder: Encoder | None
    valve: AnalogOut
    motor: AnalogOut | None
    mounted: Scalar
    gain: dict[str, Scalar]
    zero: dict[str, Scalar]

    @property
    def names(self) -> tuple[str, ...]:
        """Analogue channels in the order of their counts."""
        return tuple(sorted(self.analog))

    def read(self, counts: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Convert counts by channel to measured channels [SI]."""
        values = {n: self.true(n, self.analog[n].value(counts[n])) for n in self.names if n in counts}
        if self.encoder is not None and SPAN in counts:
            travel = self.encoder.span(counts[SPAN], 0.0)
            values[SPAN] = self.mounted + self.true(SPAN, travel)
        return values

    def true(self, name: str, indicated: Scalar) -> Scalar:
        """Apply the calibration of a channel, if any, to a nominal value [SI]."""
        if name not in self.gain:
            return indicated
        return self.gain[name] * (indicated - self.zero[name])

    def write(self, commands: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Convert commands [SI] to counts of the outputs; ``open`` is 1 or 0."""
        motor = commands["motor"]
        return {
            "valve": self.valve.count(commands["valve"]),
            "motor": motor if self.motor is None else self.motor.count(motor),
            "open": jnp.where(commands["open"] > 0.5, 1.0, 0.0),
        }

    def held(self, counts: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Convert counts to the held values of the outputs [SI]."""
        motor = counts["motor"]
        return {
            "valve": self.valve.value(counts["valve"]),
            "motor": motor if self.motor is None else self.motor.value(motor),
            "open": counts["open"],
        }
