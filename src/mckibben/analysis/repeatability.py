"""Repeatability: of cycles, of runs, and of a set of numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..answers import Answer, Caution, Column, Table
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import with_unit
from ..recordings import Recording, read_any
from ..recordings.files import naming_file, path_of, select_between
from ..verbs import ChannelName, Count, Reading, RecordFiles, Time, verb
from .channels import Interval, choose_channel, find_cycles, finite, known, linear_fit


class Spread(NamedTuple):
    """Mean of several numbers and how they scatter [their unit]."""

    mean: float
    deviation: float  # standard deviation of one number, n - 1 in the denominator
    range: float  # largest less smallest
    relative_range: float  # range over the size of the mean [1]


def spread(numbers: Sequence[float] | np.ndarray) -> Spread:
    """Spread of two or more numbers, such as the loop widths at several frequencies.

    Raises:
        InputError: fewer than two, one that is not finite, or a mean of zero.
    """
    x = finite(numbers, "numbers")
    if x.size < 2:
        raise InputError("numbers", x.size, "must be 2 or more")
    mean, span = float(x.mean()), float(np.ptp(x))
    if mean == 0.0:
        raise InputError("mean of the numbers", mean, "must not be zero for a relative spread")
    return Spread(mean, float(x.std(ddof=1)), span, span / abs(mean))


class Repeatability(NamedTuple):
    """Distance of repetitions from their mean course [unit of the channel]."""

    rms: float  # deviation of one repetition, n - 1 in the denominator, over the whole course
    largest: float  # largest distance of any repetition from the mean
    relative_rms: float  # rms over the range of the mean course [1]
    repetitions: int
    at: np.ndarray  # phase of the cycle [1], or time [s], (points,)
    courses: np.ndarray  # the channel of each repetition, (repetitions, points)

    @property
    def peaks(self) -> np.ndarray:
        """Largest value of each repetition (repetitions,)."""
        return np.asarray(self.courses.max(axis=1))


def between_cycles(
    record: Recording,
    *,
    channel: str = "muscle.tension",
    drive: str = "muscle.length",
    skip: int = 0,
    points: int = 200,
) -> Repeatability:
    """Repeatability of a channel over the full cycles of another, at equal phase.

    The phase runs evenly in time from each turn to the next, so that a cycle time that varies does not count.

    Args:
        record: with both channels.
        channel: the channel to compare.
        drive: the periodic channel.
        skip: cycles left out at the beginning.
        points: phases in a cycle.

    Raises:
        InputError: a channel is missing, or there are fewer than two full cycles.
    """
    x, y = known(record, drive), known(record, channel)
    cycles = find_cycles(x, skip=skip, subject=f"channel {drive}")
    half = np.linspace(0.0, 1.0, points // 2, endpoint=False)
    courses = []
    for c in cycles:
        t = record.time[[c.start, c.turn, c.end]]
        at = np.concatenate([t[0] + half * (t[1] - t[0]), t[1] + half * (t[2] - t[1])])
        courses.append(np.interp(at, record.time, y))
    return _compared(np.concatenate([0.5 * half, 0.5 + 0.5 * half]), np.array(courses), "full cycles")


def between_runs(records: Sequence[Recording], *, channel: str = "muscle.tension", points: int = 1000) -> Repeatability:
    """Repeatability of a channel over recordings of one protocol, at equal time, over their common duration.

    Args:
        records: two or more on one time axis.
        channel: the channel to compare.
        points: points of the common time.
    """
    if not records:
        raise InputError("recordings", 0, "must be 2 or more")
    first, last = max(r.time[0] for r in records), min(r.time[-1] for r in records)
    if not last > first:
        raise InputError("recordings", None, "must overlap in time")
    at = np.linspace(first, last, points)
    return _compared(at, np.array([np.interp(at, r.time, known(r, channel)) for r in records]), "recordings")


def _compared(at: np.ndarray, courses: np.ndarray, quantity: str) -> Repeatability:
    count = len(courses)
    if count < 2:
        raise InputError(quantity, count, "must be 2 or more")
    mean = courses.mean(axis=0)
    off = courses - mean
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=0) / (count - 1))))
    span = float(np.ptp(mean))
    relative = rms / span if span > 0.0 else float("nan")
    return Repeatability(rms, float(np.abs(off).max()), relative, count, at, courses)


class Trend(NamedTuple):
    """A straight line through numbers over something, such as loop heights over peak velocity."""

    slope: Interval  # [unit of the numbers per unit of what it goes over]
    at_zero: Interval  # [unit of the numbers]

    @property
    def measurable(self) -> bool:
        """Whether the interval of the slope leaves zero out."""
        return self.slope.low > 0.0 or self.slope.high < 0.0


def trend(over: Sequence[float], numbers: Sequence[float], *, confidence: float = 0.95) -> Trend:
    """Straight line by least squares: a viscous force shows as a loop height that grows with velocity.

    Args:
        over: the independent numbers (n,), three or more.
        numbers: the dependent ones (n,).
        confidence: confidence of the intervals.
    """
    x, y = finite(over, "over"), finite(numbers, "numbers")
    if x.shape != y.shape:
        raise InputError("over and numbers", None, f"must be two of one length, got {x.size} and {y.size}")
    fit = linear_fit(np.stack([x, np.ones_like(x)], axis=1), y, subject="points of the trend", confidence=confidence)
    return Trend(fit.coefficient(0), fit.coefficient(1))


@dataclass(frozen=True)
class CourseRepeatability(Answer):
    """How well cycles or runs repeat each other: what `repeatability` computes.

    Attributes:
        files: paths of the recordings; None for those that were no files.
        title: of the first recording, else the name of its file.
        channel: channel that is compared.
        unit: of the channel.
        each: what repeats: ``cycle`` or ``run``.
        compared: the courses and their distances from the mean one.
        peaks: spread of the largest values.
        drift: slope of a straight line through the largest values, per repetition; None of two.
        cautions: about values that can only be slips.
        guessed: channels that were not named, by their parameter.
    """

    files: tuple[str | None, ...]
    title: str
    channel: str
    unit: str
    each: str
    compared: Repeatability
    peaks: Spread
    drift: Interval | None
    cautions: tuple[Caution, ...] = ()
    guessed: Mapping[str, str] = field(default_factory=dict)

    def rows(self) -> list[dict[str, JsonValue]]:
        """The largest value of each repetition."""
        return [{self.each: i + 1, "peak": float(peak)} for i, peak in enumerate(self.compared.peaks)]

    def column_units(self) -> Mapping[str, str]:
        """Unit of the largest values."""
        return {"peak": self.unit}

    def to_dict(self) -> dict[str, JsonValue]:
        """Distances from the mean course, and the largest values with their spread and drift."""
        of = self.compared
        return {
            "files": list(self.files),
            "channel": self.channel,
            "unit": self.unit,
            "between": f"{self.each}s",
            "repetitions": of.repetitions,
            "rms": of.rms,
            "largest": of.largest,
            "relative_rms": of.relative_rms,
            "peaks": {"values": of.peaks, **self.peaks._asdict()},
            "drift": None if self.drift is None else self.drift._asdict(),
        }

    def tables(self) -> list[Table]:
        """Distances from the mean course, and how the largest values scatter and drift."""
        of, unit = self.compared, self.unit
        lines = [
            ("rms distance from the mean course", of.rms, f"{100.0 * of.relative_rms:.3g} % of its range"),
            ("largest distance", of.largest, ""),
            ("peak", self.peaks.mean, f"standard deviation {with_unit(self.peaks.deviation, unit)}"),
        ]
        if self.drift is not None:
            interval = f"95 %: {with_unit(self.drift.low, unit)} to {with_unit(self.drift.high, unit)}"
            lines.append((f"drift of the peak per {self.each}", self.drift.value, interval))
        rows = [{"name": name, "value": with_unit(value, unit), "remark": remark} for name, value, remark in lines]
        title = f"{self.channel} over {of.repetitions} {self.each}s"
        return [Table(title, (Column("name", ""), Column("value", "", right=True), Column("remark", "")), rows)]

    def remarks(self) -> list[str]:
        """Which channels were taken where none was named."""
        words = [f"{{{role}}} names another channel than {name}" for role, name in self.guessed.items()]
        return [f"Chosen by name and unit: {'; '.join(words)}."] if words else []


@verb
def repeatability(
    recordings: RecordFiles,
    *,
    channel: ChannelName | None = None,
    drive: ChannelName | None = None,
    skip: Count = 0,
    start: Time | None = None,
    end: Time | None = None,
    read: Reading | None = None,
) -> CourseRepeatability:
    """Report how well cycles or runs repeat each other.

    Cycles are compared at equal phase, runs at equal time. The drift is the slope of a straight line through the peaks.

    Args:
        recordings: one recording with cycles, or several runs alike, in files of any format; runs of one file count as such.
        channel: channel that is compared; the tension by default.
        drive: channel that has the cycles, of one recording; the length by default.
        skip: number of first cycles that are left out.
        start: time from which on samples are used [s], such as '2 s'.
        end: time up to which samples are used [s], such as '5 s'.
        read: how files of another program are understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: a channel is missing or not clear, there are fewer than two full cycles, or runs do not overlap in time.
    """
    if skip < 0:
        raise InputError("skip", skip, "must be 0 or more")
    sources = [recordings] if isinstance(recordings, str | Path | Recording) else list(recordings)
    if not sources:
        raise InputError("recordings", None, "must be one or several")
    guessed = tuple(role for role, name in (("channel", channel), ("drive", drive)) if name is None)
    records: list[Recording] = []
    for source in sources:
        record = read_any(source, **(read or {})).recording
        with naming_file(source):
            if channel is None:
                channel = "tension" if "tension" in record else choose_channel(record, "tension")
            known(record, channel)  # refuses what the file has not, before parameters of that name are looked at
            if len(sources) == 1 and len(record.runs) == 1:
                if drive is None:
                    drive = "span" if "span" in record else choose_channel(record, "length")
                known(record, drive)
            records += [select_between(run, start, end) for run in record.runs]
    one = len(records) == 1
    assert channel is not None
    guessed = tuple(role for role in guessed if one or role == "channel")
    if one:
        assert drive is not None
        compared = between_cycles(records[0], channel=channel, drive=drive, skip=skip)
    else:
        compared = between_runs(records, channel=channel)
    drift = None
    if compared.repetitions > 2:
        drift = trend(range(compared.repetitions), compared.peaks.tolist()).slope
    files = tuple(map(path_of, sources))
    return CourseRepeatability(
        files,
        str(records[0].meta.get("title") or Path(files[0] or "").name),
        channel,
        records[0].channels[channel].unit,
        "cycle" if one else "run",
        compared,
        spread(compared.peaks),
        drift,
        guessed={role: channel if role == "channel" else str(drive) for role in guessed},
    )
