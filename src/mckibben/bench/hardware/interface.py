"""Interface between the sample loop and a machine, in integer counts of its converters.

    wait(k) -> counts, edges -> the software -> write(valve, motor, opened)

What counts stand for is the matter of `Converters`, which is one for every machine. So a machine in the same process, one
behind a serial line and one behind a data acquisition card give the same run where they give the same counts. Nothing here
knows units, limits or protocols; a machine only has to vent whenever it is told to, and when it is told nothing for long.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
from operator import index
from typing import NamedTuple, Protocol

import numpy as np

from ...documents import JsonValue
from ...errors import InputError

LARGEST = 2**32 - 1  # count that a line carries


class WaitInterrupted(Exception):  # noqa: N818  # it reports no error: the loop was asked to leave
    """A `Hardware.wait` ended without a sample, since `Hardware.interrupt` was called."""


class Hardware(abc.ABC):
    """A machine that is sampled by a clock, simulated or real.

    A backend calls the constructor, keeps `counts` and `edges` up to date in `wait`, and implements the abstract methods.
    What a machine can do beyond that (`paced`, `statistics`, `look`, `state`) it says itself; the defaults are those of a
    real machine, of which nobody knows more than it measures.

    Args:
        names: analogue channels, in the order of their counts.
        encoder: whether there is an encoder.
        motor: whether there is an output to a motor.
        motor_rest: count at which the motor does nothing.

    Attributes:
        counts: counts of the analogue channels at the newest sample, in the order of `names`.
        edges: count of the encoder at the newest sample, with its sign; 0 where it was zeroed, and without an encoder.
        valve: count written to the valve.
        motor: count written to the motor.
        opened: whether the shut-off, where there is one, was asked to be open.
        venting: whether the machine was told to vent; then no count that is written to the valve takes effect.
    """

    paced = True  # its samples come at times of their own; False: every sample is there when it is asked for

    def __init__(self, names: Sequence[str], *, encoder: bool, motor: bool, motor_rest: int = 0) -> None:
        self.names, self.has_encoder, self.has_motor = tuple(names), encoder, motor
        self.counts: Sequence[int] = (0,) * len(self.names)
        self.edges = 0
        self.valve, self.motor, self.opened, self.venting = 0, motor_rest, True, False

    @abc.abstractmethod
    def start(self, period: float) -> None:
        """Zero the encoder and begin to sample with a period [s]; sample 0 is the next one."""

    @abc.abstractmethod
    def wait(self, sample: int) -> float:
        """Wait for a sample, counted from 0, and read its counts; return its lateness [s].

        Raises:
            LineLostError: if it will not come any more; says why.
            WaitInterrupted: if `interrupt` was called.
        """

    def write(self, valve: int, motor: int | None = None, *, opened: bool = True) -> None:
        """Set the counts of the outputs, which take effect at once; None leaves the motor's count unchanged.

        Raises:
            InputError: if one is no count.
            LineLostError: if nobody is there to take them.
        """
        self.valve, self.opened = _count("valve", valve), bool(opened)
        if motor is not None and self.has_motor:
            self.motor = _count("motor", motor)
        self.send()

    @abc.abstractmethod
    def send(self) -> None:
        """Make the written counts take effect; while `venting`, count 0 and an open shut-off.

        Raises:
            LineLostError: if nobody is there to take them.
        """

    def vent(self) -> None:
        """Vent at once, overriding later writes; may be called from any thread."""
        self.venting = True
        self._vent_now()

    @abc.abstractmethod
    def _vent_now(self) -> object:
        """Tell the machine to vent without waiting for the next sample."""

    @abc.abstractmethod
    def close(self) -> None:
        """Vent, and release the machine; may be called twice."""

    def interrupt(self) -> None:
        """Interrupt every `wait` that may last longer than a sample, also in another thread, until `proceed`."""
        return

    def proceed(self) -> None:
        """Allow `wait` again after `interrupt`."""
        return

    @property
    def identity(self) -> Mapping[str, JsonValue]:
        """What the machine says of itself, such as its firmware and converters, for a report; empty if it says nothing."""
        return {}

    @property
    def statistics(self) -> NamedTuple | None:
        """Statistics of the connection, or None if there is no connection."""
        return None

    def look(self) -> np.ndarray | None:
        """True state at the newest sample, as a vector for `true_outputs`; None if it is unknown."""
        return None

    def true_outputs(self, looks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
        """True channels of some samples, (n,) each, from the vectors that `look` returned."""
        return {}

    def state(self) -> np.ndarray | None:
        """Complete state of a simulated machine between two samples, as a constant vector; None for a real machine."""
        return None


class CountedMachine(Protocol):
    """A machine of integer counts, advanced sample by sample, that a simulated card or device operates."""

    @property
    def names(self) -> tuple[str, ...]:
        """Analogue channels, in the order of the counts of a sample."""

    def sample(self) -> tuple[Sequence[int], int]:
        """Counts of the channels, and of the encoder (0 if there is none)."""

    def advance(self, valve: int, motor: int, opened: bool) -> None:
        """Compute the physics of one period for given counts of the outputs and state of the shut-off."""


def _count(field: str, value: int) -> int:
    try:
        count = index(value)
    except TypeError:
        count = -1
    if not 0 <= count <= LARGEST:
        raise InputError(field, value, f"must be a count from 0 to {LARGEST}")
    return count
