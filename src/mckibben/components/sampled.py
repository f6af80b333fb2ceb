"""Interfaces of sampled systems: a machine with measurements, and the software that commands it."""

from __future__ import annotations

import abc
from collections.abc import Mapping

from .._jax import Tree
from .module import Module, Scalar
from .system import System, Value


class Plant(System):
    """A system with converters: software sees its measured channels only, and sets its inputs once per sample."""

    @abc.abstractmethod
    def sense(self, state: Tree, memory: Tree, inputs: Mapping[str, Value], row: Tree) -> dict[str, Scalar]:
        """Measured channels by name [SI].

        Args:
            state: state of the system.
            memory: memory of the system.
            inputs: in force.
            row: what this sample brings from outside, such as draws of the noise.
        """

    @abc.abstractmethod
    def convert(self, commands: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """The inputs that the output converters hold, by signal, for the commands of the software by name [SI]."""

    @abc.abstractmethod
    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Signals of the machine, with delayed ones for parts that have dead time."""

    def straight(self) -> tuple[str, ...]:
        """Names of the inputs that go straight to a new command within its sample, such as a span; all others jump to it."""
        return ()


class Software(Module):
    """A pure step on the sample clock: what a controller, a protocol and its interlocks do with measured channels."""

    @abc.abstractmethod
    def initial(self, measured: Mapping[str, Scalar]) -> Tree:
        """State before the first sample, a tree of arrays."""

    @abc.abstractmethod
    def step(
        self, state: Tree, measured: Mapping[str, Scalar], row: Tree, dt: Scalar
    ) -> tuple[Tree, dict[str, Scalar], dict[str, Scalar]]:
        """Compute one sample: the new state, the commands by name [SI], and values to record."""
