"""JAX functions as native kernels: traced to a scalar graph, improved, written as LLVM assembly with muscles in the lanes.

`lower` needs JAX; a `Program` is loaded and run without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .from_jax import lower
    from .program import Program

__all__ = ["Program", "lower"]


def __getattr__(name: str) -> Any:
    """`lower` and `Program`, when first asked for."""
    if name == "lower":
        from .from_jax import lower

        return lower
    if name == "Program":
        from .program import Program

        return Program
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
