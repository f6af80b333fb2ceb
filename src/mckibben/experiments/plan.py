"""A protocol on the sample clock: all steps in their order, with set-points where no measurement decides them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .protocol import Protocol
from .steps import Command, Follow, Go, Phased, Shut, Step
from .until import Until
from .waveforms.waveform import words

LONGEST = 20_000_000  # samples


@dataclass(frozen=True)
class Deferred:
    """A set-point that begins where the machine is by then: it stays there, or goes on a line `to` [SI] in `seconds`."""

    to: float | None = None
    seconds: float | None = None

    def at(self, start: Any, times: Any) -> Any:
        """Set-points at times [s] from the beginning of the step, for a start [SI]."""
        if self.to is None or self.seconds is None:
            return start + 0.0 * np.asarray(times)
        return start + (self.to - start) * np.clip(np.asarray(times) / self.seconds, 0.0, 1.0)


@dataclass(frozen=True)
class Reach:
    """Where a set-point or the span lies, as far as it is known beforehand [SI]; `low` equals `high` where it is certain."""

    low: float
    high: float

    @property
    def known(self) -> bool:
        """Whether it is certain."""
        return self.low == self.high


ANYWHERE = Reach(float("-inf"), float("inf"))


@dataclass(frozen=True, eq=False)
class PlannedStep:
    """One step of the plan.

    `index` counts from 1, `path` is its place in the protocol; `start` and `count` are samples, the latest and the most
    where a test may end a step early. `pressure` [Pa] and `motor` [unit of `mode`] are set-points of shape (count,), or
    `Deferred`; the pressure is None while the muscle is shut off. The `*_before` are where channels are when it begins,
    `span` where the span goes in it; `pulled` is the tension [N] that the motor held when it begins, if that decided
    the span.
    """

    index: int
    path: str
    case: Mapping[str, Any]
    step: Step
    start: int
    count: int
    mode: str
    pressure: np.ndarray | Deferred | None
    motor: np.ndarray | Deferred
    pressure_before: Reach
    motor_before: Reach
    pressure_reach: Reach
    span: Reach
    pulled: Reach | None = None

    @property
    def until(self) -> Until | None:
        """What ends it early."""
        return self.step.until

    @property
    def record(self) -> bool:
        """Whether it is kept."""
        return self.step.record

    def sentence(self) -> str:
        """The step in words, with its place and case."""
        from .sentence import case_words

        used = f" ({case_words(self.case)})" if self.case else ""
        return f"{self.path}{used}: {self.step.sentence()}"


@dataclass(frozen=True, eq=False)
class Plan:
    """All steps on the sample clock; `sample_rate` [1/s], `rest_length` of the muscle [m]."""

    protocol: Protocol
    rest_length: float
    steps: tuple[PlannedStep, ...]

    @property
    def sample_rate(self) -> float:
        """Samples per second."""
        return self.protocol.sample_rate

    @property
    def samples(self) -> int:
        """All of them, the most that it may take."""
        return sum(s.count for s in self.steps)

    @property
    def duration(self) -> float:
        """Longest time that it may take [s]."""
        return self.samples / self.sample_rate


def expand(protocol: Protocol, *, rest_length: float, start_span: float | None = None) -> Plan:
    """The flat plan.

    Args:
        protocol: what to do.
        rest_length: of the muscle [m], which ``L0`` stands for.
        start_span: where the motor is at the beginning [m]; the rest length where left out. The pressure begins at zero.

    Raises:
        InputError: if a line at a speed begins where nobody knows beforehand, or it has too many samples.
    """
    if not rest_length > 0.0:
        raise InputError("rest_length", words(rest_length, "m"), "allowed is a length above zero")
    begin = rest_length if start_span is None else start_span
    state = _State(rest_length, 1.0 / protocol.sample_rate, Reach(0.0, 0.0), Reach(begin, begin))
    planned: list[PlannedStep] = []
    start = 0
    for case, steps in protocol.blocks():
        for path, step in steps:
            one = state.plan(step, len(planned) + 1, path, case, start)
            planned.append(one)
            start += one.count
    return Plan(protocol, rest_length, tuple(planned))


class _State:
    """Where the set-points are between two steps."""

    def __init__(self, rest_length: float, dt: float, pressure: Reach, span: Reach) -> None:
        self.rest, self.dt = rest_length, dt
        self.pressure, self.span = pressure, span
        self.mode, self.motor = "span", span
        self.pulled: Reach | None = None

    def plan(self, step: Step, index: int, path: str, case: Mapping[str, Any], start: int) -> PlannedStep:
        mode = step.mode or self.mode
        if mode != self.mode:
            # nobody knows the force or speed at which control begins; the span is known if it was driven so far
            self.motor = self.span if mode == "span" else ANYWHERE
        before_p, before_m = self.pressure, self.motor
        duration = self._duration(step, mode, path)
        count = max(1, round(duration / self.dt))
        if start + count > LONGEST:
            allowed = f"allowed are {LONGEST} in all; take a lower sample rate, shorter steps or fewer cases"
            raise InputError("samples", start + count, allowed)
        times = self.dt * np.arange(count)
        pressure, reach_p, after_p = self._channel(step.pressure, self.pressure, times, step, duration)
        motor, reach_m, after_m = self._channel(step.motor, self.motor, times, step, duration)
        span, after_span = self._span(mode, motor, reach_m, after_m, step)
        pulled = before_m if self.mode == mode == "tension" else self.pulled
        self.pressure, self.motor, self.mode, self.span = after_p, after_m, mode, after_span
        self.pulled = after_m if mode == "tension" else None if after_span.known else pulled
        assert motor is not None
        return PlannedStep(
            index, path, case, step, start, count, mode, pressure, motor, before_p, before_m, reach_p, span, pulled
        )

    def _duration(self, step: Step, mode: str, path: str) -> float:
        lines = [0.0]
        for command, before, field in ((step.pressure, self.pressure, "pressure"), (step.motor, self.motor, mode)):
            if isinstance(command, Go):
                seconds = command.duration(before.low if before.known else float("nan"), self.rest)
                if np.isnan(seconds):
                    allowed = "its start is not known beforehand; allowed is a time, in"
                    raise InputError(f"{path}.{field}.at", command.sentence(field), allowed)
                lines.append(seconds)
        stated = step.stated_duration()
        return max(lines) if stated is None else stated

    def _channel(
        self, command: Command | None, before: Reach, times: np.ndarray, step: Step, duration: float
    ) -> tuple[np.ndarray | Deferred | None, Reach, Reach]:
        """Set-points, where they go, and where they are afterwards."""
        if isinstance(command, Shut):
            leaked = Reach(min(0.0, before.low), max(0.0, before.high))
            return None, leaked, leaked
        if command is None:
            if not before.known:
                return Deferred(), before, before
            return _fixed(np.full(times.shape, before.low)), before, before
        if isinstance(command, Go) and not before.known:
            to = command.to.si(self.rest)
            hull = Reach(min(before.low, to), max(before.high, to))
            there = step.until is None and command.seconds is not None and duration >= command.seconds * (1.0 - 1e-12)
            return Deferred(to, command.seconds), hull, Reach(to, to) if there else hull
        values, end = self._values(command, before, times, step, duration)
        reach = Reach(float(values.min()), float(values.max()))
        if step.until is not None and not reach.known:
            return _fixed(values), reach, Reach(min(reach.low, end), max(reach.high, end))
        return _fixed(values), reach, Reach(end, end)

    def _values(
        self, command: Follow | Go | Phased, before: Reach, times: np.ndarray, step: Step, duration: float
    ) -> tuple[np.ndarray, float]:
        """Set-points, and the one at the end: that of a line belongs to the next step's first sample."""
        ends = np.append(times, duration)
        if isinstance(command, Go):
            to, seconds = command.to.si(self.rest), command.duration(before.low, self.rest)
            share = np.clip(ends / seconds, 0.0, 1.0) if seconds > 0.0 else np.ones(ends.shape)
            values = before.low + (to - before.low) * share
            return values[:-1], to if duration >= seconds * (1.0 - 1e-12) else float(values[-1])
        if isinstance(command, Phased):
            assert isinstance(step.motor, Follow)  # the reader has seen to it
            values = command.table(step.motor.waveform, duration).at(ends)
            return values[:-1], float(values[-1])
        values = command.at(ends, self.rest)
        return values[:-1], float(values[-1] if command.waveform.straight else values[-2])

    def _span(
        self, mode: str, motor: np.ndarray | Deferred | None, reach: Reach, after: Reach, step: Step
    ) -> tuple[Reach, Reach]:
        """Where the span goes in a step, and where it is afterwards."""
        if mode == "span":
            return reach, after
        if mode == "tension" or not isinstance(motor, np.ndarray):
            return ANYWHERE, ANYWHERE
        path = np.append(0.0, np.cumsum(motor) * self.dt)
        hull = Reach(self.span.low + float(path.min()), self.span.high + float(path.max()))
        if step.until is not None:
            return hull, hull
        return hull, Reach(self.span.low + float(path[-1]), self.span.high + float(path[-1]))


def _fixed(values: np.ndarray) -> np.ndarray:
    values.setflags(write=False)
    return values
