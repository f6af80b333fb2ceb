"""Lanes at rest: what `Machine.initial` finds of one machine on the host, as a pure function that may be mapped.

A batch prepares thousands of machines, for which a root finder that is called from Python would cost more than their runs.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from ..assembly.machine import Machine
from ..assembly.muscle_unit import MuscleUnit, UnitState
from ..bench.hardware.plant import Rigged
from ..engine import sampled
from ..engine.signals import Signal, Value

HALVINGS = 64  # of a bracket: from any length to the last bit


def equilibrium(unit: MuscleUnit, span: Any, pressure: Any) -> UnitState:
    """As `MuscleUnit.equilibrium`, which says what it means; straight-line.

    Args:
        unit: the muscle.
        span: from the anchor to the load [m].
        pressure: gauge pressure [Pa].
    """

    def excess(length: Any) -> Any:
        return unit.law.braid_tension(length, pressure) - unit.tendon.force(span - length)

    shortest, longest = unit.law.length_range()
    hanging = span - unit.tendon.slack_length
    taut = (hanging > shortest) & (excess(hanging) >= 0.0)
    low = jnp.where(taut, shortest, jnp.maximum(shortest, hanging))
    high = jnp.where(taut, hanging, jnp.maximum(longest, hanging))

    def halve(_: int, ends: tuple[Any, Any]) -> tuple[Any, Any]:
        middle = 0.5 * (ends[0] + ends[1])
        above = excess(middle) > 0.0
        return jnp.where(above, ends[0], middle), jnp.where(above, middle, ends[1])

    ends = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
    found = 0.5 * (ends[0] + ends[1])
    length = jnp.where(excess(low) >= 0.0, low, jnp.where(excess(high) <= 0.0, high, found))
    return UnitState(length, jnp.zeros_like(length))


def initial(machine: Machine, pressures: dict[str, Any], inputs: dict[str, Value]) -> tuple[Any, Any]:
    """State and memory of a machine at rest, at absolute pressures [Pa]; unchecked."""
    load = machine.load.initial()
    spans = machine.load.spans(load, inputs)
    ambient = machine.environment.pressure_abs
    states = {n: equilibrium(u, spans[n].span, pressures[n] - ambient) for n, u in machine.units.items()}
    seen, joined = machine.with_lengths({"muscles": states}, inputs), machine.joined
    circuit = joined.at_rest(pressures, seen, machine.environment.temperature)
    memory = {
        "circuit": joined.initial_memory(circuit, seen),
        "muscles": {name: unit.initial_memory() for name, unit in machine.units.items()},
    }
    return {"circuit": circuit, "muscles": states, "load": load}, memory


def begin(plant: Rigged, software: Any, pressure: Any, depth: int, row: Any) -> sampled.Carry:
    """What goes into the first sample of a part, where a gauge pressure [Pa] has lasted; as `bench.part` begins one.

    Args:
        plant: the machine behind its converters.
        software: what commands it.
        pressure: in every volume, and asked of the valve [Pa].
        depth: of the history of commands, in samples.
        row: of a sample without noise.
    """
    commands = {"valve": pressure, "motor": jnp.zeros(()), "open": jnp.ones(())}
    held = {n: Signal(jnp.full((2,), v)) for n, v in plant.convert(commands).items()}
    inputs = {n: Value(s.values[0], jnp.zeros(())) for n, s in plant.commands(held).items()}
    room = plant.machine.environment.pressure_abs
    state, memory = initial(plant.machine, dict.fromkeys(plant.machine.circuit.chambers, room + pressure), inputs)
    seen = plant.seen(state, memory, inputs)
    whole = {"machine": state, "sensors": {n: s.initial(seen[n]) for n, s in plant.sensors.items()}}
    carry = sampled.rest(plant, (whole, memory), commands, depth)
    return sampled.with_software(plant, software, carry, row)
