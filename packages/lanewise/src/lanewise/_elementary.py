"""exp, log, pow, sin and cos as arithmetic, so that every emitter and every vector width computes them alike.

Reduction and polynomials as usual in mathematical libraries (W. J. Cody and W. Waite, Software Manual for the Elementary
Functions, 1980; the logarithm's coefficients are those of Sun's fdlibm). Errors in float64: about one unit in the last place
for exp, expm1, log, log1p and pow; sin and cos below 1e-15 of 1 for arguments up to 1e5. Results of exp below 1e-307 are 0.
pow is for bases that are not negative, unless the exponent is a known whole number.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from ._analysis import RewriteRule
from ._graph import Graph, Node

LN2_HIGH, LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
LOG = (
    6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01, 2.222219843214978396e-01,
    1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01,
)  # fmt: skip
HALF_PI = (
    1.57079632673412561417e00,
    6.07710050630396597660e-11,
    2.02226624871116645580e-21,
    8.47842766036889956997e-32,
)


class Format:
    """Layout of a floating-point type, and the number of terms of its polynomials."""

    def __init__(self, real: str) -> None:
        double = real == "double"
        self.mantissa, self.bias = (52, 1023) if double else (23, 127)
        self.exp_terms, self.log_terms = (14, 7) if double else (8, 4)
        self.code, self.word = ("d", "q") if double else ("f", "i")
        self.largest = 709.782712893384 if double else 88.72283
        self.smallest = -707.7 if double else -87.3
        self.tiny, self.up = (2.2250738585072014e-308, 54) if double else (1.1754943508222875e-38, 25)
        self.ln2_high = LN2_HIGH if double else 0.693145751953125
        self.ln2_low = LN2_LOW if double else 1.42860677e-6

    def bits(self, value: float) -> int:
        """A number's bits as a whole number."""
        return int(struct.unpack(self.word, struct.pack(self.code, value))[0])


class Builder:
    """Shorthand for the nodes of a formula."""

    def __init__(self, graph: Graph, form: Format) -> None:
        self.g, self.form = graph, form

    def n(self, value: Node | float) -> Node:
        """A number, or the node that it is already."""
        return value if isinstance(value, Node) else self.g.const(value)

    def i(self, value: int) -> Node:
        """A whole number."""
        return self.g.const(value, "int")

    def add(self, a: Node | float, b: Node | float) -> Node:
        """Sum."""
        return self.g.make("add", (self.n(a), self.n(b)))

    def sub(self, a: Node | float, b: Node | float) -> Node:
        """Difference."""
        return self.g.make("sub", (self.n(a), self.n(b)))

    def mul(self, a: Node | float, b: Node | float) -> Node:
        """Product."""
        return self.g.make("mul", (self.n(a), self.n(b)))

    def div(self, a: Node | float, b: Node | float) -> Node:
        """Quotient."""
        return self.g.make("div", (self.n(a), self.n(b)))

    def fma(self, a: Node | float, b: Node | float, c: Node | float) -> Node:
        """Product and sum, a b + c, rounded once."""
        return self.g.make("fma", (self.n(a), self.n(b), self.n(c)))

    def less(self, a: Node | float, b: Node | float) -> Node:
        """Whether a < b."""
        return self.g.make("lt", (self.n(a), self.n(b)))

    def where(self, c: Node, a: Node | float, b: Node | float) -> Node:
        """Choice: a where c, else b."""
        return self.g.make("select", (c, self.n(a), self.n(b)))

    def series(self, x: Node, terms: Sequence[float]) -> Node:
        """terms[0] + terms[1] x + ..."""
        total = self.n(terms[-1])
        for c in terms[-2::-1]:
            total = self.fma(total, x, c)
        return total

    def whole(self, op: str, a: Node, b: int | Node) -> Node:
        """An operation on whole numbers."""
        return self.g.make(op, (a, self.i(b) if isinstance(b, int) else b))

    def low_bits(self, k: Node) -> Node:
        """The lowest bits of a real that is whole and not large, as those of a whole number.

        They are the last of the mantissa once a large number is added: many processors convert no vectors of float64.
        """
        return self.g.make("bits", (self.add(k, 1.5 * 2.0**self.form.mantissa),), kind="int")

    def power_of_two(self, k: Node, less: int = 0) -> Node:
        """2^(k - less) of a real that is whole."""
        shifted = self.whole("shl", self.whole("add", self.low_bits(k), self.form.bias - less), self.form.mantissa)
        return self.g.make("unbits", (shifted,), kind="real")


def _reduced(b: Builder, x: Node) -> tuple[Node, Node, Node]:
    """Reduction to k and r of x = k ln 2 + r, and exp(r) - 1 - r over r^2."""
    k = b.g.make("round", (b.mul(x, 1.0 / math.log(2.0)),))
    r = b.fma(k, -b.form.ln2_low, b.fma(k, -b.form.ln2_high, x))
    return k, r, b.series(r, [1.0 / math.factorial(j) for j in range(2, b.form.exp_terms)])


def _exp(b: Builder, x: Node, more: Node | None = None) -> Node:
    """exp(x + more), more being small."""
    k, r, rest = _reduced(b, x)
    if more is not None:
        r = b.add(r, more)
    grown = b.add(b.fma(b.mul(r, r), rest, r), 1.0)
    value = b.mul(b.mul(grown, b.power_of_two(k, 1)), 2.0)
    value = b.where(b.less(x, b.form.smallest), 0.0, value)
    return b.where(b.less(b.form.largest, x), math.inf, value)


def _expm1(b: Builder, x: Node) -> Node:
    k, r, rest = _reduced(b, x)
    half = b.power_of_two(k, 1)
    value = b.mul(b.fma(half, b.fma(b.mul(r, r), rest, r), b.sub(half, 0.5)), 2.0)
    value = b.where(b.less(x, -40.0), -1.0, value)
    return b.where(b.less(b.form.largest, x), math.inf, value)


def _split(b: Builder, x: Node) -> tuple[Node, Node]:
    """Exponent k and rest m of x = 2^k m with m from sqrt(1/2) to sqrt(2); x above 0."""
    f = b.form
    small = b.less(x, f.tiny)
    bits = b.g.make("bits", (b.where(small, b.mul(x, 2.0**f.up), x),), kind="int")
    one = f.bias << f.mantissa
    raised = b.whole("shr", b.whole("add", bits, one - f.bits(math.sqrt(0.5))), f.mantissa)
    m = b.g.make(
        "unbits", (b.whole("add", b.whole("sub", bits, b.whole("shl", raised, f.mantissa)), one),), kind="real"
    )
    shift = 2.0**f.mantissa
    k = b.g.make("unbits", (b.whole("add", raised, f.bits(shift)),), kind="real")
    k = b.sub(k, b.where(small, shift + f.bias + f.up, shift + f.bias))
    return k, m


def _known_ends(b: Builder, x: Node, value: Node) -> Node:
    """A logarithm of 0, of what is below it, and of what is not finite."""
    value = b.where(b.less(x, math.inf), value, x)
    out = b.where(b.g.make("eq", (x, b.n(0.0))), -math.inf, math.nan)
    return b.where(b.less(0.0, x), value, out)


def _log(b: Builder, x: Node) -> Node:
    k, m = _split(b, x)
    f = b.sub(m, 1.0)
    s = b.div(f, b.add(f, 2.0))
    z = b.mul(s, s)
    rest = b.mul(z, b.series(z, LOG[: b.form.log_terms]))
    half = b.mul(b.mul(0.5, f), f)
    low = b.fma(s, b.add(half, rest), b.mul(k, b.form.ln2_low))
    return _known_ends(b, x, b.sub(b.mul(k, b.form.ln2_high), b.sub(b.sub(half, low), f)))


def _log1p(b: Builder, x: Node) -> Node:
    u = b.add(x, 1.0)
    lost = b.sub(x, b.sub(u, 1.0))
    value = b.add(_log(b, u), b.div(lost, u))
    return b.where(b.g.make("eq", (u, b.n(0.0))), -math.inf, b.where(b.less(x, math.inf), value, x))


def _pow(b: Builder, x: Node, y: Node) -> Node:
    """Compute the power by a logarithm with twice the digits, so that large exponents cost no accuracy."""
    k, m = _split(b, x)
    f = b.sub(m, 1.0)
    over = b.add(f, 2.0)
    s = b.div(f, over)
    # f = s over + left; 2 + f loses nothing that matters beyond `missed`
    missed = b.sub(f, b.sub(over, 2.0))
    left = b.div(b.sub(b.fma(b.sub(0.0, s), over, f), b.mul(s, missed)), over)
    z = b.mul(s, s)
    tail = b.mul(b.mul(s, z), b.series(z, LOG[: b.form.log_terms]))
    high = b.mul(2.0, s)
    low = b.add(b.mul(2.0, left), tail)
    whole = b.mul(k, b.form.ln2_high)  # exact: the constant ends in zeros
    total = b.add(whole, high)
    low = b.add(b.add(b.sub(b.sub(whole, total), b.sub(0.0, high)), low), b.mul(k, b.form.ln2_low))
    most = b.add(total, low)
    low = b.add(b.sub(total, most), low)
    total = most
    product = b.mul(y, total)
    rest = b.fma(y, low, b.fma(y, total, b.sub(0.0, product)))
    value = _exp(b, product, b.where(b.less(b.g.make("abs", (product,)), 800.0), rest, 0.0))
    zero = b.where(b.less(0.0, y), 0.0, b.where(b.less(y, 0.0), math.inf, 1.0))
    endless = b.where(b.less(0.0, y), math.inf, b.where(b.less(y, 0.0), 0.0, 1.0))
    value = b.where(b.less(x, math.inf), value, b.where(b.less(0.0, x), endless, math.nan))
    value = b.where(b.less(x, 0.0), math.nan, value)
    return b.where(b.g.make("eq", (x, b.n(0.0))), zero, value)


def _half_power(b: Builder, x: Node, y: Node) -> Node | None:
    """A power of 0.5, -0.5 or 1.5 by the root, to rounding (that of -inf is NaN); None for others."""
    if b.g.exact or y.op != "const" or y.attr not in (0.5, -0.5, 1.5):
        return None
    root = b.g.make("sqrt", (x,))
    return root if y.attr == 0.5 else b.div(1.0, root) if y.attr == -0.5 else b.mul(x, root)


def _sine(b: Builder, x: Node, quarter: int) -> Node:
    """sin(x + quarter pi/2)."""
    q = b.g.make("round", (b.mul(x, 2.0 / math.pi),))
    r = x
    for part in HALF_PI[: 4 if b.form.mantissa == 52 else 3]:
        r = b.fma(q, -part, r)
    z = b.mul(r, r)
    odd = b.series(z, [(-1.0) ** j / math.factorial(2 * j + 1) for j in range(1, 9)])
    even = b.series(z, [(-1.0) ** j / math.factorial(2 * j) for j in range(2, 10)])
    sine = b.fma(b.mul(r, z), odd, r)
    cosine = b.fma(b.mul(z, z), even, b.fma(z, -0.5, 1.0))
    turn = b.whole("add", b.low_bits(q), quarter)
    swapped = b.g.make("eq", (b.whole("iand", turn, 1), b.i(1)))
    minus = b.g.make("eq", (b.whole("iand", turn, 2), b.i(2)))
    value = b.where(swapped, cosine, sine)
    return b.where(minus, b.g.make("neg", (value,)), value)


def expand_elementary(real: str) -> RewriteRule:
    """The rule of `rewrite` that puts arithmetic in the place of functions, for ``double`` or ``float``."""
    form = Format(real)

    def rule(graph: Graph, node: Node, args: tuple[Node, ...]) -> Node | None:
        if node.op not in ("exp", "expm1", "log", "log1p", "pow", "sin", "cos"):
            return None
        if all(a.op == "const" for a in args):
            return None
        b = Builder(graph, form)
        if node.op == "pow":
            return _half_power(b, *args) or _pow(b, *args)
        if node.op in ("sin", "cos"):
            return _sine(b, args[0], int(node.op == "cos"))
        known = {"exp": _exp, "expm1": _expm1, "log": _log, "log1p": _log1p}
        return known[node.op](b, args[0])

    return rule
