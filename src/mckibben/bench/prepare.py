"""Preparation of a run before anything moves: protocol, rig and muscle, the dry run, and the segments of the run."""

from __future__ import annotations

import dataclasses
import datetime
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..answers import Caution, brief, collect
from ..assembly.build import rig_unit, with_parameters
from ..assembly.muscle_unit import MuscleUnit
from ..documents import JsonValue
from ..engine import STEP
from ..errors import InputError
from ..experiments import read
from ..experiments.dry_run import Estimate, Finding, check_plan
from ..experiments.protocol import PlannedStep, Protocol, ProtocolPlan
from ..muscles import Muscle
from ..muscles.build import rest_length_of
from ..muscles.evidence import law_cautions
from ..muscles.plausible import (
    measured_length_caution,
    parameter_cautions,
    pressure_caution,
    room_caution,
    span_cautions,
)
from ..quantities import in_si, whole_number, with_unit
from ..recordings.memory import INTEGRATED, check_memory
from ..specimens import Specimen, muscle_specimen
from .rig import Rig
from .rig_file import rig as rig_of
from .rig_file import with_control

T = TypeVar("T")
ON_THE_CELL = "the load cell reads"  # how a finding about the cell's range begins


@dataclass(frozen=True)
class OpenWire:
    """A sensor wire that opens at a time `at` of the run [s]; `channel` is pressure, valve_pressure, tension or span."""

    channel: str
    at: float


class RunSegment(NamedTuple):
    """Steps of a plan between two operator actions, on one machine."""

    steps: tuple[PlannedStep, ...]  # in their order
    layout: str  # name of the plumbing
    friction: float  # over that of the untreated muscle
    asked: str  # action of the operator before the segment
    motor_held: bool = False  # the muscle hangs at the motor, which holds it where another machine has a plate

    def __repr__(self) -> str:
        return brief(self)

    @property
    def moves(self) -> bool:
        """Whether the motor is used: else the end is fixed to a plate, as in isometric experiments."""
        if self.motor_held:
            return True
        spans = [s.motor for s in self.steps if s.mode == "span" and isinstance(s.motor, np.ndarray)]
        if len(spans) < len(self.steps):
            return True
        return float(max(s.max() for s in spans)) > float(min(s.min() for s in spans))

    @property
    def start_span(self) -> float:
        """Span at the start of the segment [m]."""
        first = self.steps[0]
        if not self.moves and isinstance(first.motor, np.ndarray):
            return float(first.motor[0])
        return first.motor_before.low if first.mode == "span" and first.motor_before.known else first.span.low

    @property
    def start_pressure(self) -> float:
        """Gauge pressure at the start of the segment [Pa]; zero if it is not known in advance."""
        before = self.steps[0].pressure_before
        return float(before.low) if before.known else 0.0


MOST_STEPS = 100_000  # of the physics between two samples; more are a slip of units, and take forever


@dataclass(frozen=True)
class PreparedRun:
    """A protocol on a rig with a muscle, planned and checked, ready to start.

    Attributes:
        protocol: the protocol.
        rig: where.
        unit: the muscle.
        plan: the protocol on the clock of the loop.
        layout: name of the plumbing at the start.
        specimen: that the muscle was built from.
        every: samples of the loop per sample of the protocol; more than one where its rate is too low for control.
        step: largest step of the physics [s].
        seed: seed of the sensors' noise.
        faults: wires that open during the run.
        findings: violations of limits that the dry run found; none may be left when the run starts.
        accepted: findings about the cell's range that were accepted: the recording then states the saturation.
        motor_held: the muscle hangs at the motor all the time, as on a machine that is operated by hand.
    """

    protocol: Protocol
    rig: Rig
    unit: MuscleUnit
    plan: ProtocolPlan
    layout: str
    specimen: Specimen | None = None
    every: int = 1
    step: float = STEP
    seed: int = 0
    faults: tuple[OpenWire, ...] = ()
    findings: tuple[Finding, ...] = ()
    accepted: tuple[Finding, ...] = ()
    motor_held: bool = False

    __repr__ = brief

    @property
    def cautions(self) -> tuple[str, ...]:
        """Cautions that do not prevent the run, but that a reader of its recording has to know.

        A calibration that is too old, and what a person is asked to do that the simulated rig knows nothing of.
        """
        used, asked = self.rig.calibration, [s.step.ask for s in self.plan.steps if s.step.ask]
        old = () if used is None else used.expired(datetime.datetime.now(datetime.UTC))
        unknown = [
            f"the rig {self.rig.name} does not say what changes when the operator is asked to {ask}: simulated, nothing does"
            for ask in dict.fromkeys(asked)
            if self.rig.operator_action(ask) is None
        ]
        of_muscle = (str(one) for one in law_cautions(self.specimen, self.unit.law))
        return (*old, *unknown, *of_muscle, *map(str, self.set_point_cautions()))

    def set_point_cautions(self) -> tuple[Caution, ...]:
        """What can hardly be meant of the protocol's pressures and spans, and of the rig's parts."""
        steps = self.plan.steps
        tops = {float(s.pressure.max()) for s in steps if isinstance(s.pressure, np.ndarray) and s.pressure.size}
        said = [pressure_caution(top, self.specimen, text=f"{top:g}") for top in sorted(tops)]
        spans = [s.motor for s in steps if s.mode == "span" and isinstance(s.motor, np.ndarray) and s.motor.size]
        ends = sorted({float(end) for motor in spans for end in (motor.min(), motor.max())})
        said.append(measured_length_caution(ends, self.specimen, "span"))
        for span in ends:
            try:
                said += span_cautions(span, self.unit.law, self.plan.rest_length, self.specimen)
            except InputError as error:
                said.append(Caution(str(error), "span"))
        parts = {"plumbing": {name: vars(p) for name, p in self.rig.plumbing.items()}, "sensors": self.rig.sensors}
        return collect(*said, room_caution(self.rig.environment), *parameter_cautions(parts))

    def segments(self) -> Iterator[RunSegment]:
        """Divide the plan at the operator actions."""
        return _segments(self.rig, self.plan, self.layout, self.motor_held)


def _segments(rig: Rig, plan: ProtocolPlan, layout: str, motor_held: bool = False) -> Iterator[RunSegment]:
    steps: list[PlannedStep] = []
    friction, asked = 1.0, ""
    for step in plan.steps:
        if step.step.ask:
            if steps:
                yield RunSegment(tuple(steps), layout, friction, asked, motor_held)
                steps = []
            asked = step.step.ask
            hand = rig.operator_action(asked)
            if hand is not None:
                layout, friction = hand.plumbing or layout, hand.friction
        steps.append(step)
    yield RunSegment(tuple(steps), layout, friction, asked, motor_held)


def changes_by_owner(changes: Mapping[str, T]) -> tuple[dict[str, T], dict[str, T], dict[str, T]]:
    """Changes of a run by path, as those of the rig and of the muscle by their own paths, and those of the protocol."""
    owned: dict[str, dict[str, T]] = {"rig": {}, "muscle": {}, "": {}}
    for path, value in changes.items():
        owner, _, own = path.partition(".")
        owned[owner if own and owner in owned else ""][own if own and owner in owned else path] = value
    return owned["rig"], owned["muscle"], owned[""]


def prepare(
    protocol: Protocol | str | os.PathLike[str],
    *,
    muscle: str | Specimen | Muscle | MuscleUnit,
    unit: MuscleUnit | None = None,
    law: str | None = None,
    rig: Rig | str | os.PathLike[str] = "paper",
    changes: Mapping[str, float | str] | None = None,
    calibration: str | os.PathLike[str] | None = None,
    plumbing: str | None = None,
    step: float = STEP,
    seed: int = 0,
    accept_saturation: bool = False,
    faults: Sequence[OpenWire] = (),
    foresee: bool = True,
    **values: JsonValue,
) -> PreparedRun:
    """Prepare a run, including the dry run; nothing moves.

    Args:
        protocol: a protocol, the name of a shipped one, or the path of a ``.toml`` file.
        muscle: a specimen, its id or file, or a muscle.
        unit: what was built from the specimen, where something of it was changed; by default `assembly.build.rig_unit`,
            which has the cord of the test machine between muscle and load.
        law: one of the laws that a specimen states; its default law by default.
        rig: a rig, its name or file.
        changes: numbers [SI] or words by path: of the protocol, as ``pressure``, of a rig that is named, as
            ``rig.plumbing.direct.tube.length``, and of the muscle, as ``muscle.law.passive_stiffness``.
        calibration: file of the calibration of the measured channels of a rig that is named.
        plumbing: name of the way in which the pneumatic parts are joined; chosen by what the protocol needs if left out.
        step: largest step of the physics [s].
        seed: seed of the sensors' noise.
        accept_saturation: go on where only the cell's range would be exceeded.
        faults: wires that open during the run.
        foresee: check the tensions that the muscle's law expects; False for a muscle of which the law is unknown.
        **values: of the protocol's parameters: numbers [SI], text with a unit, or lists of them for one case after another.

    Raises:
        InputError: names what is unknown, or cannot be read.

    Examples:
        >>> import mckibben as mk
        >>> prepared = mk.prepare("quasi-static", muscle="nylon", rig="paper", pressure="7 bar")
        >>> len(prepared.findings) > 0  # more than the machine allows: `run` would refuse
        True
    """
    of_rig, of_muscle, of_protocol = changes_by_owner(changes or {})
    wanted = read.changed_protocol(read.named_protocol(protocol, values), of_protocol)
    seed = whole_number(seed, "seed")
    step = float(in_si(step, "s", field="step"))
    if "stimulator" in wanted.required():
        raise InputError(
            "protocol", wanted.name, "must command pressures, since only biological muscles are stimulated"
        )
    named = wanted.name if isinstance(protocol, Protocol) else str(protocol)
    machine = rig_of(rig, of_rig, calibration) if not isinstance(rig, Rig) or of_rig or calibration is not None else rig
    on = with_control(machine, wanted.control, where=named)
    spec = None
    if isinstance(muscle, MuscleUnit):
        unit = muscle
    elif isinstance(muscle, Muscle):
        spec, unit = muscle.specimen, unit or rig_unit(muscle)
    else:
        spec = muscle if isinstance(muscle, Specimen) else muscle_specimen(muscle)
        unit = unit or rig_unit(spec, law=law)
    if of_muscle:
        # another rest length cuts the muscle, which changes what its specimen states, too
        try:
            spec, unit = with_parameters(spec, unit, of_muscle, law=law)
        except InputError as error:
            # called as it was given; the path of a law that it spoils is not
            raise error.changed(field=re.sub(r"^muscle\.", "changes.muscle.", error.field)) from None
    layout = on.layout(wanted, plumbing)
    rest = rest_length_of(spec, unit.law)
    plan = _plan(wanted, rest)
    if step > 0.0 and 1.0 / plan.sample_rate > MOST_STEPS * step:
        shortest = with_unit(1.0 / plan.sample_rate / MOST_STEPS, "s")
        problem = f"must be {shortest} or more: between two samples it takes at most {MOST_STEPS:,} steps"
        raise InputError("step", with_unit(step, "s"), problem)
    check_memory(plan.samples / plan.sample_rate, 1.0 / plan.sample_rate, bytes_per_sample=INTEGRATED)
    findings = check_plan(plan, on.limits(layout), expected(unit) if foresee else None)
    known = [*on.sensors, *(["span"] if on.encoder is not None else [])]
    for fault in faults:
        if fault.channel not in known:
            raise InputError("fault", fault.channel, f"the rig has sensors of {', '.join(known)}")
    # the gains of span and force want a fast loop: where a protocol is slower, several of its samples make one
    every = 1
    if not findings and RunSegment(plan.steps, "", 1.0, "").moves:
        try:
            every = on.computer.samples_per_sample(wanted.sample_rate)
        except InputError as error:
            findings.append(_finding_of(error))
    if every > 1:
        plan = _plan(dataclasses.replace(wanted, sample_rate=wanted.sample_rate * every), rest)
    findings += _not_built(on, unit, plan, layout) if not any(f.field == "sample_rate" for f in findings) else []
    spared = [f for f in findings if accept_saturation and f.field == "tension" and f.allowed.startswith(ON_THE_CELL)]
    kept = tuple(f for f in findings if f not in spared)
    return PreparedRun(wanted, on, unit, plan, layout, spec, every, step, seed, tuple(faults), kept, tuple(spared))


def prepare_on_machine(protocol: Protocol | str | os.PathLike[str], rate: float, **options: JsonValue) -> PreparedRun:
    """Prepare a run on a machine that is sampled already.

    Args:
        protocol: as of `prepare`.
        rate: samples per second of that machine [1/s].
        **options: of `prepare`.

    Raises:
        InputError: if the rate of the protocol is no whole part of it.
    """
    prepared = prepare(protocol, **options)
    motor_held, own = prepared.rig.motor is not None, prepared.protocol.sample_rate
    every = round(rate / own)
    if every < 1 or abs(rate / own - every) > 1e-6:
        allowed = f"must be {rate:g} Hz, at which the session samples, or a whole part of it, got {own:g} Hz"
        raise InputError("sample_rate", None, allowed)
    if prepared.findings or abs(prepared.plan.sample_rate - rate) < 1e-6 * rate:
        return dataclasses.replace(prepared, motor_held=motor_held)
    # once more at the rate of the machine; the recording keeps the samples of the protocol's own rate
    faster = prepare(dataclasses.replace(prepared.protocol, sample_rate=rate), **options)
    return dataclasses.replace(faster, protocol=prepared.protocol, every=every, motor_held=motor_held)


def _not_built(rig: Rig, unit: MuscleUnit, plan: ProtocolPlan, layout: str) -> list[Finding]:
    """List the reasons why the machine of a segment, or its loop, cannot be built; each reason once."""
    findings: dict[str, Finding] = {}
    for part in _segments(rig, plan, layout):
        try:
            rig.computer.period(plan.sample_rate)  # that of a loop with a motor is faster than the protocol's
            rig.machine(part.layout, with_friction_scale(unit, part.friction), start=part.start_span, moves=part.moves)
        except InputError as error:
            reason = _finding_of(error)
            findings.setdefault(reason.sentence, reason)
    return list(findings.values())


def _finding_of(error: InputError) -> Finding:
    return Finding(0, "", "", error.field, str(error.value), error.problem, str(error))


def with_friction_scale(unit: MuscleUnit, factor: float) -> MuscleUnit:
    """Return the muscle with its friction multiplied by a factor."""
    if factor == 1.0:
        return unit
    if unit.friction is None:
        raise InputError("friction", factor, "the muscle has none that a lubricant could change")
    rubbed: MuscleUnit = unit.replace(friction=unit.friction.lubricated(factor))
    return rubbed


def _plan(protocol: Protocol, rest: float) -> ProtocolPlan:
    """Expand the protocol from the rest length, or from the span at which a plate holds the muscle."""
    plan = protocol.expand(rest_length=rest)
    whole = RunSegment(plan.steps, "", 1.0, "")
    return plan if whole.moves else protocol.expand(rest_length=rest, start_span=whole.start_span)


def expected(unit: MuscleUnit) -> Estimate:
    """Return the tension by the muscle's law as a function of span and pressure."""

    def tension(span: Any, pressure: Any) -> np.ndarray:
        return np.asarray(unit.law.tension(np.asarray(span, float), np.asarray(pressure, float)))

    return tension
