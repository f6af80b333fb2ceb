"""JAX functions compiled once and run on one lane or on many, by native kernels or by XLA.

    run = compile(function, *examples)              # engine="auto": native where it can be, else XLA
    results = run(*trees)                           # like function(*trees)
    results = run(*trees, lanes=1024)               # a leaf with one axis more than its example, the last, is given per lane

Lanes are the last axis of arguments and results, with both engines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np

from . import _lower
from ._gpu import to_gpu
from ._graph import gc_paused
from ._kernel import llvm
from ._lower import Tree
from ._program import Program
from .errors import ArgumentError, LoweringError, UnavailableError

ENGINES = ("auto", "native", "gpu", "xla")


class Lowering(Protocol):
    """A function that lowers, such as `lower` or one that keeps its programs on disk."""

    def __call__(
        self, function: Callable[..., Tree], *examples: Tree, title: str
    ) -> tuple[Program, jax.tree_util.PyTreeDef]:
        """Return a program and the tree structure of its results."""
        ...


class CompiledFunction:
    """A function of trees, ready to be run.

    Attributes:
        engine: ``native``, ``gpu`` or ``xla``.
        reason: why it is not native although ``auto`` was requested; empty otherwise.
    """

    def __init__(
        self, function: Callable[..., Tree], examples: Sequence[Tree], engine: str, title: str, lower: Lowering
    ) -> None:
        self.function, self.engine, self.reason = function, "xla", ""
        self._shapes = [np.shape(leaf) for leaf in jax.tree.leaves(tuple(examples))]
        self._structure: Any = jax.tree.structure(tuple(examples))
        self._mapped: dict[Any, Callable[..., Any]] = {}
        if engine == "xla":
            return
        try:
            llvm()
            self._program, self._tree = lower(function, *examples, title=title)
            self.engine = "native"
            if engine == "gpu":
                self._program, self.engine = to_gpu(self._program), "gpu"
        except (LoweringError, UnavailableError) as error:
            if engine != "auto":
                raise
            self.reason = str(error)

    @property
    def program(self) -> Program:
        """Program of the function, which can be saved, and run without JAX.

        Raises:
            LoweringError: if the function runs by XLA.
        """
        if self.engine == "xla":
            raise LoweringError("the function", self.reason or "it was compiled for XLA")
        return self._program

    @property
    def tree(self) -> jax.tree_util.PyTreeDef:
        """Structure of the results of the program, for JAX."""
        return self._tree

    def __call__(
        self,
        *trees: Tree,
        lanes: int | None = None,
        mode: str = "default",
        real: str = "float64",
        threads: int | None = None,
    ) -> Any:
        """Run the function.

        Args:
            *trees: like the examples; leaves per lane have one axis more, the last.
            lanes: how many; None for one run.
            mode: mode of the native engine, see `Program`.
            real: type of the native engine's numbers, ``float64`` or ``float32``.
            threads: threads of the native engine, at most; all cores by default.

        Raises:
            ArgumentError: the trees are not like the examples.
        """
        if jax.tree.structure(trees) != self._structure:
            raise ArgumentError("arguments", "arguments must be trees like the examples")
        leaves = jax.tree.leaves(trees)
        if self.engine != "xla":
            results = self._program.call(leaves, lanes=lanes, mode=mode, real=real, threads=threads)
            return jax.tree.unflatten(
                self._tree, [self._empty_result(k) if v is None else v for k, v in enumerate(results)]
            )
        axes = tuple(self._axis(shape, leaf, lanes) for shape, leaf in zip(self._shapes, leaves, strict=True))
        return jax.tree.map(np.asarray, self._by_xla(axes, lanes is not None)(leaves))

    def _empty_result(self, place: int) -> np.ndarray:
        return np.zeros(self._program.results[place].shape, jax.dtypes.float0)

    def _axis(self, shape: tuple[int, ...], leaf: Any, lanes: int | None) -> int | None:
        leaf_shape = np.shape(leaf)
        if leaf_shape == shape:
            return None
        if lanes is None or leaf_shape != (*shape, lanes):
            raise ArgumentError(
                "argument",
                f"an argument must have the shape {shape}, with the lanes behind where it differs, got {leaf_shape}",
            )
        return len(shape)

    def _by_xla(self, axes: tuple[int | None, ...], lanes: bool) -> Callable[[Any], Any]:
        if (axes, lanes) not in self._mapped:

            def flat(*leaves: Any) -> Any:
                return self.function(*jax.tree.unflatten(self._structure, leaves))

            if lanes and any(a is not None for a in axes):
                flat = jax.vmap(flat, in_axes=axes, out_axes=-1)
            elif lanes:
                raise ArgumentError("lanes", "at least one argument must have a value per lane")
            jitted = jax.jit(flat)
            self._mapped[axes, lanes] = lambda leaves: jitted(*map(jnp.asarray, leaves))
        return self._mapped[axes, lanes]


@gc_paused()
def compile(
    function: Callable[..., Tree], *examples: Tree, engine: str = "auto", title: str = "", lower: Lowering | None = None
) -> CompiledFunction:
    """Compile a JAX function for one lane or many.

    Args:
        function: function of trees; whole numbers that fix its structure are closed over, all else are arguments.
        *examples: trees like its arguments, for one lane.
        engine: ``native``, ``gpu`` (lanes on one of NVIDIA's, a single run on the processor), ``xla``, or ``auto``: native
            where the function can be lowered, else XLA.
        title: name of the function in error messages.
        lower: what lowers it, in place of `lanewise.lower`; it may find a program that was lowered before.

    Raises:
        ArgumentError: an unknown engine.
        LoweringError: with ``native`` or ``gpu``, an operation that no kernel can do.
        UnavailableError: with these, if LLVM cannot be loaded; with ``gpu``, no driver or no GPU.
    """
    if engine not in ENGINES:
        raise ArgumentError("engine", f"Unknown engine {engine!r}. Known are {', '.join(ENGINES)}")
    return CompiledFunction(function, examples, engine, title, lower or _lower.lower)
