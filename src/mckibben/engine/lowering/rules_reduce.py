"""What becomes of sums, extremes and their places."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .arrays import SMALL, at, is_long, kind_of, shape_of, solid, unwrapped
from .graph import Graph, Node
from .rules_arrays import shaped
from .trace import Tracer, rule

REDUCE = {"reduce_sum": "add", "reduce_max": "max", "reduce_min": "min", "reduce_prod": "mul", "reduce_and": "and",
          "reduce_or": "or", "cumsum": "add", "cumprod": "mul", "cummax": "max", "cummin": "min"}  # fmt: skip


@rule("reduce_sum", "reduce_max", "reduce_min", "reduce_prod", "reduce_and", "reduce_or")
def _reduce(t: Tracer, eqn: Any, a: Any) -> Any:
    g, op, axes = t.graph, REDUCE[eqn.primitive.name], tuple(eqn.params["axes"])
    if not axes:
        return a
    sizes = shape_of(a)
    kept = [d for d in range(len(sizes)) if d not in axes]
    many = math.prod(sizes[d] for d in axes)

    def element(index: tuple[Any, ...]) -> Node:
        def place(part: tuple[Any, ...]) -> tuple[Any, ...]:
            known = dict(zip(kept, index, strict=True)) | dict(zip(axes, part, strict=True))
            return tuple(known[d] for d in range(len(sizes)))

        if many <= SMALL:
            nodes = [at(g, a, place(part)) for part in itertools.product(*(range(sizes[d]) for d in axes))]
            found = nodes[0] if nodes else _empty(g, op)
            for node in nodes[1:]:
                found = g.make(op, (found, node))
            return found
        return _looped(g, op, lambda part: at(g, a, place(part)), [sizes[d] for d in axes])

    return shaped(g, tuple(sizes[d] for d in kept), kind_of(a), element)


def _empty(g: Graph, op: str) -> Node:
    known = {"add": 0.0, "mul": 1.0, "max": -math.inf, "min": math.inf}
    return g.const(known[op]) if op in known else g.const(op == "and", "bool")


def _looped(g: Graph, op: str, element: Callable[[tuple[Any, ...]], Node], sizes: list[int]) -> Node:
    """A reduction of many elements: a loop over the first axis, which carries the result."""
    first = element((0,) * len(sizes))
    start = first if op in ("max", "min") else g.const(_empty(g, op).attr, first.kind)
    loop = g.open_loop(sizes[0])
    found = carried = g.carry(loop, start)
    for rest in itertools.product(*map(range, sizes[1:])):
        found = g.make(op, (found, element((loop.index, *rest))))
    assert carried.kind == found.kind
    return g.close_loop(loop, [found])[0]


@rule("cumsum", "cumprod", "cummax", "cummin")
def _cumulative(t: Tracer, eqn: Any, a: Any) -> Any:
    op, axis = REDUCE[eqn.primitive.name], eqn.params["axis"]
    if is_long(a):
        raise NotImplementedError("running sums of long arrays have no kernel; carry them through a scan")
    a = np.moveaxis(solid(t.graph, a), axis, 0).copy()
    order = range(len(a) - 2, -1, -1) if eqn.params["reverse"] else range(1, len(a))
    for k in order:
        before = a[k + 1] if eqn.params["reverse"] else a[k - 1]
        pair = np.frompyfunc(lambda x, y: t.graph.make(op, (x, y)), 2, 1)
        a[k] = pair(before, a[k])
    return np.moveaxis(a, 0, axis)


@rule("argmax", "argmin")
def _argument(t: Tracer, eqn: Any, a: Any) -> Any:
    g, (axis,) = t.graph, eqn.params["axes"]
    if is_long(a):
        raise NotImplementedError("the place of an extreme of a long array has no kernel")
    less = eqn.primitive.name == "argmin"
    moved = np.moveaxis(solid(g, a), axis, 0)

    def one(*nodes: Node) -> Node:
        best, place = nodes[0], g.const(0, "int")
        for k, node in enumerate(nodes[1:], 1):
            if node.kind == "bool":
                better = (
                    g.make("and", (node, g.make("not", (best,))))
                    if not less
                    else g.make("and", (best, g.make("not", (node,))))
                )
            else:
                better = g.make("lt", (node, best) if less else (best, node))
            best = g.make("select", (better, node, best))
            place = g.make("select", (better, g.const(k, "int"), place))
        return place

    return unwrapped(np.asarray(np.frompyfunc(one, len(moved), 1)(*moved), object))
