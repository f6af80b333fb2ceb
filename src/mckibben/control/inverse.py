"""The number that holds a machine on a wanted motion: the inverse of law, friction, creep and load, sample by sample.

    find u with  load(position, velocity, tensions(u)) at rest,   tensions(u) = law(span, P) + friction(z'(P)) + creep + c v
    P = offset + slope u of each actuator,   z' the memory advanced along the wanted motion

The memory is that of the wanted motion and not of the measured one, so that nothing is fed back. Newton's method, with
steps that stay within the limits: what no number within them does is done as far as they go. Range: tied muscles, one
output, motions slow enough that the inertia of the load does not count.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .._jax import Scalar, Tree, jax, jnp
from ..components import derivative
from ..components.system import Value
from ..engine.packed import Layout, compile_once
from ..errors import InputError
from .steps import clip
from .task import ControlTask

ITERATIONS = 5  # of Newton's method from the last number: three are enough; fewer are written out, and fill a board


class Inverse:
    """The inverse of a task's model.

    Args:
        task: what is driven.
        memory: whether friction and creep are inverted too; the static law alone otherwise.

    Attributes:
        actuators: offset [Pa] and slope [1] of each command, with its name.
        parts: the units by name, and the load.
        rest: their relaxed memory.

    Raises:
        InputError: the model has a tendon, whose stretch no such inverse knows.
    """

    def __init__(self, task: ControlTask, *, memory: bool = True) -> None:
        machine = task.model.machine
        if any(unit.tendon is not None for unit in machine.units.values()):
            raise InputError("task", None, "must be of muscles that are tied to their anchors: one has a tendon")
        units = {
            name: unit if memory else unit.with_fields(friction=None, creep=None)
            for name, unit in machine.units.items()
        }
        self.task, self.parts = task, (units, machine.load)
        self.rest = {
            name: {key: ledger.state for key, ledger in u.initial_memory().items()} for name, u in units.items()
        }
        self.actuators = tuple(task.actuators.items())
        self._relaxed, self._numbers = Layout.of(self.rest).pack(self.rest), np.zeros(6)
        self._memory, parts = self._relaxed.copy(), Layout.of(self.parts).pack(self.parts)
        run = compile_once(_of_numbers, (self.actuators,), self.parts, self.rest, self._numbers)
        self._call, (self._after, self._found) = run.bind(parts, self._memory, self._numbers)
        self._low, self._high = task.limits
        self.reset(0.0)

    def reset(self, output: float) -> float:
        """Begin at rest at an output, with relaxed memory; returns the number u that holds it [SI]."""
        self._memory[:], self._position = self._relaxed, self._field(output)
        self._number = 0.5 * (self._low + self._high)
        for _ in range(2):  # the second time from the number that holds it
            self.advance(output)
            self._memory[:] = self._relaxed
        return self._number

    def advance(self, output: float) -> float:
        """Go straight to an output within a sample [SI]; returns the number u at its end [SI]."""
        position = self._field(output)
        self._numbers[:] = position, self._position, self._number, self.task.period, self._low, self._high
        self._call()
        self._memory[:], self._number, self._position = self._after, float(self._found[0]), position
        return self._number

    def _field(self, output: float) -> float:
        """The value of the field of the observation at an output [SI]."""
        return self.task.zero + self.task.sign * output


def _of_numbers(actuators: Any, parts: Tree, memory: Tree, numbers: Tree) -> tuple[Tree, Scalar]:
    """`advance_inverse` of numbers in a vector."""
    return advance_inverse(actuators, parts, memory, *(numbers[i] for i in range(6)))


def advance_inverse(
    actuators: Any,
    parts: Tree,
    memory: Tree,
    to: Scalar,
    start: Scalar,
    before: Scalar,
    period: Scalar,
    low: Scalar,
    high: Scalar,
) -> tuple[Tree, Scalar]:
    """Go straight to a value of the field within a sample.

    Args:
        actuators: offset [Pa] and slope [1] of each command, with its name.
        parts: the units by name, and the load.
        memory: of their friction and creep.
        to: value of the field at the end [SI].
        start: value a sample ago.
        before: number u a sample ago [Pa].
        period: of the samples [s].
        low: smallest number [Pa].
        high: largest one.

    Returns:
        Memory and number at the end of the sample.
    """
    units, load = parts
    kind = type(load.initial())
    velocity, still = (to - start) / period, {name: Value(jnp.zeros(()), jnp.zeros(())) for name in load.signals()}
    here, there = load.spans(kind(to, velocity), still), load.spans(kind(start, velocity), still)

    def moved(number: Scalar) -> dict[str, Any]:
        states: dict[str, Any] = {}
        for name, (offset, slope) in actuators:
            path = here[name].span - there[name].span
            pressures = {"start_pressure": offset + slope * before, "end_pressure": offset + slope * number}
            states[name] = {
                key: part.advance(memory[name][key], path, **pressures, duration=period).state
                for key, part in units[name].parts.items()
            }
        return states

    def push(number: Scalar) -> Scalar:
        """Acceleration of the load [SI]."""
        states, tensions = moved(number), {}
        for name, (offset, slope) in actuators:
            unit, pressure, span = units[name], offset + slope * number, here[name]
            own = unit.law.braid_tension(span.span, pressure) + unit.damping(span.span) * span.velocity
            inner = (p.force(states[name][k], span.velocity, pressure) for k, p in unit.parts.items())
            tensions[name] = sum(inner, start=own)
        acceleration: Scalar = load.rates(kind(to, velocity), tensions, still)[1]
        return acceleration

    def nearer(_: Scalar, number: Scalar) -> Scalar:
        slope = derivative(push, number)
        return clip(number - push(number) / jnp.where(slope == 0.0, 1.0, slope), low, high)

    number = jax.lax.fori_loop(0, ITERATIONS, nearer, before)
    return moved(number), number
