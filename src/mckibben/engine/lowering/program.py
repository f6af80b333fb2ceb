"""A lowered function: saved, loaded, compiled and run without JAX.

    program = lower(function, *examples)          # needs JAX, see `lower`
    program.save("muscle.kernel");  program = Program.load("muscle.kernel")
    results = program.run({"[0].mass": 0.2, ..}, lanes=1024)

Arguments and results are named by their place in the trees of the function. An argument is one value for all lanes if it has
the shape of its example, and one per lane if it has one axis more, the last.

Emitters other than LLVM's take `Program.prepared`: a graph whose nodes are those of `graph`'s docstring without exp, log and
their like, in the order of `schedule`.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...documents import write_whole
from ...errors import InputError
from . import disk, machine_code
from .elementary import written_out
from .emit_llvm import emit
from .graph import Graph, growing
from .kernel import Kernel, Slot
from .llvm_estimates import fits
from .passes import optimised
from .rewrite import rewritten
from .saving import packed, unpacked
from .schedule import Schedule, schedule
from .varying import varying

# Vectors in flight side by side, by the operations of the longest body: what waits for one is done for another, until the
# registers no longer hold them. Measured with AVX-512 on bodies of 220, 670, 1,000 and 1,400 operations.
IN_FLIGHT = ((300, 4), (1_500, 2))
REGISTERS = 24  # that may hold what a loop carries
MODES = ("default", "strict", "fast")
REALS = {"float64": "double", "float32": "float"}


class Leaf(NamedTuple):
    """One array of the arguments or results: name, kind (None for one that carries nothing), shape for a single lane."""

    name: str
    kind: str | None
    shape: tuple[int, ...]


class Program:
    """A graph with its arguments and results.

    `mode` of everything below: ``default`` gives the same bits on any vector width, in any lane, alone or in a batch,
    whatever is given per lane; it differs from JAX by rounding. ``strict`` does the operations that JAX does, a product and
    the sum that it goes to rounded once, as XLA does; ``fast`` gives up what `llvm_estimates` says, and equal bits.
    """

    def __init__(
        self, graph: Graph | None, arguments: Sequence[Leaf], results: Sequence[Leaf], title: str = ""
    ) -> None:
        if graph is not None:
            self.graph = graph
        self.arguments, self.results, self.title = list(arguments), list(results), title
        self._kernels: dict[Any, Kernel] = {}

    @classmethod
    def kept(cls, data: bytes, arguments: Sequence[Leaf], results: Sequence[Leaf], title: str) -> Program:
        """One that is packed: what is read of it only where it has to be compiled."""
        made = cls(None, arguments, results, title)
        made.packed = data
        return made

    @functools.cached_property
    def graph(self) -> Graph:
        """What it does."""
        return unpacked(self.packed, self.title or "program")[0]

    @functools.cached_property
    def packed(self) -> bytes:
        """All of it, as `save` writes it."""
        more = {
            "arguments": list(map(list, self.arguments)),
            "results": list(map(list, self.results)),
            "title": self.title,
        }
        return packed(self.graph, more)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it to a file.

        Raises:
            InputError: it cannot be written.
        """
        write_whole(path, lambda part: part.write_bytes(self.packed))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Program:
        """Read it from a file, which is to be trusted as a program is: what it does when it is run is machine code.

        Raises:
            InputError: if there is none, or it is no program of this release's schema.
        """
        try:
            data = Path(path).read_bytes()
        except OSError as error:
            raise InputError("program", str(path), f"it cannot be read: {error.strerror}") from None
        return cls.unpacked(data, str(path))

    @classmethod
    def unpacked(cls, data: bytes, where: str = "program") -> Program:
        """The inverse of `packed`."""
        graph, more = unpacked(data, where)
        given, wanted = ([Leaf(n, k, tuple(s)) for n, k, s in more[part]] for part in ("arguments", "results"))
        made = cls(graph, given, wanted, more["title"])
        made.packed = data
        return made

    @growing()
    def prepared(self, mode: str = "default", real: str = "float64") -> tuple[Graph, Schedule]:
        """The graph that emitters write, and its order."""
        _known("mode", mode, MODES)
        _known("real", real, tuple(REALS))
        exact = mode == "strict"
        write = written_out(REALS[real])
        graph = rewritten(self.graph, lambda g, n, a: a[0] if n.op == "given" else write(g, n, a), exact=exact)
        graph = optimised(graph, mode, real)
        return graph, schedule(graph)

    def kernel(
        self, differs: frozenset[int] = frozenset(), *, lanes: bool = False, mode: str = "default", real: str = "float64",
        width: int | None = None,
    ) -> Kernel:  # fmt: skip
        """Machine code for one way of calling, from memory, from disk, or compiled.

        Args:
            differs: places of the arguments that are given per lane.
            lanes: whether there are lanes.
            mode: see `Program`.
            real: type of its numbers, ``float64`` or ``float32``.
            width: lanes per block; chosen for this processor where left out.
        """
        known = (differs, lanes, mode, real, width)
        if known not in self._kernels:
            self._kernels[known] = self._kernel(*known)
        return self._kernels[known]

    @growing()
    def _kernel(self, differs: frozenset[int], lanes: bool, mode: str, real: str, width: int | None) -> Kernel:
        name = machine_code.key(self.packed, sorted(differs), lanes, mode, real, width)
        code, about = disk.kept(f"{name}.o", lambda: self._compiled(differs, lanes, mode, real, width))
        slots = [Slot(role, place, kind, tuple(shape), many) for role, place, kind, shape, many in about["slots"]]
        return Kernel(machine_code.loaded(code), slots, about["width"], about["scratch"], REALS_NUMPY[real])

    def _compiled(
        self, differs: frozenset[int], lanes: bool, mode: str, real: str, width: int | None
    ) -> tuple[bytes, dict[str, Any]]:
        text, about = self.assembly(differs, lanes=lanes, mode=mode, real=real, width=width)
        return machine_code.compiled(text), about

    @growing()
    def assembly(
        self, differs: frozenset[int] = frozenset(), *, lanes: bool = False, mode: str = "default", real: str = "float64",
        width: int | None = None,
    ) -> tuple[str, dict[str, Any]]:  # fmt: skip
        """LLVM assembly, and what a caller of the kernel must know."""
        at = machine_code.host()
        if mode == "fast" and lanes and at.divides:
            mode = "default"
        graph, plan = self.prepared(mode, real)
        given = [b for b in graph.buffers if b.role == "argument"]
        wanted = [b for b in graph.buffers if b.role == "result"]
        vary = varying(graph, plan, {given[k] for k in differs}, lanes=lanes)
        size = 64 if real == "float64" else 32
        if width is None:
            width = at.bits // size if lanes else 1
            longest = max(map(len, (plan.root, *plan.bodies.values())))
            carried = max((len(places) for places in plan.live.carried.values()), default=0)
            many = next((many for most, many in IN_FLIGHT if longest <= most), 1)
            width *= min(many, max(REGISTERS // max(carried, 1), 1)) if lanes else 1
        text, layout = emit(
            graph,
            plan,
            vary,
            width=width,
            real=REALS[real],
            features=machine_code.attributes(),
            estimates=mode == "fast" and lanes and fits(width, REALS[real], at.bits),
        )
        named = [k for k, leaf in enumerate(self.results) if leaf.kind is not None]
        places = {b: k for k, b in enumerate(given)} | dict(zip(wanted, named, strict=True))
        slots = [[b.role, places[b], b.kind, list(b.shape), b in vary.buffers and lanes] for b in layout.external]
        return text, {"slots": slots, "width": width, "scratch": layout.scratch}

    def run(
        self, arguments: Mapping[str, Any] | Sequence[Any], *, lanes: int | None = None, mode: str = "default",
        real: str = "float64", threads: int | None = None, width: int | None = None,
    ) -> dict[str, np.ndarray]:  # fmt: skip
        """Run it on arrays.

        Args:
            arguments: by name, or all of them in order.
            lanes: how many; None for a single run.
            mode: see `Program`.
            real: type of its numbers.
            threads: at most; all cores where left out.
            width: lanes per block.

        Returns:
            The results by name, with the lanes as last axis.

        Raises:
            InputError: an argument is missing, unknown, or of another shape.
        """
        if isinstance(arguments, Mapping):
            values = self._ordered(arguments)
        else:
            values = list(arguments)
        found = self.call(values, lanes=lanes, mode=mode, real=real, threads=threads, width=width)
        return {leaf.name: value for leaf, value in zip(self.results, found, strict=True) if leaf.kind is not None}

    def call(
        self, values: Sequence[Any], *, lanes: int | None = None, mode: str = "default", real: str = "float64",
        threads: int | None = None, width: int | None = None,
    ) -> list[Any]:  # fmt: skip
        """The same with arguments and results in order; a result that carries nothing is None."""
        if len(values) != len(self.arguments):
            raise InputError(
                "arguments", len(values), f"the program takes {len(self.arguments)}", where=self.title or None
            )
        if lanes is not None and lanes < 1:
            raise InputError("lanes", lanes, "allowed is 1 or more")
        arrays, differs = [], set()
        for k, (leaf, value) in enumerate(zip(self.arguments, values, strict=True)):
            array = np.asarray(value)
            if array.shape != leaf.shape:
                if lanes is None or array.shape != (*leaf.shape, lanes):
                    raise _misshapen(leaf, array, lanes)
                differs.add(k)
            arrays.append(array)
        one = machine_code.host().bits // (64 if real == "float64" else 32)
        if width is None and lanes is not None and lanes <= one:
            width = one  # one vector is enough
        kernel = self.kernel(frozenset(differs), lanes=lanes is not None, mode=mode, real=real, width=width)
        return kernel(arrays, len(self.results), lanes, threads)

    def _ordered(self, arguments: Mapping[str, Any]) -> list[Any]:
        names = [leaf.name for leaf in self.arguments]
        for name in arguments:
            if name not in names:
                raise InputError(name, "unknown", f"the program takes {', '.join(names)}", where=self.title or None)
        for name in names:
            if name not in arguments:
                raise InputError(name, "not given", "the program needs it", where=self.title or None)
        return [arguments[name] for name in names]


REALS_NUMPY: dict[str, Any] = {"float64": np.float64, "float32": np.float32}


def _known(field: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(field, value, f"known are {', '.join(known)}")


def _misshapen(leaf: Leaf, array: np.ndarray, lanes: int | None) -> InputError:
    per_lane = "" if lanes is None else f", or {(*leaf.shape, lanes)} with a value per lane"
    return InputError(leaf.name, f"of shape {array.shape}", f"allowed is {leaf.shape}{per_lane}")
