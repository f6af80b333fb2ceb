"""Machines of many muscles that share tanks, a joint or a load, with arrays in the place of single muscles.

A machine is cut at the chambers that several muscles share. What hangs on them is a cell: a muscle with the chambers,
tubes and valves of its own line, as a machine of one muscle whose circuit ends at junctions. Cells of one structure are a
group, whose numbers stand side by side. Each rate is evaluated for every cell of a group by the equations of `Machine`;
what flows into the shared chambers, and what the muscles do to the load, is added up over the cells.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from .._jax import Tree, jax, jnp
from ..components import Environment, Module, Scalar, field
from ..components.flow import FlowElement, Gases, GasState
from ..components.system import Coupling, IndependentPart, Moment, System, for_each_unit
from ..engine.native import call_compiled
from ..engine.signals import Signal, Value
from ..pneumatics.circuit import Circuit
from ..pneumatics.volume import Chamber, Inflow, Junction
from ..quantities import quantity
from .loads import Load, SpanState
from .muscle_unit import MuscleUnit

ALONE = "muscle"  # name of the muscle of a cell
JUNCTION = Junction()


class JoinedParts(System):
    """Muscles, circuit and load as they are cut into cells; see `Machine`, which is their state equation."""

    circuit: Circuit
    units: dict[str, MuscleUnit]
    load: Load
    environment: Environment

    @property
    @abc.abstractmethod
    def joined(self) -> Circuit:
        """The circuit with the muscles' present laws in their nodes."""

    @abc.abstractmethod
    def with_lengths(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Value]:
        """Inputs, with the lengths of the muscles that the circuit needs."""

    @abc.abstractmethod
    def pulls(
        self, state: Tree, memory: Tree, inputs: Mapping[str, Value]
    ) -> tuple[dict[str, SpanState], dict[str, Scalar], dict[str, Scalar]]:
        """Spans, tensions at the muscles, and tensions at the load."""

    @abc.abstractmethod
    def at_rest(self, pressures: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Tree, Tree]:
        """State and memory at rest, without checks, so that all of it may be traced."""


class LineVolume(FlowElement):
    """Volume that the lines of all cells add to a shared chamber."""

    ports: ClassVar[tuple[str, ...]] = ("a",)
    paths: ClassVar[tuple[tuple[int, int], ...]] = ()
    volume: Scalar = quantity("m^3", (0.0, 1e3), "volume", symbol="V")

    def flows(self, gas: Gases, state: Tree, memory: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """No flow."""
        return ()

    def inner_volumes(self) -> tuple[Scalar, ...]:
        """The volume [m^3]."""
        return (self.volume,)


class SignalArray(Module):
    """Signals of the units of a group: values (samples + 1, n) or a delay (n,), or both."""

    signal: Signal

    def at(self, index: Tree, share: Scalar, period: Scalar) -> Value:
        """Values (n,), see `Signal.at`."""
        return self._each(lambda s: s.at(index, share, period))

    def within(self, index: Tree, begin: Scalar, end: Scalar, share: Scalar, period: Scalar) -> Value:
        """Values (n,), see `Signal.within`."""
        return self._each(lambda s: s.within(index, begin, end, share, period))

    def _each(self, function: Callable[[Signal], Value]) -> Value:
        s = self.signal
        axes = 1 if jnp.ndim(s.values) > 1 else None, 0 if jnp.ndim(s.delay if s.delay is not None else 0.0) else None

        def one(values: Scalar, delay: Scalar | None) -> Value:
            result: Value = function(s.replace(values=values, delay=delay))
            return result

        values: Value = jax.vmap(one, in_axes=axes)(s.values, s.delay)
        return values


class MachineArray(System):
    """Groups of cells on shared chambers and a load.

    Its state has ``circuit`` and ``load``, and in ``groups`` the cells' states, with the cells as last axis. The signals of
    the cells of group g have the names ``g.<name in the cell>``.
    """

    circuit: Circuit
    load: Load  # with the muscles of `Load.collected`
    environment: Environment
    groups: tuple[JoinedParts, ...] = ()
    # 1 for each cell, 0 for those that only fill the array; (n,) for each group.
    weights: tuple[Scalar, ...] = ()
    # By leaf of each group, whether it differs from cell to cell.
    varied: tuple[tuple[bool, ...], ...] = field(static=True, kw_only=True, default=())
    # See `for_each_unit`.
    mapped: bool = field(static=True, kw_only=True, default=False)

    def _each(self, g: int, function: Any, *trees: Tree) -> tuple[Tree, Tree]:
        """Evaluate a function of (cell, *trees) for each cell of a group, and add up its second result."""
        flags = [*self.varied[g], True, *(jnp.ndim(leaf) > 0 for leaf in jax.tree.leaves(trees))]

        def one(cell: JoinedParts, weight: Any, *own: Any) -> tuple[Tree, Tree]:
            result, share = function(cell, *own)
            return result, jax.tree.map(lambda x: weight * x, share)

        return for_each_unit(one, (self.groups[g], self.weights[g], *trees), flags, mapped=self.mapped)

    @property
    def _whole(self) -> Circuit:
        """The shared circuit with the volume that the cells' lines add to its chambers."""
        volumes: dict[str, Any] = {}
        for g in range(len(self.groups)):

            def added(cell: JoinedParts) -> tuple[Any, Any]:
                nodes = cell.circuit.nodes
                return (), {n: cell.circuit.inner_volume(n) for n, node in nodes.items() if isinstance(node, Junction)}

            for name, volume in self._each(g, added)[1].items():
                volumes[name] = volumes.get(name, 0.0) + volume
        return with_line_volumes(self.circuit, volumes)

    def _cells(self, state: Tree, inputs: Mapping[str, Value], circuit: Circuit) -> list[Any]:
        """States and inputs of the cells of each group; the load's state is part of every cell's."""
        gases = circuit.gas_states(state["circuit"], inputs)
        cells = []
        for g, own in enumerate(state["groups"]):
            prefix, nodes = f"{g}.", self.groups[g].circuit.nodes
            signals = {name.removeprefix(prefix): value for name, value in inputs.items() if name.startswith(prefix)}
            ends = {str(n.signal): gases[name] for name, n in nodes.items() if isinstance(n, Junction)}
            cells.append(({**own, "load": state["load"]}, {**signals, **ends}))
        return cells

    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of the shared gas, the load and all cells."""
        circuit = self._whole
        entering: dict[str, Inflow] = {}
        effort: dict[str, Any] = {}
        rates = []
        for g, (own, own_inputs) in enumerate(self._cells(state, inputs, circuit)):

            def one(cell: JoinedParts, at: Any, kept: Any, now: Any) -> tuple[Any, Any]:
                rate = cell.rate(at, kept, now)
                flows = cell.joined.junction_inflows(at["circuit"], kept["circuit"], cell.with_lengths(at, kept, now))
                share = flows, _effort(cell, at, kept, now)
                return {part: rate[part] for part in ("circuit", "muscles")}, share

            rate, (flows, pull) = self._each(g, one, own, memory["groups"][g], own_inputs)
            rates.append(rate)
            for name, flow in flows.items():
                before = entering.get(name, Inflow(0.0, 0.0))
                entering[name] = Inflow(before.mass + flow.mass, before.enthalpy + flow.enthalpy)
            effort = _added(effort, pull)
        return {
            "circuit": circuit.rate(state["circuit"], memory["circuit"], inputs, entering),
            "load": self.load.rates(state["load"], effort, inputs),
            "groups": tuple(rates),
        }

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """None: accounts are those of the machine."""
        return {}

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Advance the memory of the shared elements and of all cells."""
        circuit = self._whole
        before, after = (self._cells(moment.state, moment.inputs, circuit) for moment in (start, end))
        groups = []
        for g, (first, last) in enumerate(zip(before, after, strict=True)):

            def one(cell: JoinedParts, kept: Any, first: Any, last: Any, time: Any) -> tuple[Any, Any]:
                return cell.advance_memory(kept, Moment(*first), Moment(*last), time), ()

            groups.append(self._each(g, one, memory["groups"][g], first, last, duration)[0])
        first, last = (Moment(moment.state["circuit"], moment.inputs) for moment in (start, end))
        return {"circuit": circuit.advance_memory(memory["circuit"], first, last, duration), "groups": tuple(groups)}

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Signals with delayed commands, see `Circuit.commands`; those that differ from cell to cell as `SignalArray`."""
        out = self.circuit.commands(signals)
        for g, group in enumerate(self.groups):
            prefix = f"{g}."
            own = {n.removeprefix(prefix): s for n, s in out.items() if n.startswith(prefix)}
            if any(isinstance(s, SignalArray) for s in own.values()):
                continue  # what is late already stays as it is
            for name, signal in group.circuit.commands(own).items():
                delay = 0.0 if signal.delay is None else signal.delay
                array = jnp.ndim(signal.values) > 1 or jnp.ndim(delay) > 0
                out[prefix + name] = SignalArray(signal) if array else signal
        return out

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Outputs of the shared circuit and of the load, and ``g.<name>`` (n,) of the cells of each group."""
        circuit = self._whole
        out = circuit.outputs(state["circuit"], memory["circuit"], inputs)
        effort: dict[str, Any] = {}
        for g, (own, own_inputs) in enumerate(self._cells(state, inputs, circuit)):

            def one(cell: JoinedParts, at: Any, kept: Any, now: Any) -> tuple[Any, Any]:
                return cell.outputs(at, kept, now), _effort(cell, at, kept, now)

            values, pull = self._each(g, one, own, memory["groups"][g], own_inputs)
            effort = _added(effort, pull)
            out |= {f"{g}.{name}": value for name, value in values.items() if not name.startswith("load.")}
        return out | {f"load.{k}": v for k, v in self.load.outputs(state["load"], effort, inputs).items()}


def with_line_volumes(circuit: Circuit, volumes: Mapping[str, Scalar]) -> Circuit:
    """A circuit with volumes added to some of its chambers [m^3]."""
    names = {_line_volume(node): node for node in circuit.chambers}
    elements = {name: LineVolume(volume=jnp.asarray(volumes.get(node, 0.0))) for name, node in names.items()}
    ends = {name: ((node,), None) for name, node in names.items()}
    return circuit.replace(elements={**circuit.elements, **elements}, ends={**circuit.ends, **ends})


def _line_volume(node: str) -> str:
    return f"{node}.lines"


def _effort(cell: JoinedParts, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
    return cell.load.effort(state["load"], cell.pulls(state, memory, inputs)[2])


def _added(sums: dict[str, Any], more: Mapping[str, Any]) -> dict[str, Tree]:
    return {name: value + sums.get(name, 0.0) for name, value in more.items()}


# ---- cutting a machine


class Cell(NamedTuple):
    """Names of a cell's parts in the machine, by their names in the cell."""

    nodes: dict[str, str]  # its chambers, the reservoirs and shared chambers at which its elements end
    elements: dict[str, str]  # its elements
    signals: dict[str, str]  # signals of its nodes and elements, and of the load
    shared: frozenset[str]  # names of its shared chambers


class MachineCoupling(Coupling):
    """A machine cut into cells."""

    def __init__(self, cells: Mapping[str, Cell], nodes: list[str], elements: list[str]) -> None:
        self._cells, self._nodes, self._elements = dict(cells), nodes, elements

    def cells(self, system: Tree, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> list[IndependentPart]:
        """The cells as systems of their own, with states, memory and signals."""
        return [self._cell(system, muscle, cell, state, memory, signals) for muscle, cell in self._cells.items()]

    def _cell(
        self, machine: JoinedParts, muscle: str, cell: Cell, state: Tree, memory: Tree, signals: Mapping[str, Tree]
    ) -> IndependentPart:
        circuit, room = machine.circuit, machine.environment
        renamed = {old: new for new, old in cell.signals.items()} | {f"{muscle}.length": f"{ALONE}.length"}
        node_names = {old: new for new, old in cell.nodes.items()}
        nodes: dict[str, Any] = {}
        for new, old in cell.nodes.items():
            node = circuit.nodes[old]
            if new in cell.shared:
                nodes[new] = JUNCTION.with_fields(
                    pressure_abs=room.pressure_abs, temperature=room.temperature, signal=f"{new}.gas"
                )
            else:
                nodes[new] = node if node.signal is None else node.with_fields(signal=renamed[node.signal])
        ends = {}
        for new, old in cell.elements.items():
            ports, command = circuit.ends[old]
            ends[new] = tuple(node_names[p] for p in ports), None if command is None else renamed[command]
        elements = {new: circuit.elements[old] for new, old in cell.elements.items()}
        load = machine.load.one_of(muscle, ALONE)
        assert load is not None
        part = type(machine)(Circuit(nodes, elements, ends, circuit.gas), {ALONE: machine.units[muscle]}, load, room)
        own = {**cell.elements, **{new: old for new, old in cell.nodes.items() if new not in cell.shared}}
        gas = {
            kind: {new: values[old] for new, old in own.items() if old in values}
            for kind, values in state["circuit"].items()
        }
        kept = {new: memory["circuit"][old] for new, old in own.items() if old in memory["circuit"]}
        late = {f"{new}.command": f"{old}.command" for new, old in cell.elements.items()}
        needed = {new: signals[old] for new, old in cell.signals.items()}
        needed |= {new: signals[old] for new, old in late.items() if old in signals}
        return IndependentPart(
            part,
            {"circuit": gas, "muscles": {ALONE: state["muscles"][muscle]}},
            {"circuit": kept, "muscles": {ALONE: memory["muscles"][muscle]}},
            needed,
            own,
        )

    def _shared(self, machine: JoinedParts) -> Circuit:
        circuit = machine.circuit
        return Circuit(
            {name: circuit.nodes[name] for name in self._nodes},
            {name: circuit.elements[name] for name in self._elements},
            {name: circuit.ends[name] for name in self._elements},
            circuit.gas,
        )

    def core(self, system: Tree, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> IndependentPart:
        """The shared circuit and the load."""
        machine: JoinedParts = system
        shared, load = self._shared(machine), machine.load.collected()
        assert load is not None
        names = {*self._nodes, *self._elements}
        gas = {kind: {n: v for n, v in values.items() if n in names} for kind, values in state["circuit"].items()}
        gas["elements"] |= {_line_volume(name): () for name in shared.chambers}
        kept = {name: value for name, value in memory["circuit"].items() if name in names}
        needed = {shared.nodes[n].signal for n in self._nodes} | {shared.ends[e][1] for e in self._elements}
        needed |= {*load.signals(), *(f"{e}.command" for e in self._elements)}
        return IndependentPart(
            MachineArray(shared, load, machine.environment),
            {"circuit": gas, "load": state["load"]},
            {"circuit": kept},
            {name: signal for name, signal in signals.items() if name in needed},
            {},
        )

    def at_rest(
        self, machine: JoinedParts, pressures: Mapping[str, Scalar], inputs: Mapping[str, Value]
    ) -> tuple[dict[str, Tree], dict[str, Tree]]:
        """State and memory of the machine at rest, see `Machine.at_rest`: cell by cell, by one compiled program."""
        room = machine.environment.temperature
        state: dict[str, Any] = {"circuit": {"mass": {}, "pressure": {}, "elements": {}}, "muscles": {}}
        memory: dict[str, Any] = {"circuit": {}, "muscles": {}}
        for muscle, cell in self._cells.items():
            nothing = {"circuit": {}, "muscles": {muscle: ()}}
            part = self._cell(machine, muscle, cell, nothing, nothing, inputs)
            own = {
                new: pressures[old] for new, old in cell.nodes.items() if old in pressures and new not in cell.shared
            }
            gas = {
                f"{name}.gas": GasState(np.asarray(pressures[name]), np.asarray(room), machine.circuit.gas)
                for name in cell.shared
            }
            start, kept = call_compiled(at_rest, part.system, own, {**part.signals, **gas})
            for place, piece in (
                *((state["circuit"][kind], start["circuit"][kind]) for kind in state["circuit"]),
                (memory["circuit"], kept["circuit"]),
            ):
                place.update({part.outputs[name]: value for name, value in piece.items()})
            state["muscles"][muscle], memory["muscles"][muscle] = start["muscles"][ALONE], kept["muscles"][ALONE]
        circuit = self._shared(machine)
        lines = {name: machine.circuit.inner_volume(name) - circuit.inner_volume(name) for name in circuit.chambers}
        whole, absolute = with_line_volumes(circuit, lines), {name: pressures[name] for name in circuit.chambers}
        start, kept = call_compiled(_circuit_at_rest, whole, absolute, dict(inputs), room)
        for kind, values in start.items():
            state["circuit"][kind].update(
                {name: v for name, v in values.items() if name not in whole.elements or name in circuit.elements}
            )
        memory["circuit"].update(kept)
        state["load"] = machine.load.initial()
        return state, memory

    def assembled(
        self, core: Tree, groups: tuple[Tree, ...], weights: tuple[Tree, ...], varied: Tree, mapped: bool
    ) -> System:
        """The core with its groups of cells."""
        made: System = core.replace(groups=groups, weights=weights, varied=varied, mapped=mapped)
        return made


def at_rest(machine: JoinedParts, pressures: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Tree, Tree]:
    """`Machine.at_rest`, to be compiled."""
    return machine.at_rest(pressures, inputs)


def _circuit_at_rest(
    circuit: Circuit, pressures: Mapping[str, Scalar], inputs: Mapping[str, Value], temperature: Any
) -> tuple[Tree, Tree]:
    state = circuit.at_rest(pressures, inputs, temperature)
    return state, circuit.initial_memory(state, inputs)


def find_coupling(machine: JoinedParts) -> MachineCoupling | None:
    """Cut a machine into cells; None if muscles are joined by more than chambers between them and the load."""
    circuit, chambers = machine.circuit, set(machine.circuit.chambers)
    if any(machine.load.one_of(name, ALONE) is None for name in machine.units) or machine.load.collected() is None:
        return None
    joined: dict[str, list[str]] = {name: [] for name in circuit.nodes}  # elements at each node
    for element, (ports, _) in circuit.ends.items():
        for port in ports:
            joined[port].append(element)
    apart: dict[str, frozenset[str]] = {}
    todo = _components(circuit, joined, frozenset(chambers))
    while todo:
        together = todo.pop()
        muscles = [name for name in together if name in machine.units]
        if len(muscles) > 1:
            # what muscles share is where most elements meet; cut there, and look again at what still hangs together
            hub = max((n for n in together if n not in machine.units), key=lambda n: (len(joined[n]), n), default=None)
            if hub is None:
                return None
            todo += _components(circuit, joined, together - {hub})
        elif muscles:
            apart[muscles[0]] = together
    private = {name: muscle for muscle, together in apart.items() for name in together}
    cells = {muscle: _cell(machine, joined, muscle, private) for muscle in machine.units}
    used = {element for cell in cells.values() for element in cell.elements.values()}
    elements = [name for name in circuit.elements if name not in used]
    used_nodes = {port for name in elements for port in circuit.ends[name][0]}
    nodes = [
        n for n, node in circuit.nodes.items() if n in used_nodes or (isinstance(node, Chamber) and n not in private)
    ]
    return MachineCoupling(cells, nodes, elements)


def _components(circuit: Circuit, joined: Mapping[str, list[str]], nodes: frozenset[str]) -> list[frozenset[str]]:
    rest, components = set(nodes), []
    for first in circuit.nodes:
        if first not in rest:
            continue
        rest.remove(first)
        together, todo = {first}, [first]
        while todo:
            for element in joined[todo.pop()]:
                new = rest.intersection(circuit.ends[element][0])
                rest -= new
                together |= new
                todo += sorted(new)
        components.append(frozenset(together))
    return components


def _cell(machine: JoinedParts, joined: Mapping[str, list[str]], muscle: str, private: Mapping[str, str]) -> Cell:
    """Name the parts of a cell: by their names without the muscle's, or else by their order along its lines."""
    circuit = machine.circuit
    elements: dict[str, str] = {}
    nodes = {ALONE: muscle}
    signals = {name: name for name in machine.load.signals()}
    seen, todo = {muscle}, [muscle]

    def named(old: str, kind: str, number: int) -> str:
        prefix = f"{muscle}."
        return ALONE + old.removeprefix(muscle) if old.startswith(prefix) else f"{ALONE}.{kind}{number}"

    def signal(old: str | None) -> None:
        if old is not None and old != f"{muscle}.length" and old not in signals.values():
            signals[named(old, "signal", len(signals))] = old

    def rank(element: str) -> tuple[Tree, ...]:
        return type(circuit.elements[element]).__name__, circuit.ends[element][0].index(node)

    while todo:
        node = todo.pop(0)
        signal(circuit.nodes[node].signal)
        for element in sorted(joined[node], key=rank):
            if element in elements.values():
                continue
            elements[named(element, "element", len(elements))] = element
            signal(circuit.ends[element][1])
            for port in circuit.ends[element][0]:
                if port in seen:
                    continue
                seen.add(port)
                if private.get(port) == muscle:
                    nodes[named(port, "chamber", len(nodes))] = port
                    todo.append(port)
                else:
                    nodes[port] = port
                    signal(circuit.nodes[port].signal if not isinstance(circuit.nodes[port], Chamber) else None)
    shared = frozenset(n for n, old in nodes.items() if isinstance(circuit.nodes[old], Chamber) and old not in private)
    return Cell(nodes, elements, signals, shared)
