"""The hardware border: what a loop by the wall clock needs of a machine, in whole counts of its converters.

    wait(k) -> analog_in.read(), encoder.read() -> the software -> valve.write(..), motor.write(..) -> send()

Left of the border are counts only: what they stand for is the matter of `Converters`, which is one for every machine. So a
machine in the same process, one behind a serial line and one behind a data acquisition card give the same run where they
give the same counts. Nothing here knows units, limits or protocols; a machine only has to vent whenever it is told to, and
when it is told nothing for too long.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class AnalogIn(Protocol):
    """Analogue inputs, all converted at the same sample (each with its own skew)."""

    @property
    def names(self) -> tuple[str, ...]:
        """The channels in their order."""

    def read(self) -> Sequence[int]:
        """Counts of the newest sample, in the order of the names."""


class EncoderIn(Protocol):
    """A counter of an encoder's edges."""

    def read(self) -> int:
        """Count at the newest sample, with its sign; 0 where it was zeroed."""


class AnalogLine(Protocol):
    """An analogue output that holds its count until the next one, such as the motor's."""

    def write(self, count: int) -> None:
        """Put a count; it takes effect with `Hardware.send`."""


class Valve(Protocol):
    """The output to the valve, and to the shut-off where there is one."""

    def write(self, count: int, *, opened: bool = True) -> None:
        """Put a count, and whether the shut-off is open; they take effect with `Hardware.send`."""

    def vent(self) -> None:
        """Count zero and an open shut-off at once, and whatever is written later; may be called from another thread."""


class Hardware(Protocol):
    """A machine that is sampled by the clock. `encoder` and `motor` are None where it has none."""

    @property
    def analog_in(self) -> AnalogIn:
        """The analogue channels."""

    @property
    def encoder(self) -> EncoderIn | None:
        """The encoder, zeroed where the run begins."""

    @property
    def motor(self) -> AnalogLine | None:
        """The output to the motor's amplifier."""

    @property
    def valve(self) -> Valve:
        """The output to the valve."""

    def start(self, period: float) -> None:
        """Zero the encoder and begin to sample with a period [s]; sample 0 is the next one."""

    def wait(self, sample: int) -> float:
        """Until a sample is there, counted from 0; how much later than it should it is there [s].

        Raises:
            LineLostError: if it will not come any more; says why.
        """

    def send(self) -> None:
        """Let what was written since the sample take effect.

        Raises:
            LineLostError: if nobody is there to take it.
        """

    def close(self) -> None:
        """Vent, and let go of the machine; may be called twice."""


class Machine(Protocol):
    """What a simulated card or device has around it: a machine that gives and takes counts, sample by sample."""

    @property
    def names(self) -> tuple[str, ...]:
        """The analogue channels, in the order of the counts of a sample."""

    def sample(self) -> tuple[Sequence[int], int]:
        """Counts of the channels, and of the encoder (0 where there is none)."""

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """The physics of one period with these counts of the outputs, and whether the shut-off is open."""
