"""The operations of a graph in C99, and the small functions that some of them call."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from .graph import Node

if TYPE_CHECKING:
    from .c_body import Statements

Op = Callable[["Statements", Node], str]
C_OPS: dict[str, Op] = {}
SAFE = 2.0**62  # index arithmetic below it cannot overflow


def _op(*names: str) -> Callable[[Op], Op]:
    def registered(function: Op) -> Op:
        C_OPS.update(dict.fromkeys(names, function))
        return function

    return registered


SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "quot": "/", "rem": "%", "and": "&", "or": "|", "xor": "^",
         "lt": "<", "le": "<=", "eq": "==", "ne": "!="}  # fmt: skip


def _bounded(node: Node) -> bool:
    return all(math.isfinite(x) and abs(x) < SAFE for n in (node, *node.args) for x in n.span)


@_op("add", "sub", "mul", "div", "quot", "rem", "and", "or", "xor", "lt", "le", "eq", "ne")
def _binary(body: Statements, node: Node) -> str:
    a, b = map(body.name, node.args)
    if node.kind == "int" and node.op in ("add", "sub", "mul") and not _bounded(node):
        return f"(int64_t)((uint64_t){a} {SIGNS[node.op]} (uint64_t){b})"
    return f"{a} {SIGNS[node.op]} {b}"


@_op("shl", "shr", "iand")
def _bitwise(body: Statements, node: Node) -> str:
    a, b = map(body.name, node.args)
    sign = {"shl": "<<", "shr": ">>", "iand": "&"}[node.op]
    return f"(int64_t)((uint64_t){a} {sign} (uint64_t){b})"


@_op("neg", "abs")
def _signed(body: Statements, node: Node) -> str:
    a = body.name(node.args[0])
    minus = f"-{a}" if node.kind == "real" else f"(int64_t)(0u - (uint64_t){a})"
    if node.op == "neg":
        return minus
    return f"{body.function('fabs')}({a})" if node.kind == "real" else f"{a} < 0 ? {minus} : {a}"


@_op("not")
def _not(body: Statements, node: Node) -> str:
    return f"!{body.name(node.args[0])}"


@_op("select")
def _select(body: Statements, node: Node) -> str:
    c, a, b = map(body.name, node.args)
    return f"{c} ? {a} : {b}"


@_op("max", "min")
def _extreme(body: Statements, node: Node) -> str:
    """Of real numbers the one that is NaN, if one is."""
    first, second = node.args
    sign = ">" if node.op == "max" else "<"
    if node.kind == "int":
        a, b = body.name(first), body.name(second)
        return f"{a} {sign} {b} ? {a} : {b}"
    if first.op == "const":
        first, second = second, first
    a, b = body.name(first), body.name(second)
    if second.op == "const":
        return f"{b} {sign} {a} ? {b} : {a}"
    return f"{body.helper('larger' if node.op == 'max' else 'smaller')}({a}, {b})"


ROOTS = {"sqrt": "sqrt", "floor": "floor", "ceil": "ceil", "round": "nearbyint"}


@_op("sqrt", "floor", "ceil", "round")
def _function(body: Statements, node: Node) -> str:
    return f"{body.function(ROOTS[node.op])}({body.name(node.args[0])})"


@_op("fma")
def _fma(body: Statements, node: Node) -> str:
    return f"{body.helper('fma')}({', '.join(map(body.name, node.args))})"


@_op("rcp")
def _rcp(body: Statements, node: Node) -> str:
    return f"{body.literal(1.0)} / {body.name(node.args[0])}"


@_op("load")
def _load(body: Statements, node: Node) -> str:
    buffer, scale, offset = node.attr
    found = body.element(buffer, node.args[0] if scale else None, scale, offset)
    return f"{found} != 0" if node.kind == "bool" else found


@_op("real")
def _real(body: Statements, node: Node) -> str:
    return f"({body.real.type}){body.name(node.args[0])}"


@_op("int")
def _int(body: Statements, node: Node) -> str:
    a = body.name(node.args[0])
    return a if node.args[0].kind == "bool" else f"{body.helper('whole')}({a})"


@_op("bits", "unbits")
def _bits(body: Statements, node: Node) -> str:
    return f"{body.helper(node.op)}({body.name(node.args[0])})"


# With {p} the prefix, {t} the type, {s} the ending of math.h's names, {m} that of float.h's macros, {i} the bits' type.
C_HELPERS = {
    "normal": """\
static inline int {p}_normal({t} x)
{{
    const {t} a = fabs{s}(x);
    return a >= {m}_MIN && a <= {m}_MAX;
}}""",
    "larger": """\
static inline {t} {p}_larger({t} a, {t} b)
{{
    return b != b ? b : b > a ? b : a;
}}""",
    "smaller": """\
static inline {t} {p}_smaller({t} a, {t} b)
{{
    return b != b ? b : b < a ? b : a;
}}""",
    "fma": """\
static inline {t} {p}_fma({t} a, {t} b, {t} c)
{{
#ifdef {P}_TWO_ROUNDINGS
    return a * b + c;
#else
    return fma{s}(a, b, c);
#endif
}}""",
    "whole": """\
static inline int64_t {p}_whole({t} x)
{{
    const {t} end = {end};
    return x >= end ? INT64_MAX : x < -end ? INT64_MIN : x == x ? (int64_t)x : 0;
}}""",
    "bits": """\
static inline int64_t {p}_bits({t} x)
{{
    union {{ {t} real; {i} bits; }} both;
    both.real = x;
    return both.bits;
}}""",
    "unbits": """\
static inline {t} {p}_unbits(int64_t x)
{{
    union {{ {t} real; {i} bits; }} both;
    both.bits = ({i})x;
    return both.real;
}}""",
}
