"""Programs on a GPU: one lane per thread, in chunks that fit its memory.

    fast = on_gpu(program)                  # one line says so where there is no GPU
    fast.run({..}, lanes=262144, real="float32")

is called like `Program`; a run without lanes is the processor's. Arguments are copied there and results back for every
call; `GpuKernel.seconds` is what the GPU itself took for the last one. See `emit_ptx` for what has not been seen of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import InputError, MissingDataError
from . import disk, machine_code
from . import gpu_driver as driver
from .emit_ptx import ENTRY, OLDEST, USUAL, Places, gpu_assembly, ptx
from .kernel import Kernel, Slot
from .program import Program

BLOCK = 64  # threads: kernels of this size need so many registers that larger blocks leave some unused
SHARE = 0.9  # of the free memory that a chunk may take
ROUND = 64  # lanes to which a stride is rounded up, so that every row begins at a whole line of memory


class GpuKernel(Kernel):
    """A kernel on a GPU with what its caller brings.

    Args:
        device: where it runs.
        text: its PTX.
        slots: of its arguments and results, in its order.
        places: where they begin.
        scratch: bytes of memory to bring for each lane.
        real: type of its numbers.
        most: lanes at a time, at most; what fits the memory where left out.

    Attributes:
        seconds: that the GPU took for the last call, copies left out [s].
    """

    def __init__(
        self, device: driver.Device, text: str, slots: Sequence[Slot], places: Places, scratch: int, real: Any,
        most: int | None = None,
    ) -> None:  # fmt: skip
        self.device, self.slots, self.places, self.scratch = device, list(slots), places, scratch
        self.real, self.most, self.seconds = np.dtype(real), most, 0.0
        driver.use(device)
        self.function = driver.loaded(text, ENTRY)

    def chunk(self, lanes: int) -> int:
        """How many lanes fit at a time.

        Raises:
            InputError: if not a single one does.
        """
        each = self.places.per_lane + self.scratch
        room = int(SHARE * driver.free_memory()) - self.places.fixed
        fitting = lanes if not each else room // each // ROUND * ROUND
        if fitting < 1:
            need = self.places.fixed + ROUND * each
            raise InputError("lanes", lanes, f"the GPU has {room} bytes of memory left, and {ROUND} lanes need {need}")
        return min(lanes, fitting, self.most or lanes)

    def __call__(
        self, arguments: Sequence[Any], results: int, lanes: int | None, threads: int | None = None
    ) -> list[Any]:
        """Run it; see `kernel.Kernel`."""
        n = 1 if lanes is None else lanes
        found: list[Any] = [None] * results
        arrays = []
        for slot in self.slots:
            if slot.role == "argument":
                arrays.append(np.ascontiguousarray(arguments[slot.place], self.type(slot)))
            else:
                found[slot.place] = np.empty((*slot.shape, n), self.type(slot))
                arrays.append(found[slot.place])
        driver.use(self.device)
        size, self.seconds = self.chunk(n), 0.0
        stride = -(-size // ROUND) * ROUND
        with (
            driver.memory(self.places.fixed + stride * self.places.per_lane) as memory,
            driver.memory(stride * self.scratch) as scratch,
        ):
            for k, first in enumerate(range(0, n, size)):
                last = min(first + size, n)
                self._put(arrays, memory, stride, first, last, fixed=k == 0)
                blocks = -(-(last - first) // BLOCK)
                self.seconds += driver.launch(self.function, blocks, BLOCK, memory, scratch, stride, last - first)
                self._get(arrays, memory, stride, first, last)
        return found

    def _put(self, arrays: Sequence[Any], memory: int, stride: int, first: int, last: int, *, fixed: bool) -> None:
        """Copy the arguments of a chunk of lanes."""
        for slot, array, (a, b) in zip(self.slots, arrays, self.places.begins, strict=True):
            if slot.role != "argument":
                continue
            if slot.differs:
                part = np.zeros((*slot.shape, stride), array.dtype)
                part[..., : last - first] = array[..., first:last]
                driver.put(memory + a + b * stride, part)
            elif fixed:
                driver.put(memory + a, array)

    def _get(self, arrays: Sequence[Any], memory: int, stride: int, first: int, last: int) -> None:
        """Copy the results of a chunk of lanes."""
        for slot, array, (a, b) in zip(self.slots, arrays, self.places.begins, strict=True):
            if slot.role == "result":
                part = np.empty((*slot.shape, stride), array.dtype)
                driver.get(part, memory + a + b * stride)
                array[..., first:last] = part[..., : last - first]


class GpuProgram(Program):
    """A program whose runs of many lanes are a GPU's."""

    device: driver.Device
    most: int | None = None

    def kernel(
        self, differs: frozenset[int] = frozenset(), *, lanes: bool = False, mode: str = "default", real: str = "float64",
        width: int | None = None,
    ) -> Kernel:  # fmt: skip
        """See `Program.kernel`; the width is always 1."""
        if not lanes:
            return super().kernel(differs, lanes=False, mode=mode, real=real, width=width)
        known = (differs, mode, real)
        if known not in self._kernels:
            capability = min(self.device.capability, USUAL)

            def make() -> tuple[bytes, dict[str, Any]]:
                text, about = gpu_assembly(self, differs, mode=mode, real=real)
                return ptx(text, capability).encode(), about

            name = machine_code.key(self.packed, "gpu", capability, sorted(differs), mode, real)
            code, about = disk.kept(f"{name}.o", make)
            slots = [Slot(role, place, kind, tuple(shape), many) for role, place, kind, shape, many in about["slots"]]
            begins, fixed, per_lane = about["places"]
            places = Places([(a, b) for a, b in begins], fixed, per_lane)
            self._kernels[known] = GpuKernel(
                self.device, code.decode(), slots, places, about["scratch"], np.dtype(real), self.most
            )
        return self._kernels[known]


def on_gpu(program: Program, *, device: int = 0, most: int | None = None) -> GpuProgram:
    """A program for a GPU.

    Args:
        program: what is to run there.
        device: which one, from 0.
        most: lanes at a time, at most; as many as fit its memory where left out.

    Raises:
        MissingDataError: no driver, no GPU, or one that is too old; says which in one line.
        InputError: there is no such device.
    """
    found = driver.devices()
    if not 0 <= device < len(found):
        raise InputError("device", device, f"known are 0 to {len(found) - 1}: {', '.join(d.name for d in found)}")
    if found[device].capability < OLDEST:
        version = ".".join(map(str, found[device].capability))
        raise MissingDataError(f"No GPU: {found[device].name} has compute capability {version}; 6.0 is needed.")
    made = GpuProgram(program.graph, program.arguments, program.results, program.title)
    made.packed = program.packed
    made.device, made.most = found[device], most
    return made


__all__ = ["GpuKernel", "GpuProgram", "on_gpu"]
