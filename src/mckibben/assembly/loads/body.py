"""A body that moves in line with its muscles: weight, inertia, spring and damper, together or alone.

    m dv/dt = W + f - k (X - X0) - c v - sum T,   dX/dt = v

X is the span. A dead weight W pulls it longer, and so does a force f from a signal. Range: one direction; no stops but
those of the muscle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.system import Value
from ...quantities import quantity
from .load import TOGETHER, Load, Restraint, SpanState, mode_bound


class BodyState(NamedTuple):
    """Position, which is the span [m], and velocity [m/s]."""

    position: Scalar
    velocity: Scalar


class Body(Load):
    """A mass with weight, spring and damper; all but the mass are optional."""

    held: tuple[str, ...] = field(static=True, kw_only=True)
    start: Scalar = quantity("m", (1e-3, 100.0), "span at the start", symbol="X")
    mass: Scalar = quantity("kg", (1e-4, 1e4), "inertia", symbol="m", typical=(0.1, 100.0))
    weight: Scalar = quantity("N", (-1e5, 1e5), "constant force that lengthens", symbol="W", default=0.0)
    stiffness: Scalar = quantity("N/m", (0.0, 1e8), "spring", symbol="k", default=0.0)
    spring_rest: Scalar = quantity("m", (-10.0, 100.0), "span at which the spring is relaxed", symbol="X0", default=0.0)
    damping: Scalar = quantity("N*s/m", (0.0, 1e6), "damper", symbol="c", default=0.0)
    # Name of the signal of a further force that lengthens [N].
    signal: str | None = field(static=True, kw_only=True, default=None)

    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles that carry it."""
        return self.held

    def one_of(self, muscle: str, name: str) -> Load:
        """Return the load with one muscle."""
        return self.with_fields(held=(name,))

    def collected(self) -> Load:
        """Return the load with one muscle, which pulls as all of them do."""
        return self.replace(held=(TOGETHER,))

    def effort(self, state: Tree, tensions: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Sum of the tensions [N]."""
        return {TOGETHER: sum((tensions[n] for n in self.held), start=jnp.zeros(()))}

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
