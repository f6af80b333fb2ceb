"""Heat transfer of the gas in a volume: isothermal, polytropic, adiabatic, or with a wall.

Every node keeps mass and pressure; the temperature follows from the gas law. With V(L, P') a moving volume,

    adiabatic and wall:  dP/dt (V + gamma P dV/dP) = (gamma - 1)(sum H + Q) - gamma P dV/dL dL/dt
    isothermal:          dP/dt (V + P dV/dP) = R T sum w - P dV/dL dL/dt
    polytropic:          dP/dt (V + n P dV/dP) = n (R T sum w - P dV/dL dL/dt)

so that mass closes to rounding whatever the heat does, and the heat that keeps a temperature is reported and not assumed.
Range: slow changes are isothermal (tens of seconds in a small volume), fast ones adiabatic (1 to 6 bar ends at 393 K); a
wall with 0.05-1 W/K lies between. n between 1 and gamma is an average of a whole stroke.
"""

from __future__ import annotations

import abc
from typing import Any, NamedTuple

from .._jax import jnp
from ..components import Module, Scalar
from ..quantities import quantity
from .gas import Gas


class VolumeState(NamedTuple):
    """A volume at one moment: value [m^3], dV/dP [m^3/Pa], and the rate at which motion alone changes it [m^3/s]."""

    value: Scalar
    per_pressure: Scalar
    moving: Scalar


class Inflow(NamedTuple):
    """Flow into a volume: mass [kg/s] and enthalpy [W]."""

    mass: Scalar
    enthalpy: Scalar


class HeatModel(Module):
    """Turns inflow and motion into a pressure rate and a heat flow."""

    @abc.abstractmethod
    def rates(
        self, gas: Gas, pressure_abs: Scalar, temperature: Scalar, volume: VolumeState, inflow: Inflow
    ) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""


def _heat(gas: Gas, p: Any, rate: Any, volume: VolumeState, inflow: Inflow) -> Scalar:
    """Heat that the energy balance then requires [W]: Q = dU/dt - sum H + P dV/dt."""
    change = volume.moving + volume.per_pressure * rate
    stored = (volume.value * rate + p * change) / (gas.heat_ratio - 1.0)
    heat: Scalar = stored - inflow.enthalpy + p * change
    return heat


class Isothermal(HeatModel):
    """The gas stays at the temperature it has."""

    def rates(
        self, gas: Gas, pressure_abs: Scalar, temperature: Scalar, volume: VolumeState, inflow: Inflow
    ) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""
        drive = gas.gas_constant * temperature * inflow.mass - pressure_abs * volume.moving
        rate = drive / (volume.value + pressure_abs * volume.per_pressure)
        return rate, _heat(gas, pressure_abs, rate, volume, inflow)


class Polytropic(HeatModel):
    """P V^n is constant for a closed volume."""

    exponent: Scalar = quantity("1", (1.0, 1.67), "polytropic exponent", symbol="n", default=1.2)

    def rates(
        self, gas: Gas, pressure_abs: Scalar, temperature: Scalar, volume: VolumeState, inflow: Inflow
    ) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""
        drive = gas.gas_constant * temperature * inflow.mass - pressure_abs * volume.moving
        rate = self.exponent * drive / (volume.value + self.exponent * pressure_abs * volume.per_pressure)
        return rate, _heat(gas, pressure_abs, rate, volume, inflow)


class WallHeat(HeatModel):
    """Heat in proportion to the difference from the wall's temperature; adiabatic with a conductance of zero."""

    conductance: Scalar = quantity("W/K", (0.0, 1e4), "heat conductance to the wall", symbol="hA", default=0.0)
    wall_temperature: Scalar = quantity("K", (200.0, 500.0), "temperature of the wall", symbol="Tw", default=293.15)

    def rates(
        self, gas: Gas, pressure_abs: Scalar, temperature: Scalar, volume: VolumeState, inflow: Inflow
    ) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""
        heat = self.conductance * (self.wall_temperature - temperature)
        gamma = gas.heat_ratio
        drive = (gamma - 1.0) * (inflow.enthalpy + heat) - gamma * pressure_abs * volume.moving
        rate = drive / (volume.value + gamma * pressure_abs * volume.per_pressure)
        return rate, heat + jnp.zeros_like(rate)


def adiabatic() -> WallHeat:
    """Return a wall without heat transfer."""
    return WallHeat(conductance=0.0)
