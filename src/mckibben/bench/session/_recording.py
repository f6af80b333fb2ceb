"""Recordings of manual operation, with the log and the metadata of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from ...assembly.accounts import Accounts
from ...assembly.machine import Machine
from ...documents import JsonValue
from ...errors import InputError
from ...recordings.recording import Recording
from ..hardware.computer import Timing
from ..metadata import run_metadata
from ..prepare import PreparedRun
from ..recorder import RunRecorder
from ..sample_loop import Lateness, SampledMachine

LEAVES = "by hand"  # label of the only step
ENDED = 2.0  # time within which a machine that is sampled comes to its next sample [s]


class ManualRecording:
    """A recording of a session from one sample to another, runs included.

    Args:
        prepared: the run, for the header of the log.
        timing: timing of the loop.
        machine: that is sampled.
        log: a new ``.mcap`` file.
    """

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
        self._begun = self._state()

    def end(self, number: int) -> None:
        """End before a sample, which is the next one."""
        self.last = number
        self._ended = self._state()

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
        """Close the log and return the recording.

        Args:
            machine: whose parameters are written down.
            closed: the accounts between two states of a simulated machine.
            message: how it ended.

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
            meta |= {"steps": self._step(), "events": self.events, "deadlines": late._asdict()}
            self.recorder.close("done", message, meta)
        return record.with_meta(meta, result="done", message=message)

    def _state(self) -> np.ndarray | None:
        return self.machine.hardware.state()

    def _step(self) -> list[dict[str, JsonValue]]:
        """Describe the whole recording as one step."""
        sentence = self.prepared.protocol.sentence()
        return [
            {
                "index": 1, "path": "steps.1", "label": LEAVES, "case": {}, "start": 0.0, "end": self.time,
                "ended_by": "stop", "recorded": True, "sentence": sentence,
            }
        ]  # fmt: skip
