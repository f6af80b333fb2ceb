"""Steps of a protocol and their commands: follow a waveform, ramp to a value, isolate the muscle, and others.

A command is one class: how its words are read, what the rig must have for it, its set-points, and its sentence. An installed
package adds one by an entry point of the group ``mckibben.steps``.
"""

from __future__ import annotations

import abc
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from .. import schema
from .._jax import Scalar
from ..documents import JsonValue
from ..errors import InputError
from ..registry import Registry
from ..schema import FileTable, FrozenTable, Place, frozen, read_table, thawed
from .amounts import (
    COMMANDED,
    Amount,
    Until,
    has_both,
    in_metres,
    in_si,
    read_amount,
    read_until,
    relative_unit,
    table_words,
)
from .waveforms import Constant, PointTable, Sine, Triangle, Waveform, read_waveform, time_words
from .waveforms.waveform import JUMP, RELATIVE

MOST_CYCLES = 100_000
USUAL_REST_LENGTH = 0.14  # [m]
OPEN = (1e-9, 1e7)  # times and rates that a step may state
MODES = ("span", "velocity", "tension")  # what the motor can control
DRIVES = {"pressure": frozenset(("valve",)), "stimulation": frozenset(("stimulator",))}  # of a muscle: parts they need
MOST_STIMULI = 1_000_000


@dataclass(frozen=True)
class Deferred:
    """A set-point that begins at the then present state: constant, or linear `to` a value [SI] in `seconds`."""

    to: float | None = None
    seconds: float | None = None

    def at(self, start: Scalar, times: Scalar) -> Scalar:
        """Set-points at times [s] from the beginning of the step, for a start [SI]."""
        if self.to is None or self.seconds is None:
            return start + 0.0 * np.asarray(times)
        return start + (self.to - start) * np.clip(np.asarray(times) / self.seconds, 0.0, 1.0)


@dataclass(frozen=True)
class Reach:
    """Range in which a set-point or the span lies, as far as it is known in advance [SI].

    `low` equals `high` if it is certain.
    """

    low: float
    high: float

    @property
    def known(self) -> bool:
        """Whether it is certain."""
        return self.low == self.high


ANYWHERE = Reach(float("-inf"), float("inf"))


@dataclass(frozen=True, eq=False)
class SetPoints:
    """The set-points of one channel in one step.

    Attributes:
        values: [SI], (samples,); deferred where they depend on the machine, None while the muscle is isolated.
        reach: where they go.
        after: where the channel is after the step.
    """

    values: np.ndarray | Deferred | None
    reach: Reach
    after: Reach


@dataclass(frozen=True)
class StepClock:
    """The samples of a step: their times from its beginning [s], its duration [s], the rest length [m] of its muscle."""

    times: np.ndarray
    duration: float
    rest_length: float
    step: ProtocolStep


class Command(abc.ABC):
    """A way to drive a channel in a step."""

    digest_name: ClassVar[str]  # under which the hash of a protocol knows it; never changes

    @classmethod
    @abc.abstractmethod
    def accepts(cls, raw: object, channel: str) -> bool:
        """Whether the entry of a channel states this command."""

    @classmethod
    @abc.abstractmethod
    def read(cls, raw: object, place: Place, channel: str) -> Command:
        """Read the command from its entry; raises `InputError` with the dotted path of the error."""

    @abc.abstractmethod
    def needs(self, channel: str) -> frozenset[str]:
        """Sensors and parts that a rig must have for it on a channel."""

    @abc.abstractmethod
    def set_points(self, before: Reach, clock: StepClock) -> SetPoints:
        """Set-points, for a channel that is `before` the step [SI]."""

    @abc.abstractmethod
    def sentence(self, channel: str) -> str:
        """Describe the command, with all its numbers."""

    def duration(self, start: Reach, rest_length: float) -> float | None:
        """Time that it takes by itself from a start [s]; NaN if that is not known, None if the step decides."""
        return None

    def target(self, rest_length: float) -> float | None:
        """Final value, independent of the start [SI]; None if only the set-points determine it."""
        return None

    def check(self, step: ProtocolStep) -> None:  # noqa: B027 - most go together with any step
        """Refuse a step that it does not go together with; raises `InputError`."""


@dataclass(frozen=True)
class Follow(Command):
    """Follow a waveform from the beginning of the step; its unit is SI, ``L0`` or ``L0/s``.

    Some values may be in rest lengths and others not. `mixed` then has the waveform's table, and `waveform` is that of a
    muscle of `USUAL_REST_LENGTH`, whose kind and times are those of any other.
    """

    digest_name: ClassVar[str] = "Follow"
    waveform: Waveform
    unit: str
    mixed: Any = None
    place: str = field(default="", compare=False)

    @classmethod
    def accepts(cls, raw: object, channel: str) -> bool:
        """Whether the entry is a waveform, or a constant value."""
        return not isinstance(raw, Mapping) or "kind" in raw

    @classmethod
    def read(cls, raw: object, place: Place, channel: str) -> Follow:
        """Make it of a waveform's table, or of a value."""
        unit, where = COMMANDED[channel], place.where
        if has_both(raw, unit):
            usual = read_waveform(in_metres(raw, unit, USUAL_REST_LENGTH), unit, field=place.field, where=where)
            return cls(usual, unit, frozen(in_si(raw, unit)), place.field)
        freed, wave_unit = relative_unit(raw, unit)
        try:
            return cls(
                read_waveform(freed, unit if wave_unit == unit else "1", field=place.field, where=where), wave_unit
            )
        except InputError as error:
            if wave_unit != unit and "pure number" in error.problem:
                demand = f"must be a value in {wave_unit} or {unit}, or another unit of that dimension"
                raise error.changed(problem=demand, where=where) from None
            raise

    def at(self, times: np.ndarray, rest_length: float) -> np.ndarray:
        """Set-points [SI] at times [s] from the beginning of the step, shape of the times."""
        if self.mixed is not None:
            table = in_metres(self.mixed, self.unit, rest_length)
            return read_waveform(table, self.unit, field=self.place, where=None).at(times)
        return self.waveform.at(times) * (rest_length if self.unit in RELATIVE else 1.0)

    def needs(self, channel: str) -> frozenset[str]:
        """The valve, or the motor where the set-point changes or is no span."""
        if channel in DRIVES:
            return DRIVES[channel]
        return frozenset(() if channel == "span" and isinstance(self.waveform, Constant) else ("motor",))

    def set_points(self, before: Reach, clock: StepClock) -> SetPoints:
        """The waveform's values."""
        values = self.at(np.append(clock.times, clock.duration), clock.rest_length)
        return known_set_points(values[:-1], float(values[-1] if self.waveform.straight else values[-2]), clock)

    def sentence(self, channel: str) -> str:
        """Describe the command, such as ``span as triangle from 0.75 L0 to 1 L0 at 1 Hz``, ``pressure 5 bar``."""
        if self.mixed is not None:
            return f"{channel} as {table_words(self.mixed, self.unit)}"
        joint = "" if isinstance(self.waveform, Constant) else "as "
        return f"{channel} {joint}{self.waveform.sentence(self.unit)}"


@dataclass(frozen=True)
class RampTo(Command):
    """Go on a line from where it is to a value, in a time [s] or at a speed."""

    digest_name: ClassVar[str] = "Go"
    to: Amount
    seconds: float | None = None
    speed: Amount | None = None

    @classmethod
    def accepts(cls, raw: object, channel: str) -> bool:
        """Whether the entry is a ramp: a table with ``to`` and no ``kind``."""
        return isinstance(raw, Mapping) and "to" in raw and "kind" not in raw

    @classmethod
    def read(cls, raw: JsonValue, place: Place, channel: str) -> RampTo:
        """Make it of ``to`` and one of ``in`` and ``at``."""
        unit, table = COMMANDED[channel], FileTable(raw, place.field, place.where or "")
        table.only(("to", "in", "at"), "a line has")
        if ("in" in table) == ("at" in table):
            problem = "is missing" if "in" not in table else "cannot be stated beside at"
            raise table.fail("in", None, f"{problem}: a line has either a time, in, or a speed, at")
        to = read_amount(raw["to"], unit, field=table.field("to"), where=place.where)
        if "in" in table:
            return cls(to, read_amount(raw["in"], "s", field=table.field("in"), where=place.where, bounds=OPEN).value)
        field, bounds = table.field("at"), (1e-12, 1e12)
        return cls(to, speed=read_amount(raw["at"], f"{unit}/s", field=field, where=place.where, bounds=bounds))

    def needs(self, channel: str) -> frozenset[str]:
        """The valve or the motor."""
        return DRIVES.get(channel, frozenset(("motor",)))

    def duration(self, start: Reach, rest_length: float) -> float:
        """Time that the line takes [s]; NaN if only a speed is stated and the start is not known."""
        if self.seconds is not None:
            return self.seconds
        assert self.speed is not None  # the reader asks for one of the two
        begin = start.low if start.known else float("nan")
        return abs(self.to.si(rest_length) - begin) / self.speed.si(rest_length)

    def target(self, rest_length: float) -> float:
        """The value at its end [SI]."""
        return self.to.si(rest_length)

    def set_points(self, before: Reach, clock: StepClock) -> SetPoints:
        """The line, and after its end that value."""
        to = self.to.si(clock.rest_length)
        if not before.known:
            hull = Reach(min(before.low, to), max(before.high, to))
            ends = self.seconds is not None and clock.duration >= self.seconds * (1.0 - 1e-12)
            there = clock.step.until is None and ends
            return SetPoints(Deferred(to, self.seconds), hull, Reach(to, to) if there else hull)
        seconds = self.duration(before, clock.rest_length)
        ends_at = np.append(clock.times, clock.duration)
        share = np.clip(ends_at / seconds, 0.0, 1.0) if seconds > 0.0 else np.ones(ends_at.shape)
        values = before.low + (to - before.low) * share
        # the set-point at the end belongs to the first sample of the next step
        end = to if clock.duration >= seconds * (1.0 - 1e-12) else float(values[-1])
        return known_set_points(values[:-1], end, clock)

    def sentence(self, channel: str) -> str:
        """Describe the command, such as ``pressure to 5 bar in 1 s``."""
        way = f"at {self.speed.sentence()}" if self.speed is not None else f"in {time_words(self.seconds or 0.0)}"
        return f"{channel} to {self.to.sentence()} {way}"


@dataclass(frozen=True)
class DirectionDependent(Command):
    """Pressure by the direction of the motion: one value while the muscle shortens, another while it lengthens.

    Each change leads the reversal of the motion by `lead` [s] and takes `ramp` [s]; one that would lie before the motion
    begins starts with it. Pressures are gauge [Pa].
    """

    digest_name: ClassVar[str] = "Phased"
    shortening: float = schema.number("Pa", (-1e9, 1e9), "pressure while the muscle shortens")
    lengthening: float = schema.number("Pa", (-1e9, 1e9), "pressure while the muscle lengthens")
    lead: float = schema.number("s", (0.0, 1e3), "time by which a change leads the reversal", default=0.0)
    ramp: float = schema.number("s", (1e-4, 1e3), "time that a change takes", kw_only=True)

    @classmethod
    def accepts(cls, raw: object, channel: str) -> bool:
        """Whether a pressure is stated by ``shortening`` and its other keys."""
        return channel == "pressure" and isinstance(raw, Mapping) and "shortening" in raw and "kind" not in raw

    @classmethod
    def read(cls, raw: JsonValue, place: Place, channel: str) -> DirectionDependent:
        """Read the command from its table."""
        return read_table(cls, FileTable(raw, place.field, place.where or ""), owner="pressure by direction has")

    def needs(self, channel: str) -> frozenset[str]:
        """The valve."""
        return frozenset(("valve",))

    def check(self, step: ProtocolStep) -> None:
        """Refuse a step whose span follows no sine or triangle, or whose strokes are too short."""
        if not isinstance(step.motor, Follow) or step.mode != "span":
            demand = "by direction needs a span that follows a sine or triangle in this step"
            raise InputError("pressure", None, demand)
        try:
            self.table(step.motor.waveform, step.stated_duration() or 0.0)
        except InputError as error:
            raise error.changed(field=error.field if "." in error.field else f"pressure.{error.field}") from None

    def set_points(self, before: Reach, clock: StepClock) -> SetPoints:
        """The pressures of every stroke of the motion."""
        motion = clock.step.motor
        assert isinstance(motion, Follow)  # `check` has seen to it
        values = self.table(motion.waveform, clock.duration).at(np.append(clock.times, clock.duration))
        return known_set_points(values[:-1], float(values[-1]), clock)

    def table(self, motion: Waveform, duration: float) -> PointTable:
        """The pressure over a duration [s] of a sine or triangle of the span.

        Raises:
            InputError: if the motion is another one, or its strokes are shorter than the ramps.
        """
        start, share, period = _shortening(motion)
        if self.ramp >= period * min(share, 1.0 - share):
            stroke = time_words(period * min(share, 1.0 - share))
            raise InputError("ramp", time_words(self.ramp), f"must be less than the shorter stroke, {stroke}")
        if duration > MOST_CYCLES * period:
            demand = f"must be at most {MOST_CYCLES} with pressure by direction, got {duration / period:.6g}"
            raise InputError("cycles", None, demand)
        changes = []
        for k in range(-1, math.ceil(duration / period) + 2):
            rise, fall = start + k * period, start + (k + share) * period
            if fall > 1e-9:  # a stroke under way at the beginning has its pressure from there on
                changes += [(max(rise - self.lead, 0.0), self.shortening), (fall - self.lead, self.lengthening)]
        times, values = [0.0], [self.lengthening]
        for begin, to in changes:
            if begin < times[-1]:
                raise InputError("lead", time_words(self.lead), "must be less; one change would overtake another")
            if begin > times[-1]:
                times, values = [*times, begin], [*values, values[-1]]
            times, values = [*times, begin + self.ramp], [*values, to]
        return PointTable(times=tuple(times), values=tuple(values))

    def sentence(self, channel: str) -> str:
        """Describe it as ``pressure 5 bar while it shortens and 1 bar while it lengthens, in ramps of 20 ms``."""
        high, low = Amount(self.shortening, "Pa").sentence(), Amount(self.lengthening, "Pa").sentence()
        early = f", {time_words(self.lead)} early" if self.lead else ""
        return f"{channel} {high} while it shortens and {low} while it lengthens{early}, in ramps of {time_words(self.ramp)}"


@dataclass(frozen=True)
class StimulusTrain(Command):
    """Stimuli of a biological muscle: each excites it fully for `width` [s].

    Without a rate there is one stimulus. With one they follow at `rate` [1/s] from `start` [s] on, for `lasts` [s] or to the
    end of the step. With `phase` [rad] and `duty` [1] there is a train in each cycle of the span, which follows a sine: it
    begins at a phase of the sine (0 at the mean length while the muscle lengthens, 90 degrees at the longest) and goes on
    for a share of the cycle, as in the work loops of R. K. Josephson, Journal of Experimental Biology 114(1), 1985,
    doi:10.1242/jeb.114.1.493. The set-point of a sample is the share of its period in which the muscle is excited, so that
    every stimulus counts the same at any sample rate. No stimulus outlasts its step.
    """

    digest_name: ClassVar[str] = "Stimuli"
    width: float = schema.number("s", (1e-6, 1e3), "excitation by one stimulus")
    rate: float | None = schema.number("1/s", (1e-6, 1e5), "stimuli per time within a train", default=None)
    start: float = schema.number("s", (0.0, 1e6), "first stimulus", default=0.0)
    lasts: float | None = schema.number("s", OPEN, "duration of the train", default=None)
    phase: float | None = schema.number("rad", (-7.0, 7.0), "phase of the span at which a train begins", default=None)
    duty: float | None = schema.number("1", (0.0, 1.0), "share of the cycle that a train takes", default=None)

    @classmethod
    def accepts(cls, raw: object, channel: str) -> bool:
        """Whether a stimulation is stated by the ``width`` of its stimuli."""
        return channel == "stimulation" and isinstance(raw, Mapping) and "width" in raw and "kind" not in raw

    @classmethod
    def read(cls, raw: JsonValue, place: Place, channel: str) -> StimulusTrain:
        """Read the command from its table."""
        table = FileTable(raw, place.field, place.where or "")
        train = read_table(cls, table, owner="a stimulation has")
        if (train.phase is None) != (train.duty is None):
            missing, present = ("phase", "duty") if train.phase is None else ("duty", "phase")
            raise table.fail(missing, None, f"is missing: {present} and {missing} are stated together")
        if train.rate is None and (train.lasts is not None or train.duty is not None):
            raise table.fail("rate", None, "is missing: a train of stimuli has one")
        if train.duty is not None and (train.lasts is not None or train.start > 0.0):
            raise table.fail(
                "duty", None, "cannot be stated beside start or lasts: the cycle of the span times the trains"
            )
        return train

    def needs(self, channel: str) -> frozenset[str]:
        """The stimulator."""
        return DRIVES["stimulation"]

    def check(self, step: ProtocolStep) -> None:
        """Refuse trains in cycles of a span that follows no sine."""
        if self.duty is None:
            return
        if step.mode != "span" or not isinstance(step.motor, Follow) or not isinstance(step.motor.waveform, Sine):
            demand = "with phase and duty needs a span that follows a sine in this step"
            raise InputError("stimulation", None, demand)

    def set_points(self, before: Reach, clock: StepClock) -> SetPoints:
        """The share of each sample in which the muscle is excited; nothing after the step."""
        starts = self._stimuli(clock)
        count = len(clock.times)
        edges = np.append(clock.times, clock.times[-1] + clock.duration / count)
        values = np.zeros(count)
        if starts.size:
            ends = np.minimum(starts + self.width, np.append(starts[1:], np.inf))
            corners = np.column_stack([starts, ends]).ravel()
            excited = np.concatenate([[0.0], np.cumsum(np.diff(corners) * (np.arange(len(corners) - 1) % 2 == 0))])
            values = np.clip(np.diff(np.interp(edges, corners, excited)) / np.diff(edges), 0.0, 1.0)
        return SetPoints(_fixed(values), Reach(float(values.min()), float(values.max())), Reach(0.0, 0.0))

    def _stimuli(self, clock: StepClock) -> np.ndarray:
        """Times of the stimuli from the beginning of the step [s], rising."""
        trains = self._trains(clock)
        if self.rate is None:
            return np.array([begin for begin, _ in trains])
        count = sum(math.ceil(max(end - begin, 0.0) * self.rate) for begin, end in trains)
        if count > MOST_STIMULI:
            raise InputError(
                "rate", f"{self.rate:g} Hz", f"must give at most {MOST_STIMULI} stimuli in a step, got {count}"
            )
        each = []
        for begin, end in trains:  # a train of exactly n intervals has n stimuli, however the numbers are rounded
            stimuli = math.ceil(max(end - begin, 0.0) * self.rate - 1e-9)
            each.append(begin + np.arange(stimuli) / self.rate)
        times = np.concatenate([*each, np.zeros(0)])
        return times[(times >= -JUMP) & (times < clock.duration - JUMP)]

    def _trains(self, clock: StepClock) -> list[tuple[float, float]]:
        if self.duty is None or self.phase is None:
            return [(self.start, clock.duration if self.lasts is None else self.start + self.lasts)]
        motion = clock.step.motor
        assert isinstance(motion, Follow) and isinstance(motion.waveform, Sine)  # `check` has seen to it
        sine = motion.waveform
        turned = math.pi if sine.amplitude < 0.0 else 0.0
        first = ((self.phase - sine.phase - turned) / (2.0 * math.pi)) % 1.0
        period = 1.0 / sine.frequency
        cycles = math.ceil(clock.duration * sine.frequency) + 1
        if cycles > MOST_CYCLES:
            raise InputError("cycles", None, f"must be at most {MOST_CYCLES} with stimulation by phase, got {cycles}")
        return [((first + k) * period, (first + k + self.duty) * period) for k in range(-1, cycles)]

    def sentence(self, channel: str) -> str:
        """Describe it as ``stimulation at 150 Hz, 5 ms each, from 60 deg on for 0.3 of each cycle``."""
        said = "one stimulus" if self.rate is None else f"at {self.rate:g} Hz"
        said += f" of {time_words(self.width)}" if self.rate is None else f", {time_words(self.width)} each"
        if self.duty is not None and self.phase is not None:
            return f"{channel} {said}, from {math.degrees(self.phase):.6g} deg on for {self.duty:g} of each cycle"
        said += f", after {time_words(self.start)}" if self.start else ""
        return f"{channel} {said}" + (f", for {time_words(self.lasts)}" if self.lasts is not None else "")


@dataclass(frozen=True)
class Isolate(Command):
    """Shut the muscle off from valve and vent: its gas stays."""

    digest_name: ClassVar[str] = "Shut"

    @classmethod
    def accepts(cls, raw: object, channel: str) -> bool:
        """Whether a pressure is stated as ``shut``."""
        return channel == "pressure" and raw == "shut"

    @classmethod
    def read(cls, raw: object, place: Place, channel: str) -> Isolate:
        """Make it; its word has no parts."""
        return cls()

    def needs(self, channel: str) -> frozenset[str]:
        """A shut-off valve."""
        return frozenset(("shut-off",))

    def set_points(self, before: Reach, clock: StepClock) -> SetPoints:
        """No set-points; the pressure may leak towards that of the atmosphere."""
        leaked = Reach(min(0.0, before.low), max(0.0, before.high))
        return SetPoints(None, leaked, leaked)

    def sentence(self, channel: str) -> str:
        """Describe the command, such as ``pressure shut off``."""
        return f"{channel} shut off"


COMMANDS: Registry[type[Command]] = Registry(
    "mckibben.steps",
    "step",
    {
        "isolate": Isolate,
        "ramp": RampTo,
        "direction_dependent": DirectionDependent,
        "stimuli": StimulusTrain,
        "follow": Follow,
    },
)


def read_command(raw: object, place: Place, channel: str) -> Command:
    """Read the command of a channel from its entry.

    Args:
        raw: the words.
        place: place of them.
        channel: ``pressure``, ``stimulation``, ``span``, ``velocity`` or ``tension``.

    Raises:
        InputError: names the dotted path, the value and what it must be.
    """
    kind = next((k for k in COMMANDS.own() if k.accepts(raw, channel)), None)
    if kind is None:
        kind = next((k for k in COMMANDS.values() if k.accepts(raw, channel)), Follow)
    return kind.read(raw, place, channel)


def kept(before: Reach, clock: StepClock) -> SetPoints:
    """The set-points of a channel without a command: it stays where it is."""
    if not before.known:
        return SetPoints(Deferred(), before, before)
    return SetPoints(_fixed(np.full(clock.times.shape, before.low)), before, before)


def known_set_points(values: np.ndarray, end: float, clock: StepClock) -> SetPoints:
    """Set-points that are known in advance.

    Args:
        values: values of every sample [SI], (samples,).
        end: set-point at the end of the step, which the next one begins with [SI].
        clock: clock of the step; where a test may end it early, the channel is anywhere on its way afterwards.
    """
    reach = Reach(float(values.min()), float(values.max()))
    if clock.step.until is not None and not reach.known:
        return SetPoints(_fixed(values), reach, Reach(min(reach.low, end), max(reach.high, end)))
    return SetPoints(_fixed(values), reach, Reach(end, end))


def _fixed(values: np.ndarray) -> np.ndarray:
    values.setflags(write=False)
    return values


def _shortening(motion: Waveform) -> tuple[float, float, float]:
    """Time at which shortening first begins within a cycle [s], its share of the cycle, and the period [s]."""
    if isinstance(motion, Triangle):
        period = 1.0 / motion.frequency
        return motion.rising * period, 1.0 - motion.rising, period
    if isinstance(motion, Sine):
        period = 1.0 / motion.frequency
        turn = (0.25 - motion.phase / (2.0 * math.pi) + (0.5 if motion.amplitude < 0.0 else 0.0)) % 1.0
        turn = 0.0 if turn > 1.0 - 1e-9 else turn
        return turn * period, 0.5, period
    raise InputError("span.kind", motion.kind, "pressure by direction needs a sine or a triangle")


# ---- steps: commands, durations, and their reading from tables

GROUP_KEYS = ("label", "steps", "repeat")
_NAME = re.compile(r"\$([a-z][a-z0-9_]*)")
MOST_STEPS = 200_000
# Parts that a protocol can need; and "NAME sensor".
PARTS = ("valve", "stimulator", "motor", "shut-off", "accumulators", "plate", "person")


@dataclass(frozen=True, kw_only=True)
class ProtocolStep:
    """A step. A channel without a command keeps its last set-point; `mode` states what the motor controls.

    A McKibben muscle is driven by `pressure`, a biological one by `stimulation`. The step ends after `duration` [s] or
    `cycles` of its waveform, or earlier by `until`; with neither it lasts as long as its lines. `otherwise` says what
    follows when a test did not come true within the time: ``stop`` or ``go on``. `ask` is what a person has to do before it
    begins. Only recorded steps are kept.
    """

    digest_name: ClassVar[str] = "Step"  # under which the hash of a protocol knows it; never changes
    label: str = ""
    ask: str = ""
    pressure: Command | None = None
    stimulation: Command | None = None
    mode: str | None = None
    motor: Command | None = None
    duration: float | None = schema.number("s", OPEN, "longest time", key="for", default=None)
    cycles: float | None = schema.number("1", (1e-6, 1e6), "cycles of the waveform", default=None)
    until: Until | None = schema.entry(
        lambda raw, place: read_until(raw, field=place.field, where=place.where), default=None
    )
    otherwise: str = schema.word(among=("stop", "go on"), default="stop")
    record: bool = True

    def commands(self) -> Iterator[tuple[str, Command]]:
        """Iterate over the commands with their channels."""
        if self.pressure is not None:
            yield "pressure", self.pressure
        if self.stimulation is not None:
            yield "stimulation", self.stimulation
        if self.motor is not None and self.mode is not None:
            yield self.mode, self.motor

    def needs(self) -> set[str]:
        """Required sensors and parts of the rig, by the names of `PARTS`, or ``pressure sensor`` and the like."""
        needs = {need for channel, command in self.commands() for need in command.needs(channel)}
        if self.mode == "tension":
            needs.add("tension sensor")
        if self.ask:
            needs.add("person")
        if self.until is not None:
            needs.add(f"{'span' if self.until.channel == 'velocity' else self.until.channel} sensor")
        return needs

    def frequency(self) -> float | None:
        """Frequency of the periodic waveform, the motor's first [1/s]."""
        for command in (self.motor, self.pressure, self.stimulation):
            if isinstance(command, Follow):
                rate = getattr(command.waveform, "frequency", None)
                if rate is not None:
                    return float(rate)
        return None

    def stated_duration(self) -> float | None:
        """Longest time that it may take [s]; None if its lines decide."""
        rate = self.frequency()
        return self.duration if self.cycles is None or rate is None else self.cycles / rate

    def sentence(self) -> str:
        """Describe the step, with all its numbers."""
        said = [f"ask to {self.ask}"] if self.ask else []
        said += [command.sentence(channel) for channel, command in self.commands()]
        if self.until is not None:
            said.append(f"until {self.until.sentence()}")
        time = time_words(self.duration) if self.duration is not None else ""
        if self.cycles is not None:
            time = f"{self.cycles:g} cycle{'' if self.cycles == 1 else 's'}"
        if time:
            said.append(f"at most {time}, then {self.otherwise}" if self.until is not None else f"for {time}")
        if not self.record:
            said.append("not recorded")
        text = ", ".join(said)
        return f"{self.label}: {text}" if self.label else text


def bind(
    parts: tuple[FrozenTable, ...], case: Mapping[str, JsonValue], path: str, where: str | None = None
) -> list[tuple[str, ProtocolStep]]:
    """Steps with the values of a case, groups and repeats unrolled, each with its dotted path.

    Raises:
        InputError: names what is unknown, missing, out of bounds or in the wrong unit.
    """
    done: list[tuple[str, ProtocolStep]] = []
    for i, part in enumerate(parts, 1):
        place = f"{path}.{i}"
        entry = FileTable(substituted(part, case, place, where), place, where or "")
        times = repeats(entry)
        if "steps" in part:
            entry.only(GROUP_KEYS, "a group of steps has")
            inner = part["steps"]
            if not isinstance(inner, tuple) or not inner:
                raise entry.fail("steps", thawed(inner), "must be a list of one or more")
            for i_inner, one in enumerate(inner, 1):
                FileTable.of(one, f"{place}.steps.{i_inner}", where or "")
            group = bind(inner, case, f"{place}.steps", where)
        else:
            group = [(place, read_step(entry))]
        if len(done) + len(group) * times > MOST_STEPS:
            raise entry.fail("repeat", times, f"must be at most {MOST_STEPS} steps in all")
        done += group * times
    return done


def repeats(entry: FileTable) -> int:
    """Number of repeats of a step or group; once by default."""
    return entry.whole("repeat", 0, 100_000, 1)


def substituted(value: object, case: Mapping[str, JsonValue], path: str, where: str | None) -> JsonValue:
    """Replace ``$names`` by their values; a list of steps is left for later."""
    if isinstance(value, Mapping):
        return {k: v if k == "steps" else substituted(v, case, f"{path}.{k}", where) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [substituted(v, case, f"{path}.{i}", where) for i, v in enumerate(value, 1)]
    if not isinstance(value, str) or "$" not in value:
        return value
    for name in _NAME.findall(value):
        if name not in case:
            raise InputError(path, f"${name}", known=[f"${n}" for n in case], where=where)
    match = _NAME.fullmatch(value)
    return case[match[1]] if match else _NAME.sub(lambda m: str(case[m[1]]), value)


def names_in(value: object) -> set[str]:
    """Names of all parameters that a value refers to."""
    if isinstance(value, Mapping):
        return set().union(*(names_in(v) for v in value.values())) if value else set()
    if isinstance(value, tuple | list):
        return set().union(*(names_in(v) for v in value)) if value else set()
    return set(_NAME.findall(value)) if isinstance(value, str) else set()


def read_step(entry: FileTable) -> ProtocolStep:
    """Read one step from its table, with all names replaced.

    Raises:
        InputError: names what is unknown, missing, out of bounds or in the wrong unit.
    """
    keys = ("label", "ask", *DRIVES, *MODES, "for", "cycles", "until", "otherwise", "record", "repeat")
    entry.only(keys, "a step has")
    modes = [m for m in MODES if m in entry]
    if len(modes) > 1:
        raise entry.fail(modes[1], None, f"cannot be stated beside {modes[0]}: the motor controls one of them")
    if "pressure" in entry and "stimulation" in entry:
        raise entry.fail("stimulation", None, "cannot be stated beside pressure: a muscle takes one of the two")
    commands: dict[str, Any] = {"mode": modes[0] if modes else None, **dict.fromkeys((*DRIVES, "motor"))}
    for channel in [c for c in (*DRIVES, *modes) if c in entry]:
        place = Place(entry.field(channel), entry.where or None)
        commands[channel if channel in DRIVES else "motor"] = read_command(entry.values[channel], place, channel)
    step = read_table(ProtocolStep, entry.without(*DRIVES, *modes, "repeat"), owner="a step has", **commands)
    if step.cycles is not None and step.frequency() is None:
        raise entry.fail("cycles", step.cycles, "a step with cycles follows a waveform with a frequency")
    if step.cycles is not None and step.duration is not None:
        raise entry.fail("for", None, "cannot be stated beside cycles: a step states one of the two")
    if step.stated_duration() is None:
        if step.until is not None:
            raise entry.fail("for", None, "is missing: a step with until says how long it may take at most")
        if not any(isinstance(c, RampTo) for _, c in step.commands()) and not step.ask:
            raise entry.fail(
                "for", None, "is missing: a step says how long it takes: for, cycles, or a line to somewhere"
            )
    for _, command in step.commands():
        try:
            command.check(step)
        except InputError as error:
            raise entry.located(error) from None
    return step
