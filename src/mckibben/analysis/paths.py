"""The rising and the falling path of a cycle: tension as a function of length while lengthening and while shortening.

A path is read by a local parabola through its samples within 5 % of the length range to either side, at least the five
nearest: straight and parabolic paths are exact, and noise and counts average over the samples of the window.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import known
from .cycles import Cycle, find_cycles

_HALF_WINDOW = 0.05
_LEAST = 5


class Path(NamedTuple):
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
        """First length [m] at which the path passes a tension [N]; NaN where it never does."""
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
        return np.where(count >= 2 * _LEAST, means, np.interp(grid, self.length, self.tension))


class Paths(NamedTuple):
    """Both paths of one cycle."""

    rising: Path
    falling: Path


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
        parts.append(Path(length[part][order], tension[part][order], _HALF_WINDOW * span))
    return Paths(*(parts[::-1] if cycle.begins_high else parts))


def paths(record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0) -> Paths:
    """The paths of all full cycles taken together: the more cycles, the less noise.

    Args:
        record: with both channels.
        length: name of the channel that turns [m].
        tension: name of the channel read [N]; any other does as well, such as a pressure.
        skip: cycles left out at the beginning.

    Raises:
        InputError: a channel is missing, or there is no full cycle.
    """
    x, y = known(record, length), known(record, tension)
    each = [paths_of(x, y, cycle) for cycle in find_cycles(x, skip=skip, what=f"channel {length}")]
    return Paths(_pooled([p.rising for p in each]), _pooled([p.falling for p in each]))


def _pooled(parts: list[Path]) -> Path:
    x, y = np.concatenate([p.length for p in parts]), np.concatenate([p.tension for p in parts])
    order = np.argsort(x, kind="stable")
    return Path(x[order], y[order], float(np.mean([p.half_window for p in parts])))


class PathDistance(NamedTuple):
    """Distance of two paths in tension where both exist."""

    largest: float  # [N]
    rms: float  # [N]
    length: float  # where it is largest [m]
    from_length: float  # compared from here [m]
    to_length: float  # to here [m]


def path_distance(first: Path, second: Path, *, trim: float = 0.05, points: int = 51) -> PathDistance:
    """How far two paths, such as the rising ones of two recordings, lie apart.

    Args:
        first: one path.
        second: the other.
        trim: share of the common length range left out at either end, where turning mixes the paths.
        points: of the common grid.

    Raises:
        InputError: no length is on both paths.
    """
    if not 0.0 <= trim < 0.5 or points < 2:
        raise InputError("trim, points", f"{trim}, {points}", "allowed are 0 to below 0.5, and 2 or more")
    low = max(first.length[0], second.length[0])
    high = min(first.length[-1], second.length[-1])
    if not high > low:
        raise InputError(
            "paths",
            f"{first.length[0]:.6g} to {first.length[-1]:.6g} m and {second.length[0]:.6g} to "
            f"{second.length[-1]:.6g} m",
            "allowed are two with lengths in common",
        )
    grid = np.linspace(low + trim * (high - low), high - trim * (high - low), points)
    # One window for both, so that the same is averaged.
    half = min(first.half_window, second.half_window)
    apart = np.abs(first._replace(half_window=half).at(grid) - second._replace(half_window=half).at(grid))
    worst = int(apart.argmax())
    rms = float(np.sqrt(np.mean(apart**2)))
    return PathDistance(float(apart[worst]), rms, float(grid[worst]), float(grid[0]), float(grid[-1]))
