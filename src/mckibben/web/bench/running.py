"""Runs in the web interface, each in a separate thread, from the start to the saved recording.

On the simulated machine the recording is that of ``mckibben run --real-time``, bit for bit: same preparation, same seed,
same loop; only the pace differs, and paced or not a run is the same. On a real machine it is a run of the session that has
it.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...bench.prepare import PreparedRun
from ...bench.protocol_run import RunState
from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ...recordings.recording import Recording
from ..pages.bench.columns import Columns
from ..pages.bench.measure import of_cycle
from ..shelf import plain

if TYPE_CHECKING:
    from .machine import Bench

SHOWN = 1000.0  # samples that pages get of a second
CAUSES = {
    "emergency_stop": "the emergency stop", "lost_line": "the loss of the machine", "log": "a log that takes no more",
    "missed": "a test that did not come true",
}  # fmt: skip


class RunController:
    """A run of a bench from its start to its saved recording.

    Args:
        bench: that the run is on; told `Bench.run_over` when it has ended.
        prepared: the run; its dry run has passed.

    Attributes:
        state: that of the session's run.
        time: time of the newest sample that pages have [s].
        thread: started by the bench.
        asked: task of the operator.
        words: which step or cycle it is in.
        cycle: which of how many, where the step has cycles.
        measured: on the last cycle.
        file: name that its recording is to have.
        stopping: why it is ended by hand, which is no trip.
    """

    def __init__(self, bench: Bench, prepared: PreparedRun) -> None:
        self.bench, self.prepared, self.new_machine, self.button = (
            bench,
            prepared,
            bench.spec is None,
            bench.session.button,
        )
        name = plain(prepared.protocol.name)
        self._crash_log: Path | None = None
        if not self.new_machine:
            self._crash_log = bench.workspace.recordings.ready() / bench.workspace.recordings.numbered(name, ".mcap")
            name = self._crash_log.stem
        self.file = f"{name}.nc" if self._crash_log else bench.workspace.recordings.numbered(name, ".nc")
        self.state, self.time, self._answered = RunState(), 0.0, threading.Event()
        self.stopping = self.asked = ""
        self.words = "getting the machine ready" if self.new_machine else "going to where it begins"
        self.cycle: list[int] = []
        self.measured: list[dict[str, Any]] = []
        self._columns, self._count = Columns(prepared.rig), 0
        self._every = max(1, round(prepared.plan.sample_rate / SHOWN))
        self.thread = threading.Thread(target=self._play, name="run", daemon=True)

    def stop(self, reason: str, *, trip: bool) -> None:
        """Stop the run: at the next sample the valve vents and the motor only brakes."""
        self.button.press(reason, ordinary=not trip)
        if self.button.ordinary and self.state.result != "stopped":
            self.stopping = self.button.reason
        elif not self.button.ordinary:
            self.stopping = ""
        self.bench.clock.viewed(None)  # a stop waits for no page
        self.bench.clock.halt(False)
        self._answered.set()

    def answer(self) -> None:
        """Confirm an operator action."""
        self.asked = ""
        self._answered.set()

    @property
    def tripped(self) -> str:
        """Reason of a stop by an interlock or the emergency stop; empty otherwise."""
        return self.state.message if self.state.result == "stopped" and not self.stopping else ""

    @property
    def cause(self) -> str:
        """Cause of a stop, as the end of "ended by ..."; empty without a stop and after an ordinary one."""
        stop = self.state.stop
        return "" if stop is None or self.stopping else CAUSES.get(str(stop["code"]), "an interlock")

    @property
    def when(self) -> float:
        """Time of the stop, or present time of the run [s]."""
        return float(self.time if self.state.stop is None else self.state.stop["time"])

    def _play(self) -> None:
        record, said = None, "nothing was recorded"
        try:
            record = self.bench.session.run(
                self.prepared, new_machine=self.new_machine, clock=self.bench.clock if self.new_machine else None,
                log=self._crash_log, begun=self._begun, display=self._show, ask=self._ask,
            )  # fmt: skip
        except MckibbenError as error:
            said = str(error)
        except Exception as error:  # a failed run must not end anything else
            said = f"the run failed: {type(error).__name__}: {str(error)[:200]}"
        why, name = self.tripped or self.bench.session.why, None
        if record is None:
            self._say(said, "stop")
        else:
            name, said = self._save(record, why)
        self.bench.run_over(self, {"file": name, "said": said}, why)

    def _save(self, record: Recording, why: str) -> tuple[str | None, str]:
        """Save the recording and say so; return the name of its file, if there is one, and how the run ended."""
        shelf, message = self.bench.workspace.recordings, str(record.meta["message"])
        if self.stopping:
            message = f"Stopped by you at {self.time:.3f} s; the valve vented."
        try:
            shelf.ready()
            name = self.file if self._crash_log else shelf.free(self.file)
            record.save(shelf.path(name))
            if self._crash_log is not None:
                self._crash_log.unlink(missing_ok=True)  # all of it is in the recording
        except (MckibbenError, OSError) as error:
            kept = self._crash_log is not None and self._crash_log.exists()
            said = (
                f"{error}; kept: {self._crash_log.name}" if kept and self._crash_log else f"{error}; nothing was kept"
            )
            self._say(said, "stop")
            return None, said
        if why or not self.new_machine:  # the session has said how it ended
            self._say(f"Recorded as {name}{', up to the stop' if why else ''}.", "done")
        else:
            done = record.meta["result"] == "done" or bool(self.stopping)
            self._say(
                f"{message[:1].upper()}{message[1:].rstrip('.')}. Recorded as {name}.", "done" if done else "stop"
            )
        return name, message

    def _say(self, text: str, kind: str = "note") -> None:
        self.bench.messages.say(text, self.time, kind)

    def _begun(self, state: RunState) -> None:
        """Begin an epoch of the stream for the samples of the run."""
        self.state = state
        self.bench.view.hold(True)
        self.bench.stream.begin("run", self.prepared.protocol.name, self._every / self.prepared.plan.sample_rate)

    def _ask(self, text: str) -> None:
        self.asked = text
        self._answered.clear()
        self.bench.workspace.changed()
        self._answered.wait()
        self.asked = ""
        if self.button():
            raise InputError("run", self.prepared.protocol.name, f"it was stopped before the operator could {text}")
        self.bench.workspace.changed()

    def _show(self, times: np.ndarray, arrays: Mapping[str, np.ndarray]) -> None:
        first = -self._count % self._every
        self._count, self.time = self._count + len(times), float(times[-1])
        columns = {n: v[first :: self._every] for n, v in self._columns.of(arrays).items()}
        if len(next(iter(columns.values()))):
            self.bench.stream.add(columns)
        self._follow()

    def _follow(self) -> None:
        """Announce the present cycle and measure the last one; after a stop no cycle begins."""
        if not self.state.steps or self.button() or self.state.result == "stopped":
            return
        step, plan = self.state.steps[-1], self.prepared.plan
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
        self._say(f"Cycle {cycle[0]} of {count} began." if cycle[0] > 1 else f"{label.capitalize()} began.")
        if cycle[0] > 1:
            stream = self.bench.stream
            newest = stream.newest(round(2.2 / (frequency * stream.period)))
            self.measured = of_cycle(newest, stream.period, frequency)

    def steps(self) -> list[dict[str, JsonValue]]:
        """List the steps that have begun, as a page draws them."""
        steps = []
        for one in list(self.state.steps):
            frequency = self.prepared.plan.steps[one["index"] - 1].step.frequency()
            steps.append(
                {
                    "path": one["path"], "label": one["label"] or "step", "start": one["start"],
                    "end": one["end"] if one["end"] > one["start"] else None,
                    "period": 1.0 / frequency if frequency else 0.0,
                }
            )  # fmt: skip
        return steps
