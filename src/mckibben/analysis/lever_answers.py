"""What one asks of a recording of a muscle lever: the timing of a contraction, and the work of its cycles."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from .. import verbs
from ..answers import Answer, Caution, Column, Table, collect
from ..documents import JsonValue
from ..errors import InputError
from ..recordings import Recording, read_any
from ..recordings.files import naming_file, path_of
from . import lever

# What the channels of a lever are called in the record of another machine, or of a simulated muscle.
OTHERWISE = {"force": ("tension", "muscle.tension"), "length": ("span", "muscle.length"), "stimulus": ("excitation",)}


def _in_record(record: Recording, **names: str) -> tuple[dict[str, str], str]:
    """Channels by what they are; those that the record calls otherwise are said."""
    known = {}
    for what, name in names.items():
        others = (other for other in OTHERWISE[what] if other in record.channels and name == what)
        known[what] = name if name in record.channels else next(others, name)
    said = [f"the {what} is {name}" for what, name in known.items() if name != names[what]]
    return known, f"Chosen by name: {', '.join(said)}." if said else ""


@dataclass(frozen=True)
class Contraction(Answer):
    """Timing of a twitch or a tetanus of a recording: what `contraction` finds.

    Attributes:
        file: path of the recording; None where it was no file.
        timing: stimulus, peak, and set points.
        protocol: as the file states it; None if it states none.
        cautions: where the protocol is not one of a twitch or a tetanus.
        guessed: which channels were taken where none has the name that was asked for; empty where all have.
    """

    file: str | None
    timing: lever.ContractionTiming
    protocol: lever.LeverProtocol | None
    cautions: tuple[Caution, ...] = ()
    guessed: str = ""

    units: ClassVar[Mapping[str, str]] = {"share": "1", "time": "s", "force": "N"}

    def to_dict(self) -> dict[str, JsonValue]:
        """The timing with its set points, and the protocol."""
        timing = self.timing
        points = {name: [p._asdict() for p in getattr(timing, name)] for name in ("rising", "relaxing")}
        found = {"time_to_peak": timing.time_to_peak, "developed_force": timing.developed_force}
        return (
            timing._asdict()
            | points
            | found
            | {"file": self.file, "protocol": self.protocol and self.protocol._asdict()}
        )

    def rows(self) -> list[dict[str, Any]]:
        """Stimulus, set points of the rise, peak, and set points of the relaxation."""
        of = self.timing
        return [
            {"point": "stimulus", "share": None, "time": of.stimulus_time, "force": of.stimulus_force},
            *({"point": "rising", **p._asdict()} for p in of.rising),
            {"point": "peak", "share": None, "time": of.peak_time, "force": of.peak_force},
            *({"point": "relaxing", **p._asdict()} for p in of.relaxing),
        ]

    def tables(self) -> list[Table]:
        """All points in their order, with their times after the stimulus."""
        rows = []
        for row in self.rows():
            share = "" if row["share"] is None else f" {100.0 * row['share']:g} %"
            below = "" if row["time"] == row["time"] else ", below rest"
            after = row["time"] - self.timing.stimulus_time
            rows.append({**row, "point": f"{row['point']}{share}{below}", "after": after})
        times = (Column("time", None, "s", "ms", ".2f"), Column("after", "after stimulus", "s", "ms", "+.2f"))
        columns = (Column("point"), *times, Column("force", None, "N", "mN", ".7g"))
        return [Table(f"Contraction{_of(self.file)}, shares above {self.timing.above}", columns, rows)]

    def remarks(self) -> list[str]:
        """The peak above zero and above rest, and how long it took."""
        of = self.timing
        above = 1e3 * (of.peak_force - of.stimulus_force)
        peak = f"Peak {1e3 * of.peak_force:.7g} mN above zero, {above:.7g} mN above rest"
        return [
            f"{peak}, {1e3 * of.time_to_peak:.4g} ms after the stimulus.",
            *([self.guessed] if self.guessed else []),
        ]


@verbs.verb
def contraction(
    recording: verbs.DataFile,
    *,
    rising: verbs.Shares = "10 %, 90 %",
    relaxing: verbs.Shares | None = None,
    above: verbs.ForceLevel = "rest",
    force: verbs.ChannelName = "force",
    stimulus: verbs.ChannelName = "stimulus",
    read: verbs.Reading | None = None,
) -> Contraction:
    """Time a twitch or tetanus: stimulus, peak, and set points of rise and relaxation.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        rising: shares of the development of force at which the rise is timed.
        relaxing: shares at which the relaxation is timed; by default '90 %, 50 %', and none of a tetanus.
        above: level from which force counts: rest, at the stimulus, or zero.
        force: channel with the force.
        stimulus: channel with the stimulus.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: a channel is missing, there is no stimulus, or the force does not rise after it.
    """
    record = read_any(recording, **(read or {})).recording
    shares: dict[str, Any] = {"rising": rising, "relaxing": relaxing}
    names, said = _in_record(record, force=force, stimulus=stimulus)
    with naming_file(recording):
        timing = lever.contraction_timing(
            record, **shares, above=above, force=names["force"], stimulus=names["stimulus"]
        )
    protocol = lever.stated_protocol(record)
    return Contraction(path_of(recording), timing, protocol, cautions_of_contraction(protocol), said)


def cautions_of_contraction(protocol: lever.LeverProtocol | None) -> tuple[Caution, ...]:
    """What is said of timing a contraction in a recording with a protocol."""
    said = (
        "the protocol is one of work loops, in which the length changes; a twitch or a tetanus is timed at one length"
    )
    return (Caution(said, "protocol"),) if protocol is not None and protocol.kind == "work loop" else ()


@dataclass(frozen=True)
class WorkLoops(Answer):
    """Work and power of the cycles of a recording: what `work_loops` computes.

    Attributes:
        file: path of the recording; None where it was no file.
        cut: where a cycle begins and ends.
        loops: the cycles that were kept.
        starts: times at which they begin [s].
        protocol: as the file states it; None if it states none.
        cautions: about cycles that are missing or not whole.
        guessed: as of `Contraction`.
    """

    file: str | None
    cut: str
    loops: tuple[lever.LeverLoop, ...]
    starts: tuple[float, ...]
    protocol: lever.LeverProtocol | None
    cautions: tuple[Caution, ...] = ()
    guessed: str = ""

    units: ClassVar[Mapping[str, str]] = {
        "work": "J", "duration": "s", "power": "W", "mean_power": "W", "start": "1", "end": "1", "cycle": "1",
    }  # fmt: skip

    @property
    def mean(self) -> dict[str, float]:
        """Mean work of a cycle [J], its mean power, and the mean of force times velocity [W]."""
        return {
            n: sum(getattr(one, n) for one in self.loops) / len(self.loops) for n in ("work", "power", "mean_power")
        }

    def to_dict(self) -> dict[str, JsonValue]:
        """Cycles, their mean, and the protocol."""
        about = {"file": self.file, "cut": self.cut, "cycles": self.rows(), "mean": self.mean}
        return about | {"protocol": self.protocol and self.protocol._asdict()}

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per cycle."""
        return [one._asdict() for one in self.loops]

    def tables(self) -> list[Table]:
        """One line per cycle."""
        columns = (
            Column("cycle", right=True),
            Column("from", None, "s", places=".4f"),
            Column("duration", None, "s", "ms", ".2f"),
            Column("work", None, "J", "mJ", ".5f"),
            Column("power", None, "W", "mW", ".4f"),
            Column("mean_power", "mean of F v", "W", "mW", ".4f"),
        )
        rows = [row | {"from": start} for row, start in zip(self.rows(), self.starts, strict=True)]
        return [Table(f"Work loops{_of(self.file)}, cut at {self.cut}", columns, rows)]

    def remarks(self) -> list[str]:
        """The means of all cycles."""
        work, power, mean = (1e3 * one for one in self.mean.values())
        said = [
            f"In the mean {work:.5g} mJ a cycle, {power:.5g} mW; the mean of force times smoothed velocity is {mean:.5g} mW."
        ]
        return [*said, *([self.guessed] if self.guessed else [])]


@verbs.verb
def work_loops(
    recording: verbs.DataFile,
    *,
    cut: verbs.CutPoint = "L0",
    keep: verbs.CycleNumbers | None = None,
    frequency: verbs.Frequency | None = None,
    length: verbs.ChannelName = "length",
    force: verbs.ChannelName = "force",
    read: verbs.Reading | None = None,
) -> WorkLoops:
    """Compute work and power of each cycle of a muscle on a lever.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        cut: where a cycle begins and ends: L0, peak or trough of the length.
        keep: cycles to keep, such as '4-6' or '1, 3'; all by default.
        frequency: frequency of the cycles [Hz], such as '28 Hz'; by default that of the file's protocol.
        length: channel with the length.
        force: channel with the force.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: there is no whole cycle, or one that is to be kept is not there.
    """
    numbers = cycle_numbers(keep) if isinstance(keep, str) else keep
    per_second = None if frequency is None else float(frequency)
    record = read_any(recording, **(read or {})).recording
    names, guessed = _in_record(record, length=length, force=force)
    with naming_file(recording):
        if per_second is None and not (record.meta.get("source") or {}).get("protocol"):
            problem = (
                "is missing: the recording states no protocol of a lever; state it, or ask for the work of each cycle"
            )
            raise InputError("frequency", None, problem)
        length, force = names["length"], names["force"]
        loops = lever.lever_loops(record, cut=cut, keep=numbers, frequency=per_second, length=length, force=force)
    said = cautions_of_cycles(record, loops, length=length)
    starts = tuple(float(record.time[one.start]) for one in loops)
    return WorkLoops(path_of(recording), cut, loops, starts, lever.stated_protocol(record), said, guessed)


def cautions_of_cycles(
    record: Recording, loops: Sequence[lever.LeverLoop], *, length: str, taken: str = "in the mean; {keep} takes others"
) -> tuple[Caution, ...]:
    """What is said of cycles of a muscle lever: that some are missing, or longer or shorter than the others."""
    lacking, some = lever.missing_cycles(record, length=length), lever.partial_cycles(loops)
    which, are = ("cycle", "is") if len(some) == 1 else ("cycles", "are")
    odd = f"{which} {' and '.join(map(str, some))} {are} longer or shorter than the others, and {taken}"
    return collect(Caution(lacking, "cycles") if lacking else None, Caution(odd, "keep") if some else None)


def cycle_numbers(words: str) -> tuple[int, ...]:
    """Numbers and ranges of cycles, such as ``4-6``."""
    numbers: list[int] = []
    for word in words.split(","):
        if not (match := re.fullmatch(r"\s*(\d+)\s*(?:-\s*(\d+)\s*)?", word)):
            raise InputError("keep", words, "must be numbers or ranges of cycles, such as '4-6' or '1, 3'")
        first, last = int(match[1]), int(match[2] or match[1])
        if not 1 <= first <= last <= first + 10_000:
            raise InputError("keep", words, "must be ranges that rise, from 1 on")
        numbers += range(first, last + 1)
    return tuple(numbers)


def _of(file: str | None) -> str:
    return "" if file is None else f" of {Path(file).name}"
