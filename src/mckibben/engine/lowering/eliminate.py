"""The linear graph of a block's changes, made shorter by products of partial derivatives."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator

from .graph import Graph, Node
from .partials import product, total


class Edges:
    """By node, what its change is the sum of: partial derivatives by other nodes.

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
        """What is left, arguments first."""
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
        """How many operations fewer there are without a node."""
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
