"""The force at which friction yields, and its growth with pressure.

    Fc(P') = Fc0 + c max(P', 0)

The threads of a braid are pressed on each other and on the bladder by the gas, so their friction grows with it; Chou
and Hannaford print one constant, which their loops show to be a value for 5 bar. Vacuum presses nothing together.
"""

from __future__ import annotations

from typing import Any

from ..._jax import jnp
from ...components import Module, Scalar
from ...quantities import quantity


class FrictionLimit(Module):
    """Largest force of a friction, or of each of its elements where the parameters are arrays."""

    constant: Scalar = quantity("N", (0.0, 1e5), "friction without pressure", symbol="Fc0", typical=(0.0, 20.0))
    per_pressure: Scalar = quantity(
        "m^2", (0.0, 1.0), "friction per gauge pressure", symbol="c", typical=(0.0, 5e-5), default=0.0
    )

    def force(self, pressure: Scalar, xp: Any = jnp) -> Scalar:
        """Fc(P') [N] at a gauge pressure [Pa]; by `xp`, NumPy or JAX's."""
        limit: Scalar = self.constant + self.per_pressure * xp.maximum(pressure, 0.0)
        return limit

    def scaled(self, factor: Scalar) -> FrictionLimit:
        """Return the limit multiplied by a factor >= 0."""
        return FrictionLimit(constant=factor * self.constant, per_pressure=factor * self.per_pressure)
