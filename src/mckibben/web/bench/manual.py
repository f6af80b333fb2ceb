"""Manual operation in the web interface: a session opened in a thread, whose samples are sent to the pages."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from ...bench.session import MachineSession, Messages, Session
from ...bench.session.proxy import SessionProxy
from ...bench.session.session import VENTED
from ...errors import MckibbenError
from ..stream import Stream
from .columns import Columns

if TYPE_CHECKING:
    from ...bench.rig import Rig

TICK = 0.015  # time between two looks at the samples [s]
LONGEST = 60.0  # that its end is waited for [s]
KEPT = 2.0  # time for which a session keeps samples for the pages [s]
QUIET = 0.6  # time for which pages still see it when all is at rest [s]


class HardwareSpec(NamedTuple):
    """The name of a real machine.

    Attributes:
        words: that name it, see `hardware.connect.connected`.
        lock_step: it waits for every command, as only a simulated device can.
    """

    words: str
    lock_step: bool = False

    @property
    def caution(self) -> str:
        """A caution for the operator before the machine moves."""
        return (
            f"Connecting to {self.words}; lengths count from the muscle's rest length, at which it is taken to stand."
        )


class ManualControl:
    """The session behind the pages; a simulated machine is halted while no command is pending.

    Args:
        rig: whose machine it is.
        muscle: specimen.
        speed: speed of a simulated machine's time over that of the wall.
        stream: that the samples go to.
        messages: where the session adds its messages.
        news: told that something changed.
        spec: the real machine; None: a simulated one.
        after: threads that let go of the same real machine first.

    Attributes:
        session: that of a simulated machine is there for runs at once, that of a real one when it is ready.
        ready: whether it can be operated by hand.
        failed: why it could not be made ready.
        moving: whether pages see its samples.
        time: time of the newest sample that pages have [s].
    """

    def __init__(
        self, rig: Rig, muscle: Any, speed: float, stream: Stream, messages: Messages, news: Callable[[], None], *,
        spec: HardwareSpec | None = None, after: Iterable[threading.Thread] = (),
    ) -> None:  # fmt: skip
        self.rig, self.muscle, self.spec, self.stream, self._messages = rig, muscle, spec, stream, messages
        self.session: MachineSession | None = None
        if spec is None:
            self.session = Session(rig, muscle, keep=KEPT, rests=True, by_hand=False, messages=messages)
        self.ready, self.failed, self.moving, self.time = False, "", False, 0.0
        self._news, self._after, self._speed, self._alone, self._stop = news, list(after), speed, False, ""
        self._closed, self._held = threading.Event(), threading.Event()
        self._lock = threading.RLock()
        self._thread = threading.Thread(target=self._open_and_show, name="by hand", daemon=True)
        self._thread.start()

    def opened(self) -> MachineSession:
        """Return the session.

        Raises:
            MckibbenError: if it is not ready yet, or could not be made ready.
        """
        if self.session is None or not self.ready:
            raise MckibbenError(self.failed or "by hand: the machine is getting ready; try again in some seconds")
        return self.session

    def operated(self) -> MachineSession:
        """Return the session, which pages see from now on because something is asked of it.

        Raises:
            MckibbenError: if it is not ready yet, or could not be made ready.
        """
        session = self.opened()
        with self._lock:
            if not self.moving:
                self._show(session)
        return session

    @property
    def why(self) -> str:
        """What stopped the machine, or why a real one is not there; nothing while it is not stopped."""
        session = self.session
        if session is not None and session.why:
            return session.why
        return self._stop or ("" if self.spec is None else self.failed)

    def emergency_stop(self, reason: str) -> None:
        """Stop the machine; one that is not there yet is stopped as soon as it is."""
        session = self.session
        if session is not None:
            session.emergency_stop(reason)
        else:
            self._stop = f"emergency stop: {reason}"
            self._messages.say(self._stop, 0.0, "stop")

    def hold(self, held: bool) -> None:
        """Hide the manual samples during a run; afterwards a machine under pressure is shown again."""
        with self._lock:
            (self._held.set if held else self._held.clear)()
            self.moving, session = False, self.session
            if not held and self.spec is not None and session is not None and not session.why:
                if session.latest().get("command.pressure", 0.0) > VENTED:
                    self._show(session)

    def set_speed(self, speed: float) -> None:
        """Set the speed of simulated time relative to real time."""
        self._speed = speed
        if self.ready and isinstance(self.session, Session):
            self.session.speed = speed

    def set_control(self, there: bool) -> None:
        """Record whether a page is in control."""
        self._alone = not there
        if self.ready and self.session is not None:
            (self.session.control_back if there else self.session.control_lost)()

    def close(self) -> None:
        """Vent, and release the machine; one under preparation is waited for, since nothing can end that."""
        self._closed.set()
        self._thread.join(LONGEST)

    def closing(self) -> threading.Thread:
        """Close the session in a separate thread."""
        thread = threading.Thread(target=self.close, name="close", daemon=True)
        thread.start()
        return thread

    def _open(self) -> MachineSession:
        if self.spec is not None:
            return SessionProxy(
                self.spec.words,
                self.rig,
                self.muscle,
                lock_step=self.spec.lock_step,
                messages=self._messages,
                keep=KEPT,
            )
        assert isinstance(self.session, Session)
        self.session.make_ready()
        return self.session

    def _open_and_show(self) -> None:
        for thread in self._after if self.spec is not None else ():
            thread.join()
        with contextlib.ExitStack() as until:
            try:
                session = self._open()
                until.callback(session.close)
            except MckibbenError as error:
                return self._fail(f"by hand: {error}")
            except Exception as error:  # the page has to hear of it; runs do not need it
                return self._fail(f"by hand: it could not be made ready ({type(error).__name__}: {str(error)[:200]})")
            self.session, self.ready = session, True
            if self._stop:
                session.emergency_stop(self._stop.partition(": ")[2])
                self._stop = ""
            self.set_speed(self._speed)
            if self._alone:
                session.control_lost()
            self._news()
            self._tend(session)
            self.session, self.ready = None, False

    def _fail(self, why: str) -> None:
        self.failed = why
        if self.spec is not None:
            self._messages.say(why, 0.0, "stop")
        self._news()

    def _show(self, session: MachineSession) -> None:
        self.time = session.latest().get("time", 0.0)
        self._columns = Columns(self.rig)
        self.stream.begin("hand", "by hand", session.period, round(self.time / session.period) + 1)
        self.moving = True
        self._news()

    def _tend(self, session: MachineSession) -> None:
        quiet = 0.0
        while not self._closed.wait(TICK):
            if self._held.is_set() or not self.moving:
                continue
            self._take(session)
            quiet = 0.0 if session.busy else quiet + TICK
            if quiet > QUIET:
                with self._lock:
                    self.moving = False
                self._news()
                quiet = 0.0

    def _take(self, session: MachineSession) -> None:
        with self._lock:
            if self._held.is_set():
                return  # a run has the machine by now, and the stream
            times, arrays = session.since(self.time)
            if len(times):
                self.time = float(times[-1])
                self.stream.add(self._columns.of(arrays))
