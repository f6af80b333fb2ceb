"""Memory of an adjoint: what is kept of the way forwards, and what is added up on the way back."""

from __future__ import annotations

import dataclasses

from .graph import Buffer, Graph, Node, Store
from .replay import Replay, Scope
from .way_back import Shape

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
    shape: Shape
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
            found = self.twins.get((at, buffer))
            if found is not None:
                return found
            at = at.around
        assert buffer.within is not None, buffer.name
        inside, offset, loop, by = buffer.within
        around = self.twin(scope, inside)
        made = self.new.buffer("scratch", "real", buffer.shape)
        made.within = self.replay.moved(scope, around.buffer, offset, loop, by)
        home = scope
        while loop is not None and home.around is not None and loop not in home.loops:
            home = home.around
        found = self.twins[home if loop is not None else self.outer, buffer] = Twin(made, home, around.root)
        return found


def side_by_side(graph: Graph) -> None:
    """Put what is kept of one trip side by side in memory, not what is kept of one number in all trips."""
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
