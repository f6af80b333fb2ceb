"""What becomes of calls and choices."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import ClosedJaxpr, Literal, jaxpr_as_fun

from .graph import Node
from .trace import RULES, Refused, Tracer, rule


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
    return t.closed(inner, values) if hasattr(inner, "consts") else t.run(inner, [], values)


def _with_slopes(t: Tracer, eqn: Any, values: tuple[Any, ...]) -> list[Any]:
    """A function that says its derivatives itself: they are traced beside it, one input at a time."""
    found = t.run(eqn.params["call_jaxpr"].jaxpr, [t.constant(c) for c in eqn.params["call_jaxpr"].consts], values)
    inputs = [k for k, v in enumerate(values) if isinstance(v, Node) and v.kind == "real" and v.op != "const"]
    numbers = all(isinstance(v, Node) for v in (*values, *found))
    if not numbers or not inputs:
        return found  # of arrays the operations themselves are differentiated
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
    told: list[Any] = []
    for k, value in enumerate(found):
        rows = [x for var, d in slopes.items() for x in (known[var], d[k])]
        if value.kind != "real" or any(not isinstance(x, Node) for x in rows):
            told.append(value)
        else:
            told.append(t.graph.make("given", (value, *rows), kind="real"))
    return told


def _slope(eqn: Any, names: list[Any], by: Any) -> Any:
    """The derivatives of a call by one of its inputs, as a jaxpr of all of them."""
    own = eqn.params["call_jaxpr"].jaxpr
    call = jaxpr_as_fun(ClosedJaxpr(own.replace(constvars=[], invars=names, outvars=eqn.outvars, eqns=[eqn]), ()))
    change = tuple(jnp.zeros(v.aval.shape, _tangent(v)) if v is not by else jnp.ones(()) for v in names)
    shapes = [jax.ShapeDtypeStruct(v.aval.shape, v.aval.dtype) for v in names]
    return _needed(jax.make_jaxpr(lambda *at: jax.jvp(call, at, change)[1])(*shapes))


def _needed(closed: Any) -> Any:
    """A jaxpr without what its results do not depend on: the function itself, of which only the slopes are wanted."""
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
    """All branches, and a choice: there is no lane of its own that could jump."""
    if isinstance(which, Refused):
        return [which] * len(eqn.outvars)
    cases = [t.closed(b, values) for b in eqn.params["branches"]]
    found = []
    for outs in zip(*cases, strict=True):
        refused = [v for v in outs if isinstance(v, Refused)]
        found.append(refused[0] if refused else RULES["select_n"](t, eqn, which, *outs))
    return found
