"""A leak: laminar flow through a narrow passage.

    w = G rho0 (Pa^2 - Pb^2)/(2 p0) * (T0 mu(T0))/(T mu(T))

G is the volume flow of air in the reference atmosphere (p0, T0, rho0 of ISO 6358-1) per pressure difference, at a mean
pressure of p0; T is upstream. Range: isothermal laminar flow, a Reynolds number below 2000, which all but the gross leaks of
a pneumatic part have; no choking. Source: the law of Hagen and Poiseuille, integrated along the passage with the density of
an ideal gas.
"""

from __future__ import annotations

import math
from typing import ClassVar

from .._jax import Tree, jnp
from ..components import Scalar
from ..components.flow import GasState, TwoPort
from ..errors import InputError
from ..quantities import quantity
from .gas import AIR, REFERENCE_DENSITY, REFERENCE_PRESSURE, REFERENCE_TEMPERATURE, Gas


class Leak(TwoPort):
    """A leak between two ports, or to the atmosphere, equal in both directions."""

    symbol: ClassVar[str] = "leak"
    conductance: Scalar = quantity(
        "m^3/(s*Pa)", (0.0, 1e-6), "reference air per pressure", symbol="G", typical=(1e-14, 1e-10)
    )
    gas: Gas = AIR

    @classmethod
    def from_flow(cls, flow: float, *, pressure: float, ambient: float = 101325.0) -> Leak:
        """A leak from what a flow meter shows.

        Args:
            flow: volume flow of reference air [m^3/s].
            pressure: gauge pressure before the leak [Pa].
            ambient: absolute pressure behind it [Pa].

        Raises:
            InputError: if the pressure is not above 0.
        """
        if not pressure > 0.0:
            raise InputError("pressure", pressure, "must be a gauge pressure above 0 Pa")
        squares = (pressure + ambient) ** 2 - ambient**2
        return cls(conductance=flow * 2.0 * REFERENCE_PRESSURE / squares)

    @classmethod
    def from_decay(cls, decay: float, *, volume: float, pressure: float, ambient: float = 101325.0) -> Leak:
        """A leak from a decay test: how fast the pressure in a closed volume falls.

        Args:
            decay: fall of pressure per time [Pa/s], positive, at the temperature of the reference atmosphere.
            volume: volume of the vessel [m^3].
            pressure: gauge pressure in it [Pa].
            ambient: absolute pressure outside [Pa].
        """
        mass_flow = decay * volume / float(AIR.gas_constant * REFERENCE_TEMPERATURE)
        return cls.from_flow(mass_flow / REFERENCE_DENSITY, pressure=pressure, ambient=ambient)

    @classmethod
    def of_capillary(cls, *, length: float, diameter: float) -> Leak:
        """A leak from the length and diameter of a round passage [m]."""
        viscosity = float(AIR.viscosity(REFERENCE_TEMPERATURE))
        # dw/d(Pa^2 - Pb^2) of an isothermal capillary
        per_squares = math.pi * diameter**4 / (256.0 * viscosity * length)
        per_squares /= float(AIR.gas_constant * REFERENCE_TEMPERATURE)
        return cls(conductance=per_squares * 2.0 * REFERENCE_PRESSURE / REFERENCE_DENSITY)

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        upstream = jnp.where(a.pressure_abs >= b.pressure_abs, a.temperature, b.temperature)
        warm = REFERENCE_TEMPERATURE * self.gas.viscosity(REFERENCE_TEMPERATURE)
        warm = warm / (upstream * self.gas.viscosity(upstream))
        squares = (a.pressure_abs - b.pressure_abs) * (a.pressure_abs + b.pressure_abs)
        return self.conductance * REFERENCE_DENSITY * warm * squares / (2.0 * REFERENCE_PRESSURE)
