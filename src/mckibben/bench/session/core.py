"""What a session rests on: its loop, the samples as they come, its stops, and the machine lent to runs and taken back."""

from __future__ import annotations

import functools
import gc
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ...engine import sampled
from ...errors import InputError, LineLostError, MckibbenError
from .. import channels
from ..hardware.ongoing import Lent
from ..run import channels_of as channels_of
from ..software.emergency_stop import EmergencyStop, sentence
from ..software.interlocks import Trip
from ..software.manual import ABANDONED
from ..software.sequencer import SPAN, TENSION
from ..wall_clock import LOOK, Loop
from .loop import Gate, ManualLoop, Wishes, motor_of
from .record import Recorder
from .ring import Ring
from .run import SessionRun
from .setup import Setup
from .status import CLOSED, IDLE, LOST, MANUAL, RUNNING, STOPPED, Message, Messages, Status

STEP = 0.1  # time between two looks at a machine whose time goes only while somebody waits [s]


class Core:
    """A machine that goes on by hand.

    Args:
        setup: the machine and its manual software.
        keep: time for which samples are kept for displays [s].
        stepped: its time goes only while somebody waits.

    Attributes:
        button: the emergency stop; another one after every reset.
        why: what stopped the machine; nothing while it is not stopped.
    """

    def __init__(self, setup: Setup, *, keep: float, stepped: bool) -> None:
        self.setup, self.period = setup, setup.timing.period
        self.button, self.why = EmergencyStop(), ""
        self._lock, self._acting = threading.RLock(), threading.RLock()
        self._messages, self._ring = Messages(), Ring(max(1, round(keep / self.period)))
        self._record: Recorder | None = None
        self._run: SessionRun | None = None
        self._gone = ""  # lost or closed
        self._from = 0  # number of the first sample whose stops are news
        self._used = False  # whether anything was asked for since it was last vented
        self._wishes, self._gate = Wishes(), Gate() if stepped else None
        self._loop = ManualLoop(
            Lent(setup.ground, functools.partial(self.told, by_hand=True)), setup.converters, setup.software(),
            outputs=setup.machine.signals(), period=self.period, stop=lambda: self.button(), source=self._wishes,
            gate=self._gate, over=self._over,
        )  # fmt: skip
        # what has been made by now stays, so that nobody looks through it again while samples wait
        gc.collect()
        gc.freeze()
        self._loop.go()
        self.wait(self.period)
        if not stepped:
            threading.Thread(target=self._tend, name="session", daemon=True).start()

    @property
    def gone(self) -> str:
        """Whether the machine is lost or closed; nothing while it is there."""
        return self._gone

    def told(self, seen: sampled.Seen, numbers: np.ndarray, lateness: np.ndarray, *, by_hand: bool = False) -> None:
        """Take a chunk of samples, whoever had the machine; they come in their order."""
        arrays, times = channels_of(seen, len(numbers)), self.period * numbers
        with self._lock:
            self._ring.add(times, arrays)
            if self._record is not None:
                try:
                    self._record.take(numbers, lateness, arrays)
                except MckibbenError as error:
                    self._record = None
                    self._messages.say(f"nothing is recorded any more: {error}", float(times[-1]), "stop")
            news = (seen.shown["code"] > 0) & (numbers >= self._from)
            if news.any() and not self.why:
                self._stopped(seen, int(np.argmax(news)), times)
            if by_hand and self._wishes["pressure"] > 0.0 and (seen.shown["step"] == ABANDONED).any():
                self._rest()
                self._say("nobody is in control: vented, and the motor holds", "stop", float(times[-1]))

    def _stopped(self, seen: sampled.Seen, i: int, times: np.ndarray) -> None:
        when, code = float(times[i]), int(seen.shown["code"][i])
        if code == Trip.EMERGENCY_STOP:
            self.why = sentence(self.button, when)
        else:
            at = {n: float(v[i]) for n, v in seen.measured.items() if not n.endswith(".code")}
            self.why = self.setup.watch.reason(code, at | {"velocity": float(seen.shown["velocity"][i])}, when)
        self._rest()
        self._say(self.why, "stop", when, code=Trip(code).name.lower())

    def _collect(self) -> None:
        """Take what the manual loop has seen; never before what a run saw earlier."""
        with self._lock:
            if self._run is not None and self._run.pending:
                return
            ready = len(self._loop.kept)
            if ready:
                self._loop.chunk(ready)

    def _tend(self) -> None:
        while self._gone != CLOSED:
            self._collect()
            time.sleep(LOOK)

    def lend(self) -> Loop:
        """Between two samples the manual loop ends, for another to go on.

        Raises:
            LineLostError: if the machine is not there any more.
        """
        loop = self._loop.leave()
        with self._lock:
            loop.chunk(len(loop.kept))
        if self._gone:
            raise LineLostError(self.why or self._gone)
        return loop

    def resume(self, loop: Loop) -> None:
        """After the last sample of a run: by hand again, at its last set-points, or vented where it stopped."""
        error = loop.lost or loop.failed
        if error is not None:
            self._over(error)
            return
        mode, value = motor_of(loop)
        held = (TENSION, value) if mode == TENSION else (SPAN, np.nan)
        self._wishes.change(
            pressure=loop.number("command.pressure"), open=float(loop.opened), mode=held[0], motor=held[1], alone=0.0
        )
        self._used = True
        if loop.halted:
            self._rest()
        self._loop.go(after=loop)

    def _over(self, error: BaseException) -> None:
        """The machine is lost; called by the loop that had it."""
        with self._lock:
            self._gone, self.why = LOST, str(error) or type(error).__name__
            self._say(self.why, "stop")

    def _rest(self) -> None:
        """Ask for nothing: vented, and the motor stays where it is."""
        self._wishes.change(pressure=0.0, open=1.0, mode=SPAN, motor=np.nan, alone=0.0)
        self._used = False

    def _between(self, act: Callable[[int], None]) -> None:
        """Do something between two samples; it is told the number of the next one."""
        ground, done = self.setup.ground, threading.Event()
        if self.gone or (self._gate is not None and self._loop.alive):
            act(ground.number)
            return

        def acted(number: int) -> None:
            act(number)
            done.set()

        ground.mark = acted
        while not (done.wait(LOOK) or self.gone):
            pass
        if not done.is_set():
            act(ground.number)

    def wait(self, seconds: float) -> None:
        """Let a time of the machine go by [s]; ends where it is stopped or lost meanwhile."""
        ground, before = self.setup.ground, self.why
        until, step = ground.number + max(1, round(seconds / self.period)), max(1, round(STEP / self.period))
        while ground.number < until and self.why == before and not self._gone:
            if self._gate is not None and self._loop.alive:
                self._gate.through(min(until, ground.number + step))
            else:
                time.sleep(LOOK / 4.0)
            self._collect()

    def _until(self, true: Callable[[], bool], longest: float) -> None:
        """Wait for something by the wall clock, for a time at most [s]."""
        end = time.monotonic() + longest
        self._collect()
        while not true() and time.monotonic() < end:
            time.sleep(LOOK / 4.0)
            self._collect()

    def latest(self) -> dict[str, float]:
        """The newest sample: ``time`` of the session [s] and every channel [SI]."""
        self._collect()
        with self._lock:
            return self._ring.latest()

    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The samples after a time [s], of those that are kept for displays: times (n,) and channels (n,)."""
        self._collect()
        with self._lock:
            return self._ring.since(time)

    def messages(self, after: int = 0) -> list[Message]:
        """What happened, later than the message of a number."""
        self._collect()
        return self._messages.after(after)

    def note(self, text: str, kind: str = "note") -> None:
        """Say something at the time of the newest sample; a recording keeps it too."""
        with self._lock:
            self._say(text, kind)

    def _say(self, text: str, kind: str = "note", time: float | None = None, **more: Any) -> None:
        when = self.setup.ground.number * self.period if time is None else time
        self._messages.say(text, when, kind)
        self._remark(text, when, **more)

    def _remark(self, text: str, time: float | None = None, **more: Any) -> None:
        """What a recording keeps beside the samples."""
        when = self.setup.ground.number * self.period if time is None else time
        with self._lock:
            if self._record is not None:
                self._record.remark(text, when, **more)

    def status(self) -> Status:
        """How it is."""
        at, doing, recorder = self.latest(), self._run, self._record
        asked = {n.removeprefix("command."): v for n, v in at.items() if n.startswith("command.") and np.isfinite(v)}
        kept = () if self.why else ("pressure",) if self.setup.rig.motor is None else tuple(asked)
        asked = {n: v for n, v in asked.items() if n in kept}
        running = None if doing is None else (doing.bench.protocol.name, doing.done, doing.bench.plan.duration)
        return Status(
            state=self._doing(), why=self.why, time=at.get("time", 0.0),
            measured={n: at[n] for n in channels.MEASURED if n in at}, set_points=asked,
            deadlines=self._loop.deadlines(), protocol=running, recorded=None if recorder is None else recorder.time,
        )  # fmt: skip

    def _doing(self) -> str:
        if self._gone:
            return self._gone
        if self._run is not None:
            return RUNNING
        return STOPPED if self.why else MANUAL if self._used else IDLE

    def _alive(self, what: str, value: str = "refused") -> None:
        if self._gone:
            raise InputError(what, value, f"the machine is {self._gone}{': ' if self.why else ''}{self.why}")

    def _free(self, what: str, value: str = "refused") -> None:
        """Refuse what would be done to a machine that is not in manual mode."""
        self._alive(what, value)
        if self._run is not None:
            raise InputError(what, value, f"{self._run.bench.protocol.name} is running and sets it; stop it first")
        if self.why:
            raise InputError(what, value, f"the machine is stopped ({self.why}); reset it first")
