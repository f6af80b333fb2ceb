"""A muscle that moves: braid, friction and creep on a small end mass, and a tendon from there to the load.

    m dv/dt = T - F(L, P') - Ff(z) - Fc(e) - c(L) v,   dL/dt = v,   T = tendon(X - L, dX/dt - v)

L is the braid's length, X the span to the load. The end mass makes tension and slack a state instead of an equation to be
solved: a slack braid follows its free length, and when the tendon pulls again nothing has to be found. Beyond the longest
length of the law the damping c grows, because a braid that is pulled taut does not bounce. A muscle that lies over a bone
has a `Wrap`, and the load then feels another tension than the muscle; a `Clamp` takes what it has slipped from the span X.

Range: below 1 kHz; the mass of 20 g and the tendon's stiffness of 1e5 N/m are of a fitting and a cord, and move the results
of a muscle of 1-10 N/mm by less than a few percent. Creep elements are in parallel with the braid.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .._jax import Tree, jax, jit, jnp
from ..components import Hysteresis, MemoryElement, Module, Scalar
from ..components.element import Advanced
from ..muscles.elements import Tendon
from ..muscles.law import TensionLaw
from ..quantities import quantity
from .clamp import Clamp
from .wrap import Wrap

# Stretch beyond the law's longest length at which the damping of the stop is full [m].
STOP_TRAVEL = 1.3e-3
HALVINGS = 64  # of a bracket: from any length to the last bit


class UnitState(NamedTuple):
    """Length of the braid [m] and its rate [m/s]."""

    length: Scalar
    velocity: Scalar


class MuscleLedger(NamedTuple):
    """An element with memory, and what it has taken and turned into heat since the start [J]."""

    state: Scalar
    work: Scalar
    dissipated: Scalar


class MusclePath(NamedTuple):
    """A piece of the motion: changes of length and span [m], gauge pressure at its ends [Pa], tension at its end [N].

    The stretch of the tendon at its end is that of a clamp that has not slipped [m]; only a muscle with a clamp needs it.
    """

    length: Scalar
    span: Scalar
    start_pressure: Scalar
    end_pressure: Scalar
    end_tension: Scalar
    end_stretch: Scalar = 0.0


class MuscleUnit(Module):
    """A muscle as part of a machine; immutable."""

    law: TensionLaw
    tendon: Tendon
    friction: Hysteresis | None = None
    creep: MemoryElement | None = None
    wrap: Wrap | None = None
    clamp: Clamp | None = None
    end_mass: Scalar = quantity("kg", (1e-4, 10.0), "mass of the moving fitting", symbol="m", default=0.02)
    viscosity: Scalar = quantity("N*s/m", (0.0, 1e4), "internal damping", symbol="c", default=1.0)
    stop_damping: Scalar = quantity(
        "N*s/m", (0.0, 1e4), "further damping beyond the longest length", symbol="cs", default=100.0
    )

    @property
    def parts(self) -> dict[str, MemoryElement]:
        """Elements with memory, parallel to the braid."""
        both = {"friction": self.friction, "creep": self.creep}
        return {name: part for name, part in both.items() if part is not None}

    def initial_memory(self) -> dict[str, MuscleLedger]:
        """Memory with every element relaxed and zero accounts."""
        zero = jnp.zeros(())
        states = {name: part.initial() for name, part in self.parts.items()}
        if self.wrap is not None:
            states["wrap"] = self.wrap.initial()
        if self.clamp is not None:
            states["clamp"] = self.clamp.initial()
        return {name: MuscleLedger(state, zero, zero) for name, state in states.items()}

    def held_span(self, memory: dict[str, MuscleLedger], span: Scalar) -> Scalar:
        """Span between the muscle's anchor and what holds the tendon [m]: less what the clamp has slipped."""
        return span if self.clamp is None else span - memory["clamp"].state

    def tension(self, state: UnitState, span: Scalar, span_velocity: Scalar) -> Scalar:
        """Tension of the tendon at the muscle [N], never negative; the span is that of `held_span`."""
        return self.tendon.force(span - state.length, span_velocity - state.velocity)

    def load_tension(self, memory: dict[str, MuscleLedger], tension: Scalar) -> Scalar:
        """Tension that acts on the load, behind the bone [N]."""
        return tension if self.wrap is None else tension + self.wrap.force(memory["wrap"].state)

    def memory_force(self, memory: dict[str, MuscleLedger], state: UnitState, pressure: Scalar) -> Scalar:
        """Friction and creep together [N], positive when they oppose lengthening."""
        forces = (part.force(memory[name].state, state.velocity, pressure) for name, part in self.parts.items())
        return sum(forces, start=jnp.zeros(()))

    def damping(self, length: Scalar) -> Scalar:
        """Damping at a length of the braid [N s/m]."""
        beyond = (length - self.law.length_range()[1]) / STOP_TRAVEL
        above = jnp.where(beyond > 0.0, beyond, 0.0)
        share = jnp.where(above < 1.0, above, 1.0)
        return self.viscosity + self.stop_damping * (share * share)

    def rate(self, state: UnitState, memory: dict[str, MuscleLedger], pressure: Scalar, tension: Scalar) -> UnitState:
        """Rates of length and velocity; gauge pressure [Pa], tension of the tendon [N]."""
        inner = braid_tension(self.law, state.length, pressure) + self.memory_force(memory, state, pressure)
        push = tension - inner - self.damping(state.length) * state.velocity
        return UnitState(state.velocity, push / self.end_mass)

    def advance_memory(
        self, memory: dict[str, MuscleLedger], path: MusclePath, duration: Scalar
    ) -> dict[str, MuscleLedger]:
        """Advance the memory along a part of the motion that lasts a time [s]."""
        done: dict[str, Advanced] = {
            name: part.advance(
                memory[name].state,
                path.length,
                start_pressure=path.start_pressure,
                end_pressure=path.end_pressure,
                duration=duration,
            )
            for name, part in self.parts.items()
        }
        if self.wrap is not None:
            done["wrap"] = self.wrap.advance(memory["wrap"].state, path.span, path.end_tension)
        if self.clamp is not None:
            done["clamp"] = self.clamp.advance(memory["clamp"].state, self.tendon, path.end_stretch)
        return {
            name: MuscleLedger(new.state, memory[name].work + new.work, memory[name].dissipated + new.dissipated)
            for name, new in done.items()
        }

    def kinetic_and_elastic(self, state: UnitState, span: Scalar) -> Scalar:
        """Energy of the end mass and of the tendon [J]."""
        return 0.5 * self.end_mass * state.velocity**2 + self.tendon.stored_energy(span - state.length)

    def lost(self, state: UnitState, span: Scalar, span_velocity: Scalar) -> Scalar:
        """Power lost in damper and tendon [W], never negative; the friction's loss is in its ledger."""
        stretching = span_velocity - state.velocity
        tension = self.tension(state, span, span_velocity)
        in_tendon = (tension - self.tendon.force(span - state.length)) * stretching
        return self.damping(state.length) * state.velocity**2 + in_tendon

    def equilibrium(self, span: Scalar, pressure: Scalar) -> UnitState:
        """The length at which braid and tendon balance at rest, without friction and creep; it may be traced.

        A slack braid has its free length. Where the law has none, as without pressure or bladder, it lies as long as its
        span; and none is longer than its law's longest length unless it is pulled there.

        Args:
            span: from the anchor to the load [m].
            pressure: gauge pressure [Pa].
        """
        rest: UnitState = _equilibrium(self, span, pressure)
        return rest


@jit  # traced once for all that asks for it
def braid_tension(law: TensionLaw, length: Scalar, pressure: Scalar) -> Scalar:
    """`TensionLaw.braid_tension`."""
    return law.braid_tension(length, pressure)


@jit
def _equilibrium(unit: MuscleUnit, span: Scalar, pressure: Scalar) -> UnitState:
    """Straight-line, so that thousands of machines are prepared at once."""

    def excess(length: Scalar) -> Any:
        """Pull of the braid over that of its tendon [N]."""
        return braid_tension(unit.law, length, pressure) - unit.tendon.force(span - length)

    shortest, longest = unit.law.length_range()
    hanging = span - unit.tendon.slack_length  # the tendon gets slack here
    taut = (hanging > shortest) & (excess(hanging) >= 0.0)
    low = jnp.where(taut, shortest, jnp.maximum(shortest, hanging))
    high = jnp.where(taut, hanging, jnp.maximum(longest, hanging))

    def halve(_: int, ends: tuple[Tree, Tree]) -> tuple[Tree, Tree]:
        middle = 0.5 * (ends[0] + ends[1])
        above = excess(middle) > 0.0
        return jnp.where(above, ends[0], middle), jnp.where(above, middle, ends[1])

    ends = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
    braid_length = 0.5 * (ends[0] + ends[1])
    length = jnp.where(excess(low) >= 0.0, low, jnp.where(excess(high) <= 0.0, high, braid_length))
    return UnitState(length, jnp.zeros_like(length))
