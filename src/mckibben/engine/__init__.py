"""Time: fixed steps, independent integrals, and result codes with a sentence."""

from .integrate import Result, Run, integrate
from .rates import fastest_rate
from .signals import Signal, held, ramped

__all__ = ["Result", "Run", "Signal", "fastest_rate", "held", "integrate", "ramped"]
