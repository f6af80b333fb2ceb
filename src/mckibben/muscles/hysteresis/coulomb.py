"""Constant Coulomb friction: a function of the sign of the velocity, without memory.

    F = Fc(P') s(v/vs),   s(u) = u (3 - u^2)/2 within -1 < u < 1, -1 or 1 beyond; sign(v) for vs = 0

Positive while lengthening, negative while shortening: +-2.5 N for the nylon muscle, +-5 N for the fiberglass and the
Bridgestone muscle. Range: slow motion in one direction. It keeps no history, so it cannot narrow a loop when the
range is halved, and at rest it knows no force. A simulation needs a smoothing velocity vs, or the force chatters at
rest; it acts there like a damper of 1.5 Fc/vs.
Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from typing import Any

from ..._jax import jnp
from ...components import Scalar
from ...components.element import Advanced, Hysteresis
from ...quantities import quantity
from .slip import FrictionLimit


class Coulomb(Hysteresis):
    """Coulomb friction; its state is empty, since it remembers nothing."""

    limit: FrictionLimit
    smoothing_velocity: Scalar = quantity(
        "m/s", (0.0, 10.0), "speed from which the friction is full", symbol="vs", typical=(1e-4, 1e-2), default=0.0
    )

    title = "Coulomb"
    cites = ("chou1996",)

    def initial(self) -> Scalar:
        """Empty state, shape (0,)."""
        return jnp.zeros(0)

    def advance(
        self,
        state: Scalar,
        displacement: Scalar,
        *,
        start_pressure: Scalar,
        end_pressure: Scalar,
        duration: Scalar = 0.0,
    ) -> Advanced:
        """Dissipate the work of the friction at the mean velocity dx/duration, of full friction in no time at all."""
        moved = jnp.asarray(displacement, float)
        largest = 0.5 * (self.limit.force(start_pressure) + self.limit.force(end_pressure))
        work = largest * _direction(moved, self.smoothing_velocity * duration) * moved
        return Advanced(state, work, work)

    def force(self, state: Scalar, velocity: Scalar = 0.0, pressure: Scalar = 0.0) -> Scalar:
        """Friction force at a velocity [m/s] and gauge pressure [Pa] [N]."""
        return self.limit.force(pressure) * _direction(jnp.asarray(velocity, float), self.smoothing_velocity)

    def stored_energy(self, state: Scalar) -> Scalar:
        """Zero: nothing is elastic [J]."""
        return jnp.sum(state, axis=-1)

    def largest_force(self, pressure: Scalar) -> Scalar:
        """Fc(P') [N]."""
        return self.limit.force(pressure)

    def lubricated(self, factor: float = 0.9) -> Coulomb:
        """Return the friction with its limit scaled."""
        return self.replace(limit=self.limit.scaled(factor))


def _direction(motion: Any, width: Scalar) -> Scalar:
    """The sign of a motion, rounded within +-width; the width and the motion share a unit."""
    sharp = jnp.where(motion == 0.0, 0.0, jnp.sign(motion))  # what is no number stays none
    rounded = width > 0.0
    u = jnp.clip(motion / jnp.where(rounded, width, 1.0), -1.0, 1.0)
    return jnp.where(rounded, 0.5 * u * (3.0 - u * u), sharp)
