"""Commissioning of a test machine: whether each sensor answers valve and motor, with which sign, noise, range and delay.

A short sequence without a protocol, at a low pressure: rest, a step of the valve, a careful pull of the motor at the filled
muscle where that is allowed, the shut-off where there is one, and a vent with gas in the muscle. Everything is judged from
the counts afterwards, since a machine that is told nothing for 20 ms vents by itself. So the tests are functions of a
`CheckRecord` alone, which `replay` keeps in a file for whoever has no such machine.

    noise     rms value of the readings at rest
    delay     from the sample at which the valve was asked, to the first of two readings that left the rest by 6 rms values,
              3 counts and 5 % of the change; so it contains latency, dead time of the valve, tube and filter

Range: machines that hold still at rest, and air whose pressure settles within `SETTLING`; a delay is known to a sample.
"""

from __future__ import annotations

import dataclasses
import os
import platform
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.bench.hardware.converters import SPAN
from mckibben.bench.hardware.interface import Hardware
from mckibben.bench.hardware.simulated import SimulatedHardware
from mckibben.bench.prepare import prepare
from mckibben.bench.rig import Rig
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.bench.sensors import SENSORS
from mckibben.documents import JsonValue, editable_toml, read_text, write_text
from mckibben.errors import InputError, LineLostError
from mckibben.quantities import with_unit
from mckibben.recordings import Channel, Recording, provenance

__all__ = [
    "CheckRecord", "CheckResult", "CheckSamples", "MachineCheck", "check_machine", "record_check", "simulated_machine",
    "write_measured_rig",
]  # fmt: skip

PRESSURE = 1e5  # that the valve is asked for by default [Pa]
SETTLING = 1.5  # for a change of the pressure [s]
RESTING = 1.0  # at the begin, for noise and zero [s]
HOLDING = 0.5  # with a shut muscle [s]
PULLING = 2.0  # until the motor has its largest force of this check [s]
PULL_SHARE = 0.05  # of the motor's largest force that is asked for at most
PULL_TRAVEL = 2e-3  # beyond where the muscle was mounted, at which it lets go [m]
NOISES, COUNTS, SHARE = 6.0, 3.0, 0.05  # by which a reading has left the rest: rms values, counts, share of the change
ZERO_SHARE = 0.05  # of a sensor's range that its reading at rest may be away from nothing
SCALE_SHARE = 0.2  # by which a settled pressure may miss what the valve was asked for
PULL_SCALE_SHARE = 0.3  # by which a load cell may miss the force of the motor, whose friction is not known
SCALE_CHANGE = 10.0  # smallest change of a load cell that is compared with that force, over what shows an answer
HELD_SHARE = 0.8  # of the pressure that a shut muscle keeps
GONE_SHARE = 0.2  # of the pressure that is left when the machine has vented
OF_PRESSURE = "Pa"


@dataclass(frozen=True)
class CheckResult:
    """Outcome of one test.

    Attributes:
        channel: sensor or part: ``pressure``, ``tension``, ``shut-off``, ``span``, ``vent`` or ``line``.
        test: ``noise``, ``zero``, ``range``, ``answer``, ``sign``, ``scale``, ``delay``, ``return``, ``order``, ``tight``,
            ``limits``, ``time`` or ``samples``.
        passed: True or False; None where it could not be tested.
        value: measured value [SI]; None where there is none.
        unit: SI unit of the value.
        sentence: what was found, and what to do where it failed.
    """

    channel: str
    test: str
    passed: bool | None
    value: float | None
    unit: str
    sentence: str

    def to_dict(self) -> dict[str, JsonValue]:
        """Its fields; a value that is not finite is None."""
        finite = self.value is not None and np.isfinite(self.value)
        return dataclasses.asdict(self) | {"value": self.value if finite else None}


@dataclass(frozen=True)
class MachineCheck:
    """Outcome of the commissioning of a machine.

    Attributes:
        rig: name of the rig.
        pressure: gauge pressure that the valve was asked for [Pa].
        period: period of the samples [s].
        results: in the order of the tests.
        measured: measured values as a rig's file has them, by dotted path.
        time: of the samples [s], (n,).
        readings: by channel [SI], (n,) each.
    """

    rig: str
    pressure: float
    period: float
    results: tuple[CheckResult, ...]
    measured: Mapping[str, str]
    time: np.ndarray = field(repr=False, compare=False)
    readings: Mapping[str, np.ndarray] = field(repr=False, compare=False)

    @property
    def passed(self) -> bool:
        """Whether no test failed."""
        return all(r.passed is not False for r in self.results)

    def failures(self) -> list[CheckResult]:
        """Tests that failed."""
        return [r for r in self.results if r.passed is False]

    def recording(self) -> Recording:
        """The samples of the sequence as a recording."""
        units = {name: SENSORS[name].unit if name in SENSORS else "m" for name in self.readings}
        channels = {name: Channel(values, units[name], "measured") for name, values in self.readings.items()}
        meta = {"rig": self.rig, "protocol": "check of the machine", "created": provenance.created()}
        return Recording(self.time, channels, meta)

    def __repr__(self) -> str:
        tested = [r for r in self.results if r.passed is not None]
        return f"MachineCheck({self.rig!r}: {len(tested) - len(self.failures())} of {len(tested)} tests passed)"


class _Phase(NamedTuple):
    """A part of the sequence: name, number of samples, counts of the outputs, and whether the machine is told to vent."""

    name: str
    samples: int
    valve: int
    motor: np.ndarray | None
    opened: bool = True
    vents: bool = False


class CheckSamples(NamedTuple):
    """Samples of a check as the machine gave them, (n,) or (n, channels).

    Attributes:
        names: analogue channels of the rig.
        counts: of these channels.
        edges: counts of the encoder; None without one.
        phase: part of the sequence, by name.
        lateness: of the samples at the computer [s].
        commands: what each sample was answered with: counts of valve and motor, open shut-off, venting (n, 4).
        stopped: which limit of the interlocks was passed, as a phrase; empty where none was.
    """

    names: tuple[str, ...]
    counts: np.ndarray
    edges: np.ndarray | None
    phase: np.ndarray
    lateness: np.ndarray
    commands: np.ndarray
    stopped: str = ""


@dataclass(frozen=True, kw_only=True)
class CheckRecord:
    """A check as it was sampled: all that its tests judge, and what a report of a fault needs.

    Attributes:
        rig: what its file says of the machine.
        plumbing: way in which the parts were joined.
        pressure: gauge pressure that the valve was asked for [Pa].
        period: period of the samples [s].
        motor: whether the motor was allowed to pull.
        samples: up to the end, or to where the machine was lost; None where none was taken.
        machine: what it says of itself (``has_motor``, ``motor_rest``, ``identity``), and the ``statistics`` of its line.
        versions: of the programs, by name.
        created: ISO 8601.
        refused: why the machine could not be opened or was lost, as a sentence; empty where the check came to its end.
    """

    rig: Rig
    plumbing: str
    pressure: float
    period: float
    motor: bool = False
    samples: CheckSamples | None = None
    machine: Mapping[str, JsonValue] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=lambda: provenance.versions() | {"system": platform.platform()})
    created: str = field(default_factory=provenance.created)
    refused: str = ""

    def judge(self) -> MachineCheck:
        """Judge the samples by the tests of this version.

        Raises:
            LineLostError: the machine was refused or lost.
        """
        if self.refused or self.samples is None:
            raise LineLostError(self.refused or "the check has no samples")
        judged = _Judged(self)
        results, time = tuple(judged.all()), self.period * np.arange(len(self.samples.phase))
        return MachineCheck(
            self.rig.name, self.pressure, self.period, results, judged.measured(), time, judged.readings
        )


def check_machine(hardware: Hardware, rig: Rig, **options: Any) -> MachineCheck:
    """Check sensors and outputs of a machine; it is vented at the end, whatever happens.

    Args:
        hardware: the machine, not yet started.
        rig: what its file says of it.
        options: as of `record_check`.

    Raises:
        InputError: there is no such plumbing, the pressure is beyond the rig, or the machine lacks a channel of it.
        LineLostError: the machine does not answer.
    """
    return record_check(hardware, rig, **options).judge()


def layout_of(rig: Rig, plumbing: str | None, pressure: float) -> str:
    """The plumbing of a check, the rig's first by default, in which the pressure [Pa] is allowed.

    Raises:
        InputError: there is no such plumbing, or the pressure is beyond the rig.
    """
    name = next(iter(rig.plumbing)) if plumbing is None else plumbing
    if name not in rig.plumbing:
        raise InputError("plumbing", name, known=list(rig.plumbing), where=rig.where)
    limits = rig.limits(name)
    if not 0.0 < pressure <= limits.pressure[1]:
        most = with_unit(limits.pressure[1], OF_PRESSURE)
        raise InputError("pressure", with_unit(pressure, OF_PRESSURE), f"must be above 0 bar, and at most {most}")
    return name


def record_check(
    hardware: Hardware,
    rig: Rig,
    *,
    period: float = 4e-3,
    pressure: float = PRESSURE,
    plumbing: str | None = None,
    motor: bool = False,
    progress: Callable[[float, float], None] | None = None,
) -> CheckRecord:
    """Take the samples of a check; the machine is vented at the end, whatever happens.

    A machine that is lost on the way leaves the samples until then, and the reason in ``refused``.

    Args:
        hardware: the machine, not yet started.
        rig: what its file says of it.
        period: period of the samples [s].
        pressure: gauge pressure that the valve is asked for [Pa].
        plumbing: way in which the parts are joined; the rig's first by default.
        motor: whether the motor may pull the muscle longer, with a twentieth of its largest force, to 2 mm beyond the mount.
        progress: called with the time that has passed, and that of the whole sequence [s].

    Raises:
        InputError: there is no such plumbing, the pressure is beyond the rig, or the machine lacks a channel of it.
    """
    name = layout_of(rig, plumbing, pressure)
    missing = [n for n in rig.converters(0.0).names if n not in hardware.names]
    if missing:
        raise InputError("channels", ", ".join(missing), "the machine has", known=hardware.names)
    has_shut_off = rig.plumbing[name].shut_off is not None
    phases = list(_sequence(rig, period, pressure, has_shut_off, motor and hardware.has_motor))
    rest = hardware.motor
    samples, refused = _sampled(hardware, rig, phases, period, progress)
    statistics = {} if hardware.statistics is None else hardware.statistics._asdict()
    machine = {"has_motor": hardware.has_motor, "motor_rest": rest, "identity": dict(hardware.identity)}
    return CheckRecord(
        rig=rig, plumbing=name, pressure=pressure, period=period, motor=motor, samples=samples,
        machine=machine | {"statistics": statistics}, refused=refused,
    )  # fmt: skip


def _sequence(rig: Rig, period: float, pressure: float, shut_off: bool, motor: bool) -> Iterator[_Phase]:
    def samples(seconds: float) -> int:
        return max(int(round(seconds / period)), 8)

    none, asked = int(rig.valve_out.count(0.0)), int(rig.valve_out.count(pressure))
    yield _Phase("rest", samples(RESTING), none, None)
    yield _Phase("step", samples(SETTLING), asked, None)
    if motor and rig.motor is not None and rig.motor_out is not None:
        forces = np.linspace(0.0, PULL_SHARE * float(rig.motor.largest_force), samples(PULLING))
        yield _Phase("pull", len(forces), asked, np.array([int(rig.motor_out.count(f)) for f in forces]))
    if shut_off:
        yield _Phase("shut", samples(HOLDING), none, None, opened=False)
    yield _Phase("release", samples(SETTLING), none, None)
    yield _Phase("refill", samples(SETTLING), asked, None)
    yield _Phase("vent", samples(SETTLING), asked, None, vents=True)  # the vent overrides what the valve is asked for


def _sampled(
    hardware: Hardware, rig: Rig, phases: list[_Phase], period: float, progress: Callable[[float, float], None] | None
) -> tuple[CheckSamples, str]:
    """Execute the sequence and say why it was cut short; above a limit of the interlocks the rest of it is spent venting."""
    scales = rig.converters(0.0).analog
    names = tuple(n for n in hardware.names if n in scales)
    columns = [hardware.names.index(n) for n in names]
    low = np.array([float(scales[n].low) for n in names])
    step = np.array([float(scales[n].resolution) for n in names])
    encoder = None if rig.encoder is None or not hardware.has_encoder else float(rig.encoder.resolution)
    rest = 0 if rig.motor_out is None else int(rig.motor_out.count(0.0))
    largest = {"Pa": float(rig.interlocks.burst_pressure), "N": float(rig.interlocks.most_tension)}
    most = np.array([largest.get(SENSORS[n].unit if n in SENSORS else "", np.inf) for n in names])
    total = sum(p.samples for p in phases)
    counts, edges = np.zeros((total, len(names))), np.zeros(total)
    phase, late, commands = np.empty(total, dtype=object), np.zeros(total), np.zeros((total, 4), np.int64)
    stopped, refused, k, let_go, begun = "", "", 0, False, 0.0  # begun: counts of the encoder where the pull begins
    try:
        hardware.start(period)
        for one in phases:
            if one.vents:
                hardware.vent()
            for i in range(one.samples):
                late[k] = hardware.wait(k)
                counts[k], edges[k], phase[k] = [hardware.counts[c] for c in columns], hardware.edges, one.name
                values = low + counts[k] * step
                if not stopped and (values > most).any():
                    over = names[j := int(np.argmax(values > most))]
                    stopped = f"{over} read {with_unit(values[j], SENSORS[over].unit)}, above the rig's interlock"
                    hardware.vent()
                if one.motor is not None and encoder is not None:
                    begun = edges[k] if i == 0 else begun
                    let_go = let_go or (abs(edges[k] - begun) - abs(begun)) * encoder > PULL_TRAVEL
                pull = rest if one.motor is None or let_go or stopped else int(one.motor[i])
                commands[k] = one.valve, pull, one.opened, hardware.venting
                hardware.write(one.valve, pull if hardware.has_motor else None, opened=one.opened)
                k += 1
                if progress is not None and k % 25 == 0:
                    progress(k * period, total * period)
    except LineLostError as error:
        refused = str(error)
    finally:
        hardware.vent()
    turned = None if encoder is None else edges[:k]
    return CheckSamples(names, counts[:k], turned, phase[:k], late[:k], commands[:k], stopped), refused


class _Judged:
    def __init__(self, record: CheckRecord) -> None:
        assert record.samples is not None
        self.record, self.samples = record, record.samples
        self.rig, self.period, self.pressure = record.rig, record.period, record.pressure
        rig, counts, commanded = record.rig, record.samples.counts, record.samples.commands[:, 1]
        scales = rig.converters(0.0).analog
        names = record.samples.names
        self.readings = {
            n: float(scales[n].low) + counts[:, i] * float(scales[n].resolution) for i, n in enumerate(names)
        }
        if record.samples.edges is not None and rig.encoder is not None:
            self.readings[SPAN] = float(rig.encoder.resolution) * record.samples.edges
        self.force = np.zeros(len(commanded))  # of the motor [N], (n,)
        if rig.motor_out is not None:
            rest = int(rig.motor_out.count(0.0))
            self.force = np.asarray(rig.motor_out.value(commanded.astype(float))) - float(rig.motor_out.value(rest))
        self.names = [n for n in self.readings if n != SPAN]
        self.rest = {n: self.of(n, "rest") for n in self.readings}
        self.noise = {n: float(np.std(x)) for n, x in self.rest.items()}
        self.zero = {n: float(np.mean(x)) for n, x in self.rest.items()}

    def of(self, name: str, phase: str) -> np.ndarray:
        """Readings of a channel in a phase [SI]."""
        readings: np.ndarray = self.readings[name][self.samples.phase == phase]
        return readings

    def unit(self, name: str) -> str:
        return SENSORS[name].unit if name in SENSORS else "1"

    def say(self, name: str, value: float) -> str:
        return with_unit(value, self.unit(name))

    def result(
        self,
        name: str,
        test: str,
        passed: bool | None,
        value: float | None,
        sentence: str,
        advice: str = "",
        unit: str = "",
    ) -> CheckResult:
        """The outcome of a test, by default in the unit of the channel; what to do is said where it failed."""
        said = f"{sentence}{advice if passed is False else ''}"
        return CheckResult(name, test, passed, value, unit or self.unit(name), said)

    def all(self) -> Iterator[CheckResult]:
        """All tests, in the order of the sequence."""
        if self.samples.stopped:
            sentence = f"stopped and vented: {self.samples.stopped}; check its wires, and the scales in the rig's file"
            yield CheckResult("machine", "limits", False, None, "1", sentence)
        for i, name in enumerate(self.names):
            yield from self.at_rest(name, i)
            if not self.samples.stopped:
                yield from self.answer(name)
        if not self.samples.stopped:
            yield from self.order()
            if self.rig.plumbing[self.record.plumbing].shut_off is not None and "pressure" in self.names:
                yield self.tightness()
            if SPAN in self.readings:
                yield self.encoder()
            yield from self.venting()
        yield self.line()

    def at_rest(self, name: str, i: int) -> Iterator[CheckResult]:
        """Noise, zero, and readings at an end of the converter."""
        sensor = self.rig.sensors[name]
        span = float(sensor.high - sensor.low)
        count = float(sensor.resolution)
        noise, zero = self.noise[name], self.zero[name]
        sentence = f"noise of {self.say(name, noise)} rms, {noise / count:.2g} counts"
        advice = ": shield its cable, check ground and supply"
        yield self.result(name, "noise", noise <= max(0.01 * span, 2.0 * count), noise, sentence, advice)
        advice = ": check low and high of its converter in the rig's file, or a broken wire"
        sentence = f"reads {self.say(name, zero)} at rest"
        yield self.result(name, "zero", abs(zero) <= ZERO_SHARE * span, zero, sentence, advice)
        counts, last = self.samples.counts[:, i], float(sensor.converter.counts) - 1.0
        ends = float(np.mean((counts <= 0.0) | (counts >= last)))
        # a scale that begins at zero may read its lowest count, where nothing is
        clear = ends == 0.0 or (ends < 1.0 and float(sensor.converter.low) >= 0.0 and not (counts >= last).any())
        some = f"{100.0 * ends:.3g} % of its samples are at an end of its converter"
        advice = ": an open wire, or an amplifier with too much gain"
        yield self.result(name, "range", clear, ends, some if ends else "within its range", advice, "1")

    def change(self, name: str, phase: str = "step") -> float:
        """Settled change from the rest, in a phase."""
        values = self.of(name, phase)
        return float(np.mean(values[-max(len(values) // 4, 1) :])) - self.zero[name] if len(values) else 0.0

    def threshold(self, name: str) -> float:
        return max(NOISES * self.noise[name], COUNTS * float(self.rig.sensors[name].resolution))

    def exchanged_with(self, name: str) -> str | None:
        """Channel of another unit that answers the valve by the counts of this pressure; None if there is none."""
        expected = self.pressure / float(self.rig.sensors[name].resolution)
        for other in self.names:
            counts = self.change(other) / float(self.rig.sensors[other].resolution)
            if self.unit(other) != OF_PRESSURE and abs(counts / expected - 1.0) <= SCALE_SHARE:
                return other
        return None

    def answer(self, name: str) -> Iterator[CheckResult]:
        """Answer to the step of the valve: whether it moves, up, by how much and how soon, and back."""
        unit, change, asked = self.unit(name), self.change(name), with_unit(self.pressure, OF_PRESSURE)
        of_pressure, moved = unit == OF_PRESSURE, abs(change) > self.threshold(name)
        if not moved and of_pressure:
            other = self.exchanged_with(name)
            advice = (
                "check its wires, its supply, the tube and the air"
                if other is None
                else f"{other} changes by as many counts as it should: exchange the wires of both"
            )
            sentence = f"does not answer a step of the valve to {asked}: {advice}"
            yield self.result(name, "answer", False, change, sentence)
            return
        if not moved or (unit == "N" and "pull" in self.samples.phase):
            yield from self.pulled(name)
            return
        sentence = f"changes by {self.say(name, change)} when the valve is asked for {asked}"
        yield self.result(name, "answer", True, change, sentence)
        yield self.sign(name, change, "pressure")
        if of_pressure and change > 0.0:
            ratio = change / self.pressure
            right = abs(ratio - 1.0) <= SCALE_SHARE
            other = None if right else self.exchanged_with(name)
            advice = ": check low and high of its converter, and the output of the valve, in the rig's file"
            if other is not None:
                advice = f": {other} changes by as many counts as it should, so exchange the wires of both"
            sentence = f"reads {ratio:.3g} of what the valve was asked for"
            yield self.result(name, "scale", right, ratio, sentence, advice, "1")
        away = np.abs(self.of(name, "step") - self.zero[name]) > max(self.threshold(name), SHARE * abs(change))
        both = np.flatnonzero(away[:-1] & away[1:])  # one reading alone may be noise
        delay = float(both[0]) * self.period if len(both) else float("nan")
        sentence = f"begins to move after {with_unit(delay, 's')}, known to {with_unit(self.period, 's')}"
        yield self.result(
            name, "delay", delay <= 0.2, delay, sentence, ": check the supply, the tube's width and the filter", "s"
        )
        left = self.change(name, "release")
        back = abs(left) <= max(GONE_SHARE * abs(change), self.threshold(name))
        advice = ": the exhaust is too narrow or shut, or the muscle stays loaded"
        sentence = f"is {self.say(name, left)} away from its rest after the release"
        yield self.result(name, "return", back, left, sentence, advice)

    def sign(self, name: str, change: float, cause: str) -> CheckResult:
        way = "rises" if change > 0 else "falls"
        return self.result(name, "sign", change > 0.0, change, f"{way} with the {cause}", ": exchange its signal wires")

    def pulled(self, name: str) -> Iterator[CheckResult]:
        """Answer of a load cell to the force of the motor, where the plate is free to move."""
        if self.unit(name) != "N" or "pull" not in self.samples.phase or self.rig.motor is None:
            sentence = "does not answer a step of the valve: check it again with a muscle on a fixed plate"
            yield self.result(name, "answer", None, None, sentence)
            return
        pulls = self.force[self.samples.phase == "pull"]
        values, force = ((self.of(name, "pull") - self.change(name) - self.zero[name])[pulls > 0.0], pulls[pulls > 0.0])
        change = float(values[np.argmax(np.abs(values))])
        if abs(change) <= self.threshold(name) and self.travel() < 0.0:
            sentence = "cannot be tested while the motor moves the wrong way, or the encoder counts downwards"
            yield self.result(name, "answer", None, None, sentence)
            return
        if abs(change) <= self.threshold(name):
            sentence = "does not answer a pull of the motor: check its wires, its supply, and the amplifier's enable"
            yield self.result(name, "answer", False, change, sentence)
            return
        yield self.result(name, "answer", True, change, f"changes by {self.say(name, change)} when the motor pulls")
        yield self.sign(name, change, "pull")
        if abs(change) < SCALE_CHANGE * self.threshold(name):
            sentence = "moved too little for a comparison with the motor's force"
            yield self.result(name, "scale", None, None, sentence, unit="1")
            return
        half = len(values) // 2  # the friction of the motor takes the first half
        slope = float(np.polyfit(force[half:], values[half:], 1)[0])
        advice = ": check low and high of its converter, and the motor's torque constant, in the rig's file"
        sentence = f"reads {slope:.3g} of the motor's force"
        yield self.result(name, "scale", abs(slope - 1.0) <= PULL_SCALE_SHARE, slope, sentence, advice, "1")

    def order(self) -> Iterator[CheckResult]:
        """Whether the pressure at the valve is ahead of the muscle's while air flows in, as air flows from high to low."""
        names = ("valve_pressure", "pressure")
        if not set(names) <= set(self.names) or any(self.change(n) <= self.threshold(n) for n in names):
            return
        if not float(self.rig.sensors[names[0]].cutoff) >= float(self.rig.sensors[names[1]].cutoff):
            sentence = "cannot be told from pressure, whose sensor answers sooner"
            yield self.result("valve_pressure", "order", None, None, sentence, unit="1")
            return
        # Shares of the settled change, so that a zero or a scale that is wrong has no part in it.
        shares = [(self.of(n, "step") - self.zero[n]) / self.change(n) for n in names]
        ahead = shares[0] - shares[1]
        most, least = float(np.max(ahead)), float(np.min(ahead))
        if max(most, -least) <= max(sum(self.threshold(n) / self.change(n) for n in names), SHARE):
            sentence = "is not ahead of pressure by enough to tell both apart"
            yield self.result("valve_pressure", "order", None, None, sentence, unit="1")
            return
        right = most > -least
        by = most if right else least
        where = "ahead of" if right else "behind"
        sentence = f"is {where} pressure by {100.0 * abs(by):.2g} % of the step while the muscle fills"
        yield self.result("valve_pressure", "order", right, by, sentence, ": exchange the wires of both", "1")

    def tightness(self) -> CheckResult:
        """Whether the shut muscle keeps its pressure, while the valve vents."""
        before, after = self.change("pressure"), self.change("pressure", "shut")
        if abs(before) <= self.threshold("pressure"):
            sentence = "cannot be tested without an answer of the pressure"
            return CheckResult("shut-off", "tight", None, None, "1", sentence)
        kept = after / before
        tight = kept >= HELD_SHARE
        advice = ": it does not shut, or its output is wired to another pin"
        other = self.change("valve_pressure") if "valve_pressure" in self.names else 0.0
        if not tight and other > 0.0 and self.change("valve_pressure", "shut") >= HELD_SHARE * other:
            advice = ", and that of the valve stays: exchange the wires of pressure and valve_pressure"
        sentence = f"the shut muscle keeps {100.0 * kept:.3g} % of its pressure for {HOLDING:g} s"
        return self.result("shut-off", "tight", tight, kept, sentence, advice, "1")

    def travel(self) -> float:
        """Largest travel of the span while the motor pulls, with its sign [m]; 0 where nothing moves or no motor pulled."""
        values = self.of(SPAN, "pull") if SPAN in self.readings else np.zeros(0)
        if not len(values) or self.rig.encoder is None:
            return 0.0
        travel = float((values - values[0])[np.argmax(np.abs(values - values[0]))])
        return travel if abs(travel) >= COUNTS * float(self.rig.encoder.resolution) else 0.0

    def encoder(self) -> CheckResult:
        """Whether the encoder counts upwards when the motor pulls the muscle longer."""
        if "pull" not in self.samples.phase:
            why = "there is no motor" if self.record.motor else "the motor was not allowed to pull"
            return CheckResult(SPAN, "answer", None, None, "m", f"not tested: {why}")
        travel = self.travel()
        if travel == 0.0:
            advice = "check the amplifier's enable, and both lines of the encoder"
            return CheckResult(SPAN, "answer", False, travel, "m", f"does not count when the motor pulls: {advice}")
        sentence = f"moves by {with_unit(travel, 'm')} when the motor pulls the muscle longer"
        advice = ": exchange the encoder's lines A and B, or the motor's leads if it moved the wrong way"
        return self.result(SPAN, "sign", travel > 0.0, travel, sentence, advice, "m")

    def venting(self) -> Iterator[CheckResult]:
        """Time until the pressure is gone after the machine was told to vent."""
        for name in self.names:
            if self.unit(name) != OF_PRESSURE:
                continue
            before, values = self.change(name, "refill"), self.of(name, "vent") - self.zero[name]
            if abs(before) <= self.threshold(name):
                yield CheckResult("vent", "time", None, None, "s", f"{name} cannot show it: it does not answer")
                continue
            left = np.flatnonzero(np.abs(values) > max(GONE_SHARE * abs(before), self.threshold(name)))
            time = self.period * (int(left[-1]) + 1 if len(left) else 0)
            vented = time < self.period * len(values)
            sentence = (
                f"{name} is gone after {with_unit(time, 's')}"
                if vented
                else f"{name} stays for {with_unit(time, 's')} after it was told to vent: mend that before all else"
            )
            yield CheckResult("vent", "time", vented, time, "s", sentence)

    def line(self) -> CheckResult:
        """Lateness of the samples at the computer, and those that were lost."""
        late = self.samples.lateness
        largest, usual = float(np.max(late)), float(np.median(late))
        lost = int(self.record.machine.get("statistics", {}).get("lost", 0))
        times = f"late by {with_unit(usual, 's')} in the median and {with_unit(largest, 's')} at most"
        advice = ": lower the rate, or connect the board to a port of its own"
        sentence = f"{len(late)} samples, {lost} lost, {times}"
        return self.result("line", "samples", lost == 0 and largest < 5.0 * self.period, largest, sentence, advice, "s")

    def measured(self) -> dict[str, str]:
        """Noise and zero of the sensors, as a rig's file has them; those of channels that answer."""
        values: dict[str, str] = {}
        for name in self.names:
            at_pull = self.of(name, "pull")
            if max(abs(self.change(name)), *np.abs(at_pull - self.zero[name]), 0.0) <= self.threshold(name):
                continue
            count = float(self.rig.sensors[name].resolution)
            if self.noise[name] < 0.5 * count:  # hidden by the counts
                continue
            # The converter adds q^2/12 by itself, in the simulation too.
            noise = float(np.sqrt(max(self.noise[name] ** 2 - count**2 / 12.0, 0.0)))
            values[f"sensors.{name}.noise"] = with_unit(noise, self.unit(name), 3)
            error = 3.0 * self.noise[name] / np.sqrt(len(self.rest[name]))
            if abs(self.zero[name]) > max(error, 0.5 * count):
                values[f"sensors.{name}.offset"] = with_unit(self.zero[name], self.unit(name), 3)
        return values


def simulated_machine(
    rig: Rig, muscle: Any, *, period: float = 4e-3, plumbing: str | None = None, motor: bool = False, seed: int = 0
) -> SimulatedHardware:
    """Return a simulated machine with a muscle at rest, as hardware to check."""
    rate = f"{1.0 / period:g} Hz"
    bench = prepare("isometric-step", muscle=muscle, rig=rig, plumbing=plumbing, seed=seed, sample_rate=rate)
    bench = dataclasses.replace(bench, motor_held=motor and rig.motor is not None)
    return SimulatedHardware(SegmentMachine(bench, 0, next(bench.segments()), timing_of(bench)).at_interface())


def write_measured_rig(path: str | os.PathLike[str], check: MachineCheck, rig: Rig, source: str | None) -> Path:
    """Write a rig's file with the measured values in it; comments of the user's file stay.

    Args:
        path: file to write.
        check: outcome of the check.
        rig: rig that was checked.
        source: the user's file; None for a shipped rig, of which a file with a base is written.

    Raises:
        InputError: the file cannot be read or written.
    """
    import tomlkit

    if source is None:
        whole = tomlkit.document()
        whole.update({"schema": 1, "name": f"{rig.name}-measured", "title": f"{rig.title}, as measured"})
        whole.update({"base": rig.name, "changes": dict(check.measured)})
    else:
        whole = editable_toml(read_text(source, field="rig"), where=source, field="rig")
        if "base" in whole:
            whole.setdefault("changes", tomlkit.table()).update(check.measured)
        else:
            for dotted, words in check.measured.items():
                *tables, last = dotted.split(".")
                at: Any = whole
                for table in tables:
                    at = at[table]
                at[last] = words
    return write_text(path, tomlkit.dumps(whole), field="--out")
