"""The surroundings of an experiment, gas states at the ports of pneumatic elements, and the interface of these elements."""

from __future__ import annotations

import abc
import math
from typing import ClassVar, NamedTuple

from .._jax import Tree, jnp
from ..quantities import quantity
from .gas import AIR, Gas
from .module import Module, Scalar


class Environment(Module):
    """Pressure and temperature of the surroundings.

    The papers use 1.0336 bar (printed as 1 atm, which is 1.01325 bar) and 300 K: `Environment.of_the_papers`.
    """

    pressure_abs: Scalar = quantity("Pa", (1e3, 1e6), "ambient pressure", symbol="P0", default=101325.0)
    temperature: Scalar = quantity("K", (200.0, 400.0), "ambient temperature", symbol="T0", default=293.15)

    @classmethod
    def of_the_papers(cls) -> Environment:
        """The surroundings that Chou and Hannaford compute with."""
        return cls(pressure_abs=103360.0, temperature=300.0)


class GasState(NamedTuple):
    """The gas at a node: absolute pressure [Pa], temperature [K], and which gas it is: one in a circuit."""

    pressure_abs: Scalar
    temperature: Scalar
    gas: Gas = AIR


Gases = tuple[GasState, ...]


class FlowElement(Module):
    """An element with two ports or more, and the paths that gas can take between them.

    `command` is the value of the signal that drives the element, such as the opening of a valve.
    """

    ports: ClassVar[tuple[str, ...]]
    paths: ClassVar[tuple[tuple[int, int], ...]]  # by port index; flow from the first to the second is positive
    commanded: ClassVar[bool] = False  # whether a signal must drive it
    command_unit: ClassVar[str] = "1"  # SI unit of that signal
    # least and largest command that differ in what they do: what lies beyond acts as the end, or means nothing
    command_range: ClassVar[tuple[float, float]] = (-math.inf, math.inf)
    saturates: ClassVar[bool] = True  # whether a command beyond that range acts as its end; else it means nothing
    undriven: ClassVar[float] = 0.0  # the command where no signal does
    symbol: ClassVar[str] = ""  # of ISO 1219-1 in a diagram; a box with the name of the type where it is empty

    def initial(self) -> Tree:
        """The element's own continuous state at rest: a tree of arrays, empty if it has none."""
        return ()

    def settled(self, command: Scalar | None) -> Tree:
        """Return the element after a command has lasted; None if it is unknown, such as without a signal."""
        return self.initial()

    def initial_memory(self, gas: Gases) -> Tree:
        """Memory at rest, such as the position of a plunger with friction; empty if there is none."""
        return ()

    @abc.abstractmethod
    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Mass flow along each path [kg/s]."""

    def rates(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Tree:
        """Time derivative of the element's own state, a tree like it."""
        return ()

    def advance_memory(self, memory: Tree, start: Gases, end: Gases) -> Tree:
        """Memory after the gas at its ports has changed from `start` to `end`, at any rate."""
        return memory

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """A bound of each path's slope of mass flow over pressure, anywhere at these pressures [kg/(s Pa)].

        The engine needs it: between samples a small volume may cross a steep zone that no sample shows. Zero where the
        slope seen at a sample is telling enough.
        """
        return tuple(jnp.zeros(()) for _ in self.paths)

    def heating(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Power that each path adds to the gas it delivers [W]; zero but for machines that compress."""
        return tuple(jnp.zeros(()) for _ in self.paths)

    def inner_volumes(self) -> tuple[Scalar, ...]:
        """Gas volume inside the element that is counted with the node at each port [m^3]."""
        return tuple(jnp.zeros(()) for _ in self.ports)

    def delay(self) -> Scalar | None:
        """Dead time of the command [s]; None if it acts at once."""
        return None

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Further recorded outputs of the element, such as its opening [SI]."""
        return {}


class TwoPort(FlowElement):
    """An element that lets gas pass from node a to node b; reverse flow is negative."""

    ports: ClassVar[tuple[str, ...]] = ("a", "b")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1),)

    @abc.abstractmethod
    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""

    def rate(self, a: GasState, b: GasState, state: Tree, command: Scalar) -> Tree:
        """Time derivative of the element's own state."""
        return ()

    def inner_volume(self) -> Scalar:
        """Gas volume inside the element [m^3]; half of it is assigned to each node."""
        return jnp.zeros(())

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """The one mass flow, from a to b [kg/s]."""
        return (self.mass_flow(gas[0], gas[1], state, command),)

    def rates(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Tree:
        """Time derivative of the element's own state."""
        return self.rate(gas[0], gas[1], state, command)

    def inner_volumes(self) -> tuple[Scalar, ...]:
        """Half of the inner volume at either end [m^3]."""
        half = 0.5 * self.inner_volume()
        return half, half
