"""The third tube model of Chou and Hannaford: viscous and turbulent resistance, and the inertia of the gas.

    P1 - P2 = R1 v + R2 v |v| + (l/A) dw/dt,   v = w/(rho A)                                              (eqs. 25-31)

Range and faults as the quadratic model's, but its parameters move less between accumulators. The inertance l/A of 100 cm of
1/8 in tube is 1260 1/cm = 1.26e-3 bar s2/g; the paper prints 126 1/cm. Source: C.-P. Chou and B. Hannaford, IEEE Trans.
Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar
from ...components.flow import GasState, TwoPort
from ...quantities import quantity
from ..gas import AIR, Gas
from .quadratic import mean_density


def inertance(*, length: Scalar, area: Scalar) -> Scalar:
    """Pressure per rate of mass flow of a tube, l/A [1/m] (eq. 30); length [m], area [m^2]."""
    return length / area


class InertialTube(TwoPort):
    """Resistance and inertance; its state is the mass flow [kg/s] (eqs. 25-31)."""

    symbol: ClassVar[str] = "tube"
    viscous: Scalar = quantity("Pa*s/m", (0.0, 1e8), "viscous coefficient", symbol="R1", typical=(1.0, 1e3))
    turbulent: Scalar = quantity("Pa*s^2/m^2", (0.0, 1e8), "turbulent coefficient", symbol="R2", typical=(0.1, 1e3))
    area: Scalar = quantity("m^2", (1e-9, 1e-2), "effective cross section", symbol="A", typical=(1e-6, 1e-4))
    length: Scalar = quantity("m", (1e-3, 100.0), "effective length", symbol="l", typical=(0.1, 5.0))
    gas: Gas = AIR

    def initial(self) -> Tree:
        """State without flow."""
        return jnp.zeros(())

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """The state itself [kg/s]."""
        flow: Scalar = state
        return flow

    def rate(self, a: GasState, b: GasState, state: Tree, command: Scalar) -> Tree:
        """dw/dt [kg/s^2]."""
        speed = state / (mean_density(self.gas, a, b, state >= 0.0) * self.area)
        loss = self.viscous * speed + self.turbulent * speed * jnp.abs(speed)
        return (a.pressure_abs - b.pressure_abs - loss) / inertance(length=self.length, area=self.area)
