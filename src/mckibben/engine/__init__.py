"""Time: fixed steps, independent integrals, and result codes with a sentence.

What stands here is loaded when first asked for: a saved kernel runs without JAX, which all of it needs.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .integration import STEP, Result, Run, integrate, march
    from .rates import fastest_rate
    from .signals import Signal, held, ramped

__all__ = ["Result", "Run", "STEP", "Signal", "fastest_rate", "held", "integrate", "march", "ramped"]
_PLACES = {"fastest_rate": "rates", "Signal": "signals", "held": "signals", "ramped": "signals"}


def __getattr__(name: str) -> Any:
    """Load the names of `__all__` from their modules on first use."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_PLACES.get(name, 'integration')}"), name)
    globals()[name] = value
    return value
