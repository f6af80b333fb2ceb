"""Seated braid: a braid with a rubber wall whose two ends settle into their fittings under load.

Short muscles are weaker and softer than long ones of the same make: 305 N at 83 mm against 421 N at 281 mm, at rest
length and 6 bar. A rigid inactive length, lost volume in tapered ends or a thread stretch do not explain it, for they act
in proportion to the contraction; a length-independent element in series does, because it takes up millimetres that a
short muscle misses more. Measured on three lengths it stiffens with load, and its take-up follows the square root:

    Psi(L, P') = min over u >= 0 of  Psi_braid(L - u, P') + u^3/(3 q^2),     so that u = q sqrt(F)

with Psi_braid the neo-Hookean hyperelastic braid (Ogden exponent 2) without inactive ends. Only the rest length changes
from muscle to muscle. The inner minimum is found by five fixed steps that linearise the braid and solve the spring
exactly; the last carries the derivative. F and V are derivatives of one function, so no cycle yields work.

Range: 0.8-1.0 of the rest length, 0-6.2 bar, lengths of 80-280 mm of the 10 mm muscle it was made for. Left out one
length at a time it errs by about 5 % of the largest force, which is the force that half a millimetre of rest length makes
(24-43 N/mm). Whether q belongs to the muscle or to the mounting, three lengths of one make cannot tell.
Source of the parts: the law `hyperelastic_braid`; the seat is this project's.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar, derivative
from ...quantities import quantity
from .. import dimensions, seat
from ..law import TensionLaw
from .hyperelastic_braid import HyperelasticBraid


class SeatedBraid(TensionLaw):
    """Neo-Hookean braid between ends that settle with the square root of the load."""

    rest_length: Scalar = dimensions.rest_length()
    rest_diameter: Scalar = dimensions.rest_diameter()
    wall_thickness: Scalar = dimensions.rubber_wall()
    rest_angle: Scalar = dimensions.rest_angle((0.33, 0.55))
    shear_modulus: Scalar = quantity("Pa", (1e4, 1e8), "shear modulus of the rubber", symbol="mu", typical=(4e5, 3e6))
    seat_compliance: Scalar = dimensions.seat_compliance()
    upper_length: Scalar = dimensions.upper_length()
    threshold_width: Scalar = dimensions.threshold_width()

    title = "Seated braid"
    cites = ("ogden1972", "chou1996")
    any_length = True
    fitted_if_unknown = {"rest_diameter": ()}
    fitted = ("rest_angle", "shear_modulus", "seat_compliance")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Force of the rubber wall without gas [N]."""
        return derivative(lambda x: self._potential(x, jnp.zeros_like(x)), length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy [J]: what the potential loses by the pressure."""
        return self._potential(length, jnp.zeros_like(pressure)) - self._potential(length, pressure)

    def take_up(self, length: Scalar, pressure: Scalar) -> Scalar:
        """How far both ends have settled together [m], by which the braid is shorter than the muscle."""
        return seat.take_up(self._braid(), self.seat_compliance, length, pressure)

    def _potential(self, length: Scalar, pressure: Scalar) -> Scalar:
        braid = self._braid()
        return seat.seated_potential(braid, self.seat_compliance, length, pressure)

    def _braid(self) -> HyperelasticBraid:
        return HyperelasticBraid(
            rest_length=self.rest_length,
            rest_diameter=self.rest_diameter,
            wall_thickness=self.wall_thickness,
            thread_depth=0.0,
            thread_compliance=0.0,
            rest_angle=self.rest_angle,
            shear_modulus=self.shear_modulus,
            inactive_share=0.0,
            upper_length=self.upper_length,
            threshold_width=self.threshold_width,
            ogden_exponent=2,
        )

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from 0.6 of the rest length to the upper working length [m]."""
        return 0.6 * self.rest_length, self.upper_length
