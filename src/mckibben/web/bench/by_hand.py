"""The machine by hand: a session that goes while anything is asked of it, and stands still while nothing is.

A session of simulated time goes only while somebody waits; here somebody waits as long as the wall clock says. So a machine
at rest costs nothing, and slow motion slows what is done by hand as well. While nobody is in control it goes in real time,
for the 5 s after which it vents are seconds of whoever stands beside it. A real machine always goes, and is shown while
anything is asked of it.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from ...bench.session import Session
from ...bench.session.own_process import OwnProcess
from ...errors import MckibbenError
from ..control import HOLD
from ..stream import Stream
from .columns import Columns
from .pace import Pace

if TYPE_CHECKING:
    from ...bench.rig import Rig
    from ...specimens import Specimen

TICK = 0.015  # time between two looks at the clock [s]
BEHIND = 0.25  # a machine that is later than this is not hurried [s]
VENTED = 2e3  # pressure below which nothing is left [Pa]
LONGEST = 60.0  # that its end is waited for [s]
QUIET = 0.6  # time for which it goes on when all is at rest [s]


class Real(NamedTuple):
    """A real machine.

    Attributes:
        words: that name it, see `hardware.connect.connected`.
        lock_step: it waits for every command, as only a simulated device can.
    """

    words: str
    lock_step: bool = False

    @property
    def caution(self) -> str:
        """What somebody has to know before it moves."""
        return (
            f"Connecting to {self.words}; lengths count from the muscle's rest length, at which it is taken to stand."
        )

    def session(self, rig: Rig, muscle: Specimen) -> OwnProcess:
        """It in somebody's hands; raises what `OwnProcess` does."""
        return OwnProcess(self.words, rig, muscle, lock_step=self.lock_step)


class ByHand:
    """One session, opened in a thread of its own.

    Args:
        rig: whose machine it is.
        muscle: specimen.
        pace: of the time of a simulated one.
        stream: that the samples go to.
        news: told that something changed.
        real: the machine; None: a simulated one.
        after: threads that let go of it first.
    """

    def __init__(
        self, rig: Rig, muscle: Any, pace: Pace, stream: Stream, news: Callable[[], None], *,
        real: Real | None = None, after: Iterable[threading.Thread] = (),
    ) -> None:  # fmt: skip
        self.rig, self.muscle, self.pace, self.stream, self._news = rig, muscle, pace, stream, news
        self.real, self._after = real, list(after)
        self.session: Session | OwnProcess | None = None
        self.failed = ""
        self.moving = False
        self._closed, self._held = threading.Event(), threading.Event()
        self._alone, self._since = False, 0.0
        self._lock = threading.RLock()
        self._last = 0.0
        self._thread = threading.Thread(target=self._go, name="by hand", daemon=True)
        self._thread.start()

    @property
    def ready(self) -> bool:
        """Whether it can be operated."""
        return self.session is not None

    def asked(self) -> Session | OwnProcess:
        """The session, which goes from now on because something was asked of it.

        Raises:
            MckibbenError: if it is not ready yet, or could not be made ready.
        """
        if self.session is None:
            raise MckibbenError(self.failed or "by hand: the machine is getting ready; try again in some seconds")
        with self._lock:
            if not self.moving:
                self._begin()
        return self.session

    def hold(self, held: bool) -> None:
        """Show nothing of it while a run goes on; a simulated one stands still from then until something is asked.

        A real one is shown again where it holds a pressure after the run.
        """
        with self._lock:
            (self._held.set if held else self._held.clear)()
            self.moving, session = False, self.session
            if not held and self.real is not None and session is not None:
                if not session.why and session.latest().get("command.pressure", 0.0) > VENTED:
                    self._begin()

    def set_aside(self) -> None:
        """For a run on another simulated machine: vented, and still."""
        if self.moving and self.session is not None:
            self.session.vent()
        self.hold(True)

    def alone(self, nobody: bool) -> None:
        """Nobody is in control, or somebody is again."""
        self._alone, self._since = nobody, time.monotonic()
        if self.session is not None:
            (self.session.control_lost if nobody else self.session.control_back)()

    def close(self) -> None:
        """Vent, and let go of it; one that is being made ready is waited for, since nothing can end that."""
        self._closed.set()
        self._thread.join(LONGEST)

    def closing(self) -> threading.Thread:
        """The same in a thread of its own."""
        thread = threading.Thread(target=self.close, name="close", daemon=True)
        thread.start()
        return thread

    def _session(self) -> Session | OwnProcess:
        if self.real is not None:
            return self.real.session(self.rig, self.muscle)
        return Session(self.rig, self.muscle, speed=None, keep=2.0)

    def _begin(self) -> None:
        session = self.session
        assert session is not None
        self._last = session.latest().get("time", 0.0)
        self._columns = Columns(self.rig)
        self.stream.begin("hand", "by hand", session.period, round(self._last / session.period) + 1)
        self.moving = True
        self._news()

    def _go(self) -> None:
        for thread in self._after if self.real is not None else ():
            thread.join()
        with contextlib.ExitStack() as until:
            try:
                session = self._session()
                until.enter_context(session)
            except MckibbenError as error:
                self.failed = f"by hand: {error}"
                self._news()
                return
            except Exception as error:  # the page has to hear of it; runs do not need it
                self.failed = f"by hand: it could not be made ready ({type(error).__name__}: {str(error)[:200]})"
                self._news()
                return
            self.session = session
            if self._alone:
                session.control_lost()
            self._news()
            self._tend(session)
            self.session = None

    def _tend(self, session: Session | OwnProcess) -> None:
        before, quiet = time.monotonic(), 0.0
        while not self._closed.wait(TICK):
            now = time.monotonic()
            gone, before = min(now - before, BEHIND), now
            if self._held.is_set() or not self.moving:
                continue
            if isinstance(session, Session):
                speed = self.pace.speed or 1.0
                own = gone * (1.0 if self._alone else speed)
                if self.pace.halted or own < session.period:
                    before = now - gone if not self.pace.halted else now
                    continue
                session.wait(own)
            if self._alone and now - self._since > HOLD and session.status().state == "manual":
                session.vent()  # the session counts its own time, which a busy computer lets go slower
                session.note("nobody is in control: vented, and the motor holds", "stop")
            self._take(session)
            quiet = 0.0 if self._busy(session) else quiet + gone
            if quiet > QUIET:
                with self._lock:
                    self.moving = False
                self._news()
                quiet = 0.0

    def _busy(self, session: Session | OwnProcess) -> bool:
        status = session.status()
        return status.state == "manual" or status.measured.get("pressure", 0.0) > VENTED

    def _take(self, session: Session | OwnProcess) -> None:
        with self._lock:
            if self._held.is_set():
                return  # a run has the machine by now, and the stream
            times, arrays = session.since(self._last)
            if len(times):
                self._last = float(times[-1])
                self.stream.add(self._columns.of(arrays))

    @property
    def time(self) -> float:
        """Of the newest sample that pages have [s]."""
        return self._last
