"""A machine or a circuit near an operating point: its linear model, modes and bandwidth, found by automatic differentiation.

    dx/dt = A x + B u,   y = C x + D u          (all of them deviations)

The state counts mass and pressure of every volume, and where a volume is isothermal, polytropic or closed they are bound to
each other: such a machine has modes at zero that nothing excites. Memory cannot be linearised: friction is either held,
its force constant, as while it slides one way, or stuck, each element a spring, as in small motions about a point of rest.
Range: smooth points. At a kink, such as a regulator at its set-point, a closed valve or a tendon just slack, the model
holds on the side that the derivative of the formula takes; `Simulation.linearise` gives the gain of a stated amplitude. A
tied muscle that is taut has no state of its own.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, flatten_util, jax, jit, jnp
from ..engine.signals import Value
from ..errors import ConvergenceError, InputError, UnreachableError
from ..pneumatics.circuit import Circuit
from .machine import Machine
from .muscle_unit import TiedState, stuck_states

RATE_SUFFIX = ".rate"  # of an input's own rate of change, which a prescribed motion has beside its value
FLOOR = 1e-3  # a state smaller than this [SI] is measured against it
BEAT = 200.0  # brake of all motions while a machine settles [1/s]


class Names(NamedTuple):
    """Names of states, inputs and outputs, in the order of rows and columns."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


class Mode(NamedTuple):
    """A real mode, or a pair of complex ones: natural frequency [Hz], damping over critical [1], eigenvalue [1/s]."""

    frequency: float
    damping: float
    eigenvalue: complex


class LinearModel(NamedTuple):
    """A linear model; matrices as NumPy arrays in SI units, shapes (n, n), (n, m), (p, n), (p, m)."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    names: Names

    def eigenvalues(self) -> np.ndarray:
        """All eigenvalues [1/s], the slowest first."""
        values = np.linalg.eigvals(self.A)
        return np.asarray(values[np.argsort(np.abs(values))])

    def modes(self, slowest: float = 1e-3) -> list[Mode]:
        """The modes faster than `slowest` [1/s], a complex pair once, the slowest first."""
        return modes_of(self.eigenvalues(), slowest)

    def response(self, source: str, target: str, frequency: Scalar) -> np.ndarray:
        """Complex response of an output to an input [output/input] at frequencies [Hz], with the input's own rate.

        Raises:
            InputError: if the names are not among the model's, or the frequency is not above 0 Hz.
        """
        w = 2.0 * np.pi * np.atleast_1d(np.asarray(frequency, float))
        if not np.all(np.isfinite(w) & (w > 0.0)):
            raise InputError("frequency", str(frequency), "must be a frequency above 0 Hz", where="linear model")
        row, column = _find(target, self.names.outputs, "output"), _find(source, self.names.inputs, "input")
        s = 1j * w[:, None, None]
        b, d = self.B[:, [column]] + 0j, self.D[row, column] + 0j * s[:, 0, 0]
        b = np.broadcast_to(b, (w.size, *b.shape))
        if source + RATE_SUFFIX in self.names.inputs:
            also = self.names.inputs.index(source + RATE_SUFFIX)
            b, d = b + s * self.B[:, [also]], d + s[:, 0, 0] * self.D[row, also]
        states = np.linalg.solve(s * np.eye(self.A.shape[0]) - self.A, b)
        return np.asarray((self.C[[row]] @ states)[:, 0, 0] + d)

    def bandwidth(self, source: str, target: str, *, lowest: float = 0.01, highest: float = 1e3) -> float:
        """Lowest frequency [Hz] at which the response has fallen by 3 dB from its value at `lowest`.

        Raises:
            UnreachableError: if it does not fall so far up to `highest`, or nothing passes at `lowest`.
        """
        return bandwidth_of(
            functools.partial(self.response, source, target), f"{target} over {source}", lowest, highest
        )


def modes_of(eigenvalues: np.ndarray, slowest: float = 1e-3) -> list[Mode]:
    """The modes of eigenvalues that are faster than `slowest` [1/s], a complex pair once, in their order."""
    sizes = np.abs(eigenvalues)
    kept = (sizes > slowest) & (eigenvalues.imag >= -1e-9 * sizes)
    return [
        Mode(float(size / (2.0 * np.pi)), float(-value.real / size), complex(value))
        for value, size in zip(eigenvalues[kept], sizes[kept], strict=True)
    ]


def bandwidth_of(response: Callable[[Scalar], np.ndarray], what: str, lowest: float, highest: float) -> float:
    """Lowest frequency [Hz] at which a complex response has fallen by 3 dB from its value at `lowest`.

    Args:
        response: by frequency [Hz].
        what: the sentence calls it.
        lowest: where the search begins [Hz].
        highest: where it ends [Hz].

    Raises:
        UnreachableError: if it does not fall so far, or nothing passes at `lowest`.
    """
    from scipy.optimize import brentq

    grid = np.geomspace(lowest, highest, 2000)
    size = np.abs(response(grid))
    edge = size[0] / np.sqrt(2.0)
    below = np.flatnonzero(size < edge)
    if not (edge > 0.0 and below.size):
        raise UnreachableError(
            f"{what} does not fall by 3 dB between {lowest:g} and {highest:g} Hz; it is "
            f"{size[0]:.3g} at the one and {size[-1]:.3g} at the other"
        )
    i = int(below[0])
    excess = lambda f: float(np.abs(response(f))[0] - edge)  # noqa: E731
    return float(brentq(excess, grid[i - 1], grid[i], rtol=1e-10))


def linearise(
    machine: Machine | Circuit,
    state: Tree,
    memory: Tree,
    inputs: Mapping[str, Value],
    *,
    inputs_by_name: Sequence[str],
    outputs: Sequence[str],
    friction: str = "held",
) -> LinearModel:
    """The linear model about a point, which need not be at rest.

    Args:
        machine: the machine, or a circuit alone.
        state: continuous state at the point.
        memory: memory there.
        inputs: all signals there.
        inputs_by_name: the signals that are inputs of the model. One whose rate of change matters, as of a prescribed
            motion, brings a second column ``<name>.rate``.
        outputs: names as a recording has them.
        friction: ``held`` or ``stuck``, for friction, creep and wraps.

    Raises:
        InputError: names a signal or an output that the machine does not have, or an input on which nothing depends.
    """
    if friction not in ("held", "stuck"):
        raise InputError("friction", friction, "must be held or stuck", where="linearise")
    for name in inputs_by_name:
        _find(name, tuple(inputs), "input")
    known = tuple(jax.eval_shape(machine.outputs, state, memory, inputs))
    for name in outputs:
        _find(name, known, "output")
    values = jnp.array([[inputs[n].value, inputs[n].rate] for n in inputs_by_name], float).reshape(-1)
    names = tuple(inputs_by_name), tuple(outputs)
    (a, b), (c, d) = _jacobians(machine, state, memory, dict(inputs), values, *names, friction == "stuck")
    matrix, states = np.array(a), state_names(state)
    moving = _moving(machine, state, states)
    columns = [n + end for n in inputs_by_name for end in ("", RATE_SUFFIX)]
    into, through = np.array(b), np.array(d)
    acts = [bool(np.any(into[:, i]) or np.any(through[:, i])) for i in range(len(columns))]
    for k, name in enumerate(inputs_by_name):
        if not (acts[2 * k] or acts[2 * k + 1]):
            # Nothing depends on it, as on the command of a valve that takes it late by another name
            late = [other for other in inputs if other != name and other.startswith(f"{name}.")]
            would = f"; {', '.join(late)} would do" if late else ""
            raise InputError("input", name, f"moves nothing about this point{would}", where="linear model")
    kept = [i for i in range(len(columns)) if i % 2 == 0 or acts[i]]
    model_names = Names(tuple(states[i] for i in moving), tuple(columns[i] for i in kept), tuple(outputs))
    state_by_input = matrix[np.ix_(moving, moving)], into[np.ix_(moving, kept)]
    return LinearModel(*state_by_input, np.array(c)[:, moving], through[:, kept], model_names)


def _moving(machine: Machine | Circuit, state: Tree, states: tuple[str, ...]) -> list[int]:
    """Indices of all states but the sag of tied muscles that are taut."""
    units = machine.units if isinstance(machine, Machine) else {}
    taut = {
        f"muscles.{name}.sag"
        for name in units
        if isinstance(at := state["muscles"][name], TiedState) and float(at.sag) <= 0.0
    }
    return [i for i, name in enumerate(states) if name not in taut]


@functools.partial(jit, static_argnums=(5, 6, 7))
def _jacobians(
    machine: Machine | Circuit,
    state: Tree,
    memory: Tree,
    inputs: Mapping[str, Value],
    values: Scalar,
    sources: tuple[str, ...],
    outputs: tuple[str, ...],
    stuck: bool,
) -> Any:
    """Derivatives of (rate, outputs) by (state, inputs); what is stuck deflects with the braid, a wrap with the span."""
    flat, back = flatten_util.ravel_pytree(state)

    def stuck_at(at: Tree, now: Mapping[str, Value]) -> Tree:
        if not (stuck and isinstance(machine, Machine)):
            return memory
        spans, before = (machine.load.spans(*there) for there in ((at["load"], now), (state["load"], inputs)))
        muscles = {}
        for name, unit in machine.units.items():
            held, length = memory["muscles"][name], unit.length
            stretch = length(at["muscles"][name], spans[name].span)
            stretch = stretch - length(state["muscles"][name], before[name].span)
            muscles[name] = stuck_states(unit, held, stretch, machine.gauge(state, name))
            if "wrap" in held:
                moved = held["wrap"].state + spans[name].span - before[name].span
                muscles[name] |= {"wrap": held["wrap"]._replace(state=moved)}
        return {**memory, "muscles": muscles}

    def both(x: jax.Array, u: jax.Array) -> tuple[Tree, Tree]:
        all_inputs = {**inputs, **{n: Value(u[2 * i], u[2 * i + 1]) for i, n in enumerate(sources)}}
        at = back(x)
        now = stuck_at(at, all_inputs)
        shown = machine.outputs(at, now, all_inputs)
        picked = jnp.stack([shown[n] + 0.0 for n in outputs]) if outputs else jnp.zeros(0)
        return flatten_util.ravel_pytree(machine.rate(at, now, all_inputs))[0], picked

    return jax.jacfwd(both, argnums=(0, 1))(flat, values)


def state_names(state: Tree) -> tuple[str, ...]:
    """Dotted names of the state's numbers in the order of the matrices, such as ``muscles.biceps.length``."""
    names = []
    for path, leaf in jax.tree_util.tree_flatten_with_path(state)[0]:
        text = ".".join(str(getattr(k, "key", getattr(k, "name", getattr(k, "idx", k)))) for k in path)
        size = int(np.size(leaf))
        names += [text] if size == 1 else [f"{text}.{i}" for i in range(size)]
    return tuple(names)


class Settled(NamedTuple):
    """A point of rest, and how good it is: the largest rate of a state over its size [1/s]."""

    state: Any
    residual: float


def settle(
    machine: Machine | Circuit,
    state: Tree,
    memory: Tree,
    inputs: Mapping[str, Value],
    *,
    longest: float = 1e3,
    tolerance: float = 1e-6,
) -> Settled:
    """Find the point of rest of a machine at constant inputs, with its memory held.

    The motion is integrated with a brake on every velocity, which moves no point of rest, then polished by implicit Euler
    steps that grow: where nothing fixes a temperature it stays what it came to.

    Args:
        machine: the machine.
        state: where it starts.
        memory: held; give the relaxed one for a point without friction.
        inputs: constant values of all signals; their rates are taken as zero.
        longest: time after which it must have settled [s].
        tolerance: largest rate of a state over its size [1/s].

    Raises:
        ConvergenceError: if it does not settle; says which state still moves.
    """
    from scipy.integrate import solve_ivp

    flat, back = flatten_util.ravel_pytree(state)
    names = state_names(state)
    brake = BEAT * np.array([name.endswith("velocity") for name in names])
    still = {name: Value(jnp.asarray(v.value, float), jnp.zeros(())) for name, v in inputs.items()}

    def rate(at: np.ndarray) -> np.ndarray:
        return np.asarray(_rate_and_slope(machine, back(jnp.asarray(at)), memory, still)[0])

    def slope(at: np.ndarray) -> np.ndarray:
        return np.asarray(_rate_and_slope(machine, back(jnp.asarray(at)), memory, still)[1]) - np.diag(brake)

    size = np.maximum(np.abs(np.asarray(flat)), FLOOR)
    run = solve_ivp(
        lambda t, x: rate(x) - brake * x,
        (0.0, longest),
        np.asarray(flat),
        method="BDF",
        rtol=1e-8,
        atol=1e-9 * size,
        jac=lambda t, x: slope(x),
    )
    x = run.y[:, -1]

    def residual(at: np.ndarray) -> np.ndarray:
        speeds: np.ndarray = np.abs(rate(at)) / np.maximum(np.abs(at), FLOOR)
        return speeds

    for duration in 10.0 ** np.arange(-2, 6):
        if float(residual(x).max()) <= 1e-3 * tolerance:
            break
        for _ in range(3):
            ahead = x + np.linalg.solve(np.eye(x.size) / duration - slope(x), rate(x) - brake * x)
            if np.isfinite(ahead).all() and residual(ahead).max() < residual(x).max():
                x = ahead
    left = residual(x)
    if not (run.success and left.max() <= tolerance):
        worst = names[int(np.argmax(left))]
        raise ConvergenceError(f"The machine does not settle within {longest:g} s; {worst} still moves.")
    return Settled(back(jnp.asarray(x)), float(left.max()))


@jit
def _rate_and_slope(machine: Machine | Circuit, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Any:
    flat, back = flatten_util.ravel_pytree(state)

    def rate(v: Any) -> Tree:
        derivative = flatten_util.ravel_pytree(machine.rate(back(v), memory, inputs))[0]
        return derivative, derivative

    slope, value = jax.jacfwd(rate, has_aux=True)(flat)
    return value, slope


def _find(name: str, known: Sequence[str], kind: str) -> int:
    if name not in known:
        raise InputError(kind, name, known=known, where="linear model")
    return list(known).index(name)
