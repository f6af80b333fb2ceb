"""The virtual-work law with a wall: bladder and braid of constant thickness tk reduce the gas volume.

    F = (pi D0^2 P'/4)(3 cos^2 theta - 1) + pi P' [D0 tk (2 sin theta - 1/sin theta) - tk^2]               (eqs. 9, 10)

Range: gauge pressures above half the threshold width; braid lengths up to ``upper_length``, which must stay below the
length where this law loses its stiffness (15.48 cm for the nylon muscle). With tk -> 0 it becomes the ideal law.
Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar
from ...quantities import quantity
from .. import bladder, braid, dimensions
from ..braid import stop_tension
from ..law import TensionLaw


class ThickWall(TensionLaw):
    """Virtual-work law with wall thickness (eqs. 9 and 10)."""

    thread_length: Scalar = dimensions.thread_length()
    turns: Scalar = dimensions.turns()
    wall_thickness: Scalar = quantity(
        "m", (0.0, 0.05), "thickness of bladder and braid together", symbol="tk", typical=(1e-4, 3e-3)
    )
    upper_length: Scalar = dimensions.upper_length()
    threshold_width: Scalar = dimensions.threshold_width()
    stop_stiffness: Scalar = dimensions.stop_stiffness()

    title = "Virtual work with wall thickness"
    cites = ("chou1996",)
    any_length = True
    fitted = ("thread_length", "turns", "wall_thickness")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Zero up to the upper working length, then the stop [N]."""
        return stop_tension(length, begins_at=self.upper_length, stiffness=self.stop_stiffness)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy with the volume of eq. 9 [J]."""
        shape = {"thread_length": self.thread_length, "turns": self.turns, "wall_thickness": self.wall_thickness}
        # A guard for wild trial values of a fit: the upper volume may not vanish.
        least = 1e-6 * self.thread_length**3 / self.turns**2
        return bladder.gas_energy(
            pressure,
            braid.inner_volume(length, **shape),
            upper_volume=jnp.maximum(braid.inner_volume(self.upper_length, **shape), least),
            threshold_width=self.threshold_width,
        )

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from a hundredth of the thread length to the upper working length [m]."""
        return 0.01 * self.thread_length, self.upper_length
