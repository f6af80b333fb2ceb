"""Which sample is there: frames as they come, sorted into those taken, lost, repeated and late."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from .messages import BY_ITSELF, DAMAGED, UNANSWERED, Fault, SampleMessage

DRIFT = 1e-4  # of the clocks of host and device, as a share of the time
GRACE = 0.25  # share of a period after which a damaged frame is taken for that of the sample that is missing
GRACE_IN_LOCK_STEP = 0.1  # the same where samples have no time [s]


class EndedError(Exception):
    """No more samples of this run: says why."""


class Taken(NamedTuple):
    """A sample that is there: its message, or None where it is missing; and how late it is [s]."""

    message: SampleMessage | None
    lateness: float


class Arrivals:
    """The samples of one run, in their order.

    Args:
        period: of the samples [s].
        lock_step: whether they have no time.
        patience: samples in a row that may be missing.

    Attributes:
        lost: samples taken whose frame did not come, or damaged.
        repeated: frames of samples that had been there.
        late: frames that came more than a period late; dropped where their sample had been given up.
        answers_late: samples that the device had no answer to when it took the next one.
        answers_damaged: samples between which the device got damaged frames.
    """

    def __init__(self, period: float, lock_step: bool, patience: int) -> None:
        self.period, self.lock_step, self.patience = period, lock_step, patience
        self.lost = self.repeated = self.late = self.answers_late = self.answers_damaged = 0
        self._queue: deque[tuple[float, SampleMessage | Fault]] = deque()
        self._damaged: float | None = None  # when damage was seen that no sample is known to miss
        self._newest, self._missing = -1, 0
        self._origin = 0.0  # when sample 0 was there, or should have been

    def put(self, at: float, message: SampleMessage | Fault) -> None:
        """What came, and when [s]."""
        self._queue.append((at, message))

    def damage(self, at: float) -> None:
        """Something came that was no frame, and when [s]."""
        self._damaged = at

    def take(self, sample: int) -> Taken | None:
        """A sample, or None if it can still come.

        Raises:
            EndedError: if it cannot.
        """
        while self._queue:
            at, message = self._queue[0]
            if isinstance(message, Fault):
                raise EndedError(f"the device has stopped: {message.text or 'fault'} (code {message.code})")
            ahead = message.sequence - sample
            if ahead > 0:
                return self.without(sample, at, ahead)
            self._queue.popleft()
            if ahead == 0:
                return self._with(message, at)
            if message.sequence > self._newest:
                self.late += 1
            else:
                self.repeated += 1
        return None

    def given_up(self, sample: int) -> float | None:
        """When a sample is given up, for damage was seen [s]; None if there was none."""
        if self._damaged is None:
            return None
        if self.lock_step or self._newest < 0:
            return self._damaged + GRACE_IN_LOCK_STEP
        return max(self._damaged, self._origin + (sample + GRACE) * self.period)

    def without(self, sample: int, at: float, ahead: int = 1) -> Taken:
        """A sample that is missing, the first of `ahead`, as is known at a time [s].

        Raises:
            EndedError: if too many are.
        """
        if self._newest < 0:
            raise EndedError("the first sample is missing")
        if self._missing + ahead > self.patience:
            raise EndedError(f"{self._missing + ahead} samples are missing before sample {sample + ahead}")
        self._missing += 1
        self.lost += 1
        self._damaged = None  # this was it
        return Taken(None, 0.0 if self.lock_step else max(at - self._origin - sample * self.period, 0.0))

    def _with(self, message: SampleMessage, at: float) -> Taken:
        if message.flags & BY_ITSELF:
            raise EndedError("the device vented by itself, for it had no command for too many samples")
        if message.flags:
            self.answers_late += bool(message.flags & UNANSWERED)
            self.answers_damaged += bool(message.flags & DAMAGED)
        self._missing, self._newest = 0, message.sequence
        if self._damaged is not None and at > self._damaged:
            self._damaged = None
        return Taken(message, 0.0 if self.lock_step else self._late(message.sequence, at))

    def _late(self, sample: int, at: float) -> float:
        """How late a sample is [s]; the time expected of the next ones follows the device's clock."""
        if sample == 0:
            self._origin = at
        late = at - self._origin - sample * self.period
        if late < 0.0:
            self._origin += late
            return 0.0
        self._origin += min(late, DRIFT * self.period)
        self.late += late > self.period
        return late
