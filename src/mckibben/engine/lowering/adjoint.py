"""The discrete adjoint: a run forwards, then backwards with the derivatives of a weighted sum of its results.

Backwards, a loop is gone through from its last trip to its first. What it carried into each trip was kept on the way
forwards, everything else of a trip is made again from that; of a division the reciprocal is kept too. Where this would fill
more than `MOST` numbers per lane, the outermost loops keep what they carry only, and go forwards through what is inside of
them once more in every trip. The derivative of what all trips read is carried along as a sum; that of memory that is read at
an index is added up in memory of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from ...errors import LoweringError
from .adjoint_memory import KEPT, Sums, Twin, side_by_side
from .eliminate import Edges
from .graph import Buffer, Loop, Node, Store
from .partials import is_zero, partials, product, total
from .program import Leaf, Program
from .replay import Derived, Scope
from .rewrite import rewritten
from .schedule import Entry
from .tangents import check
from .way_back import Shape

MOST = 1_000_000  # numbers per lane that are kept of a run
Bars = dict[Node, Node]  # by old node, the derivative of the weighted sum by it so far


def adjoint(program: Program, places: Sequence[int], *, most: int = MOST) -> Program:
    """A program with the derivatives of a weighted sum of its results.

    Args:
        program: what is differentiated.
        places: of the arguments by which, real numbers.
        most: numbers per lane that may be kept of a run.

    Returns:
        One whose arguments are those of the program and a weight for each of its results of real numbers, of the same
        shape; and whose results are those of the program and the derivative by each of the places.

    Raises:
        InputError: an argument that is no real number.
        LoweringError: a loop whose trips are counted only when it runs, or a program that adds to memory.
    """
    check(program, places)
    return _Reverse(program, places, most).program()


class _Reverse(Derived, Sums):
    def __init__(self, program: Program, places: Sequence[int], most: int) -> None:
        super().__init__(program, places)
        self.shape = Shape(self.plan, self.active)
        self.again = self.shape.again(most)
        self.tapes: dict[Any, tuple[Buffer, list[Loop], Loop]] = {}
        self.twins: dict[tuple[Scope, Buffer], Twin] = {}
        self.touched: list[set[Twin]] = [set()]

    # What goes in and comes out

    def program(self) -> Program:
        g, given, leaves = self.new, self.given, list(self.given.arguments)
        for buffer in self.arguments:
            self.outer.buffers[buffer] = g.buffer("argument", buffer.kind, buffer.shape, buffer.name)
        results = [b for b in self.old.buffers if b.role == "result"]
        rest, weights = iter(results), {}
        for leaf in given.results:
            if leaf.kind is not None:
                buffer = next(rest)
                if leaf.kind == "real":
                    leaves.append(Leaf(f"weight of {leaf.name}", "real", leaf.shape))
                    weights[buffer] = g.buffer("argument", "real", leaf.shape, leaves[-1].name)
        for buffer in results:
            self.outer.buffers[buffer] = g.buffer("result", buffer.kind, buffer.shape, buffer.name)
        wanted, slopes = list(given.results), {}
        for place in self.places:
            leaf = given.arguments[place]
            wanted.append(Leaf(f"derivative by {leaf.name}", "real", leaf.shape))
            slopes[self.arguments[place]] = g.buffer("result", "real", leaf.shape, wanted[-1].name)
        self.forward(self.plan.root, self.outer, [], [], True)
        for buffer, weight in weights.items():
            self._weighted(buffer, weight)
        for buffer, slope in slopes.items():
            if not self.shape.plain(buffer):
                self.twins[self.outer, buffer] = self._begun(slope, self.outer)
        self.backward(self.plan.root, self.outer, {})
        for buffer, slope in slopes.items():
            if self.shape.plain(buffer):
                for k in range(buffer.size):
                    g.store(slope, k, self.sums.get((buffer, k), g.const(0.0)))
        whole = rewritten(g, lambda g, node, args: None, exact=False)
        side_by_side(whole)
        return Program(whole, leaves, wanted, given.title)

    # Forwards

    def forward(self, entries: list[Entry], scope: Scope, nest: list[Loop], around: list[Loop], keeps: bool) -> None:
        """Write a block, and keep what the way back needs.

        Args:
            entries: the block.
            scope: where it is written.
            nest: old loops around it whose trips are kept apart.
            around: the new loops of these.
            keeps: whether anything is kept.
        """
        for entry in entries:
            if isinstance(entry, Loop):
                self._forward_loop(entry, scope, nest, around, keeps)
            elif isinstance(entry, Store):
                if entry.adds:
                    raise LoweringError("the program", "it adds to memory; it is a derivative itself")
                if self._written(entry.buffer, scope):
                    value = self.replay.node(scope, entry.value)
                    self.replay.store(scope, entry, self.replay.buffer(scope, entry.buffer), value)
            else:
                self.replay.again(scope, entry)
                if keeps and nest and self.shape.divides(entry):
                    below = self.replay.node(scope, entry.args[1])
                    inverse = self.new.make("div", (self.new.const(1.0), below))
                    self._keep(("inverse", entry.args[1]), inverse, nest, around)
                if keeps and nest and entry in self.shape.dear:
                    self._keep(entry, self.replay.node(scope, entry), nest, around)

    def _written(self, buffer: Buffer, scope: Scope) -> bool:
        """Whether memory is written in this scope: on the way back, only what is read there again."""
        top = scope
        while top.around is not None and not top.turned:
            top = top.around
        return top.around is None or buffer in top.buffers

    def _forward_loop(self, loop: Loop, scope: Scope, nest: list[Loop], around: list[Loop], keeps: bool) -> None:
        g, places = self.new, self.plan.live.carried[loop]
        made, inner = self.replay.opened(scope, loop)
        for k in places:
            inner.nodes[loop.phis[k]] = g.carry(made, self.replay.node(scope, loop.inits[k]))
        keeps = keeps and loop in self.shape.moving
        inside, new = ([*nest, loop], [*around, made]) if keeps else (nest, around)
        if keeps:
            for k in places:
                self._keep((loop, k), inner.nodes[loop.phis[k]], inside, new)
        self.forward(self.plan.bodies[loop], inner, inside, new, keeps and loop not in self.again)
        ends = g.close_loop(made, [self.replay.node(inner, loop.nexts[k]) for k in places])
        scope.loops[loop] = made
        for k, end in zip(places, ends, strict=True):
            scope.nodes[loop, k] = end
            if keeps and nest:
                self._keep(("end", loop, k), end, nest, around)

    def _keep(self, key: Any, value: Node, nest: list[Loop], around: list[Loop]) -> None:
        if key in self.tapes and self.tapes[key][2] is around[0]:
            return
        size = math.prod(self.shape.trips(x) for x in nest)
        buffer = self.new.buffer("scratch", value.kind, (size,), f"{KEPT}{around[-1].serial} {value.kind}")
        self.new.store(buffer, self._flat(nest, [x.index for x in around]), value)
        self.tapes[key] = buffer, list(nest), around[0]

    def _flat(self, nest: list[Loop], indices: Iterable[Node]) -> Node:
        g, place = self.new, self.new.const(0, "int")
        for loop, index in zip(nest, indices, strict=True):
            trips = g.const(self.shape.trips(loop), "int")
            place = g.make("add", (g.make("mul", (place, trips)), index))
        return place

    def kept(self, key: Any, scope: Scope) -> Node:
        """What was kept, on the way back."""
        buffer, nest, first = self.tapes[key]
        index = self._flat(nest, [self.replay.node(scope, x.index) for x in nest])
        return self.new.load(buffer, index, tokens=(self.new.done(first),))

    # Backwards

    def backward(self, entries: list[Entry], scope: Scope, bars: Bars) -> None:
        """Write the way back through a block."""
        if scope is self.outer:
            self.sums = {}
        for buffer in self.shape.begun(entries):
            if (scope, buffer) not in self.twins:
                made = self.new.buffer("scratch", "real", buffer.shape)
                self.twins[scope, buffer] = self._begun(made, scope)
        edges = self._edges(entries, scope)
        for entry in reversed(entries):
            if isinstance(entry, Loop):
                if entry in self.shape.moving:
                    self._backward_loop(entry, scope, bars)
            elif isinstance(entry, Store):
                if entry.value in self.active.nodes:
                    self._add(bars, entry.value, self._read(entry, scope))
            elif entry in self.active.nodes and entry.op == "table":
                twin = self.twin(scope, entry.attr)
                for k, value in enumerate(entry.args):
                    if value in self.active.nodes:
                        self._add(bars, value, self.new.load(twin.buffer, k, tokens=tuple(twin.root.tokens)))
            elif entry in self.active.nodes and entry in bars:
                if entry.op == "load":
                    self._memory(entry, scope, bars[entry])
                for argument, slope in edges.into.get(entry, {}).items():
                    self._add(bars, argument, product(self.new, slope, bars[entry]))

    def _add(self, bars: Bars, node: Node, more: Node) -> None:
        if not is_zero(more):
            known = bars.get(node)
            bars[node] = more if known is None or is_zero(known) else total(self.new, known, more)

    def _edges(self, entries: list[Entry], scope: Scope) -> Edges:
        """What the numbers of a block change by with each other."""
        edges = Edges(self.new)
        for node in entries:
            if isinstance(node, Node) and node in self.active.nodes and node.op not in ("load", "table"):
                slopes = zip(node.args, self._slopes(node, scope), strict=True)
                edges.add(
                    node, [(a, s) for a, s in slopes if s is not None and a in self.active.nodes and not is_zero(s)]
                )
        if scope.around is not None and not any(isinstance(e, Loop) for e in entries):
            (loop,) = scope.loops
            kept = {loop.nexts[k] for k in self.plan.live.carried[loop]}
            kept |= {e.value for e in entries if isinstance(e, Store)}
            kept |= {a for e in entries if isinstance(e, Node) and e.op == "table" for a in e.args}
            edges.shorten(kept, lambda node: {0})
        return edges

    def _slopes(self, node: Node, scope: Scope) -> list[Node | None]:
        args = tuple(self.replay.node(scope, a) for a in node.args)
        made = self.replay.node(scope, node)
        if self.shape.divides(node) and ("inverse", node.args[1]) in self.tapes and scope is not self.outer:
            inverse = self.kept(("inverse", node.args[1]), scope)
            return [inverse, self.new.make("neg", (self.new.make("mul", (made, inverse)),))]
        return partials(self.new, node, args, made)

    def _backward_loop(self, loop: Loop, scope: Scope, bars: Bars) -> None:
        g, carried = self.new, self.plan.live.carried[loop]
        trips, inner = self.shape.trips(loop), Scope(scope)
        made = g.open_loop(trips)
        inner.loops[loop] = made
        inner.turned.add(loop)
        inner.nodes[loop.index] = g.make("sub", (g.const(trips - 1, "int"), made.index))
        shared, zero = self.shape.shared(loop), g.const(0.0)
        moving = [k for k in carried if loop.phis[k] in self.active.nodes]
        own: Bars = {x: g.carry(made, bars.get(x, zero)) for x in shared}
        behind = [g.carry(made, bars.pop(self.shape.ends.get((loop, k), zero), zero)) for k in moving]
        self.touched.append(set())
        for k in carried:
            inner.nodes[loop.phis[k]] = self.kept((loop, k), inner)
        self._restored(loop, inner)
        for k, bar in zip(moving, behind, strict=True):
            if loop.nexts[k] in self.active.nodes:
                self._add(own, loop.nexts[k], bar)
        self.backward(self.plan.bodies[loop], inner, own)
        nexts = [*(own[x] for x in shared), *(own.get(loop.phis[k], zero) for k in moving)]
        for twin in self.touched[-1]:
            made.after += [n for n in twin.tokens if n not in made.after]
        ends = g.close_loop(made, nexts)
        for twin in self.touched.pop():
            if twin.scope is scope:
                twin.tokens.append(g.done(made))
            else:
                self.touched[-1].add(twin)
        bars.update(zip(shared, ends, strict=False))
        for k, end in zip(moving, ends[len(shared) :], strict=True):
            if loop.inits[k] in self.active.nodes:
                self._add(bars, loop.inits[k], end)

    def _restored(self, loop: Loop, scope: Scope) -> None:
        """What a trip made on its way forwards, made again or kept."""
        entries = self.plan.bodies[loop]
        if loop in self.again:
            for buffer in self.shape.local(loop):
                scope.buffers[buffer] = self.new.buffer("scratch", buffer.kind, buffer.shape)
            self.forward(entries, scope, [], [], True)
            return
        for entry in entries:
            if isinstance(entry, Loop):
                if entry in self.shape.moving:
                    for k in self.plan.live.carried[entry]:
                        scope.nodes[entry, k] = self.kept(("end", entry, k), scope)
                else:
                    self._forward_loop(entry, scope, [], [], False)
            elif isinstance(entry, Node):
                if entry in self.tapes:
                    scope.nodes[entry] = self.kept(entry, scope)
                elif self.shape.divides(entry) and ("inverse", entry.args[1]) in self.tapes:
                    above = self.replay.node(scope, entry.args[0])
                    inverse = self.kept(("inverse", entry.args[1]), scope)
                    scope.nodes[entry] = self.new.make("mul", (above, inverse))
                else:
                    self.replay.again(scope, entry)
