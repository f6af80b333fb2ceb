"""A session on a real machine in a separate process, which nothing in the program of its user can delay.

A loop of a thousand samples a second beside pages, fits and drawings in one interpreter comes late by tens of milliseconds
at times; then a device vents, or a motor that is told too late what it did swings. Here all that is between the two is a
pipe. Where the other program ends, even by force, the machine vents at the next sample.
"""

from __future__ import annotations

import contextlib
import dataclasses
import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ...errors import LineLostError, MckibbenError
from ...experiments.protocol import Protocol
from ...recordings import read_recording
from ..hardware.connect import connected
from ..prepare import PreparedRun, prepare_on_machine
from ..protocol_run import ProtocolRun
from ..software.emergency_stop import EmergencyStop
from .session import Session
from .setup import session_rate
from .status import CLOSED, LOST, Message, Status

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from ...recordings.recording import Recording
    from ...specimens import Specimen
    from ..protocol_run import Display
    from ..rig import Rig

LONGEST = 10.0  # that the end of the process is waited for [s]
AT_ONCE = 8  # things asked for that go on at the same time
SILENCE = 0.05  # after which the device vents by itself [s]: here a run is made ready while the loop goes on
NOBODY = "nobody is there any more"
ENDED = "the process that had the machine ended; the device vents by itself"


@dataclass
class RunSnapshot:
    """The latest known state of a run in another process, with the attributes of `ProtocolRun`.

    Attributes:
        result: as that of the recording, so far.
        message: how it ended, so far that it reached its end.
        events: that the recording keeps.
        steps: that have begun.
    """

    result: str = "done"
    message: str = ""
    events: list[dict[str, Any]] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)

    @classmethod
    def of(cls, run: ProtocolRun) -> RunSnapshot:
        """Take a snapshot of a run."""
        return cls(run.result, run.message, [dict(e) for e in run.events], [dict(s) for s in run.steps])

    def update(self, newer: RunSnapshot) -> None:
        """Take over a newer snapshot."""
        self.result, self.message, self.events, self.steps = newer.result, newer.message, newer.events, newer.steps


class RemoteButton(EmergencyStop):
    """The emergency stop of a machine in another process."""

    def __init__(self, send: Callable[..., None]) -> None:
        super().__init__()
        self._send = send

    def press(self, reason: str = "the button was pressed", *, ordinary: bool = False) -> None:
        """Stop; see `EmergencyStop`."""
        super().press(reason, ordinary=ordinary)
        self._send(0, "press", reason, ordinary)


class SessionProxy:
    """A session in another process, with the methods of `session.Session`.

    Args:
        words: that name the machine, see `hardware.connect.connected`.
        rig: whose machine it is.
        muscle: specimen.
        lock_step: it waits for every command, as only a simulated device can.
        keep: time for which samples are kept for displays [s].

    Raises:
        InputError: as `connected` and `Session` do.
        LineLostError: if it does not answer.
    """

    def __init__(self, words: str, rig: Rig, muscle: Specimen, *, lock_step: bool = False, keep: float = 2.0) -> None:
        self.rig, self.muscle = rig, muscle
        self._number, self._lost, self._closed = 0, "", False
        self._sending, self._lock = threading.Lock(), threading.Lock()
        self._waiting: dict[int, queue.SimpleQueue[tuple[Any, ...]]] = {}
        self.button = RemoteButton(self._send)
        context = multiprocessing.get_context("spawn")
        self._line, other = context.Pipe()
        self._process = context.Process(
            target=serve_machine, args=(other, words, rig, muscle, lock_step, keep), daemon=True, name="machine"
        )
        self._process.start()
        other.close()
        threading.Thread(target=self._hear, name="machine", daemon=True).start()
        self._seen: Status
        try:
            self.period, self._options, self._seen = self._ask("facts")
        except BaseException:
            self.close()
            raise

    @property
    def process(self) -> int | None:
        """Process id of the other process."""
        return self._process.pid

    # ---- the line

    def _send(self, number: int, what: str, *given: Any) -> None:
        with self._sending, contextlib.suppress(OSError, ValueError):
            self._line.send((number, what, given))

    def _ask(self, what: str, *given: Any, hear: Callable[..., None] | None = None) -> Any:
        box: queue.SimpleQueue[tuple[Any, ...]] = queue.SimpleQueue()
        with self._lock:
            if self._lost:
                raise LineLostError(self._lost)
            self._number += 1
            number = self._number
            self._waiting[number] = box
        try:
            self._send(number, what, *given)
            while True:
                kind, *said = box.get()
                if kind == "done":
                    return said[0]
                if kind == "refused":
                    raise said[0]
                assert hear is not None
                hear(kind, *said)
        finally:
            with self._lock:
                self._waiting.pop(number, None)

    def _hear(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                number, *said = self._line.recv()
                with self._lock:
                    box = self._waiting.get(number)
                if box is not None:
                    box.put(tuple(said))
        with self._lock:
            self._lost = "the machine was let go" if self._closed else ENDED
            for box in self._waiting.values():
                box.put(("refused", LineLostError(self._lost)))

    # ---- what a session can

    @property
    def gone(self) -> str:
        """Whether the machine is lost or closed; nothing while it is there."""
        if self._lost:
            return CLOSED if self._closed else LOST
        return str(self._or(LOST, "get", "gone"))

    @property
    def why(self) -> str:
        """What stopped the machine; nothing while it is not stopped."""
        return self._lost or str(self._or(ENDED, "get", "why"))

    @property
    def busy(self) -> bool:
        """Whether something is asked of the machine by hand, or it holds a pressure."""
        return bool(self._or(False, "get", "busy"))

    def _or(self, otherwise: Any, what: str, *given: Any) -> Any:
        """Return the answer, or another value if the machine is lost."""
        try:
            return self._ask(what, *given)
        except LineLostError:
            return otherwise

    def status(self) -> Status:
        """Return the present status, or the last one of a lost machine."""
        found = self._or(None, "status")
        self._seen = dataclasses.replace(self._seen, state=self.gone, why=self.why) if found is None else found
        return self._seen

    def latest(self) -> dict[str, float]:
        """Return the newest sample: ``time`` of the session [s] and every channel [SI]; empty if the machine is lost."""
        return dict(self._or({}, "latest"))

    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the samples after a time [s]: times (n,) and channels (n,)."""
        times, arrays = self._or((np.zeros(0), {}), "since", time)
        return times, arrays

    def messages(self, after: int = 0) -> list[Message]:
        """Return the messages after the one with a number."""
        return list(self._or([], "messages", after))

    def note(self, text: str, kind: str = "note") -> None:
        """Add a message at the time of the newest sample."""
        self._or(None, "note", text, kind)

    def control_lost(self) -> None:
        """Note that the client in control disconnected."""
        self._or(None, "control_lost")

    def control_back(self) -> None:
        """Note that a client is in control again."""
        self._or(None, "control_back")

    def set(self, **wanted: float | str) -> None:
        """Ask for a ``pressure``, and for one of ``span``, ``velocity`` and ``tension``, as text or SI."""
        self._ask("set", wanted)

    def vent(self) -> None:
        """Vent at the manual rate."""
        self._ask("vent")

    def emergency_stop(self, reason: str = "the button was pressed") -> None:
        """Vent and brake the motor at the next sample; the machine stays stopped until `reset`."""
        self.button.press(reason)
        self._or(None, "emergency_stop", reason)

    def reset(self) -> None:
        """Return to manual mode after a stop, vented, with the motor in place."""
        self._ask("reset")
        self.button = RemoteButton(self._send)

    def prepare(self, protocol: Protocol | str) -> PreparedRun:
        """Make the dry run of a protocol for this machine, in this process so that the sample loop is not disturbed."""
        return prepare_on_machine(protocol, 1.0 / self.period, muscle=self.muscle, rig=self.rig, **self._options)

    def run(
        self, prepared: PreparedRun, *, log: str | Path, display: Display | None = None,
        ask: Callable[[str], None] | None = None, begun: Callable[[RunSnapshot], None] | None = None,
    ) -> Recording:  # fmt: skip
        """Run a protocol and come back to manual mode, see `Session.run`; the recording is read from its log."""
        run = RunSnapshot()

        def hear(kind: str, *said: Any) -> None:
            if kind == "ask":
                assert ask is not None
                try:
                    ask(said[0])
                except MckibbenError as error:
                    self._send(0, "answer", error)
                else:
                    self._send(0, "answer", None)
                return
            run.update(said[0])
            if kind == "begun" and begun is not None:
                begun(run)
            elif kind == "display" and display is not None:
                display(said[1], said[2])

        try:
            run.update(self._ask("run", prepared, str(log), ask is not None, hear=hear))
        except MckibbenError:
            raise
        except BaseException as error:  # of whoever shows it
            self.button.press(f"the run was left with {type(error).__name__}")
            raise
        return read_recording(log)

    def close(self) -> None:
        """Vent and let go of the machine; may be called twice."""
        self._closed = True
        self._or(None, "close")
        self._process.join(LONGEST)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(LONGEST)
        self._line.close()

    def __enter__(self) -> Self:
        """Return the session itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Vent and close, whatever happened."""
        self.close()


class SessionServer:
    """The server in the process that has the machine: a session, and a pipe to its client."""

    def __init__(self, line: Connection, session: Session) -> None:
        self.line, self.session = line, session
        self._sending, self._answers = threading.Lock(), queue.SimpleQueue[MckibbenError | None]()
        self._pool = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="asked")

    def serve(self) -> None:
        """Answer requests until told to close, or until the client is gone."""
        try:
            while True:
                number, what, given = self.line.recv()
                if what == "press":
                    self.session.button.press(given[0], ordinary=given[1])
                elif what == "answer":
                    self._answers.put(given[0])
                elif what == "close":
                    self._answers.put(MckibbenError(NOBODY))
                    self.session.close()
                    self.say(number, "done", None)
                    return
                else:
                    self._pool.submit(self._do, number, what, given)
        except (EOFError, OSError):
            self._answers.put(MckibbenError(NOBODY))
            self.session.button.press("the program that operated the machine ended")

    def say(self, number: int, *said: Any) -> None:
        """Send something about the request with a number."""
        with self._sending, contextlib.suppress(OSError):
            self.line.send((number, *said))

    def _do(self, number: int, what: str, given: tuple[Any, ...]) -> None:
        try:
            own = getattr(self, f"_{what}", None)
            found = own(number, *given) if own is not None else getattr(self.session, what)(*given)
            self.say(number, "done", found)
        except MckibbenError as error:
            self.say(number, "refused", error)
        except BaseException as error:
            self.say(number, "refused", MckibbenError(f"{type(error).__name__}: {str(error)[:200]}"))

    def _facts(self, number: int) -> tuple[float, dict[str, Any], Status]:
        session = self.session
        return session.period, {n: session.setup.options[n] for n in ("seed", "step", "plumbing")}, session.status()

    def _get(self, number: int, name: str) -> Any:
        return getattr(self.session, name)

    def _set(self, number: int, wanted: Mapping[str, float | str]) -> None:
        self.session.set(**wanted)

    def _run(self, number: int, prepared: PreparedRun, log: str, asks: bool) -> RunSnapshot:
        runs: list[ProtocolRun] = []

        def begun(run: ProtocolRun) -> None:
            runs.append(run)
            self.say(number, "begun", RunSnapshot.of(run))

        def display(times: np.ndarray, arrays: Mapping[str, np.ndarray]) -> None:
            self.say(number, "display", RunSnapshot.of(runs[0]), times, dict(arrays))

        def ask(text: str) -> None:
            self.say(number, "ask", text)
            error = self._answers.get()
            if error is not None:
                raise error

        self.session.run(prepared, log=log, display=display, ask=ask if asks else None, begun=begun)
        return RunSnapshot.of(runs[0])


def serve_machine(line: Connection, words: str, rig: Rig, muscle: Specimen, lock_step: bool, keep: float) -> None:
    """Main function of the process: serve the machine named by `words` over a pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal; whoever operates the machine lets go of it
    signal.signal(signal.SIGTERM, _leave)
    _go_first()
    try:
        period = rig.computer.period(session_rate(rig))
        with connected(words, rig, period, lock_step=lock_step, silence=SILENCE) as hardware:
            with Session(rig, muscle, hardware, keep=keep) as session:
                SessionServer(line, session).serve()
    except MckibbenError as error:
        with contextlib.suppress(EOFError, OSError):
            number, *_ = line.recv()
            line.send((number, "refused", error))


def _leave(number: int, _: FrameType | None) -> None:
    raise SystemExit(1)


def _go_first() -> None:
    """Raise the scheduling priority of this process as far as the system allows."""
    with contextlib.suppress(OSError, AttributeError):
        os.setsid()  # Linux shares the processors between sessions, and within them
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
