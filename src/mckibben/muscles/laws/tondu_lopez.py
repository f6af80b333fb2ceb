"""Tondu and Lopez: the ideal law in contraction, with a factor k for ends that are no cylinder.

    F = pi r0^2 P' [a (1 - k eps)^2 - c],   a = 3/tan^2 theta0,   c = 1/sin^2 theta0,   eps = (L0 - L)/L0
    k(P') = k_inf + k_1 exp(-P'/P_k)

With k = 1 it is the ideal law. Its volume follows from virtual work, pi r0^2 L0 at rest. Range: contractions from zero to
the free contraction, gauge pressures of 1-5 bar; the authors report a few percent there. No passive stiffness.
Source: B. Tondu and P. Lopez, IEEE Control Systems Magazine 20(2), 2000, doi:10.1109/37.833638.
"""

from __future__ import annotations

from typing import Any

from ..._jax import jnp
from ...components import Scalar, derivative
from ...quantities import quantity
from .. import bladder, dimensions
from ..law import TensionLaw


class TonduLopez(TensionLaw):
    """Ideal law with an end-effect factor on the contraction."""

    rest_length: Scalar = dimensions.rest_length()
    rest_radius: Scalar = quantity("m", (1e-4, 1.0), "radius at rest", symbol="r0", typical=(2e-3, 3e-2))
    rest_angle: Scalar = dimensions.rest_angle((0.3, 0.8))
    end_factor: Scalar = quantity(
        "1", (0.1, 10.0), "k at high pressure", symbol="k_inf", typical=(0.8, 1.6), default=1.0
    )
    end_factor_gain: Scalar = quantity(
        "1", (-5.0, 20.0), "growth of k towards zero pressure", symbol="k_1", typical=(-0.5, 2.0), default=0.0
    )
    end_factor_pressure: Scalar = quantity(
        "Pa", (1e4, 1e7), "gauge pressure over which k falls by 1/e", symbol="P_k", typical=(5e4, 3e5), default=1e5
    )
    upper_length: Scalar = dimensions.upper_length()
    threshold_width: Scalar = dimensions.threshold_width()

    title = "Tondu & Lopez"
    cites = ("tondu2000",)
    any_length = True
    fitted = ("rest_radius", "rest_angle", "end_factor", "end_factor_gain")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Zero: the law has no passive part [N]."""
        return jnp.zeros_like(length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy with the volume of which the law is the virtual work [J]."""
        k = self.end_factor_at(pressure)
        upper = self._volume(self.upper_length, k)
        # A fitted radius may leave less gas at the upper length than is squeezed out until the threads hold; the force tells
        # only how the volume changes.
        slope = derivative(lambda x: self._volume(x, k), self.upper_length + 0.0 * k)
        lift = bladder.least_upper_volume(slope, self.upper_length, self.thread_strain) - upper
        lift = jnp.maximum(lift, 0.0)
        return bladder.gas_energy(
            pressure, self._volume(length, k) + lift, upper_volume=upper + lift, threshold_width=self.threshold_width
        )

    def end_factor_at(self, pressure: Scalar) -> Scalar:
        """The factor k at a gauge pressure [1], at least a twentieth; in vacuum its value at zero."""
        k = self.end_factor + self.end_factor_gain * jnp.exp(-jnp.maximum(pressure, 0.0) / self.end_factor_pressure)
        return jnp.maximum(k, 0.05)

    def _volume(self, length: Scalar, k: Any) -> Scalar:
        eps = 1.0 - length / self.rest_length
        tangent2 = jnp.tan(self.rest_angle) ** 2
        a, c = 3.0 / tangent2, 1.0 + 1.0 / tangent2
        # 1 - k eps stands for a length: it ends at zero, or the muscle would pull again beyond.
        held = jnp.minimum(k * eps, 1.0)
        cubic = held * (1.0 - held * (1.0 - held / 3.0)) / k
        volume: Scalar = jnp.pi * self.rest_radius**2 * self.rest_length * (1.0 + a * cubic - c * eps)
        return volume

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from a tenth of the rest length to the upper working length [m]."""
        return 0.1 * self.rest_length, self.upper_length
