"""Playing a prepared run: segments between operator actions, samples in chunks, and one recording."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..assembly.accounts import Accounts
from ..assembly.machine import Machine
from ..assembly.output_names import CONSTANT
from ..documents import JsonValue
from ..engine import sampled
from ..engine.soundness import Soundness, overloaded_parts, unsound_sentence
from ..errors import ConvergenceError, EmptyRunError, InputError, LineLostError
from ..experiments.dry_run import check
from ..muscles.evidence import volume_contradiction
from ..recordings.recording import Recording
from . import channels
from .hardware.interface import Hardware
from .hardware.simulated import Clock, SimulatedHardware
from .prepare import PreparedRun, RunSegment, with_friction_scale
from .recorder import ASKED, RunRecorder, StepTable, run_metadata
from .sample_loop import Lateness, SampledMachine, SampleLoop, played
from .segment import AFTER_STOP, Chunk, SegmentMachine, simulated, software_of, timing_of
from .software.interlocks import EmergencyStop, Trip, stop_sentence
from .software.loop import BenchSoftware

Progress = Callable[[float, float], None]  # time done and longest time [s]
Display = Callable[[np.ndarray, Mapping[str, np.ndarray]], None]  # times and channels of a chunk


@dataclass
class RunState:
    """A run as its clients see it; that of a run in another process is updated with every chunk.

    Attributes:
        time: how far it is [s].
        result: as that of the recording, so far.
        message: how it ended, so far that it reached its end.
        events: that the recording keeps; those of a stop have a ``code``.
        steps: that have begun: path, label, start and end [s], period [s].
    """

    time: float = 0.0
    result: str = "done"
    message: str = "The run reached its end."
    events: list[dict[str, Any]] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)

    @property
    def stop(self) -> dict[str, JsonValue] | None:
        """The event of the stop that ended the run."""
        return next((e for e in reversed(self.events) if "code" in e), None)


class Stage(Protocol):
    """The machine or machines on which the segments of a run are played."""

    @property
    def hardware(self) -> Hardware | None:
        """The machine that outlives the run; None if every segment has a simulated one of its own."""

    def bring(self, segment: RunSegment) -> None:
        """Bring the machine to the start of a segment, after the operator did what the segment asks for."""

    def play(
        self, run: ProtocolRun, number: int, segment: RunSegment, software: BenchSoftware
    ) -> Generator[Chunk, None, None]:
        """Play a segment, chunk by chunk; closed before its end, the machine is stopped and vented first."""


class NewMachine:
    """A stage whose machine is set up for every segment, at rest where the segment begins.

    A real machine is started again and stays open; a simulated one is made again, and without a clock whole chunks are
    computed at once, with steps that the machine's own rates allow.
    """

    def __init__(self, hardware: Hardware | None = None, clock: Clock | None = None) -> None:
        self.hardware, self.clock = hardware, clock

    def bring(self, segment: RunSegment) -> None:
        """Do nothing: the machine is made, or the muscle was mounted by the operator, where the segment begins."""

    def play(
        self, run: ProtocolRun, number: int, segment: RunSegment, software: BenchSoftware
    ) -> Generator[Chunk, None, None]:
        """Play a segment."""
        prepared, timing = run.prepared, run.timing
        if self.hardware is not None:
            unit = with_friction_scale(prepared.unit, segment.friction)
            run.machine = prepared.rig.machine(segment.layout, unit, start=segment.start_span, moves=segment.moves)
            yield from played(run.loop(SampledMachine(self.hardware, timing.period), segment, software))
            return
        own = SegmentMachine(prepared, number, segment, timing, run.state.time)
        run.machine = own.machine
        if self.clock is None:
            carry = own.carry(software)
            try:
                for chunk in simulated(own.plant, software, carry, own.rows, timing):
                    assert chunk.carry is not None
                    carry, run.finest = chunk.carry, max(run.finest, chunk.inner)
                    yield chunk
            except (GeneratorExit, KeyboardInterrupt):
                run.accounts.append(own.closed(carry))
                raise
            return
        machine = own.at_interface(ahead=run.longest * timing.period)
        hardware = SimulatedHardware(machine, self.clock)
        try:
            yield from played(run.loop(SampledMachine(hardware, timing.period), segment, software))
        finally:
            run.accounts.append(own.closed(machine.carry()))


def compile_run(prepared: PreparedRun, wanted: Callable[[], bool] = lambda: True) -> None:
    """Compile what a real-time run of a simulated machine needs, so that it begins at once, while that is still wanted."""
    timing = timing_of(prepared)
    for number, segment in enumerate(prepared.segments()):
        if not wanted():
            return
        own = SegmentMachine(prepared, number, segment, timing)
        machine, software = own.at_interface(), software_of(prepared, segment, timing)
        sampled_machine = SampledMachine(SimulatedHardware(machine), timing.period)
        converters, outputs = prepared.rig.converters(segment.start_span), own.machine.signals()
        SampleLoop(sampled_machine, converters, software, outputs=outputs, longest=1, stop=lambda: False)


class ProtocolRun:
    """A prepared run on a stage, from its first sample to its recording; its dry run has passed.

    Options are those of `run.run`, and ``begun``, which is given the state of the run once the machine is where the first
    segment begins.

    Attributes:
        state: how far it is, and how it ended.
        machine: machine of the present segment, whose parameters are written down.
        accounts: accounts of the segments that are over; none of a real machine.
    """

    def __init__(
        self,
        prepared: PreparedRun,
        stage: Stage,
        *,
        progress: Progress | None = None,
        display: Display | None = None,
        stop: Callable[[], bool] | None = None,
        ask: Callable[[str], None] | None = None,
        log: str | Path | None = None,
        begun: Callable[[RunState], None] | None = None,
    ) -> None:
        check(list(prepared.findings))
        self.prepared, self.stage, self.progress, self.display, self.ask = prepared, stage, progress, display, ask
        self.stop = EmergencyStop() if stop is None else stop
        self._lost = EmergencyStop()  # pressed where the log takes no more
        self.begun = begun
        self.timing = timing_of(prepared)
        self.longest = round((prepared.plan.duration + 2.0 * AFTER_STOP) / self.timing.period)  # samples of a segment
        self.recorder = RunRecorder(prepared, self.timing.period * prepared.every, log)
        self.table = StepTable(self.timing.period)
        self.state = RunState(steps=self.table.steps)
        self.samples, self.finest = 0, self.timing.inner
        self.machine: Machine | None = None
        self.accounts: list[Accounts] = []
        self._lateness: list[np.ndarray] = []
        self._mounted: list[list[float]] = []  # from a time on [s], the span at which the encoder was zeroed [m]

    def loop(
        self, machine: SampledMachine, segment: RunSegment, software: BenchSoftware,
        tell: Callable[[Chunk], None] = lambda chunk: None, **more: Any,
    ) -> SampleLoop:  # fmt: skip
        """Build the loop of a segment on a machine, with the options of `SampleLoop`; `tell` is given every chunk."""
        assert self.machine is not None

        def note(chunk: Chunk) -> None:
            self._lateness.append(chunk.lateness)
            tell(chunk)

        return SampleLoop(
            machine, self.prepared.rig.converters(segment.start_span), software, outputs=self.machine.signals(),
            longest=self.longest, stop=lambda: self._lost() or self.stop(), tell=note, **more,
        )  # fmt: skip

    def play(self) -> Recording:
        """Play all segments, one after the other."""
        with self.recorder:
            for number, segment in enumerate(self.prepared.segments()):
                if segment.asked:
                    self._ask(segment.asked)
                self.stage.bring(segment)
                if number == 0 and self.begun is not None:
                    self.begun(self.state)
                self._play(number, segment)
                if self.state.result != "done":
                    break
            if self.state.result != "done" and not len(self.recorder.chunks):
                raise EmptyRunError(f"{self.state.message.rstrip('.')}; nothing had been recorded by then")
            record = self.recorder.recording()
            meta = self._metadata(record)
            self.recorder.close(self.state.result, self.state.message, meta)
        return record.with_meta(meta, result=self.state.result, message=self.state.message)

    def _metadata(self, record: Recording) -> dict[str, JsonValue]:
        assert self.machine is not None
        meta = run_metadata(
            self.prepared, self.machine, self.timing, inner=self.finest, closed=self.accounts, record=record
        )
        meta |= {"steps": self.state.steps, "events": self.state.events}
        encoder, hardware = self.prepared.rig.encoder, self.stage.hardware
        if encoder is not None:
            meta["encoder"] = {"resolution": float(encoder.resolution), "mounted": self._mounted}
        if self._lateness:
            meta["deadlines"] = Lateness.of(np.concatenate(self._lateness), self.timing.period)._asdict()
        if hardware is not None:
            meta["hardware"] = {} if hardware.statistics is None else hardware.statistics._asdict()
        return meta

    def _ask(self, text: str) -> None:
        if self.stage.hardware is not None and self.ask is None:
            raise InputError("ask", None, f"needs a person: the protocol asks the operator to {text}")
        if self.ask is not None:
            self.ask(text)
        self._event(f"{ASKED}{text}")

    def _event(self, text: str, **more: object) -> None:
        self.state.events.append({"time": self.state.time, "text": text, **more})
        self.recorder.remark(text, self.state.time)

    def _play(self, number: int, segment: RunSegment) -> None:
        self._mounted.append([self.state.time, segment.start_span])
        chunks = self.stage.play(self, number, segment, software_of(self.prepared, segment, self.timing))
        try:
            for chunk in self._samples(chunks, segment):
                if chunk.carry is not None and (self._lost() or self.stop()):
                    self._interrupted()
                    break
        except LineLostError as error:
            self.state.result, self.state.message = "stopped", str(error)
            self._event(self.state.message, code="lost_line")
        except ConvergenceError:
            contradiction = volume_contradiction(self.prepared.unit.law, segment.start_span)
            if contradiction is None:
                raise
            raise contradiction from None
        finally:
            chunks.close()
        self.table.end(self.state.time, "until" if self.state.result == "done" else "stop")

    def _samples(self, source: Iterator[Chunk], segment: RunSegment) -> Iterator[Chunk]:
        left = round(AFTER_STOP / self.timing.period)
        try:
            for chunk in source:
                results, count = chunk.results, chunk.size
                if not bool(results.sound.all()):
                    assert self.machine is not None
                    if parts := overloaded_parts(self.machine, results.outputs):
                        step = self.timing.period / self.finest
                        raise ConvergenceError(unsound_sentence(Soundness.BROKEN, 0.0, step, parts))
                    said = "A state became infinite or impossible with the fixed steps of a run in real time."
                    raise ConvergenceError(said)
                used = int(results.shown["running"].sum())
                # a machine that is computed in whole chunks goes on after its protocol; nothing there stops the run
                tripped = used < count and bool(results.shown["code"][used] > 0 or results.shown["missed"][used])
                stopped = self.state.result != "done" or tripped
                if stopped:
                    if self.state.result == "done":
                        self._stopped(results, used, segment)
                    after = min(count - used, left)
                    used, left = used + after, left - after
                over = left <= 0 if stopped else used < count
                self._keep(results, used, segment, stopped)
                yield chunk
                if over:
                    return
        except KeyboardInterrupt:
            if not self.samples:
                raise
            self._interrupted()

    def _interrupted(self) -> None:
        if self.state.result != "done":
            return
        if self._lost():
            self.state.result, self.state.message = "stopped", stop_sentence(self._lost, self.state.time)
            self._event(self.state.message, code="log")
            return
        total = self.prepared.plan.duration
        self.state.result = "interrupted"
        self.state.message = f"Interrupted after {self.state.time:.4g} s of at most {total:.4g} s."
        self._event("interrupted")

    def _keep(self, results: sampled.SampleResult, used: int, segment: RunSegment, stopped: bool) -> None:
        period, total = self.timing.period, self.prepared.plan.duration
        times = period * (self.samples + np.arange(used))
        arrays = channels_of(results, used)
        record = results.shown["record"][:used].astype(bool) | stopped
        on_the_clock = (self.samples + np.arange(used)) % self.prepared.every == 0
        self.recorder.take(times, arrays, record & on_the_clock)
        if self.recorder.failure and not self._lost():
            self._lost.press(self.recorder.failure)
        if used:
            self.table.add(times, results.shown["step"][:used].astype(int), segment.steps)
        self.samples += used
        self.state.time = period * self.samples
        if used and self.display is not None:
            self.display(times, arrays)
        if self.progress is not None:
            self.progress(min(self.state.time, total), total)

    def _stopped(self, results: sampled.SampleResult, at: int, segment: RunSegment) -> None:
        i = min(at, len(results.shown["code"]) - 1)
        when, code = self.state.time + i * self.timing.period, int(results.shown["code"][i])
        name = Trip(code).name.lower() if code else "missed"
        if code == Trip.EMERGENCY_STOP:
            stop = self._lost if self._lost() else self.stop
            name = "log" if stop is self._lost else "stop" if getattr(stop, "ordinary", False) else name
            self.state.message = stop_sentence(stop, when)
        elif code > 0:
            watch = self.prepared.rig.watch(segment.layout, tension=not self.prepared.accepted)
            measured = {n: float(v[i]) for n, v in results.measured.items() if not n.endswith(".code")}
            self.state.message = watch.reason(code, {**measured, "velocity": float(results.shown["velocity"][i])}, when)
        else:
            step = segment.steps[int(results.shown["step"][i])]
            test = "" if step.until is None else step.until.sentence()
            waited = step.count * self.timing.period
            failed = f"{test} did not come true within {waited:.4g} s"
            self.state.message = f"{step.sentence()}: {failed}; stopped and vented"
        self.state.result = "stopped"
        self.state.events.append({"time": when, "text": self.state.message, "code": name})
        self.recorder.remark(self.state.message, when)


def channels_of(results: sampled.SampleResult, used: int) -> dict[str, np.ndarray]:
    """Return the channels of a recording, (used,) each, from the results of a chunk."""
    arrays = {n: v[:used] for n, v in results.measured.items() if not n.endswith(".code")}
    arrays |= {n: v[:used] for n, v in results.shown.items() if n.startswith("command.")}
    arrays |= {channels.INPUTS[n]: v[:used] for n, v in results.commands.items()}
    for name, values in results.outputs.items():
        if not name.startswith(CONSTANT):
            arrays[channels.RENAMED.get(name, name)] = np.broadcast_to(values, results.rate_bound.shape)[:used]
    return arrays
