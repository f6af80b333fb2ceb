"""Interface of systems to integrate: a state equation, with memory beside it for friction."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import Any, NamedTuple

from .._jax import Tree, jnp
from .module import Module, Scalar


class Value(NamedTuple):
    """Value of a signal and its rate of change [1/s] (zero while held)."""

    value: Scalar
    rate: Scalar


class Exchange(NamedTuple):
    """What a store of energy exchanges: net power into it, and a measure of all in and out [W]; or energies [J]."""

    net: Scalar
    turnover: Scalar


class Moment(NamedTuple):
    """The continuous state and the inputs at one moment."""

    state: Tree
    inputs: Mapping[str, Value]


class IndependentPart(NamedTuple):
    """An independent part of a system, as a system of its own.

    Attributes:
        system: the part.
        state: continuous state.
        memory: memory.
        signals: the inputs that it needs.
        outputs: names of its outputs in the whole, by their names in the part.
    """

    system: System
    state: Any
    memory: Any
    signals: dict[str, Any]
    outputs: dict[str, str]


class Coupling(abc.ABC):
    """A system cut into cells, many of them of one structure, and a core by which they act on each other."""

    @abc.abstractmethod
    def cells(self, system: Tree, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> list[IndependentPart]:
        """The cells of a system with its state, memory and signals; numbers are taken, none is computed."""

    @abc.abstractmethod
    def core(self, system: Tree, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> IndependentPart:
        """The core of a system with its state, memory and signals."""

    @abc.abstractmethod
    def assembled(
        self, core: Tree, groups: tuple[Tree, ...], weights: tuple[Tree, ...], varied: Tree, mapped: bool
    ) -> System:
        """The system again, with its cells in groups of one structure.

        Its state and memory are tables of those of the core, with the cells' in ``groups``: arrays have the cells as last
        axis there, and those of more axes are `UnitRows`. Signals of group g are named ``g.<name>``; so are its outputs.

        Args:
            core: system of the core.
            groups: systems of the cells of each group, in which what differs has the cells as last axis.
            weights: 1 for each cell, 0 for those that only fill the arrays; (n,) for each group.
            varied: by leaf of each group's system, whether it differs.
            mapped: see `rows.for_each_unit`.
        """


class System(Module):
    """A system of ordinary differential equations with inputs and memory.

    The continuous state, its rate, the memory and the integrals are trees of arrays; the engine knows nothing of what they
    mean. The inputs are a table of the values that the signals have at the moment asked for.
    """

    @abc.abstractmethod
    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Time derivative of the continuous state, a tree like it [unit/s]."""

    @abc.abstractmethod
    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of the balances' independent integrals, such as enthalpy flows [W]; an empty tree where there are none."""

    def stored_energies(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Energies of the stores whose balance is watched, by name [J]; none by default."""
        return {}

    def balances(self, integrands: Tree) -> dict[str, Exchange]:
        """What each of `stored_energies` exchanges, from `integrands` or from integrals of them: linear in these."""
        return {}

    def slackness(self, integrands: Tree) -> tuple[Scalar, ...]:
        """1 for every muscle that is slack and 0 for one that is taut, from `integrands`; or the time that it was [s]."""
        return ()

    @abc.abstractmethod
    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Memory after a change from `start` to `end` in a time [s]; unchanged if there is none."""

    @abc.abstractmethod
    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Recorded outputs, by name [SI]."""

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Signals, with delayed ones for parts that have dead time.

        Every run calls this on the signals it is given. What is late already stays as it is.
        """
        return dict(signals)

    def max_rate_bound(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Scalar:
        """Upper bound of the fastest rate that the system can have near a state [1/s].

        Zero where the modes at the samples tell enough. A run may cross a steep zone between two samples, again and again.
        """
        return jnp.zeros(())

    def parts(self, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> list[IndependentPart]:
        """The parts that can be integrated side by side; empty if each acts on the others, or where they are few."""
        return []

    def coupling(self) -> Coupling | None:
        """How the system is cut into many cells that act on each other by a core; None if it is not, or into few."""
        return None

    def broken(self, outputs: Mapping[str, Scalar]) -> Scalar:
        """Whether outputs show a part loaded beyond what it bears (bool), elementwise; never by default."""
        return jnp.asarray(False)

    def admissible(self, state: Tree) -> Scalar:
        """Whether a state can be at all, such as a pressure above vacuum (bool)."""
        return jnp.asarray(True)
