"""A graph written again, block by block, into another: what derivatives are put beside, or are put in reverse order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .graph import Buffer, Graph, Loop, Node, Store
from .partials import Active
from .program import Program
from .rewrite import rewritten
from .schedule import Schedule, schedule

Key = Node | tuple[Loop, int]  # what a loop leaves behind is known by loop and place


class Scope:
    """Where the nodes, loops and buffers of the old graph stand in the new one, within a block and those around it."""

    def __init__(self, around: Scope | None = None) -> None:
        self.around = around
        self.nodes: dict[Key, Node] = {}
        self.loops: dict[Loop, Loop] = {}
        self.turned: set[Loop] = set()  # those whose new loop goes backwards
        self.buffers: dict[Buffer, Buffer] = {}

    def find(self, table: str, key: Any) -> Any:
        """What stands for something; None where nothing does."""
        scope: Scope | None = self
        while scope is not None:
            found = getattr(scope, table).get(key)
            if found is not None:
                return found
            scope = scope.around
        return None


class Replay:
    """Writes blocks of a graph again.

    Args:
        old: the graph.
        plan: its order.
        new: where it goes.
        outer: all that stands for what is outside of all loops, buffers of arguments and results among it.
    """

    def __init__(self, old: Graph, plan: Schedule, new: Graph, outer: Scope) -> None:
        self.old, self.plan, self.new, self.outer = old, plan, new, outer

    def node(self, scope: Scope, node: Node) -> Node:
        """What stands for a node."""
        if node.op == "const":
            return self.new.const(node.attr, node.kind)
        if node.op == "end":
            found = scope.find("nodes", node.attr)
        elif node.op == "done":
            loop = scope.find("loops", node.attr)
            return self.new.done(loop)
        else:
            found = scope.find("nodes", node)
        assert found is not None, node
        return found

    def buffer(self, scope: Scope, buffer: Buffer) -> Buffer:
        """What stands for a buffer; scratch memory is made when it is first asked for."""
        found = scope.find("buffers", buffer)
        if found is None:
            found = self.new.buffer(buffer.role, buffer.kind, buffer.shape, buffer.name, buffer.data)
            home = scope if buffer.within is not None and buffer.within[2] is not None else self.outer
            if buffer.within is not None:
                inside, offset, loop, by = buffer.within
                found.within = self.moved(scope, self.buffer(scope, inside), offset, loop, by)
                while loop is not None and home.around is not None and loop not in home.loops:
                    home = home.around
            home.buffers[buffer] = found
        return found

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
        """Whether the loop that stands for one goes backwards."""
        found: Scope | None = scope
        while found is not None and loop not in found.loops:
            found = found.around
        return found is not None and loop in found.turned

    def again(self, scope: Scope, node: Node) -> Node:
        """Write one node."""
        args = tuple(self.node(scope, a) for a in node.args)
        attr = node.attr
        if node.op == "load":
            attr = (self.buffer(scope, attr[0]), *attr[1:])
        if node.op == "table":
            buffer = scope.buffers[attr] = self.new.buffer("scratch", attr.kind, attr.shape)
            made = self.new.once(("table", buffer), "table", args, buffer, "token")
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


class Derived:
    """A program's graph, looked over, and the new graph in which its derivatives are put.

    Args:
        program: what is differentiated.
        places: of the arguments by which.
    """

    def __init__(self, program: Program, places: Sequence[int]) -> None:
        self.given, self.places = program, list(places)
        self.old = rewritten(program.graph, lambda g, node, args: None, exact=False)
        self.plan = schedule(self.old)
        self.new = Graph(exact=False)
        self.arguments = [b for b in self.old.buffers if b.role == "argument"]
        self.active = Active(self.old, self.plan, {self.arguments[p] for p in places})
        self.outer = Scope()
        self.replay = Replay(self.old, self.plan, self.new, self.outer)
