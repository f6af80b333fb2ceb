"""A worn braid: threads are lost, or the rubber is warm; a change of any law that keeps it a potential.

    G(L, P') = (1 - s) G0(L, P') + s G0(Lr, P'),     Fe(L) = (1 + dT/T0) Fe0(L)

G0 and Fe0 are the gas energy and the wall's tension of the sound law. Where threads are missing, nothing couples the length
to the volume: over this share s of the circumference the bladder keeps the volume of the length Lr, and by virtual work its
gas does not pull. The modulus of rubber grows with its absolute temperature T0 + dT. Both leave F and V derivatives of one
function, so that no closed cycle yields work. Range: shares and temperatures at which the bladder holds; no bulge of the
bladder through the gap, no loss of friction, and the rubber's entropic part only.
Source: virtual work of C.-P. Chou and B. Hannaford, 1996, doi:10.1109/70.481753; modulus and temperature: the statistical
theory of rubber elasticity, L. R. G. Treloar, The Physics of Rubber Elasticity, 1975. The share is this project's.
"""

from __future__ import annotations

from .._jax import jnp
from ..components import Scalar
from ..quantities import quantity
from .law import TensionLaw

ROOM = 293.15  # temperature at which a law's rubber was measured [K]
FILLED = 0.8  # of the longest length: where a law states no rest length, the lost share is as wide as there


class WornBraid(TensionLaw):
    """A law whose braid has lost threads, or whose rubber is warm; with both at zero it is the law itself."""

    sound: TensionLaw  # type: ignore[misc]  # all quantities are keyword-only
    lost_threads: Scalar = quantity(
        "1", (0.0, 0.9), "share of the circumference without threads", symbol="s", default=0.0
    )
    warming: Scalar = quantity(
        "K", (0.0, 100.0), "rubber's temperature above room temperature", symbol="dT", default=0.0
    )

    title = "Worn braid"
    cites = ("chou1996",)
    fitted = ("lost_threads", "warming")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Force of the warm wall without gas [N]."""
        return (1.0 + self.warming / ROOM) * self.sound.elastic_tension(length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy of the shares with and without threads [J]."""
        kept = self.sound.gas_energy(length, pressure)
        rest = getattr(self.sound, "rest_length", None)
        held = jnp.asarray(FILLED * self.sound.length_range()[1] if rest is None else rest)
        lost = self.sound.gas_energy(held + 0.0 * length, pressure)
        return kept + self.lost_threads * (lost - kept)

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range of the sound law [m]."""
        return self.sound.length_range()

    def has_volume(self) -> bool:
        """Whether the sound law knows its volume."""
        return self.sound.has_volume()
