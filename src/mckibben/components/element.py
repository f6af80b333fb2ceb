"""Interfaces of force elements with and without memory.

All of them pull like the muscle does: a force is positive when it opposes lengthening. An element without memory
knows its length and velocity; one with memory is advanced along a straight piece of path, half a step of the
integrator at a time, and is told the pressure at both ends of it: friction moves first and is limited once, by the
yield at the end, while a gradual relaxation takes the mean of both. The order of the whole integration rests on that
sequence.
"""

from __future__ import annotations

import abc
from typing import ClassVar, NamedTuple

from .module import Module, Scalar


class ForceElement(Module):
    """A force that depends on the present length and velocity only.

    Passive: ``force(L, 0)`` is the slope of `stored_energy`, and what the velocity adds never drives the motion.
    """

    @abc.abstractmethod
    def force(self, length: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Tension [N], shape of the arguments broadcast.

        Args:
            length: length of the element [m].
            velocity: its rate, positive while lengthening [m/s].
        """

    @abc.abstractmethod
    def stored_energy(self, length: Scalar) -> Scalar:
        """Elastic energy at a length [J]."""


class Advanced(NamedTuple):
    """State of an element with memory after a part of its path, and the ledger of that part.

    The work taken from the outside is the stored energy gained plus the energy dissipated, to rounding.
    """

    state: Scalar  # like the state before
    work: Scalar  # [J], taken from the outside
    dissipated: Scalar  # [J], >= 0


class MemoryElement(Module):
    """A force that depends on the path of the length.

    The state is an array whose last axis counts the parts of the element; displacements, pressures and forces have the
    axes before it. So one state serves a single muscle, and a state with leading axes a batch.
    """

    title: ClassVar[str]
    cites: ClassVar[tuple[str, ...]]

    @abc.abstractmethod
    def initial(self) -> Scalar:
        """The relaxed state, shape (parts,)."""

    @abc.abstractmethod
    def advance(
        self, state: Scalar, displacement: Scalar, *, start_pressure: Scalar, end_pressure: Scalar, duration: Scalar
    ) -> Advanced:
        """Advance along a straight part of the path.

        Args:
            state: where the element stands, shape (..., parts).
            displacement: change of length, positive while lengthening [m].
            start_pressure: gauge pressure before [Pa].
            end_pressure: gauge pressure after [Pa].
            duration: time taken [s]; of no consequence to friction that does not depend on velocity.
        """

    @abc.abstractmethod
    def force(self, state: Scalar, velocity: Scalar = 0.0, pressure: Scalar = 0.0) -> Scalar:
        """Force [N], positive when it opposes lengthening; velocity [m/s] and pressure [Pa] matter to few."""

    @abc.abstractmethod
    def stored_energy(self, state: Scalar) -> Scalar:
        """Elastic energy held [J]."""


class Hysteresis(MemoryElement):
    """Friction: an element with memory whose force is bounded by a limit that may grow with the pressure.

    Passive over any path, and a change of pressure alone takes no work from anywhere: a shrinking limit releases stored
    energy as heat, a growing one stores nothing.
    """

    @abc.abstractmethod
    def largest_force(self, pressure: Scalar) -> Scalar:
        """The friction that a long motion reaches at a gauge pressure [Pa], >= 0 [N]."""

    @abc.abstractmethod
    def lubricated(self, factor: float = 0.9) -> Hysteresis:
        """Return the friction with its limit scaled by a factor; 0.9 holds for three lubricants on the nylon muscle."""
