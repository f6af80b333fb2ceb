"""The kernel of a muscle with gas, friction and a valve: its derivatives, and what becomes of it on a GPU."""

import re
from collections import Counter
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from lanewise import Program, lower, tangents, to_ptx
from mckibben.assembly.build import unit_from_specimen
from mckibben.assembly.loads import PlateLoad
from mckibben.assembly.machine import Machine
from mckibben.engine import held, march
from mckibben.engine.signals import Value
from mckibben.muscles.elements import Tendon
from mckibben.muscles.hysteresis import Dahl
from mckibben.muscles.hysteresis.slip import FrictionLimit
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.volume import MovingVolume, Reservoir, WallHeat

ROOM, TEMPERATURE = 101325.0, 293.15


@cache
def muscle() -> tuple[Machine, tuple[Any, Any]]:
    """The nylon muscle with gas, friction and a valve on a spring to a plate: (machine, (state, memory) at rest)."""
    one = unit_from_specimen("nylon").replace(
        friction=Dahl(limit=FrictionLimit(constant=0.5, per_pressure=4e-6), stiffness=2500.0),
        tendon=Tendon(stiffness=1500.0, slack_length=0.0, toe_length=5e-3, loss=0.2), end_mass=jnp.asarray(2.0),
        viscosity=jnp.asarray(5.0),
    )  # fmt: skip
    heat = WallHeat(conductance=0.2, wall_temperature=TEMPERATURE)
    nodes = {
        "supply": Reservoir(temperature=TEMPERATURE, signal="supply"),
        "m": MovingVolume(of=one.law.braid_volume, ambient=ROOM, dead_volume=1e-6, signal="m.length", heat=heat),
    }
    circuit = Circuit.of(nodes, {"m.valve": Branch(Orifice(conductance=4e-9), ("supply", "m"))})
    machine = Machine.of(circuit, {"m": one}, PlateLoad(held=("m",), span=0.16))
    return machine, machine.initial({"m": ROOM}, {"supply": Value(jnp.asarray(ROOM), jnp.zeros(()))})


SAMPLES = 40


def commands() -> np.ndarray:
    """Pressures of the supply [Pa], which press and let go."""
    return ROOM + 2.5e5 - 2.5e5 * np.cos(2.0 * np.pi * np.arange(SAMPLES + 1) / 20.0)


def run_of_muscle(machine: Any, state: Any, memory: Any, supply: Any) -> dict[str, Any]:
    """A run of 40 ms, as the outputs at 1 kHz."""
    _, kept = march(machine, state, memory, {"supply": held(supply)}, 1e-3, 4, SAMPLES, False)
    return {name: kept[2][name] for name in ("m.length", "m.pressure_abs")}


@cache
def muscle_program() -> Program:
    machine, (state, memory) = muscle()
    return lower(run_of_muscle, machine, state, memory, commands(), title="muscle")[0]


def muscle_values() -> list[Any]:
    """Arguments of `muscle_program`."""
    machine, (state, memory) = muscle()
    return [*jax.tree.leaves((machine, state, memory)), commands()]


def muscle_places() -> list[int]:
    names = [leaf.name for leaf in muscle_program().arguments]
    wanted = ("end_mass", "viscosity", "conductance", "dead_volume")
    return [next(k for k, n in enumerate(names) if n.endswith(w)) for w in wanted]


def test_tangents_of_a_muscle_are_differences_of_the_strict_kernel() -> None:
    program, values, places = muscle_program(), muscle_values(), muscle_places()
    seeds = [np.eye(4)[k] for k in range(4)]
    seeds = [
        s.reshape(4, *np.shape(values[p])) if np.size(values[p]) == 1 else s for s, p in zip(seeds, places, strict=True)
    ]
    found = tangents(program, places, 4).call([*values, *seeds])[2:]
    for k, place in enumerate(places):
        step = 1e-5 * float(np.ravel(values[place])[0])
        ends = []
        for sign in (1.0, -1.0):
            moved = list(values)
            moved[place] = np.asarray(values[place]) + sign * step
            ends.append(program.call(moved, mode="strict"))
        for tangent, high, low in zip(found, *ends, strict=True):
            rough = (high - low) / (2.0 * step)
            # central differences: rounding over the step, 1e-16 / 1e-5 of what changes little, and its square by curvature
            np.testing.assert_allclose(tangent[k], rough, rtol=0.0, atol=2e-4 * np.abs(rough).max())


def operations(program: Program) -> int:
    """Of the longest loop."""
    _, plan = program.prepared()
    return max(
        sum(n for op, n in Counter(getattr(e, "op", "store") for e in body).items() if op != "neg")
        for body in plan.bodies.values()
    )


def test_four_tangents_of_a_muscle_take_less_than_four_runs() -> None:
    # written out without shortening they take 5.3 times as many
    assert operations(tangents(muscle_program(), muscle_places(), 4)) < 3.5 * operations(muscle_program())


@pytest.mark.parametrize("real", ["float64", "float32"])
def test_on_a_gpu_the_state_of_a_muscle_stays_in_registers(real: str) -> None:
    names = [leaf.name for leaf in muscle_program().arguments if leaf.kind == "real"]
    text = to_ptx(muscle_program(), names, real=real)
    found = Counter(re.findall(r"^\s+(?:@!?%\w+ )?([a-z][\w.]*)", text, re.M))
    assert found[f"fma.rn.{'f64' if real == 'float64' else 'f32'}"] > 100
    assert not any(".local" in op or op.startswith(("ld.b", "st.b")) for op in found)  # no memory but the caller's
    assert real == "float64" or not any("f64" in op for op in found)
