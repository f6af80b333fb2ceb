"""A program as PTX, the assembly of NVIDIA's GPUs: one thread per lane, the time loop in the kernel, the state in registers.

The text is that of `emit_llvm` for blocks of a single lane; only an entry is put before it, that finds a thread's lane:

    lanes(ptr memory, ptr scratch, i64 stride, i64 last)

does the lanes below `last`. All slots stand in one piece of memory: first what is one value for all lanes, then the
others, each as on the processor, [.., stride], so that neighbouring threads read and write side by side; see `Places`.
Scratch memory up to `OWN` bytes is a thread's own; beyond that the caller brings it for each lane in one piece, so that
neighbouring threads do not write side by side there, and reach only a part of the memory's speed.

Operations keep their rounding (``.rn``, which forbids the assembler to join a product and a sum, and small numbers are not
flushed to zero), so that in the modes ``default`` and ``strict`` lanes are meant to have the same bits as on the processor.
Mode ``fast`` takes reciprocals together in float64, see `passes`, and in float32 the GPU's own divisions and roots, within 2
units in the last place for common numbers.

What is known of it: NVIDIA's ptxas assembles the PTX for sm_80 and sm_90, its operations are counted, and the text it is
made from is run on the processor, entry and index arithmetic included, by a stand-in for the driver. What only a GPU shows
has not been seen: that its results are those of the processor, that NVIDIA's driver takes the calls, and how fast it is.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from . import machine_code
from .emit_llvm import emit
from .varying import varying

if TYPE_CHECKING:
    from .program import Program

OLDEST, USUAL = (6, 0), (8, 0)  # compute capabilities; PTX for the usual one runs on all later ones
VERSION = "+ptx70"  # read by drivers since CUDA 11
OWN = 1024  # bytes of scratch memory that a thread has for itself; the driver sets them aside for all threads a GPU can hold
ENTRY = "lanes"
TRIPLE = 'target triple = "nvptx64-nvidia-cuda"'
PLACE = ("tid.x", "ctaid.x", "ntid.x")


class Places(NamedTuple):
    """Where slots begin, in bytes from the begin of their memory; the stride is a multiple of 8 lanes.

    Attributes:
        begins: of each slot (a, b): it begins at a + b stride.
        fixed: bytes of what is one value for all lanes.
        per_lane: bytes of the others per lane of the stride.
    """

    begins: list[tuple[int, int]]
    fixed: int
    per_lane: int


def gpu_assembly(
    program: Program, differs: frozenset[int], *, mode: str = "default", real: str = "float64"
) -> tuple[str, dict[str, Any]]:
    """LLVM assembly for a GPU, and what its caller must know: slots, and bytes of scratch memory to bring for each lane.

    Args:
        program: what is written.
        differs: places of the arguments that are given per lane.
        mode: see `Program`.
        real: type of its numbers.
    """
    graph, plan = program.prepared(mode, real)
    given, wanted = ([b for b in graph.buffers if b.role == role] for role in ("argument", "result"))
    vary = varying(graph, plan, {given[k] for k in differs}, lanes=True)
    kind = "double" if real == "float64" else "float"
    text, layout = emit(graph, plan, vary, width=1, real=kind, features="alwaysinline nounwind ")
    text = text.replace("define void @kernel", "define internal void @kernel")
    if mode == "fast" and real == "float32":
        text = re.sub(r"= (fdiv|call(?= (?:<1 x float>|float) @llvm\.sqrt))", r"= \1 afn", text)
    numbers = dict(zip(given, range(len(given)), strict=True))
    numbers |= dict(zip(wanted, (k for k, leaf in enumerate(program.results) if leaf.kind is not None), strict=True))
    slots = [[b.role, numbers[b], b.kind, list(b.shape), b in vary.buffers] for b in layout.external]
    brought = layout.scratch if layout.scratch > OWN else 0
    places = placed(slots, real)
    entry = _entry(places, layout.scratch, brought)
    return f"{TRIPLE}\n{text}{entry}", {"slots": slots, "scratch": brought, "places": list(places)}


def placed(slots: Sequence[Sequence[Any]], real: str) -> Places:
    """Where each slot (role, place, kind, shape, differs) of a kernel begins."""
    fixed, per_lane = 0, 0
    begins = []
    for _, _, kind, shape, differs in slots:
        size = math.prod(shape) * {"real": 8 if real == "float64" else 4, "int": 8, "bool": 1}[kind]
        begins.append((0 if differs else fixed, per_lane if differs else 0, differs))
        if differs:
            per_lane += size
        else:
            fixed += -(-size // 64) * 64
    return Places([(fixed if differs else a, b) for a, b, differs in begins], fixed, per_lane)


def _entry(places: Places, scratch: int, brought: int) -> str:
    """The function that a launch calls: it makes the table of pointers, of which inlining `kernel` leaves nothing."""
    slots = len(places.begins)
    lines = [f"declare i32 @llvm.nvvm.read.ptx.sreg.{place}()" for place in PLACE]
    lines.append(
        f"define ptx_kernel void @{ENTRY}(ptr noalias %memory, ptr noalias %brought, i64 %stride, i64 %last) {{"
    )
    lines.append(f"  %pointers = alloca [{slots + 1} x ptr]")
    if scratch and not brought:
        lines.append(f"  %scratch = alloca [{scratch} x i8], align 64")
    for k, place in enumerate(PLACE):
        lines += [f"  %n{k} = call i32 @llvm.nvvm.read.ptx.sreg.{place}()", f"  %w{k} = zext i32 %n{k} to i64"]
    lines += ["  %before = mul i64 %w1, %w2", "  %lane = add i64 %before, %w0", "  %some = icmp slt i64 %lane, %last"]
    lines += ["  br i1 %some, label %work, label %idle", "work:"]
    for k, (fixed, per_lane) in enumerate(places.begins):
        lines += [f"  %far{k} = mul i64 %stride, {per_lane}", f"  %at{k} = add i64 %far{k}, {fixed}"]
        lines += [
            f"  %p{k} = getelementptr i8, ptr %memory, i64 %at{k}",
            f"  %to{k} = getelementptr ptr, ptr %pointers, i64 {k}",
        ]
        lines.append(f"  store ptr %p{k}, ptr %to{k}")
    if brought:
        lines += [f"  %skipped = mul i64 %lane, {brought}", "  %scratch = getelementptr i8, ptr %brought, i64 %skipped"]
    if scratch:
        lines += [f"  %to = getelementptr ptr, ptr %pointers, i64 {slots}", "  store ptr %scratch, ptr %to"]
    lines += ["  %next = add i64 %lane, 1", "  call void @kernel(ptr %pointers, i64 %stride, i64 %lane, i64 %next)"]
    return "\n".join([*lines, "  br label %idle", "idle:", "  ret void", "}"]) + "\n"


def ptx(text: str, capability: tuple[int, int] = USUAL) -> str:
    """PTX from the LLVM assembly of `gpu_assembly`.

    Args:
        text: the assembly.
        capability: of the GPU; above `USUAL` that of `USUAL` is written.
    """
    binding, machine = _machine(f"sm_{''.join(map(str, min(capability, USUAL)))}")
    module = binding.parse_assembly(text)
    module.data_layout = str(machine.target_data)
    module.verify()
    passes = binding.create_new_module_pass_manager()
    passes.add_always_inliner_pass()
    passes.add_sroa_pass()  # the table of pointers goes, so that what it holds is known to be global memory
    passes.add_instruction_combine_pass()
    passes.add_simplify_cfg_pass()
    passes.run(module, binding.create_pass_builder(machine, binding.create_pipeline_tuning_options()))
    return str(machine.emit_assembly(module))


@functools.cache
def _machine(name: str) -> Any:
    """LLVM's binding, and its description of a GPU."""
    binding = machine_code.llvm()
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    return binding, binding.Target.from_triple("nvptx64-nvidia-cuda").create_target_machine(
        cpu=name, features=VERSION, opt=3
    )
