"""Dahl's friction: one contact whose force approaches its limit exponentially with the distance moved.

    dz = dx - |dx| z/d(P'),   F = k z,   d(P') = Fc(P')/k

The relaxation is stepped by the implicit mean, with the mean yield travel of the piece's two ends, then limited once
with the travel at its end: z' = clip((z (1 - a/2) + dx)/(1 + a/2), -d, d), a = |dx|/d. Range: pieces of path shorter
than d follow the exponential to second order; longer ones stay bounded and passive. Rate-independent. It closes no
minor loop: after a small reversal it does not come back to where it left, so a rising path is kept only as far as the
motion before it saturated the friction, to 2 exp(-range/d) of the limit.
Sources: P. R. Dahl, A solid friction model, The Aerospace Corporation TOR-0158(3107-18)-1, 1968; P. R. Dahl, AIAA
Journal 14(12), 1976, doi:10.2514/3.61511.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar
from ...quantities import quantity
from .slip import FrictionLimit, RelaxingContacts


class Dahl(RelaxingContacts):
    """Dahl's friction with exponent one; the state is the deflection of its one contact [m]."""

    limit: FrictionLimit
    stiffness: Scalar = quantity(
        "N/m", (1e-3, 1e9), "stiffness of the contact before it slips", symbol="k", typical=(1e2, 1e5)
    )

    title = "Dahl"
    cites = ("dahl1976",)

    def relaxed(self, deflection: Scalar, displacement: Scalar, travel: Scalar) -> Scalar:
        """Relax the deflection, by the implicit mean of dz = dx - |dx| z/d [m]."""
        half = 0.5 * jnp.abs(displacement)
        return (deflection * (travel - half) + displacement * travel) / (travel + half)
