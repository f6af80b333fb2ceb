"""One run on the simulated machine, as ``mckibben run --real-time`` does it, in a thread, with a pace that can be changed.

The recording is that of the command line, bit for bit: same preparation, same seed, same loop; only the pace differs, and
paced or not a run is the same. On a real machine it is a run of the session that has the machine.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...bench.prepare import PreparedRun
from ...bench.run import Run
from ...bench.session.own_process import OwnProcess
from ...bench.software.emergency_stop import EmergencyStop
from ...errors import InputError, MckibbenError
from ...experiments.dry_run import check
from ...recordings.recording import Recording
from ..shelf import Shelf, plain
from ..stream import Stream
from .columns import Columns
from .log import Log
from .measure import of_cycle
from .pace import Pace, Paced

if TYPE_CHECKING:
    from ...bench.session.own_process import Doing
    from ...bench.session.run import OnMachine
    from ...experiments.protocol import Protocol
    from .by_hand import ByHand

SHOWN = 1000.0  # samples that pages get of a second
CAUSES = {
    "emergency_stop": "the emergency stop", "lost_line": "the loss of the machine", "missed": "a test that did not come true"
}  # fmt: skip


class RealMachine(NamedTuple):
    """What a run on a real machine goes on.

    Attributes:
        bench: what is done there.
        session: that has the machine, and has it again afterwards.
        taken: called when the run begins, after the machine was brought to where it does.
        log: a new ``.mcap`` file that has every sample, whatever becomes of this program.
    """

    bench: OnMachine
    session: OwnProcess
    taken: Callable[[], None]
    log: Path

    @classmethod
    def of(cls, hand: ByHand, protocol: Protocol, shelf: Shelf) -> RealMachine:
        """A protocol on the machine by hand, which is shown from now on, also on the way to where the protocol begins.

        Raises:
            InputError: what speaks against it there, or that the machine is not ready.
        """
        session = hand.asked()
        assert isinstance(session, OwnProcess)
        bench = session.prepared(protocol)
        check(list(bench.findings))
        log = shelf.ready() / shelf.numbered(plain(protocol.name), ".mcap")
        return cls(bench, session, lambda: hand.hold(True), log)


class Going:
    """A run while it goes on, and what became of it.

    Args:
        bench: what is done; nothing speaks against it.
        pace: of its time.
        stream: that the samples go to.
        log: that is told of cycles.
        news: told that something changed.
        over: given the run when it has ended.
        file: name that its recording is to have, where nobody takes it meanwhile.
        on: the real machine that it goes on; None: the simulated one.

    Attributes:
        time: how far it is [s].
        record: at the end, if there is one.
        error: at the end, if it failed.
        asked: what a person has to do now.
        words: which step or cycle it is in.
        cycle: which of how many, where the step has cycles.
        measured: on the last cycle.
        file: name that its recording is to have.
    """

    def __init__(
        self, bench: PreparedRun, pace: Pace, stream: Stream, log: Log, news: Callable[[], None],
        over: Callable[[Going], None], *, file: str = "", on: RealMachine | None = None,
    ) -> None:  # fmt: skip
        self.bench, self.pace, self.stream, self._log, self._news, self._over = bench, pace, stream, log, news, over
        self.on, self.file = on, file if on is None else f"{on.log.stem}.nc"
        self.button = EmergencyStop() if on is None else on.session.button
        self.time = 0.0
        self.record: Recording | None = None
        self.error: str | None = None
        ready = "getting the machine ready" if on is None else "going to where it begins"
        self.asked, self.words, self.cycle = "", ready, []  # type: str, str, list[int]
        self.measured: list[dict[str, Any]] = []
        self.stopping = ""  # the ordinary stop, which is no trip
        self._answered = threading.Event()
        self._columns = Columns(bench.rig)
        self._count, self._every = 0, max(1, round(bench.plan.sample_rate / SHOWN))
        self._run: Run | Doing | None = None
        if on is None:
            run = Run(bench, display=self._show, stop=self.button, ask=self._ask)
            run.real_time = True
            run.simulated_by = functools.partial(Paced, pace=pace)
            self._begun(run)
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
        run = self._run
        if run is not None and run.result == "stopped" and not self.stopping:
            return run.message
        return ""

    def over(self) -> str:
        """Why it was stopped, after its end; an ordinary stop of a real machine is over then."""
        session = None if self.on is None else self.on.session
        if session is not None and session.why and self.stopping and not session.gone:
            session.reset()
        return self.tripped or ("" if session is None else session.why)

    @property
    def cause(self) -> str:
        """What stopped it, as the end of "ended by ..."; nothing where nothing did, or an ordinary stop."""
        coded = [] if self._run is None else [str(e["code"]) for e in self._run.events if "code" in e]
        return "" if not coded or self.stopping else CAUSES.get(coded[-1], "an interlock")

    @property
    def when(self) -> float:
        """When it was stopped, or how far it is [s]."""
        coded = [] if self._run is None else [e for e in self._run.events if "code" in e]
        return float(coded[-1]["time"]) if coded else self.time

    @property
    def steps(self) -> list[dict[str, Any]]:
        """The steps that have begun: label, start, end [s]."""
        return [] if self._run is None else list(self._run.steps)

    def _begun(self, run: Run | Doing) -> None:
        """Its samples are the next ones."""
        self._run = run
        if self.on is not None:
            self.on.taken()
        self.stream.begin("run", self.bench.protocol.name, self._every / self.bench.plan.sample_rate)

    def _done(self) -> Recording:
        if self.on is None:
            assert isinstance(self._run, Run)
            return self._run.go()
        on = self.on
        return on.session.run(on.bench, display=self._show, ask=self._ask, begun=self._begun, log=on.log)

    def _go(self) -> None:
        try:
            self.record = self._done()
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
        """Say which cycle it is in, and measure the one that has ended; after a stop no cycle begins."""
        step = self.steps[-1] if self.steps else None
        if step is None or self.button() or (self._run is not None and self._run.result == "stopped"):
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
