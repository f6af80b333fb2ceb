"""What differs from lane to lane, and what is one value for all: decided anew for each way to call a program."""

from __future__ import annotations

from typing import NamedTuple

from ...errors import LoweringError
from .graph import Buffer, Graph, Node
from .rewrite import roots
from .schedule import Schedule


class Varying(NamedTuple):
    """The nodes and the buffers that have a value per lane."""

    nodes: set[Node]
    buffers: set[Buffer]


def varying(graph: Graph, plan: Schedule, arguments: set[Buffer], *, lanes: bool) -> Varying:
    """Follow what differs through nodes, loops and memory.

    Args:
        graph: the program's.
        plan: its order.
        arguments: buffers that are given per lane.
        lanes: whether results are wanted per lane; without lanes nothing differs.
    """
    nodes: set[Node] = set()
    buffers = set(arguments) | ({b for b in graph.buffers if b.role == "result"} if lanes else set())
    if not lanes:
        return Varying(nodes, buffers)
    stores = [s for x in plan.live.loops for s in x.stores] + graph.stores
    while True:
        before = len(nodes), len(buffers)
        for buffer in plan.live.buffers:
            if any(b in buffers for b in roots(buffer)):
                buffers.update(roots(buffer))
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
    return Varying(nodes, buffers)
