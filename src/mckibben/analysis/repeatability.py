"""Repeatability: of cycles, of runs, and of a set of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from ._regression import Interval, linear_fit
from .channels import finite, known
from .cycles import find_cycles


class Spread(NamedTuple):
    """Mean of several numbers and how they scatter [their unit]."""

    mean: float
    deviation: float  # standard deviation of one number, n - 1 in the denominator
    range: float  # largest less smallest
    relative_range: float  # range over the size of the mean [1]


def spread(numbers: Sequence[float] | np.ndarray) -> Spread:
    """Spread of two or more numbers, such as the loop widths at several frequencies.

    Raises:
        InputError: fewer than two, one that is not finite, or a mean of zero.
    """
    x = finite(numbers, "numbers")
    if x.size < 2:
        raise InputError("numbers", x.size, "must be 2 or more")
    mean, span = float(x.mean()), float(np.ptp(x))
    if mean == 0.0:
        raise InputError("mean of the numbers", mean, "must not be zero for a relative spread")
    return Spread(mean, float(x.std(ddof=1)), span, span / abs(mean))


class Repeatability(NamedTuple):
    """Distance of repetitions from their mean course [unit of the channel]."""

    rms: float  # deviation of one repetition, n - 1 in the denominator, over the whole course
    largest: float  # largest distance of any repetition from the mean
    relative_rms: float  # rms over the range of the mean course [1]
    repetitions: int
    at: np.ndarray  # phase of the cycle [1], or time [s], (points,)
    courses: np.ndarray  # the channel of each repetition, (repetitions, points)

    @property
    def peaks(self) -> np.ndarray:
        """Largest value of each repetition (repetitions,)."""
        return np.asarray(self.courses.max(axis=1))


def between_cycles(
    record: Recording,
    *,
    channel: str = "muscle.tension",
    drive: str = "muscle.length",
    skip: int = 0,
    points: int = 200,
) -> Repeatability:
    """Repeatability of a channel over the full cycles of another, at equal phase.

    The phase runs evenly in time from each turn to the next, so that a cycle time that varies does not count.

    Args:
        record: with both channels.
        channel: the channel to compare.
        drive: the periodic channel.
        skip: cycles left out at the beginning.
        points: phases in a cycle.

    Raises:
        InputError: a channel is missing, or there are fewer than two full cycles.
    """
    x, y = known(record, drive), known(record, channel)
    cycles = find_cycles(x, skip=skip, subject=f"channel {drive}")
    half = np.linspace(0.0, 1.0, points // 2, endpoint=False)
    courses = []
    for c in cycles:
        t = record.time[[c.start, c.turn, c.end]]
        at = np.concatenate([t[0] + half * (t[1] - t[0]), t[1] + half * (t[2] - t[1])])
        courses.append(np.interp(at, record.time, y))
    return _compared(np.concatenate([0.5 * half, 0.5 + 0.5 * half]), np.array(courses), "full cycles")


def between_runs(records: Sequence[Recording], *, channel: str = "muscle.tension", points: int = 1000) -> Repeatability:
    """Repeatability of a channel over recordings of one protocol, at equal time, over their common duration.

    Args:
        records: two or more on one time axis.
        channel: the channel to compare.
        points: points of the common time.
    """
    if not records:
        raise InputError("recordings", 0, "must be 2 or more")
    first, last = max(r.time[0] for r in records), min(r.time[-1] for r in records)
    if not last > first:
        raise InputError("recordings", None, "must overlap in time")
    at = np.linspace(first, last, points)
    return _compared(at, np.array([np.interp(at, r.time, known(r, channel)) for r in records]), "recordings")


def _compared(at: np.ndarray, courses: np.ndarray, quantity: str) -> Repeatability:
    count = len(courses)
    if count < 2:
        raise InputError(quantity, count, "must be 2 or more")
    mean = courses.mean(axis=0)
    off = courses - mean
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=0) / (count - 1))))
    span = float(np.ptp(mean))
    relative = rms / span if span > 0.0 else float("nan")
    return Repeatability(rms, float(np.abs(off).max()), relative, count, at, courses)


class Trend(NamedTuple):
    """A straight line through numbers over something, such as loop heights over peak velocity."""

    slope: Interval  # [unit of the numbers per unit of what it goes over]
    at_zero: Interval  # [unit of the numbers]

    @property
    def measurable(self) -> bool:
        """Whether the interval of the slope leaves zero out."""
        return self.slope.low > 0.0 or self.slope.high < 0.0


def trend(over: Sequence[float], numbers: Sequence[float], *, confidence: float = 0.95) -> Trend:
    """Straight line by least squares: a viscous force shows as a loop height that grows with velocity.

    Args:
        over: the independent numbers (n,), three or more.
        numbers: the dependent ones (n,).
        confidence: confidence of the intervals.
    """
    x, y = finite(over, "over"), finite(numbers, "numbers")
    if x.shape != y.shape:
        raise InputError("over and numbers", None, f"must be two of one length, got {x.size} and {y.size}")
    fit = linear_fit(np.stack([x, np.ones_like(x)], axis=1), y, subject="points of the trend", confidence=confidence)
    return Trend(fit.coefficient(0), fit.coefficient(1))
