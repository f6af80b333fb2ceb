"""From a JAX function to a graph: its jaxpr is interpreted with nodes in the place of numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Literal

from ...errors import LoweringError
from .arrays import SMALL, Joined, Rows, View, at, is_long, shape_of, solid, unwrapped
from .graph import Buffer, Graph, Node

Rule = Callable[..., Any]  # (tracer, eqn, *values) -> a value, or a list where there are several
RULES: dict[str, Rule] = {}


class Refused(NamedTuple):
    """The value of an operation that cannot be lowered: an error as soon as a result depends on it."""

    why: LoweringError


class Traced(NamedTuple):
    """A function as a graph; a leaf without a buffer carries nothing (the tangent of a whole number).

    Attributes:
        graph: exact, with dead nodes.
        arguments: buffers of the leaves of the arguments.
        results: the same for the results.
        tree: structure of the results, for JAX.
        shapes: of the results' leaves.
    """

    graph: Graph
    arguments: list[Buffer]
    results: list[Buffer | None]
    tree: Any
    shapes: list[tuple[int, ...]]


def rule(*names: str) -> Callable[[Rule], Rule]:
    """Register what becomes of primitives."""

    def registered(function: Rule) -> Rule:
        RULES.update(dict.fromkeys(names, function))
        return function

    return registered


KINDS: dict[Any, str | None] = {np.dtype(name): "int" for name in ("int64", "int32", "int16", "int8")}
KINDS |= {np.dtype(np.float64): "real", np.dtype(np.bool_): "bool", jax.dtypes.float0: None}


def kind_of_dtype(dtype: Any) -> str | None:
    """Kind of node for a type of JAX: None for one that carries nothing, KeyError for one that is not lowered."""
    return KINDS[dtype]


def trace(function: Callable[..., Any], *examples: Any) -> Traced:
    """A function of trees as a graph.

    Args:
        function: a JAX function; what it closes over is part of it.
        *examples: trees like its arguments; only shapes and types of their leaves matter.

    Raises:
        LoweringError: an operation that no kernel can do; names it and where it is written.
    """
    from . import rules_arrays, rules_control, rules_gather, rules_linear, rules_loops, rules_numbers, rules_reduce  # noqa: F401

    shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(jnp.shape(x), jnp.result_type(x)), examples)
    closed, out = jax.make_jaxpr(function, return_shape=True)(*shapes)
    tracer = Tracer(Graph())
    arguments, values = [], []
    for (path, leaf), var in zip(jax.tree.leaves_with_path(shapes), closed.jaxpr.invars, strict=True):
        name = _named(path)
        kind = _kind(var.aval.dtype, f"argument {name}")
        buffer = tracer.graph.buffer("argument", kind or "real", leaf.shape, name)
        arguments.append(buffer)
        rows: Any = Rows(tracer.graph, buffer, leaf.shape)
        values.append(rows if leaf.shape else rows.at(()))
    found = tracer.closed(closed, values)
    leaves = jax.tree.leaves_with_path(out)
    results = [tracer.result(v, leaf, _named(path, "result")) for v, (path, leaf) in zip(found, leaves, strict=True)]
    return Traced(tracer.graph, arguments, results, jax.tree.structure(out), [leaf.shape for _, leaf in leaves])


def _named(path: Any, whole: str = "argument") -> str:
    text: str = jax.tree_util.keystr(path)
    return text or whole


def _kind(dtype: Any, what: str) -> str | None:
    try:
        return kind_of_dtype(dtype)
    except KeyError:
        raise LoweringError(what, "float64, integers and truth values can be lowered", f"it is {dtype}") from None


class Tracer:
    """Interprets jaxprs; all values are those of `arrays`, or `Refused`."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.calls: list[Any] = []  # operations in work, from the outermost in
        self.slopes: dict[Any, Any] = {}  # derivatives that functions say themselves, by call and input

    def closed(self, closed: ClosedJaxpr, values: Sequence[Any]) -> list[Any]:
        """Results of a jaxpr with its constants."""
        return self.run(closed.jaxpr, [self.constant(c) for c in closed.consts], values)

    def constant(self, value: Any) -> Any:
        """A number or an array that is known."""
        if type(value) in (float, int, bool):
            return self.graph.const(value, {float: "real", int: "int", bool: "bool"}[type(value)])
        array = np.asarray(value)
        if array.ndim == 0:
            return self.graph.const(array.item(), _kind(array.dtype, "constant") or "bool")
        kind = _kind(array.dtype, "constant") or "bool"
        if array.size > SMALL:
            buffer = self.graph.buffer("constant", kind, (array.size,), data=array.ravel())
            return Rows(self.graph, buffer, array.shape)
        out = np.empty(array.shape, object)
        for index in np.ndindex(array.shape):
            out[index] = self.graph.const(array[index], kind)
        return unwrapped(out)

    def run(self, jaxpr: Any, consts: Sequence[Any], values: Sequence[Any]) -> list[Any]:
        """Results of a jaxpr."""
        known: dict[Any, Any] = {}

        def read(v: Any) -> Any:
            return self.constant(v.val) if isinstance(v, Literal) else known[v]

        known.update(zip(jaxpr.constvars, consts, strict=True))
        known.update(zip(jaxpr.invars, values, strict=True))
        for eqn in jaxpr.eqns:
            found = self.equation(eqn, read)
            for var, value in zip(eqn.outvars, found, strict=True):
                known[var] = value
        return [read(v) for v in jaxpr.outvars]

    def equation(self, eqn: Any, read: Callable[[Any], Any]) -> list[Any]:
        """Results of one operation; refusals are passed on, for what is refused may not be needed."""
        name = eqn.primitive.name
        inner, depth = name in CALLS, self.graph.depth
        refused = [v for v in (read(x) for x in eqn.invars if not isinstance(x, Literal)) if isinstance(v, Refused)]
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
            found = made(self, eqn, *values)
        except LoweringError as error:
            self.graph.unwind(depth)
            return [Refused(error)] * len(eqn.outvars)
        except NotImplementedError as error:
            self.graph.unwind(depth)
            return [Refused(self.refusal(eqn, str(error)))] * len(eqn.outvars)
        finally:
            self.calls.pop()
        return found if isinstance(found, list) else [found]

    def refusal(self, eqn: Any, why: str) -> LoweringError:
        """Why an operation cannot be lowered, with the place where it is written."""
        # a function of JAX's own is traced once, and remembers where it was called first: what counts is its call
        inside = next((k for k, e in enumerate(self.calls) if _of_jax(e)), len(self.calls))
        places = (written_at(e) for e in (*reversed(self.calls[: inside + 1]), eqn))
        return LoweringError(eqn.primitive.name, why, where=next((p for p in places if p), None))

    def result(self, value: Any, leaf: Any, name: str) -> Buffer | None:
        """Put a result of the whole function into memory of its own."""
        if isinstance(value, Refused):
            raise value.why
        kind = kind_of_dtype(leaf.dtype)
        if kind is None:
            return None
        buffer = self.graph.buffer("result", kind, leaf.shape, name)
        self.write(value, buffer, 0)
        return buffer

    def write(self, value: Any, buffer: Buffer, offset: int) -> None:
        """Put a value into a buffer from an element on, outside of all loops; what a loop stacks is made there at once."""
        if isinstance(value, Joined):
            for part in value.parts:
                self.write(part, buffer, offset)
                offset += math.prod(shape_of(part))
        elif (
            isinstance(value, Rows) and value.buffer.role == "scratch" and value.buffer.within is None and value.written
        ):
            value.buffer.within = (buffer, offset, None, 0)
        else:
            copy(self.graph, value, lambda place, node: self.graph.store(buffer, place, node, offset=offset))


def copy(graph: Graph, value: Any, put: Callable[[Any, Node], None]) -> None:
    """Give every element of a value with its place in C order to `put`, by loops where there are many."""
    from .arrays import plus, times

    def walk(begin: tuple[Any, ...], place: Any, rest: tuple[int, ...]) -> None:
        if not rest:
            put(place, at(graph, value, begin))
            return
        size, inner = rest[0], math.prod(rest[1:])
        if size * inner <= 32:
            for i in range(size):
                walk((*begin, i), plus(graph, place, i * inner), rest[1:])
        elif size:
            loop = graph.open_loop(size)
            walk((*begin, loop.index), plus(graph, place, times(graph, loop.index, inner)), rest[1:])
            graph.close_loop(loop, ())

    if is_long(value):
        walk((), 0, value.shape)
        return
    value = solid(graph, value)
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


def written_at(eqn: Any) -> str | None:
    """File, line and function in which an operation is written; None where JAX does not know."""
    try:
        from jax._src import source_info_util

        frames = list(source_info_util.user_frames(eqn.source_info.traceback))
    except (ImportError, AttributeError, TypeError):
        return None
    frames = [f for f in frames if "equinox" not in f.file_name] or frames
    if not frames:
        return None
    first = frames[0]
    path = Path(first.file_name)
    short = "/".join(path.parts[path.parts.index("mckibben") + 1 :]) if "mckibben" in path.parts[:-1] else path.name
    return f"{short}, line {first.start_line}, {first.function_name}"


CALLS = frozenset(
    {"jit", "pjit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr", "remat2",
     "checkpoint", "custom_linear_solve", "scan", "while", "cond"}
)  # fmt: skip
__all__ = ["CALLS", "RULES", "Refused", "Traced", "Tracer", "View", "copy", "rule", "trace"]
