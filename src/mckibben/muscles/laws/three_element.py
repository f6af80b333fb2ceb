"""The three-element phenomenological law: spring, damper and contractile element, each linear in pressure.

    F = f0 + f1 P' - (k0 + k1 P') x - (b0 + b1 P') dx/dt,   x = L0 - L

Static tension is the part without velocity; `viscous_tension` gives the damper. It knows how the volume changes with
length (virtual work), not how large it is. No coefficients of its authors ship, for want of a source at hand.
Range: between the two pressures of its fit (its authors: 2-6 bar); outside it means nothing, and at zero pressure f0 need
not vanish.
Source: D. B. Reynolds, D. W. Repperger, C. A. Phillips and G. Bandry, Annals of Biomedical Engineering 31(3), 2003,
doi:10.1114/1.1554921.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar, field
from ...quantities import quantity
from .. import dimensions
from ..law import TensionLaw


class ThreeElement(TensionLaw):
    """Pressure-dependent spring, damper and contractile element in parallel."""

    rest_length: Scalar = dimensions.rest_length()
    upper_length: Scalar = dimensions.upper_length()
    force_constant: Scalar = quantity(
        "N", (-1e5, 1e5), "contractile force at zero pressure", symbol="f0", typical=(-2e2, 2e2)
    )
    force_per_pressure: Scalar = quantity(
        "m^2", (0.0, 1.0), "contractile force per pressure", symbol="f1", typical=(1e-4, 5e-3)
    )
    stiffness_constant: Scalar = quantity(
        "N/m", (-1e7, 1e7), "stiffness at zero pressure", symbol="k0", typical=(-1e3, 1e4)
    )
    stiffness_per_pressure: Scalar = quantity(
        "m", (-10.0, 10.0), "stiffness per pressure", symbol="k1", typical=(1e-3, 5e-2)
    )
    damping_constant: Scalar = quantity("N*s/m", (0.0, 1e6), "damping at zero pressure", symbol="b0", default=0.0)
    damping_per_pressure: Scalar = quantity("m*s", (-10.0, 10.0), "damping per pressure", symbol="b1", default=0.0)
    rest_volume: Scalar = dimensions.rest_volume()
    volume_known: bool = field(static=True, kw_only=True, default=False)

    title = "Three elements"
    cites = ("reynolds2003",)
    fitted = ("force_constant", "force_per_pressure", "stiffness_constant", "stiffness_per_pressure")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """The terms without pressure [N]."""
        return self.force_constant - self.stiffness_constant * (self.rest_length - length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Pressure times the volume whose virtual work the terms with pressure are [J]."""
        x = self.rest_length - length
        return pressure * (self.rest_volume + x * (self.force_per_pressure - 0.5 * self.stiffness_per_pressure * x))

    def viscous_tension(self, velocity: Scalar, pressure: Scalar) -> Scalar:
        """Force of the damper [N], positive while lengthening; never a source of energy."""
        damping = jnp.maximum(self.damping_constant + self.damping_per_pressure * pressure, 0.0)
        return damping * velocity

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from half the rest length to the upper working length [m]."""
        return 0.5 * self.rest_length, self.upper_length

    def has_volume(self) -> bool:
        """Whether a rest volume was given."""
        return self.volume_known
