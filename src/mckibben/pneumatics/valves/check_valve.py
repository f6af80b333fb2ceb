"""A check valve: nothing passes backwards.

    w = f((Pa - Pb - Pc)/band) w_ISO(Pa, Pb),   f = 0 below 0, y^2 (3 - 2 y) between, 1 above 1

Pc is the cracking pressure, and `band` the further rise at which it is fully open. Range: the poppet has no mass, so that
chatter is not shown. Source of w_ISO: ISO 6358-1:2013, see `mckibben.pneumatics.orifice`.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.flow import Gases, GasState, TwoPort
from ...quantities import quantity
from ..gas import REFERENCE_TEMPERATURE
from ..orifice import Orifice, conductance_flow, opening_flow, steepest_slope
from .shares import EASED_SLOPE, eased


class CheckValve(TwoPort):
    """Opens from a to b only."""

    symbol: ClassVar[str] = "check_valve"
    passage: Orifice = field(kw_only=True)
    cracking_pressure: Scalar = quantity(
        "Pa", (0.0, 1e6), "pressure difference at which it opens", symbol="Pc", typical=(1e3, 5e4), default=5e3
    )
    band: Scalar = quantity("Pa", (100.0, 1e6), "further difference until fully open", typical=(2e3, 1e5), default=1e4)

    def opening(self, a: GasState, b: GasState) -> Scalar:
        """Share of the passage that is open [1]."""
        return eased((a.pressure_abs - b.pressure_abs - self.cracking_pressure) / self.band)

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s], never negative."""
        return opening_flow(self.passage, a, b, self.opening(a, b))

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Largest slope of the flow, including the opening of the poppet [kg/(s Pa)]."""
        a, b = gas
        # the opening only changes up to this difference, where the flow is largest
        lifted = self.cracking_pressure + self.band
        flow = conductance_flow(
            a.pressure_abs,
            REFERENCE_TEMPERATURE / a.temperature,
            jnp.maximum(a.pressure_abs - lifted, 0.0),
            conductance=self.passage.conductance,
            critical_ratio=self.passage.critical_ratio,
            linear_band=self.passage.linear_band,
        )
        return (steepest_slope(self.passage, a, b) + EASED_SLOPE * flow / self.band,)

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Opening of the valve [1]."""
        return {"opening": self.opening(*gas)}
