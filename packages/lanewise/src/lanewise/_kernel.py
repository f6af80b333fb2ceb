"""Machine code of the processor: compiled by LLVM, loaded, and called on arrays, lanes in blocks and blocks on all cores.

Object files are kept on disk, see `cache`, so that a program is compiled once. A file is named by a hash of everything its
content depends on: the program, how it is called, processor, and versions of compiler and emitter.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .errors import UnavailableError

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
