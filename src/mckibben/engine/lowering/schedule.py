"""The order in which an emitter writes a graph: a tree of blocks, walked once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from .graph import Graph, Loop, Node, Store
from .rewrite import Alive, alive, homes

Entry = Node | Loop | Store


class Schedule(NamedTuple):
    """Where everything stands.

    Attributes:
        live: what the results depend on.
        home: of nodes and loops, the loop they stand in, or None.
        root: what is done in order outside of all loops.
        bodies: what is done in every trip of a loop. A node stands before what uses it; constants, indices, carried
            values, ends and tokens stand nowhere.
    """

    live: Alive
    home: dict[Node | Loop, Loop | None]
    root: list[Entry]
    bodies: dict[Loop, list[Entry]]


HELD = frozenset({"const", "index", "phi", "end", "done"})  # values that take no instruction of their own


def schedule(graph: Graph) -> Schedule:
    """Order a graph: every value as late as something needs it, so that few are held at once."""
    live = alive(graph)
    home = homes(graph, live)
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
        """What a trip is for."""
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
        """Put an entry after all that it needs; a stack instead of recursion, for graphs are deep."""
        stack: list[tuple[Entry, Iterator[Entry], Loop | None]] = []

        def push(entry: Entry, within: Loop | None) -> None:
            if entry not in self.seen:
                self.seen.add(entry)
                stack.append((entry, iter(self.needs(entry)), within))

        push(first, None)
        while stack:
            entry, needs, within = stack[-1]
            found = next(needs, None)
            if found is None:
                stack.pop()
                self.put(entry, within)
            else:
                push(found, entry if isinstance(entry, Loop) else within)
