"""The operations of a graph in LLVM assembly, on numbers or on vectors alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from .graph import Node
from .llvm_estimates import reciprocal, root

if TYPE_CHECKING:
    from .emit_llvm import Body

Op = Callable[["Body", Node], str]
LLVM_OPS: dict[str, Op] = {}


def _op(*names: str) -> Callable[[Op], Op]:
    def registered(function: Op) -> Op:
        LLVM_OPS.update(dict.fromkeys(names, function))
        return function

    return registered


def _operands(body: Body, node: Node) -> tuple[bool, str, list[str]]:
    """Whether it is done in vectors, the type of the first operand, and all operands."""
    vector = node in body.vary.nodes
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
def _binary(body: Body, node: Node) -> str:
    vector, kind, (a, b) = _operands(body, node)
    if node.op == "div" and vector and body.estimates:
        return body.emit(f"fmul {kind} {a}, {reciprocal(body, b)}")
    return body.emit(f"{BINARY[node.kind][node.op]} {kind} {a}, {b}")


@_op("lt", "le", "eq", "ne")
def _compare(body: Body, node: Node) -> str:
    _, kind, (a, b) = _operands(body, node)
    op, names = COMPARE[node.args[0].kind]
    return body.emit(f"{op} {names[node.op]} {kind} {a}, {b}")


@_op("not")
def _not(body: Body, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    return body.emit(f"xor {kind} {a}, {'splat (i1 true)' if vector else 'true'}")


@_op("neg")
def _neg(body: Body, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    if node.kind == "real":
        return body.emit(f"fneg {kind} {a}")
    return body.emit(f"sub {kind} {'zeroinitializer' if vector else '0'}, {a}")


@_op("select")
def _select(body: Body, node: Node) -> str:
    vector = node in body.vary.nodes
    c, a, b = node.args
    chosen = body.name(c, c in body.vary.nodes)  # one condition for all lanes stays one
    truth, kind = body.type("bool", c in body.vary.nodes), body.type(node.kind, vector)
    return body.emit(f"select {truth} {chosen}, {kind} {body.name(a, vector)}, {kind} {body.name(b, vector)}")


@_op("max", "min")
def _extreme(body: Body, node: Node) -> str:
    vector, kind, (a, b) = _operands(body, node)
    most = node.op == "max"
    truth = body.type("bool", vector)
    if node.kind == "int":
        c = body.emit(f"icmp {'sgt' if most else 'slt'} {kind} {a}, {b}")
        return body.emit(f"select {truth} {c}, {kind} {a}, {kind} {b}")
    if node.args[0].op == "const":  # b is what may be NaN, and is taken if it is
        a, b = b, a
    better = body.emit(f"fcmp {'ogt' if most else 'olt'} {kind} {b}, {a}")
    found = body.emit(f"select {truth} {better}, {kind} {b}, {kind} {a}")
    if any(n.op == "const" for n in node.args):
        return found
    lost = body.emit(f"fcmp uno {kind} {b}, {b}")
    return body.emit(f"select {truth} {lost}, {kind} {b}, {kind} {found}")


ROOTS = {"sqrt": "sqrt", "abs": "fabs", "floor": "floor", "ceil": "ceil", "round": "roundeven", "fma": "fma"}


@_op("sqrt", "abs", "floor", "ceil", "round", "fma")
def _intrinsic(body: Body, node: Node) -> str:
    vector, kind, operands = _operands(body, node)
    if node.kind == "int":
        less = body.emit(f"icmp slt {kind} {operands[0]}, {'zeroinitializer' if vector else '0'}")
        minus = body.emit(f"sub {kind} {'zeroinitializer' if vector else '0'}, {operands[0]}")
        return body.emit(f"select {body.type('bool', vector)} {less}, {kind} {minus}, {kind} {operands[0]}")
    if node.op == "sqrt" and vector and body.estimates:
        return root(body, operands[0])
    name = f"llvm.{ROOTS[node.op]}.{_suffix(body, vector)}"
    return body.intrinsic(name, kind, *((kind, v) for v in operands))


def _suffix(body: Body, vector: bool) -> str:
    one = "f64" if body.real == "double" else "f32"
    return f"v{body.width}{one}" if vector else one


@_op("rcp")
def _rcp(body: Body, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    return _reciprocal(body, vector, kind, a)


def _reciprocal(body: Body, vector: bool, kind: str, d: str) -> str:
    if vector and body.estimates:
        return reciprocal(body, d)
    return body.emit(f"fdiv {kind} {_one(body, vector)}, {d}")


def _one(body: Body, vector: bool) -> str:
    return f"splat ({body.real} 0x3FF0000000000000)" if vector else "0x3FF0000000000000"


@_op("item")
def _item(body: Body, node: Node) -> str:
    return body.inverted[node.args[0]][node.attr]


@_op("invert")
def _invert(body: Body, node: Node) -> str:
    """Reciprocals with one division; where their product is not a normal number, each by itself."""
    vector, kind, d = _operands(body, node)
    if vector and body.estimates:
        body.inverted[node] = [reciprocal(body, x) for x in d]
        return ""
    products = [d[0]]
    for x in d[1:]:
        products.append(body.emit(f"fmul {kind} {products[-1]}, {x}"))
    left, found = body.emit(f"fdiv {kind} {_one(body, vector)}, {products[-1]}"), [""] * len(d)
    for k in range(len(d) - 1, 0, -1):
        found[k] = body.emit(f"fmul {kind} {left}, {products[k - 1]}")
        left = body.emit(f"fmul {kind} {left}, {d[k]}")
    found[0] = left
    truth, name = body.type("bool", vector), f"llvm.is.fpclass.{_suffix(body, vector)}"
    body.declared.add(f"declare {truth} @{name}({kind}, i32 immarg)")
    odd = body.emit(f"call {truth} @{name}({kind} {products[-1]}, i32 {NOT_NORMAL})")
    body.inverted[node] = _one_by_one(body, odd, vector, kind, d, found)
    return ""


NOT_NORMAL = 0x2F7  # of LLVM's classes of numbers all but those of normal ones


def _one_by_one(body: Body, odd: str, vector: bool, kind: str, d: list[str], found: list[str]) -> list[str]:
    """Past a branch that is hardly ever taken: the reciprocals where `odd` is not true, and divisions where it is."""
    some = odd
    if vector:
        name, truth = f"llvm.vector.reduce.or.v{body.width}i1", f"<{body.width} x i1>"
        some = body.intrinsic(name, "i1", (truth, odd))
    body.count += 1
    key, here = body.count, body.label
    body.lines += [f"  br i1 {some}, label %odd{key}, label %even{key}, !prof !0", f"odd{key}:"]
    blended = []
    for x, value in zip(d, found, strict=True):
        divided = body.emit(f"fdiv {kind} {_one(body, vector)}, {x}")
        blended.append(body.emit(f"select {body.type('bool', vector)} {odd}, {kind} {divided}, {kind} {value}"))
    body.lines += [f"  br label %even{key}", f"even{key}:"]
    body.label = f"even{key}"
    pairs = zip(found, blended, strict=True)
    return [body.emit(f"phi {kind} [ {a}, %{here} ], [ {b}, %odd{key} ]") for a, b in pairs]


@_op("real")
def _real(body: Body, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    op = "uitofp" if node.args[0].kind == "bool" else "sitofp"
    return body.emit(f"{op} {kind} {a} to {body.type('real', vector)}")


@_op("int")
def _int(body: Body, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    whole = body.type("int", vector)
    if node.args[0].kind == "bool":
        return body.emit(f"zext {kind} {a} to {whole}")
    bits = "i32" if "i32" in whole else "i64"
    suffix = f"v{body.width}{bits}" if vector else bits
    return body.intrinsic(f"llvm.fptosi.sat.{suffix}.{_suffix(body, vector)}", whole, (kind, a))


@_op("bits", "unbits")
def _bits(body: Body, node: Node) -> str:
    vector, kind, (a,) = _operands(body, node)
    whole = body.type(node.kind, vector)
    if vector or body.real == "double":
        return body.emit(f"bitcast {kind} {a} to {whole}")
    if node.op == "bits":  # a single whole number has 64 bits, a float32 has 32
        return body.emit(f"sext i32 {body.emit(f'bitcast float {a} to i32')} to i64")
    return body.emit(f"bitcast i32 {body.emit(f'trunc i64 {a} to i32')} to float")
