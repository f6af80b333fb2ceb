"""A session in a separate process, which nothing in the program of its user can delay.

A loop of a thousand samples a second beside pages, fits and drawings in one interpreter comes late by tens of milliseconds
at times; then a device vents, or a motor that is told too late what it did swings. Here all that is between the two is a
pipe. Where the other program ends, even by force, the machine vents at the next sample.
"""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import os
import queue
import signal
import sys
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from ...documents import JsonValue
from ...errors import InputError, LineLostError, MckibbenError
from ...experiments.protocol import Protocol
from ...recordings import read_recording
from ..hardware.backends import connected
from ..prepare import PreparedRun
from ..protocol_run import RunState
from ..rig_file import rig as rig_of
from ..sample_loop import Lateness
from ..software.interlocks import EmergencyStop
from .interface import CLOSED, IDLE, LOST, MachineSession, ManualSetup, Message, Messages, Status, session_rate
from .session import Session

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from ...recordings.recording import Recording
    from ...specimens import Specimen
    from ..hardware.simulated import Clock
    from ..protocol_run import Display, Progress
    from ..rig import Rig

LONGEST = 10.0  # that the end of the process is waited for [s]
AT_ONCE = 8  # things asked for that go on at the same time
SILENCE = 0.05  # after which the device vents by itself [s]: here a run is made ready while the loop goes on
NOBODY = "nobody is there any more"
ENDED = "the process that had the machine ended; the device vents by itself"


F = TypeVar("F", bound=Callable[..., Any])
REFUSE = object()  # what a lost machine answers to a request that must not be lost


def _forwarded(method: F, otherwise: object = REFUSE) -> F:
    """Return a method that asks the session in the other process; a lost machine gives another value, or an error."""

    @functools.wraps(method, updated=())
    def ask(self: SessionProxy, *arguments: Any, **named: Any) -> Any:
        return self.ask(method.__name__, *arguments, otherwise=otherwise, **named)

    return cast(F, ask)


class SessionProxy(MachineSession):
    """A session in another process, which owns the machine and its clock.

    Args:
        words: that name the machine, see `hardware.backends.connected`; None: a simulated one.
        rig: a rig, its name or file.
        muscle: a specimen, its id or file.
        lock_step: a simulated device waits for every command.
        by_hand: begin the process and wait until the machine is ready; else `make_ready` does.
        messages: where the session's messages are added; its own ones by default.
        **options: of `Session`: span, plumbing, rate, speed, seed, step, keep, hold.

    Raises:
        InputError: as `connected` and `Session` do.
        LineLostError: if it does not answer.
    """

    def __init__(
        self, words: str | None, rig: Rig | str, muscle: Specimen | str, *, lock_step: bool = False,
        by_hand: bool = True, messages: Messages | None = None, **options: Any,
    ) -> None:  # fmt: skip
        self.rig = rig if not isinstance(rig, str) else rig_of(rig)
        self._words, self._muscle, self._options = words, muscle, options
        self._messages = Messages() if messages is None else messages
        self._number, self._lost, self._closed, self.ready = 0, "", False, False
        self._sending, self._sender, self._lock = threading.Lock(), 0, threading.Lock()
        self._waiting: dict[int, queue.SimpleQueue[tuple[Any, ...]]] = {}
        self._renew_button()
        self._seen = Status(IDLE, "", 0.0, {}, {}, Lateness.of(np.zeros(0), 1.0))
        context = multiprocessing.get_context("spawn")
        self._line, self._other = context.Pipe()
        self._process = context.Process(
            target=serve_machine, args=(self._other, words, self.rig, muscle, lock_step, options), daemon=True,
            name="machine",
        )  # fmt: skip
        if by_hand:
            try:
                self.make_ready()
            except BaseException:
                self.close()
                raise

    def make_ready(self) -> None:
        """Begin the other process, and wait until it has the machine; see `MachineSession`."""
        self._process.start()
        self._other.close()
        threading.Thread(target=self._hear, name="machine", daemon=True).start()
        try:
            self.period, self._seen = self.ask("period"), self.ask("status")
        except Exception as error:
            self._lose(str(error))
            raise
        self.ready = True

    @property
    def process(self) -> int | None:
        """Process id of the other process."""
        return self._process.pid

    @functools.cached_property
    def setup(self) -> ManualSetup:
        """Limits, rates and channels of manual operation, set up again in this process on first use."""
        options = {n: value for n, value in self._options.items() if n not in ("speed", "keep")}
        return ManualSetup(self.rig, muscle=self._muscle, **options)

    @property
    def simulated(self) -> bool:
        """Whether the machine is simulated in the other process."""
        return self._words is None

    # ---- the line

    def _renew_button(self) -> None:
        self.button = EmergencyStop(lambda reason, ordinary: self._send(0, "press", reason, ordinary=ordinary))

    def _send(self, number: int, name: str, *arguments: Any, **named: Any) -> None:
        if self._sender == threading.get_ident():  # a signal that presses the button came while this thread was sending
            threading.Thread(target=self._send, args=(number, name, *arguments), kwargs=named, daemon=True).start()
            return
        with self._sending, contextlib.suppress(OSError, ValueError):
            self._sender = threading.get_ident()
            try:
                self._line.send((number, name, arguments, named))
            finally:
                self._sender = 0

    def ask(
        self, name: str, *arguments: Any, otherwise: Any = REFUSE, hear: Callable[..., None] | None = None, **named: Any
    ) -> Any:
        """Return an attribute of the session, or what a method of it returns.

        Args:
            name: its name.
            *arguments: arguments.
            otherwise: returned if the machine is lost; while it is not ready, nobody waits for an answer either.
            hear: told what the session says before it answers.
            **named: arguments by name.

        Raises:
            LineLostError: if the machine is lost, and there is no other value.
        """
        box: queue.SimpleQueue[tuple[Any, ...]] = queue.SimpleQueue()
        with self._lock:
            if self._lost:
                box.put(("lost",))
            self._number += 1
            number = 0 if otherwise is not REFUSE and not self.ready else self._number
            self._waiting[number] = box
        try:
            self._send(number, name, *arguments, **named)
            while number:
                kind, *said = box.get()
                if kind == "done":
                    return said[0]
                if kind == "lost":
                    break
                if kind == "refused":
                    raise said[0]
                assert hear is not None
                hear(kind, *said)
        finally:
            with self._lock:
                self._waiting.pop(number, None)
        if otherwise is REFUSE:
            raise LineLostError(self._lost)
        return otherwise

    def _hear(self) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                number, kind, *said = self._line.recv()
                if kind == "message":
                    _, time, sort, text = said[0]
                    self._messages.say(text, time, sort)
                    continue
                with self._lock:
                    box = self._waiting.get(number)
                if box is not None:
                    box.put((kind, *said))
                if kind == "refused" and not self.ready:  # before the pipe ends, which would be another reason
                    self._lose(str(said[0]))
        self._lose(ENDED)

    def _lose(self, why: str) -> None:
        with self._lock:
            if not self._lost:
                self._lost = "the machine was released" if self._closed else why
                if not self._closed:
                    self._messages.say(why, 0.0, "stop")
            for box in self._waiting.values():
                box.put(("lost",))

    # ---- what a session can

    set = _forwarded(MachineSession.set)
    vent = _forwarded(MachineSession.vent)
    set_speed = _forwarded(MachineSession.set_speed, None)
    stop_recording = _forwarded(MachineSession.stop_recording)
    note = _forwarded(MachineSession.note, None)
    wait = _forwarded(MachineSession.wait, None)
    control_lost = _forwarded(MachineSession.control_lost, None)
    control_back = _forwarded(MachineSession.control_back, None)

    @property
    def gone(self) -> str:
        """Reason for which the machine is lost or closed; empty while it is available."""
        lost = CLOSED if self._closed else LOST
        return lost if self._lost else str(self.ask("gone", otherwise=lost if self.ready else ""))

    @property
    def why(self) -> str:
        """Reason for which the machine is stopped; empty while it is not stopped."""
        if not self.ready and not self._lost:
            return f"emergency stop: {self.button.reason}" if self.button() else ""
        return self._lost or str(self.ask("why", otherwise=ENDED))

    @property
    def busy(self) -> bool:
        """Whether manual commands are pending, or the machine is under pressure."""
        return bool(self.ask("busy", otherwise=False))

    def status(self) -> Status:
        """Return the present status, or the last one of a lost machine."""
        self._seen = self.ask("status", otherwise=None) or replace(self._seen, state=self.gone, why=self.why)
        return self._seen

    def latest(self) -> dict[str, float]:
        """Return the newest sample; empty if the machine is lost; see `MachineSession`."""
        return dict(self.ask("latest", otherwise={}))

    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the samples after a time [s]; none of a lost machine; see `MachineSession`."""
        times, arrays = self.ask("since", time, otherwise=(np.zeros(0), {}))
        return times, arrays

    def messages(self, after: int = 0) -> list[Message]:
        """Return the messages after the one with a number; see `MachineSession`."""
        self.ask("messages", sys.maxsize, otherwise=None)  # all that there are come before the answer
        return self._messages.after(after)

    def emergency_stop(self, reason: str = "the button was pressed") -> None:
        """Vent and brake the motor at the next sample; the machine stays stopped until `reset`."""
        self.button.press(reason)
        self.ask("emergency_stop", reason, otherwise=None)

    def reset(self) -> None:
        """Return to manual mode after a stop, vented, with the motor in place."""
        self.ask("reset")
        self._renew_button()

    def start_recording(self, log: str | Path | None = None) -> None:
        """Record from the next sample on, in the other process; see `MachineSession`."""
        self.ask("start_recording", None if log is None else str(Path(log).absolute()))

    def run(
        self, protocol: Protocol | str | PreparedRun, *, new_machine: bool = False, clock: Clock | None = None,
        log: str | Path | None = None, accept_saturation: bool = False, begun: Callable[[RunState], None] | None = None,
        progress: Progress | None = None, display: Display | None = None, ask: Callable[[str], None] | None = None,
    ) -> Recording:  # fmt: skip
        """Run a protocol, which is prepared in this process; the recording is read from its log; see `MachineSession`."""
        if clock is not None:
            raise InputError("clock", None, "must be left out: the machine is in another process")
        prepared = protocol if isinstance(protocol, PreparedRun) else self.prepare(protocol, accept_saturation)
        state = RunState()
        listeners: dict[str, Callable[..., None] | None] = {"display": display, "progress": progress}

        def hear(kind: str, newer: RunState, *said: Any) -> None:
            vars(state).update(vars(newer))
            if kind == "begun" and begun is not None:
                begun(state)
            elif kind == "ask" and ask is not None:
                error = None
                try:
                    ask(*said)
                except MckibbenError as refusal:
                    error = refusal
                self._send(0, "answer", error)
            elif kind == "over":
                kept.extend(said)
            elif (function := listeners.get(kind)) is not None:
                function(*said)

        kept: list[Recording] = []  # where the log took no more
        with contextlib.ExitStack() as until:
            if log is None:
                log = Path(until.enter_context(tempfile.TemporaryDirectory(prefix="mckibben-"))) / "run.mcap"
            kinds = [kind for kind, function in {**listeners, "ask": ask}.items() if function is not None]
            try:
                self.ask("run", prepared, kinds, hear=hear, log=str(Path(log).absolute()), new_machine=new_machine)
            except MckibbenError:
                raise
            except BaseException as error:  # of the caller's display
                self.button.press(f"the run was left with {type(error).__name__}")
                raise
            finally:
                if new_machine or self.button.ordinary:  # the session has reset itself
                    self._renew_button()
            return kept[0] if kept else read_recording(log)

    def close(self) -> None:
        """Vent and release the machine; may be called twice."""
        self._closed = True
        self.ask("close", otherwise=None)
        if self._process.pid is not None:
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
                number, name, arguments, named = self.line.recv()
                if name == "press":
                    self.session.button.press(*arguments, **named)
                elif name == "answer":
                    self._answers.put(arguments[0])
                elif name == "close":
                    self._answers.put(MckibbenError(NOBODY))
                    self.session.close()
                    self.say(number, "done", None)
                    return
                else:
                    self._pool.submit(self._do, number, name, arguments, named)
        except (EOFError, OSError):
            self._answers.put(MckibbenError(NOBODY))
            self.session.button.press("the program that operated the machine ended")

    def say(self, number: int, *said: Any) -> None:
        """Send a message about the request with a number."""
        with self._sending, contextlib.suppress(OSError):
            self.line.send((number, *said))

    def _do(self, number: int, name: str, arguments: tuple[Any, ...], named: dict[str, Any]) -> None:
        try:
            asked = self._run if name == "run" else getattr(self.session, name)
            arguments = (number, *arguments) if name == "run" else arguments
            self.say(number, "done", asked(*arguments, **named) if callable(asked) else asked)
        except MckibbenError as error:
            self.say(number, "refused", error)
        except BaseException as error:
            self.say(number, "refused", MckibbenError(f"{type(error).__name__}: {str(error)[:200]}"))

    def _run(self, number: int, prepared: PreparedRun, kinds: list[str], **options: Any) -> None:
        states = [RunState()]

        def begun(state: RunState) -> None:
            states.append(state)
            self.say(number, "begun", state)

        def tell(kind: str, *said: Any) -> None:
            self.say(number, kind, states[-1], *said)
            if kind == "ask":
                error = self._answers.get()
                if error is not None:
                    raise error

        listeners: dict[str, Any] = {kind: functools.partial(tell, kind) for kind in kinds}
        record = self.session.run(prepared, begun=begun, **listeners, **options)
        lost = any(event.get("code") == "log" for event in states[-1].events)
        self.say(number, "over", states[-1], *([record] if lost else []))


def serve_machine(
    line: Connection,
    words: str | None,
    rig: Rig,
    muscle: Specimen | str,
    lock_step: bool,
    options: dict[str, JsonValue],
) -> None:
    """Main function of the process: serve the machine named by `words` over a pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal; the program that operates the machine releases it
    signal.signal(signal.SIGTERM, _leave)
    with contextlib.suppress(OSError, AttributeError):  # go first, as far as the system allows
        os.setsid()  # Linux shares the processors between sessions, and within them
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    try:
        period = rig.computer.period(options.get("rate") or session_rate(rig))
        with connected(words, rig, period, lock_step=lock_step, silence=SILENCE) as hardware:
            server = SessionServer(line)
            messages = Messages(lambda message: server.say(0, "message", message))
            with Session(rig, muscle, hardware, messages=messages, **options) as session:
                server.serve(session)
    except MckibbenError as error:
        with contextlib.suppress(EOFError, OSError):
            while not (number := line.recv()[0]):
                pass  # what nobody waits for
            line.send((number, "refused", error))


def _leave(number: int, _: FrameType | None) -> None:
    raise SystemExit(1)
