"""A relieving pressure regulator, set by hand or by a signal.

    ds/dt = (u + Pset - s)/tau                                        set-point, after the dead time of the command u
    z' = clip(z, P - h/2, P + h/2)                                    sensed pressure: a play of width h behind the outlet
    e = s - k ((Psup - Pexh) - Pref) - (z - Pexh)                     error
    fill: clip(e/band, 0, 1) C_fill,   relief: clip((-e - offset)/band, 0, 1) C_relief

A regulator opens in proportion to its error, so the outlet droops by `band` on the way to full flow, and stays under what
C_fill lets through at all. Friction of its piston and seals is a play in what it senses: an outlet that rose to its value
rests h/2 above the set-point, one that fell rests h/2 below, and within h nothing happens. With k its poppet is not
balanced: the outlet falls by k times the rise of the supply. Dead time and lag act on the set-point: a lag of the opening
itself, inside the pressure loop, rings unless it is shorter than band over the fastest pressure rate. Range: settled and
slow behaviour, and set-point steps; no resonance of the piston. A relief of no conductance makes a regulator that does not
relieve. Sources: droop, hysteresis and supply effect are what ISO 6953-2 has measured of a regulator; play: M. A.
Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis, 1989; flow: ISO 6358-1:2013.
"""

from __future__ import annotations

import math
from typing import ClassVar

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.flow import FlowElement, Gases
from ...errors import InputError
from ...quantities import quantity
from ..gas import REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from ..orifice import Orifice, opening_flow, steepest_slope
from .shares import between, share


class PressureRegulator(FlowElement):
    """Holds its outlet at a pressure above that of its exhaust port.

    Where a signal drives it, that is the gauge pressure to hold [Pa], on top of `set_pressure`. Its state is the lagging
    set-point [Pa], its memory the sensed absolute pressure [Pa].
    """

    symbol: ClassVar[str] = "regulator"
    command_unit: ClassVar[str] = "Pa"
    command_range: ClassVar[tuple[float, float]] = (
        0.0,
        math.inf,
    )  # it vents no further than to the pressure of its exhaust
    ports: ClassVar[tuple[str, ...]] = ("supply", "outlet", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    fill: Orifice = field(kw_only=True)
    relief: Orifice = field(kw_only=True)
    band: Scalar = quantity("Pa", (100.0, 1e7), "error at which it is fully open", typical=(5e3, 2e5))
    set_pressure: Scalar = quantity(
        "Pa", (-1.1e5, 1e8), "gauge pressure it is set to by hand", symbol="Pset", typical=(0.0, 1e6), default=0.0
    )
    hysteresis: Scalar = quantity(
        "Pa", (0.0, 1e6), "outlet from above to outlet from below", symbol="h", typical=(0.0, 3e4), default=0.0
    )
    relief_offset: Scalar = quantity(
        "Pa", (0.0, 1e6), "further rise before it relieves", typical=(0.0, 5e4), default=0.0
    )
    dead_time: Scalar = quantity("s", (0.0, 1.0), "of the command", typical=(0.0, 2e-2), default=0.0)
    lag: Scalar = quantity("s", (1e-4, 10.0), "of the set-point", symbol="tau", typical=(1e-3, 0.1), default=1e-3)
    supply_effect: Scalar = quantity(
        "1", (0.0, 1.0), "fall of the outlet per rise of the supply", symbol="k", typical=(0.0, 0.1), default=0.0
    )
    supply_reference: Scalar = quantity(
        "Pa", (0.0, 1e8), "gauge supply at which it was set", symbol="Pref", typical=(1e5, 1e6), default=6e5
    )

    def worn(self, *, blockage: Scalar = 0.0, sticking: Scalar = 0.0) -> PressureRegulator:
        """Return the regulator with blocked orifices and a sticking piston.

        Args:
            blockage: share of the conductances of fill and relief that is blocked [1].
            sticking: what its hysteresis is more [Pa].
        """
        fill, relief = (
            edge.replace(conductance=(1.0 - blockage) * edge.conductance) for edge in (self.fill, self.relief)
        )
        worn: PressureRegulator = self.replace(fill=fill, relief=relief, hysteresis=self.hysteresis + sticking)
        return worn

    def sensed(self, memory: Tree, pressure_abs: Scalar) -> Scalar:
        """The sensed absolute pressure [Pa] once the outlet has come to an absolute pressure."""
        half = 0.5 * self.hysteresis
        return between(memory, pressure_abs - half, pressure_abs + half)

    def openings(self, gas: Gases, state: Tree, memory: Tree) -> tuple[Scalar, Scalar]:
        """Shares of fill and relief that are open [1]."""
        supply, outlet, exhaust = (g.pressure_abs for g in gas)
        if isinstance(memory, tuple):
            raise InputError(
                "memory", None, "is missing: pass the circuit's initial_memory(state): a regulator has some"
            )
        # the play is taken up within the step as well, so that methods and rates see the loop closed
        error = state - self.supply_effect * (supply - exhaust - self.supply_reference)
        error = error - (self.sensed(memory, outlet) - exhaust)
        return share(error / self.band), share((-error - self.relief_offset) / self.band)

    def initial(self) -> Tree:
        """State at the pressure set by hand."""
        return jnp.asarray(self.set_pressure, float)

    def settled(self, command: Scalar | None) -> Tree:
        """State at the commanded set-point, so that a run which begins under pressure does not vent first."""
        return self.initial() if command is None else self.set_pressure + jnp.asarray(command, float)

    def initial_memory(self, gas: Gases) -> Tree:
        """Memory in the middle of the play."""
        return jnp.asarray(gas[1].pressure_abs, float)

    def rates(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Tree:
        """Rate of the set-point [Pa/s]."""
        return (self.set_pressure + command - state) / self.lag

    def advance_memory(self, memory: Tree, start: Gases, end: Gases) -> Tree:
        """The sensed pressure after a move of the outlet; its speed makes no difference."""
        return self.sensed(memory, end[1].pressure_abs)

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Flows from supply to outlet, and from outlet to exhaust [kg/s]."""
        supply, outlet, exhaust = gas
        fill, relief = self.openings(gas, state, memory)
        return opening_flow(self.fill, supply, outlet, fill), opening_flow(self.relief, outlet, exhaust, relief)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slopes of the restrictions, and of their openings by the outlet's pressure [kg/(s Pa)]."""
        slopes = []
        for edge, a, b in ((self.fill, gas[0], gas[1]), (self.relief, gas[1], gas[2])):
            upstream = jnp.where(a.pressure_abs >= b.pressure_abs, a.temperature, b.temperature)
            choked = edge.conductance * REFERENCE_DENSITY * jnp.sqrt(REFERENCE_TEMPERATURE / upstream)
            choked = choked * jnp.maximum(a.pressure_abs, b.pressure_abs)
            slopes.append(steepest_slope(edge, a, b) + choked * (1.0 + self.supply_effect) / self.band)
        return tuple(slopes)

    def delay(self) -> Scalar:
        """Dead time of the command [s]."""
        return self.dead_time

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Lagging set-point, sensed pressure above the exhaust's [Pa], and openings [1]."""
        fill, relief = self.openings(gas, state, memory)
        sensed = self.sensed(memory, gas[1].pressure_abs) - gas[2].pressure_abs
        return {"set_pressure": state, "sensed_pressure": sensed, "fill_opening": fill, "relief_opening": relief}
