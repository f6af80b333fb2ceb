"""From the words of steps and the values of their parameters to steps with numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from ..errors import InputError
from .amounts import CHANNELS, Amount, has_both, in_metres, in_si, read_amount, relative_unit
from .steps import MODES, USUAL_REST_LENGTH, Follow, Go, Phased, Shut, Step
from .until import read_until
from .waveforms import near, read_waveform
from .words import Entry

STEP_KEYS = ("label", "ask", "pressure", *MODES, "for", "cycles", "until", "otherwise", "record", "repeat")
GROUP_KEYS = ("label", "steps", "repeat")
_NAME = re.compile(r"\$([a-z][a-z0-9_]*)")
_OPEN = (1e-9, 1e7)
MOST_STEPS = 200_000


class Part(Mapping[str, Any]):
    """The words of one step or group of steps, which nothing changes; ``$name`` stands for a parameter."""

    def __init__(self, words: Mapping[str, Any]) -> None:
        self._words = {str(k): _frozen(v) for k, v in words.items()}

    def __getitem__(self, key: str) -> Any:
        return self._words[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._words)

    def __len__(self) -> int:
        return len(self._words)

    def __hash__(self) -> int:
        return hash(frozenset((k, _hashed(v)) for k, v in self._words.items()))

    def __repr__(self) -> str:
        return f"Part({self.plain()!r})"

    def plain(self) -> dict[str, Any]:
        """The same as dicts and lists."""
        return {k: _thawed(v) for k, v in self._words.items()}


def bind(
    parts: tuple[Part, ...], case: Mapping[str, Any], path: str, where: str | None = None
) -> list[tuple[str, Step]]:
    """Steps with the values of a case, groups and repeats unrolled, each with its dotted path.

    Raises:
        InputError: names what is unknown, missing, out of bounds or in the wrong unit.
    """
    done: list[tuple[str, Step]] = []
    for i, part in enumerate(parts, 1):
        place = f"{path}.{i}"
        entry = Entry(substituted(part, case, place, where), place, where or "")
        times = repeats(entry)
        if "steps" in part:
            entry.only(GROUP_KEYS, "a group of steps has")
            inner = part["steps"]
            if not isinstance(inner, tuple) or not inner:
                raise entry.fail("steps", _thawed(inner), "allowed is a list of one or more")
            for i_inner, one in enumerate(inner, 1):
                Entry.of(one, f"{place}.steps.{i_inner}", where or "")
            group = bind(inner, case, f"{place}.steps", where)
        else:
            group = [(place, read_step(entry))]
        if len(done) + len(group) * times > MOST_STEPS:
            raise entry.fail("repeat", times, f"allowed are {MOST_STEPS} steps in all")
        done += group * times
    return done


def repeats(entry: Entry) -> int:
    """How often a step or a group is done; once where it is not said."""
    raw = entry.values.get("repeat", 1)
    return whole(entry, "repeat", raw, 0, 100_000)


def whole(entry: Entry, key: str, raw: Any, low: int, high: int) -> int:
    """A whole number between bounds."""
    try:
        number = int(raw) if isinstance(raw, str | int) and not isinstance(raw, bool) else None
    except ValueError:
        number = None
    if number is None or not low <= number <= high:
        raise entry.fail(key, raw, f"allowed is a whole number, {low} to {high}")
    return number


def substituted(value: Any, case: Mapping[str, Any], path: str, where: str | None) -> Any:
    """Words with the values of their ``$names``; a list of steps is left for later."""
    if isinstance(value, Mapping):
        return {k: v if k == "steps" else substituted(v, case, f"{path}.{k}", where) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [substituted(v, case, f"{path}.{i}", where) for i, v in enumerate(value, 1)]
    if not isinstance(value, str) or "$" not in value:
        return value
    for name in _NAME.findall(value):
        if name not in case:
            known = ", ".join(f"${n}" for n in case) or "none"
            raise InputError(path, f"${name}", f"{near(name, case)}known are {known}", where=where)
    match = _NAME.fullmatch(value)
    return case[match[1]] if match else _NAME.sub(lambda m: str(case[m[1]]), value)


def names_in(value: Any) -> set[str]:
    """All parameters that words refer to."""
    if isinstance(value, Mapping):
        return set().union(*(names_in(v) for v in value.values())) if value else set()
    if isinstance(value, tuple | list):
        return set().union(*(names_in(v) for v in value)) if value else set()
    return set(_NAME.findall(value)) if isinstance(value, str) else set()


def read_step(entry: Entry) -> Step:
    """One step from its words, all names replaced."""
    entry.only(STEP_KEYS, "a step has")
    modes = [m for m in MODES if m in entry.values]
    if len(modes) > 1:
        raise entry.fail(modes[1], f"beside {modes[0]}", "the motor controls one of span, velocity, tension")
    mode = modes[0] if modes else None
    motor = None if mode is None else _command(entry, mode)
    pressure = _command(entry, "pressure") if "pressure" in entry.values else None
    assert not isinstance(motor, Phased | Shut)  # the reader makes them of pressures only
    step = Step(
        label=entry.word("label", "-") if "label" in entry.values else "",
        ask=entry.word("ask", "-") if "ask" in entry.values else "",
        pressure=pressure,
        mode=mode,
        motor=motor,
        duration=_number(entry, "for", "s", _OPEN),
        cycles=_number(entry, "cycles", "1", (1e-6, 1e6)),
        until=read_until(entry.values["until"], field=entry.field("until"), where=entry.where)
        if "until" in entry.values
        else None,
        otherwise=entry.word("otherwise", "stop", among=("stop", "go on")),
        record=_flag(entry, "record"),
    )
    _check(entry, step)
    return step


def _check(entry: Entry, step: Step) -> None:
    lines = any(isinstance(c, Go) for c in (step.pressure, step.motor))
    if step.cycles is not None and step.frequency() is None:
        raise entry.fail("cycles", step.cycles, "a step with cycles follows a waveform with a frequency")
    if step.cycles is not None and step.duration is not None:
        raise entry.fail("for", "beside cycles", "allowed is one of the two")
    if step.stated_duration() is None:
        if step.until is not None:
            raise entry.fail("for", "missing", "a step with until says how long it may take at most")
        if not lines and not step.ask:
            raise entry.fail("for", "missing", "a step says how long it takes: for, cycles, or a line to somewhere")
    if isinstance(step.pressure, Phased):
        if not isinstance(step.motor, Follow) or step.mode != "span":
            raise entry.fail("pressure", "by direction", "it needs a span that follows a sine or triangle in this step")
        try:
            step.pressure.table(step.motor.waveform, step.stated_duration() or 0.0)
        except InputError as error:
            key = error.field if "." in error.field else f"pressure.{error.field}"
            raise InputError(entry.field(key), error.value, error.allowed, where=entry.where or None) from None


def _command(entry: Entry, channel: str) -> Any:
    raw, unit, place, where = entry.values[channel], CHANNELS[channel], entry.field(channel), entry.where or None
    if channel == "pressure" and raw == "shut":
        return Shut()
    if isinstance(raw, Mapping) and "to" in raw:
        return _go(Entry(raw, place, entry.where), unit)
    if channel == "pressure" and isinstance(raw, Mapping) and "shortening" in raw:
        return _phased(Entry(raw, place, entry.where))
    if has_both(raw, unit):
        usual = read_waveform(in_metres(raw, unit, USUAL_REST_LENGTH), unit, field=place, where=where)
        return Follow(usual, unit, _frozen(in_si(raw, unit)), place)
    freed, own = relative_unit(raw, unit)
    try:
        return Follow(read_waveform(freed, unit if own == unit else "1", field=place, where=where), own)
    except InputError as error:
        if own != unit and "pure number" in error.allowed:
            allowed = f"allowed is a value in {own} or {unit}, or another unit of that dimension"
            raise InputError(error.field, error.value, allowed, where=where) from None
        raise


def _go(entry: Entry, unit: str) -> Go:
    entry.only(("to", "in", "at"), "a line has")
    if ("in" in entry.values) == ("at" in entry.values):
        raise entry.fail(
            "in", "missing" if "in" not in entry.values else "beside at", "a line has a time in, or a speed at"
        )
    to = read_amount(entry.values["to"], unit, field=entry.field("to"), where=entry.where or None)
    if "in" in entry.values:
        return Go(to, seconds=_number(entry, "in", "s", _OPEN))
    speed = read_amount(
        entry.values["at"], f"{unit}/s", field=entry.field("at"), where=entry.where or None, bounds=(1e-12, 1e12)
    )
    return Go(to, speed=speed)


def _phased(entry: Entry) -> Phased:
    keys = {"shortening": ("Pa", (-1e9, 1e9)), "lengthening": ("Pa", (-1e9, 1e9)), "lead": ("s", (0.0, 1e3))}
    keys["ramp"] = ("s", (1e-4, 1e3))
    entry.only(keys, "pressure by direction has")
    values: dict[str, Amount] = {}
    for key, (unit, bounds) in keys.items():
        if key not in entry.values and key != "lead":
            raise entry.fail(key, "missing", f"pressure by direction has {', '.join(keys)}")
        raw = entry.values.get(key, "0 s")
        values[key] = read_amount(raw, unit, field=entry.field(key), where=entry.where or None, bounds=bounds)
    return Phased(**{k: v.value for k, v in values.items()})


def _number(entry: Entry, key: str, unit: str, bounds: tuple[float, float]) -> float | None:
    if key not in entry.values:
        return None
    raw = entry.values[key]
    return read_amount(raw, unit, field=entry.field(key), where=entry.where or None, bounds=bounds).value


def _flag(entry: Entry, key: str) -> bool:
    value = entry.values.get(key, True)
    if not isinstance(value, bool):
        raise entry.fail(key, value, "allowed are true, false")
    return value


def _frozen(value: Any) -> Any:
    if isinstance(value, Mapping):
        return Part(value)
    return tuple(_frozen(v) for v in value) if isinstance(value, list | tuple) else value


def _thawed(value: Any) -> Any:
    if isinstance(value, Part):
        return value.plain()
    return [_thawed(v) for v in value] if isinstance(value, tuple) else value


def _hashed(value: Any) -> Any:
    return tuple(_hashed(v) for v in value) if isinstance(value, tuple) else value
