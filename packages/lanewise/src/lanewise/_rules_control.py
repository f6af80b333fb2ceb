"""Rules of calls, choices and loops, and what a loop carries from trip to trip while a function is traced.

A loop of few trips is written out; a longer one stays a loop. What it carries and leaves unchanged, and whole numbers that
it counts up, are no carried values but known ones. What it stacks stands in memory, one row per trip. A long array that is
carried stands in memory in two rows: a trip reads one and writes the other. One that begins as zeros may be only added to,
which is what the derivative of a signal is; then it has one row, and the additions are made in place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ._graph import DOUBLE, Graph, Loop, Node
from ._rules_arrays import make_array
from ._trace import (
    RULES,
    SMALL,
    AccumulatedArray,
    BufferArray,
    ClosedJaxpr,
    ConcatenatedArray,
    ConstantArray,
    LazyArray,
    Literal,
    Refusal,
    Tracer,
    add_index,
    as_node,
    copy_elements,
    element_at,
    flat_index,
    is_long,
    is_zero,
    jaxpr_as_fun,
    materialise,
    rule,
    scale_index,
    shape_of,
    store_table,
    subtract_index,
)
from .errors import LoweringError

# ---- calls and choices


@rule(
    "jit",
    "pjit",
    "closed_call",
    "core_call",
    "custom_jvp_call",
    "custom_vjp_call",
    "custom_vjp_call_jaxpr",
    "remat2",
    "checkpoint",
)
def _call(t: Tracer, eqn: Any, *values: Any) -> list[Any]:
    p = eqn.params
    if eqn.primitive.name == "custom_jvp_call":
        return _with_slopes(t, eqn, values)
    inner = p.get("jaxpr", p.get("call_jaxpr", p.get("fun_jaxpr")))
    return t.call(inner, values) if hasattr(inner, "consts") else t.run(inner, [], values)


def _with_slopes(t: Tracer, eqn: Any, values: tuple[Any, ...]) -> list[Any]:
    """Trace a function with its own derivatives, one input at a time."""
    results = t.run(eqn.params["call_jaxpr"].jaxpr, [t.constant(c) for c in eqn.params["call_jaxpr"].consts], values)
    inputs = [k for k, v in enumerate(values) if isinstance(v, Node) and v.kind == "real" and v.op != "const"]
    numbers = all(isinstance(v, Node) for v in (*values, *results))
    if not numbers or not inputs:
        return results  # of arrays the operations themselves are differentiated
    known = {v: value for v, value in zip(eqn.invars, values, strict=True) if not isinstance(v, Literal)}
    slopes: dict[Any, list[Any]] = {}
    for var in known:
        if known[var].kind == "real" and known[var].op != "const":
            key = id(eqn), list(known).index(var)  # an equation of a compiled function stands for all its calls
            if key not in t.slopes:
                t.slopes[key] = eqn, _slope(eqn, list(known), var)
            exact, t.graph.exact = t.graph.exact, False  # what is multiplied by 0 is gone
            try:
                slopes[var] = t.closed(t.slopes[key][1], list(known.values()))
            finally:
                t.graph.exact = exact
    derivatives: list[Any] = []
    for k, value in enumerate(results):
        rows = [x for var, d in slopes.items() for x in (known[var], d[k])]
        if value.kind != "real" or any(not isinstance(x, Node) for x in rows):
            derivatives.append(value)
        else:
            derivatives.append(t.graph.make("given", (value, *rows), kind="real"))
    return derivatives


def _slope(eqn: Any, names: list[Any], by: Any) -> Any:
    """Jaxpr of the derivatives of a call by one of its inputs."""
    own = eqn.params["call_jaxpr"].jaxpr
    call = jaxpr_as_fun(ClosedJaxpr(own.replace(constvars=[], invars=names, outvars=eqn.outvars, eqns=[eqn]), ()))
    change = tuple(np.zeros(v.aval.shape, _tangent(v)) if v is not by else np.ones((), v.aval.dtype) for v in names)
    shapes = [jax.ShapeDtypeStruct(v.aval.shape, v.aval.dtype) for v in names]
    # The function itself goes, of which only the slopes are wanted: what no result depends on
    closed = jax.make_jaxpr(lambda *element_at: jax.jvp(call, element_at, change)[1])(*shapes)
    wanted, kept = {v for v in closed.jaxpr.outvars if not isinstance(v, Literal)}, []
    for eqn in reversed(closed.jaxpr.eqns):
        if not wanted.isdisjoint(eqn.outvars):
            kept.append(eqn)
            wanted.update(v for v in eqn.invars if not isinstance(v, Literal))
    return ClosedJaxpr(closed.jaxpr.replace(eqns=kept[::-1]), closed.consts)


def _tangent(var: Any) -> Any:
    return var.aval.dtype if jnp.issubdtype(var.aval.dtype, jnp.floating) else jax.dtypes.float0


@rule("cond")
def _cond(t: Tracer, eqn: Any, which: Any, *values: Any) -> list[Any]:
    """Evaluate all branches and select, since lanes cannot jump separately."""
    if isinstance(which, Refusal):
        return [which] * len(eqn.outvars)
    cases = [t.closed(b, values) for b in eqn.params["branches"]]
    results = []
    for outs in zip(*cases, strict=True):
        refused = [v for v in outs if isinstance(v, Refusal)]
        results.append(refused[0] if refused else RULES["select_n"](t, eqn, which, *outs))
    return results


# ---- what a loop carries


def find_invariants(jaxpr: Any, consts: int, count: int, inits: Sequence[Any]) -> tuple[set[int], dict[int, int]]:
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


def replaced_arrays(t: Tracer, inits: Sequence[Any], stays: set[int], added: bool) -> dict[int, DoubleBuffer]:
    """Memory for long arrays that a trip replaces: those that do not begin as zeros, and where nothing is `added`, all."""
    memory = {}
    for k, value in enumerate(inits):
        if k not in stays and is_long(value) and not (added and is_zero(value)):
            if not isinstance(value, AccumulatedArray):
                memory[k] = DoubleBuffer(t.graph, value)
    return memory


def accumulator_memory(
    t: Tracer, inits: Sequence[Any], stays: set[int], replaced: Container[int] = ()
) -> dict[int, AccumulatedArray]:
    """Memory for long arrays that a loop changes by adding to them."""
    g, memory = t.graph, {}
    for k, value in enumerate(inits):
        if k in stays or k in replaced or not (is_long(value) or isinstance(value, AccumulatedArray)):
            continue
        if isinstance(value, AccumulatedArray):
            memory[k] = AccumulatedArray(value.buffer, value.shape)
        elif value.kind != "real":
            raise NotImplementedError("long arrays of whole numbers cannot be carried through a loop")
        else:
            buffer = g.buffer("scratch", "real", value.shape)
            loop = g.open_loop(math.prod(value.shape))
            whole = LazyArray((math.prod(value.shape),), "real", value.at) if len(value.shape) == 1 else None
            if whole is None and value.fill is None:
                raise NotImplementedError(
                    "a long array with several axes can be carried only if it begins as one number"
                )
            node = value.fill if value.fill is not None else element_at(g, whole, (loop.index,))
            g.store(buffer, loop.index, node)
            g.pin()
            g.close_loop(loop, ())
            memory[k] = AccumulatedArray(buffer, value.shape)
            memory[k].filled = g.done(loop)
    return memory


class DoubleBuffer:
    """A long array that a loop replaces in every trip, which reads one row of its memory and writes the other."""

    def __init__(self, g: Graph, init: Any) -> None:
        self.g, self.shape, self.kind, self.size = g, tuple(init.shape), init.kind, math.prod(init.shape)
        self.buffer = g.buffer("scratch", init.kind, (2, self.size), DOUBLE)
        self.filled = self._write(init, 0)

    def _write(self, value: Any, row: Any) -> Node:
        """Write a value to a row; the token of what wrote it."""
        g = self.g
        begin = scale_index(g, row, self.size)
        first = len(g.loops)
        copy_elements(g, value, lambda place, node: g.store(self.buffer, add_index(g, begin, place), node), pinned=True)
        return g.done(g.loops[first])

    def read(self, row: Any, tokens: tuple[Node, ...] = ()) -> LazyArray:
        """The array as it stands in a row."""
        g, begin = self.g, scale_index(self.g, row, self.size)

        def element(index: tuple[Any, ...]) -> Node:
            place = add_index(g, begin, flat_index(g, index, self.shape))
            return g.load(self.buffer, place, tokens=tokens)

        return LazyArray(self.shape, self.kind, element)

    def parity(self, trips: Any) -> Any:
        """The row that holds the value after a number of trips."""
        if isinstance(trips, int):
            return trips % 2
        return self.g.make("iand", (trips, self.g.const(1, "int")))

    def replace(self, value: Any, loop: Loop) -> None:
        """Write the value for the next trip of the loop that is open."""
        if not isinstance(value, LazyArray):
            value = store_table(self.g, np.asarray(value, object))
        self._write(value, subtract_index(self.g, 1, self.parity(loop.index)))


class LoopCarry:
    """Carried values of a loop: the places in JAX's order, and their nodes."""

    def __init__(
        self,
        g: Graph,
        loop: Loop,
        inits: list[Any],
        stays: set[int],
        counts: dict[int, int],
        grown: dict[int, AccumulatedArray],
        replaced: dict[int, DoubleBuffer],
    ) -> None:
        self.g, self.loop, self.inits, self.stays, self.counts, self.grown = g, loop, inits, stays, counts, grown
        self.replaced = replaced
        self.during: list[Any] = []
        for k, value in enumerate(inits):
            if k in grown:
                token = grown[k].filled
                if token is not None:
                    loop.after.append(token)
                self.during.append(grown[k])
            elif k in replaced:
                loop.after.append(replaced[k].filled)
                self.during.append(replaced[k].read(replaced[k].parity(loop.index)))
            elif k in stays:
                self.during.append(value)
            elif k in counts:
                self.during.append(self._counted(k, loop.index))
            else:
                written = materialise(g, value)
                phi = g.carry(loop, written) if isinstance(written, Node) else self._each(written)
                self.during.append(phi)

    def _each(self, written: np.ndarray) -> np.ndarray:
        out = np.empty(written.shape, object)
        for index in np.ndindex(written.shape):
            init: Any = written[index]
            out[index] = self.g.carry(self.loop, init)
        return out

    def _counted(self, k: int, trips: Any) -> Node:
        return as_node(self.g, add_index(self.g, self.inits[k], scale_index(self.g, trips, self.counts[k])))

    def close(self, nexts: Sequence[Any]) -> list[Any]:
        """End the loop; what is in the places afterwards."""
        g, loop, flattened = self.g, self.loop, []
        refused = [v for v in nexts if isinstance(v, Refusal)]
        for k, value in enumerate(nexts):
            if k in self.stays or k in self.counts or refused:
                continue
            if k in self.grown:
                self._add(self.grown[k], value)
            elif k in self.replaced:
                self.replaced[k].replace(value, loop)
            else:
                written = materialise(g, value)
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
                whole = isinstance(value, AccumulatedArray)
                rows = BufferArray(g, own.buffer, own.shape, (g.done(loop),))
                rows.sum_of = own if is_zero(value) else None
                after.append(value if whole else rows)
            elif k in self.replaced:
                last = self.replaced[k].parity(loop.trips)
                after.append(self.replaced[k].read(last, (g.done(loop),)))
            elif isinstance(self.during[k], Node):
                after.append(next(ends))
            else:
                shape = shape_of(self.during[k])
                out = np.empty(shape, object)
                for index in np.ndindex(shape):
                    out[index] = next(ends)
                after.append(out)
        return after

    def _add(self, own: AccumulatedArray, value: Any) -> None:
        if not isinstance(value, AccumulatedArray) or value.buffer is not own.buffer:
            raise NotImplementedError("a long array that a loop carries can only be added to")
        for start, block in value.blocks:
            sizes = shape_of(block)
            copy_to = self._adder(own, start, sizes)
            copy_elements(self.g, block, copy_to)

    def _adder(self, own: AccumulatedArray, start: Any, sizes: tuple[int, ...]) -> Any:
        g, shape = self.g, own.shape
        inner = math.prod(shape[1:])
        if sizes[1:] != tuple(shape[1:]):
            if math.prod(sizes) > SMALL:
                raise NotImplementedError("such a part of a long array can not be added to")
            places = [
                flat_index(g, tuple(add_index(g, s, i) for s, i in zip(start, index, strict=True)), shape)
                for index in np.ndindex(sizes)
            ]
            return lambda place, node: g.store(own.buffer, places[place], node, adds=True)
        begin = scale_index(g, start[0], inner)
        return lambda place, node: g.store(own.buffer, add_index(g, begin, place), node, adds=True)


# ---- loops


FEW, MUCH = 4, 16000  # trips up to which a loop is written out, and trips times operations
LITTLE = 96  # trips times operations up to which more trips are


def count_operations(jaxpr: Any) -> int:
    """Count the operations of a jaxpr, multiplied by the trips of loops."""
    total = 0
    for eqn in jaxpr.eqns:
        inner = [v for p in eqn.params.values() for v in (p if isinstance(p, tuple | list) else [p])]
        inside = sum(count_operations(getattr(v, "jaxpr", v)) for v in inner if hasattr(getattr(v, "jaxpr", v), "eqns"))
        total += (inside or 1) * (eqn.params["length"] if eqn.primitive.name == "scan" else 1)
    return total


def scan_sizes(params: Mapping[str, Any]) -> tuple[int, int]:
    """Count the constants and the carried values of a scan; JAX 0.11 and later state them as a tree of the arguments."""
    if "num_consts" in params:
        return params["num_consts"], params["num_carry"]
    consts, carry, _ = (len(list(part)) for part in params["ft_in"].unpack())
    return consts, carry


@rule("scan")
def _scan(t: Tracer, eqn: Any, *values: Any) -> list[Any]:
    p = eqn.params
    consts, carried = scan_sizes(p)
    known, inits, xs = values[:consts], list(values[consts : consts + carried]), values[consts + carried :]
    length, closed = p["length"], p["jaxpr"]
    if length * count_operations(closed.jaxpr) <= (MUCH if length <= FEW else LITTLE):
        return _unrolled(t, eqn, known, inits, xs)
    refused = [v for v in (*known, *inits, *xs) if isinstance(v, Refusal)]
    if refused:
        return [refused[0]] * len(eqn.outvars)
    g = t.graph
    xs = tuple(store_table(g, x) if isinstance(x, np.ndarray) else x for x in xs)
    stays, counts = find_invariants(closed.jaxpr, consts, len(inits), inits)

    def looped(added: bool) -> list[Any]:
        replaced = replaced_arrays(t, inits, stays, added)
        starts = accumulator_memory(t, inits, stays, replaced)
        loop = g.open_loop(length)
        row = subtract_index(g, length - 1, loop.index) if p["reverse"] else loop.index
        places = LoopCarry(g, loop, inits, stays, counts, starts, replaced)
        rows = [_row(g, x, row) for x in xs]
        results = t.closed(closed, [*known, *places.during, *rows])
        stacked = [_stacked(t, v, loop, row, length) for v in results[len(inits) :]]
        ends = places.close(results[: len(inits)])
        return [*ends, *(_after(g, v, loop) for v in stacked)]

    return _added_or_replaced(t, looped, inits, stays)


def _added_or_replaced(t: Tracer, looped: Callable[[bool], list[Any]], inits: list[Any], stays: set[int]) -> list[Any]:
    """Trace a loop; where a long array that begins as zeros is not only added to, once more with its values replaced."""
    depth = t.graph.depth
    try:
        return looped(True)
    except (NotImplementedError, LoweringError):
        if not any(k not in stays and is_long(v) and is_zero(v) for k, v in enumerate(inits)):
            raise
        t.graph.unwind(depth)
        return looped(False)


def _unrolled(t: Tracer, eqn: Any, known: Any, carry: list[Any], xs: Any) -> list[Any]:
    g, p = t.graph, eqn.params
    count, length = len(carry), p["length"]
    order = range(length - 1, -1, -1) if p["reverse"] else range(length)
    rows: dict[int, list[Any]] = {}
    for i in order:
        part = [x if isinstance(x, Refusal) else _row(g, x, i) for x in xs]
        results = t.closed(p["jaxpr"], [*known, *carry, *part])
        carry, rows[i] = results[:count], results[count:]
    ys = []
    for k, var in enumerate(eqn.outvars[count:]):
        parts = [rows[i][k] for i in range(length)]
        refused = [v for v in parts if isinstance(v, Refusal)]
        ys.append(refused[0] if refused else _stack_of(g, parts, var.aval.shape))
    return [*carry, *ys]


def _stack_of(g: Graph, parts: list[Any], shape: tuple[int, ...]) -> Any:
    if math.prod(shape) <= SMALL:
        out = np.empty(shape, object)
        for i, part in enumerate(parts):
            out[i] = materialise(g, part)
        return out
    grown = [_with_axis(g, part) for part in parts]
    return ConcatenatedArray(g, grown, shape, parts[0].kind)


def _with_axis(g: Graph, part: Any) -> Any:
    return make_array(g, (1, *shape_of(part)), part.kind, lambda i: element_at(g, part, i[1:]))


def _row(g: Graph, x: Any, row: Any) -> Any:
    """One row of an array over which a loop runs."""
    shape = shape_of(x)[1:]
    if isinstance(x, ConstantArray):
        return ConstantArray(shape, x.node) if shape else x.node
    if isinstance(x, LazyArray) and shape:
        return LazyArray(shape, x.kind, lambda i: x.at((row, *i)))
    return make_array(
        g, shape, x.kind if isinstance(x, LazyArray) else x.flat[0].kind, lambda i: element_at(g, x, (row, *i))
    )


def _stacked(t: Tracer, value: Any, loop: Loop, row: Node, length: int) -> Any:
    """Store a trip's result in its row; a result that is equal in all trips needs no memory."""
    g = t.graph
    if isinstance(value, Refusal):
        return value
    if isinstance(value, Node) and value.op == "const":
        return ConstantArray((length,), value)
    if isinstance(value, AccumulatedArray):
        raise NotImplementedError("a long array that a loop changes can not be stacked")
    shape = shape_of(value)
    size = math.prod(shape)
    kind = value.kind if not isinstance(value, np.ndarray) else value.flat[0].kind if value.size else "real"
    buffer = g.buffer("scratch", kind, (length, *shape))
    own = (
        isinstance(value, BufferArray)
        and value.buffer.role == "scratch"
        and value.written
        and value.buffer.within is None
    )
    if own and size > FEW:
        value.buffer.within = (
            buffer,
            (length - 1) * size if row is not loop.index else 0,
            loop,
            -size if row is not loop.index else size,
        )
    else:
        copy_elements(
            g, value, lambda place, node: g.store(buffer, add_index(g, scale_index(g, row, size), place), node)
        )
    return buffer


def _after(g: Graph, value: Any, loop: Loop) -> Any:
    if isinstance(value, LazyArray | Refusal):
        return value
    return BufferArray(g, value, value.shape, (g.done(loop),), written=True)


@rule("while")
def _while(t: Tracer, eqn: Any, *values: Any) -> list[Any]:
    """Lower a loop whose number of trips is known at its start: a count up to a constant limit."""
    g, p = t.graph, eqn.params
    n_cond, n_body = p["cond_nconsts"], p["body_nconsts"]
    cond_consts, known, inits = values[:n_cond], values[n_cond : n_cond + n_body], list(values[n_cond + n_body :])
    refused = [v for v in values if isinstance(v, Refusal)]
    if refused:
        return [refused[0]] * len(eqn.outvars)
    body, cond = p["body_jaxpr"], p["cond_jaxpr"].jaxpr
    stays, counts = find_invariants(body.jaxpr, n_body, len(inits), inits)
    trips = _trips(g, cond, cond_consts, inits, stays, counts, p["cond_jaxpr"])

    def looped(added: bool) -> list[Any]:
        replaced = replaced_arrays(t, inits, stays, added)
        starts = accumulator_memory(t, inits, stays, replaced)
        loop = g.open_loop(trips)
        places = LoopCarry(g, loop, inits, stays, counts, starts, replaced)
        return places.close(t.closed(body, [*known, *places.during]))

    return _added_or_replaced(t, looped, inits, stays)


def _trips(
    g: Graph, cond: Any, consts: Any, inits: list[Any], stays: set[int], counts: dict[int, int], closed: Any
) -> Any:
    refusal = NotImplementedError("only a loop that counts up to a limit, with no other condition, has a kernel")
    if len(cond.eqns) != 1 or cond.eqns[0].primitive.name not in ("lt", "lt_to") or closed.consts:
        raise refusal
    counter, limit = cond.eqns[0].invars
    places = {v: k for k, v in enumerate(cond.invars)}
    k = places.get(counter, -1) - len(consts)
    if counts.get(k) != 1:
        raise refusal
    if isinstance(limit, Literal):
        top: Any = int(limit.val)
    elif places[limit] < len(consts):
        top = consts[places[limit]]
    elif places[limit] - len(consts) in stays:
        top = inits[places[limit] - len(consts)]
    else:
        raise refusal
    trips = g.make("max", (subtract_index(g, top, inits[k]), g.const(0, "int")))
    return trips.attr if trips.op == "const" and trips.attr > 0 else trips
