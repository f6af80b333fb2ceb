"""A graph as plain lists, and back: what a saved program holds. No pickle, so that reading a file runs nothing.

Words and numbers of a file become part of the text that LLVM compiles, so only operations, kinds and whole numbers that a
graph can have are read. What the program does when it is run stays its own: it can read and write any memory.
"""

from __future__ import annotations

import json
import math
import zlib
from typing import Any

import numpy as np

from ...errors import InputError
from .graph import Buffer, Graph, Loop, Node, Store

SCHEMA = 1
KINDS = frozenset({"real", "int", "bool"})
ROLES = frozenset({"argument", "result", "constant", "scratch"})
OPS = frozenset(
    "const index phi end done table load add sub mul div max min neg abs sqrt floor ceil round fma rcp exp expm1 log log1p"
    " sin cos pow quot rem shl shr iand and or xor not lt le eq ne select real int bits unbits given invert item".split()
)
PIECE = 500  # entries of a list that are written at once


def packed(graph: Graph, more: dict[str, Any]) -> bytes:
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


def unpacked(data: bytes, where: str) -> tuple[Graph, dict[str, Any]]:
    """The graph, and what was saved with it.

    Raises:
        InputError: if it is not such a file, or of another schema.
    """
    try:
        content = json.loads(zlib.decompress(data))
        schema = content["schema"]
    except (zlib.error, ValueError, KeyError, TypeError, RecursionError):
        raise InputError("program", "unreadable", "allowed is a file that Program.save wrote", where=where) from None
    if schema != SCHEMA:
        raise InputError("schema", schema, f"this release reads {SCHEMA}", where=where)
    try:
        more = {part: [[str(n), k if k is None else _one_of(KINDS, k), _wholes(s)] for n, k, s in content[part]]
                for part in ("arguments", "results")}  # fmt: skip
        return _Reader(content).graph(), {**more, "title": str(content["title"])}
    except (KeyError, IndexError, ValueError, TypeError, AttributeError):
        raise InputError("program", "damaged", "allowed is a file that Program.save wrote", where=where) from None


def _json(value: Any) -> str:
    """As `json.dumps` without spaces, in pieces: no thread goes on while that writes, and one may control a machine."""
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
        "depth": x.depth, "trips": x.trips if isinstance(x.trips, int) else None,
        "count": x.trips.serial if isinstance(x.trips, Node) else None,
        "index": x.index.serial, "inits": [n.serial for n in x.inits],
        "phis": [n.serial for n in x.phis], "nexts": [n.serial for n in x.nexts], "after": [n.serial for n in x.after],
        "stores": [_store(s) for s in x.stores], "pinned": None if x.pinned is None else x.pinned.serial,
    }  # fmt: skip


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
