"""McKibben muscles with added elements: a parallel spring and damper, a tendon in series, a delay before the valve.

    T = tendon(X - L) = max(braid(L, P') + spring(L) - Fc(P') + c v, 0)       in steady shortening at v = dX/dt < 0

Beside the braid the spring becomes part of its law, so that tension and volume still come from one potential. The static
solution here and the motion in `twitch_of` are those of a `MuscleUnit`, which a test machine takes as it is. Chou and
Hannaford propose these elements, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753 (discussion).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..._jax import Array, Tree, jax, jnp
from ...assembly.muscle_unit import BraidMotion, MusclePath, MuscleUnit, UnitState
from ...components import Module, Scalar
from ...components.system import Moment, System, Value
from ...engine import march, ramped
from ...muscles.elements import PassiveSpring
from ...muscles.law import TensionLaw
from ...quantities import quantity

HALVINGS = 50


class Accompanied(TensionLaw):
    """A law with a parallel spring: one length, added forces. The spring does not affect the gas.

    Range: that of the law.
    """

    law: TensionLaw  # type: ignore[misc]  # all quantities are keyword-only
    spring: PassiveSpring  # type: ignore[misc]

    title = "With a spring beside it"
    cites = ("chou1996",)
    fitted = ()

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Elastic tension of the braid and the spring [N]."""
        return self.law.elastic_tension(length) + self.spring.force(length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy of the law [J]."""
        return self.law.gas_energy(length, pressure)

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range of lengths of the law [m]."""
        return self.law.length_range()

    def has_volume(self) -> bool:
        """Whether the law has a known volume."""
        return self.law.has_volume()


class Assisted(Module):
    """A muscle with added elements; its span at rest; and a pure delay of its command."""

    unit: MuscleUnit
    rest_span: Scalar = quantity("m", (1e-3, 100.0), "span that counts as the rest length", symbol="X0")
    delay: Scalar = quantity("s", (0.0, 0.2), "pure delay of the command", symbol="td", default=0.0)


def with_spring(unit: MuscleUnit, *, rest_length: float) -> MuscleUnit:
    """Return the muscle with a parallel spring that is slack at first; `rest_length` of the spring in [m]."""
    spring = PassiveSpring(rest_length=rest_length, stiffness=0.0)
    law = Accompanied(law=unit.law, spring=spring, thread_strain=unit.law.thread_strain)
    changed: MuscleUnit = unit.replace(law=law)
    return changed


def steady(
    unit: MuscleUnit, span: Scalar, pressure: Scalar, velocity: Scalar = 0.0, direction: Scalar = 0.0
) -> tuple[Tree, Tree]:
    """Tension of the tendon [N] and length of the braid [m] at rest or in steady motion, elementwise.

    Args:
        unit: the muscle, with a tendon.
        span: between the anchors [m].
        pressure: gauge pressure [Pa].
        velocity: velocity of span and braid alike [m/s], positive while lengthening.
        direction: +1 with the full friction of lengthening, -1 of shortening, 0 without.
    """
    span, pressure, velocity, direction = jnp.broadcast_arrays(
        *(jnp.asarray(x, float) for x in (span, pressure, velocity, direction))
    )
    tendon = unit.tendon
    assert tendon is not None
    rubbing = 0.0 if unit.friction is None else unit.friction.largest_force(pressure)
    resisting = direction * rubbing + unit.viscosity * velocity

    def pull(length: Scalar) -> Any:
        return unit.law.braid_tension(length, pressure) + resisting

    def excess(length: Scalar) -> Any:
        return pull(length) - tendon.force(span - length)

    longest = span - tendon.slack_length

    def halve(_: int, ends: tuple[Tree, Tree]) -> tuple[Tree, Tree]:
        middle = 0.5 * (ends[0] + ends[1])
        over = excess(middle) > 0.0
        return jnp.where(over, ends[0], middle), jnp.where(over, middle, ends[1])

    low = 0.05 * span
    start = jax.lax.stop_gradient(
        0.5 * sum(jax.lax.fori_loop(0, HALVINGS, halve, jax.lax.stop_gradient((low, longest))))
    )
    # One Newton step carries the derivative through the implicit function, as in the law's free length.
    off, stiffness = jax.jvp(excess, (start,), (jnp.ones_like(start),))
    stiffness = jax.lax.stop_gradient(stiffness)
    length = start - jnp.where(stiffness > 0.0, off / jnp.where(stiffness > 0.0, stiffness, 1.0), 0.0)
    taut = pull(longest) > 0.0
    return jnp.where(taut, tendon.force(span - length), 0.0), jnp.where(taut, length, longest)


class Mounted(System):
    """A muscle between fixed ends under a known pressure: input ``pressure`` [Pa], gauge."""

    unit: MuscleUnit
    span: Scalar

    def rate(self, state: UnitState, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of change of length and velocity of the braid."""
        return self.unit.rate(state, self._motion(state, memory, inputs), jnp.zeros(()))

    def _motion(self, state: UnitState, memory: Tree, inputs: Mapping[str, Value]) -> BraidMotion:
        return self.unit.motion(state, memory, inputs["pressure"].value, self.span, jnp.zeros(()))

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Return no integrands."""
        return ()

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Advance the friction along the path."""
        moved = end.state.length - start.state.length
        pressures = start.inputs["pressure"].value, end.inputs["pressure"].value

        def pull(kept: Tree) -> Scalar:
            return self._motion(end.state, kept, end.inputs).tension

        return self.unit.advance_memory(memory, MusclePath(moved, jnp.zeros(()), *pressures, pull), duration)

    def outputs(self, state: UnitState, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Tension and length."""
        return {"tension": self._motion(state, memory, inputs).tension, "length": state.length}


def twitch_of(muscle: Assisted, pressure: Array, period: float) -> jax.Array:
    """Compute the tension [N] between fixed ends at the rest span for a course of pressure, by the stiff method.

    The pressure is that of a muscle that was recorded before; that it would change a little with the length is left out,
    and a run on the test machine shows how little.

    Args:
        muscle: with its elements.
        pressure: gauge pressure at the samples (n,) [Pa], from rest.
        period: period of the samples [s].

    Returns:
        (n,) [N].
    """
    _, length = steady(muscle.unit, muscle.rest_span, pressure[0])
    start = UnitState(length, jnp.zeros(()))
    signal = ramped(pressure).delayed(muscle.delay)
    system = Mounted(unit=muscle.unit, span=muscle.rest_span)
    memory = muscle.unit.initial_memory()
    _, outputs = march(system, start, memory, {"pressure": signal}, period, 1, len(pressure) - 1, True)
    twitch: jax.Array = outputs[2]["tension"]
    return twitch
