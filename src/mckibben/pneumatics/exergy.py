"""Rates of exergy in a circuit at one moment, beside those of mass and energy.

    b(P, T) = cp (T - T0) - T0 s,   s = cp ln(T/T0) - R ln(P/P0)                       of flowing gas [J/kg]
    A       = V (P/(gamma - 1) + P0) - m (T0 s + cp T0)                                 of gas in a volume [J]
    throttled  w T0 R ln(Pa/Pb)                                 on a path, at constant enthalpy [W]
    mixed      w T0 cp ((Ta - Tb)/Tb - ln(Ta/Tb))               where gas enters a volume at another temperature [W]
    by heat    T0 Q (1/T - 1/Tw)                                from the wall at Tw into gas at T [W]

against surroundings at P0 and T0, whose own air is worth nothing. With them dA/dt = sum of b w over the border + shaft
+ Q (1 - T0/Tw) - (P - P0) dV/dt - all that is destroyed, exactly: it is the first law less T0 times the second. The wall of
gas that is kept at its temperature, or on a polytrope, is the room; walls of several temperatures are not told from it, and
what they give is then a negative loss. The gas's kinetic energy is neglected as in the circuit;
in a tube with inertia it is lent and given back, so that only the sum over a run is never negative. Source: A. Bejan,
Advanced Engineering Thermodynamics, 4th ed., 2016, chapter 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from .._jax import Tree, jnp
from ..components import Environment, Scalar
from ..components.flow import FlowElement, GasState
from ..components.system import Value
from .gas import Gas
from .heat import Inflow, VolumeState
from .leak import Leak
from .tubes import TUBES
from .volume import MovingVolume, Reservoir

if TYPE_CHECKING:
    from .circuit import Circuit


ROOM = "room"  # how the node of the room's air is called


class ExergyStream(NamedTuple):
    """Gas on one path: the nodes at its ends, mass flow [kg/s], power added on the way [W], None if nothing can."""

    element: str
    ends: tuple[str, str]
    flow: Scalar
    power: Scalar | None


class Passing(NamedTuple):
    """A circuit at one moment.

    Attributes:
        gas: at every node.
        volumes: volumes of every chamber.
        streams: by path.
        inflow: into every node.
        added: by machines to the gas, all together [W].
        pressure_rates: pressure rates of every chamber [Pa/s].
        heat: into the gas of every chamber [W].
    """

    gas: dict[str, GasState]
    volumes: dict[str, VolumeState]
    streams: dict[str, ExergyStream]
    inflow: dict[str, Inflow]
    added: Scalar
    pressure_rates: dict[str, Scalar]
    heat: dict[str, Scalar]

    def swelling(self, name: str) -> Scalar:
        """Rate at which a volume grows, by its motion and by its pressure [m^3/s]."""
        volume = self.volumes[name]
        return volume.moving + volume.per_pressure * self.pressure_rates[name]


def path_name(element: FlowElement, name: str, path: tuple[int, int]) -> str:
    """Name of a path: that of its element if it has only one path, else with both ports."""
    i, j = path
    return name if len(element.paths) == 1 else f"{name}.{element.ports[i]}_to_{element.ports[j]}"


class Seen(NamedTuple):
    """Gas as a dead state sees it: absolute pressure [Pa], temperature [K], ln(P/P0) and ln(T/T0)."""

    pressure_abs: Scalar
    temperature: Scalar
    squeeze: Scalar
    warmth: Scalar


class DeadState(NamedTuple):
    """Surroundings in which gas is worth nothing: absolute pressure [Pa] and temperature [K]. Elementwise."""

    gas: Gas
    pressure_abs: Scalar
    temperature: Scalar

    @classmethod
    def of(cls, gas: Gas, room: Environment) -> DeadState:
        """Return the dead state of a gas in an environment."""
        return cls(gas, room.pressure_abs, room.temperature)

    def see(self, pressure_abs: Scalar, temperature: Scalar) -> Seen:
        """Gas at an absolute pressure [Pa] and a temperature [K]."""
        squeeze, warmth = jnp.log(pressure_abs / self.pressure_abs), jnp.log(temperature / self.temperature)
        return Seen(pressure_abs, temperature, squeeze, warmth)

    def flowing(self, at: Seen) -> Scalar:
        """Exergy of flowing gas, b [J/kg]."""
        entropy = self.gas.cp * at.warmth - self.gas.gas_constant * at.squeeze
        return self.gas.cp * (at.temperature - self.temperature) - self.temperature * entropy

    def compression(self, pressure_abs: Scalar, *, cooled: bool) -> Scalar:
        """Least work to compress ambient air in one stage, isothermally or without heat exchange [J/kg]."""
        if cooled:
            return self.flowing(self.see(pressure_abs, self.temperature))
        share = (self.gas.heat_ratio - 1.0) / self.gas.heat_ratio
        return self.gas.cp * self.temperature * ((pressure_abs / self.pressure_abs) ** share - 1.0)

    def stored(self, pressure_abs: Scalar, volume: Scalar, mass: Scalar) -> Scalar:
        """Exergy of gas in a volume, A [J]; volume [m^3], mass [kg]."""
        temperature = self.gas.temperature(pressure_abs, volume, mass)
        rest = self.flowing(self.see(pressure_abs, temperature)) - self.gas.cp * temperature  # -(T0 s + cp T0)
        return volume * (pressure_abs / (self.gas.heat_ratio - 1.0) + self.pressure_abs) + mass * rest

    def throttled(self, flow: Scalar, first: Seen, second: Seen) -> Scalar:
        """Destroyed by a flow [kg/s] from a first place to a second, or back where it is negative [W]."""
        return self.temperature * self.gas.gas_constant * flow * (first.squeeze - second.squeeze)

    def mixed(self, flow: Scalar, arriving: Seen, there: Seen) -> Scalar:
        """Destroyed where a flow [kg/s] of one temperature enters gas of another [W], never negative."""
        excess = arriving.temperature / there.temperature - 1.0 - (arriving.warmth - there.warmth)
        return self.temperature * self.gas.cp * flow * excess

    def by_heat(self, heat: Scalar, temperature: Scalar, wall: Scalar) -> Scalar:
        """Destroyed by heat [W] into gas of a temperature from a wall of another [W]."""
        return self.temperature * heat * (1.0 / temperature - 1.0 / wall)


def stored_exergy(circuit: Circuit, state: Tree, inputs: Mapping[str, Value], room: Environment) -> Scalar:
    """Exergy of all stored gas, A [J]."""
    dead, volumes = DeadState.of(circuit.gas, room), circuit.volumes(state, inputs)
    return jnp.asarray(sum(dead.stored(state["pressure"][n], v.value, state["mass"][n]) for n, v in volumes.items()))


def exergies(circuit: Circuit, now: Passing, room: Environment) -> dict[str, Scalar]:
    """Rates of the exergy account [W], few of them, since each costs time in every step of a run.

    By role of the paths (`role_of`): ``throttled.<role>``; where they begin or end at a reservoir ``entered.<role>``, what
    comes in from there. Of paths to a reservoir that is called room only ``thrown.<role>``, what leaves the volumes towards
    it, and ``idle.<role>``, the share that the fixed volumes of a muscle's line have in it. Over all chambers ``mixed`` and
    ``heat_worth``, the exergy of the heat that enters.
    """
    dead, lines = DeadState.of(circuit.gas, room), lines_of(circuit)
    names = list(now.gas)
    # all logarithms at once, which is faster than one by one
    together = dead.see(*(jnp.stack([jnp.asarray(now.gas[n][i]) for n in names]) for i in (0, 1)))
    states = {n: Seen(*(jnp.asarray(values)[i] for values in together)) for i, n in enumerate(names)}
    out: dict[str, Any] = dict.fromkeys(("mixed", "heat_worth"), 0.0)
    for stream in now.streams.values():
        role = role_of(circuit, stream.element, stream.ends)
        rates = _on_a_path(circuit, stream, states, dead)
        line = next((g for g in lines if len(g & set(stream.ends)) == 1), None)
        if "thrown" in rates and line is not None and not role.startswith("leak"):
            rates["idle"] = rates["thrown"] * idle_share(circuit, now, line)
        for key, value in rates.items():
            name = key if key in out else f"{key}.{role}"
            out[name] = out.get(name, 0.0) + value
    for name, heat in now.heat.items():
        out["heat_worth"] += heat * (1.0 - dead.temperature / now.gas[name].temperature)
    return {name: jnp.asarray(value) for name, value in out.items()}


def _on_a_path(circuit: Circuit, stream: ExergyStream, seen: Mapping[str, Seen], dead: DeadState) -> dict[str, Scalar]:
    """Exergy rates of a path: throttling, mixing at its end, inflow from a reservoir, and discharge [W]."""
    (a, b), flow = stream.ends, stream.flow
    ahead, size = flow >= 0.0, jnp.abs(flow)
    taken = delivered = Seen(*(jnp.where(ahead, *both) for both in zip(seen[a], seen[b], strict=True)))
    lost = dead.throttled(flow, seen[a], seen[b])
    if stream.power is not None:
        capacity = size * circuit.gas.cp
        hot = taken.temperature + stream.power / jnp.where(size > 0.0, capacity, jnp.inf)
        delivered = dead.see(taken.pressure_abs, hot)
        lost = lost + dead.temperature * capacity * (delivered.warmth - taken.warmth)
    out: dict[str, Any] = {}
    for end, into in ((a, ~ahead), (b, ahead)):
        # what arrives has its own temperature and the pressure of the place
        arrives = Seen(seen[end].pressure_abs, delivered.temperature, seen[end].squeeze, delivered.warmth)
        if not isinstance(circuit.nodes[end], Reservoir):
            out["mixed"] = out.get("mixed", 0.0) + jnp.where(into, dead.mixed(size, delivered, seen[end]), 0.0)
            if ROOM in (a, b):
                out["thrown"] = jnp.where(into, -size, size) * dead.flowing(arrives)
        elif end != ROOM:
            worth = dead.flowing(Seen(*(jnp.where(into, *both) for both in zip(arrives, seen[end], strict=True))))
            out["entered"] = jnp.where(into, -size, size) * worth
    return out if "thrown" in out else out | {"throttled": lost}


def idle_share(circuit: Circuit, now: Passing, line: frozenset[str]) -> Scalar:
    """Share of the volumes of a line that never change: ports, tubes, fittings, accumulators [1]."""
    whole = sum((now.volumes[n].value for n in line), start=jnp.zeros(()))
    working = jnp.zeros(())
    for name in line:
        node = circuit.nodes[name]
        if isinstance(node, MovingVolume):
            working = working + now.volumes[name].value - node.dead - circuit.inner_volume(name)
    return (whole - working) / whole


def lines_of(circuit: Circuit) -> list[frozenset[str]]:
    """The chambers that hang together with a muscle, by tubes and shut-offs; not the tanks that several may share.

    A tank is a volume that gas reaches from a supply and that nothing empties into a reservoir.
    """
    pairs = [
        (el, circuit.ends[el][0][i], circuit.ends[el][0][j]) for el, e in circuit.elements.items() for i, j in e.paths
    ]
    fed: set[str] = set()
    vented: set[str] = set()
    for name, a, b in pairs:
        for node, other in ((a, b), (b, a)):
            if isinstance(circuit.nodes[other], Reservoir) and not isinstance(circuit.elements[name], Leak):
                # a path is drawn from the supply on
                (fed if node == b else vented).add(node)
    tanks = {n for n in fed - vented if not isinstance(circuit.nodes[n], MovingVolume)}
    near: dict[str, set[str]] = {n: {n} for n in circuit.chambers if n not in tanks}
    for _, a, b in pairs:
        if a in near and b in near and near[a] is not near[b]:
            near[a] |= near[b]
            for n in near[b]:
                near[n] = near[a]
    lines = {frozenset(group) for group in near.values()}
    return sorted((g for g in lines if any(isinstance(circuit.nodes[n], MovingVolume) for n in g)), key=sorted)


def kind_of(element: FlowElement) -> str:
    """Kind of an element in the account: tube, leak, machine, or valve."""
    if isinstance(element, tuple(TUBES.values())):
        return "tube"
    if isinstance(element, Leak):
        return "leak"
    return "machine" if type(element).heating is not FlowElement.heating else "valve"


def role_of(circuit: Circuit, element: str, ends: tuple[str, str]) -> str:
    """Kind of a path's element, and the reservoir at which it begins or ends, such as ``valve.room``."""
    border = [end for end in ends if isinstance(circuit.nodes[end], Reservoir)]
    return ".".join([kind_of(circuit.elements[element]), *border])


def paths_of(circuit: Circuit) -> dict[str, tuple[str, tuple[str, str]]]:
    """Element of every path, and the nodes at its ends."""
    return {
        path_name(e, name, (i, j)): (name, (circuit.ends[name][0][i], circuit.ends[name][0][j]))
        for name, e in circuit.elements.items()
        for i, j in e.paths
    }
