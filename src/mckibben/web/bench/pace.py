"""The time of a simulated machine: as fast as it goes, by the wall clock, slower, standing still, or sample by sample."""

from __future__ import annotations

import threading
import time
from time import perf_counter
from typing import Any

from ...bench.hardware.in_process import InProcess
from ...errors import InputError

PACES = {"simulated": None, "real": 1.0, "slow": 0.1}  # over the wall clock; None: as fast as it goes
NAMES = {"simulated": "as fast as it goes", "real": "real time", "slow": "slow 1:10"}
BURST = 0.004  # a loop that is ahead sleeps at least so long [s], so that pages get their share of the processor
LATE = 1.0  # later than this, the clock begins anew [s]
BREATH = 16  # samples after which a loop without a clock lets others in
LEAD = 0.07  # so far ahead of what the page in control shows does a machine go [s]
PATIENCE = 2.0  # time for which it waits for a page that says nothing [s]


class Pace:
    """How the time of one machine goes; may be changed from any thread while it does.

    Every pace has one bound, while a page in control says what it shows: the machine is at most `LEAD` ahead of that. Who
    sees something and presses the stop so stops the machine near what was seen, however fast it is and however slow the
    page. Only where the page has said nothing for `PATIENCE` does the machine go on, in real time at most.
    """

    def __init__(self, name: str = "real") -> None:
        self._changed = threading.Condition()
        self._name, self._due = name, None  # type: str, float | None
        self._halted, self._steps, self._count = False, 0, 0
        self._reached, self._shown = 0.0, None  # type: float, float | None
        self._heard = 0.0  # when the page in control said so [s]
        self._before = 0.0  # when the last sample was let through [s]

    def begin(self) -> None:
        """A run begins at 0 s."""
        with self._changed:
            self._reached, self._shown, self._halted, self._steps, self._due = 0.0, None, False, 0, None
            self._changed.notify_all()

    def shown(self, time: float | None) -> None:
        """So far [s] has the page in control seen the run; None: it does not say."""
        with self._changed:
            self._shown, self._heard = time, perf_counter()
            self._changed.notify_all()

    @property
    def name(self) -> str:
        """One of `PACES`."""
        return self._name

    @property
    def speed(self) -> float | None:
        """Over the wall clock."""
        return PACES[self._name]

    def choose(self, name: str) -> None:
        """Another one.

        Raises:
            InputError: if there is none of that name.
        """
        if name not in PACES:
            raise InputError("pace", name, f"known are {', '.join(PACES)}")
        with self._changed:
            self._name, self._due = name, None
            self._changed.notify_all()

    @property
    def halted(self) -> bool:
        """Whether it stands still."""
        return self._halted

    def halt(self, halted: bool = True) -> None:
        """Let it stand still, or go on."""
        with self._changed:
            self._halted, self._steps, self._due = halted, 0, None
            self._changed.notify_all()

    def step(self, samples: int = 1) -> None:
        """Let so many samples through where it stands still."""
        with self._changed:
            self._steps += samples
            self._changed.notify_all()

    def turn(self, period: float) -> float:
        """Wait for the turn of the next sample, `period` [s] after the one before; how late it is [s]."""
        with self._changed:
            self._changed.wait_for(lambda: not self._halted or self._steps > 0)
            if self._halted:
                self._steps -= 1
                self._reached += period
                return 0.0
            self._reached += period
            self._led(period)
            speed, due = self.speed, self._due
        now = perf_counter()
        if speed is None:
            self._count += 1
            if self._count % BREATH == 0:
                time.sleep(0.0)
            return 0.0
        due = now if due is None else due + period / speed
        late = now - due
        if late > LATE:
            due = now
        self._due = due
        if late < 0.0:
            time.sleep(max(-late, BURST))
            return 0.0
        return late if late > BURST + 0.001 else 0.0

    def _led(self, period: float) -> None:
        """Wait until the page in control has seen enough; where it is silent, as long as a sample takes in real time."""
        if not self._near():
            until = max(self._heard + PATIENCE, self._before + period)
            self._changed.wait_for(self._near, max(until - perf_counter(), 0.0))
        self._before = perf_counter()

    def _near(self) -> bool:
        return self._shown is None or self._halted or self._reached - self._shown < LEAD


class Paced(InProcess):
    """A simulated machine whose samples come as a pace says."""

    def __init__(self, machine: Any, pace: Pace) -> None:
        super().__init__(machine, paced=False)
        self.pace = pace

    def wait(self, sample: int) -> float:
        """Until it is there; how late [s]."""
        late = self.pace.turn(self._period)
        super().wait(sample)
        return late
