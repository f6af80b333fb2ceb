"""A switching valve between two ports (2/2, closed without current).

    w = x(t) w_ISO(Pa, Pb)

The opening x follows the command as `mckibben.pneumatics.valves.solenoid` says, w_ISO as ISO 6358-1:2013 says. Range: both
directions of flow alike. The motion does not depend on the pressures, unless the valve has a pilot stage
(`mckibben.pneumatics.valves.pilot_stage`), which takes its gas from the first port.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree
from ...components import Scalar, field
from ...components.flow import Gases, GasState, TwoPort
from ..orifice import Orifice, opening_flow, steepest_slope
from .pilot_stage import PilotStage
from .solenoid import Solenoid


class OnOffValve(TwoPort):
    """Open above a command of 0.5, closed below, after its dead and switching times."""

    symbol: ClassVar[str] = "on_off_valve"
    commanded: ClassVar[bool] = True
    command_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    passage: Orifice = field(kw_only=True)
    drive: Solenoid = field(kw_only=True)
    pilot: PilotStage | None = field(kw_only=True, default=None)

    def initial(self) -> Tree:
        """Closed."""
        return self.drive.initial()

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        return opening_flow(self.passage, a, b, self.drive.opening(state))

    def rate(self, a: GasState, b: GasState, state: Tree, command: Scalar) -> Tree:
        """Rates of change of flux, or of the pilot's pressure, and of stroke [1/s]."""
        if self.pilot is None:
            return self.drive.rates(state, command)
        return self.pilot.rates(self.drive, state, command, a.pressure_abs)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slope at equal pressures; of the open valve where it is on its way [kg/(s Pa)]."""
        return (steepest_slope(self.passage, *gas) * self.drive.widest(state, command),)

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Opening of the valve [1]."""
        return {"opening": self.drive.opening(state)}
