"""Integration steps; no other module takes one.

Without memory: the classical Runge-Kutta method, order 4 on smooth problems. With memory (friction): symmetric splitting.
The memory is advanced through the first half of the step, the continuous state is stepped with the memory held, and the
memory is advanced through what remains. Order 2 holds with pressure-dependent yield because the first half is predicted
to second order, and the second takes what the step really moved less that prediction.

Stiff circuits: the two-stage Rosenbrock method ROS2 (order 2, L-stable, any Jacobian). Source: J. G. Verwer, E. J. Spee,
J. G. Blom and W. Hundsdorfer, SIAM J. Scientific Computing 20, 1999, doi:10.1137/S1064827597326651.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from .._jax import Scalar, Tree, flatten_util, jax, jit, jnp
from ..components.system import Moment, System, Value

# The classical Runge-Kutta method, a row per stage: how far along the last slope, at which share of the step, its weight.
TABLEAU = ((0.0, 0.0, 1.0 / 6.0), (0.5, 0.5, 1.0 / 3.0), (0.5, 0.5, 1.0 / 3.0), (1.0, 1.0, 1.0 / 6.0))
UNROLLED = 24  # states up to which the stages are written out: faster to run, slower to compile
GAMMA = 1.0 - 0.5**0.5  # of ROS2, the L-stable choice with small errors
Inputs = Callable[[Any], Any]  # share of the step -> inputs
Integrands = Callable[[System, Any, Any, Any], Any]  # of (system, state, memory, inputs)


# Traced once for all stages of a step, for all steps, and for every run of a system of this structure.
@jit
def rate_of(system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
    """`System.rate`."""
    return system.rate(state, memory, inputs)


@jit
def integrands_of(system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
    """`System.integrands`."""
    return system.integrands(state, memory, inputs)


@jit
def watched_of(system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
    """`System.balances` and `System.slackness` of the integrands; of these, a kernel computes what is needed for them."""
    integrands = system.integrands(state, memory, inputs)
    return system.balances(integrands), system.slackness(integrands)


@jit
def outputs_of(system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
    """`System.outputs`."""
    return system.outputs(state, memory, inputs)


def zero_integrals(
    system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value], of: Integrands = integrands_of
) -> Tree:
    """Integrals of a system before the first step: zeros."""
    shapes = jax.eval_shape(of, system, state, memory, inputs)
    return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)


@jit
def advance_memory_of(system: System, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
    """`System.advance_memory`."""
    return system.advance_memory(memory, start, end, duration)


def axpy(a: Scalar, x: Scalar, y: Scalar) -> Tree:
    """Add two trees: y + a x."""
    return jax.tree.map(lambda u, v: v + a * u, x, y)


def step(
    system: System,
    carry: tuple[Tree, Tree, Tree],
    inputs: Inputs,
    h: Scalar,
    stiff: bool,
    integrands: Integrands = integrands_of,
) -> tuple[Tree, Tree, Tree]:
    """Advance (continuous state, memory, integrals) by a time h [s].

    Args:
        system: the system to integrate.
        carry: the three trees; without numbers in the last, no integrals are taken.
        inputs: the inputs as a function of the share of the step, 0 to 1.
        h: duration of the step [s].
        stiff: use ROS2 instead of Runge-Kutta.
        integrands: what the integrals are of.
    """
    state, memory, sums = carry
    has_memory = bool(jax.tree.leaves(memory))
    middle = state
    if has_memory:
        first = rate_of(system, state, memory, inputs(0.0))
        middle = axpy(0.5 * h, rate_of(system, axpy(0.25 * h, first, state), memory, inputs(0.25)), state)
        memory = advance_memory_of(system, memory, Moment(state, inputs(0.0)), Moment(middle, inputs(0.5)), 0.5 * h)
    new, sums = (_ros2 if stiff else _rk4)(system, state, memory, sums, inputs, h, integrands)
    if has_memory:
        memory = advance_memory_of(system, memory, Moment(middle, inputs(0.5)), Moment(new, inputs(1.0)), 0.5 * h)
    return new, memory, sums


def _rk4(
    system: System, y: Scalar, z: Any, sums: Tree, inputs: Inputs, h: Scalar, integrands: Integrands
) -> tuple[Tree, Tree]:
    """Four stages; of a large system in a loop, which the compiler handles once instead of four times."""
    counted = bool(jax.tree.leaves(sums))

    def stage(carry: Tree, tableau: Any) -> tuple[Any, None]:
        k, change, sums = carry
        ahead, share, weight = tableau
        at = axpy(ahead * h, k, y)
        now = inputs(share)
        k = rate_of(system, at, z, now)
        if counted:
            sums = axpy(weight * h, integrands(system, at, z, now), sums)
        return (k, axpy(weight * h, k, change), sums), None

    carry = (*jax.tree.map(jnp.zeros_like, (y, y)), sums)
    if len(jax.tree.leaves(y)) > UNROLLED:
        carry, _ = jax.lax.scan(stage, carry, tuple(jnp.array(TABLEAU).T))
    else:
        for row in TABLEAU:
            carry, _ = stage(carry, row)
    return axpy(1.0, carry[1], y), carry[2]


def _ros2(
    system: System, y: Scalar, z: Any, sums: Tree, inputs: Inputs, h: Scalar, integrands: Integrands
) -> tuple[Tree, Tree]:
    flat, back = flatten_util.ravel_pytree(y)
    total, whole = flatten_util.ravel_pytree(sums)

    def rate(v: Any, share: float) -> Tree:
        return flatten_util.ravel_pytree(rate_of(system, back(v), z, inputs(share)))[0]

    def sum_rate(v: Any, share: float) -> Any:
        return flatten_util.ravel_pytree(integrands(system, back(v), z, inputs(share)))[0]

    first, rates = jax.linearize(lambda v: rate(v, 0.0), flat)
    matrix = jnp.eye(flat.size) - GAMMA * h * jax.vmap(rates, out_axes=1)(jnp.eye(flat.size))
    k1 = jnp.linalg.solve(matrix, first)
    ahead = flat + h * k1
    k2 = jnp.linalg.solve(matrix, rate(ahead, 1.0) - 2.0 * k1)
    new = back(flat + h * (1.5 * k1 + 0.5 * k2))
    if not total.size:
        return new, sums
    # The integrals are states too, whose rates depend on the others; so what is linear in them closes to rounding.
    begin, gains = jax.linearize(lambda v: sum_rate(v, 0.0), flat)
    s1 = begin + GAMMA * h * gains(k1)
    s2 = sum_rate(ahead, 1.0) - 2.0 * s1 + GAMMA * h * gains(k2)
    return new, whole(total + h * (1.5 * s1 + 0.5 * s2))
