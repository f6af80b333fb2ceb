"""Start, turning points and end of the cycles of a driven channel.

A channel turns where it has crossed from the lowest quarter of its range into the highest and back: an excursion. The turn
is the extreme sample of its excursion, the middle one where several are equal. So noise below half the range makes no
turns, and a hold at an end is one turn. The range is that between the 0.5 % and 99.5 % quantiles: single spikes do not
count. The first and the last excursion are cut by the record; they count only if they reach the level of the others to
2 % of the range. A cycle is from one turn to the next of its kind.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError

LEAST_SAMPLES = 8  # in a cycle; below this neither path can be drawn
_END_LEVEL = 0.02


class Cycle(NamedTuple):
    """Samples at which a cycle starts, turns and ends; it begins at its low end unless `begins_high`."""

    start: int
    turn: int
    end: int
    begins_high: bool = False


def turns(values: np.ndarray, *, subject: str = "drive") -> tuple[np.ndarray, np.ndarray]:
    """Samples of the low and of the high turns, each in order (k,).

    Args:
        values: values of the driven channel (n,), finite.
        subject: its name, for error messages.

    Raises:
        InputError: the channel is constant.
    """
    low, high = np.quantile(values, [0.005, 0.995])
    span = high - low
    if not span > 0.0:
        raise InputError(subject, None, "is constant, so it has no full cycle")
    side = np.where(values > high - 0.25 * span, 1, np.where(values < low + 0.25 * span, -1, 0))
    beyond = np.flatnonzero(side)
    excursions = np.split(beyond, np.flatnonzero(np.diff(side[beyond])) + 1)
    kinds = np.array([side[e[0]] for e in excursions])
    extremes = np.array([_extreme(values, e, k) for e, k in zip(excursions, kinds, strict=True)])
    inner = np.zeros(len(kinds), bool)
    inner[1:-1] = True
    kept = []
    for kind, fallback in ((-1, low), (1, high)):
        whole = values[extremes[inner & (kinds == kind)]]
        level = float(np.median(whole)) if whole.size else fallback
        reached = kind * (level - values[extremes]) <= _END_LEVEL * span
        kept.append(extremes[(kinds == kind) & (inner | reached)])
    return kept[0], kept[1]


def _extreme(values: np.ndarray, excursion: np.ndarray, kind: int) -> int:
    part = kind * values[excursion[0] : excursion[-1] + 1]
    ties = np.flatnonzero(part == part.max())
    return int(excursion[0] + ties[len(ties) // 2])


def find_cycles(values: np.ndarray, *, skip: int = 0, subject: str = "drive") -> tuple[Cycle, ...]:
    """The full cycles of a channel, from low turn to low turn, or between high turns where these give more.

    Args:
        values: values of the driven channel (n,), finite.
        skip: cycles left out at the beginning, such as the first after rest.
        subject: its name, for error messages.

    Raises:
        InputError: there is no full cycle left, or a cycle has fewer than 8 samples.
    """
    if skip < 0:
        raise InputError("skip", skip, "must be 0 or more")
    low, high = turns(values, subject=subject)
    ends, others, begins_high = (high, low, True) if len(high) > len(low) else (low, high, False)
    cycles = tuple(
        Cycle(int(a), int(others[np.searchsorted(others, a)]), int(b), begins_high)
        for a, b in zip(ends[:-1], ends[1:], strict=True)
    )
    if len(cycles) <= skip:
        raise InputError(
            subject,
            None,
            f"must have {skip + 1} full cycles or more, got {len(cycles)}; a cycle lies between two equal ends of its range",
        )
    for cycle in cycles:
        if cycle.end - cycle.start < LEAST_SAMPLES:
            raise InputError(
                subject,
                None,
                f"must have {LEAST_SAMPLES} samples or more in a cycle, got {cycle.end - cycle.start}; is it noise?",
            )
    return cycles[skip:]


def cycle_frequency(time: np.ndarray, values: np.ndarray, *, subject: str = "drive") -> float:
    """Cycles per second [Hz]: from the times at which the channel crosses its mid-range in one direction.

    A crossing is that of a straight line through the samples between 35 % and 65 % of the range, at least two, so that
    counts and noise average out. One cycle alone is timed from turn to turn.

    Args:
        time: (n,) [s].
        values: values of the driven channel (n,), finite.
        subject: its name, for error messages.
    """
    low, high = turns(values, subject=subject)
    cycles = find_cycles(values, subject=subject)
    best: list[float] = []
    for starts, stops in ((low, high), (high, low)):
        times = []
        for start in starts:
            later = stops[stops > start]
            if later.size:
                times.append(_crossing(time[start : later[0] + 1], values[start : later[0] + 1]))
        best = times if len(times) > len(best) else best
    if len(best) < 2:
        return 1.0 / float(time[cycles[0].end] - time[cycles[0].start])
    return (len(best) - 1) / (best[-1] - best[0])


def _crossing(time: np.ndarray, values: np.ndarray) -> float:
    """Time at which a monotone part passes the middle between its ends [s]."""
    first, last = values[0], values[-1]
    share = (values - first) / (last - first)
    near = np.flatnonzero(np.abs(share - 0.5) <= 0.15)
    if len(near) < 2:
        after = int(np.argmax(share >= 0.5))
        near = np.array([after - 1, after])
    centre = time[near].mean()
    slope, level = np.polyfit(time[near] - centre, share[near], 1)
    # A level held in the middle has no slope: its middle is as good as any.
    return float(centre + (0.5 - level) / slope) if slope > 0.0 else float(centre)
