"""Pneumatic parts of a rig: supply, valve, tube, accumulators, shut-off and leak, connected to a muscle or a vessel.

    supply - valve - port - [shut-off - line] - tube - muscle
                      |                                  |
              (accumulator at the valve)     (accumulator at the muscle), leak to the room

An accumulator adds its volume to the node it is screwed to, whose gas it shares. Where no muscle is connected, an
accumulator takes its place, as in the pneumatic experiments.
"""

from __future__ import annotations

from collections.abc import Mapping

from ...assembly.muscle_unit import MuscleUnit
from ...components import Environment, Module, Scalar, field
from ...components.flow import FlowElement
from ...pneumatics.circuit import Branch, Circuit
from ...pneumatics.heat import HeatModel
from ...pneumatics.leak import Leak
from ...pneumatics.valves import OnOffValve
from ...pneumatics.volume import Chamber, FixedVolume, MovingVolume, Reservoir
from ...quantities import quantity

MUSCLE, VESSEL, PORT, LINE = "muscle", "accumulator", "port", "line"  # names of nodes


class Plumbing(Module):
    """A way to connect the parts.

    The valve is the electro-valve, a regulator set by hand, or an element of the user's own with the ports supply, outlet
    and exhaust; the signal ``valve`` is the gauge pressure asked of it.
    """

    valve: FlowElement
    tube: FlowElement
    heat: HeatModel
    supply_pressure: Scalar = quantity("Pa", (0.0, 1e8), "gauge pressure of the supply", typical=(6e5, 1e6))
    port_volume: Scalar = quantity("m^3", (1e-9, 1.0), "outlet of the valve and fittings", default=2e-6)
    line_volume: Scalar = quantity("m^3", (1e-9, 1.0), "between a shut-off and the tube", default=1e-6)
    valve_accumulator: Scalar = quantity("m^3", (0.0, 1.0), "accumulator at the valve", default=0.0)
    muscle_accumulator: Scalar = quantity("m^3", (0.0, 1.0), "accumulator at the muscle, or in its place", default=0.0)
    shut_off: OnOffValve | None = None
    leak: Leak | None = None
    has_muscle: bool = field(static=True, kw_only=True, default=True)

    @property
    def tested(self) -> str:
        """Name of the tested node."""
        return MUSCLE if self.has_muscle else VESSEL

    def parts(self) -> frozenset[str]:
        """Parts that a protocol can use, by the names of `Step.needs`."""
        names = {"valve"}
        names |= {"shut-off"} if self.shut_off is not None else set()
        held = float(self.valve_accumulator) + float(self.muscle_accumulator)
        return frozenset(names | ({"accumulators"} if held > 0.0 else set()))

    def signals(self) -> tuple[str, ...]:
        """Names of the driving signals."""
        return ("valve",) if self.shut_off is None else ("valve", "open")

    def circuit(self, units: Mapping[str, MuscleUnit], room: Environment) -> Circuit:
        """Build the circuit, with nodes ``supply``, ``room``, and those of the sketch above."""
        tested = self.tested
        nodes: dict[str, Reservoir | Chamber] = {
            "supply": Reservoir(pressure_abs=self.supply_pressure + room.pressure_abs, temperature=room.temperature),
            "room": Reservoir(pressure_abs=room.pressure_abs, temperature=room.temperature),
            PORT: FixedVolume(size=self.port_volume + self.valve_accumulator, heat=self.heat),
        }
        if self.has_muscle:
            nodes[tested] = MovingVolume(
                of=units[MUSCLE].law.braid_volume,
                ambient=room.pressure_abs,
                dead=self.muscle_accumulator,
                heat=self.heat,
                signal=f"{MUSCLE}.length",
            )
        else:
            nodes[tested] = FixedVolume(size=self.muscle_accumulator, heat=self.heat)
        branches = {"valve": Branch(self.valve, ("supply", PORT, "room"), "valve")}
        begins = PORT
        if self.shut_off is not None:
            begins = LINE
            nodes[begins] = FixedVolume(size=self.line_volume, heat=self.heat)
            branches["shut_off"] = Branch(self.shut_off, (PORT, begins), "open")
        branches["tube"] = Branch(self.tube, (begins, tested))
        if self.leak is not None:
            branches["leak"] = Branch(self.leak, (tested, "room"))
        return Circuit.of(nodes, branches)
