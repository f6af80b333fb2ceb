"""A program for NVIDIA's GPUs: one thread per lane, the time loop in the kernel, the state in registers.

    fast = to_gpu(program)                  # one line says so where there is no GPU
    fast.run({..}, lanes=262144, real="float32")

is called like `Program`; a run without lanes is the processor's. Arguments are copied there and results back for every
call, in chunks that fit the GPU's memory; `GpuKernel.seconds` is what the GPU itself took for the last one.

The text is that of `_kernel` for blocks of a single lane; only an entry is put before it, that finds a thread's lane:

    lanes(ptr memory, ptr scratch, i64 stride, i64 last)

does the lanes below `last`. What all lanes share (numbers that follow from shared arguments alone, and in float64 long
constants) takes registers in every thread, of which a step of a muscle has too few. A kernel of this module therefore has
another entry, ``uniforms_of_all``, which writes these numbers once per call; they are the last argument of ``lanes``, by
value, which a GPU reads as fast as registers. `to_ptx` writes a single entry that makes them itself.

All slots stand in one piece of memory: first what is one value for all lanes, then the others, each as on the processor,
[.., stride], so that neighbouring threads read and write side by side; see `MemoryLayout`.
Scratch memory up to `OWN` bytes is a thread's own; beyond that the caller brings it for each lane in one piece, so that
neighbouring threads do not write side by side there, and reach only a part of the memory's speed.

Operations keep their rounding (``.rn``, which forbids the assembler to join a product and a sum, and small numbers are
not flushed to zero), so that in the modes ``default`` and ``strict`` lanes are meant to have the same bits as on the
processor. Mode ``fast`` takes reciprocals together in float64, see `_passes`, and in float32 the GPU's own divisions
and roots, within 2 units in the last place for common numbers.

NVIDIA's ptxas assembles the PTX for sm_80 and sm_90, and the text it is made from is run on the processor, entry and index
arithmetic included, by a stand-in for the driver. On an H200 a step of 3,400 lines of PTX had the same bits as on the
processor in every result of 4,096 lanes, in float64 and float32, with shared parameters and with those of each lane; so
had the adjoint of ten samples.
"""

from __future__ import annotations

import ctypes
import functools
import math
import os
import re
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from ctypes import POINTER, byref, c_char_p, c_float, c_int, c_size_t, c_uint, c_uint64, c_void_p
from typing import Any, NamedTuple

import numpy as np

from ._analysis import find_divergence, most_held, order_for_registers
from ._kernel import Kernel, Slot, cache_key, emit, llvm
from ._program import Program
from .cache import load_or_make
from .errors import ArgumentError, DriverError, UnavailableError

VARIABLE = "LANEWISE_GPU_DRIVER"  # a library to load in the place of the driver's
NAMES = {"win32": ("nvcuda.dll",)}.get(sys.platform, ("libcuda.so.1", "libcuda.so"))
PROCESSORS, MAJOR, MINOR = 16, 75, 76  # attributes of a device
# options of loading: registers of a thread, where errors are written, and how much of them
REGISTERS, LOG, LOG_SIZE = 0, 5, 6
SPACE = 8192  # for them
CALLS: dict[str, Sequence[Any]] = {
    "cuInit": (c_uint,),
    "cuGetErrorString": (c_int, POINTER(c_char_p)),
    "cuDeviceGetCount": (POINTER(c_int),),
    "cuDeviceGet": (POINTER(c_int), c_int),
    "cuDeviceGetName": (c_char_p, c_int, c_int),
    "cuDeviceGetAttribute": (POINTER(c_int), c_int, c_int),
    "cuDevicePrimaryCtxRetain": (POINTER(c_void_p), c_int),
    "cuCtxSetCurrent": (c_void_p,),
    "cuModuleLoadDataEx": (POINTER(c_void_p), c_char_p, c_uint, POINTER(c_int), POINTER(c_void_p)),
    "cuModuleGetFunction": (POINTER(c_void_p), c_void_p, c_char_p),
    "cuMemGetInfo_v2": (POINTER(c_size_t), POINTER(c_size_t)),
    "cuMemAlloc_v2": (POINTER(c_uint64), c_size_t),
    "cuMemFree_v2": (c_uint64,),
    "cuMemcpyHtoD_v2": (c_uint64, c_void_p, c_size_t),
    "cuMemcpyDtoH_v2": (c_void_p, c_uint64, c_size_t),
    "cuLaunchKernel": (c_void_p, *(c_uint,) * 7, c_void_p, POINTER(c_void_p), POINTER(c_void_p)),
    "cuEventCreate": (POINTER(c_void_p), c_uint),
    "cuEventRecord": (c_void_p, c_void_p),
    "cuEventSynchronize": (c_void_p,),
    "cuEventElapsedTime": (POINTER(c_float), c_void_p, c_void_p),
    "cuEventDestroy_v2": (c_void_p,),
}


class Device(NamedTuple):
    """A GPU: its number, name, compute capability, and number of multiprocessors."""

    number: int
    name: str
    capability: tuple[int, int]
    processors: int


@functools.cache
def _library(name: str | None) -> Any:
    """The driver, ready for use."""
    for candidate in (name,) if name else NAMES:
        try:
            library = ctypes.CDLL(candidate)
        except OSError:
            continue
        for call, types in CALLS.items():
            function = getattr(library, call, None)
            if function is None:
                raise UnavailableError(
                    f"No GPU: the driver {candidate} has no {call}; one of CUDA 11 or later is needed."
                )
            function.argtypes, function.restype = types, c_int
        if (code := library.cuInit(0)) != 0:
            raise UnavailableError(f"No GPU: the driver says {_error_text(library, code)!r}.")
        return library
    raise UnavailableError(f"No GPU: no NVIDIA driver was found ({', '.join((name,) if name else NAMES)}).")


def _error_text(library: Any, code: int) -> str:
    text = c_char_p()
    library.cuGetErrorString(code, byref(text))
    return text.value.decode() if text.value else f"error {code}"


def call(name: str, *values: object) -> None:
    """Call a function of the driver.

    Raises:
        UnavailableError: if there is no driver, or it finds no GPU.
        DriverError: if the call fails; says why in the driver's words.
    """
    library = _library(os.environ.get(VARIABLE) or None)
    code = getattr(library, name)(*values)
    if code != 0:
        raise DriverError(f"The GPU's driver refused {name}: {_error_text(library, code)}.")


def devices() -> list[Device]:
    """List all GPUs of this machine.

    Raises:
        UnavailableError: if there is no driver, or it finds none; says which in one line.
    """
    count, number, major, minor, processors = c_int(), c_int(), c_int(), c_int(), c_int()
    call("cuDeviceGetCount", byref(count))
    gpus = []
    for k in range(count.value):
        call("cuDeviceGet", byref(number), k)
        text = ctypes.create_string_buffer(256)
        call("cuDeviceGetName", text, len(text), number.value)
        call("cuDeviceGetAttribute", byref(major), MAJOR, number.value)
        call("cuDeviceGetAttribute", byref(minor), MINOR, number.value)
        call("cuDeviceGetAttribute", byref(processors), PROCESSORS, number.value)
        name, capability = text.value.decode(errors="replace"), (major.value, minor.value)
        gpus.append(Device(number.value, name, capability, processors.value))
    if not gpus:
        raise UnavailableError("No GPU: the driver is there, but it finds no device.")
    return gpus


@functools.cache
def _context(name: str | None, number: int) -> c_void_p:
    context = c_void_p()
    call("cuDevicePrimaryCtxRetain", byref(context), number)
    return context


def use_device(device: Device) -> None:
    """Make this thread's calls those of a device; its context is the one that other libraries use as well."""
    call("cuCtxSetCurrent", _context(os.environ.get(VARIABLE), device.number))


def load_ptx(text: str, entries: Sequence[str], registers: int = 0) -> list[c_void_p]:
    """Functions of PTX, compiled by the driver (which keeps what it compiled) for the device in use.

    Args:
        text: the PTX.
        entries: names of the functions.
        registers: of a thread, at most; 0 leaves the number to the driver.
    """
    log = ctypes.create_string_buffer(SPACE)
    chosen = {LOG: ctypes.addressof(log), LOG_SIZE: SPACE} | ({REGISTERS: registers} if registers else {})
    options, values = (c_int * len(chosen))(*chosen), (c_void_p * len(chosen))(*chosen.values())
    module = c_void_p()
    try:
        call("cuModuleLoadDataEx", byref(module), text.encode(), len(chosen), options, values)
    except DriverError as error:
        words = " ".join(log.value.decode(errors="replace").split())
        raise DriverError(f"{error} {words}".strip()) from None
    functions = [c_void_p() for _ in entries]
    for function, entry in zip(functions, entries, strict=True):
        call("cuModuleGetFunction", byref(function), module, entry.encode())
    return functions


def free_memory() -> int:
    """Bytes of memory that the device in use has left."""
    free, total = c_size_t(), c_size_t()
    call("cuMemGetInfo_v2", byref(free), byref(total))
    return free.value


@contextmanager
def allocate(size: int) -> Iterator[int]:
    """Bytes of the device's memory, given back at the end: their address, at a multiple of 256."""
    address = c_uint64()
    call("cuMemAlloc_v2", byref(address), max(size, 1))
    try:
        yield address.value
    finally:
        call("cuMemFree_v2", address)


def copy_to_device(address: int, array: np.ndarray) -> None:
    """Copy a contiguous NumPy array to the device."""
    if array.nbytes:
        call("cuMemcpyHtoD_v2", address, array.ctypes.data, array.nbytes)


def copy_from_device(array: np.ndarray, address: int) -> None:
    """Copy from the device into a contiguous NumPy array, after all that was launched before."""
    if array.nbytes:
        call("cuMemcpyDtoH_v2", array.ctypes.data, address, array.nbytes)


def launch(function: c_void_p, blocks: int, threads: int, *values: int | np.ndarray) -> float:
    """Run a function with 64-bit arguments, or bytes by value, and wait for it; returns the seconds that the device took."""
    held = [v if isinstance(v, np.ndarray) else c_uint64(v) for v in values]
    places = [v.ctypes.data if isinstance(v, np.ndarray) else ctypes.addressof(v) for v in held]
    pointers = (c_void_p * len(held))(*places)
    begin, end = c_void_p(), c_void_p()
    call("cuEventCreate", byref(begin), 0)
    call("cuEventCreate", byref(end), 0)
    try:
        call("cuEventRecord", begin, None)
        call("cuLaunchKernel", function, blocks, 1, 1, threads, 1, 1, 0, None, pointers, None)
        call("cuEventRecord", end, None)
        call("cuEventSynchronize", end)
        took = c_float()
        call("cuEventElapsedTime", byref(took), begin, end)
    finally:
        call("cuEventDestroy_v2", begin)
        call("cuEventDestroy_v2", end)
    return took.value * 1e-3


# ---- assembly


OLDEST, USUAL = (6, 0), (8, 0)  # compute capabilities; PTX for the usual one runs on all later ones
VERSION = "+ptx70"  # read by drivers since CUDA 11
OWN = 1024  # bytes of scratch memory that a thread has for itself; the driver sets them aside for all threads a GPU can hold
ENTRY, FIRST = "lanes", "uniforms_of_all"
WARP = 32  # threads that do the same at a time
ALL_REGISTERS = 255  # that a thread may have
# Measured on an H200, see docs/explanation/kernels.md: with 128 registers of a thread a multiprocessor has room for 512,
# enough for some to compute while others wait; in one block these stay close to each other, and read the same instructions.
# Where a step holds more than a thread may have, as with reciprocals taken together and on the way back of an adjoint, the
# rest goes through memory, and few threads with all registers are faster.
MOST_REGISTERS, MOST_THREADS, FEW_THREADS = 128, 512, 64
UNIFORMS = 3584  # bytes of what all lanes share, at most: with other arguments a launch takes 4,096 bytes of it
TRIPLE = 'target triple = "nvptx64-nvidia-cuda"'
PLACE = ("tid.x", "ctaid.x", "ntid.x")


class MemoryLayout(NamedTuple):
    """Offsets of slots in bytes from the start of their memory; the stride is a multiple of 8 lanes.

    Attributes:
        begins: start of each slot (a, b), at a + b stride.
        fixed: bytes of what is one value for all lanes.
        per_lane: bytes of the others per lane of the stride.
    """

    begins: list[tuple[int, int]]
    fixed: int
    per_lane: int


def gpu_assembly(
    program: Program,
    differs: frozenset[int],
    *,
    mode: str = "default",
    real: str = "float64",
    parted: bool = False,
) -> tuple[str, dict[str, Any]]:
    """LLVM assembly for a GPU, and what its caller must know: slots, and bytes of scratch memory to bring for each lane.

    Args:
        program: the program.
        differs: places of the arguments that are given per lane.
        mode: see `Program`.
        real: type of its numbers.
        parted: whether what all lanes share is made by an entry of its own, if it is not too much for that.
    """
    graph, plan = program.prepared(mode, real)
    inputs, wanted = ([b for b in graph.buffers if b.role == role] for role in ("argument", "result"))
    divergence = find_divergence(graph, plan, {inputs[k] for k in differs}, lanes=True)
    held = {node for node in divergence.nodes if node.kind != "bool"}
    if parted:
        plan = order_for_registers(plan, held)
    kind = "double" if real == "float64" else "float"
    how: dict[str, Any] = {"width": 1, "real": kind, "features": "alwaysinline nounwind "}
    text, layout = emit(graph, plan, divergence, **how, parted=parted)
    if parted and not 0 < layout.uniforms <= UNIFORMS:
        text, layout = emit(graph, plan, divergence, **how)
    text = re.sub(r"^define void @", "define internal void @", text, flags=re.M)
    if mode == "fast" and real == "float32":
        text = re.sub(r"= (fdiv|call(?= (?:<1 x float>|float) @llvm\.sqrt))", r"= \1 afn", text)
    numbers = dict(zip(inputs, range(len(inputs)), strict=True))
    numbers |= dict(zip(wanted, (k for k, leaf in enumerate(program.results) if leaf.kind is not None), strict=True))
    slots = [[b.role, numbers[b], b.kind, list(b.shape), b in divergence.buffers] for b in layout.external]
    brought = layout.scratch if layout.scratch > OWN else 0
    places = placed(slots, real)
    entry = _entry(places, layout.scratch, brought, layout.uniforms)
    about = {"slots": slots, "scratch": brought, "places": list(places)}
    many = most_held(plan, held) * (2 if real == "float64" else 1) > ALL_REGISTERS
    many |= brought > 0 or any(node.op == "invert" for node in plan.live.nodes)
    about |= {"uniforms": layout.uniforms, "registers": 0 if many else MOST_REGISTERS}
    return f"{TRIPLE}\n{text}{entry}", about


def placed(slots: Sequence[Sequence[Any]], real: str) -> MemoryLayout:
    """Offset of each slot (role, place, kind, shape, differs) of a kernel."""
    fixed, per_lane = 0, 0
    begins = []
    for _, _, kind, shape, differs in slots:
        size = math.prod(shape) * {"real": 8 if real == "float64" else 4, "int": 8, "bool": 1}[kind]
        begins.append((0 if differs else fixed, per_lane if differs else 0, differs))
        if differs:
            per_lane += size
        else:
            fixed += -(-size // 64) * 64
    return MemoryLayout([(fixed if differs else a, b) for a, b, differs in begins], fixed, per_lane)


def _entry(places: MemoryLayout, scratch: int, brought: int, uniforms: int) -> str:
    """The functions that launches call: they make the table of pointers, of which inlining leaves nothing."""
    slots = len(places.begins)
    held, table = f"  %pointers = alloca [{slots + 1} x ptr]", list[str]()
    for k, (fixed, per_lane) in enumerate(places.begins):
        table += [f"  %far{k} = mul i64 %stride, {per_lane}", f"  %at{k} = add i64 %far{k}, {fixed}"]
        table += [
            f"  %p{k} = getelementptr i8, ptr %memory, i64 %at{k}",
            f"  %to{k} = getelementptr ptr, ptr %pointers, i64 {k}",
        ]
        table.append(f"  store ptr %p{k}, ptr %to{k}")
    lines = [f"declare i32 @llvm.nvvm.read.ptx.sreg.{place}()" for place in PLACE]
    argument, given = "", ""
    if uniforms:
        lines += [
            f"define ptx_kernel void @{FIRST}(ptr noalias %memory, ptr noalias %values, i64 %stride) {{",
            *[held, *table],
            "  call void @uniforms(ptr %pointers, i64 %stride, ptr %values)",
            "  ret void",
            "}",
        ]
        argument, given = f", ptr noalias byval([{uniforms} x i8]) align 8 %values", ", ptr %values"
    lines += [
        f"define ptx_kernel void @{ENTRY}(ptr noalias %memory, ptr noalias %brought, i64 %stride, i64 %last{argument}) {{"
    ]
    lines.append(held)  # in the first block, without which it would not go
    if scratch and not brought:
        lines.append(f"  %scratch = alloca [{scratch} x i8], align 64")
    for k, place in enumerate(PLACE):
        lines += [f"  %n{k} = call i32 @llvm.nvvm.read.ptx.sreg.{place}()", f"  %w{k} = zext i32 %n{k} to i64"]
    lines += ["  %before = mul i64 %w1, %w2", "  %lane = add i64 %before, %w0", "  %some = icmp slt i64 %lane, %last"]
    lines += ["  br i1 %some, label %work, label %idle", "work:", *table]
    if brought:
        lines += [f"  %skipped = mul i64 %lane, {brought}", "  %scratch = getelementptr i8, ptr %brought, i64 %skipped"]
    if scratch:
        lines += [f"  %to = getelementptr ptr, ptr %pointers, i64 {slots}", "  store ptr %scratch, ptr %to"]
    lines.append("  %next = add i64 %lane, 1")
    lines.append(f"  call void @kernel(ptr %pointers, i64 %stride, i64 %lane, i64 %next{given})")
    return "\n".join([*lines, "  br label %idle", "idle:", "  ret void", "}"]) + "\n"


def to_ptx(
    program: Program,
    per_lane: Collection[str],
    *,
    mode: str = "default",
    real: str = "float64",
    capability: tuple[int, int] = USUAL,
) -> str:
    """PTX of a program for lanes, with the entry ``lanes`` that the docstring of this module describes.

    Args:
        program: the program.
        per_lane: names of the arguments that have a value per lane.
        mode: see `Program`.
        real: type of its numbers, ``float64`` or ``float32``.
        capability: compute capability of the GPU; above `USUAL` that of `USUAL` is written.

    Raises:
        ArgumentError: an argument that the program does not take.
    """
    names = [leaf.name for leaf in program.arguments]
    for name in per_lane:
        if name not in names:
            raise ArgumentError("per_lane", f"Unknown argument {name!r}. The program takes {', '.join(names)}")
    text, _ = gpu_assembly(program, frozenset(map(names.index, per_lane)), mode=mode, real=real)
    return compile_ptx(text, capability)


def compile_ptx(text: str, capability: tuple[int, int] = USUAL) -> str:
    """PTX from the LLVM assembly of `gpu_assembly`.

    Args:
        text: the assembly.
        capability: capability of the GPU; above `USUAL` that of `USUAL` is written.
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
    binding = llvm()
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    return binding, binding.Target.from_triple("nvptx64-nvidia-cuda").create_target_machine(
        cpu=name, features=VERSION, opt=3
    )


# ---- kernels


SHARE = 0.9  # of the free memory that a chunk may take
ROUND = 64  # lanes to which a stride is rounded up, so that every row begins at a whole line of memory


class GpuKernel(Kernel):
    """A kernel on a GPU with what its caller brings.

    Args:
        device: where it runs.
        text: its PTX.
        slots: slots of its arguments and results, in its order.
        places: where they begin.
        scratch: bytes of memory to bring for each lane.
        real: type of its numbers.
        most: lanes at a time, at most; what fits the memory by default.
        uniforms: bytes of what all lanes share and an entry of its own makes.
        registers: of a thread, at most; 0 for as many as it takes.

    Attributes:
        seconds: that the GPU took for the last call, copies left out [s].
    """

    def __init__(
        self,
        device: Device,
        text: str,
        slots: Sequence[Slot],
        places: MemoryLayout,
        scratch: int,
        real: Any,
        most: int | None = None,
        uniforms: int = 0,
        registers: int = 0,
    ) -> None:
        self.device, self.slots, self.places, self.scratch = device, list(slots), places, scratch
        self.real, self.most, self.seconds = np.dtype(real), most, 0.0
        self.uniforms, self.registers = uniforms, registers
        use_device(device)
        self.functions = load_ptx(text, [ENTRY, FIRST] if uniforms else [ENTRY], registers)

    def block_of(self, lanes: int) -> int:
        """Threads of a block, so that a run of few lanes still gives every multiprocessor some."""
        each = -(-lanes // (WARP * self.device.processors)) * WARP
        return min(each, MOST_THREADS if self.registers else FEW_THREADS)

    def chunk(self, lanes: int) -> int:
        """Number of lanes that fit at a time.

        Raises:
            ArgumentError: if not a single one does.
        """
        each = self.places.per_lane + self.scratch
        room = int(SHARE * free_memory()) - self.places.fixed
        fitting = lanes if not each else room // each // ROUND * ROUND
        if fitting < 1:
            need = self.places.fixed + ROUND * each
            raise ArgumentError(
                "lanes",
                f"{lanes} lanes do not fit: the GPU has {room} bytes of memory left, and {ROUND} lanes need {need}",
            )
        return min(lanes, fitting, self.most or lanes)

    def __call__(
        self, arguments: Sequence[Any], results: int, lanes: int | None, threads: int | None = None
    ) -> list[Any]:
        """Run it; see `Kernel.__call__`."""
        n = 1 if lanes is None else lanes
        outputs: list[Any] = [None] * results
        arrays = []
        for slot in self.slots:
            if slot.role == "argument":
                arrays.append(np.ascontiguousarray(arguments[slot.place], self.type(slot)))
            else:
                outputs[slot.place] = np.empty((*slot.shape, n), self.type(slot))
                arrays.append(outputs[slot.place])
        use_device(self.device)
        size, self.seconds = self.chunk(n), 0.0
        stride = -(-size // ROUND) * ROUND
        with (
            allocate(self.places.fixed + stride * self.places.per_lane) as memory,
            allocate(stride * self.scratch) as scratch,
            allocate(self.uniforms) as values,
        ):
            shared: list[np.ndarray] = []
            for first in range(0, n, size):
                last = min(first + size, n)
                for slot, array, (a, b) in zip(self.slots, arrays, self.places.begins, strict=True):
                    if slot.role != "argument":
                        continue
                    if slot.differs:
                        part = np.zeros((*slot.shape, stride), array.dtype)
                        part[..., : last - first] = array[..., first:last]
                        copy_to_device(memory + a + b * stride, part)
                    elif first == 0:
                        copy_to_device(memory + a, array)
                if first == 0 and self.uniforms:
                    self.seconds += launch(self.functions[1], 1, 1, memory, values, stride)
                    shared = [np.empty(self.uniforms, np.uint8)]
                    copy_from_device(shared[0], values)
                block = self.block_of(last - first)
                blocks = -(-(last - first) // block)
                self.seconds += launch(self.functions[0], blocks, block, memory, scratch, stride, last - first, *shared)
                self._get(arrays, memory, stride, first, last)
        return outputs

    def _get(self, arrays: Sequence[Any], memory: int, stride: int, first: int, last: int) -> None:
        """Copy the results of a chunk of lanes."""
        for slot, array, (a, b) in zip(self.slots, arrays, self.places.begins, strict=True):
            if slot.role == "result":
                part = np.empty((*slot.shape, stride), array.dtype)
                copy_from_device(part, memory + a + b * stride)
                array[..., first:last] = part[..., : last - first]


class GpuProgram(Program):
    """A program whose runs of many lanes are a GPU's."""

    device: Device
    most: int | None = None

    def kernel(
        self,
        differs: frozenset[int] = frozenset(),
        *,
        lanes: bool = False,
        mode: str = "default",
        real: str = "float64",
        width: int | None = None,
    ) -> Kernel:
        """See `Program.kernel`; the width is always 1."""
        if not lanes:
            return super().kernel(differs, lanes=False, mode=mode, real=real, width=width)
        known = (differs, mode, real)
        if known not in self._kernels:
            capability = min(self.device.capability, USUAL)

            def make() -> tuple[bytes, dict[str, Any]]:
                text, about = gpu_assembly(self, differs, mode=mode, real=real, parted=True)
                return compile_ptx(text, capability).encode(), about

            name = cache_key(self.serialised, "gpu", capability, sorted(differs), mode, real)
            code, about = load_or_make(f"{name}.o", make)
            slots = [Slot(role, place, kind, tuple(shape), many) for role, place, kind, shape, many in about["slots"]]
            begins, fixed, per_lane = about["places"]
            places = MemoryLayout([(a, b) for a, b in begins], fixed, per_lane)
            self._kernels[known] = GpuKernel(
                self.device,
                code.decode(),
                slots,
                places,
                about["scratch"],
                np.dtype(real),
                self.most,
                about["uniforms"],
                about["registers"],
            )
        return self._kernels[known]


def to_gpu(program: Program, *, device: int = 0, most: int | None = None) -> GpuProgram:
    """Compile a program for a GPU.

    Args:
        program: the program to compile.
        device: which one, from 0.
        most: lanes at a time, at most; as many as fit its memory by default.

    Raises:
        UnavailableError: no driver, no GPU, or one that is too old; says which in one line.
        ArgumentError: there is no such device.
    """
    gpus = devices()
    if not 0 <= device < len(gpus):
        raise ArgumentError(
            "device",
            f"Unknown device {device}. Known are 0 to {len(gpus) - 1}: {', '.join(d.name for d in gpus)}",
        )
    if gpus[device].capability < OLDEST:
        version = ".".join(map(str, gpus[device].capability))
        raise UnavailableError(f"No GPU: {gpus[device].name} has compute capability {version}; 6.0 is needed.")
    made = GpuProgram(program.graph, program.arguments, program.results, program.title)
    made.serialised = program.serialised
    made.device, made.most = gpus[device], most
    return made
