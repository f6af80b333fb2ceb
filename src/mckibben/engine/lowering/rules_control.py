"""What becomes of calls and choices."""

from __future__ import annotations

from typing import Any

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
    inner = p.get("jaxpr", p.get("call_jaxpr", p.get("fun_jaxpr")))
    return t.closed(inner, values) if hasattr(inner, "consts") else t.run(inner, [], values)


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
