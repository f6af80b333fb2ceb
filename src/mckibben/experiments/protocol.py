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
from ..schema import FrozenTable, Place, read_table, write_table
from .amounts import read_amount
from .plan import ProtocolPlan, expand
from .sentence import protocol_sentence
from .steps import PARTS, ProtocolStep, bind
from .waveforms.random import uniform

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


def _read_inferred(raw: object, place: Place) -> tuple[JsonValue, ...]:
    return () if raw is False else read_values(raw, place)


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
    inferred: tuple[Any, ...] = schema.entry(_read_inferred, write=_all, default=())
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


def _read_rate(raw: object, place: Place) -> float:
    return read_amount(raw, "1/s", field=place.field, where=place.where, bounds=RATES).value


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
    sample_rate: float = schema.entry(_read_rate, write=lambda rate, place: f"{rate!r} Hz", default=1000.0)
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
        cases = [self._with_choices(case) for _ in range(self.repeat) for case in listed]
        if self.order == "random":
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
        """The flat plan on the sample clock; see `plan.expand`."""
        return expand(self, rest_length=rest_length, start_span=start_span)

    def varied(self) -> tuple[str, ...]:
        """Names of the parameters and choices with more than one value: what distinguishes the cases."""
        return tuple(name for name, values in self.variables().items() if len(values) > 1)

    def _with_choices(self, case: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
        full = dict(case)
        for choice in self.choices:
            full |= choice.sets(case[choice.name])
        return full


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
