"""Friction of a muscle or its cord over a curved bone: it sticks, and slides at the tension ratio of the capstan.

    Tx = T + k z,   z' = clip(z + dX, T (exp(-mu phi) - 1)/k, T (exp(mu phi) - 1)/k)

T is the tension on the muscle's side, Tx what the load feels behind the bone, X the span. While it slides, Tx is
T exp(mu phi) when the load lengthens the muscle and T exp(-mu phi) when the muscle pulls the load; at rest everything
between the two is possible, which is why a wrapped muscle holds its load. The stiffness k of the contact is constant and
only its yield follows the tension, so that a rising tension gives no energy back.

Range: a constant wrap angle, a cord without bending stiffness or mass, dry friction.
Source of the ratio: L. Euler, 1762 (published 1769), as in any text on belts; sticking as in Maxwell-slip friction.
"""

from __future__ import annotations

from .._jax import jnp
from ..components import Module, Scalar
from ..components.element import Advanced
from ..muscles.hysteresis.slip import advanced, contact_energy, contact_force, per_contact
from ..quantities import quantity


class Wrap(Module):
    """Capstan friction; the state is the deflection of its one contact [m], shape (1,)."""

    angle: Scalar = quantity("rad", (0.0, 20.0), "angle over which it lies on the bone", symbol="phi")
    friction: Scalar = quantity("1", (0.0, 2.0), "coefficient of friction", symbol="mu", typical=(0.05, 0.5))
    stiffness: Scalar = quantity(
        "N/m", (1e2, 1e8), "stiffness of the contact before it slides", symbol="k", typical=(1e4, 1e6), default=1e5
    )

    def initial(self) -> Scalar:
        """State without deflection, shape (1,) [m]."""
        return jnp.zeros(1)

    def ratio(self) -> Scalar:
        """Tension of the side that pulls over that of the other while it slides, exp(mu phi) [1]."""
        return jnp.exp(self.friction * self.angle)

    def advance(self, state: Scalar, displacement: Scalar, tension: Scalar) -> Advanced:
        """Move the span by a displacement [m], then limit once with the tension [N] at the end."""
        dx, most = per_contact(displacement), self.ratio()
        pulled = per_contact(tension) / self.stiffness
        low, high = pulled * (1.0 / most - 1.0), pulled * (most - 1.0)
        return advanced(self.stiffness, state, dx, jnp.minimum(jnp.maximum(state + dx, low), high))

    def force(self, state: Scalar) -> Scalar:
        """Force that the bone adds to the tension [N], positive when it opposes lengthening."""
        return contact_force(self.stiffness, state)

    def stored_energy(self, state: Scalar) -> Scalar:
        """Elastic energy of the contact [J]."""
        return contact_energy(self.stiffness, state)
