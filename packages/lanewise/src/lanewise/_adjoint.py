"""The discrete adjoint: a run forwards, then backwards with the derivatives of a weighted sum of its results.

Backwards, a loop is gone through from its last trip to its first. What it carried into each trip was kept on the way
forwards, everything else of a trip is made again from that; of a division the reciprocal is kept too. Where this would fill
more than `MOST` numbers per lane, the outermost loops keep what they carry only, and go forwards through what is inside of
them once more in every trip. The derivative of what all trips read is carried along as a sum; that of memory that is read at
an index is added up in memory of its own. `ReverseAnalysis` finds out all of this before the way back is written.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from ._analysis import Entry, Schedule, enclosing_buffers, rewrite
from ._derivatives import (
    ActiveNodes,
    DerivedGraph,
    LinearGraph,
    Replay,
    Scope,
    check,
    is_zero,
    partials,
    product,
    total,
)
from ._graph import DOUBLE, Buffer, Graph, Loop, Node, Store
from ._program import Leaf, Program
from .errors import LoweringError

# ---- what is known before the way back is written


DEAR = 2.0  # operations to make a number again from which on it is kept
SMALL = 64  # elements of an argument up to which its derivative is no sum in memory


class ReverseAnalysis:
    """Analysis of loops and memory for the reverse pass."""

    def __init__(self, plan: Schedule, active: ActiveNodes) -> None:
        self.plan, self.active = plan, active
        live, home = plan.live, plan.home
        self.home = home
        self.ends = {n.attr: n for n in live.nodes if n.op == "end"}
        self.inside: dict[Loop, set[Loop]] = {x: set() for x in live.loops}  # each with those inside of it
        for loop in live.loops:
            up: Loop | None = loop
            while up is not None:
                self.inside[up].add(loop)
                up = home[up]
        self.loads = [n for n in live.nodes if n.op == "load"]
        self.moving = {x for x in live.loops if any(self._moves(y) for y in self.inside[x])}
        self._shared: dict[Loop, list[Node]] = {}
        self.dear = {n for x in self.moving if len(self.inside[x]) == 1 for n in self._dear(x)}

    def _moves(self, loop: Loop) -> bool:
        if any(loop.phis[k] in self.active.nodes for k in self.plan.live.carried[loop]):
            return True
        return any(
            (e.value if isinstance(e, Store) else e) in self.active.nodes
            for e in self.plan.bodies[loop]
            if not isinstance(e, Loop)
        )

    @staticmethod
    def trips(loop: Loop) -> int:
        """Number of trips of a loop."""
        if isinstance(loop.trips, int):
            return loop.trips
        raise LoweringError("a loop", "its derivative needs a number of trips that is known before it runs")

    def divides(self, node: Entry) -> bool:
        """Whether the reciprocal of a division in a loop is stored."""
        if not isinstance(node, Node) or node.op != "div" or node not in self.active.nodes:
            return False
        home = self.home[node]
        return home is not None and self.home.get(node.args[1]) is home

    def _dear(self, loop: Loop) -> list[Node]:
        """Values worth storing: sums that the reverse pass needs, of many terms that it does not need."""
        entries = [e for e in self.plan.bodies[loop] if isinstance(e, Node)]
        needed = {a for e in entries if e in self.active.nodes for a in _needed(e)}
        uses = Counter(a for e in entries for a in e.args)
        cost: dict[Node, float] = {}
        sums = []
        for node in entries:
            if node.op in ("load", "table"):
                continue
            cost[node] = 1.0 + sum(0.0 if a in needed else cost.get(a, 0.0) / uses[a] for a in node.args)
            if cost[node] > DEAR and node.kind == "real":
                cost[node] = 0.0
                sums.append(node)
        return sums

    def plain(self, buffer: Buffer) -> bool:
        """Whether an argument is read at known places only."""
        return buffer.size <= SMALL and not any(n.attr[0] is buffer and n.attr[1] for n in self.loads)

    def read(self, buffer: Buffer) -> bool:
        """Whether a buffer, or one inside it, is read again as a changing value."""
        return any(n in self.active.nodes and buffer in enclosing_buffers(n.attr[0]) for n in self.loads)

    def begun(self, entries: list[Entry]) -> list[Buffer]:
        """Buffers whose derivatives begin with a block: those that it writes and reads."""
        buffers: dict[Buffer, None] = {}
        for entry in entries:
            if isinstance(entry, Node) and entry.op == "table" and entry in self.active.nodes:
                buffers[entry.attr] = None
            for loop in self.inside[entry] if isinstance(entry, Loop) else ():
                for store in loop.stores:
                    root = list(enclosing_buffers(store.buffer))[-1]
                    if root.role == "scratch" and root in self.active.buffers and root.kind == "real":
                        buffers[root] = None
        return [b for b in buffers if self._here(b, entries)]

    def _here(self, buffer: Buffer, entries: list[Entry]) -> bool:
        """Whether all readers of a buffer are in a block or inside it."""
        inside = {x for e in entries if isinstance(e, Loop) for x in self.inside[e]}
        own = {e for e in entries if isinstance(e, Node)}
        return all(
            n in own or self.home[n] in inside for n in self.loads if buffer in enclosing_buffers(n.attr[0])
        ) and not any(
            all(
                n in self.plan.bodies[x] or self.home[n] in self.inside[x]
                for n in self.loads
                if buffer in enclosing_buffers(n.attr[0])
            )
            and self._writes(x, buffer)
            for x in inside
        )

    def _writes(self, loop: Loop, buffer: Buffer) -> bool:
        """Whether a buffer is written by loops inside of one, not by itself."""
        return any(buffer in enclosing_buffers(s.buffer) for x in self.inside[loop] - {loop} for s in x.stores)

    def local(self, loop: Loop) -> list[Buffer]:
        """Memory that one trip writes, by inner loops, and reads."""
        written = {s.buffer for x in self.inside[loop] - {loop} for s in x.stores}
        read = {n.attr[0] for n in self.loads if self.home[n] in self.inside[loop]}
        return sorted(written & read, key=lambda b: b.serial)

    def again(self, most: int) -> set[Loop]:
        """Loops whose content is recomputed in every trip of the reverse pass."""
        loops = {x for x in self.moving if self.local(x)}
        size = 0
        for loop in self.moving:
            many, up = len(self.plan.live.carried[loop]), self.home[loop]
            many *= self.trips(loop)
            while up is not None:
                many, up = many * self.trips(up), self.home[up]
            size += many
        if size > most:
            loops |= {x for x in self.moving if self.home[x] is None and len(self.inside[x]) > 1}
        return loops

    def shared(self, loop: Loop) -> list[Node]:
        """Changing values from outside a loop that are used inside."""
        if loop not in self._shared:
            nodes: dict[Node, None] = {}
            for x in sorted(self.inside[loop], key=lambda x: x.serial):
                places = self.plan.live.carried[x]
                used = [n for k in places for n in ((None if x is loop else x.inits[k]), x.nexts[k]) if n is not None]
                for entry in self.plan.bodies[x]:
                    if isinstance(entry, Store):
                        used.append(entry.value)
                    elif isinstance(entry, Node) and entry in self.active.nodes and entry.op != "load":
                        used += entry.args
                for node in used:
                    if node in self.active.nodes and node.op != "table" and self.home[node] not in self.inside[loop]:
                        nodes[node] = None
            self._shared[loop] = list(nodes)
        return self._shared[loop]


def _needed(node: Node) -> tuple[Node, ...]:
    """Nodes on which the derivatives of an operation depend."""
    if node.op in ("add", "sub", "neg"):
        return ()
    if node.op == "select":
        return node.args[:1]
    if node.op == "given":
        return node.args[2::2]
    return (*node.args, node) if node.op in ("div", "sqrt", "exp", "expm1", "pow") else node.args


# ---- memory


KEPT = "kept of loop "  # what buffers of numbers that are kept of one loop are called


class Twin:
    """Memory for the derivatives by a buffer's numbers; `tokens` say what was added to it, `scope` where it began."""

    def __init__(self, buffer: Buffer, scope: Scope, root: Twin | None = None) -> None:
        self.buffer, self.root = buffer, root or self
        self.scope, self.tokens = scope, list[Node]()


class Sums:
    """The part of an adjoint that adds up in memory."""

    new: Graph
    outer: Scope
    replay: Replay
    shape: ReverseAnalysis
    twins: dict[tuple[Scope, Buffer], Twin]
    touched: list[set[Twin]]  # by open loop, what has been added to
    sums: dict[tuple[Buffer, int], Node]  # derivatives by elements that are read at known places

    def _weighted(self, buffer: Buffer, weight: Buffer) -> None:
        """The weights of a result, as the beginning of the derivatives by it."""
        if not self.shape.read(buffer):
            self.twins[self.outer, buffer] = Twin(weight, self.outer)
            return
        made = self.new.buffer("scratch", "real", buffer.shape)
        self.twins[self.outer, buffer] = self._begun(made, self.outer, weight)

    def _begun(self, buffer: Buffer, scope: Scope, values: Buffer | None = None) -> Twin:
        g, twin = self.new, Twin(buffer, scope)
        if buffer.size:
            loop = g.open_loop(buffer.size)
            g.store(buffer, loop.index, g.const(0.0) if values is None else g.load(values, loop.index))
            g.pin()
            g.close_loop(loop, ())
            twin.tokens.append(g.done(loop))
        return twin

    def _memory(self, node: Node, scope: Scope, bar: Node) -> None:
        """Add to the derivatives by what was read."""
        buffer, scale, offset = node.attr
        if buffer.role == "argument" and self.shape.plain(buffer):
            self.sums[buffer, offset] = bar
            return
        twin, g = self.twin(scope, buffer), self.new
        index: Node | int = self.replay.node(scope, node.args[0]) if scale else 0
        if twin.root.scope is scope:  # what is added here is read here: a loop of one trip says when it is there
            loop = g.open_loop(1)
            loop.after = list(twin.root.tokens)
            g.store(twin.buffer, index, bar, scale=scale, offset=offset, adds=True)
            g.close_loop(loop, ())
            twin.root.tokens.append(g.done(loop))
        else:
            g.store(twin.buffer, index, bar, scale=scale, offset=offset, adds=True)
            self.touched[-1].add(twin.root)

    def _read(self, store: Store, scope: Scope) -> Node:
        """The derivative by what was stored."""
        twin = self.twin(scope, store.buffer)
        index: Node | int = 0 if store.index is None else self.replay.node(scope, store.index)
        return self.new.load(twin.buffer, index, store.scale, store.offset, tuple(twin.root.tokens))

    def twin(self, scope: Scope, buffer: Buffer) -> Twin:
        """The derivatives by a buffer's numbers."""
        at: Scope | None = scope
        while at is not None:
            twin = self.twins.get((at, buffer))
            if twin is not None:
                return twin
            at = at.around
        assert buffer.within is not None, buffer.name
        inside, offset, loop, by = buffer.within
        around = self.twin(scope, inside)
        made = self.new.buffer("scratch", "real", buffer.shape)
        made.within = self.replay.moved(scope, around.buffer, offset, loop, by)
        home = scope
        while loop is not None and home.around is not None and loop not in home.loops:
            home = home.around
        twin = self.twins[home if loop is not None else self.outer, buffer] = Twin(made, home, around.root)
        return twin


def side_by_side(graph: Graph) -> None:
    """Arrange the stored values of one trip side by side in memory, instead of each value over all trips."""
    groups: dict[str, list[Buffer]] = {}
    for buffer in graph.buffers:
        if buffer.name.startswith(KEPT):
            groups.setdefault(buffer.name, []).append(buffer)
    place: dict[Buffer, tuple[Buffer, int, int]] = {}
    for name, buffers in groups.items():
        many = len(buffers)
        whole = graph.buffer("scratch", buffers[0].kind, (buffers[0].size * many,), name)
        place.update({b: (whole, many, k) for k, b in enumerate(buffers)})
    for node in graph.nodes:
        if node.op == "load" and node.attr[0] in place:
            (whole, many, k), (_, scale, offset) = place[node.attr[0]], node.attr
            node.attr = whole, scale * many, offset * many + k
    for stores in (graph.stores, *(x.stores for x in graph.loops)):
        for i, store in enumerate(stores):
            if store.buffer in place:
                whole, many, k = place[store.buffer]
                stores[i] = dataclasses.replace(
                    store, buffer=whole, scale=store.scale * many, offset=store.offset * many + k
                )


# ---- reverse mode


MOST = 1_000_000  # numbers per lane that are kept of a run


def replaces_arrays(graph: Graph) -> bool:
    """Whether a loop of a program carries a long array and replaces it in every trip."""
    return any(buffer.name == DOUBLE for buffer in graph.buffers)


Bars = dict[Node, Node]  # by old node, the derivative of the weighted sum by it so far


def adjoint(program: Program, places: Sequence[int], *, most: int = MOST) -> Program:
    """A program with the derivatives of a weighted sum of its results.

    Args:
        program: the program to differentiate.
        places: places of the arguments by which, real numbers.
        most: numbers per lane that may be kept of a run.

    Returns:
        One whose arguments are those of the program and a weight for each of its results of real numbers, of the same
        shape; and whose results are those of the program and the derivative by each of the places.

    Raises:
        ArgumentError: an argument that is no real number.
        LoweringError: a loop whose trips are counted only when it runs, or that replaces a long array; or a program that
            adds to memory.
    """
    check(program, places)
    if replaces_arrays(program.graph):
        raise LoweringError("a loop", "it replaces a long array in every trip, through which there is no way back")
    return _Reverse(program, places, most).program()


class _Reverse(DerivedGraph, Sums):
    def __init__(self, program: Program, places: Sequence[int], most: int) -> None:
        super().__init__(program, places)
        self.shape = ReverseAnalysis(self.plan, self.active)
        self.again = self.shape.again(most)
        self.tapes: dict[Any, tuple[Buffer, list[Loop], Loop]] = {}
        self.twins: dict[tuple[Scope, Buffer], Twin] = {}
        self.touched: list[set[Twin]] = [set()]

    # What goes in and comes out

    def program(self) -> Program:
        g, original, leaves = self.new, self.given, list(self.given.arguments)
        for buffer in self.arguments:
            self.outer.buffers[buffer] = g.buffer("argument", buffer.kind, buffer.shape, buffer.name)
        results = [b for b in self.old.buffers if b.role == "result"]
        rest, weights = iter(results), {}
        for leaf in original.results:
            if leaf.kind is not None:
                buffer = next(rest)
                if leaf.kind == "real":
                    leaves.append(Leaf(f"weight of {leaf.name}", "real", leaf.shape))
                    weights[buffer] = g.buffer("argument", "real", leaf.shape, leaves[-1].name)
        for buffer in results:
            self.outer.buffers[buffer] = g.buffer("result", buffer.kind, buffer.shape, buffer.name)
        wanted, slopes = list(original.results), {}
        for place in self.places:
            leaf = original.arguments[place]
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
        whole = rewrite(g, lambda g, node, args: None, exact=False)
        side_by_side(whole)
        return Program(whole, leaves, wanted, original.title)

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
                # on the way back memory is written only where it is read there again
                top = scope
                while top.around is not None and not top.turned:
                    top = top.around
                if top.around is None or entry.buffer in top.buffers:
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
        """Load a stored value in the reverse pass."""
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

    def _edges(self, entries: list[Entry], scope: Scope) -> LinearGraph:
        """Graph of partial derivatives within a block."""
        edges = LinearGraph(self.new)
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
        """Restore the values of a forward trip, by recomputation or from memory."""
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
