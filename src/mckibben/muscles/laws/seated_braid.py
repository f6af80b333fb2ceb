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

from ..._jax import jax, jnp
from ...components import Scalar, derivative
from ...quantities import quantity
from .. import dimensions
from ..law import TensionLaw
from .hyperelastic_braid import HyperelasticBraid

STEPS = 5


class SeatedBraid(TensionLaw):
    """Neo-Hookean braid between ends that settle with the square root of the load."""

    rest_length: Scalar = dimensions.rest_length()
    rest_diameter: Scalar = dimensions.rest_diameter()
    wall_thickness: Scalar = dimensions.rubber_wall()
    rest_angle: Scalar = dimensions.rest_angle((0.33, 0.55))
    shear_modulus: Scalar = quantity("Pa", (1e4, 1e8), "shear modulus of the rubber", symbol="mu", typical=(4e5, 3e6))
    seat_compliance: Scalar = quantity(
        "m/N^0.5", (1e-7, 1e-2), "take-up of both ends per square root of load", symbol="q", typical=(3e-5, 4e-4)
    )
    upper_length: Scalar = dimensions.upper_length()
    threshold_width: Scalar = dimensions.threshold_width()

    title = "Seated braid"
    cites = ("ogden1972", "chou1996")
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
        return self._take_up(self._braid(), length, pressure)

    def _potential(self, length: Scalar, pressure: Scalar) -> Scalar:
        braid = self._braid()
        u = self._take_up(braid, length, pressure)
        return braid.potential(length - u, pressure) + u * (u / self.seat_compliance) ** 2 / 3.0

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

    def _take_up(self, braid: HyperelasticBraid, length: Scalar, pressure: Scalar) -> Scalar:
        """Take-up u of the seats [m]; only the last step of the iteration is differentiated."""
        held_braid, held_q, held_length, held_pressure = jax.lax.stop_gradient(
            (braid, self.seat_compliance, length, pressure)
        )

        def step(u: Scalar, force: Scalar, stiffness: Scalar, q: Scalar) -> Scalar:
            # Where the braid has no positive stiffness the step is short instead of wrong.
            soft = jnp.maximum(stiffness, 1.0) * q * q
            reach = jnp.maximum(force + jnp.maximum(stiffness, 1.0) * u, 0.0) * q * q
            loaded = reach > 1e-24  # below that the square root has no derivative, and the ends carry nothing
            return jnp.where(
                loaded, 2.0 * reach / (soft + jnp.sqrt(soft * soft + 4.0 * jnp.where(loaded, reach, 1.0))), 0.0
            )

        def forces(u: Scalar) -> tuple[Scalar, Scalar]:
            at = held_length - u
            pull = lambda x: derivative(lambda y: held_braid.potential(y, held_pressure), x)  # noqa: E731
            return jax.jvp(pull, (at,), (jnp.ones_like(at),))

        u = jax.lax.fori_loop(0, STEPS - 1, lambda _, u: step(u, *forces(u), held_q), jnp.zeros_like(held_length))
        force = derivative(lambda x: braid.potential(x, pressure), length - u)
        return step(u, force, forces(u)[1], self.seat_compliance)

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from 0.6 of the rest length to the upper working length [m]."""
        return 0.6 * self.rest_length, self.upper_length
