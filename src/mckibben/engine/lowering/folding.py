"""What is known of a node without running it: constant folding, neutral elements, and the spans of whole numbers.

A fold takes (graph, arguments, kind) and returns a node, or None where nothing is known. With ``graph.exact`` no fold
changes a value, apart from the sign of zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .graph import Graph, Node

Fold = Callable[["Graph", tuple["Node", ...], str], "Node | None"]
FOLDS: dict[str, Fold] = {}
WIDE = (-math.inf, math.inf)


def folds(*ops: str) -> Callable[[Fold], Fold]:
    """Register a fold for operations."""

    def registered(fold: Fold) -> Fold:
        FOLDS.update(dict.fromkeys(ops, fold))
        return fold

    return registered


def span(node: Node) -> tuple[float, float]:
    """Smallest and largest value that an int node can have."""
    if node.kind != "int":
        return WIDE
    if node.op == "const":
        return node.attr, node.attr
    if node.op == "index":
        trips = node.attr.trips
        return (0, trips - 1) if isinstance(trips, int) else (0, max(trips.span[1] - 1, 0))
    if node.op == "int" and node.args[0].kind == "bool":
        return 0, 1
    spans = [a.span for a in node.args]
    if node.op == "add":
        return spans[0][0] + spans[1][0], spans[0][1] + spans[1][1]
    if node.op == "sub":
        return spans[0][0] - spans[1][1], spans[0][1] - spans[1][0]
    if node.op in ("max", "min"):
        pick = max if node.op == "max" else min
        return pick(spans[0][0], spans[1][0]), pick(spans[0][1], spans[1][1])
    if node.op == "select":
        return min(spans[1][0], spans[2][0]), max(spans[1][1], spans[2][1])
    if node.op == "mul" and all(map(math.isfinite, (*spans[0], *spans[1]))):
        ends = [a * b for a in spans[0] for b in spans[1]]
        return min(ends), max(ends)
    return WIDE


def _number(node: Node) -> Any:
    return node.attr if node.op == "const" else None


def _values(args: tuple[Node, ...]) -> list[Any] | None:
    for a in args:
        if a.op != "const":
            return None
    return [a.attr for a in args]


_REAL: dict[str, Callable[..., Any]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "max": np.maximum, "min": np.minimum,
    "neg": np.negative, "abs": np.abs, "sqrt": np.sqrt, "floor": np.floor, "ceil": np.ceil, "round": np.rint, "exp": np.exp,
    "expm1": np.expm1, "log": np.log, "log1p": np.log1p, "sin": np.sin, "cos": np.cos, "pow": np.power,
}  # fmt: skip


def _known(g: Graph, op: str, args: tuple[Node, ...], kind: str) -> Node | None:
    """The value of a real or int operation on constants."""
    values = _values(args)
    if values is None:
        return None
    with np.errstate(all="ignore"):
        if kind == "real":
            return g.const(float(_REAL[op](*map(np.float64, values))), "real")
        return g.const(int(_REAL[op](*values)), "int") if op in _REAL else None


def _zero(node: Node) -> bool:
    return node.op == "const" and node.attr == 0


@folds("add")
def _add(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    a, b = args
    if _zero(a):
        return b
    if _zero(b):
        return a
    if kind == "real":
        if b.op == "neg":
            return g.make("sub", (a, b.args[0]))
        if a.op == "neg":
            return g.make("sub", (b, a.args[0]))
    elif a.op == "const" and b.op == "add" and b.args[0].op == "const":
        return g.make("add", (g.const(a.attr + b.args[0].attr, "int"), b.args[1]))
    return _known(g, "add", args, kind)


@folds("sub")
def _sub(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    a, b = args
    if _zero(b):
        return a
    if _zero(a):
        return g.make("neg", (b,))
    if kind == "int":
        if a is b:
            return g.const(0, "int")
        if b.op == "const":
            return g.make("add", (g.const(-b.attr, "int"), a))
    elif b.op == "neg":
        return g.make("add", (a, b.args[0]))
    return _known(g, "sub", args, kind)


@folds("mul")
def _mul(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    for a, b in (args, args[::-1]):
        value = _number(a)
        if value == 1:
            return b
        if value == -1:
            return g.make("neg", (b,))
        if value == 0 and (kind == "int" or not g.exact):
            return g.const(0, kind)
        if a.op == "neg" and b.op == "neg":
            return g.make("mul", (a.args[0], b.args[0]))
        if not g.exact and a.op == "select" and _zero(a.args[2]) and _number(a.args[1]) == 1:
            return g.make("select", (a.args[0], b, a.args[2]))
    return _known(g, "mul", args, kind)


@folds("div")
def _div(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    a, b = args
    if _number(b) == 1:
        return a
    if b.op == "const" and b.attr != 0 and math.isfinite(b.attr) and abs(math.frexp(b.attr)[0]) == 0.5:
        inverse = 1.0 / b.attr
        if math.isfinite(inverse) and abs(inverse) > 1e-300:
            return g.make("mul", (a, g.const(inverse)))  # by a power of two: exact
    if not g.exact and _zero(a) and b.op != "const":
        return a
    return _known(g, "div", args, kind)


@folds("neg")
def _neg(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    (a,) = args
    if a.op == "neg":
        return a.args[0]
    if a.op == "sub":
        return g.make("sub", a.args[::-1])
    return _known(g, "neg", args, kind)


@folds("abs")
def _abs(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    (a,) = args
    if a.op == "abs":
        return a  # the size of a negative stays: at 0 its slope is another one
    return _known(g, "abs", args, kind)


for _op in ("sqrt", "floor", "ceil", "round", "exp", "expm1", "log", "log1p", "sin", "cos", "pow"):
    FOLDS[_op] = lambda g, args, kind, _op=_op: _known(g, _op, args, kind)  # type: ignore[misc]


def _extreme(op: str) -> Fold:
    def fold(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
        a, b = args
        if a is b:
            return a
        if kind == "int":
            low, high = (a, b) if a.span[1] <= b.span[0] else (b, a)
            if low.span[1] <= high.span[0]:
                return high if op == "max" else low
        return _known(g, op, args, kind)

    return fold


FOLDS["max"], FOLDS["min"] = _extreme("max"), _extreme("min")


@folds("select")
def _select(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    c, a, b = args
    if c.op == "const":
        return a if c.attr else b
    if a is b:
        return a
    if c.op == "not":
        return g.make("select", (c.args[0], b, a))
    if kind == "bool" and a.op == "const" and b.op == "const":
        return c if a.attr else g.make("not", (c,))
    if a.op == "select" and a.args[0] is c:
        return g.make("select", (c, a.args[1], b))
    if b.op == "select" and b.args[0] is c:
        return g.make("select", (c, a, b.args[2]))
    if not g.exact and kind == "real" and a.op == "neg" and b.op == "neg":
        return g.make("neg", (g.make("select", (c, a.args[0], b.args[0])),))
    return None


def _compare(op: str) -> Fold:
    number = {"lt": np.less, "le": np.less_equal, "eq": np.equal, "ne": np.not_equal}[op]

    def fold(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
        a, b = args
        values = _values(args)
        if values is not None:
            return g.const(bool(number(*values)), "bool")
        if a.kind == "int":
            (low, high), (least, most) = a.span, b.span
            apart = high < least or most < low
            if a is b or (op in ("eq", "ne") and apart):
                return g.const((op in ("le", "eq")) if a is b else op == "ne", "bool")
            if op == "lt" and (high < least or low >= most):
                return g.const(high < least, "bool")
            if op == "le" and (high <= least or low > most):
                return g.const(high <= least, "bool")
        if op in ("eq", "ne"):
            return _same(g, op, a, b)
        return None

    return fold


def _same(g: Graph, op: str, a: Node, b: Node) -> Node | None:
    """Fold eq and ne of what is a truth value, of a number and an extreme of it, and of a number with itself."""
    for x, y in ((a, b), (b, a)):
        if y.op == "const" and x.op in ("real", "int") and x.args[0].kind == "bool" and y.attr in (0, 1):
            return x.args[0] if (y.attr == 1) == (op == "eq") else g.make("not", (x.args[0],))
        if y.op == "const" and x.kind == "bool":
            return x if bool(y.attr) == (op == "eq") else g.make("not", (x,))
        if not g.exact and y.op in ("max", "min") and x in y.args and x.kind == "real":
            other = y.args[1] if y.args[0] is x else y.args[0]
            reached = g.make("le", (other, x) if y.op == "max" else (x, other))
            return reached if op == "eq" else g.make("not", (reached,))
    return None


for _op in ("lt", "le", "eq", "ne"):
    FOLDS[_op] = _compare(_op)


@folds("not")
def _not(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    (a,) = args
    if a.op == "const":
        return g.const(not a.attr, "bool")
    return a.args[0] if a.op == "not" else None


def _logic(op: str) -> Fold:
    def fold(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
        for a, b in (args, args[::-1]):
            if a.op != "const":
                continue
            if op == "xor":
                return g.make("not", (b,)) if a.attr else b
            if bool(a.attr) == (op == "and"):
                return b
            return a
        return args[0] if args[0] is args[1] and op != "xor" else None

    return fold


for _op in ("and", "or", "xor"):
    FOLDS[_op] = _logic(_op)


@folds("given")
def _given(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    return args[0] if args[0].op == "const" or (args[0].op == "given" and len(args[0].args) == len(args) == 1) else None


@folds("real", "int")
def _convert(g: Graph, args: tuple[Node, ...], kind: str) -> Node | None:
    (a,) = args
    if a.kind == kind:
        return a
    if a.op == "const" and (a.kind != "real" or math.isfinite(a.attr)):
        return g.const(a.attr, kind)
    if kind == "int" and a.op == "real":
        return a.args[0] if a.args[0].kind == "int" else g.make("int", a.args, kind="int")
    return None
