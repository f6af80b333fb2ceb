"""The surroundings of an experiment, an input and not a constant."""

from __future__ import annotations

from ..quantities import quantity
from .module import Module, Scalar


class Environment(Module):
    """Pressure and temperature of the surroundings.

    The papers use 1.0336 bar (printed as 1 atm, which is 1.01325 bar) and 300 K: `Environment.of_the_papers`.
    """

    pressure_abs: Scalar = quantity("Pa", (1e3, 1e6), "ambient pressure", symbol="P0", default=101325.0)
    temperature: Scalar = quantity("K", (200.0, 400.0), "ambient temperature", symbol="T0", default=293.15)

    @classmethod
    def of_the_papers(cls) -> Environment:
        """The surroundings that Chou and Hannaford compute with."""
        return cls(pressure_abs=103360.0, temperature=300.0)
