"""What becomes of loops.

A loop of few trips is written out; a longer one stays a loop. What it carries and leaves unchanged, and whole numbers that
it counts up, are no carried values but known ones. What it stacks stands in memory, one row per trip. A long array that is
carried must be known when the loop begins, and is only added to: this is what the derivative of a signal is.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jax.extend.core import Literal

from .arrays import SMALL, Filled, Growing, Joined, Rows, View, at, minus, plus, shape_of, solid, stored, times
from .carried import Places, grown_memory, steady
from .graph import Graph, Loop, Node
from .rules_arrays import shaped
from .trace import Refused, Tracer, copy, rule

FEW, MUCH = 4, 16000  # trips up to which a loop is written out, and trips times operations
LITTLE = 96  # trips times operations up to which more trips are


def operations(jaxpr: Any) -> int:
    """How many operations a jaxpr has, loops multiplied."""
    total = 0
    for eqn in jaxpr.eqns:
        inner = [v for p in eqn.params.values() for v in (p if isinstance(p, tuple | list) else [p])]
        inside = sum(operations(getattr(v, "jaxpr", v)) for v in inner if hasattr(getattr(v, "jaxpr", v), "eqns"))
        total += (inside or 1) * (eqn.params["length"] if eqn.primitive.name == "scan" else 1)
    return total


@rule("scan")
def _scan(t: Tracer, eqn: Any, *values: Any) -> list[Any]:
    p = eqn.params
    consts, carry = p["num_consts"], p["num_consts"] + p["num_carry"]
    known, inits, xs = values[:consts], list(values[consts:carry]), values[carry:]
    length, closed = p["length"], p["jaxpr"]
    if length * operations(closed.jaxpr) <= (MUCH if length <= FEW else LITTLE):
        return _unrolled(t, eqn, known, inits, xs)
    refused = [v for v in (*known, *inits, *xs) if isinstance(v, Refused)]
    if refused:
        return [refused[0]] * len(eqn.outvars)
    g = t.graph
    xs = tuple(stored(g, x) if isinstance(x, np.ndarray) else x for x in xs)
    stays, counts = steady(closed.jaxpr, consts, len(inits), inits)
    starts = grown_memory(t, inits, stays)
    loop = g.open_loop(length)
    row = minus(g, length - 1, loop.index) if p["reverse"] else loop.index
    places = Places(g, loop, inits, stays, counts, starts)
    rows = [_row(g, x, row) for x in xs]
    found = t.closed(closed, [*known, *places.during, *rows])
    stacked = [_stacked(t, v, loop, row, length) for v in found[len(inits) :]]
    ends = places.close(found[: len(inits)])
    return [*ends, *(_after(g, v, loop) for v in stacked)]


def _unrolled(t: Tracer, eqn: Any, known: Any, carry: list[Any], xs: Any) -> list[Any]:
    g, p = t.graph, eqn.params
    count, length = len(carry), p["length"]
    order = range(length - 1, -1, -1) if p["reverse"] else range(length)
    rows: dict[int, list[Any]] = {}
    for i in order:
        part = [x if isinstance(x, Refused) else _row(g, x, i) for x in xs]
        found = t.closed(p["jaxpr"], [*known, *carry, *part])
        carry, rows[i] = found[:count], found[count:]
    ys = []
    for k, var in enumerate(eqn.outvars[count:]):
        parts = [rows[i][k] for i in range(length)]
        refused = [v for v in parts if isinstance(v, Refused)]
        ys.append(refused[0] if refused else _stack_of(g, parts, var.aval.shape))
    return [*carry, *ys]


def _stack_of(g: Graph, parts: list[Any], shape: tuple[int, ...]) -> Any:
    if math.prod(shape) <= SMALL:
        out = np.empty(shape, object)
        for i, part in enumerate(parts):
            out[i] = solid(g, part)
        return out
    grown = [_with_axis(g, part) for part in parts]
    return Joined(g, grown, shape, parts[0].kind)


def _with_axis(g: Graph, part: Any) -> Any:
    return shaped(g, (1, *shape_of(part)), part.kind, lambda i: at(g, part, i[1:]))


def _row(g: Graph, x: Any, row: Any) -> Any:
    """One row of what a loop goes through."""
    shape = shape_of(x)[1:]
    if isinstance(x, Filled):
        return Filled(shape, x.node) if shape else x.node
    if isinstance(x, View) and shape:
        return View(shape, x.kind, lambda i: x.at((row, *i)))
    return shaped(g, shape, x.kind if isinstance(x, View) else x.flat[0].kind, lambda i: at(g, x, (row, *i)))


def _stacked(t: Tracer, value: Any, loop: Loop, row: Node, length: int) -> Any:
    """Put a trip's result into its row; what is the same in all trips needs no memory."""
    g = t.graph
    if isinstance(value, Refused):
        return value
    if isinstance(value, Node) and value.op == "const":
        return Filled((length,), value)
    if isinstance(value, Growing):
        raise NotImplementedError("a long array that a loop changes can not be stacked")
    shape = shape_of(value)
    size = math.prod(shape)
    kind = value.kind if not isinstance(value, np.ndarray) else value.flat[0].kind if value.size else "real"
    buffer = g.buffer("scratch", kind, (length, *shape))
    own = isinstance(value, Rows) and value.buffer.role == "scratch" and value.written and value.buffer.within is None
    if own and size > FEW:
        value.buffer.within = (
            buffer,
            (length - 1) * size if row is not loop.index else 0,
            loop,
            -size if row is not loop.index else size,
        )
    else:
        copy(g, value, lambda place, node: g.store(buffer, plus(g, times(g, row, size), place), node))
    return buffer


def _after(g: Graph, value: Any, loop: Loop) -> Any:
    if isinstance(value, View | Refused):
        return value
    return Rows(g, value, value.shape, (g.done(loop),), written=True)


@rule("while")
def _while(t: Tracer, eqn: Any, *values: Any) -> list[Any]:
    """A loop whose number of trips is known when it begins: a count up to a limit that stays."""
    g, p = t.graph, eqn.params
    n_cond, n_body = p["cond_nconsts"], p["body_nconsts"]
    cond_consts, known, inits = values[:n_cond], values[n_cond : n_cond + n_body], list(values[n_cond + n_body :])
    refused = [v for v in values if isinstance(v, Refused)]
    if refused:
        return [refused[0]] * len(eqn.outvars)
    body, cond = p["body_jaxpr"], p["cond_jaxpr"].jaxpr
    stays, counts = steady(body.jaxpr, n_body, len(inits), inits)
    trips = _trips(g, cond, cond_consts, inits, stays, counts, p["cond_jaxpr"])
    starts = grown_memory(t, inits, stays)
    loop = g.open_loop(trips)
    places = Places(g, loop, inits, stays, counts, starts)
    return places.close(t.closed(body, [*known, *places.during]))


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
    trips = g.make("max", (minus(g, top, inits[k]), g.const(0, "int")))
    return trips.attr if trips.op == "const" and trips.attr > 0 else trips
