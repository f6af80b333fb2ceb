"""One run on the simulated machine, as ``mckibben run --real-time`` does it, in a thread, with a pace that can be changed.

The recording is that of the command line, bit for bit: same preparation, same seed, same loop; only the pace differs, and
paced or not a run is the same.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...bench.prepare import Bench as Prepared
from ...bench.run import Run
from ...bench.software.emergency_stop import EmergencyStop
from ...errors import InputError, MckibbenError
from ...recordings.recording import Recording
from ..stream import Stream
from .columns import Columns
from .log import Log
from .measure import of_cycle
from .pace import Pace, Paced

SHOWN = 1000.0  # samples that pages get of a second


class Going:
    """A run while it goes on, and what became of it.

    Args:
        bench: what is done; nothing speaks against it.
        pace: of its time.
        stream: that the samples go to.
        log: that is told of cycles.
        news: told that something changed.
        over: given the run when it has ended.

    Attributes:
        time: how far it is [s].
        record: at the end, if there is one.
        error: at the end, if it failed.
        asked: what a person has to do now.
        words: which step or cycle it is in.
        cycle: which of how many, where the step has cycles.
        measured: on the last cycle.
    """

    def __init__(
        self, bench: Prepared, pace: Pace, stream: Stream, log: Log, news: Callable[[], None],
        over: Callable[[Going], None],
    ) -> None:  # fmt: skip
        self.bench, self.pace, self.stream, self._log, self._news, self._over = bench, pace, stream, log, news, over
        self.button = EmergencyStop()
        self.time = 0.0
        self.record: Recording | None = None
        self.error: str | None = None
        self.asked, self.words, self.cycle = "", "getting the machine ready", []  # type: str, str, list[int]
        self.measured: list[dict[str, Any]] = []
        self.stopping = ""  # the ordinary stop, which is no trip
        self._answered = threading.Event()
        self._columns = Columns(bench.rig)
        self._count, self._every = 0, max(1, round(bench.plan.sample_rate / SHOWN))
        stream.begin("run", bench.protocol.name, self._every / bench.plan.sample_rate)
        self._run = Run(bench, display=self._show, stop=self.button, ask=self._ask)
        self._run.real_time = True
        self._run.simulated_by = functools.partial(Paced, pace=pace)
        self._thread = threading.Thread(target=self._go, name="run", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def join(self, longest: float | None = None) -> None:
        """Wait for its end [s]."""
        self._thread.join(longest)

    def stop(self, reason: str, *, trip: bool) -> None:
        """At the next sample the valve vents and the motor only brakes."""
        self.stopping = "" if trip else reason
        self.button.press(reason, ordinary=not trip)
        self.pace.shown(None)  # a stop waits for no page
        self.pace.halt(False)
        self._answered.set()

    def answer(self) -> None:
        """What a person was asked to do is done."""
        self.asked = ""
        self._answered.set()

    @property
    def tripped(self) -> str:
        """Why it was stopped, by an interlock or the emergency stop; nothing while it was not, or by an ordinary stop."""
        stopped = self._run.result == "stopped"
        return self._run.message if stopped and not self.stopping else ""

    @property
    def when(self) -> float:
        """When it was stopped, or how far it is [s]."""
        coded = [e for e in self._run.events if "code" in e]
        return float(coded[-1]["time"]) if coded else self.time

    @property
    def steps(self) -> list[dict[str, Any]]:
        """The steps that have begun: label, start, end [s]."""
        return list(self._run.table.steps)

    def _go(self) -> None:
        try:
            self.record = self._run.go()
        except MckibbenError as error:
            self.error = str(error)
        except Exception as error:  # of a run that fails, no other thing of the laboratory may
            self.error = f"the run failed: {type(error).__name__}: {str(error)[:200]}"
        finally:
            self._over(self)

    def _ask(self, what: str) -> None:
        self.asked = what
        self._answered.clear()
        self._news()
        self._answered.wait()
        self.asked = ""
        if self.button():
            raise InputError("run", self.bench.protocol.name, f"it was stopped before somebody could {what}")
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
        """Say which cycle it is in, and measure the one that has ended."""
        step = self.steps[-1] if self.steps else None
        if step is None:
            return
        planned = self.bench.plan.steps[step["index"] - 1]
        frequency, label = planned.step.frequency(), step["label"] or f"step {step['index']}"
        if not frequency:
            self.words, self.cycle = label, []
            return
        count = max(1, round(planned.count / self.bench.plan.sample_rate * frequency))
        cycle = [min(int((self.time - step["start"]) * frequency) + 1, count), count, step["index"]]
        if cycle == self.cycle:
            return
        self.words, self.cycle = f"cycle {cycle[0]} of {count}", cycle
        self._log.say(
            f"Cycle {cycle[0]} of {count} began." if cycle[0] > 1 else f"{label.capitalize()} began.", "note", self.time
        )
        if cycle[0] > 1:
            period = self.stream.period
            self.measured = of_cycle(self.stream.newest(round(2.2 / (frequency * period))), period, frequency)
