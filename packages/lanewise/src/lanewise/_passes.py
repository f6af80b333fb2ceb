"""Passes that change values by rounding only: what decides the speed is the number of divisions.

In order; `share_divisions` only in mode ``fast``, in mode ``strict`` only the last:

* `combine_lines`: k (x + a) + b, and longer chains that end with a sum, become K x + B with K and B taken before the loop.
* `regroup_products`: a product of products and quotients is a bag of factors, each with exponent 1 or -1, and is put
  together again: x/(a (b/(c y))) -> (c/(a b)) x y, with c/(a b) taken before the loop where a, b and c stay the same in
  it. What stands in the numerator and in the denominator goes. Divisors that change in the loop have one reciprocal
  between them, or each its own where another product has it already. What does not change in the innermost loop of a
  bag is multiplied before that loop; so are constants and signs. Two factors that several products of a loop have in
  common are multiplied once. What is ready first is multiplied first, so that the last to come waits for one
  multiplication only.
* `share_divisions` (float64 only, where products of denominators have room): reciprocals that do not depend on each
  other are taken together, 1/a = b r and 1/b = a r with r = 1/(a b). It pays where division is slow against
  multiplication; where it is not, as on AMD's Zen 5, what one has to wait for the others costs more than the divisions
  saved.
* `restore_divisions`: a reciprocal that one product needs becomes the division that it was.
* `fuse_products`: a product that is used once, by a sum, becomes one operation with it, rounded once. The choice is made
  here and not by a compiler, so that it is the same for every width and every emitter.

``invert`` [d1 .. dn]: with p2 = d1 d2, p3 = p2 d3 .. and r = 1/pn, the last reciprocal is r p(n-1), then r becomes r dn, and
so on backwards. Where pn is not a normal number, each reciprocal is taken by itself. LLVM's emitter takes the processor's
own estimates instead where there are some, see `_llvm_text`.

All of them move results by rounding; `combine_lines` by rounding of b, not of the sum. A quotient of a number by itself is
1, also of zero by itself.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any, NamedTuple

from ._analysis import Liveness, find_homes, find_live, largest_need, loop_of_token, rewrite, sinks
from ._graph import Graph, Loop, Node

# ---- divisions and sums


TOGETHER = 4  # reciprocals that are taken with one division


def optimise(graph: Graph, mode: str, real: str) -> Graph:
    """The graph that emitters write."""
    exact = mode == "strict"
    if not exact:
        graph = combine_lines(rewrite(graph, lambda g, node, args: None, exact=False))
        graph = regroup_products(graph, together=real == "float64")
        graph = rewrite(graph, lambda g, node, args: None, exact=False)  # what nothing uses any more is gone
        if real == "float64" and mode == "fast":
            graph = share_divisions(graph)
        graph = restore_divisions(graph)
    return fuse_products(graph, exact=exact)


def share_divisions(graph: Graph) -> Graph:
    """Reciprocals in groups of `TOGETHER`, of the same loop, and none depending on another of its group."""
    live = find_live(graph)
    home, depth = find_homes(graph, live), _depths(live)
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
    replaced: dict[Node, Node] = {}

    def rule(g: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        group = chosen.get(node)
        if group is None:
            return None
        made = g.make("invert", tuple(replaced[m.args[0]] for m in group), len(group), "real")
        return g.make("item", (made,), group.index(node))

    return rewrite(graph, rule, exact=False, known=replaced, order=_order(live, chosen))


def _depths(live: Liveness) -> dict[Node, int]:
    """Length of the longest chain of reciprocals that a node needs, within a trip of its loop."""
    depth: dict[Node, int] = {}
    before = largest_need(live, lambda a, _: depth[a])
    for node in live.nodes:
        depth[node] = int(before(node)) + (node.op == "rcp")
    return depth


def _order(live: Liveness, chosen: dict[Node, list[Node]]) -> list[Node]:
    """The nodes in an order in which all denominators of a group stand before its reciprocals."""
    order: list[Node] = []
    visited: set[Node] = set()
    over: set[Loop] = set()  # all that they need is in order, or will be before what is looked at

    def needs(node: Node) -> list[Node]:
        if node in chosen:
            return [m.args[0] for m in chosen[node]]
        if node.op not in ("end", "done"):
            return list(node.args)
        first = loop_of_token(node) not in over
        over.add(loop_of_token(node))
        return sinks(loop_of_token(node), live) if first else []

    for first in live.nodes:
        stack = [(first, iter(needs(first)))] if first not in visited else []
        visited.add(first)
        while stack:
            following = next(stack[-1][1], None)
            if following is None:
                order.append(stack.pop()[0])
            elif following not in visited:
                visited.add(following)
                stack.append((following, iter(needs(following))))
    return order


def restore_divisions(graph: Graph) -> Graph:
    """Restore a division from a reciprocal that is used once, by a product."""
    live = find_live(graph)
    home, times = find_homes(graph, live), count_uses(graph, live)

    def rule(g: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.op == "mul":
            for k, arg in enumerate(node.args):
                if arg.op == "rcp" and times[arg] == 1 and home[arg] is home[node] and args[k].op == "rcp":
                    return g.make("div", (args[1 - k], args[k].args[0]))
        return None

    return rewrite(graph, rule, exact=False)


def fuse_products(graph: Graph, *, exact: bool) -> Graph:
    """Replace a sum and a product that nothing else uses by one fused operation."""
    live = find_live(graph)
    home, times = find_homes(graph, live), count_uses(graph, live)

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

    return rewrite(graph, rule, exact=exact)


# ---- products


OPEN = frozenset({"mul", "div", "rcp", "neg"})
MOST = 24  # factors of one product
# How long what waits for a result waits, about, in additions.
LATENCY = {"div": 4, "rcp": 4, "sqrt": 6, "select": 0.5, "neg": 0, "abs": 0.3, "load": 0}

Factor = tuple[Any, int]  # (a node, or a pair of factors; its exponent)


class FactorBag(NamedTuple):
    """A product: its constant, the factors that stay the same in its loop, and those that change."""

    constant: float
    fixed: list[Factor]
    changing: list[Factor]


class Survey(NamedTuple):
    """Properties of the nodes of a graph."""

    live: Liveness
    home: dict[Any, Any]
    times: Counter[Node]
    ready: dict[Node, float]


def count_uses(graph: Graph, live: Liveness) -> Counter[Node]:
    """Count the uses of each node."""
    uses = Counter(a for n in live.nodes for a in n.args)
    for loop in live.loops:
        uses.update(n for k in live.carried[loop] for n in (loop.inits[k], loop.nexts[k]))
        uses.update(s.value for s in loop.stores)
    uses.update(s.value for s in graph.stores)
    return uses


def survey(graph: Graph) -> Survey:
    """Look a graph over."""
    live = find_live(graph)
    home = find_homes(graph, live)
    ready: dict[Node, float] = {}
    waits = largest_need(live, lambda a, node: ready[a] if home[a] is home[node] else 0.0)
    for node in live.nodes:
        ready[node] = waits(node) + (0.0 if node.op in ("phi", "const") else LATENCY.get(node.op, 1.0))
    return Survey(live, home, count_uses(graph, live), ready)


def combine_lines(graph: Graph) -> Graph:
    """Chains of sums and products with what does not change become one product and one sum."""
    at = survey(graph)

    def outside(node: Node, loop: Any) -> bool:
        return at.home[node] is not loop

    def line(node: Node, loop: Any, first: bool) -> tuple[Node, list[tuple[str, Node]]]:
        """Start of a chain, and the operations applied to it, in order."""
        if node.op in ("add", "sub", "mul", "div", "neg") and at.home[node] is loop and (first or at.times[node] == 1):
            if node.op == "neg":
                begin, steps = line(node.args[0], loop, False)
                return begin, [*steps, ("neg", node)]
            for k, (x, c) in enumerate((node.args, node.args[::-1])):
                if outside(c, loop) and not outside(x, loop) and not (node.op == "div" and k):
                    begin, steps = line(x, loop, False)
                    return begin, [*steps, ("from" if node.op == "sub" and k else node.op, c)]
        return node, []

    made: dict[Node, Node] = {}

    def rule(g: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        loop = at.home[node]
        if node.kind != "real" or node.op not in ("add", "sub") or loop is None:
            return None
        begin, steps = line(node, loop, True)
        if len([s for s, _ in steps if s != "neg"]) < 2:
            return None
        factor, offset = g.const(1.0), g.const(0.0)
        for op, old in steps:
            if op == "neg":
                factor, offset = g.make("neg", (factor,)), g.make("neg", (offset,))
                continue
            c = made[old]
            if op in ("mul", "div"):
                factor, offset = g.make(op, (factor, c)), g.make(op, (offset, c))
            elif op == "from":
                factor, offset = g.make("neg", (factor,)), g.make("sub", (c, offset))
            else:
                offset = g.make(op, (offset, c))
        return g.make("add", (g.make("mul", (made[begin], factor)), offset))

    return rewrite(graph, rule, exact=False, known=made)


def regroup_products(graph: Graph, *, together: bool) -> Graph:
    """Regroup the factors of every product.

    Args:
        graph: stays as it is.
        together: whether divisors may share a reciprocal of their product, which float32 has no room for.
    """
    at = survey(graph)
    bags = _bags(at)
    wanted = Counter(n for bag in bags.values() for n, e in bag.changing if e < 0)
    for root, bag in bags.items():
        alone = [f for f in bag.changing if f[1] < 0 and wanted[f[0]] == 1]
        if together and len(alone) > 1:
            kept = [f for f in bag.changing if f not in alone]
            bags[root] = bag._replace(changing=[*kept, (tuple(n for n, _ in alone), -1)])
    _pair(at, bags)
    made: dict[Node, Node] = {}

    def rule(g: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        return _Builder(g, at, made).product(bags[node]) if node in bags else None

    return rewrite(graph, rule, exact=False, known=made)


def _bags(at: Survey) -> dict[Node, FactorBag]:
    """The products that are no part of another."""
    users: dict[Node, list[Node]] = defaultdict(list)
    for node in at.live.nodes:
        if node.kind == "real" and node.op in OPEN:
            for a in node.args:
                users[a].append(node)
    bags = {}
    for node in reversed(at.live.nodes):
        if node.kind != "real" or node.op not in OPEN or node.op == "neg":
            continue
        inside = at.times[node] == 1 and users[node] and at.home[users[node][0]] is at.home[node]
        if inside and (users[node][0].op != "neg" or _in_product(users[node][0], at, users)):
            continue
        bag = _factorise(node, at)
        if bag is not None:
            bags[node] = bag
    return bags


def _in_product(neg: Node, at: Survey, users: dict[Node, list[Node]]) -> bool:
    """Whether a sign is part of a product."""
    while at.times[neg] == 1 and users[neg] and at.home[users[neg][0]] is at.home[neg]:
        if users[neg][0].op != "neg":
            return True
        neg = users[neg][0]
    return False


def _factorise(root: Node, at: Survey) -> FactorBag | None:
    """The factors of a product; None if there are too many."""
    home, constant = at.home[root], 1.0
    factors: list[tuple[Node, int]] = []
    stack = [(root, 1)]
    while stack:
        node, exponent = stack.pop()
        if node.op == "const" and node.attr != 0.0:
            constant = constant * node.attr if exponent > 0 else constant / node.attr
        elif node is root or (node.op in OPEN and (at.home[node] is not home or at.times[node] == 1)):
            if node.op == "neg":
                constant = -constant
            if node.op == "rcp":
                stack.append((node.args[0], -exponent))
            else:
                stack.append((node.args[0], exponent))
                if node.op in ("mul", "div"):
                    stack.append((node.args[1], exponent if node.op == "mul" else -exponent))
        else:
            factors.append((node, exponent))
        if len(stack) + len(factors) > MOST:
            return None
    for node, exponent in list(factors):
        if (node, exponent) in factors and (node, -exponent) in factors:
            factors.remove((node, exponent))
            factors.remove((node, -exponent))
    factors.sort(key=lambda f: f[0].serial)
    fixed: list[Factor] = [f for f in factors if at.home[f[0]] is not home]
    return FactorBag(constant, fixed, [f for f in factors if at.home[f[0]] is home])


def _pair(at: Survey, bags: dict[Node, FactorBag]) -> None:
    """Factors that several products of a loop have in common."""
    while True:
        having: dict[Any, list[Node]] = defaultdict(list)
        for root, bag in bags.items():
            factors = sorted(set(bag.changing), key=_factor_order)
            for i, a in enumerate(factors):
                for b in factors[i + 1 :]:
                    having[at.home[root], a, b].append(root)
        best = sorted(
            (p for p, roots in having.items() if len(roots) > 1),
            key=lambda p: (-len(having[p]), _factor_order(p[1]), _factor_order(p[2])),
        )
        if not best:
            return
        touched: set[Node] = set()
        for pair in best:
            _, a, b = pair
            roots = [r for r in having[pair] if r not in touched]
            if len(roots) < 2:
                continue
            touched.update(roots)
            for root in roots:
                changing = list(bags[root].changing)
                changing.remove(a)
                changing.remove(b)
                bags[root] = bags[root]._replace(changing=[*changing, ((a, b), 0)])


def _factor_order(factor: Factor) -> Any:
    """Some order that depends on the graph only."""
    base, exponent = factor
    if isinstance(base, Node):
        return ((base.serial,), exponent)
    return (tuple(n for part in base for n in _factor_order(part if exponent == 0 else (part, -1))[0]), exponent)


class _Builder:
    """Puts products together in a new graph."""

    def __init__(self, g: Graph, at: Survey, made: dict[Node, Node]) -> None:
        self.g, self.at, self.made = g, at, made

    def product(self, bag: FactorBag) -> Node:
        """The new node of a product."""
        fixed = self.fixed(bag.fixed)
        if bag.constant not in (1.0, -1.0) or (bag.constant < 0.0 and fixed is not None):
            constant = self.g.const(bag.constant)
            fixed = constant if fixed is None else self.g.make("mul", (fixed, constant))
        parts = sorted((self.ready(f), k, f) for k, f in enumerate(bag.changing))
        values = [self.factor(f) for _, _, f in parts]
        if fixed is not None:
            values.insert(0, fixed)
        whole = values[0] if values else self.g.const(1.0)
        for value in values[1:]:
            whole = self.g.make("mul", (whole, value))
        return self.g.make("neg", (whole,)) if bag.constant == -1.0 and fixed is None else whole

    def fixed(self, factors: list[Factor]) -> Node | None:
        """Product of the factors that are constant in the loop: the outermost first, divisors together at equal depth."""
        whole: Node | None = None
        groups: dict[int, list[Factor]] = defaultdict(list)
        for factor in factors:
            home = self.at.home[factor[0]]
            groups[home.depth if home is not None else 0].append(factor)
        for _, group in sorted(groups.items()):
            above = [self.made[n] for n, e in group if e > 0]
            below = [self.made[n] for n, e in group if e < 0]
            for node in above:
                whole = node if whole is None else self.g.make("mul", (whole, node))
            for node in below:
                rcp = self.g.make("rcp", (node,))
                whole = rcp if whole is None else self.g.make("mul", (whole, rcp))
        return whole

    def ready(self, factor: Factor) -> float:
        """Depth at which a factor is available."""
        base, exponent = factor
        if isinstance(base, Node):
            return self.at.ready[base] + (LATENCY["rcp"] if exponent < 0 else 0.0)
        parts = base if exponent == 0 else [(n, 1) for n in base]
        return max(map(self.ready, parts)) + (1.0 if exponent == 0 else len(base) - 1.0 + LATENCY["rcp"])

    def factor(self, factor: Factor) -> Node:
        """The new node of a factor that changes."""
        base, exponent = factor
        if isinstance(base, Node):
            return self.made[base] if exponent > 0 else self.g.make("rcp", (self.made[base],))
        if exponent == 0:
            a, b = sorted(base, key=self.ready)
            return self.g.make("mul", (self.factor(a), self.factor(b)))
        whole = self.made[base[0]]
        for node in base[1:]:
            whole = self.g.make("mul", (whole, self.made[node]))
        return self.g.make("rcp", (whole,))
