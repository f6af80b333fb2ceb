"""A protocol on the sample clock: all steps in their order, with set-points where no measurement decides them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..answers import brief
from ..documents import JsonValue
from ..errors import InputError
from .commands import ANYWHERE, Command, Deferred, Reach, SetPoints, StepClock, kept
from .sentence import case_words
from .steps import ProtocolStep
from .until import Until
from .waveforms.waveform import words

if TYPE_CHECKING:
    from .protocol import Protocol

LONGEST = 20_000_000  # samples


@dataclass(frozen=True, eq=False)
class PlannedStep:
    """A step of the plan.

    `index` counts from 1, `path` is its place in the protocol; `start` and `count` are samples, the latest and the most
    where a test may end a step early. `pressure` [Pa] and `motor` [unit of `mode`] are set-points of shape (count,), or
    `Deferred`; the pressure is None while the muscle is shut off. `stimulation` [1] is the excitation of
    a biological muscle. The `*_before` are where channels are when it begins,
    `span` where the span goes in it; `pulled` is the tension [N] that the motor held when it begins, if that decided
    the span.
    """

    index: int
    path: str
    case: Mapping[str, Any]
    step: ProtocolStep
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
    stimulation: np.ndarray | Deferred | None = None

    __repr__ = brief

    @property
    def until(self) -> Until | None:
        """Condition that ends the step early."""
        return self.step.until

    @property
    def record(self) -> bool:
        """Whether the step is recorded."""
        return self.step.record

    def sentence(self) -> str:
        """Describe the step, with its place and case."""
        used = f" ({case_words(self.case)})" if self.case else ""
        return f"{self.path}{used}: {self.step.sentence()}"


@dataclass(frozen=True, eq=False)
class ProtocolPlan:
    """Steps on the sample clock; `sample_rate` [1/s], `rest_length` of the muscle [m]."""

    protocol: Protocol
    rest_length: float
    steps: tuple[PlannedStep, ...]

    __repr__ = brief

    @property
    def sample_rate(self) -> float:
        """Samples per second."""
        return self.protocol.sample_rate

    @property
    def samples(self) -> int:
        """Number of samples, at most."""
        return sum(s.count for s in self.steps)

    @property
    def duration(self) -> float:
        """Longest time that it may take [s]."""
        return self.samples / self.sample_rate


def expand(protocol: Protocol, *, rest_length: float, start_span: float | None = None) -> ProtocolPlan:
    """The flat plan.

    Args:
        protocol: the protocol.
        rest_length: rest length of the muscle [m], which ``L0`` stands for.
        start_span: where the motor is at the beginning [m]; the rest length by default. The pressure begins at zero.

    Raises:
        InputError: if a line at a speed begins where nobody knows in advance, or it has too many samples.
    """
    if not rest_length > 0.0:
        raise InputError("rest_length", words(rest_length, "m"), "must be a length above zero")
    begin = rest_length if start_span is None else start_span
    state = _State(rest_length, 1.0 / protocol.sample_rate, Reach(0.0, 0.0), Reach(begin, begin))
    planned: list[PlannedStep] = []
    start = 0
    for case, steps in protocol.blocks():
        for path, step in steps:
            one = state.plan(step, len(planned) + 1, path, case, start)
            planned.append(one)
            start += one.count
    return ProtocolPlan(protocol, rest_length, tuple(planned))


class _State:
    """Set-points between two steps."""

    def __init__(self, rest_length: float, dt: float, pressure: Reach, span: Reach) -> None:
        self.rest, self.dt = rest_length, dt
        self.pressure, self.span = pressure, span
        self.stimulation = Reach(0.0, 0.0)
        self.mode, self.motor = "span", span
        self.pulled: Reach | None = None

    def plan(self, step: ProtocolStep, index: int, path: str, case: Mapping[str, JsonValue], start: int) -> PlannedStep:
        mode = step.mode or self.mode
        if mode != self.mode:
            # nobody knows the force or speed at which control begins; the span is known if it was driven so far
            self.motor = self.span if mode == "span" else ANYWHERE
        before_p, before_m = self.pressure, self.motor
        duration = self._duration(step, mode, path)
        count = max(1, round(duration / self.dt))
        if start + count > LONGEST:
            allowed = f"must be at most {LONGEST} in all; take a lower sample rate, shorter steps or fewer cases"
            raise InputError("samples", start + count, allowed)
        clock = StepClock(self.dt * np.arange(count), duration, self.rest, step)
        pressure, motor = _driven(step.pressure, before_p, clock), _driven(step.motor, before_m, clock)
        stimulation = _driven(step.stimulation, self.stimulation, clock)
        self.stimulation = stimulation.after
        assert motor.values is not None
        span, after_span = self._span(mode, motor, step)
        pulled = before_m if self.mode == mode == "tension" else self.pulled
        self.pressure, self.motor, self.mode, self.span = pressure.after, motor.after, mode, after_span
        self.pulled = motor.after if mode == "tension" else None if after_span.known else pulled
        return PlannedStep(
            index,
            path,
            case,
            step,
            start,
            count,
            mode,
            pressure.values,
            motor.values,
            before_p,
            before_m,
            pressure.reach,
            span,
            pulled,
            stimulation.values,
        )

    def _duration(self, step: ProtocolStep, mode: str, path: str) -> float:
        lines = [0.0]
        for channel, command in step.commands():
            drives = {"pressure": self.pressure, "stimulation": self.stimulation}
            seconds = command.duration(drives.get(channel, self.motor), self.rest)
            if seconds is not None and np.isnan(seconds):
                demand = "its start is not known in advance; state a time, in, instead of a speed"
                raise InputError(f"{path}.{channel}.at", command.sentence(channel), demand)
            lines.append(seconds or 0.0)
        stated = step.stated_duration()
        return max(lines) if stated is None else stated

    def _span(self, mode: str, motor: SetPoints, step: ProtocolStep) -> tuple[Reach, Reach]:
        """Range of the span during and after a step."""
        if mode == "span":
            return motor.reach, motor.after
        if mode == "tension" or not isinstance(motor.values, np.ndarray):
            return ANYWHERE, ANYWHERE
        path = np.append(0.0, np.cumsum(motor.values) * self.dt)
        hull = Reach(self.span.low + float(path.min()), self.span.high + float(path.max()))
        if step.until is not None:
            return hull, hull
        return hull, Reach(self.span.low + float(path[-1]), self.span.high + float(path[-1]))


def _driven(command: Command | None, before: Reach, clock: StepClock) -> SetPoints:
    return kept(before, clock) if command is None else command.set_points(before, clock)
