"""The second tube model of Chou and Hannaford: a resistance with a viscous and a turbulent part.

    P1 - P2 = R1 v + R2 v |v|,   v = w/(rho A),   rho = (P1 + P2)/(2 R T)                                 (eqs. 20-24)

Solved for v in closed form. The printed R2 v^2 has no sign, so that reverse flow would be driven the wrong way; here
it has one. R2 does not grow with density, although a turbulent loss does. Range: one pressure level and one accumulator;
refitted to another it changes. Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996,
doi:10.1109/70.481753.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar
from ...components.flow import GasState, TwoPort
from ...quantities import quantity
from ..gas import AIR, Gas


def mean_density(gas: Gas, a: GasState, b: GasState, forward: Scalar) -> Scalar:
    """Density at the mean pressure of the ends [kg/m^3] (eq. 21), at the temperature of where the gas comes from."""
    upstream = jnp.where(forward, a.temperature, b.temperature)
    return gas.density(0.5 * (a.pressure_abs + b.pressure_abs), upstream)


# Keeps the slope at no flow finite; a thousandth of the paper's R1, which it changes by 1e-6 of it [Pa s/m].
LEAST_VISCOUS = 0.05


class QuadraticTube(TwoPort):
    """Viscous and turbulent resistance (eqs. 20-24)."""

    symbol: ClassVar[str] = "tube"
    viscous: Scalar = quantity("Pa*s/m", (0.0, 1e8), "viscous coefficient", symbol="R1", typical=(1.0, 1e3))
    turbulent: Scalar = quantity("Pa*s^2/m^2", (1e-6, 1e8), "turbulent coefficient", symbol="R2", typical=(0.1, 1e3))
    area: Scalar = quantity("m^2", (1e-9, 1e-2), "effective cross section", symbol="A", typical=(1e-6, 1e-4))
    gas: Gas = AIR

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        drop = a.pressure_abs - b.pressure_abs
        # The root in the form that does not cancel, and whose slope at zero is 1/R1; a little R1 is always there.
        viscous = jnp.sqrt(self.viscous**2 + LEAST_VISCOUS**2)
        speed = 2.0 * drop / (viscous + jnp.sqrt(viscous**2 + 4.0 * self.turbulent * jnp.abs(drop)))
        return mean_density(self.gas, a, b, drop >= 0.0) * self.area * speed
