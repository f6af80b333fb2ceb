"""Elements joined at nodes, in any topology, as one state equation with its mass and energy accounts.

Nodes are reservoirs and chambers; every element leads from one node to another. The state is the mass and the pressure of
each chamber, and the elements' own states. Gas that flows carries the enthalpy of where it comes from, both ways. Kinetic
energy is neglected (about 0.1 % in a tube at 50 m/s).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from ..components import Scalar
from ..components.flow import FlowElement, GasState
from ..components.system import System
from ..errors import InputError
from .gas import AIR, Gas
from .heat import Inflow, VolumeState
from .volume import Chamber, Reservoir


class Branch(NamedTuple):
    """One element between two nodes, and the signal that drives it."""

    element: FlowElement
    a: str
    b: str
    command: str | None = None


class Circuit(System):
    """A pneumatic network. Use `Circuit.of`, which checks it."""

    nodes: dict[str, Reservoir | Chamber]
    elements: dict[str, FlowElement]
    ends: dict[str, tuple[str, str, str | None]] = eqx.field(static=True)
    gas: Gas = AIR

    @classmethod
    def of(cls, nodes: Mapping[str, Reservoir | Chamber], branches: Mapping[str, Branch], *, gas: Gas = AIR) -> Circuit:
        """Join elements at nodes.

        Args:
            nodes: reservoirs and chambers by name.
            branches: elements by name, with the nodes they lead from and to.
            gas: what flows.

        Raises:
            InputError: names a dangling end, or a node that nothing reaches.
        """
        touched: set[str] = set()
        for name, branch in branches.items():
            for end in (branch.a, branch.b):
                if end not in nodes:
                    raise InputError(
                        f"{name}", end, f"this end leads to no node; known are {', '.join(nodes)}", where="circuit"
                    )
                touched.add(end)
            if branch.a == branch.b:
                raise InputError(name, branch.a, "both ends lead to the same node", where="circuit")
        for name in nodes:
            if name not in touched:
                raise InputError(
                    name, "no element", "a node needs at least one element that leads to it", where="circuit"
                )
        if not any(isinstance(node, Chamber) for node in nodes.values()):
            raise InputError("nodes", "reservoirs only", "a circuit needs at least one volume", where="circuit")
        ends = {name: (b.a, b.b, b.command) for name, b in branches.items()}
        return cls(dict(nodes), {name: b.element for name, b in branches.items()}, ends, gas)

    @property
    def chambers(self) -> list[str]:
        """Names of the nodes that store gas, in the order of the state."""
        return [name for name, node in self.nodes.items() if isinstance(node, Chamber)]

    def initial(
        self, pressures: Mapping[str, float], inputs: Mapping[str, Any] | None = None, temperature: float = 293.15
    ) -> Any:
        """The state with given absolute pressures [Pa] and one temperature [K]; lengths of moving volumes from `inputs`."""
        masses, values = {}, {}
        for name in self.chambers:
            if name not in pressures:
                raise InputError(f"pressure of {name}", "not given", "every volume needs one", where="circuit")
            p = float(pressures[name])
            if not p > 0.0:
                raise InputError(
                    f"pressure of {name}", p, "allowed is an absolute pressure above 0 Pa", where="circuit"
                )
            volume = self._volume(name, jnp.asarray(p), _Fixed(inputs or {}))
            masses[name] = self.gas.mass(p, volume.value, temperature)
            values[name] = jnp.asarray(p)
        return {"mass": masses, "pressure": values, "elements": {n: e.initial() for n, e in self.elements.items()}}

    def rate(self, state: Any, memory: Any, inputs: Any) -> Any:
        """Rates of masses, pressures and the elements' own states."""
        seen = self._gas_states(state, inputs)
        inflow = self._inflows(state, seen, inputs)
        masses, pressures = {}, {}
        for name in self.chambers:
            volume = self._volume(name, state["pressure"][name], inputs)
            rate, _ = self._chamber(name).heat.rates(self.gas, *seen[name], volume, inflow[name])
            masses[name], pressures[name] = inflow[name].mass, rate
        elements = {
            name: self.elements[name].rate(seen[a], seen[b], state["elements"][name], _command(inputs, command))
            for name, (a, b, command) in self.ends.items()
        }
        return {"mass": masses, "pressure": pressures, "elements": elements}

    def integrands(self, state: Any, memory: Any, inputs: Any) -> Any:
        """What crosses the circuit's border: mass [kg/s], enthalpy, heat, work of the gas on moving walls [W]."""
        seen = self._gas_states(state, inputs)
        inflow = self._inflows(state, seen, inputs)
        out: dict[str, Any] = {
            "mass": 0.0,
            "enthalpy": 0.0,
            "heat": 0.0,
            "work": 0.0,
            "mass_turnover": 0.0,
            "enthalpy_turnover": 0.0,
        }
        for name, node in self.nodes.items():
            flow = inflow[name]
            if isinstance(node, Reservoir):
                out["mass"] -= flow.mass
                out["enthalpy"] -= flow.enthalpy
                out["mass_turnover"] += jnp.abs(flow.mass)
                out["enthalpy_turnover"] += jnp.abs(flow.enthalpy)
                continue
            volume = self._volume(name, state["pressure"][name], inputs)
            rate, heat = node.heat.rates(self.gas, *seen[name], volume, flow)
            out["heat"] += heat
            out["work"] += seen[name].pressure_abs * (volume.moving + volume.per_pressure * rate)
        return {name: jnp.asarray(value) for name, value in out.items()}

    def slide(self, memory: Any, start: Any, end: Any, duration: Any) -> Any:
        """A circuit has no memory."""
        return memory

    def outputs(self, state: Any, memory: Any, inputs: Any) -> dict[str, Any]:
        """Absolute pressures [Pa], temperatures [K] and masses [kg] of all nodes, mass flows of all elements [kg/s]."""
        seen = self._gas_states(state, inputs)
        out = {f"{name}.pressure_abs": s.pressure_abs for name, s in seen.items()}
        out |= {f"{name}.temperature": s.temperature for name, s in seen.items()}
        out |= {f"{name}.mass": state["mass"][name] for name in self.chambers}
        return out | {f"{name}.mass_flow": w for name, w in self._flows(state, seen, inputs).items()}

    def stored(self, state: Any, inputs: Any) -> tuple[float, float]:
        """Mass [kg] and internal energy [J] of all stored gas."""
        mass, energy = 0.0, 0.0
        for name in self.chambers:
            p = state["pressure"][name]
            mass += float(state["mass"][name])
            energy += float(p * self._volume(name, p, inputs).value / (self.gas.heat_ratio - 1.0))
        return mass, energy

    def _gas_states(self, state: Any, inputs: Any) -> dict[str, GasState]:
        seen = {}
        for name, node in self.nodes.items():
            if isinstance(node, Reservoir):
                pressure = inputs[node.signal].value if node.signal else node.pressure_abs
                seen[name] = GasState(pressure, node.temperature)
            else:
                p = state["pressure"][name]
                volume = self._volume(name, p, inputs)
                seen[name] = GasState(p, self.gas.temperature(p, volume.value, state["mass"][name]))
        return seen

    def _chamber(self, name: str) -> Chamber:
        node = self.nodes[name]
        assert isinstance(node, Chamber)
        return node

    def _volume(self, name: str, pressure_abs: Any, inputs: Any) -> VolumeState:
        node = self._chamber(name)
        length, velocity = (0.0, 0.0) if node.signal is None else inputs[node.signal]
        volume = node.volume(pressure_abs, length, velocity)
        # By name: a tree that was taken apart and put together has its tables sorted.
        tubes = [0.5 * self.elements[n].inner_volume() for n, (a, b, _) in self.ends.items() if name in (a, b)]
        return volume._replace(value=volume.value + sum(tubes))

    def _flows(self, state: Any, seen: dict[str, GasState], inputs: Any) -> dict[str, Scalar]:
        return {
            name: self.elements[name].mass_flow(seen[a], seen[b], state["elements"][name], _command(inputs, command))
            for name, (a, b, command) in self.ends.items()
        }

    def _inflows(self, state: Any, seen: dict[str, GasState], inputs: Any) -> dict[str, Inflow]:
        mass: dict[str, Any] = {name: 0.0 for name in self.nodes}
        enthalpy: dict[str, Any] = {name: 0.0 for name in self.nodes}
        for name, flow in self._flows(state, seen, inputs).items():
            a, b, _ = self.ends[name]
            carried = flow * self.gas.cp * jnp.where(flow >= 0.0, seen[a].temperature, seen[b].temperature)
            mass[a], mass[b] = mass[a] - flow, mass[b] + flow
            enthalpy[a], enthalpy[b] = enthalpy[a] - carried, enthalpy[b] + carried
        return {name: Inflow(mass[name], enthalpy[name]) for name in self.nodes}


class Balance(NamedTuple):
    """Closure of a run: what is missing, over what went through; zero is perfect."""

    mass: float
    energy: float


def balance(circuit: Circuit, start: Any, end: Any, first: Any, last: Any, integrals: Mapping[str, Any]) -> Balance:
    """Compare stored mass and energy of the end states with independent integrals over the border.

    Args:
        circuit: what was run.
        start: its state at the start.
        end: its state at the end.
        first: inputs at the start.
        last: inputs at the end.
        integrals: as `Circuit.integrands` names them, integrated over the run.
    """
    (m0, u0), (m1, u1) = circuit.stored(start, first), circuit.stored(end, last)
    entered = float(integrals["enthalpy"]) + float(integrals["heat"]) - float(integrals["work"])
    mass = abs(m1 - m0 - float(integrals["mass"])) / max(float(integrals["mass_turnover"]), 1e-30)
    energy = abs(u1 - u0 - entered) / max(float(integrals["enthalpy_turnover"]), 1e-30)
    return Balance(mass, energy)


class _Fixed(dict[str, Any]):
    """Plain lengths as inputs at rest."""

    def __getitem__(self, name: str) -> Any:
        return jnp.asarray(super().__getitem__(name), float), jnp.zeros(())


def _command(inputs: Any, name: str | None) -> Any:
    return jnp.zeros(()) if name is None else inputs[name].value
