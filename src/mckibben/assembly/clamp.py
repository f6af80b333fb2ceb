"""Clamp that holds the end of a muscle by friction, and slips irreversibly once the tension passes its grip.

    d = X - L - Ls - z,   z' = max(z, X - L - Ls - d(G)),   f(d(G)) = G

d is the stretch of the tendon between muscle and load, z the span that the clamp has lost, G its grip and f the tendon's
force at rest. The slip is rigid and perfectly plastic: below the grip nothing moves, at the grip the tension stays, and
what has slipped does not come back. All work at the clamp becomes heat.

Range: a grip that does not depend on speed or on how far it has slipped; the grip holds by the end of each step of the
integrator, within which the tension may pass it. Source of the return to the yield limit: J. C. Simo and T. J. R. Hughes,
Computational Inelasticity, 1998, doi:10.1007/b98904.
"""

from __future__ import annotations

from .._jax import jnp
from ..components import Module, Scalar
from ..components.element import Advanced
from ..muscles.elements import Tendon
from ..quantities import quantity


class Clamp(Module):
    """Clamp with a limited grip; the state is the span that it has lost [m]."""

    grip: Scalar = quantity("N", (1e-3, 1e9), "tension from which on the clamp slips", symbol="G", typical=(10.0, 1e4))

    def initial(self) -> Scalar:
        """State of a clamp that has not slipped [m]."""
        return jnp.zeros(())

    def advance(self, state: Scalar, tendon: Tendon, stretch: Scalar) -> Advanced:
        """Slip until the tendon pulls with the grip at most.

        Args:
            state: span lost before [m].
            tendon: the cord that the clamp holds.
            stretch: of the tendon beyond its slack length, as if nothing had slipped [m].
        """
        after = jnp.maximum(state, stretch - tendon.stretch(self.grip))
        slack = tendon.slack_length
        freed = tendon.stored_energy(slack + stretch - state) - tendon.stored_energy(slack + stretch - after)
        return Advanced(after, freed, freed)
