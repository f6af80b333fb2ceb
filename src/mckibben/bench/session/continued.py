"""Segments of a run on the machine of a session, between manual operation before and after each."""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...quantities import with_unit
from ..hardware.converters import SPAN
from ..prepare import PreparedRun, RunSegment
from ..sample_loop import SampleLoop, played
from ..segment import Chunk
from ..software.loop import BenchSoftware

if TYPE_CHECKING:
    from ..protocol_run import ProtocolRun
    from .session import Session

NEAR = 0.01  # of the valve's range, within which a pressure is there
CLOSE = 3e-4  # within which a span is there [m]
LONG = 5.0  # time for the rest of a way once its set-point is there [s]
SETTLE = 0.2  # time between the way and the run [s]
LOOK = 0.05  # time between two looks at the way [s]


class ContinuedMachine:
    """A stage with the machine of a session, which is sampled before, during and after the run.

    Args:
        session: that has the machine.
        prepared: what is done.
        attended: whether an operator carries out the tasks of the protocol.

    Raises:
        InputError: if a segment cannot be played on this machine.
    """

    def __init__(self, session: Session, prepared: PreparedRun, attended: bool) -> None:
        self.session, self.prepared, self.hardware = session, prepared, session.machine.hardware
        self._zero = 0
        for segment in prepared.segments():
            if segment.asked and not attended:
                raise InputError("ask", None, f"needs a person: the protocol asks somebody to {segment.asked}")
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
        session.wait(SETTLE)

    def _reach(self, pressure: float, span: float | None) -> None:
        session, top = self.session, float(self.session.setup.limits.pressure[1])
        session.ask_for(pressure=pressure, **({} if span is None else {"span": span}))
        left = LONG
        while left > 0.0:
            session.wait(LOOK)
            if session.why:
                raise InputError("run", self.prepared.protocol.name, f"on the way to its beginning: {session.why}")
            at = session.latest()
            asked = abs(at["command.pressure"] - pressure) < 1.0
            asked = asked and (span is None or abs(at["command.span"] - span) < 1e-6)
            off = abs(at.get("pressure", pressure) - pressure) / (NEAR * top)
            away = 0.0 if span is None else abs(at.get("span", span) - span) / CLOSE
            if asked and off <= 1.0 and away <= 1.0:
                return
            left -= LOOK if asked else 0.0
        name, unit = ("pressure", "Pa") if off > 1.0 else ("span", "m")
        wanted = with_unit(pressure if off > 1.0 else float(span or 0.0), unit)
        raise InputError(name, with_unit(at[name], unit), f"the protocol begins at {wanted}, which was not reached")

    def _count_at(self, span: float) -> int:
        """Return the count of the encoder at a span [m], to the nearest count."""
        converters = self.session.setup.converters
        if converters.encoder is None:
            return 0
        one, none = (float(converters.read({SPAN: np.asarray(x)})[SPAN]) for x in (1.0, 0.0))
        return round((span - none) / (one - none))
