"""The text of a kernel while it grows: names and types of its values, and its memory."""

from __future__ import annotations

import struct

from ...errors import LoweringError
from .graph import Buffer, Graph, Node, Store
from .rewrite import roots
from .schedule import Schedule
from .varying import Varying


class Text:
    """The text while it grows, and the names of the values in it."""

    def __init__(self, graph: Graph, plan: Schedule, vary: Varying, *, width: int, real: str, estimates: bool) -> None:
        self.graph, self.plan, self.vary, self.width, self.real = graph, plan, vary, width, real
        self.estimates = estimates
        self.inverted: dict[Node, list[str]] = {}
        self.lines: list[str] = []
        self.before: list[str] = []  # once per call, what all lanes share
        self.names: dict[Node, str] = {}
        self.shared: set[Node] = set()  # made once per call
        self.splats: dict[Node, str] = {}
        self.declared: set[str] = set()
        self.globals: list[str] = []
        self.label, self.begun = "block", 0  # the block that grows, and the line after which it began
        self.count = 0
        self.external = [b for b in graph.buffers if b.role in ("argument", "result") and b in plan.live.buffers]
        self.bases: dict[Buffer, str] = {}
        self.scratch = 0

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
        return self.type(node.kind, node in self.vary.nodes)

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
        if node.op == "const":
            return self.literal(node, vector)
        if not vector or node in self.vary.nodes:
            return self.names[node]
        if node not in self.splats:
            self.splats[node] = self.splat(self.names[node], node.kind)
        return self.splats[node]

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
        return buffer in self.vary.buffers

    def base(self, buffer: Buffer) -> str:
        """Where a buffer begins, for this block of lanes."""
        return self.bases[buffer]

    def place(self, buffer: Buffer, index: Node | None, scale: int, offset: int) -> tuple[Buffer, str, bool]:
        """The buffer that holds an element, its number there, and whether that is a vector."""
        vector = index is not None and index in self.vary.nodes
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
            found = self.emit(f"getelementptr {one}, ptr {self.base(root)}, <{self.width} x i64> {place}")
            return found, True, False
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
        """How a kind stands in memory."""
        return {"real": self.real, "int": "i64", "bool": "i8"}[kind]

    def load(self, node: Node) -> str:
        """Read an element."""
        buffer, scale, offset = node.attr
        index = node.args[0] if scale else None
        pointer, scattered, _ = self.pointer(buffer, index, scale, offset)
        one, vector = self.memory(node.kind), node in self.vary.nodes
        size = 1 if one == "i8" else 4 if one == "float" else 8
        if scattered:
            whole = f"<{self.width} x {one}>"
            found = self._gather(pointer, node.kind, one, size)
        else:
            whole = f"<{self.width} x {one}>" if vector else one
            found = self.emit(f"load {whole}, ptr {pointer}, align {size}")
        if node.kind == "bool":
            return self.emit(f"trunc {whole} {found} to {self.type('bool', vector)}")
        if node.kind == "int" and vector and self.real == "float":
            return self.emit(f"trunc {whole} {found} to {self.type('int', True)}")
        return found

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
            self.put(pointer, many, store.value, store.adds)

    def _scatter(self, pointers: str, store: Store) -> None:
        """Write to an address per lane; no two lanes have an address in common, for what differs stands apart by lanes."""
        if store.value.kind != "real" or not self.differs(list(roots(store.buffer))[-1]):
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
        """Write a value to an address, or add it to what is there."""
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


def counted(width: int) -> str:
    """The vector 0, 1, 2 .."""
    return "<" + ", ".join(f"i64 {k}" for k in range(width)) + ">"
