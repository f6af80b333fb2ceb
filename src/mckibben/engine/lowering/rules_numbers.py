"""What becomes of the operations that act on every element by itself."""

from __future__ import annotations

import math
from typing import Any

from .arrays import Growing, Rows, Update, each, is_zero, kind_of
from .graph import Graph, Node
from .trace import RULES, Tracer, kind_of_dtype, rule


def _plain(op: str) -> Any:
    return lambda t, eqn, *values: each(t.graph, lambda *n: t.graph.make(op, n), *values)


for _name in ("sub", "mul", "max", "min", "neg", "abs", "sqrt", "floor", "ceil", "exp", "expm1", "log", "log1p", "pow",
              "sin", "cos", "eq", "ne", "lt", "le"):  # fmt: skip
    RULES[_name] = _plain(_name)
RULES["lt_to"], RULES["le_to"] = RULES["lt"], RULES["le"]


@rule("add", "add_any")
def _add(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    for x, y in ((a, b), (b, a)):
        if isinstance(x, Growing):
            if is_zero(y):
                return x
            if _merged(t.graph, x, y):
                return x
            blocks = y.blocks if isinstance(y, Update) else [((0,) * len(x.shape), y)]
            return Growing(x.buffer, x.shape, (*x.blocks, *blocks))
    if isinstance(a, Update) and isinstance(b, Update):
        return Update(t.graph, a.shape, [*a.blocks, *b.blocks])
    return each(t.graph, lambda *n: t.graph.make("add", n), a, b)


def _merged(g: Graph, whole: Growing, part: Any) -> bool:
    """Let a sum that is made only to be added to another be made there at once."""
    own = part.sum_of if isinstance(part, Rows) else None
    if own is None or part.touched or own.filled is None or part.buffer.within is not None:
        return False
    fill = own.filled.attr
    fill.stores.clear()
    part.buffer.within = (whole.buffer, 0, None, 0)
    return True


@rule("gt", "ge")
def _greater(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    op = "lt" if eqn.primitive.name == "gt" else "le"
    return each(t.graph, lambda x, y: t.graph.make(op, (y, x)), a, b)


@rule("div")
def _div(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    op = "quot" if kind_of(a) == "int" else "div"
    return each(t.graph, lambda *n: t.graph.make(op, n), a, b)


@rule("rem")
def _rem(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    if kind_of(a) != "int":
        raise NotImplementedError("a remainder of numbers that are not whole has no kernel")
    return each(t.graph, lambda *n: t.graph.make("rem", n), a, b)


@rule("square")
def _square(t: Tracer, eqn: Any, a: Any) -> Any:
    return each(t.graph, lambda x: t.graph.make("mul", (x, x)), a)


@rule("integer_pow")
def _integer_pow(t: Tracer, eqn: Any, a: Any) -> Any:
    return each(t.graph, lambda x: whole_power(t.graph, x, eqn.params["y"]), a)


def whole_power(g: Graph, x: Node, y: int) -> Node:
    """A whole power of x, by the squarings that JAX does."""
    if y == 0:
        return g.const(1, x.kind)
    left, found = abs(y), None
    while left:
        if left & 1:
            found = x if found is None else g.make("mul", (found, x))
        left >>= 1
        if left:
            x = g.make("mul", (x, x))
    assert found is not None
    return g.make("div", (g.const(1.0), found)) if y < 0 else found


@rule("rsqrt")
def _rsqrt(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return each(g, lambda x: g.make("div", (g.const(1.0), g.make("sqrt", (x,)))), a)


@rule("exp2")
def _exp2(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return each(g, lambda x: g.make("exp", (g.make("mul", (x, g.const(math.log(2.0)))),)), a)


@rule("logistic")
def _logistic(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    one = g.const(1.0)
    return each(g, lambda x: g.make("div", (one, g.make("add", (one, g.make("exp", (g.make("neg", (x,)),)))))), a)


@rule("tanh")
def _tanh(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph

    def one(x: Node) -> Node:
        size = g.make("min", (g.make("abs", (x,)), g.const(22.0)))  # where it is 1 to rounding
        e = g.make("expm1", (g.make("mul", (g.const(2.0), size)),))
        share = g.make("div", (e, g.make("add", (e, g.const(2.0)))))
        found = g.make("select", (g.make("lt", (x, g.const(0.0))), g.make("neg", (share,)), share))
        slope = g.make("sub", (g.const(1.0), g.make("mul", (found, found))))
        return g.make("given", (found, x, slope), kind="real")  # shorter than that of its parts

    return each(g, one, a)


@rule("tan")
def _tan(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return each(g, lambda x: g.make("div", (g.make("sin", (x,)), g.make("cos", (x,)))), a)


@rule("sign")
def _sign(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph

    def one(x: Node) -> Node:
        zero = g.const(0, x.kind)
        below = g.make("select", (g.make("lt", (x, zero)), g.const(-1, x.kind), x))
        found = g.make("select", (g.make("lt", (zero, x)), g.const(1, x.kind), below))
        return g.make("given", (found,), kind="real") if x.kind == "real" else found

    return each(g, one, a)


@rule("round")
def _round(t: Tracer, eqn: Any, a: Any) -> Any:
    if int(eqn.params["rounding_method"]) != 1:
        raise NotImplementedError("halves can be rounded to even only")
    return each(t.graph, lambda x: t.graph.make("round", (x,)), a)


@rule("is_finite")
def _is_finite(t: Tracer, eqn: Any, a: Any) -> Any:
    g = t.graph
    return each(g, lambda x: g.make("lt", (g.make("abs", (x,)), g.const(math.inf))), a)


@rule("clamp")
def _clamp(t: Tracer, eqn: Any, low: Any, a: Any, high: Any) -> Any:
    g = t.graph
    return each(g, lambda least, x, most: g.make("min", (g.make("max", (x, least)), most)), low, a, high)


@rule("and", "or", "xor")
def _logic(t: Tracer, eqn: Any, a: Any, b: Any) -> Any:
    name = eqn.primitive.name
    if kind_of(a) == "int":
        if name != "and":
            raise NotImplementedError("bits of whole numbers can be masked only")
        name = "iand"
    return each(t.graph, lambda *n: t.graph.make(name, n), a, b)


@rule("not")
def _not(t: Tracer, eqn: Any, a: Any) -> Any:
    if kind_of(a) != "bool":
        raise NotImplementedError("bits of whole numbers can be masked only")
    return each(t.graph, lambda x: t.graph.make("not", (x,)), a)


@rule("select_n")
def _select_n(t: Tracer, eqn: Any, which: Any, *cases: Any) -> Any:
    g = t.graph

    def one(chosen: Node, *nodes: Node) -> Node:
        if chosen.kind == "bool":
            return g.make("select", (chosen, nodes[1], nodes[0]))
        found = nodes[-1]
        for k in range(len(nodes) - 2, -1, -1):
            found = g.make("select", (g.make("le", (chosen, g.const(k, "int"))), nodes[k], found))
        return found

    return each(g, one, which, *cases)


@rule("convert_element_type")
def _convert(t: Tracer, eqn: Any, a: Any) -> Any:
    g, kind = t.graph, kind_of_dtype(eqn.params["new_dtype"])

    def one(x: Node) -> Node:
        if x.kind == kind:
            return x
        if kind == "bool":
            return g.make("ne", (x, g.const(0, x.kind)))
        return g.make(str(kind), (x,), kind=kind)

    return a if isinstance(a, Growing | Update) and kind == "real" else each(g, one, a)


@rule("stop_gradient")
def _still(t: Tracer, eqn: Any, a: Any) -> Any:
    return each(t.graph, lambda x: t.graph.make("given", (x,), kind="real"), a) if kind_of(a) == "real" else a


@rule("copy", "copy_p", "reduce_precision", "optimization_barrier")
def _same(t: Tracer, eqn: Any, *values: Any) -> Any:
    return list(values)
