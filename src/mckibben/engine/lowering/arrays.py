"""Values while a function is traced: a number is a `Node`, a small array an object array of nodes, anything larger a `View`.

A view has no elements of its own: it says which node stands at an index, so that a row of a long signal is a load, and an
operation on long arrays is done where its elements are used.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .graph import Buffer, Graph, Node

SMALL = 64  # elements up to which an array is written out
FEW = 4  # elements up to which one is picked by choices instead of from memory

Index = tuple[Any, ...]  # of ints and int nodes


class View:
    """An array of nodes that are made when asked for; `at` takes one int or int node per axis.

    `fill` is the node that stands everywhere, where one does.
    """

    fill: Node | None = None

    def __init__(self, shape: Sequence[int], kind: str, at: Callable[[Index], Node]) -> None:
        self.shape, self.kind, self._make = tuple(shape), kind, at
        self._made: dict[Index, Node] = {}

    @property
    def touched(self) -> bool:
        """Whether an element has been asked for."""
        return bool(self._made)

    def at(self, index: Index) -> Node:
        """The node at an index."""
        node = self._made.get(index)
        if node is None:
            node = self._made[index] = self._make(index)
        return node


class Filled(View):
    """One node everywhere."""

    def __init__(self, shape: Sequence[int], fill: Node) -> None:
        super().__init__(shape, fill.kind, lambda index: fill)
        self.fill = self.node = fill


class Rows(View):
    """The whole of a buffer, in C order; readable once the tokens are there.

    `written` says that a loop writes every element of it, so that it may stand inside a larger buffer; `sum_of` that it
    began as zeros and was only added to.
    """

    sum_of: Growing | None = None

    def __init__(
        self, graph: Graph, buffer: Buffer, shape: Sequence[int], tokens: tuple[Node, ...] = (), written: bool = False
    ) -> None:
        self.graph, self.buffer, self.tokens, self.written = graph, buffer, tokens, written
        super().__init__(shape, buffer.kind, self._at)

    def _at(self, index: Index) -> Node:
        if self.sum_of is not None and self.buffer.within is not None:
            raise NotImplementedError("a long sum is needed by itself, and in a longer one")
        return self.graph.load(self.buffer, flat(self.graph, index, self.shape), tokens=self.tokens)


class Joined(View):
    """Parts one behind the other along the first axis."""

    def __init__(self, graph: Graph, parts: Sequence[Any], shape: Sequence[int], kind: str) -> None:
        self.graph, self.parts = graph, list(parts)
        super().__init__(shape, kind, self._at)

    def _at(self, index: Index) -> Node:
        begin, found = 0, None
        for part in self.parts:
            rows = shape_of(part)[0]
            if isinstance(index[0], int):
                if begin <= index[0] < begin + rows:
                    return at(self.graph, part, (index[0] - begin, *index[1:]))
            elif rows:
                here = minus(self.graph, index[0], begin)
                low, high = here.span
                if high >= 0 and low < rows:
                    value = at(self.graph, part, (clamped(self.graph, here, rows), *index[1:]))
                    inside = self.graph.make("le", (self.graph.const(0, "int"), here))
                    found = value if found is None else self.graph.make("select", (inside, value, found))
            begin += rows
        if found is None:
            raise IndexError("no element there")
        return found


class Update(View):
    """Zeros but for some blocks that are added: (start indices, block) each; what a slice's derivative is made of."""

    def __init__(self, graph: Graph, shape: Sequence[int], blocks: list[tuple[Index, Any]]) -> None:
        self.graph, self.blocks = graph, blocks
        super().__init__(shape, "real", self._at)

    def _at(self, index: Index) -> Node:
        g, total = self.graph, self.graph.const(0.0)
        for start, block in self.blocks:
            here, inside = [], g.const(True, "bool")
            for i, begin, n in zip(index, start, shape_of(block), strict=True):
                place = minus(g, i, begin)
                inside = g.make("and", (inside, within(g, place, n)))
                here.append(clamped(g, place, n))
            value = at(g, block, tuple(here))
            total = g.make("add", (total, g.make("select", (inside, value, g.const(0.0)))))
        return total


class Growing(View):
    """A long array that a loop carries and only adds to: its present additions on top of a buffer."""

    def __init__(self, buffer: Buffer, shape: Sequence[int], blocks: tuple[tuple[Index, Any], ...] = ()) -> None:
        self.buffer, self.blocks = buffer, blocks
        self.filled: Node | None = None  # the token of what wrote its beginning
        super().__init__(shape, "real", self._at)

    def _at(self, index: Index) -> Node:
        raise NotImplementedError("an array that a loop changes in place is read while it changes")


def shape_of(value: Any) -> tuple[int, ...]:
    """Shape of a value."""
    return () if isinstance(value, Node) else value.shape


def kind_of(value: Any) -> str:
    """Kind of a value's elements; an array without elements is real."""
    if isinstance(value, np.ndarray):
        return str(value.flat[0].kind) if value.size else "real"
    return str(value.kind)


def flat(graph: Graph, index: Index, shape: Sequence[int]) -> Any:
    """The place in C order of an index, an int or an int node."""
    place: Any = 0
    for i, n in zip(index, shape, strict=True):
        place = plus(graph, times(graph, place, n), i)
    return place


def as_node(graph: Graph, value: Any) -> Node:
    """An index as an int node."""
    return value if isinstance(value, Node) else graph.const(value, "int")


def plus(graph: Graph, a: Any, b: Any) -> Any:
    """Sum of indices."""
    if isinstance(a, int) and isinstance(b, int):
        return a + b
    return graph.make("add", (as_node(graph, a), as_node(graph, b)))


def minus(graph: Graph, a: Any, b: Any) -> Node:
    """Difference of indices, as a node."""
    return graph.make("sub", (as_node(graph, a), as_node(graph, b)))


def times(graph: Graph, a: Any, b: int) -> Any:
    """Product of an index with a number."""
    return a * b if isinstance(a, int) else graph.make("mul", (a, graph.const(b, "int")))


def clamped(graph: Graph, index: Any, rows: int) -> Any:
    """An index within 0 .. rows - 1."""
    low = graph.make("max", (as_node(graph, index), graph.const(0, "int")))
    node = graph.make("min", (low, graph.const(rows - 1, "int")))
    return node.attr if node.op == "const" else node


def within(graph: Graph, index: Node, rows: int) -> Node:
    """Whether an index is in 0 .. rows - 1."""
    low = graph.make("le", (graph.const(0, "int"), index))
    return graph.make("and", (low, graph.make("lt", (index, graph.const(rows, "int")))))


def at(graph: Graph, value: Any, index: Index) -> Node:
    """An element of a value; the index is within its shape."""
    if isinstance(value, Node):
        return value
    index = tuple(i.attr if isinstance(i, Node) and i.op == "const" else i for i in index)
    if isinstance(value, View):
        return value.at(index)
    if all(isinstance(i, int) for i in index):
        found: Node = value[index]
        return found
    return _picked(graph, value, index)


def _picked(graph: Graph, value: np.ndarray, index: Index) -> Node:
    """An element of an array of nodes at an index that is not known beforehand."""
    fixed = tuple(i if isinstance(i, int) else slice(None) for i in index)
    part, moving = value[fixed], tuple(i for i in index if not isinstance(i, int))
    flattened, place = part.ravel(), flat(graph, moving, part.shape)
    if len(flattened) <= FEW:
        found: Node = flattened[-1]
        for k in range(len(flattened) - 2, -1, -1):
            here = graph.make("le", (place, graph.const(k, "int")))
            found = graph.make("select", (here, flattened[k], found))
        return found
    return stored(graph, flattened).at((place,))


def stored(graph: Graph, value: np.ndarray) -> Rows:
    """An array of nodes in memory, so that it can be read at any index."""
    flattened = tuple(value.ravel())
    kind = flattened[0].kind
    if all(n.op == "const" for n in flattened):
        data = np.array([n.attr for n in flattened])
        for known in graph.buffers:
            if known.role == "constant" and known.kind == kind and np.array_equal(known.data, data):
                return Rows(graph, known, value.shape)
        return Rows(graph, graph.buffer("constant", kind, (len(data),), data=data), value.shape)
    key = ("table", kind, tuple(n.serial for n in flattened))
    token = graph.known(key)
    if token is None:
        token = graph.once(key, "table", flattened, graph.buffer("scratch", kind, (len(flattened),)), "token")
    return Rows(graph, token.attr, value.shape, (token,))


def solid(graph: Graph, value: Any) -> Any:
    """A value with its elements written out."""
    if not isinstance(value, View):
        return value
    out = np.empty(value.shape, object)
    for index in itertools.product(*map(range, value.shape)):
        out[index] = value.at(index)
    return out


def unwrapped(value: Any) -> Any:
    """An array without axes as the node that it holds."""
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value


def is_zero(value: Any) -> bool:
    """Whether a value is known to be zero everywhere."""
    node = value.fill if isinstance(value, View) else value if isinstance(value, Node) else None
    return node is not None and node.op == "const" and node.attr == 0


def is_long(value: Any) -> bool:
    """Whether a value is too large to be written out."""
    return isinstance(value, View) and math.prod(value.shape) > SMALL


def each(graph: Graph, make: Callable[..., Node], *values: Any) -> Any:
    """An operation on every element of values; single numbers, and axes of one element, go with all others."""
    if all(isinstance(v, Node) for v in values):
        return make(*values)
    if any(is_long(v) for v in values) and not any(isinstance(v, np.ndarray) for v in values):
        shape = np.broadcast_shapes(*map(shape_of, values))
        first = make(*(_one(graph, v, (0,) * len(shape)) for v in values))
        return View(shape, first.kind, lambda index: make(*(_one(graph, v, index) for v in values)))
    whole = np.broadcast_arrays(*(np.asarray(solid(graph, v), object) for v in values))
    return np.asarray(np.frompyfunc(make, len(whole), 1)(*whole), object)


def _one(graph: Graph, value: Any, index: Index) -> Node:
    if isinstance(value, Node):
        return value
    return at(graph, value, tuple(0 if n == 1 else i for i, n in zip(index, value.shape, strict=True)))
