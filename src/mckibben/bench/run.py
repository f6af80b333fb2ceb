"""A protocol on a simulated rig: dry run, parts between what a person does, samples in chunks, and one recording."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..analysis.saturation import saturation
from ..assembly.accounts import Accounts, accounts
from ..assembly.build import unit_from_specimen
from ..assembly.machine import Machine
from ..assembly.muscle_unit import MuscleUnit
from ..engine import STEP, sampled
from ..engine.signals import Value
from ..errors import InputError
from ..experiments.dry_run import Finding, check_plan
from ..experiments.library import shipped
from ..experiments.plan import Plan, PlannedStep
from ..experiments.protocol import Protocol
from ..experiments.read import read_protocol
from ..experiments.sentence import case_words
from ..recordings.recording import Recording
from ..specimens import Specimen, specimen
from . import channels
from .hardware.pneumatics import MUSCLE
from .provenance import created, resolved, versions
from .rig import Hand, Rig
from .rig_file import rig as rig_of
from .software.interlocks import Trip
from .software.loop import BenchSoftware
from .software.sequencer import Sequencer
from .software.storage import Chunks
from .software.timing import Timing, configure

CHUNK = 500  # samples between two looks at the display, at the rates, and at whether somebody interrupts
AFTER_STOP = 0.5  # time for which a stopped machine is recorded further, so that it is seen to vent [s]

Progress = Callable[[float, float], None]  # time done and longest time [s]
Display = Callable[[np.ndarray, Mapping[str, np.ndarray]], None]  # times and channels of a chunk


@dataclass(frozen=True)
class Fault:
    """A wire that opens: `channel` is pressure, valve_pressure, tension or span, `at` a time of the run [s]."""

    channel: str
    at: float


class Part(NamedTuple):
    """Steps of a plan between two things that a person does, on one machine."""

    steps: tuple[PlannedStep, ...]
    layout: str
    friction: float
    asked: str


@dataclass
class Bench:
    """One run of a protocol on a simulated rig, ready to start: what will be done, and what speaks against it.

    Attributes:
        protocol: what to do.
        rig: where.
        unit: the muscle.
        plan: the protocol on the sample clock.
        layout: name of the plumbing at the start.
        findings: all that speaks against it.
        accepted: findings of the cell's range that were accepted: the recording then tells of saturation.
    """

    protocol: Protocol
    rig: Rig
    unit: MuscleUnit
    plan: Plan
    layout: str
    specimen: Specimen | None = None
    step: float = STEP
    seed: int = 0
    faults: tuple[Fault, ...] = ()
    findings: tuple[Finding, ...] = ()
    accepted: tuple[Finding, ...] = ()
    changes: Mapping[str, Any] = field(default_factory=dict)


def prepare(
    protocol: Protocol | str | os.PathLike[str],
    *,
    muscle: str | Specimen | MuscleUnit,
    rig: Rig | str | os.PathLike[str] = "paper",
    plumbing: str | None = None,
    step: float = STEP,
    seed: int = 0,
    accept_saturation: bool = False,
    faults: Sequence[Fault] = (),
) -> Bench:
    """Everything before anything moves, the dry run included.

    Args:
        protocol: a protocol, the name of a shipped one, or the path of a ``.toml`` file.
        muscle: a specimen, its id or file, or a muscle built already.
        rig: a rig, its name or file.
        plumbing: name of the way in which the pneumatic parts are joined; chosen by what the protocol needs if left out.
        step: largest step of the physics [s].
        seed: of the sensors' noise.
        accept_saturation: go on where only the cell's range would be exceeded.
        faults: wires that open during the run.

    Raises:
        InputError: names what is unknown, or cannot be read.
    """
    wanted = _protocol(protocol)
    on = rig if isinstance(rig, Rig) else rig_of(rig)
    spec = None if isinstance(muscle, MuscleUnit) else muscle if isinstance(muscle, Specimen) else specimen(muscle)
    unit = muscle if isinstance(muscle, MuscleUnit) else unit_from_specimen(_known(spec))
    layout = on.layout(wanted, plumbing)
    rest = float(unit.law.rest_length if hasattr(unit.law, "rest_length") else unit.law.thread_length)
    plan = wanted.expand(rest_length=rest)
    limits = on.limits(layout)
    found = check_plan(plan, limits, lambda span, pressure: np.asarray(unit.law.tension(span, pressure)))
    for fault in faults:
        if fault.channel not in on.sensors and not (fault.channel == "span" and on.encoder is not None):
            known = [*on.sensors, *(["span"] if on.encoder is not None else [])]
            raise InputError("fault", fault.channel, f"the rig has sensors of {', '.join(known)}")
    spared = [f for f in found if accept_saturation and f.field == "tension" and "load cell" in f.allowed]
    return Bench(
        wanted, on, unit, plan, layout, spec, step, seed, tuple(faults),
        tuple(f for f in found if f not in spared), tuple(spared),
    )  # fmt: skip


def run(
    bench: Bench,
    *,
    progress: Progress | None = None,
    display: Display | None = None,
    stop: Callable[[], bool] | None = None,
) -> Recording:
    """Do what was prepared. A keyboard interrupt vents nothing in a simulation: it ends the run and keeps what there is.

    Args:
        bench: of `prepare`.
        progress: told how far it is, once per chunk.
        display: shown every chunk.
        stop: asked once per chunk whether to stop.

    Raises:
        InputError: the first finding of the dry run, if there is one.
        ConvergenceError: if the physics failed; says why.
    """
    _refuse(bench.findings)
    return _Run(bench, progress, display, stop).go()


class _Run:
    """The state of one run while it goes on."""

    def __init__(
        self, bench: Bench, progress: Progress | None, display: Display | None, stop: Callable[[], bool] | None
    ) -> None:
        self.bench, self.progress, self.display, self.asked_to_stop = bench, progress, display, stop
        rig, plan = bench.rig, bench.plan
        delays = [float(p.valve.delay() or 0.0) for p in rig.plumbing.values()]
        delays += [float(p.shut_off.delay() or 0.0) for p in rig.plumbing.values() if p.shut_off is not None]
        self.timing: Timing = configure(rig.computer, plan.sample_rate, dead_time=max(delays), step=bench.step)
        self.chunks: Chunks | None = None
        self.time = 0.0
        self.finest = self.timing.inner
        self.result, self.message = "done", "The run reached its end."
        self.steps: list[dict[str, Any]] = []
        self.events: list[dict[str, Any]] = []
        self.closed: list[Accounts] = []
        self.machine: Machine | None = None

    def go(self) -> Recording:
        for number, part in enumerate(_parts(self.bench)):
            if part.asked:
                self.events.append({"time": self.time, "text": f"asked to {part.asked}"})
            self._part(number, part)
            if self.result != "done":
                break
        assert self.chunks is not None
        return self.chunks.recording(self._meta())

    def _part(self, number: int, part: Part) -> None:
        bench, timing = self.bench, self.timing
        rig, first = bench.rig, part.steps[0]
        begin = _first_span(part.steps)
        moves = _moves(part.steps)
        machine = self.machine = rig.machine(part.layout, _rubbed(bench.unit, part.friction), start=begin, moves=moves)
        plant = rig.plant(machine, part.layout, mounted=begin)
        software = BenchSoftware(
            sequencer=Sequencer.of(part.steps, rest_length=bench.plan.rest_length, period=timing.period),
            motion=rig.motion, pressure=rig.pressure, position=rig.position, force=rig.force,
            interlocks=rig.watch(part.layout, tension=not bench.accepted),
            start_pressure=jnp.asarray(_start_pressure(first)), start_motor=jnp.asarray(begin if first.mode == "span" else 0.0),
            has_motor=moves,
        )  # fmt: skip
        commands = {"valve": _start_pressure(first), "motor": 0.0, "open": 1.0}
        now = {n: Value(jnp.asarray(float(v)), jnp.zeros(())) for n, v in plant.convert(commands).items()}
        room = float(rig.environment.pressure_abs)
        pressures = {n: room + commands["valve"] for n in machine.circuit.chambers}
        late = plant.commands({n: sampled.Signal(jnp.full((2,), v.value)) for n, v in now.items()})
        start = plant.initial(pressures, {n: Value(s.values[0], jnp.zeros(())) for n, s in late.items()})
        rows = _Rows(bench, number)
        carry = sampled.begin(plant, software, start, commands, rows.first(), timing.depth)
        opened = sampled.inputs_of(plant, carry, timing.latency, timing.period)
        carry = self._samples(plant, software, carry, rows, part)
        closing = sampled.inputs_of(plant, carry, timing.latency, timing.period)
        self.closed.append(_accounts(machine, start, carry, opened, closing))

    def _samples(self, plant: Any, software: Any, carry: Any, rows: _Rows, part: Part) -> Any:
        begun, following = self.time, None
        total = self.bench.plan.duration
        left = round(AFTER_STOP / self.timing.period)
        try:
            while left > 0:
                carry, seen, inner = sampled.advance(
                    plant, software, carry, rows.next(self.time), period=self.timing.period, inner=self.timing.inner,
                    latency=self.timing.latency,
                )  # fmt: skip
                self.finest = max(self.finest, inner)
                running = seen.shown["running"].astype(bool)
                used = int(running.sum())
                stopped = bool((seen.shown["code"] > 0).any() or seen.shown["missed"].any())
                if used < CHUNK:  # the protocol is over, or something stopped it
                    if stopped and following is None:
                        self._stopped(seen, used, part)
                        following = left
                    used, left = (min(CHUNK, used + left), left - (CHUNK - used)) if stopped else (used, 0)
                times = self.time + self.timing.period * np.arange(used)
                self._keep(times, seen, used, part, stopped)
                self.time += self.timing.period * used
                if self.progress is not None:
                    self.progress(min(self.time, total), total)
                if self.asked_to_stop is not None and self.asked_to_stop():
                    raise KeyboardInterrupt
        except KeyboardInterrupt:
            if self.chunks is None or not len(self.chunks):
                raise
            self.result = "interrupted"
            self.message = f"Interrupted after {self.time:.4g} s of at most {total:.4g} s."
            self.events.append({"time": self.time, "text": "interrupted"})
        if self.steps and self.time > begun:
            self.steps[-1]["end"] = self.time
        return carry

    def _keep(self, times: np.ndarray, seen: Any, used: int, part: Part, stopped: bool) -> None:
        if not used:
            return
        arrays = _channels(seen, used)
        if self.chunks is None:
            self.chunks = Chunks(self.timing.period, {})
        names = [n for n in seen.outputs if not n.startswith(tuple(f"{c}." for c in channels.CONSTANT))]
        self.chunks.kinds.update(channels.kinds(channels.RENAMED.get(n, n) for n in names))
        index = seen.shown["step"][:used].astype(int)
        keep = seen.shown["record"][:used].astype(bool)
        self.chunks.add(times, arrays, keep | stopped)
        self._note(times, index, part)
        if self.display is not None:
            self.display(times, arrays)

    def _note(self, times: np.ndarray, index: np.ndarray, part: Part) -> None:
        """The table of steps: where each began and ended."""
        for j in np.unique(index):
            step, begins = part.steps[int(j)], float(times[np.argmax(index == j)])
            if self.steps and self.steps[-1]["index"] == step.index:
                continue
            if self.steps:
                self.steps[-1]["end"] = begins
                _ended(self.steps[-1], self.timing.period)
            self.steps.append(
                {
                    "index": step.index, "path": step.path, "label": step.step.label,
                    "case": {k: _words(v) for k, v in step.case.items()}, "start": begins, "end": begins,
                    "longest": step.count * self.timing.period, "ended_by": "time", "recorded": step.record,
                    "sentence": step.step.sentence(),
                }
            )  # fmt: skip

    def _stopped(self, seen: Any, at: int, part: Part) -> None:
        i = min(at, CHUNK - 1)
        when = self.time + i * self.timing.period
        code = int(seen.shown["code"].max())
        measured = {n: float(v[i]) for n, v in seen.measured.items() if not n.endswith(".code")}
        if code > 0:
            watch = self.bench.rig.watch(part.layout, tension=not self.bench.accepted)
            self.message = watch.reason(code, {**measured, "velocity": float(seen.shown["velocity"][i])}, when)
        else:
            step = part.steps[int(seen.shown["step"][i])]
            assert step.until is not None
            self.message = (
                f"{step.sentence()}: {step.until.sentence()} did not come true within "
                f"{step.count * self.timing.period:.4g} s; stopped and vented"
            )
        self.result = "stopped"
        self.events.append({"time": when, "text": self.message, "code": Trip(code).name.lower() if code else "missed"})

    def _meta(self) -> dict[str, Any]:
        bench, rig = self.bench, self.bench.rig
        if self.steps:
            _ended(self.steps[-1], self.timing.period, last=self.result != "done")
        worst = {
            k: max(float(getattr(a, k)) for a in self.closed) for k in ("mass", "gas", "muscle", "mechanics", "energy")
        }
        spec = bench.specimen
        found = {
            "title": bench.protocol.title, "sentence": bench.protocol.sentence(), "protocol": bench.protocol.document(),
            "digest": bench.protocol.digest, "rig": rig.name, "rig_document": dict(rig.document),
            "plumbing": bench.layout, "specimen": None if spec is None else spec.id,
            "rest_length": bench.plan.rest_length,
            "parameters": resolved(self.machine), "inferred": [*rig.inferred, *(spec.inferred() if spec else [])],
            "environment": {
                "pressure_abs": float(rig.environment.pressure_abs), "temperature": float(rig.environment.temperature),
            },
            "steps": self.steps, "events": self.events, "balance": worst,
            "friction": {
                "work": sum(a.friction for a in self.closed), "dissipated": sum(a.dissipated for a in self.closed),
            },
            "converters": {
                n: {"low": float(s.converter.low), "high": float(s.converter.top), "bits": s.converter.bits}
                for n, s in rig.sensors.items()
            },
            "timing": {
                "sample_rate": self.timing.sample_rate, "latency": self.timing.latency,
                "step": self.timing.period / self.finest,
            },
            "seed": bench.seed, "result": self.result, "message": self.message,
            "warnings": [f.sentence for f in bench.accepted], "versions": versions(),
            "citations": list(dict.fromkeys([*bench.unit.law.cites, *(spec.sources if spec else ()), "chou1996"])),
            "created": created(),
        }  # fmt: skip
        assert self.chunks is not None
        found["saturation"] = _saturation(self.chunks.recording(), found["converters"])
        return found


class _Rows:
    """What every sample brings from outside: draws of the noise, and wires that are open."""

    def __init__(self, bench: Bench, part: int) -> None:
        self.bench, self.chance = bench, bench.rig.noise(bench.seed, part)
        self.names = list(bench.rig.sensors)
        self.lost = [*self.names, "span"]

    def first(self) -> dict[str, Any]:
        zero = jnp.zeros(())
        return {"draws": dict.fromkeys(self.names, zero), "lost": dict.fromkeys(self.lost, zero)}

    def next(self, time: float) -> dict[str, Any]:
        draws = self.chance.standard_normal((len(self.names), CHUNK))
        times = time + np.arange(CHUNK) / self.bench.plan.sample_rate
        opened = {f.channel: f.at for f in self.bench.faults}
        return {
            "draws": dict(zip(self.names, draws, strict=True)),
            "lost": {n: np.where(times >= opened.get(n, np.inf), 1.0, 0.0) for n in self.lost},
        }


def _channels(seen: Any, used: int) -> dict[str, np.ndarray]:
    found = {n: v[:used] for n, v in seen.measured.items() if not n.endswith(".code")}
    found |= {n: v[:used] for n, v in seen.shown.items() if n.startswith("command.")}
    found |= {channels.INPUTS[n]: v[:used] for n, v in seen.commands.items()}
    for name, values in seen.outputs.items():
        if not name.startswith(tuple(f"{c}." for c in channels.CONSTANT)):
            found[channels.RENAMED.get(name, name)] = values[:used]
    return found


def _parts(bench: Bench) -> Iterator[Part]:
    """The plan, divided where a person is asked to do something."""
    steps: list[PlannedStep] = []
    hand, layout, friction, asked = Hand(""), bench.layout, 1.0, ""
    for step in bench.plan.steps:
        if step.step.ask:
            if steps:
                yield Part(tuple(steps), layout, friction, asked)
                steps = []
            asked = step.step.ask
            hand = bench.rig.hand(asked)
            layout, friction = hand.plumbing or layout, hand.friction
        steps.append(step)
    if steps:
        yield Part(tuple(steps), layout, friction, asked)


def _moves(steps: Sequence[PlannedStep]) -> bool:
    """Whether the motor is used: else the end is fixed to a plate, as in isometric experiments."""
    if any(s.mode != "span" or not isinstance(s.motor, np.ndarray) for s in steps):
        return True
    spans = [s.motor for s in steps if isinstance(s.motor, np.ndarray)]
    return float(max(s.max() for s in spans)) > float(min(s.min() for s in spans))


def _first_span(steps: Sequence[PlannedStep]) -> float:
    first = steps[0]
    if first.mode == "span" and isinstance(first.motor, np.ndarray):
        return float(first.motor[0]) if not _moves(steps) else float(first.motor_before.low)
    return first.span.low if np.isfinite(first.span.low) else float(first.motor_before.low)


def _start_pressure(step: PlannedStep) -> float:
    return float(step.pressure_before.low) if step.pressure_before.known else 0.0


def _rubbed(unit: MuscleUnit, factor: float) -> MuscleUnit:
    """The muscle with its friction times a factor."""
    if factor == 1.0 or unit.friction is None:
        return unit
    rubbed: MuscleUnit = unit.replace(friction=unit.friction.lubricated(factor))
    return rubbed


def _accounts(machine: Machine, start: Any, carry: Any, first: Any, last: Any) -> Accounts:
    class Ended(NamedTuple):
        state: Any
        memory: Any
        integrals: Any

    ended: Any = Ended(carry.state["machine"], carry.memory, carry.integrals)
    return accounts(machine, (start[0]["machine"], start[1]), ended, first, last)


def _saturation(record: Recording, converters: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Of every measured channel that reached the end of its converter: share, longest stay, sentence."""
    found = {}
    for name, ends in converters.items():
        if name not in record or not np.isfinite(record[name]).all():
            continue
        # at the lower end of a range that begins at nothing, nothing is what is measured
        low = ends["low"] if ends["low"] < 0.0 else None
        one = saturation(record, name, ends=(low, ends["high"]))
        if one:
            found[name] = {"share": one.share, "longest": one.longest, "sentence": one.sentence}
    return found


def _ended(step: dict[str, Any], period: float, last: bool = False) -> None:
    longest = step.pop("longest", None)
    if longest is not None and step["end"] - step["start"] < longest - 0.5 * period:
        step["ended_by"] = "stop" if last else "until"


def _words(value: Any) -> str:
    return value if isinstance(value, str) else str(value)


def _protocol(wanted: Protocol | str | os.PathLike[str]) -> Protocol:
    if isinstance(wanted, Protocol):
        return wanted
    text = os.fspath(wanted)
    return read_protocol(text) if text.lower().endswith(".toml") or os.sep in text else shipped(text)


def _known(spec: Specimen | None) -> Specimen:
    assert spec is not None
    return spec


def _refuse(findings: Sequence[Finding]) -> None:
    from ..experiments.dry_run import check

    check(list(findings))


__all__ = ["MUSCLE", "Bench", "Fault", "case_words", "prepare", "run"]
