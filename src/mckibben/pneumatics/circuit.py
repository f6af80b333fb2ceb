"""Elements joined at nodes, in any topology, as one state equation with its mass and energy accounts.

Nodes are reservoirs and chambers; every element has a node at each of its ports. The state is the mass and the pressure of
each chamber, and the elements' own states. Gas that flows carries the enthalpy of where it comes from, both ways. Kinetic
energy is neglected (about 0.1 % in a tube at 50 m/s).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .._jax import Tree, jnp
from ..components import Scalar, field
from ..components.flow import FlowElement, GasState
from ..components.module import flatten
from ..components.system import Exchange, Moment, System, Value
from ..errors import InputError
from .exergy import ExergyStream, Passing, kind_of, path_name
from .gas import AIR, Gas
from .heat import Inflow, VolumeState
from .topology import check_topology
from .volume import Chamber, Junction, Reservoir, volume_of


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
        return self.at_rest(pressures, _Fixed(inputs or {}), temperature)

    def at_rest(
        self, pressures: Mapping[str, Scalar], inputs: Mapping[str, Value], temperature: Scalar = 293.15
    ) -> Tree:
        """State and memory at rest, without checks, so that pressures may be traced; inputs as the engine gives them."""
        values = {name: jnp.asarray(pressures[name], float) for name in self.chambers}
        masses = {
            name: self.gas.mass(p, self._volume(name, p, inputs).value, temperature) for name, p in values.items()
        }
        elements = {name: element.settled(self._driven(name, inputs)) for name, element in self.elements.items()}
        return {"mass": masses, "pressure": values, "elements": elements}

    def _driven(self, name: str, inputs: Mapping[str, Value]) -> Scalar | None:
        """The command of an element at the start, or None if it is not known."""
        signal = self.ends[name][1]
        return None if signal is None or signal not in inputs else self._command(name, inputs)

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
            rate, _ = self._chamber(name).heat.rates(self.gas, *gases[name], volume, inflow[name])
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
        rates = {n: self._chamber(n).heat.rates(self.gas, *gases[n], volumes[n], inflow[n]) for n in volumes}
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
                gases[name] = GasState(pressure, node.temperature)
            else:
                p = state["pressure"][name]
                volume = self._volume(name, p, inputs)
                gases[name] = GasState(p, self.gas.temperature(p, volume.value, state["mass"][name]))
        return gases

    def _chamber(self, name: str) -> Chamber:
        node = self.nodes[name]
        assert isinstance(node, Chamber)
        return node

    def _at(self, name: str, gases: Mapping[str, GasState]) -> tuple[GasState, ...]:
        """The gas at the ports of an element."""
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
        """The gas on every path."""
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


class _Fixed(dict[str, Any]):
    """Plain lengths as inputs at rest."""

    def __getitem__(self, name: str) -> Value:
        return Value(jnp.asarray(super().__getitem__(name), float), jnp.zeros(()))


def _kept(memory: Tree, name: str) -> Any:
    return memory[name] if name in memory else ()
