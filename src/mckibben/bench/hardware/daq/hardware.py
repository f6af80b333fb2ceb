"""A machine behind a data acquisition card as `interface.Hardware`: counts and terminal voltages.

    wait(k)   the card's own clock samples all inputs and the encoder; the read waits for sample k
    send()    the outputs take their levels at once, not with the clock: what was written acts during the period

Lateness is that of the read, and the card's clock is not the computer's. So sample k is due at t0 + k T, where t0 follows
the earliest reads and may move by 1e-4 T per sample, more than two quartz clocks differ. What takes equally long for every
sample (conversion, bus, network) does not show in it, nor a loop that falls behind by less than 1e-4.

A card holds its outputs when nobody writes any more. Therefore a thread vents where the software sends nothing for a while;
it lives and dies with this process. Who must vent even when the process is killed needs a watchdog on the card or a valve
that closes without power.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import NamedTuple

from ....errors import InputError, LineLostError
from ..interface import Hardware
from ._client import OverrunError, Tasks
from .wiring import CardWiring

DRIFT = 1e-4  # of the card's clock against the computer's that is not taken for lateness
UNWRITTEN = -1  # count of a motor that nobody commands: its output is at the level of rest
LOOKS = 4.0  # at the software per time of its silence


class DaqStatistics(NamedTuple):
    """Counts of the samples since the start.

    Attributes:
        reads: samples that were given to the software, none left out.
        late: those that came more than a period late: the next one was there already.
        overruns: losses of samples; the first one ends the run.
    """

    reads: int
    late: int
    overruns: int


class DaqHardware(Hardware):
    """`interface.Hardware` of a card. Opening changes no output; `start` sets them to rest, and a `vent` persists.

    `vented` says whether the card was told to vent by what was written last.

    Args:
        wiring: wiring of the card.
        block: samples of one read. With more than 1 the software gets them late, up to block - 1 periods, and what it
            sends acts as late: for runs that only record.
        buffer: time for which samples may wait to be read before some are lost [s], which ends the run; a control loop
            that is so far behind is better vented.
        patience: how long a sample may be overdue before the card counts as lost [s].
        silence: time without `send` after which the machine is vented [s]; never less than four blocks.

    Raises:
        InputError: a library is missing, or the card has no such terminal or range.
        LineLostError: no driver, no device server, or no card.
    """

    def __init__(
        self, wiring: CardWiring, *, block: int = 1, buffer: float = 0.25, patience: float = 1.0, silence: float = 0.25
    ) -> None:
        if type(block) is not int or block < 1:
            raise InputError("block", str(block), "must be a whole number, 1 or more")
        for key, value in (("buffer", buffer), ("patience", patience), ("silence", silence)):
            if not 1e-3 <= value <= 3600.0:
                raise InputError(key, None, f"must be between 1 ms and 1 h, got {value:g} s")
        self.wiring = wiring
        self._block, self._buffer, self._silence = block, buffer, silence
        self._tasks = Tasks(wiring, patience)
        super().__init__(
            tuple(wiring.inputs),
            encoder=wiring.encoder is not None,
            motor=wiring.motor is not None,
            motor_rest=UNWRITTEN,
        )
        self._alarm = threading.Event()
        self._lock = threading.RLock()  # of the outputs
        self._waiting: deque[tuple[list[int], int]] = deque()
        self.period = 0.0  # not started
        self._fault = ""
        self._silent = self._closed = False
        self._sent: float | None = None
        self._next = self._late = self._overruns = 0
        self._origin: float | None = None
        self.vented = False
        self._watch = threading.Thread(target=self._watching, name="daq watch", daemon=True)
        self._watch.start()

    @property
    def statistics(self) -> DaqStatistics:
        """Statistics since the start."""
        return DaqStatistics(self._next, self._late, self._overruns)

    def start(self, period: float) -> None:
        """Vent, set the motor to rest, zero the encoder and begin to sample.

        Raises:
            InputError: the card has no such rate.
            LineLostError: it does not start.
        """
        if not 1e-6 <= period <= 10.0:
            raise InputError("period", None, f"must be between 1 us and 10 s, got {period:g} s")
        self._not_closed()
        self.period = period
        self._pause = max(self._silence, 4.0 * self._block * period)
        with self._lock:
            self._sent, self._silent, self._fault = None, False, ""
            self._waiting.clear()
            self._next = self._late = self._overruns = 0
            self._origin = None
            self.valve, self.opened = 0, True
            self._rest()
            self._tasks.start(period, self._block, self._buffer)

    def wait(self, sample: int) -> float:
        """Wait until a sample has arrived; return its lateness [s].

        Raises:
            InputError: it is not the next one.
            LineLostError: it will not come any more; the machine was vented, if it could be.
        """
        self._alive()
        if not self.period:
            raise InputError("sample", str(sample), "none comes before the start")
        if sample != self._next:
            raise InputError("sample", str(sample), f"must be {self._next}; they are waited for one after another")
        if not self._waiting:
            try:
                volts, ticks = self._tasks.read()
            except LineLostError as error:
                self._overruns += isinstance(error, OverrunError)
                raise self._lost(error) from None
            self._take(volts.T.tolist(), ticks.tolist())
        now = time.perf_counter()
        self.counts, count = self._waiting.popleft()
        if self.has_encoder:
            self.edges = count
        begun = now - sample * self.period
        self._origin = begun if self._origin is None else min(begun, self._origin + DRIFT * self.period)
        self._next += 1
        self._late += begun - self._origin > self.period
        return begun - self._origin

    def send(self) -> None:
        """Write the pending output levels; after a `vent`, an open shut-off and count 0.

        Raises:
            LineLostError: the card does not take them, or the machine was vented since nothing was sent for too long.
        """
        self._alive()
        try:
            with self._lock:
                self._put()
                self._sent = time.monotonic()
        except LineLostError as error:
            raise self._lost(error) from None

    def _vent_now(self) -> None:
        self._alarm.set()  # a caller does not wait for the card

    def close(self) -> None:
        """Vent, set the motor to rest, and clear the tasks; `vented` states whether that reached the machine."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            self.vent()
            self._try_rest()
            self._tasks.close()
        if self._watch is not threading.current_thread():
            self._watch.join()

    def _take(self, samples: list[list[float]], ticks: list[float]) -> None:
        scales, counter = tuple(self.wiring.inputs.values()), self.wiring.encoder
        for levels, tick in zip(samples, ticks, strict=True):
            try:
                counts = [scale.count(level) for scale, level in zip(scales, levels, strict=True)]
                self._waiting.append((counts, 0 if counter is None else counter.signed(tick)))
            except (ValueError, OverflowError):
                readings = ", ".join(f"{s.channel} {v:g} V" for s, v in zip(scales, levels, strict=True))
                raise self._lost(LineLostError(f"{self._tasks.place}: no numbers came: {readings}")) from None

    def _levels(self, valve: int, motor: float | None) -> list[float]:
        return [self.wiring.valve.volts(valve), *([] if motor is None else [motor])]

    def _put(self) -> None:
        """Write the pending levels; write them again if a vent came in between, since the vent must come last."""
        drive = self.wiring.motor
        while True:
            vented = self.venting or self._silent
            count, opened = (0, True) if vented else (self.valve, self.opened)
            pull = None
            if drive is not None:
                pull = drive.rest if self.motor == UNWRITTEN else drive.volts(self.motor)
            self._tasks.write(self._levels(count, pull), opened)
            self.vented = vented
            if vented or not self.venting:
                return

    def _rest(self) -> None:
        """Write count 0, an open shut-off, and a motor without force."""
        drive = self.wiring.motor
        self.motor = UNWRITTEN
        self._tasks.write(self._levels(0, None if drive is None else drive.rest), True)
        self.vented = True

    def _try_rest(self) -> bool:
        try:
            with self._lock:
                self._rest()
            return True
        except LineLostError:
            self.vented = False
            return False

    def _lost(self, error: LineLostError) -> LineLostError:
        """The error message about a card that failed, after an attempt to vent; it holds for every later call."""
        done = "the machine is vented" if self._try_rest() else "it could not be told to vent"
        self._fault = f"{error}; {done}"
        return type(error)(self._fault)

    def _not_closed(self) -> None:
        if self._closed:
            raise LineLostError(f"{self._tasks.place}: it was closed")

    def _alive(self) -> None:
        self._not_closed()
        if self._fault:
            raise LineLostError(self._fault)

    def _watching(self) -> None:
        """Vent at once on request, and when nothing has been sent for too long."""
        while True:
            called = self._alarm.wait(self._silence / LOOKS)
            self._alarm.clear()
            with self._lock:
                if self._closed:
                    return
                silent = self._sent is not None and time.monotonic() - self._sent > self._pause
                if silent:
                    self._sent, self._silent = None, True
                    error = LineLostError(f"{self._tasks.place}: nothing was sent for {self._pause:g} s")
                    self._lost(error)
                elif called and self._fault:
                    self._try_rest()
                elif called:
                    try:
                        self._put()
                    except LineLostError as error:
                        self._lost(error)
