"""Lowering of JAX functions to programs; with `_trace` and the rules the only part that needs JAX."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from . import _rules_arrays, _rules_control, _rules_elementwise  # noqa: F401 - they register what becomes of operations
from ._analysis import rewrite
from ._graph import Buffer, Graph, gc_paused
from ._program import Leaf, Program
from ._trace import BufferArray, Tracer, checked_kind

Tree = Any  # numbers and arrays in tuples, lists, tables and classes that JAX knows as trees


class TracedFunction(NamedTuple):
    """A function as a graph; a leaf without a buffer carries nothing (the tangent of a whole number).

    Attributes:
        graph: exact, with dead nodes.
        arguments: buffers of the leaves of the arguments.
        results: the same for the results.
        tree: structure of the results, for JAX.
        shapes: shapes of the results' leaves.
    """

    graph: Graph
    arguments: list[Buffer]
    results: list[Buffer | None]
    tree: jax.tree_util.PyTreeDef
    shapes: list[tuple[int, ...]]


def trace(function: Callable[..., Tree], *examples: Tree) -> TracedFunction:
    """Trace a function of trees to a graph.

    Args:
        function: a JAX function; what it closes over is part of it.
        *examples: trees like its arguments; only shapes and types of their leaves matter.

    Raises:
        LoweringError: an operation that no kernel can do; names it and where it is written.
    """
    shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(jnp.shape(x), jnp.result_type(x)), examples)
    closed, out = jax.make_jaxpr(function, return_shape=True)(*shapes)
    tracer = Tracer(Graph())
    arguments, values = [], []
    for (path, leaf), var in zip(jax.tree.leaves_with_path(shapes), closed.jaxpr.invars, strict=True):
        name = _path_name(path)
        kind = checked_kind(var.aval.dtype, f"argument {name}")
        buffer = tracer.graph.buffer("argument", kind or "real", leaf.shape, name)
        arguments.append(buffer)
        rows: Any = BufferArray(tracer.graph, buffer, leaf.shape)
        values.append(rows if leaf.shape else rows.at(()))
    outputs = tracer.closed(closed, values)
    leaves = jax.tree.leaves_with_path(out)
    results = [
        tracer.result(v, leaf, _path_name(path, "result")) for v, (path, leaf) in zip(outputs, leaves, strict=True)
    ]
    return TracedFunction(tracer.graph, arguments, results, jax.tree.structure(out), [leaf.shape for _, leaf in leaves])


def _path_name(path: Any, whole: str = "argument") -> str:
    text: str = jax.tree_util.keystr(path)
    return text or whole


@gc_paused()
def lower(function: Callable[..., Tree], *examples: Tree, title: str = "") -> tuple[Program, jax.tree_util.PyTreeDef]:
    """Lower a JAX function to a program; return it with the tree structure of the results.

    Args:
        function: function of trees of numbers and arrays, made of arithmetic, choices, calls and counted loops, such as
            a fixed-step integration with its number of steps fixed, or a derivative of it.
        *examples: trees like its arguments; shapes and types count, values do not.
        title: its name in error messages.

    Raises:
        LoweringError: an operation that no kernel can do; names it and where it is written.
    """
    traced = trace(function, *examples)
    graph = rewrite(traced.graph, lambda g, node, args: None, exact=True)
    arguments = [Leaf(b.name, b.kind, b.shape) for b in traced.arguments]
    results = [
        Leaf("" if b is None else b.name, None if b is None else b.kind, shape)
        for b, shape in zip(traced.results, traced.shapes, strict=True)
    ]
    return Program(graph, arguments, results, title), traced.tree
