"""What a force element with memory and one without must offer.

An element with memory is advanced by the displacement of one half-step and then limited once by the yield at the
half-step's end: the order of the whole integration rests on that sequence (see the decision on friction).
"""

from __future__ import annotations

import abc
from typing import Any

from .module import Module, Scalar


class ForceElement(Module):
    """A force that depends on the present stretch and velocity only."""

    @abc.abstractmethod
    def force(self, length: Any, velocity: Any = 0.0) -> Scalar:
        """Tension [N], shape of the arguments broadcast.

        Args:
            length: length of the element [m].
            velocity: its rate, positive while lengthening [m/s].
        """


class Hysteresis(Module):
    """Friction with memory: a force that depends on the path of the length.

    The state is an array of at least one number per element; `initial` gives the relaxed one. Every implementation is
    passive: over any path the work taken from the outside is the stored energy gained plus a dissipation >= 0.
    """

    @abc.abstractmethod
    def initial(self) -> Scalar:
        """The relaxed state."""

    @abc.abstractmethod
    def advance(self, state: Scalar, displacement: Any, pressure: Any) -> Scalar:
        """The state after a displacement [m], with the yield at the pressure of its end [Pa]."""

    @abc.abstractmethod
    def force(self, state: Scalar, pressure: Any) -> Scalar:
        """Friction force [N], positive while lengthening."""

    @abc.abstractmethod
    def stored_energy(self, state: Scalar, pressure: Any) -> Scalar:
        """Elastic energy held by the contacts [J]."""
