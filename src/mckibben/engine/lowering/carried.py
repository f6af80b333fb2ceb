"""What a loop carries from trip to trip, while a function is traced."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jax.extend.core import Literal

from .arrays import SMALL, Growing, Rows, View, as_node, at, flat, is_long, is_zero, plus, shape_of, solid, times
from .graph import Graph, Loop, Node
from .trace import Refused, Tracer, copy


def steady(jaxpr: Any, consts: int, count: int, inits: Sequence[Any]) -> tuple[set[int], dict[int, int]]:
    """Places of a carry that a trip leaves as they are, and whole numbers to which it adds one number."""
    vars_in = jaxpr.invars[consts : consts + count]
    made = {v: e for e in jaxpr.eqns for v in e.outvars}
    stays, counts = set(), {}
    for k, (var, out) in enumerate(zip(vars_in, jaxpr.outvars, strict=False)):
        eqn = made.get(out) if not isinstance(out, Literal) else None
        if out is var:
            stays.add(k)
        elif eqn is not None and eqn.primitive.name == "add" and isinstance(inits[k], Node) and inits[k].kind == "int":
            a, b = eqn.invars
            by = b if a is var else a
            if (a is var or b is var) and isinstance(by, Literal):
                counts[k] = int(by.val)
    return stays, counts


def grown_memory(t: Tracer, inits: Sequence[Any], stays: set[int]) -> dict[int, Growing]:
    """Memory for long arrays that a loop changes."""
    g, found = t.graph, {}
    for k, value in enumerate(inits):
        if k in stays or not (is_long(value) or isinstance(value, Growing)):
            continue
        if isinstance(value, Growing):
            found[k] = Growing(value.buffer, value.shape)
        elif value.kind != "real":
            raise NotImplementedError("long arrays of whole numbers cannot be carried through a loop")
        else:
            buffer = g.buffer("scratch", "real", value.shape)
            loop = g.open_loop(math.prod(value.shape))
            whole = View((math.prod(value.shape),), "real", value.at) if len(value.shape) == 1 else None
            if whole is None and value.fill is None:
                raise NotImplementedError(
                    "a long array with several axes can be carried only if it begins as one number"
                )
            node = value.fill if value.fill is not None else at(g, whole, (loop.index,))
            g.store(buffer, loop.index, node)
            g.pin()
            g.close_loop(loop, ())
            found[k] = Growing(buffer, value.shape)
            found[k].filled = g.done(loop)
    return found


class Places:
    """What a loop carries: the places in JAX's order, and the nodes that stand for them."""

    def __init__(
        self, g: Graph, loop: Loop, inits: list[Any], stays: set[int], counts: dict[int, int], grown: dict[int, Growing]
    ) -> None:
        self.g, self.loop, self.inits, self.stays, self.counts, self.grown = g, loop, inits, stays, counts, grown
        self.during: list[Any] = []
        for k, value in enumerate(inits):
            if k in grown:
                token = grown[k].filled
                if token is not None:
                    loop.after.append(token)
                self.during.append(grown[k])
            elif k in stays:
                self.during.append(value)
            elif k in counts:
                self.during.append(self._counted(k, loop.index))
            else:
                written = solid(g, value)
                phi = g.carry(loop, written) if isinstance(written, Node) else self._each(written)
                self.during.append(phi)

    def _each(self, written: np.ndarray) -> np.ndarray:
        out = np.empty(written.shape, object)
        for index in np.ndindex(written.shape):
            init: Any = written[index]
            out[index] = self.g.carry(self.loop, init)
        return out

    def _counted(self, k: int, trips: Any) -> Node:
        return as_node(self.g, plus(self.g, self.inits[k], times(self.g, trips, self.counts[k])))

    def close(self, nexts: Sequence[Any]) -> list[Any]:
        """End the loop; what is in the places afterwards."""
        g, loop, flattened = self.g, self.loop, []
        refused = [v for v in nexts if isinstance(v, Refused)]
        for k, value in enumerate(nexts):
            if k in self.stays or k in self.counts or refused:
                continue
            if k in self.grown:
                self._add(self.grown[k], value)
            else:
                written = solid(g, value)
                flattened += [written] if isinstance(written, Node) else list(written.ravel())
        ends = iter(g.close_loop(loop, loop.phis if refused else flattened))
        if refused:
            raise refused[0].why
        after: list[Any] = []
        for k, value in enumerate(self.inits):
            if k in self.stays:
                after.append(value)
            elif k in self.counts:
                after.append(self._counted(k, loop.trips))
            elif k in self.grown:
                own = self.grown[k]
                whole = isinstance(value, Growing)
                rows = Rows(g, own.buffer, own.shape, (g.done(loop),))
                rows.sum_of = own if is_zero(value) else None
                after.append(value if whole else rows)
            elif isinstance(self.during[k], Node):
                after.append(next(ends))
            else:
                shape = shape_of(self.during[k])
                out = np.empty(shape, object)
                for index in np.ndindex(shape):
                    out[index] = next(ends)
                after.append(out)
        return after

    def _add(self, own: Growing, value: Any) -> None:
        if not isinstance(value, Growing) or value.buffer is not own.buffer:
            raise NotImplementedError("a long array that a loop carries can only be added to")
        for start, block in value.blocks:
            sizes = shape_of(block)
            copy_to = self._adder(own, start, sizes)
            copy(self.g, block, copy_to)

    def _adder(self, own: Growing, start: Any, sizes: tuple[int, ...]) -> Any:
        g, shape = self.g, own.shape
        inner = math.prod(shape[1:])
        if sizes[1:] != tuple(shape[1:]):
            if math.prod(sizes) > SMALL:
                raise NotImplementedError("such a part of a long array can not be added to")
            places = [
                flat(g, tuple(plus(g, s, i) for s, i in zip(start, index, strict=True)), shape)
                for index in np.ndindex(sizes)
            ]
            return lambda place, node: g.store(own.buffer, places[place], node, adds=True)
        begin = times(g, start[0], inner)
        return lambda place, node: g.store(own.buffer, plus(g, begin, place), node, adds=True)
