"""The live strip chart: samples become frames of a few columns of pixels, each with its least, largest and last value.

A peak of a single sample is seen whatever the sample rate. Frames lie on a fixed grid of the machine's time, so that they do
not depend on how the samples were cut into chunks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import InputError

_ROUNDING = 1e-6  # of a column; times are sums of periods


class DisplayFeed:
    """Frames from chunks of samples; plain NumPy.

    Args:
        frames_per_second: the most frames in a second of the machine's time [1/s].
        buckets: columns of pixels in one frame.

    Raises:
        InputError: names the field and what is allowed.
    """

    def __init__(self, frames_per_second: float = 50.0, buckets: int = 2) -> None:
        if not (math.isfinite(frames_per_second) and frames_per_second > 0.0):
            raise InputError("frames_per_second", float(frames_per_second), "allowed is a number above zero")
        if buckets != int(buckets) or buckets < 1:
            raise InputError("buckets", buckets, "allowed is a whole number of columns, 1 or more")
        self.frames_per_second, self.buckets = float(frames_per_second), int(buckets)
        self._times = np.zeros(0)
        self._arrays: dict[str, np.ndarray] = {}
        self._shown = -math.inf  # no sample before this time can still be shown

    def push(self, times: Any, arrays: Mapping[str, Any]) -> list[dict[str, Any]]:
        """The frames that these samples complete; the last one waits for a sample behind it.

        A frame holds only what JSON can: ``start`` [s], ``width`` of a column [s], and ``channels``, of which each has
        lists ``min``, ``max`` and ``last`` of `buckets` numbers [its unit], None where nothing is known.

        Args:
            times: rising [s], (n,), after those before.
            arrays: channels by name, (n,) each; a channel may be missing in some chunks.

        Raises:
            InputError: if a shape differs or time goes back; `finish` begins anew.
        """
        t = np.array(times, np.float64)
        columns = {name: np.array(values, np.float64) for name, values in arrays.items()}
        self._check(t, columns)
        names = [*self._arrays, *(name for name in columns if name not in self._arrays)]
        nothing, missing = np.full(self._times.shape, np.nan), np.full(t.shape, np.nan)
        self._arrays = {
            name: np.concatenate([self._arrays.get(name, nothing), columns.get(name, missing)]) for name in names
        }
        self._times = np.concatenate([self._times, t])
        if not len(self._times):
            return []
        frame = self._bucket(self._times) // self.buckets
        return self._take(int(np.searchsorted(frame, frame[-1])))

    def finish(self) -> list[dict[str, Any]]:
        """The frame that was not complete, if there is one; then a new run may begin at any time."""
        frames = self._take(len(self._times))
        self._times, self._arrays, self._shown = np.zeros(0), {}, -math.inf
        return frames

    def _check(self, times: np.ndarray, columns: Mapping[str, np.ndarray]) -> None:
        if times.ndim != 1:
            raise InputError("times", f"of shape {times.shape}", "allowed is one dimension")
        for name, values in columns.items():
            if values.shape != times.shape:
                raise InputError(f"channel {name}", f"of shape {values.shape}", f"the times have {times.shape}")
        if not len(times):
            return
        if not (np.isfinite(times).all() and times[0] > self._shown and np.all(np.diff(times) > 0.0)):
            raise InputError(
                "times", f"from {times[0]:.6g} s", "allowed are finite times that rise from chunk to chunk"
            )
        self._shown = float(times[-1])

    def _bucket(self, times: np.ndarray) -> np.ndarray:
        return np.floor(times * (self.frames_per_second * self.buckets) + _ROUNDING).astype(np.int64)

    def _take(self, count: int) -> list[dict[str, Any]]:
        """The first samples as frames; the others stay."""
        if not count:
            return []
        bucket = self._bucket(self._times[:count])
        firsts = np.flatnonzero(np.diff(bucket, prepend=bucket[0] - 1))
        lasts = np.append(firsts[1:], count) - 1
        held = bucket[firsts]
        frames = np.unique(held // self.buckets)
        place = np.searchsorted(frames, held // self.buckets) * self.buckets + held % self.buckets
        grids: dict[str, dict[str, np.ndarray]] = {}
        for name, values in self._arrays.items():
            some = values[:count]
            rows = {"min": np.fmin.reduceat(some, firsts), "max": np.fmax.reduceat(some, firsts), "last": some[lasts]}
            grids[name] = {key: self._grid(row, place, len(frames)) for key, row in rows.items()}
        self._times = self._times[count:]
        self._arrays = {name: values[count:] for name, values in self._arrays.items()}
        return [self._frame(int(number), i, grids) for i, number in enumerate(frames)]

    def _grid(self, row: np.ndarray, place: np.ndarray, frames: int) -> np.ndarray:
        """Values of the columns that have samples on the full grid, as objects: JSON has no NaN and no infinity."""
        grid = np.full(frames * self.buckets, None, object)
        known = np.isfinite(row)
        grid[place[known]] = row[known]
        return grid.reshape(frames, self.buckets)

    def _frame(self, number: int, i: int, grids: Mapping[str, Mapping[str, np.ndarray]]) -> dict[str, Any]:
        return {
            "start": number / self.frames_per_second,
            "width": 1.0 / (self.frames_per_second * self.buckets),
            "channels": {name: {key: grid[i].tolist() for key, grid in grid.items()} for name, grid in grids.items()},
        }
