"""What becomes of elements taken from, or put to, places that are computed."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from .arrays import (
    SMALL,
    Update,
    as_node,
    at,
    clamped,
    is_zero,
    kind_of,
    minus,
    plus,
    shape_of,
    solid,
    unwrapped,
    within,
)
from .graph import Node
from .rules_arrays import shaped
from .trace import Tracer, rule


def _mode(eqn: Any) -> str:
    return str(eqn.params["mode"]).rsplit(".", 1)[-1].lower()


@rule("gather")
def _gather(t: Tracer, eqn: Any, a: Any, indices: Any) -> Any:
    g, numbers, sizes = t.graph, eqn.params["dimension_numbers"], eqn.params["slice_sizes"]
    mode, shape, out = _mode(eqn), shape_of(a), eqn.outvars[0].aval.shape
    paired = list(numbers.operand_batching_dims)
    offsets = [d for d in range(len(shape)) if d not in numbers.collapsed_slice_dims and d not in paired]
    batch = [d for d in range(len(out)) if d not in numbers.offset_dims]
    fills = "fill" in mode
    empty = {"real": math.nan, "int": np.iinfo(np.int64).min, "bool": True}[kind_of(a)]
    fill = g.const(empty if eqn.params["fill_value"] is None else eqn.params["fill_value"], kind_of(a))

    def element(index: tuple[Any, ...]) -> Node:
        asked = tuple(index[d] for d in batch)
        start: list[Any] = [0] * len(shape)
        for k, d in enumerate(numbers.start_index_map):
            start[d] = at(g, indices, (*asked, k))
        for d, e in zip(paired, numbers.start_indices_batching_dims, strict=True):
            start[d] = asked[e]
        sound = g.const(True, "bool")
        for d in numbers.start_index_map:
            room = shape[d] - sizes[d] + 1
            if fills:
                sound = g.make("and", (sound, within(g, as_node(g, start[d]), room)))
            start[d] = clamped(g, start[d], room)
        for d, e in zip(offsets, numbers.offset_dims, strict=True):
            start[d] = plus(g, start[d], index[e])
        found = at(g, a, tuple(start))
        return g.make("select", (sound, found, fill)) if fills else found

    return shaped(g, tuple(out), kind_of(a), element)


@rule("scatter-add", "scatter")
def _scatter(t: Tracer, eqn: Any, a: Any, indices: Any, updates: Any) -> Any:
    g, numbers, shape = t.graph, eqn.params["dimension_numbers"], shape_of(a)
    adds = eqn.primitive.name == "scatter-add"
    many = shape_of(updates)
    windows, paired = numbers.update_window_dims, list(numbers.operand_batching_dims)
    batch = [d for d in range(len(many)) if d not in windows]
    inner = [d for d in range(len(shape)) if d not in numbers.inserted_window_dims and d not in paired]
    sizes = [1] * len(shape)
    for d, e in zip(inner, windows, strict=True):
        sizes[d] = many[e]
    blocks: list[tuple[tuple[Any, ...], Any, Node]] = []
    if math.prod(many[d] for d in batch) > SMALL:
        raise NotImplementedError("so many places in a long array can not be changed at once")
    for asked in itertools.product(*(range(many[d]) for d in batch)):
        start: list[Any] = [0] * len(shape)
        for k, d in enumerate(numbers.scatter_dims_to_operand_dims):
            start[d] = at(g, indices, (*asked, k))
        for d, e in zip(paired, numbers.scatter_indices_batching_dims, strict=True):
            start[d] = asked[e]
        sound = g.const(True, "bool")
        for d in numbers.scatter_dims_to_operand_dims:
            room = shape[d] - sizes[d] + 1
            if "clip" not in _mode(eqn):
                sound = g.make("and", (sound, within(g, as_node(g, start[d]), room)))
            start[d] = clamped(g, start[d], room)
        block = np.empty(sizes, object)
        for place in itertools.product(*map(range, sizes)):
            at_update: list[Any] = [0] * len(many)
            for d, i in zip(batch, asked, strict=True):
                at_update[d] = i
            for d, e in zip(inner, windows, strict=True):
                at_update[e] = place[d]
            block[place] = at(g, updates, tuple(at_update))
        blocks.append((tuple(start), block, sound))
    return _changed(t, a, shape, blocks, adds)


def _changed(t: Tracer, a: Any, shape: tuple[int, ...], blocks: list[Any], adds: bool) -> Any:
    g = t.graph
    if math.prod(shape) > SMALL and adds and is_zero(a):
        zero = g.const(0.0)
        kept = []
        for start, block, sound in blocks:
            guarded = np.frompyfunc(lambda n, s=sound: g.make("select", (s, n, zero)), 1, 1)(block)
            kept.append((start, np.asarray(guarded, object)))
        return Update(g, shape, kept)

    def element(index: tuple[Any, ...]) -> Node:
        found = at(g, a, index)
        for start, block, sound in blocks:
            inside, here = sound, []
            for i, s, n in zip(index, start, block.shape, strict=True):
                place = minus(g, i, s)
                inside = g.make("and", (inside, within(g, place, n)))
                here.append(clamped(g, place, n))
            if inside.op == "const" and not inside.attr:
                continue
            value = at(g, block, tuple(here))
            if adds:
                value = g.make("add", (found, value))
            found = g.make("select", (inside, value, found))
        return found

    return shaped(g, shape, kind_of(a), element)


@rule("sort")
def _sort(t: Tracer, eqn: Any, *values: Any) -> Any:
    """Stable, by exchanging neighbours: for few elements."""
    g, axis, keys = t.graph, eqn.params["dimension"], eqn.params["num_keys"]
    arrays = [np.moveaxis(solid(g, v), axis, 0).copy() for v in values]
    if len(arrays[0]) > 16 or keys != 1:
        raise NotImplementedError("only up to 16 elements are sorted, and by one key")
    for at_index in np.ndindex(arrays[0].shape[1:]):
        for end in range(len(arrays[0]) - 1, 0, -1):
            for i in range(end):
                low, high = (i, *at_index), (i + 1, *at_index)
                swap = g.make("lt", (arrays[0][high], arrays[0][low]))
                for a in arrays:
                    x, y = a[low], a[high]
                    a[low], a[high] = g.make("select", (swap, y, x)), g.make("select", (swap, x, y))
    return [unwrapped(np.moveaxis(a, 0, axis)) for a in arrays]
