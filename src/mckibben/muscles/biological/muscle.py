"""A skeletal muscle to compare McKibben muscles with, driven by activation where they are driven by pressure.

    F = Fmax [ a fl(L/L0) fv(v / (vmax L0)) + fp(L/L0) ],   Fmax = tension intensity x cross section

with Gordon's fl, Hill's fv and the passive curve fp. Parallel fibres without pennation or a tendon in series (a
tendon is an element of its own). Range: 0.635-1.6 L0, shortening up to vmax, activation 0..1; finite everywhere else.
Left out: memory of stretch, fatigue, and any dependence of vmax or of the optimal length on activation; no source at
hand bounds the error.
Sources: in the file of each effect; comparison with McKibben muscles: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics
and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NoReturn

from ..._jax import jnp
from ...components import Module, Scalar, derivative
from ...components.evaluation import evaluated
from ...errors import InputError, NoVolumeError, UnreachableError
from ...quantities import quantity, with_unit
from ..law import LawState
from . import activation as activation_dynamics
from . import gordon, hill, passive


class BiologicalMuscle(Module):
    """Tension of a biological muscle, with the questions and answers of a `TensionLaw`.

    It is a sibling of `TensionLaw` and no subclass, for the promise of that type cannot be kept here: a law derives
    tension *and gas volume* from one potential and so conserves energy in every closed cycle. A muscle holds no gas;
    its second argument is an activation [1] and not a pressure [Pa]; its tension depends on velocity; and it turns
    chemical energy into work round a cycle, which is what it is for. Whatever asks a law for tension, parts,
    stiffness, free length, range and state may ask a muscle the same by the same names; whatever needs a volume is
    told `NoVolumeError`. Activations are limited to 0..1. Lengths [m] and velocities [m/s, positive while
    lengthening] of any shape broadcast.
    """

    rest_length: Scalar = quantity("m", (1e-4, 10.0), "optimal length, where the plateau begins", symbol="L0")
    section_area: Scalar = quantity("m^2", (1e-12, 1.0), "physiological cross section", symbol="A")
    maximum_tension_intensity: Scalar = quantity(
        "N/m^2", (1e3, 1e7), "largest isometric tension per cross section", symbol="sigma", typical=(1e5, 5e5)
    )
    maximum_velocity: Scalar = quantity(
        "1/s", (1e-3, 1e3), "largest shortening velocity in rest lengths", symbol="vmax", typical=(1.0, 20.0)
    )
    shortest_active_length: Scalar = quantity(
        "1", (0.1, 0.75), "length over L0 where active tension begins", symbol="x1", default=gordon.SHORTEST
    )
    knee_length: Scalar = quantity(
        "1", (0.76, 0.99), "knee of the ascending limb, over L0", symbol="x2", default=gordon.KNEE
    )
    knee_tension: Scalar = quantity(
        "1", (0.0, 1.0), "active tension at the knee, relative", symbol="f2", default=gordon.KNEE_TENSION
    )
    plateau_end: Scalar = quantity(
        "1", (1.0, 1.4), "end of the plateau, over L0", symbol="x4", default=gordon.PLATEAU_END
    )
    longest_active_length: Scalar = quantity(
        "1", (1.41, 3.0), "length over L0 where active tension ends", symbol="x5", default=gordon.LONGEST
    )
    passive_onset: Scalar = quantity(
        "1", (0.5, 2.0), "length over L0 where passive tension begins", symbol="xp", default=1.0
    )
    passive_strain: Scalar = quantity(
        "1", (0.05, 5.0), "strain beyond it at which it equals Fmax", symbol="ep", typical=(0.3, 1.0), default=0.6
    )
    curvature: Scalar = quantity("1", (0.02, 5.0), "Hill's a/F0", symbol="c", typical=(0.1, 0.5), default=0.25)
    lengthening_tension: Scalar = quantity(
        "1", (1.01, 3.0), "plateau of tension while lengthening, over the isometric one", symbol="m", default=1.4
    )
    rise_time: Scalar = quantity("s", (1e-4, 10.0), "time constant of activation", symbol="tr", default=0.015)
    fall_time: Scalar = quantity("s", (1e-4, 10.0), "time constant of deactivation", symbol="tf", default=0.05)

    name: ClassVar[str] = "biological"
    title: ClassVar[str] = "Biological muscle"
    cites: ClassVar[tuple[str, ...]] = ("gordon1966", "hill1938", "thelen2003", "chou1996")

    # ---- relative curves

    def active_curve(self, relative_length: Scalar) -> Scalar:
        """Isometric active tension over Fmax at full activation [1], against L/L0 [1]."""
        return gordon.active_curve(
            relative_length,
            shortest=self.shortest_active_length,
            knee=self.knee_length,
            knee_tension=self.knee_tension,
            plateau_end=self.plateau_end,
            longest=self.longest_active_length,
        )

    def passive_curve(self, relative_length: Scalar) -> Scalar:
        """Passive tension over Fmax [1], against L/L0 [1]."""
        return passive.passive_curve(relative_length, onset=self.passive_onset, strain=self.passive_strain)

    def velocity_curve(self, relative_velocity: Scalar) -> Scalar:
        """Active tension over the isometric one [1], against velocity over vmax [1], positive while lengthening."""
        return hill.velocity_curve(
            relative_velocity, curvature=self.curvature, lengthening_tension=self.lengthening_tension
        )

    # ---- the muscle between its anchors: it never pushes, for both parts are never negative

    @property
    def maximum_tension(self) -> Scalar:
        """Fmax, the largest isometric active tension [N]."""
        return self.maximum_tension_intensity * self.section_area

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Passive tension [N], the total without activation."""
        return self.maximum_tension * self.passive_curve(jnp.asarray(length, float) / self.rest_length)

    @evaluated
    def active_tension(self, length: Scalar, activation: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Active part of the tension [N] at a velocity [m/s]."""
        length, activation, velocity = _together(length, activation, velocity)
        isometric = jnp.clip(activation, 0.0, 1.0) * self.active_curve(length / self.rest_length)
        relative_velocity = velocity / (self.maximum_velocity * self.rest_length)
        return self.maximum_tension * isometric * self.velocity_curve(relative_velocity)

    @evaluated
    def tension(self, span: Scalar, activation: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Tension on the anchors [N], never negative."""
        span, activation, velocity = _together(span, activation, velocity)
        return self.elastic_tension(span) + self.active_tension(span, activation, velocity)

    @evaluated
    def stiffness(self, span: Scalar, activation: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """dF/dL at constant activation and velocity [N/m]; negative on the descending limb, zero when slack."""
        span, activation, velocity = _together(span, activation, velocity)
        slack = self.tension(span, activation, velocity) <= 0.0
        return jnp.where(slack, 0.0, derivative(lambda x: self.tension(x, activation, velocity), span))

    @evaluated
    def damping(self, span: Scalar, activation: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """dF/dv at constant length and activation [N s/m], never negative; largest at small velocities."""
        span, activation, velocity = _together(span, activation, velocity)
        return derivative(lambda v: self.tension(span, activation, v), velocity)

    @evaluated
    def free_length(self, activation: Scalar) -> Scalar:
        """The longest length at which the muscle carries no tension at rest [m]; below it hangs slack."""
        activation = jnp.asarray(activation, float)
        excited = jnp.minimum(self.shortest_active_length, self.passive_onset)
        length = self.rest_length * jnp.where(activation > 0.0, excited, self.passive_onset)
        return jnp.where(jnp.isnan(activation), jnp.nan, length)

    @evaluated
    def state(self, span: Scalar, activation: Scalar, velocity: Scalar = 0.0) -> LawState:
        """Evaluate the complete state; `volume` is NaN, and `braid_length` the length of the fibres."""
        span, activation, velocity = _together(span, activation, velocity)
        passive_part, active = self.elastic_tension(span), self.active_tension(span, activation, velocity)
        return LawState(
            tension=passive_part + active,
            passive=passive_part,
            active=active,
            volume=jnp.full_like(active, jnp.nan),
            stiffness=self.stiffness(span, activation, velocity),
            braid_length=jnp.maximum(span, self.free_length(activation)),
            slack=passive_part + active <= 0.0,
            overstretched=self.overstretched(span),
        )

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Shortest and longest length with active tension [m]; beyond the longest it is overstretched."""
        return self.shortest_active_length * self.rest_length, self.longest_active_length * self.rest_length

    def overstretched(self, span: Scalar) -> Scalar:
        """Whether the filaments no longer overlap."""
        return jnp.asarray(span, float) > self.length_range()[1]

    def has_volume(self) -> bool:
        """Return False, since there is no gas."""
        return False

    def volume(self, span: Scalar, activation: Scalar) -> NoReturn:
        """Raise an error: a biological muscle has no gas volume.

        Raises:
            NoVolumeError: always.
        """
        raise NoVolumeError("a biological muscle holds no gas")

    def activation_for(self, tension: float, span: float, velocity: float = 0.0) -> float:
        """The lowest activation [1] at which the muscle pulls with a tension [N].

        Raises:
            UnreachableError: if the passive part alone pulls more, or full activation less; it says what they give.
        """
        if not (math.isfinite(tension) and tension >= 0.0):
            raise InputError("tension", None, f"must be 0 N or more, got {tension:.6g} N")
        if not math.isfinite(span):
            raise InputError("span", None, f"must be a number, got {span} m")
        low, high = (float(self.tension(span, a, velocity)) for a in (0.0, 1.0))
        slack = 1e-9 * max(tension, 1.0)
        if not low - slack <= tension <= high + slack:
            raise UnreachableError(
                f"{tension:.4g} N at {with_unit(float(span), 'm')} is not reached between no and full activation: "
                f"the muscle pulls with {low:.4g} to {high:.4g} N there"
            )
        return min(max((tension - low) / (high - low), 0.0), 1.0) if high > low else 0.0

    # ---- the way from excitation to activation

    def activation_rate(self, activation: Scalar, excitation: Scalar) -> Scalar:
        """da/dt [1/s] at an excitation [1]."""
        return activation_dynamics.rate(activation, excitation, rise_time=self.rise_time, fall_time=self.fall_time)

    def advance_activation(self, activation: Scalar, excitation: Scalar, dt: Scalar) -> Scalar:
        """The activation [1] after a time [s] at constant excitation [1], exactly."""
        times = {"rise_time": self.rise_time, "fall_time": self.fall_time}
        return activation_dynamics.advance(activation, excitation, dt, **times)


def _together(*values: Any) -> tuple[Scalar, ...]:
    return tuple(jnp.broadcast_arrays(*(jnp.asarray(value, float) for value in values)))
