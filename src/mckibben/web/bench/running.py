"""Runs in the web interface, each in a separate thread, from the start to the saved recording.

On the simulated machine the recording is that of ``mckibben run --real-time``, bit for bit: same preparation, same seed,
same loop; only the pace differs, and paced or not a run is the same. On a real machine it is a run of the session that has
it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...bench.hardware.clock import Clock
from ...bench.prepare import PreparedRun
from ...bench.protocol_run import RunState
from ...bench.session import MachineSession, Messages, Session
from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ...recordings.recording import Recording
from ..shelf import Shelf, plain
from ..stream import Stream
from .columns import Columns
from .measure import of_cycle

SHOWN = 1000.0  # samples that pages get of a second
CAUSES = {
    "emergency_stop": "the emergency stop", "lost_line": "the loss of the machine", "missed": "a test that did not come true"
}  # fmt: skip


class RunController:
    """A run from its start to its saved recording.

    Args:
        prepared: the run; its dry run has passed.
        session: that has the machine.
        clock: clock of simulated time.
        stream: that the samples go to.
        log: that is told of cycles.
        shelf: shelf of the recordings.
        news: told that something changed.
        taken: called when the run begins, after a real machine was brought to where it does.
        over: given the run when it has ended.

    Attributes:
        time: how far it is [s].
        record: at the end, if there is one.
        error: at the end, if it failed.
        asked: task of the operator.
        words: which step or cycle it is in.
        cycle: which of how many, where the step has cycles.
        measured: on the last cycle.
        file: name that its recording is to have.
        stopping: why it is ended by hand, which is no trip.
    """

    def __init__(
        self, prepared: PreparedRun, session: MachineSession, clock: Clock, stream: Stream, log: Messages,
        shelf: Shelf, news: Callable[[], None], *, taken: Callable[[], None], over: Callable[[RunController], None],
    ) -> None:  # fmt: skip
        self.prepared, self.clock, self.stream, self._log, self._shelf = prepared, clock, stream, log, shelf
        self._session, self._news, self._taken, self._over = session, news, taken, over
        self._anew = session if isinstance(session, Session) else None  # a machine for this run, in this process
        self.button = session.button
        name = plain(prepared.protocol.name)
        self._crash_log: Path | None = None
        if self._anew is None:
            self._crash_log = shelf.ready() / shelf.numbered(name, ".mcap")
        self.file = shelf.numbered(name, ".nc") if self._crash_log is None else f"{self._crash_log.stem}.nc"
        self.time = 0.0
        self.record: Recording | None = None
        self.error: str | None = None
        ready = "going to where it begins" if self._anew is None else "getting the machine ready"
        self.asked, self.words, self.cycle = "", ready, []  # type: str, str, list[int]
        self.measured: list[dict[str, Any]] = []
        self.stopping = ""
        self._answered = threading.Event()
        self._columns = Columns(prepared.rig)
        self._count, self._every = 0, max(1, round(prepared.plan.sample_rate / SHOWN))
        self._run: RunState | None = None
        self._thread = threading.Thread(target=self._play, name="run", daemon=True)

    def start(self) -> None:
        """Start the thread of the run."""
        self._thread.start()

    def join(self, longest: float | None = None) -> None:
        """Wait for the end of the run, for at most a time [s]."""
        self._thread.join(longest)

    def stop(self, reason: str, *, trip: bool) -> None:
        """Stop the run: at the next sample the valve vents and the motor only brakes."""
        self.stopping = "" if trip else reason
        self.button.press(reason, ordinary=not trip)
        self.clock.viewed(None)  # a stop waits for no page
        self.clock.halt(False)
        self._answered.set()

    def answer(self) -> None:
        """Confirm an operator action."""
        self.asked = ""
        self._answered.set()

    @property
    def tripped(self) -> str:
        """Reason of a stop by an interlock or the emergency stop; empty otherwise."""
        run = self._run
        if run is not None and run.result == "stopped" and not self.stopping:
            return run.message
        return ""

    @property
    def _stops(self) -> list[dict[str, JsonValue]]:
        return [] if self._run is None else [e for e in self._run.events if "code" in e]

    @property
    def cause(self) -> str:
        """Cause of a stop, as the end of "ended by ..."; empty without a stop and after an ordinary one."""
        stops = self._stops
        return "" if not stops or self.stopping else CAUSES.get(str(stops[-1]["code"]), "an interlock")

    @property
    def when(self) -> float:
        """Time of the stop, or present time of the run [s]."""
        stops = self._stops
        return float(stops[-1]["time"]) if stops else self.time

    @property
    def steps(self) -> list[dict[str, JsonValue]]:
        """Steps that have begun: label, start, end [s]."""
        return [] if self._run is None else list(self._run.steps)

    def save_result(self, why: str = "") -> dict[str, JsonValue]:
        """Save the recording after the end, and report it in the log.

        Args:
            why: what stopped it, where the log knows that already.

        Returns:
            ``file``, the name of the recording or None, and ``said``.
        """
        if self.record is None:
            said = self.error or "nothing was recorded"
            self._log.say(said, self.time, "stop")
            return {"file": None, "said": said}
        message = str(self.record.meta["message"])
        if self.stopping:
            message = f"Stopped by you at {self.time:.3f} s; the valve vented."
        try:
            self._shelf.ready()
            name = self._shelf.free(self.file) if self._crash_log is None else self.file
            self.record.save(self._shelf.path(name))
            if self._crash_log is not None:
                self._crash_log.unlink(missing_ok=True)  # all of it is in the recording
        except (MckibbenError, OSError) as error:
            self._log.say(str(error), self.time, "stop")
            return {"file": None, "said": str(error)}
        done = self.record.meta["result"] == "done" or bool(self.stopping)
        if why or self._anew is None:  # the session has said how it ended
            self._log.say(f"Recorded as {name}{', up to the stop' if why else ''}.", self.time, "done")
        else:
            sentence = f"{message[:1].upper()}{message[1:].rstrip('.')}. Recorded as {name}."
            self._log.say(sentence, self.time, "done" if done else "stop")
        return {"file": name, "said": message}

    def _play(self) -> None:
        try:
            self.record = self._recorded()
        except MckibbenError as error:
            self.error = str(error)
        except Exception as error:  # of a run that fails, no other thing of the laboratory may
            self.error = f"the run failed: {type(error).__name__}: {str(error)[:200]}"
        finally:
            self._over(self)

    def _recorded(self) -> Recording:
        if self._anew is None:
            return self._session.run(
                self.prepared, log=self._crash_log, display=self._show, ask=self._ask, begun=self._begun
            )
        return self._anew.run(
            self.prepared, anew=True, clock=self.clock, display=self._show, ask=self._ask,
            begun=self._begun,
        )  # fmt: skip

    def _begun(self, run: RunState) -> None:
        """Begin an epoch of the stream for the samples of the run."""
        self._run = run
        self._taken()
        self.stream.begin("run", self.prepared.protocol.name, self._every / self.prepared.plan.sample_rate)

    def _ask(self, text: str) -> None:
        self.asked = text
        self._answered.clear()
        self._news()
        self._answered.wait()
        self.asked = ""
        if self.button():
            raise InputError("run", self.prepared.protocol.name, f"it was stopped before somebody could {text}")
        self._news()

    def _show(self, times: np.ndarray, arrays: Mapping[str, np.ndarray]) -> None:
        first = -self._count % self._every
        self._count += len(times)
        if not len(times):
            return
        self.time = float(times[-1])
        columns = {n: v[first :: self._every] for n, v in self._columns.of(arrays).items()}
        if len(next(iter(columns.values()))):
            self.stream.add(columns)
        self._follow()

    def _follow(self) -> None:
        """Announce the present cycle and measure the last one; after a stop no cycle begins."""
        step = self.steps[-1] if self.steps else None
        if step is None or self.button() or (self._run is not None and self._run.result == "stopped"):
            return
        plan = self.prepared.plan
        planned = plan.steps[step["index"] - 1]
        frequency, label = planned.step.frequency(), step["label"] or f"step {step['index']}"
        if not frequency:
            self.words, self.cycle = label, []
            return
        count = max(1, round(planned.count / plan.sample_rate * frequency))
        cycle = [min(int((self.time - step["start"]) * frequency) + 1, count), count, step["index"]]
        if cycle == self.cycle:
            return
        self.words, self.cycle = f"cycle {cycle[0]} of {count}", cycle
        self._log.say(
            f"Cycle {cycle[0]} of {count} began." if cycle[0] > 1 else f"{label.capitalize()} began.", self.time
        )
        if cycle[0] > 1:
            period = self.stream.period
            self.measured = of_cycle(self.stream.newest(round(2.2 / (frequency * period))), period, frequency)
