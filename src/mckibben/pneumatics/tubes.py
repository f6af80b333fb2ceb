"""Lumped models of a tube with one interface: three of Chou and Hannaford, and one more accurate.

The friction of developed flow in a pipe is that of the lumped and of the distributed tube alike.

    f = 64/Re                                                      laminar
    1/sqrt(f) = -1.8 log10((eps/(3.7 D))^1.11 + 6.9/Re)            turbulent (Haaland)

f is Darcy's factor. Between Re = 2300 and 4000 it passes smoothly from one to the other. Range: Re below 1e8, roughness up
to 5 % of the diameter; Haaland's formula is within 2 % of Colebrook's. Source: S. E. Haaland, J. Fluids Eng. 105, 1983,
doi:10.1115/1.3240948.
"""

from __future__ import annotations

from typing import ClassVar

from .._jax import Tree, jnp
from ..components import Scalar
from ..components.flow import GasState, TwoPort
from ..quantities import quantity

LAMINAR_END, TURBULENT_START = 2300.0, 4000.0


def turbulence(reynolds_number: Scalar) -> Scalar:
    """Share of the turbulent law: 0 up to Re = 2300, 1 from 4000, smooth between."""
    x = jnp.clip((reynolds_number - LAMINAR_END) / (TURBULENT_START - LAMINAR_END), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def haaland(reynolds_number: Scalar, relative_roughness: Scalar) -> Scalar:
    """Darcy's friction factor of turbulent flow; below Re = 2300 its value there."""
    re = jnp.maximum(reynolds_number, LAMINAR_END)
    argument = (relative_roughness / 3.7) ** 1.11 + 6.9 / re
    return 1.0 / (1.8 * jnp.log10(argument)) ** 2


def friction_factor(reynolds_number: Scalar, relative_roughness: Scalar) -> Scalar:
    """Darcy's friction factor at any Reynolds number above zero."""
    share = turbulence(reynolds_number)
    return (1.0 - share) * 64.0 / reynolds_number + share * haaland(reynolds_number, relative_roughness)


class LinearTube(TwoPort):
    """Linear resistance (eqs. 17-19).

        (P1 - P2)/R = w                                                                                     (eqs. 17-19)

    With an accumulator it is a first-order low-pass, too fast at low and too slow at high pressure: a turbulent
    resistance is no constant. Range: small changes around one pressure. Source: C.-P. Chou and B. Hannaford, IEEE
    Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
    """

    symbol: ClassVar[str] = "tube"
    resistance: Scalar = quantity("Pa*s/kg", (1e3, 1e14), "pressure per mass flow", symbol="R", typical=(1e6, 1e10))

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        return (a.pressure_abs - b.pressure_abs) / self.resistance


def mean_density(a: GasState, b: GasState, forward: Scalar) -> Scalar:
    """Density at the mean pressure of the ends [kg/m^3] (eq. 21), at the temperature of where the gas comes from."""
    upstream = jnp.where(forward, a.temperature, b.temperature)
    return a.gas.density(0.5 * (a.pressure_abs + b.pressure_abs), upstream)


# Keeps the slope at no flow finite; a thousandth of the paper's R1, which it changes by 1e-6 of it [Pa s/m].
LEAST_VISCOUS = 0.05


class QuadraticTube(TwoPort):
    """Viscous and turbulent resistance (eqs. 20-24).

        P1 - P2 = R1 v + R2 v |v|,  v = w/(rho A),  rho = (P1 + P2)/(2 R T)                                (eqs. 20-24)

    Solved for v in closed form. The printed R2 v^2 has no sign, so that reverse flow would be driven the wrong way;
    here it has one. R2 does not grow with density, although a turbulent loss does. Range: one pressure level and one
    accumulator; refitted to another it changes. Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and
    Automation 12(1), 1996, doi:10.1109/70.481753.
    """

    symbol: ClassVar[str] = "tube"
    viscous: Scalar = quantity("Pa*s/m", (0.0, 1e8), "viscous coefficient", symbol="R1", typical=(1.0, 1e3))
    turbulent: Scalar = quantity("Pa*s^2/m^2", (1e-6, 1e8), "turbulent coefficient", symbol="R2", typical=(0.1, 1e3))
    area: Scalar = quantity("m^2", (1e-9, 1e-2), "effective cross section", symbol="A", typical=(1e-6, 1e-4))

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        drop = a.pressure_abs - b.pressure_abs
        # The root in the form that does not cancel, and whose slope at zero is 1/R1; a little R1 is always there.
        viscous = jnp.sqrt(self.viscous**2 + LEAST_VISCOUS**2)
        speed = 2.0 * drop / (viscous + jnp.sqrt(viscous**2 + 4.0 * self.turbulent * jnp.abs(drop)))
        return mean_density(a, b, drop >= 0.0) * self.area * speed


def inertance(*, length: Scalar, area: Scalar) -> Scalar:
    """Pressure per rate of mass flow of a tube, l/A [1/m] (eq. 30); length [m], area [m^2]."""
    return length / area


class FlowState(TwoPort):
    """A restriction whose gas has inertia: its flow is its state [kg/s]."""

    def initial(self) -> Tree:
        """State without flow."""
        return jnp.zeros(())

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """The state itself [kg/s]."""
        flow: Scalar = state
        return flow


class InertialTube(FlowState):
    """Resistance and inertance; its state is the mass flow [kg/s] (eqs. 25-31).

        P1 - P2 = R1 v + R2 v |v| + (l/A) dw/dt,  v = w/(rho A)                                             (eqs. 25-31)

    Range and faults as the quadratic model's, but its parameters move less between accumulators. The inertance l/A of
    100 cm of 1/8 in tube is 1260 1/cm = 1.26e-3 bar s2/g; the paper prints 126 1/cm. Source: C.-P. Chou and B.
    Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
    """

    symbol: ClassVar[str] = "tube"
    viscous: Scalar = quantity("Pa*s/m", (0.0, 1e8), "viscous coefficient", symbol="R1", typical=(1.0, 1e3))
    turbulent: Scalar = quantity("Pa*s^2/m^2", (0.0, 1e8), "turbulent coefficient", symbol="R2", typical=(0.1, 1e3))
    area: Scalar = quantity("m^2", (1e-9, 1e-2), "effective cross section", symbol="A", typical=(1e-6, 1e-4))
    length: Scalar = quantity("m", (1e-3, 100.0), "effective length", symbol="l", typical=(0.1, 5.0))

    def rate(self, a: GasState, b: GasState, state: Tree, command: Scalar) -> Tree:
        """dw/dt [kg/s^2]."""
        speed = state / (mean_density(a, b, state >= 0.0) * self.area)
        loss = self.viscous * speed + self.turbulent * speed * jnp.abs(speed)
        return (a.pressure_abs - b.pressure_abs - loss) / inertance(length=self.length, area=self.area)


class LumpedTube(FlowState):
    """Inertance, friction by Reynolds number, choking, and the tube's own volume; its state is the mass flow [kg/s].

        (l/A) dw/dt = P1 - P2 - loss,   loss = (f l/D + K + 2 ln(P1/P2)) rho v |v| / 2,   v = w/(rho A)
        P2 = max(Pb, w a/(gamma A)),   rho at the mean of P1 and P2,   f(Re) laminar, or turbulent by Haaland

    * The turbulent loss grows with density, and the friction factor follows the Reynolds number of the flow, not a fit.
      Steady and at one temperature it is the exact isothermal pipe flow, the gas's own acceleration (the logarithm)
      included.
    * Half the tube's volume is given to either end.
    * P2 is the pressure in the exit: it cannot fall below the one at which the gas leaves with the speed of sound, so the
      flow chokes. The same holds for reverse flow.

    Range: tubes shorter than a quarter of the shortest wave (1 m up to about 80 Hz), hydraulically developed, one
    temperature along the tube. Sources: isothermal and choked pipe flow, A. H. Shapiro, The Dynamics and Thermodynamics
    of Compressible Fluid Flow, 1953; friction as in the distributed tube.

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

    @property
    def area(self) -> Scalar:
        """Cross section [m^2]."""
        return 0.25 * jnp.pi * self.diameter**2

    def rate(self, a: GasState, b: GasState, state: Tree, command: Scalar) -> Tree:
        """dw/dt [kg/s^2]."""
        forward = state >= 0.0
        temperature = jnp.where(forward, a.temperature, b.temperature)
        flux = state / self.area
        sonic = flux * a.gas.sound_speed(temperature) / a.gas.heat_ratio
        # The pressure in whichever bore is the exit, as choices: at a tie a maximum has half a derivative.
        p1 = jnp.where(a.pressure_abs < -sonic, -sonic, a.pressure_abs)
        p2 = jnp.where(b.pressure_abs < sonic, sonic, b.pressure_abs)
        drop, twice = p1 - p2, 1.0 / (p1 + p2)
        volume = 2.0 * a.gas.gas_constant * temperature * twice  # of the mean gas per mass
        size = jnp.abs(flux)
        viscosity = a.gas.viscosity(self.wall_temperature)  # friction acts at the wall, which is known in advance
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


TUBES = {"linear": LinearTube, "quadratic": QuadraticTube, "inertial": InertialTube, "lumped": LumpedTube}
