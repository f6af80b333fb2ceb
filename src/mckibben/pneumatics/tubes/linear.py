"""The first tube model of Chou and Hannaford: a constant resistance to mass flow.

    (P1 - P2)/R = w                                                                                      (eqs. 17-19)

With an accumulator it is a first-order low-pass, too fast at low and too slow at high pressure: a turbulent resistance is no
constant. Range: small changes around one pressure. Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation
12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree
from ...components import Scalar
from ...components.flow import GasState, TwoPort
from ...quantities import quantity


class LinearTube(TwoPort):
    """Linear resistance (eqs. 17-19)."""

    symbol: ClassVar[str] = "tube"
    resistance: Scalar = quantity("Pa*s/kg", (1e3, 1e14), "pressure per mass flow", symbol="R", typical=(1e6, 1e10))

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        return (a.pressure_abs - b.pressure_abs) / self.resistance
