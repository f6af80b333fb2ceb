"""Interface of loads: spans of the muscles, motion under tensions, and accounts."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import NamedTuple

from ..._jax import Tree, jnp
from ...components import Module, Scalar, field
from ...components.system import Value
from ...quantities import quantity

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


class HeldMuscles(Load):
    """A load that states which muscles it holds."""

    held: tuple[str, ...] = field(static=True, kw_only=True)

    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles that it holds."""
        return self.held


class ParallelMuscles(HeldMuscles):
    """A load whose muscles pull side by side at one place, along one span."""

    def one_of(self, muscle: str, name: str) -> Load:
        """Return the load with one muscle."""
        return self.with_fields(held=(name,))

    def collected(self) -> Load:
        """Return the load with one muscle, which pulls as all of them do."""
        return self.replace(held=(TOGETHER,))

    def effort(self, state: Tree, tensions: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Sum of the tensions [N]."""
        return {TOGETHER: sum((tensions[n] for n in self.held), start=jnp.zeros(()))}


class PrescribedMotion(HeldMuscles):
    """A load whose motion is given: it has no state, stores nothing and loses nothing."""

    def initial(self) -> Tree:
        """Return no state."""
        return ()

    def rates(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> Tree:
        """Return no rates."""
        return ()

    def stored_energy(self, state: Tree) -> Scalar:
        """Stored energy, zero [J]."""
        return jnp.zeros(())

    def powers(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Scalar, Scalar]:
        """Power of what moves it against the tensions; the loss is zero [W]."""
        spans = self.spans(state, inputs)
        return sum((tensions[n] * spans[n].velocity for n in self.held), start=jnp.zeros(())), jnp.zeros(())

    def outputs(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Return no outputs beside the spans."""
        return {}


class PlateLoad(ParallelMuscles, PrescribedMotion):
    """Holds each of its muscles at one span, constant or by a signal."""

    span: Scalar = quantity("m", (1e-3, 100.0), "span, where no signal gives it", symbol="X", default=0.14)
    # Name of the signal that gives the span [m].
    signal: str | None = field(static=True, kw_only=True, default=None)

    def alone(self, muscle: str, name: str) -> Load:
        """Return the same plate, since its position is prescribed."""
        return self.with_fields(held=(name,))

    def spans(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Equal spans of all muscles."""
        at = (self.span, jnp.zeros(())) if self.signal is None else inputs[self.signal]
        return {name: SpanState(*at) for name in self.held}


class BodyState(NamedTuple):
    """Position, which is the span [m], and velocity [m/s]."""

    position: Scalar
    velocity: Scalar


class Body(ParallelMuscles):
    """A mass with weight, spring and damper; all but the mass are optional.

        m dv/dt = W + f - k (X - X0) - c v - sum T,   dX/dt = v

    X is the span. A dead weight W pulls it longer, and so does a force f from a signal. Range: one direction; no stops
    but those of the muscle.
    """

    start: Scalar = quantity("m", (1e-3, 100.0), "span at the start", symbol="X")
    mass: Scalar = quantity("kg", (1e-4, 1e4), "inertia", symbol="m", typical=(0.1, 100.0))
    weight: Scalar = quantity("N", (-1e5, 1e5), "constant force that lengthens", symbol="W", default=0.0)
    stiffness: Scalar = quantity("N/m", (0.0, 1e8), "spring", symbol="k", default=0.0)
    spring_rest: Scalar = quantity("m", (-10.0, 100.0), "span at which the spring is relaxed", symbol="X0", default=0.0)
    damping: Scalar = quantity("N*s/m", (0.0, 1e6), "damper", symbol="c", default=0.0)
    # Name of the signal of a further force that lengthens [N].
    signal: str | None = field(static=True, kw_only=True, default=None)

    def initial(self) -> BodyState:
        """State at rest."""
        return BodyState(self.start, jnp.zeros(()))

    def spans(self, state: BodyState, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Equal spans of all muscles."""
        return {name: SpanState(state.position, state.velocity) for name in self.held}

    def _outside(self, inputs: Mapping[str, Value]) -> Scalar:
        return jnp.zeros(()) if self.signal is None else inputs[self.signal].value

    def rates(self, state: BodyState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> BodyState:
        """Velocity and acceleration."""
        pull = sum((tensions[n] for n in self.held), start=jnp.zeros(()))
        inner = self.stiffness * (state.position - self.spring_rest) + self.damping * state.velocity
        return BodyState(state.velocity, (self.weight + self._outside(inputs) - inner - pull) / self.mass)

    def max_rate_bound(self, state: BodyState, restraints: Mapping[str, Restraint]) -> Scalar:
        """Bound of the body on spring, damper and muscles [1/s]."""
        stiff = self.stiffness + sum(restraints[n].stiffness for n in self.held)
        return mode_bound(self.mass, stiff, self.damping + sum(restraints[n].damping for n in self.held))

    def stored_energy(self, state: BodyState) -> Scalar:
        """Kinetic, elastic, and of the weight's height [J]."""
        elastic = 0.5 * self.stiffness * (state.position - self.spring_rest) ** 2
        return 0.5 * self.mass * state.velocity**2 + elastic - self.weight * state.position

    def powers(
        self, state: BodyState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]
    ) -> tuple[Scalar, Scalar]:
        """Power of the signal's force, and power lost in the damper [W]."""
        return self._outside(inputs) * state.velocity, self.damping * state.velocity**2

    def outputs(
        self, state: BodyState, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]
    ) -> dict[str, Scalar]:
        """Position [m] and velocity [m/s]."""
        return {"position": state.position, "velocity": state.velocity}


class HostLoad(PrescribedMotion):
    """Muscles whose spans another program gives, each by its own signal ``<muscle>.span`` [m]."""

    def signals(self) -> tuple[str, ...]:
        """Names of the signals of the spans."""
        return tuple(f"{name}.span" for name in self.held)

    def spans(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Span of every muscle from its signal."""
        return {name: SpanState(*inputs[f"{name}.span"]) for name in self.held}

    def accounts(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Tension [N], whose integral is the impulse, and power [W] at the end of each muscle."""
        spans = self.spans(state, inputs)
        impulses = {f"{n}.impulse": tensions[n] + jnp.zeros(()) for n in self.held}
        return impulses | {f"{n}.work": tensions[n] * spans[n].velocity for n in self.held}
