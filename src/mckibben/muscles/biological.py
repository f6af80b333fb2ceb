"""A skeletal muscle to compare McKibben muscles with, driven by activation where they are driven by pressure.

    F = Fmax [ a fl(L/L0) fv(v / (vmax L0)) + fp(L/L0) ],   Fmax = tension intensity x cross section

All curves are relative: lengths to the rest (optimal) length L0, velocities to the largest shortening velocity, tensions to
the largest isometric tension; only the muscle knows metres and newtons. Parallel fibres without pennation or a tendon in
series (a tendon is an element of its own). Range: 0.635-1.6 L0, shortening up to vmax, activation 0..1; finite everywhere
else. Left out: memory of stretch, fatigue, and any dependence of vmax or of the optimal length on activation; no source at
hand bounds the error.

**Active tension against length**, fl: the polygon of Gordon, Huxley and Julian for frog striated muscle.

    sarcomere length [um]      1.27    1.67    2.00    2.25    3.65
    over L0 = 2.00 um          0.635   0.835   1.000   1.125   1.825
    relative active tension    0       0.84    1       1       0

The limb below the plateau has two slopes: the thin filaments begin to overlap at L0, the thick ones meet the Z discs at the
knee. It is exactly zero outside the outer nodes and exactly one on the plateau; at a node the derivative is the mean of
both sides. It is their schematic summary: the measured tension rounds the corners, and they saw the full tension between
2.05 and 2.2 um.

**Tension against velocity**, fv: Hill's hyperbola for shortening, and its continuation for lengthening.

    f = (1 - u) / (1 + u/c)                            shortening at u = -v/vmax, zero from u = 1 on        (Hill)
    f = 1 + (m - 1) w / (w + s)                        lengthening at w = v/vmax, towards the plateau m
        with s = (m - 1) c / (1 + c)

c = a/F0 is Hill's curvature, 0.25 for typical skeletal muscle; the power f u then peaks at 0.095 Fmax vmax, which is the
"about 0.1" of McMahon. The scale s makes the slope continuous at v = 0. That is a choice: Katz found the slope on the
lengthening side several times steeper. Never negative; lengthening faster than about vmax is extrapolation. At -vmax, where
the tension ends, the derivative is the mean of both sides.

**Passive tension**, fp = (max(x - onset, 0) / strain)^4 with x = L/L0. The ends are Thelen's for young adults: it begins at
L0 and reaches the largest isometric tension at a strain of 0.6. The fourth power is a choice of this package: it stays
within 0.06 of Thelen's exponential of shape 5 between these ends, and needs no exponential. Beyond 1.6 L0 it only keeps
growing (123 times the largest tension at 3 L0). It differs widely between muscles: take it as an order of magnitude.

**Activation**, da/dt = (u - a) / tau with tau = rise where u > a, else fall. The excitation u is held within 0 and 1, so an
activation that starts there stays there. It stands to a biological muscle as valve and tube stand to a McKibben muscle: it
decides how soon, not how strongly, the muscle pulls. It is a lumped description of calcium release and uptake; single
twitches and fatigue are beyond it, and fibres differ severalfold in both time constants. The defaults, 15 and 50 ms, are
those with which Thelen's model is commonly run; here they are marked inferred.

Sources: A. M. Gordon, A. F. Huxley and F. J. Julian, Journal of Physiology 184(1), 1966,
doi:10.1113/jphysiol.1966.sp007909; A. V. Hill, Proceedings of the Royal Society B 126, 1938, doi:10.1098/rspb.1938.0050; B.
Katz, Journal of Physiology 96, 1939; T. A. McMahon, Muscles, Reflexes, and Locomotion, Princeton University Press, 1984; D.
G. Thelen, Journal of Biomechanical Engineering 125(1), 2003, doi:10.1115/1.1531112; comparison with McKibben muscles: C.-P.
Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NoReturn

from .._jax import jnp
from ..components import Module, Scalar, derivative
from ..components.programs import evaluated
from ..errors import InputError, NoVolumeError, UnreachableError
from ..quantities import quantity, with_unit
from .law import LawState

# Sarcomere lengths of Gordon's polygon over its optimal length of 2.00 um [1].
SHORTEST = 1.27 / 2.00
KNEE = 1.67 / 2.00
PLATEAU_END = 2.25 / 2.00
LONGEST = 3.65 / 2.00
KNEE_TENSION = 0.84


def active_curve(
    relative_length: Scalar,
    *,
    shortest: Scalar = SHORTEST,
    knee: Scalar = KNEE,
    knee_tension: Scalar = KNEE_TENSION,
    plateau_end: Scalar = PLATEAU_END,
    longest: Scalar = LONGEST,
) -> Scalar:
    """Isometric active tension at full activation over its largest value [1], 0 to 1.

    Args:
        relative_length: length over the rest length [1], any shape.
        shortest: length below which there is no active tension [1].
        knee: length at which the ascending limb changes its slope [1], between `shortest` and 1.
        knee_tension: relative tension there [1].
        plateau_end: longest length on the plateau, which begins at 1 [1].
        longest: length beyond which there is no active tension [1].
    """
    steep = knee_tension / (knee - shortest)
    shallow = (1.0 - knee_tension) / (1.0 - knee)
    above_shortest = jnp.maximum(relative_length - shortest, 0.0)
    above_knee = jnp.maximum(relative_length - knee, 0.0)
    ascending = steep * above_shortest + (shallow - steep) * above_knee
    descending = (longest - relative_length) / (longest - plateau_end)
    return jnp.maximum(jnp.minimum(jnp.minimum(ascending, descending), 1.0), 0.0)


def velocity_curve(relative_velocity: Scalar, *, curvature: Scalar = 0.25, lengthening_tension: Scalar = 1.4) -> Scalar:
    """Tension over the isometric tension at the same length and activation [1], 0 up to `lengthening_tension`.

    Args:
        relative_velocity: dL/dt over the largest shortening velocity [1], positive while lengthening, any shape.
        curvature: Hill's a/F0 [1], positive.
        lengthening_tension: the plateau while lengthening fast [1], above 1.
    """
    shortening = jnp.maximum(-relative_velocity, 0.0)
    lengthening = jnp.maximum(relative_velocity, 0.0)
    hyperbola = curvature * jnp.maximum(1.0 - shortening, 0.0) / (curvature + shortening)
    above = lengthening_tension - 1.0
    scaled = lengthening * (1.0 + curvature)
    return hyperbola + above * scaled / (scaled + above * curvature)


def passive_curve(relative_length: Scalar, *, onset: Scalar = 1.0, strain: Scalar = 0.6) -> Scalar:
    """Passive tension over the largest isometric tension [1], never negative.

    Args:
        relative_length: length over the rest length [1], any shape.
        onset: length at which the passive tension begins [1].
        strain: how far beyond it equals the largest isometric tension [1], positive.
    """
    stretch = jnp.maximum(relative_length - onset, 0.0) / strain
    square = stretch * stretch
    return square * square


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
        "1", (0.1, 0.75), "length over L0 where active tension begins", symbol="x1", default=SHORTEST
    )
    knee_length: Scalar = quantity("1", (0.76, 0.99), "knee of the ascending limb, over L0", symbol="x2", default=KNEE)
    knee_tension: Scalar = quantity(
        "1", (0.0, 1.0), "active tension at the knee, relative", symbol="f2", default=KNEE_TENSION
    )
    plateau_end: Scalar = quantity("1", (1.0, 1.4), "end of the plateau, over L0", symbol="x4", default=PLATEAU_END)
    longest_active_length: Scalar = quantity(
        "1", (1.41, 3.0), "length over L0 where active tension ends", symbol="x5", default=LONGEST
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
        return active_curve(
            relative_length,
            shortest=self.shortest_active_length,
            knee=self.knee_length,
            knee_tension=self.knee_tension,
            plateau_end=self.plateau_end,
            longest=self.longest_active_length,
        )

    def passive_curve(self, relative_length: Scalar) -> Scalar:
        """Passive tension over Fmax [1], against L/L0 [1]."""
        return passive_curve(relative_length, onset=self.passive_onset, strain=self.passive_strain)

    def velocity_curve(self, relative_velocity: Scalar) -> Scalar:
        """Active tension over the isometric one [1], against velocity over vmax [1], positive while lengthening."""
        return velocity_curve(relative_velocity, curvature=self.curvature, lengthening_tension=self.lengthening_tension)

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
        """da/dt [1/s] at an excitation [1], which is limited to 0..1."""
        missing = jnp.clip(excitation, 0.0, 1.0) - activation
        return missing / jnp.where(missing > 0.0, self.rise_time, self.fall_time)

    def advance_activation(self, activation: Scalar, excitation: Scalar, dt: Scalar) -> Scalar:
        """The activation [1] after a time [s] at constant excitation [1], exactly, for any step >= 0."""
        missing = jnp.clip(excitation, 0.0, 1.0) - activation
        # The sign of u - a does not change along the exponential, so that one time constant holds for the whole step. dt/tau
        # is at least 0; -expm1 keeps the last digits of a small step.
        return activation - missing * jnp.expm1(-dt / jnp.where(missing > 0.0, self.rise_time, self.fall_time))


def _together(*values: Any) -> tuple[Scalar, ...]:
    return tuple(jnp.broadcast_arrays(*(jnp.asarray(value, float) for value in values)))
