"""Channels that stood at the end of their converter: reported, never hidden.

With the range of the sensor or converter a sample within half a count of either end is saturated. Without it only a
suspicion can be had: the channel stays on exactly its largest or smallest value far longer than on the counts next to it
while it moves elsewhere. A noise-free hold at an end looks the same, so `certain` says which it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import known


class Saturation(NamedTuple):
    """What part of a channel stood at an end of its range."""

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
    """Samples of a channel that stood at an end of its range.

    Args:
        record: with the channel.
        channel: its name.
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
            raise InputError("ends", f"{low} to {high}", "allowed is a lower end below the upper one")
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
