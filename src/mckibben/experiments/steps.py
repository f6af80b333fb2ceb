"""Steps of a protocol: commands of valve and motor, durations, and their reading from tables."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from .. import schema
from ..documents import JsonValue
from ..errors import InputError
from ..schema import FileTable, FrozenTable, Place, read_table, thawed
from .commands import DRIVES, MODES, OPEN, Command, Follow, RampTo, read_command
from .until import Until, read_until
from .waveforms import time_words

GROUP_KEYS = ("label", "steps", "repeat")
_NAME = re.compile(r"\$([a-z][a-z0-9_]*)")
MOST_STEPS = 200_000
# Parts that a protocol can need; and "NAME sensor".
PARTS = ("valve", "stimulator", "motor", "shut-off", "accumulators", "plate", "person")


def _read_until(raw: object, place: Place) -> Until:
    return read_until(raw, field=place.field, where=place.where)


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
    until: Until | None = schema.entry(_read_until, default=None)
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
        time = self._time()
        if time:
            said.append(f"at most {time}, then {self.otherwise}" if self.until is not None else f"for {time}")
        if not self.record:
            said.append("not recorded")
        text = ", ".join(said)
        return f"{self.label}: {text}" if self.label else text

    def _time(self) -> str:
        if self.cycles is not None:
            return f"{self.cycles:g} cycle{'' if self.cycles == 1 else 's'}"
        return time_words(self.duration) if self.duration is not None else ""


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
    _check(entry, step)
    return step


def _check(entry: FileTable, step: ProtocolStep) -> None:
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
