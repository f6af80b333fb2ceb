"""What the process that has a machine does: it answers whoever operates it, and vents when nobody is there any more."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import MckibbenError
from ..hardware.connect import connected
from .session import Session
from .setup import RATE
from .status import Status

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from ...experiments.protocol import Protocol
    from ...specimens import Specimen
    from ..rig import Rig
    from ..run import Run

AT_ONCE = 8  # things asked for that go on at the same time
SILENCE = 0.05  # after which the device vents by itself [s]: here runs are prepared while the loop goes on
NOBODY = "nobody is there any more"


class Facts(NamedTuple):
    """How a run in another process is.

    Attributes:
        result: as that of a recording, so far.
        message: how it ended, so far that it reached its end.
        events: that the recording keeps.
        steps: that have begun.
    """

    result: str = "done"
    message: str = ""
    events: tuple[dict[str, Any], ...] = ()
    steps: tuple[dict[str, Any], ...] = ()

    @classmethod
    def of(cls, run: Run) -> Facts:
        """Those of now."""
        return cls(run.result, run.message, tuple(dict(e) for e in run.events), tuple(dict(s) for s in run.steps))


class Served:
    """What answers there: a session, and a line to whoever asks."""

    def __init__(self, line: Connection, session: Session) -> None:
        self.line, self.session = line, session
        self._sending, self._answers = threading.Lock(), queue.SimpleQueue[MckibbenError | None]()
        self._pool = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="asked")

    def go(self) -> None:
        """Until it is told to close, or nobody is there any more."""
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
        """Something about what was asked for under a number."""
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

    def _run(self, number: int, protocol: Protocol, log: str, asks: bool) -> Facts:
        runs: list[Run] = []

        def begun(run: Run) -> None:
            runs.append(run)
            self.say(number, "begun", Facts.of(run))

        def display(times: np.ndarray, arrays: Mapping[str, np.ndarray]) -> None:
            self.say(number, "display", Facts.of(runs[0]), times, dict(arrays))

        def ask(text: str) -> None:
            self.say(number, "ask", text)
            error = self._answers.get()
            if error is not None:
                raise error

        self.session.run(protocol, log=log, display=display, ask=ask if asks else None, begun=begun)
        return Facts.of(runs[0])


def serve(line: Connection, words: str, rig: Rig, muscle: Specimen, lock_step: bool, keep: float) -> None:
    """What the process does: the machine of `words`, for whoever is at the other end of the line."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal; whoever operates the machine lets go of it
    signal.signal(signal.SIGTERM, _leave)
    _go_first()
    try:
        period = rig.computer.period(RATE)
        with connected(words, rig, period, lock_step=lock_step, silence=SILENCE) as hardware:
            with Session(rig, muscle, hardware, keep=keep) as session:
                Served(line, session).go()
    except MckibbenError as error:
        with contextlib.suppress(EOFError, OSError):
            number, *_ = line.recv()
            line.send((number, "refused", error))


def _leave(number: int, _: FrameType | None) -> None:
    raise SystemExit(1)


def _go_first() -> None:
    """Wait for no other program, as far as the system lets this one choose."""
    with contextlib.suppress(OSError, AttributeError):
        os.setsid()  # Linux shares the processors between sessions, and within them
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
