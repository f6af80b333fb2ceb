"""Circuit, muscles and load as one state equation, with the accounts of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .._jax import Tree, jnp
from ..components import Environment, Scalar
from ..components.system import Exchange, IndependentPart, Moment
from ..engine.native import call_compiled
from ..engine.signals import Value
from ..errors import InputError
from ..muscles.law import law_name
from ..pneumatics.circuit import Circuit, exergies
from ..pneumatics.volume import MovingVolume, MuscleGas
from .loads import Load, SpanState
from .loads.load import mode_bound
from .machine_array import ALONE, JoinedParts, MachineCoupling, at_rest, find_coupling
from .muscle_unit import BraidMotion, MusclePath, MuscleUnit, braid_tension

MANY = 8  # muscles from which on independent ones are integrated side by side, each by the same compiled step
MANY_COUPLED = 16  # muscles from which on those that share a tank or a load are evaluated as arrays


class Machine(JoinedParts):
    """Muscles, circuit and load as one state equation; create it by `Machine.of`, which checks that its parts fit.

    The circuit's node of a muscle has the muscle's name; its volume is that of the muscle's own law, and its length, the
    signal ``<muscle>.length``, comes from the state here. All other inputs are signals by name.
    """

    @classmethod
    def of(
        cls, circuit: Circuit, units: Mapping[str, MuscleUnit], load: Load, environment: Environment | None = None
    ) -> Machine:
        """Join the parts.

        Raises:
            InputError: if a muscle has no node in the circuit, its law knows no volume, or the load does not hold exactly
                these muscles.
        """
        for name, unit in units.items():
            node = circuit.nodes.get(name)
            if not isinstance(node, MovingVolume) or node.signal != f"{name}.length":
                problem = f"must be a MovingVolume of the circuit with the signal {name}.length"
                raise InputError(name, None, problem, where="machine")
            if not unit.law.has_volume():
                law = law_name(unit.law)
                said = f"The law {law} of {name} does not know the volume of its gas, which a machine needs. "
                said += "State its rest_volume if it has one, or take another law"
                demand = "must be a law that knows its volume"
                raise InputError(f"{name}.law", law, demand, where="machine", sentence=said)
        if sorted(load.muscles()) != sorted(units):
            raise InputError("load", ", ".join(load.muscles()), f"must hold {', '.join(units)}", where="machine")
        # Law and room stand once among the parameters, with the muscle and the environment: what changes them changes all.
        muscles: dict[str, Any] = {name: circuit.nodes[name] for name in units}
        gases = {
            name: MuscleGas(dead_volume=n.dead_volume, heat=n.heat, signal=n.signal) for name, n in muscles.items()
        }
        circuit = circuit.replace(nodes={**circuit.nodes, **gases})
        return cls(circuit, dict(units), load, environment or Environment())

    @property
    def joined(self) -> Circuit:
        """The circuit with the muscles' present laws in their nodes: a law is changed in one place, force and volume."""
        room, nodes = self.environment.pressure_abs, dict[str, Any](self.circuit.nodes)
        for name, unit in self.units.items():
            nodes[name] = nodes[name].within(unit.law.braid_volume, room)
        return self.circuit.replace(nodes=nodes)

    def signals(self) -> tuple[str, ...]:
        """Names of all signals that it needs."""
        lengths = [f"{name}.length" for name in self.units]
        needed = [command for _, command in self.circuit.ends.values() if command is not None]
        for node in self.circuit.nodes.values():
            name = node.signal
            needed += [] if name is None or name in lengths else [name]
        return tuple(dict.fromkeys([*needed, *self.load.signals()]))

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Signals, with delayed commands of elements that have dead time, see `Circuit.commands`."""
        return self.circuit.commands(signals)

    def initial(self, pressures: Mapping[str, float], inputs: Mapping[str, Value]) -> tuple[Tree, Tree]:
        """State and memory at rest: every braid balances its tendon or hangs in its ties, friction and creep are relaxed.

        Args:
            pressures: absolute pressure of every volume of the circuit [Pa].
            inputs: values of the signals at the start.

        Raises:
            InputError: names a signal or a pressure that is missing, or a pressure that is none.
        """
        for name in self.signals():
            if name not in inputs:
                problem = f"is missing: the machine needs {', '.join(self.signals())}"
                raise InputError(f"signal {name}", None, problem, where="machine")
        for name in self.circuit.chambers:
            if name not in pressures:
                raise InputError(f"pressure of {name}", None, "is missing: every volume needs one", where="machine")
            p = float(pressures[name])
            if not (p > 0.0 and np.isfinite(p)):
                raise InputError(f"pressure of {name}", p, "must be an absolute pressure above 0 Pa", where="machine")
        chamber_pressures = {name: np.asarray(pressures[name], float) for name in self.circuit.chambers}
        parts = self.names_by_part()
        coupling = None if parts else self.coupling()
        if coupling is not None:
            return coupling.at_rest(self, chamber_pressures, inputs)
        if not parts:
            start: tuple[Any, Any] = call_compiled(at_rest, self, chamber_pressures, dict(inputs))
            return start
        gas: Any = {"mass": {}, "pressure": {}, "elements": {}}
        state: Any = {"circuit": gas, "muscles": {}, "load": self.load.initial()}
        memory: Any = {"circuit": {}, "muscles": {}}
        for muscle, names in parts.items():
            part = self._part(muscle, names)
            chosen = {new: chamber_pressures[old] for new, old in names.items() if old in chamber_pressures}
            alone, kept = call_compiled(at_rest, part, chosen, {new: inputs[names[new]] for new in part.signals()})
            for whole, piece in (
                *((state["circuit"][kind], alone["circuit"][kind]) for kind in state["circuit"]),
                (state["muscles"], alone["muscles"]),
                (memory["circuit"], kept["circuit"]),
                (memory["muscles"], kept["muscles"]),
            ):
                whole.update({names[new]: value for new, value in piece.items()})
        return state, memory

    def names_by_part(self) -> dict[str, dict[str, str]]:
        """Names in the part and in the whole, for each muscle, if the muscles are independent and many; else empty.

        Muscles are independent where no chamber is joined to that of another but through a reservoir, and where the load
        gives their spans.
        """
        if len(self.units) < MANY or any(self.load.alone(name, ALONE) is None for name in self.units):
            return {}
        chambers = set(self.circuit.chambers)
        joined: dict[str, set[str]] = {name: set() for name in chambers}  # elements at each chamber
        for element, (ports, _) in self.circuit.ends.items():
            if not chambers.intersection(ports):
                return {}
            for port in chambers.intersection(ports):
                joined[port].add(element)
        parts: dict[str, dict[str, str]] = {}
        for muscle in self.units:
            nodes, elements, todo = {muscle}, set[str](), [muscle]
            while todo:
                for element in joined[todo.pop()] - elements:
                    elements.add(element)
                    new = set(self.circuit.ends[element][0]) - nodes
                    nodes |= new
                    todo += new & chambers
            if sum(name in self.units for name in nodes) > 1:
                return {}
            signals = [self.circuit.nodes[n].signal for n in nodes] + [self.circuit.ends[e][1] for e in elements]
            named = [*nodes, *elements, *self.load.signals(), *(s for s in signals if s is not None)]
            prefix = f"{muscle}."
            parts[muscle] = {
                ALONE + n.removeprefix(muscle) if n == muscle or n.startswith(prefix) else n: n
                for n in dict.fromkeys(named)
            }
        held = set[str]().union(*(names.values() for names in parts.values()))
        return parts if held >= chambers and held >= set(self.circuit.elements) else {}

    def _part(self, muscle: str, names: Mapping[str, str]) -> Machine:
        new = {old: name for name, old in names.items()}
        circuit = self.circuit
        nodes = {
            name: circuit.nodes[old].with_fields(signal=new.get(circuit.nodes[old].signal or "", None))
            for name, old in names.items()
            if old in circuit.nodes
        }
        elements = {name: circuit.elements[old] for name, old in names.items() if old in circuit.elements}
        ends = {}
        for name in elements:
            ports, command = circuit.ends[names[name]]
            ends[name] = tuple(new[port] for port in ports), None if command is None else new[command]
        load = self.load.alone(muscle, ALONE)
        assert load is not None
        return Machine(Circuit(nodes, elements, ends, circuit.gas), {ALONE: self.units[muscle]}, load, self.environment)

    def parts(self, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> list[IndependentPart]:
        """Parts for each muscle, if the muscles are independent and many."""
        made = []
        for muscle, names in self.names_by_part().items():
            part = self._part(muscle, names)
            gas = {
                kind: {new: values[old] for new, old in names.items() if old in values}
                for kind, values in state["circuit"].items()
            }
            kept = {new: memory["circuit"][old] for new, old in names.items() if old in memory["circuit"]}
            state_there = {"circuit": gas, "muscles": {ALONE: state["muscles"][muscle]}, "load": state["load"]}
            late = {f"{new}.command": f"{old}.command" for new, old in names.items()}
            needed = {name: signals[names[name]] for name in part.signals()}
            needed |= {new: signals[old] for new, old in late.items() if old in signals}
            memory_there = {"circuit": kept, "muscles": {ALONE: memory["muscles"][muscle]}}
            made.append(IndependentPart(part, state_there, memory_there, needed, dict(names)))
        return made

    def coupling(self) -> MachineCoupling | None:
        """Cells of one muscle each on what they share, if the muscles are many."""
        if len(self.units) < MANY_COUPLED:
            return None
        return find_coupling(self)

    def at_rest(self, pressures: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Tree, Tree]:
        """State and memory at rest, without checks, so that all of it may be traced."""
        load = self.load.initial()
        spans = self.load.spans(load, inputs)
        ambient = self.environment.pressure_abs
        lengths = {n: unit.equilibrium(spans[n].span, pressures[n] - ambient) for n, unit in self.units.items()}
        with_lengths, joined = {**inputs, **{f"{n}.length": Value(*at) for n, at in lengths.items()}}, self.joined
        circuit = joined.at_rest(pressures, with_lengths, self.environment.temperature)
        memory = {
            "circuit": joined.initial_memory(circuit, with_lengths),
            "muscles": {name: unit.initial_memory() for name, unit in self.units.items()},
        }
        states = {n: unit.resting(lengths[n], spans[n].span) for n, unit in self.units.items()}
        return {"circuit": circuit, "muscles": states, "load": load}, memory

    def with_lengths(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Value]:
        """Inputs, with the lengths of the muscles that the circuit needs."""
        return self._with(self.motions(state, memory, inputs), inputs)

    def _with(self, motions: Mapping[str, BraidMotion], inputs: Mapping[str, Value]) -> dict[str, Value]:
        return {**inputs, **{f"{name}.length": Value(at.length, at.velocity) for name, at in motions.items()}}

    def gauge(self, state: Tree, name: str) -> Scalar:
        """Gauge pressure in a muscle [Pa]."""
        gauge: Scalar = state["circuit"]["pressure"][name] - self.environment.pressure_abs
        return gauge

    def motions(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, BraidMotion]:
        """Length, velocity and tension of every muscle."""
        held = self.held_spans(self.load.spans(state["load"], inputs), memory)
        return {
            name: unit.motion(state["muscles"][name], memory["muscles"][name], self.gauge(state, name), *held[name])
            for name, unit in self.units.items()
        }

    def pulls(
        self, state: Tree, memory: Tree, inputs: Mapping[str, Value]
    ) -> tuple[dict[str, SpanState], dict[str, Scalar], dict[str, Scalar]]:
        """Spans, tensions at the muscles, and tensions at the load."""
        spans = self.load.spans(state["load"], inputs)
        held = self.held_spans(spans, memory)
        tensions = {
            name: unit.tension(state["muscles"][name], memory["muscles"][name], self.gauge(state, name), *held[name])
            for name, unit in self.units.items()
        }
        felt = {n: unit.load_tension(memory["muscles"][n], tensions[n]) for n, unit in self.units.items()}
        return spans, tensions, felt

    def _felt(self, memory: Tree, motions: Mapping[str, BraidMotion]) -> dict[str, Scalar]:
        return {n: unit.load_tension(memory["muscles"][n], motions[n].tension) for n, unit in self.units.items()}

    def held_spans(self, spans: Mapping[str, SpanState], memory: Tree) -> dict[str, SpanState]:
        """Spans less what clamps have slipped, with their rates."""
        return {
            name: at._replace(span=self.units[name].held_span(memory["muscles"][name], at.span))
            for name, at in spans.items()
        }

    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of gas, muscles and load."""
        motions = self.motions(state, memory, inputs)
        held = self.held_spans(self.load.spans(state["load"], inputs), memory)
        muscles = {
            name: unit.rate(state["muscles"][name], motions[name], held[name].velocity)
            for name, unit in self.units.items()
        }
        gas = self.joined.rate(state["circuit"], memory["circuit"], self._with(motions, inputs))
        load = self.load.rates(state["load"], self._felt(memory, motions), inputs)
        return {"circuit": gas, "muscles": muscles, "load": load}

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """The circuit's accounts, those of exergy with them, and the powers of the mechanics [W].

        ``braid`` goes into the braids by their motion and ``filling`` by the gas, ``exchanged`` is the size of both,
        ``muscle_work`` is what the gas does in the muscles, the atmosphere's share included; ``delivered`` goes from the
        muscles into the load, ``outside`` enters the load from elsewhere, ``outside_turnover`` is its size; ``lost`` is
        turned into heat by dampers, of which ``viscous`` in the muscles and their tendons. The load's own follow with the
        prefix ``load.``. ``<muscle>.slack`` is 1 while that one is slack.
        """
        motions, joined = self.motions(state, memory, inputs), self.joined
        now = joined.passing(state["circuit"], memory["circuit"], self._with(motions, inputs))
        out = joined.crossing(now) | exergies(joined, now, self.environment)
        spans, felt = self.load.spans(state["load"], inputs), self._felt(memory, motions)
        held = self.held_spans(spans, memory)
        outside, lost = self.load.powers(state["load"], felt, inputs)
        braid, filling, exchanged, work, viscous, delivered = (jnp.zeros(()) for _ in range(6))
        for name, unit in self.units.items():
            at, gauge = motions[name], self.gauge(state, name)
            swelling = now.swelling(name)
            moved, filled = braid_tension(unit.law, at.length, gauge) * at.velocity, gauge * swelling
            braid, filling = braid + moved, filling + filled
            exchanged = exchanged + jnp.abs(moved) + jnp.abs(filled)
            work = work + state["circuit"]["pressure"][name] * swelling
            viscous = viscous + unit.lost(at, *held[name])
            delivered = delivered - felt[name] * spans[name].velocity
        powers = {
            "braid": braid,
            "filling": filling,
            "exchanged": exchanged,
            "muscle_work": work,
            "delivered": delivered,
        }
        outer = {"outside": outside, "outside_turnover": jnp.abs(outside), "lost": lost + viscous, "viscous": viscous}
        own = {f"load.{key}": value for key, value in self.load.accounts(state["load"], felt, inputs).items()}
        slack = {f"{name}.slack": jnp.where(at.tension > 0.0, 0.0, 1.0) for name, at in motions.items()}
        return out | powers | outer | own | slack

    def mechanical_energies(
        self, state: Tree, memory: Tree, inputs: Mapping[str, Value]
    ) -> tuple[Scalar, Scalar, Scalar]:
        """Energy of end masses and tendons, that of the load, and work that friction and creep took until now [J]."""
        motions = self.motions(state, memory, inputs)
        spans = self.held_spans(self.load.spans(state["load"], inputs), memory)
        moving = [u.kinetic_and_elastic(motions[n], spans[n].span) for n, u in self.units.items()]
        ledgers = [ledger for parts in memory["muscles"].values() for ledger in parts.values()]
        taken: Scalar = sum((ledger.work for ledger in ledgers), start=jnp.zeros(()))
        return sum(moving, start=jnp.zeros(())), self.load.stored_energy(state["load"]), taken

    def stored_energies(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Internal energy of the gas; that of the mechanics with what friction took [J]."""
        gas = self.joined.stored(state["circuit"], self.with_lengths(state, memory, inputs))[1]
        return {"gas": gas, "mechanics": sum(self.mechanical_energies(state, memory, inputs), start=jnp.zeros(()))}

    def balances(self, integrands: Tree) -> dict[str, Exchange]:
        """Of the gas, as `Circuit.balances` has it, and of the mechanics, both over the work exchanged with the braids."""
        exchanged = integrands["exchanged"]
        gas = self.circuit.balances(integrands)["gas"]._replace(turnover=exchanged)
        powers = integrands["outside"] - integrands["lost"] - integrands["braid"]
        return {"gas": gas, "mechanics": Exchange(powers, exchanged)}

    def slackness(self, integrands: Tree) -> tuple[Scalar, ...]:
        """Of each muscle."""
        return tuple(integrands[f"{name}.slack"] for name in self.units)

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Advance friction and creep along the path, and the memory of valves."""
        first, last = (self.motions(moment.state, memory, moment.inputs) for moment in (start, end))
        gas = self.joined.advance_memory(
            memory["circuit"],
            Moment(start.state["circuit"], self._with(first, start.inputs)),
            Moment(end.state["circuit"], self._with(last, end.inputs)),
            duration,
        )
        before, after = (self.load.spans(moment.state["load"], moment.inputs) for moment in (start, end))
        held = self.held_spans(after, memory)

        def tension(name: str) -> Callable[[Any], Scalar]:
            at, gauge = end.state["muscles"][name], self.gauge(end.state, name)
            return lambda kept: self.units[name].motion(at, kept, gauge, *held[name]).tension

        muscles = {
            name: unit.advance_memory(
                memory["muscles"][name],
                MusclePath(
                    last[name].length - first[name].length,
                    after[name].span - before[name].span,
                    self.gauge(start.state, name),
                    self.gauge(end.state, name),
                    tension(name),
                    0.0 if unit.tendon is None else after[name].span - last[name].length - unit.tendon.slack_length,
                ),
                duration,
            )
            for name, unit in self.units.items()
        }
        return {"circuit": gas, "muscles": muscles}

    def overloaded(self, outputs: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Whether each muscle is longer than its threads bear."""
        lengths = {name: outputs[f"{name}.length"] for name in self.units if f"{name}.length" in outputs}
        return {name: length > self.units[name].breaking_length() for name, length in lengths.items()}

    def admissible(self, state: Tree) -> Scalar:
        """Whether every volume holds gas above vacuum."""
        return self.joined.admissible(state["circuit"])

    def max_rate_bound(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Scalar:
        """The circuit's bound, that of each muscle by itself, and that of the load which they hold [1/s].

        A muscle with a tendon has the mode of the tendon on its end mass; a tied one the creep of the slack braid, and it
        holds the load as stiffly as its law, its gas shut in and its friction stuck.
        """
        motions, joined = self.motions(state, memory, inputs), self.joined
        with_lengths = self._with(motions, inputs)
        bounds = [joined.max_rate_bound(state["circuit"], memory["circuit"], with_lengths)]
        volumes, restraints = joined.volumes(state["circuit"], with_lengths), {}
        for name, unit in self.units.items():
            gauge = self.gauge(state, name)
            stiff = joined.gas.heat_ratio * state["circuit"]["pressure"][name] / volumes[name].value
            restraints[name], bound = unit.restraint(motions[name], gauge, stiff)
            bounds.append(bound)
            if unit.end_mass is not None:  # on which the tendon's loss acts too, the more the tighter it is
                bounds.append(mode_bound(unit.end_mass, *restraints[name]))
        return jnp.stack([*bounds, self.load.max_rate_bound(state["load"], restraints)]).max()

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Outputs of the circuit, of each muscle, and of the load.

        A muscle has its span, length and their rates, tension at its end and at the load, friction, gauge pressure, volume
        and whether it is slack (1 or 0); one with a clamp has what that has slipped.
        """
        motions = self.motions(state, memory, inputs)
        out = self.joined.outputs(state["circuit"], memory["circuit"], self._with(motions, inputs))
        spans, felt = self.load.spans(state["load"], inputs), self._felt(memory, motions)
        for name, unit in self.units.items():
            at, gauge = motions[name], self.gauge(state, name)
            out |= {
                f"{name}.span": spans[name].span + jnp.zeros(()),
                f"{name}.span_velocity": spans[name].velocity + jnp.zeros(()),
                f"{name}.length": at.length,
                f"{name}.velocity": at.velocity,
                f"{name}.tension": at.tension,
                f"{name}.load_tension": felt[name],
                f"{name}.friction": unit.memory_force(memory["muscles"][name], at.velocity, gauge),
                f"{name}.pressure": gauge,
                f"{name}.volume": unit.law.braid_volume(at.length, gauge),
                f"{name}.slack": jnp.where(at.tension > 0.0, 0.0, 1.0),
            }
            if unit.clamp is not None:
                out[f"{name}.slip"] = memory["muscles"][name]["clamp"].state
        return out | {f"load.{k}": v for k, v in self.load.outputs(state["load"], felt, inputs).items()}
