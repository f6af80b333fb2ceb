"""Quick exhaust valve: inflow is passed to the work port, return flow directly to the exhaust.

    y = 1 + (Pin - Pwork + Pc)/band                       1 or more: inlet feeds work; 0 or less: work vents to exhaust
    feed: f(y),   vent: 1 - f(y),   f = y^2 (3 - 2 y) between 0 and 1

The shuttle leaves the exhaust seat when the inlet is Pc below the work port, and has closed the inlet `band` further down.
While it moves a little goes back to the inlet, as in a real one, but nothing from the inlet to the exhaust. Range: a shuttle
without mass. Source of each edge: ISO 6358-1:2013.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.flow import FlowElement, Gases
from ...quantities import quantity
from ..gas import REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from ..orifice import Orifice, opening_flow, steepest_slope
from .shares import EASED_SLOPE, eased


class QuickExhaust(FlowElement):
    """Shuttle between inlet and exhaust, moved by the pressures alone."""

    symbol: ClassVar[str] = "quick_exhaust"
    ports: ClassVar[tuple[str, ...]] = ("inlet", "work", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    feed: Orifice = field(kw_only=True)
    vent: Orifice = field(kw_only=True)
    cracking_pressure: Scalar = quantity(
        "Pa", (0.0, 1e6), "inlet below work before it vents", symbol="Pc", typical=(1e3, 3e4), default=5e3
    )
    band: Scalar = quantity("Pa", (100.0, 1e6), "further fall until it has shuttled", typical=(2e3, 5e4), default=1e4)

    def openings(self, gas: Gases) -> tuple[Scalar, Scalar]:
        """Shares of feed and vent that are open [1]."""
        inlet, work, _ = (g.pressure_abs for g in gas)
        feed = eased(1.0 + (inlet - work + self.cracking_pressure) / self.band)
        return feed, 1.0 - feed

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Inlet to work, and work to exhaust [kg/s]."""
        inlet, work, exhaust = gas
        feed, vent = self.openings(gas)
        return opening_flow(self.feed, inlet, work, feed), opening_flow(self.vent, work, exhaust, vent)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slopes of the restrictions, and of their openings while the shuttle moves [kg/(s Pa)]."""
        slopes = []
        for edge, a, b in ((self.feed, gas[0], gas[1]), (self.vent, gas[1], gas[2])):
            upstream = jnp.where(a.pressure_abs >= b.pressure_abs, a.temperature, b.temperature)
            choked = edge.conductance * REFERENCE_DENSITY * jnp.sqrt(REFERENCE_TEMPERATURE / upstream)
            choked = choked * jnp.maximum(a.pressure_abs, b.pressure_abs)
            slopes.append(steepest_slope(edge, a, b) + EASED_SLOPE * choked / self.band)
        return tuple(slopes)

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Opening of the vent [1]."""
        return {"vent_opening": self.openings(gas)[1]}
