"""What a run keeps while it goes on: the samples in memory, and where it is wanted a log that survives this program."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from ..recordings.live_log import LiveLog
from ..recordings.recording import Channel, Recording
from . import channels
from .about import beforehand
from .prepare import Bench
from .software.storage import Chunks


class Keeper:
    """Takes chunks of samples.

    Args:
        bench: what is run, for the head of the log.
        period: between two samples that are kept [s].
        log: path of a new ``.mcap`` file.
    """

    def __init__(self, bench: Bench, period: float, log: str | Path | None = None) -> None:
        self.bench, self.path = bench, log
        self.chunks = Chunks(period, {})
        self.log: LiveLog | None = None
        self._names: list[str] = []

    def take(self, times: np.ndarray, arrays: Mapping[str, np.ndarray], keep: np.ndarray) -> None:
        """The next samples (n,), of which some are kept; the first call, which may bring none, begins the log."""
        self.chunks.kinds.update(channels.kinds(arrays))
        if self.path is not None and self.log is None:
            kinds = self.chunks.kinds
            columns = {n: Channel(np.zeros(0), *kinds[n]) for n in arrays}
            self.log, self._names = LiveLog(self.path, columns, beforehand(self.bench)), list(arrays)
        if not len(times):
            return
        self.chunks.add(times, arrays, keep)
        if self.log is not None and keep.any():
            nothing = np.full(len(times), np.nan)  # another part may have fewer channels
            table = np.stack([np.asarray(arrays.get(n, nothing), float)[keep] for n in self._names], axis=1)
            self.log.append(times[keep], table)

    def remark(self, text: str, time: float) -> None:
        """A sentence at a time [s], into the log."""
        if self.log is not None:
            self.log.annotate(text, time)

    def recording(self) -> Recording:
        """What was kept, without a meta."""
        return self.chunks.recording()

    def close(self, result: str, message: str, meta: Mapping[str, Any]) -> None:
        """End the log."""
        if self.log is not None:
            self.log.close(result, message, meta)

    def __enter__(self) -> Self:
        """The keeper itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """What goes wrong inside becomes the log's last word."""
        if self.log is not None:
            self.log.__exit__(kind, error, trace)
