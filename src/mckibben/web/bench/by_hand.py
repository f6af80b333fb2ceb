"""The machine by hand: a session that goes while anything is asked of it, and stands still while nothing is.

A session of simulated time goes only while somebody waits; here somebody waits as long as the wall clock says. So a machine
at rest costs nothing, and slow motion slows what is done by hand as well. While nobody is in control it goes in real time,
for the 5 s after which it vents are seconds of whoever stands beside it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from ...bench.session import Session
from ...errors import MckibbenError
from ..control import HOLD
from ..stream import Stream
from .columns import Columns
from .pace import Pace

TICK = 0.015  # time between two looks at the clock [s]
BEHIND = 0.25  # a machine that is later than this is not hurried [s]
VENTED = 2e3  # pressure below which nothing is left [Pa]
LONGEST = 60.0  # that its end is waited for [s]
QUIET = 0.6  # time for which it goes on when all is at rest [s]


class ByHand:
    """One session, opened in a thread of its own.

    Args:
        rig: name or rig.
        muscle: specimen.
        pace: of its time.
        stream: that the samples go to.
        news: told that something changed.
    """

    def __init__(self, rig: Any, muscle: Any, pace: Pace, stream: Stream, news: Callable[[], None]) -> None:
        self.rig, self.muscle, self.pace, self.stream, self._news = rig, muscle, pace, stream, news
        self.session: Session | None = None
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

    def asked(self) -> Session:
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
        """Let it stand still while a run goes on elsewhere; nothing moves then."""
        (self._held.set if held else self._held.clear)()

    def alone(self, nobody: bool) -> None:
        """Nobody is in control, or somebody is again."""
        self._alone, self._since = nobody, time.monotonic()
        if self.session is not None:
            (self.session.control_lost if nobody else self.session.control_back)()

    def close(self) -> None:
        """Vent, and let go of it; one that is being made ready is waited for, since nothing can end that."""
        self._closed.set()
        self._thread.join(LONGEST)

    def _begin(self) -> None:
        session = self.session
        assert session is not None
        self._last = session.latest().get("time", 0.0)
        self._columns = Columns(session.setup.rig)
        self.stream.begin("hand", "by hand", session.period, round(self._last / session.period) + 1)
        self.moving = True
        self._news()

    def _go(self) -> None:
        try:
            session = Session(self.rig, self.muscle, speed=None, keep=2.0)
        except MckibbenError as error:
            self.failed = f"by hand: {error}"
            self._news()
            return
        except Exception as error:  # the page has to hear of it; runs do not need it
            self.failed = f"by hand: it could not be made ready ({type(error).__name__}: {str(error)[:200]})"
            self._news()
            return
        with session:
            self.session = session
            if self._alone:
                session.control_lost()
            self._news()
            self._tend(session)
            self.session = None

    def _tend(self, session: Session) -> None:
        before, quiet = time.monotonic(), 0.0
        while not self._closed.wait(TICK):
            now = time.monotonic()
            gone, before = min(now - before, BEHIND), now
            if self._held.is_set() or not self.moving:
                continue
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

    def _busy(self, session: Session) -> bool:
        status = session.status()
        return status.state == "manual" or status.measured.get("pressure", 0.0) > VENTED

    def _take(self, session: Session) -> None:
        times, arrays = session.since(self._last)
        if len(times):
            self._last = float(times[-1])
            self.stream.add(self._columns.of(arrays))

    @property
    def time(self) -> float:
        """Of the newest sample that pages have [s]."""
        return self._last
