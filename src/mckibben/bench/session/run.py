"""A protocol on the machine of a session: prepared for it, begun where the machine is brought to, and told like any run."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...assembly.where_it_went import document
from ...errors import InputError
from ...experiments.dry_run import check
from ...experiments.protocol import Protocol
from ...quantities import with_unit
from ...recordings.recording import Recording
from ..hardware.converters import SPAN
from ..hardware.ongoing import Lent
from ..metadata import CLOSED
from ..prepare import PreparedRun, RunSegment, prepare
from ..run import Display, Progress, Run
from ..wall_clock import Loop

if TYPE_CHECKING:
    from .session import Session

NEAR = 0.01  # of the valve's range, within which a pressure is there
CLOSE = 3e-4  # within which a span is there [m]
LONG = 5.0  # time for the rest of a way once its set-point is there [s]
SETTLE = 0.2  # time between the way and the run [s]
LOOK = 0.05  # time between two looks at the way [s]


class OnMotor(RunSegment):
    """A part whose muscle hangs at the motor, which holds it where another machine has a plate."""

    @property
    def moves(self) -> bool:
        """Always."""
        return True


class OnMachine(PreparedRun):
    """A run on a machine that is there already."""

    @classmethod
    def of(cls, bench: PreparedRun, **changed: Any) -> OnMachine:
        """The same on such a machine."""
        return cls(**{f.name: getattr(bench, f.name) for f in dataclasses.fields(bench)} | changed)

    def segments(self) -> Iterator[RunSegment]:
        """As of any run, at the motor if there is one."""
        for part in super().segments():
            yield part if self.rig.motor is None else OnMotor(*part)


def prepared(protocol: Protocol | str, rate: float, **options: Any) -> OnMachine:
    """A run on a loop of a rate [1/s].

    Raises:
        InputError: if the rate of the protocol is no whole part of it.
    """
    bench = prepare(protocol, **options)
    own = bench.protocol.sample_rate
    every = round(rate / own)
    if every < 1 or abs(rate / own - every) > 1e-6:
        allowed = f"the session samples at {rate:g} Hz; allowed is that or a whole part of it"
        raise InputError("sample_rate", f"{own:g} Hz", allowed)
    if bench.findings or abs(bench.plan.sample_rate - rate) < 1e-6 * rate:
        return OnMachine.of(bench)
    faster = prepare(dataclasses.replace(bench.protocol, sample_rate=rate), **options)
    return OnMachine.of(faster, protocol=bench.protocol, every=every)


class SessionRun:
    """One run on the machine of a session.

    Args:
        session: that has the machine.
        bench: what is done.
        ask: told what a person has to do.
    """

    def __init__(self, session: Session, bench: OnMachine, ask: Callable[[str], None] | None = None) -> None:
        self.session, self.bench, self.ask = session, bench, ask
        self.done = 0.0
        self.loops: list[Loop] = []
        self.states: list[tuple[np.ndarray, np.ndarray]] = []
        self._begun: np.ndarray | None = None
        self.lent = Lent(session.setup.ground, session.told, take=self._take, ended=self._end)
        check(list(bench.findings))
        self.parts = list(bench.segments())
        self._to_come = iter([part for part in self.parts if part.asked])
        for part in self.parts:
            self._possible(part)

    def go(
        self, log: str | Path | None, progress: Progress | None, display: Display | None,
        begun: Callable[[Run], None] | None = None,
    ) -> Recording:  # fmt: skip
        """From where the machine is to the recording; the machine is in manual mode afterwards, or stopped."""
        session = self.session

        def told(time: float, total: float) -> None:
            self.done = time
            if progress is not None:
                progress(time, total)

        going = Run(
            self.bench, progress=told, display=display, stop=session.button, ask=None if self.ask is None else self._asked,
            log=log,
        )  # fmt: skip
        going.hardware = self.lent
        if not self.parts[0].asked:
            self._bring(self.parts[0])
        if begun is not None:
            begun(going)
        try:
            record = going.go()
        finally:
            for loop in self.loops:  # what nobody has looked at after an interrupt
                loop.chunk(len(loop.kept))
        return record.with_meta(self._accounts())

    @property
    def pending(self) -> bool:
        """Whether the machine is lent, or samples of that have not been told of."""
        return self.lent.holds or self.lent.pending > 0

    def _asked(self, text: str) -> None:
        assert self.ask is not None
        self.ask(text)
        self._bring(next(self._to_come))

    def _possible(self, part: RunSegment) -> None:
        session = self.session
        if part.asked and self.ask is None:
            raise InputError("ask", "nobody", f"the protocol wants a person to {part.asked}")
        if session.setup.ground.machine is not None and (part.layout, part.friction) != (
            session.setup.bench.layout,
            1.0,
        ):
            allowed = "a simulated machine stays as it is; allowed is mckibben run"
            raise InputError("ask", part.asked or part.layout, allowed)

    def _take(self) -> Loop:
        before = self.session.lend()
        machine = self.session.setup.ground.machine
        self._begun = None if machine is None else machine.state()
        return before

    def _end(self, loop: Loop) -> None:
        self.loops.append(loop)
        machine = self.session.setup.ground.machine
        if machine is not None and self._begun is not None:
            self.states.append((self._begun, machine.state()))
        self.session.resume(loop)

    def _bring(self, part: RunSegment) -> None:
        """By hand to where a part begins: down with the pressure, along, and up, so that no load is pulled along full."""
        session, at = self.session, self.session.latest()
        rest, span = part.start_pressure, part.start_span
        self.lent.zero(self._zero(span))
        there = abs(at.get("command.pressure", 0.0) - rest) < 1.0
        along = self.bench.rig.motor is None or abs(at.get("command.span", np.nan) - span) < 1e-6
        if there and along:
            return
        session.note(f"going to where {self.bench.protocol.name} begins")
        down = min(rest, at.get("command.pressure", 0.0))
        for pressure, place in ((down, None), (down, span), (rest, span)):
            self._reach(pressure, None if self.bench.rig.motor is None else place)
        session.wait(SETTLE)

    def _reach(self, pressure: float, span: float | None) -> None:
        session, top = self.session, float(self.session.setup.limits.pressure[1])
        session.ask_for(pressure=pressure, **({} if span is None else {"span": span}))
        left = LONG
        while left > 0.0:
            session.wait(LOOK)
            if session.why:
                raise InputError("run", self.bench.protocol.name, f"on the way to its beginning: {session.why}")
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

    def _zero(self, span: float) -> int:
        """The count at which an encoder would have been zeroed at a span [m], to the nearest one."""
        session = self.session
        if session.setup.converters.encoder is None:
            return 0
        one, none = (float(session.setup.converters.read({SPAN: np.asarray(x)})[SPAN]) for x in (1.0, 0.0))
        return round((span - none) / (one - none))

    def _accounts(self) -> dict[str, Any]:
        """What a run on a simulated machine of its own would tell of its accounts."""
        session = self.session
        if not self.states:
            return {}
        closed = [session.setup.closed(begin, end) for begin, end in self.states]
        return {
            "balance": {name: max(float(getattr(a, name)) for a in closed) for name in CLOSED},
            "friction": {"work": sum(a.friction for a in closed), "dissipated": sum(a.dissipated for a in closed)},
            "energy": document(session.setup.machine, [a.energy_parts for a in closed]),
        }
