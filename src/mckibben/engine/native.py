"""JAX functions compiled once and run on one muscle or on many, by native kernels or by XLA.

    run = compile_function(function, *examples)     # engine="auto": native where it can be, else XLA
    results = run(*trees)                           # like function(*trees)
    results = run(*trees, lanes=1024)               # a leaf with one axis more than its example, the last, is given per lane

The compiler is the package `lanewise`. Here are the programs that it lowered before, found again on disk, and its errors as
those of this package. What is found again is run without JAX. `integration.compile_march` does the same for a system's run.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any

import numpy as np

import lanewise

from .._jax import Tree
from ..components import programs
from ..components.module import flatten, map_leaves, unflatten
from ..errors import EngineError, InputError

ENGINES = ("auto", "native", "gpu", "xla")


class EngineFunction:
    """A function of trees, ready to be run.

    Attributes:
        engine: ``native``, ``gpu`` or ``xla``.
        reason: why it is not native although ``auto`` was requested; empty otherwise.
    """

    def __init__(self, compiled: lanewise.CompiledFunction | _KeptFunction) -> None:
        self.compiled, self.engine, self.reason = compiled, compiled.engine, compiled.reason

    @property
    def program(self) -> lanewise.Program:
        """The lowered program, which can be saved, and run without JAX.

        Raises:
            EngineError: if the function runs by XLA.
        """
        with as_package_errors():
            return self.compiled.program

    def __call__(
        self,
        *trees: Tree,
        lanes: int | None = None,
        mode: str = "default",
        real: str = "float64",
        threads: int | None = None,
    ) -> Any:
        """Run it; see `lanewise.CompiledFunction`.

        Raises:
            InputError: the trees are not like the examples.
            EngineError: the GPU refused.
        """
        with as_package_errors():
            return self.compiled(*trees, lanes=lanes, mode=mode, real=real, threads=threads)


class _KeptFunction:
    """A function whose program was lowered before, run without JAX; otherwise like `lanewise.CompiledFunction`."""

    engine, reason = "native", ""

    def __init__(self, program: lanewise.Program, result: Any, examples: Any) -> None:
        self.program, self._structure, self._result = program, flatten(examples)[1], flatten(result)[1]

    def __call__(self, *trees: Tree, **options: Any) -> Any:
        leaves, structure = flatten(trees)
        if structure != self._structure:
            raise lanewise.ArgumentError("arguments", "arguments must be trees like the examples")
        return self.call(leaves, **options)

    def call(self, leaves: Sequence[Any], **options: Any) -> Any:
        """Run it on the leaves of arguments that are known to be trees like the examples."""
        return unflatten(self._result, self.program.call(leaves, **options))


def _find_kept(function: Callable[..., Tree], examples: tuple[Tree, ...], engine: str) -> _KeptFunction | None:
    """The function as it was lowered before; None if it has to be lowered, or needs JAX to be run."""
    if engine not in ("auto", "native") or importlib.util.find_spec("llvmlite") is None:
        return None
    known = programs.find_program(function, *examples)
    if known is None or any(leaf.kind is None for leaf in known[0].results):  # a result of JAX's that carries nothing
        return None
    return _KeptFunction(*known, examples)


@contextlib.contextmanager
def as_package_errors() -> Iterator[None]:
    """Convert errors of the compiler to errors of this package."""
    try:
        yield
    except lanewise.ArgumentError as error:
        raise InputError(error.argument, "not allowed", "", where=error.source, sentence=error.sentence) from None
    except lanewise.LanewiseError as error:
        raise EngineError(str(error)) from None


def compile_function(
    function: Callable[..., Tree], *examples: Tree, engine: str = "auto", title: str = ""
) -> EngineFunction:
    """Compile a JAX function for one lane or many, or find what was lowered before.

    Args:
        function: function of trees; whole numbers that fix its structure are closed over, all else are arguments.
        *examples: trees like its arguments, for one lane.
        engine: ``native``, ``gpu`` (lanes on one of NVIDIA's, a single run on the processor), ``xla``, or ``auto``: native
            where the function can be lowered, else XLA.
        title: name of the function in error messages.

    Raises:
        InputError: an unknown engine.
        EngineError: with ``native`` or ``gpu``, an operation that no kernel can do, or no driver or GPU.
    """
    with as_package_errors():
        if (kept := _find_kept(function, examples, engine)) is not None:
            return EngineFunction(kept)
        return EngineFunction(
            lanewise.compile(function, *examples, engine=engine, title=title, lower=programs.lower_or_load)
        )


def differentiable(function: Callable[..., Tree], *examples: Tree, **options: Any) -> Callable[..., Tree]:
    """Compile a JAX function whose derivatives are kernels too, or find what was lowered before.

    Args:
        function: function of trees, as for `compile_function`.
        *examples: trees like its arguments.
        **options: of `lanewise.differentiable`.
    """
    return lanewise.differentiable(function, *examples, lower=programs.lower_or_load, **options)


_known: dict[Any, list[tuple[Any, EngineFunction]]] = {}
MOST_KNOWN = 64  # functions with the shapes of their arguments that are remembered
MOST_ALIKE = 16  # structures of each


def call_compiled(function: Callable[..., Tree], *trees: Tree, mode: str = "default", **fixed: Hashable) -> Tree:
    """Call a function that is compiled when it is first called with trees of this structure and these shapes.

    Args:
        function: a module's own, of trees.
        *trees: arguments of the call.
        mode: mode of the native engine, see `lanewise.Program`.
        **fixed: more arguments, which fix its structure.
    """
    run, leaves = _compiled_for(function, trees, fixed)
    if isinstance(run.compiled, _KeptFunction):  # a chunk of a run takes a few milliseconds, and its trees are large
        with as_package_errors():
            return run.compiled.call(leaves, mode=mode)
    return run(*trees, mode=mode)


def call_in_lanes(
    function: Callable[..., Tree],
    shared: tuple[Tree, ...],
    varied: tuple[Tree, ...],
    *,
    mode: str = "default",
    **fixed: Hashable,
) -> Tree:
    """Call a function that is compiled once for many cases, as `call_compiled` does; each case is a lane.

    Args:
        function: a module's own, of the shared trees and then the varied ones.
        shared: trees that all cases have in common.
        varied: trees whose leaves have the cases along their first axis.
        mode: mode of the native engine, see `lanewise.Program`.
        **fixed: more arguments, which fix its structure.

    Returns:
        The results, with the cases along the first axis of their leaves.
    """
    lanes = len(flatten(varied)[0][0])
    one = map_leaves(lambda x: np.asarray(x)[0], varied)
    moved = map_leaves(lambda x: np.moveaxis(np.asarray(x), 0, -1), varied)
    run, _ = _compiled_for(function, (*shared, *one), fixed)
    leaves, structure = flatten(run(*shared, *moved, lanes=lanes, mode=mode))
    if run.engine != "xla":  # what is the same in all lanes has no axis for them
        shapes = [(*leaf.shape, lanes) for leaf in run.program.results]
        leaves = [
            np.broadcast_to(x[..., None], s) if x.ndim < len(s) else x for x, s in zip(leaves, shapes, strict=True)
        ]
    return unflatten(structure, [np.moveaxis(x, -1, 0) for x in leaves])


def _compiled_for(
    function: Callable[..., Tree], trees: tuple[Tree, ...], fixed: dict[str, Hashable]
) -> tuple[EngineFunction, list[Any]]:
    """A function compiled for trees of this structure and these shapes, from memory if it was before; and their leaves."""
    leaves, structure = flatten(trees)
    kinds = tuple((np.shape(leaf), getattr(leaf, "dtype", type(leaf))) for leaf in leaves)
    key = function, tuple(fixed.items()), kinds
    alike = _known.get(key, [])  # a structure may have tables in its static fields, and then no hash
    run = next((run for known, run in alike if known == structure), None)
    if run is None:
        if len(_known) >= MOST_KNOWN:
            _known.pop(next(iter(_known)), None)
        bound = functools.partial(function, **fixed) if fixed else function
        run = compile_function(bound, *trees, title=function.__name__)
        _known[key] = [*alike[1 - MOST_ALIKE :], (structure, run)]
    return run, leaves
