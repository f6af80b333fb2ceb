"""Lanes at rest, at the first sample of a part: a pure function that may be mapped."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from ..bench.hardware.plant import InstrumentedPlant
from ..engine import sampled
from ..engine.signals import Signal, Value


def begin(plant: InstrumentedPlant, software: Any, pressure: Any, depth: int, row: Any) -> sampled.Carry:
    """What goes into the first sample of a part, where a gauge pressure [Pa] has lasted; as `bench.segment` begins one.

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
    state, memory = plant.machine.at_rest(dict.fromkeys(plant.machine.circuit.chambers, room + pressure), inputs)
    seen = plant.seen(state, memory, inputs)
    whole = {"machine": state, "sensors": {n: s.initial(seen[n]) for n, s in plant.sensors.items()}}
    carry = sampled.rest(plant, (whole, memory), commands, depth)
    return sampled.with_software(plant, software, carry, row)
