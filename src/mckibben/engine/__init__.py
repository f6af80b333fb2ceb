"""Time: fixed steps, independent integrals, and result codes with a sentence.

What stands here is loaded when first asked for: a saved kernel runs without JAX, which all of it needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._lazy import lazy_names

if TYPE_CHECKING:
    from .integration import STEP as STEP
    from .integration import Result as Result
    from .integration import Run as Run
    from .integration import compile_march as compile_march
    from .integration import integrate as integrate
    from .integration import march as march
    from .native import differentiable as differentiable
    from .rates import fastest_rate as fastest_rate
    from .signals import Signal as Signal
    from .signals import Value as Value
    from .signals import held as held
    from .signals import ramped as ramped

lazy_names(__name__)
