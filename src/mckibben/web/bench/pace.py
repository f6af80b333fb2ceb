"""The time of a simulated machine: as fast as it goes, by the wall clock, slower, standing still, or sample by sample."""

from __future__ import annotations

import threading
import time
from typing import Any

from ...bench.hardware.in_process import InProcess
from ...errors import InputError

PACES = {"simulated": None, "real": 1.0, "slow": 0.1}  # over the wall clock; None: as fast as it goes
NAMES = {"simulated": "as fast as it goes", "real": "real time", "slow": "slow 1:10"}
BURST = 0.004  # a loop that is ahead sleeps at least so long [s], so that pages get their share of the processor
LATE = 1.0  # later than this, the clock begins anew [s]
BREATH = 16  # samples after which a loop without a clock lets others in


class Pace:
    """How the time of one machine goes; may be changed from any thread while it does."""

    def __init__(self, name: str = "real") -> None:
        self._changed = threading.Condition()
        self._name, self._due = name, None  # type: str, float | None
        self._halted, self._steps, self._count = False, 0, 0

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
                return 0.0
            speed, due = self.speed, self._due
        now = time.perf_counter()
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
