"""JAX functions compiled once and run on one muscle or on many, by native kernels or by XLA.

    run = compiled(function, *examples)             # engine="auto": native where it can be, else XLA
    results = run(*trees)                           # like function(*trees)
    results = run(*trees, lanes=1024)               # a leaf with one axis more than its example, the last, is given per lane

`integration.compiled_march` does that for a system's run. Lanes are the last axis of arguments and results, in both engines.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import InputError, LoweringError, MissingDataError
from .lowering.graph import growing
from .lowering.machine_code import llvm
from .lowering.program import Program
from .programs import program

ENGINES = ("auto", "native", "gpu", "xla")


class Compiled:
    """A function of trees, ready to be run; `engine` says by what, `reason` why it is not native where that was wished."""

    def __init__(self, function: Callable[..., Any], examples: Sequence[Any], engine: str, title: str) -> None:
        self.function, self.engine, self.reason = function, "xla", ""
        self._shapes = [np.shape(leaf) for leaf in jax.tree.leaves(tuple(examples))]
        self._structure: Any = jax.tree.structure(tuple(examples))
        self._mapped: dict[Any, Callable[..., Any]] = {}
        if engine == "xla":
            return
        try:
            llvm()
            self._program, self._tree = program(function, examples, title)
            self.engine = "native"
            if engine == "gpu":
                from .lowering.gpu import on_gpu

                self._program, self.engine = on_gpu(self._program), "gpu"
        except (LoweringError, MissingDataError) as error:
            if engine != "auto":
                raise
            self.reason = str(error)

    @property
    def program(self) -> Program:
        """What can be saved, and run without JAX.

        Raises:
            LoweringError: if the function runs by XLA.
        """
        if self.engine == "xla":
            raise LoweringError("the function", self.reason or "it was compiled for XLA")
        return self._program

    @property
    def tree(self) -> Any:
        """Structure of the results of the program, for JAX."""
        return self._tree

    def __call__(
        self,
        *trees: Any,
        lanes: int | None = None,
        mode: str = "default",
        real: str = "float64",
        threads: int | None = None,
    ) -> Any:
        """Run it.

        Args:
            *trees: like the examples; leaves per lane have one axis more, the last.
            lanes: how many; None for one run.
            mode: of the native engine, see `lowering.program.Program`.
            real: type of the native engine's numbers, ``float64`` or ``float32``.
            threads: of the native engine, at most; all cores where left out.

        Raises:
            InputError: the trees are not like the examples.
        """
        if jax.tree.structure(trees) != self._structure:
            raise InputError("arguments", "another tree", "allowed are trees like the examples")
        leaves = jax.tree.leaves(trees)
        if self.engine != "xla":
            found = self._program.call(leaves, lanes=lanes, mode=mode, real=real, threads=threads)
            return jax.tree.unflatten(self._tree, [self._empty(k) if v is None else v for k, v in enumerate(found)])
        axes = tuple(self._axis(shape, leaf, lanes) for shape, leaf in zip(self._shapes, leaves, strict=True))
        return jax.tree.map(np.asarray, self._by_xla(axes, lanes is not None)(leaves))

    def _empty(self, place: int) -> np.ndarray:
        return np.zeros(self._program.results[place].shape, jax.dtypes.float0)

    def _axis(self, shape: tuple[int, ...], leaf: Any, lanes: int | None) -> int | None:
        given = np.shape(leaf)
        if given == shape:
            return None
        if lanes is None or given != (*shape, lanes):
            raise InputError(
                "argument", f"of shape {given}", f"allowed is {shape}, with the lanes behind it where it differs"
            )
        return len(shape)

    def _by_xla(self, axes: tuple[int | None, ...], lanes: bool) -> Callable[[Any], Any]:
        if (axes, lanes) not in self._mapped:

            def flat(*leaves: Any) -> Any:
                return self.function(*jax.tree.unflatten(self._structure, leaves))

            if lanes and any(a is not None for a in axes):
                flat = jax.vmap(flat, in_axes=axes, out_axes=-1)
            elif lanes:
                raise InputError("lanes", "no argument per lane", "allowed is at least one", where="xla")
            jitted = jax.jit(flat)
            self._mapped[axes, lanes] = lambda leaves: jitted(*map(jnp.asarray, leaves))
        return self._mapped[axes, lanes]


@growing()
def compiled(function: Callable[..., Any], *examples: Any, engine: str = "auto", title: str = "") -> Compiled:
    """A JAX function ready to run on one lane or many.

    Args:
        function: of trees; whole numbers that fix its structure are closed over, all else are arguments.
        *examples: trees like its arguments, for one lane.
        engine: ``native``, ``gpu`` (lanes on one of NVIDIA's, a single run on the processor), ``xla``, or ``auto``: native
            where the function can be lowered, else XLA.
        title: what errors call it.

    Raises:
        InputError: an unknown engine.
        LoweringError: with ``native`` or ``gpu``, an operation that no kernel can do.
        MissingDataError: with these, if llvmlite is not installed; with ``gpu``, no driver or no GPU.
    """
    if engine not in ENGINES:
        raise InputError("engine", engine, f"known are {', '.join(ENGINES)}")
    return Compiled(function, examples, engine, title)


_called: dict[Any, Compiled] = {}
MOST_CALLED = 64  # functions with the structures of their arguments that are remembered


def called(function: Callable[..., Any], *trees: Any, mode: str = "default", **fixed: Hashable) -> Any:
    """What a function returns, compiled when it is first called with trees of this structure and these shapes.

    Args:
        function: a module's own, of trees.
        *trees: what it is called with.
        mode: of the native engine, see `lowering.program.Program`.
        **fixed: more arguments, which fix its structure.
    """
    leaves, structure = jax.tree.flatten(trees)
    kinds = tuple((np.shape(leaf), getattr(leaf, "dtype", type(leaf))) for leaf in leaves)
    known = function, tuple(fixed.items()), structure, kinds
    run = _called.get(known)
    if run is None:
        if len(_called) >= MOST_CALLED:
            _called.pop(next(iter(_called)), None)
        made = functools.partial(function, **fixed) if fixed else function
        run = _called[known] = compiled(made, *trees, title=function.__name__)
    return run(*trees, mode=mode)
