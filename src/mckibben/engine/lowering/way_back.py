"""What is known of loops and memory before the way back through a program is written."""

from __future__ import annotations

from collections import Counter

from ...errors import LoweringError
from .graph import Buffer, Loop, Node, Store
from .partials import Active
from .rewrite import roots
from .schedule import Entry, Schedule

DEAR = 2.0  # operations to make a number again from which on it is kept
SMALL = 64  # elements of an argument up to which its derivative is no sum in memory


class Shape:
    """What is known of loops and memory before the way back is written."""

    def __init__(self, plan: Schedule, active: Active) -> None:
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
        """How many trips a loop has."""
        if isinstance(loop.trips, int):
            return loop.trips
        raise LoweringError("a loop", "its derivative needs a number of trips that is known before it runs")

    def divides(self, node: Entry) -> bool:
        """Whether the reciprocal of a division in a loop is kept."""
        if not isinstance(node, Node) or node.op != "div" or node not in self.active.nodes:
            return False
        home = self.home[node]
        return home is not None and self.home.get(node.args[1]) is home

    def _dear(self, loop: Loop) -> list[Node]:
        """What is worth keeping: sums that the way back needs, of much that it does not need."""
        entries = [e for e in self.plan.bodies[loop] if isinstance(e, Node)]
        needed = {a for e in entries if e in self.active.nodes for a in _needed(e)}
        uses = Counter(a for e in entries for a in e.args)
        cost: dict[Node, float] = {}
        found = []
        for node in entries:
            if node.op in ("load", "table"):
                continue
            cost[node] = 1.0 + sum(0.0 if a in needed else cost.get(a, 0.0) / uses[a] for a in node.args)
            if cost[node] > DEAR and node.kind == "real":
                cost[node] = 0.0
                found.append(node)
        return found

    def plain(self, buffer: Buffer) -> bool:
        """Whether an argument is read at known places only."""
        return buffer.size <= SMALL and not any(n.attr[0] is buffer and n.attr[1] for n in self.loads)

    def read(self, buffer: Buffer) -> bool:
        """Whether what stands in a buffer, or in one inside of it, is read again as something that changes."""
        return any(n in self.active.nodes and buffer in roots(n.attr[0]) for n in self.loads)

    def begun(self, entries: list[Entry]) -> list[Buffer]:
        """Buffers whose derivatives begin with a block: those that it writes and reads."""
        found: dict[Buffer, None] = {}
        for entry in entries:
            if isinstance(entry, Node) and entry.op == "table" and entry in self.active.nodes:
                found[entry.attr] = None
            for loop in self.inside[entry] if isinstance(entry, Loop) else ():
                for store in loop.stores:
                    root = list(roots(store.buffer))[-1]
                    if root.role == "scratch" and root in self.active.buffers and root.kind == "real":
                        found[root] = None
        return [b for b in found if self._here(b, entries)]

    def _here(self, buffer: Buffer, entries: list[Entry]) -> bool:
        """Whether all that reads a buffer stands in a block or inside of it."""
        inside = {x for e in entries if isinstance(e, Loop) for x in self.inside[e]}
        own = {e for e in entries if isinstance(e, Node)}
        return all(n in own or self.home[n] in inside for n in self.loads if buffer in roots(n.attr[0])) and not any(
            all(n in self._body(x) or self.home[n] in self.inside[x] for n in self.loads if buffer in roots(n.attr[0]))
            and self._writes(x, buffer)
            for x in inside
        )

    def _body(self, loop: Loop) -> list[Entry]:
        return self.plan.bodies[loop]

    def _writes(self, loop: Loop, buffer: Buffer) -> bool:
        """Whether a buffer is written by loops inside of one, not by itself."""
        return any(buffer in roots(s.buffer) for x in self.inside[loop] - {loop} for s in x.stores)

    def local(self, loop: Loop) -> list[Buffer]:
        """Memory that one trip writes, by loops inside of it, and reads."""
        written = {s.buffer for x in self.inside[loop] - {loop} for s in x.stores}
        read = {n.attr[0] for n in self.loads if self.home[n] in self.inside[loop]}
        return sorted(written & read, key=lambda b: b.serial)

    def again(self, most: int) -> set[Loop]:
        """Loops that go forwards once more through what is inside of them, in every trip on the way back."""
        found = {x for x in self.moving if self.local(x)}
        size = 0
        for loop in self.moving:
            many, up = len(self.plan.live.carried[loop]), self.home[loop]
            many *= self.trips(loop)
            while up is not None:
                many, up = many * self.trips(up), self.home[up]
            size += many
        if size > most:
            found |= {x for x in self.moving if self.home[x] is None and len(self.inside[x]) > 1}
        return found

    def shared(self, loop: Loop) -> list[Node]:
        """What changes, stands outside of a loop, and is used inside."""
        if loop not in self._shared:
            found: dict[Node, None] = {}
            for x in sorted(self.inside[loop], key=lambda x: x.serial):
                places = self.plan.live.carried[x]
                used = [n for k in places for n in (loop_inits(x, k, loop), x.nexts[k]) if n is not None]
                for entry in self.plan.bodies[x]:
                    if isinstance(entry, Store):
                        used.append(entry.value)
                    elif isinstance(entry, Node) and entry in self.active.nodes and entry.op != "load":
                        used += entry.args
                for node in used:
                    if node in self.active.nodes and node.op != "table" and self.home[node] not in self.inside[loop]:
                        found[node] = None
            self._shared[loop] = list(found)
        return self._shared[loop]


def _needed(node: Node) -> tuple[Node, ...]:
    """What the derivatives of an operation are made of."""
    if node.op in ("add", "sub", "neg"):
        return ()
    if node.op == "select":
        return node.args[:1]
    if node.op == "given":
        return node.args[2::2]
    return (*node.args, node) if node.op in ("div", "sqrt", "exp", "expm1", "pow") else node.args


def loop_inits(inner: Loop, place: int, outer: Loop) -> Node | None:
    """What a loop inside of another begins with; of the other itself, that is used outside."""
    return None if inner is outer else inner.inits[place]
