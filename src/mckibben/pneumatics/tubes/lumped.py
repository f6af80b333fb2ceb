"""A lumped tube that keeps what the three models of the paper leave out, at about the cost of the third.

    (l/A) dw/dt = P1 - P2 - loss,   loss = (f l/D + K + 2 ln(P1/P2)) rho v |v| / 2,   v = w/(rho A)
    P2 = max(Pb, w a/(gamma A)),   rho at the mean of P1 and P2,   f(Re) laminar, or turbulent by Haaland

* The turbulent loss grows with density, and the friction factor follows the Reynolds number of the flow, not a fit. Steady
  and at one temperature it is the exact isothermal pipe flow, the gas's own acceleration (the logarithm) included.
* Half the tube's volume is given to either end.
* P2 is the pressure in the exit: it cannot fall below the one at which the gas leaves with the speed of sound, so the flow
  chokes. The same holds for reverse flow.

Range: tubes shorter than a quarter of the shortest wave (1 m up to about 80 Hz), hydraulically developed, one temperature
along the tube. Sources: isothermal and choked pipe flow, A. H. Shapiro, The Dynamics and Thermodynamics of Compressible
Fluid Flow, 1953; friction as in the distributed tube.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar
from ...components.flow import GasState, TwoPort
from ...quantities import quantity
from ..gas import AIR, Gas
from ..wall_friction import haaland, turbulence
from .inertial import inertance


class LumpedTube(TwoPort):
    """Inertance, friction by Reynolds number, choking, and the tube's own volume; its state is the mass flow [kg/s].

    `ends` counts velocity heads lost at both ends: 0.5 for a sharp inlet and 1 for the outlet into a volume; fittings add.
    `friction_scale` is for what a straight smooth pipe does not have: bends, couplings, a collapsed bore.
    """

    symbol: ClassVar[str] = "tube"
    length: Scalar = quantity("m", (1e-3, 100.0), "length", symbol="l", typical=(0.1, 5.0))
    diameter: Scalar = quantity("m", (1e-4, 0.1), "inner diameter", symbol="D", typical=(1e-3, 1e-2))
    roughness: Scalar = quantity("m", (0.0, 1e-3), "height of the wall's roughness", symbol="eps", default=1.5e-6)
    ends: Scalar = quantity("1", (0.0, 1e3), "loss of both ends in velocity heads", symbol="K", default=1.5)
    friction_scale: Scalar = quantity("1", (0.01, 100.0), "friction over that of a straight pipe", default=1.0)
    wall_temperature: Scalar = quantity("K", (200.0, 500.0), "temperature of the wall", symbol="Tw", default=293.15)
    gas: Gas = AIR

    @property
    def area(self) -> Scalar:
        """Cross section [m^2]."""
        return 0.25 * jnp.pi * self.diameter**2

    def initial(self) -> Tree:
        """State without flow."""
        return jnp.zeros(())

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """The state itself [kg/s]."""
        flow: Scalar = state
        return flow

    def rate(self, a: GasState, b: GasState, state: Tree, command: Scalar) -> Tree:
        """dw/dt [kg/s^2]."""
        forward = state >= 0.0
        temperature = jnp.where(forward, a.temperature, b.temperature)
        flux = state / self.area
        sonic = flux * self.gas.sound_speed(temperature) / self.gas.heat_ratio
        # The pressure in whichever bore is the exit, as choices: at a tie a maximum has half a derivative.
        p1 = jnp.where(a.pressure_abs < -sonic, -sonic, a.pressure_abs)
        p2 = jnp.where(b.pressure_abs < sonic, sonic, b.pressure_abs)
        drop, twice = p1 - p2, 1.0 / (p1 + p2)
        volume = 2.0 * self.gas.gas_constant * temperature * twice  # of the mean gas per mass
        size = jnp.abs(flux)
        viscosity = self.gas.viscosity(self.wall_temperature)  # friction acts at the wall, which is known in advance
        reynolds = size * self.diameter / viscosity
        share = turbulence(reynolds)
        slender = self.friction_scale * self.length / self.diameter
        laminar = (1.0 - share) * 32.0 * viscosity * slender / self.diameter
        pipe = share * haaland(reynolds, self.roughness / self.diameter) * slender
        # 2 ln(P1/P2) = 4 atanh x, by a series that is within 0.6 % up to P1 = 5 P2
        x = jnp.where(forward, drop, -drop) * twice
        x = jnp.where(x < 0.0, 0.0, x)
        accelerating = 4.0 * x * (1.0 + x * x * (1.0 / 3.0 + x * x * (0.2 + x * x / 7.0)))
        loss = volume * flux * (laminar + 0.5 * size * (pipe + self.ends + accelerating))
        return (drop - loss) / inertance(length=self.length, area=self.area)

    def inner_volume(self) -> Scalar:
        """Volume of the bore [m^3]."""
        return self.area * self.length
