"""Passes that change values by rounding only: what decides the speed is the number of divisions.

In order; `shared` only in mode ``fast``, in mode ``strict`` only the last:

* `products.straight` and `products.products`: sums and products are put together anew, with one reciprocal for the divisors
  of each, and what does not change in a loop is taken before it.
* `shared` (float64 only, where products of denominators have room): reciprocals that do not depend on each other are taken
  together, 1/a = b r and 1/b = a r with r = 1/(a b). It pays where division is slow against multiplication; where it is not,
  as on AMD's Zen 5, what one has to wait for the others costs more than the divisions saved.
* `lonely`: a reciprocal that one product needs becomes the division that it was.
* `contracted`: a product that is used once, by a sum, becomes one operation with it, rounded once. The choice is made here
  and not by a compiler, so that it is the same for every width and every emitter.

``invert`` [d1 .. dn]: with p2 = d1 d2, p3 = p2 d3 .. and r = 1/pn, the last reciprocal is r p(n-1), then r becomes r dn, and
so on backwards. Where pn is not a normal number, each reciprocal is taken by itself. LLVM's emitter takes the processor's
own estimates instead where there are some, see `llvm_estimates`.
"""

from __future__ import annotations

from collections import defaultdict

from .graph import Graph, Loop, Node
from .products import products, straight, uses
from .rewrite import Alive, alive, ended, homes, largest, rewritten, sinks

TOGETHER = 4  # reciprocals that are taken with one division


def optimised(graph: Graph, mode: str, real: str) -> Graph:
    """The graph that emitters write."""
    exact = mode == "strict"
    if not exact:
        graph = straight(rewritten(graph, lambda g, node, args: None, exact=False))
        graph = products(graph, together=real == "float64")
        graph = rewritten(graph, lambda g, node, args: None, exact=False)  # what nothing uses any more is gone
        if real == "float64" and mode == "fast":
            graph = shared(graph)
        graph = lonely(graph)
    return contracted(graph, exact=exact)


def shared(graph: Graph) -> Graph:
    """Reciprocals in groups of `TOGETHER`, of the same loop, and none depending on another of its group."""
    live = alive(graph)
    home, depth = homes(graph, live), _depths(live)
    groups = defaultdict(list)
    for node in live.nodes:
        if node.op == "rcp" and home[node] is not None:
            groups[home[node], depth[node]].append(node)
    chosen: dict[Node, list[Node]] = {}
    for members in groups.values():
        pieces = -(-len(members) // TOGETHER)
        for k in range(pieces):
            part = members[len(members) * k // pieces : len(members) * (k + 1) // pieces]
            if len(part) > 1:
                chosen.update(dict.fromkeys(part, part))
    known: dict[Node, Node] = {}

    def rule(g: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        group = chosen.get(node)
        if group is None:
            return None
        made = g.make("invert", tuple(known[m.args[0]] for m in group), len(group), "real")
        return g.make("item", (made,), group.index(node))

    return rewritten(graph, rule, exact=False, known=known, order=_order(live, chosen))


def _depths(live: Alive) -> dict[Node, int]:
    """How many reciprocals one after the other a node needs, within a trip of its loop."""
    depth: dict[Node, int] = {}
    before = largest(live, lambda a, _: depth[a])
    for node in live.nodes:
        depth[node] = int(before(node)) + (node.op == "rcp")
    return depth


def _order(live: Alive, chosen: dict[Node, list[Node]]) -> list[Node]:
    """The nodes in an order in which all denominators of a group stand before its reciprocals."""
    order: list[Node] = []
    seen: set[Node] = set()
    over: set[Loop] = set()  # all that they need is in order, or will be before what is looked at

    def needs(node: Node) -> list[Node]:
        if node in chosen:
            return [m.args[0] for m in chosen[node]]
        if node.op not in ("end", "done"):
            return list(node.args)
        first = ended(node) not in over
        over.add(ended(node))
        return sinks(ended(node), live) if first else []

    for first in live.nodes:
        stack = [(first, iter(needs(first)))] if first not in seen else []
        seen.add(first)
        while stack:
            found = next(stack[-1][1], None)
            if found is None:
                order.append(stack.pop()[0])
            elif found not in seen:
                seen.add(found)
                stack.append((found, iter(needs(found))))
    return order


def lonely(graph: Graph) -> Graph:
    """A reciprocal that is used once, by a product beside it, becomes the division that it was."""
    live = alive(graph)
    home, times = homes(graph, live), uses(graph, live)

    def rule(g: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.op == "mul":
            for k, arg in enumerate(node.args):
                if arg.op == "rcp" and times[arg] == 1 and home[arg] is home[node] and args[k].op == "rcp":
                    return g.make("div", (args[1 - k], args[k].args[0]))
        return None

    return rewritten(graph, rule, exact=False)


def contracted(graph: Graph, *, exact: bool) -> Graph:
    """Sums with a product of their own."""
    live = alive(graph)
    home, times = homes(graph, live), uses(graph, live)

    def own(node: Node, k: int, args: tuple[Node, ...]) -> bool:
        arg = node.args[k]
        return arg.op == "mul" and times[arg] == 1 and home[arg] is home[node] and args[k].op == "mul"

    def rule(g: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.kind != "real" or node.op not in ("add", "sub"):
            return None
        if own(node, 1, args):
            a, b = args[1].args
            if node.op == "sub":
                a, b = (b, g.make("neg", (a,))) if a.op == "const" else (a, g.make("neg", (b,)))
            return g.make("fma", (a, b, args[0]))
        if own(node, 0, args):
            last = g.make("neg", (args[1],)) if node.op == "sub" else args[1]
            return g.make("fma", (*args[0].args, last))
        return None

    return rewritten(graph, rule, exact=exact)
