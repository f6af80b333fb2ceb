"""Checks common to all analyses of recordings: finite channels, a uniform clock, arguments in range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .._jax import Scalar
from ..errors import InputError
from ..recordings import Recording

# Clocks of real loops jitter; a local fit over uneven samples would need the times themselves beyond this share.
_JITTER = 1e-2
# Squares and products of sums must stay within float64; no measured quantity is near it.
_LARGEST = 1e100


def known(record: Recording, name: str) -> np.ndarray:
    """Values of a channel (n,) [its unit], all finite.

    Raises:
        InputError: the recording lacks the channel, or something is not known in it.
    """
    values = record[name]
    return finite(values, f"channel {name}")


def finite(values: Sequence[float] | Scalar, subject: str) -> np.ndarray:
    """An array (n,) of finite numbers, or `InputError` with the first sample that is none."""
    array = np.asarray(values, float)
    if array.ndim != 1 or not array.size:
        raise InputError(subject, None, f"must have one dimension and at least one value, got shape {array.shape}")
    sound = np.abs(array) <= _LARGEST
    if not sound.all():
        i = int(np.argmin(sound))
        raise InputError(f"{subject}, sample {i}", float(array[i]), "must be finite values; select a part without gaps")
    return array


def uniform_period(record: Recording) -> float:
    """Period of the clock [s], which may vary by one per cent.

    Raises:
        InputError: the samples are not evenly spaced.
    """
    period = record.period
    steps = np.diff(record.time)
    worst = int(np.argmax(np.abs(steps - period)))
    if abs(steps[worst] - period) > _JITTER * period:
        raise InputError(
            f"interval after sample {worst}", float(steps[worst]), f"must be {period:.6g} s; use Recording.uniform()"
        )
    return period


def positive(name: str, value: Scalar, unit: str, *, zero: bool = False) -> float:
    """Check that a number is finite and above zero, or not below zero where zero is allowed."""
    number = float(value)
    if not np.isfinite(number) or number < 0.0 or (number == 0.0 and not zero):
        raise InputError(name, number, f"must be a number [{unit}] {'of 0 or more' if zero else 'above 0'}")
    return number


def held_against_spikes(values: np.ndarray, samples: int) -> np.ndarray:
    """Running median over an odd number of samples (n,): what rises or falls steadily is left as it is.

    The ends are filled with the first and the last value.
    """
    if samples < 1 or samples % 2 == 0:
        raise InputError("samples of the median", samples, "must be an odd number, 1 for none")
    if samples == 1:
        return values
    padded = np.pad(values, samples // 2, mode="edge")
    spikes: np.ndarray = np.median(np.lib.stride_tricks.sliding_window_view(padded, samples), axis=-1)
    return spikes


def window_samples(window: float, period: float, count: int, order: int = 2) -> int:
    """The odd number of samples of a window in time, enough for a polynomial of an order and no more than there are.

    Args:
        window: [s].
        period: period of the clock [s].
        count: samples of the record.
        order: order of the polynomial.
    """
    wide = 2 * round(0.5 * positive("window", window, "s") / period) + 1
    wide = max(wide, order + 1 + order % 2)
    if wide > count:
        raise InputError("window", window, f"must be at most the record, {count * period:.6g} s")
    return wide


def smoothed(values: np.ndarray, *, period: float, window: float, derivative: int = 0) -> np.ndarray:
    """Sliding local parabola (Savitzky and Golay): the value or a derivative (n,) [unit per s^derivative].

    Exact for parabolas; white noise of deviation s leaves about s sqrt(9/(4 m)) in the value and
    s sqrt(12/m^3)/period in the first derivative, m samples in the window.

    Args:
        values: on a uniform clock (n,).
        period: period of the clock [s].
        window: width of the parabola [s].
        derivative: 0, 1 or 2.
    """
    from scipy.signal import savgol_filter

    wide = window_samples(window, period, len(values))
    return np.asarray(savgol_filter(values, wide, 2, deriv=derivative, delta=period))


class Saturation(NamedTuple):
    """Share of a channel's samples at the ends of its range."""

    share: float  # of the samples [1]
    low: int  # samples at the lower end
    high: int  # samples at the upper end
    longest: float  # longest stay [s]
    resolution: float  # smallest step between values [unit of the channel]
    certain: bool  # whether the ends were given

    def __bool__(self) -> bool:
        """Whether anything was saturated."""
        return self.low + self.high > 0

    @property
    def sentence(self) -> str:
        """For a report."""
        if not self:
            return "not saturated" if self.certain else "no sign of saturation"
        word = "saturated" if self.certain else "stays at its largest or smallest value, as if saturated,"
        return f"{word} for {100.0 * self.share:.3g} % of the samples, at most {1e3 * self.longest:.3g} ms at once"


def saturation(
    record: Recording, channel: str, *, ends: tuple[float | None, float | None] | None = None, least_samples: int = 5
) -> Saturation:
    """Share of samples of a channel at an end of its range.

    Args:
        record: with the channel.
        channel: name of the channel.
        ends: lowest and highest value that the converter gives [unit of the channel], None for an end that has none;
            left out where unknown.
        least_samples: without `ends`, the shortest stay that counts.

    Raises:
        InputError: the channel is missing or not finite, or the ends are reversed.
    """
    y = known(record, channel)
    steps = np.diff(np.unique(y))
    resolution = float(steps.min()) if steps.size else 0.0
    if ends is not None:
        low, high = (-np.inf if ends[0] is None else ends[0]), (np.inf if ends[1] is None else ends[1])
        if not low < high:
            raise InputError("ends", None, f"must be a lower end below the upper one, got {low} to {high}")
        # Half a count: what a converter gives is on its counts to rounding. Without counts rounding alone decides.
        room = 0.5 * resolution if steps.size and resolution > 1e-6 * np.ptp(y) else 1e-9 * max(np.abs(y).max(), 1e-300)
        below, above = y <= low + room, y >= high - room
    else:
        below, above = _stays(-y, least_samples), _stays(y, least_samples)
    return Saturation(
        float(np.mean(below | above)),
        int(below.sum()),
        int(above.sum()),
        max(_longest(record.time, below), _longest(record.time, above)),
        resolution,
        ends is not None,
    )


def _stays(y: np.ndarray, least: int) -> np.ndarray:
    """Samples of the largest value, if it is held in longer runs than smooth tops on counts give."""
    values = np.unique(y)
    at_top = y == values[-1]
    if len(values) < 4:  # switched or constant: levels, not a range
        return np.zeros(len(y), bool)
    runs = _runs(at_top)
    # A parabola stays on its top count at most 2.4 times as long as on both sides of the next together; four is beyond it.
    next_below = np.count_nonzero(y == values[-2]) / max(len(runs), 1)
    long = [run for run in runs if run[1] - run[0] >= max(least, 4.0 * next_below)]
    marked = np.zeros(len(y), bool)
    for first, last in long:
        marked[first:last] = True
    return marked


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _longest(time: np.ndarray, mask: np.ndarray) -> float:
    return max((float(time[b - 1] - time[a]) for a, b in _runs(mask)), default=0.0)
