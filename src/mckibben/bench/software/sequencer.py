"""Protocol on the sample clock: the present step, its set-points, and the tests that end it early.

A plan becomes tables that a pure step reads, so that the same program runs in a simulation and by the wall clock. The
sample at which a test comes true is the last of its step. Set-points that nobody knows in advance begin where the machine
is: at the last set-point while the motor's mode stays, else at the measured channel of the new mode.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..._jax import Scalar, Tree, jnp
from ...components import Module, field
from ...experiments import until
from ...experiments.commands import MODES, Deferred
from ...experiments.protocol import PlannedStep
from ...experiments.until import KINDS

SPAN, VELOCITY, TENSION = range(3)
assert MODES == ("span", "velocity", "tension")
LEAST_STEPS, LEAST_SAMPLES = (
    64,
    2**16,
)  # tables are padded to these, or 16 times as much, so that few sizes are compiled
CHANNELS = ("pressure", "span", "velocity", "tension")  # that a test can look at, and the sensors that are tested


class SequencePlace(NamedTuple):
    """Position of the sequencer in its protocol.

    Attributes:
        step: its index, as large as the count of steps when all is done.
        sample: within the step.
        test: state of the step's test.
        pressure: set-point at the step's beginning [Pa].
        motor: the same of the motor [unit of its mode].
        missed: whether a test did not come true in a step that then has to stop.
    """

    step: Any
    sample: Any
    test: Any
    pressure: Any
    motor: Any
    missed: Any


class SampleSetpoints(NamedTuple):
    """Set-points of a sample.

    Attributes:
        pressure: [Pa]; as it was while the muscle is shut off.
        open: 0 while the muscle is shut off, else 1.
        mode: mode of the motor, see `MODES`.
        motor: [m, m/s or N].
        velocity: rate of a set-point of the span [m/s].
        acceleration: acceleration of it [m/s^2].
        step: index of the step.
        record: whether the sample is kept (bool).
        running: whether the protocol still goes on (bool).
        fresh: whether it is the first sample of a step (bool).
    """

    pressure: Any
    open: Any
    mode: Any
    motor: Any
    velocity: Any
    acceleration: Any
    step: Any
    record: Any
    running: Any
    fresh: Any


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
        """Build the program of consecutive steps.

        Args:
            steps: steps of a plan.
            rest_length: rest length of the muscle [m].
            period: period of the samples [s].
        """
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
                each(lambda s: 0 if s.until is None else KINDS.index(s.until.kind), int),
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
        state, true = until.advance(tests.kind[j], place.test, x, tests.limit[j], tests.lasting[j], commanded, period)
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
    """State of a test before its first sample."""
    place, held = until.START
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
