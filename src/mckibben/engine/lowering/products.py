"""Products and quotients taken apart and put together anew: fewer divisions, fewer operations, shorter chains.

    x/(a (b/(c y)))  ->  (c/(a b)) x y        with c/(a b) taken before the loop, where a, b and c stay the same in it

* A product of products and quotients is a bag of factors, each with exponent 1 or -1. What stands in the numerator and in
  the denominator goes. Divisors that change in the loop have one reciprocal between them, or each its own where another
  product has it already.
* What does not change in the innermost loop of a bag is multiplied before that loop; so are constants and signs.
* Two factors that several products of a loop have in common are multiplied once.
* What is ready first is multiplied first, so that the last to come waits for one multiplication only.
* `straight`: k (x + a) + b, and longer chains that end with a sum, become K x + B with K and B taken before the loop.

All of them move results by rounding; `straight` by rounding of b, not of the sum. A quotient of a number by itself is 1,
also of zero by itself.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any, NamedTuple

from .graph import Graph, Node
from .rewrite import Alive, alive, homes, largest, rewritten

OPEN = frozenset({"mul", "div", "rcp", "neg"})
MOST = 24  # factors of one product
# How long what waits for a result waits, about, in additions.
LATENCY = {"div": 4, "rcp": 4, "sqrt": 6, "select": 0.5, "neg": 0, "abs": 0.3, "load": 0}

Factor = tuple[Any, int]  # (a node, or a pair of factors; its exponent)


class Bag(NamedTuple):
    """A product: its constant, the factors that stay the same in its loop, and those that change."""

    constant: float
    fixed: list[Factor]
    changing: list[Factor]


class Uses(NamedTuple):
    """What is known of the nodes of a graph."""

    live: Alive
    home: dict[Any, Any]
    times: Counter[Node]
    ready: dict[Node, float]


def uses(graph: Graph, live: Alive) -> Counter[Node]:
    """How often each node is needed."""
    found = Counter(a for n in live.nodes for a in n.args)
    for loop in live.loops:
        found.update(n for k in live.carried[loop] for n in (loop.inits[k], loop.nexts[k]))
        found.update(s.value for s in loop.stores)
    found.update(s.value for s in graph.stores)
    return found


def known(graph: Graph) -> Uses:
    """Look a graph over."""
    live = alive(graph)
    home = homes(graph, live)
    ready: dict[Node, float] = {}
    waits = largest(live, lambda a, node: ready[a] if home[a] is home[node] else 0.0)
    for node in live.nodes:
        ready[node] = waits(node) + (0.0 if node.op in ("phi", "const") else LATENCY.get(node.op, 1.0))
    return Uses(live, home, uses(graph, live), ready)


def straight(graph: Graph) -> Graph:
    """Chains of sums and products with what does not change become one product and one sum."""
    at = known(graph)

    def outside(node: Node, loop: Any) -> bool:
        return at.home[node] is not loop

    def line(node: Node, loop: Any, first: bool) -> tuple[Node, list[tuple[str, Node]]]:
        """What a chain begins with, and what is done to it, in order."""
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

    return rewritten(graph, rule, exact=False, known=made)


def products(graph: Graph, *, together: bool) -> Graph:
    """The graph with every product put together anew.

    Args:
        graph: stays as it is.
        together: whether divisors may share a reciprocal of their product, which float32 has no room for.
    """
    at = known(graph)
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

    return rewritten(graph, rule, exact=False, known=made)


def _bags(at: Uses) -> dict[Node, Bag]:
    """The products that are no part of another."""
    users: dict[Node, list[Node]] = defaultdict(list)
    for node in at.live.nodes:
        if node.kind == "real" and node.op in OPEN:
            for a in node.args:
                users[a].append(node)
    found = {}
    for node in reversed(at.live.nodes):
        if node.kind != "real" or node.op not in OPEN or node.op == "neg":
            continue
        inside = at.times[node] == 1 and users[node] and at.home[users[node][0]] is at.home[node]
        if inside and (users[node][0].op != "neg" or _in_product(users[node][0], at, users)):
            continue
        bag = _taken_apart(node, at)
        if bag is not None:
            found[node] = bag
    return found


def _in_product(neg: Node, at: Uses, users: dict[Node, list[Node]]) -> bool:
    """Whether a sign is part of a product."""
    while at.times[neg] == 1 and users[neg] and at.home[users[neg][0]] is at.home[neg]:
        if users[neg][0].op != "neg":
            return True
        neg = users[neg][0]
    return False


def _taken_apart(root: Node, at: Uses) -> Bag | None:
    """The factors of a product; None where there are too many."""
    here, constant = at.home[root], 1.0
    factors: list[tuple[Node, int]] = []
    stack = [(root, 1)]
    while stack:
        node, exponent = stack.pop()
        if node.op == "const" and node.attr != 0.0:
            constant = constant * node.attr if exponent > 0 else constant / node.attr
        elif node is root or (node.op in OPEN and (at.home[node] is not here or at.times[node] == 1)):
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
    fixed: list[Factor] = [f for f in factors if at.home[f[0]] is not here]
    return Bag(constant, fixed, [f for f in factors if at.home[f[0]] is here])


def _pair(at: Uses, bags: dict[Node, Bag]) -> None:
    """Factors that several products of a loop have in common."""
    while True:
        having: dict[Any, list[Node]] = defaultdict(list)
        for root, bag in bags.items():
            seen = sorted(set(bag.changing), key=_order)
            for i, a in enumerate(seen):
                for b in seen[i + 1 :]:
                    having[at.home[root], a, b].append(root)
        best = sorted(
            (p for p, roots in having.items() if len(roots) > 1),
            key=lambda p: (-len(having[p]), _order(p[1]), _order(p[2])),
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


def _order(factor: Factor) -> Any:
    """Some order that depends on the graph only."""
    what, exponent = factor
    if isinstance(what, Node):
        return ((what.serial,), exponent)
    return (tuple(n for part in what for n in _order(part if exponent == 0 else (part, -1))[0]), exponent)


class _Builder:
    """Puts products together in a new graph."""

    def __init__(self, g: Graph, at: Uses, made: dict[Node, Node]) -> None:
        self.g, self.at, self.made = g, at, made

    def product(self, bag: Bag) -> Node:
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
        """What is multiplied before the loop: the outermost first, divisors together where they stand equally far out."""
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
        """When a factor is there."""
        what, exponent = factor
        if isinstance(what, Node):
            return self.at.ready[what] + (LATENCY["rcp"] if exponent < 0 else 0.0)
        parts = what if exponent == 0 else [(n, 1) for n in what]
        return max(map(self.ready, parts)) + (1.0 if exponent == 0 else len(what) - 1.0 + LATENCY["rcp"])

    def factor(self, factor: Factor) -> Node:
        """The new node of a factor that changes."""
        what, exponent = factor
        if isinstance(what, Node):
            return self.made[what] if exponent > 0 else self.g.make("rcp", (self.made[what],))
        if exponent == 0:
            a, b = sorted(what, key=self.ready)
            return self.g.make("mul", (self.factor(a), self.factor(b)))
        whole = self.made[what[0]]
        for node in what[1:]:
            whole = self.g.make("mul", (whole, self.made[node]))
        return self.g.make("rcp", (whole,))
