"""The first tube model of Chou and Hannaford: a constant resistance to mass flow.

    (P1 - P2)/R = w                                                                                      (eqs. 17-19)

With an accumulator it is a first-order low-pass, too fast at low and too slow at high pressure: a turbulent resistance is no
constant. Range: small changes around one pressure. Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation
12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from ...components import Scalar
from ...components.flow import FlowElement, GasState
from ...quantities import quantity


class LinearTube(FlowElement):
    """Linear resistance (eqs. 17-19)."""

    resistance: Scalar = quantity("Pa*s/kg", (1e3, 1e14), "pressure per mass flow", symbol="R", typical=(1e6, 1e10))

    def initial(self) -> Any:
        """No state."""
        return ()

    def mass_flow(self, a: GasState, b: GasState, state: Any, command: Any) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        return (a.pressure_abs - b.pressure_abs) / self.resistance

    def rate(self, a: GasState, b: GasState, state: Any, command: Any) -> Any:
        """No state."""
        return ()

    def inner_volume(self) -> Scalar:
        """The paper ignores the tube's volume [m^3]."""
        return jnp.zeros(())
