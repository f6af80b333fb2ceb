"""What becomes of linear algebra, written out for the small matrices of a stiff step."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from .arrays import at, each, is_long, kind_of, shape_of, solid, unwrapped
from .graph import Graph, Node
from .rules_arrays import shaped
from .trace import Tracer, rule

LARGEST = 48  # rows of a matrix that is still written out


@rule("dot_general")
def _dot_general(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    g, ((by_a, by_b), (batch_a, batch_b)) = t.graph, eqn.params["dimension_numbers"]
    if is_long(a) and is_long(b):
        raise NotImplementedError("matrices of this size have no kernel")
    free_a = [d for d in range(len(shape_of(a))) if d not in by_a and d not in batch_a]
    free_b = [d for d in range(len(shape_of(b))) if d not in by_b and d not in batch_b]
    sums = [shape_of(a)[d] for d in by_a]

    def element(index: tuple[Any, ...]) -> Node:
        n, m = len(batch_a), len(batch_a) + len(free_a)
        at_a: dict[int, Any] = dict(zip(batch_a, index[:n], strict=True)) | dict(zip(free_a, index[n:m], strict=True))
        at_b: dict[int, Any] = dict(zip(batch_b, index[:n], strict=True)) | dict(zip(free_b, index[m:], strict=True))
        total = g.const(0.0)
        for part in itertools.product(*map(range, sums)):
            x = at_a | dict(zip(by_a, part, strict=True))
            y = at_b | dict(zip(by_b, part, strict=True))
            left = at(g, a, tuple(x[d] for d in range(len(x))))
            right = at(g, b, tuple(y[d] for d in range(len(y))))
            total = g.make("add", (total, g.make("mul", (left, right))))
        return total

    return shaped(g, tuple(eqn.outvars[0].aval.shape), "real", element)


@rule("lu")
def _lu(t: Tracer, eqn: Any, a: Any) -> Any:
    """Gaussian elimination with the largest pivot of each column, rows exchanged by choices."""
    g = t.graph
    a = solid(g, a).copy()
    n = a.shape[-1]
    if a.ndim != 2 or a.shape[0] != n or n > LARGEST:
        raise NotImplementedError(f"only one square matrix of up to {LARGEST} rows is factorised")
    order = np.array([g.const(i, "int") for i in range(n)], object)
    pivots = np.empty(n, object)
    for k in range(n):
        best, place = g.make("abs", (a[k, k],)), g.const(k, "int")
        for i in range(k + 1, n):
            size = g.make("abs", (a[i, k],))
            larger = g.make("lt", (best, size))
            best, place = g.make("select", (larger, size, best)), g.make("select", (larger, g.const(i, "int"), place))
        pivots[k] = place
        for i in range(k + 1, n):
            swap = g.make("eq", (place, g.const(i, "int")))
            for row in (a, order[:, None]):
                for j in range(row.shape[1]):
                    x, y = row[k, j], row[i, j]
                    row[k, j], row[i, j] = g.make("select", (swap, y, x)), g.make("select", (swap, x, y))
        for i in range(k + 1, n):
            a[i, k] = g.make("div", (a[i, k], a[k, k]))
            for j in range(k + 1, n):
                a[i, j] = g.make("sub", (a[i, j], g.make("mul", (a[i, k], a[k, j]))))
    return [a, pivots, order]


@rule("triangular_solve")
def _triangular_solve(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    p, g = eqn.params, t.graph
    a, b = solid(g, a), solid(g, b)
    if a.ndim != 2 or len(a) > LARGEST:
        raise NotImplementedError(f"only one matrix of up to {LARGEST} rows is solved")
    if p["transpose_a"]:
        a = a.T
    lower = p["lower"] != p["transpose_a"]
    if not p["left_side"]:
        return _solved(g, a.T, b.T, not lower, p["unit_diagonal"]).T
    return _solved(g, a, b, lower, p["unit_diagonal"])


def _solved(g: Graph, a: np.ndarray, b: np.ndarray, lower: bool, unit: bool) -> np.ndarray:
    x, n = b.copy(), len(a)
    for i in range(n) if lower else range(n - 1, -1, -1):
        for c in range(x.shape[1]):
            for j in range(i) if lower else range(i + 1, n):
                x[i, c] = g.make("sub", (x[i, c], g.make("mul", (a[i, j], x[j, c]))))
            if not unit:
                x[i, c] = g.make("div", (x[i, c], a[i, i]))
    return x


@rule("custom_linear_solve")
def _custom_linear_solve(t: Tracer, eqn: Any, *values: Any) -> Any:
    lengths, jaxprs = eqn.params["const_lengths"], eqn.params["jaxprs"]
    parts, begin = {}, 0
    for name in lengths._fields:
        count = getattr(lengths, name)
        parts[name] = values[begin : begin + count]
        begin += count
    wanted = [solid(t.graph, v) for v in values[begin:]]
    if any(kind_of(x) != "real" for x in wanted):
        return [unwrapped(v) for v in t.closed(jaxprs.solve, [*parts["solve"], *wanted])]
    # JAX's factors have no derivatives; those of the solution are those of what a correction by the residual would add
    g = t.graph
    alone = lambda x: g.make("given", (x,), kind="real")  # noqa: E731
    found = [unwrapped(v) for v in t.closed(jaxprs.solve, [*parts["solve"], *(each(g, alone, b) for b in wanted)])]
    still = [each(g, alone, x) for x in found]
    left = t.closed(jaxprs.matvec, [*parts["matvec"], *still])
    rest = [each(g, lambda b, ax: g.make("sub", (b, ax)), *pair) for pair in zip(wanted, left, strict=True)]
    more = t.closed(jaxprs.solve, [*parts["solve"], *rest])
    told = lambda x, y: g.make("given", (x, y, g.const(1.0)), kind="real")  # noqa: E731
    return [unwrapped(each(g, told, x, y)) for x, y in zip(found, more, strict=True)]
