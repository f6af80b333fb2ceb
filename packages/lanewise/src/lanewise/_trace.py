"""Interpretation of a jaxpr with nodes in the place of numbers.

While a function is traced, a number is a `Node`, a small array an object array of nodes, anything larger a `LazyArray`. A
view has no elements of its own: it says which node stands at an index, so that a row of a long signal is a load, and an
operation on long arrays is done where its elements are used. `Tracer` runs the equations of a jaxpr by the rules that
`_rules_elementwise`, `_rules_arrays` and `_rules_control` register in `RULES`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from ._graph import Buffer, Graph, Node
from .errors import LoweringError

# `jax.extend.core` is the public place of these classes, but importing it imports Pallas besides, some 7 % of the time that
# a fresh process takes to lower and run its first program. They are taken from where `jax.extend.core` takes them, and from
# the public place where JAX has moved them.
if TYPE_CHECKING:
    from jax.extend.core import ClosedJaxpr as ClosedJaxpr
    from jax.extend.core import Literal as Literal
    from jax.extend.core import Primitive as Primitive
    from jax.extend.core import jaxpr_as_fun as jaxpr_as_fun
else:
    try:
        from jax._src.core import ClosedJaxpr, Literal, Primitive, jaxpr_as_fun  # noqa: F401
    except ImportError:
        from jax.extend.core import ClosedJaxpr, Literal, Primitive, jaxpr_as_fun  # noqa: F401

# ---- values while tracing


SMALL = 64  # elements up to which an array is written out
FEW = 4  # elements up to which one is picked by choices instead of from memory

Place = Any  # an int, or an int node
Index = tuple[Place, ...]
Value = Any  # a node, an array of nodes, a view, or a refusal


class LazyArray:
    """An array whose nodes are created on request; `element_at` takes one int or int node per axis.

    `fill` is the node that stands everywhere, where one does.
    """

    fill: Node | None = None

    def __init__(self, shape: Sequence[int], kind: str, element_at: Callable[[Index], Node]) -> None:
        self.shape, self.kind, self._make = tuple(shape), kind, element_at
        self._made: dict[Index, Node] = {}

    @property
    def touched(self) -> bool:
        """Whether an element has been requested."""
        return bool(self._made)

    def at(self, index: Index) -> Node:
        """The node at an index."""
        node = self._made.get(index)
        if node is None:
            node = self._made[index] = self._make(index)
        return node


class ConstantArray(LazyArray):
    """An array with one node for all its elements."""

    def __init__(self, shape: Sequence[int], fill: Node) -> None:
        super().__init__(shape, fill.kind, lambda index: fill)
        self.fill = self.node = fill


class BufferArray(LazyArray):
    """A whole buffer, in C order; readable after its tokens.

    `written` says that a loop writes every element of it, so that it may stand inside a larger buffer; `sum_of` that it
    began as zeros and was only added to.
    """

    sum_of: AccumulatedArray | None = None

    def __init__(
        self, graph: Graph, buffer: Buffer, shape: Sequence[int], tokens: tuple[Node, ...] = (), written: bool = False
    ) -> None:
        self.graph, self.buffer, self.tokens, self.written = graph, buffer, tokens, written
        super().__init__(shape, buffer.kind, self._at)

    def _at(self, index: Index) -> Node:
        if self.sum_of is not None and self.buffer.within is not None:
            raise NotImplementedError("a long sum is needed by itself, and in a longer one")
        return self.graph.load(self.buffer, flat_index(self.graph, index, self.shape), tokens=self.tokens)


class ConcatenatedArray(LazyArray):
    """Parts one behind the other along the first axis."""

    def __init__(self, graph: Graph, parts: Sequence[Any], shape: Sequence[int], kind: str) -> None:
        self.graph, self.parts = graph, list(parts)
        super().__init__(shape, kind, self._at)

    def _at(self, index: Index) -> Node:
        return element_of_join(self.graph, self.parts, 0, index)


class ScatteredBlocks(LazyArray):
    """Zeros but for some blocks that are added: (start indices, block) each; what a slice's derivative is made of."""

    def __init__(self, graph: Graph, shape: Sequence[int], blocks: list[tuple[Index, Any]]) -> None:
        self.graph, self.blocks = graph, blocks
        super().__init__(shape, "real", self._at)

    def _at(self, index: Index) -> Node:
        g, total = self.graph, self.graph.const(0.0)
        for start, block in self.blocks:
            indices, inside = [], g.const(True, "bool")
            for i, begin, n in zip(index, start, shape_of(block), strict=True):
                place = subtract_index(g, i, begin)
                inside = g.make("and", (inside, is_within(g, place, n)))
                indices.append(clamp_index(g, place, n))
            value = element_at(g, block, tuple(indices))
            total = g.make("add", (total, g.make("select", (inside, value, g.const(0.0)))))
        return total


class AccumulatedArray(LazyArray):
    """A long array that a loop carries and only adds to: its present additions on top of a buffer."""

    def __init__(self, buffer: Buffer, shape: Sequence[int], blocks: tuple[tuple[Index, Any], ...] = ()) -> None:
        self.buffer, self.blocks = buffer, blocks
        self.filled: Node | None = None  # the token of what wrote its beginning
        super().__init__(shape, "real", self._at)

    def _at(self, index: Index) -> Node:
        raise NotImplementedError("an array that a loop changes in place is read while it changes")


def shape_of(value: Value) -> tuple[int, ...]:
    """Shape of a value."""
    return () if isinstance(value, Node) else value.shape


def kind_of(value: Value) -> str:
    """Kind of a value's elements; an array without elements is real."""
    if isinstance(value, np.ndarray):
        return str(value.flat[0].kind) if value.size else "real"
    return str(value.kind)


def flat_index(graph: Graph, index: Index, shape: Sequence[int]) -> Place:
    """Position of an index in C order, an int or an int node."""
    place: Any = 0
    for i, n in zip(index, shape, strict=True):
        place = add_index(graph, scale_index(graph, place, n), i)
    return place


def as_node(graph: Graph, value: Value) -> Node:
    """An index as an int node."""
    return value if isinstance(value, Node) else graph.const(value, "int")


def add_index(graph: Graph, a: Place, b: Place) -> Place:
    """Sum of indices."""
    if isinstance(a, int) and isinstance(b, int):
        return a + b
    return graph.make("add", (as_node(graph, a), as_node(graph, b)))


def subtract_index(graph: Graph, a: Place, b: Place) -> Node:
    """Difference of indices, as a node."""
    return graph.make("sub", (as_node(graph, a), as_node(graph, b)))


def scale_index(graph: Graph, a: Place, b: int) -> Place:
    """Product of an index with a number."""
    return a * b if isinstance(a, int) else graph.make("mul", (a, graph.const(b, "int")))


def clamp_index(graph: Graph, index: Place, rows: int) -> Place:
    """An index within 0 .. rows - 1."""
    low = graph.make("max", (as_node(graph, index), graph.const(0, "int")))
    node = graph.make("min", (low, graph.const(rows - 1, "int")))
    return node.attr if node.op == "const" else node


def is_within(graph: Graph, index: Node, rows: int) -> Node:
    """Whether an index is in 0 .. rows - 1."""
    low = graph.make("le", (graph.const(0, "int"), index))
    return graph.make("and", (low, graph.make("lt", (index, graph.const(rows, "int")))))


def element_at(graph: Graph, value: Value, index: Index) -> Node:
    """An element of a value; the index is within its shape."""
    if isinstance(value, Node):
        return value
    index = tuple(i.attr if isinstance(i, Node) and i.op == "const" else i for i in index)
    if isinstance(value, LazyArray):
        return value.at(index)
    if all(isinstance(i, int) for i in index):
        node: Node = value[index]
        return node
    return _picked(graph, value, index)


def element_of_join(graph: Graph, parts: Sequence[Value], axis: int, index: Index) -> Node:
    """An element of parts that stand one behind the other along an axis; the index is within their joint shape."""
    begin, chosen = 0, None
    for part in parts:
        rows = shape_of(part)[axis]
        if isinstance(index[axis], int):
            if begin <= index[axis] < begin + rows:
                return element_at(graph, part, (*index[:axis], index[axis] - begin, *index[axis + 1 :]))
        elif rows:
            place = subtract_index(graph, index[axis], begin)
            low, high = place.value_range
            if high >= 0 and low < rows:
                value = element_at(graph, part, (*index[:axis], clamp_index(graph, place, rows), *index[axis + 1 :]))
                inside = graph.make("le", (graph.const(0, "int"), place))
                chosen = value if chosen is None else graph.make("select", (inside, value, chosen))
        begin += rows
    if chosen is None:
        raise IndexError("no element there")
    return chosen


def _picked(graph: Graph, value: np.ndarray, index: Index) -> Node:
    """Element of an array of nodes at an index that is known at run time only."""
    fixed = tuple(i if isinstance(i, int) else slice(None) for i in index)
    part, moving = value[fixed], tuple(i for i in index if not isinstance(i, int))
    flattened, place = part.ravel(), flat_index(graph, moving, part.shape)
    if len(flattened) <= FEW:
        node: Node = flattened[-1]
        for k in range(len(flattened) - 2, -1, -1):
            reached = graph.make("le", (place, graph.const(k, "int")))
            node = graph.make("select", (reached, flattened[k], node))
        return node
    return store_table(graph, flattened).at((place,))


def store_table(graph: Graph, value: np.ndarray) -> BufferArray:
    """An array of nodes in memory, so that it can be read at any index."""
    flattened = tuple(value.ravel())
    kind = flattened[0].kind
    if all(n.op == "const" for n in flattened):
        data = np.array([n.attr for n in flattened])
        for known in graph.buffers:
            if known.role == "constant" and known.kind == kind and np.array_equal(known.data, data):
                return BufferArray(graph, known, value.shape)
        return BufferArray(graph, graph.buffer("constant", kind, (len(data),), data=data), value.shape)
    key = ("table", kind, tuple(n.serial for n in flattened))
    token = graph.lookup(key)
    if token is None:
        token = graph.intern(key, "table", flattened, graph.buffer("scratch", kind, (len(flattened),)), "token")
    return BufferArray(graph, token.attr, value.shape, (token,))


def materialise(graph: Graph, value: Value) -> Value:
    """A value with its elements written out."""
    if not isinstance(value, LazyArray):
        return value
    out = np.empty(value.shape, object)
    for index in itertools.product(*map(range, value.shape)):
        out[index] = value.at(index)
    return out


def unwrap_scalar(value: Value) -> Value:
    """An array without axes as the node that it holds."""
    return value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value


def is_zero(value: Value) -> bool:
    """Whether a value is known to be zero everywhere."""
    node = value.fill if isinstance(value, LazyArray) else value if isinstance(value, Node) else None
    return node is not None and node.op == "const" and node.attr == 0


def is_long(value: Value) -> bool:
    """Whether a value is too large to be written out."""
    return isinstance(value, LazyArray) and math.prod(value.shape) > SMALL


def elementwise(graph: Graph, make: Callable[..., Node], *values: Value) -> Value:
    """An operation on every element of values; single numbers, and axes of one element, go with all others."""
    if all(isinstance(v, Node) for v in values):
        return make(*values)
    if any(is_long(v) for v in values) and not any(isinstance(v, np.ndarray) for v in values):
        shape = np.broadcast_shapes(*map(shape_of, values))
        first = make(*(_one(graph, v, (0,) * len(shape)) for v in values))
        return LazyArray(shape, first.kind, lambda index: make(*(_one(graph, v, index) for v in values)))
    whole = np.broadcast_arrays(*(np.asarray(materialise(graph, v), object) for v in values))
    return np.asarray(np.frompyfunc(make, len(whole), 1)(*whole), object)


def _one(graph: Graph, value: Any, index: Index) -> Node:
    if isinstance(value, Node):
        return value
    return element_at(graph, value, tuple(0 if n == 1 else i for i, n in zip(index, value.shape, strict=True)))


# ---- the tracer


LoweringRule = Callable[..., Any]  # (tracer, eqn, *values) -> a value, or a list where there are several
RULES: dict[str, LoweringRule] = {}


class Refusal(NamedTuple):
    """The value of an operation that cannot be lowered: an error as soon as a result depends on it."""

    why: LoweringError


def rule(*names: str) -> Callable[[LoweringRule], LoweringRule]:
    """Register what becomes of primitives."""

    def registered(function: LoweringRule) -> LoweringRule:
        RULES.update(dict.fromkeys(names, function))
        return function

    return registered


KINDS: dict[Any, str | None] = {np.dtype(name): "int" for name in ("int64", "int32", "int16", "int8")}
KINDS |= {np.dtype(np.float64): "real", np.dtype(np.bool_): "bool", jax.dtypes.float0: None}


def kind_of_dtype(dtype: Any) -> str | None:
    """Kind of node for a type of JAX: None for one that carries nothing, KeyError for one that is not lowered."""
    return KINDS[dtype]


def checked_kind(dtype: Any, what: str) -> str | None:
    """Kind of node for a type of JAX; refuses one that cannot be lowered, naming what has it."""
    try:
        return kind_of_dtype(dtype)
    except KeyError:
        raise LoweringError(what, "float64, integers and truth values can be lowered", f"it is {dtype}") from None


class Tracer:
    """Interprets jaxprs; all values are nodes, arrays of nodes, views, or `Refusal`."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.calls: list[Any] = []  # operations in work, from the outermost in
        self.slopes: dict[Any, Any] = {}  # derivatives that functions say themselves, by call and input
        self._results: dict[Any, tuple[Any, list[Value]]] = {}  # of calls, by function, arguments and exactness

    def closed(self, closed: ClosedJaxpr, values: Sequence[Value]) -> list[Value]:
        """Results of a jaxpr with its constants."""
        return self.run(closed.jaxpr, [self.constant(c) for c in closed.consts], values)

    def call(self, closed: ClosedJaxpr, values: Sequence[Value]) -> list[Value]:
        """Results of a function that JAX has traced once for all its calls; it is followed once per arguments.

        Following it again would find the same nodes, since a graph has none twice. Loops and memory are made anew instead,
        and a refusal names the call that it comes from.
        """
        if not all(isinstance(v, Node) for v in values):
            return self.closed(closed, values)
        key = id(closed), self.graph.exact, tuple(v.serial for v in values)
        if key not in self._results:
            before = self.graph.effects
            results = self.closed(closed, values)
            if self.graph.effects != before or any(isinstance(v, Refusal) for v in results):
                return results
            self._results[key] = closed, results
        return self._results[key][1]

    def constant(self, value: Any) -> Any:
        """Return a known number or array as a value."""
        if type(value) in (float, int, bool):
            return self.graph.const(value, {float: "real", int: "int", bool: "bool"}[type(value)])
        array = np.asarray(value)
        if array.ndim == 0:
            return self.graph.const(array.item(), checked_kind(array.dtype, "constant") or "bool")
        kind = checked_kind(array.dtype, "constant") or "bool"
        if array.size > SMALL:
            buffer = self.graph.buffer("constant", kind, (array.size,), data=array.ravel())
            return BufferArray(self.graph, buffer, array.shape)
        out = np.empty(array.shape, object)
        for index in np.ndindex(array.shape):
            out[index] = self.graph.const(array[index].item(), kind)
        return unwrap_scalar(out)

    def run(self, jaxpr: Any, consts: Sequence[Value], values: Sequence[Value]) -> list[Value]:
        """Results of a jaxpr."""
        known: dict[Any, Any] = {}

        def read(v: Any) -> Any:
            return self.constant(v.val) if isinstance(v, Literal) else known[v]

        known.update(zip(jaxpr.constvars, consts, strict=True))
        known.update(zip(jaxpr.invars, values, strict=True))
        for eqn in jaxpr.eqns:
            results = self.equation(eqn, read)
            for var, value in zip(eqn.outvars, results, strict=True):
                known[var] = value
        return [read(v) for v in jaxpr.outvars]

    def equation(self, eqn: Any, read: Callable[[Any], Any]) -> list[Any]:
        """Results of one operation; refusals are passed on, for what is refused may not be needed."""
        name = eqn.primitive.name
        inner, depth = name in CALLS, self.graph.depth
        refused = [v for v in (read(x) for x in eqn.invars if not isinstance(x, Literal)) if isinstance(v, Refusal)]
        if refused and not inner:
            return [refused[0]] * len(eqn.outvars)
        self.calls.append(eqn)
        try:
            values = [read(x) for x in eqn.invars]
            for var in eqn.outvars:
                if not inner and var.aval.dtype not in KINDS:
                    raise self.refusal(
                        eqn, f"it makes {var.aval.dtype}; float64, integers and truth values can be lowered"
                    )
            made = RULES.get(name)
            if made is None:
                raise self.refusal(eqn, "no kernel can do that")
            results = made(self, eqn, *values)
        except LoweringError as error:
            self.graph.unwind(depth)
            return [Refusal(error)] * len(eqn.outvars)
        except NotImplementedError as error:
            self.graph.unwind(depth)
            return [Refusal(self.refusal(eqn, str(error)))] * len(eqn.outvars)
        finally:
            self.calls.pop()
        return results if isinstance(results, list) else [results]

    def refusal(self, eqn: Any, why: str) -> LoweringError:
        """Error for an operation that cannot be lowered, with its place in the source."""
        # a function of JAX's own is traced once, and remembers where it was called first: what counts is its call
        inside = next((k for k, e in enumerate(self.calls) if _of_jax(e)), len(self.calls))
        places = (source_location(e) for e in (*reversed(self.calls[: inside + 1]), eqn))
        return LoweringError(eqn.primitive.name, why, source=next((p for p in places if p), None))

    def result(self, value: Any, leaf: Any, name: str) -> Buffer | None:
        """Store a result of the whole function in a buffer."""
        if isinstance(value, Refusal):
            raise value.why
        kind = kind_of_dtype(leaf.dtype)
        if kind is None:
            return None
        buffer = self.graph.buffer("result", kind, leaf.shape, name)
        self.write(value, buffer, 0)
        return buffer

    def write(self, value: Any, buffer: Buffer, offset: int) -> None:
        """Write a value into a buffer from an offset, outside of all loops.

        Stacked results of a loop are computed in place.
        """
        if isinstance(value, ConcatenatedArray):
            for part in value.parts:
                self.write(part, buffer, offset)
                offset += math.prod(shape_of(part))
        elif (
            isinstance(value, BufferArray)
            and value.buffer.role == "scratch"
            and value.buffer.within is None
            and value.written
        ):
            value.buffer.within = (buffer, offset, None, 0)
        else:
            copy_elements(self.graph, value, lambda place, node: self.graph.store(buffer, place, node, offset=offset))


def copy_elements(graph: Graph, value: Value, put: Callable[[Place, Node], None], pinned: bool = False) -> None:
    """Give every element of a value with its place in C order to `put`, by loops where there are many.

    `pinned` ones are run again in every trip of the loops that are open, and are loops however few elements there are.
    """

    def walk(begin: tuple[Any, ...], place: Any, rest: tuple[int, ...]) -> None:
        if not rest:
            put(place, element_at(graph, value, begin))
            return
        size, inner = rest[0], math.prod(rest[1:])
        if size * inner <= 32 and not (pinned and not begin):
            for i in range(size):
                walk((*begin, i), add_index(graph, place, i * inner), rest[1:])
        elif size:
            loop = graph.open_loop(size)
            walk((*begin, loop.index), add_index(graph, place, scale_index(graph, loop.index, inner)), rest[1:])
            if pinned:
                graph.pin()
            graph.close_loop(loop, ())

    if pinned or is_long(value):
        walk((), 0, value.shape)
        return
    value = materialise(graph, value)
    for place, node in enumerate([value] if isinstance(value, Node) else value.ravel()):
        put(place, node)


def _of_jax(eqn: Any) -> bool:
    """Whether it is a call of a function of JAX's own."""
    if eqn.primitive.name not in ("jit", "pjit"):
        return False
    try:
        return "jax" in Path(eqn.params["jaxpr"].jaxpr.debug_info.func_src_info.split(" at ")[-1]).parts
    except (AttributeError, KeyError):
        return True


def source_location(eqn: Any) -> str | None:
    """File, line and function in which an operation is written; None if JAX does not know."""
    try:
        from jax._src import source_info_util

        frames = list(source_info_util.user_frames(eqn.source_info.traceback))
    except (ImportError, AttributeError, TypeError):
        return None
    frames = [f for f in frames if not any(library in f.file_name for library in WRAPPERS)] or frames
    if not frames:
        return None
    frame = frames[0]
    return f"{_short_path(Path(frame.file_name))}, line {frame.start_line}, {frame.function_name}"


def _short_path(path: Path) -> str:
    """A path from the top-level package that the file belongs to, or the name of a file that belongs to none."""
    root = path.parent
    while (root / "__init__.py").is_file():
        root = root.parent
    return path.relative_to(root).as_posix()


WRAPPERS = ("equinox",)  # libraries that call the functions of others
CALLS = frozenset(
    {"jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr", "remat2",
     "checkpoint", "custom_linear_solve", "scan", "while", "cond"}
)  # fmt: skip
