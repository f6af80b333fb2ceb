"""Common ground of all analyses of recordings: finite channels, a uniform clock, cycles, and straight lines.

A channel turns where it has crossed from the lowest quarter of its range into the highest and back: an excursion. The turn
is the extreme sample of its excursion, the middle one where several are equal. So noise below half the range makes no
turns, and a hold at an end is one turn. The range is that between the 0.5 % and 99.5 % quantiles: single spikes do not
count. The first and the last excursion are cut by the record; they count only if they reach the level of the others to
2 % of the range. A cycle is from one turn to the next of its kind.

Numbers are read off straight lines and planes by least squares. Their intervals hold for independent errors of one size:
two-sided, from Student's t with n - p degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .._jax import Scalar
from ..answers import Caution, collect
from ..errors import InputError
from ..formats.labels import quantity_of
from ..quantities import with_unit
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


# What a question needs of a recording: its SI unit, and the names that recordings have for it, best first.
ROLES = {
    "length": ("m", ("muscle.length", "span", "length")),
    "tension": ("N", ("muscle.tension", "tension", "force")),
    "pressure": ("Pa", ("muscle.pressure", "pressure")),
}


def choose_channel(record: Recording, role: str, name: str | None = None) -> str:
    """The channel that has a role: the one that is named, else by the usual names, else the only one of the unit.

    Commands, and channels of which nothing is known, are none.

    Args:
        record: the recording.
        role: length, tension or pressure.
        name: of the channel, where it is known.

    Raises:
        InputError: there is no such channel, or several that could be it.

    Examples:
        >>> import mckibben as mk
        >>> pulls = mk.Channel([1.0, 2.0], "N", "measured")
        >>> choose_channel(mk.Recording([0.0, 1.0], {"cell_3": pulls}), "tension")
        'cell_3'
    """
    if name is not None:
        record.unit(name)
        return name
    unit, names = ROLES[role]
    usable = [
        n for n, c in record.channels.items() if c.unit == unit and c.kind != "command" and np.isfinite(c.values).any()
    ]
    usable = [n for n in usable if not n.endswith("_abs")] or usable  # a gauge pressure before an absolute one
    alike = [n for n in usable if quantity_of(n.rpartition(".")[2]) == role]
    for candidates in ([n for n in names if n in usable][:1], alike, usable):
        if len(candidates) == 1:
            return candidates[0]
    empty = {n: "" if np.isfinite(c.values).any() else " without a number" for n, c in record.channels.items()}
    has = ", ".join(alike or usable) or ", ".join(f"{n} [{c.unit}]{empty[n]}" for n, c in record.channels.items())
    raise InputError(role, None, f"must name a channel in {unit}; the recording has {has or 'no channels'}")


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
        least = f"must have {skip + 1} full cycles or more, got {len(cycles)}"
        raise InputError(subject, None, f"{least}; a cycle lies between two equal ends of its range")
    for cycle in cycles:
        if cycle.end - cycle.start < LEAST_SAMPLES:
            problem = (
                f"must have {LEAST_SAMPLES} samples or more in a cycle, got {cycle.end - cycle.start}; is it noise?"
            )
            raise InputError(subject, None, problem)
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
    name = _pressure_beside(record, length)
    others = ({} if name is None else {name: record[name]}) | {tension: y}
    cycles, caution = closed_cycles(every, record.time, others)
    cautions = [caution]
    held = cycle_conditions(record, cycles, length=length, tension=tension)
    groups = []
    for chosen, means_held in parted_by(held):
        groups.append(HeldCycles(tuple(cycles[i] for i in chosen), means_held))
        if name is not None and np.ptp(drift := held["pressure"][0][chosen]) > 2.0 * held["pressure"][1]:
            ends = " to ".join(with_unit(float(p), "Pa") for p in (drift[0], drift[-1]))
            cautions.append(Caution(f"{name} drifts from {ends} over the loops of one mean", "pressure"))
    return tuple(groups), collect(*cautions)


def _pressure_beside(record: Recording, length: str) -> str | None:
    """Name of the pressure beside a length: of its room, else ``pressure``; None where it is not known throughout."""
    room = length.rpartition(".")[0]
    names = [name for name in (f"{room}.pressure" if room else "pressure", "pressure") if name in record]
    return next((n for n in names if np.isfinite(record[n]).all()), None)


def cycle_conditions(
    record: Recording, cycles: Sequence[Cycle], *, length: str, tension: str
) -> dict[str, tuple[np.ndarray, float]]:
    """What was held in each cycle, by name: values (cycles,), and the jump that parts them; see `held_cycles`."""
    x, y, name = known(record, length), known(record, tension), _pressure_beside(record, length)
    held: dict[str, tuple[np.ndarray, float]] = {}
    if name is not None:
        means = np.array([record[name][c.start : c.end].mean() for c in cycles])
        held["pressure"] = means, _ALIKE * float(np.abs(record[name]).max())
    else:
        held["tension"] = np.array([y[c.start : c.end].mean() for c in cycles]), 0.1 * float(np.ptp(y))
    periods = np.array([record.time[c.end] - record.time[c.start] for c in cycles])
    held["frequency"] = 1.0 / periods, 0.2 / float(np.median(periods))
    held["stroke"] = np.array([float(np.ptp(x[c.start : c.end + 1])) for c in cycles]), 0.1 * float(np.ptp(x))
    return held


def parted_by(held: Mapping[str, tuple[np.ndarray, float]]) -> list[tuple[np.ndarray, dict[str, float]]]:
    """Numbers of the cycles in which the same was held, and the means of what tells them from other groups; none of one."""
    marks = np.array([_parted(values, jump) for values, jump in held.values()]).T
    groups = []
    for mark in dict.fromkeys(map(tuple, marks)):
        chosen = np.flatnonzero((marks == mark).all(axis=1))
        apart = [n for n, column in zip(held, marks.T, strict=True) if np.ptp(column)]
        groups.append((chosen, {n: float(held[n][0][chosen].mean()) for n in apart}))
    return groups


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


class Interval(NamedTuple):
    """A number with the ends of its confidence interval, all in one unit."""

    value: float
    low: float
    high: float


class LinearFit(NamedTuple):
    """Coefficients (p,), their covariance (p, p), root mean square of the residual, and the t quantile."""

    values: np.ndarray
    covariance: np.ndarray
    rms: float
    quantile: float

    def interval(self, value: float, gradient: np.ndarray) -> Interval:
        """Interval of a function of the coefficients from its value and its gradient (p,), to first order."""
        half = self.quantile * float(np.sqrt(max(gradient @ self.covariance @ gradient, 0.0)))
        return Interval(float(value), float(value) - half, float(value) + half)

    def coefficient(self, index: int) -> Interval:
        """Estimate one coefficient with its interval."""
        return self.interval(float(self.values[index]), np.eye(len(self.values))[index])


def t_quantile(degrees: int, confidence: float) -> float:
    """Student's t beyond which the two-sided rest lies [1]."""
    from scipy.special import stdtrit

    if not 0.0 < confidence < 1.0:
        raise InputError("confidence", confidence, "must be above 0 and below 1")
    return float(stdtrit(degrees, 0.5 + 0.5 * confidence))


def linear_fit(matrix: np.ndarray, target: np.ndarray, *, subject: str, confidence: float = 0.95) -> LinearFit:
    """Least squares of matrix @ values = target.

    Args:
        matrix: (n, p), columns of any scale.
        target: (n,).
        subject: the points, for error messages.
        confidence: confidence of the two-sided intervals.

    Raises:
        InputError: fewer points than p + 1, or points that do not tell the coefficients apart.
    """
    n, p = matrix.shape
    if n <= p:
        raise InputError(subject, None, f"must be {p + 1} or more, got {n}")
    if not (np.isfinite(matrix).all() and np.isfinite(target).all()):
        raise InputError(subject, None, "must be finite numbers")
    size = np.linalg.norm(matrix, axis=0)
    u, strength, directions = np.linalg.svd(matrix / np.where(size > 0.0, size, 1.0), full_matrices=False)
    if strength[-1] < 1e-9 * strength[0]:
        raise InputError(subject, None, f"do not vary enough to tell {p} numbers apart")
    half = directions.T / strength
    values = half @ (u.T @ target) / size
    residual = target - matrix @ values
    variance = float(residual @ residual) / (n - p)
    covariance = variance * (half @ half.T) / np.outer(size, size)
    return LinearFit(values, covariance, float(np.sqrt(np.mean(residual**2))), t_quantile(n - p, confidence))
