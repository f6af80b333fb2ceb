"""Timing configuration: sample rate, timer ticks, steps of the physics, latency, and how far back commands are kept."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...engine import STEP
from ..hardware.computer import Computer


class Timing(NamedTuple):
    """What the sampled loop runs by.

    Attributes:
        period: of the samples, a whole number of timer ticks [s].
        inner: steps of the physics per sample.
        latency: from a sample to the action of its commands [s].
        depth: samples for which commands are kept, for latency and dead times.
    """

    period: float
    inner: int
    latency: float
    depth: int

    @property
    def sample_rate(self) -> float:
        """Samples per second."""
        return 1.0 / self.period


def configure(computer: Computer, sample_rate: float, *, dead_time: float = 0.0, step: float = STEP) -> Timing:
    """The timing of a run.

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
