"""Protocol on the sample clock: the present step, its set-points, and the tests that end it early.

A plan becomes tables that a pure step reads, so that the same program runs in a simulation and by the wall clock. The
sample at which a test comes true is the last of its step. Set-points that nobody knows in advance begin where the machine
is: at the last set-point while the motor's mode stays, else at the measured channel of the new mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..._jax import Tree, jnp
from ...components import Module, Scalar, field
from ...documents import JsonValue
from ...experiments.amounts import TEST_START, TESTS, advance_test
from ...experiments.commands import MODES, Deferred
from ...experiments.dry_run import Limits
from ...experiments.protocol import PlannedStep
from ...quantities import quantity

SPAN, VELOCITY, TENSION = range(3)
assert MODES == ("span", "velocity", "tension")
LEAST_STEPS, LEAST_SAMPLES = 64, 2**16  # tables are padded to these, or 16 times as much: few sizes are compiled
CHANNELS = ("pressure", "span", "velocity", "tension")  # that a test can look at, and the sensors that are tested


class SequencePlace(NamedTuple):
    """Position of the sequencer in its protocol."""

    step: Any  # its index, as large as the count of steps when all is done
    sample: Any  # within the step
    test: Any  # state of the step's test
    pressure: Any  # set-point at the step's beginning [Pa]
    motor: Any  # the same of the motor [unit of its mode]
    missed: Any  # whether a test did not come true in a step that then has to stop


class SampleSetpoints(NamedTuple):
    """Set-points of a sample."""

    pressure: Any  # [Pa]; as it was while the muscle is shut off
    open: Any  # 0 while the muscle is shut off, else 1
    mode: Any  # mode of the motor, see `MODES`
    motor: Any  # [m, m/s or N]
    velocity: Any  # rate of a set-point of the span [m/s]
    acceleration: Any  # acceleration of it [m/s^2]
    step: Any  # index of the step
    record: Any  # whether the sample is kept (bool)
    running: Any  # whether the protocol still goes on (bool)
    fresh: Any  # whether it is the first sample of a step (bool)


class Tests(NamedTuple):
    """Test of every step that may end it early (steps,); without one the channel is -1."""

    channel: Any
    kind: Any
    limit: Any
    lasting: Any


class StepLines(NamedTuple):
    """Course of a channel in every step, (steps,): a table from `offset` on, or a line from the start to `to`."""

    tabled: Any
    to: Any
    seconds: Any


class Sequencer(Module):
    """A program of steps; built by `Sequencer.of`."""

    count: Any
    total: Any
    offset: Any
    mode: Any
    shut: Any
    record: Any
    tests: Tests
    must: Any
    pressure: StepLines
    motor: StepLines
    table: dict[str, Any]
    sensors: tuple[str, ...] = field(static=True, default=())

    @classmethod
    def of(cls, steps: Sequence[PlannedStep], *, rest_length: float, period: float) -> Sequencer:
        """Build the program of consecutive steps."""
        size = _padded(len(steps), LEAST_STEPS)
        offset = np.concatenate([[0], np.cumsum([s.count for s in steps])])
        samples = _padded(int(offset[-1]), LEAST_SAMPLES)
        table = {name: np.zeros(samples) for name in ("pressure", "motor", "velocity", "acceleration")}
        for s, begin in zip(steps, offset, strict=False):
            part = slice(begin, begin + s.count)
            if isinstance(s.pressure, np.ndarray):
                table["pressure"][part] = s.pressure
            if isinstance(s.motor, np.ndarray):
                table["motor"][part] = s.motor
                if s.mode == "span":
                    table["velocity"][part], table["acceleration"][part] = _motion(s, period)

        tested = {s.until.channel for s in steps if s.until is not None}
        sensors = tuple(sorted(tested - set(CHANNELS)))
        names = (*CHANNELS, *sensors)

        def each(of: Any, kind: Any, pad: Any = 0) -> Any:
            return jnp.asarray(np.array([*map(of, steps), *[pad] * (size - len(steps))]), kind)

        return cls(
            count=each(lambda s: s.count, int, 1), total=jnp.asarray(len(steps)),
            offset=jnp.asarray(np.pad(offset[:-1], (0, size - len(steps)))),
            mode=each(lambda s: MODES.index(s.mode), int), shut=each(lambda s: s.pressure is None, bool),
            record=each(lambda s: s.record, bool),
            tests=Tests(
                each(lambda s: -1 if s.until is None else names.index(s.until.channel), int, -1),
                each(lambda s: 0 if s.until is None else TESTS.index(s.until.kind), int),
                each(lambda s: 0.0 if s.until is None else s.until.amount.si(rest_length), float),
                each(lambda s: 0.0 if s.until is None else s.until.lasting, float),
            ),
            must=each(lambda s: s.until is not None and s.step.otherwise == "stop", bool),
            pressure=_lines([s.pressure for s in steps], size), motor=_lines([s.motor for s in steps], size),
            table={name: jnp.asarray(values) for name, values in table.items()}, sensors=sensors,
        )  # fmt: skip

    def initial(self, pressure: Scalar, motor: Scalar) -> SequencePlace:
        """State before the first sample, at given set-points [Pa; unit of the first step's mode]."""
        zero = jnp.zeros((), int)
        return SequencePlace(
            zero, zero, _fresh(), jnp.asarray(pressure, float), jnp.asarray(motor, float),
            jnp.asarray(False),
        )  # fmt: skip

    def set_points(self, place: SequencePlace, period: Scalar) -> SampleSetpoints:
        """Set-points of a sample; after the end those of the last step."""
        running = place.step < self.total
        j = jnp.where(running, place.step, self.total - 1)
        i = jnp.where(running, place.sample, self.count[j] - 1)
        at = self.offset[j] + i
        seconds = i * period
        pressure = jnp.where(
            self.shut[j], place.pressure, self._value(self.pressure, "pressure", j, at, place.pressure, seconds)
        )
        motor = self._value(self.motor, "motor", j, at, place.motor, seconds)
        line = self.motor
        going = ~line.tabled[j] & (seconds < line.seconds[j]) & jnp.isfinite(line.seconds[j])
        rate = jnp.where(going, (line.to[j] - place.motor) / line.seconds[j], self.table["velocity"][at])
        return SampleSetpoints(
            pressure=pressure, open=jnp.where(self.shut[j], 0.0, 1.0), mode=self.mode[j], motor=motor,
            velocity=jnp.where(self.mode[j] == SPAN, rate, 0.0), acceleration=self.table["acceleration"][at],
            step=j, record=jnp.logical_and(self.record[j], running), running=running,
            fresh=jnp.logical_and(place.sample == 0, running),
        )  # fmt: skip

    def _value(self, line: StepLines, name: str, j: Any, at: Scalar, start: Scalar, seconds: Any) -> Any:
        share = jnp.clip(seconds / line.seconds[j], 0.0, 1.0)
        return jnp.where(line.tabled[j], self.table[name][at], start + (line.to[j] - start) * share)

    def advance(
        self,
        place: SequencePlace,
        asked: SampleSetpoints,
        measured: Mapping[str, Scalar],
        motor_at: Sequence[Scalar],
        period: Scalar,
    ) -> SequencePlace:
        """Advance to the next sample.

        Args:
            place: place of this sample.
            asked: its set-points.
            measured: channels by name, with ``velocity`` [SI].
            motor_at: where the motor's channel is in each mode, for a change of mode [m, m/s, N].
            period: period of the samples [s].
        """
        j = asked.step
        nothing, tests = jnp.zeros(()), self.tests
        channel, commanded = tests.channel[j], jnp.where(tests.channel[j] == 0, asked.pressure, asked.motor)
        x = jnp.stack([jnp.asarray(measured.get(name, nothing), float) for name in (*CHANNELS, *self.sensors)])[channel]
        state, true = advance_test(tests.kind[j], place.test, x, tests.limit[j], tests.lasting[j], commanded, period)
        ended = true & (channel >= 0)
        late = place.sample + 1 >= self.count[j]
        over = jnp.logical_and(asked.running, jnp.logical_or(ended, late))
        missed = asked.running & late & ~ended & self.must[j]
        after = jnp.where(over & ~missed, place.step + 1, place.step)
        coming = jnp.where(after < self.total, after, self.total - 1)
        same = self.mode[coming] == asked.mode
        where = jnp.stack([jnp.asarray(x, float) for x in motor_at])[self.mode[coming]]
        motor = jnp.where(over, jnp.where(same, asked.motor, where), place.motor)
        kept = tuple(jnp.where(over, first, now) for first, now in zip(_fresh(), state, strict=True))
        return SequencePlace(
            after, jnp.where(over, 0, place.sample + jnp.where(asked.running, 1, 0)), kept,
            jnp.where(over, asked.pressure, place.pressure), motor, jnp.logical_or(place.missed, missed),
        )  # fmt: skip


def _fresh() -> tuple[Tree, Tree]:
    place, held = TEST_START
    return jnp.asarray(place), jnp.asarray(held)


def _padded(count: int, least: int) -> int:
    size = least
    while size < count:
        size *= 16
    return size


def _lines(commands: Sequence[Any], size: int) -> StepLines:
    tabled, to, seconds = np.ones(size, bool), np.zeros(size), np.ones(size)
    for i, command in enumerate(commands):
        if isinstance(command, Deferred):
            tabled[i] = False
            if command.to is None or command.seconds is None:
                seconds[i] = np.inf  # one that stays is a line that takes for ever
            else:
                to[i], seconds[i] = command.to, max(command.seconds, 1e-12)
    return StepLines(jnp.asarray(tabled), jnp.asarray(to), jnp.asarray(seconds))


def _motion(step: PlannedStep, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration of a tabulated span; a jump at its start has none."""
    assert isinstance(step.motor, np.ndarray)
    x = step.motor
    if len(x) < 3:
        return np.zeros(len(x)), np.zeros(len(x))
    velocity = np.gradient(x, period)
    return velocity, np.gradient(velocity, period)


# ---- by hand


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
    """Present manual set-points."""

    step: Any  # `MANUAL`, or `ABANDONED` once it vented since nobody was in control
    missed: Any  # False; a manual mode waits for nothing
    pressure: Any  # [Pa]
    open: Any  # 0 while the muscle is shut off, else 1
    mode: Any  # mode of the motor
    span: Any  # [m]; the measured one while the tension is controlled
    velocity: Any  # velocity of it [m/s]
    acceleration: Any  # acceleration of it [m/s^2]
    tension: Any  # [N]
    alone: Any  # for how long nobody has been in control [s]
    asked: ManualRow  # request of this sample


class Manual(Module):
    """Generator of manual set-points in place of a `Sequencer`: their rates, and their hold time without an operator.

        pressure and tension     x' = x + clip(to - x, -r dt, r dt)
        span                     v' = v + clip(w - v, -a dt, a dt),  x' = x + v' dt
                                 w = sign(to - x) min(u, V(|to - x|)),  V(e) = e/(m dt) + a dt (m - 1)/2
                                 m = ceil(sqrt(1/4 + 2 e/(a dt^2)) - 1/2), at least 1
        velocity                 the same with w the set velocity, and V of the way that is left to the end of the span

    V is the speed from which m samples, each slower by a dt, make exactly the way e: the set-point arrives without
    overshoot. Whatever is asked, the set-points have no steps, and the span none in its velocity. When the motor's mode
    changes, the new set-point begins at the measured channel. Pressures are gauge.
    """

    pressure_rate: Scalar = quantity("Pa/s", (1.0, 1e9), "largest rate of the pressure", typical=(1e4, 1e6))
    speed: Scalar = quantity("m/s", (1e-6, 100.0), "largest speed of the span", typical=(0.01, 0.5))
    acceleration: Scalar = quantity("m/s^2", (1e-6, 1e4), "largest acceleration of the span", typical=(0.1, 10.0))
    tension_rate: Scalar = quantity("N/s", (1e-6, 1e6), "largest rate of the tension", typical=(1.0, 100.0))
    shortest: Scalar = quantity("m", (-100.0, 100.0), "shortest span that a velocity leads to", typical=(0.05, 0.5))
    longest: Scalar = quantity("m", (-100.0, 100.0), "longest span that a velocity leads to", typical=(0.1, 0.6))
    hold: Scalar = quantity("s", (0.0, FOREVER), "time for which set-points are held without a hand", default=5.0)

    @classmethod
    def of(cls, limits: Limits, *, hold: float = 5.0) -> Manual:
        """Rates for a rig."""
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
        velocity = jnp.where(by_span, place.velocity, 0.0)
        acceleration = jnp.where(place.mode == TENSION, 0.0, place.acceleration)
        goes = place.mode, values[place.mode], velocity, acceleration
        return SampleSetpoints(place.pressure, place.open, *goes, place.step, always, always, ~always)

    def advance(
        self,
        place: ManualPlace,
        _: SampleSetpoints,
        measured: Mapping[str, Scalar],
        motor_at: Sequence[Scalar],
        dt: Scalar,
    ) -> ManualPlace:
        """Advance to the next sample; see `Sequencer.advance`."""
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
        pulled = jnp.where(pulling, tension + _within(aim - tension, self.tension_rate * dt), tension)
        span = jnp.where(pulling, motor_at[SPAN], span)
        velocity, acceleration = (jnp.where(pulling, 0.0, x) for x in (velocity, acceleration))
        step, opened = jnp.where(left, ABANDONED, MANUAL), jnp.where(left, 1.0, asked.open)
        path = span, velocity, acceleration, pulled
        return ManualPlace(step, place.missed, pressure, opened, mode, *path, alone, asked)

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
