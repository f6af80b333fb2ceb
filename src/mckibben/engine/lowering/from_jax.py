"""From a JAX function to a program: the one step that needs JAX."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .graph import growing
from .program import Leaf, Program
from .rewrite import rewritten
from .trace import trace


@growing()
def lower(function: Callable[..., Any], *examples: Any, title: str = "") -> tuple[Program, Any]:
    """A JAX function as a program, and the tree structure of its results.

    Args:
        function: of trees of numbers and arrays, made of arithmetic, choices, calls and counted loops, such as
            `engine.march` with its whole numbers fixed, or a derivative of it.
        *examples: trees like its arguments; shapes and types count, values do not.
        title: what errors call it.

    Raises:
        LoweringError: an operation that no kernel can do; names it and where it is written.
    """
    traced = trace(function, *examples)
    graph = rewritten(traced.graph, lambda g, node, args: None, exact=True)
    arguments = [Leaf(b.name, b.kind, b.shape) for b in traced.arguments]
    results = [
        Leaf("" if b is None else b.name, None if b is None else b.kind, shape)
        for b, shape in zip(traced.results, traced.shapes, strict=True)
    ]
    return Program(graph, arguments, results, title), traced.tree
