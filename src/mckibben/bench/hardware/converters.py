"""Conversion of counts of a machine: nominal scales of the converters, and their calibration.

    measured = gain (low + n q - zero)        a channel without a calibration has gain 1 and zero 0
    span = mounted + n r                      with gain: mounted + gain n r, since the encoder is zeroed where it is mounted

One for every machine, simulated or real: where the counts are the same, so are the measured channels, to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..._jax import jnp
from ...components import Module, Scalar
from .analogue import AnalogOut, Converter
from .motor import Encoder

SPAN = "span"
OUTPUTS = ("valve", "motor", "open")


class Converters(Module):
    """Inputs and outputs of a rig as its software knows them.

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
