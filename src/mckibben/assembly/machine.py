"""Circuit, muscles and load as one state equation, with the accounts of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from ..components import Environment, Scalar
from ..components.system import Moment, System
from ..engine.signals import Value
from ..errors import InputError
from ..pneumatics.circuit import Circuit
from ..pneumatics.volume import MovingVolume
from .loads import Load, SpanState
from .muscle_unit import MuscleUnit


class Machine(System):
    """What moves: use `Machine.of`, which checks that its parts fit.

    The circuit's node of a muscle has the muscle's name, and its length is the signal ``<muscle>.length``, which the state
    gives here. All other inputs are signals by name.
    """

    circuit: Circuit
    units: dict[str, MuscleUnit]
    load: Load
    environment: Environment

    @classmethod
    def of(
        cls, circuit: Circuit, units: Mapping[str, MuscleUnit], load: Load, environment: Environment | None = None
    ) -> Machine:
        """Join the parts.

        Raises:
            InputError: if a muscle has no node in the circuit, or the load does not hold exactly these muscles.
        """
        for name in units:
            node = circuit.nodes.get(name)
            if not isinstance(node, MovingVolume) or node.signal != f"{name}.length":
                raise InputError(name, "no moving volume", f"the circuit needs a node {name} of its volume and length")
        if set(load.muscles()) != set(units):
            raise InputError("load", ", ".join(load.muscles()), f"it must hold {', '.join(units)}")
        return cls(circuit, dict(units), load, environment or Environment())

    def initial(self, pressures: Mapping[str, float], inputs: Mapping[str, Value]) -> tuple[Any, Any]:
        """State and memory at rest.

        Args:
            pressures: absolute pressure of every volume of the circuit [Pa].
            inputs: values of the signals at the start.
        """
        load = self.load.initial()
        spans = self.load.spans(load, inputs)
        ambient = float(self.environment.pressure_abs)
        states = {
            name: unit.equilibrium(float(spans[name].span), float(pressures[name]) - ambient)
            for name, unit in self.units.items()
        }
        seen = self.with_lengths({"muscles": states}, inputs)
        circuit = self.circuit.at_rest(pressures, seen, float(self.environment.temperature))
        memory = {
            "circuit": self.circuit.initial_memory(circuit, seen),
            "muscles": {name: unit.initial_memory() for name, unit in self.units.items()},
        }
        return {"circuit": circuit, "muscles": states, "load": load}, memory

    def with_lengths(self, state: Any, inputs: Mapping[str, Any]) -> dict[str, Any]:
        """The inputs, and beside them the lengths of the muscles, as the circuit needs them."""
        return {**inputs, **{f"{name}.length": Value(*state["muscles"][name]) for name in self.units}}

    def _gauge(self, state: Any, name: str) -> Scalar:
        return state["circuit"]["pressure"][name] - self.environment.pressure_abs

    def _pulls(self, state: Any, inputs: Any) -> tuple[dict[str, SpanState], dict[str, Scalar], dict[str, Scalar]]:
        """Spans, tensions at the muscles, and tensions at the load."""
        spans = self.load.spans(state["load"], inputs)
        own = {n: unit.tension(state["muscles"][n], *spans[n]) for n, unit in self.units.items()}
        return spans, own, {n: unit.load_tension(own[n], spans[n].velocity) for n, unit in self.units.items()}

    def rate(self, state: Any, memory: Any, inputs: Any) -> Any:
        """Rates of gas, muscles and load."""
        _, own, felt = self._pulls(state, inputs)
        muscles = {
            name: unit.rate(state["muscles"][name], memory["muscles"][name], self._gauge(state, name), own[name])
            for name, unit in self.units.items()
        }
        gas = self.circuit.rate(state["circuit"], memory["circuit"], self.with_lengths(state, inputs))
        return {"circuit": gas, "muscles": muscles, "load": self.load.rates(state["load"], felt, inputs)}

    def integrands(self, state: Any, memory: Any, inputs: Any) -> Any:
        """The circuit's accounts, and the powers in the mechanics [W]: into the braids, the outside's, and what is lost."""
        seen = self.with_lengths(state, inputs)
        out = dict(self.circuit.integrands(state["circuit"], memory["circuit"], seen))
        gas = self.circuit.rate(state["circuit"], memory["circuit"], seen)["pressure"]
        spans, _, felt = self._pulls(state, inputs)
        outside, lost = self.load.powers(state["load"], felt, inputs)
        braid, filling = jnp.zeros(()), jnp.zeros(())
        for name, unit in self.units.items():
            at = state["muscles"][name]
            gauge = self._gauge(state, name)
            braid = braid + unit.law.braid_tension(at.length, gauge) * at.velocity
            filling = filling + gauge * self.circuit.swelling(name, state["circuit"], seen, gas[name])
            lost = lost + unit.lost(at, *spans[name])
        return out | {"braid": braid, "filling": filling, "outside": outside, "lost": lost}

    def slide(self, memory: Any, start: Moment, end: Moment, duration: Any) -> Any:
        """Friction and creep along the piece of path, and the memory of valves."""
        gas = self.circuit.slide(
            memory["circuit"],
            Moment(start.state["circuit"], self.with_lengths(start.state, start.inputs)),
            Moment(end.state["circuit"], self.with_lengths(end.state, end.inputs)),
            duration,
        )
        muscles = {
            name: unit.slide(
                memory["muscles"][name],
                end.state["muscles"][name].length - start.state["muscles"][name].length,
                self._gauge(start.state, name),
                self._gauge(end.state, name),
                duration,
            )
            for name, unit in self.units.items()
        }
        return {"circuit": gas, "muscles": muscles}

    def steepest_rate(self, state: Any, memory: Any, inputs: Any) -> Scalar:
        """The circuit's bound, and that of each taut tendon on its end mass [1/s]."""
        bounds = [self.circuit.steepest_rate(state["circuit"], memory["circuit"], self.with_lengths(state, inputs))]
        bounds += [jnp.sqrt(unit.tendon.stiffness / unit.end_mass) for unit in self.units.values()]
        return jnp.stack(bounds).max()

    def outputs(self, state: Any, memory: Any, inputs: Any) -> dict[str, Any]:
        """Of the circuit, of each muscle (span, length, tension, friction, pressure, volume, slack), and of the load."""
        out = self.circuit.outputs(state["circuit"], memory["circuit"], self.with_lengths(state, inputs))
        spans, own, felt = self._pulls(state, inputs)
        for name, unit in self.units.items():
            at, gauge = state["muscles"][name], self._gauge(state, name)
            out |= {
                f"{name}.span": spans[name].span + jnp.zeros(()),
                f"{name}.span_velocity": spans[name].velocity + jnp.zeros(()),
                f"{name}.length": at.length,
                f"{name}.velocity": at.velocity,
                f"{name}.tension": own[name],
                f"{name}.load_tension": felt[name],
                f"{name}.friction": unit.memory_force(memory["muscles"][name], at, gauge),
                f"{name}.pressure": gauge,
                f"{name}.volume": unit.law.braid_volume(at.length, gauge),
                f"{name}.slack": jnp.where(own[name] > 0.0, 0.0, 1.0),
            }
        return out | {f"load.{k}": v for k, v in self.load.outputs(state["load"], felt, inputs).items()}
