"""A pure function of trees as a compiled one of plain vectors: what a loop by the wall clock calls at every sample.

A call with a tree of some fifty numbers costs more in wrapping and unwrapping than in computing; one with a few vectors
costs some microseconds. It is a native kernel that leaves every operation as it is written, or XLA's where there can
be none. The arithmetic is that of the function; whole numbers and truth values travel as floats, exactly.
"""

from __future__ import annotations

import functools
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

import numpy as np

from .._jax import Tree, flatten_util, jax, jnp
from ..components.programs import program_key
from .native import compile_function


class Packed:
    """A compiled function of vectors that returns several trees as vectors, ready to be called."""

    def __init__(self, function: Callable[..., tuple[Tree, ...]], *examples: Tree) -> None:
        """Compile a function for arguments like the examples; it returns a tuple of trees."""
        vectors, self._backs = zip(*(_packed(e) for e in examples), strict=True)
        shapes = jax.eval_shape(function, *examples)
        self._structures = [jax.tree.structure(tree) for tree in shapes]
        self._outs = [_packed(jax.tree.map(lambda s: np.zeros(s.shape, s.dtype), tree))[1] for tree in shapes]

        def flat(*given: Any) -> tuple[Tree, ...]:
            trees = function(*(back(v) for back, v in zip(self._backs, given, strict=True)))
            return tuple(_packed(tree)[0] for tree in trees)

        made = compile_function(flat, *vectors, title="a sample")
        if made.engine == "xla":
            self._call: Callable[..., Any] = jax.jit(flat).lower(*vectors).compile()
        else:
            kernel = made.program
            self._call = lambda *given: kernel.call(given, mode="strict")

    def __call__(self, *vectors: np.ndarray) -> list[np.ndarray]:
        """The results as vectors."""
        return [np.asarray(v) for v in self._call(*vectors)]

    def tree(self, index: int, vector: np.ndarray) -> Tree:
        """A result as the tree that it is."""
        return self._outs[index](vector)

    def columns(self, index: int, rows: np.ndarray) -> Tree:
        """Many vectors of a result (n, ..) as a tree of columns (n,); for results whose leaves are single numbers."""
        columns = [rows[:, i] for i in range(rows.shape[1])]
        return jax.tree.unflatten(self._structures[index], columns)

    def size(self, index: int) -> int:
        """Numbers in a result's vector."""
        structure: Any = self._structures[index]
        return int(structure.num_leaves)

    def index(self, index: int, name: str) -> int:
        """Position of a named number of a result, a table of single numbers, in its vector."""
        structure: Any = self._structures[index]
        places = jax.tree.unflatten(structure, list(range(structure.num_leaves)))
        return int(places[name])


_compiled: OrderedDict[str, Future[Packed]] = OrderedDict()
_lock = threading.Lock()
MOST_COMPILED = 24  # that are remembered


def compile_once(function: Callable[..., tuple[Tree, ...]], constants: Sequence[Tree], *examples: Tree) -> Packed:
    """Fix the first arguments of a function, and compile it at the first call with such values.

    Concurrent requests for the same share one compilation. What `programs.program_key` cannot name is compiled every time.

    Args:
        function: a module's own, of `constants` and then arguments like the examples; returns a tuple of trees.
        constants: trees and plain values, which become part of the program.
        *examples: trees like the other arguments.
    """
    fixed = functools.partial(function, *constants)
    key = program_key(fixed, examples)
    if key is None:
        return Packed(fixed, *examples)
    with _lock:
        known = _compiled.get(key)
        mine = known is None
        if known is None:
            known = _compiled[key] = Future()
            while len(_compiled) > MOST_COMPILED:
                _compiled.popitem(last=False)
        _compiled.move_to_end(key)
    if mine:
        try:
            known.set_result(Packed(fixed, *examples))
        except BaseException as error:
            with _lock:
                _compiled.pop(key, None)
            known.set_exception(error)
    return known.result()


def pack(tree: Tree) -> np.ndarray:
    """Flatten a tree to a vector."""
    return np.asarray(_packed(tree)[0])


def _packed(tree: Tree) -> tuple[Any, Callable[[Any], Any]]:
    leaves, structure = jax.tree.flatten(tree)
    kinds = [jnp.asarray(leaf).dtype for leaf in leaves]
    vector, back = flatten_util.ravel_pytree([jnp.asarray(leaf, float) for leaf in leaves])

    def unpacked(given: Any) -> Any:
        parts = [jnp.asarray(x).astype(kind) for x, kind in zip(back(jnp.asarray(given)), kinds, strict=True)]
        return jax.tree.unflatten(structure, parts)

    return vector, unpacked
