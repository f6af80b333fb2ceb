"""The gas spring: a muscle whose stiffness is proportional to its pressure.

    F = Kg P' (L - Lmin)                                                                                        (eq. 11)

The straight-line form of the virtual-work law: within 10-14 cm the stiffness per pressure of the nylon muscle varies by
14 % around Kg. Range: taut lengths up to ``upper_length``; no threshold, no passive stiffness.
Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import AbstractVar, Scalar, field
from .. import bladder, dimensions
from ..law import TensionLaw


def spring_volume(
    length: Scalar, *, rest_length: Scalar, rest_volume: Scalar, shortest_length: Scalar, per_pressure: Scalar
) -> Scalar:
    """Volume whose derivative is that of a gas spring [m^3] (eq. 38b); lengths [m], Kg [m].

    It turns negative at long lengths (beyond 16.3 cm for the nylon muscle), by design: see `bladder`.
    """
    return rest_volume - 0.5 * per_pressure * ((length - shortest_length) ** 2 - (rest_length - shortest_length) ** 2)


def volume_when_unknown(
    *, rest_length: Scalar, upper_length: Scalar, shortest_length: Scalar, per_pressure: Scalar, thread_strain: Scalar
) -> Scalar:
    """Rest volume, large enough for the gas up to the upper working length, if none was measured [m^3].

    It only keeps the formulas in their domain; a law that uses it says that it has no volume. The factor is that of the
    nylon muscle.
    """
    drop = 0.5 * per_pressure * ((upper_length - shortest_length) ** 2 - (rest_length - shortest_length) ** 2)
    slope = per_pressure * (shortest_length - upper_length)
    left = bladder.least_upper_volume(slope, upper_length, thread_strain)
    return jnp.maximum(1.8 * jnp.maximum(drop, 1e-3 * per_pressure * rest_length**2), drop + left)


class SpringVolume(TensionLaw):
    """A law whose volume is that of a gas spring (eq. 38b) above a threshold pressure."""

    stiffness_per_pressure: AbstractVar[Scalar]  # type: ignore[misc]
    shortest_length: AbstractVar[Scalar]  # type: ignore[misc]
    rest_length: AbstractVar[Scalar]  # type: ignore[misc]
    upper_length: AbstractVar[Scalar]  # type: ignore[misc]
    rest_volume: AbstractVar[Scalar]  # type: ignore[misc]
    threshold_width: AbstractVar[Scalar]  # type: ignore[misc]
    volume_known: AbstractVar[bool]  # type: ignore[misc]

    def threshold(self) -> Scalar | float:
        """Gauge pressure at which the bladder reaches the braid [Pa]; none by default."""
        return 0.0

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy with the volume of eq. 38b above the threshold [J]."""
        line = {
            "rest_length": self.rest_length,
            "shortest_length": self.shortest_length,
            "per_pressure": self.stiffness_per_pressure,
        }
        upper, rest = self.upper_length, self.rest_volume
        if not self.volume_known:
            rest = volume_when_unknown(upper_length=upper, thread_strain=self.thread_strain, **line)
        return bladder.gas_energy(
            pressure,
            spring_volume(length, rest_volume=rest, **line),
            upper_volume=spring_volume(upper, rest_volume=rest, **line),
            threshold_pressure=self.threshold(),
            threshold_width=self.threshold_width,
        )

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from a tenth of the rest length to the upper working length [m]."""
        return 0.1 * self.rest_length, self.upper_length

    def has_volume(self) -> bool:
        """Whether the rest volume was given."""
        return self.volume_known


class GasSpring(SpringVolume):
    """Gas spring (eq. 11)."""

    stiffness_per_pressure: Scalar = dimensions.stiffness_per_pressure()
    shortest_length: Scalar = dimensions.shortest_length()
    rest_length: Scalar = dimensions.rest_length()
    upper_length: Scalar = dimensions.upper_length()
    rest_volume: Scalar = dimensions.rest_volume()
    threshold_width: Scalar = dimensions.threshold_width()
    volume_known: bool = field(static=True, kw_only=True, default=True)

    title = "Gas spring"
    cites = ("chou1996",)
    any_length = True
    fitted = ("stiffness_per_pressure", "shortest_length")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Zero: eq. 11 has no passive part [N]."""
        return jnp.zeros_like(length)
