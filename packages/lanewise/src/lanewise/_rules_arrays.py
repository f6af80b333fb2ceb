"""Rules of the operations that move elements: shapes, slices, joins, gathers and scatters."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ._graph import Graph, Node
from ._trace import (
    SMALL,
    BufferArray,
    ConcatenatedArray,
    ConstantArray,
    LazyArray,
    ScatteredBlocks,
    Tracer,
    add_index,
    as_node,
    clamp_index,
    element_at,
    element_of_join,
    flat_index,
    is_long,
    is_within,
    is_zero,
    kind_of,
    kind_of_dtype,
    materialise,
    rule,
    scale_index,
    shape_of,
    subtract_index,
    unwrap_scalar,
)

# ---- shapes, slices and joins


FEW = 32  # elements up to which parts of memory are joined outside of it


def make_array(graph: Graph, shape: tuple[int, ...], kind: str, element: Callable[[tuple[Any, ...]], Node]) -> Any:
    """Build a value from the elements at each index: written out if it is small."""
    view = LazyArray(shape, kind, element)
    return view if is_long(view) else unwrap_scalar(materialise(graph, view))


@rule("broadcast_in_dim")
def _broadcast(t: Tracer, eqn: Any, a: Any, *_: Any) -> Any:
    shape, axes = tuple(eqn.params["shape"]), eqn.params["broadcast_dimensions"]
    fill = a if isinstance(a, Node) else a.fill if isinstance(a, LazyArray) else None
    if fill is not None:
        filled = ConstantArray(shape, fill)
        return filled if is_long(filled) else unwrap_scalar(materialise(t.graph, filled))
    sizes = shape_of(a)
    if isinstance(a, BufferArray) and math.prod(sizes) == math.prod(shape):
        return BufferArray(t.graph, a.buffer, shape, a.tokens, a.written)
    return make_array(
        t.graph,
        shape,
        kind_of(a),
        lambda i: element_at(t.graph, a, tuple(0 if n == 1 else i[d] for d, n in zip(axes, sizes, strict=True))),
    )


@rule("reshape", "squeeze", "expand_dims")
def _reshape(t: Tracer, eqn: Any, a: Any, *_: Any) -> Any:
    g, shape, old = t.graph, tuple(eqn.outvars[0].aval.shape), shape_of(a)
    if isinstance(a, Node):
        return np.full(shape, a, object) if shape else a
    if isinstance(a, np.ndarray):
        return unwrap_scalar(a.reshape(shape))
    if isinstance(a, BufferArray):
        rows = BufferArray(g, a.buffer, shape, a.tokens, a.written)
        return rows if shape else rows.at(())
    if isinstance(a, ConstantArray):
        return ConstantArray(shape, a.node) if shape else a.node
    if [n for n in shape if n != 1] == [n for n in old if n != 1]:

        def same(index: tuple[Any, ...]) -> Node:
            used = iter([i for i, n in zip(index, shape, strict=True) if n != 1])
            return element_at(g, a, tuple(0 if n == 1 else next(used) for n in old))

        return make_array(g, shape, a.kind, same)

    def moved(index: tuple[Any, ...]) -> Node:
        place, indices = flat_index(g, index, shape), []
        for n in reversed(old):
            number = as_node(g, place)
            indices.append(g.make("rem", (number, g.const(n, "int"))))
            place = g.make("quot", (number, g.const(n, "int")))
        return element_at(g, a, tuple(reversed(indices)))

    return make_array(g, shape, a.kind, moved)


@rule("transpose")
def _transpose(t: Tracer, eqn: Any, a: Any) -> Any:
    order = eqn.params["permutation"]
    if isinstance(a, np.ndarray):
        return a.transpose(order)
    back = np.argsort(order)
    return make_array(
        t.graph, eqn.outvars[0].aval.shape, kind_of(a), lambda i: element_at(t.graph, a, tuple(i[k] for k in back))
    )


@rule("rev")
def _rev(t: Tracer, eqn: Any, a: Any) -> Any:
    g, axes, shape = t.graph, eqn.params["dimensions"], shape_of(a)

    def back(index: tuple[Any, ...]) -> Node:
        return element_at(
            g,
            a,
            tuple(
                subtract_index(g, n - 1, i) if d in axes else i
                for d, (i, n) in enumerate(zip(index, shape, strict=True))
            ),
        )

    return make_array(g, shape, kind_of(a), back)


@rule("slice")
def _slice(t: Tracer, eqn: Any, a: Any) -> Any:
    p = eqn.params
    strides = p["strides"] or (1,) * len(p["start_indices"])
    return take_slice(t.graph, a, p["start_indices"], eqn.outvars[0].aval.shape, strides)


def take_slice(g: Graph, a: Any, start: Any, shape: tuple[int, ...], strides: Any = None) -> Any:
    """Part of a value; the start may be nodes."""
    strides = strides or (1,) * len(shape)

    def element(index: tuple[Any, ...]) -> Node:
        return element_at(
            g, a, tuple(add_index(g, s, scale_index(g, i, k)) for s, i, k in zip(start, index, strides, strict=True))
        )

    if isinstance(a, ConstantArray):
        return ConstantArray(shape, a.node)
    if isinstance(a, ConcatenatedArray) and len(shape) == 1 and strides == (1,) and isinstance(start[0], int):
        begin = 0
        for part in a.parts:  # a part of its own, as the derivative of a join asks for it
            if begin == start[0] and shape_of(part)[0] == shape[0]:
                return part
            begin += shape_of(part)[0]
    return make_array(g, shape, kind_of(a), element)


@rule("split")
def _split(t: Tracer, eqn: Any, a: Any) -> Any:
    axis, begin, parts = eqn.params["axis"], 0, []
    for n, var in zip(eqn.params["sizes"], eqn.outvars, strict=True):
        start = [0] * len(shape_of(a))
        start[axis] = begin
        parts.append(take_slice(t.graph, a, start, var.aval.shape))
        begin += n
    return parts


@rule("concatenate")
def _concatenate(t: Tracer, eqn: Any, *parts: Any) -> Any:
    shape, axis = eqn.outvars[0].aval.shape, eqn.params["dimension"]
    if math.prod(shape) <= FEW or not any(isinstance(p, LazyArray) for p in parts):
        return np.concatenate([materialise(t.graph, p) for p in parts], axis)
    if axis:
        return make_array(t.graph, shape, kind_of(parts[0]), lambda index: element_of_join(t.graph, parts, axis, index))
    flattened = [q for p in parts for q in (p.parts if isinstance(p, ConcatenatedArray) else [p])]
    return ConcatenatedArray(t.graph, flattened, shape, kind_of(parts[0]))


@rule("stack")
def _stack(t: Tracer, eqn: Any, *parts: Any) -> Any:
    axis = eqn.params.get("axis", 0)
    if any(is_long(p) for p in parts):
        if axis:
            raise NotImplementedError("long arrays can be stacked along a new first axis only")
        shape, kind = tuple(eqn.outvars[0].aval.shape), kind_of(parts[0])
        return ConcatenatedArray(t.graph, [_as_row(t, p) for p in parts], shape, kind)
    written = [materialise(t.graph, p) for p in parts]
    out = np.empty((len(written), *shape_of(written[0])), object)
    for k, part in enumerate(written):
        out[k] = part
    return np.moveaxis(out, 0, axis)


@rule("unstack")
def _unstack(t: Tracer, eqn: Any, a: Any) -> list[Any]:
    axis, parts = eqn.params["axis"], []
    for k, var in enumerate(eqn.outvars):
        if isinstance(a, np.ndarray):
            parts.append(unwrap_scalar(np.take(a, k, axis)))
        elif isinstance(a, ConstantArray):
            parts.append(ConstantArray(var.aval.shape, a.node) if var.aval.shape else a.node)
        else:
            parts.append(make_array(t.graph, var.aval.shape, kind_of(a), _row_of(t, a, axis, k)))
    return parts


def _row_of(t: Tracer, a: Any, axis: int, k: int) -> Callable[[tuple[Any, ...]], Node]:
    """Element of a row of a value at each index within the row."""
    return lambda i: element_at(t.graph, a, (*i[:axis], k, *i[axis:]))


def _as_row(t: Tracer, part: Any) -> Any:
    shape = (1, *shape_of(part))
    if isinstance(part, BufferArray):
        return BufferArray(t.graph, part.buffer, shape, part.tokens, part.written)
    return make_array(t.graph, shape, kind_of(part), lambda i: element_at(t.graph, part, i[1:]))


@rule("pad")
def _pad(t: Tracer, eqn: Any, a: Any, fill: Any) -> Any:
    g, config, shape = t.graph, eqn.params["padding_config"], eqn.outvars[0].aval.shape
    if any(low < 0 or high < 0 or inner for low, high, inner in config):
        raise NotImplementedError("padding between elements, and padding that takes elements away, has no kernel")
    if is_zero(fill) and math.prod(shape) > SMALL and kind_of(a) == "real":
        return ScatteredBlocks(g, shape, [(tuple(low for low, _, _ in config), a)])

    def element(index: tuple[Any, ...]) -> Node:
        inside, indices = g.const(True, "bool"), []
        for i, (low, _, _), n in zip(index, config, shape_of(a), strict=True):
            place = subtract_index(g, i, low)
            inside = g.make("and", (inside, is_within(g, place, n)))
            indices.append(clamp_index(g, place, n))
        return g.make("select", (inside, element_at(g, a, tuple(indices)), fill))

    return make_array(g, shape, kind_of(a), element)


@rule("iota")
def _iota(t: Tracer, eqn: Any, *_: Any) -> Any:
    g, kind, axis = t.graph, kind_of_dtype(eqn.params["dtype"]), eqn.params["dimension"]

    def element(index: tuple[Any, ...]) -> Node:
        node = as_node(g, index[axis])
        return node if kind == "int" else g.make("real", (node,), kind="real")

    return make_array(g, eqn.params["shape"], str(kind), element)


@rule("dynamic_slice")
def _dynamic_slice(t: Tracer, eqn: Any, a: Any, *start: Any) -> Any:
    g, sizes = t.graph, eqn.params["slice_sizes"]
    begin = [clamp_index(g, s, n - k + 1) for s, n, k in zip(start, shape_of(a), sizes, strict=True)]
    return take_slice(g, a, begin, sizes)


@rule("dynamic_update_slice")
def _dynamic_update_slice(t: Tracer, eqn: Any, a: Any, block: Any, *start: Any) -> Any:
    g, sizes, shape = t.graph, shape_of(block), shape_of(a)
    begin = tuple(clamp_index(g, s, n - k + 1) for s, n, k in zip(start, shape, sizes, strict=True))
    if math.prod(shape) > SMALL and is_zero(a) and kind_of(a) == "real":
        return ScatteredBlocks(g, shape, [(begin, block)])

    def element(index: tuple[Any, ...]) -> Node:
        inside, indices = g.const(True, "bool"), []
        for i, s, n in zip(index, begin, sizes, strict=True):
            place = subtract_index(g, i, s)
            inside = g.make("and", (inside, is_within(g, place, n)))
            indices.append(clamp_index(g, place, n))
        if inside.op == "const" and not inside.attr:
            return element_at(g, a, index)
        return g.make("select", (inside, element_at(g, block, tuple(indices)), element_at(g, a, index)))

    return make_array(g, shape, kind_of(a), element)


@rule("empty", "empty2")
def _empty_array(t: Tracer, eqn: Any, *_: Any) -> Any:
    aval = eqn.outvars[0].aval
    kind = kind_of_dtype(aval.dtype)
    filled = ConstantArray(aval.shape, t.graph.const(0, str(kind)))
    return filled if is_long(filled) else unwrap_scalar(materialise(t.graph, filled))


# ---- gathers and scatters


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
            start[d] = element_at(g, indices, (*asked, k))
        for d, e in zip(paired, numbers.start_indices_batching_dims, strict=True):
            start[d] = asked[e]
        sound = g.const(True, "bool")
        for d in numbers.start_index_map:
            room = shape[d] - sizes[d] + 1
            if fills:
                sound = g.make("and", (sound, is_within(g, as_node(g, start[d]), room)))
            start[d] = clamp_index(g, start[d], room)
        for d, e in zip(offsets, numbers.offset_dims, strict=True):
            start[d] = add_index(g, start[d], index[e])
        value = element_at(g, a, tuple(start))
        return g.make("select", (sound, value, fill)) if fills else value

    return make_array(g, tuple(out), kind_of(a), element)


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
            start[d] = element_at(g, indices, (*asked, k))
        for d, e in zip(paired, numbers.scatter_indices_batching_dims, strict=True):
            start[d] = asked[e]
        sound = g.const(True, "bool")
        for d in numbers.scatter_dims_to_operand_dims:
            room = shape[d] - sizes[d] + 1
            if "clip" not in _mode(eqn):
                sound = g.make("and", (sound, is_within(g, as_node(g, start[d]), room)))
            start[d] = clamp_index(g, start[d], room)
        block = np.empty(sizes, object)
        for place in itertools.product(*map(range, sizes)):
            at_update: list[Any] = [0] * len(many)
            for d, i in zip(batch, asked, strict=True):
                at_update[d] = i
            for d, e in zip(inner, windows, strict=True):
                at_update[e] = place[d]
            block[place] = element_at(g, updates, tuple(at_update))
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
        return ScatteredBlocks(g, shape, kept)

    def element(index: tuple[Any, ...]) -> Node:
        changed = element_at(g, a, index)
        for start, block, sound in blocks:
            inside, indices = sound, []
            for i, s, n in zip(index, start, block.shape, strict=True):
                place = subtract_index(g, i, s)
                inside = g.make("and", (inside, is_within(g, place, n)))
                indices.append(clamp_index(g, place, n))
            if inside.op == "const" and not inside.attr:
                continue
            value = element_at(g, block, tuple(indices))
            if adds:
                value = g.make("add", (changed, value))
            changed = g.make("select", (inside, value, changed))
        return changed

    return make_array(g, shape, kind_of(a), element)


@rule("sort")
def _sort(t: Tracer, eqn: Any, *values: Any) -> Any:
    """Stable, by exchanging neighbours: for few elements."""
    g, axis, keys = t.graph, eqn.params["dimension"], eqn.params["num_keys"]
    arrays = [np.moveaxis(materialise(g, v), axis, 0).copy() for v in values]
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
    return [unwrap_scalar(np.moveaxis(a, 0, axis)) for a in arrays]
