"""A piston compressor with a pressure switch, which feeds a tank.

    w = V (omega/2 pi) lambda p1/(R T1),   lambda = max(1 + c - c r^(1/n), 0),   r = p2/p1
    shaft power = w cp T1 (r^((gamma - 1)/gamma) - 1)/eta     where r > 1, else 0

Gas left in the clearance c expands before the piston draws any (exponent n), so that delivery ends at r = (1 + 1/c)^n. The
valve at its outlet is tight: nothing ever flows back. The shaft's power goes into the gas; an aftercooler takes a share of
it out again before the tank. A running machine needs no power where the outlet is below the intake. The switch runs it from
the start pressure up to the stop pressure, both above the intake's pressure. Range: means over a revolution; the losses of
motor and bearings are not counted, and eta is isentropic. Source: the ideal indicator diagram with clearance, as in
any textbook of thermodynamics.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from .._jax import Tree, jnp
from ..components import Scalar
from ..components.flow import FlowElement, Gases
from ..errors import InputError
from ..quantities import quantity, with_unit
from .solenoid import switched


class Compressor(FlowElement):
    """A compressor from intake to outlet; its memory is the pressure switch, 1 closed and 0 open.

    A command, where a signal gives one, is the switch of the motor: above 0.5 it runs if the pressure switch lets it.
    """

    symbol: ClassVar[str] = "compressor"
    ports: ClassVar[tuple[str, ...]] = ("intake", "outlet")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1),)
    undriven: ClassVar[float] = 1.0
    command_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    displacement: Scalar = quantity("m^3", (0.0, 1.0), "swept volume per revolution", symbol="V", typical=(1e-6, 1e-3))
    speed: Scalar = quantity("rad/s", (0.0, 1e4), "speed of the shaft", symbol="omega", typical=(50.0, 350.0))
    clearance: Scalar = quantity(
        "1", (0.0, 1.0), "clearance over swept volume", symbol="c", typical=(0.02, 0.15), default=0.05
    )
    exponent: Scalar = quantity(
        "1", (1.0, 1.67), "polytropic exponent of the clearance", symbol="n", typical=(1.1, 1.4), default=1.3
    )
    efficiency: Scalar = quantity(
        "1", (0.05, 1.0), "isentropic efficiency", symbol="eta", typical=(0.5, 0.9), default=0.7
    )
    aftercooling: Scalar = quantity(
        "1", (0.0, 1.0), "share of the shaft's power that is cooled away", typical=(0.5, 1.0), default=0.0
    )
    start_pressure: Scalar = quantity(
        "Pa", (0.0, 1e8), "switches on below, above the intake", typical=(4e5, 1e6), default=1e8
    )
    stop_pressure: Scalar = quantity(
        "Pa", (0.0, 1e8), "switches off above, above the intake", typical=(5e5, 1.2e6), default=1e8
    )

    def __check_init__(self) -> None:
        """Refuse a switch that starts above where it stops."""
        try:
            start, stop = np.asarray(self.start_pressure, float), np.asarray(self.stop_pressure, float)
        except TypeError:  # traced
            return
        if np.any(start > stop):
            allowed = f"must be up to the stop_pressure of {with_unit(float(stop.min()), 'Pa')}"
            raise InputError("start_pressure", with_unit(float(start.max()), "Pa"), allowed, where="Compressor")

    def running(self, memory: Tree, command: Scalar) -> Scalar:
        """State of the switch: 1 while it runs, else 0."""
        if isinstance(memory, tuple):
            raise InputError(
                "memory", None, "is missing: pass the circuit's initial_memory(state): a compressor has some"
            )
        speed: Scalar = memory * switched(command)
        return speed

    def initial_memory(self, gas: Gases) -> Tree:
        """Closed where the tank is below the start pressure."""
        return jnp.where(gas[1].pressure_abs - gas[0].pressure_abs < self.start_pressure, 1.0, 0.0)

    def advance_memory(self, memory: Tree, start: Gases, end: Gases) -> Tree:
        """The switch after the tank's pressure has changed."""
        above = end[1].pressure_abs - end[0].pressure_abs
        return jnp.where(above < self.start_pressure, 1.0, jnp.where(above > self.stop_pressure, 0.0, memory))

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Mass flow into the tank [kg/s], never negative."""
        intake, _ = gas
        left = 1.0 + self.clearance * (1.0 - jnp.exp(jnp.log(_ratio(gas)) / self.exponent))
        swept = self.displacement * self.speed / (2.0 * math.pi) * self.running(memory, command)
        return (
            swept * jnp.where(left <= 0.0, 0.0, left) * intake.gas.density(intake.pressure_abs, intake.temperature),
        )

    def shaft_power(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Scalar:
        """Power of the shaft [W]."""
        of = gas[0].gas
        gamma = of.heat_ratio
        rise = jnp.exp(jnp.log(_ratio(gas)) * (gamma - 1.0) / gamma) - 1.0
        (flow,) = self.flows(gas, state, memory, command)
        return flow * of.cp * gas[0].temperature * jnp.where(rise <= 0.0, 0.0, rise) / self.efficiency

    def heating(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Part of the shaft's power that heats the gas [W]."""
        return ((1.0 - self.aftercooling) * self.shaft_power(gas, state, memory, command),)

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Power of the shaft [W], and whether it runs [1]."""
        return {"shaft_power": self.shaft_power(gas, state, memory, command), "running": self.running(memory, command)}


def _ratio(gas: Gases) -> Scalar:
    """Outlet over intake pressure, neither taken below 1 Pa, so that a vacuum has a logarithm."""
    intake, outlet = (jnp.where(g.pressure_abs <= 1.0, 1.0, g.pressure_abs) for g in gas)
    return outlet / intake
