"""The mechanism of another program, which moves the ends of the muscles and feels their tensions."""

from __future__ import annotations

from collections.abc import Mapping

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.system import Value
from .load import Load, SpanState


class HostLoad(Load):
    """Muscles whose spans another program gives, each by its own signal ``<muscle>.span`` [m]."""

    held: tuple[str, ...] = field(static=True, kw_only=True)

    def muscles(self) -> tuple[str, ...]:
        """Names of the muscles that the other program holds."""
        return self.held

    def signals(self) -> tuple[str, ...]:
        """Names of the signals of the spans."""
        return tuple(f"{name}.span" for name in self.held)

    def initial(self) -> Tree:
        """Return no state."""
        return ()

    def spans(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Span of every muscle from its signal."""
        return {name: SpanState(*inputs[f"{name}.span"]) for name in self.held}

    def rates(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> Tree:
        """Return no rates."""
        return ()

    def stored_energy(self, state: Tree) -> Scalar:
        """Stored energy, zero [J]."""
        return jnp.zeros(())

    def powers(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Scalar, Scalar]:
        """Power of the other program against the tensions; the loss is zero [W]."""
        spans = self.spans(state, inputs)
        return sum((tensions[n] * spans[n].velocity for n in self.held), start=jnp.zeros(())), jnp.zeros(())

    def accounts(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Tension [N], whose integral is the impulse, and power [W] at the end of each muscle."""
        spans = self.spans(state, inputs)
        impulses = {f"{n}.impulse": tensions[n] + jnp.zeros(()) for n in self.held}
        return impulses | {f"{n}.work": tensions[n] * spans[n].velocity for n in self.held}

    def outputs(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Return no outputs beside the spans."""
        return {}
