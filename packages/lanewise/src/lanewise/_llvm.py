"""A scheduled graph as LLVM assembly: lanes as the lanes of vectors, loops as loops, one function.

A run without lanes does several trips of a loop at once where they do not wait for each other, see `find_wide_loops`.

    void kernel(ptr pointers, i64 stride, i64 first, i64 last)

does the blocks of lanes first .. last-1, each `width` lanes wide. `pointers` holds the address of each argument and result
in the order of `Layout.external`, then that of the scratch memory. What is one value for all lanes stands in memory as it
is; what differs has `stride` lanes side by side for each of its elements. Whole numbers are 64 bits, truth values bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from ._analysis import Divergence, Entry, Schedule, WideLoop, find_wide_loops
from ._graph import Buffer, Graph, Loop, Node, Store
from ._llvm_text import LLVM_OPS, Memory, number

LONGEST = 4000  # lines of a block: LLVM's time for one grows faster than its length


class Layout(NamedTuple):
    """Memory that a caller of the kernel must provide.

    Attributes:
        external: buffers of arguments and results whose addresses it gets.
        scratch: bytes of scratch memory per thread.
        width: lanes per block.
    """

    external: list[Buffer]
    scratch: int
    width: int


class Body(Memory):
    """Text in the order of a schedule."""

    wide: dict[Loop, WideLoop] = {}  # loops that do several trips at once

    def entries(self, entries: list[Entry], root: bool = False) -> None:
        """Write a block."""
        for entry in entries:
            # a branch that is never taken parts a block that has become too long
            if len(self.lines) - self.begun > LONGEST:
                self.count += 1
                self.label = f"more{self.count}"
                self.lines += [f"  br i1 %never, label %out, label %{self.label}", f"{self.label}:"]
                self.begun = len(self.lines)
            if isinstance(entry, Store):
                self.store(entry)
            elif isinstance(entry, Loop):
                self.loop(entry)
            elif root and self._once(entry):
                kept, self.lines = self.lines, self.before
                self.node(entry)
                self.shared.add(entry)
                self.lines = kept
            else:
                self.node(entry)

    def _once(self, node: Node) -> bool:
        """Whether a node of the outermost block can be made once for all lanes."""
        if node in self.divergence.nodes or node.op == "table":
            return False
        return all(a.op == "const" or a in self.shared for a in node.args)

    def node(self, node: Node) -> None:
        """Write one node."""
        if node.op == "load":
            self.names[node] = self.load(node)
        elif node.op == "table":
            for k, value in enumerate(node.args):
                pointer, _, many = self.pointer(node.attr, None, 0, k)
                self.put(pointer, many, value)
        else:
            self.names[node] = LLVM_OPS[node.op](self, node)

    def loop(self, loop: Loop) -> None:
        """Write a loop and name what it leaves behind."""
        width = self.width
        if loop in self.wide:
            self.width, self.steps = self.wide[loop].width, self.wide[loop].steps
        self._loop(loop)
        self.width, self.steps = width, {}

    def _in_order(self, wide: WideLoop, loop: Loop) -> None:
        """Write what depends on carried values, for one trip after the other."""
        places = self.plan.live.carried[loop]
        operands = list(dict.fromkeys(a for n in wide.serial for a in n.args if a in wide.vectors))
        outer = {a: self.names[a] for a in operands}
        for trip in range(self.width):
            for a in operands:
                self.names[a] = self.emit(f"extractelement {self.type('real', True)} {outer[a]}, i64 {trip}")
            for node in wide.serial:
                self.names[node] = LLVM_OPS[node.op](self, node)
            if trip < self.width - 1:
                nexts = [self.name(loop.nexts[k], False) for k in places]
                for k, name in zip(places, nexts, strict=True):
                    self.names[loop.phis[k]] = name
        self.names.update(outer)

    def _loop(self, loop: Loop) -> None:
        wide = self.wide.get(loop)
        key, places, sure = loop.serial, self.plan.live.carried[loop], isinstance(loop.trips, int)
        phis = [loop.phis[k] for k in places]
        inits = [self.name(loop.inits[k], p in self.divergence.nodes) for k, p in zip(places, phis, strict=True)]
        start, trips = self.label, str(loop.trips) if isinstance(loop.trips, int) else self.name(loop.trips, False)
        if sure:
            self.lines.append(f"  br label %loop{key}")
        else:
            any_trip = self.emit(f"icmp sgt i64 {trips}, 0")
            self.lines.append(f"  br i1 {any_trip}, label %loop{key}, label %past{key}")
        self.lines.append(f"loop{key}:")
        self.label, self.begun = f"loop{key}", len(self.lines)
        index, head = f"%i{key}", len(self.lines)
        self.names[loop.index] = index
        for phi in phis:
            self.names[phi] = self.fresh()
        outside = dict(self.splats)
        tops = [self.names[phi] for phi in phis]
        if wide is None:
            self.entries(self.plan.bodies[loop])
        else:
            serial = set(wide.serial)
            self.entries([entry for entry in self.plan.bodies[loop] if entry not in serial])
            self._in_order(wide, loop)
        nexts = [self.name(loop.nexts[k], p in self.divergence.nodes) for k, p in zip(places, phis, strict=True)]
        latch = self.label
        top = [f"  {index} = phi i64 [ 0, %{start} ], [ {index}n, %{latch} ]"]
        for phi, first, init, after in zip(phis, tops, inits, nexts, strict=True):
            top.append(f"  {first} = phi {self.type_of(phi)} [ {init}, %{start} ], [ {after}, %{latch} ]")
        self.lines[head:head] = top
        self.lines.append(f"  {index}n = add nuw nsw i64 {index}, {1 if wide is None else self.width}")
        again = self.emit(f"icmp slt i64 {index}n, {trips}")
        self.lines.append(f"  br i1 {again}, label %loop{key}, label %past{key}")
        self.lines.append(f"past{key}:")
        self.label, self.splats, self.begun = f"past{key}", outside, len(self.lines)
        for k, phi, init, after in zip(places, phis, inits, nexts, strict=True):
            name = after if sure else self.emit(f"phi {self.type_of(phi)} [ {init}, %{start} ], [ {after}, %{latch} ]")
            self.names[self.graph.end(loop, k)] = name


def emit(
    graph: Graph,
    plan: Schedule,
    divergence: Divergence,
    *,
    width: int,
    real: str = "double",
    features: str = "",
    estimates: bool = False,
    vector: int = 0,
) -> tuple[str, Layout]:
    """The text of a kernel, and what its caller brings; estimates are for mode ``fast``, see `_llvm_text`.

    `vector` is the number of trips of a loop that stand in a vector of a run without lanes, 0 for none.
    """
    body = Body(graph, plan, divergence, width=width, real=real, estimates=estimates)
    if vector:
        wide = find_wide_loops(plan, vector)
        nodes = divergence.nodes.union(*(w.vectors for w in wide.values()))
        body.divergence, body.wide = divergence._replace(nodes=nodes), wide
    head: list[str] = []
    _memory(body, head)
    body.entries(plan.root, root=True)
    # what stands outside of loops is parted in the same way; the block that loops back to names the last part
    lines = [*head, *body.before]
    once, entry = lines[:LONGEST], "entry"
    for k in range(LONGEST, len(lines), LONGEST):
        entry = f"once{k}"
        once += [f"  br i1 %never, label %out, label %{entry}", f"{entry}:", *lines[k : k + LONGEST]]
    text = [
        *body.globals,
        f"define void @kernel(ptr noalias %pointers, i64 %stride, i64 %first, i64 %last) {features}{{",
        "entry:",
        "  %never = icmp slt i64 %stride, 0",
        *once,
        "  br label %block",
        "block:",
        f"  %number = phi i64 [ %first, %{entry} ], [ %more, %{body.label} ]",
        f"  %lane = mul i64 %number, {width}",
        *[
            f"  %lanes{k} = getelementptr {body.memory(b.kind)}, ptr %base{k}, i64 %lane"
            for k, b in enumerate(body.external)
            if body.differs(b)
        ],
        *body.lines,
        "  %more = add i64 %number, 1",
        "  %again = icmp slt i64 %more, %last",
        "  br i1 %again, label %block, label %out",
        "out:",
        "  ret void",
        "}",
        *sorted(body.declared),
        '!0 = !{!"branch_weights", i32 1, i32 100000}',
    ]
    return "\n".join(text) + "\n", Layout(body.external, body.scratch, width)


def _memory(body: Body, head: list[str]) -> None:
    """Addresses of all buffers."""
    if any(n.op == "load" and n.attr[1] and n.args[0] in body.divergence.nodes for n in body.plan.live.nodes):
        whole = f"<{body.width} x i64>"
        head.append(f"  %stride1 = insertelement {whole} poison, i64 %stride, i64 0")
        head.append(
            f"  %strides = shufflevector {whole} %stride1, {whole} poison, <{body.width} x i32> zeroinitializer"
        )
    for k, buffer in enumerate(body.external):
        head.append(f"  %at{k} = getelementptr ptr, ptr %pointers, i64 {k}")
        head.append(f"  %base{k} = load ptr, ptr %at{k}, align 8")
        body.bases[buffer] = f"%lanes{k}" if body.differs(buffer) else f"%base{k}"
    head.append(f"  %atscratch = getelementptr ptr, ptr %pointers, i64 {len(body.external)}")
    head.append("  %scratch = load ptr, ptr %atscratch, align 8")
    for buffer in sorted(body.plan.live.buffers, key=lambda b: b.serial):
        if buffer.role == "scratch" and buffer.within is None:
            one = 1 if buffer.kind == "bool" else 4 if buffer.kind == "real" and body.real == "float" else 8
            head.append(f"  %s{buffer.serial} = getelementptr i8, ptr %scratch, i64 {body.scratch}")
            body.bases[buffer] = f"%s{buffer.serial}"
            body.scratch += -(-buffer.size * one * (body.width if body.differs(buffer) else 1) // 64) * 64
        elif buffer.role == "constant":
            kind = body.memory(buffer.kind)
            show: Callable[[Any], str] = (
                (lambda v: number(float(v), body.real)) if buffer.kind == "real" else (lambda v: str(int(v)))
            )
            values = ", ".join(f"{kind} {show(v)}" for v in buffer.data)
            body.globals.append(f"@c{buffer.serial} = private constant [{buffer.size} x {kind}] [{values}], align 64")
            body.bases[buffer] = f"@c{buffer.serial}"
