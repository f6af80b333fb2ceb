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
from typing import Any, NamedTuple

import numpy as np

from .._jax import Tree, jax, jnp
from ..components.module import flatten, map_leaves, unflatten
from ..components.programs import program_key
from .native import compile_function


class Layout(NamedTuple):
    """How a tree lies in a vector of floats: its structure, and shape and type of each leaf."""

    structure: Any
    shapes: tuple[tuple[int, ...], ...]
    kinds: tuple[str, ...]

    @classmethod
    def of(cls, tree: Tree) -> Layout:
        """The layout of trees like this one."""
        leaves, structure = flatten(tree)
        kinds = tuple(np.dtype(getattr(leaf, "dtype", type(leaf))).str for leaf in leaves)
        return cls(structure, tuple(np.shape(leaf) for leaf in leaves), kinds)

    @property
    def size(self) -> int:
        """Numbers in the vector."""
        return sum(int(np.prod(shape)) for shape in self.shapes)

    def pack(self, tree: Tree) -> np.ndarray:
        """The vector of a tree of concrete arrays; whole numbers and truth values become floats, exactly."""
        parts = [np.asarray(leaf, float).reshape(-1) for leaf in flatten(tree)[0]]
        return np.concatenate(parts) if parts else np.zeros(0)

    def packed(self, tree: Tree) -> Tree:
        """The same of a tree that may be traced."""
        return _packed(tree)

    def unpack(self, vector: Tree) -> Tree:
        """The tree of a vector, which may be traced."""
        leaves, at = [], 0
        make: Any = np if isinstance(vector, np.ndarray) else jnp
        for shape, kind in zip(self.shapes, self.kinds, strict=True):
            count = int(np.prod(shape))
            leaves.append(make.reshape(vector[at : at + count], shape).astype(kind))
            at += count
        return unflatten(self.structure, leaves)


class Packed:
    """A compiled function of vectors that returns several trees as vectors, ready to be called."""

    def __init__(self, function: Callable[..., tuple[Tree, ...]], *examples: Tree) -> None:
        """Compile a function for arguments like the examples; it returns a tuple of trees."""
        inputs = tuple(map(Layout.of, examples))
        vectors = [layout.pack(example) for layout, example in zip(inputs, examples, strict=True)]
        made = compile_function(functools.partial(_of_vectors, function, inputs), *vectors, title="a sample")
        described = compile_function(functools.partial(_described, function, inputs), *vectors, title="a sample")
        kinds: dict[int, str] = {np.dtype(kind).num: np.dtype(kind).str for kind in np.typecodes["AllInteger"] + "d?"}
        self._outs: list[Layout] = []
        for leaves, structure in map(flatten, described(*vectors)):
            shapes = tuple(tuple(map(int, leaf[1:])) for leaf in leaves)
            self._outs.append(Layout(structure, shapes, tuple(kinds[int(leaf[0])] for leaf in leaves)))
        self._kernel = None if made.engine == "xla" else made.program
        if self._kernel is None:
            flat = functools.partial(_of_vectors, function, inputs)
            self._call: Callable[..., Any] = jax.jit(flat).lower(*vectors).compile()
        else:
            kernel = self._kernel
            self._call = lambda *given: kernel.call(given, mode="strict")

    def __call__(self, *vectors: np.ndarray) -> list[np.ndarray]:
        """The results as vectors."""
        return [np.asarray(v) for v in self._call(*vectors)]

    def bind(self, *vectors: np.ndarray) -> tuple[Callable[[], None], list[np.ndarray]]:
        """Fix the places of arguments: what to call when they have changed, and the vectors in which results then are."""
        results = [np.zeros(layout.size) for layout in self._outs]
        if self._kernel is not None:
            return self._kernel.bind(vectors, results, mode="strict"), results

        def call() -> None:
            for result, vector in zip(results, self._call(*vectors), strict=True):
                result[:] = vector

        return call, results

    def tree(self, index: int, vector: np.ndarray) -> Tree:
        """A result as the tree that it is."""
        return self._outs[index].unpack(np.asarray(vector))

    def columns(self, index: int, rows: np.ndarray) -> Tree:
        """Many vectors of a result (n, ..) as a tree of columns (n,); for results whose leaves are single numbers."""
        columns = [rows[:, i] for i in range(rows.shape[1])]
        return unflatten(self._outs[index].structure, columns)

    def size(self, index: int) -> int:
        """Leaves of a result."""
        return len(self._outs[index].shapes)

    def index(self, index: int, name: str) -> int:
        """Position of a named number of a result, a table of single numbers, in its vector."""
        layout = self._outs[index]
        return int(unflatten(layout.structure, range(len(layout.shapes)))[name])


def _of_vectors(function: Callable[..., tuple[Any, ...]], inputs: tuple[Layout, ...], *vectors: Any) -> tuple[Any, ...]:
    """The results of a function as vectors, its arguments too."""
    trees = function(*(layout.unpack(v) for layout, v in zip(inputs, vectors, strict=True)))
    return tuple(_packed(tree) for tree in trees)


def _described(function: Callable[..., tuple[Any, ...]], inputs: tuple[Layout, ...], *vectors: Any) -> tuple[Any, ...]:
    """The results of a function, each leaf as number of its type and its shape: found again on disk, it needs no tracing."""
    trees = function(*(layout.unpack(v) for layout, v in zip(inputs, vectors, strict=True)))
    return tuple(map_leaves(lambda leaf: np.array([jnp.asarray(leaf).dtype.num, *np.shape(leaf)]), t) for t in trees)


def _packed(tree: Tree) -> Tree:
    """The vector of a tree that may be traced."""
    parts = [jnp.reshape(jnp.asarray(leaf, float), (-1,)) for leaf in flatten(tree)[0]]
    return jnp.concatenate(parts) if parts else jnp.zeros(0)


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
    return Layout.of(tree).pack(tree)
