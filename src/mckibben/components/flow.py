"""What a pneumatic element between two nodes must offer, and what it sees of a node."""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

from .module import Module, Scalar


class GasState(NamedTuple):
    """The gas at a node: absolute pressure [Pa] and temperature [K]."""

    pressure_abs: Scalar
    temperature: Scalar


class FlowElement(Module):
    """An element that lets gas pass from node a to node b; reverse flow is negative.

    `command` is the value of the signal that drives the element, such as the opening of a valve; zero where none does.
    """

    @abc.abstractmethod
    def initial(self) -> Any:
        """The element's own state at rest: a tree of arrays, empty where it has none."""

    @abc.abstractmethod
    def mass_flow(self, a: GasState, b: GasState, state: Any, command: Any) -> Scalar:
        """Mass flow from a to b [kg/s]."""

    @abc.abstractmethod
    def rate(self, a: GasState, b: GasState, state: Any, command: Any) -> Any:
        """Time derivative of the element's own state."""

    @abc.abstractmethod
    def inner_volume(self) -> Scalar:
        """Gas volume inside the element [m^3]; half of it is given to either node."""
