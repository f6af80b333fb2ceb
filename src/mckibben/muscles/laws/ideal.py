"""The ideal virtual-work law: a cylindrical braid of inextensible threads around a bladder without stiffness.

    F = P' b^2 (3 cos^2 theta - 1) / (4 pi n^2) = (pi D0^2 P'/4)(3 cos^2 theta - 1),   cos theta = L/b     (eqs. 8a, 8b)

Range: gauge pressures above half the threshold width; braid lengths up to 0.9915 of the thread length, where the volume
has all but vanished and the threads are straight.
It errs by 10-20 % of the largest force on real muscles, most at the ends of the stroke, since it knows neither wall nor
bladder. First stated by R. H. Gaylord (US patent 2,844,126, 1958) and H. F. Schulte (1961); this form: C.-P. Chou and
B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar
from .. import bladder, braid, dimensions, threads
from ..law import TensionLaw

# Just short of the thread length: there the braid still holds a thousandth of its largest volume, and no formula is asked
# beyond.
LONGEST = 0.9995


class Ideal(TensionLaw):
    """Ideal virtual-work law (eq. 8)."""

    thread_length: Scalar = dimensions.thread_length()
    turns: Scalar = dimensions.turns()
    threshold_width: Scalar = dimensions.threshold_width()

    title = "Ideal virtual work"
    cites = ("gaylord1958", "schulte1961", "chou1996")
    any_length = True
    fitted = ("thread_length", "turns")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Zero: the ideal bladder has no stiffness [N]."""
        return jnp.zeros_like(length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy with the volume of eq. 7 [J]."""
        shape = {"thread_length": self.thread_length, "turns": self.turns}
        return bladder.gas_energy(
            pressure,
            braid.volume(length, **shape),
            upper_volume=braid.volume(LONGEST * self.thread_length, **shape),
            threshold_width=self.threshold_width,
        )

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from a hundredth of the thread length to where the threads, pulled straight, take the tension over [m]."""
        return 0.01 * self.thread_length, LONGEST * self.thread_length / (1.0 + threads.furthest(self.thread_strain))
