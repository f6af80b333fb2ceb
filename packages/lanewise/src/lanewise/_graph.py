"""The scalar graph: what a lowered function is, between JAX and the emitters.

A graph is made of nodes of three kinds (``real``, ``int``, ``bool``), of buffers in memory, of counted loops, and of stores.
Equal nodes are one node, so common subexpressions are found as they are written, and what is known of a node without running
it is folded at once. Nothing here knows of lanes or of JAX.

The node set, by `Node.op` (arguments in brackets; one kind throughout unless said otherwise):

* ``const`` its attr is the value; ``index`` number of the present trip of the loop in its attr, from 0 (int);
  ``phi`` attr (loop, k), what the loop carries in place k during a trip; ``end`` the same after the last trip;
  ``done`` attr loop: a token, "this loop has run"; ``table`` [values..] attr buffer: a token, "these values stand in memory"
* ``load`` [index, tokens..] attr (buffer, scale, offset): the element scale * index + offset of a buffer that those tokens
  say is written; without the index where scale is 0. Always within the buffer.
* real: ``add sub mul div max min`` [a, b], ``neg abs sqrt floor ceil round`` [a] (round to even), ``fma`` [a, b, c] a b + c
  rounded once, ``rcp`` [a] 1/a, ``exp expm1 log log1p sin cos`` [a], ``pow`` [a, b]; max and min are NaN if one argument is
* int: ``add sub mul max min quot rem`` [a, b] (quot and rem towards zero), ``neg abs`` [a], ``shl shr iand`` [a, b]
* bool: ``and or xor`` [a, b], ``not`` [a], ``lt le eq ne`` [a, b] of real, int or bool (all but ne false for NaN)
* ``select`` [c, a, b] a where c, else b; ``real`` [a] of int or bool; ``int`` [a] of bool, or of real towards zero;
  ``bits`` [real] the int with the same bits, ``unbits`` [int] back; these two mean what they do in float64 only
* ``given`` [value, x1, d1, x2, d2 ..] the value, whose derivatives by x1, x2 .. are d1, d2 .. whatever it was made of, and
  none by anything else (real); emitters get the value in its place
* made by the last passes: ``invert`` [d..] attr n, the reciprocals of n numbers with one division, see `_passes` (only in
  mode ``fast``); ``item`` [invert] attr k, one of them (real)

A fold takes (graph, arguments, kind) and returns a node, or None if nothing is known. With ``graph.exact`` no fold
changes a value, apart from the sign of zero.
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import math
from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import Any

import numpy as np

# ---- nodes, buffers, loops


COMMUTE = frozenset({"add", "mul", "max", "min", "and", "or", "xor", "eq", "ne"})
TRUTH = frozenset({"lt", "le", "eq", "ne", "and", "or", "xor", "not"})


@contextlib.contextmanager
def gc_paused() -> Iterator[None]:
    """Pause Python's garbage collector while a graph grows; it would search the whole graph each time and find nothing."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


class Node:
    """A value, or a token; `serial` grows in the order of creation, so arguments come before their uses."""

    __slots__ = ("args", "attr", "kind", "op", "serial", "value_range")

    def __init__(self, op: str, args: tuple[Node, ...], attr: Any, kind: str, serial: int) -> None:
        self.op, self.args, self.attr, self.kind, self.serial = op, args, attr, kind, serial
        self.value_range: tuple[float, float] = value_range_of(self)

    def __repr__(self) -> str:
        inner = self.attr if self.op == "const" else ", ".join(f"%{a.serial}" for a in self.args)
        return f"%{self.serial} = {self.op}({inner})"


DOUBLE = "double buffer"


class Buffer:
    """Numbers in memory, in C order of `shape`.

    `role` is ``argument``, ``result``, ``constant`` (`data` holds it) or ``scratch``. A scratch buffer that stands inside
    another has `within`: (buffer, offset of its first element, loop or None, what each trip of that loop adds to it).
    Scratch with the name `DOUBLE` has two rows: no loop inside the one that it belongs to reads the row it writes.
    """

    __slots__ = ("data", "kind", "name", "role", "serial", "shape", "within")

    def __init__(
        self, serial: int, role: str, kind: str, shape: tuple[int, ...], name: str = "", data: Any = None
    ) -> None:
        self.serial, self.role, self.kind, self.shape, self.name = serial, role, kind, shape, name
        self.data = data
        self.within: tuple[Buffer, int, Loop | None, int] | None = None

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)


@dataclasses.dataclass(frozen=True, eq=False, slots=True)
class Store:
    """Write a value to element scale * index + offset of a buffer, or add it to the present value."""

    buffer: Buffer
    scale: int
    offset: int
    index: Node | None
    value: Node
    adds: bool = False


class Loop:
    """Trips 0 .. n-1; `trips` is their number, an int of at least 1 or an int node of any value (none if below 1).

    `inits`, `phis` and `nexts` belong together place by place; the stores are made once per trip; `after` are tokens. A loop
    stands as far out as what it uses allows, but inside of `pinned`, whose every trip must do it again.
    """

    __slots__ = ("after", "depth", "index", "inits", "nexts", "phis", "pinned", "serial", "stores", "trips")

    def __init__(self, serial: int, depth: int, trips: int | Node) -> None:
        self.serial, self.depth, self.trips = serial, depth, trips
        self.index: Node  # made together with the loop
        self.inits: list[Node] = []
        self.phis: list[Node] = []
        self.nexts: list[Node] = []
        self.stores: list[Store] = []
        self.after: list[Node] = []
        self.pinned: Loop | None = None

    def __repr__(self) -> str:
        return f"loop{self.serial}"


class Graph:
    """All nodes of a function, and its effects on memory.

    Args:
        exact: no folding that changes a value; without it 0 x is 0 and -0.0 is 0.0 (what is not finite may be lost there).
    """

    def __init__(self, *, exact: bool = True) -> None:
        self.exact = exact
        self.nodes: list[Node] = []
        self.loops: list[Loop] = []
        self.buffers: list[Buffer] = []
        self.stores: list[Store] = []  # outside of all loops
        self._known: dict[Any, Node] = {}
        self._open: list[Loop] = []

    def const(self, value: float | int | bool, kind: str = "real") -> Node:
        """A number as a node."""
        if kind == "real":
            value = float(value)
            if not self.exact and value == 0.0:
                value = 0.0
            key: Any = ("const", kind, value.hex())
        else:
            value = bool(value) if kind == "bool" else int(value)
            key = ("const", kind, value)
        return self.intern(key, "const", (), value, kind)

    def make(self, op: str, args: tuple[Node, ...], attr: Any = None, kind: str | None = None) -> Node:
        """Return a node, folded if possible, or an existing one."""
        if kind is None:
            kind = "bool" if op in TRUTH else args[-1].kind
        if op in COMMUTE and args[0].serial > args[1].serial:
            args = (args[1], args[0])
        fold = FOLDS.get(op)
        if fold is not None:
            folded = fold(self, args, kind)
            if folded is not None:
                return folded
        return self.intern((op, attr, kind, tuple(a.serial for a in args)), op, args, attr, kind)

    def lookup(self, key: Hashable) -> Node | None:
        """The node that `intern` made under a key."""
        return self._known.get(key)

    def intern(self, key: Hashable, op: str, args: tuple[Node, ...], attr: Any, kind: str) -> Node:
        """Return the node of a key, created if there is none; nothing is folded."""
        node = self._known.get(key)
        if node is None:
            node = self._known[key] = Node(op, args, attr, kind, len(self.nodes))
            self.nodes.append(node)
        return node

    def buffer(self, role: str, kind: str, shape: Iterable[int], name: str = "", data: Any = None) -> Buffer:
        """New memory."""
        made = Buffer(len(self.buffers), role, kind, tuple(shape), name, data)
        self.buffers.append(made)
        return made

    def load(self, buffer: Buffer, index: Node | int, scale: int = 1, offset: int = 0, tokens: Any = ()) -> Node:
        """Element scale * index + offset of a buffer."""
        base, by, more = affine(index) if isinstance(index, Node) else (None, 0, int(index))
        scale, offset = scale * by, scale * more + offset
        args = (base, *tokens) if base is not None and scale else tuple(tokens)
        return self.make("load", args, (buffer, scale, offset), buffer.kind)

    def open_loop(self, trips: int | Node) -> Loop:
        """A loop, inside those that are open; what follows until `close_loop` may use its index and what it carries."""
        loop = Loop(len(self.loops), len(self._open) + 1, trips)
        self.loops.append(loop)
        self._open.append(loop)
        loop.index = self.intern(("index", loop), "index", (), loop, "int")
        return loop

    def carry(self, loop: Loop, init: Node) -> Node:
        """Add a carried value to a loop; return it as seen during a trip."""
        attr = (loop, len(loop.phis))
        phi = self.intern(("phi", *attr), "phi", (), attr, init.kind)
        loop.inits.append(init)
        loop.phis.append(phi)
        return phi

    def close_loop(self, loop: Loop, nexts: Iterable[Node]) -> list[Node]:
        """End a loop with the values for the next trip; return its results."""
        if self._open.pop() is not loop:
            raise ValueError("loops are closed in the reverse order of opening")
        loop.nexts = list(nexts)
        return [self.end(loop, k) for k in range(len(loop.phis))]

    def end(self, loop: Loop, place: int) -> Node:
        """Value that a loop leaves at a place."""
        return self.intern(("end", loop, place), "end", (), (loop, place), loop.phis[place].kind)

    def done(self, loop: Loop) -> Node:
        """The token of a loop that has run."""
        return self.intern(("done", loop), "done", (), loop, "token")

    def store(
        self, buffer: Buffer, index: Node | int, value: Node, *, scale: int = 1, offset: int = 0, adds: bool = False
    ) -> None:
        """Write to memory, once per trip of the innermost open loop."""
        base, by, more = affine(index) if isinstance(index, Node) else (None, 0, int(index))
        scale, offset = scale * by, scale * more + offset
        made = Store(buffer, scale, offset, base if scale else None, value, adds)
        if adds:
            self.pin()
        (self._open[-1].stores if self._open else self.stores).append(made)

    def pin(self) -> None:
        """Keep the open loops inside of one another: they change memory that is read later."""
        for inner, outer in zip(self._open[1:], self._open, strict=False):
            inner.pinned = outer

    @property
    def effects(self) -> tuple[int, int, int]:
        """Count what is made anew each time it is asked for: loops, buffers, and stores outside of all loops."""
        return len(self.loops), len(self.buffers), len(self.stores)

    @property
    def depth(self) -> int:
        """Number of open loops."""
        return len(self._open)

    def unwind(self, depth: int) -> None:
        """Discard open loops, down to a depth, after their content was refused."""
        del self._open[depth:]


def affine(node: Node) -> tuple[Node | None, int, int]:
    """Decompose an int node as scale * base + offset: (base, scale, offset), base None if it is constant."""
    if node.op == "const":
        return None, 0, node.attr
    if node.op in ("add", "sub", "mul") and node.args[0].kind == "int":
        a, b = node.args
        if b.op == "const" and node.op != "mul":
            base, scale, offset = affine(a)
            return base, scale, offset + (b.attr if node.op == "add" else -b.attr)
        if a.op == "const":
            base, scale, offset = affine(b)
            if node.op == "mul":
                return base, scale * a.attr, offset * a.attr
            return (base, scale, a.attr + offset) if node.op == "add" else (base, -scale, a.attr - offset)
        if b.op == "const":
            base, scale, offset = affine(a)
            return base, scale * b.attr, offset * b.attr
    return node, 1, 0


# ---- folding


Fold = Callable[["Graph", tuple["Node", ...], str], "Node | None"]
FOLDS: dict[str, Fold] = {}
WIDE = (-math.inf, math.inf)


def folds(*ops: str) -> Callable[[Fold], Fold]:
    """Register a fold for operations."""

    def registered(fold: Fold) -> Fold:
        FOLDS.update(dict.fromkeys(ops, fold))
        return fold

    return registered


def value_range_of(node: Node) -> tuple[float, float]:
    """Smallest and largest value that an int node can have."""
    if node.kind != "int":
        return WIDE
    if node.op == "const":
        return node.attr, node.attr
    if node.op == "index":
        trips = node.attr.trips
        return (0, trips - 1) if isinstance(trips, int) else (0, max(trips.value_range[1] - 1, 0))
    if node.op == "int" and node.args[0].kind == "bool":
        return 0, 1
    spans = [a.value_range for a in node.args]
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
            low, high = (a, b) if a.value_range[1] <= b.value_range[0] else (b, a)
            if low.value_range[1] <= high.value_range[0]:
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
            (low, high), (least, most) = a.value_range, b.value_range
            apart = high < least or most < low
            if a is b or (op in ("eq", "ne") and apart):
                return g.const((op in ("le", "eq")) if a is b else op == "ne", "bool")
            if op == "lt" and (high < least or low >= most):
                return g.const(high < least, "bool")
            if op == "le" and (high <= least or low > most):
                return g.const(high <= least, "bool")
        if op in ("eq", "ne"):
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
        return None

    return fold


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
