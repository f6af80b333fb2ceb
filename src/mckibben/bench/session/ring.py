"""The newest samples of a session, of which displays take what they have not shown yet; memory is bounded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


class Ring:
    """Channels of the last so many samples; used under the lock of its owner.

    Args:
        size: samples.
    """

    def __init__(self, size: int) -> None:
        self.size, self.count = size, 0
        self._times = np.zeros(size)
        self._arrays: dict[str, np.ndarray] = {}

    def add(self, times: np.ndarray, arrays: Mapping[str, Any]) -> None:
        """The next samples (n,); a channel that is missing is NaN there."""
        n = len(times)
        if n > self.size:
            self.add(times[: n - self.size], {k: v[: n - self.size] for k, v in arrays.items()})
            times, arrays, n = times[-self.size :], {k: v[-self.size :] for k, v in arrays.items()}, self.size
        for name in arrays:
            if name not in self._arrays:
                self._arrays[name] = np.full(self.size, np.nan)
        first = self.count % self.size
        cut = min(n, self.size - first)
        for row, values in [(self._times, times), *((a, arrays.get(k)) for k, a in self._arrays.items())]:
            given = np.full(n, np.nan) if values is None else values
            row[first : first + cut], row[: n - cut] = given[:cut], given[cut:]
        self.count += n

    def latest(self) -> dict[str, float]:
        """The newest sample: ``time`` [s] and every channel [its unit]; empty before the first."""
        if not self.count:
            return {}
        at = (self.count - 1) % self.size
        return {"time": float(self._times[at]), **{name: float(a[at]) for name, a in self._arrays.items()}}

    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Samples after a time [s], of those that are still there: times (n,) and channels (n,)."""
        kept = min(self.count, self.size)
        order = (self.count - kept + np.arange(kept)) % self.size
        order = order[np.searchsorted(self._times[order], time, side="right") :]
        return self._times[order], {name: a[order] for name, a in self._arrays.items()}
