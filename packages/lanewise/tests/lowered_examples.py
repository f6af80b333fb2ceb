"""What emitters are tried on: functions that together use every operation, all sorts of loops and memory; and an orbit."""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from lanewise import Program, lower
from lowered_systems import bodies, body_outputs, body_step

NUMBERS = np.array([0.3, -1.7, 12.5, 0.0, 2e-3, 1.0, -40.0, 7.25])


def arithmetic(x: Any, y: Any) -> Any:
    """Operations on numbers."""
    whole = jnp.floor(x) + jnp.ceil(y) + jnp.round(x * 1.5)
    chosen = jnp.where((x < y) ^ (y <= 0.1), jnp.maximum(x, y), jnp.minimum(x, 0.25))
    ratio = x / (1.0 + y * y) + y / (2.0 + jnp.abs(x)) + 1.0 / (3.0 + x * x)
    return whole + chosen * ratio - jnp.sqrt(jnp.abs(x * y)) * jnp.sign(x)


def elementary(x: Any, y: Any) -> Any:
    """Functions that are written out as arithmetic on numbers and their bits."""
    positive = jnp.abs(x) + 0.1
    waves = jnp.sin(x) * jnp.cos(y) + jnp.tanh(x)
    return waves + jnp.exp(-jnp.abs(y)) + jnp.log(positive) + positive**1.7 + jnp.expm1(0.1 * x) + jnp.log1p(y * y)


def integers(x: Any, n: Any) -> Any:
    """Whole numbers and truth values, also as arguments and results."""
    k = (10.0 * x).astype(int)
    both = ((k > n) | ~(x < 0.5)) & (n != 3)
    return k * n - jnp.abs(k), jnp.where(both, k // 3, k % 5), both, jnp.maximum(k, n).astype(float) / 4.0


def tables(x: Any, table: Any) -> Any:
    """Elements whose place is computed, of an argument and of a constant."""
    place = jnp.clip((x * 3.0).astype(int), 0, 39)
    constant = jnp.asarray(np.cos(np.arange(40.0)))
    few = jnp.stack([x, x * x, jnp.sin(x), 1.0 - x, 2.0 * x])  # made here: they get memory of their own
    return table[place % 8] + constant[place] + few[place % 5], (x > table).sum()


def loops(x: Any, rows: Any) -> Any:
    """A loop in a loop, carried values that change places, and results that grow."""

    def one(carry: Any, row: Any) -> Any:
        a, b, n = carry
        inner = jax.lax.fori_loop(0, 7, lambda i, s: s + row * i / (1.0 + s * s), a)
        return (b, inner - 0.1 * b, n + 1), (a, inner > b)

    return jax.lax.scan(one, (x, 1.0 - x, 0), rows)


def counted(x: Any, n: Any) -> Any:
    """A loop whose number of trips is an argument, which may be 0."""
    return jax.lax.fori_loop(0, n, lambda i, s: 0.5 * s + jnp.sin(s + i), x)


def gradient(x: Any, rows: Any) -> Any:
    """A derivative backwards through a loop, which needs what the loop made on the way."""
    return jax.value_and_grad(lambda x, rows: (loops(x, rows)[1][0] ** 2).sum(), (0, 1))(x, rows)


CASES: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]] = {
    "arithmetic": (arithmetic, (1.3, -0.4)),
    "elementary": (elementary, (1.3, -0.4)),
    "integers": (integers, (1.37, 4)),
    "tables": (tables, (1.3, NUMBERS)),
    "loops": (loops, (0.3, np.linspace(-1.0, 2.0, 40))),
    "counted": (counted, (0.7, 5)),
    "gradient": (gradient, (0.3, np.linspace(-1.0, 2.0, 40))),
}
# Further arguments that each case is run with.
OTHERS: dict[str, list[tuple[Any, ...]]] = {
    "arithmetic": [(-2.5, 3.5), (0.0, -0.0), (np.nan, 1.0), (2.0, np.nan), (np.inf, 1.0), (1e200, 1e200)],
    "elementary": [(-3.0, 800.0), (40.0, 0.0), (1e-9, 1e-9), (np.nan, 1.0)],
    "integers": [(-1.37, 4), (0.0, 3), (1e30, -7), (np.nan, 5)],
    "tables": [(-5.0, NUMBERS), (100.0, -NUMBERS)],
    "loops": [(-3.0, np.zeros(40))],
    "gradient": [(-3.0, np.zeros(40))],
    "counted": [(0.7, 0), (0.7, -3), (0.2, 100)],
}


def arguments_of(name: str, real: str) -> Iterator[tuple[Any, ...]]:
    """Arguments of a case that a type of numbers can hold."""
    for values in (CASES[name][1], *OTHERS[name]):
        numbers = np.concatenate([np.ravel(np.asarray(v, float)) for v in values])
        if real == "float64" or not np.any(np.abs(numbers[np.isfinite(numbers)]) > 3e38):
            yield values


@cache
def program(name: str) -> Program:
    function, examples = CASES[name]
    return lower(function, *examples, title=name)[0]


SAMPLES, INNER, PERIOD = 40, 4, 0.05


def commands() -> np.ndarray:
    """Thrusts at all samples, which drive and rest."""
    return 0.2 - 0.2 * np.cos(2.0 * np.pi * np.arange(SAMPLES + 1) / 20.0)


def run_of_orbit(parameters: Any, state: Any, thrusts: Any) -> dict[str, Any]:
    """A run of 160 steps, as the outputs at all samples."""

    def sample(state: Any, index: Any) -> Any:
        step = lambda i, s: body_step(parameters, s, thrusts[index], PERIOD / INNER)  # noqa: E731
        return jax.lax.fori_loop(0, INNER, step, state), body_outputs(state)

    last, seen = jax.lax.scan(sample, state, jnp.arange(SAMPLES))
    return {name: jnp.concatenate([seen[name], value[None]]) for name, value in body_outputs(last).items()}


def sample_of_orbit(parameters: Any, state: Any, inputs: Any) -> Any:
    """One sample at a held command: the state afterwards, and outputs."""
    step = lambda i, s: body_step(parameters, s, inputs["thrust"], PERIOD / INNER)  # noqa: E731
    after = jax.lax.fori_loop(0, INNER, step, state)
    return after, body_outputs(after)


@cache
def orbit_program() -> Program:
    return lower(run_of_orbit, *bodies(), commands(), title="orbit")[0]


def orbit_values() -> list[Any]:
    """Arguments of `orbit_program`."""
    return [*jax.tree.leaves(bodies()), commands()]
