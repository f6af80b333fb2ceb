"""A session in a separate process, which nothing in the program of its user can delay.

A loop of a thousand samples a second beside pages, fits and drawings in one interpreter comes late by tens of milliseconds
at times; then a device vents, or a motor that is told too late what it did swings. Here all that is between the two is a
pipe. Where the other program ends, even by force, the machine vents at the next sample.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import multiprocessing
import os
import queue
import signal
import tempfile
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...documents import JsonValue
from ...engine import STEP
from ...errors import LineLostError, MckibbenError
from ...experiments.protocol import Protocol
from ...recordings import read_recording
from ..hardware.connect import connected
from ..prepare import PreparedRun
from ..protocol_run import RunState
from ..rig_file import rig as rig_of
from ..software.emergency_stop import EmergencyStop
from .interface import MachineSession
from .session import Session
from .setup import HOLD, ManualSetup, session_rate
from .status import CLOSED, LOST, Message, Messages, Status

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from ...recordings.recording import Recording
    from ...specimens import Specimen
    from ..protocol_run import Display, Progress
    from ..rig import Rig

LONGEST = 10.0  # that the end of the process is waited for [s]
AT_ONCE = 8  # things asked for that go on at the same time
SILENCE = 0.05  # after which the device vents by itself [s]: here a run is made ready while the loop goes on
NOBODY = "nobody is there any more"
ENDED = "the process that had the machine ended; the device vents by itself"


@dataclass
class RunSnapshot:
    """The latest known state of a run in another process, with the attributes of `RunState`."""

    result: str = "done"
    message: str = ""
    time: float = 0.0
    events: list[dict[str, Any]] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)

    @classmethod
    def of(cls, run: RunState) -> RunSnapshot:
        """Take a snapshot of a run."""
        return cls(run.result, run.message, run.time, [dict(e) for e in run.events], [dict(s) for s in run.steps])

    def update(self, newer: RunSnapshot) -> None:
        """Take over a newer snapshot."""
        vars(self).update(vars(newer))


class RemoteButton(EmergencyStop):
    """The emergency stop of a machine in another process."""

    def __init__(self, send: Callable[..., None]) -> None:
        super().__init__()
        self._send = send

    def press(self, reason: str = "the button was pressed", *, ordinary: bool = False) -> None:
        """Stop; see `EmergencyStop`."""
        super().press(reason, ordinary=ordinary)
        self._send(0, "press", reason, ordinary)


class SessionProxy(MachineSession):
    """A session in another process, which owns the machine and its clock.

    Args:
        words: that name the machine, see `hardware.connect.connected`; None: a simulated one.
        rig: a rig, its name or file.
        muscle: a specimen, its id or file.
        lock_step: a simulated device waits for every command.
        messages: where the session's messages are added; its own ones by default.
        **options: of `Session`: span, plumbing, rate, speed, seed, step, keep, hold.

    Raises:
        InputError: as `connected` and `Session` do.
        LineLostError: if it does not answer.
    """

    def __init__(
        self, words: str | None, rig: Rig | str, muscle: Specimen | str, *, lock_step: bool = False,
        messages: Messages | None = None, **options: Any,
    ) -> None:  # fmt: skip
        self.rig = rig if not isinstance(rig, str) else rig_of(rig)
        self._words, self._muscle, self._options = words, muscle, options
        self._messages = Messages() if messages is None else messages
        self._number, self._lost, self._closed = 0, "", False
        self._sending, self._sender, self._lock = threading.Lock(), 0, threading.Lock()
        self._waiting: dict[int, queue.SimpleQueue[tuple[Any, ...]]] = {}
        self.button: EmergencyStop = RemoteButton(self._send)
        context = multiprocessing.get_context("spawn")
        self._line, other = context.Pipe()
        self._process = context.Process(
            target=serve_machine, args=(other, words, self.rig, muscle, lock_step, options), daemon=True, name="machine"
        )
        self._process.start()
        other.close()
        threading.Thread(target=self._hear, name="machine", daemon=True).start()
        self._seen: Status
        try:
            self.period, self._seen = self._ask("get", "period"), self._ask("status")
        except BaseException:
            self.close()
            raise

    @property
    def process(self) -> int | None:
        """Process id of the other process."""
        return self._process.pid

    @functools.cached_property
    def setup(self) -> ManualSetup:
        """Limits, rates and channels of manual operation, set up again in this process on first use."""
        given = {"span": None, "rate": None, "hold": HOLD, "plumbing": None, "seed": 0, "step": STEP, **self._options}
        names = "span", "rate", "hold", "plumbing", "seed", "step"
        span, rate, hold, plumbing, seed, step = (given[n] for n in names)
        return ManualSetup(self.rig, span, rate, hold, muscle=self._muscle, plumbing=plumbing, seed=seed, step=step)

    @property
    def simulated(self) -> bool:
        """Whether the machine is simulated in the other process."""
        return self._words is None

    # ---- the line

    def _send(self, number: int, what: str, *given: Any) -> None:
        if self._sender == threading.get_ident():  # a signal that presses the button came while this thread was sending
            threading.Thread(target=self._send, args=(number, what, *given), daemon=True).start()
            return
        with self._sending, contextlib.suppress(OSError, ValueError):
            self._sender = threading.get_ident()
            try:
                self._line.send((number, what, given))
            finally:
                self._sender = 0

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
                if not number:
                    _, time, kind, text = said[0]
                    self._messages.say(text, time, kind)
                    continue
                with self._lock:
                    box = self._waiting.get(number)
                if box is not None:
                    box.put(tuple(said))
        with self._lock:
            self._lost = "the machine was let go" if self._closed else ENDED
            if not self._closed:
                self._messages.say(ENDED, 0.0, "stop")
            for box in self._waiting.values():
                box.put(("refused", LineLostError(self._lost)))

    # ---- what a session can

    @property
    def gone(self) -> str:
        """Reason for which the machine is lost or closed; empty while it is available."""
        if self._lost:
            return CLOSED if self._closed else LOST
        return str(self._or(LOST, "get", "gone"))

    @property
    def why(self) -> str:
        """Reason for which the machine is stopped; empty while it is not stopped."""
        return self._lost or str(self._or(ENDED, "get", "why"))

    @property
    def busy(self) -> bool:
        """Whether manual commands are pending, or the machine is under pressure."""
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
        """Return the messages after the one with a number; see `MachineSession`."""
        self._or(None, "tell_all")
        return self._messages.after(after)

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
        """Ask for set-points; see `MachineSession`."""
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

    def wait(self, seconds: float) -> None:
        """Wait for a time of the machine [s]; see `MachineSession`."""
        self._or(None, "wait", seconds)

    def start_recording(self, log: str | Path | None = None) -> None:
        """Record from the next sample on, in the other process; see `MachineSession`."""
        self._ask("start_recording", None if log is None else str(Path(log).absolute()))

    def stop_recording(self) -> Recording:
        """End the recording, and return what was recorded; see `MachineSession`."""
        record: Recording = self._ask("stop_recording")
        return record

    def run(
        self, protocol: Protocol | str | PreparedRun, *, log: str | Path | None = None, progress: Progress | None = None,
        display: Display | None = None, ask: Callable[[str], None] | None = None, accept_saturation: bool = False,
        begun: Callable[[RunState], None] | None = None,
    ) -> Recording:  # fmt: skip
        """Run a protocol, which is prepared in this process; the recording is read from its log; see `MachineSession`."""
        prepared = protocol if isinstance(protocol, PreparedRun) else self.prepare(protocol, accept_saturation)
        with contextlib.ExitStack() as until:
            if log is None:
                log = Path(until.enter_context(tempfile.TemporaryDirectory(prefix="mckibben-"))) / "run.mcap"
            run = RunSnapshot()
            hear = functools.partial(self._follow, run, prepared.plan.duration, progress, display, ask, begun)
            try:
                run.update(self._ask("run", prepared, str(Path(log).absolute()), ask is not None, hear=hear))
            except MckibbenError:
                raise
            except BaseException as error:  # of whoever shows it
                self.button.press(f"the run was left with {type(error).__name__}")
                raise
            finally:
                if self.button.ordinary:  # the session has reset itself
                    self.button = RemoteButton(self._send)
            return read_recording(log)

    def _follow(
        self, run: RunSnapshot, longest: float, progress: Progress | None, display: Display | None,
        ask: Callable[[str], None] | None, begun: Callable[[RunState], None] | None, kind: str, *said: Any,
    ) -> None:  # fmt: skip
        """Pass on what the other process says of a run."""
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
        elif kind == "display":
            if display is not None:
                display(said[1], said[2])
            if progress is not None:
                progress(min(run.time, longest), longest)

    def close(self) -> None:
        """Vent and release the machine; may be called twice."""
        self._closed = True
        self._or(None, "close")
        self._process.join(LONGEST)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(LONGEST)
        self._line.close()


class SessionServer:
    """Server in the process that owns the machine: a session, and a pipe to its client."""

    def __init__(self, line: Connection) -> None:
        self.line = line
        self.session: Session
        self._sending, self._answers = threading.Lock(), queue.SimpleQueue[MckibbenError | None]()
        self._pool = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="asked")

    def serve(self, session: Session) -> None:
        """Answer requests to a session until told to close, or until the client is gone."""
        self.session = session
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
        """Send a message about the request with a number."""
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

    def _tell_all(self, number: int) -> None:
        """Let every message so far go out before the answer."""
        self.session.messages()

    def _get(self, number: int, name: str) -> Any:
        return getattr(self.session, name)

    def _set(self, number: int, wanted: Mapping[str, float | str]) -> None:
        self.session.set(**wanted)

    def _run(self, number: int, prepared: PreparedRun, log: str, asks: bool) -> RunSnapshot:
        runs: list[RunState] = []

        def begun(run: RunState) -> None:
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


def serve_machine(
    line: Connection,
    words: str | None,
    rig: Rig,
    muscle: Specimen | str,
    lock_step: bool,
    options: dict[str, JsonValue],
) -> None:
    """Main function of the process: serve the machine named by `words` over a pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal; whoever operates the machine lets go of it
    signal.signal(signal.SIGTERM, _leave)
    _go_first()
    try:
        period = rig.computer.period(options.get("rate") or session_rate(rig))
        with connected(words, rig, period, lock_step=lock_step, silence=SILENCE) as hardware:
            server = SessionServer(line)
            messages = Messages(lambda message: server.say(0, message))
            with Session(rig, muscle, hardware, messages=messages, **options) as session:
                server.serve(session)
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
