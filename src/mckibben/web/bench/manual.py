"""Manual operation on the pages: the samples of a session go to the stream while anything moves."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...bench.session import MachineSession
from ...bench.session.session import VENTED
from ..stream import Columns, Stream

if TYPE_CHECKING:
    from ...bench.rig import Rig

TICK = 0.015  # time between two looks at the samples [s]
LONGEST = 60.0  # that its end is waited for [s]
QUIET = 0.6  # time for which pages still see it when all is at rest [s]


class HardwareSpec(NamedTuple):
    """The name of a real machine.

    Attributes:
        words: that name it, see `hardware.backends.connected`.
        lock_step: it waits for every command, as only a simulated device can.
    """

    words: str
    lock_step: bool = False


class ManualView:
    """What pages see of a session that is operated by hand; it makes the session ready, and closes it."""

    def __init__(
        self, session: MachineSession, rig: Rig, stream: Stream, news: Callable[[], None],
        after: Iterable[threading.Thread] = (),
    ) -> None:  # fmt: skip
        self.session, self.stream, self._news, self._columns = session, stream, news, Columns(rig)
        self.failed, self.moving, self.time = "", False, 0.0
        self._after = list(after)  # threads that must release the same real machine first
        self._closed, self._lock = threading.Event(), threading.RLock()
        self.thread = threading.Thread(target=self._follow, name="by hand", daemon=True)

    def show(self) -> None:
        """Let pages see the samples from now on, until the machine is at rest."""
        with self._lock:
            if self.moving:
                return
            self.time, period = self.session.latest().get("time", 0.0), self.session.period
            self.stream.begin("hand", "by hand", period, round(self.time / period) + 1)
            self.moving = True
        self._news()

    def at(self) -> dict[str, float]:
        """Return the newest sample of the machine by hand, named as `stream.CHANNELS` [SI]; empty until it is ready."""
        newest = self.session.latest() if self.session.ready else {}
        columns = self._columns.of({name: [value] for name, value in newest.items()})
        return {name: float(values[0]) for name, values in columns.items() if np.isfinite(values[0])}

    def hold(self, held: bool) -> None:
        """Hide the samples during a run; afterwards a real machine that it left under pressure is shown again."""
        session = self.session
        with self._lock:
            self.moving = False
            if not held and session.ready and not session.simulated and not session.why:
                if session.latest().get("command.pressure", 0.0) > VENTED:
                    self.show()

    def close(self) -> None:
        """Vent, and release the machine; one under preparation is waited for, since nothing can end that."""
        self._closed.set()
        if self.thread.is_alive():
            self.thread.join(LONGEST)

    def _follow(self) -> None:
        for thread in self._after:
            thread.join()
        try:
            self.session.make_ready()
        except Exception as error:  # pages have to hear of it; a simulated machine can be run all the same
            self.failed = f"by hand: {error}"
        self._news()
        quiet = 0.0
        while not self._closed.wait(TICK):
            with self._lock:
                if not self.moving:
                    continue
                times, arrays = self.session.since(self.time)
                if len(times):
                    self.time = float(times[-1])
                    self.stream.add(self._columns.of(arrays))
                quiet = 0.0 if self.session.busy else quiet + TICK
                if quiet <= QUIET:
                    continue
                self.moving, quiet = False, 0.0
            self._news()
        self.session.close()
