"""Manual mode: set-points come with the samples, and are approached at limited rates.

    pressure and tension     x' = x + clip(to - x, -r dt, r dt)
    span                     v' = v + clip(w - v, -a dt, a dt),   x' = x + v' dt,   w = sign(to - x) min(u, V(|to - x|))
                             V(e) = e/(m dt) + a dt (m - 1)/2,   m = ceil(sqrt(1/4 + 2 e/(a dt^2)) - 1/2), at least 1
    velocity                 the same with w the set velocity, and V of the way that is left to the end of the span

V is the speed from which m samples, each slower by a dt, make exactly the way e: the set-point arrives without overshoot.
Whatever is asked, the set-points have no steps, and the span none in its velocity. When the motor's mode
changes, the new set-point begins at the measured channel. Pressures are gauge.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from ..._jax import Tree, jnp
from ...components import Module, Scalar
from ...documents import JsonValue
from ...experiments.dry_run import Limits
from ...quantities import quantity
from .sequencer import SPAN, TENSION, VELOCITY, SampleSetpoints

ROW = ("alone", "mode", "motor", "open", "pressure")  # of a sample: what is asked, sorted
FILL = 2.0  # time from nothing to the full range of the valve or the cell, at least [s]
SHARE = 0.5  # of the steepest pressure that the valve can follow
SLOW = 0.05  # share of the motor's largest speed
START = 0.1  # time in which the motor reaches it [s]
FOREVER = 1e9  # [s]
MANUAL, ABANDONED = 0, 1  # steps


class ManualRow(NamedTuple):
    """Manual set-points of a sample: pressure [Pa], open 1 or 0, motor mode and value [m, m/s or N], alone 1 or 0.

    A motor that is NaN stays where it is. `alone` is 1 while no client is in control.
    """

    pressure: Any
    open: Any
    mode: Any
    motor: Any
    alone: Any


class ManualPlace(NamedTuple):
    """Present manual set-points.

    Attributes:
        step: `MANUAL`, or `ABANDONED` once it vented since nobody was in control.
        missed: False; a manual mode waits for nothing.
        pressure: [Pa].
        open: 0 while the muscle is shut off, else 1.
        mode: mode of the motor.
        span: [m]; the measured one while the tension is controlled.
        velocity: velocity of it [m/s].
        acceleration: acceleration of it [m/s^2].
        tension: [N].
        alone: for how long nobody has been in control [s].
        asked: request of this sample.
    """

    step: Any
    missed: Any
    pressure: Any
    open: Any
    mode: Any
    span: Any
    velocity: Any
    acceleration: Any
    tension: Any
    alone: Any
    asked: ManualRow


class Manual(Module):
    """Generator of manual set-points in place of a `Sequencer`: their rates, and their hold time without an operator."""

    pressure_rate: Scalar = quantity("Pa/s", (1.0, 1e9), "largest rate of the pressure", typical=(1e4, 1e6))
    speed: Scalar = quantity("m/s", (1e-6, 100.0), "largest speed of the span", typical=(0.01, 0.5))
    acceleration: Scalar = quantity("m/s^2", (1e-6, 1e4), "largest acceleration of the span", typical=(0.1, 10.0))
    tension_rate: Scalar = quantity("N/s", (1e-6, 1e6), "largest rate of the tension", typical=(1.0, 100.0))
    shortest: Scalar = quantity("m", (-100.0, 100.0), "shortest span that a velocity leads to", typical=(0.05, 0.5))
    longest: Scalar = quantity("m", (-100.0, 100.0), "longest span that a velocity leads to", typical=(0.1, 0.6))
    hold: Scalar = quantity("s", (0.0, FOREVER), "time for which set-points are held without a hand", default=5.0)

    @classmethod
    def of(cls, limits: Limits, *, hold: float = 5.0) -> Manual:
        """Rates for a rig.

        Args:
            limits: limits of the rig.
            hold: time for which set-points are held while nobody is in control [s].
        """
        speed = SLOW * limits.speed if limits.speed > 0.0 else 1e-6
        return cls(
            pressure_rate=min(limits.pressure[1] / FILL, SHARE * limits.pressure_rate),
            speed=speed,
            acceleration=min(speed / START, limits.acceleration, 1e4),
            tension_rate=min(limits.tension, limits.motor_force, 1e6 * FILL) / FILL,
            shortest=limits.span[0],
            longest=limits.span[1],
            hold=hold,
        )

    def initial(self, pressure: Scalar, motor: Scalar) -> ManualPlace:
        """Set-points at a pressure [Pa] and a span [m], at rest, with nothing requested."""
        zero, pressure, span = jnp.zeros(()), jnp.asarray(pressure, float), jnp.asarray(motor, float)
        mode = jnp.zeros((), int)
        stays = ManualRow(pressure, zero + 1.0, mode, zero + jnp.nan, zero)
        return ManualPlace(mode, jnp.asarray(False), pressure, zero + 1.0, mode, span, zero, zero, zero, zero, stays)

    def heard(self, place: ManualPlace, row: Mapping[str, JsonValue]) -> ManualPlace:
        """Place with the requests of a sample; see `ROW`."""
        mode = jnp.asarray(row["mode"]).astype(int)
        return place._replace(asked=ManualRow(row["pressure"], row["open"], mode, row["motor"], row["alone"]))

    def set_points(self, place: ManualPlace, _: object) -> SampleSetpoints:
        """Set-points of a sample."""
        by_span = place.mode == SPAN
        values = jnp.stack([place.span, place.velocity, place.tension])
        always = jnp.asarray(True)
        return SampleSetpoints(
            pressure=place.pressure,
            open=place.open,
            mode=place.mode,
            motor=values[place.mode],
            velocity=jnp.where(by_span, place.velocity, 0.0),
            acceleration=jnp.where(place.mode == TENSION, 0.0, place.acceleration),
            step=place.step,
            record=always,
            running=always,
            fresh=~always,
        )

    def advance(
        self,
        place: ManualPlace,
        _: SampleSetpoints,
        measured: Mapping[str, Scalar],
        motor_at: Sequence[Scalar],
        dt: Scalar,
    ) -> ManualPlace:
        """Advance to the next sample.

        Args:
            place: place of this sample.
            measured: channels by name, with ``velocity`` [SI].
            motor_at: where the motor's channel is in each mode, for a change of mode [m, m/s, N].
            dt: period of the samples [s].
        """
        asked = place.asked
        alone = jnp.where(asked.alone > 0.5, place.alone + dt, 0.0)
        left = alone > self.hold - 0.5 * dt
        # the pressure goes at once, and the motor holds
        pressure = jnp.where(
            left, 0.0, place.pressure + _within(asked.pressure - place.pressure, self.pressure_rate * dt)
        )
        mode = jnp.where(left, SPAN, asked.mode)
        to = jnp.where(left, jnp.nan, asked.motor)
        span, velocity, acceleration = self._span(place, mode, to, motor_at, dt)
        tension = jnp.where(place.mode == TENSION, place.tension, motor_at[TENSION])
        aim = jnp.where(jnp.isfinite(to), to, tension)
        pulling = mode == TENSION
        return ManualPlace(
            step=jnp.where(left, ABANDONED, MANUAL),
            missed=place.missed,
            pressure=pressure,
            open=jnp.where(left, 1.0, asked.open),
            mode=mode,
            span=jnp.where(pulling, motor_at[SPAN], span),
            velocity=jnp.where(pulling, 0.0, velocity),
            acceleration=jnp.where(pulling, 0.0, acceleration),
            tension=jnp.where(pulling, tension + _within(aim - tension, self.tension_rate * dt), tension),
            alone=alone,
            asked=asked,
        )

    def _span(
        self, place: ManualPlace, mode: Any, to: Any, motor_at: Sequence[Scalar], dt: Scalar
    ) -> tuple[Tree, Tree, Tree]:
        """Set-point of the span at the next sample, its velocity and acceleration."""
        fresh = place.mode == TENSION
        x = jnp.where(fresh, motor_at[SPAN], place.span)
        v = jnp.where(fresh, _within(motor_at[VELOCITY], self.speed), place.velocity)
        way = jnp.where(jnp.isfinite(to), to - x, 0.0)
        there = jnp.where(jnp.isfinite(to), jnp.sign(way) * self._stopping(jnp.abs(way), dt), 0.0)
        driven = jnp.where(jnp.isfinite(to), to, 0.0)
        end = jnp.where(driven > 0.0, self.longest - x, x - self.shortest)
        driven = jnp.sign(driven) * jnp.minimum(jnp.abs(driven), self._stopping(jnp.where(end > 0.0, end, 0.0), dt))
        wanted = _within(jnp.where(mode == VELOCITY, driven, there), self.speed)
        change = _within(wanted - v, self.acceleration * dt)
        return x + (v + change) * dt, v + change, change / dt

    def _stopping(self, way: Any, dt: Scalar) -> Any:
        """Speed from which the motor stops within a distance [m], in whole samples of deceleration."""
        slower = self.acceleration * dt
        samples = jnp.ceil(jnp.sqrt(0.25 + 2.0 * way / (slower * dt)) - 0.5)
        samples = jnp.where(samples > 1.0, samples, 1.0)
        return way / (samples * dt) + 0.5 * slower * (samples - 1.0)


def _within(x: Scalar, most: Any) -> Any:
    return jnp.where(x > most, most, jnp.where(x < -most, -most, x))
