"""A protocol from a TOML file (schema 1): one of the shipped ones with its values, or one of its own; all errors by path.

    protocol = "quasi-static"          # a whole file: what is not said is as the library has it
    pressure = ["1 bar", "3 bar"]      # several values: the steps are done for each
    frequency = "0.25 Hz"
    order = "random"

or

    schema = 1
    name = "hold"
    [parameters.load]                  # `about`, `low`, `high`, `inferred`, `note` if wanted
    unit = "N"
    value = ["10 N", "20 N"]
    [[steps]]                          # [[first]] and [[last]] are done once
    pressure = { to = "3 bar", in = "1 s" }
    tension = "$load"                  # or span, velocity: what the motor controls
    until = "span settled within 0.1 mm for 0.2 s"
    for = "5 s"                        # at most
"""

from __future__ import annotations

import dataclasses
import functools
import os
import re
from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np

from ..documents import parse_toml, read_text
from ..errors import InputError
from ..quantities import split_values
from ..schema import FileTable, FrozenTable, shown
from .amounts import read_amount
from .protocol import ORDERS, SCHEMA, Protocol, ProtocolChoice, ProtocolParameter
from .steps import PARTS, names_in

TEXTS = ("title", "note", "order")  # settings in which a comma is a comma
SETTINGS = ("title", "note", "sample_rate", "order", "seed", "repeat")
SECTIONS = ("schema", "name", "source", "needs", "parameters", "choices", "first", "steps", "last", *SETTINGS)
MOST_CASES = 10_000
RATES = (1.0, 1e6)


def read_protocol(path: str | os.PathLike[str]) -> Protocol:
    """Read a protocol.

    Args:
        path: a TOML file.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    where = os.fspath(path)
    return parse_protocol(read_text(path, field="protocol"), where=where)


def parse_protocol(text: str, *, where: str) -> Protocol:
    """The protocol of a file's text; raises as `read_protocol` does."""
    return build_protocol(parse_toml(text, where=where, field="protocol"), where=where)


def build_protocol(document: Mapping[str, Any], *, where: str) -> Protocol:
    """Read a protocol from tables of text; raises as `read_protocol` does."""
    top = FileTable(document, "", where)
    if "schema" in document or "protocol" not in document:
        top.schema(SCHEMA)
    if "protocol" in document:
        base = shipped(top.word("protocol"), where=where)
        tables = {k: v for k, v in document.items() if k not in ("protocol", "schema")}
        return with_values(base, tables, where=where)
    top.only(SECTIONS, "a protocol has")
    name = top.word("name")
    protocol = Protocol(
        name=name,
        title=top.word("title", name),
        steps=_parts(top, "steps", needed=True),
        first=_parts(top, "first"),
        last=_parts(top, "last"),
        parameters=tuple(_parameter(n, e) for n, e in _named(top, "parameters")),
        choices=tuple(_choice(n, e) for n, e in _named(top, "choices")),
        needs=_needs(top),
        source=top.text("source"),
        note=top.text("note"),
    )
    return checked(_set(protocol, {k: document[k] for k in SETTINGS if k in document}, top), where)


def with_values(protocol: Protocol, given: Mapping[str, Any], *, where: str | None = None) -> Protocol:
    """Return a protocol with other values of its parameters, choices and settings.

    Args:
        protocol: the protocol to change.
        given: words by name, a list for several values.
        where: file, for error messages.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.
    """
    top = FileTable(given, "", where or "")
    names = protocol.variables()
    top.only([*names, *SETTINGS], f"{protocol.name} has")
    parameters = tuple(
        dataclasses.replace(p, values=_values(p, given[p.name], top.field(p.name), where)) if p.name in given else p
        for p in protocol.parameters
    )
    choices = []
    for c in protocol.choices:
        values = _options(FileTable(given, "", where or ""), c.name, dict(c.options)) if c.name in given else c.values
        kept = tuple((o, tuple((k, v) for k, v in sets if k not in given)) for o, sets in c.options)
        choices.append(dataclasses.replace(c, values=values, options=kept))
    changed = dataclasses.replace(protocol, parameters=parameters, choices=tuple(choices))
    return checked(_set(changed, {k: given[k] for k in SETTINGS if k in given}, top), where)


def values_of(name: str, words: str, *, field: str, where: str | None = None) -> str | list[str]:
    """Values of a parameter, choice or setting from text: a list if there are several.

    Raises:
        InputError: a comma stands between two digits.
    """
    if name in TEXTS:
        return words.strip()
    values = split_values(words, field=field, where=where)
    return values if len(values) > 1 else words.strip()


def checked(protocol: Protocol, where: str | None) -> Protocol:
    """The protocol, if every one of its cases can be read; raises `InputError` by path."""
    count = protocol.repeat
    for values in protocol.variables().values():
        count *= len(values) or 1
    if count > MOST_CASES:
        raise InputError("cases", count, f"must be at most {MOST_CASES}", where=where)
    _check_choices(protocol, where)
    used = names_in((protocol.first, protocol.steps, protocol.last))
    set_by = {k for c in protocol.choices for _, sets in c.options for k, _ in sets}
    for p in protocol.parameters:
        if p.name not in used:
            raise InputError(f"parameters.{p.name}", None, f"is unused: no step refers to ${p.name}", where=where)
        if not p.values and p.name not in set_by:
            raise InputError(f"parameters.{p.name}.value", None, "is missing", where=where)
    try:
        done = [s for _, steps in protocol.blocks() for s in steps]
    except InputError as error:
        raise error.changed(where=where) from None
    if not done:
        raise InputError("steps", None, "are all repeated 0 times", where=where)
    cases = protocol.cases()
    for part, key in ((protocol.first, "first"), (protocol.last, "last")):
        for name in sorted(n for n in names_in(part) if len({case[n] for case in cases}) > 1):
            raise InputError(
                key, None, f"must be a parameter with one value, got ${name}: it is done once", where=where
            )
    return protocol


def _check_choices(protocol: Protocol, where: str | None) -> None:
    """Check that choices set parameters, to values that these allow."""
    parameters = {p.name: p for p in protocol.parameters}
    for c in protocol.choices:
        for option, sets in c.options:
            for key, value in sets:
                field = f"choices.{c.name}.options.{option}.{key}"
                if key not in parameters:
                    raise InputError(field, None, "parameters are", known=parameters, where=where)
                _values(parameters[key], value, field, where)


def _set(protocol: Protocol, given: Mapping[str, Any], top: FileTable) -> Protocol:
    changes: dict[str, Any] = {}
    for key in ("title", "note"):
        if key in given:
            changes[key] = top.word(key)
    if "order" in given:
        changes["order"] = top.word("order", among=ORDERS)
    if "seed" in given:
        changes["seed"] = top.whole("seed", 0, 2**32 - 1)
    if "repeat" in given:
        changes["repeat"] = top.whole("repeat", 1, MOST_CASES)
    if "sample_rate" in given:
        field, where = top.field("sample_rate"), top.where or None
        changes["sample_rate"] = read_amount(given["sample_rate"], "1/s", field=field, where=where, bounds=RATES).value
    return dataclasses.replace(protocol, **changes)


def _parts(top: FileTable, key: str, *, needed: bool = False) -> tuple[FrozenTable, ...]:
    raw = top.values.get(key, [])
    if not isinstance(raw, list | tuple) or (needed and not raw):
        raise top.fail(key, raw or None, f"must be a list of steps, [[{key}]]")
    return tuple(FrozenTable(FileTable.of(one, f"{key}.{i}", top.where).values) for i, one in enumerate(raw, 1))


def _named(top: FileTable, section: str) -> list[tuple[str, FileTable]]:
    table = top.table(section)
    for name in table.values:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise table.fail(name, name, "must be made of small letters, digits and _")
        if name in (*SECTIONS, "protocol"):
            raise table.fail(name, name, "that name says something else in a protocol; choose another one")
        if section == "choices" and name in top.table("parameters").values:
            raise table.fail(name, name, "a parameter has that name; choose another one")
    return [(name, table.table(name)) for name in table.values]


def _parameter(name: str, entry: FileTable) -> ProtocolParameter:
    entry.only(("unit", "value", "about", "low", "high", "inferred", "note"), "a parameter has")
    bounds = tuple(str(entry.values[k]) for k in ("low", "high")) if {"low", "high"} <= set(entry.values) else ()
    if not bounds and {"low", "high"} & set(entry.values):
        raise entry.fail("low", None, "and high must both be stated")
    unit = entry.word("unit")
    bare = ProtocolParameter(name, unit, (), entry.text("about"), bounds, (), entry.text("note"))
    if unit != "word":
        for key in ("low", "high"):
            if bounds:
                read_amount(entry.values[key], unit, field=entry.field(key), where=entry.where or None)
        if not bounds:
            read_amount(f"1 {unit}" if unit != "1" else "1", unit, field=entry.field("unit"), where=entry.where or None)
    place, where = entry.field("value"), entry.where or None
    values = _values(bare, entry.values["value"], place, where) if "value" in entry.values else ()
    inferred = entry.values.get("inferred", False)
    if isinstance(inferred, bool):
        flagged = values if inferred else ()
    else:
        flagged = _values(bare, inferred, entry.field("inferred"), where)
    return dataclasses.replace(bare, values=values, inferred=flagged)


def _values(p: ProtocolParameter, raw: Any, field: str, where: str | None) -> tuple[Any, ...]:
    values = tuple(raw) if isinstance(raw, list | tuple) else (raw,)
    if not values:
        raise InputError(field, None, "must be a value or a list of one or more", where=where)
    for value in values:
        if p.unit == "word":
            if not isinstance(value, str) or not value.strip() or "$" in value:
                raise InputError(field, shown(value), "must be a word", where=where)
            continue
        amount = read_amount(value, p.unit, field=field, where=where)
        low, high = (read_amount(b, p.unit, field=field, where=where) for b in p.bounds) if p.bounds else (None, None)
        if low is None or high is None or low.unit != amount.unit:
            continue
        if not low.value <= amount.value <= high.value:
            raise InputError(field, value, f"must be between {p.bounds[0]} and {p.bounds[1]}", where=where)
    return values


def _choice(name: str, entry: FileTable) -> ProtocolChoice:
    entry.only(("value", "about", "options", "inferred", "note"), "a choice has")
    table = entry.table("options")
    options = []
    for option in table.values:
        sets = table.table(option).values
        for key, value in sets.items():
            if isinstance(value, bool) or not isinstance(value, str | int | float):
                raise table.fail(f"{option}.{key}", value, "must be a word or a number")
        options.append((option, tuple(sets.items())))
    if not options:
        raise entry.fail("options", None, "must be a table of one or more")
    inferred = _options(entry, "inferred", dict(options)) if "inferred" in entry.values else ()
    values = _options(entry, "value", dict(options))
    return ProtocolChoice(name, values, tuple(options), entry.text("about"), inferred, entry.text("note"))


def _options(entry: FileTable, key: str, options: Mapping[str, Any]) -> tuple[str, ...]:
    raw = entry.values.get(key)
    values = raw if isinstance(raw, list) and raw else [raw]
    return tuple(
        FileTable({key: v} if v is not None else {}, entry.path, entry.where).word(key, among=options) for v in values
    )


def _needs(top: FileTable) -> tuple[str, ...]:
    needs = top.texts("needs")
    for need in needs:
        if not re.fullmatch(r"[a-z][a-z0-9_]* sensor", need):
            top.derived({"needs": need}).word(
                "needs", among=(*PARTS, "pressure sensor", "span sensor", "tension sensor")
            )
    return needs


def protocol_names() -> list[str]:
    """Names of all shipped protocols, sorted."""
    folder = resources.files(__package__) / "protocols"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def shipped(name: str, *, where: str | None = None) -> Protocol:
    """Load a shipped protocol unchanged.

    Raises:
        InputError: if there is none of that name.
    """
    if name not in protocol_names():
        known = protocol_names()
        raise InputError("protocol", name, known=known, where=where)
    return _shipped(name)


def protocol(name: str, **values: Any) -> Protocol:
    """Load a shipped protocol with values of its parameters, such as ``protocol("quasi-static", pressure="5 bar")``.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.
    """
    base = shipped(name)
    return with_values(base, in_words(base, values))


def in_words(protocol: Protocol, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of parameters as the words of a file: a number [SI] gets the unit of its parameter.

    The name ``pressure`` stands for the only parameter that is a pressure, where none has that name.
    """
    units = {p.name: p.unit for p in protocol.parameters if p.unit not in ("1", "word")}
    pressures = [name for name, unit in units.items() if unit in ("Pa", "bar")]
    if "pressure" in values and len(pressures) == 1 and pressures[0] not in values:
        values = {pressures[0] if name == "pressure" else name: value for name, value in values.items()}

    def word(name: str, value: Any) -> Any:
        if name not in units or isinstance(value, bool | str):
            return value
        return f"{float(value)!r} {read_amount(f'1 {units[name]}', units[name], field=name).unit}"

    return {
        name: [word(name, v) for v in np.ravel(value)]
        if isinstance(value, list | tuple | np.ndarray)
        else word(name, value)
        for name, value in values.items()
    }


@functools.cache
def _shipped(name: str) -> Protocol:
    file = resources.files(__package__) / "protocols" / f"{name}.toml"
    return parse_protocol(file.read_text(encoding="utf-8"), where=f"{name}.toml")
