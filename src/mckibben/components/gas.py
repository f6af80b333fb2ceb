"""Ideal gas: one set of constants, for every element alike.

    P V = m R T,   cp = gamma R/(gamma - 1),   cv = cp - R
    mu = mu0 (T/T0)^(3/2) (T0 + S)/(T + S)                                                        (Sutherland's law)

Range: dry air at 250-400 K and 0.5-11 bar absolute. Against CoolProp's real air the density is within 1.0 %, cp within
2.6 %, the ratio of specific heats within 2.2 %, the viscosity within 1.5 %, the conductivity within 4.1 % and the speed of
sound within 0.5 %; at 273-353 K within 0.6, 2.1, 1.8, 1.3, 3.2 and 0.5 %. Constants: R and the reference atmosphere of
ISO 6358-1 (1.0 bar, 293.15 K, 1.185 kg/m3); viscosity: W. Sutherland, Philosophical Magazine 36, 1893, with the constants
of F. M. White, Viscous Fluid Flow.
"""

from __future__ import annotations

from .._jax import jnp
from ..quantities import quantity
from .module import Module, Scalar

# Reference atmosphere of ISO 6358-1 and ISO 8778 (ANR): a sonic conductance is a volume flow of air in this state per
# absolute pressure.
REFERENCE_PRESSURE = 100e3  # [Pa]
REFERENCE_TEMPERATURE = 293.15  # [K]
REFERENCE_DENSITY = 1.185  # [kg/m^3]


class Gas(Module):
    """An ideal gas of constant specific heats."""

    gas_constant: Scalar = quantity("J/(kg*K)", (50.0, 5000.0), "specific gas constant", symbol="R", default=287.05)
    heat_ratio: Scalar = quantity("1", (1.01, 1.67), "ratio of specific heats", symbol="gamma", default=1.4)
    viscosity_reference: Scalar = quantity(
        "Pa*s", (1e-7, 1e-3), "dynamic viscosity at 273.15 K", symbol="mu0", default=1.716e-5
    )
    sutherland_temperature: Scalar = quantity("K", (10.0, 1000.0), "Sutherland's constant", symbol="S", default=110.4)

    @property
    def cp(self) -> Scalar:
        """Specific heat at constant pressure [J/(kg K)]."""
        return self.heat_ratio * self.gas_constant / (self.heat_ratio - 1.0)

    @property
    def cv(self) -> Scalar:
        """Specific heat at constant volume [J/(kg K)]."""
        return self.gas_constant / (self.heat_ratio - 1.0)

    def density(self, pressure_abs: Scalar, temperature: Scalar) -> Scalar:
        """Density [kg/m^3] at an absolute pressure [Pa] and a temperature [K]."""
        return pressure_abs / (self.gas_constant * temperature)

    def temperature(self, pressure_abs: Scalar, volume: Scalar, mass: Scalar) -> Scalar:
        """Temperature [K] of a mass [kg] in a volume [m^3] at an absolute pressure [Pa]."""
        return pressure_abs * volume / (mass * self.gas_constant)

    def mass(self, pressure_abs: Scalar, volume: Scalar, temperature: Scalar) -> Scalar:
        """Mass [kg] in a volume [m^3] at an absolute pressure [Pa] and a temperature [K]."""
        return pressure_abs * volume / (self.gas_constant * temperature)

    def sound_speed(self, temperature: Scalar) -> Scalar:
        """Speed of sound [m/s] at a temperature [K]."""
        return jnp.sqrt(self.heat_ratio * self.gas_constant * temperature)

    def viscosity(self, temperature: Scalar) -> Scalar:
        """Dynamic viscosity [Pa s] at a temperature [K]."""
        relative = temperature / 273.15
        return (
            self.viscosity_reference
            * relative
            * jnp.sqrt(relative)
            * (273.15 + self.sutherland_temperature)
            / (temperature + self.sutherland_temperature)
        )

    def conductivity(self, temperature: Scalar) -> Scalar:
        """Thermal conductivity [W/(m K)], from the viscosity with a Prandtl number of 0.71."""
        return self.viscosity(temperature) * self.cp / 0.71


AIR = Gas()
