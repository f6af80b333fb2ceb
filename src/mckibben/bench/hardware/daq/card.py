"""The inside of a simulated card: its clock, its buffers and what its outputs hold, around a machine in counts.

in lock-step   the machine goes on when its outputs are written after a sample; the next sample is there at once
by the clock   sample k is there k periods after the start, and what the outputs hold then has acted for a period
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence

from ..interface import CountedMachine

OVERWRITTEN, TOO_EARLY, GONE = -200279, -200284, -201003  # codes of NI-DAQmx


class CardError(Exception):
    """What a card refuses, with its code of NI-DAQmx."""

    def __init__(self, code: int, text: str = "") -> None:
        super().__init__(text)
        self.code, self.text = code, text


class Card:
    """Samples of a machine.

    Args:
        machine: what is sampled.
        lock_step: whether the outputs make it go on; else the clock does.
        zeroed: whether the counter is set to nothing at the start, as a card does; else the machine's own zero holds.
    """

    def __init__(self, machine: CountedMachine, *, lock_step: bool, zeroed: bool) -> None:
        self.machine, self.lock_step, self.zeroed = machine, lock_step, zeroed
        self.valve, self.motor, self.opened = 0, 0, True
        self.writes = 0
        self._changed = threading.Condition()
        self._samples: deque[tuple[Sequence[int], int]] = deque()
        self._first = self._taken = 0  # index of the oldest sample in the buffer, and of the next one
        self._places: dict[str, int] = {}  # next sample of every reader
        self._size = 0
        self._running = False
        self._fresh = True  # whether the machine went on since its newest sample
        self._zero: int | None = None
        self._failed = ""
        self._clock: threading.Thread | None = None

    def start(self, period: float, size: int) -> None:
        """The sample clock of the inputs; every reader that stands ready gets the first sample."""
        self.stop()
        with self._changed:
            self._samples.clear()
            self._first = self._taken = 0
            self._places = dict.fromkeys(self._places, 0)
            self._size, self._running, self._zero = size, True, None
        if not self.lock_step:
            self._clock = threading.Thread(target=self._tick, args=(period,), name="simulated card", daemon=True)
            self._clock.start()

    def ready(self, reader: str) -> None:
        """A task that gets every sample from now on."""
        with self._changed:
            self._places[reader] = self._taken

    def forget(self, reader: str) -> None:
        """A task that is there no more."""
        with self._changed:
            self._places.pop(reader, None)

    def stop(self) -> None:
        """The clock stands still."""
        with self._changed:
            self._running = False
            self._changed.notify_all()
        if self._clock is not None:
            self._clock.join()
            self._clock = None

    def write(self, valve: int | None, motor: int | None, opened: bool | None) -> None:
        """What the outputs hold from now on; None leaves one as it is.

        In lock-step the machine goes on with levels of the valve, once for each sample that all readers have.
        """
        with self._changed:
            self.valve = self.valve if valve is None else valve
            self.motor = self.motor if motor is None else motor
            self.opened = self.opened if opened is None else opened
            if valve is not None:
                self.writes += 1
                read = all(place == self._taken for place in self._places.values())
                if self.lock_step and self._running and read and not self._fresh:
                    self._go(self._advance)

    def read(self, reader: str, count: int, timeout: float) -> list[tuple[Sequence[int], int]]:
        """The next samples of a reader.

        Raises:
            CardError: they did not come in time, or were overwritten.
        """
        with self._changed:
            place = self._places.get(reader, 0)

            def there() -> bool:
                if self.lock_step and self._fresh and self._running and self._taken < place + count:
                    self._go(self._sample)
                return self._taken >= place + count or bool(self._failed) or not self._running

            if not self._changed.wait_for(there, timeout):
                raise CardError(TOO_EARLY)
            if place < self._first:
                raise CardError(OVERWRITTEN)
            if self._taken < place + count:
                raise CardError(GONE, self._failed)
            self._places[reader] = place + count
            found = [self._samples[k - self._first] for k in range(place, place + count)]
            while self._first < min(self._places.values()):
                self._samples.popleft()
                self._first += 1
            return found

    def _go(self, what: Callable[[], None]) -> None:
        try:
            what()
        except Exception as error:  # the machine's own failure, which whoever reads is told
            self._failed = f"{type(error).__name__}: {error}"
        self._changed.notify_all()

    def _advance(self) -> None:
        self.machine.advance(self.valve, self.motor, self.opened)
        self._fresh = True

    def _sample(self) -> None:
        counts, edges = self.machine.sample()
        self._fresh = False
        if self._zero is None:
            self._zero = edges if self.zeroed else 0
        self._samples.append((tuple(counts), edges - self._zero))
        self._taken += 1
        while len(self._samples) > self._size:
            self._samples.popleft()
            self._first += 1

    def _tick(self, period: float) -> None:
        origin, k = time.perf_counter(), 0
        while True:
            ahead = origin + k * period - time.perf_counter()
            if ahead > 0.0:
                time.sleep(ahead)
            with self._changed:
                if not self._running or self._failed:
                    return
                if not self._fresh:
                    self._go(self._advance)
                self._go(self._sample)
            k += 1
