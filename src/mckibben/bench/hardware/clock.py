"""Clock of a simulated machine: its speed, whether it is halted, and how far it runs ahead of a viewer."""

from __future__ import annotations

import threading
import time
from time import perf_counter

from .interface import WaitInterrupted

SPIN = 3e-4  # time before a deadline from which the loop no longer sleeps, for the system wakes it late [s]
BEHIND = 1.0  # a machine that is later than this starts again, rather than to hurry after its clock [s]
BREATH = 16  # samples after which a shared clock without a speed lets other threads in
LEAD = 0.07  # so far ahead of what a viewer in control has seen does a machine go [s]
PATIENCE = 2.0  # time for which it waits for a viewer that says nothing [s]


class Clock:
    """Clock of one simulated machine; it may be changed from any thread at any time.

    A clock may have one viewer, such as a page: while that says how much of the machine it has seen (`viewed`), the machine
    is at most `LEAD` ahead. Who sees something and presses the stop so stops the machine near what was seen, however fast it
    is and however slow the viewer. Where the viewer has said nothing for `PATIENCE` the machine goes on, at most in real
    time.

    Args:
        speed: speed of the machine's time over that of the wall; None: as fast as it goes.
        grain: shortest time for which the machine sleeps where it is ahead [s], so that other threads of the process get
            their share; it then comes at most so late. 0 keeps deadlines to some microseconds, and spins before each.
        halted: whether it stands still at first.
    """

    def __init__(self, speed: float | None = 1.0, *, grain: float = 0.0, halted: bool = False) -> None:
        self._changed = threading.Condition()
        self._speed, self._grain, self._halted = speed, grain, halted
        self._due: float | None = None  # when the newest sample was due [s]
        self._count = self._until = 0  # samples let through, and up to which they are while it stands still
        self._waiting = self._interrupted = False
        self._reached, self._viewed = 0.0, None  # type: float, float | None
        self._heard = self._before = 0.0  # when the viewer spoke, and when the newest sample was let through [s]

    @property
    def speed(self) -> float | None:
        """Time of the machine over that of the wall; None: as fast as it goes."""
        return self._speed

    @speed.setter
    def speed(self, speed: float | None) -> None:
        """Go on at another speed from now on."""
        with self._changed:
            self._speed, self._due = speed, None
            self._changed.notify_all()

    def begin(self) -> None:
        """Restart at 0 s, running, without a viewer."""
        with self._changed:
            self._reached, self._viewed, self._halted, self._due = 0.0, None, False, None
            self._changed.notify_all()

    @property
    def halted(self) -> bool:
        """Whether the clock is halted."""
        return self._halted

    def halt(self, halted: bool = True) -> None:
        """Halt the machine, or let it continue."""
        with self._changed:
            self._halted, self._until, self._due = halted, self._count, None
            self._changed.notify_all()

    @property
    def count(self) -> int:
        """Number of samples so far."""
        return self._count

    def step(self, samples: int = 1) -> None:
        """Advance a halted machine by some samples."""
        with self._changed:
            self._until = max(self._until, self._count) + samples
            self._changed.notify_all()

    def advance(self, until: int) -> None:
        """Advance a halted machine to a number of samples, and wait until it is reached."""
        with self._changed:
            self._until = max(self._until, until)
            self._changed.notify_all()
            self._changed.wait_for(
                lambda: self._interrupted or not self._halted or (self._waiting and self._count >= until)
            )

    def viewed(self, time: float | None) -> None:
        """Set how much of the machine's time the viewer has seen [s]; None if there is no viewer."""
        with self._changed:
            self._viewed, self._heard = time, perf_counter()
            self._changed.notify_all()

    def interrupt(self, interrupted: bool = True) -> None:
        """Interrupt `wait` now and later, or let it wait again."""
        with self._changed:
            self._interrupted = interrupted
            if not interrupted:
                self._due = None
            self._changed.notify_all()

    def wait(self, period: float) -> float:
        """Wait for the next sample, a period after the last one; return its lateness in the machine's time [s].

        Raises:
            WaitInterrupted: if `interrupt` was called.
        """
        with self._changed:
            self._waiting = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._interrupted or not self._halted or self._count < self._until)
            self._waiting = False
            if self._interrupted:
                raise WaitInterrupted
            self._count += 1
            self._reached += period
            if self._halted:
                return 0.0
            self._follow_viewer(period)
            speed, due = self._speed, self._due
        if speed is None:
            if self._grain and self._count % BREATH == 0:
                time.sleep(0.0)
            return 0.0
        now = perf_counter()
        due = now if due is None else due + period / speed
        if now - due > BEHIND:
            self._due = now
            return (now - due) * speed
        self._due = due
        if not self._grain:
            return wait_until(due) * speed
        if now < due:
            time.sleep(max(due - now, self._grain))
            return 0.0
        return now - due if now - due > self._grain + 1e-3 else 0.0

    def _follow_viewer(self, period: float) -> None:
        """Wait until the viewer has seen enough, or if it is silent, for a period of real time."""
        if not self._near():
            until = max(self._heard + PATIENCE, self._before + period)
            self._changed.wait_for(self._near, max(until - perf_counter(), 0.0))
        self._before = perf_counter()

    def _near(self) -> bool:
        return self._viewed is None or self._halted or self._interrupted or self._reached - self._viewed < LEAD


def wait_until(deadline: float) -> float:
    """Wait until a time of `time.perf_counter` [s]; return the lateness [s]."""
    ahead = deadline - perf_counter()
    if ahead > SPIN:
        time.sleep(ahead - SPIN)
    while (now := perf_counter()) < deadline:
        pass
    return now - deadline
