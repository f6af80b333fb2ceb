"""A protocol on a simulated rig: parts between what a person does, samples in chunks, and one recording."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..assembly.accounts import Accounts, accounts
from ..assembly.machine import Machine
from ..assembly.muscle_unit import MuscleUnit
from ..engine import sampled
from ..errors import InputError
from ..experiments.dry_run import check
from ..experiments.protocol import Protocol
from ..recordings.recording import Recording
from ..specimens import Specimen
from . import channels
from .about import StepTable, describe
from .hardware.plant import Rigged
from .prepare import Bench, Fault, Part, prepare
from .rig import Rig
from .software.interlocks import Trip
from .software.loop import BenchSoftware
from .software.sequencer import Sequencer
from .software.storage import Chunks
from .software.timing import configure
from .source import AFTER_STOP, CHUNK, Lateness, Source, WallClock, simulated

Progress = Callable[[float, float], None]  # time done and longest time [s]
Display = Callable[[np.ndarray, Mapping[str, np.ndarray]], None]  # times and channels of a chunk

__all__ = ["Bench", "Fault", "prepare", "run"]


def run(
    what: Bench | Protocol | str | os.PathLike[str],
    rig: Rig | str | os.PathLike[str] = "paper",
    *,
    muscle: str | Specimen | MuscleUnit | None = None,
    progress: Progress | None = None,
    display: Display | None = None,
    stop: Callable[[], bool] | None = None,
    real_time: bool = False,
    **options: Any,
) -> Recording:
    """Do a protocol on a simulated rig; a keyboard interrupt ends the run and keeps what there is.

    Args:
        what: a protocol, the name of a shipped one, a ``.toml`` file, or what `prepare` made.
        rig: a rig, its name or file; of what was prepared already it is known.
        muscle: a specimen, its id or file, or a muscle; likewise.
        progress: told how far it is, once per chunk.
        display: shown every chunk.
        stop: asked once per chunk whether to end the run.
        real_time: by the wall clock; display and progress then come after each part, and the meta tells of ``deadlines``.
        **options: of `prepare`.

    Raises:
        InputError: what `prepare` cannot read, or the first finding of the dry run.
        ConvergenceError: if the physics failed; says why.
    """
    if isinstance(what, Bench):
        bench = what
    elif muscle is None:
        raise InputError("muscle", "not given", "allowed is a specimen, its id or file, or a muscle")
    else:
        bench = prepare(what, muscle=muscle, rig=rig, **options)
    check(list(bench.findings))
    clock = WallClock(bench.plan.duration) if real_time else None
    going = _Run(bench, progress, display, stop, clock or simulated)
    if clock is None:
        return going.go()
    clock.stop = stop
    record = going.go()
    kept = Lateness.of(clock.lateness, going.timing.period)
    return record.with_meta(deadlines=kept._asdict())


class _Run:
    """The state of one run while it goes on."""

    def __init__(
        self,
        bench: Bench,
        progress: Progress | None = None,
        display: Display | None = None,
        stop: Callable[[], bool] | None = None,
        source: Source = simulated,
    ) -> None:
        self.source = source
        self.bench, self.progress, self.display, self.asked_to_stop = bench, progress, display, stop
        rig = bench.rig
        commanded = [e for p in rig.plumbing.values() for e in (p.valve, p.shut_off) if e is not None]
        delays = [float(e.delay() or 0.0) for e in commanded]
        self.timing = configure(rig.computer, bench.plan.sample_rate, dead_time=max(delays), step=bench.step)
        self.chunks = Chunks(self.timing.period * bench.every, {})
        self.table = StepTable(self.timing.period)
        self.time, self.samples, self.finest = 0.0, 0, self.timing.inner
        self.result, self.message = "done", "The run reached its end."
        self.events: list[dict[str, Any]] = []
        self.closed: list[Accounts] = []

    def go(self) -> Recording:
        """All parts, one after the other."""
        for number, part in enumerate(self.bench.parts()):
            if part.asked:
                self.events.append({"time": self.time, "text": f"asked to {part.asked}"})
            machine = self._part(number, part)
            if self.result != "done":
                break
        record = self.chunks.recording()
        about = describe(self.bench, machine, self.timing, inner=self.finest, closed=self.closed, record=record)
        return record.with_meta(
            about, steps=self.table.steps, events=self.events, result=self.result, message=self.message
        )

    def _part(self, number: int, part: Part) -> Machine:
        rig, timing = self.bench.rig, self.timing
        unit = _rubbed(self.bench.unit, part.friction)
        machine = rig.machine(part.layout, unit, start=part.start_span, moves=part.moves)
        plant = rig.plant(machine, part.layout, mounted=part.start_span)
        software = self._software(part)
        commands = {"valve": part.start_pressure, "motor": 0.0, "open": 1.0}
        start = plant.at_rest(commands, dict.fromkeys(machine.circuit.chambers, part.start_pressure))
        rows = _Rows(self.bench, number, self.time)
        carry = sampled.begin(plant, software, start, commands, rows.first(), timing.depth)
        first = sampled.inputs_of(plant, carry, timing.latency, timing.period)
        carry = self._samples(plant, software, carry, rows, part)
        last = sampled.inputs_of(plant, carry, timing.latency, timing.period)
        ended: Any = _Ended(carry.state["machine"], carry.memory, carry.integrals)
        self.closed.append(accounts(machine, (start[0]["machine"], start[1]), ended, first, last))
        return machine

    def _software(self, part: Part) -> BenchSoftware:
        rig = self.bench.rig
        begins = part.start_span if part.steps[0].mode == "span" else 0.0
        return BenchSoftware(
            sequencer=Sequencer.of(part.steps, rest_length=self.bench.plan.rest_length, period=self.timing.period),
            motion=rig.motion, pressure=rig.pressure, position=rig.position, force=rig.force,
            interlocks=rig.watch(part.layout, tension=not self.bench.accepted),
            start_pressure=jnp.asarray(part.start_pressure), start_motor=jnp.asarray(float(begins)),
            has_motor=part.moves,
        )  # fmt: skip

    def _samples(self, plant: Rigged, software: BenchSoftware, carry: Any, rows: _Rows, part: Part) -> Any:
        left = round(AFTER_STOP / self.timing.period)
        over = False
        try:
            for latest, seen, inner in self.source(plant, software, carry, rows, self.timing):
                carry = latest
                self.finest = max(self.finest, inner)
                used = int(seen.shown["running"].sum())
                stopped = bool((seen.shown["code"] > 0).any() or seen.shown["missed"].any())
                if stopped:
                    if self.result == "done":
                        self._stopped(seen, used, part)
                    after = min(CHUNK - used, left)
                    used, left = used + after, left - after
                    over = left <= 0
                else:
                    over = used < CHUNK
                self._keep(seen, used, part, stopped)
                if over:
                    break
                if self.asked_to_stop is not None and self.asked_to_stop():
                    raise KeyboardInterrupt
        except KeyboardInterrupt:
            if not len(self.chunks):
                raise
            self.result = "interrupted"
            total = self.bench.plan.duration
            self.message = f"Interrupted after {self.time:.4g} s of at most {total:.4g} s."
            self.events.append({"time": self.time, "text": "interrupted"})
        self.table.end(self.time, "until" if self.result == "done" else "stop")
        return carry

    def _keep(self, seen: Any, used: int, part: Part, stopped: bool) -> None:
        """Take the first samples of a chunk."""
        period, total = self.timing.period, self.bench.plan.duration
        times = period * (self.samples + np.arange(used))
        arrays = _channels(seen, used)
        self.chunks.kinds.update(channels.kinds(arrays))
        record = seen.shown["record"][:used].astype(bool) | stopped
        clocked = (self.samples + np.arange(used)) % self.bench.every == 0
        if used:
            self.chunks.add(times, arrays, record & clocked)
            self.table.add(times, seen.shown["step"][:used].astype(int), part.steps)
        self.samples += used
        self.time = period * self.samples
        if used and self.display is not None:
            self.display(times, arrays)
        if self.progress is not None:
            self.progress(min(self.time, total), total)

    def _stopped(self, seen: Any, at: int, part: Part) -> None:
        """Say what stopped the machine at a sample of a chunk."""
        i = min(at, CHUNK - 1)
        when, code = self.time + i * self.timing.period, int(seen.shown["code"].max())
        if code > 0:
            watch = self.bench.rig.watch(part.layout, tension=not self.bench.accepted)
            measured = {n: float(v[i]) for n, v in seen.measured.items() if not n.endswith(".code")}
            self.message = watch.reason(code, {**measured, "velocity": float(seen.shown["velocity"][i])}, when)
        else:
            step = part.steps[int(seen.shown["step"][i])]
            test = "" if step.until is None else step.until.sentence()
            waited = step.count * self.timing.period
            self.message = f"{step.sentence()}: {test} did not come true within {waited:.4g} s; stopped and vented"
        self.result = "stopped"
        self.events.append({"time": when, "text": self.message, "code": Trip(code).name.lower() if code else "missed"})


class _Ended(NamedTuple):
    """What the accounts need of a run."""

    state: Any
    memory: Any
    integrals: Any


class _Rows:
    """What every sample brings from outside: draws of the noise, and wires that are open."""

    def __init__(self, bench: Bench, part: int, begin: float = 0.0) -> None:
        # a generator for each part, so that the parts do not depend on each other's length
        self.chance = np.random.default_rng([bench.seed, part])
        self.period = 1.0 / bench.plan.sample_rate
        self.names = list(bench.rig.sensors)
        self.lost = [*self.names, "span"]
        self.opened = {f.channel: f.at for f in bench.faults}
        self.begin, self.count = begin, 0

    def first(self) -> dict[str, Any]:
        """Of a sample without noise."""
        zero = jnp.zeros(())
        return {"draws": dict.fromkeys(self.names, zero), "lost": dict.fromkeys(self.lost, zero)}

    def next(self) -> dict[str, Any]:
        """Of the next chunk."""
        draws = self.chance.standard_normal((len(self.names), CHUNK))
        times = self.begin + self.period * (self.count + np.arange(CHUNK))
        self.count += CHUNK
        return {
            "draws": dict(zip(self.names, draws, strict=True)),
            "lost": {n: np.where(times >= self.opened.get(n, np.inf), 1.0, 0.0) for n in self.lost},
        }


def _channels(seen: Any, used: int) -> dict[str, np.ndarray]:
    """The channels of a recording from what was seen of a chunk."""
    found = {n: v[:used] for n, v in seen.measured.items() if not n.endswith(".code")}
    found |= {n: v[:used] for n, v in seen.shown.items() if n.startswith("command.")}
    found |= {channels.INPUTS[n]: v[:used] for n, v in seen.commands.items()}
    for name, values in seen.outputs.items():
        if not name.startswith(channels.CONSTANT):
            found[channels.RENAMED.get(name, name)] = np.broadcast_to(values, seen.steepest.shape)[:used]
    return found


def _rubbed(unit: MuscleUnit, factor: float) -> MuscleUnit:
    """The muscle with its friction times a factor."""
    if factor == 1.0:
        return unit
    if unit.friction is None:
        raise InputError("friction", factor, "the muscle has none that a lubricant could change")
    rubbed: MuscleUnit = unit.replace(friction=unit.friction.lubricated(factor))
    return rubbed
