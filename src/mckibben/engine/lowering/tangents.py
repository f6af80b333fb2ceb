"""Forward tangents: a program beside which derivatives in several directions go along.

Every number gets its changes in all directions, as sums over what it depends on. In a loop without further loops the graph
of these sums is shortened first: a value with few inputs and uses is replaced by products of partial derivatives, taken once
for all directions, wherever that saves operations (vertex elimination; A. Griewank and A. Walther, Evaluating Derivatives,
2nd ed., 2008, chapter 9). Of a system this leaves little more than the Jacobian of its rates.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...errors import InputError
from .eliminate import Edges
from .graph import Buffer, Loop, Node, Store
from .partials import is_zero, partials, product, total
from .program import Leaf, Program
from .replay import Derived, Scope
from .rewrite import rewritten
from .schedule import Entry


def tangents(program: Program, places: Sequence[int], count: int) -> Program:
    """A program with its derivatives.

    Args:
        program: what is differentiated.
        places: of the arguments by which, real numbers.
        count: of directions.

    Returns:
        One whose arguments are those of the program and, for each of the places, its change in each direction, (count,
        ...); and whose results are those of the program, and their changes, (count, ...). A result that does not change
        carries nothing.

    Raises:
        InputError: an argument that is no real number, or no direction.
    """
    check(program, places)
    if count < 1:
        raise InputError("count", count, "allowed is at least one direction")
    return _Forward(program, places, count).program()


def check(program: Program, places: Sequence[int]) -> None:
    """Refuse arguments that have no derivative."""
    for place in places:
        if not 0 <= place < len(program.arguments):
            raise InputError("places", place, f"the program has {len(program.arguments)} arguments")
        leaf = program.arguments[place]
        if leaf.kind != "real":
            raise InputError(leaf.name, leaf.kind or "nothing", "only real numbers have derivatives")


class _Forward(Derived):
    def __init__(self, program: Program, places: Sequence[int], count: int) -> None:
        super().__init__(program, places)
        self.count = count
        self.twins: dict[tuple[Buffer, int], tuple[Buffer, int]] = {}
        self.changes: dict[tuple[Node, int], Node] = {}  # by old node and direction; ends by (loop, place)
        self.ends: dict[tuple[Loop, int], list[Node]] = {}
        self.inside = {home for x, home in self.plan.home.items() if isinstance(x, Loop)}

    def program(self) -> Program:
        given, leaves = self.given, list(self.given.arguments)
        for buffer in self.arguments:
            self.outer.buffers[buffer] = self.new.buffer("argument", buffer.kind, buffer.shape, buffer.name)
        for place in self.places:
            leaf = leaves[place]
            leaves.append(Leaf(f"change of {leaf.name}", "real", (self.count, *leaf.shape)))
            self._twinned(self.arguments[place], self.new.buffer("argument", "real", leaves[-1].shape, leaves[-1].name))
        results = [b for b in self.old.buffers if b.role == "result"]
        for buffer in results:
            self.outer.buffers[buffer] = self.new.buffer("result", buffer.kind, buffer.shape, buffer.name)
        wanted, rest = list(given.results), iter(results)
        for leaf in given.results:
            changed = Leaf(f"change of {leaf.name}", None, (self.count, *leaf.shape))
            if leaf.kind is not None:
                buffer = next(rest)
                if leaf.kind == "real" and buffer in self.active.buffers:
                    changed = changed._replace(kind="real")
                    self._twinned(buffer, self.new.buffer("result", "real", changed.shape, changed.name))
            wanted.append(changed)
        self.block(self.plan.root, self.outer, False)
        whole = rewritten(self.new, lambda g, node, args: None, exact=False)
        return Program(whole, leaves, wanted, given.title)

    def _twinned(self, buffer: Buffer, twin: Buffer) -> None:
        for k in range(self.count):
            self.twins[buffer, k] = twin, k * buffer.size

    def twin(self, scope: Scope, buffer: Buffer, k: int) -> tuple[Buffer, int]:
        """Where the changes of a buffer's numbers in a direction stand: a buffer, and from which element on."""
        found = self.twins.get((buffer, k))
        if found is None:
            made = self.new.buffer("scratch", "real", buffer.shape, buffer.name)
            if buffer.within is not None:
                inside, offset, loop, by = buffer.within
                root, more = self.twin(scope, inside, k)
                made.within = self.replay.moved(scope, root, offset + more, loop, by)
            found = self.twins[buffer, k] = made, 0
        return found

    def change(self, node: Node, k: int) -> Node:
        """How a node changes in a direction."""
        if node.op == "end":
            found = self.ends.get(node.attr)
            return self.new.const(0.0) if found is None else found[k]
        return self.changes.get((node, k)) or self.new.const(0.0)

    def block(self, entries: list[Entry], scope: Scope, leaf: bool) -> None:
        """Write a block with its changes; in a leaf, a block without loops, they are shortened first."""
        later: list[Store] = []
        edges, last = Edges(self.new), self._last_needed(entries) if leaf else {}
        for place, entry in enumerate(entries):
            if isinstance(entry, Loop):
                self.loop(entry, scope)
            elif isinstance(entry, Store):
                if leaf:
                    later.append(entry)
                else:
                    self.store(entry, scope)
            else:
                made = self.replay.again(scope, entry)
                if entry not in self.active.nodes or (leaf and entry not in last):
                    continue
                if entry.op == "table" and leaf:  # puts the changes of its numbers into memory, so they must be there
                    self._write_changes(edges, {n for n in edges.into if last[n] >= place})
                    edges = Edges(self.new)
                if entry.op in ("load", "table"):
                    self._memory(entry, scope)
                    continue
                args = tuple(self.replay.node(scope, a) for a in entry.args)
                terms = [
                    (a, p)
                    for a, p in zip(entry.args, partials(self.new, entry, args, made), strict=True)
                    if p is not None and a in self.active.nodes and not is_zero(p)
                ]
                if leaf:
                    edges.add(entry, terms)
                else:
                    self._sum(entry, terms)
        if leaf:
            self._write_changes(edges, {n for n in edges.into if last[n] >= len(entries)})
            for store in later:
                self.store(store, scope)

    def _last_needed(self, entries: list[Entry]) -> dict[Node, int]:
        """Place of the last entry of a leaf that needs the change of a node; the leaf's length where its end needs it."""
        last = dict.fromkeys(self._nexts, len(entries))
        for place, entry in reversed(list(enumerate(entries))):
            if isinstance(entry, Store):
                last[entry.value] = len(entries)
            elif isinstance(entry, Node) and entry in last:
                for argument in entry.args[1::2] if entry.op == "given" else entry.args:
                    last.setdefault(argument, place)
        return last

    def _write_changes(self, edges: Edges, kept: set[Node]) -> None:
        """Shorten the sums of a part of a leaf, and write the changes of the nodes that are needed after it."""
        edges.shorten(kept, lambda n: {k for k in range(self.count) if not is_zero(self.change(n, k))})
        for node, terms in edges.rest(kept):
            self._sum(node, terms)

    _nexts: set[Node] = set()

    def _sum(self, node: Node, terms: list[tuple[Node, Node]]) -> None:
        for k in range(self.count):
            found = None
            for argument, partial in sorted(terms, key=lambda t: t[1].op != "const"):
                change = self.change(argument, k)
                if not is_zero(change):
                    part = product(self.new, partial, change)
                    found = part if found is None else total(self.new, found, part)
            if found is not None:
                self.changes[node, k] = found

    def _memory(self, node: Node, scope: Scope) -> None:
        """What is read from memory, or put there as a table."""
        for k in range(self.count):
            if node.op == "table":
                twin, _ = self.twin(scope, node.attr, k)
                values = tuple(self.change(a, k) for a in node.args)
                self.changes[node, k] = self.new.once(("table", twin), "table", values, twin, "token")
                continue
            buffer, scale, offset = node.attr
            twin, more = self.twin(scope, buffer, k)
            args = tuple(self.changes.get((a, k)) or self.replay.node(scope, a) for a in node.args)
            self.changes[node, k] = self.new.make("load", args, (twin, scale, offset + more), "real")

    def store(self, store: Store, scope: Scope) -> None:
        """A store, and those of its changes."""
        if store.adds:
            raise InputError("program", "adds to memory", "allowed are programs that are no derivatives themselves")
        buffer = self.replay.buffer(scope, store.buffer)
        self.replay.store(scope, store, buffer, self.replay.node(scope, store.value))
        if store.buffer in self.active.buffers and store.buffer.kind == "real":
            for k in range(self.count):
                twin, more = self.twin(scope, store.buffer, k)
                self.replay.store(scope, store, twin, self.change(store.value, k), more)

    def loop(self, loop: Loop, scope: Scope) -> None:
        """A loop that carries its changes with it."""
        made, inner = self.replay.opened(scope, loop)
        places = self.plan.live.carried[loop]
        for k in places:
            inner.nodes[loop.phis[k]] = self.new.carry(made, self.replay.node(scope, loop.inits[k]))
        moving = [p for p in places if loop.phis[p] in self.active.nodes]
        for k in range(self.count):
            for p in moving:
                self.changes[loop.phis[p], k] = self.new.carry(made, self.change(loop.inits[p], k))
        before, self._nexts = self._nexts, {loop.nexts[p] for p in moving}
        self.block(self.plan.bodies[loop], inner, loop not in self.inside)
        self._nexts = before
        nexts = [self.replay.node(inner, loop.nexts[p]) for p in places]
        nexts += [self.change(loop.nexts[p], k) for k in range(self.count) for p in moving]
        ends = self.new.close_loop(made, nexts)
        scope.loops[loop] = made
        for p, end in zip(places, ends, strict=False):
            scope.nodes[loop, p] = end
        for i, p in enumerate(moving):
            self.ends[loop, p] = ends[len(places) + i :: len(moving)]
