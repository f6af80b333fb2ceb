"""Time: fixed steps, independent integrals, and result codes with a sentence."""

from .integrate import STEP, Result, Run, integrate, march
from .rates import fastest_rate
from .signals import Signal, held, ramped

__all__ = ["Result", "Run", "STEP", "Signal", "fastest_rate", "held", "integrate", "march", "ramped"]
