"""A proportional spool valve between supply, work and exhaust (3/3): a positive command fills, a negative one vents.

    ds/dt = clip((u - s)/tau, -v, v),   u = clip(command, -1, 1)                                 after the dead time
    fill: f((s - o)/(1 - o)) + l (1 - |s|),   vent: f((-s - o)/(1 - o)) + l (1 - |s|),   f = clip to 0 .. 1

s is the position of the spool over its stroke, o the overlap of either edge (a dead band; negative for an underlap, where
both edges are open in mid position), and l the leakage past the spool, largest in mid position, where it is a share of the
full conductance. The command saturates, and so does the flow. Range: the position loop of the spool is a lag with a speed
limit; no pressure forces on the spool. A lag inside a fast pressure loop rings: the loop must be slower than dead time and
lag.
Source of each edge: ISO 6358-1:2013.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.flow import FlowElement, Gases
from ...quantities import quantity
from ..orifice import Orifice, opening_flow, steepest_slope
from .shares import between, share


class SpoolValve(FlowElement):
    """Proportional valve with dead time, lag, speed limit, overlap and leakage; its state is the spool's position."""

    symbol: ClassVar[str] = "proportional_valve"
    ports: ClassVar[tuple[str, ...]] = ("supply", "work", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    commanded: ClassVar[bool] = True
    command_range: ClassVar[tuple[float, float]] = (-1.0, 1.0)
    fill: Orifice = field(kw_only=True)
    vent: Orifice = field(kw_only=True)
    dead_time: Scalar = quantity("s", (0.0, 1.0), "of the command", typical=(0.0, 1e-2), default=0.0)
    lag: Scalar = quantity("s", (1e-4, 10.0), "time constant of the spool", symbol="tau", typical=(1e-3, 2e-2))
    speed_limit: Scalar = quantity(
        "1/s", (0.1, 1e5), "stroke from mid to end per time", symbol="v", typical=(50.0, 1e3), default=1e5
    )
    overlap: Scalar = quantity(
        "1",
        (-0.9, 0.9),
        "share of the stroke before an edge opens, negative: open in mid position",
        symbol="o",
        typical=(-0.1, 0.1),
        default=0.0,
    )
    leakage: Scalar = quantity(
        "1", (0.0, 0.5), "leakage in mid position over full conductance", symbol="l", typical=(0.0, 0.02), default=0.0
    )

    def openings(self, position: Scalar) -> tuple[Scalar, Scalar]:
        """Shares of fill and vent that are open, at a position of -1 to 1."""
        leak = self.leakage * (1.0 - share(jnp.where(position >= 0.0, position, -position)))
        stroke = 1.0 - self.overlap
        return share((position - self.overlap) / stroke) + leak, share((-position - self.overlap) / stroke) + leak

    def initial(self) -> Tree:
        """State in mid position."""
        return jnp.zeros(())

    def rates(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Tree:
        """Speed of the spool [1/s]."""
        return between((between(command, -1.0, 1.0) - state) / self.lag, -self.speed_limit, self.speed_limit)

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Supply to work, and work to exhaust [kg/s]."""
        supply, work, exhaust = gas
        fill, vent = self.openings(state)
        return opening_flow(self.fill, supply, work, fill), opening_flow(self.vent, work, exhaust, vent)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slopes at equal pressures, with the edges as they are or will be at the command [kg/(s Pa)]."""
        supply, work, exhaust = gas
        ahead = between(command, -1.0, 1.0)
        fill, _ = self.openings(jnp.maximum(state, ahead))
        _, vent = self.openings(jnp.minimum(state, ahead))
        return steepest_slope(self.fill, supply, work) * fill, steepest_slope(self.vent, work, exhaust) * vent

    def delay(self) -> Scalar:
        """Dead time of the command [s]."""
        return self.dead_time

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Position of the spool [1]."""
        return {"position": state}
