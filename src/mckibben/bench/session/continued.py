"""Segments of a run on the machine of a session, between manual operation before and after each."""

from __future__ import annotations

import abc
from collections.abc import Generator
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...experiments.amounts import CHANNELS
from ...quantities import with_unit
from ..hardware.converters import SPAN
from ..prepare import PreparedRun, RunSegment
from ..sample_loop import SampledMachine, SampleLoop, played
from ..segment import Chunk
from ..software.interlocks import SPAN_TOLERANCE
from ..software.loop import BenchSoftware
from .interface import MachineSession

if TYPE_CHECKING:
    from ..protocol_run import ProtocolRun

EXACT = 1e-6  # of the allowed range, within which the machine's own set-point is the one asked for
NEAR = 0.01  # of the allowed range, within which a pressure or a tension is there
LONG = 5.0  # time for the rest of a way once its set-point moves no more [s]
SETTLE = 0.2  # time between the way and the run [s]
LOOK = 0.05  # time between two looks at the way [s]


class Arrival:
    """Whether the set-points of a machine, and what is measured of them, have reached the requested values.

    Args:
        session: the machine.
        **goals: ``pressure``, ``span``, ``velocity`` or ``tension`` as asked for [SI]; a velocity is not measured.

    Attributes:
        apart: the channels whose measured value was not there at the last look.
    """

    def __init__(self, session: MachineSession, **goals: float) -> None:
        self.session, self.goals, self.apart = session, goals, list(goals)
        self._ranges = {n: max(abs(end) for end in session.setup.allowed(n)) for n in goals}
        self._left, self._before = LONG, dict.fromkeys(goals, np.nan)

    def arrived(self) -> bool:
        """Look at the newest sample, `LOOK` after the last time, and say whether all is there."""
        at, ranges = self.session.latest(), self._ranges
        near = {n: {"span": SPAN_TOLERANCE, "velocity": np.inf}.get(n, NEAR * ranges[n]) for n in self.goals}
        self.apart = [n for n, goal in self.goals.items() if abs(at.get(n, goal) - goal) > near[n]]
        asked = {n: at[f"command.{n}"] for n in self.goals}
        exact = all(abs(asked[n] - goal) <= EXACT * ranges[n] for n, goal in self.goals.items())
        if exact or not any(abs(asked[n] - self._before[n]) > 0.0 for n in asked):
            self._left -= LOOK
        self._before = asked
        return exact and not self.apart

    @property
    def stuck(self) -> bool:
        """Whether the set-points have stood still for `LONG` without all being there."""
        return self._left <= 0.0


class SampledSession(MachineSession):
    """A session whose machine is sampled in this process, by hand or, lent between two samples, by the loop of a run."""

    machine: SampledMachine
    period: float

    @abc.abstractmethod
    def observe(self, chunk: Chunk, *, by_hand: bool = False) -> None:
        """Take samples of the machine."""

    @abc.abstractmethod
    def lend(self, run_loop: SampleLoop) -> SampleLoop:
        """End the manual loop between two samples, so that the loop of a run can continue."""

    @abc.abstractmethod
    def resume(self, loop: SampleLoop) -> None:
        """Return to manual operation after the last sample of a run."""

    @abc.abstractmethod
    def ask_for(self, **wanted: float | str) -> None:
        """Change the set-points without checking the mode of the machine."""


class ContinuedMachine:
    """A stage with the machine of a session, which is sampled before, during and after the run.

    Raises:
        InputError: if a segment cannot be played on this machine.
    """

    def __init__(self, session: SampledSession, prepared: PreparedRun, attended: bool) -> None:
        self.session, self.prepared, self.hardware = session, prepared, session.machine.hardware
        self._zero = 0
        for segment in prepared.segments():
            if segment.asked and not attended:
                raise InputError("ask", None, f"needs a person: the protocol asks the operator to {segment.asked}")
            as_it_is = (segment.layout, segment.friction) == (session.setup.prepared.layout, 1.0)
            if self.hardware.state() is not None and not as_it_is:
                allowed = "a simulated machine stays as it is; use mckibben run"
                raise InputError("ask", segment.asked or segment.layout, allowed)

    def play(
        self, run: ProtocolRun, number: int, segment: RunSegment, software: BenchSoftware
    ) -> Generator[Chunk, None, None]:
        """Play a segment between two samples of manual operation."""
        session, setup = self.session, self.session.setup
        begun, ended = self.hardware.state(), None  # type: np.ndarray | None, np.ndarray | None
        if abs(run.timing.period - session.period) > 1e-9 * session.period:
            raise InputError("period", run.timing.period, f"the machine goes on with {session.period:g} s")
        unit = setup.prepared.unit
        run.machine = setup.rig.machine(segment.layout, unit, start=segment.start_span, moves=segment.moves)

        def take() -> SampleLoop:
            nonlocal begun
            before = session.lend(loop)
            begun = self.hardware.state()
            return before

        def give_back(loop: SampleLoop) -> None:
            nonlocal ended
            ended = self.hardware.state()
            session.resume(loop)

        loop = run.loop(
            session.machine, segment, software, session.observe, zero=self._zero, begin=take, ended=give_back
        )
        try:
            yield from played(loop)
        finally:
            account = setup.closed(begun, ended)
            if account is not None:
                run.accounts.append(account)

    def bring(self, segment: RunSegment) -> None:
        """Depressurise, move to the start span, repressurise, so that no load is pulled along full."""
        session, at = self.session, self.session.latest()
        rest, span = segment.start_pressure, segment.start_span
        self._zero = self._count_at(span)
        motor = self.prepared.rig.motor is not None
        there = abs(at.get("command.pressure", 0.0) - rest) < 1.0
        if there and (not motor or abs(at.get("command.span", np.nan) - span) < 1e-6):
            return
        session.note(f"going to where {self.prepared.protocol.name} begins")
        down = min(rest, at.get("command.pressure", 0.0))
        for pressure, place in ((down, None), (down, span), (rest, span)):
            self._reach(pressure, place if motor else None)
        self._go_on(SETTLE)

    def _reach(self, pressure: float, span: float | None) -> None:
        session, goals = self.session, {"pressure": pressure, **({} if span is None else {"span": span})}
        session.ask_for(**goals)
        arrival = Arrival(session, **goals)
        while not arrival.stuck:
            self._go_on(LOOK)
            if arrival.arrived():
                return
        name = next(iter(arrival.apart), "pressure")
        goal, measured = (with_unit(value, CHANNELS[name]) for value in (goals[name], session.latest()[name]))
        raise InputError(name, measured, f"the protocol begins at {goal}, which was not reached")

    def _go_on(self, seconds: float) -> None:
        self.session.wait(seconds)
        if self.session.why:
            raise InputError("run", self.prepared.protocol.name, f"on the way to its beginning: {self.session.why}")

    def _count_at(self, span: float) -> int:
        converters = self.session.setup.converters
        if converters.encoder is None:
            return 0
        one, none = (float(converters.read({SPAN: np.asarray(x)})[SPAN]) for x in (1.0, 0.0))
        return round((span - none) / (one - none))
