"""Recording of a run or of manual operation: samples in memory, in a crash-safe file where asked for, and the metadata."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from .. import citations
from .._jax import Scalar
from ..analysis.channels import saturation
from ..assembly.accounts import CLOSED, Accounts, document
from ..assembly.machine import Machine
from ..components.paths import resolved
from ..documents import JsonValue
from ..errors import InputError
from ..experiments.protocol import PlannedStep
from ..formats.live_log import LiveLog
from ..muscles.evidence import law_error
from ..recordings import Channel, Recording
from ..recordings.provenance import created, versions
from . import channels
from .hardware.computer import Timing
from .prepare import PreparedRun
from .sample_loop import Lateness, SampledMachine

ASKED = "asked to "  # begins the event of an operator's action


class StepTable:
    """Start and end times of the steps of a protocol, as a recording keeps them."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.steps: list[dict[str, Any]] = []
        self._longest = 0.0

    def add(self, times: np.ndarray, index: np.ndarray, steps: Sequence[PlannedStep]) -> None:
        """Add samples at times [s], each in the step with an index into `steps`."""
        for j in np.unique(index):
            step, begins = steps[int(j)], float(times[np.argmax(index == j)])
            if self.steps and self.steps[-1]["index"] == step.index:
                continue
            self.end(begins)
            self._longest = step.count * self.period
            self.steps.append(step.entry(begins, begins))

    def end(self, time: float, by: str = "until") -> None:
        """End the last step at a time [s]; if that is earlier than planned, `by` names the reason."""
        if not self.steps or self.steps[-1]["end"] > self.steps[-1]["start"]:
            return
        last = self.steps[-1]
        last["end"] = time
        if time - last["start"] < self._longest - 0.5 * self.period:
            last["ended_by"] = by


def initial_metadata(bench: PreparedRun) -> dict[str, JsonValue]:
    """Compose the metadata that are known before the run."""
    protocol, rig, spec = bench.protocol, bench.rig, bench.specimen
    room = rig.environment
    said, used = " ".join([rig.source, protocol.source]), rig.calibration
    sources = [*(spec.sources if spec else ()), *(key for key in citations.known_keys() if key in said)]
    return {
        "title": protocol.title,
        "sentence": protocol.sentence(),
        "protocol": protocol.document(),
        "digest": protocol.digest,
        "rig": rig.name,
        "rig_document": dict(rig.document),
        "plumbing": bench.layout,
        "specimen": None if spec is None else spec.id,
        "rest_length": bench.plan.rest_length,
        "mounting": {"muscle": bench.unit.mounting},
        "inferred": [*rig.inferred, *(spec.inferred() if spec else [])],
        "environment": {"pressure_abs": float(room.pressure_abs), "temperature": float(room.temperature)},
        "converters": _ends(bench),
        **({} if used is None else {"calibration": used.plain()}),
        "seed": bench.seed,
        "law_error": law_error(spec, bench.unit.law),
        "warnings": [*(f.sentence for f in bench.accepted), *bench.cautions],
        "citations": list(dict.fromkeys([*bench.unit.law.cites, *sources])),
        "versions": versions(),
        "created": created(),
    }


def run_metadata(
    bench: PreparedRun, machine: Machine, timing: Timing, *, inner: int, closed: Sequence[Accounts], record: Recording
) -> dict[str, JsonValue]:
    """Compose the metadata of a recording, without steps, events and result.

    Args:
        bench: the run.
        machine: the last one, whose parameters are written down.
        timing: timing of the loop.
        inner: most steps of the physics per sample.
        closed: the accounts of every part; none if the machine is real.
        record: what was recorded, for its saturation.
    """
    true = bench.rig.true  # what the channels measure at the ends of their converters
    ends = {n: {k: float(true(n, e[k])) for k in ("low", "high")} for n, e in _ends(bench).items()}
    return {
        **initial_metadata(bench),
        "parameters": resolved(machine),
        "balance": {name: max(float(getattr(a, name)) for a in closed) for name in CLOSED if closed},
        "friction": {"work": sum(a.friction for a in closed), "dissipated": sum(a.dissipated for a in closed)},
        "energy": document(machine, [a.energy_parts for a in closed]) if closed else {},
        "saturation": saturated(record, ends),
        "timing": {
            "sample_rate": bench.protocol.sample_rate,
            "control_rate": timing.sample_rate,
            "latency": timing.latency,
            "step": timing.period / inner,
        },
    }


def _ends(bench: PreparedRun) -> dict[str, dict[str, float]]:
    return {
        name: {"low": float(s.converter.low), "high": float(s.converter.top), "bits": s.converter.bits}
        for name, s in bench.rig.sensors.items()
    }


def saturated(record: Recording, converters: Mapping[str, Mapping[str, float]]) -> dict[str, JsonValue]:
    """Describe every measured channel that saturated: share, longest time [s], and a sentence."""
    saturations = {}
    for name, ends in converters.items():
        if name not in record or not np.isfinite(record[name]).all():
            continue
        # at the lower end of a range that begins at zero, zero is measured
        low = ends["low"] if ends["low"] < 0.0 else None
        one = saturation(record, name, ends=(low, ends["high"]))
        if one:
            saturations[name] = {"share": one.share, "longest": one.longest, "sentence": one.sentence}
    return saturations


LONGEST_GAP = 1.5  # samples; further apart are samples between which something was left out


BLOCK = 4096  # samples from which on chunks are joined


class Chunks:
    """Samples kept in memory, chunk by chunk, of channels whose unit, kind and meaning are known; some may lack in a chunk.

    Raises:
        InputError: if the period is no time above zero.
    """

    def __init__(self, period: float, kinds: Mapping[str, tuple[str, str, str]]) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise InputError("period", float(period), "must be a time [s] above zero")
        self.period, self.kinds = float(period), dict(kinds)
        self._times: list[np.ndarray] = []
        self._arrays: list[dict[str, np.ndarray]] = []
        self._joined = self._loose = 0  # chunks that were joined, and samples of those behind them

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
        if not kept.any():
            return
        t = t[kept]
        before = self._times[-1][-1:] if self._times else t[:0]
        if not (np.isfinite(t).all() and np.all(np.diff(np.concatenate([before, t])) > 0.0)):
            raise InputError("times", None, f"must be finite and rise from chunk to chunk, got {t[0]:.6g} s")
        self._times.append(t)
        self._arrays.append(chosen)
        self._loose += len(t)
        if self._loose >= BLOCK:
            self._join()

    def _join(self) -> None:
        """Join the chunks that came since the last time into one: many of few samples take several times their size."""
        times, columns = self._columns(self._joined)
        self._times[self._joined :], self._arrays[self._joined :] = [times], [columns]
        self._joined, self._loose = self._joined + 1, 0

    def _columns(self, first: int = 0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Times and channels of the chunks from one on, each in one piece; NaN where a chunk does not have a channel."""
        chunks = list(zip(self._times[first:], self._arrays[first:], strict=True))
        columns = {
            name: np.concatenate([chunk[name] if name in chunk else np.full(t.shape, np.nan) for t, chunk in chunks])
            for name in dict.fromkeys(name for _, chunk in chunks for name in chunk)
        }
        return np.concatenate([times for times, _ in chunks]), columns

    def recording(self, meta: Mapping[str, JsonValue] | None = None) -> Recording:
        """Return the samples kept so far; a channel is NaN if a chunk did not have it.

        The meta gets ``gaps``, the times [s] before and after each place where samples were left out, if there are any.

        Raises:
            InputError: if nothing was kept.
        """
        if not self._times:
            raise InputError("recording", None, "is empty: the run recorded no sample")
        time, columns = self._columns()
        channels = {name: Channel(columns[name], *kind) for name, kind in self.kinds.items() if name in columns}
        places = np.flatnonzero(np.diff(time) > LONGEST_GAP * self.period)
        gaps = [[float(time[i]), float(time[i + 1])] for i in places]
        return Recording(time, channels, {**(meta or {}), **({"gaps": gaps} if gaps else {})})


class RunRecorder:
    """Recorder of a run: samples in memory and, if a log is given, in a crash-safe file.

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


# ---- by hand


LEAVES = "by hand"  # label of the only step


class ManualRecording:
    """A recording of a session from one sample to another, runs included, with a log where a file is named for it."""

    def __init__(
        self, prepared: PreparedRun, timing: Timing, machine: SampledMachine, log: str | Path | None = None
    ) -> None:
        self.prepared, self.timing, self.machine = prepared, timing, machine
        self.recorder = RunRecorder(prepared, timing.period, log)
        self.first: int | None = None
        self.last: int | None = None
        self.taken = 0
        self.events: list[dict[str, JsonValue]] = []
        self._lateness: list[np.ndarray] = []
        self._begun: np.ndarray | None = None
        self._ended: np.ndarray | None = None

    @property
    def time(self) -> float:
        """Recorded time [s]."""
        return self.taken * self.timing.period

    def complete(self) -> bool:
        """Whether the last sample has been recorded."""
        return self.last is not None and self.first is not None and self.taken >= self.last - self.first

    def begin(self, number: int) -> None:
        """Begin with a sample, which is the next one."""
        self.first = number
        self._begun = self.machine.hardware.state()

    def end(self, number: int) -> None:
        """End before a sample, which is the next one."""
        self.last = number
        self._ended = self.machine.hardware.state()

    def take(self, numbers: np.ndarray, lateness: np.ndarray, arrays: Mapping[str, np.ndarray]) -> None:
        """Record the samples of a chunk that lie within; the time of a recording begins at 0."""
        if self.first is None:
            return
        keep = (numbers >= self.first) & (numbers < (np.inf if self.last is None else self.last))
        times = self.timing.period * (numbers - self.first)
        self.recorder.take(times[keep], {n: v[keep] for n, v in arrays.items()}, np.ones(int(keep.sum()), bool))
        self._lateness.append(lateness[keep])
        self.taken += int(keep.sum())

    def remark(self, text: str, time: float, **more: str) -> None:
        """Add an event at a time of the session [s]."""
        begun = 0 if self.first is None else self.first
        own = max(0.0, time - begun * self.timing.period)
        self.events.append({"time": own, "text": text, **more})
        self.recorder.remark(text, own)

    def close(
        self, machine: Machine, closed: Callable[[np.ndarray | None, np.ndarray | None], Accounts | None], message: str
    ) -> Recording:
        """Close the log and return the recording, with the parameters of a machine and the accounts between two states.

        Raises:
            InputError: if nothing was recorded.
        """
        with self.recorder:
            if not self.taken:
                raise InputError("record", None, "is empty: it must hold one sample or more")
            record = self.recorder.recording()
            account = closed(self._begun, self._ended)
            sums = [] if account is None else [account]
            meta = run_metadata(
                self.prepared, machine, self.timing, inner=self.timing.inner, closed=sums, record=record
            )
            late = Lateness.of(np.concatenate(self._lateness), self.timing.period)
            encoder = self.prepared.rig.encoder
            if encoder is not None:
                mounted = [[0.0, next(self.prepared.segments()).start_span]]
                meta["encoder"] = {"resolution": float(encoder.resolution), "mounted": mounted}
            step = {
                "index": 1, "path": "steps.1", "label": LEAVES, "case": {}, "start": 0.0, "end": self.time,
                "ended_by": "stop", "recorded": True, "sentence": self.prepared.protocol.sentence(),
            }  # fmt: skip
            meta |= {"steps": [step], "events": self.events, "deadlines": late._asdict()}
            self.recorder.close("done", message, meta)
        return record.with_meta(meta, result="done", message=message)
