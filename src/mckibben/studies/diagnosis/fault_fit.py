"""Diagnosis of a rig from a recording of normal operation: which fault, how large, and what cannot be told apart.

    r = measured - sound prediction,   L_k = max over the fault's value v of  (|r|^2 - |r - d_k(v)|^2)/(s^2 w^2)

Each fault of `RigFaults` is fitted alone; d_k(v) is its effect on the readings. Readings are averaged over blocks, in
units of the standard deviation s that the residual of all faults together has, widened by w for neighbouring blocks that
are alike. L_k is twice the logarithm of the likelihood ratio against the sound rig. The largest one beyond `THRESHOLD`
names the fault; others within `TELLING` of it explain the record nearly as well.

The rig's own description is the model: what it leaves out, such as another muscle than the one it names, looks like a fault.
One fault at a time is identified; where one does not explain the record, the diagnosis says so.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.optimize import lsq_linear

from ...answers import Answer, Caution, Column, Table
from ...assembly.build import rig_unit
from ...assembly.muscle_unit import MuscleUnit
from ...bench.recorder import ASKED
from ...bench.rig import DRIFT, Plumbing, Rig, RigFaults
from ...bench.rig_file import read_rig
from ...bench.rig_file import rig as rig_of
from ...documents import JsonValue
from ...errors import InputError
from ...estimation import NORMAL_QUANTILE, Estimate, akaike, descend_in_lanes, widening
from ...muscles import Muscle
from ...pneumatics.valves import PressureRegulator
from ...quantities import declared, from_si, with_unit
from ...recordings.files import read_recording
from ...recordings.recording import Recording
from ...specimens import Specimen
from ...verbs import MuscleName, PlumbingName, RecordingFile, RigName, verb
from .observer import (
    CHANNELS,
    MOTION,
    START_FRICTION,
    START_GAS,
    START_PORT,
    START_SLIP,
    Observer,
    RecordedSection,
    stated_numbers,
)

# Above what sound runs reach, see docs/explanation/diagnosis.md.
THRESHOLD = 30.0
TELLING = 6.0  # a likelihood e^3 times smaller: such a fault is not excluded
BLOCK = 0.02  # readings are averaged over it [s]
# A section is compared from where it has forgotten how friction and pressure at the valve began, which no recording says:
# starts as different as these are predicted alike, to a share of the noise of a block. It is at most a share of it.
# What is left of them then is noise to each fault, as are another motion and more gas, each up to so many times its step.
FARTHEST_START = 3.0
STARTS = ({START_FRICTION: 0.02}, {START_FRICTION: -0.02}, {START_PORT: 0.02}, {START_PORT: -0.02})
FORGOTTEN, SKIPPED, FEWEST_SKIPPED = 0.1, 0.25, 2
LEAST_GRIP = 1e-3  # of a clamp that is searched [N]
SHORTEST = 0.2  # of a section [s]
MOST_SECTIONS, MOST_SAMPLES = 8, 20_000
ROUNDS, LADDER = 4, 9  # of the search for a fault's value, and values of each
# Values at which the effect of a fault begins to be seen [SI], in which it is searched.
SIZES = {
    "leak": 3e-11,
    "valve_blockage": 0.05,
    "valve_sticking": 100.0,
    "pressure_drift": 20.0,
    "valve_pressure_drift": 20.0,
    "tension_drift": 0.02,
    "span_drift": 2e-5,
    "clamp_slack": 1e-4,
    "clamp_grip": 0.05,  # by which it is below the largest tension
    "lost_threads": 0.01,
    "rubber_warming": 5.0,
}
# Sizes up to which it is no fault but the tolerance of parts, to which no description of a rig is true [SI]: a valve's flow,
# a frame that warms by a few kelvins, a tenth of an encoder's count in a second, less than one thread, the weather.
TOLERANCES = {
    "valve_blockage": 0.01, "clamp_slack": 1e-5, "span_drift": 1e-6, "lost_threads": 2e-3, "rubber_warming": 1.0,
}  # fmt: skip
# The effects of a play and of a slip are not in proportion to the size: they are predicted at several, in units of that
# above.
RUNGS = {"valve_sticking": (1.0, 3.0, 8.0, 24.0, 64.0), "clamp_grip": (1.0, 8.0, 64.0)}
QUICK_RELEASES = 2, 8  # false alarms of a clamp, of so many sound runs, see benchmarks/diagnosis.py
CLAMP_GRIP = "clamp_grip"  # searched as the tension by which it is below the largest of the sound rig
CLAMP_SLACK = "clamp_slack"
# What such a fault does hangs on the motion to the micrometre, more than the recording tells: its interval spans those of
# other motions that the recording could as well be of.
MOTIONS = (0.5, -0.5, 1.0, -1.0)
FAR = 8.0  # standard errors from the best value up to which other motions are tried
# Shares of the best value beside it, at which a misfit that is no parabola is looked at.
BESIDE = np.array([0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.15, 0.2])
# What a clamp lost before the recording is a second number, for which twice the logarithm of the likelihood must be larger
# by `TELLING`.
SLIP_ROUNDS, SLIP_STEP, EDGES = 2, 1e-3, 4  # rounds of its search, step in shares of the slack, values at either end
# Rounds of the search for such a grip: its hollow, some 0.02 N wide, is at the edge of a plateau: grips that slip no more.
GRIP_ROUNDS = 6
NEARLY = 0.5  # share of the best fault's ratio from which on a fault is looked at as closely
TITLES = {
    "leak": "leak of the muscle's fitting",
    "valve_blockage": "blocked valve",
    "valve_sticking": "sticking valve",
    "pressure_drift": "drifting pressure sensor at the muscle",
    "valve_pressure_drift": "drifting pressure sensor at the valve",
    "tension_drift": "drifting load cell",
    "span_drift": "drifting measurement of the span",
    "clamp_slack": "slack clamp",
    "clamp_grip": "slipping clamp",
    "lost_threads": "braid that has lost threads",
    "rubber_warming": "warm rubber",
}
SHOWN = {
    "leak": "l/(min*bar)", "pressure_drift": "mbar/s", "valve_pressure_drift": "mbar/s", "span_drift": "mm/s",
    "valve_sticking": "mbar", "clamp_slack": "mm",
}  # fmt: skip
# A wrong zero or gain must leave no more than this mean square in units of the sensors' noise, or this share of what there
# was, up to what files leave that describe a recording; and slack acts in proportion to it for no more than this [m].
LEAVES, LEAVES_SHARE, MOST_ZERO = 4.0, 0.01, 5e-3
# Units in which the zero of a sensor is shown, and factors to them.
ZERO_SHOWN = {"span": ("mm", 1e3), "pressure": ("mbar", 1e-2), "valve_pressure": ("mbar", 1e-2), "tension": ("N", 1.0)}
FEWEST_BLOCKS, SCALINGS = 20, 5
NEAR, FEWEST_NEAR = 3.0, 7  # standard errors from the best value, and values, that say how sharp the misfit is
START, LEAST_EFFECT = 0.01, 1e-9  # share of the gas at the start by which its effect is found; least effect that is one
# Rounds in which the description is found, step of its numbers and the farthest that they go, in standard deviations.
DESCRIBED_ROUNDS, OFF_STEP, FARTHEST_OFF = 30, 0.05, 4.0
# Dampings that are tried in each round; change of a number and of twice the logarithm of the likelihood at which it ends.
DAMPINGS, OFF_CLOSE, LIKELY_CLOSE = (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0), 0.05, 0.5
# Mean square left, in units of the noise, beyond which the search begins anew from other rest lengths [deviations].
NOISE_LEFT, OTHER_LENGTHS = 1.5, (-2.0, 2.0)
UNDESCRIBED = 3.0  # noises of the sensors that are left where no description nor fault explains a recording
SAID_OFF, MOST_OFF = 0.5, 4  # usual errors from which on a number is shown, and numbers in a sentence
# Share of a fault's size at which its effect is taken, too, beside numbers that may be off: at the whole size what bends in
# it is no number's and seems to tell it from them; at a small one that is so of a simulation's roughness.
SMALL = 0.1


class FaultFit(NamedTuple):
    """A fault fitted alone.

    Attributes:
        name: as in the rig's file.
        estimate: its value with a 95 % interval [SI].
        ratio: twice the logarithm of its likelihood over that of the sound rig.
        aicc: Akaike's criterion less that of the sound rig; negative where the fault explains the record better.
        limit: value from which on this recording would show it [SI].
        sound: value that a sound rig has as far as the recording loads it: zero, but the largest tension of a clamp's grip.
        slipped_before: span that a slipping clamp has lost before the recording [m]; zero where that explains no more.
    """

    name: str
    estimate: Estimate
    ratio: float
    aicc: float
    limit: float
    sound: float = 0.0
    slipped_before: float = 0.0

    @property
    def title(self) -> str:
        """The fault in words."""
        return TITLES[self.name]


class NumberOff(NamedTuple):
    """A number of the muscle's or rig's file, and what the recording says of it.

    Attributes:
        path: such as ``muscle.law.passive_stiffness``.
        change: what it has to be more than stated, as a share of that.
        off: the same in standard deviations of what such numbers are usually off by.
    """

    path: str
    change: float
    off: float

    def __str__(self) -> str:
        return f"{self.path} {100.0 * self.change:+.2g} %"


@dataclass(frozen=True)
class Diagnosis(Answer):
    """Result of a diagnosis.

    Attributes:
        faults: all faults, the most likely first.
        fault: name of the fault that was found; empty if the rig is sound as far as the recording shows, or `calibration`
            explains it better.
        alternatives: names of faults that explain the recording nearly as well.
        explained: whether one fault, or none, explains the recording.
        threshold: of the likelihood ratio.
        blocks: number of averaged readings.
        not_judged: a sentence for each fault of which this recording or this rig says nothing.
        cautions: about what was named beside the recording and differs from what it states.
        calibration: wrong zero or gain of a sensor that explains the recording better than any fault, in words; else empty.
        tolerance: name of a fault that explains the recording better, but is within `TOLERANCES`; else empty.
        description: numbers of the files of muscle and rig, and how far the recording says they are off, the farthest first;
            empty where they were taken as exact.
        misfit: what every fault together leaves of the recording, over the noise of the sensors [1].
        file: of the recording, where it was read from one.
    """

    faults: tuple[FaultFit, ...]
    fault: str
    alternatives: tuple[str, ...]
    explained: bool
    threshold: float
    blocks: int
    not_judged: tuple[str, ...] = ()
    cautions: tuple[Caution, ...] = ()
    calibration: str = ""
    tolerance: str = ""
    file: str | None = None
    description: tuple[NumberOff, ...] = ()
    misfit: float = 1.0

    @property
    def described(self) -> bool:
        """Whether the files of muscle and rig describe the recording, with or without a fault."""
        return self.explained or bool(self.calibration) or self.misfit < UNDESCRIBED

    def __getitem__(self, name: str) -> FaultFit:
        """Fit of a fault by its name."""
        for one in self.faults:
            if one.name == name:
                return one
        raise InputError("fault", name, known=[one.name for one in self.faults])

    @property
    def sentence(self) -> str:
        """The diagnosis in words."""
        if not self.described:
            return (
                f"The files of muscle and rig do not describe this recording: {self.misfit:.2g} times the noise of the"
                " sensors is left, whatever fault there is and wherever their numbers lie within what such are usually off"
                " by. Fit the muscle anew, and diagnose with that: no fault can be told beside it."
            )
        if self.calibration:
            nearest = self.faults[0]
            return (
                f"No fault of the list: {self.calibration} explains the recording better than any of them. Calibrate the "
                f"sensor, and diagnose again. The nearest fault would be: {nearest.title}, "
                f"{shown(nearest.name, nearest.estimate.value)}."
            )
        if self.tolerance:
            nearest = self[self.tolerance]
            value, most = (shown(nearest.name, v) for v in (nearest.estimate.value, TOLERANCES[nearest.name]))
            if not self.explained:
                return (
                    f"No fault of the list explains the recording: there is something else. The nearest, {nearest.title}, "
                    f"would be of {value}; up to {most} is within the tolerance of parts."
                )
            return (
                f"No fault: the sound rig explains the recording. The nearest fault, {nearest.title}, would be of {value}; "
                f"up to {most} is within the tolerance of parts."
            )
        if not self.fault:
            off = [str(one) for one in self.description if abs(one.off) >= 1.0][:MOST_OFF]
            beside = f", with what its files state off by: {', '.join(off)}" if off else ""
            return f"No fault: the sound rig explains the recording{beside}."
        best = self[self.fault]
        value, low, high = (shown(best.name, v) for v in best.estimate[:3])
        said = f"{best.title.capitalize()}: {value} (95 %: {low} to {high})."
        if best.slipped_before > 0.0:
            said += f" It lost {shown(CLAMP_SLACK, best.slipped_before)} of span before the recording."
        if self.alternatives:
            others = ", ".join(TITLES[name] for name in self.alternatives)
            said += f" The recording cannot tell it from: {others}."
        if not self.explained:
            said += " It does not explain the recording alone: there is another fault, or something that is not in the list."
        return said

    def __repr__(self) -> str:
        return f"Diagnosis({self.sentence})"

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per fault."""
        return [
            {"fault": one.name, **one.estimate._asdict(), "ratio": one.ratio, "aicc": one.aicc, "limit": one.limit}
            for one in self.faults
        ]

    def tables(self) -> list[Table]:
        """Each fault alone, below the diagnosis in words."""
        columns = (
            Column("title", "each fault alone"),
            Column("value", right=True),
            Column("interval", "95 %", right=True),
            Column("limit", "seen from", right=True),
            Column("ratio", "likelihood ratio", "1", places=".1f"),
        )
        rows = [
            {
                "title": one.title,
                "value": shown(one.name, one.estimate.value),
                "interval": f"{shown(one.name, one.estimate.low)} to {shown(one.name, one.estimate.high)}",
                "limit": shown(one.name, one.limit),
                "ratio": one.ratio,
            }
            for one in self.faults
        ]
        off = [one for one in self.description if abs(one.off) >= SAID_OFF]
        stated = Table(
            "What the files of muscle and rig state, and what the recording says of it",
            (
                Column("path", "number"),
                Column("change", "off by", "%", places="+.2f"),
                Column("off", "usual errors", "1", places="+.1f"),
            ),
            [one._asdict() for one in off],
            ("A fault is named beyond what such numbers are usually off by; exact files show smaller ones.",),
        )
        least = f"A fault is reported from a likelihood ratio of {self.threshold:.0f} on; {self.blocks} readings."
        return [Table(self.sentence, columns, rows, (*self.not_judged, least)), *([stated] if off else [])]

    def to_dict(self) -> dict[str, JsonValue]:
        """Plain values for JSON [SI]."""
        return ({} if self.file is None else {"file": self.file}) | {
            "fault": self.fault or None,
            "sentence": self.sentence,
            "alternatives": list(self.alternatives),
            "explained": self.explained,
            "threshold": self.threshold,
            "blocks": self.blocks,
            "not_judged": list(self.not_judged),
            "cautions": [one.text for one in self.cautions],
            "calibration": self.calibration or None,
            "tolerance": self.tolerance or None,
            "description": [one._asdict() for one in self.description],
            "misfit": self.misfit,
            "described": self.described,
            "faults": [
                one.estimate._asdict() | {name: value for name, value in one._asdict().items() if name != "estimate"}
                for one in self.faults
            ],
        }


def shown(name: str, value: float) -> str:
    """Format the value of a fault with its usual unit."""
    unit = declared(RigFaults)[name].unit
    if name == CLAMP_GRIP:  # known to a part of its own that is smaller than of other faults
        return with_unit(value, unit, 5)
    if name in SHOWN:
        return f"{from_si(value, unit, SHOWN[name]):.3g} {SHOWN[name]}".replace("l/(min*bar)", "l/min/bar")
    return f"{100.0 * value:.3g} %" if unit == "1" else with_unit(value, unit, 3)


_OF_RECORDING = "rig of the recording"


@verb
def diagnose(
    recording: RecordingFile,
    *,
    muscle: MuscleName | None = None,
    rig: RigName | None = None,
    plumbing: PlumbingName | None = None,
    exact: bool = False,
) -> Diagnosis:
    """Find a fault of a rig from a recording of its normal operation.

    Each fault is fitted alone to pressures and tension, given the recorded command of the valve and the span: a leak, a
    blocked or sticking valve, a drifting sensor, a slack or slipping clamp, lost threads, warm rubber. Of what this
    recording or rig cannot show it says so. The numbers of the muscle's law may be off by 5 % and its lengths by 0.5 mm, its
    friction and creep by 20 %, the valve's flow by 1.5 % (standard deviations): a fault is what is left beyond that.

    Args:
        recording: a normal run: a recording or its file, with the channels ``span``, ``valve.command`` and at least one of
            ``pressure``, ``valve_pressure`` and ``tension``.
        muscle: sound muscle: id or .toml file; by default as the recording states it.
        rig: sound rig: paper, modern, or a .toml file; by default as the recording states it, without its faults.
        plumbing: plumbing that joins the rig's pneumatic parts; by default as the recording states it.
        exact: take every number of muscle and rig as exact, as after a characterisation on this rig; shows smaller faults.

    Raises:
        InputError: names what is missing.
        ConvergenceError: the rig cannot be simulated with what was recorded.

    Examples:
        >>> import mckibben as mk
        >>> leaking = mk.rig("modern", {"faults.leak": "0.5 l/min/bar"})
        >>> mk.diagnose(mk.run("work-loop", leaking, muscle="nylon", cycles=2)).fault
        'leak'
    """
    record = read_recording(recording)
    where = None if isinstance(recording, Recording) else str(recording)
    _check_stated(record, rig, muscle, plumbing, where)
    try:
        observer = observer_of(record, rig, muscle=muscle, plumbing=plumbing, exact=exact)
    except InputError as error:
        raise error.at(where) if where and error.where == _OF_RECORDING else error from None
    try:
        sections = sections_of(record, observer.channels, shut_off=observer.plumbing.shut_off is not None)
    except InputError as error:
        raise error.at(where) if where else error from None
    found = diagnose_sections(observer, sections)
    said = _differences(record, observer.rig, rig)
    if found.fault == CLAMP_GRIP and found.description:
        alarms, runs = QUICK_RELEASES
        called = f"of {runs} sound quick releases beside files that were off {alarms} were called a slipping clamp"
        would = "look at the clamp, or characterise the muscle and take its file as {exact}"
        said += (Caution(f"{called}: {would}", "recording"),)
    return replace(found, cautions=said, file=where)


def _differences(record: Recording, named: Rig, rig: Rig | str | os.PathLike[str] | None) -> tuple[Caution, ...]:
    """A caution where the rig that was named is not that of the recording: what differs looks like a fault."""
    stated = record.meta.get("rig_document")
    if rig is None or not isinstance(stated, Mapping):
        return ()
    words = {"faults", "name", "title", "source", "note", "inferred"}
    keys = sorted(k for k in {*stated, *named.document} - words if stated.get(k) != named.document.get(k))
    if not keys:
        return ()
    differs = (
        f"the recording was made on the rig {record.meta.get('rig')}; the rig {named.name} differs from it in "
        f"{', '.join(keys)}, which may be taken for a fault"
    )
    return (Caution(differs, "rig"),)


def observer_of(
    record: Recording,
    rig: Rig | str | os.PathLike[str] | None = None,
    *,
    muscle: str | Specimen | Muscle | MuscleUnit | None = None,
    plumbing: str | None = None,
    exact: bool = False,
) -> Observer:
    """Build the sound rig of a recording; arguments as of `diagnose`."""
    on = _sound_rig(record, rig)
    joined = _layout(on, record, plumbing)
    timing = record.meta.get("timing")
    latency = float(timing["latency"]) if isinstance(timing, Mapping) else float(on.computer.latency)
    unit = _sound_unit(record, muscle)
    return Observer(joined, unit, on, latency, () if exact else stated_numbers(joined, unit))


def _layout(on: Rig, record: Recording, plumbing: str | None) -> Plumbing:
    layout = record.meta.get("plumbing") if plumbing is None else plumbing
    layout = next(iter(on.plumbing)) if layout is None else layout
    if layout not in on.plumbing:
        raise InputError("plumbing", str(layout), known=list(on.plumbing))
    joined = on.plumbing[str(layout)]
    if not joined.has_muscle:
        raise InputError("plumbing", str(layout), "has no muscle; a diagnosis needs one")
    return joined


def _check_stated(
    record: Recording,
    rig: Rig | str | os.PathLike[str] | None,
    muscle: str | Specimen | Muscle | MuscleUnit | None,
    plumbing: str | None,
    where: str | None,
) -> None:
    """Refuse a recording, such as one of another program, with all that is missing in one sentence.

    What the caller has named is checked before.
    """
    missing = []
    if rig is not None:
        _layout(_sound_rig(record, rig), record, plumbing)
    if muscle is not None:
        _sound_unit(record, muscle)
    if rig is None and not isinstance(record.meta.get("rig_document"), Mapping):
        missing.append("it does not state its rig, so name the sound one")
    if muscle is None and record.meta.get("specimen") is None:
        missing.append("it does not state its muscle, so name the sound one")
    inputs = [name for name in ("span", "valve.command") if name not in record]
    missing += [f"it has no channel {name}, which drives the sound rig" for name in inputs]
    events = record.meta.get("events")
    texts = [str(e.get("text")) for e in events if isinstance(e, Mapping)] if isinstance(events, list | tuple) else []
    changes = [text for text in texts if text.startswith(ASKED)]
    missing += [f"in its run the operator was {ask}, after which it is another rig or muscle" for ask in changes[:1]]
    if not any(name in record for name in CHANNELS):
        missing.append(f"it has none of {', '.join(CHANNELS)}, to compare with the sound rig")
    if missing:
        by_channels = inputs or len(missing) > len(inputs) + len(changes[:1])
        named = f" (its channels are {', '.join(record.names())})" if by_channels else ""
        sentence = f"the recording cannot be diagnosed: {'; '.join(missing)}{named}"
        raise InputError("recording", None, sentence, sentence=sentence, where=where)


def _sound_rig(record: Recording, rig: Rig | str | os.PathLike[str] | None) -> Rig:
    if isinstance(rig, Rig):
        return replace(rig, faults=RigFaults())
    if rig is not None:
        return replace(rig_of(rig), faults=RigFaults())
    document = record.meta.get("rig_document")
    if not isinstance(document, Mapping):
        raise InputError("rig", None, "is missing: the recording does not state its rig")
    return read_rig({k: v for k, v in document.items() if k != "faults"}, where=_OF_RECORDING)


def _sound_unit(record: Recording, muscle: str | Specimen | Muscle | MuscleUnit | None) -> MuscleUnit:
    named = record.meta.get("specimen") if muscle is None else muscle
    if named is None:
        raise InputError("muscle", None, "is missing: the recording does not state its muscle")
    return rig_unit(named if isinstance(named, MuscleUnit | Muscle | Specimen) else str(named))


def sections_of(record: Recording, channels: Sequence[str], *, shut_off: bool = False) -> list[RecordedSection]:
    """Cut a recording at its gaps into sections of one length.

    Raises:
        InputError: names the channel that is missing, or says that the recording is too short.
    """
    for name in ("span", "valve.command", *(["shut_off.command"] if shut_off else [])):
        if name not in record:
            raise InputError("channels", name, f"is missing: the recording has {', '.join(record.names())}")
    measured = [name for name in channels if name in record and np.isfinite(record[name]).all()]
    if not measured:
        raise InputError("channels", None, f"must be at least one of {', '.join(CHANNELS)}")
    time, period = record.time, record.period
    ends = [0, *(np.flatnonzero(np.diff(time) > 1.5 * period) + 1), len(time)]
    pieces = [(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True) if (b - a) * period >= SHORTEST]
    longest = max((b - a for a, b in pieces), default=0)
    pieces = [(a, b) for a, b in pieces if 2 * (b - a) > longest][:MOST_SECTIONS]
    size = min(min((b - a for a, b in pieces), default=0), MOST_SAMPLES)
    if len(pieces) * size * period * (1.0 - SKIPPED) < FEWEST_BLOCKS * BLOCK:
        raise InputError("recording", None, f"must have {FEWEST_BLOCKS * BLOCK / (1.0 - SKIPPED):.2g} s or more")
    places = [slice(a, a + size) for a, _ in pieces]
    return [
        RecordedSection(
            time[at],
            record["span"][at],
            record["valve.command"][at],
            record["shut_off.command"][at] if shut_off else np.ones(size),
            {name: record[name][at] for name in measured},
        )
        for at in places
    ]


def known_faults(observer: Observer, measured: Sequence[str]) -> tuple[str, ...]:
    """Faults that the rig can have and the measured channels can show."""
    names = []
    for name in SIZES:
        of_valve = name.startswith("valve_") and not name.endswith(DRIFT)
        if of_valve and not isinstance(observer.plumbing.valve, PressureRegulator):
            continue
        if name == CLAMP_GRIP and "tension" not in measured:
            continue
        if name.endswith(DRIFT) and name != "span_drift" and name.removesuffix(DRIFT) not in measured:
            continue
        names.append(name)
    return tuple(names)


def _not_judged(compare: _Comparison, names: Sequence[str], limits: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence for each fault of which nothing can be said, and why."""
    said = []
    for name in SIZES:
        title = f"{TITLES[name].capitalize()}: not judged"
        if name in names:
            if not limits[name] < compare.bounds(name)[1]:
                said.append(f"{title}, since in this recording even the largest would not show.")
            continue
        channel = "tension" if name == CLAMP_GRIP else name.removesuffix(DRIFT)
        if name.startswith("valve_") and not name.endswith(DRIFT):
            said.append(f"{title}, since the valve of this rig is no pressure regulator.")
        elif channel not in compare.observer.rig.sensors:
            said.append(f"{title}, since this rig does not measure {channel}.")
        else:
            said.append(f"{title}, since the recording does not have {channel} throughout.")
    return tuple(said)


class _Comparison:
    """Measured and predicted blocks of all sections, in units of their standard deviation."""

    def __init__(self, observer: Observer, sections: Sequence[RecordedSection]) -> None:
        self.observer, self.sections = observer, sections
        self.channels = [name for name in observer.channels if name in sections[0].measured]
        self.rows = [observer.channels.index(name) for name in self.channels]
        self.size = max(1, round(BLOCK / float(np.mean(np.diff(sections[0].time)))))
        self.scale = np.ones((len(self.channels), 1))
        self.starts = np.zeros((0, len(self.channels), 0))
        self.rough = np.zeros((len(self.channels), 1))
        self.largest = 0.0
        self.slipped = 0.0
        self.described: dict[str, float] = {}  # the description that is taken, in deviations from the stated one
        self.loose = np.zeros((0, len(self.channels), 0))  # effects of a deviation of each of its numbers
        self.firsts = [0] * len(sections)
        self.measured = np.zeros((len(self.channels), 0))

    def readings(self, values: Sequence[Mapping[str, float]]) -> list[np.ndarray]:
        """Readings (sets, channels, n) of each section predicted for sets of faults [SI]."""
        real = [self.real(one) for one in values]
        return [table[:, self.rows] for table in self.observer.predict_all(self.sections, real)]

    def real(self, values: Mapping[str, float]) -> dict[str, float]:
        """Faults of the rig [SI] from what is searched: the grip of a clamp from the tension by which it is too low."""
        real = {n: max(self.largest - v, LEAST_GRIP) if n == CLAMP_GRIP else v for n, v in values.items()}
        real = self.described | real
        return {START_SLIP: self.slipped, **real} if CLAMP_GRIP in real else real

    def searched(self, name: str, value: float) -> float:
        """What is searched of a fault of the rig [SI]; the reverse of `real`."""
        return self.largest - value if name == CLAMP_GRIP else value

    def bounds(self, name: str) -> tuple[float, float]:
        """Bounds of what is searched of a fault [SI]."""
        low, high = declared(RigFaults)[name].bounds
        return (0.0, max(self.largest - LEAST_GRIP, 0.0)) if name == CLAMP_GRIP else (low, high)

    def begin(self, tables: Sequence[np.ndarray]) -> None:
        """Compare from where the sections have forgotten their start.

        Args:
            tables: readings (1 + starts, channels, n) of each section for the start that is taken, and for `STARTS`.
        """
        least = FORGOTTEN * self.noise()
        for i, table in enumerate(tables):
            blocks = self._averaged(table, 0)
            off = (np.abs(blocks[1:] - blocks[0]) > least[:, None]).any(axis=(0, 1))
            after = int(np.flatnonzero(off)[-1]) + 1 if off.any() else 0
            most = max(int(SKIPPED * table.shape[-1]) // self.size, FEWEST_SKIPPED)
            self.firsts[i] = self.size * int(np.clip(after, FEWEST_SKIPPED, most))
        self.measured = self.blocks([np.array([s.measured[name] for name in self.channels]) for s in self.sections])

    def noise(self) -> np.ndarray:
        """Standard deviation that the noise of each channel's sensor leaves of a block [unit of the channel]."""
        sensors = [self.observer.rig.sensors[name] for name in self.channels]
        least: np.ndarray = np.array([float(max(s.noise, 0.02 * s.resolution)) for s in sensors]) / np.sqrt(self.size)
        return least

    def _averaged(self, table: np.ndarray, first: int) -> np.ndarray:
        count = (table.shape[-1] - first) // self.size
        kept = table[..., first : first + count * self.size]
        averaged: np.ndarray = kept.reshape(*kept.shape[:-1], count, self.size).mean(axis=-1)
        return averaged

    def blocks(self, tables: Sequence[np.ndarray]) -> np.ndarray:
        """Average tables (.., channels, n) of all sections over blocks: (.., channels, blocks)."""
        return np.concatenate([self._averaged(t, f) for t, f in zip(tables, self.firsts, strict=True)], axis=-1)

    def of_each_section(self, effects: np.ndarray) -> np.ndarray:
        """Split effects (k, channels, blocks) into one of each section: every section has a start of its own."""
        counts = [(len(s.time) - first) // self.size for s, first in zip(self.sections, self.firsts, strict=True)]
        section = np.repeat(np.arange(len(counts)), counts)
        return np.concatenate([effects * (section == i) for i in range(len(counts))])

    def predict(self, values: Sequence[Mapping[str, float]]) -> np.ndarray:
        """Blocks (sets, channels, blocks) predicted for sets of faults [SI]."""
        return self.blocks(self.readings(values))

    def misfits(self, values: Sequence[Mapping[str, float]]) -> np.ndarray:
        """Sums of squares (sets,) of measured less predicted blocks in units of the standard deviations."""
        off = self.scaled(self.measured - self.predict(values))
        misfits: np.ndarray = np.nan_to_num((off**2).sum(axis=1), nan=np.inf)
        return misfits

    @property
    def spread(self) -> np.ndarray:
        """Standard deviation of each block (channels, blocks): of its channel, and of the motion where that is rough."""
        spread: np.ndarray = np.sqrt(self.scale**2 + self.rough**2)
        return spread

    def scaled(self, blocks: np.ndarray) -> np.ndarray:
        """Blocks as rows (..., channels times blocks), in units of the standard deviations, with what is unknown as noise.

        What start and motion of each section and the numbers of the description may do is noise too, of a covariance with
        one direction for each. A combination of them has less weight as far as it would show, however small its share is:
        two starts of the friction nearly cancel, but for the moment in which the braid is released.
        """
        rows: np.ndarray = (blocks / self.spread).reshape(*blocks.shape[:-2], -1)
        unknown = np.array([*(FARTHEST_START * self.starts), *self.loose])
        if not len(unknown):
            return rows
        left, strength, _ = np.linalg.svd((unknown / self.spread).reshape(len(unknown), -1).T, full_matrices=False)
        kept: np.ndarray = rows - ((rows @ left) * (1.0 - 1.0 / np.sqrt(1.0 + strength**2))) @ left.T
        return kept


def diagnose_sections(observer: Observer, sections: Sequence[RecordedSection]) -> Diagnosis:
    """Diagnose a rig from sections of a recording; see `diagnose`.

    Where another motion that the recording could as well be of changes a block or its neighbours by more than the noise, the
    variance of the block is larger by the square of that change.
    """
    compare = _Comparison(observer, sections)
    sound = _describe(compare, {})
    found = _judge(compare, sound.around)
    if found.fault:  # the description was bent as if the rig were sound; with the fault it may be as stated
        beside = _describe(compare, {found.fault: compare.searched(found.fault, found[found.fault].estimate.value)})
        gain = sound.unlikely - beside.unlikely
        if observer.description and found.fault not in RUNGS and not gain > THRESHOLD:
            # The judgement took what the numbers do in proportion. Found anew, they explain as much without the fault.
            lesser = [one._replace(ratio=min(one.ratio, max(gain, 0.0))) for one in found.faults]
            left = float(np.sqrt(sound.left))
            found = replace(
                found,
                fault="",
                alternatives=(),
                explained=left < UNDESCRIBED,
                faults=tuple(sorted(lesser, key=lambda one: -one.ratio)),
                misfit=max(found.misfit, left),
            )
        else:
            again = _judge(compare)
            found = again if again.fault == found.fault else found
    # nor may it be bent for a wrong zero, or for a clamp that slips or a valve that sticks, beside which it leads nowhere
    if observer.description and (not found.explained or found.fault in RUNGS):
        stated = diagnose_sections(observer._replace(description=()), sections)
        found = stated if stated.explained or stated.calibration else found
    if not found.described:
        found = replace(found, fault="", alternatives=(), calibration="", tolerance="")
    return found


def _around(compare: _Comparison) -> list[dict[str, float]]:
    """Sets of values: a rig as it is described, other starts and motion of it, and a step of each number described."""
    steps = [{n: off + OFF_STEP} for n, off in compare.described.items()]
    return [{}, {START_GAS: START}, *STARTS, {MOTION: 1.0}, *steps]


def _begin_around(compare: _Comparison, tables: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Take starts and motion of the readings of `_around`, and return blocks of the rig as described, and of the steps."""
    last = 2 + len(STARTS)
    compare.begin([np.concatenate([table[:1], table[2:last]]) for table in tables])
    blocks = compare.blocks(tables)
    compare.starts = compare.of_each_section(blocks[1 : last + 1] - blocks[0])
    rough = maximum_filter1d(np.abs(blocks[last] - blocks[0]), 3, axis=1)
    compare.rough = np.where(rough > compare.noise()[:, None], rough, 0.0)
    return blocks[0], (blocks[last + 1 :] - blocks[0]) / OFF_STEP


class _Description(NamedTuple):
    """Numbers of a description, in deviations from the stated ones, and what speaks against them.

    Attributes:
        numbers: by their paths.
        unlikely: twice the negative logarithm of their likelihood.
        left: mean square that they leave, in units of the noise.
        around: readings of the sets of `_around`; None where the search was not at its end.
    """

    numbers: dict[str, float]
    unlikely: float
    left: float
    around: list[np.ndarray] | None


def _describe(compare: _Comparison, fault: Mapping[str, float]) -> _Description:
    """Find the most probable numbers of the description, given a fault: least squares with what is stated as the prior.

    A slack muscle pulls with nothing whatever its length is, so that no small change says that it should be taut: where more
    than noise is left, the search begins anew from a shorter and from a longer muscle.
    """
    names = [one.path for one in compare.observer.description]
    compare.described = dict.fromkeys(names, 0.0)
    if not names:
        return _Description({}, 0.0, 0.0, None)
    lengths = [name for name in names if name.endswith(".rest_length")]
    best = _descend(compare, fault, compare.described)
    for start in ({name: off} for name in lengths for off in OTHER_LENGTHS):
        if best.left < NOISE_LEFT:
            break
        best = min(best, _descend(compare, fault, dict.fromkeys(names, 0.0) | start), key=lambda one: one.unlikely)
    compare.described, compare.starts = best.numbers, compare.starts[:0]
    return best


def _descend(compare: _Comparison, fault: Mapping[str, float], start: Mapping[str, float]) -> _Description:
    """Most probable description near a start, by Levenberg and Marquardt.

    Noise beyond that of the sensors is unknown, by one factor for all of them.
    """
    names, compare.described = list(start), dict(start)
    compare.loose, compare.scale = compare.loose[:0], compare.noise()[:, None]
    for _ in range(DESCRIBED_ROUNDS):
        tables = compare.readings([{**fault, **one} for one in _around(compare)])
        predicted, effects = _begin_around(compare, tables)
        off = compare.measured - predicted
        stated = np.array([*compare.described.values()])
        now = _Description(
            compare.described, _unlikely(compare, off, stated), float((compare.scaled(off) ** 2).mean()), tables
        )
        trials = np.array([_step_of(compare, off, effects, stated, damping) for damping in DAMPINGS])
        if np.abs(trials[0] - stated).max() < OFF_CLOSE:
            return now
        blocks = compare.predict([{**fault, **dict(zip(names, one, strict=True))} for one in trials.tolist()])
        tried = [_unlikely(compare, compare.measured - b, one) for b, one in zip(blocks, trials, strict=True)]
        best = int(np.argmin(np.nan_to_num(tried, nan=np.inf)))
        if not now.unlikely - tried[best] > LIKELY_CLOSE:
            return now
        compare.described = dict(zip(names, trials[best].tolist(), strict=True))
    return now._replace(numbers=compare.described, unlikely=tried[best], around=None)


def _unlikely(compare: _Comparison, off: np.ndarray, stated: np.ndarray) -> float:
    """Twice the negative logarithm of the posterior of a description, with the noise that it leaves."""
    misfit = float((compare.scaled(off) ** 2).sum())
    widest = max(misfit / off.size, 1.0)
    volume = 2.0 * float(np.log(compare.spread / compare.scale).sum())  # of blocks that have less weight
    return misfit / widest + off.size * float(np.log(widest)) + volume + float(stated @ stated)


def _step_of(
    compare: _Comparison, off: np.ndarray, effects: np.ndarray, stated: np.ndarray, damping: float
) -> np.ndarray:
    """Description (k,) to which a damped step leads, with the noise that it would leave, and no number too far off."""
    rows, left = compare.scaled(effects), compare.scaled(off)
    normal, pull = rows @ rows.T, rows @ left
    normal = normal + damping * np.diag(np.diag(normal))
    ends = -FARTHEST_OFF - stated, FARTHEST_OFF - stated
    change, widest = np.zeros(len(stated)), 1.0
    for _ in range(SCALINGS):
        root = np.linalg.cholesky(normal / widest + np.eye(len(stated))).T
        # moduli cancel: one that is cut off at its end by itself leaves thousands of noises
        change = lsq_linear(root, np.linalg.solve(root.T, pull / widest - stated), ends, method="bvls").x
        widest = max(float(np.mean((left - change @ rows) ** 2)), 1.0)
    return stated + change


def _judge(compare: _Comparison, around: Sequence[np.ndarray] | None = None) -> Diagnosis:
    """Judge all faults beside a description that may be off, from where it is most probable.

    Args:
        compare: measured and predicted blocks.
        around: readings of the sets of `_around` without a fault, where they are known.
    """
    names = known_faults(compare.observer, compare.channels)
    compare.loose, compare.starts, compare.slipped = compare.loose[:0], compare.starts[:0], 0.0
    compare.scale = np.ones((len(compare.channels), 1))
    around = compare.readings(_around(compare)) if around is None else around
    tried = [(n, SIZES[n] * rung) for n in names if n != CLAMP_GRIP for rung in RUNGS.get(n, (1.0,))]
    slips: list[tuple[str, float]] = []
    if CLAMP_GRIP in names:
        tension = compare.channels.index("tension")
        compare.largest = max(float(table[0, tension].max()) for table in around)
        slips = [(CLAMP_GRIP, SIZES[CLAMP_GRIP] * rung) for rung in RUNGS[CLAMP_GRIP]]
    tried = [*tried, *slips]
    small = [(n, SMALL * SIZES[n]) for n in names if compare.described and n not in RUNGS]
    others = compare.readings([{n: v} for n, v in (*tried, *small)])
    sound, effects_of_numbers = _begin_around(compare, around)
    further = compare.blocks(others)
    # As if the stated numbers had been predicted with: their deviations are centred there.
    off_by = np.array([*compare.described.values()])
    compare.measured = compare.measured + np.einsum("k,kcb->cb", off_by, effects_of_numbers)
    changed = further[: len(tried)] - sound
    widened = _set_scale(compare, changed, effects_of_numbers, compare.measured - sound)
    compare.loose = effects_of_numbers
    residual = compare.scaled(compare.measured - sound)
    effects = compare.scaled(changed)
    alone = {n: _first_fit(n, tried, effects, residual, widened) for n in names}
    values, spread, likelihoods, limits = ({n: alone[n][i] for n in names} for i in range(4))
    for (n, v), effect in zip(small, further[len(tried) :] - sound, strict=True):
        strength = max(float(np.sum(compare.scaled(effect) ** 2)), 1e-12) / widened
        limits[n] = max(limits[n], _seen_from(np.array([v]), np.array([strength])))
    if max(likelihoods.values()) <= THRESHOLD:
        intervals = {
            n: (values[n] - NORMAL_QUANTILE * spread[n], values[n] + NORMAL_QUANTILE * spread[n]) for n in names
        }
        for name in (n for n in names if n in RUNGS and likelihoods[n] > TELLING):
            searched, ends, _ = _search(compare, [name], values, spread, residual, widened, only=name)
            values, intervals = values | searched, intervals | ends
        return _result(compare, names, values, intervals, likelihoods, limits, residual, explained=True)
    values, intervals, likelihoods = _search(compare, names, values, spread, residual, widened)
    fresh = values, likelihoods
    pulls = compare.largest > SIZES[CLAMP_GRIP]  # else the sound rig loads the clamp with nothing
    if CLAMP_GRIP in names and pulls and _nearly(likelihoods, CLAMP_GRIP, CLAMP_SLACK):
        before = _slipped_before(compare, values, residual, widened)
        intervals[CLAMP_GRIP] = before.interval
        if before.ratio - TELLING > likelihoods[CLAMP_GRIP]:
            values = values | {CLAMP_GRIP: before.value}
            likelihoods = likelihoods | {CLAMP_GRIP: before.ratio - TELLING}
            compare.slipped = before.slip
    best = max(names, key=likelihoods.__getitem__)
    explained = _explains(compare, names, best, values[best], widened)
    if best == CLAMP_GRIP and compare.slipped and not explained:  # two numbers may come nearer without being the fault
        (values, likelihoods), compare.slipped = fresh, 0.0
        best = max(names, key=likelihoods.__getitem__)
        explained = _explains(compare, names, best, values[best], widened)
    slack = changed[[n for n, _ in tried].index(CLAMP_SLACK)] / SIZES[CLAMP_SLACK]
    result = _result(compare, names, values, intervals, likelihoods, limits, residual, explained=explained)
    if result.tolerance:
        return result
    calibration = _calibration_error(compare, {best: values[best]}, sound, slack)
    return (
        replace(result, fault="", alternatives=(), explained=False, calibration=calibration) if calibration else result
    )


class _FirstFit(NamedTuple):
    """A fault fitted by its effect at some sizes: value, standard error [SI], likelihood ratio, and limit [SI]."""

    value: float
    spread: float
    ratio: float
    limit: float


def _first_fit(
    name: str, tried: Sequence[tuple[str, float]], effects: np.ndarray, residual: np.ndarray, widened: float
) -> _FirstFit:
    """Fit a fault by its effects (sets, n) at the sizes that were tried.

    Between two sizes the effect is taken in proportion to the nearer one, below the least and above the largest to that.
    """
    own = [i for i, (n, _) in enumerate(tried) if n == name]
    sizes = np.array([tried[i][1] for i in own])
    effects = effects[own]
    strength = np.maximum((effects**2).sum(axis=1), 1e-12)
    projected = effects @ residual
    share = projected / strength  # of each size
    edges = np.sqrt(sizes[1:] / sizes[:-1])
    low = np.concatenate([[-np.inf if _signed(name) else 0.0], 1.0 / edges])
    share = np.clip(share, low, np.concatenate([edges, [np.inf]]))
    ratios = (2.0 * share * projected - share**2 * strength) / widened
    best = int(np.argmax(ratios))
    ratio, value = max(0.0, float(ratios[best])), float(share[best] * sizes[best])
    return _FirstFit(
        value if ratio > 0.0 else 0.0,
        float(sizes[best] * np.sqrt(widened / strength[best])),
        ratio,
        _seen_from(sizes, strength / widened),
    )


def _seen_from(sizes: np.ndarray, strength: np.ndarray) -> float:
    """Least size whose effect reaches the threshold, by power laws between the sizes and in proportion beyond them."""
    x, y = np.log(sizes), np.log(strength / THRESHOLD)
    if y[0] >= 0.0 or len(x) == 1:
        return float(np.exp(x[0] - 0.5 * y[0]))
    for a in range(len(x) - 1):
        if y[a + 1] >= 0.0:
            return float(np.exp(x[a] - y[a] * (x[a + 1] - x[a]) / (y[a + 1] - y[a])))
    return float(np.exp(x[-1] - 0.5 * y[-1]))


def _signed(name: str) -> bool:
    return name.endswith(DRIFT)


def _set_scale(compare: _Comparison, changed: np.ndarray, loose: np.ndarray, off: np.ndarray) -> float:
    """Set the standard deviation of each channel.

    Args:
        compare: whose scale is set.
        changed: change of the blocks by each fault at its sizes.
        loose: change of the blocks by a deviation of each number of the description, which goes as far as such do.
        off: what was measured less the blocks of the sound rig.

    Returns:
        The factor by which blocks that are like their neighbours widen variances. It is of the residual that all faults
        leave together.
    """
    starts = compare.starts
    effects = np.concatenate([changed, starts, loose])
    prior = np.eye(len(effects))[len(effects) - len(loose) :]
    compare.starts = starts[:0]
    left = off
    for _ in range(SCALINGS):  # each time in the units of the one before
        rows = np.concatenate([compare.scaled(effects).T, prior])
        amounts = np.linalg.lstsq(rows, np.append(compare.scaled(off), np.zeros(len(prior))), rcond=1e-9)[0]
        left = off - np.einsum("k,kcb->cb", amounts, effects)
        share = (left / compare.spread).std(axis=1, keepdims=True)
        compare.scale = np.maximum(share * compare.scale, compare.noise()[:, None])
    compare.starts = starts
    return max(1.0, widening(list(left / compare.spread))) ** 2


def _search(
    compare: _Comparison,
    names: Sequence[str],
    values: Mapping[str, float],
    spread: Mapping[str, float],
    residual: np.ndarray,
    widened: float,
    only: str = "",
) -> tuple[dict[str, float], dict[str, tuple[float, float]], dict[str, float]]:
    """Fit each fault alone, whatever its size: values, 95 % intervals and likelihood ratios; or only one of them."""
    bounds = {n: compare.bounds(n) for n in names}
    sound = float(residual @ residual)
    ladders = {n: _ladder(n, values[n], bounds[n]) for n in names}
    tried: dict[str, dict[float, float]] = {n: {0.0: sound} for n in names}
    for _ in range(ROUNDS):
        sets = [(n, float(v)) for n in names for v in ladders[n]]
        misfits = compare.misfits([{n: v} for n, v in sets])
        for (n, v), misfit in zip(sets, misfits, strict=True):
            tried[n][v] = float(misfit)
        for n in names:
            ladders[n] = _narrowed(tried[n], bounds[n])
    best, intervals = {}, {}
    ratios = {n: (sound - min(tried[n].values())) / widened for n in names}
    for n in names:
        vertex, error = _vertex(tried[n], widened, spread[n])
        best[n] = float(np.clip(vertex, *bounds[n]))
        low, high = vertex - NORMAL_QUANTILE * error, vertex + NORMAL_QUANTILE * error
        if n in RUNGS:
            least, largest = _profile_interval(tried[n], widened)
            low, high = min(low, least), max(high, largest)
        if n == only or (n in RUNGS and n != CLAMP_GRIP and _nearly(ratios, n)):
            best[n], (least, largest) = _interval_beside(compare, n, best[n], tried[n], widened)
            shift = best[n] - vertex
            low, high = min(low + shift, least), max(high + shift, largest)
        intervals[n] = low, high
    ratios = {n: (sound - min(tried[n].values())) / widened for n in names}
    return best, intervals, ratios


def _nearly(ratios: Mapping[str, float], *names: str) -> bool:
    """Whether one of some faults explains nearly as much as the best one."""
    return max(ratios[n] for n in names) >= max(NEARLY * max(ratios.values()), TELLING)


def _interval_beside(
    compare: _Comparison, name: str, value: float, tried: dict[float, float], widened: float
) -> tuple[float, tuple[float, float]]:
    """Best value and 95 % interval of a fault whose misfit is no parabola, from values beside it, which are tried as well.

    Where one of them is better by more than noise, what is beside that is tried too.
    """
    for _ in range(2):
        beside = np.clip(value * np.concatenate([1.0 - BESIDE, 1.0 + BESIDE]), *compare.bounds(name)).tolist()
        least = min(tried.values())
        tried |= dict(zip(beside, compare.misfits([{name: v} for v in beside]).tolist(), strict=True))
        if not least - min(tried.values()) > widened:
            break
        value = min(tried, key=tried.__getitem__)
    return value, _interval_over_motions(compare, {v: {name: v} for v in tried}, tried, widened)


def _ladder(name: str, linear: float, bounds: tuple[float, float]) -> np.ndarray:
    """Values from a tenth of the size at which a fault is seen to its bound, and around the linear estimate."""
    most = min(bounds[1], 3e3 * SIZES[name])
    rungs = np.geomspace(0.1 * SIZES[name], max(most, 0.1 * SIZES[name]), LADDER)
    around = linear * np.array([0.7, 1.0, 1.4])
    every = np.concatenate([rungs, -rungs, around]) if _signed(name) else np.concatenate([rungs, around])
    return np.unique(np.clip(every, *bounds))


def _narrowed(tried: Mapping[float, float], bounds: tuple[float, float]) -> np.ndarray:
    values = np.array(sorted(tried))
    at = int(np.argmin([tried[v] for v in values]))
    low, high = values[max(at - 1, 0)], values[min(at + 1, len(values) - 1)]
    return np.clip(np.linspace(low, high, LADDER + 2)[1:-1], *bounds)


def _vertex(tried: Mapping[float, float], widened: float, spread: float) -> tuple[float, float]:
    """Best value, and the standard error by the curvature of the misfit as far as it matters: within `NEAR` errors of it.

    Closer to the best value the misfit of a play has kinks, which say nothing of the error.
    """
    values = np.array(sorted(tried))
    misfits = np.array([tried[v] for v in values])
    at = int(np.argmin(misfits))
    near = np.flatnonzero(misfits - misfits[at] <= NEAR**2 * widened)
    if len(near) < FEWEST_NEAR:
        near = np.argsort(np.abs(values - values[at]))[:FEWEST_NEAR]
    x, y = values[near] - values[at], misfits[near] - misfits[at]
    size = float(np.abs(x).max())
    if not (size > 0.0 and np.isfinite(y).all()):
        return float(values[at]), spread
    curvature, slope, _ = np.polyfit(x / size, y, 2)
    if not curvature > 0.0:
        return float(values[at]), spread
    shift = float(np.clip(-0.5 * slope / curvature, -1.0, 1.0)) * size
    return float(values[at]) + shift, size * float(np.sqrt(widened / curvature))


def _profile_interval(tried: Mapping[float, float], widened: float) -> tuple[float, float]:
    """95 % interval by the likelihood itself, as for a fault whose misfit has kinks and several minima.

    It reaches from the least to the largest value that was tried whose misfit is not refused, and beyond both to where the
    root of the misfit, between two values a straight line, is refused.
    """
    values = np.array(sorted(tried))
    off = np.sqrt(np.maximum(np.array([tried[v] for v in values]) - min(tried.values()), 0.0) / widened)
    inside = np.flatnonzero(off <= NORMAL_QUANTILE)
    ends = []
    for at, beyond in ((inside[0], inside[0] - 1), (inside[-1], inside[-1] + 1)):
        if not 0 <= beyond < len(values) or not np.isfinite(off[beyond]):
            ends.append(float(values[at]))
        else:
            share = (NORMAL_QUANTILE - off[at]) / (off[beyond] - off[at])
            ends.append(float(values[at] + share * (values[beyond] - values[at])))
    return ends[0], ends[1]


def _interval_over_motions(
    compare: _Comparison, sets: Mapping[float, Mapping[str, float]], tried: Mapping[float, float], widened: float
) -> tuple[float, float]:
    """95 % interval by the likelihood, from the least to the largest of those for each motion of `MOTIONS`.

    Args:
        compare: measured and predicted blocks.
        sets: what to predict for each value.
        tried: misfit of each value with the motion that is taken.
        widened: factor on variances.
    """
    ends = [_profile_interval(tried, widened)]
    values = np.array(sorted(tried))
    off = np.array([tried[v] for v in values]) - min(tried.values())
    near = np.flatnonzero(off <= FAR**2 * widened)
    middle = int(np.argmin(off))
    first, last = min(near[0] - 1, middle - len(BESIDE)), max(near[-1] + 1, middle + len(BESIDE))
    some = [float(v) for v in values[max(first, 0) : last + 1]]
    for motion in MOTIONS:
        misfits = compare.misfits([{**sets[v], MOTION: motion} for v in some])
        ends.append(_profile_interval(dict(zip(some, misfits, strict=True)), widened))
    return min(low for low, _ in ends), max(high for _, high in ends)


class _SlippedBefore(NamedTuple):
    """A slipping clamp that has lost span before the recording: value as it is searched, interval, slip [m], ratio."""

    value: float
    interval: tuple[float, float]
    slip: float
    ratio: float


def _slipped_before(
    compare: _Comparison, values: Mapping[str, float], residual: np.ndarray, widened: float
) -> _SlippedBefore:
    """Fit the grip of a clamp along with what it has lost before the recording, from nothing on.

    A slip before the recording acts as slack, from whose value the search begins.
    """
    slack, bounds = max(values[CLAMP_SLACK], SIZES[CLAMP_SLACK]), compare.bounds(CLAMP_GRIP)
    tried: dict[float, float] = {}
    slips: dict[float, float] = {}
    linear = values[CLAMP_GRIP] * np.array([0.7, 1.0, 1.4])
    ladder = np.concatenate(
        [[0.0], np.geomspace(0.1 * SIZES[CLAMP_GRIP], bounds[1], LADDER), np.minimum(linear, bounds[1])]
    )
    starts: dict[float, tuple[float, ...]] = {v: (0.0, slack) for v in np.unique(ladder).tolist()}
    for _ in range(GRIP_ROUNDS):
        for v, (misfit, slip) in zip(starts, _least_over_slips(compare, starts, slack), strict=True):
            tried[v], slips[v] = misfit, slip
        new = np.concatenate([_narrowed(tried, bounds), _around_ends(tried, widened)])
        values_tried, starts = sorted(tried), {}
        for v in (v for v in new.tolist() if v not in tried):
            at = int(np.searchsorted(values_tried, v))  # the search begins at the slip of the better neighbour
            starts[v] = (slips[min(values_tried[max(at - 1, 0) : at + 1], key=tried.__getitem__)],)
    sets = {v: {CLAMP_GRIP: v, START_SLIP: slips[v]} for v in tried}
    interval = _interval_over_motions(compare, sets, tried, widened)
    best = min(tried, key=tried.__getitem__)
    return _SlippedBefore(best, interval, slips[best], (float(residual @ residual) - tried[best]) / widened)


def _around_ends(tried: Mapping[float, float], widened: float) -> np.ndarray:
    """Values on both sides of the last that the misfit does not refuse, up to its neighbours, at either end.

    The hollow of a grip may lie between two grips of a plateau, the last one of which stands on its far slope already.
    """
    values = np.array(sorted(tried))
    inside = np.flatnonzero(np.array([tried[v] for v in values]) - min(tried.values()) <= NORMAL_QUANTILE**2 * widened)
    places = np.clip(
        [inside[0] - 1, inside[0], inside[0] + 1, inside[-1] - 1, inside[-1], inside[-1] + 1], 0, len(values) - 1
    )
    ends = [(places[i], places[i + 1]) for i in (0, 1, 3, 4)]
    return np.unique(np.concatenate([np.linspace(values[a], values[b], EDGES + 2)[1:-1] for a, b in ends]))


def _least_over_slips(
    compare: _Comparison, starts: Mapping[float, Sequence[float]], slack: float
) -> list[tuple[float, float]]:
    """Find the least misfit over what the clamp lost before the recording, and that slip [m], of each grip.

    By Gauss-Newton from several slips.

    Args:
        compare: measured and predicted blocks.
        starts: slips from which the search begins, by what is searched of the grip [m].
        slack: of a slack clamp [m], a third of the largest slip.
    """
    grips = [v for v, some in starts.items() for _ in some]
    slips = np.array([[slip] for some in starts.values() for slip in some])

    def off(at: np.ndarray) -> np.ndarray:
        sets = [{CLAMP_GRIP: v, START_SLIP: slip} for v, row in zip(grips, at[..., 0], strict=True) for slip in row]
        return compare.scaled(compare.measured - compare.predict(sets)).reshape(*at.shape[:2], -1)

    step, bounds = np.array([SLIP_STEP * slack]), (np.zeros(1), np.array([3.0 * slack]))
    best, least = descend_in_lanes(off, slips, step=step, bounds=bounds, rounds=SLIP_ROUNDS, least=LEAST_EFFECT)
    ends = np.cumsum([len(some) for some in starts.values()])
    found = [a + int(np.argmin(least[a:b])) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
    return [(float(least[i]), float(best[i, 0])) for i in found]


def _explains(compare: _Comparison, names: Sequence[str], best: str, value: float, widened: float) -> bool:
    """Whether nothing of the list improves the prediction much once the best fault is there."""
    there = {best: value}
    predicted = compare.predict([there, *({**there, n: there.get(n, 0.0) + SIZES[n]} for n in names)])
    left = compare.scaled(compare.measured - predicted[0])
    effects = compare.scaled(predicted[1:] - predicted[0])
    own = effects[list(names).index(best)]
    own = own / max(float(np.linalg.norm(own)), 1e-12)
    effects, left = effects - np.outer(effects @ own, own), left - (left @ own) * own
    strength = (effects**2).sum(axis=1)
    gain = np.where(strength > 1e-9, (effects @ left) ** 2 / np.maximum(strength, 1e-9), 0.0)
    gain = np.where([_signed(n) for n in names], gain, np.where(effects @ left > 0.0, gain, 0.0))
    return bool(gain.max() / widened <= THRESHOLD)


def _calibration_error(compare: _Comparison, fault: Mapping[str, float], sound: np.ndarray, slack: np.ndarray) -> str:
    """Wrong zero or gain of one sensor that explains the recording better than a fault; empty where none does.

    Each is one number, as the fault is: better is a likelihood ratio beyond `THRESHOLD`, with the noise that either leaves,
    which must be near that of the sensors.

    Args:
        compare: measured and predicted blocks.
        fault: best fault, as it is searched.
        sound: blocks of the sound rig.
        slack: change of the blocks by slack [1/m], which a span that is measured too long changes alike.
    """
    kept = compare.scale
    compare.scale = compare.noise()[:, None]  # of the sensors: the residual's contains what is sought here
    off = compare.measured - sound
    effects: dict[str, np.ndarray] = {"span zero": slack}
    for row, name in enumerate(compare.channels):
        for kind, values in (("zero", np.ones_like(sound[row])), ("gain", sound[row])):
            effects[f"{name} {kind}"] = np.zeros_like(sound)
            effects[f"{name} {kind}"][row] = values
    left, scaled = compare.scaled(off), {name: compare.scaled(effect) for name, effect in effects.items()}
    with_fault = float(compare.misfits([fault])[0])
    compare.scale = kept
    sizes = {n: float(e @ left) / max(float(e @ e), LEAST_EFFECT) for n, e in scaled.items()}
    misfits = {n: float(np.sum((left - sizes[n] * e) ** 2)) for n, e in scaled.items()}
    best = min(misfits, key=misfits.__getitem__)
    better = left.size * np.log(with_fault / max(misfits[best], LEAST_EFFECT)) > THRESHOLD
    allowed = max(LEAVES * left.size, min(LEAVES_SHARE * float(left @ left), UNDESCRIBED**2 * left.size))
    if not better or misfits[best] > allowed or (best == "span zero" and abs(sizes[best]) > MOST_ZERO):
        return ""
    channel, kind = best.split()
    if kind == "gain":
        return f"a gain of {channel} that is wrong by {100.0 * sizes[best]:+.3g} %"
    unit, factor = ZERO_SHOWN[channel]
    return f"a zero of {channel} that is wrong by {factor * sizes[best]:+.3g} {unit}"


def _result(
    compare: _Comparison,
    names: Sequence[str],
    values: Mapping[str, float],
    intervals: Mapping[str, tuple[float, float]],
    ratios: Mapping[str, float],
    limits: Mapping[str, float],
    residual: np.ndarray,
    *,
    explained: bool,
) -> Diagnosis:
    units = declared(RigFaults)
    sound = akaike(residual, 1)
    fits = []
    for n in names:
        low, high = np.clip(intervals[n], *compare.bounds(n))
        share = max(1.0 - ratios[n] / max(float(residual @ residual), 1e-12), 1e-12)
        least = max(limits[n], TOLERANCES.get(n, 0.0))
        value, low, high, limit = (compare.real({n: float(v)})[n] for v in (values[n], low, high, least))
        estimate = Estimate(value, min(low, high), max(low, high), units[n].unit)
        aicc = akaike(residual * np.sqrt(share), 2) - sound
        slipped = compare.slipped if n == CLAMP_GRIP else 0.0
        fits.append(FaultFit(n, estimate, ratios[n], aicc, limit, compare.real({n: 0.0})[n], slipped))
    fits.sort(key=lambda one: -one.ratio)
    found = fits[0].name if fits[0].ratio > THRESHOLD else ""
    tolerance = found if abs(fits[0].estimate.value) <= TOLERANCES.get(found, 0.0) else ""
    found = "" if tolerance else found
    alike = tuple(one.name for one in fits[1:] if found and fits[0].ratio - one.ratio < TELLING)
    misfit = float(np.max(compare.scale / compare.noise()[:, None]))
    return Diagnosis(
        tuple(fits),
        found,
        alike,
        explained and misfit < UNDESCRIBED,
        THRESHOLD,
        residual.size,
        _not_judged(compare, names, limits),
        tolerance=tolerance,
        description=_numbers_off(compare),
        misfit=misfit,
    )


def _numbers_off(compare: _Comparison) -> tuple[NumberOff, ...]:
    found = []
    for one in compare.observer.description:
        off, of = compare.described[one.path], float(np.abs(one.value).max())
        found.append(NumberOff(one.path, off * float(one.deviation.max()) / of, off))
    return tuple(sorted(found, key=lambda one: -abs(one.off)))
