"""A muscle that moves between its anchor and the load: tied to both, or with a tendon between braid and load.

Tied, which is the default, the braid has no mass and is as long as its span X while taut. Its only state is the sag e, by
which a slack braid is longer than its span:

    L = X + e,   N = F(L, P') + Ff(z) + Fc(.)               inner tension of the braid: law, friction, creep
    R = N + eta dX/dt                                        below zero where the braid gets longer faster than its span
    taut   e = 0, R >= 0:   dL/dt = dX/dt,    T = max(min(N + c(L) dX/dt, 2 R), 0)
    slack  else:            dL/dt = -N/eta,   T = 0

A slack braid creeps to its free length against the slack damping eta, with a time constant of about `SLACK_TIME`; a tie does
not pull on what sags, and a taut one does not stretch: nothing but the law stands between pressure, span and tension. One
that shortens faster than it could alone pulls with less than its law until 2 R, and T is zero where it sags; otherwise
tension and slack would both be possible, and the rate would jump. The power lost, T dX/dt - N dL/dt, is never
negative: (T - N) dX/dt while taut, N^2/eta while slack. Source: the sweeping process of J. J. Moreau, J. Differential
Equations 26, 1977, doi:10.1016/0022-0396(77)90085-7, with a viscous braid.

With a tendon, braid, friction and creep act on the small mass of a fitting:

    m dv/dt = T - F(L, P') - Ff(z) - Fc(e) - c(L) v,   dL/dt = v,   T = tendon(X - L, dX/dt - v)

The end mass makes tension and slack a state instead of an equation to be solved. Range: below 1 kHz; the muscle pulls less
than its law by what the tendon stretches, which is part of a test machine whose cord it is.

Beyond the longest length of the law the damping c grows, because a braid that is pulled taut does not bounce. A muscle that
lies over a bone has a `Wrap`, and the load then feels another tension than the muscle; a `Clamp` holds a tendon and takes
what it has slipped from the span X. Creep elements are in parallel with the braid.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .._jax import Tree, is_traced, jax, jit, jnp
from ..components import Hysteresis, MemoryElement, Module, Scalar, derivative
from ..components.element import Advanced
from ..components.module import flatten
from ..engine.native import call_in_lanes
from ..errors import InputError
from ..muscles.elements import Tendon
from ..muscles.hysteresis.slip import advanced, contact_energy, contact_force, per_contact
from ..muscles.law import TensionLaw
from ..muscles.plausible import LARGEST_STRAIN
from ..quantities import as_array, quantity, with_unit
from .loads.load import Restraint


class Wrap(Module):
    """Capstan friction; the state is the deflection of its one contact [m], shape (1,).

        Tx = T + k z,   z' = clip(z + dX, T (exp(-mu phi) - 1)/k, T (exp(mu phi) - 1)/k)

    T is the tension on the muscle's side, Tx what the load feels behind the bone, X the span. While it slides, Tx is T
    exp(mu phi) when the load lengthens the muscle and T exp(-mu phi) when the muscle pulls the load; at rest everything
    between the two is possible, which is why a wrapped muscle holds its load. The stiffness k of the contact is
    constant and only its yield follows the tension, so that a rising tension gives no energy back.

    Range: a constant wrap angle, a cord without bending stiffness or mass, dry friction. Source of the ratio: L. Euler,
    1762 (published 1769), as in any text on belts; sticking as in Maxwell-slip friction.
    """

    angle: Scalar = quantity("rad", (0.0, 20.0), "angle over which it lies on the bone", symbol="phi")
    friction: Scalar = quantity("1", (0.0, 2.0), "coefficient of friction", symbol="mu", typical=(0.05, 0.5))
    stiffness: Scalar = quantity(
        "N/m", (1e2, 1e8), "stiffness of the contact before it slides", symbol="k", typical=(1e4, 1e6), default=1e5
    )

    def initial(self) -> Scalar:
        """State without deflection, shape (1,) [m]."""
        return jnp.zeros(1)

    def ratio(self) -> Scalar:
        """Tension of the side that pulls over that of the other while it slides, exp(mu phi) [1]."""
        return jnp.exp(self.friction * self.angle)

    def advance(self, state: Scalar, displacement: Scalar, tension: Scalar) -> Advanced:
        """Move the span by a displacement [m], then limit once with the tension [N] at the end."""
        dx, most = per_contact(displacement), self.ratio()
        pulled = per_contact(tension) / self.stiffness
        low, high = pulled * (1.0 / most - 1.0), pulled * (most - 1.0)
        return advanced(self.stiffness, state, dx, jnp.minimum(jnp.maximum(state + dx, low), high))

    def force(self, state: Scalar) -> Scalar:
        """Force that the bone adds to the tension [N], positive when it opposes lengthening."""
        return contact_force(self.stiffness, state)

    def stored_energy(self, state: Scalar) -> Scalar:
        """Elastic energy of the contact [J]."""
        return contact_energy(self.stiffness, state)


class Clamp(Module):
    """Clamp with a limited grip; the state is the span that it has lost [m].

        d = X - L - Ls - z,   z' = max(z, X - L - Ls - d(G)),   f(d(G)) = G

    d is the stretch of the tendon between muscle and load, z the span that the clamp has lost, G its grip and f the
    tendon's force at rest. The slip is rigid and perfectly plastic: below the grip nothing moves, at the grip the
    tension stays, and what has slipped does not come back. All work at the clamp becomes heat.

    Range: a grip that does not depend on speed or on how far it has slipped; the grip holds by the end of each step of
    the integrator, within which the tension may pass it. Source of the return to the yield limit: J. C. Simo and T. J.
    R. Hughes, Computational Inelasticity, 1998, doi:10.1007/b98904.
    """

    grip: Scalar = quantity("N", (1e-3, 1e9), "tension from which on the clamp slips", symbol="G", typical=(10.0, 1e4))

    def initial(self) -> Scalar:
        """State of a clamp that has not slipped [m]."""
        return jnp.zeros(())

    def advance(self, state: Scalar, tendon: Tendon, stretch: Scalar) -> Advanced:
        """Slip until the tendon pulls with the grip at most.

        Args:
            state: span lost before [m].
            tendon: the cord that the clamp holds.
            stretch: of the tendon beyond its slack length, as if nothing had slipped [m].
        """
        after = jnp.maximum(state, stretch - tendon.stretch(self.grip))
        slack = tendon.slack_length
        freed = tendon.stored_energy(slack + stretch - state) - tendon.stored_energy(slack + stretch - after)
        return Advanced(after, freed, freed)


STOP_TRAVEL = 1.3e-3  # [m]
HALVINGS = 64  # of a bracket: from any length to the last bit
END_MASS = 0.02  # of a fitting between braid and tendon [kg]
SLACK_TIME = 1e-3  # in which a slack braid relaxes where it is stiffest, unless its damping is stated [s]
SLACK_PRESSURES = np.linspace(0.0, 10e5, 11)  # at which its stiffness is looked up for that, gauge [Pa]
STUCK = 2.0**-40  # stretch that no element yields to, a power of two: products with it are exact [m]
LEAST_DAMPING = 1e-3  # of a slack braid that nothing draws to a free length [N s/m]
RETURN_RATE = 1e3  # at which a sag below zero, which is an error of a step, is forgotten [1/s]
RESERVE = 2.0  # tension over the force by which a shortening braid would keep up with its span [1]


class UnitState(NamedTuple):
    """Length of the braid [m] and its rate [m/s]."""

    length: Scalar
    velocity: Scalar


class TiedState(NamedTuple):
    """Length of the braid beyond its span [m]; zero while it is taut."""

    sag: Scalar


class BraidMotion(NamedTuple):
    """Motion of a braid at a moment."""

    length: Scalar  # length of the braid [m]
    velocity: Scalar  # its rate [m/s]
    inner: Scalar  # tension of law, friction and creep [N], signed
    tension: Scalar  # tension between braid and load, never negative [N]


class MuscleLedger(NamedTuple):
    """An element with memory, and what it has taken and turned into heat since the start [J]."""

    state: Scalar
    work: Scalar
    dissipated: Scalar


class MusclePath(NamedTuple):
    """A piece of the motion: changes of length and span [m], gauge pressure at its ends [Pa].

    The tension at its end [N] is a function of the muscle's memory there; only a wrap asks for it. The stretch of the tendon
    at its end is that of a clamp that has not slipped [m]; only a muscle with a clamp needs it.
    """

    length: Scalar
    span: Scalar
    start_pressure: Scalar
    end_pressure: Scalar
    end_tension: Callable[[dict[str, MuscleLedger]], Scalar]
    end_stretch: Scalar = 0.0


class MuscleUnit(Module):
    """A muscle as part of a machine; immutable. Without a tendon it is tied to its anchors.

    A tied muscle has a slack damping, and one with a tendon has an end mass; the other of the two is None.
    """

    law: TensionLaw
    tendon: Tendon | None = None
    friction: Hysteresis | None = None
    creep: MemoryElement | None = None
    wrap: Wrap | None = None
    clamp: Clamp | None = None
    end_mass: Scalar = quantity(
        "kg", (1e-4, 10.0), "mass of the fitting between braid and tendon", symbol="m", default=None
    )
    viscosity: Scalar = quantity("N*s/m", (0.0, 1e4), "internal damping", symbol="c", default=1.0)
    stop_damping: Scalar = quantity(
        "N*s/m", (0.0, 1e4), "further damping beyond the longest length", symbol="cs", default=100.0
    )
    stop_travel: Scalar = quantity(
        "m", (1e-6, 1.0), "stretch beyond the longest length at which that damping is full", default=STOP_TRAVEL
    )
    slack_damping: Scalar = quantity(
        "N*s/m",
        (1e-6, 1e6),
        "resistance of the slack braid on its way to the length that it has alone",
        symbol="eta",
        default=None,
    )
    largest_strain: Scalar = quantity(
        "1", (1e-3, 1.0), "strain beyond the longest length at which the threads break", default=LARGEST_STRAIN
    )

    def __check_init__(self) -> None:
        """Fill in what is left out, drop what the other kind has, and refuse a clamp that holds no tendon."""
        known = self.__dict__
        if self.tendon is None:
            if self.clamp is not None:
                raise InputError("clamp", None, "needs a tendon that it holds, and the muscle has none", where="muscle")
            known["end_mass"] = None
            if known["slack_damping"] is None:
                known["slack_damping"] = as_array(usual_slack_damping(self))
        else:
            known["slack_damping"] = None
            if known["end_mass"] is None:
                known["end_mass"] = as_array(END_MASS)

    def breaking_length(self) -> Scalar:
        """Length of the braid at which its threads break [m]."""
        return (1.0 + self.largest_strain) * self.law.length_range()[1]

    @property
    def mounting(self) -> str:
        """How it is held, one phrase."""
        if self.tendon is None:
            return "tied to its anchors"
        if is_traced(self.tendon.stiffness) or np.ndim(self.tendon.stiffness):
            return "by a tendon"
        return f"by a tendon of {with_unit(float(self.tendon.stiffness), 'N/m')}"

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

    def length(self, state: UnitState | TiedState, span: Scalar) -> Scalar:
        """Length of the braid [m]; the span is that of `held_span`."""
        if isinstance(state, UnitState):
            return state.length
        return span + state.sag

    def motion(
        self,
        state: UnitState | TiedState,
        memory: dict[str, MuscleLedger],
        pressure: Scalar,
        span: Scalar,
        span_velocity: Scalar,
    ) -> BraidMotion:
        """Length, velocity and tension, which is never negative.

        Args:
            state: of the muscle.
            memory: of its elements.
            pressure: gauge pressure [Pa].
            span: that of `held_span` [m].
            span_velocity: its rate [m/s].
        """
        if isinstance(state, UnitState):
            own = braid_tension(self.law, state.length, pressure)
            inner = own + self.memory_force(memory, state.velocity, pressure)
            tension = self.tension(state, memory, pressure, span, span_velocity)
            return BraidMotion(state.length, state.velocity, inner, tension)
        length = self.length(state, span)
        own, resisting = braid_tension(self.law, length, pressure), self._slack_damping(length)
        held = own + self.memory_force(memory, span_velocity, pressure)
        reserve = held + resisting * span_velocity
        sags = (state.sag > 0.0) | (reserve < 0.0)
        pull, most = held + self.damping(length) * span_velocity, RESERVE * reserve
        pull = jnp.where(pull < most, pull, most)
        # Friction that depends on velocity slows a slack braid and may stop it, but never turns it back.
        still = own + self.memory_force(memory, 0.0, pressure)
        free = own + self.memory_force(memory, -still / resisting, pressure)
        free = jnp.where(free * still > 0.0, free, 0.0)
        return BraidMotion(
            length,
            jnp.where(sags, -free / resisting, span_velocity - RETURN_RATE * state.sag),
            jnp.where(sags, free, held),
            jnp.where(sags, 0.0, jnp.where(pull < 0.0, 0.0, pull)),
        )

    def tension(
        self,
        state: UnitState | TiedState,
        memory: dict[str, MuscleLedger],
        pressure: Scalar,
        span: Scalar,
        span_velocity: Scalar,
    ) -> Scalar:
        """Tension of `motion` alone [N]; that of a tendon follows from its stretch, whatever the muscle does inside."""
        if isinstance(state, UnitState):
            assert self.tendon is not None
            return self.tendon.force(span - state.length, span_velocity - state.velocity)
        return self.motion(state, memory, pressure, span, span_velocity).tension

    def _slack_damping(self, length: Scalar) -> Scalar:
        """Damping of the slack braid [N s/m]: no less than the taut one's, or what is slack could not get taut."""
        taut = self.damping(length)
        return jnp.where(self.slack_damping > taut, self.slack_damping, taut)

    def load_tension(self, memory: dict[str, MuscleLedger], tension: Scalar) -> Scalar:
        """Tension that acts on the load, behind the bone [N]."""
        return tension if self.wrap is None else tension + self.wrap.force(memory["wrap"].state)

    def memory_force(self, memory: dict[str, MuscleLedger], velocity: Scalar, pressure: Scalar) -> Scalar:
        """Friction and creep together [N], positive when they oppose lengthening; velocity of the braid [m/s]."""
        forces = (part.force(memory[name].state, velocity, pressure) for name, part in self.parts.items())
        return sum(forces, start=jnp.zeros(()))

    def damping(self, length: Scalar) -> Scalar:
        """Damping at a length of the braid [N s/m]."""
        beyond = (length - self.law.length_range()[1]) / self.stop_travel
        above = jnp.where(beyond > 0.0, beyond, 0.0)
        share = jnp.where(above < 1.0, above, 1.0)
        return self.viscosity + self.stop_damping * (share * share)

    def rate(self, state: UnitState | TiedState, motion: BraidMotion, span_velocity: Scalar) -> UnitState | TiedState:
        """Rates of the state, from what `motion` returned and the rate of the held span [m/s]."""
        if isinstance(state, UnitState):
            push = motion.tension - motion.inner - self.damping(state.length) * state.velocity
            return UnitState(state.velocity, push / self.end_mass)
        return TiedState(motion.velocity - span_velocity)

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
            ahead = {name: memory[name]._replace(state=new.state) for name, new in done.items()}
            tension = path.end_tension({**memory, **ahead})
            done["wrap"] = self.wrap.advance(memory["wrap"].state, path.span, tension)
        if self.clamp is not None:
            assert self.tendon is not None
            done["clamp"] = self.clamp.advance(memory["clamp"].state, self.tendon, path.end_stretch)
        return {
            name: MuscleLedger(new.state, memory[name].work + new.work, memory[name].dissipated + new.dissipated)
            for name, new in done.items()
        }

    def kinetic_and_elastic(self, at: UnitState | BraidMotion, span: Scalar) -> Scalar:
        """Energy of the end mass and of the tendon [J]; a tied muscle has neither."""
        if self.tendon is None:
            return jnp.zeros_like(at.length)
        return 0.5 * self.end_mass * at.velocity**2 + self.tendon.stored_energy(span - at.length)

    def lost(self, motion: BraidMotion, span: Scalar, span_velocity: Scalar) -> Scalar:
        """Power lost in dampers and tendon [W], never negative; the friction's loss is in its ledger.

        Args:
            motion: what `motion` returned.
            span: that of `held_span` [m].
            span_velocity: its rate [m/s].
        """
        if self.tendon is None:
            return motion.tension * span_velocity - motion.inner * motion.velocity
        stretching = span_velocity - motion.velocity
        in_tendon = (motion.tension - self.tendon.force(span - motion.length)) * stretching
        return self.damping(motion.length) * motion.velocity**2 + in_tendon

    def restraint(self, at: BraidMotion, pressure: Scalar, gas_stiffness: Scalar) -> tuple[Restraint, Scalar]:
        """Bound of what the load feels, and of the muscle's own rates [1/s].

        Args:
            at: what `motion` returned.
            pressure: gauge pressure [Pa].
            gas_stiffness: rise of its pressure with the volume taken from it, dP/dV where it is shut in [Pa/m^3].
        """
        if self.tendon is not None:
            cord = self.tendon.stiffness
            held = jnp.where(at.length > self.law.length_range()[1], self.law.thread_stiffness(), 0.0)
            return Restraint(cord, self.tendon.loss * at.tension), jnp.sqrt((cord + held) / self.end_mass)
        per_pressure = derivative(lambda p: self.law.braid_tension(at.length, p), pressure)  # -dV/dL
        stiff = jnp.abs(self.law.braid_stiffness(at.length, pressure)) + gas_stiffness * per_pressure * per_pressure
        stiff, resisting = stiff + memory_stiffness(self, pressure), self._slack_damping(at.length)
        return Restraint(RESERVE * stiff, RESERVE * resisting), stiff / resisting

    def equilibrium(self, span: Scalar, pressure: Scalar) -> UnitState:
        """The length at which the braid balances its tendon or hangs between its anchors at rest; it may be traced.

        Friction and creep are relaxed. A slack braid has its free length. Where the law has none, as without pressure or
        bladder, it lies as long as its span; and none is longer than its law's longest length unless it is pulled there.

        Args:
            span: from the anchor to the load [m].
            pressure: gauge pressure [Pa].
        """
        rest: UnitState = _equilibrium(self, span, pressure)
        return rest

    def resting(self, at: UnitState, span: Scalar) -> UnitState | TiedState:
        """State of the muscle where its braid has a length at rest; the span is that of `held_span` [m]."""
        return at if self.tendon is not None else TiedState(at.length - span)


def memory_stiffness(unit: MuscleUnit, pressure: Scalar) -> Scalar:
    """Stiffness of friction and creep while no element slips or relaxes [N/m]; gauge pressure [Pa]."""
    stretched = stuck_states(unit, unit.initial_memory(), STUCK, pressure)
    return unit.memory_force(stretched, 0.0, pressure) / STUCK


def stuck_states(
    unit: MuscleUnit, memory: dict[str, MuscleLedger], stretch: Scalar, pressure: Scalar
) -> dict[str, MuscleLedger]:
    """Memory after a short, quick stretch [m] in which nothing slips or relaxes; gauge pressure [Pa]."""
    at = {"start_pressure": pressure, "end_pressure": pressure, "duration": 0.0}
    deflected = dict(memory)
    for name, part in unit.parts.items():
        moved = part.advance(part.initial(), stretch, **at).state - part.initial()
        deflected[name] = memory[name]._replace(state=memory[name].state + moved)
    return deflected


def usual_slack_damping(unit: MuscleUnit) -> Scalar:
    """Damping with which a slack braid comes to its free length in `SLACK_TIME` where it is stiffest [N s/m].

    The stiffness is that of the law at its free length, the largest up to 10 bar, with that of stuck friction and creep.
    """
    if any(is_traced(leaf) for leaf in flatten(unit)[0]):
        pressures = jnp.asarray(SLACK_PRESSURES)
        stiffest = jnp.max(jax.vmap(lambda pressure: _free_stiffness(unit, pressure))(pressures))
        return jnp.maximum(SLACK_TIME * stiffest, LEAST_DAMPING)
    # A lane per pressure: in one lane the law and its slopes would be written out for each, and compiled eleven times.
    stiffest = np.max(call_in_lanes(_free_stiffness, (unit,), (SLACK_PRESSURES,)))
    usual: Scalar = np.maximum(SLACK_TIME * stiffest, LEAST_DAMPING)
    return usual


def _free_stiffness(unit: MuscleUnit, pressure: Scalar) -> Scalar:
    """Stiffness of a muscle at its free length, with that of stuck friction and creep [N/m]; gauge pressure [Pa]."""
    own = unit.law.braid_stiffness(unit.law.free_length(pressure), pressure)
    return jnp.where(jnp.isfinite(own) & (own > 0.0), own, 0.0) + memory_stiffness(unit, pressure)


@jit  # traced once for all that asks for it
def braid_tension(law: TensionLaw, length: Scalar, pressure: Scalar) -> Scalar:
    """`TensionLaw.braid_tension`."""
    return law.braid_tension(length, pressure)


@jit
def _equilibrium(unit: MuscleUnit, span: Scalar, pressure: Scalar) -> UnitState:
    """Straight-line, so that thousands of machines are prepared at once."""

    def excess(length: Scalar) -> Any:
        """Pull of the braid over that of its tendon [N]; tied, of itself."""
        own = braid_tension(unit.law, length, pressure)
        return own if unit.tendon is None else own - unit.tendon.force(span - length)

    shortest, longest = unit.law.length_range()
    # Where braid or tendon gets slack.
    hanging = span if unit.tendon is None else span - unit.tendon.slack_length
    taut = (excess(hanging) >= 0.0) & (True if unit.tendon is None else hanging > shortest)
    low = jnp.where(taut, shortest, hanging if unit.tendon is None else jnp.maximum(shortest, hanging))
    high = jnp.where(taut, hanging, jnp.maximum(longest, hanging))

    def halve(_: int, ends: tuple[Tree, Tree]) -> tuple[Tree, Tree]:
        middle = 0.5 * (ends[0] + ends[1])
        above = excess(middle) > 0.0
        return jnp.where(above, ends[0], middle), jnp.where(above, middle, ends[1])

    ends = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
    braid_length = 0.5 * (ends[0] + ends[1])
    length = jnp.where(excess(low) >= 0.0, low, jnp.where(excess(high) <= 0.0, high, braid_length))
    if unit.tendon is None:
        length = jnp.where(taut, span, length)  # its own pull is all that a tie asks for
    return UnitState(length, jnp.zeros_like(length))
