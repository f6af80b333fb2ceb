"""A switching valve between supply, work and exhaust (3/2, vented without current).

    fill: f((x - (1 + o)/2)/((1 - o)/2)),   vent: f(((1 - o)/2 - x)/((1 - o)/2)),   f = clip to 0 .. 1

x is the stroke as `mckibben.pneumatics.valves.solenoid` says. With an overlap o of zero or more both edges are never open
at once, and nothing crosses from supply to exhaust; with a negative one they are, in the middle of the stroke, as in a
poppet valve that lifts from one seat before it meets the other. Range and sources as there, and ISO 6358-1:2013 for each
edge.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.flow import FlowElement, Gases
from ...quantities import quantity
from ..orifice import Orifice, opening_flow, steepest_slope
from .shares import share
from .solenoid import Solenoid


class ThreeWayValve(FlowElement):
    """Supply to work above a command of 0.5, work to exhaust below."""

    symbol: ClassVar[str] = "on_off_valve"
    ports: ClassVar[tuple[str, ...]] = ("supply", "work", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    commanded: ClassVar[bool] = True
    command_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    fill: Orifice = field(kw_only=True)
    vent: Orifice = field(kw_only=True)
    drive: Solenoid = field(kw_only=True)
    overlap: Scalar = quantity(
        "1", (-0.9, 0.9), "share of the stroke with both edges closed, negative: open", typical=(-0.3, 0.3), default=0.1
    )

    def openings(self, stroke: Scalar) -> tuple[Scalar, Scalar]:
        """Shares of fill and vent that are open, at a stroke of 0 to 1 beyond the seat."""
        half = 0.5 * (1.0 - self.overlap)
        return share((stroke - (1.0 - half)) / half), share((half - stroke) / half)

    def initial(self) -> Tree:
        """Vented."""
        return self.drive.initial()

    def rates(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Tree:
        """Rates of change of flux and stroke [1/s]."""
        return self.drive.rates(state, command)

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Supply to work, and work to exhaust [kg/s]."""
        supply, work, exhaust = gas
        fill, vent = self.openings(self.drive.opening(state))
        return opening_flow(self.fill, supply, work, fill), opening_flow(self.vent, work, exhaust, vent)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slopes at equal pressures, of the edges as they are or will soon be [kg/(s Pa)]."""
        supply, work, exhaust = gas
        fill, _ = self.openings(self.drive.widest(state, command))
        _, vent = self.openings(self.drive.opening(state))
        vent = jnp.where(jnp.asarray(command) > 0.5, vent, 1.0)
        return steepest_slope(self.fill, supply, work) * fill, steepest_slope(self.vent, work, exhaust) * vent

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Stroke of the valve [1]."""
        return {"opening": self.drive.opening(state)}
