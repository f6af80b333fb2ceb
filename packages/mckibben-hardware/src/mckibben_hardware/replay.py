"""Checks of machines that were never here: the file that their owner sends, and the machine that answers as it did there.

`write_check` keeps a `CheckRecord` as JSON: versions, timing, raw counts, what was refused, and the rig with which they are
read. `read_check` reads it as any foreign file, within bounds and without running code. `ReplayedHardware` is that machine:

    while it is asked what it was asked then    the recorded samples, bit for bit, with their lateness
    from the first other command on             counts = rest + sum over changes of the valve, du * s(t - t_change)

s is the recorded answer [count] to a step, a release or a vent, du the change of the valve in parts of the recorded step. So
``--on replay:FILE`` runs whatever runs on a machine, and what is wrong with the wires, signs, scales and delays is in it.

Range: air answers a larger step as a larger copy of the recorded one, which holds near the pressure of the check, and not
for the times of choked flow. Between its samples s is linear. Whether a channel follows a shut valve is that of the check.
The encoder rests: how the plate follows a motor under control is not in the file.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.bench.hardware.backends import HardwareRequest
from mckibben.bench.hardware.interface import LARGEST, Hardware
from mckibben.bench.rig import Rig
from mckibben.bench.rig_file import read_rig
from mckibben.bench.run import prepare, run
from mckibben.documents import JsonValue, parse_json, read_text, write_text
from mckibben.errors import InputError, LineLostError, MckibbenError
from mckibben.quantities import with_unit
from mckibben.schema import FileTable
from mckibben.specimens import muscle_specimen

from . import commissioning
from .calibrate.session import CalibrationSession, HardwareReadings, OperatorTask, grids
from .commissioning import CheckRecord, CheckResult, CheckSamples, MachineCheck

__all__ = ["Replay", "ReplayStep", "ReplayedHardware", "read_check", "replay_check", "write_check"]

SCHEMA = 1
KIND = "check of a machine"
MOST_SAMPLES = 1_000_000
MICRO = 1e-6  # in which lateness is written [s]
COMMANDS = ("valve", "motor", "opened", "venting")
PROTOCOL = "isometric-step"  # the first one on a new machine: the muscle between two fixed ends


# ---- the file


def check_content(record: CheckRecord, outcome: MachineCheck | None) -> dict[str, JsonValue]:
    """A check as JSON: what ``device check --json`` prints, and the record behind it.

    Args:
        record: as it was sampled.
        outcome: what its tests found; None where the machine was refused or lost.
    """
    results = [] if outcome is None else [r.to_dict() for r in outcome.results]
    return {
        "schema": SCHEMA,
        "kind": KIND,
        "created": record.created,
        "versions": dict(record.versions),
        "refused": record.refused,
        "rig": record.rig.name,
        "plumbing": record.plumbing,
        "pressure": record.pressure,
        "period": record.period,
        "motor": record.motor,
        "passed": outcome is not None and outcome.passed,
        "results": results,
        "measured": {} if outcome is None else dict(outcome.measured),
        "machine": dict(record.machine),
        "rig_document": dict(record.rig.document),
        "samples": None if record.samples is None else _packed(record.samples),
    }


def write_check(path: str | os.PathLike[str], record: CheckRecord, outcome: MachineCheck | None) -> Path:
    """Write a check as JSON, one line for each key, so that it is small and a person can look into it."""
    lines = (
        f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}"
        for key, value in check_content(record, outcome).items()
    )
    return write_text(path, "{\n" + ",\n".join(lines) + "\n}\n", field="--out")


def _packed(samples: CheckSamples) -> dict[str, JsonValue]:
    """Samples as lists: phases by their number of samples, commands where they change."""
    phases: dict[str, int] = {}
    for name in samples.phase:
        phases[name] = phases.get(name, 0) + 1
    rows = samples.commands
    changed = [i for i in range(len(rows)) if i == 0 or (rows[i] != rows[i - 1]).any()]
    return {
        "phases": phases,
        "counts": {n: [int(c) for c in samples.counts[:, i]] for i, n in enumerate(samples.names)},
        "edges": None if samples.edges is None else [int(c) for c in samples.edges],
        "late": [round(late / MICRO) for late in samples.lateness.tolist()],
        "commands": [[i, *(int(v) for v in rows[i])] for i in changed],
        "stopped": samples.stopped,
    }


def read_check(path: str | os.PathLike[str]) -> tuple[CheckRecord, tuple[CheckResult, ...]]:
    """Read the file of a check: the record, and what its tests found then.

    Raises:
        InputError: there is no such file, it is no check of a machine, of another version, or damaged; names the field.
    """
    where, text = os.fspath(path), read_text(path, form="JSON")
    try:
        content = parse_json(text)
    except ValueError as error:
        raise InputError("check", None, f"is no JSON: {error}", where=where) from None
    if not isinstance(content, Mapping) or content.get("kind") != KIND:
        demand = "must be what mckibben device check --out FILE.json has written"
        raise InputError("check", None, demand, where=where)
    top = FileTable.of(content, "", where)
    top.schema(SCHEMA)
    rig = read_rig(top.table("rig_document").values, where=where)
    layout = commissioning.layout_of(rig, top.word("plumbing"), pressure := _number(top, "pressure", 0.0, 1e9))
    raw = top.values.get("samples")
    record = CheckRecord(
        rig=rig,
        plumbing=layout,
        pressure=pressure,
        period=_number(top, "period", 1e-6, 10.0),
        motor=top.flag("motor", False),
        samples=None if raw is None else _unpacked(top.table("samples"), rig),
        machine=_machine(top.table("machine")),
        versions={name: str(word) for name, word in top.table("versions").values.items()},
        created=top.text("created"),
        refused=str(top.values.get("refused") or ""),
    )
    if record.samples is None and not record.refused:
        raise top.fail("samples", None, "is missing, and nothing says why the machine was refused")
    return record, tuple(_result(one) for one in top.listed("results"))


def _number(table: FileTable, key: str, low: float, high: float) -> float:
    value = table.values.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise table.fail(key, value, f"must be a number from {low:g} to {high:g}")
    return float(value)


def _machine(table: FileTable) -> dict[str, JsonValue]:
    statistics = table.table("statistics")
    lost = statistics.whole("lost", 0, MOST_SAMPLES, 0)
    return {
        "has_motor": table.flag("has_motor", False),
        "motor_rest": table.whole("motor_rest", 0, LARGEST, 0),
        "identity": dict(table.table("identity").values),
        "statistics": {**statistics.values, "lost": lost},
    }


def _result(table: FileTable) -> CheckResult:
    passed, value = table.values.get("passed"), table.values.get("value")
    if not (passed is None or isinstance(passed, bool)):
        raise table.fail("passed", passed, "must be true, false or null")
    number = float(value) if isinstance(value, int | float) else None
    words = [str(table.values.get(key, "")) for key in ("channel", "test", "unit", "sentence")]
    return CheckResult(words[0], words[1], passed, number, words[2], words[3])


def _unpacked(table: FileTable, rig: Rig) -> CheckSamples:
    """The samples of a file; every list is as long as the phases say, and of whole numbers."""
    phases = table.table("phases")
    sizes = {name: phases.whole(name, 0, MOST_SAMPLES) for name in phases.values}
    total, names = sum(sizes.values()), rig.converters(0.0).names
    counts, late = table.table("counts"), _whole_numbers(table, "late", -LARGEST, LARGEST)
    counts.only(names, "the rig has")
    columns = [_whole_numbers(counts, name, 0, LARGEST) for name in names]
    turned = None if table.values.get("edges") is None else _whole_numbers(table, "edges", -LARGEST, LARGEST)
    for key, column in zip((*names, "late", "edges"), (*columns, late, turned), strict=True):
        if column is not None and len(column) != total:
            raise table.fail(key, len(column), f"must have {total} samples, as the phases have")
    rows, at = table.values.get("commands"), 0
    commands = np.zeros((total, len(COMMANDS)), np.int64)
    if not isinstance(rows, list):
        raise table.fail("commands", None, "must be a list of a sample and what it was answered with")
    for i, row in enumerate(rows):
        plain = isinstance(row, list) and len(row) == 1 + len(COMMANDS) and all(type(v) is int for v in row)
        if not plain or not (at if i else 0) <= row[0] < total or not 0 <= min(row) <= max(row) <= LARGEST:
            raise table.fail(f"commands.{i}", row, f"must be a later sample, and counts: {', '.join(COMMANDS)}")
        at = row[0]
        commands[at:] = row[1:]
    phase = np.repeat(np.array(list(sizes), object), list(sizes.values()))
    stacked = np.array(columns, float).reshape(len(names), total).T
    edges = None if turned is None else np.array(turned, float)
    return CheckSamples(
        names, stacked, edges, phase, MICRO * np.array(late, float), commands, str(table.values.get("stopped") or "")
    )


def _whole_numbers(table: FileTable, key: str, low: int, high: int) -> list[int]:
    values = table.values.get(key)
    if not isinstance(values, list) or not all(type(v) is int and low <= v <= high for v in values):
        raise table.fail(key, None, f"must be a list of whole numbers from {low} to {high}")
    return values


# ---- the machine


class _Answers(NamedTuple):
    """Answers of the channels to one way in which the valve changes, by samples after it (m, channels), and their ends."""

    counts: np.ndarray
    end: np.ndarray

    @classmethod
    def of(cls, counts: np.ndarray, begin: np.ndarray, end: np.ndarray, sign: float, stretch: float) -> _Answers:
        """Answers from recorded counts, on another period: `stretch` is the recorded one over that."""
        size = len(counts)
        at = np.arange(math.ceil(size * stretch)) / stretch
        change = sign * (counts - begin)
        sampled = [np.interp(at, np.arange(size), change[:, i]) for i in range(counts.shape[1])]
        return cls(np.array(sampled).T, sign * (end - begin))


class _Statistics(NamedTuple):
    lost: int


class ReplayedHardware(Hardware):
    """The machine of a recorded check, as if it were here; the module says how it answers.

    Args:
        record: the check.

    Attributes:
        followed: whether it has been asked so far what it was asked in the check.

    Raises:
        LineLostError: the check has no samples, since the machine was refused; says why.
    """

    paced = False

    def __init__(self, record: CheckRecord) -> None:
        samples = record.samples
        if samples is None or not len(samples.counts):
            raise LineLostError(record.refused or "the check has no samples")
        self.record, self.samples = record, samples
        rest = int(record.machine.get("motor_rest", 0))
        motor = bool(record.machine.get("has_motor", False))
        super().__init__(samples.names, encoder=samples.edges is not None, motor=motor, motor_rest=rest)
        analog = record.rig.converters(0.0).analog
        self._most = np.array([2.0 ** float(analog[n].bits) - 1.0 for n in samples.names])
        self._none = int(record.rig.valve_out.count(0.0))
        self._step = int(record.rig.valve_out.count(record.pressure)) - self._none
        self._rest = samples.counts[samples.phase == samples.phase[0]]
        self.start(record.period)

    @property
    def identity(self) -> Mapping[str, JsonValue]:
        """What the machine said of itself in the check."""
        identity: Mapping[str, JsonValue] = self.record.machine.get("identity", {})
        return identity

    @property
    def statistics(self) -> NamedTuple:
        """Samples that the line lost in the check."""
        return _Statistics(int(self.record.machine.get("statistics", {}).get("lost", 0)))

    def start(self, period: float) -> None:
        """Begin with a period [s]; the recorded samples are those of the period of the check."""
        stretch = self.record.period / period
        self.venting, self.followed, self._sample = False, abs(stretch - 1.0) < 1e-6, 0
        self._answers = self._all_answers(stretch)
        self._level = np.zeros(len(self.names))  # of the valve, as each channel feels it, in parts of the recorded step
        self._changes: list[tuple[int, str, np.ndarray]] = []  # not yet settled: sample, way, change
        self._settled = np.zeros(len(self.names))

    def wait(self, sample: int) -> float:
        """Give the next sample at once, with the lateness that it had."""
        self._sample, recorded = sample, self.samples.counts
        if self.followed and sample >= len(recorded) and self.record.refused:
            raise LineLostError(self.record.refused)
        self.followed = self.followed and sample < len(recorded)
        if self.followed:
            self.counts = tuple(int(c) for c in recorded[sample])
            self.edges = 0 if self.samples.edges is None else int(self.samples.edges[sample])
            return float(self.samples.lateness[sample])
        counts, left = self._settled + self._rest[sample % len(self._rest)], []
        for begun, way, change in self._changes:
            answers = self._answers[way]
            if sample - begun < len(answers.counts):
                counts = counts + change * answers.counts[sample - begun]
                left.append((begun, way, change))
            else:
                self._settled = self._settled + change * answers.end
                counts = counts + change * answers.end
        self._changes = left
        self.counts = tuple(int(c) for c in np.clip(np.floor(counts + 0.5), 0.0, self._most))
        return 0.0

    def send(self) -> None:
        """Take the outputs: whether they are those of the check, and how the valve changes."""
        row = (self.valve, self.motor, self.opened, self.venting)
        known = self._sample < len(self.samples.commands)
        self.followed = self.followed and known and tuple(self.samples.commands[self._sample]) == row
        asked = 0.0 if self.venting or not self._step else (self.valve - self._none) / self._step
        shut = self._shut_off and not (self.opened or self.venting)
        level = np.where(self._holds & shut, self._level, asked)
        change = level - self._level
        if change.any():
            way = "vent" if self.venting else "step" if change.sum() > 0.0 else "release"
            self._changes.append((self._sample, way, change))
            self._level = level

    def _vent_now(self) -> None:
        return  # the next sample does

    def close(self) -> None:
        """Vent; nothing else is to be released."""
        self.vent()

    def _all_answers(self, stretch: float) -> dict[str, _Answers]:
        """Answers to a step, a release and a vent; where the check was cut short before one, those to the step reversed."""
        samples, counts = self.samples, self.samples.counts
        vented = samples.commands[:, 3] > 0
        rest, nothing = self._rest.mean(axis=0), np.zeros((1, len(self.names)))

        def of(phase: str) -> np.ndarray:
            return np.asarray(counts[(samples.phase == phase) & ~vented])

        def end(rows: np.ndarray) -> np.ndarray:
            return np.asarray(rows[-max(len(rows) // 4, 1) :].mean(axis=0))

        filled, shut = of("step"), of("shut")
        top = end(filled) if len(filled) else rest
        step = _Answers.of(filled if len(filled) else rest + nothing, rest, top, 1.0, stretch)
        self._shut_off = self.record.rig.plumbing[self.record.plumbing].shut_off is not None
        moved = np.where(top == rest, 1.0, top - rest)
        held = (end(shut) - rest) / moved if len(shut) else np.zeros(len(self.names))
        self._holds = held >= commissioning.HELD_SHARE
        release = vent = step
        emptied = of("release")
        if len(emptied):
            free = np.concatenate([shut, emptied])
            padded = np.concatenate([emptied, np.repeat(end(emptied)[None, :], len(shut), axis=0)])
            release = _Answers.of(np.where(self._holds, padded, free), top, end(emptied), -1.0, stretch)
        begun = int(np.argmax(vented))
        if vented.any() and begun > 0:
            full = counts[max(begun - 8, 0) : begun].mean(axis=0)
            # by as much as the valve's level was above nothing then, which is a whole step in every phase that vents
            vent = _Answers.of(counts[begun:], full, end(counts[begun:]), -1.0, stretch)
        return {"step": step, "release": release, "vent": vent}


def open_replay(request: HardwareRequest) -> Hardware:
    """The backend ``replay``: the machine of the file ``request.place``, whose channels must be those of the rig."""
    record, _ = read_check(request.place)
    known = record.rig.converters(0.0).names
    missing = [n for n in request.rig.converters(0.0).names if n not in known]
    if missing:
        raise InputError(
            "channels", ", ".join(missing), "the machine of the check has", known=known, where=request.place
        )
    return ReplayedHardware(record)


# ---- check, calibration and first protocol


class ReplayStep(NamedTuple):
    """What became of one use of the machine: its name, whether it went well, and a sentence."""

    name: str
    passed: bool
    sentence: str


@dataclasses.dataclass(frozen=True)
class Replay:
    """What a machine that is not here does in check, calibration and first protocol: what `replay_check` computes.

    Attributes:
        record: the check.
        check: what the tests of this version find; None where the machine was refused or lost.
        steps: check, comparison with what was found then, calibration and protocol.
    """

    record: CheckRecord
    check: MachineCheck | None
    steps: tuple[ReplayStep, ...]

    @property
    def passed(self) -> bool:
        """Whether all went well."""
        return all(step.passed for step in self.steps)


def replay_check(path: str | os.PathLike[str], *, muscle: Any = "nylon") -> Replay:
    """Run check, calibration and first protocol on the machine of a recorded check, as if it were here.

    The protocol is one isometric step to the pressure of the check, with its rig, plumbing and rate.

    Args:
        path: file that ``mckibben device check --out FILE.json`` has written.
        muscle: specimen, its id or file, that the dry run of the protocol takes for the mounted one.

    Raises:
        InputError: as of `read_check`.

    Examples:
        >>> import mckibben as mk
        >>> from mckibben_hardware.commissioning import record_check, simulated_machine
        >>> record = record_check(simulated_machine(mk.rig("modern"), "nylon"), mk.rig("modern"))
        >>> [step.passed for step in replay_check(write_check("check.json", record, record.judge())).steps]
        [True, True, True, True]
    """
    record, then = read_check(path)
    muscle = muscle_specimen(muscle) if isinstance(muscle, str) else muscle
    outcome, steps = _check_step(record)
    if outcome is not None:
        steps.append(_compared(record, then, outcome))
    for name, use in (("calibrate zero", _zeros), (PROTOCOL, lambda r: _protocol(r, muscle))):
        try:
            steps.append(ReplayStep(name, *use(record)))
        except MckibbenError as error:
            steps.append(ReplayStep(name, False, str(error)))
    return Replay(record, outcome, tuple(steps))


def _check_step(record: CheckRecord) -> tuple[MachineCheck | None, list[ReplayStep]]:
    try:
        outcome = commissioning.check_machine(
            ReplayedHardware(record), record.rig, period=record.period, pressure=record.pressure,
            plumbing=record.plumbing, motor=record.motor,
        )  # fmt: skip
    except MckibbenError as error:
        return None, [ReplayStep("check", False, str(error))]
    failures = outcome.failures()
    said = "; ".join(f"{r.channel}: {r.sentence}" for r in failures)
    tested = sum(r.passed is not None for r in outcome.results)
    return outcome, [ReplayStep("check", outcome.passed, said or f"{tested} of {tested} tests passed")]


def _compared(record: CheckRecord, then: tuple[CheckResult, ...], now: MachineCheck) -> ReplayStep:
    """Whether the tests find what they found when the file was written."""
    words = {True: "passed", False: "failed", None: "not tested"}
    before = {(r.channel, r.test): words[r.passed] for r in then}
    after = {(r.channel, r.test): words[r.passed] for r in now.results}
    changed = [
        f"{' '.join(key)}: then {before.get(key, 'no test')}, now {after.get(key, 'no test')}"
        for key in {**before, **after} if before.get(key) != after.get(key)
    ]  # fmt: skip
    version = record.versions.get("mckibben", "of an unknown version")
    return ReplayStep(
        "as then", not changed, "; ".join(changed) or f"each test finds what it found with mckibben {version}"
    )


def _zeros(record: CheckRecord) -> tuple[bool, str]:
    """Zeros of all analogue channels whose scales go below zero, by the session that calibrates a machine."""
    scales = grids(record.rig)
    names = [n for n in record.rig.converters(0.0).names if scales[n].low < 0.0]
    if not names:
        return True, "not tested: each scale begins at zero, of which only what is above it can be read"

    def rests(task: OperatorTask) -> None:
        """The machine of a check rests where it is not asked for anything."""

    with HardwareReadings(ReplayedHardware(record), record.rig.converters(0.0), scales) as readings:
        session = CalibrationSession(source=readings, ask=rests, date=record.created)
        found = session.zero(names).corrections
    zeros = {n: found[n].terms["zero"].value for n in names}
    said = ", ".join(f"{n} {with_unit(zeros[n], scales[n].unit)}" for n in names)
    beyond = [n for n in names if abs(zeros[n]) > commissioning.ZERO_SHARE * scales[n].range]
    why = f": {' and '.join(beyond)} must be at rest near nothing" if beyond else ""
    return not beyond, f"zeros of {said}{why}"


def _protocol(record: CheckRecord, muscle: Any) -> tuple[bool, str]:
    """One isometric step to the pressure of the check: how it ended, and where the pressure settled."""
    bench = prepare(
        PROTOCOL, muscle=muscle, rig=record.rig, plumbing=record.plumbing, accept_saturation=True,
        sample_rate=f"{1.0 / record.period!r} Hz", high=f"{record.pressure!r} Pa", cycles=1,
    )  # fmt: skip
    recording = run(bench, hardware=ReplayedHardware(record))
    done = recording.meta["result"] == "done"
    if not done:
        return False, f"{recording.meta['result']}: {recording.meta['message']}"
    asked = recording["command.pressure"] > 0.5 * record.pressure
    held = recording["pressure"][asked] if "pressure" in recording.channels else np.full(1, math.nan)
    reached = float(held[-max(len(held) // 4, 1) :].mean())
    right = abs(reached / record.pressure - 1.0) <= commissioning.SCALE_SHARE
    ends = f"{with_unit(reached, 'Pa')} of {with_unit(record.pressure, 'Pa')}"
    return right, f"done in {recording.duration:.3g} s; the pressure came to {ends}"
