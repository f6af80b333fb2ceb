"""A protocol on a rig, simulated or real: parts between what a person does, samples in chunks, and one recording."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..assembly.accounts import Accounts
from ..errors import ConvergenceError, EmptyRunError, InputError, LineLostError
from ..experiments.dry_run import check
from ..experiments.protocol import Protocol
from ..recordings.recording import Recording
from ..specimens import Specimen
from . import channels
from .hardware.in_process import InProcess, SimulatedMachine
from .hardware.interface import Hardware
from .metadata import StepTable, run_metadata
from .prepare import OpenWire, PreparedRun, RunSegment, prepare, with_friction_scale
from .recorder import RunRecorder
from .rig import Rig
from .segment import AFTER_STOP, Chunk, SegmentMachine, simulated, software_of, timing_of
from .software.emergency_stop import EmergencyStop, sentence
from .software.interlocks import Trip
from .wall_clock import Lateness, Loop, clocked

Progress = Callable[[float, float], None]  # time done and longest time [s]
Display = Callable[[np.ndarray, Mapping[str, np.ndarray]], None]  # times and channels of a chunk

__all__ = ["PreparedRun", "EmergencyStop", "OpenWire", "prepare", "run"]


def run(
    what: PreparedRun | Protocol | str | os.PathLike[str],
    rig: Rig | str | os.PathLike[str] = "paper",
    *,
    muscle: str | Specimen | Any = None,
    progress: Progress | None = None,
    display: Display | None = None,
    stop: Callable[[], bool] | None = None,
    ask: Callable[[str], None] | None = None,
    real_time: bool = False,
    hardware: Hardware | None = None,
    log: str | Path | None = None,
    **options: Any,
) -> Recording:
    """Do a protocol on a rig; a keyboard interrupt ends the run and keeps what there is.

    Args:
        what: a protocol, the name of a shipped one, a ``.toml`` file, or what `prepare` made.
        rig: a rig, its name or file; of what was prepared already it is known.
        muscle: a specimen, its id or file, or a muscle; likewise.
        progress: told how far it is, with every chunk.
        display: shown every chunk.
        stop: asked at every sample by the wall clock, else once per chunk, whether to end the run. An `EmergencyStop`
            gives its reason; the machine vents at the next sample.
        ask: told what a person has to do on a real machine; returns when it is done.
        real_time: the simulated machine by the wall clock; the meta then tells of ``deadlines``.
        hardware: a machine at the hardware border instead. It gives the clock, and stays open.
        log: a new ``.mcap`` file which has every sample within a tenth of a second, whatever becomes of this program.
        **options: of `prepare`.

    Raises:
        InputError: what `prepare` cannot read, the first finding of the dry run, or a machine that does not fit the rig.
        ConvergenceError: if the physics failed; says why.
    """
    if isinstance(what, PreparedRun):
        bench = what
    elif muscle is None:
        raise InputError("muscle", "not given", "allowed is a specimen, its id or file, or a muscle")
    else:
        bench = prepare(what, muscle=muscle, rig=rig, **options)
    check(list(bench.findings))
    going = Run(bench, progress=progress, display=display, stop=stop, ask=ask, log=log)
    going.real_time, going.hardware = real_time, hardware
    return going.go()


def compile_run(bench: PreparedRun, wanted: Callable[[], bool] = lambda: True) -> None:
    """Compile what a run of the simulated machine by the wall clock needs, so that it begins at once.

    Args:
        bench: what is going to be run.
        wanted: asked before each part whether somebody still wants it.
    """
    timing = timing_of(bench)
    for number, part in enumerate(bench.segments()):
        if not wanted():
            return
        own = SegmentMachine(bench, number, part, timing)
        machine, software = own.at_border(), software_of(bench, part, timing)
        Loop(
            InProcess(machine), bench.rig.converters(part.start_span), software, outputs=own.machine.signals(),
            period=timing.period, longest=1, stop=lambda: False,
        )  # fmt: skip


class Run:
    """The state of one run while it goes on."""

    real_time = False
    hardware: Hardware | None = None
    simulated_by: Callable[[SimulatedMachine], Hardware] = InProcess  # how a simulated machine keeps its time

    def __init__(
        self, bench: PreparedRun, *, progress: Progress | None = None, display: Display | None = None,
        stop: Callable[[], bool] | None = None, ask: Callable[[str], None] | None = None, log: str | Path | None = None,
    ) -> None:  # fmt: skip
        self.bench, self.progress, self.display, self.ask = bench, progress, display, ask
        self.stop = EmergencyStop() if stop is None else stop
        self.timing = timing_of(bench)
        self.keeper = RunRecorder(bench, self.timing.period * bench.every, log)
        self.table = StepTable(self.timing.period)
        self.time, self.samples, self.finest = 0.0, 0, self.timing.inner
        self.result, self.message = "done", "The run reached its end."
        self.events: list[dict[str, Any]] = []
        self.closed: list[Accounts] = []
        self.lateness: list[np.ndarray] = []
        self.mounted: list[list[float]] = []  # from a time on [s], the span at which the encoder was zeroed [m]

    @property
    def steps(self) -> list[dict[str, Any]]:
        """Those that have begun: path, label, start and end [s], period [s]."""
        return self.table.steps

    def go(self) -> Recording:
        """All parts, one after the other."""
        with self.keeper:
            machine: Any = None
            for number, part in enumerate(self.bench.segments()):
                if part.asked:
                    self._asked(part.asked)
                machine = self._part(number, part)
                if self.result != "done":
                    break
            if self.result != "done" and not len(self.keeper.chunks):
                raise EmptyRunError(f"{self.message.rstrip('.')}; nothing had been recorded by then")
            record = self.keeper.recording()
            about = run_metadata(
                self.bench, machine, self.timing, inner=self.finest, closed=self.closed, record=record
            )  # fmt: skip
            about |= {"steps": self.steps, "events": self.events}
            encoder = self.bench.rig.encoder
            if encoder is not None:
                about["encoder"] = {"resolution": float(encoder.resolution), "mounted": self.mounted}
            if self.lateness:
                late = np.concatenate(self.lateness)
                about["deadlines"] = Lateness.of(late, self.timing.period)._asdict()
            if self.hardware is not None:
                about["hardware"] = _statistics(self.hardware)
            self.keeper.close(self.result, self.message, about)
        return record.with_meta(about, result=self.result, message=self.message)

    def _asked(self, asked: str) -> None:
        if self.hardware is not None and self.ask is None:
            raise InputError("ask", "nobody", f"the protocol wants a person to {asked}")
        if self.ask is not None:
            self.ask(asked)
        self._event(f"asked to {asked}")

    def _event(self, text: str, **more: Any) -> None:
        self.events.append({"time": self.time, "text": text, **more})
        self.keeper.remark(text, self.time)

    def _part(self, number: int, part: RunSegment) -> Any:
        software = software_of(self.bench, part, self.timing)
        self.mounted.append([self.time, part.start_span])
        most = round((self.bench.plan.duration + 2.0 * AFTER_STOP) / self.timing.period)
        if self.hardware is not None:
            unit = with_friction_scale(self.bench.unit, part.friction)
            nominal = self.bench.rig.machine(part.layout, unit, start=part.start_span, moves=part.moves)
            self._clocked(self.hardware, software, part, nominal, most)
            return nominal
        own = SegmentMachine(self.bench, number, part, self.timing, self.time)
        if self.real_time:
            at = own.at_border(ahead=most * self.timing.period)
            self._clocked(self.simulated_by(at), software, part, own.machine, most)
            self.closed.append(own.closed(at.carry()))
            return own.machine
        carry = own.carry(software)
        for chunk in self._samples(simulated(own.plant, software, carry, own.rows, self.timing), part):
            assert chunk.carry is not None
            carry = chunk.carry
            self.finest = max(self.finest, chunk.inner)
            if self.stop():
                self._interrupted()
                break
        self.table.end(self.time, "until" if self.result == "done" else "stop")
        self.closed.append(own.closed(carry))
        return own.machine

    def _clocked(self, hardware: Hardware, software: Any, part: RunSegment, machine: Any, most: int) -> None:
        converters = self.bench.rig.converters(part.start_span)
        loop = Loop(
            hardware, converters, software, outputs=machine.signals(), period=self.timing.period, longest=most,
            stop=self.stop,
        )  # fmt: skip
        chunks = clocked(loop)
        try:
            for _ in self._samples(chunks, part):
                pass
        except LineLostError as error:
            self.result, self.message = "stopped", str(error)
            self._event(self.message, code="lost_line")
        finally:
            chunks.close()
            self.lateness.append(loop.lateness[: loop.taken])
        self.table.end(self.time, "until" if self.result == "done" else "stop")

    def _samples(self, source: Iterator[Chunk], part: RunSegment) -> Iterator[Chunk]:
        """Keep what a source gives, until the part ends; each chunk is given on."""
        left = round(AFTER_STOP / self.timing.period)
        try:
            for chunk in source:
                seen, count = chunk.seen, chunk.size
                if not bool(seen.sound.all()):
                    raise ConvergenceError("A state is not finite, or not possible, with the steps of the wall clock.")
                used = int(seen.shown["running"].sum())
                stopped = bool((seen.shown["code"] > 0).any() or seen.shown["missed"].any())
                if stopped:
                    if self.result == "done":
                        self._stopped(seen, used, part)
                    after = min(count - used, left)
                    used, left = used + after, left - after
                over = left <= 0 if stopped else used < count
                self._keep(seen, used, part, stopped)
                yield chunk
                if over:
                    return
        except KeyboardInterrupt:
            if not self.samples:
                raise
            self._interrupted()

    def _interrupted(self) -> None:
        if self.result != "done":
            return
        total = self.bench.plan.duration
        self.result, self.message = "interrupted", f"Interrupted after {self.time:.4g} s of at most {total:.4g} s."
        self._event("interrupted")

    def _keep(self, seen: Any, used: int, part: RunSegment, stopped: bool) -> None:
        """Take the first samples of a chunk."""
        period, total = self.timing.period, self.bench.plan.duration
        times = period * (self.samples + np.arange(used))
        arrays = channels_of(seen, used)
        record = seen.shown["record"][:used].astype(bool) | stopped
        clocked_ = (self.samples + np.arange(used)) % self.bench.every == 0
        self.keeper.take(times, arrays, record & clocked_)
        if used:
            self.table.add(times, seen.shown["step"][:used].astype(int), part.steps)
        self.samples += used
        self.time = period * self.samples
        if used and self.display is not None:
            self.display(times, arrays)
        if self.progress is not None:
            self.progress(min(self.time, total), total)

    def _stopped(self, seen: Any, at: int, part: RunSegment) -> None:
        """Say what stopped the machine at a sample of a chunk."""
        i = min(at, len(seen.shown["code"]) - 1)
        when, code = self.time + i * self.timing.period, int(seen.shown["code"].max())
        name = Trip(code).name.lower() if code else "missed"
        if code == Trip.EMERGENCY_STOP:
            name = "stop" if getattr(self.stop, "ordinary", False) else name
            self.message = sentence(self.stop, when)
        elif code > 0:
            watch = self.bench.rig.watch(part.layout, tension=not self.bench.accepted)
            measured = {n: float(v[i]) for n, v in seen.measured.items() if not n.endswith(".code")}
            self.message = watch.reason(code, {**measured, "velocity": float(seen.shown["velocity"][i])}, when)
        else:
            step = part.steps[int(seen.shown["step"][i])]
            test = "" if step.until is None else step.until.sentence()
            waited = step.count * self.timing.period
            self.message = f"{step.sentence()}: {test} did not come true within {waited:.4g} s; stopped and vented"
        self.result = "stopped"
        self.events.append({"time": when, "text": self.message, "code": name})
        self.keeper.remark(self.message, when)


def _statistics(hardware: Hardware) -> dict[str, Any]:
    """What a machine counted of its line, where it does."""
    found = getattr(hardware, "statistics", None)
    return {} if found is None else dict(found._asdict())


def channels_of(seen: Any, used: int) -> dict[str, np.ndarray]:
    """The channels of a recording from what was seen of a chunk."""
    found = {n: v[:used] for n, v in seen.measured.items() if not n.endswith(".code")}
    found |= {n: v[:used] for n, v in seen.shown.items() if n.startswith("command.")}
    found |= {channels.INPUTS[n]: v[:used] for n, v in seen.commands.items()}
    for name, values in seen.outputs.items():
        if not name.startswith(channels.CONSTANT):
            found[channels.RENAMED.get(name, name)] = np.broadcast_to(values, seen.steepest.shape)[:used]
    return found
