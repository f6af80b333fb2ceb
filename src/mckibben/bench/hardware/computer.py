"""Timing of the computer: a timer triggers each sample, and its outputs change a latency later.

    dt = n dt0,   n the whole number nearest to 1/(f dt0)

dt0 is the timer's resolution: of 3 kHz asked for, a timer of 1 us makes 333 us. Range: interrupts come on time; a computer
that misses one is not shown. Defaults, but for the latency: the machine of C.-P. Chou and B. Hannaford, IEEE Trans.
Robotics and Automation 12(1), 1996, doi:10.1109/70.481753, with 1 kHz for all channels and 5 kHz at most.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...components import Module, Scalar
from ...engine import STEP
from ...errors import InputError
from ...quantities import quantity

ROUNDING = 1e-9  # share by which a whole number of steps or ticks may be missed


class Computer(Module):
    """The clock of the computer, and the latency of its outputs."""

    timer_resolution: Scalar = quantity("s", (1e-9, 1e-2), "tick of the timer", default=1e-6)
    highest_rate: Scalar = quantity("1/s", (1.0, 1e5), "most samples per second", default=5000.0)
    lowest_rate: Scalar = quantity("1/s", (1e-3, 1e4), "fewest samples per second", default=1.0)
    lowest_motor_rate: Scalar = quantity(
        "1/s", (1.0, 1e5), "fewest samples per second with which the gains of span and force are stable", default=1000.0
    )
    latency: Scalar = quantity("s", (0.0, 1.0), "from sampling to new outputs", typical=(1e-4, 1e-2), default=1e-3)

    def __check_init__(self) -> None:
        """Refuse a clock without a usable rate."""
        low, high, tick = float(self.lowest_rate), float(self.highest_rate), float(self.timer_resolution)
        if low > high:
            raise InputError(
                "lowest_rate", None, f"must be at most {high:g} 1/s, the highest, got {low:g} 1/s", where="Computer"
            )
        if low * tick > 1.0:
            problem = f"must be at most {1.0 / low:g} s, the longest period, got {tick:g} s"
            raise InputError("timer_resolution", None, problem, where="Computer")

    def period(self, sample_rate: float) -> float:
        """Sample period of the timer for a rate [1/s] [s].

        Raises:
            InputError: if the computer cannot run at this rate.
        """
        low, high, tick = float(self.lowest_rate), float(self.highest_rate), float(self.timer_resolution)
        if not low <= sample_rate <= high:
            problem = f"must be between {low:g} 1/s and {high:g} 1/s, got {sample_rate:g} 1/s"
            raise InputError("sample_rate", None, problem, where="computer")
        fewest = math.ceil((1.0 - ROUNDING) / (high * tick))  # rounding must not make it faster than it can be
        return max(round(1.0 / (sample_rate * tick)), fewest, 1) * tick

    def samples_per_sample(self, sample_rate: float) -> int:
        """Samples of a loop that moves the motor per sample of a protocol with this rate [1/s].

        Raises:
            InputError: if the computer is too slow for the gains, or for the whole multiple of the protocol's rate.
        """
        needed, high = float(self.lowest_motor_rate), float(self.highest_rate)
        every = math.ceil(needed / sample_rate * (1.0 - ROUNDING)) if sample_rate < needed else 1
        if every > 1 and every * sample_rate > high * (1.0 + ROUNDING):
            problem = (
                f"too low for a protocol that moves the motor: its loop needs {every * sample_rate:g} Hz, the first "
                f"multiple of {sample_rate:g} Hz from {needed:g} Hz on, and the computer samples at {high:g} Hz at most; "
            )
            problem += (
                "state a higher rate of the protocol"
                if high >= needed
                else "use a faster computer, or state gains for a slower loop and its computer.lowest_motor_rate"
            )
            raise InputError("sample_rate", f"{sample_rate:g} Hz", problem, where="computer")
        return every

    def steps(self, sample_rate: float, largest_step: float) -> int:
        """Number of integration steps in a period, so that none is longer than a time [s].

        Raises:
            InputError: if the computer cannot run at this rate, or the step is no time.
        """
        if not (largest_step > 0.0 and math.isfinite(largest_step)):
            raise InputError("largest_step", largest_step, "must be a time above 0 s", where="computer")
        return max(1, math.ceil(self.period(sample_rate) / largest_step * (1.0 - ROUNDING)))


class Timing(NamedTuple):
    """The timing of a sample loop."""

    period: float  # period of the samples, a whole number of timer ticks [s]
    inner: int  # steps of the physics per sample
    latency: float  # from a sample to the action of its commands [s]
    depth: int  # samples for which commands are kept, for latency and dead times

    @property
    def sample_rate(self) -> float:
        """Samples per second."""
        return 1.0 / self.period


def configure(computer: Computer, sample_rate: float, *, dead_time: float = 0.0, step: float = STEP) -> Timing:
    """Return the timing of a run.

    Args:
        computer: that runs the loop.
        sample_rate: wanted [1/s].
        dead_time: longest of any part that is commanded [s].
        step: largest step of the physics [s].

    Raises:
        InputError: if the computer cannot sample so fast or so slowly.
    """
    period = computer.period(sample_rate)
    latency = float(computer.latency)
    return Timing(period, computer.steps(sample_rate, step), latency, math.ceil((latency + dead_time) / period) + 2)
