"""The operations of a graph in LLVM assembly, on numbers or on vectors alike, and the text of a kernel while it grows.

Mode ``fast`` on processors with AVX-512 takes reciprocals and roots from the processor's estimates of 14 bits. Newton's
iteration doubles the bits: twice in float64, once in float32. Errors are one or two units in the last place. Given up: the
reciprocal of 0 or of an infinity, and the root of an infinity, are NaN; roots of numbers below 1e-290 (1e-30 in float32) are
wrong by up to that root.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from ._analysis import Divergence, Schedule, enclosing_buffers
from ._graph import Buffer, Graph, Node, Store
from .errors import LoweringError

# ---- names, types and memory


class Text:
    """The text while it grows, and the names of the values in it."""

    def __init__(
        self, graph: Graph, plan: Schedule, divergence: Divergence, *, width: int, real: str, estimates: bool
    ) -> None:
        self.graph, self.plan, self.divergence, self.width, self.real = graph, plan, divergence, width, real
        self.estimates = estimates
        self.inverted: dict[Node, list[str]] = {}
        self.lines: list[str] = []
        self.before: list[str] = []  # once per call, what all lanes share
        self.names: dict[Node, str] = {}
        self.shared: set[Node] = set()  # made once per call
        self.splats: dict[Node, str] = {}
        self.declared: set[str] = set()
        self.globals: list[str] = []
        self.steps: dict[Node, int] = {}  # of the loop that does several trips at once, see `WideLoop`
        self.label, self.begun = "block", 0  # the block that grows, and the line after which it began
        self.count = 0
        self.external = [b for b in graph.buffers if b.role in ("argument", "result") and b in plan.live.buffers]
        self.bases: dict[Buffer, str] = {}
        self.scratch = 0
        self.uniforms: dict[Node, str] | None = None  # what all lanes share, where a function of its own makes it

    def fresh(self) -> str:
        """A name that nothing has yet."""
        self.count += 1
        return f"%v{self.count}"

    def emit(self, text: str) -> str:
        """A line that makes a value; returns its name."""
        name = self.fresh()
        self.lines.append(f"  {name} = {text}")
        return name

    def type(self, kind: str, vector: bool) -> str:
        """The type of a value."""
        one = {"real": self.real, "int": "i64", "bool": "i1"}[kind]
        if not vector:
            return one
        return f"<{self.width} x {'i32' if kind == 'int' and self.real == 'float' else one}>"

    def type_of(self, node: Node) -> str:
        """The type of a node's value."""
        return self.type(node.kind, node in self.divergence.nodes)

    def literal(self, node: Node, vector: bool) -> str:
        """A constant."""
        if node.kind == "real":
            text = number(node.attr, self.real)
        else:
            text = str(node.attr).lower() if node.kind == "bool" else str(node.attr)
        one = self.type(node.kind, vector)
        return f"splat ({one[one.index('x') + 2 : -1]} {text})" if vector else text

    def name(self, node: Node, vector: bool) -> str:
        """A value, repeated in all lanes where a vector is wanted of what all share."""
        if node.op == "const" and not (vector and self._shares_long(node)):
            return self.literal(node, vector)
        if not vector or node in self.divergence.nodes:
            return self.names[node]
        if node not in self.splats:
            name = self.splat(self.names[node], node.kind)
            if node in self.steps:
                kind, one = self.type("int", True), "i32" if self.real == "float" else "i64"
                name = self.emit(f"add {kind} {name}, {counted(self.width, self.steps[node], one)}")
            self.splats[node] = name
        return self.splats[node]

    def _shares_long(self, node: Node) -> bool:
        """Put a constant of which an instruction of a GPU has no room for the lower half among what all lanes share."""
        if self.uniforms is None or node.kind != "real" or self.real != "double":
            return False
        if int(number(node.attr), 16) & 0xFFFFFFFF == 0:
            return False
        if node not in self.uniforms:
            self.uniforms[node] = self.literal(node, False)
            self.names[node] = f"%long{len(self.uniforms)}"
        return True

    def splat(self, name: str, kind: str) -> str:
        """A number in all lanes."""
        whole = self.type(kind, True)
        one = whole[whole.index("x") + 2 : -1]
        if one == "i32":
            name = self.emit(f"trunc i64 {name} to i32")
        first = self.emit(f"insertelement {whole} poison, {one} {name}, i64 0")
        return self.emit(f"shufflevector {whole} {first}, {whole} poison, <{self.width} x i32> zeroinitializer")

    def intrinsic(self, name: str, result: str, *arguments: tuple[str, str]) -> str:
        """A call of one of LLVM's own functions; arguments are (type, value)."""
        self.declared.add(f"declare {result} @{name}({', '.join(t for t, _ in arguments)})")
        return self.emit(f"call {result} @{name}({', '.join(f'{t} {v}' for t, v in arguments)})")


class Memory(Text):
    """Text that reads and writes memory."""

    def differs(self, buffer: Buffer) -> bool:
        """Whether a buffer has a value per lane."""
        return buffer in self.divergence.buffers

    def base(self, buffer: Buffer) -> str:
        """Start of a buffer, for this block of lanes."""
        return self.bases[buffer]

    def place(self, buffer: Buffer, index: Node | None, scale: int, offset: int) -> tuple[Buffer, str, bool]:
        """The buffer that holds an element, its number there, and whether that is a vector."""
        vector = index is not None and (
            index in self.divergence.nodes or (index in self.steps and self.steps[index] * scale != 1)
        )
        terms: list[str] = []
        if index is not None:
            terms.append(self._times(self._wide(index) if vector else self.name(index, False), scale, vector))
        while buffer.within is not None:
            buffer, more, loop, by = buffer.within
            offset += more
            if loop is not None and by:
                term = self._times(self.names[loop.index], by, False)
                terms.append(self.splat_wide(term) if vector else term)
        kind = f"<{self.width} x i64>" if vector else "i64"
        total = terms[0] if terms else ""
        for term in terms[1:]:
            total = self.emit(f"add {kind} {total}, {term}")
        if not total:
            return buffer, str(offset), False
        if offset:
            total = self.emit(f"add {kind} {total}, {f'splat (i64 {offset})' if vector else offset}")
        return buffer, total, vector

    def _wide(self, node: Node) -> str:
        name = self.name(node, True)
        if self.real == "float":
            return self.emit(f"sext <{self.width} x i32> {name} to <{self.width} x i64>")
        return name

    def splat_wide(self, name: str) -> str:
        """An i64 in all lanes."""
        whole = f"<{self.width} x i64>"
        first = self.emit(f"insertelement {whole} poison, i64 {name}, i64 0")
        return self.emit(f"shufflevector {whole} {first}, {whole} poison, <{self.width} x i32> zeroinitializer")

    def _times(self, name: str, by: int, vector: bool) -> str:
        if by == 1:
            return name
        kind = f"<{self.width} x i64>" if vector else "i64"
        return self.emit(f"mul {kind} {name}, {f'splat (i64 {by})' if vector else by}")

    def pointer(self, buffer: Buffer, index: Node | None, scale: int, offset: int) -> tuple[str, bool, bool]:
        """Address of an element: name, whether it is a vector of addresses, and whether lanes stand side by side there."""
        root, place, vector = self.place(buffer, index, scale, offset)
        one, many = self.memory(root.kind), self.differs(root)
        if vector:
            if many:
                place = self.emit(f"mul <{self.width} x i64> {place}, {self._stride(root, True)}")
                place = self.emit(f"add <{self.width} x i64> {place}, {counted(self.width)}")
            address = self.emit(f"getelementptr {one}, ptr {self.base(root)}, <{self.width} x i64> {place}")
            return address, True, False
        if many:
            if root.role == "scratch" and place.isdigit():
                place = str(int(place) * self.width)
            elif place != "0":
                place = self.emit(f"mul i64 {place}, {self._stride(root, False)}")
        if place == "0":
            return self.base(root), False, many
        return self.emit(f"getelementptr {one}, ptr {self.base(root)}, i64 {place}"), False, many

    def _stride(self, root: Buffer, vector: bool) -> str:
        if root.role == "scratch":
            return f"splat (i64 {self.width})" if vector else str(self.width)
        return "%strides" if vector else "%stride"

    def memory(self, kind: str) -> str:
        """LLVM type of a kind in memory."""
        return {"real": self.real, "int": "i64", "bool": "i8"}[kind]

    def load(self, node: Node) -> str:
        """Read an element."""
        buffer, scale, offset = node.attr
        index = node.args[0] if scale else None
        pointer, scattered, _ = self.pointer(buffer, index, scale, offset)
        one, vector = self.memory(node.kind), node in self.divergence.nodes
        size = 1 if one == "i8" else 4 if one == "float" else 8
        if scattered:
            whole = f"<{self.width} x {one}>"
            value = self._gather(pointer, node.kind, one, size)
        else:
            whole = f"<{self.width} x {one}>" if vector else one
            value = self.emit(f"load {whole}, ptr {pointer}, align {size}")
        if node.kind == "bool":
            return self.emit(f"trunc {whole} {value} to {self.type('bool', vector)}")
        if node.kind == "int" and vector and self.real == "float":
            return self.emit(f"trunc {whole} {value} to {self.type('int', True)}")
        return value

    def _gather(self, pointers: str, kind: str, one: str, size: int) -> str:
        """Read from an address per lane."""
        whole = f"<{self.width} x {one}>"
        name = f"llvm.masked.gather.v{self.width}{'f' if kind == 'real' else 'i'}{8 * size}.v{self.width}p0"
        rest = f"<{self.width} x i1> splat (i1 true), {whole} zeroinitializer"
        self.declared.add(f"declare {whole} @{name}(<{self.width} x ptr>, <{self.width} x i1>, {whole})")
        return self.emit(f"call {whole} @{name}(<{self.width} x ptr> align {size} {pointers}, {rest})")

    def store(self, store: Store) -> None:
        """Write an element."""
        pointer, scattered, many = self.pointer(store.buffer, store.index, store.scale, store.offset)
        if scattered:
            self._scatter(pointer, store)
        else:
            self.put(pointer, many or store.index in self.steps, store.value, store.adds)

    def _scatter(self, pointers: str, store: Store) -> None:
        """Write to an address per lane; no two lanes share one, since varying values are stored by lanes."""
        lanes = store.index in self.steps or self.differs(list(enclosing_buffers(store.buffer))[-1])
        if store.value.kind != "real" or not lanes:
            raise LoweringError("a store", "its place differs from lane to lane")
        one, name = self.real, self.name(store.value, True)
        size = 4 if one == "float" else 8
        whole, mask = f"<{self.width} x {one}>", f"<{self.width} x i1>"
        if store.adds:
            name = self.emit(f"fadd {whole} {self._gather(pointers, 'real', one, size)}, {name}")
        made = f"llvm.masked.scatter.v{self.width}f{8 * size}.v{self.width}p0"
        self.declared.add(f"declare void @{made}({whole}, <{self.width} x ptr>, {mask})")
        where = f"<{self.width} x ptr> align {size} {pointers}"
        self.lines.append(f"  call void @{made}({whole} {name}, {where}, {mask} splat (i1 true))")

    def put(self, pointer: str, many: bool, value: Node, adds: bool = False) -> None:
        """Write a value to an address, or add it to the present value."""
        one = self.memory(value.kind)
        name, whole = self.name(value, many), self.type(value.kind, many)
        inside = f"<{self.width} x {one}>" if many else one
        if value.kind == "bool":
            name = self.emit(f"zext {whole} {name} to {inside}")
        elif whole != inside:
            name = self.emit(f"sext {whole} {name} to {inside}")
        size = 1 if one == "i8" else 4 if one == "float" else 8
        if adds:
            old = self.emit(f"load {inside}, ptr {pointer}, align {size}")
            name = self.emit(f"fadd {inside} {old}, {name}")
        self.lines.append(f"  store {inside} {name}, ptr {pointer}, align {size}")


def number(value: float, real: str = "double") -> str:
    """A literal with all bits; of a float32 the double that it is."""
    if real == "float":
        value = struct.unpack(
            "f", struct.pack("f", max(min(value, 3.4e38), -3.4e38) if abs(value) != float("inf") else value)
        )[0]
    return f"0x{struct.unpack('Q', struct.pack('d', value))[0]:016X}"


def counted(width: int, step: int = 1, one: str = "i64") -> str:
    """The vector 0, 1, 2 .., each times a step."""
    return "<" + ", ".join(f"{one} {k * step}" for k in range(width)) + ">"


# ---- estimates of reciprocals and roots


def fits(width: int, real: str, bits: int) -> bool:
    """Whether vectors of a width are made of whole registers with estimates."""
    return bits == 512 and width & (width - 1) == 0 and width >= (8 if real == "double" else 16)


def reciprocal(body: Memory, d: str) -> str:
    """1/d."""
    kind = body.type("real", True)
    y, minus = _estimate(body, "rcp14", d), body.emit(f"fneg {kind} {d}")
    for _ in range(2 if body.real == "double" else 1):
        off = _fma(body, minus, y, _all(body, 1.0))
        y = _fma(body, y, off, y)
    return y


def root(body: Memory, x: str) -> str:
    """The square root, by Goldschmidt's form of the iteration; of what is below 0, NaN."""
    kind, truth = body.type("real", True), body.type("bool", True)
    tiny = _all(body, 1e-290 if body.real == "double" else 1e-30)
    small = body.emit(f"fcmp olt {kind} {x}, {tiny}")
    y = _estimate(body, "rsqrt14", body.emit(f"select {truth} {small}, {kind} {tiny}, {kind} {x}"))
    g, h = body.emit(f"fmul {kind} {x}, {y}"), body.emit(f"fmul {kind} {_all(body, 0.5)}, {y}")
    for _ in range(2 if body.real == "double" else 1):
        off = _fma(body, body.emit(f"fneg {kind} {h}"), g, _all(body, 0.5))
        g, h = _fma(body, g, off, g), _fma(body, h, off, h)
    below = body.emit(f"fcmp olt {kind} {x}, zeroinitializer")
    return body.emit(f"select {truth} {below}, {kind} {_all(body, float('nan'))}, {kind} {g}")


def _all(body: Memory, value: float) -> str:
    return f"splat ({body.real} {number(value, body.real)})"


def _fma(body: Memory, a: str, b: str, c: str) -> str:
    kind = body.type("real", True)
    name = f"llvm.fma.v{body.width}{'f64' if body.real == 'double' else 'f32'}"
    return body.intrinsic(name, kind, (kind, a), (kind, b), (kind, c))


def _estimate(body: Memory, what: str, x: str) -> str:
    """The processor's estimate, register by register."""
    lanes, short = (8, "pd") if body.real == "double" else (16, "ps")
    whole, part = body.type("real", True), f"<{lanes} x {body.real}>"
    registers = []
    for k in range(body.width // lanes):
        piece = x
        if body.width > lanes:
            mask = ", ".join(f"i32 {k * lanes + i}" for i in range(lanes))
            piece = body.emit(f"shufflevector {whole} {x}, {whole} poison, <{lanes} x i32> <{mask}>")
        name = f"llvm.x86.avx512.{what}.{short}.512"
        mask_type = f"i{lanes}"
        registers.append(body.intrinsic(name, part, (part, piece), (part, "zeroinitializer"), (mask_type, "-1")))
    size = lanes
    while len(registers) > 1:
        size *= 2
        mask = ", ".join(f"i32 {i}" for i in range(size))
        half = f"<{size // 2} x {body.real}>"
        registers = [
            body.emit(f"shufflevector {half} {a}, {half} {b}, <{size} x i32> <{mask}>")
            for a, b in zip(registers[::2], registers[1::2], strict=True)
        ]
    return registers[0]


# ---- operations


Op = Callable[[Memory, Node], str]
LLVM_OPS: dict[str, Op] = {}


def _op(*names: str) -> Callable[[Op], Op]:
    def registered(function: Op) -> Op:
        LLVM_OPS.update(dict.fromkeys(names, function))
        return function

    return registered


def _operands(body: Memory, node: Node) -> tuple[bool, str, list[str]]:
    """Whether it is done in vectors, the type of the first operand, and all operands."""
    vector = node in body.divergence.nodes
    return vector, body.type(node.args[0].kind, vector), [body.name(a, vector) for a in node.args]


BINARY = {
    "real": {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"},
    "int": {
        "add": "add",
        "sub": "sub",
        "mul": "mul",
        "quot": "sdiv",
        "rem": "srem",
        "shl": "shl",
        "shr": "lshr",
        "iand": "and",
    },
    "bool": {"and": "and", "or": "or", "xor": "xor"},
}
COMPARE = {"real": ("fcmp", {"lt": "olt", "le": "ole", "eq": "oeq", "ne": "une"}),
           "int": ("icmp", {"lt": "slt", "le": "sle", "eq": "eq", "ne": "ne"}),
           "bool": ("icmp", {"lt": "ult", "le": "ule", "eq": "eq", "ne": "ne"})}  # fmt: skip


@_op("add", "sub", "mul", "div", "quot", "rem", "shl", "shr", "iand", "and", "or", "xor")
def _binary(body: Memory, node: Node) -> str:
    vector, kind, (a, b) = _operands(body, node)
    if node.op == "div" and vector and body.estimates:
        return body.emit(f"fmul {kind} {a}, {reciprocal(body, b)}")
    return body.emit(f"{BINARY[node.kind][node.op]} {kind} {a}, {b}")


@_op("lt", "le", "eq", "ne")
def _compare(body: Memory, node: Node) -> str:
    _, kind, (a, b) = _operands(body, node)
    op, names = COMPARE[node.args[0].kind]
    return body.emit(f"{op} {names[node.op]} {kind} {a}, {b}")


@_op("not")
def _not(body: Memory, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    return body.emit(f"xor {kind} {a}, {'splat (i1 true)' if vector else 'true'}")


@_op("neg")
def _neg(body: Memory, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    if node.kind == "real":
        return body.emit(f"fneg {kind} {a}")
    return body.emit(f"sub {kind} {'zeroinitializer' if vector else '0'}, {a}")


@_op("select")
def _select(body: Memory, node: Node) -> str:
    vector = node in body.divergence.nodes
    c, a, b = node.args
    chosen = body.name(c, c in body.divergence.nodes)  # one condition for all lanes stays one
    truth, kind = body.type("bool", c in body.divergence.nodes), body.type(node.kind, vector)
    return body.emit(f"select {truth} {chosen}, {kind} {body.name(a, vector)}, {kind} {body.name(b, vector)}")


@_op("max", "min")
def _extreme(body: Memory, node: Node) -> str:
    vector, kind, (a, b) = _operands(body, node)
    most = node.op == "max"
    truth = body.type("bool", vector)
    if node.kind == "int":
        c = body.emit(f"icmp {'sgt' if most else 'slt'} {kind} {a}, {b}")
        return body.emit(f"select {truth} {c}, {kind} {a}, {kind} {b}")
    if node.args[0].op == "const":  # b is what may be NaN, and is taken if it is
        a, b = b, a
    better = body.emit(f"fcmp {'ogt' if most else 'olt'} {kind} {b}, {a}")
    value = body.emit(f"select {truth} {better}, {kind} {b}, {kind} {a}")
    if any(n.op == "const" for n in node.args):
        return value
    lost = body.emit(f"fcmp uno {kind} {b}, {b}")
    return body.emit(f"select {truth} {lost}, {kind} {b}, {kind} {value}")


ROOTS = {"sqrt": "sqrt", "abs": "fabs", "floor": "floor", "ceil": "ceil", "round": "roundeven", "fma": "fma"}


@_op("sqrt", "abs", "floor", "ceil", "round", "fma")
def _intrinsic(body: Memory, node: Node) -> str:
    vector, kind, operands = _operands(body, node)
    if node.kind == "int":
        less = body.emit(f"icmp slt {kind} {operands[0]}, {'zeroinitializer' if vector else '0'}")
        minus = body.emit(f"sub {kind} {'zeroinitializer' if vector else '0'}, {operands[0]}")
        return body.emit(f"select {body.type('bool', vector)} {less}, {kind} {minus}, {kind} {operands[0]}")
    if node.op == "sqrt" and vector and body.estimates:
        return root(body, operands[0])
    name = f"llvm.{ROOTS[node.op]}.{_suffix(body, vector)}"
    return body.intrinsic(name, kind, *((kind, v) for v in operands))


def _suffix(body: Memory, vector: bool) -> str:
    one = "f64" if body.real == "double" else "f32"
    return f"v{body.width}{one}" if vector else one


@_op("rcp")
def _rcp(body: Memory, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    if vector and body.estimates:
        return reciprocal(body, a)
    return body.emit(f"fdiv {kind} {_one(body, vector)}, {a}")


def _one(body: Memory, vector: bool) -> str:
    return f"splat ({body.real} 0x3FF0000000000000)" if vector else "0x3FF0000000000000"


@_op("item")
def _item(body: Memory, node: Node) -> str:
    item: str = body.inverted[node.args[0]][node.attr]
    return item


@_op("invert")
def _invert(body: Memory, node: Node) -> str:
    """Reciprocals with one division; where their product is not a normal number, each by itself."""
    vector, kind, d = _operands(body, node)
    if vector and body.estimates:
        body.inverted[node] = [reciprocal(body, x) for x in d]
        return ""
    products = [d[0]]
    for x in d[1:]:
        products.append(body.emit(f"fmul {kind} {products[-1]}, {x}"))
    left, reciprocals = body.emit(f"fdiv {kind} {_one(body, vector)}, {products[-1]}"), [""] * len(d)
    for k in range(len(d) - 1, 0, -1):
        reciprocals[k] = body.emit(f"fmul {kind} {left}, {products[k - 1]}")
        left = body.emit(f"fmul {kind} {left}, {d[k]}")
    reciprocals[0] = left
    truth, name = body.type("bool", vector), f"llvm.is.fpclass.{_suffix(body, vector)}"
    body.declared.add(f"declare {truth} @{name}({kind}, i32 immarg)")
    odd = body.emit(f"call {truth} @{name}({kind} {products[-1]}, i32 {NOT_NORMAL})")
    body.inverted[node] = _one_by_one(body, odd, vector, kind, d, reciprocals)
    return ""


NOT_NORMAL = 0x2F7  # of LLVM's classes of numbers all but those of normal ones


def _one_by_one(body: Memory, odd: str, vector: bool, kind: str, d: list[str], lines: list[str]) -> list[str]:
    """Past a branch that is hardly ever taken: the reciprocals where `odd` is not true, and divisions where it is."""
    some = odd
    if vector:
        name, truth = f"llvm.vector.reduce.or.v{body.width}i1", f"<{body.width} x i1>"
        some = body.intrinsic(name, "i1", (truth, odd))
    body.count += 1
    key, label = body.count, body.label
    body.lines += [f"  br i1 {some}, label %odd{key}, label %even{key}, !prof !0", f"odd{key}:"]
    blended = []
    for x, value in zip(d, lines, strict=True):
        divided = body.emit(f"fdiv {kind} {_one(body, vector)}, {x}")
        blended.append(body.emit(f"select {body.type('bool', vector)} {odd}, {kind} {divided}, {kind} {value}"))
    body.lines += [f"  br label %even{key}", f"even{key}:"]
    body.label = f"even{key}"
    pairs = zip(lines, blended, strict=True)
    return [body.emit(f"phi {kind} [ {a}, %{label} ], [ {b}, %odd{key} ]") for a, b in pairs]


@_op("real")
def _real(body: Memory, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    op = "uitofp" if node.args[0].kind == "bool" else "sitofp"
    return body.emit(f"{op} {kind} {a} to {body.type('real', vector)}")


@_op("int")
def _int(body: Memory, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    whole = body.type("int", vector)
    if node.args[0].kind == "bool":
        return body.emit(f"zext {kind} {a} to {whole}")
    bits = "i32" if "i32" in whole else "i64"
    suffix = f"v{body.width}{bits}" if vector else bits
    return body.intrinsic(f"llvm.fptosi.sat.{suffix}.{_suffix(body, vector)}", whole, (kind, a))


@_op("bits", "unbits")
def _bits(body: Memory, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    whole = body.type(node.kind, vector)
    if vector or body.real == "double":
        return body.emit(f"bitcast {kind} {a} to {whole}")
    if node.op == "bits":  # a single whole number has 64 bits, a float32 has 32
        return body.emit(f"sext i32 {body.emit(f'bitcast float {a} to i32')} to i64")
    return body.emit(f"bitcast i32 {body.emit(f'trunc i64 {a} to i32')} to float")
