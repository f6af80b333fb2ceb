"""The rising and the falling path of a cycle: tension as a function of length while lengthening and while shortening.

A path is read by a local parabola through its samples within 5 % of the length range to either side, at least the five
nearest: straight and parabolic paths are exact, and noise and counts average over the samples of the window.

The distance of a measured loop from a simulated one is taken path by path.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..answers import Caution, warn
from ..errors import InputError
from ..recordings import ForceMap, Recording
from .channels import (
    Cycle,
    HeldCycles,
    Interval,
    cycle_frequency,
    find_cycles,
    finite,
    held_cycles,
    known,
    linear_fit,
    positive,
)
from .segments import segments

_HALF_WINDOW = 0.05
_LEAST = 5


class TensionPath(NamedTuple):
    """Samples of one path by increasing length: length [m] (n,), tension [N] (n,), half the reading window [m]."""

    length: np.ndarray
    tension: np.ndarray
    half_window: float

    def read(self, length: float) -> tuple[float, float]:
        """Tension [N] and slope [N/m] at one length [m]; outside the samples the parabola is continued."""
        first, last = np.searchsorted(self.length, [length - self.half_window, length + self.half_window])
        if last - first < _LEAST:
            first, last = _nearest(self.length, length, int(first))
        x = (self.length[first:last] - length) / self.half_window
        size = max(float(np.abs(x).max()), 1e-300)
        matrix = np.stack([np.ones_like(x), x / size, (x / size) ** 2], axis=1)
        value, slope, _ = np.linalg.lstsq(matrix, self.tension[first:last], rcond=1e-10)[0]
        return float(value), float(slope / size / self.half_window)

    def at(self, lengths: np.ndarray) -> np.ndarray:
        """Tension [N] at lengths [m], both (m,)."""
        return np.array([self.read(float(x))[0] for x in np.atleast_1d(lengths)])

    def length_at(self, tension: float) -> float:
        """First length [m] at which the path passes a tension [N]; NaN if it never does."""
        span = self.length[-1] - self.length[0]
        grid = np.linspace(self.length[0] + 0.01 * span, self.length[-1] - 0.01 * span, 101)
        changes = np.flatnonzero(np.diff(self._coarse(grid) >= tension))
        if not changes.size:
            return float("nan")
        # The means place it to about a hundredth of the range, noise and bend included to a few.
        x = middle = 0.5 * (grid[changes[0]] + grid[changes[0] + 1])
        for _ in range(6):
            value, slope = self.read(float(x))
            if slope:
                x = np.clip(x - (value - tension) / slope, middle - 0.05 * span, middle + 0.05 * span)
        return float(x)

    def _coarse(self, grid: np.ndarray) -> np.ndarray:
        """Means over the reading window [N] at lengths (m,); straight lines where it holds no samples."""
        total = np.concatenate([[0.0], np.cumsum(self.tension)])
        first = np.searchsorted(self.length, grid - self.half_window)
        last = np.searchsorted(self.length, grid + self.half_window)
        count = last - first
        means = (total[last] - total[first]) / np.maximum(count, 1)
        coarse: np.ndarray = np.where(count >= 2 * _LEAST, means, np.interp(grid, self.length, self.tension))
        return coarse


class Paths(NamedTuple):
    """The two paths of a cycle."""

    rising: TensionPath
    falling: TensionPath


def _nearest(x: np.ndarray, at: float, near: int) -> tuple[int, int]:
    first = last = min(max(near, 0), len(x))
    while last - first < min(_LEAST, len(x)):
        if last == len(x) or (first > 0 and at - x[first - 1] <= x[last] - at):
            first -= 1
        else:
            last += 1
    return first, last


def paths_of(length: np.ndarray, tension: np.ndarray, cycle: Cycle) -> Paths:
    """The two paths of one cycle of the arrays (n,) [m] and (n,) [N]."""
    span = float(np.ptp(length[cycle.start : cycle.end + 1]))
    parts = []
    for first, last in ((cycle.start, cycle.turn), (cycle.turn, cycle.end)):
        part = slice(first, last + 1)
        order = np.argsort(length[part], kind="stable")
        parts.append(TensionPath(length[part][order], tension[part][order], _HALF_WINDOW * span))
    return Paths(*(parts[::-1] if cycle.begins_high else parts))


def paths(record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0) -> Paths:
    """The paths of all full cycles in which pressure and tension return, taken together: the more cycles, the less noise.

    What is left out, and paths of different pressures, speeds or strokes in one, are said as a warning.

    Args:
        record: with both channels.
        length: name of the channel that turns [m].
        tension: name of the channel read [N]; any other does as well, such as a pressure.
        skip: cycles left out at the beginning.

    Raises:
        InputError: a channel is missing, or there is no full cycle.
    """
    x, y = known(record, length), known(record, tension)
    groups, cautions = held_cycles(record, length=length, tension=tension, skip=skip)
    _say(groups, cautions, "paths are")
    return _paths(x, y, [cycle for held in groups for cycle in held.cycles])


def _say(groups: Sequence[HeldCycles], cautions: tuple[Caution, ...], subject: str) -> None:
    """Warn of what is said of loops, and of what is taken over groups of them."""
    if len(groups) > 1:
        held = "; ".join(group.words() for group in groups)
        cautions += (Caution(f"the {subject} over loops in which different things were held ({held})", "cycles"),)
    warn(cautions, stacklevel=3)


def _paths(x: np.ndarray, y: np.ndarray, cycles: Sequence[Cycle]) -> Paths:
    each = [paths_of(x, y, cycle) for cycle in cycles]
    return Paths(_pooled([p.rising for p in each]), _pooled([p.falling for p in each]))


def _pooled(parts: list[TensionPath]) -> TensionPath:
    x, y = np.concatenate([p.length for p in parts]), np.concatenate([p.tension for p in parts])
    order = np.argsort(x, kind="stable")
    return TensionPath(x[order], y[order], float(np.mean([p.half_window for p in parts])))


class PathDistance(NamedTuple):
    """Distance of two paths in tension where both exist."""

    largest: float  # [N]
    rms: float  # [N]
    length: float  # where it is largest [m]
    from_length: float  # compared from here [m]
    to_length: float  # to here [m]


def path_distance(first: TensionPath, second: TensionPath, *, trim: float = 0.05, points: int = 51) -> PathDistance:
    """Distance between two paths, such as the rising ones of two recordings.

    Args:
        first: one path.
        second: the other.
        trim: share of the common length range left out at either end, where turning mixes the paths.
        points: points of the common grid.

    Raises:
        InputError: no length is on both paths.
    """
    if not 0.0 <= trim < 0.5 or points < 2:
        raise InputError("trim, points", None, f"must be from 0 to below 0.5 and 2 or more, got {trim}, {points}")
    low = max(first.length[0], second.length[0])
    high = min(first.length[-1], second.length[-1])
    if not high > low:
        ranges = " and ".join(f"{path.length[0]:.6g} to {path.length[-1]:.6g} m" for path in (first, second))
        raise InputError("paths", None, f"must be two with lengths in common, got {ranges}")
    grid = np.linspace(low + trim * (high - low), high - trim * (high - low), points)
    # One window for both, so that the same is averaged.
    half = min(first.half_window, second.half_window)
    apart = np.abs(first._replace(half_window=half).at(grid) - second._replace(half_window=half).at(grid))
    worst = int(apart.argmax())
    rms = float(np.sqrt(np.mean(apart**2)))
    return PathDistance(float(apart[worst]), rms, float(grid[worst]), float(grid[0]), float(grid[-1]))


class TensionLoop(NamedTuple):
    """Shape of one loop, or the mean of several [SI]."""

    width: float  # at mid-range of tension [m]; NaN where a path does not reach it
    height: float  # at mid-range of length [N]
    area: float  # [J]
    stiffness: float  # [N/m]
    length_low: float  # [m]
    length_high: float  # [m]
    tension_low: float  # [N]
    tension_high: float  # [N]
    closure: float  # tension at the end less that at the beginning [N]
    pressure: float = float("nan")  # mean gauge pressure, where the recording has one [Pa]

    @property
    def work(self) -> float:
        """Work of the muscle in the cycle; positive if the muscle delivers it [J]."""
        return -self.area

    @property
    def friction(self) -> float:
        """Half the height: the Coulomb friction of a loop that has no other [N]."""
        return 0.5 * self.height


class LoopRatio(NamedTuple):
    """Ratios of one loop to another [1]."""

    width: float
    height: float
    area: float
    range: float  # of the lengths


def loops(
    record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0
) -> tuple[TensionLoop, ...]:
    """The loop of every full cycle in which pressure and tension return; what is left out is said as a warning.

    Args:
        record: with both channels.
        length: name of the driven channel [m].
        tension: name of the other [N].
        skip: cycles left out at the beginning, such as the first after rest, whose history is another.

    Raises:
        InputError: a channel is missing or not finite, or there is no full cycle.
    """
    groups, cautions = loops_by_held(record, length=length, tension=tension, skip=skip)
    warn(cautions)
    each = [(cycle.start, one) for held, parts in groups for cycle, one in zip(held.cycles, parts, strict=True)]
    return tuple(one for _, one in sorted(each, key=lambda pair: pair[0]))


def loops_by_held(
    record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0
) -> tuple[tuple[tuple[HeldCycles, tuple[TensionLoop, ...]], ...], tuple[Caution, ...]]:
    """The loops by what was held, as `cycles.held_cycles` parts them; arguments and errors as there."""
    x, y = known(record, length), known(record, tension)
    groups, cautions = held_cycles(record, length=length, tension=tension, skip=skip)
    room = length.rpartition(".")[0]
    name = next((n for n in (f"{room}.pressure" if room else "pressure", "pressure") if n in record), None)

    def one(cycle: Cycle) -> TensionLoop:
        mean = float("nan") if name is None else float(record[name][cycle.start : cycle.end].mean())
        return _loop(x, y, cycle)._replace(pressure=mean)

    return tuple((held, tuple(map(one, held.cycles))) for held in groups), cautions


def loop(
    record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0
) -> TensionLoop:
    """The mean of the loops of all full cycles; arguments, errors and warnings as in `loops`.

    A mean over loops of different pressures, speeds or strokes is said as a warning.
    """
    groups, cautions = loops_by_held(record, length=length, tension=tension, skip=skip)
    _say([group for group, _ in groups], cautions, "mean is")
    return mean_loop([one for _, parts in groups for one in parts])


def mean_loop(each: Sequence[TensionLoop]) -> TensionLoop:
    """Mean of every number over loops."""
    if not each:
        raise InputError("loops", None, "must be one or more")
    return TensionLoop(*(float(v) for v in np.mean(np.array(each), axis=0)))


def _loop(length: np.ndarray, tension: np.ndarray, cycle: Cycle) -> TensionLoop:
    # The sample at the end repeats the beginning: what closes the polygon is the line to it.
    x, y = length[cycle.start : cycle.end + 1], tension[cycle.start : cycle.end + 1]
    rising, falling = paths_of(length, tension, cycle)
    ends = (float(x.min()), float(x.max()), float(y.min()), float(y.max()))
    middle, halfway = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[2] + ends[3])
    slopes = [_slope(path, middle, 0.25 * (ends[1] - ends[0])) for path in (rising, falling)]
    return TensionLoop(
        falling.length_at(halfway) - rising.length_at(halfway),
        rising.read(middle)[0] - falling.read(middle)[0],
        closed_area(x, y),
        float(np.mean(slopes)),
        *ends,
        float(y[-1] - y[0]),
    )


def _slope(path: TensionPath, middle: float, half: float) -> float:
    near = np.abs(path.length - middle) <= half
    if np.count_nonzero(near) < 3 or not np.ptp(path.length[near]) > 0.0:
        return path.read(middle)[1]
    return float(np.polyfit((path.length[near] - middle) / half, path.tension[near], 1)[0]) / half


def closed_area(length: np.ndarray, tension: np.ndarray) -> float:
    """Integral of F dL around the polygon through all points, closed from the last to the first [J].

    Args:
        length: (n,) [m] in order of time.
        tension: (n,) [N].
    """
    x, y = finite(length, "length"), finite(tension, "tension")
    if x.shape != y.shape:
        raise InputError("length and tension", None, f"must be two of one length, got {x.shape} and {y.shape}")
    # From their means, so that a small loop far from zero keeps its digits.
    x, y = x - x.mean(), y - y.mean()
    return float(0.5 * np.sum((np.roll(x, -1) - x) * (np.roll(y, -1) + y)))


def path_work(length: np.ndarray, tension: np.ndarray) -> float:
    """Work of a muscle along a path that need not close, the integral of -F dL by trapezoids [J]; positive in shortening.

    Args:
        length: (n,) [m] in order of time.
        tension: (n,) [N].
    """
    return -float(np.trapezoid(tension, length))


def path_stiffness(length: np.ndarray, tension: np.ndarray) -> float:
    """Slope of tension over length about the middle of a path that need not return, as of the paths of a loop [N/m].

    NaN where the length is constant.

    Args:
        length: (n,) [m] in order of time.
        tension: (n,) [N].
    """
    if not np.ptp(length) > 0.0:
        return float("nan")
    order, low, high = np.argsort(length, kind="stable"), float(length.min()), float(length.max())
    path = TensionPath(length[order], tension[order], _HALF_WINDOW * (high - low))
    return _slope(path, 0.5 * (low + high), 0.25 * (high - low))


def loop_ratio(part: TensionLoop, whole: TensionLoop) -> LoopRatio:
    """A loop over another: of a smaller range, a lower frequency, or a lubricated muscle."""
    if 0.0 in (whole.width, whole.height, whole.area):
        raise InputError("loop", None, "must enclose an area; a ratio needs its width, height or area")
    return LoopRatio(
        part.width / whole.width,
        part.height / whole.height,
        part.area / whole.area,
        (part.length_high - part.length_low) / (whole.length_high - whole.length_low),
    )


class Variation(NamedTuple):
    """Variation of a nominally constant channel within the cycles [its unit]."""

    largest: float  # largest less smallest, the worst cycle
    around_mean: float  # largest distance from the mean of the cycle, the worst cycle
    mean: float  # over all cycles


def variation(
    record: Recording, *, channel: str = "muscle.pressure", drive: str = "muscle.length", skip: int = 0
) -> Variation:
    """Variation of a channel over the full cycles of another; single samples count, so noise adds to it.

    A cycle in which the channel does not return is left out. That, and different pressures, speeds or strokes in one
    number, are said as a warning.
    """
    y = known(record, channel)
    groups, cautions = held_cycles(record, length=drive, tension=channel, skip=skip)
    _say(groups, cautions, "variation is")
    parts = [y[c.start : c.end + 1] for held in groups for c in held.cycles]
    return Variation(
        max(float(np.ptp(p)) for p in parts),
        max(float(np.abs(p - p.mean()).max()) for p in parts),
        float(np.mean([p.mean() for p in parts])),
    )


def peak_velocity(record: Recording, *, length: str = "muscle.length", skip: int = 0) -> float:
    """Largest speed of a sine of the range and frequency of the cycles: pi f (longest - shortest) [m/s].

    For a triangle, whose speed is constant, it is pi/2 times that speed. No derivative is taken of noise.
    """
    x = known(record, length)
    cycles = find_cycles(x, skip=skip, subject=f"channel {length}")
    span = float(np.mean([np.ptp(x[c.start : c.end + 1]) for c in cycles]))
    return np.pi * cycle_frequency(record.time, x, subject=f"channel {length}") * span


class StaticPoint(NamedTuple):
    """A length with the tension and pressure that friction and motion have been averaged out of."""

    length: float  # [m]
    pressure: float  # gauge [Pa]
    tension: float  # [N]


def static_points(
    record: Recording,
    lengths: Sequence[float] | np.ndarray,
    *,
    length: str = "muscle.length",
    tension: str = "muscle.tension",
    pressure: str = "muscle.pressure",
    skip: int = 0,
) -> tuple[StaticPoint, ...]:
    """Points of a quasi-static recording, for each pressure that was held.

    Args:
        record: with the three channels.
        lengths: where to sample [m].
        length: name of the driven channel.
        tension: name of the tension.
        pressure: name of the pressure.
        skip: cycles left out at the beginning.

    Raises:
        InputError: a channel is missing, there is no full cycle, or a length is not reached on both paths.
    """
    at = finite(lengths, "lengths")
    x = known(record, length)
    groups, cautions = held_cycles(record, length=length, tension=tension, skip=skip)
    warn(cautions)
    return tuple(
        point
        for group in groups
        for point in _static(at, *(_paths(x, known(record, n), group.cycles) for n in (pressure, tension)))
    )


def _static(at: np.ndarray, pressures: Paths, tensions: Paths) -> Iterator[StaticPoint]:
    rising, falling = tensions
    low, high = max(rising.length[0], falling.length[0]), min(rising.length[-1], falling.length[-1])
    for x in at:
        if not low <= x <= high:
            raise InputError("lengths", float(x), f"must be between {low:.6g} and {high:.6g} m, which both paths reach")
    means = (0.5 * (p.rising.at(at) + p.falling.at(at)) for p in (pressures, tensions))
    for x, p, f in zip(at, *means, strict=True):
        yield StaticPoint(float(x), float(p), float(f))


def force_map(
    record: Recording,
    lengths: Sequence[float] | np.ndarray,
    *,
    of: str | None = None,
    length: str = "span",
    tension: str = "tension",
    pressure: str = "pressure",
    skip: int = 0,
) -> ForceMap:
    """Force map of slow loops at constant pressures: the mean of both branches, which leaves friction out.

    Args:
        record: of a protocol such as ``quasi-static``, one loop or more for each pressure.
        lengths: where to read the branches [m].
        of: label of the steps with the loops; all recorded ones, or the whole recording, where left out.
        length: name of the driven channel [m].
        tension: name of the tension [N].
        pressure: name of the gauge pressure [Pa].
        skip: cycles left out at the beginning of each step.

    Raises:
        InputError: a channel or step is missing, there is no full cycle, or a length is not reached on both branches.
    """
    parts = segments(record, of) if of is not None or record.meta.get("steps") else [record]
    points = [
        point
        for part in parts
        for point in static_points(part, lengths, length=length, tension=tension, pressure=pressure, skip=skip)
    ]
    title, rest = str(record.meta.get("title") or "recording"), record.meta.get("rest_length")
    at, pressures, tensions = (np.array(column) for column in zip(*points, strict=True))
    measured = ForceMap(title, at, pressures, tensions)
    return measured if rest is None else measured.with_rest_length(float(rest))


class LinearTensionFit(NamedTuple):
    """The four numbers of eq. 13, with 95 % intervals by default [SI]."""

    stiffness_per_pressure: Interval  # Kg [m]
    offset_pressure: Interval  # Pa [Pa]
    shortest_length: Interval  # Lmin [m]
    offset_tension: Interval  # Fa [N]
    rms: float  # of the residual tension [N]
    points: int

    def tension(self, length: np.ndarray | float, pressure: np.ndarray | float) -> np.ndarray:
        """Eq. 13 [N] at lengths [m] and gauge pressures [Pa], of one shape."""
        active = self.stiffness_per_pressure.value * (np.asarray(pressure, float) - self.offset_pressure.value)
        return active * (np.asarray(length, float) - self.shortest_length.value) + self.offset_tension.value

    def passive_stiffness(self, rest_length: float) -> float:
        """Passive stiffness Kp [N/m] for a rest length [m]."""
        return self.offset_tension.value / (self.shortest_length.value - positive("rest_length", rest_length, "m"))

    def threshold_pressure(self, rest_length: float) -> float:
        """Threshold pressure Pth [Pa] for a rest length [m]."""
        return self.offset_pressure.value + self.passive_stiffness(rest_length) / self.stiffness_per_pressure.value


def fit_linear_tension(points: Sequence[StaticPoint], *, confidence: float = 0.95) -> LinearTensionFit:
    """Eq. 13 through points, by linear least squares of the tension.

    Args:
        points: five or more, of two or more lengths at each of two or more pressures; the paper took ten.
        confidence: confidence of the intervals, to first order.

    Raises:
        InputError: too few points, or points that do not tell the four numbers apart.
    """
    table = np.array(points, float).reshape(-1, 3)
    # About their middle: the products then differ, and the four columns stay independent in float64.
    middle = table.mean(axis=0) if len(table) else np.zeros(3)
    x, p = table[:, 0] - middle[0], table[:, 1] - middle[1]
    matrix = np.stack([p * x, p, x, np.ones_like(x)], axis=1)
    fit = linear_fit(matrix, table[:, 2], subject="points of eq. 13", confidence=confidence)
    kg, c_p, c_x, c_1 = fit.values
    if kg == 0.0:
        raise InputError("points of eq. 13", None, "must have a tension that grows with pressure and length")
    lever, rise = c_p / kg, c_x / kg  # length above Lmin, pressure above Pa at the middle
    return LinearTensionFit(
        fit.coefficient(0),
        fit.interval(middle[1] - rise, np.array([rise, 0.0, -1.0, 0.0]) / kg),
        fit.interval(middle[0] - lever, np.array([lever, -1.0, 0.0, 0.0]) / kg),
        fit.interval(c_1 - kg * lever * rise, np.array([lever * rise, -rise, -lever, 1.0])),
        fit.rms,
        len(table),
    )


POINTS = 101  # of a path at which loops are compared
TRIM = 0.02  # share of the common range left out at either end, where turning mixes the paths


class LoopResiduals(NamedTuple):
    """Simulated less measured values of a loop.

    Attributes:
        at: values of the horizontal channel, rising and then falling path (n,).
        error: simulated less measured (n,), in the unit of the channel.
        rising: whether a value is on the rising path (n,).
        span: range of the measured values.
    """

    at: np.ndarray
    error: np.ndarray
    rising: np.ndarray
    span: float

    @property
    def rms(self) -> float:
        """Root of the mean square."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def relative(self) -> float:
        """`rms` over the range of the measured values [1]."""
        return self.rms / self.span if self.span > 0.0 else float("nan")


def loop_residuals(
    simulated: Recording, measured: Recording | ForceMap, *, across: str = "span", channel: str = "tension"
) -> LoopResiduals:
    """Compare a measured loop with a simulated one where both exist.

    Cycles of a recording are taken together, and the rising path is compared with the rising one. Static points have no
    paths and are compared with the mean of both at their length.

    Args:
        simulated: recording with at least one full cycle.
        measured: recording with at least one full cycle, or a table of static points.
        across: channel that turns, such as the span [m].
        channel: channel that is compared.

    Raises:
        InputError: a channel is missing, there is no full cycle, or the loops have no common range.
    """
    model = paths(simulated, length=across, tension=channel)
    if isinstance(measured, ForceMap):
        low, high = _common(model.rising, model.falling)
        inside = (measured.length >= low) & (measured.length <= high)
        if not inside.any():
            raise InputError("measured", None, "must have points within the range of the simulated loop")
        at, values = measured.length[inside], measured.tension[inside]
        middle = 0.5 * (model.rising.at(at) + model.falling.at(at))
        return LoopResiduals(at, middle - values, np.ones(len(at), bool), float(np.ptp(measured.tension)))
    names = measured_channels(measured, across, channel)
    other = paths(measured, length=names[0], tension=names[1])
    places, errors, rising = [], [], []
    for one, two, up in ((model.rising, other.rising, True), (model.falling, other.falling, False)):
        low, high = _common(one, two)
        if not low < high:
            raise InputError("measured", None, "must have a range in common with the simulated loop")
        grid = np.linspace(low + TRIM * (high - low), high - TRIM * (high - low), POINTS)
        places.append(grid)
        errors.append(one.at(grid) - two.at(grid))
        rising.append(np.full(POINTS, up))
    span = float(np.nanmax(measured[names[1]]) - np.nanmin(measured[names[1]]))
    return LoopResiduals(np.concatenate(places), np.concatenate(errors), np.concatenate(rising), span)


def measured_channels(measured: Recording, across: str, channel: str) -> tuple[str, str]:
    """Names of both channels in a measured recording, which may call them otherwise.

    Raises:
        InputError: there is no such channel.
    """
    channels = []
    for name in (across, channel):
        last = name.rpartition(".")[2]
        same = {"span": ("span", "length"), "length": ("length", "span"), "tension": ("tension", "force")}
        candidates = [name, last, *(same.get(last, ()))]
        match = next((c for c in candidates if c in measured), None)
        if match is None:
            raise InputError("measured", name, "the measured data have", known=measured.names())
        channels.append(match)
    return channels[0], channels[1]


def _common(one: TensionPath, two: TensionPath) -> tuple[float, float]:
    return float(max(one.length[0], two.length[0])), float(min(one.length[-1], two.length[-1]))
