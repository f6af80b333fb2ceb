"""A protocol: what to do, as an immutable value that prints itself, saves itself, and has one hash for one experiment."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from .. import schema
from ..answers import brief
from ..documents import JsonValue
from ..errors import InputError
from ..schema import FileTable, FrozenTable, Place, read_table, write_table
from .amounts import Until, read_amount
from .commands import (
    ANYWHERE,
    PARTS,
    Command,
    Deferred,
    ProtocolStep,
    Reach,
    SetPoints,
    StepClock,
    bind,
    kept,
    read_step,
    repeats,
    substituted,
)
from .waveforms.shapes import uniform
from .waveforms.waveform import words

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")

SCHEMA = 1
ORDERS = ("as listed", "random")
MOST_CASES = 10_000
RATES = (1.0, 1e6)  # of samples [1/s]
SENSORS = ("pressure sensor", "span sensor", "tension sensor")  # that are suggested; others may be named too
_NAME = r"[a-z][a-z0-9_]*"


def check_values(p: ProtocolParameter, values: tuple[JsonValue, ...], place: Place) -> None:
    """Refuse values that a parameter cannot have, by the place where they are stated."""
    for value in values:
        if p.unit == "word":
            if not isinstance(value, str) or not value.strip() or "$" in value:
                raise place.fail(value, "must be a word")
            continue
        amount = read_amount(value, p.unit, field=place.field, where=place.where)
        ends = [read_amount(b, p.unit, field=place.field, where=place.where) for b in p.bounds]
        if ends and ends[0].unit == ends[1].unit == amount.unit:
            if not ends[0].value <= amount.value <= ends[1].value:
                raise place.fail(value, f"must be between {p.low} and {p.high}")


def check_options(choice: ProtocolChoice, values: tuple[JsonValue, ...], place: Place) -> None:
    """Refuse values that are no options of a choice, by the place where they are stated."""
    options = [name for name, _ in choice.options]
    for value in values:
        if not isinstance(value, str):
            raise place.fail(value, "must be a word")
        if value not in options:
            raise place.fail(value, known=options)


def read_values(raw: object, place: Place) -> tuple[JsonValue, ...]:
    """Read one value or several."""
    values = tuple(raw) if isinstance(raw, list | tuple) else (raw,)
    if not values:
        raise place.fail(None, "must be a value or a list of one or more")
    return values


def _few(values: tuple[JsonValue, ...], place: Place | None = None) -> Any:
    return values[0] if len(values) == 1 else list(values)


def _all(values: tuple[JsonValue, ...], place: Place) -> list[Any]:
    return list(values)


@dataclass(frozen=True, kw_only=True)
class ProtocolParameter:
    """A named number or text of a protocol; with several values the steps are run for each of them.

    Values are the words of the file, `low` and `high` bound them; `inferred` are those that no source prints, all if it is
    true, and `note` says why they were chosen.
    """

    name: str
    unit: str
    values: tuple[Any, ...] = schema.entry(read_values, key="value", write=_few, default=())
    about: str = ""
    low: str = schema.entry(lambda raw, place: str(raw), default="")
    high: str = schema.entry(lambda raw, place: str(raw), default="")
    inferred: tuple[Any, ...] = schema.entry(
        lambda raw, place: () if raw is False else read_values(raw, place), write=_all, default=()
    )
    note: str = ""

    __repr__ = brief

    def __post_init__(self) -> None:
        if bool(self.low) != bool(self.high):
            raise InputError("low", None, "and high must both be stated")
        if self.inferred == (True,):
            object.__setattr__(self, "inferred", self.values)
        if self.unit != "word":
            for key, bound in (("low", self.low), ("high", self.high)) if self.low else ():
                read_amount(bound, self.unit, field=key)
            if not self.low:
                read_amount("1" if self.unit == "1" else f"1 {self.unit}", self.unit, field="unit")
        check_values(self, self.values, Place("value"))
        check_values(self, self.inferred, Place("inferred"))

    @property
    def bounds(self) -> tuple[str, ...]:
        """Lowest and highest value in words; empty where none are stated."""
        return (self.low, self.high) if self.low else ()


def _read_options(raw: object, place: Place) -> tuple[tuple[str, tuple[tuple[str, Any], ...]], ...]:
    options = []
    for option, sets in place.table(raw).values.items():
        at = place.below(option)
        for key, value in at.table(sets).values.items():
            if isinstance(value, bool) or not isinstance(value, str | int | float):
                raise at.below(key).fail(value, "must be a word or a number")
        options.append((option, tuple(sets.items())))
    if not options:
        raise place.fail(None, "must be a table of one or more")
    return tuple(options)


@dataclass(frozen=True, kw_only=True)
class ProtocolChoice:
    """A named option that sets parameters, such as ``range = "small"``; several are run one after the other."""

    name: str
    values: tuple[str, ...] = schema.entry(read_values, "option that is run", key="value", write=_few)
    about: str = ""
    inferred: tuple[str, ...] = schema.entry(read_values, write=_all, default=())
    note: str = ""
    options: tuple[tuple[str, tuple[tuple[str, Any], ...]], ...] = schema.entry(
        _read_options,
        "table of what each option sets",
        write=lambda options, place: {option: dict(sets) for option, sets in options},
    )

    __repr__ = brief

    def __post_init__(self) -> None:
        check_options(self, self.inferred, Place("inferred"))
        check_options(self, self.values, Place("value"))

    def sets(self, option: str) -> dict[str, JsonValue]:
        """The parameters that an option sets."""
        return dict(dict(self.options)[option])


def _read_named(kind: type[T]) -> Callable[[Any, Place], tuple[T, ...]]:
    def read(raw: object, place: Place) -> tuple[T, ...]:
        table = place.table(raw)
        for name in table.values:
            if not re.fullmatch(_NAME, name):
                raise table.fail(name, name, "must be made of small letters, digits and _")
        owner = f"a {kind.__name__.removeprefix('Protocol').lower()} has"
        return tuple(read_table(kind, table.table(name), owner=owner, name=name) for name in table.values)

    return read


def _write_named(values: tuple[JsonValue, ...], place: Place) -> dict[str, JsonValue]:
    return {value.name: write_table(value, skip=("name",)) for value in values}


def _read_steps(raw: object, place: Place) -> tuple[FrozenTable, ...]:
    if not isinstance(raw, list | tuple):
        raise place.fail(raw, f"must be a list of steps, [[{place.field}]]")
    return tuple(FrozenTable(place.below(i).table(one).values) for i, one in enumerate(raw, 1))


def _write_steps(steps: tuple[FrozenTable, ...], place: Place) -> list[dict[str, JsonValue]]:
    return [step.plain() for step in steps]


def _read_needs(raw: object, place: Place) -> tuple[str, ...]:
    if not isinstance(raw, list | tuple) or not all(isinstance(need, str) for need in raw):
        raise place.fail(raw, "must be a list of words")
    for need in raw:
        if need not in PARTS and not re.fullmatch(rf"{_NAME} sensor", need):
            raise place.fail(need, known=(*PARTS, *SENSORS))
    return tuple(raw)


CONTROLLED = ("pressure", "position", "force")  # what a controller of a machine holds


def _read_control(raw: object, place: Place) -> FrozenTable:
    """Read the tables of controllers; what is in them the rig's reader checks, which knows the controllers."""
    table = place.table(raw)
    table.only(CONTROLLED, "control has")
    for name in table.values:
        table.table(name)
    return FrozenTable(table.values)


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """An experiment on a muscle: `first` once, then `steps` for every case and repeat, then `last`.

    A case is one value of every parameter and choice. `needs` are sensors and parts that a rig must have beside those that
    the steps ask for. `sample_rate` [1/s]. `control` are gains, or controllers of the user's own, that stand in place of the
    rig's, as tables like those of a rig's file.
    """

    name: str
    title: str = ""
    source: str = ""
    note: str = ""
    order: str = schema.word(among=ORDERS, default="as listed")
    seed: int = schema.whole(0, 2**32 - 1, default=0)
    repeat: int = schema.whole(1, MOST_CASES, default=1)
    needs: tuple[str, ...] = schema.entry(_read_needs, write=_all, default=())
    sample_rate: float = schema.entry(
        lambda raw, place: read_amount(raw, "1/s", field=place.field, where=place.where, bounds=RATES).value,
        write=lambda rate, place: f"{rate!r} Hz",
        default=1000.0,
    )
    control: FrozenTable = schema.entry(
        _read_control, write=lambda table, place: table.plain(), default=FrozenTable({})
    )
    choices: tuple[ProtocolChoice, ...] = schema.entry(_read_named(ProtocolChoice), write=_write_named, default=())
    parameters: tuple[ProtocolParameter, ...] = schema.entry(
        _read_named(ProtocolParameter), write=_write_named, default=()
    )
    first: tuple[FrozenTable, ...] = schema.entry(_read_steps, write=_write_steps, default=())
    steps: tuple[FrozenTable, ...] = schema.entry(_read_steps, write=_write_steps, default=())
    last: tuple[FrozenTable, ...] = schema.entry(_read_steps, write=_write_steps, default=())

    def __post_init__(self) -> None:
        if not self.title:
            object.__setattr__(self, "title", self.name)
        if not self.steps:
            raise InputError("steps", None, "must be a list of steps, [[steps]]")
        reserved = {"schema", "protocol", *(f.name for f in fields(self))}
        parameters = [p.name for p in self.parameters]
        for section, names in (("parameters", parameters), ("choices", [c.name for c in self.choices])):
            for name in names:
                field = f"{section}.{name}"
                if name in reserved:
                    raise InputError(field, name, "that name says something else in a protocol; choose another one")
                if section == "choices" and name in parameters:
                    raise InputError(field, name, "a parameter has that name; choose another one")

    def __repr__(self) -> str:
        count = len(self.cases())
        return f"Protocol({self.name!r}: {self.title}; {count} {'case' if count == 1 else 'cases'})"

    def variables(self) -> dict[str, tuple[JsonValue, ...]]:
        """The values of every choice and parameter by name; those that choices set are empty."""
        return {c.name: c.values for c in self.choices} | {p.name: p.values for p in self.parameters}

    def cases(self) -> list[dict[str, JsonValue]]:
        """Cases in the order in which they are run: the value of each name."""
        varied = {name: values for name, values in self.variables().items() if values}
        listed = [dict(zip(varied, values, strict=True)) for values in itertools.product(*varied.values())]
        for case in listed:
            for choice in self.choices:
                case |= choice.sets(case[choice.name])
        cases = [dict(case) for _ in range(self.repeat) for case in listed]
        if self.order == "random":
            # by numbers that are the same on every machine, for the order is part of the hash
            chance = uniform(self.seed, np.arange(len(cases)))
            cases = [cases[i] for i in np.argsort(chance, kind="stable")]
        return cases

    def blocks(self) -> Iterator[tuple[dict[str, JsonValue], list[tuple[str, ProtocolStep]]]]:
        """The case and the steps of each, with their dotted paths: `first`, every case, `last`."""
        cases = self.cases()
        if self.first:
            yield {}, bind(self.first, cases[0], "first")
        for case in cases:
            yield case, bind(self.steps, case, "steps")
        if self.last:
            yield {}, bind(self.last, cases[-1], "last")

    def required(self) -> tuple[str, ...]:
        """Sensors and parts that a rig must have, sorted: those stated and those that steps use."""
        needs = set(self.needs)
        for _, steps in self.blocks():
            for _, step in steps:
                needs |= step.needs()
        return tuple(sorted(needs))

    @property
    def digest(self) -> str:
        """SHA-256 of what is done, however it is written: equal for ``5 bar`` and ``500 kPa``, on every machine."""
        body = [[_plain(s) for _, s in steps] for _, steps in self.blocks()]
        meaning = {"schema": SCHEMA, "rate": _plain(self.sample_rate), "needs": sorted(self.needs), "blocks": body}
        if self.control:  # the hash of a protocol that leaves the control to the rig stays as it was
            meaning["control"] = self.control.plain()
        return hashlib.sha256(json.dumps(meaning, sort_keys=True, separators=(",", ":")).encode()).hexdigest()

    def sentence(self) -> str:
        """Describe the whole protocol, with all its numbers."""
        return protocol_sentence(self)

    def document(self) -> dict[str, JsonValue]:
        """Return the protocol as tables of text, which `read.build_protocol` takes and recordings contain."""
        return {"schema": SCHEMA} | write_table(self, always=("sample_rate",))

    def toml(self) -> str:
        """Return the protocol as the text of a file."""
        import tomlkit

        return tomlkit.dumps(self.document())

    def expand(self, *, rest_length: float, start_span: float | None = None) -> ProtocolPlan:
        """The flat plan on the sample clock; see `experiments.protocol.expand`."""
        return expand(self, rest_length=rest_length, start_span=start_span)

    def varied(self) -> tuple[str, ...]:
        """Names of the parameters and choices with more than one value: what distinguishes the cases."""
        return tuple(name for name, values in self.variables().items() if len(values) > 1)


def _plain(value: Any) -> Any:
    """A value as JSON has it; numbers with 12 digits, so that the way through a unit leaves no trace."""
    if is_dataclass(value) and not isinstance(value, type):
        kind = getattr(value, "kind", "")
        # what only some have, such as lengths in two units, leaves the hash of the others as it was
        named = {f.name: getattr(value, f.name) for f in fields(value) if f.compare}
        named = {k: v for k, v in named.items() if not (k in ("mixed", "stimulation") and v is None)}
        return [
            getattr(value, "digest_name", type(value).__name__),
            str(kind),
            {k: _plain(v) for k, v in named.items()},
        ]
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    return f"{float(value) + 0.0:.12g}"


# ---- the plan on the sample clock: all steps in their order, with set-points where no measurement decides them

LONGEST = 20_000_000  # samples


@dataclass(frozen=True, eq=False)
class PlannedStep:
    """A step of the plan.

    `index` counts from 1, `path` is its place in the protocol; `start` and `count` are samples, the latest and the most
    where a test may end a step early. `pressure` [Pa] and `motor` [unit of `mode`] are set-points of shape (count,), or
    `Deferred`; the pressure is None while the muscle is shut off. `stimulation` [1] is the excitation of
    a biological muscle. The `*_before` are where channels are when it begins,
    `span` where the span goes in it; `pulled` is the tension [N] that the motor held when it begins, if that decided
    the span.
    """

    index: int
    path: str
    case: Mapping[str, Any]
    step: ProtocolStep
    start: int
    count: int
    mode: str
    pressure: np.ndarray | Deferred | None
    motor: np.ndarray | Deferred
    pressure_before: Reach
    motor_before: Reach
    pressure_reach: Reach
    span: Reach
    pulled: Reach | None = None
    stimulation: np.ndarray | Deferred | None = None

    __repr__ = brief

    @property
    def until(self) -> Until | None:
        """Condition that ends the step early."""
        return self.step.until

    @property
    def record(self) -> bool:
        """Whether the step is recorded."""
        return self.step.record

    def entry(self, start: float, end: float) -> dict[str, Any]:
        """The step as a recording lists it, from a time to another [s]."""
        case = {k: v if isinstance(v, str) else str(v) for k, v in self.case.items()}
        place = {"index": self.index, "path": self.path, "label": self.step.label, "case": case}
        times = {"start": start, "end": end, "ended_by": "time"}
        return {**place, **times, "recorded": self.record, "sentence": self.step.sentence()}

    def sentence(self) -> str:
        """Describe the step, with its place and case."""
        used = f" ({case_words(self.case)})" if self.case else ""
        return f"{self.path}{used}: {self.step.sentence()}"


@dataclass(frozen=True, eq=False)
class ProtocolPlan:
    """Steps on the sample clock; `sample_rate` [1/s], `rest_length` of the muscle [m]."""

    protocol: Protocol
    rest_length: float
    steps: tuple[PlannedStep, ...]

    __repr__ = brief

    @property
    def sample_rate(self) -> float:
        """Samples per second."""
        return self.protocol.sample_rate

    @property
    def samples(self) -> int:
        """Number of samples, at most."""
        return sum(s.count for s in self.steps)

    @property
    def duration(self) -> float:
        """Longest time that it may take [s]."""
        return self.samples / self.sample_rate

    @property
    def may_end_early(self) -> bool:
        """Whether a test may end a step, and so the whole, before that time."""
        return any(step.until is not None for step in self.steps)


def expand(protocol: Protocol, *, rest_length: float, start_span: float | None = None) -> ProtocolPlan:
    """The flat plan.

    Args:
        protocol: the protocol.
        rest_length: rest length of the muscle [m], which ``L0`` stands for.
        start_span: where the motor is at the beginning [m]; the rest length by default. The pressure begins at zero.

    Raises:
        InputError: if a line at a speed begins where nobody knows in advance, or it has too many samples.
    """
    if not rest_length > 0.0:
        raise InputError("rest_length", words(rest_length, "m"), "must be a length above zero")
    begin = rest_length if start_span is None else start_span
    state = _State(rest_length, 1.0 / protocol.sample_rate, Reach(0.0, 0.0), Reach(begin, begin))
    planned: list[PlannedStep] = []
    start = 0
    for case, steps in protocol.blocks():
        for path, step in steps:
            one = state.plan(step, len(planned) + 1, path, case, start)
            planned.append(one)
            start += one.count
    return ProtocolPlan(protocol, rest_length, tuple(planned))


class _State:
    def __init__(self, rest_length: float, dt: float, pressure: Reach, span: Reach) -> None:
        self.rest, self.dt = rest_length, dt
        self.pressure, self.span = pressure, span
        self.stimulation = Reach(0.0, 0.0)
        self.mode, self.motor = "span", span
        self.pulled: Reach | None = None

    def plan(self, step: ProtocolStep, index: int, path: str, case: Mapping[str, JsonValue], start: int) -> PlannedStep:
        mode = step.mode or self.mode
        if mode != self.mode:
            # nobody knows the force or speed at which control begins; the span is known if it was driven so far
            self.motor = self.span if mode == "span" else ANYWHERE
        before_p, before_m = self.pressure, self.motor
        duration = self._duration(step, mode, path)
        count = max(1, round(duration / self.dt))
        if start + count > LONGEST:
            allowed = f"must be at most {LONGEST} in all; take a lower sample rate, shorter steps or fewer cases"
            raise InputError("samples", start + count, allowed)
        clock = StepClock(self.dt * np.arange(count), duration, self.rest, step)
        pressure, motor = _driven(step.pressure, before_p, clock), _driven(step.motor, before_m, clock)
        stimulation = _driven(step.stimulation, self.stimulation, clock)
        self.stimulation = stimulation.after
        assert motor.values is not None
        span, after_span = self._span(mode, motor, step)
        pulled = before_m if self.mode == mode == "tension" else self.pulled
        self.pressure, self.motor, self.mode, self.span = pressure.after, motor.after, mode, after_span
        self.pulled = motor.after if mode == "tension" else None if after_span.known else pulled
        place, before, values = (index, path, case, step, start, count, mode), (before_p, before_m), pressure.values
        return PlannedStep(
            *place, values, motor.values, *before, pressure.reach, span, pulled=pulled, stimulation=stimulation.values
        )

    def _duration(self, step: ProtocolStep, mode: str, path: str) -> float:
        lines = [0.0]
        for channel, command in step.commands():
            drives = {"pressure": self.pressure, "stimulation": self.stimulation}
            seconds = command.duration(drives.get(channel, self.motor), self.rest)
            if seconds is not None and np.isnan(seconds):
                demand = "its start is not known in advance; state a time, in, instead of a speed"
                raise InputError(f"{path}.{channel}.at", command.sentence(channel), demand)
            lines.append(seconds or 0.0)
        stated = step.stated_duration()
        return max(lines) if stated is None else stated

    def _span(self, mode: str, motor: SetPoints, step: ProtocolStep) -> tuple[Reach, Reach]:
        """Range of the span during and after a step."""
        if mode == "span":
            return motor.reach, motor.after
        if mode == "tension" or not isinstance(motor.values, np.ndarray):
            return ANYWHERE, ANYWHERE
        path = np.append(0.0, np.cumsum(motor.values) * self.dt)
        hull = Reach(self.span.low + float(path.min()), self.span.high + float(path.max()))
        if step.until is not None:
            return hull, hull
        return hull, Reach(self.span.low + float(path[-1]), self.span.high + float(path[-1]))


def _driven(command: Command | None, before: Reach, clock: StepClock) -> SetPoints:
    return kept(before, clock) if command is None else command.set_points(before, clock)


# ---- the sentence: cases, steps with all numbers, and values that no source states

_UNITS = r"bar/s|bar|L0/s|L0|cm/s|cm|m/s\^2|m/s|mm|m|N/s|N|Hz|us|ms|s|deg|cycles|cycle"
_NUMBER = r"[-+]?(?<![\w.])\d[\d.]*(?:e[-+]?\d+)?"
_TOKENS = re.compile(rf"{_NUMBER}(?: (?:{_UNITS})(?![\w/]))?|\w+|\s+|.")


def protocol_sentence(protocol: Protocol) -> str:
    """Title; what is varied; first, the steps, last; sampling and needs; what is inferred."""
    cases = protocol.cases()
    varied = _varied(cases)
    said = [f"{protocol.title}."]
    if protocol.first:
        said.append(f"First {_parts(protocol.first, cases[0], 'first')}.")
    each = [f"each {_named(name)} of {_listed(protocol, name)}" for name in protocol.varied()]
    times = f"{protocol.repeat} times" if protocol.repeat > 1 else ""
    order = f"in random order (seed {protocol.seed})" if protocol.order == "random" else ""
    how = " ".join(w for w in (f"For {' and '.join(each)}" if each else "", times, order) if w)
    body = _marked(protocol.steps, _told(protocol, cases[0]), varied)
    said.append(f"{how[:1].upper()}{how[1:]}: {body}." if how else f"{body[:1].upper()}{body[1:]}.")
    if protocol.last:
        said.append(f"Last {_parts(protocol.last, cases[-1], 'last')}.")
    for name, table in protocol.control.items():  # controllers that take the place of the rig's
        gains = ", ".join(f"{_named(key)} {value}" for key, value in table.items() if key != "controller")
        by = f" by {table['controller']}" if "controller" in table else ""
        said.append(f"The {name} is controlled{by}{f' with {gains}' if gains else ''}.")
    rate = protocol.sample_rate
    shown = f"{rate / 1e3:.6g} kHz" if rate >= 1e3 else f"{rate:.6g} Hz"
    said.append(f"Sampled at {shown}; needs {', '.join(protocol.required())}.")
    inferred = _inferred(protocol, cases)
    if inferred:
        said.append(f"Inferred, not printed: {'; '.join(inferred)}.")
    return " ".join(said)


def clauses(protocol: Protocol) -> list[tuple[str, str]]:
    """Describe every step or group, with its dotted path such as ``steps.2``, in the order in which they are run."""
    cases = protocol.cases()
    varied, sentences = _varied(cases), []
    for section, case in (("first", cases[0]), ("steps", _told(protocol, cases[0])), ("last", cases[-1])):
        for i, part in enumerate(getattr(protocol, section), 1):
            text = _marked((part,), case, varied)
            if text:
                sentences.append((f"{section}.{i}", text))
    return sentences


def case_words(case: Mapping[str, JsonValue]) -> str:
    """Describe a case, such as ``pressure 5 bar, frequency 1 Hz``."""
    return ", ".join(f"{_named(k)} {v}" for k, v in case.items())


def is_inferred(p: ProtocolParameter, value: object) -> bool:
    """Whether a value of a parameter is one that no source prints."""
    if p.unit == "word":
        return value in p.inferred
    amount = read_amount(value, p.unit, field=p.name)
    return any(amount == read_amount(v, p.unit, field=p.name) for v in p.inferred)


def _named(name: str) -> str:
    return name.replace("_", " ")


def _varied(cases: list[dict[str, JsonValue]]) -> dict[str, list[Any]]:
    """Names with more than one value in all the cases, with these values."""
    names: dict[str, list[Any]] = {}
    for case in cases:
        for name, value in case.items():
            known = names.setdefault(name, [])
            if value not in known:
                known.append(value)
    return {name: values for name, values in names.items() if len(values) > 1}


def _listed(protocol: Protocol, name: str) -> str:
    """The values of a name: ``0, 1, 5 bar``, with a flag at inferred ones; options of a choice with what they set."""
    for choice in protocol.choices:
        if choice.name == name:
            return ", ".join(_option(choice.sets(o), o) for o in choice.values)
    (p,) = (p for p in protocol.parameters if p.name == name)
    words = [str(v).split(None, 1) for v in p.values]
    flags = [" (inferred)" if is_inferred(p, v) else "" for v in p.values]
    if p.unit == "word":
        return ", ".join(f"{v}{f}" for v, f in zip(p.values, flags, strict=True))
    same = len({w[1] if len(w) > 1 else "" for w in words}) == 1 and len(words[0]) > 1
    shown = [f"{w[0] if same else ' '.join(w)}{f}" for w, f in zip(words, flags, strict=True)]
    return ", ".join(shown) + (f" {words[0][1]}" if same else "")


def _option(sets: Mapping[str, JsonValue], option: str) -> str:
    return f"{option} ({case_words(sets)})" if sets else option


def _told(protocol: Protocol, case: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
    """Case with phrases such as ``this lubricant`` for parameters that are text, for use in sentences."""
    words = {p.name: f"this {_named(p.name)}" for p in protocol.parameters if p.unit == "word" and len(p.values) > 1}
    phrases = {**case, **words}
    try:
        _parts(protocol.steps, phrases, "steps")
    except InputError:  # it is a word that means something, such as a kind of waveform
        return dict(case)
    return phrases


def _parts(parts: tuple[FrozenTable, ...], case: Mapping[str, JsonValue], path: str) -> str:
    said = []
    for i, part in enumerate(parts, 1):
        place = f"{path}.{i}"
        entry = FileTable(substituted(part, case, place, None), place, "")
        times = repeats(entry)
        if times == 0:
            continue
        if "steps" in part:
            label = f"{part['label']}: " if "label" in part else ""
            text = f"{label}[{_parts(part['steps'], case, f'{place}.steps')}]"
        else:
            text = read_step(entry).sentence()
        said.append(f"{text} (done {times} times)" if times > 1 else text)
    return "; ".join(said)


def _marked(parts: tuple[FrozenTable, ...], case: Mapping[str, JsonValue], varied: Mapping[str, list[Any]]) -> str:
    """The steps of one case; a number that changes with a name is called after it: ``at this frequency``."""
    base = _TOKENS.findall(_parts(parts, case, "steps"))
    marked = list(base)
    for name, values in varied.items():
        for value in () if str(case[name]).startswith("this ") else values:
            other = _TOKENS.findall(_parts(parts, {**case, name: value}, "steps"))
            if len(other) != len(base):
                continue
            for i, (a, b) in enumerate(zip(base, other, strict=True)):
                if a != b:
                    marked[i] = f"this {_named(name)}"
    return "".join(marked)


def _inferred(protocol: Protocol, cases: list[dict[str, JsonValue]]) -> list[str]:
    said = []
    for c in protocol.choices:
        options = [o for o in c.values if o in c.inferred]
        if options:
            said.append(f"{_named(c.name)} {', '.join(_option(c.sets(o), o) for o in options)}")
    for p in protocol.parameters:
        if len(p.values) > 1:
            continue  # flagged where they are listed
        values = dict.fromkeys(case[p.name] for case in cases if is_inferred(p, case[p.name]))
        if values:
            said.append(f"{_named(p.name)} {', '.join(str(v) for v in values)}")
    return said
