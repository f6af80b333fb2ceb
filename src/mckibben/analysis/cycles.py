"""Start, turning points and end of the cycles of a driven channel.

A channel turns where it has crossed from the lowest quarter of its range into the highest and back: an excursion. The turn
is the extreme sample of its excursion, the middle one where several are equal. So noise below half the range makes no
turns, and a hold at an end is one turn. The range is that between the 0.5 % and 99.5 % quantiles: single spikes do not
count. The first and the last excursion are cut by the record; they count only if they reach the level of the others to
2 % of the range. A cycle is from one turn to the next of its kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..answers import Caution, collect
from ..errors import InputError
from ..quantities import with_unit
from ..recordings import Recording
from .channels import known

LEAST_SAMPLES = 8  # in a cycle; below this neither path can be drawn
_END_LEVEL = 0.02
_CLOSED = 0.25  # of its range in a cycle, from which a channel does not return: the first loop after rest stays below
_LISTED = 5  # cycles that a sentence names
_ALIKE = 0.02  # of its largest value, below which two pressures are one: sensors of a bench are no better


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


def closed(values: np.ndarray, cycle: Cycle) -> bool:
    """Whether a channel returns within a cycle to where it began: to a quarter of its range there, and 2 % of its size.

    Read just before both ends, or just after both, so that friction counts alike: a set-point that changes at a turn of
    the drive belongs to one of the two cycles.

    Args:
        values: values of a channel that is not the driven one (n,), finite.
        cycle: cycle of the driven channel.
    """
    part = values[cycle.start : cycle.end]
    few = max(1, len(part) // 50)
    pairs = [(values[c : c + few] for c in (cycle.start, cycle.end))]
    pairs += [(values[c - few : c] for c in (cycle.start, cycle.end))] if cycle.start >= few else []
    step = min(abs(float(end.mean() - start.mean())) for start, end in pairs)
    return step <= max(_CLOSED * float(np.ptp(part)), _ALIKE * float(np.abs(values).max()))


def closed_cycles(
    cycles: tuple[Cycle, ...], time: np.ndarray, channels: Mapping[str, np.ndarray]
) -> tuple[tuple[Cycle, ...], Caution | None]:
    """Those cycles in which all channels return, or all cycles if there is none such, and what must be said of it.

    Args:
        cycles: cycles of the driven channel.
        time: (n,) [s].
        channels: other channels, by name (n,).
    """
    opened = {c: [name for name, values in channels.items() if not closed(values, c)] for c in cycles}
    if not any(opened.values()):
        return cycles, None
    which = " and ".join(dict.fromkeys(name for names in opened.values() for name in names))
    verb = "do" if " and " in which else "does"
    if all(opened.values()):
        said = (
            f"the cycles cannot be cut by what was held: {which} {verb} not return within one; their work is no loop's"
        )
        return cycles, Caution(said, "cycles")
    left = [f"{time[c.start]:.4g} to {time[c.end]:.4g} s" for c, names in opened.items() if names]
    shown = ", ".join(left[:_LISTED]) + (" .." if len(left) > _LISTED else "")
    said = f"{len(left)} of {len(cycles)} cycles ({shown}) left out: {which} {verb} not return within a cycle"
    return tuple(c for c in cycles if not opened[c]), Caution(said, "cycles")


class HeldCycles(NamedTuple):
    """Cycles in which the same was held.

    Attributes:
        cycles: in their order.
        held: what tells them from the cycles of other groups: mean `pressure` [Pa] and `tension` [N], `frequency` [Hz],
            `stroke` [m]; empty if there is one group.
    """

    cycles: tuple[Cycle, ...]
    held: dict[str, float]

    def words(self) -> str:
        """What was held, with units."""
        return ", ".join(f"{with_unit(value, _UNITS[name])}" for name, value in self.held.items())


def held_cycles(
    record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0
) -> tuple[tuple[HeldCycles, ...], tuple[Caution, ...]]:
    """The full cycles of a channel by what was held: pressure, speed, stroke, and the tension where no pressure is known.

    A cycle in which pressure or tension do not return is none of a loop and is left out, unless none returns. Groups are
    parted where a value jumps by more than 2 % of the largest pressure, a fifth of the frequency, or a tenth of the range of
    length or tension; a slow drift parts nothing.

    Args:
        record: with both channels; its pressure is `pressure` or, for `muscle.length`, `muscle.pressure`.
        length: name of the driven channel [m].
        tension: name of the other [N].
        skip: cycles left out at the beginning.

    Returns:
        The groups in the order of their first cycles, and what must be said: what was left out, what drifts.

    Raises:
        InputError: a channel is missing or not finite, or there is no full cycle.
    """
    x, y = known(record, length), known(record, tension)
    every = find_cycles(x, skip=skip, subject=f"channel {length}")
    room = length.rpartition(".")[0]
    names = [name for name in (f"{room}.pressure" if room else "pressure", "pressure") if name in record]
    name = next((n for n in names if np.isfinite(record[n]).all()), None)
    others = ({} if name is None else {name: record[name]}) | {tension: y}
    cycles, caution = closed_cycles(every, record.time, others)
    cautions = [caution]
    span = float(np.ptp(x))
    held: dict[str, tuple[np.ndarray, float]] = {}  # values (cycles,) and the jump that parts them
    if name is not None:
        means = np.array([record[name][c.start : c.end].mean() for c in cycles])
        held["pressure"] = means, _ALIKE * float(np.abs(record[name]).max())
    else:
        held["tension"] = np.array([y[c.start : c.end].mean() for c in cycles]), 0.1 * float(np.ptp(y))
    periods = np.array([record.time[c.end] - record.time[c.start] for c in cycles])
    held["frequency"] = 1.0 / periods, 0.2 / float(np.median(periods))
    held["stroke"] = np.array([float(np.ptp(x[c.start : c.end + 1])) for c in cycles]), 0.1 * span
    marks = np.array([_parted(values, jump) for values, jump in held.values()]).T
    groups = []
    for mark in dict.fromkeys(map(tuple, marks)):
        chosen = np.flatnonzero((marks == mark).all(axis=1))
        apart = [n for n, column in zip(held, marks.T, strict=True) if np.ptp(column)]
        means_held = {n: float(held[n][0][chosen].mean()) for n in apart}
        groups.append(HeldCycles(tuple(cycles[i] for i in chosen), means_held))
        if name is not None and np.ptp(drift := held["pressure"][0][chosen]) > 2.0 * held["pressure"][1]:
            ends = " to ".join(with_unit(float(p), "Pa") for p in (drift[0], drift[-1]))
            cautions.append(Caution(f"{name} drifts from {ends} over the loops of one mean", "pressure"))
    return tuple(groups), collect(*cautions)


_UNITS = {"pressure": "Pa", "tension": "N", "frequency": "Hz", "stroke": "m"}


def _parted(values: np.ndarray, jump: float) -> np.ndarray:
    """Number of the group of each value (n,): sorted values that are further apart than a jump are in different ones."""
    order = np.argsort(values, kind="stable")
    marks = np.empty(len(values), int)
    marks[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > jump)])
    return marks


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
