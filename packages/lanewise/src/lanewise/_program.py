"""A lowered function: saved, loaded, compiled and run without JAX.

    program, _ = lower(function, *examples)       # needs JAX
    program.save("orbit.kernel");  program = Program.load("orbit.kernel")
    results = program.run({"[0].mass": 0.2, ..}, lanes=1024)

Arguments and results are named by their place in the trees of the function. An argument is one value for all lanes if it has
the shape of its example, and one per lane if it has one axis more, the last.

A saved program is a graph as plain lists of words and numbers. No pickle, so that reading a file runs nothing: words and
numbers of a file become part of the text that LLVM compiles, so only operations, kinds and whole numbers that a graph can
have are read. What the program does when it is run stays its own: it can read and write any memory.

Emitters other than LLVM's take `Program.prepared`: a graph whose nodes are those of the docstring of `_graph` without
exp, log and their like, in the order of `make_schedule`.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import secrets
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ._analysis import Schedule, find_divergence, make_schedule, rewrite
from ._elementary import expand_elementary
from ._graph import Buffer, Graph, Loop, Node, Store, gc_paused
from ._kernel import (
    BoundKernel,
    Kernel,
    Slot,
    cache_key,
    compile_assembly,
    emit,
    function_attributes,
    host,
    load_object,
)
from ._llvm_text import fits
from ._passes import optimise
from .cache import load_or_make
from .errors import ArgumentError

# ---- serialisation


SCHEMA = 1
KINDS = frozenset({"real", "int", "bool"})
ROLES = frozenset({"argument", "result", "constant", "scratch"})
OPS = frozenset(
    "const index phi end done table load add sub mul div max min neg abs sqrt floor ceil round fma rcp exp expm1 log log1p"
    " sin cos pow quot rem shl shr iand and or xor not lt le eq ne select real int bits unbits given invert item".split()
)
PIECE = 500  # entries of a list that are written at once


def serialise(graph: Graph, more: dict[str, Any]) -> bytes:
    """A graph and what belongs to it."""
    content = {
        "schema": SCHEMA,
        **more,
        "buffers": [_buffer(b) for b in graph.buffers],
        "nodes": [[n.op, n.kind, [a.serial for a in n.args], _attr(n)] for n in graph.nodes],
        "loops": [_loop(x) for x in graph.loops],
        "stores": [_store(s) for s in graph.stores],
    }
    return zlib.compress(_json(content).encode(), 6)


def deserialise(data: bytes, where: str) -> tuple[Graph, dict[str, Any]]:
    """Read a graph and the data saved with it.

    Raises:
        ArgumentError: if it is not such a file, or of another schema.
    """
    try:
        content = json.loads(zlib.decompress(data))
        schema = content["schema"]
    except (zlib.error, ValueError, KeyError, TypeError, RecursionError):
        raise ArgumentError(
            "program", "the program is unreadable; it must be a file that Program.save wrote", source=where
        ) from None
    if schema != SCHEMA:
        raise ArgumentError("schema", f"the schema must be {SCHEMA} for this release, got {schema!r}", source=where)
    try:
        more = {
            part: [[str(n), k if k is None else _one_of(KINDS, k), _wholes(s)] for n, k, s in content[part]]
            for part in ("arguments", "results")
        }
        return _Reader(content).graph(), {**more, "title": str(content["title"])}
    except (KeyError, IndexError, ValueError, TypeError, AttributeError):
        raise ArgumentError(
            "program", "the program is damaged; it must be a file that Program.save wrote", source=where
        ) from None


def _json(value: Any) -> str:
    """Write as `json.dumps` without spaces, in pieces, since other threads are blocked while that runs."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{json.dumps(name)}:{_json(of)}" for name, of in value.items()) + "}"
    if not isinstance(value, list):
        return json.dumps(value)
    if len(value) <= PIECE:
        return "[" + ",".join(map(_json, value)) + "]"
    pieces = (value[i : i + PIECE] for i in range(0, len(value), PIECE))
    return "[" + ",".join(json.dumps(piece, separators=(",", ":"))[1:-1] for piece in pieces) + "]"


def _number(value: Any) -> Any:
    return value if not isinstance(value, float) or math.isfinite(value) else repr(value)


def _attr(node: Node) -> Any:
    if node.op == "const":
        return _number(node.attr)
    if node.op == "load":
        return [node.attr[0].serial, *node.attr[1:]]
    if node.op in ("index", "done"):
        return node.attr.serial
    if node.op in ("phi", "end"):
        return [node.attr[0].serial, node.attr[1]]
    return node.attr.serial if node.op == "table" else node.attr


def _buffer(b: Buffer) -> list[Any]:
    within = None
    if b.within:
        within = [b.within[0].serial, b.within[1], None if b.within[2] is None else b.within[2].serial, b.within[3]]
    data = None if b.data is None else [_number(v) for v in np.asarray(b.data).tolist()]
    return [b.role, b.kind, list(b.shape), b.name, data, within]


def _loop(x: Loop) -> dict[str, Any]:
    return {
        "depth": x.depth,
        "trips": x.trips if isinstance(x.trips, int) else None,
        "count": x.trips.serial if isinstance(x.trips, Node) else None,
        "index": x.index.serial,
        "inits": [n.serial for n in x.inits],
        "phis": [n.serial for n in x.phis],
        "nexts": [n.serial for n in x.nexts],
        "after": [n.serial for n in x.after],
        "stores": [_store(s) for s in x.stores],
        "pinned": None if x.pinned is None else x.pinned.serial,
    }


def _store(s: Store) -> list[Any]:
    return [s.buffer.serial, s.scale, s.offset, None if s.index is None else s.index.serial, s.value.serial, s.adds]


def _one_of(known: frozenset[str], word: Any) -> str:
    if not isinstance(word, str) or word not in known:
        raise ValueError(word)
    return word


def _wholes(values: list[Any]) -> list[int]:
    """Whole numbers, and nothing that would be written otherwise."""
    if any(type(v) is not int for v in values):
        raise ValueError(values)
    return values


class _Reader:
    def __init__(self, content: dict[str, Any]) -> None:
        self.content, self.out = content, Graph()

    def graph(self) -> Graph:
        g, content = self.out, self.content
        for role, kind, shape, name, data, _ in content["buffers"]:
            numbers = None if data is None else np.array([float(v) for v in data])
            made = g.buffer(_one_of(ROLES, role), _one_of(KINDS, kind), _wholes(shape), str(name), numbers)
            if min(shape, default=0) < 0 or (numbers is not None and numbers.size != made.size):
                raise ValueError(shape)
        g.loops = [Loop(k, *_wholes([x["depth"], x["trips"] or 0])) for k, x in enumerate(content["loops"])]
        for buffer, row in zip(g.buffers, content["buffers"], strict=True):
            if row[5]:
                inside, offset, loop, by = row[5]
                _wholes([offset, by])
                buffer.within = (g.buffers[inside], offset, None if loop is None else g.loops[loop], by)
        for op, kind, args, attr in content["nodes"]:
            if op not in OPS or (kind not in KINDS and kind != "token"):
                raise ValueError(op)
            node = Node(op, tuple(g.nodes[a] for a in args), self.attr(op, kind, attr), kind, len(g.nodes))
            g.nodes.append(node)
        for loop, saved in zip(g.loops, content["loops"], strict=True):
            if saved["trips"] is None:
                loop.trips = g.nodes[saved["count"]]
            loop.index = g.nodes[saved["index"]]
            for name in ("inits", "phis", "nexts", "after"):
                setattr(loop, name, [g.nodes[n] for n in saved[name]])
            loop.pinned = None if saved["pinned"] is None else g.loops[saved["pinned"]]
            loop.stores = [self.store(s) for s in saved["stores"]]
        g.stores = [self.store(s) for s in content["stores"]]
        return g

    def attr(self, op: str, kind: str, attr: Any) -> Any:
        g = self.out
        if op == "const":
            return float(attr) if kind == "real" else bool(attr) if kind == "bool" else int(attr)
        if op == "load":
            inside, scale, offset = _wholes(attr)
            return g.buffers[inside], scale, offset
        if op in ("index", "done"):
            return g.loops[attr]
        if op in ("phi", "end"):
            loop, place = _wholes(attr)
            return g.loops[loop], place
        if op == "table":
            return g.buffers[attr]
        return None if attr is None else _wholes([attr])[0]

    def store(self, row: list[Any]) -> Store:
        buffer, scale, offset, index, value, adds = row
        _wholes([scale, offset])
        g = self.out
        return Store(
            g.buffers[buffer], scale, offset, None if index is None else g.nodes[index], g.nodes[value], bool(adds)
        )


# ---- programs


# Vectors in flight side by side, by the operations of the longest body: what waits for one is done for another, until the
# registers no longer hold them. Measured with AVX-512 on bodies of 220, 670, 1,000 and 1,400 operations.
IN_FLIGHT = ((300, 4), (1_500, 2))
REGISTERS = 24  # that may hold what a loop carries
MODES = ("default", "strict", "fast")
REALS = {"float64": "double", "float32": "float"}


class Leaf(NamedTuple):
    """An array of the arguments or results: name, kind (None if it carries nothing), shape for a single lane."""

    name: str
    kind: str | None
    shape: tuple[int, ...]


class Program:
    """A graph with its arguments and results.

    `mode` of everything below: ``default`` gives the same bits on any vector width, in any lane, alone or in a batch,
    whatever is given per lane; it differs from JAX by rounding. ``strict`` does the operations that JAX does, a product and
    the sum that it goes to rounded once, as XLA does; ``fast`` gives up what `_llvm_text` says, and equal bits.
    """

    def __init__(
        self, graph: Graph | None, arguments: Sequence[Leaf], results: Sequence[Leaf], title: str = ""
    ) -> None:
        if graph is not None:
            self.__dict__["graph"] = graph  # of the property below
        self.arguments, self.results, self.title = list(arguments), list(results), title
        self._kernels: dict[Any, Kernel] = {}

    @classmethod
    def from_parts(cls, data: bytes, arguments: Sequence[Leaf], results: Sequence[Leaf], title: str) -> Program:
        """A program whose graph stays serialised until it has to be compiled."""
        made = cls(None, arguments, results, title)
        made.serialised = data
        return made

    @functools.cached_property
    def graph(self) -> Graph:
        """Graph of the program."""
        return deserialise(self.serialised, self.title or "program")[0]

    @functools.cached_property
    def serialised(self) -> bytes:
        """Content of a file that `save` writes."""
        more = {
            "arguments": list(map(list, self.arguments)),
            "results": list(map(list, self.results)),
            "title": self.title,
        }
        return serialise(self.graph, more)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the program to a file.

        Raises:
            ArgumentError: it cannot be written.
        """
        _write_whole(Path(path), self.serialised)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Program:
        """Read a program from a file. Read only trusted files: the program runs as machine code.

        Raises:
            ArgumentError: if there is none, or it is no program of this release's schema.
        """
        try:
            data = Path(path).read_bytes()
        except OSError as error:
            raise ArgumentError("program", f"{path} cannot be read ({error.strerror})") from None
        return cls.from_bytes(data, str(path))

    @classmethod
    def from_bytes(cls, data: bytes, where: str = "program") -> Program:
        """Read a program from bytes, the inverse of `serialised`.

        Raises:
            ArgumentError: if it is no program of this release's schema.
        """
        graph, more = deserialise(data, where)
        arguments, wanted = ([Leaf(n, k, tuple(s)) for n, k, s in more[part]] for part in ("arguments", "results"))
        made = cls(graph, arguments, wanted, more["title"])
        made.serialised = data
        return made

    @gc_paused()
    def prepared(self, mode: str = "default", real: str = "float64") -> tuple[Graph, Schedule]:
        """The graph that emitters write, and its order."""
        _known("mode", mode, MODES)
        _known("real", real, tuple(REALS))
        exact = mode == "strict"
        write = expand_elementary(REALS[real])
        graph = rewrite(self.graph, lambda g, n, a: a[0] if n.op == "given" else write(g, n, a), exact=exact)
        graph = optimise(graph, mode, real)
        return graph, make_schedule(graph)

    def kernel(
        self,
        differs: frozenset[int] = frozenset(),
        *,
        lanes: bool = False,
        mode: str = "default",
        real: str = "float64",
        width: int | None = None,
    ) -> Kernel:
        """Machine code for one way of calling, from memory, from disk, or compiled.

        Args:
            differs: places of the arguments that are given per lane.
            lanes: whether there are lanes.
            mode: see `Program`.
            real: type of its numbers, ``float64`` or ``float32``.
            width: lanes per block; chosen for this processor by default.
        """
        known = (differs, lanes, mode, real, width)
        if known not in self._kernels:
            self._kernels[known] = self._kernel(*known)
        return self._kernels[known]

    @gc_paused()
    def _kernel(self, differs: frozenset[int], lanes: bool, mode: str, real: str, width: int | None) -> Kernel:
        name = cache_key(self.serialised, sorted(differs), lanes, mode, real, width)
        code, about = load_or_make(f"{name}.o", lambda: self._compiled(differs, lanes, mode, real, width))
        slots = [Slot(role, place, kind, tuple(shape), many) for role, place, kind, shape, many in about["slots"]]
        return Kernel(load_object(code), slots, about["width"], about["scratch"], REALS_NUMPY[real])

    def _compiled(
        self, differs: frozenset[int], lanes: bool, mode: str, real: str, width: int | None
    ) -> tuple[bytes, dict[str, Any]]:
        text, about = self.assembly(differs, lanes=lanes, mode=mode, real=real, width=width)
        return compile_assembly(text), about

    @gc_paused()
    def assembly(
        self,
        differs: frozenset[int] = frozenset(),
        *,
        lanes: bool = False,
        mode: str = "default",
        real: str = "float64",
        width: int | None = None,
    ) -> tuple[str, dict[str, Any]]:
        """LLVM assembly, and what a caller of the kernel must know."""
        at = host()
        if mode == "fast" and lanes and at.divides:
            mode = "default"
        graph, plan = self.prepared(mode, real)
        inputs = [b for b in graph.buffers if b.role == "argument"]
        wanted = [b for b in graph.buffers if b.role == "result"]
        divergence = find_divergence(graph, plan, {inputs[k] for k in differs}, lanes=lanes)
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
            divergence,
            width=width,
            real=REALS[real],
            features=function_attributes(),
            estimates=mode == "fast" and lanes and fits(width, REALS[real], at.bits),
            vector=0 if lanes else at.bits // size,
        )
        named = [k for k, leaf in enumerate(self.results) if leaf.kind is not None]
        places = {b: k for k, b in enumerate(inputs)} | dict(zip(wanted, named, strict=True))
        slots = [[b.role, places[b], b.kind, list(b.shape), b in divergence.buffers and lanes] for b in layout.external]
        return text, {"slots": slots, "width": width, "scratch": layout.scratch}

    def run(
        self,
        arguments: Mapping[str, ArrayLike] | Sequence[ArrayLike],
        *,
        lanes: int | None = None,
        mode: str = "default",
        real: str = "float64",
        threads: int | None = None,
        width: int | None = None,
    ) -> dict[str, np.ndarray]:
        """Run it on arrays.

        Args:
            arguments: by name, or all of them in order.
            lanes: how many; None for a single run.
            mode: see `Program`.
            real: type of its numbers.
            threads: at most; all cores by default.
            width: lanes per block.

        Returns:
            The results by name, with the lanes as last axis.

        Raises:
            ArgumentError: an argument is missing, unknown, or of another shape.
        """
        if isinstance(arguments, Mapping):
            values = self._ordered(arguments)
        else:
            values = list(arguments)
        outputs = self.call(values, lanes=lanes, mode=mode, real=real, threads=threads, width=width)
        return {leaf.name: value for leaf, value in zip(self.results, outputs, strict=True) if value is not None}

    def call(
        self,
        values: Sequence[ArrayLike],
        *,
        lanes: int | None = None,
        mode: str = "default",
        real: str = "float64",
        threads: int | None = None,
        width: int | None = None,
    ) -> list[np.ndarray | None]:
        """Run with arguments and results in order; a result that carries nothing is None."""
        if len(values) != len(self.arguments):
            raise ArgumentError(
                "arguments",
                f"the program takes {len(self.arguments)} arguments, got {len(values)}",
                source=self.title or None,
            )
        if lanes is not None and lanes < 1:
            raise ArgumentError("lanes", f"lanes must be 1 or more, got {lanes}")
        arrays, differs = [], set()
        for k, (leaf, value) in enumerate(zip(self.arguments, values, strict=True)):
            array = np.asarray(value)
            if array.shape != leaf.shape:
                if lanes is None or array.shape != (*leaf.shape, lanes):
                    raise _misshapen(leaf, array, lanes)
                differs.add(k)
            arrays.append(array)
        one = host().bits // (64 if real == "float64" else 32)
        if width is None and lanes is not None and lanes <= one:
            width = one  # one vector is enough
        kernel = self.kernel(frozenset(differs), lanes=lanes is not None, mode=mode, real=real, width=width)
        return kernel(arrays, len(self.results), lanes, threads)

    def bind(
        self,
        arguments: Sequence[np.ndarray],
        results: Sequence[np.ndarray | None],
        *,
        lanes: int | None = None,
        mode: str = "default",
        real: str = "float64",
        threads: int | None = None,
    ) -> BoundKernel:
        """The program on arrays whose places are fixed: a call of it reads and writes them, and makes nothing.

        Args:
            arguments: arrays in order, of the types of the kernel; those per lane have one axis more, the last.
            results: arrays in order in which the results are left, None if one carries nothing.
            lanes: how many, a multiple of the width of `kernel`; None for a single run.
            mode: see `Program`.
            real: type of its numbers.
            threads: at most; all cores by default.

        Raises:
            ValueError: an array or the number of lanes does not fit.
        """
        many = [k for k, (leaf, a) in enumerate(zip(self.arguments, arguments, strict=True)) if a.shape != leaf.shape]
        kernel = self.kernel(frozenset(many), lanes=lanes is not None, mode=mode, real=real)
        return BoundKernel(kernel, arguments, results, lanes, threads)

    def _ordered(self, arguments: Mapping[str, ArrayLike]) -> list[ArrayLike]:
        names = [leaf.name for leaf in self.arguments]
        for name in arguments:
            if name not in names:
                raise ArgumentError(
                    name, f"Unknown argument {name!r}. The program takes {', '.join(names)}", source=self.title or None
                )
        for name in names:
            if name not in arguments:
                raise ArgumentError(name, f"{name} is missing; the program needs it", source=self.title or None)
        return [arguments[name] for name in names]


REALS_NUMPY: dict[str, Any] = {"float64": np.float64, "float32": np.float32}


def _known(field: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ArgumentError(field, f"Unknown {field} {value!r}. Known are {', '.join(known)}")


def _misshapen(leaf: Leaf, array: np.ndarray, lanes: int | None) -> ArgumentError:
    per_lane = "" if lanes is None else f", or {(*leaf.shape, lanes)} with a value per lane"
    return ArgumentError(leaf.name, f"{leaf.name} must have the shape {leaf.shape}{per_lane}, got {array.shape}")


def _write_whole(path: Path, data: bytes) -> None:
    """Write a file atomically."""
    part = path.with_name(f".{secrets.token_hex(4)}.part{path.suffix}")
    try:
        with open(part, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(part, path)
    except OSError as error:
        raise ArgumentError("file", f"{path} cannot be written ({error.strerror})") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
