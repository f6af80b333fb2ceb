"""Analysis of graphs: liveness, the loop of each node, the order of writing, and which values differ per lane.

`find_live` works backwards from the results through loops and memory; `find_homes` puts every node as far out of the
loops as its arguments allow; `make_schedule` orders nodes, loops and stores as a tree of blocks that an emitter walks
once, `order_for_registers` so that fewer values are held at once; `find_divergence` says which values differ from lane
to lane, `find_wide_loops` which loops of a run without lanes do several trips at once. `rewrite` makes the
live part of a graph again by a rule.
"""

from __future__ import annotations

import dataclasses
import heapq
import itertools
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from ._graph import DOUBLE, Buffer, Graph, Loop, Node, Store
from .errors import LoweringError

# ---- liveness and rewriting


RewriteRule = Callable[
    [Graph, Node, tuple[Node, ...]], "Node | None"
]  # (new graph, old node, new arguments) -> new node


class Liveness(NamedTuple):
    """Nodes, loops and stores on which the results depend.

    Attributes:
        nodes: in the order of making.
        loops: likewise.
        carried: by loop, the places that are needed.
        buffers: that are read, or are results.
    """

    nodes: list[Node]
    loops: list[Loop]
    carried: dict[Loop, list[int]]
    buffers: set[Buffer]


def enclosing_buffers(buffer: Buffer) -> Iterable[Buffer]:
    """Iterate over a buffer and all that contain it."""
    enclosing: Buffer | None = buffer
    while enclosing is not None:
        yield enclosing
        enclosing = enclosing.within[0] if enclosing.within else None


def find_live(graph: Graph) -> Liveness:
    """Find everything on which the results depend, through loops and memory."""
    return _Search(graph).found()


class _Search:
    """Works backwards from the results; a store is needed if its buffer is."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.nodes: set[Node] = set()
        self.loops: set[Loop] = set()
        self.carried: dict[Loop, set[int]] = {}
        self.buffers: set[Buffer] = set()
        self.work: list[Node] = []
        self.writers: dict[Buffer, list[tuple[Loop | None, Store]]] = {}
        for loop, stores in [(None, graph.stores), *((x, x.stores) for x in graph.loops)]:  # type: Any
            for store in stores:
                self.writers.setdefault(store.buffer, []).append((loop, store))
        self.inside: dict[Buffer, list[Buffer]] = {}
        for buffer in graph.buffers:
            if buffer.within:
                self.inside.setdefault(buffer.within[0], []).append(buffer)

    def found(self) -> Liveness:
        for buffer in self.graph.buffers:
            if buffer.role == "result":
                self.buffer(buffer)
        while self.work:
            self.node(self.work.pop())
        order = sorted(self.nodes, key=lambda n: n.serial)
        loops = [x for x in self.graph.loops if x in self.loops]
        return Liveness(order, loops, {x: sorted(self.carried.get(x, ())) for x in loops}, self.buffers)

    def want(self, node: Node | None) -> None:
        if node is not None and node not in self.nodes:
            self.nodes.add(node)
            self.work.append(node)

    def buffer(self, buffer: Buffer) -> None:
        if buffer in self.buffers:
            return
        self.buffers.add(buffer)
        for loop, store in self.writers.get(buffer, ()):
            self.want(store.index)
            self.want(store.value)
            if loop is not None:
                self.loop(loop)
        for other in (*self.inside.get(buffer, ()), *((buffer.within[0],) if buffer.within else ())):
            self.buffer(other)
        if buffer.within and buffer.within[2] is not None:
            self.loop(buffer.within[2])

    def loop(self, loop: Loop) -> None:
        if loop in self.loops:
            return
        self.loops.add(loop)
        self.want(loop.index)
        if loop.pinned is not None:
            self.loop(loop.pinned)
        for node in loop.after:
            self.want(node)
        if isinstance(loop.trips, Node):
            self.want(loop.trips)

    def node(self, node: Node) -> None:
        for arg in node.args:
            self.want(arg)
        if node.op == "load":
            self.buffer(node.attr[0])
        elif node.op == "table":
            self.buffers.add(node.attr)
        elif node.op == "index" or node.op == "done":
            self.loop(node.attr)
        elif node.op in ("phi", "end"):
            loop, place = node.attr
            self.loop(loop)
            if place not in self.carried.setdefault(loop, set()):
                self.carried[loop].add(place)
                self.want(loop.phis[place])
                self.want(loop.inits[place])
                self.want(loop.nexts[place])


def find_homes(graph: Graph, live: Liveness) -> dict[Any, Loop | None]:
    """Loop of each node, as far out as its dependencies allow; the same for each loop itself."""
    home: dict[Any, Loop | None] = {}
    outer: dict[Loop, set[Loop]] = {x: set() for x in live.loops}  # what is used inside and stands outside

    def deepest(loops: Iterable[Loop | None]) -> Loop | None:
        return max((x for x in loops if x is not None), key=lambda x: x.depth, default=None)

    def uses(loop: Loop, node: Node) -> None:
        at = home[node]
        if at is not None and at is not loop:
            outer[loop].add(at)

    def finish(loop: Loop) -> None:
        if loop in home:
            return
        carried = [nodes[k] for nodes in (loop.inits, loop.nexts) for k in live.carried[loop]]
        stored = [n for s in loop.stores if s.buffer in live.buffers for n in (s.index, s.value) if n is not None]
        trips = [loop.trips] if isinstance(loop.trips, Node) else []
        for node in (*carried, *stored, *loop.after, *trips):
            uses(loop, node)
        for store in loop.stores:
            for buffer in enclosing_buffers(store.buffer):
                if store.buffer in live.buffers and buffer.within and buffer.within[2] not in (None, loop):
                    outer[loop].add(buffer.within[2])
        if loop.pinned is not None:
            outer[loop].add(loop.pinned)
        home[loop] = deepest(outer[loop])
        at = home[loop]
        if at is not None:
            outer[at] |= outer[loop] - {at}

    position = {x: k for k, x in enumerate(live.loops)}
    for node in live.nodes:
        if node.op in ("index", "phi"):
            home[node] = node.attr if node.op == "index" else node.attr[0]
            continue
        if node.op in ("end", "done"):
            loop = loop_of_token(node)
            if loop not in home:
                # loops that were opened inside follow in the order of opening, and are finished first
                k = position[loop] + 1
                while k < len(live.loops) and live.loops[k].depth > loop.depth:
                    k += 1
                for inner in reversed(live.loops[position[loop] + 1 : k]):
                    finish(inner)
                finish(loop)
            home[node] = home[loop]
            continue
        at = home[node] = deepest(home[a] for a in node.args)
        if at is not None:
            for arg in node.args:
                uses(at, arg)
    for loop in reversed(live.loops):
        finish(loop)
    return home


def loop_of_token(node: Node) -> Loop:
    """The loop that a node waits for."""
    loop: Loop = node.attr if node.op == "done" else node.attr[0]
    return loop


def largest_need(live: Liveness, worth: Callable[[Node, Node], float]) -> Callable[[Node], float]:
    """Function of a node: the largest `worth(needed, node)` of what it needs.

    That of a loop is computed once for all its ends.
    """
    largest: dict[Loop, float] = {}

    def over(node: Node) -> float:
        if node.op not in ("end", "done"):
            return max((worth(a, node) for a in node.args), default=0)
        loop = loop_of_token(node)
        if loop not in largest:
            largest[loop] = max((worth(a, node) for a in sinks(loop, live)), default=0)
        return largest[loop]

    return over


def sinks(loop: Loop, live: Liveness) -> list[Node]:
    """Entries that a loop must complete before it ends, including inner loops."""
    entries, inside = [], False
    for x in live.loops:
        inside = x is loop or (inside and x.depth > loop.depth)
        if inside:
            entries += [n for k in live.carried[x] for n in (x.inits[k], x.nexts[k])]
            entries += [n for s in x.stores if s.buffer in live.buffers for n in (s.index, s.value) if n is not None]
            entries += [*x.after, *([x.trips] if isinstance(x.trips, Node) else [])]
    return entries


def rewrite(
    graph: Graph,
    rule: RewriteRule,
    *,
    exact: bool,
    known: dict[Node, Node] | None = None,
    order: list[Node] | None = None,
) -> Graph:
    """Rebuild the live part of a graph, node by node; the rule returns None for an unchanged node.

    Args:
        graph: stays as it is.
        rule: what becomes of a node.
        exact: whether the new graph is exact.
        known: filled with the new node of each old one.
        order: order of the nodes; as they were made by default.
    """
    live = find_live(graph)
    for loop, places in live.carried.items():
        places[:] = [k for k in places if loop.nexts[k] is not loop.phis[k]]
    new = Graph(exact=exact)
    known = {} if known is None else known
    buffers = {
        b: new.buffer(b.role, b.kind, b.shape, b.name, b.data)
        for b in graph.buffers
        if b in live.buffers or b.role == "argument"
    }
    loops: dict[Loop, Loop] = {}
    for loop in live.loops:
        made = Loop(len(new.loops), loop.depth, loop.trips if isinstance(loop.trips, int) else 0)
        new.loops.append(made)
        loops[loop] = made
    for node in order or live.nodes:
        known[node] = _again(new, node, known, loops, buffers, rule, live)
    for loop in live.loops:
        made = loops[loop]
        if isinstance(loop.trips, Node):
            made.trips = known[loop.trips]
        made.index = new.intern(("index", made), "index", (), made, "int")
        made.inits = [known[loop.inits[k]] for k in live.carried[loop]]
        made.nexts = [known[loop.nexts[k]] for k in live.carried[loop]]
        made.phis = [known[loop.phis[k]] for k in live.carried[loop]]
        made.pinned = None if loop.pinned is None else loops[loop.pinned]
        made.after = [known[n] for n in loop.after]
        made.stores = _stores(loop.stores, known, buffers)
    new.stores = _stores(graph.stores, known, buffers)
    for old, buffer in buffers.items():
        if old.within:
            inside, offset, at, by = old.within
            buffer.within = (buffers[inside], offset, None if at is None else loops[at], by)
    return new


def _stores(stores: list[Store], known: dict[Node, Node], buffers: dict[Buffer, Buffer]) -> list[Store]:
    return [
        dataclasses.replace(
            s, buffer=buffers[s.buffer], index=None if s.index is None else known[s.index], value=known[s.value]
        )
        for s in stores
        if s.buffer in buffers and s.value in known
    ]


def _again(
    new: Graph,
    node: Node,
    known: dict[Node, Node],
    loops: dict[Loop, Loop],
    buffers: dict[Buffer, Buffer],
    rule: RewriteRule,
    live: Liveness,
) -> Node:
    if node.op == "const":
        return new.const(node.attr, node.kind)
    if node.op == "index" or node.op == "done":
        loop = loops[node.attr]
        if isinstance(node.attr.trips, Node):
            loop.trips = known[node.attr.trips] if node.attr.trips in known else loop.trips
        return new.intern((node.op, loop), node.op, (), loop, node.kind)
    if node.op in ("phi", "end"):
        old, k = node.attr
        if old.nexts[k] is old.phis[k]:
            return known[old.inits[k]]
        loop, place = loops[old], live.carried[old].index(k)
        return new.intern((node.op, loop, place), node.op, (), (loop, place), node.kind)
    args = tuple(known[a] for a in node.args)
    attr = node.attr
    if node.op == "load":
        attr = (buffers[attr[0]], *attr[1:])
    elif node.op == "table":
        attr = buffers[attr]
    replacement = rule(new, node, args)
    if replacement is not None:
        return replacement
    if node.op == "table":
        return new.intern(("table", attr), "table", args, attr, "token")
    return new.make(node.op, args, attr, node.kind)


# ---- order


Entry = Node | Loop | Store


class Schedule(NamedTuple):
    """Order and nesting of all entries.

    Attributes:
        live: what the results depend on.
        home: the enclosing loop of nodes and loops, or None.
        root: what is done in order outside of all loops.
        bodies: what is done in every trip of a loop. A node stands before what uses it; constants, indices, carried
            values, ends and tokens stand nowhere.
    """

    live: Liveness
    home: dict[Node | Loop, Loop | None]
    root: list[Entry]
    bodies: dict[Loop, list[Entry]]


HELD = frozenset({"const", "index", "phi", "end", "done"})  # values that take no instruction of their own


def make_schedule(graph: Graph) -> Schedule:
    """Order a graph: every value as late as something needs it, so that few are held at once."""
    live = find_live(graph)
    home = find_homes(graph, live)
    made = Schedule(live, home, [], {x: [] for x in live.loops})
    _Order(graph, made).write()
    return made


class _Order:
    def __init__(self, graph: Graph, made: Schedule) -> None:
        self.graph, self.made = graph, made
        self.seen: set[Entry] = set()
        self.inner: dict[Loop | None, list[Loop]] = {}
        for loop in made.live.loops:
            self.inner.setdefault(made.home[loop], []).append(loop)
        self.acts: dict[Loop, bool] = {}
        for loop in reversed(made.live.loops):  # inner ones follow outer ones
            self.acts[loop] = bool(self.stores(loop.stores)) or any(self.acts[x] for x in self.inner.get(loop, ()))

    def stores(self, stores: Iterable[Store]) -> list[Store]:
        return [s for s in stores if s.buffer in self.made.live.buffers]

    def sinks(self, loop: Loop | None) -> list[Entry]:
        """Entries for which a trip is run."""
        acting = [x for x in self.inner.get(loop, ()) if self.acts[x]]
        if loop is None:
            return [*acting, *self.stores(self.graph.stores)]
        return [*acting, *self.stores(loop.stores), *(loop.nexts[k] for k in self.made.live.carried[loop])]

    def needs(self, entry: Entry) -> list[Entry]:
        if isinstance(entry, Store):
            return [n for n in (entry.index, entry.value) if n is not None]
        if isinstance(entry, Loop):
            trips = [entry.trips] if isinstance(entry.trips, Node) else []
            return [*trips, *entry.after, *(entry.inits[k] for k in self.made.live.carried[entry]), *self.sinks(entry)]
        if entry.op in ("end", "done"):
            return [entry.attr if entry.op == "done" else entry.attr[0]]
        return list(entry.args)

    def put(self, entry: Entry, within: Loop | None) -> None:
        if isinstance(entry, Store):
            home = within
        elif isinstance(entry, Node) and entry.op in HELD:
            return
        elif isinstance(entry, Loop) and not self.made.bodies[entry] and not self.made.live.carried[entry]:
            return  # it does nothing
        else:
            home = self.made.home[entry]
        (self.made.root if home is None else self.made.bodies[home]).append(entry)

    def write(self) -> None:
        for sink in self.sinks(None):
            self.visit(sink)

    def visit(self, first: Entry) -> None:
        """Schedule an entry after everything it needs; with a stack instead of recursion, since graphs are deep."""
        stack: list[tuple[Entry, Iterator[Entry], Loop | None]] = []

        def push(entry: Entry, within: Loop | None) -> None:
            if entry not in self.seen:
                self.seen.add(entry)
                stack.append((entry, iter(self.needs(entry)), within))

        push(first, None)
        while stack:
            entry, needs, within = stack[-1]
            following = next(needs, None)
            if following is None:
                stack.pop()
                self.put(entry, within)
            else:
                push(following, entry if isinstance(entry, Loop) else within)


# ---- order for registers


def order_for_registers(plan: Schedule, held: Collection[Node]) -> Schedule:
    """Order the nodes in loops again, each time one of those that free the most values, so that fewer are held at once.

    Args:
        plan: the order so far, which decides among equals.
        held: values that take a register each.
    """
    bodies = {}
    for loop, body in plan.bodies.items():
        bodies[loop] = list[Entry]()
        for moves, run in itertools.groupby(body, lambda entry: isinstance(entry, Node) and entry.op != "table"):
            entries = list(run)
            bodies[loop] += _fewest_held(entries, _uses_outside(plan, loop, entries), held) if moves else entries
    return plan._replace(bodies=bodies)


def most_held(plan: Schedule, held: Collection[Node]) -> int:
    """How many values are held at once in a trip of a loop, at most; what only other loops need is not counted."""
    most = 0
    for loop, body in plan.bodies.items():
        nodes = [entry for entry in body if isinstance(entry, Node)]
        left: Counter[Node] = Counter(a for node in nodes for a in set(node.args) if a in held)
        outside = {n for n in left if plan.home.get(n) is not loop}
        lasting = outside | {loop.nexts[k] for k in plan.live.carried[loop]}
        now = len(outside | {n for n in (loop.phis[k] for k in plan.live.carried[loop]) if n in held})
        for node in nodes:
            now += node in held
            most = max(most, now)
            for a in set(node.args):
                left[a] -= 1
                now -= left[a] == 0 and a in held and a not in lasting
    return most


def _uses_outside(plan: Schedule, loop: Loop, entries: Sequence[Entry]) -> set[Node]:
    """Values that something else than these entries of a loop needs, or the next trip."""
    nodes = set(entries)
    kept = {loop.nexts[k] for k in plan.live.carried[loop]} | {
        n for n in plan.live.nodes if plan.home.get(n) is not loop
    }
    for entry in plan.bodies[loop]:
        if isinstance(entry, Node):
            kept |= set(entry.args) if entry not in nodes else set()
        elif isinstance(entry, Store):
            kept |= {entry.value} | ({entry.index} if entry.index is not None else set())
        else:
            kept |= {
                *entry.inits,
                *(n for inside in plan.bodies[entry] if isinstance(inside, Node) for n in inside.args),
            }
    return kept


def _fewest_held(entries: list[Any], kept: set[Node], held: Collection[Node]) -> list[Any]:
    place = {node: k for k, node in enumerate(entries)}
    users: dict[Node, set[Node]] = {}
    for node in entries:
        for a in node.args:
            users.setdefault(a, set()).add(node)
    missing = {node: sum(a in place for a in set(node.args)) for node in entries}
    frees = {node: -int(node in held) for node in entries}
    single = [next(iter(u)) for a, u in users.items() if len(u) == 1 and a in held and a not in kept]
    for node in single:
        frees[node] += 1
    ready = [(-frees[node], place[node], node) for node in entries if not missing[node]]
    heapq.heapify(ready)
    order: list[Any] = []
    done = set[Node]()
    while ready:
        score, _, node = heapq.heappop(ready)
        if node in done or score != -frees[node]:
            continue  # it stands in the heap once more, with what it frees now
        done.add(node)
        order.append(node)
        for a in set(node.args):
            users[a].discard(node)
            if len(users[a]) == 1 and a in held and a not in kept:
                (last,) = users[a]
                frees[last] += 1
                if not missing[last]:
                    heapq.heappush(ready, (-frees[last], place[last], last))
        for user in users.get(node, set()):
            missing[user] -= 1
            if not missing[user]:
                heapq.heappush(ready, (-frees[user], place[user], user))
    return order


# ---- divergence


class Divergence(NamedTuple):
    """The nodes and the buffers that have a value per lane."""

    nodes: set[Node]
    buffers: set[Buffer]


def find_divergence(graph: Graph, plan: Schedule, arguments: set[Buffer], *, lanes: bool) -> Divergence:
    """Follow what differs through nodes, loops and memory.

    Args:
        graph: the program's.
        plan: order of its entries.
        arguments: buffers that are given per lane.
        lanes: whether results are wanted per lane; without lanes nothing differs.
    """
    nodes: set[Node] = set()
    buffers = set(arguments) | ({b for b in graph.buffers if b.role == "result"} if lanes else set())
    if not lanes:
        return Divergence(nodes, buffers)
    stores = [s for x in plan.live.loops for s in x.stores] + graph.stores
    while True:
        before = len(nodes), len(buffers)
        for buffer in plan.live.buffers:
            if any(b in buffers for b in enclosing_buffers(buffer)):
                buffers.update(enclosing_buffers(buffer))
        for node in plan.live.nodes:
            if node in nodes:
                continue
            if node.op in ("phi", "end"):
                loop, k = node.attr
                parts: tuple[Node, ...] = (loop.inits[k], loop.nexts[k])
            else:
                parts = node.args
            if any(n in nodes for n in parts) or (node.op == "load" and node.attr[0] in buffers):
                nodes.add(node)
                if node.op == "table":
                    buffers.add(node.attr)
        buffers.update(s.buffer for s in stores if s.value in nodes or s.index in nodes)
        if (len(nodes), len(buffers)) == before:
            break
    for loop in plan.live.loops:
        if loop.trips in nodes:
            raise LoweringError("a loop", "its number of trips differs from lane to lane")
    return Divergence(nodes, buffers)


# ---- loops of a single run


FEWEST = 32  # trips from which on a loop does several at once
IN_ORDER = frozenset({"add", "sub", "mul", "fma", "neg", "max", "min"})  # what may be done with a carried value
MOST_IN_ORDER = 0.5  # share of the operations of a trip that may be done one trip after the other


class WideLoop(NamedTuple):
    """A loop that does several trips at once.

    Attributes:
        vectors: its nodes that have a value per trip.
        steps: by how much its whole numbers grow from trip to trip, of those that grow evenly; they stay single numbers.
        serial: its nodes that depend on what it carries, in order: they are done trip by trip.
        width: trips at once: those that one vector holds, or less where these would leave some over. With two vectors at
            once, which pay for lanes, kernels took a few percent longer: here one trip does not wait for the other.
    """

    vectors: set[Node]
    steps: dict[Node, int]
    serial: list[Node]
    width: int


def find_wide_loops(plan: Schedule, vector: int) -> dict[Loop, WideLoop]:
    """Loops whose trips do not wait for each other, but for sums and the like that they carry.

    Such a loop has no other one inside, a known number of trips, and reads nothing that it writes. The results have the
    bits of a loop that does one trip after the other.

    Args:
        plan: order of a program's entries.
        vector: trips that one vector holds.
    """
    if any(s.adds for x in plan.live.loops for s in x.stores):
        return {}
    nested = {plan.home[x] for x in plan.live.loops}
    found = {}
    for loop in plan.live.loops:
        width = math.gcd(loop.trips, vector) if isinstance(loop.trips, int) and loop.trips >= FEWEST else 1
        if width > 1 and loop not in nested:
            wide = _wide_loop(loop, plan, width)
            if wide is not None:
                found[loop] = wide
    return found


def _wide_loop(loop: Loop, plan: Schedule, width: int) -> WideLoop | None:
    vectors: set[Node] = set()
    steps = {loop.index: 1}
    carried = {loop.phis[k] for k in plan.live.carried[loop]}
    serial: list[Node] = []
    depends = set(carried)
    body = plan.bodies[loop]
    stores = [entry for entry in body if isinstance(entry, Store)]
    written = {b for s in stores for b in enclosing_buffers(s.buffer)}
    for node in body:
        if isinstance(node, Store):
            continue
        if isinstance(node, Loop) or node.op == "table":
            return None
        if not depends.isdisjoint(node.args):
            if node.op not in IN_ORDER or node.kind != "real":
                return None
            depends.add(node)
            serial.append(node)
            continue
        if node.op == "load":
            around = list(enclosing_buffers(node.attr[0]))
            if any(b.within and b.within[2] is loop for b in around):
                return None
            if any(b in written and b.name != DOUBLE for b in around):
                return None
        step = None if node.kind != "int" or node.op == "load" else _step(node, vectors, steps)
        if step is not None:
            if step:
                steps[node] = step
        elif any(a in vectors or a in steps for a in node.args):
            vectors.add(node)
    for store in stores:
        if store.value in depends or any(b.within and b.within[2] is loop for b in enclosing_buffers(store.buffer)):
            return None
        if store.index is None or steps.get(store.index, 0) * store.scale == 0:
            return None
        if steps[store.index] * store.scale != 1 and store.value.kind != "real":
            return None
    if any(loop.nexts[k] not in depends for k in plan.live.carried[loop]):
        return None
    if len(serial) > MOST_IN_ORDER * len(body):
        return None
    return WideLoop(vectors, steps, serial, width)


def _step(node: Node, vectors: set[Node], steps: dict[Node, int]) -> int | None:
    """By how much a whole number grows from trip to trip; None if not evenly, or from values that do not."""
    if any(a in vectors for a in node.args):
        return None
    by = [steps.get(a, 0) for a in node.args]
    if not any(by):
        return 0
    if node.op == "add":
        return by[0] + by[1]
    if node.op == "sub":
        return by[0] - by[1]
    if node.op == "mul":
        constant = next((a for a in node.args if a.op == "const"), None)
        return None if constant is None else sum(by) * int(constant.attr)
    return None
