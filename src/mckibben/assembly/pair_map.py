"""Stiffness of a muscle and of a joint, of a short, quick stretch or a relaxed one, and the map of an antagonist pair.

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

import numpy as np

from .._jax import Array, Tree, jax, jnp
from ..components import GasState, Module, Scalar, derivative, jit_arrays
from ..components.system import Value
from ..errors import InputError
from ..pneumatics.volume import Inflow, VolumeState
from ..quantities import quantity, with_unit
from .loads import JointLoad
from .loads.joint import JointState
from .machine import Machine
from .muscle_unit import UnitState, memory_stiffness


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
    moved = node.volume_state(p, with_lengths[f"{name}.length"].value, 1.0)
    whole = m * circuit.gas.gas_constant * temperature / p  # with the fittings and the tube's share
    closed = Inflow(jnp.zeros(()), jnp.zeros(()))

    def rate(moving: Any) -> Scalar:
        volume = VolumeState(whole, moved.per_pressure, moving)
        flow: Scalar = node.heat.rates(GasState(p, temperature, circuit.gas), volume, closed)[0]
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


NAMES = ("flexor", "extensor")
ANGLES, LEVELS = 17, 9
FINE = 4  # solved pressures per level that is kept
NEWTON = 40  # steps; a dozen are enough where there is a solution
LONGEST, STEEPEST = 2e-3, 5e4  # of a Newton step [m], [Pa]
TIE = 1e5  # force that stands for a tied muscle's length being off its span [N/m]
LEFT = 1e-6  # share of the moments that may be left unbalanced


class PairPoint(NamedTuple):
    """State of a pair: common pressure, half the difference [Pa], moment per difference [N m/Pa], stiffness [N m/rad]."""

    common: Scalar
    difference: Scalar
    moment_per_difference: Scalar
    stiffness: Scalar


class PairMap(Module):
    """A table of points at rest: a row for each angle, of rising stiffness; straight between them.

        M(q, c + d, c - d) = 0,   K(q, c + d, c - d) = K*          c common to both muscles, d the difference

    M is the static moment about the joint, with its springs and weight; K is `joint_stiffness` with the pressures held
    and friction and creep relaxed, as a slow push finds it. For each of some angles the d is found that balances a
    common pressure, which gives a curve K(c) that is then read backwards. Between the points all is straight. Range:
    the angles asked for, both muscles taut, both pressures between the lowest and the highest; at each angle these
    leave a range of stiffness, and what is beyond gets its end. Halfway between the points of 17 angles and 9 levels, a
    pair of nylon muscles at 1.4 to 5 bar rests within 2 mrad of the angle. Bones that a muscle lies over are left out.
    """

    angles: Array = quantity("rad", (-10.0, 10.0), "angles of the rows, rising evenly; shape (m,)", symbol="q")
    stiffness: Array = quantity("N*m", (0.0, 1e6), "stiffness per rad, rising along a row; shape (m, n)", symbol="K")
    common: Array = quantity("Pa", (-1e5, 1e8), "mean gauge pressure of the two; shape (m, n)", symbol="c")
    difference: Array = quantity("Pa", (-1e8, 1e8), "flexor's pressure less the mean; shape (m, n)", symbol="d")
    moment_per_difference: Array = quantity("m^3", (-1e3, 1e3), "moment of a difference in Pa; shape (m, n)")

    def _row(self, table: Array, angle: Scalar) -> Array:
        apart = self.angles[1:2] - self.angles[0:1]
        low, high = self.angles[:1], self.angles[-1:]
        inside = jnp.where(angle < low, low, jnp.where(angle > high, high, angle))
        near = 1.0 - jnp.abs(inside - self.angles) / apart
        return jnp.sum(jnp.where(near > 0.0, near, 0.0)[:, None] * table, axis=0)

    def stiffness_range(self, angle: Scalar) -> tuple[Scalar, Scalar]:
        """Least and largest stiffness at an angle [N m/rad]."""
        row = self._row(self.stiffness, angle)
        return jnp.min(row), jnp.max(row)

    def at(self, angle: Scalar, stiffness: Scalar) -> PairPoint:
        """The point for an angle [rad] and a stiffness [N m/rad]; of what is out of range, the nearest."""
        row = self._row(self.stiffness, angle)
        share = (stiffness - row[:-1]) / (row[1:] - row[:-1])
        share = jnp.where(share < 0.0, 0.0, jnp.where(share > 1.0, 1.0, share))

        def along(table: Array) -> Scalar:
            values = self._row(table, angle)
            return jnp.sum(values[:1]) + jnp.sum(share * (values[1:] - values[:-1]))

        tables = (self.common, self.difference, self.moment_per_difference, self.stiffness)
        return PairPoint(*(along(table) for table in tables))


def pair_map(
    machine: Machine,
    *,
    lowest: float,
    highest: float,
    angles: tuple[float, float],
    rows: int = ANGLES,
    levels: int = LEVELS,
) -> PairMap:
    """The map of a pair whose muscles are called flexor and extensor.

    Args:
        machine: such as `build.antagonist_pair` makes; its signals count as zero.
        lowest: least gauge pressure of either muscle [Pa].
        highest: largest one [Pa].
        angles: first and last of the rows [rad].
        rows: number of angles, at least 2.
        levels: points along each row, at least 2.

    Raises:
        InputError: if the machine is no such pair, or at an angle no pressures balance it with both muscles taut.
    """
    if not isinstance(machine.load, JointLoad) or sorted(machine.units) != sorted(NAMES):
        raise InputError("machine", ", ".join(machine.units), f"must be a JointLoad with {' and '.join(NAMES)}")
    for name, low, high in (("highest", lowest, highest), ("angles", *angles)):
        if not low < high:
            raise InputError(name, high, f"must be more than {low:.6g}", where="pair map")
    inputs = {n: Value(jnp.zeros(()), jnp.zeros(())) for n in machine.signals()}
    room = float(machine.environment.pressure_abs)
    start = machine.initial(dict.fromkeys(machine.circuit.chambers, room + highest), inputs)
    places, commons = np.linspace(*angles, rows), np.linspace(lowest, highest, FINE * levels + 1)
    solved = jax.tree.map(np.asarray, _solved(machine, start, inputs, jnp.asarray(places), jnp.asarray(commons)))
    tables = [np.zeros((rows, levels)) for _ in PairPoint._fields]
    for i, angle in enumerate(places):
        apart = np.abs(solved.point.difference[i])
        good = solved.sound[i] & (commons + apart <= highest) & (commons - apart >= lowest)
        if np.sum(good) < 2:
            between = f"between {with_unit(lowest, 'Pa')} and {with_unit(highest, 'Pa')}"
            ends, at = " to ".join(with_unit(end, "rad") for end in angles), with_unit(float(angle), "rad")
            problem = f"of the pair's map are {ends}, but at {at} no pressures {between} balance the pair with both "
            problem += "muscles taut: a smaller moment arm, or muscles that pull alike, may help"
            raise InputError("angles", None, problem)
        kept = np.linspace(commons[good].min(), commons[good].max(), levels)
        for table, values in zip(tables, solved.point, strict=True):
            table[i] = np.interp(kept, commons[good], values[i][good])
    common, difference, per_difference, stiffness = tables
    if not (np.diff(stiffness, axis=1) > 0.0).all():
        worst = float(places[np.argmin(np.diff(stiffness, axis=1).min(axis=1))])
        raise InputError("stiffness", None, f"must rise, but falls with co-contraction at {worst:.4g} rad")
    return PairMap(
        angles=places, stiffness=stiffness, common=common, difference=difference, moment_per_difference=per_difference
    )


class _Found(NamedTuple):
    point: PairPoint
    sound: Any  # balanced, both muscles taut


@jit_arrays
def _solved(
    machine: Machine, start: tuple[Tree, Tree], inputs: Mapping[str, Value], angles: Scalar, common: Any
) -> _Found:
    """Points at rest for all angles (m,) and common pressures (n,), each (m, n)."""

    def one(angle: Scalar, mean: Any) -> _Found:
        return _at_rest(machine, start, inputs, angle, mean)

    return jax.vmap(jax.vmap(one, in_axes=(None, 0)), in_axes=(0, None))(angles, common)


def _at_rest(
    machine: Machine, start: tuple[Tree, Tree], inputs: Mapping[str, Value], angle: Scalar, mean: Any
) -> _Found:
    load: Any = machine.load
    joint = JointState(angle, jnp.zeros(()))
    spans = load.spans(joint, inputs)

    def pressures(x: Array) -> dict[str, Any]:
        return {"flexor": mean + x[2], "extensor": mean - x[2]}

    def pulls(x: Array) -> dict[str, tuple[Any, Any]]:
        """Tension of each muscle, and what its length is off by [N]."""
        gauge, out = pressures(x), {}
        for i, name in enumerate(NAMES):
            unit, beyond = machine.units[name], spans[name].span - x[i]
            braid = unit.law.braid_tension(x[i], gauge[name])
            if unit.tendon is None:
                out[name] = braid, TIE * beyond
            else:
                cord = unit.tendon.force(beyond)
                out[name] = cord, cord - braid
        return out

    def felt(x: Array) -> dict[str, Any]:
        return {name: pull for name, (pull, _) in pulls(x).items()}

    def excess(x: Array) -> Any:
        pull, residuals = felt(x), [off for _, off in pulls(x).values()]
        return jnp.stack([*residuals, load.inertia * load.rates(joint, pull, inputs).velocity])

    def closer(_: Any, x: Array) -> Any:
        step = jnp.linalg.solve(jax.jacfwd(excess)(x), -excess(x))
        most = jnp.array([LONGEST, LONGEST, STEEPEST])
        return x + jnp.where(step > most, most, jnp.where(step < -most, -most, step))

    cords = {n: machine.units[n].tendon for n in NAMES}
    taut = [spans[n].span - (0.0 if cord is None else cord.toe_length) for n, cord in cords.items()]
    x = jax.lax.fori_loop(0, NEWTON, closer, jnp.stack([*taut, jnp.zeros(())]))
    slopes, pull = jax.jacfwd(excess)(x), felt(x)
    yielding = jnp.linalg.solve(slopes[:2, :2], slopes[:2, 2])
    per_difference = slopes[2, 2] - slopes[2, :2] @ yielding  # tendons give a little
    begin, memory = start
    room = machine.environment.pressure_abs
    gas = {**begin["circuit"]["pressure"], **{n: room + p for n, p in pressures(x).items()}}
    state = {
        "circuit": {**begin["circuit"], "pressure": gas},
        "muscles": {
            n: machine.units[n].resting(UnitState(x[i], jnp.zeros(())), spans[n].span) for i, n in enumerate(NAMES)
        },
        "load": joint,
    }
    stiff = joint_stiffness(machine, state, memory, inputs).relaxed_at_pressure
    arms = sum(jnp.abs(load.arms[n].arm(angle)) * pull[n] for n in NAMES)
    left = jnp.abs(excess(x)) / jnp.stack([pull[n] for n in NAMES] + [arms])
    sound = jnp.isfinite(x).all() & (left < LEFT).all() & (pull["flexor"] > 0.0) & (pull["extensor"] > 0.0)
    return _Found(PairPoint(mean, x[2], per_difference, stiff), sound)
