"""The operations and statements of a scheduled graph in C99, for one lane: a statement per node, a `for` per loop.

Numbers are `double` or `float`, whole numbers `int64_t`, truth values `int` (in memory `unsigned char`). Whole numbers wrap
as LLVM's do: what may overflow goes through unsigned arithmetic. Names of values end in the serial number of their node.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from typing import NamedTuple

from ._analysis import Entry, Schedule
from ._graph import Buffer, Graph, Loop, Node, Store

# ---- operations


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
    return all(math.isfinite(x) and abs(x) < SAFE for n in (node, *node.args) for x in n.value_range)


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
    """Minimum or maximum; of real numbers NaN if either is NaN."""
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
    element = body.element(buffer, node.args[0] if scale else None, scale, offset)
    return f"{element} != 0" if node.kind == "bool" else element


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


# ---- statements


C_MEMORY = {"int": "int64_t", "bool": "unsigned char"}  # real: `Real.type`


class Real(NamedTuple):
    """A type of numbers in C: its name, the ending of math.h's functions and literals, and of its macros in float.h."""

    type: str
    suffix: str
    macro: str


C_REALS = {"float64": Real("double", "", "DBL"), "float32": Real("float", "f", "FLT")}


def c_literal(value: float, real: Real) -> str:
    """A number in the shortest decimal form that has all its bits; beyond the largest float, that one."""
    if math.isnan(value):
        return f"({real.type})NAN"
    if math.isinf(value):
        return f"({real.type}){'-' if value < 0.0 else ''}INFINITY"
    if real.suffix:
        import numpy as np

        held = max(min(value, 3.4e38), -3.4e38)
        text = str(np.float32(struct.unpack("f", struct.pack("f", held))[0]))
    else:
        text = repr(float(value))
    text = (text if "." in text or "e" in text else text + ".0") + real.suffix
    return f"({text})" if text.startswith("-") else text


class Statements:
    """The text of a function's body while it grows.

    Args:
        graph: the graph to write.
        plan: order of its entries.
        bases: address of the first element of each buffer's memory, in C.
        real: type of its numbers.
        prefix: prefix of the names of helper functions.
    """

    def __init__(self, graph: Graph, plan: Schedule, bases: Mapping[Buffer, str], *, real: Real, prefix: str) -> None:
        self.graph, self.plan, self.bases, self.real = graph, plan, bases, real
        self.prefix = prefix
        self.lines: list[str] = []
        self.names: dict[Node, str] = {}
        self.helpers: set[str] = set()
        self.loads: set[Buffer] = set()
        self.depth = 1
        self.entries(plan.root)

    def line(self, text: str) -> None:
        """A statement at the present depth."""
        self.lines.append("    " * self.depth + text)

    def type(self, kind: str) -> str:
        """The type of a value."""
        return {"real": self.real.type, "int": "int64_t", "bool": "int"}[kind]

    def name(self, node: Node) -> str:
        """A value as an operand."""
        if node.op != "const":
            return self.names[node]
        if node.kind == "real":
            return self.literal(node.attr)
        return str(int(node.attr)) if node.kind == "bool" else whole(node.attr)

    def literal(self, value: float) -> str:
        """A number."""
        return c_literal(value, self.real)

    def helper(self, name: str) -> str:
        """A helper function of this file, which is then written before it."""
        self.helpers.add(name)
        return f"{self.prefix}_{name}"

    def function(self, name: str) -> str:
        """A function of math.h for these numbers."""
        return name + self.real.suffix

    # memory

    def element(self, buffer: Buffer, index: Node | None, scale: int, offset: int) -> str:
        """An element of a buffer."""
        terms = [] if index is None or not scale else [times(self.name(index), scale)]
        while buffer.within is not None:
            buffer, more, loop, by = buffer.within
            offset += more
            if loop is not None and by:
                terms.append(times(self.names[loop.index], by))
        self.loads.add(buffer)
        base = self.bases[buffer]
        if not terms:
            return base[1:] if base.startswith("&") and not offset else f"{_grouped(base)}[{offset}]"
        return f"{_grouped(base)}[{' + '.join(terms)}{f' {offset:+d}' if offset else ''}]"

    def put(self, place: str, value: Node, adds: bool = False) -> None:
        """Write a value to memory."""
        text = self.name(value)
        if value.kind == "bool":
            text = f"(unsigned char){text}"
        self.line(f"{place} {'+=' if adds else '='} {text};")

    # order

    def entries(self, entries: list[Entry]) -> None:
        """Write the statements of a block: stores, loops and nodes in order."""
        for entry in entries:
            if isinstance(entry, Store):
                self.put(self.element(entry.buffer, entry.index, entry.scale, entry.offset), entry.value, entry.adds)
            elif isinstance(entry, Loop):
                self.loop(entry)
            else:
                self.node(entry)

    def node(self, node: Node) -> None:
        """Write one node."""
        if node.op == "table":
            for k, value in enumerate(node.args):
                self.put(self.element(node.attr, None, 0, k), value)
        elif node.op == "item":
            self.names[node] = f"r{node.args[0].serial}[{node.attr}]"
        elif node.op == "invert":
            self.invert(node)
        else:
            text = C_OPS[node.op](self, node)
            self.names[node] = f"v{node.serial}"
            self.line(f"const {self.type(node.kind)} v{node.serial} = {text};")

    def invert(self, node: Node) -> None:
        """Reciprocals with one division; where their product is not a normal number, each by itself."""
        d, key, real = [self.name(a) for a in node.args], node.serial, self.real
        one = self.literal(1.0)
        products = [d[0]]
        for k, x in enumerate(d[1:], start=1):
            self.line(f"const {real.type} p{key}_{k} = {products[-1]} * {x};")
            products.append(f"p{key}_{k}")
        self.line(f"{real.type} q{key} = {one} / {products[-1]}, r{key}[{len(d)}];")
        for k in range(len(d) - 1, 0, -1):
            self.line(f"r{key}[{k}] = q{key} * {products[k - 1]};")
            self.line(f"q{key} = q{key} * {d[k]};")
        self.line(f"r{key}[0] = q{key};")
        odd = f"!{self.helper('normal')}({products[-1]})"
        apart = " ".join(f"r{key}[{k}] = {one} / {x};" for k, x in enumerate(d))
        self.line(f"if ({odd}) {{ {apart} }}")

    def loop(self, loop: Loop) -> None:
        """Write a loop; what it carries are variables that stand before it."""
        places = self.plan.live.carried[loop]
        carried = [(loop.phis[k], loop.inits[k], loop.nexts[k], k) for k in places]
        for phi, init, _, _ in carried:
            self.names[phi] = f"c{phi.serial}"
            self.line(f"{self.type(phi.kind)} c{phi.serial} = {self.name(init)};")
        index = f"i{loop.serial}"
        self.names[loop.index] = index
        trips = whole(loop.trips) if isinstance(loop.trips, int) else self.name(loop.trips)
        self.line(f"for (int64_t {index} = 0; {index} < {trips}; ++{index}) {{")
        self.depth += 1
        self.entries(self.plan.bodies[loop])
        moving = {phi for phi, _, _, _ in carried}
        swapped = {after for phi, _, after, _ in carried if after in moving and after is not phi}
        for after in sorted(swapped, key=lambda n: n.serial):  # it gets a new value before it is passed on
            self.line(f"const {self.type(after.kind)} o{after.serial} = {self.name(after)};")
        for phi, _, after, _ in carried:
            if after is not phi:
                self.line(f"c{phi.serial} = {f'o{after.serial}' if after in swapped else self.name(after)};")
        self.depth -= 1
        self.line("}")
        for phi, _, _, k in carried:
            self.names[self.graph.end(loop, k)] = f"c{phi.serial}"


def whole(value: int) -> str:
    """A whole number."""
    return str(value) if abs(value) < 2**31 else "INT64_MIN" if value == -(2**63) else f"INT64_C({value})"


def times(name: str, by: int) -> str:
    """A multiple, of at most 64 bits."""
    return name if by == 1 else f"{name} * {by}" if by >= 0 else f"{name} * ({by})"


def _grouped(base: str) -> str:
    return f"({base})" if base.startswith("&") else base
