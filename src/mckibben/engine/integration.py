"""Fixed-step integration on a sample clock.

The bench looks once per sample, the physics takes a whole number of steps between. Every run returns a result code with a
sentence; a single run raises on it, a batch never does.
"""

from __future__ import annotations

import enum
import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jax, jnp
from ..components.module import flatten, map_leaves
from ..components.system import System, Value
from ..errors import ConvergenceError, InputError
from .coupled import CoupledRun, find_groups
from .native import EngineFunction, call_compiled, call_in_lanes, compile_function
from .rates import RK4_LIMIT, fastest_rate
from .side_by_side import SideBySide, Split
from .signals import Signal
from .soundness import OF_STORES, OPEN, Soundness, balance_errors, overloaded_parts, unsound_sentence
from .step import outputs_of, step, zero_integrals

STEP = 50e-6  # default step of the physics [s]
# The Rosenbrock method is stable at any step, but a valve that chokes shows it nothing of the steep zone ahead: over a step
# longer than some 30 time constants of that zone it jumps across and back. Measured; see the test of a small pocket.
ROS2_LIMIT = 10.0
MOST_PARTS = 1024  # into which a wanted step is split for that
ATTEMPTS = 3  # runs, where a run meets faster modes than its start showed
COARSE = 1e-4  # longer steps of the Rosenbrock method, which is stable at any, are compared with half the step [s]
CHANGE = 0.05  # share of a channel's range by which half the step may change it
MOST_GROUPS = 8  # structures of coupled cells up to which they are evaluated as arrays
HALVINGS = 4  # of the step, where a balance does not close
PROBES = 256  # states at which the rates are examined


class Result(enum.Enum):
    """Result code of a run."""

    DONE = "The run reached its end."
    NOT_FINITE = "A state is not finite any more; a parameter or an input is far out of range."
    TOO_STIFF = "A mode of the system is too fast for this step."
    IMPOSSIBLE = "A state is beyond what the physics allows, such as a pressure below vacuum."
    TOO_COARSE = "Half the step gives another result."
    UNBALANCED = "An energy balance does not close."
    BROKEN = "A muscle is longer than its threads bear."


class Run(NamedTuple):
    """Result of a run.

    Attributes:
        time: time of the samples [s], (samples + 1,).
        outputs: by name, each (samples + 1, ...).
        state: the continuous state at the end.
        memory: the memory at the end.
        integrals: independent integrals over the whole run.
        result: result of it.
        message: the sentence, with the number that matters.
        fastest: fastest rate found along the run [1/s].
        stiff: whether the Rosenbrock method was used.
        step: step of the physics [s].
    """

    time: Any
    outputs: dict[str, Any]
    state: Any
    memory: Any
    integrals: Any
    result: Result
    message: str
    fastest: float
    stiff: bool
    step: float


def integrate(
    system: System,
    state: Tree,
    signals: Mapping[str, Signal],
    *,
    period: float,
    memory: Tree = (),
    step_size: float = STEP,
    method: str = "auto",
    raises: bool = True,
) -> Run:
    """Integrate over all samples of the signals; parts with dead time see theirs late, as in `march`.

    Args:
        system: the system to integrate.
        state: continuous state at the start, a tree of arrays.
        signals: inputs by name, all of one length.
        period: period of the samples [s].
        memory: memory at the start.
        step_size: largest step of the physics [s]; shortened so that a whole number fits a period, for the Rosenbrock method
            further where the system's rates ask for it, and halved where an energy balance does not close.
        method: ``rk4``, ``ros2``, or ``auto`` for the choice by the system's own rates.
        raises: raise on a result that is not `Result.DONE`.

    Raises:
        InputError: if the signals differ in length, or step or period are not positive.
        ConvergenceError: if the run failed; says why, and which step would be needed.
    """
    signals = system.commands(signals)
    samples = _samples(signals, period, step_size, method)
    inner = max(1, round(np.ceil(period / step_size - 1e-9)))
    h = period / inner
    first = _inputs(signals, 0, 0.0, period)
    # As many times as `_along` looks, so that one compilation serves both.
    many = min(samples, PROBES)

    def lead(tree: Tree) -> Tree:
        return map_leaves(lambda x: np.broadcast_to(np.asarray(x), (many, *np.shape(x))), tree)

    plan = _plan(fastest_rate(system, lead(state), lead(memory), lead(first)), h, method)
    for _ in range(ATTEMPTS):
        carry, kept = _run(system, state, memory, dict(signals), period, plan.split * inner, samples, plan.stiff)
        fastest = _along(system, kept, signals, period, samples)
        needed = _plan(fastest, h, method)
        if needed.split <= plan.split and needed.stiff <= plan.stiff:
            break
        plan = needed
    last = _inputs(signals, samples - 1, 1.0, period)
    ends = (state, memory, first), period * samples
    errors = _balance_errors(system, *ends, carry, last)
    for _ in range(HALVINGS):
        if not max(errors.values(), default=0.0) > OPEN:
            break
        plan = plan._replace(split=2 * plan.split)
        carry, kept = _run(system, state, memory, dict(signals), period, plan.split * inner, samples, plan.stiff)
        errors = _balance_errors(system, *ends, carry, last)
    stiff, h = plan.stiff, h / plan.split
    result, message = _judge(system, carry, kept, fastest, h, stiff)
    if result is Result.DONE and stiff and h > COARSE:
        half = _run(system, state, memory, dict(signals), period, 2 * plan.split * inner, samples, stiff)[1]
        result, message = _compared(kept[2], half[2], h)
    worst = max(errors, key=lambda name: errors[name], default="")
    if result is Result.DONE and worst and errors[worst] > OPEN:
        result, message = Result.UNBALANCED, unsound_sentence(OF_STORES[worst], errors[worst], h)
    run = Run(
        time=period * np.arange(samples + 1),
        outputs=kept[2],
        state=carry[0],
        memory=carry[1],
        integrals=carry[2],
        result=result,
        message=message,
        fastest=fastest,
        stiff=stiff,
        step=h,
    )
    if raises and result is not Result.DONE:
        raise ConvergenceError(message)
    return run


def _balance_errors(
    system: System, begin: tuple[Tree, Tree, Tree], duration: float, end: Tree, inputs: Tree
) -> dict[str, float]:
    """Errors of the balances of a run: (state, memory, inputs) at its start, the carry and the inputs at its end."""
    if type(system).balances is System.balances:
        return {}
    before, after = (call_compiled(_stored, system, *ends) for ends in (begin, (end[0], end[1], inputs)))
    errors = balance_errors(before, after, system.balances(end[2]), duration)
    return {name: float(error) for name, error in errors.items()}


def _stored(system: System, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
    """`System.stored_energies`."""
    return system.stored_energies(state, memory, inputs)


class _Plan(NamedTuple):
    """Whether the Rosenbrock method is used, and into how many parts the wanted step is split."""

    stiff: bool
    split: int


def _plan(rate: float, h: float, method: str) -> _Plan:
    stiff = method == "ros2" or (method == "auto" and rate * h > RK4_LIMIT)
    if not stiff or not np.isfinite(rate):
        return _Plan(stiff, 1)
    return _Plan(True, min(max(1, int(np.ceil(rate * h / ROS2_LIMIT))), MOST_PARTS))


def _run(
    system: System, state: Tree, memory: Tree, signals: Any, period: float, inner: int, samples: int, stiff: bool
) -> Any:
    arguments = system, state, memory, signals, np.float64(period), np.int64(inner)  # the number of steps is tried out
    return call_compiled(march, *arguments, samples=samples, stiff=stiff)


def march(
    system: System,
    state: Tree,
    memory: Tree,
    signals: Tree,
    period: Scalar,
    inner: int,
    samples: int,
    stiff: bool,
    *,
    integrals: bool = True,
) -> tuple[Tree, Tree]:
    """The run itself, unchecked: a pure function, to be compiled, mapped and differentiated.

    Args:
        system: the system to integrate.
        state: continuous state at the start.
        memory: memory at the start.
        signals: inputs by name; parts with dead time see theirs late, see `System.commands`.
        period: period of the samples [s].
        inner: steps per sample.
        samples: how many samples to go on for.
        stiff: use the Rosenbrock method.
        integrals: whether they are wanted; empty if not.

    Returns:
        (state, memory, integrals) at the end, and (states, memories, outputs) at all samples.
    """
    h, signals = period / inner, system.commands(signals)
    sums = zero_integrals(system, state, memory, _inputs(signals, 0, 0.0, period)) if integrals else ()

    def sample(carry: Tree, index: Scalar) -> tuple[Tree, Tree]:
        now = _inputs(signals, index, 0.0, period)
        sampled = carry[0], carry[1], outputs_of(system, carry[0], carry[1], now)

        def one(i: Any, c: Any) -> Any:
            begin, end = i / inner, (i + 1) / inner

            def inputs(share: Scalar) -> dict[str, Tree]:
                return {name: s.within(index, begin, end, share, period) for name, s in signals.items()}

            return step(system, c, inputs, h, stiff)

        return jax.lax.fori_loop(0, inner, one, carry), sampled

    carry, kept = jax.lax.scan(sample, (state, memory, sums), jnp.arange(samples))
    last = _inputs(signals, samples - 1, 1.0, period)
    end = carry[0], carry[1], outputs_of(system, carry[0], carry[1], last)
    return carry, jax.tree.map(lambda many, one: jnp.concatenate([many, jnp.asarray(one)[None]]), kept, end)


def compile_march(
    system: Tree,
    state: Tree,
    memory: Tree,
    signals: Mapping[str, Tree],
    *,
    period: float,
    inner: int,
    stiff: bool = False,
    outputs: Sequence[str] | None = None,
    engine: str = "auto",
) -> EngineFunction | SideBySide | CoupledRun:
    """The run of a system, called with (system, state, memory, signals); see `march`.

    A system that has many parts of one structure, see `System.parts`, is not compiled as one long step: its parts are the
    lanes of the run of a single one. Where they act on each other by a core, see `System.coupling`, a step evaluates them
    as arrays.

    Args:
        system: an example, as the next three; parameters, states and signals are arguments of the run.
        state: continuous state at the start.
        memory: memory at the start.
        signals: inputs by name, whose length says how many samples there are.
        period: period of the samples [s].
        inner: steps per sample.
        stiff: use the Rosenbrock method.
        outputs: names of the outputs that are wanted, all by default: what nobody asks for is not computed.
        engine: see `native.compile_function`.

    Returns:
        What returns the outputs by name, each (samples + 1, lanes).
    """
    samples = min(len(s.values) for s in signals.values()) - 1
    options: dict[str, Any] = {"period": period, "inner": inner, "samples": samples, "stiff": stiff}
    arguments = system, state, memory, dict(signals)
    wanted = None if outputs is None else tuple(outputs)
    split = Split.of(arguments)
    if split is not None:
        return SideBySide(split, functools.partial(_outputs, **options), wanted, engine)
    coupling = None if stiff else system.coupling()
    groups = None if coupling is None else find_groups(coupling, arguments)
    if coupling is not None and groups is not None and len(groups) <= MOST_GROUPS:
        return CoupledRun(coupling, groups, arguments, functools.partial(_outputs, **options), wanted, engine)
    function = functools.partial(_outputs, **options, outputs=wanted)
    return compile_function(function, *arguments, engine=engine, title=type(system).__name__)


def _outputs(
    system: Tree,
    state: Tree,
    memory: Tree,
    signals: Any,
    *,
    period: float,
    inner: int,
    samples: int,
    stiff: bool,
    outputs: Any,
) -> dict[str, Tree]:
    _, kept = march(system, state, memory, signals, period, inner, samples, stiff, integrals=False)
    if outputs is None:
        return dict(kept[2])
    for name in outputs:
        if name not in kept[2]:
            raise InputError("outputs", name, known=kept[2])
    return {name: kept[2][name] for name in outputs}


def _inputs(signals: Any, index: Scalar, share: Scalar, period: Scalar) -> dict[str, Tree]:
    return {name: s.at(index, share, period) for name, s in signals.items()}


def _samples(signals: Mapping[str, Signal], period: float, step_size: float, method: str) -> int:
    if not (period > 0.0 and np.isfinite(period)):
        raise InputError("period", period, "must be a time above 0 s")
    if not (step_size > 0.0 and np.isfinite(step_size)):
        raise InputError("step_size", step_size, "must be a time above 0 s")
    if method not in ("auto", "rk4", "ros2"):
        raise InputError("method", method, known=("auto", "rk4", "ros2"))
    lengths = {name: len(s.values) for name, s in signals.items()}
    if not lengths:
        raise InputError("signals", None, "must be at least one, which says how long to run")
    if len(set(lengths.values())) > 1 or min(lengths.values()) < 2:
        raise InputError("signals", str(lengths), "must be equal lengths of two samples or more")
    return min(lengths.values()) - 1


def _along(system: System, kept: Any, signals: Mapping[str, Signal], period: float, samples: int) -> float:
    """Fastest rate at states spread over the run."""
    at = np.unique(np.linspace(0, samples - 1, min(samples, PROBES)).astype(int))

    def pick(tree: Tree) -> Tree:
        return map_leaves(lambda x: np.asarray(x)[at], tree)

    stacked = {n: [signal.at(i, 0.0, period) for i in at] for n, signal in signals.items()}
    inputs = {n: map_leaves(lambda *x: np.stack([np.asarray(v) for v in x]), *some) for n, some in stacked.items()}
    return fastest_rate(system, pick(kept[0]), pick(kept[1]), inputs)


def _judge(system: System, carry: Tree, kept: Any, fastest: float, h: float, stiff: bool) -> tuple[Result, str]:
    if not all(np.isfinite(leaf).all() for leaf in flatten((carry, kept[0]))[0]):
        return Result.NOT_FINITE, Result.NOT_FINITE.value
    limit = ROS2_LIMIT if stiff else RK4_LIMIT
    if fastest * h > limit * (1.0 + 1e-9):
        instead = "" if stiff else ", or the method ros2"
        need = limit / fastest
        return (
            Result.TOO_STIFF,
            f"{Result.TOO_STIFF.value} It needs {need:.3g} s or less instead of {h:.3g} s{instead}.",
        )
    if not np.all(call_in_lanes(_admissible, (system,), (kept[0],))):
        return Result.IMPOSSIBLE, f"{Result.IMPOSSIBLE.value} The step of {h:.3g} s is too long for it."
    if parts := overloaded_parts(system, kept[2]):
        return Result.BROKEN, unsound_sentence(Soundness.BROKEN, 0.0, h, parts)
    return Result.DONE, Result.DONE.value


def _admissible(system: System, state: Tree) -> Any:
    """`System.admissible`."""
    return system.admissible(state)


def _compared(outputs: Mapping[str, Any], halved: Mapping[str, Any], h: float) -> tuple[Result, str]:
    """Compare with half the step: a stable method hides a step that is too long for the physics."""
    worst, channel = 0.0, ""
    for name, values in outputs.items():
        size = float(np.ptp(halved[name]))
        off = float(np.abs(values - halved[name]).max())
        if size > 1e-9 * float(np.abs(halved[name]).max()) and not off <= worst * size:
            worst, channel = off / size, name
    if worst <= CHANGE:
        return Result.DONE, Result.DONE.value
    need = h * (CHANGE / worst) ** 0.5 if np.isfinite(worst) else 0.5 * h
    return (
        Result.TOO_COARSE,
        f"{Result.TOO_COARSE.value} {channel} changes by {100 * worst:.0f} % of its range; try {need:.2g} s or less "
        f"instead of {h:.3g} s.",
    )
