"""JAX functions compiled once and run on one muscle or on many, by native kernels or by XLA.

    run = compile_function(function, *examples)     # engine="auto": native where it can be, else XLA
    results = run(*trees)                           # like function(*trees)
    results = run(*trees, lanes=1024)               # a leaf with one axis more than its example, the last, is given per lane

The compiler is the package `lanewise`. Here are the programs that it lowered before, found again on disk, and its errors as
those of this package. `integration.compile_march` does the same for a system's run.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Hashable, Iterator
from typing import Any

import numpy as np

import lanewise

from .._jax import jax
from ..components import programs
from ..errors import EngineError, InputError

ENGINES = ("auto", "native", "gpu", "xla")


class EngineFunction:
    """A function of trees, ready to be run.

    Attributes:
        engine: ``native``, ``gpu`` or ``xla``.
        reason: why it is not native although ``auto`` was requested; empty otherwise.
    """

    def __init__(self, compiled: lanewise.CompiledFunction) -> None:
        self.compiled, self.engine, self.reason = compiled, compiled.engine, compiled.reason

    @property
    def program(self) -> lanewise.Program:
        """The lowered program, which can be saved, and run without JAX.

        Raises:
            EngineError: if the function runs by XLA.
        """
        with laboratory_errors():
            return self.compiled.program

    def __call__(
        self,
        *trees: Any,
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
        with laboratory_errors():
            return self.compiled(*trees, lanes=lanes, mode=mode, real=real, threads=threads)


@contextlib.contextmanager
def laboratory_errors() -> Iterator[None]:
    """Convert errors of the compiler to errors of this package."""
    try:
        yield
    except lanewise.ArgumentError as error:
        raise InputError(error.argument, "not allowed", "", where=error.source, sentence=error.sentence) from None
    except lanewise.LanewiseError as error:
        raise EngineError(str(error)) from None


def compile_function(
    function: Callable[..., Any], *examples: Any, engine: str = "auto", title: str = ""
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
    with laboratory_errors():
        return EngineFunction(
            lanewise.compile(function, *examples, engine=engine, title=title, lower=programs.lower_or_load)
        )


def differentiable(function: Callable[..., Any], *examples: Any, **options: Any) -> Callable[..., Any]:
    """Compile a JAX function whose derivatives are kernels too, or find what was lowered before.

    Args:
        function: function of trees, as for `compile_function`.
        *examples: trees like its arguments.
        **options: of `lanewise.differentiable`.
    """
    return lanewise.differentiable(function, *examples, lower=programs.lower_or_load, **options)


_known: dict[Any, EngineFunction] = {}
MOST_KNOWN = 64  # functions with the structures of their arguments that are remembered


def call_compiled(function: Callable[..., Any], *trees: Any, mode: str = "default", **fixed: Hashable) -> Any:
    """Call a function that is compiled when it is first called with trees of this structure and these shapes.

    Args:
        function: a module's own, of trees.
        *trees: arguments of the call.
        mode: mode of the native engine, see `lanewise.Program`.
        **fixed: more arguments, which fix its structure.
    """
    leaves, structure = jax.tree.flatten(trees)
    kinds = tuple((np.shape(leaf), getattr(leaf, "dtype", type(leaf))) for leaf in leaves)
    key = function, tuple(fixed.items()), structure, kinds
    run = _known.get(key)
    if run is None:
        if len(_known) >= MOST_KNOWN:
            _known.pop(next(iter(_known)), None)
        bound = functools.partial(function, **fixed) if fixed else function
        run = _known[key] = compile_function(bound, *trees, title=function.__name__)
    return run(*trees, mode=mode)
