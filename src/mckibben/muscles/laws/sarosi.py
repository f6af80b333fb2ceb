"""Sarosi's six-coefficient form, an empirical fit in contraction and pressure.

    F = (a1 P' + a2) exp(a3 eps) + a4 P' eps + a5 P' + a6,   eps = (L0 - L)/L0

Here in SI units and with contraction as a fraction (the author uses bar or kPa and percent). The form interpolates well
and has no reason behind it: asked outside the pressures it was fitted to, it can diverge. It knows how the volume changes
with length (virtual work), not how large it is. Range: the contractions and pressures of the fit.
Source: J. Sarosi, I. Biro, J. Nemeth and L. Cveticanin, Mechanism and Machine Theory 85, 2015,
doi:10.1016/j.mechmachtheory.2014.11.006.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar, field
from ...quantities import quantity
from .. import dimensions
from ..law import TensionLaw

# Beyond this exponent the exponential is held: e^30 is far outside every muscle, and infinity helps no solver.
LARGEST_EXPONENT = 30.0


class Sarosi(TensionLaw):
    """Exponential and linear terms in contraction, all linear in pressure."""

    rest_length: Scalar = dimensions.rest_length()
    upper_length: Scalar = dimensions.upper_length()
    area_exponential: Scalar = quantity(
        "m^2", (-1.0, 1.0), "pressure factor of the exponential", symbol="a1", typical=(-2e-4, 2e-4)
    )
    force_exponential: Scalar = quantity(
        "N", (-1e5, 1e5), "constant factor of the exponential", symbol="a2", typical=(0.0, 5e2)
    )
    decay: Scalar = quantity("1", (-300.0, -0.1), "rate of the exponential", symbol="a3", typical=(-60.0, -5.0))
    area_slope: Scalar = quantity(
        "m^2", (-10.0, 10.0), "pressure factor of the contraction", symbol="a4", typical=(-1e-2, 0.0)
    )
    area_constant: Scalar = quantity("m^2", (-1.0, 1.0), "pressure factor alone", symbol="a5", typical=(0.0, 5e-3))
    force_constant: Scalar = quantity("N", (-1e5, 1e5), "constant force", symbol="a6", typical=(-5e2, 1e2))
    rest_volume: Scalar = dimensions.rest_volume()
    volume_known: bool = field(static=True, kw_only=True, default=False)

    title = "Sarosi, six coefficients"
    cites = ("sarosi2015",)
    fitted = ("area_exponential", "force_exponential", "decay", "area_slope", "area_constant", "force_constant")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """The terms without pressure [N]."""
        exponent = jnp.minimum(self.decay * (1.0 - length / self.rest_length), LARGEST_EXPONENT)
        return self.force_exponential * jnp.exp(exponent) + self.force_constant

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Pressure times the volume whose virtual work the terms with pressure are [J]."""
        eps = 1.0 - length / self.rest_length
        exponential = jnp.expm1(jnp.minimum(self.decay * eps, LARGEST_EXPONENT)) / self.decay
        change = self.area_exponential * exponential + eps * (0.5 * self.area_slope * eps + self.area_constant)
        return pressure * (self.rest_volume + self.rest_length * change)

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from half the rest length to the upper working length [m]."""
        return 0.5 * self.rest_length, self.upper_length

    def has_volume(self) -> bool:
        """Whether a rest volume was given."""
        return self.volume_known
