"""Hyperelastic braid: threads embedded in a softening rubber wall, between ends that do not contract.

Virtual work of the braid needs three additions to meet a measured fluidic muscle, each with a reason behind it:

* the **wall** is rubber in hoop stretch, and filled rubber softens: an incompressible Ogden material of negative exponent
  alpha, whose force rises steeply near rest and then stays on a plateau;
* the **threads** stretch a little with the pressure they carry, e = kappa P';
* next to each fitting a length of ``inactive_share`` wall diameters does not contract.

    l = lr L0 - li,   li = 2 f (D0 + h),   x = (L - li)/l,   s = sin theta0,  c = cos theta0
    t = (1 + 2 e - x^2 c^2)/s^2                                 squared hoop stretch of threads of strain e
    W = (2 mu/alpha^2) (x^alpha + t^(alpha/2) + (x^2 t)^(-alpha/2) - 3)
    Psi = pi (D0 + h) h l W - P' (pi Dt^2/(4 s^2)) l x (1 + e - x^2 c^2),   F = dPsi/dL,  V = -dPsi/dP'

Dt is the diameter of the thread layer inside the wall.

The law is linear in pressure but for kappa, so it extrapolates in pressure: on the two force maps of Martens and Boblan
(2017), trained up to 4 bar with the slack points, it errs by at most 2.4 % and 1.0 % of the largest force at 4-6.75 bar.
Range: 0.65-1.03 of the rest length, gauge pressures from the filling of the bladder (about 0.6 bar) up. Near the rest
length a map must contain that length: left out, the error there is 4-5 %.

What cannot be known stays fixed: alpha = -4 and f = 0.6 were chosen on those two maps and cannot be told from one map
together with the fitted parameters; kappa keeps its default of 0.5 % per MPa where tension was measured at fewer than
three lengths; an inner diameter that is not given is fitted in place of the thread depth. The wall of 1.8 mm is that of
Festo muscles.

Sources of the parts: R. W. Ogden, Proc. R. Soc. Lond. A 326, 1972, doi:10.1098/rspa.1972.0026; C.-P. Chou and
B. Hannaford, 1996, doi:10.1109/70.481753. The combination and the two constants are this project's.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar, derivative, field
from ...quantities import quantity
from .. import bladder, dimensions
from ..law import TensionLaw

# Below this stretch, and below this squared hoop stretch, the formulas are held by smooth ramps (see `bladder.ramp`).
SHORTEST_STRETCH, SHORT_WIDTH = 0.5, 0.1
SMALLEST_HOOP, HOOP_WIDTH = 0.2, 0.2
LEAST_EXPONENT = 1e-3  # of a real Ogden exponent, whose energy is divided by its square


class HyperelasticBraid(TensionLaw):
    """Embedded extensible threads in a softening rubber wall, with inactive ends."""

    rest_length: Scalar = dimensions.rest_length()
    rest_diameter: Scalar = dimensions.rest_diameter()
    wall_thickness: Scalar = dimensions.rubber_wall()
    thread_depth: Scalar = dimensions.thread_depth()
    rest_angle: Scalar = dimensions.rest_angle((0.38, 0.6))
    length_factor: Scalar = quantity(
        "1", (0.95, 1.05), "true over nominal rest length", symbol="lr", typical=(0.99, 1.01), default=1.0
    )
    shear_modulus: Scalar = quantity("Pa", (1e4, 1e8), "shear modulus of the rubber", symbol="mu", typical=(5e5, 5e6))
    thread_compliance: Scalar = quantity(
        "1/Pa", (0.0, 1e-7), "thread strain per gauge pressure", symbol="kappa", typical=(0.0, 2e-8), default=5e-9
    )
    inactive_share: Scalar = quantity(
        "1", (0.0, 3.0), "inactive length at each fitting over the wall diameter", symbol="f", default=0.6
    )
    upper_length: Scalar = dimensions.upper_length()
    threshold_width: Scalar = dimensions.threshold_width()
    ogden_exponent: int = field(static=True, kw_only=True, default=-4)
    # A law that fits the exponent gives it here, as a number that may be traced; None for the whole number above.
    real_exponent: Scalar | None = field(kw_only=True, default=None)

    title = "Hyperelastic braid"
    cites = ("ogden1972", "chou1996")
    any_length = True
    fitted_if_unknown = {"rest_diameter": ("thread_depth",)}
    lengths_needed = {"thread_compliance": 3}
    fitted = ("thread_depth", "rest_angle", "length_factor", "shear_modulus", "thread_compliance")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Force of the rubber wall without gas [N]."""
        return derivative(lambda x: self.wall_energy(x, 0.0), length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy [J]; the strain of the threads compensates the volume of the wall."""
        return self.wall_energy(length, 0.0) - self.potential(length, pressure)

    def potential(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Psi(L, P') [J]: F = dPsi/dL, V = -dPsi/dP'."""
        strain = self.thread_compliance * bladder.ramp(pressure, self.threshold_width)
        return self.wall_energy(length, strain) - bladder.gas_energy(
            pressure,
            self._bore_volume(length, strain),
            upper_volume=self._bore_volume(self.upper_length, 0.0),
            threshold_width=self.threshold_width,
        )

    def wall_energy(self, length: Scalar, thread_strain: Scalar) -> Scalar:
        """Elastic energy of the rubber [J]."""
        x, hoop = self._stretches(length, thread_strain)
        x2 = x * x
        if self.real_exponent is None:
            half = self.ogden_exponent // 2
            density = (0.5 * self.shear_modulus / half**2) * (x2**half + hoop**half + (x2 * hoop) ** (-half) - 3.0)
        else:
            density = real_ogden_density(x2, hoop, self.shear_modulus, self.real_exponent)
        return jnp.pi * (self.rest_diameter + self.wall_thickness) * self.wall_thickness * self._active() * density

    def _inactive(self) -> Scalar:
        return 2.0 * self.inactive_share * (self.rest_diameter + self.wall_thickness)

    def _active(self) -> Scalar:
        return self.length_factor * self.rest_length - self._inactive()

    def _stretches(self, length: Scalar, thread_strain: Scalar) -> tuple[Scalar, Scalar]:
        x = (length - self._inactive()) / self._active()
        x = SHORTEST_STRETCH + bladder.ramp(x - SHORTEST_STRETCH, SHORT_WIDTH)
        sine2 = jnp.sin(self.rest_angle) ** 2
        hoop = (1.0 + 2.0 * thread_strain - x * x * (1.0 - sine2)) / sine2
        return x, SMALLEST_HOOP + bladder.ramp(hoop - SMALLEST_HOOP, HOOP_WIDTH)

    def _bore_volume(self, length: Scalar, thread_strain: Scalar) -> Scalar:
        x, _ = self._stretches(length, thread_strain)
        sine2 = jnp.sin(self.rest_angle) ** 2
        layer = self.rest_diameter + 2.0 * self.thread_depth * self.wall_thickness
        within_threads = layer**2 / sine2 * self._active() * x * (1.0 + thread_strain - x * x * (1.0 - sine2))
        # The rubber inside the thread layer keeps its volume; the inactive ends keep their bore.
        rubber = (layer**2 - self.rest_diameter**2) * self._active()
        return 0.25 * jnp.pi * (within_threads - rubber + self.rest_diameter**2 * self._inactive())

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from 0.6 of the rest length to the upper working length [m]."""
        return 0.6 * self.rest_length, self.upper_length


def real_ogden_density(axial: Scalar, hoop: Scalar, shear_modulus: Scalar, exponent: Scalar) -> Scalar:
    """Energy density of incompressible Ogden rubber whose exponent is any number [J/m^3].

    Args:
        axial: squared axial stretch, above zero.
        hoop: squared hoop stretch, above zero.
        shear_modulus: [Pa].
        exponent: alpha; at zero the density is held at that of 1e-3, from which its limit differs by rounding.
    """
    half = 0.5 * jnp.where(jnp.abs(exponent) < LEAST_EXPONENT, LEAST_EXPONENT, exponent)
    along, around = half * jnp.log(axial), half * jnp.log(hoop)
    return 0.5 * shear_modulus / (half * half) * (jnp.expm1(along) + jnp.expm1(around) + jnp.expm1(-along - around))
