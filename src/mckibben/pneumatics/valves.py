"""Valves: what a command, a spring or a pressure opens. The flow through each edge, w_ISO, is that of `orifice`."""

from __future__ import annotations

import math
from typing import ClassVar

from .._jax import Tree, jnp
from ..components import Scalar, field
from ..components.flow import FlowElement, Gases, GasState, TwoPort
from ..components.gas import REFERENCE_DENSITY
from ..errors import InputError
from ..quantities import quantity
from .orifice import Orifice, conductance_flow, density_over_air, opening_flow, steepest_slope
from .solenoid import EASED_SLOPE, PilotStage, Solenoid, between, eased, share


def _steepest_while_moving(edge: Orifice, a: GasState, b: GasState, growth: Scalar, band: Scalar) -> Scalar:
    """Slope of an open edge and of its opening, which grows by at most growth / band [kg/(s Pa)]."""
    upstream = jnp.where(a.pressure_abs >= b.pressure_abs, density_over_air(a), density_over_air(b))
    choked = edge.conductance * REFERENCE_DENSITY * jnp.sqrt(upstream)
    # the flow once it chokes is the most that an opening can change
    choked = choked * jnp.maximum(a.pressure_abs, b.pressure_abs)
    return steepest_slope(edge, a, b) + choked * growth / band


class CheckValve(TwoPort):
    """Opens from a to b only.

        w = f((Pa - Pb - Pc)/band) w_ISO(Pa, Pb),   f = 0 below 0, y^2 (3 - 2 y) between, 1 above 1

    Pc is the cracking pressure, and `band` the further rise at which it is fully open. Range: the poppet has no mass,
    so that chatter is not shown. Source of w_ISO: ISO 6358-1:2013.
    """

    symbol: ClassVar[str] = "check_valve"
    passage: Orifice = field(kw_only=True)
    cracking_pressure: Scalar = quantity(
        "Pa", (0.0, 1e6), "pressure difference at which it opens", symbol="Pc", typical=(1e3, 5e4), default=5e3
    )
    band: Scalar = quantity("Pa", (100.0, 1e6), "further difference until fully open", typical=(2e3, 1e5), default=1e4)

    def opening(self, a: GasState, b: GasState) -> Scalar:
        """Share of the passage that is open [1]."""
        return eased((a.pressure_abs - b.pressure_abs - self.cracking_pressure) / self.band)

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s], never negative."""
        return opening_flow(self.passage, a, b, self.opening(a, b))

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Largest slope of the flow, including the opening of the poppet [kg/(s Pa)]."""
        a, b = gas
        # the opening only changes up to this difference, where the flow is largest
        lifted = self.cracking_pressure + self.band
        flow = conductance_flow(
            a.pressure_abs,
            density_over_air(a),
            jnp.maximum(a.pressure_abs - lifted, 0.0),
            conductance=self.passage.conductance,
            critical_ratio=self.passage.critical_ratio,
            linear_band=self.passage.linear_band,
        )
        return (steepest_slope(self.passage, a, b) + EASED_SLOPE * flow / self.band,)

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Opening of the valve [1]."""
        return {"opening": self.opening(*gas)}


class QuickExhaust(FlowElement):
    """Shuttle between inlet and exhaust, moved by the pressures alone.

        y = 1 + (Pin - Pwork + Pc)/band                    1 or more: inlet feeds work; 0 or less: work vents to exhaust
        feed: f(y),   vent: 1 - f(y),   f = y^2 (3 - 2 y) between 0 and 1

    The shuttle leaves the exhaust seat when the inlet is Pc below the work port, and has closed the inlet `band`
    further down. While it moves a little goes back to the inlet, as in a real one, but nothing from the inlet to the
    exhaust. Range: a shuttle without mass. Source of each edge: ISO 6358-1:2013.
    """

    symbol: ClassVar[str] = "quick_exhaust"
    ports: ClassVar[tuple[str, ...]] = ("inlet", "work", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    feed: Orifice = field(kw_only=True)
    vent: Orifice = field(kw_only=True)
    cracking_pressure: Scalar = quantity(
        "Pa", (0.0, 1e6), "inlet below work before it vents", symbol="Pc", typical=(1e3, 3e4), default=5e3
    )
    band: Scalar = quantity("Pa", (100.0, 1e6), "further fall until it has shuttled", typical=(2e3, 5e4), default=1e4)

    def openings(self, gas: Gases) -> tuple[Scalar, Scalar]:
        """Shares of feed and vent that are open [1]."""
        inlet, work, _ = (g.pressure_abs for g in gas)
        feed = eased(1.0 + (inlet - work + self.cracking_pressure) / self.band)
        return feed, 1.0 - feed

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Inlet to work, and work to exhaust [kg/s]."""
        inlet, work, exhaust = gas
        feed, vent = self.openings(gas)
        return opening_flow(self.feed, inlet, work, feed), opening_flow(self.vent, work, exhaust, vent)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slopes of the restrictions, and of their openings while the shuttle moves [kg/(s Pa)]."""
        pairs = (self.feed, gas[0], gas[1]), (self.vent, gas[1], gas[2])
        return tuple(_steepest_while_moving(*pair, EASED_SLOPE, self.band) for pair in pairs)

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Opening of the vent [1]."""
        return {"vent_opening": self.openings(gas)[1]}


class OnOffValve(TwoPort):
    """Open above a command of 0.5, closed below, after its dead and switching times.

        w = x(t) w_ISO(Pa, Pb)

    The opening x follows the command as `solenoid` says, w_ISO as ISO 6358-1:2013 says.
    Range: both directions of flow alike. The motion does not depend on the pressures, unless the valve has a pilot
    stage (`PilotStage`), which takes its gas from the first port.
    """

    symbol: ClassVar[str] = "on_off_valve"
    commanded: ClassVar[bool] = True
    command_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    passage: Orifice = field(kw_only=True)
    drive: Solenoid = field(kw_only=True)
    pilot: PilotStage | None = field(kw_only=True, default=None)

    def initial(self) -> Tree:
        """Closed."""
        return self.drive.initial()

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        return opening_flow(self.passage, a, b, self.drive.opening(state))

    def rate(self, a: GasState, b: GasState, state: Tree, command: Scalar) -> Tree:
        """Rates of change of flux, or of the pilot's pressure, and of stroke [1/s]."""
        if self.pilot is None:
            return self.drive.rates(state, command)
        return self.pilot.rates(self.drive, state, command, a.pressure_abs)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slope at equal pressures; of the open valve where it is on its way [kg/(s Pa)]."""
        return (steepest_slope(self.passage, *gas) * self.drive.widest(state, command),)

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Opening of the valve [1]."""
        return {"opening": self.drive.opening(state)}


class ThreeWayValve(FlowElement):
    """Supply to work above a command of 0.5, work to exhaust below.

        fill: f((x - (1 + o)/2)/((1 - o)/2)),   vent: f(((1 - o)/2 - x)/((1 - o)/2)),   f = clip to 0 .. 1

    x is the stroke as `solenoid` says. With an overlap o of zero or more both edges are
    never open at once, and nothing crosses from supply to exhaust; with a negative one they are, in the middle of the
    stroke, as in a poppet valve that lifts from one seat before it meets the other. Range and sources as there, and ISO
    6358-1:2013 for each edge.
    """

    symbol: ClassVar[str] = "on_off_valve"
    ports: ClassVar[tuple[str, ...]] = ("supply", "work", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    commanded: ClassVar[bool] = True
    command_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    fill: Orifice = field(kw_only=True)
    vent: Orifice = field(kw_only=True)
    drive: Solenoid = field(kw_only=True)
    overlap: Scalar = quantity(
        "1", (-0.9, 0.9), "share of the stroke with both edges closed, negative: open", typical=(-0.3, 0.3), default=0.1
    )

    def openings(self, stroke: Scalar) -> tuple[Scalar, Scalar]:
        """Shares of fill and vent that are open, at a stroke of 0 to 1 beyond the seat."""
        half = 0.5 * (1.0 - self.overlap)
        return share((stroke - (1.0 - half)) / half), share((half - stroke) / half)

    def initial(self) -> Tree:
        """Vented."""
        return self.drive.initial()

    def rates(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Tree:
        """Rates of change of flux and stroke [1/s]."""
        return self.drive.rates(state, command)

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Supply to work, and work to exhaust [kg/s]."""
        supply, work, exhaust = gas
        fill, vent = self.openings(self.drive.opening(state))
        return opening_flow(self.fill, supply, work, fill), opening_flow(self.vent, work, exhaust, vent)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slopes at equal pressures, of the edges as they are or will soon be [kg/(s Pa)]."""
        supply, work, exhaust = gas
        fill, _ = self.openings(self.drive.widest(state, command))
        _, vent = self.openings(self.drive.opening(state))
        vent = jnp.where(jnp.asarray(command) > 0.5, vent, 1.0)
        return steepest_slope(self.fill, supply, work) * fill, steepest_slope(self.vent, work, exhaust) * vent

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Stroke of the valve [1]."""
        return {"opening": self.drive.opening(state)}


class SpoolValve(FlowElement):
    """Proportional valve with dead time, lag, speed limit, overlap and leakage; its state is the spool's position.

        ds/dt = clip((u - s)/tau, -v, v),   u = clip(command, -1, 1)                                 after the dead time
        fill: f((s - o)/(1 - o)) + l (1 - |s|),   vent: f((-s - o)/(1 - o)) + l (1 - |s|),   f = clip to 0 .. 1

    s is the position of the spool over its stroke, o the overlap of either edge (a dead band; negative for an underlap,
    where both edges are open in mid position), and l the leakage past the spool, largest in mid position, where it is a
    share of the full conductance. The command saturates, and so does the flow. Range: the position loop of the spool is
    a lag with a speed limit; no pressure forces on the spool. A lag inside a fast pressure loop rings: the loop must be
    slower than dead time and lag. Source of each edge: ISO 6358-1:2013.
    """

    symbol: ClassVar[str] = "proportional_valve"
    ports: ClassVar[tuple[str, ...]] = ("supply", "work", "exhaust")
    paths: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2))
    commanded: ClassVar[bool] = True
    command_range: ClassVar[tuple[float, float]] = (-1.0, 1.0)
    fill: Orifice = field(kw_only=True)
    vent: Orifice = field(kw_only=True)
    dead_time: Scalar = quantity("s", (0.0, 1.0), "of the command", typical=(0.0, 1e-2), default=0.0)
    lag: Scalar = quantity("s", (1e-4, 10.0), "time constant of the spool", symbol="tau", typical=(1e-3, 2e-2))
    speed_limit: Scalar = quantity(
        "1/s", (0.1, 1e5), "stroke from mid to end per time", symbol="v", typical=(50.0, 1e3), default=1e5
    )
    overlap: Scalar = quantity(
        "1",
        (-0.9, 0.9),
        "share of the stroke before an edge opens, negative: open in mid position",
        symbol="o",
        typical=(-0.1, 0.1),
        default=0.0,
    )
    leakage: Scalar = quantity(
        "1", (0.0, 0.5), "leakage in mid position over full conductance", symbol="l", typical=(0.0, 0.02), default=0.0
    )

    def openings(self, position: Scalar) -> tuple[Scalar, Scalar]:
        """Shares of fill and vent that are open, at a position of -1 to 1."""
        leak = self.leakage * (1.0 - share(jnp.where(position >= 0.0, position, -position)))
        stroke = 1.0 - self.overlap
        return share((position - self.overlap) / stroke) + leak, share((-position - self.overlap) / stroke) + leak

    def initial(self) -> Tree:
        """State in mid position."""
        return jnp.zeros(())

    def rates(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> Tree:
        """Speed of the spool [1/s]."""
        return between((between(command, -1.0, 1.0) - state) / self.lag, -self.speed_limit, self.speed_limit)

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Supply to work, and work to exhaust [kg/s]."""
        supply, work, exhaust = gas
        fill, vent = self.openings(state)
        return opening_flow(self.fill, supply, work, fill), opening_flow(self.vent, work, exhaust, vent)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slopes at equal pressures, with the edges as they are or will be at the command [kg/(s Pa)]."""
        supply, work, exhaust = gas
        ahead = between(command, -1.0, 1.0)
        fill, _ = self.openings(jnp.maximum(state, ahead))
        _, vent = self.openings(jnp.minimum(state, ahead))
        return steepest_slope(self.fill, supply, work) * fill, steepest_slope(self.vent, work, exhaust) * vent

    def delay(self) -> Scalar:
        """Dead time of the command [s]."""
        return self.dead_time

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Position of the spool [1]."""
        return {"position": state}


class PressureRegulator(FlowElement):
    """Holds its outlet at a pressure above that of its exhaust port.

        ds/dt = (u + Pset - s)/tau                                       set-point, after the dead time of the command u
        z' = clip(z, P - h/2, P + h/2)                              sensed pressure: a play of width h behind the outlet
        e = s - k ((Psup - Pexh) - Pref) - (z - Pexh)                     error
        fill: clip(e/band, 0, 1) C_fill,   relief: clip((-e - offset)/relief_band, 0, 1) C_relief

    A regulator opens in proportion to its error, so the outlet droops by `band` on the way to full flow, and stays
    under what C_fill lets through at all. Friction of its piston and seals is a play in what it senses: an outlet that
    rose to its value rests h/2 above the set-point, one that fell rests h/2 below, and within h nothing happens. With k
    its poppet is not balanced: the outlet falls by k times the rise of the supply. Dead time and lag act on the
    set-point: a lag of the opening itself, inside the pressure loop, rings unless it is shorter than band over the
    fastest pressure rate. Range: settled and slow behaviour, and set-point steps; no resonance of the piston. A relief
    of no conductance makes a regulator that does not relieve. Sources: droop, hysteresis and supply effect are what ISO
    6953-2 has measured of a regulator; play: M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis, 1989;
    flow: ISO 6358-1:2013.

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
    relief_band: Scalar = quantity(
        "Pa", (100.0, 1e7), "that of the relief where it has its own", typical=(5e3, 2e5), default=None
    )
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
        return share(error / self.band), share((-error - self.relief_offset) / self._bands()[1])

    def _bands(self) -> tuple[Scalar, Scalar]:
        """Errors at which fill and relief are fully open [Pa]."""
        return self.band, self.band if self.relief_band is None else self.relief_band

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
        pairs = (self.fill, gas[0], gas[1]), (self.relief, gas[1], gas[2])
        growth = 1.0 + self.supply_effect
        return tuple(
            _steepest_while_moving(*pair, growth, band) for pair, band in zip(pairs, self._bands(), strict=True)
        )

    def delay(self) -> Scalar:
        """Dead time of the command [s]."""
        return self.dead_time

    def outputs(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> dict[str, Scalar]:
        """Lagging set-point, sensed pressure above the exhaust's [Pa], and openings [1]."""
        fill, relief = self.openings(gas, state, memory)
        sensed = self.sensed(memory, gas[1].pressure_abs) - gas[2].pressure_abs
        return {"set_pressure": state, "sensed_pressure": sensed, "fill_opening": fill, "relief_opening": relief}
