"""Rules of the operations on numbers: elementwise arithmetic, reductions, and small linear algebra."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ._graph import Graph, Node
from ._rules_arrays import make_array
from ._trace import (
    RULES,
    SMALL,
    AccumulatedArray,
    BufferArray,
    ScatteredBlocks,
    Tracer,
    element_at,
    elementwise,
    is_long,
    is_zero,
    kind_of,
    kind_of_dtype,
    materialise,
    rule,
    shape_of,
    unwrap_scalar,
)

# ---- elementwise


def _plain(op: str) -> Any:
    return lambda t, eqn, *values: elementwise(t.graph, lambda *n: t.graph.make(op, n), *values)


for _name in (
    "sub",
    "mul",
    "max",
    "min",
    "neg",
    "abs",
    "sqrt",
    "floor",
    "ceil",
    "exp",
    "expm1",
    "log",
    "log1p",
    "pow",
    "sin",
    "cos",
    "eq",
    "ne",
    "lt",
    "le",
):
    RULES[_name] = _plain(_name)
RULES["lt_to"], RULES["le_to"] = RULES["lt"], RULES["le"]


@rule("add", "add_any")
def _add(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    for x, y in ((a, b), (b, a)):
        if isinstance(x, AccumulatedArray):
            if is_zero(y):
                return x
            if _merged(t.graph, x, y):
                return x
            blocks = y.blocks if isinstance(y, ScatteredBlocks) else [((0,) * len(x.shape), y)]
            return AccumulatedArray(x.buffer, x.shape, (*x.blocks, *blocks))
    if isinstance(a, ScatteredBlocks) and isinstance(b, ScatteredBlocks):
        return ScatteredBlocks(t.graph, a.shape, [*a.blocks, *b.blocks])
    return elementwise(t.graph, lambda *n: t.graph.make("add", n), a, b)


def _merged(g: Graph, whole: AccumulatedArray, part: Any) -> bool:
    """Accumulate a sum in place if it is only used as a term of another one."""
    own = part.sum_of if isinstance(part, BufferArray) else None
    if own is None or part.touched or own.filled is None or part.buffer.within is not None:
        return False
    fill = own.filled.attr
    fill.stores.clear()
    part.buffer.within = (whole.buffer, 0, None, 0)
    return True


@rule("gt", "ge")
def _greater(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    op = "lt" if eqn.primitive.name == "gt" else "le"
    return elementwise(t.graph, lambda x, y: t.graph.make(op, (y, x)), a, b)


@rule("div")
def _div(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    op = "quot" if kind_of(a) == "int" else "div"
    return elementwise(t.graph, lambda *n: t.graph.make(op, n), a, b)


@rule("rem")
def _rem(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    if kind_of(a) != "int":
        raise NotImplementedError("a remainder of numbers that are not whole has no kernel")
    return elementwise(t.graph, lambda *n: t.graph.make("rem", n), a, b)


@rule("square")
def _square(t: Tracer, eqn: Any, a: Any) -> Any:
    return elementwise(t.graph, lambda x: t.graph.make("mul", (x, x)), a)


@rule("integer_pow")
def _integer_pow(t: Tracer, eqn: Any, a: Any) -> Any:
    return elementwise(t.graph, lambda x: whole_power(t.graph, x, eqn.params["y"]), a)


def whole_power(g: Graph, x: Node, y: int) -> Node:
    """A whole power of x, by the squarings that JAX does."""
    if y == 0:
        return g.const(1, x.kind)
    left, power = abs(y), None
    while left:
        if left & 1:
            power = x if power is None else g.make("mul", (power, x))
        left >>= 1
        if left:
            x = g.make("mul", (x, x))
    assert power is not None
    return g.make("div", (g.const(1.0), power)) if y < 0 else power


@rule("rsqrt")
def _rsqrt(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return elementwise(g, lambda x: g.make("div", (g.const(1.0), g.make("sqrt", (x,)))), a)


@rule("exp2")
def _exp2(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return elementwise(g, lambda x: g.make("exp", (g.make("mul", (x, g.const(math.log(2.0)))),)), a)


@rule("logistic")
def _logistic(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    one = g.const(1.0)
    return elementwise(
        g, lambda x: g.make("div", (one, g.make("add", (one, g.make("exp", (g.make("neg", (x,)),)))))), a
    )


@rule("tanh")
def _tanh(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph

    def one(x: Node) -> Node:
        size = g.make("min", (g.make("abs", (x,)), g.const(22.0)))  # where it is 1 to rounding
        e = g.make("expm1", (g.make("mul", (g.const(2.0), size)),))
        share = g.make("div", (e, g.make("add", (e, g.const(2.0)))))
        value = g.make("select", (g.make("lt", (x, g.const(0.0))), g.make("neg", (share,)), share))
        slope = g.make("sub", (g.const(1.0), g.make("mul", (value, value))))
        return g.make("given", (value, x, slope), kind="real")  # shorter than that of its parts

    return elementwise(g, one, a)


@rule("tan")
def _tan(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return elementwise(g, lambda x: g.make("div", (g.make("sin", (x,)), g.make("cos", (x,)))), a)


@rule("sign")
def _sign(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph

    def one(x: Node) -> Node:
        zero = g.const(0, x.kind)
        below = g.make("select", (g.make("lt", (x, zero)), g.const(-1, x.kind), x))
        value = g.make("select", (g.make("lt", (zero, x)), g.const(1, x.kind), below))
        return g.make("given", (value,), kind="real") if x.kind == "real" else value

    return elementwise(g, one, a)


@rule("round")
def _round(t: Tracer, eqn: Any, a: Any) -> Any:
    if int(eqn.params["rounding_method"]) != 1:
        raise NotImplementedError("halves can be rounded to even only")
    return elementwise(t.graph, lambda x: t.graph.make("round", (x,)), a)


@rule("is_finite")
def _is_finite(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return elementwise(g, lambda x: g.make("lt", (g.make("abs", (x,)), g.const(math.inf))), a)


@rule("clamp")
def _clamp(t: Tracer, eqn: Any, low: Any, a: Any, high: Any) -> Any:
    g = t.graph
    return elementwise(g, lambda least, x, most: g.make("min", (g.make("max", (x, least)), most)), low, a, high)


@rule("and", "or", "xor")
def _logic(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    name = eqn.primitive.name
    if kind_of(a) == "int":
        if name != "and":
            raise NotImplementedError("bits of whole numbers can be masked only")
        name = "iand"
    return elementwise(t.graph, lambda *n: t.graph.make(name, n), a, b)


@rule("not")
def _not(t: Tracer, eqn: Any, a: Any) -> Any:
    if kind_of(a) != "bool":
        raise NotImplementedError("bits of whole numbers can be masked only")
    return elementwise(t.graph, lambda x: t.graph.make("not", (x,)), a)


@rule("select_n")
def _select_n(t: Tracer, eqn: Any, which: Any, *cases: Any) -> Any:
    g = t.graph

    def one(chosen: Node, *nodes: Node) -> Node:
        if chosen.kind == "bool":
            return g.make("select", (chosen, nodes[1], nodes[0]))
        selected = nodes[-1]
        for k in range(len(nodes) - 2, -1, -1):
            selected = g.make("select", (g.make("le", (chosen, g.const(k, "int"))), nodes[k], selected))
        return selected

    return elementwise(g, one, which, *cases)


@rule("convert_element_type")
def _convert(t: Tracer, eqn: Any, a: Any) -> Any:
    g, kind = t.graph, kind_of_dtype(eqn.params["new_dtype"])

    def one(x: Node) -> Node:
        if x.kind == kind:
            return x
        if kind == "bool":
            return g.make("ne", (x, g.const(0, x.kind)))
        return g.make(str(kind), (x,), kind=kind)

    return a if isinstance(a, AccumulatedArray | ScatteredBlocks) and kind == "real" else elementwise(g, one, a)


@rule("stop_gradient")
def _still(t: Tracer, eqn: Any, a: Any) -> Any:
    return elementwise(t.graph, lambda x: t.graph.make("given", (x,), kind="real"), a) if kind_of(a) == "real" else a


@rule("copy", "copy_p", "reduce_precision", "optimization_barrier")
def _same(t: Tracer, eqn: Any, *values: Any) -> Any:
    return list(values)


# ---- reductions


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
            nodes = [element_at(g, a, place(part)) for part in itertools.product(*(range(sizes[d]) for d in axes))]
            value = nodes[0] if nodes else _empty(g, op)
            for node in nodes[1:]:
                value = g.make(op, (value, node))
            return value
        return _looped(g, op, lambda part: element_at(g, a, place(part)), [sizes[d] for d in axes])

    return make_array(g, tuple(sizes[d] for d in kept), kind_of(a), element)


def _empty(g: Graph, op: str) -> Node:
    known = {"add": 0.0, "mul": 1.0, "max": -math.inf, "min": math.inf}
    return g.const(known[op]) if op in known else g.const(op == "and", "bool")


def _looped(g: Graph, op: str, element: Callable[[tuple[Any, ...]], Node], sizes: list[int]) -> Node:
    """A reduction of many elements: a loop over the first axis, which carries the result."""
    first = element((0,) * len(sizes))
    start = first if op in ("max", "min") else g.const(_empty(g, op).attr, first.kind)
    loop = g.open_loop(sizes[0])
    result = carried = g.carry(loop, start)
    for rest in itertools.product(*map(range, sizes[1:])):
        result = g.make(op, (result, element((loop.index, *rest))))
    assert carried.kind == result.kind
    return g.close_loop(loop, [result])[0]


@rule("cumsum", "cumprod", "cummax", "cummin")
def _cumulative(t: Tracer, eqn: Any, a: Any) -> Any:
    op, axis = REDUCE[eqn.primitive.name], eqn.params["axis"]
    if is_long(a):
        raise NotImplementedError("running sums of long arrays have no kernel; carry them through a scan")
    a = np.moveaxis(materialise(t.graph, a), axis, 0).copy()
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
    moved = np.moveaxis(materialise(g, a), axis, 0)

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

    return unwrap_scalar(np.asarray(np.frompyfunc(one, len(moved), 1)(*moved), object))


# ---- linear algebra


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
            left = element_at(g, a, tuple(x[d] for d in range(len(x))))
            right = element_at(g, b, tuple(y[d] for d in range(len(y))))
            total = g.make("add", (total, g.make("mul", (left, right))))
        return total

    return make_array(g, tuple(eqn.outvars[0].aval.shape), "real", element)


@rule("lu")
def _lu(t: Tracer, eqn: Any, a: Any) -> Any:
    """Gaussian elimination with the largest pivot of each column, rows exchanged by choices."""
    g = t.graph
    a = materialise(g, a).copy()
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
    a, b = materialise(g, a), materialise(g, b)
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
    wanted = [materialise(t.graph, v) for v in values[begin:]]
    if any(kind_of(x) != "real" for x in wanted):
        return [unwrap_scalar(v) for v in t.closed(jaxprs.solve, [*parts["solve"], *wanted])]
    # JAX's factors have no derivatives; those of the solution are those of what a correction by the residual would add
    g = t.graph
    alone = lambda x: g.make("given", (x,), kind="real")  # noqa: E731
    solution = [
        unwrap_scalar(v) for v in t.closed(jaxprs.solve, [*parts["solve"], *(elementwise(g, alone, b) for b in wanted)])
    ]
    still = [elementwise(g, alone, x) for x in solution]
    left = t.closed(jaxprs.matvec, [*parts["matvec"], *still])
    rest = [elementwise(g, lambda b, ax: g.make("sub", (b, ax)), *pair) for pair in zip(wanted, left, strict=True)]
    more = t.closed(jaxprs.solve, [*parts["solve"], *rest])
    given_values = lambda x, y: g.make("given", (x, y, g.const(1.0)), kind="real")  # noqa: E731
    return [unwrap_scalar(elementwise(g, given_values, x, y)) for x, y in zip(solution, more, strict=True)]
