"""Interface of loads: spans of the muscles, motion under tensions, and accounts."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import NamedTuple

from ..._jax import Tree, jnp
from ...components import Module, Scalar
from ...components.system import Value

TOGETHER = "together"  # the muscle that stands for all of a load's


class SpanState(NamedTuple):
    """Span of a muscle, from its fixed anchor to the load [m], and its rate [m/s]."""

    span: Scalar
    velocity: Scalar


class Restraint(NamedTuple):
    """Bounds of what a muscle resists a motion of its load with: stiffness [N/m] and damping [N s/m]."""

    stiffness: Scalar
    damping: Scalar


def mode_bound(inertia: Scalar, stiffness: Scalar, damping: Scalar) -> Scalar:
    """Bound of the rates of a mass on a spring with a damper [1/s]: no mode is faster than either of the two alone."""
    return jnp.maximum(jnp.sqrt(stiffness / inertia), damping / inertia)


class Load(Module):
    """A mechanism that one muscle or several act on; its inputs are the values of signals at a moment."""

    @abc.abstractmethod
    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles that it holds."""

    def signals(self) -> tuple[str, ...]:
        """Names of the signals that drive it."""
        name = getattr(self, "signal", None)
        return () if name is None else (name,)

    def alone(self, muscle: str, name: str) -> Load | None:
        """Return the load of one muscle under another name, if no other muscle moves it; else None."""
        return None

    def one_of(self, muscle: str, name: str) -> Load | None:
        """Return the load with one of its muscles only, under another name; None where they cannot be told apart."""
        return None

    def collected(self) -> Load | None:
        """Return the load with muscles that pull as all of its own do together, with the tensions that `effort` states."""
        return None

    def effort(self, state: Tree, tensions: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Sums over the muscles: tensions of those of `collected` [N]."""
        return {}

    @abc.abstractmethod
    def initial(self) -> Tree:
        """The continuous state at the start, a tree of arrays; empty if the motion is given."""

    @abc.abstractmethod
    def spans(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Span of every muscle."""

    @abc.abstractmethod
    def rates(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> Tree:
        """Rate of the state under the tensions [N], which pull every span shorter."""

    @abc.abstractmethod
    def stored_energy(self, state: Tree) -> Scalar:
        """Kinetic, elastic and potential energy [J]."""

    @abc.abstractmethod
    def powers(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Scalar, Scalar]:
        """Power that enters from outside, and power that is lost [W]."""

    def accounts(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Return further powers [W] or the like whose integrals are wanted; none by default."""
        return {}

    def max_rate_bound(self, state: Tree, restraints: Mapping[str, Restraint]) -> Scalar:
        """Return a bound of its fastest mode [1/s] with the stiffness and damping of its muscles; none by default."""
        return jnp.zeros(())

    @abc.abstractmethod
    def outputs(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Recorded outputs of the load [SI]."""
