"""Forward derivatives: programs that also compute tangents in several directions.

Every number gets its changes in all directions, as sums over what it depends on. In a loop without further loops the graph
of these sums is shortened first: a value with few inputs and uses is replaced by products of partial derivatives, taken once
for all directions, wherever that saves operations (vertex elimination; A. Griewank and A. Walther, Evaluating Derivatives,
2nd ed., 2008, chapter 9). Of a system this leaves little more than the Jacobian of its rates.

Where an extreme is reached by both arguments each has half of it, and the slope of abs at 0 is 1: as JAX has it. What the
tracer was told about a value (op ``given``) goes before what its operations would say.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ._analysis import Entry, Schedule, enclosing_buffers, make_schedule, rewrite
from ._graph import Buffer, Graph, Loop, Node, Store
from ._program import Leaf, Program
from .errors import ArgumentError

# ---- derivatives of one operation


def partials(g: Graph, node: Node, args: tuple[Node, ...], made: Node) -> list[Node | None]:
    """Derivatives of a node by its arguments, None if there is none.

    Args:
        g: where they are made.
        node: node of the old graph.
        args: its arguments in the new one.
        made: itself in the new one.
    """
    if node.op == "given":
        derivatives: list[Node | None] = [None] * len(args)
        derivatives[1::2] = args[2::2]
        return derivatives
    rule = _RULES.get(node.op)
    return [None] * len(args) if rule is None else rule(g, made, args)


def _one(g: Graph) -> Node:
    return g.const(1.0)


def _quotient(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    inverse = g.make("div", (_one(g), args[1]))
    by_below = None if args[1].op == "const" else g.make("neg", (g.make("mul", (z, inverse)),))
    return [inverse, by_below]


def _extreme(g: Graph, args: tuple[Node, ...], largest_need: bool) -> list[Node | None]:
    below, above = g.make("lt", args), g.make("lt", args[::-1])
    first, second = (above, below) if largest_need else (below, above)
    share = g.make("select", (first, _one(g), g.make("select", (second, g.const(0.0), g.const(0.5)))))
    return [share, g.make("sub", (_one(g), share))]


def _size(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    return [g.make("select", (g.make("lt", (args[0], g.const(0.0))), g.const(-1.0), _one(g)))]


def _power(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    x, y = args
    zero, one = g.const(0.0), _one(g)
    lower = g.make("pow", (x, g.make("sub", (y, one))))
    by_x = g.make("select", (g.make("eq", (y, zero)), zero, g.make("mul", (y, lower))))
    logarithm = g.make("log", (g.make("select", (g.make("eq", (x, zero)), one, x)),))
    return [by_x, None if y.op == "const" else g.make("mul", (z, logarithm))]


def _chosen(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    one, zero = _one(g), g.const(0.0)
    return [None, g.make("select", (args[0], one, zero)), g.make("select", (args[0], zero, one))]


_RULES: dict[str, Callable[[Graph, Node, tuple[Node, ...]], list[Node | None]]] = {
    "add": lambda g, z, a: [_one(g), _one(g)],
    "sub": lambda g, z, a: [_one(g), g.const(-1.0)],
    "mul": lambda g, z, a: [a[1], a[0]],
    "div": _quotient,
    "neg": lambda g, z, a: [g.const(-1.0)],
    "abs": _size,
    "sqrt": lambda g, z, a: [g.make("div", (g.const(0.5), z))],
    "max": lambda g, z, a: _extreme(g, a, True),
    "min": lambda g, z, a: _extreme(g, a, False),
    "exp": lambda g, z, a: [z],
    "expm1": lambda g, z, a: [g.make("add", (z, _one(g)))],
    "log": lambda g, z, a: [g.make("div", (_one(g), a[0]))],
    "log1p": lambda g, z, a: [g.make("div", (_one(g), g.make("add", (_one(g), a[0]))))],
    "sin": lambda g, z, a: [g.make("cos", a)],
    "cos": lambda g, z, a: [g.make("neg", (g.make("sin", a),))],
    "pow": _power,
    "select": _chosen,
}


def product(g: Graph, x: Node, y: Node) -> Node:
    """Product of x and y; a factor that chooses between 1 and 0 is a choice, a sign is left to the sum that follows."""
    if x.op == "neg" or y.op == "neg":
        signs = (x.op == "neg") + (y.op == "neg")
        made = product(g, *(z.args[0] if z.op == "neg" else z for z in (x, y)))
        return made if signs == 2 else g.make("neg", (made,))
    for a, b in ((x, y), (y, x)):
        if a.op == "select" and a.args[1].op == a.args[2].op == "const":
            if (a.args[1].attr, a.args[2].attr) == (1.0, 0.0):
                return g.make("select", (a.args[0], b, a.args[2]))
            if (a.args[1].attr, a.args[2].attr) == (0.0, 1.0):
                return g.make("select", (a.args[0], a.args[1], b))
    return g.make("mul", (x, y))


def total(g: Graph, x: Node, y: Node) -> Node:
    """Add x and y; choices by the same condition are merged."""
    if x.op == y.op == "select" and x.args[0] is y.args[0]:
        for a, b in ((x, y), (y, x)):
            if is_zero(a.args[2]) and is_zero(b.args[1]):
                return g.make("select", (a.args[0], a.args[1], b.args[2]))
    return g.make("add", (x, y))


def is_zero(node: Node) -> bool:
    """Whether a node is the number 0."""
    return node.op == "const" and node.attr == 0.0


class ActiveNodes:
    """Nodes that depend on some arguments, through numbers that have derivatives.

    Attributes:
        nodes: in no order.
        buffers: all that hold such numbers.
    """

    def __init__(self, graph: Graph, plan: Schedule, arguments: set[Buffer]) -> None:
        self.nodes: set[Node] = set()
        self.buffers = set(arguments)
        stores = [s for x in plan.live.loops for s in x.stores] + graph.stores
        before = (-1, -1)
        while before != (len(self.nodes), len(self.buffers)):
            before = len(self.nodes), len(self.buffers)
            for buffer in plan.live.buffers:
                if any(b in self.buffers for b in enclosing_buffers(buffer)):
                    self.buffers.update(enclosing_buffers(buffer))
            for node in plan.live.nodes:
                if node not in self.nodes and self._depends(node):
                    self.nodes.add(node)
                    if node.op == "table":
                        self.buffers.add(node.attr)
            self.buffers.update(s.buffer for s in stores if s.value in self.nodes)

    def _depends(self, node: Node) -> bool:
        if node.op in ("phi", "end"):
            loop, k = node.attr
            return loop.inits[k] in self.nodes or loop.nexts[k] in self.nodes
        if node.op == "load":
            return node.kind == "real" and node.attr[0] in self.buffers
        if node.op == "given":
            return any(a in self.nodes for a in node.args[1::2])
        if node.op == "table":
            return any(a in self.nodes for a in node.args)
        return node.kind == "real" and node.op in _RULES and any(a in self.nodes for a in node.args)


# ---- elimination


class LinearGraph:
    """Graph of partial derivatives: for each node, the nodes it depends on and their factors.

    Args:
        graph: where the partial derivatives are.
    """

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.into: dict[Node, dict[Node, Node]] = {}
        self.uses: dict[Node, set[Node]] = {}
        self.wide: dict[Node, int] = {}

    def add(self, node: Node, terms: list[tuple[Node, Node]]) -> None:
        """Nodes are added in an order in which arguments come first."""
        sums: dict[Node, Node] = {}
        for argument, partial in terms:
            known = sums.get(argument)
            sums[argument] = partial if known is None else total(self.graph, known, partial)
        self.into[node] = sums
        for argument in sums:
            self.uses.setdefault(argument, set()).add(node)

    def shorten(self, kept: set[Node], directions: Callable[[Node], set[int]]) -> None:
        """Take nodes out while that saves operations.

        Args:
            kept: nodes whose changes are needed.
            directions: in which a node from outside of the block changes.
        """
        self._prune(kept)
        support: dict[Node, set[int]] = {}
        for node, terms in self.into.items():
            for a in terms:
                if a not in support:
                    support[a] = directions(a)
            support[node] = set().union(*(support[a] for a in terms))
        self.wide = {n: len(s) for n, s in support.items()}
        best: list[tuple[float, int]] = []  # what saves most for its work comes first
        number = {n: k for k, n in enumerate(self.into)}
        nodes = list(self.into)
        rank: dict[Node, float] = {}

        def look(node: Node) -> None:
            gain = self._gain(node)
            rank[node] = -gain / (1.0 + len(self.into[node]) * len(self.uses[node]))
            if gain >= 0.0:
                heapq.heappush(best, (rank[node], number[node]))

        for node in nodes:
            if node not in kept:
                look(node)
        while best:
            ranked, k = heapq.heappop(best)
            node = nodes[k]
            if node not in self.into or rank[node] != ranked:
                continue  # seen in another state of the graph
            near = {*self.into[node], *self.uses[node]}
            self._remove(node)
            for n in list(near):
                near.update(self.uses.get(n, ()), self.into.get(n, ()))
            for n in sorted(
                (n for n in near if n in number and n in self.into and n not in kept), key=number.__getitem__
            ):
                look(n)

    def rest(self, kept: set[Node]) -> Iterator[tuple[Node, list[tuple[Node, Node]]]]:
        """Iterate over the remaining nodes, arguments first."""
        for node, terms in self.into.items():
            yield node, list(terms.items())

    def _prune(self, kept: set[Node]) -> None:
        for node in reversed(list(self.into)):
            if node not in kept and not self.uses.get(node):
                self._forget(node)

    def _forget(self, node: Node) -> None:
        for argument in self.into.pop(node):
            self.uses[argument].discard(node)

    def _unit(self, partial: Node) -> bool:
        return partial.op == "const" and abs(partial.attr) == 1.0

    def _cost(self, terms: dict[Node, Node]) -> float:
        """Operations per node for all directions: a product and a sum are one, and the first of equals is free."""
        units = [a for a, p in terms.items() if self._unit(p)]
        return float(sum(self.wide[a] for a in terms) - (max(self.wide[a] for a in units) if units else 0))

    def _gain(self, node: Node) -> float:
        """Number of operations saved by eliminating a node."""
        own = self.into[node]
        gain = self._cost(own)
        for user in self.uses.get(node, ()):
            before = self.into[user]
            outer = before[node]
            after = {a: p for a, p in before.items() if a is not node}
            for argument, partial in own.items():
                known = after.get(argument)
                one = self._unit(partial) and self._unit(outer)
                gain -= (0.0 if self._unit(partial) or self._unit(outer) else 1.0) + (known is not None and one)
                after[argument] = partial if one and known is None else argument  # a number that is no unit
            gain += self._cost(before) - self._cost(after)
        return gain

    def _remove(self, node: Node) -> None:
        own, users = self.into[node], self.uses.get(node, set())
        self._forget(node)
        for user in users:
            terms = self.into[user]
            outer = terms.pop(node)
            for argument, partial in own.items():
                both = product(self.graph, partial, outer)
                known = terms.get(argument)
                terms[argument] = both if known is None else total(self.graph, known, both)
                self.uses[argument].add(user)
        self.uses.pop(node, None)


# ---- replaying blocks


Key = Node | tuple[Loop, int]  # what a loop leaves behind is known by loop and place


class Scope:
    """Nodes, loops and buffers of the new graph for those of the old one, within a block and those around it."""

    def __init__(self, around: Scope | None = None) -> None:
        self.around = around
        self.nodes: dict[Key, Node] = {}
        self.loops: dict[Loop, Loop] = {}
        self.turned: set[Loop] = set()  # those whose new loop goes backwards
        self.buffers: dict[Buffer, Buffer] = {}

    def find(self, table: str, key: Any) -> Any:
        """Replacement of an object; None if there is none."""
        scope: Scope | None = self
        while scope is not None:
            replacement = getattr(scope, table).get(key)
            if replacement is not None:
                return replacement
            scope = scope.around
        return None


class Replay:
    """Writes blocks of a graph again.

    Args:
        old: the graph.
        plan: order of its entries.
        new: where it goes.
        outer: all that stands for what is outside of all loops, buffers of arguments and results among it.
    """

    def __init__(self, old: Graph, plan: Schedule, new: Graph, outer: Scope) -> None:
        self.old, self.plan, self.new, self.outer = old, plan, new, outer

    def node(self, scope: Scope, node: Node) -> Node:
        """Replacement of a node."""
        if node.op == "const":
            return self.new.const(node.attr, node.kind)
        if node.op == "end":
            replacement = scope.find("nodes", node.attr)
        elif node.op == "done":
            loop = scope.find("loops", node.attr)
            return self.new.done(loop)
        else:
            replacement = scope.find("nodes", node)
        assert isinstance(replacement, Node), node
        return replacement

    def buffer(self, scope: Scope, buffer: Buffer) -> Buffer:
        """Replacement of a buffer; scratch memory is allocated at the first request."""
        replacement: Buffer | None = scope.find("buffers", buffer)
        if replacement is None:
            replacement = self.new.buffer(buffer.role, buffer.kind, buffer.shape, buffer.name, buffer.data)
            home = scope if buffer.within is not None and buffer.within[2] is not None else self.outer
            if buffer.within is not None:
                inside, offset, loop, by = buffer.within
                replacement.within = self.moved(scope, self.buffer(scope, inside), offset, loop, by)
                while loop is not None and home.around is not None and loop not in home.loops:
                    home = home.around
            home.buffers[buffer] = replacement
        return replacement

    def moved(self, scope: Scope, inside: Buffer, offset: int, loop: Loop | None, by: int) -> Any:
        """The place of a buffer in another one, as seen by the loops of a scope."""
        if loop is None:
            return inside, offset, None, 0
        made = scope.find("loops", loop)
        if self.turns(scope, loop):
            assert isinstance(loop.trips, int)
            return inside, offset + by * (loop.trips - 1), made, -by
        return inside, offset, made, by

    @staticmethod
    def turns(scope: Scope, loop: Loop) -> bool:
        """Whether the loop that replaces a loop runs backwards."""
        outer: Scope | None = scope
        while outer is not None and loop not in outer.loops:
            outer = outer.around
        return outer is not None and loop in outer.turned

    def again(self, scope: Scope, node: Node) -> Node:
        """Write one node."""
        args = tuple(self.node(scope, a) for a in node.args)
        attr = node.attr
        if node.op == "load":
            attr = (self.buffer(scope, attr[0]), *attr[1:])
        if node.op == "table":
            buffer = scope.buffers[attr] = self.new.buffer("scratch", attr.kind, attr.shape)
            made = self.new.intern(("table", buffer), "table", args, buffer, "token")
        else:
            made = self.new.make(node.op, args, attr, node.kind)
        scope.nodes[node] = made
        return made

    def opened(self, scope: Scope, loop: Loop) -> tuple[Loop, Scope]:
        """Begin a loop again: the new one, and the scope inside it, without what it carries."""
        trips = loop.trips if isinstance(loop.trips, int) else self.node(scope, loop.trips)
        made, inner = self.new.open_loop(trips), Scope(scope)
        if loop.pinned is not None:
            made.pinned = scope.find("loops", loop.pinned)
        made.after = [self.node(scope, n) for n in loop.after]
        inner.loops[loop] = made
        inner.nodes[loop.index] = made.index
        return made, inner

    def store(
        self, scope: Scope, store: Store, buffer: Buffer, value: Node, offset: int = 0, adds: bool = False
    ) -> None:
        """Write to the place of a store, in some buffer."""
        index = 0 if store.index is None else self.node(scope, store.index)
        self.new.store(buffer, index, value, scale=store.scale, offset=store.offset + offset, adds=adds)


class DerivedGraph:
    """A program's graph, looked over, and the new graph in which its derivatives are put.

    Args:
        program: the program to differentiate.
        places: places of the arguments by which.
    """

    def __init__(self, program: Program, places: Sequence[int]) -> None:
        self.given, self.places = program, list(places)
        self.old = rewrite(program.graph, lambda g, node, args: None, exact=False)
        self.plan = make_schedule(self.old)
        self.new = Graph(exact=False)
        self.arguments = [b for b in self.old.buffers if b.role == "argument"]
        self.active = ActiveNodes(self.old, self.plan, {self.arguments[p] for p in places})
        self.outer = Scope()
        self.replay = Replay(self.old, self.plan, self.new, self.outer)


# ---- forward mode


def tangents(program: Program, places: Sequence[int], count: int) -> Program:
    """A program with its derivatives.

    Args:
        program: the program to differentiate.
        places: places of the arguments by which, real numbers.
        count: count of directions.

    Returns:
        One whose arguments are those of the program and, for each of the places, its change in each direction, (count,
        ...); and whose results are those of the program, and their changes, (count, ...). A result that does not change
        carries nothing.

    Raises:
        ArgumentError: an argument that is no real number, or no direction.
    """
    check(program, places)
    if count < 1:
        raise ArgumentError("count", f"count must be at least one direction, got {count}")
    return _Forward(program, places, count).program()


def check(program: Program, places: Sequence[int]) -> None:
    """Refuse arguments that have no derivative."""
    for place in places:
        if not 0 <= place < len(program.arguments):
            raise ArgumentError("places", f"Unknown place {place}. The program has {len(program.arguments)} arguments")
        leaf = program.arguments[place]
        if leaf.kind != "real":
            raise ArgumentError(
                leaf.name, f"{leaf.name} holds {leaf.kind or 'nothing'}; only real numbers have derivatives"
            )


class _Forward(DerivedGraph):
    def __init__(self, program: Program, places: Sequence[int], count: int) -> None:
        super().__init__(program, places)
        self.count = count
        self.twins: dict[tuple[Buffer, int], tuple[Buffer, int]] = {}
        self.changes: dict[tuple[Node, int], Node] = {}  # by old node and direction; ends by (loop, place)
        self.ends: dict[tuple[Loop, int], list[Node]] = {}
        self.inside = {home for x, home in self.plan.home.items() if isinstance(x, Loop)}

    def program(self) -> Program:
        original, leaves = self.given, list(self.given.arguments)
        for buffer in self.arguments:
            self.outer.buffers[buffer] = self.new.buffer("argument", buffer.kind, buffer.shape, buffer.name)
        for place in self.places:
            leaf = leaves[place]
            leaves.append(Leaf(f"change of {leaf.name}", "real", (self.count, *leaf.shape)))
            self._twinned(self.arguments[place], self.new.buffer("argument", "real", leaves[-1].shape, leaves[-1].name))
        results = [b for b in self.old.buffers if b.role == "result"]
        for buffer in results:
            self.outer.buffers[buffer] = self.new.buffer("result", buffer.kind, buffer.shape, buffer.name)
        wanted, rest = list(original.results), iter(results)
        for leaf in original.results:
            changed = Leaf(f"change of {leaf.name}", None, (self.count, *leaf.shape))
            if leaf.kind is not None:
                buffer = next(rest)
                if leaf.kind == "real" and buffer in self.active.buffers:
                    changed = changed._replace(kind="real")
                    self._twinned(buffer, self.new.buffer("result", "real", changed.shape, changed.name))
            wanted.append(changed)
        self.block(self.plan.root, self.outer, False)
        whole = rewrite(self.new, lambda g, node, args: None, exact=False)
        return Program(whole, leaves, wanted, original.title)

    def _twinned(self, buffer: Buffer, twin: Buffer) -> None:
        for k in range(self.count):
            self.twins[buffer, k] = twin, k * buffer.size

    def twin(self, scope: Scope, buffer: Buffer, k: int) -> tuple[Buffer, int]:
        """Memory of the tangents of a buffer in one direction: a buffer and an offset."""
        twin = self.twins.get((buffer, k))
        if twin is None:
            made = self.new.buffer("scratch", "real", buffer.shape, buffer.name)
            if buffer.within is not None:
                inside, offset, loop, by = buffer.within
                root, more = self.twin(scope, inside, k)
                made.within = self.replay.moved(scope, root, offset + more, loop, by)
            twin = self.twins[buffer, k] = made, 0
        return twin

    def change(self, node: Node, k: int) -> Node:
        """Tangent of a node in one direction."""
        if node.op == "end":
            tangent = self.ends.get(node.attr)
            return self.new.const(0.0) if tangent is None else tangent[k]
        return self.changes.get((node, k)) or self.new.const(0.0)

    def block(self, entries: list[Entry], scope: Scope, leaf: bool) -> None:
        """Write a block with its changes; in a leaf, a block without loops, they are shortened first."""
        later: list[Store] = []
        edges, last = LinearGraph(self.new), self._last_needed(entries) if leaf else {}
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
                    edges = LinearGraph(self.new)
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

    def _write_changes(self, edges: LinearGraph, kept: set[Node]) -> None:
        """Shorten the sums of a part of a leaf, and write the changes of the nodes that are needed after it."""
        edges.shorten(kept, lambda n: {k for k in range(self.count) if not is_zero(self.change(n, k))})
        for node, terms in edges.rest(kept):
            self._sum(node, terms)

    _nexts: set[Node] = set()

    def _sum(self, node: Node, terms: list[tuple[Node, Node]]) -> None:
        for k in range(self.count):
            total_change = None
            for argument, partial in sorted(terms, key=lambda t: t[1].op != "const"):
                change = self.change(argument, k)
                if not is_zero(change):
                    part = product(self.new, partial, change)
                    total_change = part if total_change is None else total(self.new, total_change, part)
            if total_change is not None:
                self.changes[node, k] = total_change

    def _memory(self, node: Node, scope: Scope) -> None:
        """Tangent of a load from memory or of a table."""
        for k in range(self.count):
            if node.op == "table":
                twin, _ = self.twin(scope, node.attr, k)
                values = tuple(self.change(a, k) for a in node.args)
                self.changes[node, k] = self.new.intern(("table", twin), "table", values, twin, "token")
                continue
            buffer, scale, offset = node.attr
            twin, more = self.twin(scope, buffer, k)
            args = tuple(self.changes.get((a, k)) or self.replay.node(scope, a) for a in node.args)
            self.changes[node, k] = self.new.make("load", args, (twin, scale, offset + more), "real")

    def store(self, store: Store, scope: Scope) -> None:
        """A store, and those of its changes."""
        if store.adds:
            raise ArgumentError("program", "a program that is a derivative itself has no derivative: it adds to memory")
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
