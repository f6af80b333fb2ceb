"""Recording of a run: samples in memory and, if a log is requested, in a crash-safe file."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from .._jax import Scalar
from ..documents import JsonValue
from ..errors import InputError
from ..recordings.live_log import LiveLog
from ..recordings.recording import Channel, Recording
from . import channels
from .metadata import initial_metadata
from .prepare import PreparedRun

LONGEST_GAP = 1.5  # samples; further apart are samples between which something was left out


class Chunks:
    """Samples kept in memory, chunk by chunk; a channel may be missing in some chunks.

    Args:
        period: period of the samples [s].
        kinds: kinds of every channel that may come: SI unit, kind (``"true"``, ``"measured"``, ``"command"``) and meaning.

    Raises:
        InputError: if the period is no time above zero.
    """

    def __init__(self, period: float, kinds: Mapping[str, tuple[str, str, str]]) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise InputError("period", float(period), "must be a time [s] above zero")
        self.period, self.kinds = float(period), dict(kinds)
        self._times: list[np.ndarray] = []
        self._arrays: list[dict[str, np.ndarray]] = []

    def __len__(self) -> int:
        """Number of samples kept so far."""
        return sum(len(t) for t in self._times)

    def add(self, times: np.ndarray, arrays: Mapping[str, Scalar], keep: np.ndarray | bool = True) -> None:
        """Take the next samples; they are copied.

        Args:
            times: rising [s], (n,), after those that were kept before.
            arrays: channels by name, (n,) each [their units]. A channel may be missing in some chunks.
            keep: which samples to keep, (n,) or one for all.

        Raises:
            InputError: names the channel that is unknown or has another shape, or the time that does not rise.
        """
        t = np.asarray(times, np.float64)
        if t.ndim != 1:
            raise InputError("times", None, f"must have one dimension, got shape {t.shape}")
        kept = np.asarray(keep, bool)
        if kept.shape not in ((), t.shape):
            raise InputError("keep", None, f"must have the shape {t.shape}, got {kept.shape}")
        kept = np.broadcast_to(kept, t.shape)
        chosen: dict[str, np.ndarray] = {}
        for name, values in arrays.items():
            column = np.asarray(values)
            if name not in self.kinds:
                raise InputError("channel", name, "units are known of", known=self.kinds)
            if column.shape != t.shape:
                raise InputError(
                    f"channel {name}", None, f"must have the shape of the times, {t.shape}, got {column.shape}"
                )
            chosen[name] = np.array(column[kept], np.float64)
        if kept.any():
            self._append(t[kept], chosen)

    def _append(self, times: np.ndarray, chosen: dict[str, np.ndarray]) -> None:
        before = self._times[-1][-1:] if self._times else times[:0]
        steps = np.diff(np.concatenate([before, times]))
        if not (np.isfinite(times).all() and np.all(steps > 0.0)):
            raise InputError("times", None, f"must be finite and rise from chunk to chunk, got {times[0]:.6g} s")
        self._times.append(times)
        self._arrays.append(chosen)

    def recording(self, meta: Mapping[str, JsonValue] | None = None) -> Recording:
        """Return the samples kept so far; a channel is NaN if a chunk did not have it.

        The meta gets ``gaps``, the times [s] before and after each place where samples were left out, if there are any.

        Raises:
            InputError: if nothing was kept.
        """
        if not self._times:
            raise InputError("recording", None, "is empty: the run recorded no sample")
        time = np.concatenate(self._times)
        present = {name for chunk in self._arrays for name in chunk}
        channels = {
            name: Channel(np.concatenate(self._column(name)), *self.kinds[name])
            for name in self.kinds
            if name in present
        }
        gaps = self._gaps(time)
        return Recording(time, channels, {**(meta or {}), **({"gaps": gaps} if gaps else {})})

    def _column(self, name: str) -> list[np.ndarray]:
        pairs = zip(self._times, self._arrays, strict=True)
        return [chunk[name] if name in chunk else np.full(times.shape, np.nan) for times, chunk in pairs]

    def _gaps(self, time: np.ndarray) -> list[list[float]]:
        places = np.flatnonzero(np.diff(time) > LONGEST_GAP * self.period)
        return [[float(time[i]), float(time[i + 1])] for i in places]


class RunRecorder:
    """Recorder of a run: samples in memory and, if a log is given, in a crash-safe file.

    Args:
        bench: the run, for the header of the log.
        period: between two samples that are kept [s].
        log: path of a new ``.mcap`` file.

    Attributes:
        failure: why the log has no more samples, such as a full disk; empty while it takes them.
    """

    def __init__(self, bench: PreparedRun, period: float, log: str | Path | None = None) -> None:
        self.bench, self.path, self.failure = bench, log, ""
        self.chunks = Chunks(period, {})
        self.log: LiveLog | None = None
        self._names: list[str] = []

    def take(self, times: np.ndarray, arrays: Mapping[str, np.ndarray], keep: np.ndarray) -> None:
        """Take the next samples (n,) and keep those selected; the first call, even without samples, opens the log."""
        self.chunks.kinds.update(channels.kinds(arrays))
        if self.path is not None and self.log is None and not self.failure:
            kinds = self.chunks.kinds
            columns = {n: Channel(np.zeros(0), *kinds[n]) for n in arrays}
            self.log, self._names = LiveLog(self.path, columns, initial_metadata(self.bench)), list(arrays)
        if not len(times):
            return
        self.chunks.add(times, arrays, keep)
        if self.log is not None and keep.any():
            nothing = np.full(len(times), np.nan)  # another part may have fewer channels
            table = np.stack([np.asarray(arrays.get(n, nothing), float)[keep] for n in self._names], axis=1)
            with self._losing():
                self.log.append(times[keep], table)

    def remark(self, text: str, time: float) -> None:
        """Write a remark at a time [s] into the log."""
        if self.log is not None:
            with self._losing():
                self.log.annotate(text, time)

    @contextlib.contextmanager
    def _losing(self) -> Iterator[None]:
        """Go on in memory where the log takes no more: a run must vent then, and its samples must not be lost."""
        try:
            yield
        except InputError as error:
            log, self.log = self.log, None
            assert log is not None
            self.failure = f"the log {Path(log.path).name} cannot be written: {error.problem}"
            with contextlib.suppress(InputError):
                log.close("stopped", self.failure)

    def recording(self) -> Recording:
        """Return the samples as a recording without metadata."""
        return self.chunks.recording()

    def close(self, result: str, message: str, meta: Mapping[str, JsonValue]) -> None:
        """Close the log."""
        if self.log is not None:
            with self._losing():
                self.log.close(result, message, meta)

    def __enter__(self) -> Self:
        """Return the recorder itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the log with the error that ended the block, if any."""
        if self.log is not None:
            self.log.__exit__(kind, error, trace)
