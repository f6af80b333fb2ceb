"""A plate whose position is given: fixed, as in an isometric test, or moved by whatever holds it."""

from __future__ import annotations

from collections.abc import Mapping

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.system import Value
from ...quantities import quantity
from .load import TOGETHER, Load, SpanState


class PlateLoad(Load):
    """Holds each of its muscles at one span, constant or by a signal."""

    held: tuple[str, ...] = field(static=True, kw_only=True)
    span: Scalar = quantity("m", (1e-3, 100.0), "span, where no signal gives it", symbol="X", default=0.14)
    # Name of the signal that gives the span [m].
    signal: str | None = field(static=True, kw_only=True, default=None)

    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles that the plate holds."""
        return self.held

    def alone(self, muscle: str, name: str) -> Load:
        """Return the same plate, since its position is prescribed."""
        return self.with_fields(held=(name,))

    def one_of(self, muscle: str, name: str) -> Load:
        """Return the load with one muscle."""
        return self.with_fields(held=(name,))

    def collected(self) -> Load:
        """Return the load with one muscle, which pulls as all of them do."""
        return self.replace(held=(TOGETHER,))

    def effort(self, state: Tree, tensions: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Sum of the tensions [N]."""
        return {TOGETHER: sum((tensions[n] for n in self.held), start=jnp.zeros(()))}

    def initial(self) -> Tree:
        """Return no state."""
        return ()

    def spans(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Equal spans of all muscles."""
        at = (self.span, jnp.zeros(())) if self.signal is None else inputs[self.signal]
        return {name: SpanState(*at) for name in self.held}

    def rates(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> Tree:
        """Return no rates."""
        return ()

    def stored_energy(self, state: Tree) -> Scalar:
        """Stored energy, zero [J]."""
        return jnp.zeros(())

    def powers(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Scalar, Scalar]:
        """Power that moves the plate against the tensions; the loss is zero [W]."""
        spans = self.spans(state, inputs)
        return sum((tensions[n] * spans[n].velocity for n in self.held), start=jnp.zeros(())), jnp.zeros(())

    def outputs(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Return no outputs beside the spans."""
        return {}
