"""Stiffness of a muscle and of a joint at a point: of a short, quick stretch or a relaxed one, with gas shut in or held.

    k = dF/dL + dF/dP' dP'/dL + k_z         in series with a tendon, where there is one: k k_t/(k + k_t)

Shut in, the gas answers with its heat model (P V^n constant, n = gamma for a quick stretch with a wall); held, the pressure
stays. A short stretch finds the elements of friction and creep stuck, each with its spring k_z; in a long and slow one they
slip and relax, and only the braid is left. For a joint K = dM/dq of what resists: sum r_i^2 k_i - sum dr_i/dq T_i, and the
joint's own springs, stops and weight. Range: taut muscles; the gas in the muscle with its half of
the tube is shut in; a bone that it lies over is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .._jax import Tree, jax, jnp
from ..components import Scalar, derivative
from ..components.system import Value
from ..errors import InputError
from ..pneumatics.heat import Inflow, VolumeState
from .loads import JointLoad
from .machine import Machine
from .muscle_unit import memory_stiffness


class Stiffness(NamedTuple):
    """Four stiffnesses [N/m] of a muscle, or [N m/rad] of a joint; floats, or traced where the state is."""

    short_at_mass: Scalar
    short_at_pressure: Scalar
    relaxed_at_mass: Scalar
    relaxed_at_pressure: Scalar


def braid_stiffness(
    machine: Machine, state: Tree, memory: Tree, inputs: Mapping[str, Value], name: str, *, mass: bool
) -> Scalar:
    """Stiffness of the braid with its gas [N/m], with the mass of the gas constant or with its pressure."""
    unit = machine.units[name]
    length, gauge = machine.motions(state, memory, inputs)[name].length, machine.gauge(state, name)
    stiff = unit.law.braid_stiffness(length, gauge)
    if not mass:
        return stiff
    per_pressure = derivative(lambda p: unit.law.braid_tension(length, p), gauge)
    return stiff + per_pressure * _pressure_slope(machine, state, memory, inputs, name)


def _pressure_slope(machine: Machine, state: Tree, memory: Tree, inputs: Mapping[str, Value], name: str) -> Scalar:
    """dP/dL of the gas shut into a muscle and stretched quickly, by its heat model [Pa/m]."""
    circuit, with_lengths = machine.joined, machine.with_lengths(state, memory, inputs)
    node: Any = circuit.nodes[name]
    p, m = state["circuit"]["pressure"][name], state["circuit"]["mass"][name]
    temperature = circuit.outputs(state["circuit"], memory["circuit"], with_lengths)[f"{name}.temperature"]
    moved = node.volume(p, with_lengths[f"{name}.length"].value, 1.0)
    whole = m * circuit.gas.gas_constant * temperature / p  # with the fittings and the tube's share
    closed = Inflow(jnp.zeros(()), jnp.zeros(()))

    def rate(moving: Any) -> Scalar:
        volume = VolumeState(whole, moved.per_pressure, moving)
        flow: Scalar = node.heat.rates(circuit.gas, p, temperature, volume, closed)[0]
        return flow

    return rate(moved.moving) - rate(jnp.zeros(()))  # without what a wall's heat does meanwhile


def muscle_stiffness(machine: Machine, state: Tree, memory: Tree, inputs: Mapping[str, Value], name: str) -> Stiffness:
    """Stiffness of a muscle, with its tendon if it has one, at a point [N/m]; zero where it is slack.

    Raises:
        InputError: if there is no such muscle.
    """
    if name not in machine.units:
        raise InputError("muscle", name, known=machine.units, where="stiffness")
    unit, motion = machine.units[name], machine.motions(state, memory, inputs)[name]
    stuck = memory_stiffness(unit, machine.gauge(state, name))
    span = machine.held_spans(machine.load.spans(state["load"], inputs), memory)[name].span
    cord = None if unit.tendon is None else derivative(unit.tendon.force, span - motion.length)

    def seen(short: bool, mass: bool) -> Scalar:
        stiffness = braid_stiffness(machine, state, memory, inputs, name, mass=mass) + (stuck if short else 0.0)
        if cord is None:
            return jnp.where(motion.tension > 0.0, stiffness, 0.0)
        return jnp.where(cord > 0.0, stiffness * cord / jnp.where(cord > 0.0, stiffness + cord, 1.0), 0.0)

    return _told(seen(True, True), seen(True, False), seen(False, True), seen(False, False))


def joint_stiffness(machine: Machine, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Stiffness:
    """Stiffness of a joint against turning at a point [N m/rad], with all its muscles and what the joint itself has.

    Raises:
        InputError: if the machine's load is no joint.
    """
    load = machine.load
    if not isinstance(load, JointLoad):
        raise InputError("load", type(load).__name__, "must be a JointLoad", where="stiffness")
    _, _, felt = machine.pulls(state, memory, inputs)
    angle = state["load"].angle

    def moment(q: Any) -> Any:
        return load.inertia * load.rates(state["load"]._replace(angle=q), felt, inputs).velocity

    geometric = -jax.jvp(moment, (angle,), (jnp.ones_like(angle),))[1]  # arms that change under the tensions are in it
    parts = [muscle_stiffness(machine, state, memory, inputs, name) for name in load.arms]
    arms = [arm.arm(angle) ** 2 for arm in load.arms.values()]
    return _told(*(geometric + sum(a * k[i] for a, k in zip(arms, parts, strict=True)) for i in range(4)))


def _told(*value: Any) -> Stiffness:
    return Stiffness(*(x if isinstance(x, jax.core.Tracer) else float(x) for x in value))
