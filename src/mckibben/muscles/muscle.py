"""A muscle: its tension law and its friction, addressed as ``muscle.law.thread_length`` and ``muscle.friction.limit``."""

from __future__ import annotations

from typing import Any

from .._jax import jnp
from ..components import Hysteresis, Module, Scalar
from .law import TensionLaw


class Muscle(Module):
    """The components of a specimen; immutable."""

    law: TensionLaw
    friction: Hysteresis | None = None

    def quasi_static_tension(self, span: Any, pressure: Any, direction: Any) -> Scalar:
        """Tension while the muscle is moved slowly one way [N], the law with constant friction.

        Args:
            span: distance between the anchors [m].
            pressure: gauge pressure [Pa].
            direction: +1 while lengthening, -1 while shortening, 0 for the hypothetical static tension.

        Returns:
            max(F + direction Fc(P'), 0): the paper's suggestion where a simple friction is enough (eqs. 12, 13).
        """
        force = self.law.braid_tension(span, pressure)
        if self.friction is not None:
            force = force + direction * self.friction.largest_force(pressure)
        return jnp.maximum(force, 0.0)
