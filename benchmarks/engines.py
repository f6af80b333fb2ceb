"""The library's engines, each of which turns a batch into something that can be run again and again.

XLA is the reference; the native kernels of `mckibben.engine` stand beside it where they are built.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from cases import INNER, PERIOD, Batch

from mckibben.engine import held
from mckibben.engine.signals import ramped

Outputs = tuple[np.ndarray, np.ndarray]  # both (samples + 1, lanes)
Runner = Callable[[], Outputs]


def xla(batch: Batch, dtype: Any = np.float64, inner: int = INNER) -> Runner:
    """The library's `march` under `jit` and `vmap`, as a user would write it."""
    if np.dtype(dtype) == np.float64:
        compiled, given = jax.jit(batch.mapped(inner)), batch.arguments()
        return lambda: _lanes_last(compiled(*given))
    with jax.enable_x64(False):
        single = batch.cast(np.float32)
        compiled, given = jax.jit(single.mapped(inner)), single.arguments(np.float32)

    def run() -> Outputs:
        with jax.enable_x64(False):
            return _lanes_last(compiled(*given))

    return run


def _lanes_last(found: Any) -> Outputs:
    first, second = (np.asarray(x).T for x in found)
    return first, second


def native(
    batch: Batch, dtype: Any = np.float64, inner: int = INNER, mode: str = "default", threads: int = 1
) -> Runner:
    """The library's native kernel of the same `march`; all that `batch` varies is given per lane."""
    run, trees = lowered(batch, inner)
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(trees)]
    options = {"mode": mode, "real": np.dtype(dtype).name, "threads": threads}
    lanes = None if batch.lanes == 1 else batch.lanes

    def call() -> Outputs:
        first, second = run.program.call(leaves, lanes=lanes, **options)
        return (first[:, None], second[:, None]) if lanes is None else (first, second)

    return call


def lowered(batch: Batch, inner: int = INNER) -> tuple[Any, Any]:
    """The compiled run, and the trees that it is called with, lanes last."""
    from mckibben.engine.integration import compile_march

    case, one = batch.case, batch.first(1)
    examples = [trees(one, lambda x: x[..., 0])]
    run = compile_march(
        *examples[0], period=PERIOD, inner=inner, outputs=sorted(case.outputs), engine="native"
    )  # the outputs come in the order of their names, which is that of the kernels
    return run, examples[0] if batch.lanes == 1 else trees(batch, lambda x: x)


def trees(batch: Batch, pick: Callable[[np.ndarray], Any]) -> tuple[Any, ...]:
    """System, state, memory and signals of a batch, its per-lane numbers picked from."""
    system = batch.case.with_parameters({name: pick(value) for name, value in batch.changes.items()})
    values = {name: pick(batch.commands[:, i]) for i, name in enumerate(batch.case.commands)}
    make = ramped if batch.case.straight else held
    return system, *batch.case.start, {name: make(v) for name, v in values.items()}


ENGINES: dict[str, Callable[..., Runner]] = {"XLA": xla}
try:
    import llvmlite  # noqa: F401
except ImportError:
    pass
else:
    ENGINES = {"native": native, "native, fast": functools.partial(native, mode="fast"), **ENGINES}
