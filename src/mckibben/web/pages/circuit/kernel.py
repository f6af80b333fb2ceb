"""The response of a circuit by a native kernel: one compilation per topology, then a few milliseconds per change.

A kernel takes the circuit's values, signals and start pressures, and makes state and memory itself. It is the engine's own
march, so that it gives what the command line gives, and keeps the integrals that its accounts are balanced with.
"""

from __future__ import annotations

import functools
import threading
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from ....assembly.circuit_file import CircuitPlan
from ....components.system import Moment, System
from ....engine.integration import ATTEMPTS, MOST_PARTS, ROS2_LIMIT, march
from ....engine.native import EngineFunction, compile_function
from ....engine.rates import RK4_LIMIT
from ....errors import ConvergenceError
from ....pneumatics.balance import RunBalance, balance
from ....pneumatics.circuit import Circuit

MOST = 24  # kernels that are kept
_kept: OrderedDict[Any, EngineFunction] = OrderedDict()
_locks: dict[Any, threading.Lock] = {}
_guard = threading.Lock()


RATE = "steepest rate"  # beside the outputs of a circuit [1/s]


class Method(NamedTuple):
    """How a circuit is integrated: by the stiff method, and into how many parts its step is split."""

    stiff: bool = False
    split: int = 1


def method_of(rate: float, step: float, stiff: bool = False) -> Method:
    """The method that the engine chooses at a rate [1/s] and a step [s]."""
    if not stiff and rate * step <= RK4_LIMIT:
        return Method()
    return Method(True, min(MOST_PARTS, max(1, int(np.ceil(rate * step / ROS2_LIMIT)))) if np.isfinite(rate) else 1)


class Watched(System):
    """A circuit that also tells its steepest rate at every sample, by which the method is chosen."""

    circuit: Circuit

    def rate(self, state: Any, memory: Any, inputs: Any) -> Any:
        """Of the circuit."""
        return self.circuit.rate(state, memory, inputs)

    def integrands(self, state: Any, memory: Any, inputs: Any) -> Any:
        """Of the circuit."""
        return self.circuit.integrands(state, memory, inputs)

    def advance_memory(self, memory: Any, start: Moment, end: Moment, duration: Any) -> Any:
        """Of the circuit."""
        return self.circuit.advance_memory(memory, start, end, duration)

    def commands(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Of the circuit."""
        return self.circuit.commands(signals)

    def outputs(self, state: Any, memory: Any, inputs: Any) -> dict[str, Any]:
        """Of the circuit, and `RATE`."""
        steepest = self.circuit.max_rate_bound(state, memory, inputs)
        return {**self.circuit.outputs(state, memory, inputs), RATE: steepest}


class Response(NamedTuple):
    """The outputs of a circuit by name, each (samples + 1,), pressures absolute; the method, and what the accounts need."""

    outputs: dict[str, np.ndarray]
    method: Method
    start: Any
    end: Any
    integrals: Any


def respond(plan: CircuitPlan, method: Method | None = None) -> Response:
    """What a circuit does.

    Args:
        plan: of the circuit.
        method: to begin with; another is taken where the rates that were met ask for it.

    Raises:
        ConvergenceError: the state is not finite.
    """
    given, method = _given(plan), method or Method()
    for _ in range(ATTEMPTS):
        seen, start, end, integrals = _kernel(plan, given, method)(*given)
        found: dict[str, np.ndarray] = dict(seen)
        rate = float(np.max(found.pop(RATE)))
        sound = all(np.isfinite(values).all() for values in found.values())
        needed = method_of(rate if np.isfinite(rate) and sound else float("inf"), plan.inner_step, method.stiff)
        if sound and needed.stiff <= method.stiff and needed.split <= method.split:
            return Response(found, method, start, end, integrals)
        if needed == method:
            break
        method = needed
    if sound:
        return Response(found, method, start, end, integrals)
    raise ConvergenceError("the state is not finite any more: a value is far out of range, or the step is too long")


def ready(plan: CircuitPlan, method: Method | None = None) -> bool:
    """Whether the kernel of a topology is compiled."""
    return _key(plan, _given(plan), method or Method()) in _kept


def _given(plan: CircuitPlan) -> tuple[Any, ...]:
    room = plan.environment
    pressures = {n: np.asarray(p + float(room.pressure_abs)) for n, p in plan.starts.items()}
    return plan.circuit, plan.inputs(), pressures, np.asarray(float(room.temperature))


def _key(plan: CircuitPlan, given: Any, method: Method) -> Any:
    shapes = tuple(np.shape(leaf) for leaf in jax.tree.leaves(given))
    return jax.tree.structure(given), shapes, plan.period, plan.inner_step, plan.samples, method


def _kernel(plan: CircuitPlan, given: Any, method: Method) -> EngineFunction:
    key = _key(plan, given, method)
    with _guard:
        lock = _locks.setdefault(key, threading.Lock())
    with lock:
        if key not in _kept:
            function = functools.partial(
                _outputs, period=plan.period, inner=max(1, round(plan.period / plan.inner_step)) * method.split,
                samples=plan.samples, stiff=method.stiff,
            )  # fmt: skip
            made = compile_function(function, *given, title="circuit")
            made(*given)  # machine code is made at the first call
            with _guard:
                _kept[key] = made
                while len(_kept) > MOST:
                    _locks.pop(_kept.popitem(last=False)[0], None)
        with _guard:
            _kept.move_to_end(key)
            return _kept[key]


def _outputs(circuit: Any, signals: Any, pressures: Any, temperature: Any, *, period: float, inner: int, samples: int,
             stiff: bool) -> Any:  # fmt: skip
    first = {n: s.at(0, 0.0, period) for n, s in signals.items()}
    state = circuit.at_rest(pressures, first, temperature)
    memory = circuit.initial_memory(state, first)
    carry, kept = march(Watched(circuit=circuit), state, memory, signals, period, inner, samples, stiff)
    return kept[2], state, carry[0], carry[2]


def accounts(plan: CircuitPlan, done: Response) -> RunBalance:
    """How well mass and energy of a response balance, over what went through."""
    signals, count = plan.inputs(), plan.samples
    first = {n: s.at(0, 0.0, plan.period) for n, s in signals.items()}
    last = {n: s.at(count - 1, 1.0, plan.period) for n, s in signals.items()}
    sums = jax.tree.map(float, done.integrals)
    return balance(plan.circuit, done.start, done.end, first, last, sums)
