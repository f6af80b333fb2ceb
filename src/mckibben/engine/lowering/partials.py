"""What each operation's result changes by with its arguments, as nodes; and which nodes depend on some arguments at all.

Where an extreme is reached by both arguments each has half of it, and the size of 0 rises: as JAX has it. What the tracer
was told about a value (op ``given``) goes before what its operations would say.
"""

from __future__ import annotations

from collections.abc import Callable

from .graph import Buffer, Graph, Node
from .rewrite import roots
from .schedule import Schedule


def partials(g: Graph, node: Node, args: tuple[Node, ...], made: Node) -> list[Node | None]:
    """Derivatives of a node by its arguments, None where there is none.

    Args:
        g: where they are made.
        node: of the old graph.
        args: its arguments in the new one.
        made: itself in the new one.
    """
    if node.op == "given":
        found: list[Node | None] = [None] * len(args)
        found[1::2] = args[2::2]
        return found
    rule = _RULES.get(node.op)
    return [None] * len(args) if rule is None else rule(g, made, args)


def _one(g: Graph) -> Node:
    return g.const(1.0)


def _quotient(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    inverse = g.make("div", (_one(g), args[1]))
    by_below = None if args[1].op == "const" else g.make("neg", (g.make("mul", (z, inverse)),))
    return [inverse, by_below]


def _extreme(g: Graph, args: tuple[Node, ...], largest: bool) -> list[Node | None]:
    below, above = g.make("lt", args), g.make("lt", args[::-1])
    first, second = (above, below) if largest else (below, above)
    share = g.make("select", (first, _one(g), g.make("select", (second, g.const(0.0), g.const(0.5)))))
    return [share, g.make("sub", (_one(g), share))]


def _size(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    return [g.make("select", (g.make("lt", (args[0], g.const(0.0))), g.const(-1.0), _one(g)))]


def _power(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    x, y = args
    zero, one = g.const(0.0), _one(g)
    lower = g.make("pow", (x, g.make("sub", (y, one))))
    by_x = g.make("select", (g.make("eq", (y, zero)), zero, g.make("mul", (y, lower))))
    logarithm = g.make("log", (g.make("select", (g.make("eq", (x, zero)), one, x)),))
    return [by_x, None if y.op == "const" else g.make("mul", (z, logarithm))]


def _chosen(g: Graph, z: Node, args: tuple[Node, ...]) -> list[Node | None]:
    one, zero = _one(g), g.const(0.0)
    return [None, g.make("select", (args[0], one, zero)), g.make("select", (args[0], zero, one))]


_RULES: dict[str, Callable[[Graph, Node, tuple[Node, ...]], list[Node | None]]] = {
    "add": lambda g, z, a: [_one(g), _one(g)],
    "sub": lambda g, z, a: [_one(g), g.const(-1.0)],
    "mul": lambda g, z, a: [a[1], a[0]],
    "div": _quotient,
    "neg": lambda g, z, a: [g.const(-1.0)],
    "abs": _size,
    "sqrt": lambda g, z, a: [g.make("div", (g.const(0.5), z))],
    "max": lambda g, z, a: _extreme(g, a, True),
    "min": lambda g, z, a: _extreme(g, a, False),
    "exp": lambda g, z, a: [z],
    "expm1": lambda g, z, a: [g.make("add", (z, _one(g)))],
    "log": lambda g, z, a: [g.make("div", (_one(g), a[0]))],
    "log1p": lambda g, z, a: [g.make("div", (_one(g), g.make("add", (_one(g), a[0]))))],
    "sin": lambda g, z, a: [g.make("cos", a)],
    "cos": lambda g, z, a: [g.make("neg", (g.make("sin", a),))],
    "pow": _power,
    "select": _chosen,
}


def product(g: Graph, x: Node, y: Node) -> Node:
    """Product of x and y; a factor that chooses between 1 and 0 is a choice, a sign is left to the sum that follows."""
    if x.op == "neg" or y.op == "neg":
        signs = (x.op == "neg") + (y.op == "neg")
        made = product(g, *(z.args[0] if z.op == "neg" else z for z in (x, y)))
        return made if signs == 2 else g.make("neg", (made,))
    for a, b in ((x, y), (y, x)):
        if a.op == "select" and a.args[1].op == a.args[2].op == "const":
            if (a.args[1].attr, a.args[2].attr) == (1.0, 0.0):
                return g.make("select", (a.args[0], b, a.args[2]))
            if (a.args[1].attr, a.args[2].attr) == (0.0, 1.0):
                return g.make("select", (a.args[0], a.args[1], b))
    return g.make("mul", (x, y))


def total(g: Graph, x: Node, y: Node) -> Node:
    """Sum of x and y, where what a choice gives to one and what it gives to the other are one choice."""
    if x.op == y.op == "select" and x.args[0] is y.args[0]:
        for a, b in ((x, y), (y, x)):
            if is_zero(a.args[2]) and is_zero(b.args[1]):
                return g.make("select", (a.args[0], a.args[1], b.args[2]))
    return g.make("add", (x, y))


def is_zero(node: Node) -> bool:
    """Whether a node is the number 0."""
    return node.op == "const" and node.attr == 0.0


class Active:
    """What depends on some arguments, by numbers that have derivatives.

    Attributes:
        nodes: in no order.
        buffers: all that hold such numbers.
    """

    def __init__(self, graph: Graph, plan: Schedule, arguments: set[Buffer]) -> None:
        self.nodes: set[Node] = set()
        self.buffers = set(arguments)
        stores = [s for x in plan.live.loops for s in x.stores] + graph.stores
        before = (-1, -1)
        while before != (len(self.nodes), len(self.buffers)):
            before = len(self.nodes), len(self.buffers)
            for buffer in plan.live.buffers:
                if any(b in self.buffers for b in roots(buffer)):
                    self.buffers.update(roots(buffer))
            for node in plan.live.nodes:
                if node not in self.nodes and self._depends(node):
                    self.nodes.add(node)
                    if node.op == "table":
                        self.buffers.add(node.attr)
            self.buffers.update(s.buffer for s in stores if s.value in self.nodes)

    def _depends(self, node: Node) -> bool:
        if node.op in ("phi", "end"):
            loop, k = node.attr
            return loop.inits[k] in self.nodes or loop.nexts[k] in self.nodes
        if node.op == "load":
            return node.kind == "real" and node.attr[0] in self.buffers
        if node.op == "given":
            return any(a in self.nodes for a in node.args[1::2])
        if node.op == "table":
            return any(a in self.nodes for a in node.args)
        return node.kind == "real" and node.op in _RULES and any(a in self.nodes for a in node.args)
