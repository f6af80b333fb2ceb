"""The linearised law with threshold and passive stiffness, the one that Chou and Hannaford fit to their muscles.

    F = Kg (P' - Pth)(L - Lmin) + Kp (L - L0) + nl(L)    above the threshold                                  (eq. 12a)
    F = Kp (L - L0) + nl(L)                              below it                                             (eq. 12b)
    F = Kg (P' - Pa)(L - Lmin) + Fa                      the same above the threshold, for a fit               (eq. 13)
        with Pa = Pth - Kp/Kg and Fa = Kp (Lmin - L0)

Here the step of eq. 12 is rounded over ``threshold_width``, because the law and its volume must come from one potential:
outside Pth +- w/2 and up to ``upper_length`` the printed equations hold to rounding. Range: taut lengths in which the
tension is straight, 0.75-1.1 L0 for the nylon muscle, 0-5 bar. Largest deviation from the printed sample points: a few N.
Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from ...components import Scalar, field
from ...quantities import quantity
from .. import dimensions
from ..braid import stop_tension
from .gas_spring import SpringVolume


class LinearThreshold(SpringVolume):
    """Linearised law with threshold and passive stiffness (eqs. 12a, 12b and 13)."""

    stiffness_per_pressure: Scalar = dimensions.stiffness_per_pressure()
    shortest_length: Scalar = dimensions.shortest_length()
    threshold_pressure: Scalar = quantity(
        "Pa", (-5e5, 2e6), "gauge pressure at which the bladder reaches the braid", symbol="Pth", typical=(0.0, 2e5)
    )
    passive_stiffness: Scalar = quantity(
        "N/m", (0.0, 1e6), "passive stiffness of bladder and braid", symbol="Kp", typical=(1e1, 1e4), along=-1
    )
    rest_length: Scalar = dimensions.rest_length()
    upper_length: Scalar = dimensions.upper_length()
    rest_volume: Scalar = dimensions.rest_volume()
    threshold_width: Scalar = dimensions.threshold_width(8.5e4)
    stop_stiffness: Scalar = dimensions.stop_stiffness()
    volume_known: bool = field(static=True, kw_only=True, default=True)

    title = "Linear with threshold"
    cites = ("chou1996",)
    any_length = True
    fitted = ("stiffness_per_pressure", "shortest_length", "threshold_pressure", "passive_stiffness")

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Passive spring and stop, eq. 12b [N]."""
        spring = self.passive_stiffness * (length - self.rest_length)
        return spring + stop_tension(length, begins_at=self.upper_length, stiffness=self.stop_stiffness)

    def threshold(self) -> Scalar:
        """Pth [Pa]."""
        return self.threshold_pressure

    @property
    def offset_pressure(self) -> Scalar:
        """Pa of eq. 13 [Pa]."""
        return self.threshold_pressure - self.passive_stiffness / self.stiffness_per_pressure

    @property
    def offset_tension(self) -> Scalar:
        """Fa of eq. 13 [N]."""
        return self.passive_stiffness * (self.shortest_length - self.rest_length)
