"""Elements joined at nodes, in any topology, as one state equation with its mass and energy accounts.

Nodes are reservoirs and chambers; every element has a node at each of its ports. The state is the mass and the pressure of
each chamber, and the elements' own states. Gas that flows carries the enthalpy of where it comes from, both ways. Kinetic
energy is neglected (about 0.1 % in a tube at 50 m/s).

Rates of exergy stand beside those of mass and energy:

    b(P, T) = cp (T - T0) - T0 s,   s = cp ln(T/T0) - R ln(P/P0)                       of flowing gas [J/kg]
    A       = V (P/(gamma - 1) + P0) - m (T0 s + cp T0)                                 of gas in a volume [J]
    throttled  w T0 R ln(Pa/Pb)                                 on a path, at constant enthalpy [W]
    mixed      w T0 cp ((Ta - Tb)/Tb - ln(Ta/Tb))               where gas enters a volume at another temperature [W]
    by heat    T0 Q (1/T - 1/Tw)                                from the wall at Tw into gas at T [W]

against surroundings at P0 and T0, whose own air is worth nothing. With them dA/dt = sum of b w over the border + shaft
+ Q (1 - T0/Tw) - (P - P0) dV/dt - all that is destroyed, exactly: it is the first law less T0 times the second. The wall of
gas that is kept at its temperature, or on a polytrope, is the room; walls of several temperatures are not told from it, and
what they give is then a negative loss. In a tube with inertia the gas's kinetic energy is lent and given back, so that only
the sum over a run is never negative. Source: A. Bejan, Advanced Engineering Thermodynamics, 4th ed., 2016, chapter 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .._jax import Scalar, Tree, jnp
from ..components import Environment, field
from ..components.flow import FlowElement, GasState
from ..components.gas import AIR, Gas
from ..components.module import flatten
from ..components.system import Exchange, Moment, System, Value
from ..errors import InputError
from .orifice import Leak
from .tubes import TUBES
from .volume import Chamber, Inflow, Junction, MovingVolume, Reservoir, VolumeState, volume_of


class Branch(NamedTuple):
    """An element, the nodes at its ports in the element's order, and the signal that drives it."""

    element: FlowElement
    ports: tuple[str, ...]
    command: str | None = None


class Circuit(System):
    """A pneumatic network. Use `Circuit.of`, which checks it."""

    nodes: dict[str, Reservoir | Chamber]
    elements: dict[str, FlowElement]
    ends: dict[str, tuple[tuple[str, ...], str | None]] = field(static=True)
    gas: Gas = AIR

    @classmethod
    def of(cls, nodes: Mapping[str, Reservoir | Chamber], branches: Mapping[str, Branch], *, gas: Gas = AIR) -> Circuit:
        """Join elements at nodes.

        Args:
            nodes: reservoirs and chambers by name.
            branches: elements by name, with the nodes at their ports.
            gas: the working gas.

        Raises:
            InputError: names a dangling port, a node that nothing reaches, supplies in short circuit, a valve without a
                signal, or a node without volume.
        """
        check_topology(nodes, branches)
        ends = {name: (tuple(b.ports), b.command) for name, b in branches.items()}
        return cls(dict(nodes), {name: b.element for name, b in branches.items()}, ends, gas)

    @property
    def chambers(self) -> list[str]:
        """Names of the nodes that store gas, in the order of the state."""
        return [name for name, node in self.nodes.items() if isinstance(node, Chamber)]

    def initial(
        self, pressures: Mapping[str, float], inputs: Mapping[str, Scalar] | None = None, temperature: float = 293.15
    ) -> Tree:
        """The state with given absolute pressures [Pa] and one temperature [K]; lengths of moving volumes from `inputs`."""
        for name in self.chambers:
            if name not in pressures:
                raise InputError(f"pressure of {name}", None, "is missing: every volume needs one", where="circuit")
            p = float(pressures[name])
            if not p > 0.0:
                raise InputError(f"pressure of {name}", p, "must be an absolute pressure above 0 Pa", where="circuit")
        fixed = {name: Value(jnp.asarray(x, float), jnp.zeros(())) for name, x in (inputs or {}).items()}
        return self.at_rest(pressures, fixed, temperature)

    def at_rest(
        self, pressures: Mapping[str, Scalar], inputs: Mapping[str, Value], temperature: Scalar = 293.15
    ) -> Tree:
        """State and memory at rest, without checks, so that pressures may be traced; inputs as the engine gives them."""
        values = {name: jnp.asarray(pressures[name], float) for name in self.chambers}
        masses = {
            name: self.gas.mass(p, self._volume(name, p, inputs).value, temperature) for name, p in values.items()
        }
        elements = {}
        for name, element in self.elements.items():
            signal = self.ends[name][1]
            # of a command that nobody knows yet, the element keeps what it is set to by hand
            elements[name] = element.settled(self._command(name, inputs) if signal in inputs else None)
        return {"mass": masses, "pressure": values, "elements": elements}

    def initial_memory(self, state: Tree, inputs: Mapping[str, Value] | None = None) -> Tree:
        """Memory for a state at rest, with inputs as the engine gives them; empty if there is none."""
        gases = self.gas_states(state, inputs or {})
        kept = {name: self.elements[name].initial_memory(self._at(name, gases)) for name in self.elements}
        return {name: memory for name, memory in kept.items() if flatten(memory)[0]}

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Signals, with ``<element>.command`` of every element that has dead time, delayed by it.

        A run does this itself. What is late already stays as it is.
        """
        late = {}
        for name, element in self.elements.items():
            delay, signal = element.delay(), self.ends[name][1]
            if delay is not None and signal is not None and signal in signals and f"{name}.command" not in signals:
                late[f"{name}.command"] = signals[signal].delayed(delay)
        return {**signals, **late}

    def rate(
        self, state: Tree, memory: Tree, inputs: Mapping[str, Value], entering: Mapping[str, Inflow] | None = None
    ) -> Tree:
        """Rates of masses, pressures and the elements' own states.

        Args:
            state: state of the circuit.
            memory: memory of its elements.
            inputs: values of the signals.
            entering: what enters nodes from other circuits, see `Junction`.
        """
        gases = self.gas_states(state, inputs)
        inflow, _ = self._inflows(self._streams(state, memory, gases, inputs), gases)
        for name, more in (entering or {}).items():
            inflow[name] = Inflow(inflow[name].mass + more.mass, inflow[name].enthalpy + more.enthalpy)
        masses, pressures = {}, {}
        for name in self.chambers:
            volume = self._volume(name, state["pressure"][name], inputs)
            rate, _ = self._chamber(name).heat.rates(gases[name], volume, inflow[name])
            masses[name], pressures[name] = inflow[name].mass, rate
        elements = {
            name: element.rates(
                self._at(name, gases), state["elements"][name], _kept(memory, name), self._command(name, inputs)
            )
            for name, element in self.elements.items()
        }
        return {"mass": masses, "pressure": pressures, "elements": elements}

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Flows across the boundary: mass [kg/s], enthalpy, heat, work on moving walls, and of machines on the gas [W]."""
        return self.crossing(self.passing(state, memory, inputs))

    def stored_energies(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Internal energy of all stored gas [J]."""
        return {"gas": self.stored(state, inputs)[1]}

    def balances(self, integrands: Tree) -> dict[str, Exchange]:
        """Energy into the gas, over the enthalpy that crosses the border."""
        net = integrands["enthalpy"] + integrands["heat"] + integrands["shaft"] - integrands["work"]
        return {"gas": Exchange(net, integrands["enthalpy_turnover"])}

    def crossing(self, now: Passing) -> dict[str, Scalar]:
        """Flows across the boundary, from known flows."""
        out: dict[str, Any] = {
            "mass": 0.0,
            "enthalpy": 0.0,
            "heat": 0.0,
            "work": 0.0,
            "shaft": now.added,
            "mass_turnover": 0.0,
            "enthalpy_turnover": 0.0,
        }
        for name, node in self.nodes.items():
            flow = now.inflow[name]
            if isinstance(node, Reservoir):
                out["mass"] -= flow.mass
                out["enthalpy"] -= flow.enthalpy
                out["mass_turnover"] += jnp.abs(flow.mass)
                out["enthalpy_turnover"] += jnp.abs(flow.enthalpy)
                continue
            out["heat"] += now.heat[name]
            out["work"] += now.gas[name].pressure_abs * now.swelling(name)
        return {name: jnp.asarray(value) for name, value in out.items()}

    def passing(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Passing:
        """Quantities of a moment for the accounts: gas, volumes, flows and heat."""
        gases, volumes = self.gas_states(state, inputs), self.volumes(state, inputs)
        streams = self._streams(state, memory, gases, inputs)
        inflow, added = self._inflows(streams, gases)
        rates = {n: self._chamber(n).heat.rates(gases[n], volumes[n], inflow[n]) for n in volumes}
        pressure_rates, heat = ({n: r[i] for n, r in rates.items()} for i in (0, 1))
        return Passing(gases, volumes, streams, inflow, added, pressure_rates, heat)

    def volumes(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, VolumeState]:
        """Volumes of the chambers."""
        return {name: self._volume(name, state["pressure"][name], inputs) for name in self.chambers}

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Advance the memory of every element after the gas at its ports has changed."""
        if not memory:
            return {}
        before, after = self.gas_states(*start), self.gas_states(*end)
        return {
            name: self.elements[name].advance_memory(kept, self._at(name, before), self._at(name, after))
            for name, kept in memory.items()
        }

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Absolute pressures [Pa], temperatures [K] and masses [kg] of all nodes, mass flows of all elements [kg/s]."""
        gases = self.gas_states(state, inputs)
        out = {f"{name}.pressure_abs": s.pressure_abs for name, s in gases.items()}
        out |= {f"{name}.temperature": s.temperature for name, s in gases.items()}
        out |= {f"{name}.mass": state["mass"][name] for name in self.chambers}
        for name, flows in self._flows(state, memory, gases, inputs).items():
            element = self.elements[name]
            for path, flow in zip(element.paths, flows, strict=True):
                out[f"{path_name(element, name, path)}.mass_flow"] = flow
            arguments = state["elements"][name], _kept(memory, name), self._command(name, inputs)
            out |= {f"{name}.{key}": value for key, value in element.outputs(self._at(name, gases), *arguments).items()}
        return out

    def admissible(self, state: Tree) -> Scalar:
        """Whether every volume holds gas at a pressure above vacuum."""
        held = [state[quantity][name] > 0.0 for quantity in ("mass", "pressure") for name in self.chambers]
        return jnp.stack(held).all()

    def max_rate_bound(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Scalar:
        """Bound from the steepest slope of each restriction and the capacity of the nodes it joins [1/s].

        A network of conductances s over capacities has no mode faster than the sum, over the two ends of some path, of what
        the paths at each end amount to.
        """
        gases = self.gas_states(state, inputs)
        per_mass = {}  # dP/dm of each node at its stiffest, adiabatic
        for name in self.chambers:
            volume = self._volume(name, gases[name].pressure_abs, inputs)
            stiff = self.gas.heat_ratio * self.gas.gas_constant * gases[name].temperature
            # a ramp in V(P') only softens a node, and may be left at once
            per_mass[name] = stiff / volume.value
        load: dict[str, Any] = {name: jnp.zeros(()) for name in self.nodes}
        paths = []
        for name, element in self.elements.items():
            slopes = element.steepest(self._at(name, gases), state["elements"][name], self._command(name, inputs))
            for (i, j), slope in zip(element.paths, slopes, strict=True):
                ends = self.ends[name][0][i], self.ends[name][0][j]
                paths.append(ends)
                for end in ends:
                    load[end] = load[end] + slope * per_mass.get(end, 0.0)
        return jnp.stack([load[a] + load[b] for a, b in paths]).max()

    def stored(self, state: Tree, inputs: Mapping[str, Value]) -> tuple[Scalar, Scalar]:
        """Mass [kg] and internal energy [J] of all stored gas."""
        mass: Any = 0.0
        energy: Any = 0.0
        for name in self.chambers:
            p = state["pressure"][name]
            mass += state["mass"][name]
            energy += p * self._volume(name, p, inputs).value / (self.gas.heat_ratio - 1.0)
        return mass, energy

    def junction_inflows(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Inflow]:
        """What flows to each junction: mass [kg/s] and enthalpy [W]."""
        gases = self.gas_states(state, inputs)
        inflow, _ = self._inflows(self._streams(state, memory, gases, inputs), gases)
        return {name: inflow[name] for name, node in self.nodes.items() if isinstance(node, Junction)}

    def gas_states(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, GasState]:
        """Gas of every node."""
        gases = {}
        for name, node in self.nodes.items():
            if isinstance(node, Junction):
                junction: Tree = inputs[str(node.signal)]  # its gas, as the circuits that share it have it
                gases[name] = junction
            elif isinstance(node, Reservoir):
                pressure = inputs[node.signal].value if node.signal else node.pressure_abs
                gases[name] = GasState(pressure, node.temperature, self.gas)
            else:
                p = state["pressure"][name]
                volume = self._volume(name, p, inputs)
                gases[name] = GasState(p, self.gas.temperature(p, volume.value, state["mass"][name]), self.gas)
        return gases

    def _chamber(self, name: str) -> Chamber:
        node = self.nodes[name]
        assert isinstance(node, Chamber)
        return node

    def _at(self, name: str, gases: Mapping[str, GasState]) -> tuple[GasState, ...]:
        return tuple(gases[end] for end in self.ends[name][0])

    def _command(self, name: str, inputs: Mapping[str, Value]) -> Scalar:
        signal = self.ends[name][1]
        if signal is None:
            return jnp.asarray(self.elements[name].undriven)
        late = f"{name}.command"
        return inputs[late if late in inputs else signal].value

    def _volume(self, name: str, pressure_abs: Scalar, inputs: Mapping[str, Value]) -> VolumeState:
        node = self._chamber(name)
        length, velocity = (0.0, 0.0) if node.signal is None else inputs[node.signal]
        volume = volume_of(node, pressure_abs, length, velocity)
        moved: VolumeState = volume._replace(value=volume.value + self.inner_volume(name))
        return moved

    def inner_volume(self, name: str) -> Scalar:
        """Volume that the elements at a node add to it [m^3]."""
        # By name: a tree that was taken apart and put together has its tables sorted.
        volumes = [
            inner
            for element, (ends, _) in self.ends.items()
            if name in ends
            for end, inner in zip(ends, self.elements[element].inner_volumes(), strict=True)
            if end == name
        ]
        return sum(volumes, start=jnp.zeros(()))

    def _flows(
        self, state: Tree, memory: Tree, gases: dict[str, GasState], inputs: Mapping[str, Value]
    ) -> dict[str, tuple[Scalar, ...]]:
        return {
            name: element.flows(
                self._at(name, gases), state["elements"][name], _kept(memory, name), self._command(name, inputs)
            )
            for name, element in self.elements.items()
        }

    def _streams(
        self, state: Tree, memory: Tree, gases: dict[str, GasState], inputs: Mapping[str, Value]
    ) -> dict[str, ExergyStream]:
        streams = {}
        for name, flows in self._flows(state, memory, gases, inputs).items():
            element, ends = self.elements[name], self.ends[name][0]
            power: Any = [None] * len(flows)
            if kind_of(element) == "machine":
                arguments = state["elements"][name], _kept(memory, name), self._command(name, inputs)
                power = element.heating(self._at(name, gases), *arguments)
            for path, flow, gain in zip(element.paths, flows, power, strict=True):
                streams[path_name(element, name, path)] = ExergyStream(name, (ends[path[0]], ends[path[1]]), flow, gain)
        return streams

    def _inflows(
        self, streams: Mapping[str, ExergyStream], gases: dict[str, GasState]
    ) -> tuple[dict[str, Inflow], Scalar]:
        """Inflow of each node, and power that machines add to the gas on its way [W]."""
        mass: dict[str, Any] = {name: 0.0 for name in self.nodes}
        enthalpy: dict[str, Any] = {name: 0.0 for name in self.nodes}
        total: Any = jnp.zeros(())
        for _, (a, b), flow, power in streams.values():
            carried = flow * self.gas.cp * jnp.where(flow >= 0.0, gases[a].temperature, gases[b].temperature)
            mass[a], mass[b] = mass[a] - flow, mass[b] + flow
            enthalpy[a], enthalpy[b] = enthalpy[a] - carried, enthalpy[b] + carried
            if power is not None:
                enthalpy[b], total = enthalpy[b] + power, total + power
        return {name: Inflow(mass[name], enthalpy[name]) for name in self.nodes}, total


def _kept(memory: Tree, name: str) -> Any:
    return memory[name] if name in memory else ()


# ---- topology: closed at every node, driven, without supplies in short circuit


def check_topology(nodes: Mapping[str, Reservoir | Chamber], branches: Mapping[str, Branch]) -> None:
    """Raise `InputError` that names the element or node, and what is wrong with it."""
    touched = {end for name, branch in branches.items() for end in _closed(name, branch, nodes)}
    for name in nodes:
        if name not in touched:
            raise InputError(name, None, "needs at least one element that leads to it", where="circuit")
    if not any(isinstance(node, Chamber) for node in nodes.values()):
        raise InputError("nodes", None, "must have at least one volume; they are reservoirs only", where="circuit")
    for name, branch in branches.items():
        for i, j in branch.element.paths:
            a, b = branch.ports[i], branch.ports[j]
            if isinstance(nodes[a], Reservoir) and isinstance(nodes[b], Reservoir):
                raise InputError(
                    name, None, f"joins two supplies, {a} and {b}: a volume must lie between them", where="circuit"
                )


def _closed(name: str, branch: Branch, nodes: Mapping[str, Reservoir | Chamber]) -> tuple[str, ...]:
    wanted = branch.element.ports
    if len(branch.ports) != len(wanted):
        raise InputError(name, ", ".join(branch.ports), f"must have a node at {' and '.join(wanted)}", where="circuit")
    for port, end in zip(wanted, branch.ports, strict=True):
        if end not in nodes:
            raise InputError(
                f"{name}.{port}", end, "this port leads to no node; nodes are", known=nodes, where="circuit"
            )
    if len(set(branch.ports)) < len(branch.ports):
        raise InputError(name, ", ".join(branch.ports), "two of its ports lead to the same node", where="circuit")
    if branch.element.commanded and branch.command is None:
        raise InputError(f"{name}.command", None, "is missing: a signal must drive it", where="circuit")
    if branch.command == f"{name}.command" and branch.element.delay() is not None:
        problem = "must be another name; this one is kept for the signal as it is after the dead time"
        raise InputError(f"{name}.command", branch.command, problem, where="circuit")
    return branch.ports


# ---- exergy

ROOM = "room"  # how the node of the room's air is called


class ExergyStream(NamedTuple):
    """Gas on one path: the nodes at its ends, mass flow [kg/s], power added on the way [W], None if nothing can."""

    element: str
    ends: tuple[str, str]
    flow: Scalar
    power: Scalar | None


class Passing(NamedTuple):
    """A circuit at one moment."""

    gas: dict[str, GasState]  # at every node
    volumes: dict[str, VolumeState]  # volumes of every chamber
    streams: dict[str, ExergyStream]  # by path
    inflow: dict[str, Inflow]  # into every node
    added: Scalar  # by machines to the gas, all together [W]
    pressure_rates: dict[str, Scalar]  # pressure rates of every chamber [Pa/s]
    heat: dict[str, Scalar]  # into the gas of every chamber [W]

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
            working = working + now.volumes[name].value - node.dead_volume - circuit.inner_volume(name)
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


# ---- balance of a run: whether its gas is all there

LEAST_FLOW = 1e-6  # of what is stored


class RunBalance(NamedTuple):
    """Errors of the balances of a run, relative to the throughput; zero is perfect.

    Where next to nothing went through, it is over `LEAST_FLOW` of what is stored, so that a circuit at rest shows the
    rounding of its stored energy and not a ratio of two roundings.
    """

    mass: float
    energy: float


def balance(
    circuit: Circuit, start: Scalar, end: Scalar, first: Tree, last: Tree, integrals: Mapping[str, Scalar]
) -> RunBalance:
    """Compare stored mass and energy of the end states with independent integrals over the border.

    Args:
        circuit: the circuit that was run.
        start: state at the start.
        end: state at the end.
        first: inputs at the start.
        last: inputs at the end.
        integrals: as `Circuit.integrands` names them, integrated over the run.
    """
    (m0, u0), (m1, u1) = (map(float, circuit.stored(*at)) for at in ((start, first), (end, last)))
    entered = float(integrals["enthalpy"]) + float(integrals["heat"]) - float(integrals["work"])
    entered += float(integrals["shaft"])
    mass = abs(m1 - m0 - float(integrals["mass"])) / max(float(integrals["mass_turnover"]), LEAST_FLOW * abs(m1), 1e-30)
    energy = abs(u1 - u0 - entered) / max(float(integrals["enthalpy_turnover"]), LEAST_FLOW * abs(u1), 1e-30)
    return RunBalance(mass, energy)
