"""The scalar graph: what a lowered function is, between JAX and the emitters.

A graph is made of nodes of three kinds (``real``, ``int``, ``bool``), of buffers in memory, of counted loops, and of stores.
Equal nodes are one node, so common subexpressions are found as they are written. Nothing here knows of lanes or of JAX.

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
* made by the last passes: ``invert`` [d..] attr n, the reciprocals of n numbers with one division, see `passes` (only in
  mode ``fast``); ``item`` [invert] attr k, one of them (real)
"""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import math
from collections.abc import Iterable, Iterator
from typing import Any

from .folding import FOLDS, span

COMMUTE = frozenset({"add", "mul", "max", "min", "and", "or", "xor", "eq", "ne"})
TRUTH = frozenset({"lt", "le", "eq", "ne", "and", "or", "xor", "not"})


@contextlib.contextmanager
def growing() -> Iterator[None]:
    """While a graph grows, nothing is thrown away that Python's collector could find, which looks at all of it each time."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


class Node:
    """One value, or one token; `serial` grows in the order of making, so arguments come before what uses them."""

    __slots__ = ("args", "attr", "kind", "op", "serial", "span")

    def __init__(self, op: str, args: tuple[Node, ...], attr: Any, kind: str, serial: int) -> None:
        self.op, self.args, self.attr, self.kind, self.serial = op, args, attr, kind, serial
        self.span: tuple[float, float] = span(self)

    def __repr__(self) -> str:
        inner = self.attr if self.op == "const" else ", ".join(f"%{a.serial}" for a in self.args)
        return f"%{self.serial} = {self.op}({inner})"


class Buffer:
    """Numbers in memory, in C order of `shape`.

    `role` is ``argument``, ``result``, ``constant`` (`data` holds it) or ``scratch``. A scratch buffer that stands inside
    another has `within`: (buffer, offset of its first element, loop or None, what each trip of that loop adds to it).
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
    """Write a value to element scale * index + offset of a buffer, or add it to what stands there."""

    buffer: Buffer
    scale: int
    offset: int
    index: Node | None
    value: Node
    adds: bool = False


class Loop:
    """Trips 0 .. n-1; `trips` is their number, an int of at least 1 or an int node of any value (none where below 1).

    `inits`, `phis` and `nexts` belong together place by place; the stores are made once per trip; `after` are tokens. A loop
    stands as far out as what it uses allows, but inside of `pinned`, whose every trip must do it again.
    """

    __slots__ = ("after", "depth", "index", "inits", "nexts", "phis", "pinned", "serial", "stores", "trips")

    def __init__(self, serial: int, depth: int, trips: int | Node) -> None:
        self.serial, self.depth, self.trips = serial, depth, trips
        self.index: Node  # made by whoever makes the loop
        self.inits: list[Node] = []
        self.phis: list[Node] = []
        self.nexts: list[Node] = []
        self.stores: list[Store] = []
        self.after: list[Node] = []
        self.pinned: Loop | None = None

    def __repr__(self) -> str:
        return f"loop{self.serial}"


class Graph:
    """All nodes of a function, and what it does to memory.

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

    def const(self, value: Any, kind: str = "real") -> Node:
        """A number as a node."""
        if kind == "real":
            value = float(value)
            if not self.exact and value == 0.0:
                value = 0.0
            key: Any = ("const", kind, value.hex())
        else:
            value = bool(value) if kind == "bool" else int(value)
            key = ("const", kind, value)
        return self.once(key, "const", (), value, kind)

    def make(self, op: str, args: tuple[Node, ...], attr: Any = None, kind: str | None = None) -> Node:
        """A node, folded where that is possible, or the one that is there already."""
        if kind is None:
            kind = "bool" if op in TRUTH else args[-1].kind
        if op in COMMUTE and args[0].serial > args[1].serial:
            args = (args[1], args[0])
        fold = FOLDS.get(op)
        if fold is not None:
            folded = fold(self, args, kind)
            if folded is not None:
                return folded
        return self.once((op, attr, kind, tuple(a.serial for a in args)), op, args, attr, kind)

    def known(self, key: Any) -> Node | None:
        """The node that `once` made under a key."""
        return self._known.get(key)

    def once(self, key: Any, op: str, args: tuple[Node, ...], attr: Any, kind: str) -> Node:
        """The node under a key, made if it is not there; nothing is folded."""
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
        loop.index = self.once(("index", loop), "index", (), loop, "int")
        return loop

    def carry(self, loop: Loop, init: Node) -> Node:
        """What a loop carries in a new place, as seen during a trip."""
        attr = (loop, len(loop.phis))
        phi = self.once(("phi", *attr), "phi", (), attr, init.kind)
        loop.inits.append(init)
        loop.phis.append(phi)
        return phi

    def close_loop(self, loop: Loop, nexts: Iterable[Node]) -> list[Node]:
        """End a loop with what goes to the next trip; returns what it leaves behind."""
        if self._open.pop() is not loop:
            raise ValueError("loops are closed in the reverse order of opening")
        loop.nexts = list(nexts)
        return [self.end(loop, k) for k in range(len(loop.phis))]

    def end(self, loop: Loop, place: int) -> Node:
        """What a loop leaves behind in a place."""
        return self.once(("end", loop, place), "end", (), (loop, place), loop.phis[place].kind)

    def done(self, loop: Loop) -> Node:
        """The token of a loop that has run."""
        return self.once(("done", loop), "done", (), loop, "token")

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
    def depth(self) -> int:
        """How many loops are open."""
        return len(self._open)

    def unwind(self, depth: int) -> None:
        """Give up loops that are open, down to a depth: what stood in them was refused."""
        del self._open[depth:]


def affine(node: Node) -> tuple[Node | None, int, int]:
    """An int node as scale * base + offset: (base, scale, offset), base None where it is constant."""
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
