"""Friction of developed pipe flow at the wall, and heat transfer.

    dP/dx = -f rho u |u| / (2 D)                                                    f as in `pneumatics.wall_friction`
    q = (Nu k/D) (Tw - T - r u^2/(2 cp)),    Nu = 3.66                                              laminar
    Nu = (f/8)(Re - 1000) Pr / (1 + 12.7 sqrt(f/8) (Pr^(2/3) - 1))                                  turbulent (Gnielinski)

Between Re = 2300 and 4000 both f and Nu pass smoothly from one to the other. The recovery factor r = Pr^(1/3) makes the
driving temperature that of an insulated wall. Range: Re below 1e8, roughness up to 5 % of the diameter; steady, developed
flow: the extra friction of fast oscillations and of the first ten to fifty diameters is left out.

Sources: V. Gnielinski, Int. Chem. Eng. 16, 1976;
F. M. White, Fluid Mechanics and Viscous Fluid Flow.
"""

from __future__ import annotations

from typing import NamedTuple

from ..._jax import jnp
from ...components import Scalar
from ..gas import Gas
from ..wall_friction import LAMINAR_END, haaland, turbulence
from .equations import Primitive

WALLS = ("isothermal", "adiabatic", "wall_heat")
PRANDTL = 0.71
LAMINAR_NUSSELT = 3.66  # developed flow, constant wall temperature


class WallRates(NamedTuple):
    """Effect of the wall on the gas, per cell."""

    friction: Scalar  # lambda [1/s]: the momentum decays at this rate
    heating: Scalar  # heat given to the gas [W/m^3]
    exchange: Scalar  # rate at which the temperature approaches the wall's [1/s]


def nusselt(reynolds_number: Scalar, relative_roughness: Scalar) -> Scalar:
    """Nusselt number of a wall at constant temperature, at any Reynolds number."""
    share = turbulence(reynolds_number)
    re = jnp.maximum(reynolds_number, LAMINAR_END)
    eighth = haaland(re, relative_roughness) / 8.0
    turbulent = eighth * (re - 1000.0) * PRANDTL / (1.0 + 12.7 * jnp.sqrt(eighth) * (PRANDTL ** (2.0 / 3.0) - 1.0))
    nusselt: Scalar = (1.0 - share) * LAMINAR_NUSSELT + share * turbulent
    return nusselt


def wall_rates(
    gas: Gas,
    state: Primitive,
    *,
    diameter: Scalar,
    roughness: Scalar,
    wall_temperature: Scalar,
    friction_scale: Scalar,
    heat: bool,
) -> WallRates:
    """Friction and heat of cells of shape (cells,); lengths [m], temperature [K].

    Written per speed, so that it is finite at rest: f |u|/(2 D) is 32 mu/(rho D^2) in laminar flow.
    """
    density, viscosity = gas.density(state.pressure, state.temperature), gas.viscosity(state.temperature)
    speed = jnp.abs(state.velocity)
    re = density * speed * diameter / viscosity
    share, rough = turbulence(re), roughness / diameter
    factor = haaland(re, rough)
    laminar = 32.0 * viscosity / (density * diameter**2)
    friction = friction_scale * ((1.0 - share) * laminar + share * factor * speed / (2.0 * diameter))
    if not heat:
        return WallRates(friction, jnp.zeros_like(speed), jnp.zeros_like(speed))
    conductance = 4.0 * nusselt(re, rough) * gas.conductivity(state.temperature) / diameter**2  # [W/(m^3 K)]
    recovered = state.temperature + PRANDTL ** (1.0 / 3.0) * state.velocity**2 / (2.0 * gas.cp)
    return WallRates(friction, conductance * (wall_temperature - recovered), conductance / (density * gas.cv))
