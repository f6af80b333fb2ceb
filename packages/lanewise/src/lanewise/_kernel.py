"""A scheduled graph as LLVM assembly, and as machine code of the processor: compiled, loaded, and called on arrays.

The lanes are those of vectors, and loops are loops of one function.

A run without lanes does several trips of a loop at once where they do not wait for each other, see `find_wide_loops`.

    void kernel(ptr pointers, i64 stride, i64 first, i64 last)

does the blocks of lanes first .. last-1, each `width` lanes wide. `pointers` holds the address of each argument and result
in the order of `Layout.external`, then that of the scratch memory. What is one value for all lanes stands in memory as it
is; what differs has `stride` lanes side by side for each of its elements. Whole numbers are 64 bits, truth values bytes.

Lanes are called in blocks and blocks on all cores. Object files are kept on disk, see `cache`, so that a program is compiled
once. A file is named by a hash of everything its content depends on: the program, how it is called, processor, and versions
of compiler and emitter.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import re
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ._analysis import Divergence, Entry, Schedule, WideLoop, find_wide_loops
from ._graph import Buffer, Graph, Loop, Node, Store
from ._llvm_text import LLVM_OPS, Memory, number
from .errors import UnavailableError

LONGEST = 4000  # lines of a block: LLVM's time for one grows faster than its length


class Layout(NamedTuple):
    """Memory that a caller of the kernel must provide.

    Attributes:
        external: buffers of arguments and results whose addresses it gets.
        scratch: bytes of scratch memory per thread.
        width: lanes per block.
        uniforms: bytes of what `uniforms` makes for all lanes, where that is a function of its own.
    """

    external: list[Buffer]
    scratch: int
    width: int
    uniforms: int = 0


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
    parted: bool = False,
) -> tuple[str, Layout]:
    """The text of a kernel, and what its caller brings; estimates are for mode ``fast``, see `_llvm_text`.

    `vector` is the number of trips of a loop that stand in a vector of a run without lanes, 0 for none.
    `parted` makes two functions, for a GPU: what all lanes share is written by ``uniforms(pointers, stride, values)``, once
    per call, and read by the kernel from an argument, so that no lane keeps it in a register of its own.
    """
    body = Body(graph, plan, divergence, width=width, real=real, estimates=estimates)
    body.uniforms = {} if parted else None
    if vector:
        wide = find_wide_loops(plan, vector)
        nodes = divergence.nodes.union(*(w.vectors for w in wide.values()))
        body.divergence, body.wide = divergence._replace(nodes=nodes), wide
    head: list[str] = []
    _memory(body, head)
    body.entries(plan.root, root=True)
    # what stands outside of loops is parted in the same way; the block that loops back to names the last part
    first, entry = _in_parts([*head, *body.before])
    argument, size, own = "", 0, list[str]()
    if parted:
        reads, writes, size = _uniforms(body)
        own = [
            f"define void @uniforms(ptr noalias %pointers, i64 %stride, ptr noalias %values) {features}{{",
            *["entry:", "  %never = icmp slt i64 %stride, 0", *first, *writes, "  br label %out"],
            *["out:", "  ret void", "}"],
        ]
        argument, (first, entry) = ", ptr noalias %values", _in_parts([*head, *reads])
    text = [
        *body.globals,
        *own,
        f"define void @kernel(ptr noalias %pointers, i64 %stride, i64 %first, i64 %last{argument}) {features}{{",
        "entry:",
        "  %never = icmp slt i64 %stride, 0",
        *first,
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
    return "\n".join(text) + "\n", Layout(body.external, body.scratch, width, size)


def _in_parts(lines: list[str]) -> tuple[list[str], str]:
    """Lines of the first block, in blocks that are not too long, and the name of the last."""
    parts, entry = lines[:LONGEST], "entry"
    for k in range(LONGEST, len(lines), LONGEST):
        entry = f"once{k}"
        parts += [f"  br i1 %never, label %out, label %{entry}", f"{entry}:", *lines[k : k + LONGEST]]
    return parts, entry


def _uniforms(body: Body) -> tuple[list[str], list[str], int]:
    """Lines that read what all lanes share and the loop over lanes needs, lines that write it, and its bytes."""
    asked = set(re.findall(r"%[\w.]+", "\n".join(body.lines)))
    made = {node: body.names[node] for node in sorted(body.shared, key=lambda node: node.serial)}
    made |= body.uniforms or {}
    reads, writes, size = list[str](), list[str](), 0
    for k, (node, value) in enumerate(made.items()):
        name = body.names[node]
        if name not in asked:
            continue
        asked.remove(name)
        one, inside = body.type(node.kind, False), body.memory(node.kind)
        wide = 1 if inside == "i8" else 4 if inside == "float" else 8
        size = -(-size // wide) * wide
        place = f"getelementptr i8, ptr %values, i64 {size}"
        raw, kept = (f"%raw{k}", f"%kept{k}") if one != inside else (name, value)
        reads += [f"  %from{k} = {place}", f"  {raw} = load {inside}, ptr %from{k}, align {wide}"]
        if one != inside:
            reads.append(f"  {name} = trunc {inside} {raw} to {one}")
            writes.append(f"  {kept} = zext {one} {value} to {inside}")
        writes += [f"  %into{k} = {place}", f"  store {inside} {kept}, ptr %into{k}, align {wide}"]
        size += wide
    return reads, writes, size


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


# ---- machine code


# Lines above which LLVM takes no pains: its choice of registers would take many minutes, as of a system of 10,000 states.
# The code then takes 1.6 times as long, and gives the same bits.
LARGE = 250_000


class Host(NamedTuple):
    """The processor: its name, its features for LLVM, the bits of its vectors, and whether it divides quickly."""

    cpu: str
    features: str
    bits: int
    divides: bool


class LoadedCode(NamedTuple):
    """Machine code in memory; the engine owns it."""

    address: int
    engine: Any


@functools.cache
def llvm() -> Any:
    """Load llvmlite's binding, ready to compile.

    Raises:
        UnavailableError: if it is not installed.
    """
    try:
        import llvmlite.binding as binding
    except ImportError:
        raise UnavailableError("LLVM cannot be loaded: llvmlite is not installed.") from None
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding


@functools.cache
def host() -> Host:
    """Properties of this processor."""
    binding = llvm()
    features = binding.get_host_cpu_features()
    bits = 512 if features.get("avx512f") else 256 if features.get("avx") else 128
    name = binding.get_host_cpu_name()
    # measured on Zen 5: its division of whole vectors is faster than what stands for it elsewhere
    return Host(name, features.flatten(), bits, name.startswith(("znver4", "znver5", "znver6")))


@functools.cache
def emitter_version() -> str:
    """Hash of this package's own sources, so that changes of them invalidate the cache."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def function_attributes() -> str:
    """Attributes of a function for this processor."""
    at = host()
    # Without a frame pointer LLVM cannot align the stack once it finds that it must keep vectors there: every one of them
    # would then lie across two lines of the cache, which costs a quarter of the speed.
    stack = '"stackrealign" "frame-pointer"="all"'
    return (
        f'"target-cpu"="{at.cpu}" "target-features"="{at.features}" "prefer-vector-width"="{at.bits}" {stack} nounwind '
    )


def compile_assembly(text: str) -> bytes:
    """Assembly to an object file."""
    binding = llvm()
    module = binding.parse_assembly(text)
    module.verify()
    return bytes(target_machine(2 if text.count("\n") < LARGE else 0).emit_object(module))


def target_machine(effort: int = 2) -> Any:
    """LLVM's description of this processor."""
    binding, at = llvm(), host()
    target = binding.Target.from_default_triple()
    return target.create_target_machine(
        cpu=at.cpu, features=at.features, opt=effort, reloc="pic", codemodel="jitdefault"
    )


def load_object(data: bytes) -> LoadedCode:
    """An object file's kernel, ready to be called."""
    binding = llvm()
    module = binding.parse_assembly("")
    engine = binding.create_mcjit_compiler(module, target_machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(data))
    engine.finalize_object()
    return LoadedCode(engine.get_function_address("kernel"), engine)


def cache_key(*parts: object) -> str:
    """The name of machine code that depends on these parts, on this processor and on the versions here."""
    import llvmlite

    digest = hashlib.sha256()
    for part in (*parts, *host(), llvmlite.__version__, emitter_version()):
        data = part if isinstance(part, bytes) else repr(part).encode()
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()[:40]


# ---- calls


_CALL = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
PIECES = 4  # for each thread, so that a late one does not keep all others waiting
_own = threading.local()


class Slot(NamedTuple):
    """An argument or result of a kernel: role, kind, shape, and whether it has a value per lane."""

    role: str
    place: int
    kind: str
    shape: tuple[int, ...]
    differs: bool


@functools.cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="kernel")


def available_cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


class Kernel:
    """Machine code with what its caller brings.

    Args:
        code: where it stands.
        slots: slots of its arguments and results, in its order.
        width: lanes per block.
        scratch: bytes of scratch memory per thread.
        real: type of its numbers.
    """

    def __init__(self, code: LoadedCode, slots: Sequence[Slot], width: int, scratch: int, real: Any) -> None:
        self.code, self.slots, self.width, self.scratch, self.real = code, list(slots), width, scratch, np.dtype(real)
        self.entry = _CALL(code.address)

    def type(self, slot: Slot) -> np.dtype:
        """The type of a slot's elements in memory."""
        return self.real if slot.kind == "real" else np.dtype(np.int64) if slot.kind == "int" else np.dtype(np.bool_)

    def __call__(
        self, arguments: Sequence[Any], results: int, lanes: int | None, threads: int | None = None
    ) -> list[Any]:
        """Run it.

        Args:
            arguments: arrays by place, those per lane with the lanes as last axis.
            results: how many there are.
            lanes: how many, None for one call without lanes.
            threads: at most; all cores by default.
        """
        n = 1 if lanes is None else lanes
        arrays: list[np.ndarray] = []
        outputs: list[Any] = [None] * results
        for slot in self.slots:
            if slot.role == "argument":
                arrays.append(np.ascontiguousarray(arguments[slot.place], self.type(slot)))
            else:
                shape = (*slot.shape, n) if slot.differs else slot.shape
                outputs[slot.place] = np.empty(shape, self.type(slot))
                arrays.append(outputs[slot.place])
        if lanes is None:
            self._run(arrays, 1, 0, 1)
            return outputs
        whole, rest = divmod(n, self.width)
        if whole:
            self._spread(arrays, n, whole, threads or available_cores())
        if rest:
            self._last(arrays, n, rest)
        return outputs

    def _spread(self, arrays: list[np.ndarray], n: int, blocks: int, threads: int) -> None:
        threads = min(threads, blocks)
        if threads == 1:
            self._run(arrays, n, 0, blocks)
            return
        pieces = min(blocks, PIECES * threads)
        cuts = [blocks * k // pieces for k in range(pieces + 1)]
        work = [_pool(threads).submit(self._run, arrays, n, a, b) for a, b in zip(cuts, cuts[1:], strict=False)]
        for one in work:
            one.result()

    def _last(self, arrays: list[np.ndarray], n: int, rest: int) -> None:
        """Run the lanes that fill no block, the last of them repeated, in separate arrays."""
        own = []
        for slot, array in zip(self.slots, arrays, strict=True):
            if not slot.differs:
                own.append(array)
                continue
            part = np.empty((*slot.shape, self.width), array.dtype)
            if slot.role == "argument":
                part[..., :rest] = array[..., n - rest :]
                part[..., rest:] = array[..., n - 1 :]
            own.append(part)
        self._run(own, self.width, 0, 1)
        for slot, array, part in zip(self.slots, arrays, own, strict=True):
            if slot.differs and slot.role == "result":
                array[..., n - rest :] = part[..., :rest]

    def _run(self, arrays: list[np.ndarray], stride: int, first: int, last: int) -> None:
        addresses = (ctypes.c_void_p * (len(arrays) + 1))(*[a.ctypes.data for a in arrays], self._memory())
        self.entry(addresses, stride, first, last)

    def _memory(self) -> int:
        """Address of this thread's scratch memory, at a multiple of 64 bytes."""
        if not self.scratch:
            return 0
        have = getattr(_own, "memory", None)
        if have is None or have.size < self.scratch + 64:
            have = _own.memory = np.empty(self.scratch + 64, np.uint8)
        return int(have.ctypes.data + 63) // 64 * 64


class BoundKernel:
    """A kernel whose arguments and results have fixed places in memory; a call reads and writes them there.

    Such a call takes no array apart and makes none, which is what most of the time of a short kernel goes into. It holds
    the arrays, and is to be called by one thread at a time.

    Args:
        kernel: what is called.
        arguments: arrays by place, of the kernel's types, contiguous; those per lane with the lanes as last axis.
        results: arrays by place in which the results are left, None for one that carries nothing; no memory of an argument.
        lanes: how many, a whole number of the kernel's blocks; None for one call without lanes.
        threads: at most; all cores by default.

    Raises:
        ValueError: an array has another type or shape, or is not contiguous, or the lanes leave a block unfilled.
    """

    def __init__(
        self,
        kernel: Kernel,
        arguments: Sequence[np.ndarray],
        results: Sequence[np.ndarray | None],
        lanes: int | None,
        threads: int | None = None,
    ) -> None:
        self.kernel, self._stride = kernel, 1 if lanes is None else lanes
        self._arrays: list[np.ndarray] = []
        for slot in kernel.slots:
            array = (arguments if slot.role == "argument" else results)[slot.place]
            shape = (*slot.shape, self._stride) if slot.differs else slot.shape
            if (
                array is None
                or array.dtype != kernel.type(slot)
                or array.shape != shape
                or not array.flags.c_contiguous
            ):
                raise ValueError(f"{slot.role} {slot.place} must be a contiguous array {shape} of {kernel.type(slot)}")
            self._arrays.append(array)
        if self._stride % (1 if lanes is None else kernel.width):
            raise ValueError(f"the lanes must be a multiple of {kernel.width}, got {lanes}")
        blocks = 1 if lanes is None else lanes // kernel.width
        self._threads = 1 if lanes is None else min(threads or available_cores(), blocks)
        pieces = min(blocks, PIECES * self._threads) if self._threads > 1 else 1
        cuts = [blocks * k // pieces for k in range(pieces + 1)]
        self._parts = list(zip(cuts, cuts[1:], strict=False))
        self._scratch = [np.empty(kernel.scratch + 64, np.uint8) for _ in self._parts]
        places = [a.ctypes.data for a in self._arrays]
        kind = ctypes.c_void_p * (len(places) + 1)
        self._addresses = [kind(*places, (s.ctypes.data + 63) // 64 * 64) for s in self._scratch]
        self._call = kernel.entry

    def __call__(self) -> None:
        """Run it."""
        if self._threads == 1:
            begin, end = self._parts[0]
            self._call(self._addresses[0], self._stride, begin, end)
            return
        work = [
            _pool(self._threads).submit(self._call, at, self._stride, *part)
            for at, part in zip(self._addresses, self._parts, strict=True)
        ]
        for one in work:
            one.result()
