"""A muscle that moves: braid, friction and creep on a small end mass, and a tendon from there to the load.

    m dv/dt = T - F(L, P') - Ff(z) - Fc(e) - c v,   dL/dt = v,   T = tendon(X - L, dX/dt - v)

L is the braid's length, X the span to the load. The end mass makes tension and slack a state instead of an equation to be
solved: a slack braid follows its free length, and when the tendon pulls again nothing has to be found. A tendon that is
wrapped over a bone loses tension where it slides (capstan): the load feels T exp(+-mu phi), more while it lengthens.

Range: below 1 kHz; the mass of 20 g and the tendon's stiffness of 1e5 N/m are of a fitting and a cord, and move the results
of a 1 N/mm muscle by less than 1 %. Source of the capstan equation: L. Euler, 1762, as in any text on belts.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from ..components import Hysteresis, MemoryElement, Module, Scalar
from ..components.element import Advanced
from ..muscles.elements import Tendon
from ..muscles.law import TensionLaw
from ..quantities import quantity

# Speed at which the friction over a bone has 70 % of its direction: it keeps the sign differentiable.
SLIDING = 1e-3  # [m/s]


class UnitState(NamedTuple):
    """Length of the braid [m] and its rate [m/s]."""

    length: Scalar
    velocity: Scalar


class Ledger(NamedTuple):
    """An element with memory, and what it has taken and turned into heat since the start [J]."""

    state: Scalar
    work: Scalar
    dissipated: Scalar


class MuscleUnit(Module):
    """One muscle as part of a machine; immutable."""

    law: TensionLaw
    tendon: Tendon
    friction: Hysteresis | None = None
    creep: MemoryElement | None = None
    end_mass: Scalar = quantity("kg", (1e-4, 10.0), "mass of the moving fitting", symbol="m", default=0.02)
    viscosity: Scalar = quantity("N*s/m", (0.0, 1e4), "internal damping", symbol="c", default=1.0)
    wrap_angle: Scalar = quantity("rad", (0.0, 20.0), "angle that it is wrapped over a bone", symbol="phi", default=0.0)
    wrap_friction: Scalar = quantity("1", (0.0, 2.0), "friction over the bone", symbol="mu", default=0.0)

    @property
    def parts(self) -> dict[str, MemoryElement]:
        """The elements with memory."""
        both = {"friction": self.friction, "creep": self.creep}
        return {name: part for name, part in both.items() if part is not None}

    def initial_memory(self) -> dict[str, Ledger]:
        """Every element relaxed, nothing taken yet."""
        zero = jnp.zeros(())
        return {name: Ledger(part.initial(), zero, zero) for name, part in self.parts.items()}

    def tension(self, state: UnitState, span: Any, span_velocity: Any) -> Scalar:
        """Tension of the tendon at the muscle [N], never negative."""
        return self.tendon.force(span - state.length, span_velocity - state.velocity)

    def load_tension(self, tension: Any, span_velocity: Any) -> Scalar:
        """What the load feels of it behind the bone [N]."""
        way = span_velocity / jnp.sqrt(span_velocity * span_velocity + SLIDING * SLIDING)
        return tension * jnp.exp(self.wrap_friction * self.wrap_angle * way)

    def memory_force(self, memory: dict[str, Ledger], state: UnitState, pressure: Any) -> Scalar:
        """Friction and creep together [N], positive when they oppose lengthening."""
        forces = (part.force(memory[name].state, state.velocity, pressure) for name, part in self.parts.items())
        return sum(forces, start=jnp.zeros(()))

    def rate(self, state: UnitState, memory: dict[str, Ledger], pressure: Any, tension: Any) -> UnitState:
        """Rates of length and velocity; gauge pressure [Pa], tension of the tendon [N]."""
        inner = self.law.braid_tension(state.length, pressure) + self.memory_force(memory, state, pressure)
        push = tension - inner - self.viscosity * state.velocity
        return UnitState(state.velocity, push / self.end_mass)

    def slide(
        self, memory: dict[str, Ledger], displacement: Any, start_pressure: Any, end_pressure: Any, duration: Any
    ) -> dict[str, Ledger]:
        """The memory after a piece of path [m] between two gauge pressures [Pa]."""
        found = {}
        for name, part in self.parts.items():
            done: Advanced = part.advance(
                memory[name].state, displacement,
                start_pressure=start_pressure, end_pressure=end_pressure, duration=duration,
            )  # fmt: skip
            found[name] = Ledger(done.state, memory[name].work + done.work, memory[name].dissipated + done.dissipated)
        return found

    def kinetic_and_elastic(self, state: UnitState, span: Any) -> Scalar:
        """Energy of the end mass and of the tendon [J]."""
        return 0.5 * self.end_mass * state.velocity**2 + self.tendon.stored_energy(span - state.length)

    def lost(self, state: UnitState, span: Any, span_velocity: Any) -> Scalar:
        """Power lost in damper, tendon and over the bone [W]."""
        stretching = span_velocity - state.velocity
        tension = self.tension(state, span, span_velocity)
        in_tendon = (tension - self.tendon.force(span - state.length)) * stretching
        over_bone = (self.load_tension(tension, span_velocity) - tension) * span_velocity
        return self.viscosity * state.velocity**2 + in_tendon + over_bone

    def equilibrium(self, span: float, pressure: float) -> UnitState:
        """The length at which braid and tendon balance at rest, without friction [m]."""
        import numpy as np
        from scipy.optimize import brentq

        def excess(length: float) -> float:
            pull = self.law.braid_tension(length, pressure) - self.tendon.force(span - length)
            return float(pull)

        low, high = (float(end) for end in self.law.length_range())
        high = max(low * (1.0 + 1e-9), min(high, span)) if excess(min(high, span)) > 0.0 else high
        if excess(low) >= 0.0:
            length = low
        elif excess(high) <= 0.0:
            length = high
        else:
            length = brentq(excess, low, high, xtol=1e-14, rtol=1e-15)
        return UnitState(jnp.asarray(np.float64(length)), jnp.zeros(()))
