"""Martens and Boblan: virtual work of the braid less the work of a rubber wall with a length-dependent modulus.

    F = -P' dV/dL + E(L) [ (D - D0)/D0 H0 pi L dD/dL - (L - L0)/L0 H0 pi D ],   E = c0 + c1 L + c2 L^2 + c3 L^3
    b = L0/cos(theta0 + d),  n = L0 tan(theta0 + d)/(pi D0)

The correction d of the braid angle is in radians: read as degrees the law misses its authors' own maps by 100-170 N.
Range: Festo DMSP-10-250 and DMSP-20-300, rest to free length, 0.5-6.75 bar; errors up to 4.3 % and 2.4 % of the largest
force there, unbounded outside (a cubic modulus). Source: M. Martens and I. Boblan, Actuators 6(4), 33, 2017,
doi:10.3390/act6040033, with the erratum in Actuators 7(1), 9, 2018.
"""

from __future__ import annotations

from typing import Any

from ..._jax import jnp
from ...components import Scalar
from ...quantities import quantity
from .. import bladder, braid, dimensions
from ..law import TensionLaw
from .ideal import LONGEST


class MartensBoblan(TensionLaw):
    """Virtual work with a rubber wall whose modulus is a cubic in length."""

    rest_length: Scalar = dimensions.rest_length()
    rest_diameter: Scalar = dimensions.rest_diameter()
    wall_thickness: Scalar = dimensions.rubber_wall()
    rest_angle: Scalar = dimensions.rest_angle((0.3, 0.8), default=0.49916416607037824)
    angle_correction: Scalar = quantity(
        "rad", (-0.4, 0.4), "correction of that angle, in radians", symbol="d", typical=(-0.15, 0.1), default=0.0
    )
    modulus_0: Scalar = quantity("Pa", (-1e12, 1e12), "modulus, constant term", symbol="c0", typical=(-1e8, 1e8))
    modulus_1: Scalar = quantity("Pa/m", (-1e13, 1e13), "modulus, linear term", symbol="c1", typical=(-1e9, 1e9))
    modulus_2: Scalar = quantity("Pa/m^2", (-1e14, 1e14), "modulus, quadratic term", symbol="c2", typical=(-3e9, 3e9))
    modulus_3: Scalar = quantity("Pa/m^3", (-1e15, 1e15), "modulus, cubic term", symbol="c3", typical=(-3e9, 3e9))
    threshold_width: Scalar = dimensions.threshold_width()

    title = "Martens & Boblan"
    cites = ("martens2017", "martens2018")
    fitted_if_unknown = {"rest_diameter": ()}
    fitted = ("angle_correction", "modulus_0", "modulus_1", "modulus_2", "modulus_3")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Force of the rubber wall, along and around [N]."""
        shape = self._shape()
        diameter = braid.diameter(length, **shape)
        sine = braid.sine(length, thread_length=shape["thread_length"])
        narrowing = -length / (jnp.pi * shape["turns"] * shape["thread_length"] * sine)
        modulus = self.modulus_0 + length * (self.modulus_1 + length * (self.modulus_2 + length * self.modulus_3))
        around = (diameter / self.rest_diameter - 1.0) * length * narrowing
        along = (length / self.rest_length - 1.0) * diameter
        tension: Scalar = jnp.pi * self.wall_thickness * modulus * (around - along)
        return tension

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy with the volume of eq. 7 [J]."""
        shape = self._shape()
        return bladder.gas_energy(
            pressure,
            braid.volume(length, **shape),
            upper_volume=braid.volume(LONGEST * shape["thread_length"], **shape),
            threshold_width=self.threshold_width,
        )

    def _shape(self) -> dict[str, Any]:
        angle = self.rest_angle + self.angle_correction
        shape = braid.wound(rest_length=self.rest_length, rest_angle=angle, rest_diameter=self.rest_diameter)
        return shape._asdict()

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from 0.65 of the rest length to the rest length [m]; the cubic pulls again on a shorter muscle."""
        return 0.65 * self.rest_length, self.rest_length
