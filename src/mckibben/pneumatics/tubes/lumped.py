"""A lumped tube that keeps what the three models of the paper leave out, at the cost of the third.

    (l/A) dw/dt = Pa - Pe - R1 v - (K/2) rho v |v|,   v = w/(rho A),   rho at the mean pressure
    Pe = max(Pb, w a/(gamma A))

* The turbulent loss grows with density: with K = f l/D + entry and exit it is the isothermal pipe flow between the ends.
* Half the tube's volume is given to either end.
* Pe is the pressure in the exit: it cannot fall below the one at which the gas leaves with the speed of sound, so the flow
  chokes. The same holds for reverse flow.

Range: tubes shorter than a quarter of the shortest wave (1 m up to about 80 Hz); one temperature along the tube. Sources:
isothermal and choked pipe flow, A. H. Shapiro, The Dynamics and Thermodynamics of Compressible Fluid Flow, 1953; laminar
R1 = 32 mu l/D^2 (Hagen and Poiseuille).
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from ...components import Scalar
from ...components.flow import GasState, TwoPort
from ...quantities import quantity
from ..gas import AIR, Gas
from .inertial import inertance
from .quadratic import mean_density


class LumpedTube(TwoPort):
    """Inertance, density-dependent loss, choking, and the tube's own volume; its state is the mass flow [kg/s]."""

    length: Scalar = quantity("m", (1e-3, 100.0), "length", symbol="l", typical=(0.1, 5.0))
    diameter: Scalar = quantity("m", (1e-4, 0.1), "inner diameter", symbol="D", typical=(1e-3, 1e-2))
    viscous: Scalar = quantity("Pa*s/m", (0.0, 1e8), "viscous coefficient", symbol="R1", typical=(1.0, 1e3))
    loss: Scalar = quantity(
        "1", (0.0, 1e5), "loss of velocity heads, f l/D with ends", symbol="K", typical=(1.0, 100.0)
    )
    gas: Gas = AIR

    @classmethod
    def of_pipe(cls, *, length: float, diameter: float, friction: float = 0.024, ends: float = 1.5) -> LumpedTube:
        """A tube from its dimensions [m], a friction factor [1] and the loss of its ends [1]; air at 293 K."""
        viscous = 32.0 * AIR.viscosity(293.15) * length / diameter**2
        return cls(length=length, diameter=diameter, viscous=viscous, loss=friction * length / diameter + ends)

    @property
    def area(self) -> Scalar:
        """Cross section [m^2]."""
        return 0.25 * jnp.pi * self.diameter**2

    def initial(self) -> Any:
        """No flow."""
        return jnp.zeros(())

    def mass_flow(self, a: GasState, b: GasState, state: Any = (), command: Any = 0.0) -> Scalar:
        """The state itself [kg/s]."""
        return state

    def rate(self, a: GasState, b: GasState, state: Any, command: Any) -> Any:
        """dw/dt [kg/s^2]."""
        density = mean_density(self.gas, a, b)
        speed = state / (density * self.area)
        loss = (self.viscous + 0.5 * self.loss * density * jnp.abs(speed)) * speed
        upstream = jnp.where(state >= 0.0, a.temperature, b.temperature)
        sonic = state * self.gas.sound_speed(upstream) / (self.gas.heat_ratio * self.area)
        drop = jnp.maximum(a.pressure_abs, -sonic) - jnp.maximum(b.pressure_abs, sonic)
        return (drop - loss) / inertance(length=self.length, area=self.area)

    def inner_volume(self) -> Scalar:
        """Volume of the bore [m^3]."""
        return self.area * self.length
