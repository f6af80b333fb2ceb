"""A kernel in memory, called on arrays: lanes in blocks, blocks on all cores."""

from __future__ import annotations

import ctypes
import functools
import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from .machine_code import Loaded

_CALL = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
PIECES = 4  # for each thread, so that a late one does not keep all others waiting
_own = threading.local()


class Slot(NamedTuple):
    """One argument or result of a kernel: which, its kind, shape, and whether it has a value per lane."""

    role: str
    place: int
    kind: str
    shape: tuple[int, ...]
    differs: bool


@functools.cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="kernel")


def cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


class Kernel:
    """Machine code with what its caller brings.

    Args:
        code: where it stands.
        slots: of its arguments and results, in its order.
        width: lanes per block.
        scratch: bytes of scratch memory per thread.
        real: type of its numbers.
    """

    def __init__(self, code: Loaded, slots: Sequence[Slot], width: int, scratch: int, real: Any) -> None:
        self.code, self.slots, self.width, self.scratch, self.real = code, list(slots), width, scratch, np.dtype(real)
        self._call = _CALL(code.address)

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
            threads: at most; all cores where left out.
        """
        n = 1 if lanes is None else lanes
        arrays: list[np.ndarray] = []
        found: list[Any] = [None] * results
        for slot in self.slots:
            if slot.role == "argument":
                arrays.append(np.ascontiguousarray(arguments[slot.place], self.type(slot)))
            else:
                shape = (*slot.shape, n) if slot.differs else slot.shape
                found[slot.place] = np.empty(shape, self.type(slot))
                arrays.append(found[slot.place])
        if lanes is None:
            self._run(arrays, 1, 0, 1)
            return found
        whole, rest = divmod(n, self.width)
        if whole:
            self._spread(arrays, n, whole, threads or cores())
        if rest:
            self._last(arrays, n, rest)
        return found

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
        """The lanes that fill no block, the last of them repeated, in arrays of their own."""
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
        self._call(addresses, stride, first, last)

    def _memory(self) -> int:
        """Address of this thread's scratch memory, at a multiple of 64 bytes."""
        if not self.scratch:
            return 0
        have = getattr(_own, "memory", None)
        if have is None or have.size < self.scratch + 64:
            have = _own.memory = np.empty(self.scratch + 64, np.uint8)
        return int(have.ctypes.data + 63) // 64 * 64
