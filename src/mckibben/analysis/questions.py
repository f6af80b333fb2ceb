"""What one asks of every recording: loops, work, stiffness, steps, leak; of a pneumatic muscle and one on a lever alike.

A question names the channels that it needs, or finds them by name and unit and says which it took. Of a file with several
runs each is asked by itself, on its own clock; each number then has its median and range over the runs, of one run those
over its loops or steps. What is computed stands in `loops`, `lever` and `steps`; here it is asked and answered.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from .. import verbs
from ..answers import Answer, Caution, Column, Table, collect
from ..documents import JsonValue
from ..errors import InputError
from ..formats.columns import AMBIENT
from ..pneumatics.orifice import Leak, flow_of_decay
from ..quantities import with_unit
from ..recordings import Recording, read_any
from ..recordings.files import naming_file, path_of, select_between
from ..recordings.provenance import MACHINE
from . import lever
from .channels import HeldCycles, choose_channel, cycle_conditions, known, parted_by
from .lever_answers import cautions_of_contraction, cautions_of_cycles
from .loops import TensionLoop, loops_by_held, path_stiffness, path_work
from .segments import segments, steps_of
from .steps import ONSET, REACHED, StepResponse, find_steps, pressure_decay, step_responses

T = TypeVar("T")
R = TypeVar("R")
QUICKEST = 0.03  # share of the pressure that a leak may take in a second, where a hold is sought [1/s]
BINS = 100  # into which a record is cut where a hold is sought
HELD = 0.2  # of the largest pressure, below which none is held
WARM = 1.0  # at the begin of a hold that is left out, for the heat of filling, but at most a tenth of it [s]
UNEVEN = 0.2  # share by which the halves of a hold may leak unequally before it is said


@dataclass(frozen=True)
class RecordingNumbers(Answer, Generic[T]):
    """Numbers of a recording, one row for each loop, step or hold; a sequence of its `items`.

    Attributes:
        file: path of the recording; None where it was no file.
        heading: title of the table.
        channels: name of the channel that each role was taken from.
        guessed: roles whose channel was chosen by name or unit.
        items: loops, steps or holds, in order.
        numbers: those of each by name [SI], with ``run`` and ``group``: what was held, or which way it went.
        columns: of the numbers, as a person reads them.
        summarised: names of the numbers that have a median and a range.
        notes: sentences about how it was computed.
        cautions: about the recording, and about what was left out.
    """

    file: str | None
    heading: str
    channels: Mapping[str, str]
    guessed: tuple[str, ...]
    items: tuple[T, ...]
    numbers: tuple[Mapping[str, Any], ...]
    columns: tuple[Column, ...]
    summarised: tuple[str, ...]
    notes: tuple[str, ...] = ()
    cautions: tuple[Caution, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.items)

    def __iter__(self) -> Iterator[T]:
        return iter(self.items)

    def __getitem__(self, place: int) -> T:
        return self.items[place]

    @property
    def runs(self) -> int:
        """Number of runs of which there are numbers."""
        return len({row["run"] for row in self.numbers})

    def summary(self) -> list[dict[str, Any]]:
        """Median, smallest and largest of each number [SI] over runs, of which each counts by its median, else over rows."""
        groups: dict[str, list[Mapping[str, Any]]] = {}
        for row in self.numbers:
            groups.setdefault(row["group"], []).append(row)
        lines = []
        for group, rows in groups.items():
            line: dict[str, Any] = {"group": group, "runs": len({row["run"] for row in rows}), "count": len(rows)}
            for name in self.summarised:
                by_run: dict[int, list[float]] = {}
                for row in rows:
                    if row[name] is not None:
                        by_run.setdefault(row["run"], []).append(row[name])
                medians = [float(np.median(values)) for values in by_run.values()]
                values = medians if len(medians) > 1 else [v for values in by_run.values() for v in values]
                ends = (float(np.median(values)), min(values), max(values)) if values else (None,) * 3
                line |= dict(zip((name, f"{name}_low", f"{name}_high"), ends, strict=True))
            lines.append(line)
        return lines

    def rows(self) -> list[Mapping[str, JsonValue]]:
        """One row for each loop, step or hold."""
        return list(self.numbers)

    def column_units(self) -> Mapping[str, str]:
        """SI units of the numbers; what has one of its own in each row states it there."""
        return {one.key: one.unit for one in self.columns if one.unit}

    def to_dict(self) -> dict[str, JsonValue]:
        """Channels, rows, and the median and range of each number [SI]."""
        about = {"file": self.file, "channels": dict(self.channels), "guessed": list(self.guessed)}
        return {**about, "runs": self.runs, "rows": [dict(row) for row in self.numbers], "summary": self.summary()}

    def tables(self) -> list[Table]:
        """One line for each loop, step or hold, and their medians with ranges."""
        named = (Column("group", ""),) if any(row["group"] for row in self.numbers) else ()
        run = (Column("run", right=True),) if self.runs > 1 else ()
        whole = Table(self.heading, (*run, *named, *self.columns), self.numbers)
        if all(line["count"] < 2 for line in self.summary()):
            return [whole]
        counts = (Column("runs", right=True),) if self.runs > 1 else ()
        medians = [
            Column(c.key, c.title, c.unit, c.shown, c.places, ends=(f"{c.key}_low", f"{c.key}_high"), missing="-")
            for c in self.columns
            if c.key in self.summarised
        ]
        title = f"Median and range over {f'{self.runs} runs' if self.runs > 1 else 'all of them'}"
        return [whole, Table(title, (*named, *counts, Column("count", right=True), *medians), self.summary())]

    def remarks(self) -> list[str]:
        """Which channels were taken, and how the numbers were computed."""
        taken = [f"{role.replace('_', ' ')} is {self.channels[role]}" for role in self.guessed]
        if not taken:
            return list(self.notes)
        options = " and ".join(f"{{{role}}}" for role in self.guessed)
        if "pressure" in self.channels and "pressure" not in self.guessed:
            taken.append(f"pressure is {self.channels['pressure']}")
        words = ", ".join(taken)
        verb = "names another" if len(self.guessed) == 1 else "name others"
        return [f"{words[:1].upper()}{words[1:]}, chosen by name and unit; {options} {verb}.", *self.notes]


class _Question(NamedTuple):
    """A recording that is asked: number of the run of each part, and the channels of each role."""

    file: str | None
    parts: tuple[tuple[int, Recording], ...]
    channels: dict[str, str]
    guessed: tuple[str, ...]
    cautions: tuple[Caution, ...]

    def each(self, ask: Callable[[Recording], R]) -> tuple[list[tuple[int, Recording, R]], tuple[Caution, ...]]:
        """What each part answers; a caution for each run that does not.

        Raises:
            InputError: no part does; of the first one.
        """
        results: list[tuple[int, Recording, R]] = []
        failures: dict[int, InputError] = {}
        for number, part in self.parts:
            try:
                results.append((number, part, ask(part)))
            except InputError as error:
                failures.setdefault(number, error)
        if not results:
            first = next(iter(failures.values()))
            raise first if self.file is None else first.at(self.file)
        lost = [number for number in failures if number not in {run for run, *_ in results}]
        return results, tuple(Caution(f"run {number} is left out: {failures[number]}", "runs") for number in lost)

    def answer(
        self, heading: str, items: Sequence[T], rows: Sequence[Mapping[str, Any]], columns: Sequence[Column],
        summarised: Sequence[str], notes: Sequence[str], cautions: Sequence[Caution],
    ) -> RecordingNumbers[T]:  # fmt: skip
        """The answer with these numbers."""
        about = (self.file, heading, self.channels, self.guessed)
        said = tuple(note for note in notes if note)
        return RecordingNumbers(
            *about, tuple(items), tuple(rows), tuple(columns), tuple(summarised), said, collect(*cautions)
        )


def _question(
    recording: Any, read: Any, start: Any, end: Any, roles: Mapping[str, str | None], by_step: bool = False
) -> _Question:
    """A recording with its runs between the times that count, or the recorded steps of each where it has steps."""
    record = read_any(recording, **(read or {})).recording
    with naming_file(recording):
        channels = {role: choose_channel(record, role, name) for role, name in roles.items()}
        runs = [select_between(run, start, end) for run in record.runs]
        cut = by_step and bool(record.meta.get("steps"))
        if by_step and not {"pressure", "muscle.pressure"} & {*record.channels}:  # loops are told apart by it
            with contextlib.suppress(InputError):
                if not (beside := choose_channel(record, "pressure")).endswith("_abs"):
                    channels["pressure"] = beside
                    runs = [run.with_channels({"pressure": run.channels[beside]}) for run in runs]
        parts = tuple((at, part) for at, run in enumerate(runs, 1) for part in (segments(run) if cut else [run]))
    guessed = tuple(role for role, name in roles.items() if name is None)
    about = (*MACHINE, "source", *channels.values())
    return _Question(
        path_of(recording), parts, channels, guessed, collect(*(c for c in record.cautions if c.parameter in about))
    )


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: None if isinstance(value, float) and value != value else value for name, value in row.items()}


# ---- loops, work, stiffness

_AT = (Column("cycle", right=True), Column("time", "from", "s", places=".4g"))
_PRESSURE = Column("pressure", None, "Pa", missing="-")


class _Loops(NamedTuple):
    rows: list[dict[str, Any]]
    loops: list[TensionLoop]
    cautions: tuple[Caution, ...]
    note: str


def _loops_of(question: _Question, skip: int) -> _Loops:
    """All loops of all runs, parted by what was held in them whichever run or step they are of."""
    names = {"length": question.channels["length"], "tension": question.channels["tension"]}
    results, said = question.each(lambda part: loops_by_held(part, **names, skip=skip))
    rows: list[dict[str, Any]] = []
    items: list[TensionLoop] = []
    conditions: list[dict[str, tuple[np.ndarray, float]]] = []
    cautions = [*question.cautions, *said]
    for number, part, (groups, own) in results:
        cautions += own
        each = sorted(
            (pair for held, of in groups for pair in zip(held.cycles, of, strict=True)), key=lambda pair: pair[0]
        )
        conditions.append(cycle_conditions(part, [cycle for cycle, _ in each], **names))
        before = sum(row["run"] == number for row in rows)
        for count, (cycle, one) in enumerate(each, 1 + before):
            begin, lasted = float(part.time[cycle.start]), float(part.time[cycle.end] - part.time[cycle.start])
            friction = one.friction if one.height > 0.0 else None  # of a muscle that drives, none is shown
            more = {"work": one.work, "power": one.work / lasted, "friction": friction}
            place = {"run": number, "group": "", "cycle": count, "time": begin, "duration": lasted}
            rows.append(_plain(place | one._asdict() | more))
            items.append(one)
    shared = [name for name in conditions[0] if all(name in one for one in conditions)]
    every = {n: (np.concatenate([c[n][0] for c in conditions]), max(c[n][1] for c in conditions)) for n in shared}
    for chosen, held in parted_by(every):
        for at in chosen:
            rows[at]["group"] = HeldCycles((), held).words()
    return _Loops(rows, items, collect(*cautions), "")


def _loops_or_whole(
    question: _Question, skip: int, name: str, measure: Callable[[np.ndarray, np.ndarray], float]
) -> _Loops:
    """All loops, or where there are none a number of each whole run, measured along its length and tension."""
    along, pull = question.channels["length"], question.channels["tension"]
    for _, part in question.parts:
        known(part, pull)
    if not any(np.ptp(known(part, along)) > 0.0 for _, part in question.parts):
        raise InputError(f"channel {along}", None, "is constant, so the muscle neither works nor shows a stiffness")
    try:
        return _loops_of(question, skip)
    except InputError:
        if skip:
            raise
    rows = []
    for number, part in question.parts:
        at = {"run": number, "group": "", "cycle": 1, "time": float(part.time[0]), "duration": part.duration}
        ends = {"length_low": float(part[along].min()), "length_high": float(part[along].max()), "pressure": None}
        rows.append(_plain(at | ends | {name: measure(part[along], part[pull])}))
    return _Loops(rows, [], question.cautions, f"{along} has no full cycle: the {name} is that of all samples.")


def _over(question: _Question) -> str:
    return f"of {question.channels['tension']} over {question.channels['length']}"


@verbs.verb
def loops(
    recording: verbs.DataFile,
    *,
    length: verbs.ChannelName | None = None,
    tension: verbs.ChannelName | None = None,
    skip: verbs.Count = 0,
    start: verbs.Time | None = None,
    end: verbs.Time | None = None,
    read: verbs.Reading | None = None,
) -> RecordingNumbers[TensionLoop]:
    """Measure each loop of tension over length: work, friction, width, height and stiffness.

    Loops in which pressure, speed or stroke differ are told apart. Work is positive where the muscle delivers it; a height
    is the tension while lengthening less that while shortening, and the friction half of it where it is positive.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        length: channel with the length; found by its name and unit by default.
        tension: channel with the tension; found by its name and unit by default.
        skip: number of first cycles that are left out, whose history is another.
        start: time from which on samples are used [s], such as '2 s'.
        end: time up to which samples are used [s], such as '5 s'.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: a channel is missing, not clear or not finite, or there is no full cycle.

    Examples:
        >>> import numpy as np
        >>> import mckibben as mk
        >>> time = np.linspace(0.0, 2.0, 401)
        >>> span = mk.Channel(0.12 + 0.01 * np.sin(2.0 * np.pi * time), "m", "measured")
        >>> pull = mk.Channel(30.0 + 2.0 * np.sign(np.cos(2.0 * np.pi * time)), "N", "measured")
        >>> [round(one.friction, 2) for one in mk.Recording(time, {"span": span, "cell": pull}).loops()]
        [2.0]
    """
    question = _question(recording, read, start, end, {"length": length, "tension": tension}, by_step=True)
    rows, items, cautions, _ = _loops_of(question, skip)
    units = {"work": "J", "friction": "N", "height": "N", "width": "m", "stiffness": "N/m"}
    numbers = [Column(name, None, unit, missing="-") for name, unit in units.items()]
    columns = (*_AT, _PRESSURE, *numbers)
    return question.answer(f"Loops {_over(question)}", items, rows, columns, [*units], (), cautions)


@verbs.verb
def work(
    recording: verbs.DataFile,
    *,
    length: verbs.ChannelName | None = None,
    tension: verbs.ChannelName | None = None,
    skip: verbs.Count = 0,
    start: verbs.Time | None = None,
    end: verbs.Time | None = None,
    read: verbs.Reading | None = None,
) -> RecordingNumbers[float]:
    """Compute the work and power of a muscle in each cycle, or along the whole record where there is no cycle.

    Of the file of a muscle lever that states its sine, cycles are cut at the length about which the lever moves, as
    workloopR cuts them; of others from turn to turn of the length. Work is positive where the muscle delivers it.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        length: channel with the length; found by its name and unit by default.
        tension: channel with the tension; found by its name and unit by default.
        skip: number of first cycles that are left out.
        start: time from which on samples are used [s], such as '2 s'.
        end: time up to which samples are used [s], such as '5 s'.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: a channel is missing, not clear or not finite, or fewer cycles are there than are left out.
    """
    question = _question(recording, read, start, end, {"length": length, "tension": tension}, by_step=True)
    stated = lever.stated_protocol(question.parts[0][1])
    if stated is not None and stated.cycle_frequency and start is None and end is None:
        names: dict[str, Any] = {"length": question.channels["length"], "force": question.channels["tension"]}
        results, said = question.each(lambda part: lever.lever_loops(part, **names)[skip:])
        each = [
            {"run": run, "group": "", "time": float(part.time[one.start]), **one._asdict()}
            for run, part, cycles in results for one in cycles
        ]  # fmt: skip
        note = "Cycles are cut at L0, as those of a muscle lever; mckibben record work-loops cuts them elsewhere."
        odd = [
            one for _, part, cycles in results
            for one in cautions_of_cycles(part, cycles, length=names["length"], taken="in the range below")
        ]  # fmt: skip
        cautions = collect(*question.cautions, *said, *odd)
        if not each:
            raise InputError("skip", skip, "must leave a cycle")
    else:
        each, _, cautions, note = _loops_or_whole(question, skip, "work", path_work)
    names_kept = ("run", "group", "cycle", "time", "duration", "work")
    rows = tuple({**{n: row[n] for n in names_kept}, "power": row["work"] / row["duration"]} for row in each)
    numbers = (Column("duration", None, "s"), Column("work", None, "J"), Column("power", None, "W"))
    done, summarised = [row["work"] for row in rows], ("duration", "work", "power")
    return question.answer(f"Work {_over(question)}", done, rows, (*_AT, *numbers), summarised, [note], cautions)


@verbs.verb
def stiffness(
    recording: verbs.DataFile,
    *,
    length: verbs.ChannelName | None = None,
    tension: verbs.ChannelName | None = None,
    skip: verbs.Count = 0,
    start: verbs.Time | None = None,
    end: verbs.Time | None = None,
    read: verbs.Reading | None = None,
) -> RecordingNumbers[float]:
    """Measure the stiffness about the middle of each loop, or of one pull where there is no loop.

    It is the slope of tension over length, of a straight line over half the range of the length; of a loop the mean of both
    of its paths.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        length: channel with the length; found by its name and unit by default.
        tension: channel with the tension; found by its name and unit by default.
        skip: number of first cycles that are left out.
        start: time from which on samples are used [s], such as '2 s'.
        end: time up to which samples are used [s], such as '5 s'.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: a channel is missing, not clear or not finite, the length does not change, or fewer cycles are there
            than are left out.
    """
    question = _question(recording, read, start, end, {"length": length, "tension": tension}, by_step=True)
    each, _, cautions, note = _loops_or_whole(question, skip, "stiffness", path_stiffness)
    names_kept = ("run", "group", "cycle", "time", "pressure", "length_low", "length_high", "stiffness")
    rows = tuple({name: row[name] for name in names_kept} for row in each)
    lengths = (Column("length_low", "length from", "m"), Column("length_high", "to", "m"))
    columns, slopes = (*_AT, _PRESSURE, *lengths, Column("stiffness", None, "N/m")), [row["stiffness"] for row in rows]
    return question.answer(f"Stiffness {_over(question)}", slopes, rows, columns, ["stiffness"], [note], cautions)


# ---- steps


_COMMANDS = ("valve.command", "command.pressure", "stimulus", "excitation")  # that are looked at first


@verbs.verb
def steps(
    recording: verbs.DataFile,
    *,
    command: verbs.ChannelName | None = None,
    channel: verbs.ChannelName | None = None,
    start: verbs.Time | None = None,
    end: verbs.Time | None = None,
    read: verbs.Reading | None = None,
) -> RecordingNumbers[StepResponse]:
    """Time how pressure and tension follow each step of a command, or a muscle its stimulus: delay, rise and settling.

    The delay ends where 2 % of the step is passed for good, the rise where 90 % is reached; a channel has settled when it
    stays within 5 % of the step. A contraction ends at its peak, and has no settling.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        command: channel that steps, or the stimulus; by default a command that does, else the stimulus, else the pressure.
        channel: channel that follows; pressure and tension by default.
        start: time from which on samples are used [s], such as '2 s'.
        end: time up to which samples are used [s], such as '5 s'.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: a channel is missing or not finite, nothing steps, or nothing follows.
    """
    question = _question(recording, read, start, end, {})
    first = question.parts[0][1]
    for name in (command, channel):
        if name is not None:
            first.unit(name)  # refuses what is no channel, before anything is looked for
    driver = _driver(first) if command is None else command
    followers = [channel] if channel is not None else _followers(first, driver)
    rows: list[dict[str, Any]] = []
    items: list[StepResponse] = []
    said_of_pulses = cautions_of_contraction(lever.stated_protocol(first)) if _pulsed(driver) else ()
    cautions, failure = [*question.cautions, *said_of_pulses], None
    for name in followers:
        unit = first.unit(name)
        try:
            results, said = question.each(functools.partial(_timings, driver=driver, name=name))
        except InputError as error:
            failure = failure or error
            cautions.append(Caution(f"{name} is left out: {error}", "channel"))
            continue
        cautions += said
        for number, _, each in results:
            for count, one in enumerate(each, 1):
                row = {
                    "run": number,
                    "group": f"{name}, {'rise' if one.rising else 'fall'}",
                    "step": count,
                    "unit": unit,
                }
                rows.append(_plain(row | {"channel": name} | one._asdict()))
        items += [one for *_, each in results for one in each]
    if not rows:
        raise failure or InputError("channel", None, "must name a channel that follows")
    slow = dict.fromkeys(row["group"] for row in rows if not row["settled"])
    if slow:
        under_way = (
            f"{'; '.join(slow)}: not settled before the next step or the end; its numbers are of a step under way"
        )
        cautions.append(Caution(under_way, "channel"))
    times = tuple(Column(n, t, "s", "ms", missing="-") for n, t in _TIMES.items())
    columns = (
        Column("step", right=True), Column("command_time", "at", "s", places=".4g"), Column("before", own="unit"),
        Column("after", own="unit"), *times,
    )  # fmt: skip
    guessed = (*(("command",) if command is None else ()), *(("channel",) if channel is None else ()))
    question = question._replace(channels={"command": driver, "channel": " and ".join(followers)}, guessed=guessed)
    return question.answer(f"Steps of {driver}", items, rows, columns, [*_TIMES], (), cautions)


_TIMES = {"delay": "delay", "transition": "rise or fall", "settling_time": "settling"}


def _pulsed(name: str) -> bool:
    return name.rpartition(".")[2] in ("stimulus", "excitation")


def _driver(record: Recording) -> str:
    """The channel that steps: a command, the stimulus, else the pressure."""
    commands = [n for n, c in record.channels.items() if c.kind == "command" and n not in _COMMANDS]
    for name in (*_COMMANDS, *commands, "muscle.pressure", "pressure"):
        if name not in record or not np.isfinite(record[name]).all() or not np.ptp(record[name]) > 0.0:
            continue
        with contextlib.suppress(InputError):
            return name if _pulsed(name) or find_steps(record, name) else ""
    problem = f"must name the channel that steps; none of {', '.join(record.names())} does between two samples"
    raise InputError("command", None, problem)


def _followers(record: Recording, driver: str) -> list[str]:
    names = []
    for role in ("pressure", "tension"):
        with contextlib.suppress(InputError):
            names.append(choose_channel(record, role))
    if not (names := [name for name in names if name != driver]):
        raise InputError("channel", None, f"must name the channel that follows; the recording has {record.names()}")
    return names


def _timings(run: Recording, driver: str, name: str) -> tuple[StepResponse, ...]:
    """What follows each step; of a stimulus one, which ends at the peak."""
    if not _pulsed(driver):
        return step_responses(run, command=driver, channel=name)
    of = lever.contraction_timing(run, rising=(ONSET, REACHED), relaxing=(), force=name, stimulus=driver)
    begins, reaches = (point.time for point in of.rising)
    since, end = begins - of.stimulus_time, float(run.time[-1])
    levels = (of.stimulus_force, of.peak_force, ONSET)
    return (StepResponse(of.stimulus_time, begins, since, reaches - begins, *levels, end, float("nan"), True),)


# ---- leak


class HeldPressure(NamedTuple):
    """How the pressure of a shut muscle falls."""

    start: float  # of the hold [s]
    end: float  # [s]
    pressure: float  # mean gauge pressure, at which the leak holds [Pa]
    rate: float  # fall of pressure per time [Pa/s]
    decay: float  # share of the pressure that is lost per second [1/s]
    decay_low: float  # of its 95 % interval [1/s]
    decay_high: float  # [1/s]
    flow: float  # air of the reference atmosphere; NaN where no volume is known [m^3/s]
    conductance: float  # of the leak, as circuits state it; NaN where no volume is known [m^3/(s*Pa)]


@verbs.verb
def leak(
    recording: verbs.DataFile,
    *,
    pressure: verbs.ChannelName | None = None,
    gas_volume: verbs.AirVolume | None = None,
    start: verbs.Time | None = None,
    end: verbs.Time | None = None,
    read: verbs.Reading | None = None,
) -> RecordingNumbers[HeldPressure]:
    """Measure how fast the pressure of a shut muscle falls, and how much air that is.

    The hold is what is between the times that are stated, else the steps named shut or leak, else the longest while
    in which the pressure falls by less than 3 % a second. Air is that of ISO 6358, at 20 °C, 1 bar and 65 % humidity.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        pressure: channel with the gauge pressure; found by its name and unit by default.
        gas_volume: volume of muscle and tube behind the valve [m^3], such as '200 ml'; by default that which the recording
            has of the muscle, if any.
        start: time from which on the muscle is shut [s], such as '2 s'.
        end: time up to which it is shut [s], such as '60 s'.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: the pressure is missing, not clear or not finite, or nothing is held.

    Examples:
        >>> import numpy as np
        >>> import mckibben as mk
        >>> time = np.linspace(0.0, 60.0, 601)
        >>> held = mk.Channel(5e5 - 200.0 * time, "Pa", "measured")
        >>> (hold,) = mk.Recording(time, {"pressure": held}).leak(gas_volume="200 ml")
        >>> round(hold.rate), round(6e7 * hold.flow, 1)
        (200, 24.0)
    """
    stated = start is not None or end is not None
    question = _question(recording, read, start, end, {"pressure": pressure})
    name, cautions = question.channels["pressure"], list(question.cautions)
    volume = None if gas_volume is None else float(gas_volume)

    def holds(run: Recording) -> list[tuple[HeldPressure, str]]:
        return [_leaked(part, name, volume) for part in ([run] if stated else _holds(run, name))]

    results, said = question.each(holds)
    rows = [_plain({"run": run, "group": ""} | one._asdict()) for run, _, each in results for one, _ in each]
    cautions += [*said, *(Caution(words, "hold") for *_, each in results for _, words in each if words)]
    items = tuple(one for *_, each in results for one, _ in each)
    columns = [
        Column("start", "from", "s"), Column("end", "to", "s"), Column("pressure", "at", "Pa"),
        Column("rate", "falls by", "Pa/s", "mbar/min"),
        Column("decay", "share lost", "1/s", "%/min", ends=("decay_low", "decay_high")),
    ]  # fmt: skip
    summarised = ["pressure", "rate", "decay"]
    if any(np.isfinite(one.flow) for one in items):
        columns += [
            Column("flow", "air", "m^3/s", "ml/min", missing="-"),
            Column("conductance", "leak of a circuit", "m^3/(s*Pa)", "ml/min/bar", missing="-"),
        ]
        summarised += ["flow", "conductance"]
        note = "Air at 20 °C, 1 bar and 65 % humidity; the conductance is that of a leak in a circuit."
    else:
        note = "{gas_volume} says how much air that is."
    if name.endswith("_abs"):
        note = f"{name} is absolute; its gauge pressure is less {with_unit(AMBIENT, 'Pa', 6)}. {note}"
    if not stated:
        note = f"The hold was found by the pressure or by its step; {{start}} and {{end}} state another. {note}"
    return question.answer(f"Leak by {name}, gauge", items, rows, columns, summarised, [note], cautions)


def _holds(run: Recording, name: str) -> list[Recording]:
    """The parts of a run in which the muscle is shut: by the names of its steps, else by the pressure itself."""
    if run.meta.get("steps"):
        labels = dict.fromkeys(str(step["label"]) for step in steps_of(run) if step["recorded"])
        shut = [label for label in labels if {*label.lower().split()} & {"shut", "leak"}]
        if shut:
            return [part for label in shut for part in segments(run, label)]
    p, time = known(run, name), run.time
    edges = np.linspace(time[0], time[-1], min(BINS, max(len(run) // 4, 1)) + 1)
    place = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(edges) - 2)
    counts = np.bincount(place)
    filled = np.flatnonzero(counts)
    level, clock = (np.bincount(place, weights=v)[filled] / counts[filled] for v in (p, time))
    rate = np.diff(level) / np.diff(clock) / np.maximum(level[1:], 1e-3 * max(float(p.max()), 1.0))
    held = (np.abs(rate) <= QUICKEST) & (np.minimum(level[1:], level[:-1]) > HELD * level.max())
    stretches = np.split(np.arange(len(held)), np.flatnonzero(np.diff(held)) + 1) if len(held) else []
    longest = max((s for s in stretches if held[s[0]]), key=len, default=None)
    if longest is None or len(longest) < 4:
        problem = f"must be held for a while; {name} is nowhere, to 3 % a second: state {{start}} and {{end}}"
        raise InputError("pressure", None, problem)
    last = longest[-1] if longest[-1] + 2 < len(level) else longest[-1] + 1  # the next may hold the begin of venting
    top = longest[0] + int(np.argmax(level[longest[0] : last]))
    return [run.select(float(clock[top]), float(clock[last]))]


def _leaked(part: Recording, name: str, volume: float | None) -> tuple[HeldPressure, str]:
    """How a hold leaks, and a sentence where its halves differ."""
    kept = part.select(start=part.time[0] + min(WARM, 0.1 * part.duration))
    if len(kept) < 10:
        raise InputError(f"channel {name}", None, f"must have 10 samples or more while it is held, got {len(kept)}")
    p = known(kept, name) - (AMBIENT if name.endswith("_abs") else 0.0)
    mean = float(np.mean(p))
    if not mean > 0.0:
        raise InputError(
            f"channel {name}", with_unit(mean, "Pa"), "must be a gauge pressure above zero while it is held"
        )
    decay = pressure_decay(kept.time, p)
    if volume is None and "muscle.volume" in kept and np.isfinite(kept["muscle.volume"]).all():
        volume = float(np.mean(kept["muscle.volume"]))
    rate = decay.value * mean
    flow = float("nan") if volume is None else flow_of_decay(rate, volume=volume)
    through = float("nan") if volume is None else float(Leak.from_flow(flow, pressure=mean).conductance)
    middle = len(kept) // 2
    early, late = (pressure_decay(kept.time[cut], p[cut]) for cut in (slice(middle), slice(middle, None)))
    words = ""
    if abs(early.value - late.value) > UNEVEN * decay.value and not (early.low <= late.high and late.low <= early.high):
        first, then = (f"{6e3 * half.value:.3g} %" for half in (early, late))
        words = (
            f"{name} loses {first} a minute in the first half of the hold and {then} in the second: warm air that cools, a "
            "muscle that creeps, or a valve that still acts; a later {start} is nearer the leak"
        )
    elif decay.low == 0.0:
        words = f"{name} does not fall by more than its uncertainty: the muscle is tight as far as this record shows"
    ends = float(kept.time[0]), float(kept.time[-1])
    return HeldPressure(*ends, mean, rate, decay.value, decay.low, decay.high, flow, through), words
