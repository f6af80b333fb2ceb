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

A protocol file may take a waveform from another file, whose points are included in the protocol, so that what was recorded
with it holds all of it:

    pressure = { kind = "table", file = "walk.csv", time = "t [s]", column = "p [bar]" }

Files are those that `recordings.read_record` opens; a path is taken from the folder of the protocol.
"""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Callable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..documents import JsonValue, parse_toml, path_text, read_toml
from ..errors import InputError
from ..quantities import split_values
from ..recordings import files
from ..registry import with_own_references
from ..schema import FileTable, Place, read_stated, read_table
from .amounts import COMMANDED, read_amount
from .commands import names_in
from .protocol import MOST_CASES, SCHEMA, Protocol, check_options, check_values, read_values

TEXTS = ("title", "note", "order")  # settings in which a comma is a comma
STIMULATION = "protocols/stimulation"  # folder of the protocols of biological muscles
SETTINGS = ("title", "note", "sample_rate", "order", "seed", "repeat")
T = TypeVar("T")


def with_own_controllers(document: Mapping[str, JsonValue], where: str) -> dict[str, JsonValue]:
    """The tables of a file with its controllers, such as ``my.py:MyController``, found from the folder of the file."""
    own = {"control": with_own_references(document["control"], where, "control")} if "control" in document else {}
    return {**document, **own}


def parse_protocol(text: str, *, where: str) -> Protocol:
    """The protocol of a file's text; raises as `build_protocol` does."""
    return build_protocol(parse_toml(text, where=where, field="protocol"), where=where)


def read_protocol(path: str | os.PathLike[str]) -> Protocol:
    """Read a protocol and the waveforms that it names.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    where = os.fspath(path)
    document = with_own_controllers(read_toml(path, field="protocol"), where)
    for section in ("first", "steps", "last"):
        if isinstance(document.get(section), list):
            document[section] = _steps(document[section], section, where)
    return build_protocol(document, where=where)


def _steps(steps: list[Any], path: str, where: str) -> list[Any]:
    rows = []
    for number, step in enumerate(steps, 1):
        if isinstance(step, Mapping):
            place = f"{path}.{number}"
            step = {
                key: _steps(value, f"{place}.{key}", where)
                if key == "steps" and isinstance(value, list)
                else _taken_in(value, COMMANDED[key], f"{place}.{key}", where)
                if key in COMMANDED
                else value
                for key, value in step.items()
            }
        rows.append(step)
    return rows


def _taken_in(value: Any, unit: str, field: str, where: str) -> Any:
    """Include the points of the files that a waveform's tables name."""
    if isinstance(value, list):
        return [_taken_in(v, unit, field, where) for v in value]
    if not isinstance(value, Mapping):
        return value
    if value.get("kind") != "table" or "file" not in value:
        return {k: _taken_in(v, unit, f"{field}.{k}", where) for k, v in value.items()}
    known = ("kind", "file", "time", "column", "between")
    for key, raw in value.items():
        if key not in known:
            raise InputError(f"{field}.{key}", None, "a table from a file has", known=known, where=where)
        if not isinstance(raw, str):
            raise InputError(f"{field}.{key}", str(raw), "must be a word", where=where)
    file = Path(where).parent / value["file"]
    times, values = files.read_points(file, value.get("time"), value.get("column"), unit, field=field, where=where)
    inside = {"kind": "table", "between": value.get("between", "straight")}
    return inside | {
        "times": [f"{float(t) - float(times[0])!r} s" for t in times],
        "values": [f"{float(v)!r} {unit}" for v in values],
    }


def build_protocol(document: Mapping[str, JsonValue], *, where: str) -> Protocol:
    """Read a protocol from tables of text.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    top = FileTable(document, "", where)
    if "schema" in document or "protocol" not in document:
        top.schema(SCHEMA)
    if "protocol" in document:
        base = shipped(top.word("protocol"), where=where)
        if "control" in document:
            base = dataclasses.replace(base, **read_stated(Protocol, top, ("control",)))
        tables = {k: v for k, v in document.items() if k not in ("protocol", "schema", "control")}
        return with_values(base, tables, where=where)
    return checked(read_table(Protocol, top, owner="a protocol has", beside=("schema",)), where)


def with_values(protocol: Protocol, changes: Mapping[str, JsonValue], *, where: str | None = None) -> Protocol:
    """Return a protocol with other values of its parameters, choices and settings.

    Args:
        protocol: the protocol to change.
        changes: words by name, a list for several values.
        where: file, for error messages.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.
    """
    top = FileTable(changes, "", where or "")
    names = protocol.variables()
    top.only([*names, *SETTINGS], f"{protocol.name} has")
    parameters, choices = [], []
    for p in protocol.parameters:
        values = _read(changes[p.name], p.name, p, check_values, where) if p.name in changes else p.values
        parameters.append(dataclasses.replace(p, values=values))
    for c in protocol.choices:
        values = _read(changes[c.name], c.name, c, check_options, where) if c.name in changes else c.values
        kept = tuple((o, tuple((k, v) for k, v in sets if k not in changes)) for o, sets in c.options)
        choices.append(dataclasses.replace(c, values=values, options=kept))
    settings = read_stated(Protocol, top, SETTINGS)
    changed = dataclasses.replace(protocol, parameters=tuple(parameters), choices=tuple(choices), **settings)
    return checked(changed, where)


def _read(
    raw: object, name: str, owner: T, check: Callable[[T, tuple[Any, ...], Place], None], where: str | None
) -> tuple[JsonValue, ...]:
    place = Place(name, where)
    values = read_values(raw, place)
    check(owner, values, place)
    return values


def values_of(name: str, words: str, *, field: str) -> str | list[str]:
    """Values of a parameter, choice or setting from text: a list if there are several.

    Raises:
        InputError: a comma stands between two digits.
    """
    if name in TEXTS:
        return words.strip()
    values = split_values(words, field=field)
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
    parameters = {p.name: p for p in protocol.parameters}
    for c in protocol.choices:
        for option, sets in c.options:
            for key, value in sets:
                field = f"choices.{c.name}.options.{option}.{key}"
                if key not in parameters:
                    raise InputError(field, None, "parameters are", known=parameters, where=where)
                _read(value, field, parameters[key], check_values, where)


def protocol_names() -> list[str]:
    """Names of all shipped protocols of McKibben muscles on test machines, sorted."""
    return _names_in("protocols")


def stimulation_protocol_names() -> list[str]:
    """Names of the shipped protocols that stimulate biological muscles, sorted."""
    return _names_in(STIMULATION)


def _names_in(folder: str) -> list[str]:
    files = resources.files(__package__).joinpath(folder).iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))


def shipped(name: str, *, where: str | None = None) -> Protocol:
    """Load a shipped protocol unchanged.

    Raises:
        InputError: if there is none of that name.
    """
    known = [*protocol_names(), *stimulation_protocol_names()]
    if name not in known:
        raise InputError("protocol", name, known=known, where=where)
    return _shipped(name)


def protocol(name: str | os.PathLike[str], **values: object) -> Protocol:
    """Load a protocol with values of its parameters.

    Args:
        name: of a shipped one, or the path of a ``.toml`` file.
        **values: of its parameters: numbers [SI], text with a unit, or lists of them for one case after another.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.

    Examples:
        >>> import mckibben as mk
        >>> mk.protocol("quasi-static", pressure=["2 bar", "5 bar"], cycles=1)
        Protocol('quasi-static': Quasi-static triangle at constant pressure; 2 cases)
    """
    return named_protocol(name, values)


def named_protocol(name: Protocol | str | os.PathLike[str], values: Mapping[str, JsonValue]) -> Protocol:
    """A protocol, that of a file, or a shipped one by its name, with other values as `protocol` has them."""
    if isinstance(name, Protocol):
        base = name
    else:
        path = path_text(name, "protocol")
        is_file = path.lower().endswith(".toml") or os.sep in path
        base = read_protocol(path) if is_file else shipped(path)
    return with_values(base, in_words(base, values)) if values else base


def changed_protocol(name: Protocol | str | os.PathLike[str], changes: Mapping[str, float | str]) -> Protocol:
    """A protocol by its name with changes as one types them, where one text may hold several values.

    Args:
        name: a protocol, a shipped one by its name, or the path of a ``.toml`` file.
        changes: numbers [SI] or words by the name of a parameter, choice or setting.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit, as ``changes.NAME``.
    """
    base = named_protocol(name, {})
    if not changes:
        return base
    words = {n: values_of(n, one, field=f"changes.{n}") for n, one in changes.items() if isinstance(one, str)}
    numbers = in_words(base, {n: one for n, one in changes.items() if not isinstance(one, str)})
    try:
        return with_values(base, {**words, **numbers})
    except InputError as error:
        # a parameter is called as it was typed; the path of a step that it spoils is not
        raise error.changed(field=f"changes.{error.field}" if error.field in changes else error.field) from None


def in_words(protocol: Protocol, values: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
    """Values of parameters as the words of a file: a number [SI] gets the unit of its parameter.

    The name ``pressure`` stands for the only parameter that is a pressure, where none has that name.
    """
    units = {p.name: p.unit for p in protocol.parameters if p.unit not in ("1", "word")}
    pressures = [name for name, unit in units.items() if unit in ("Pa", "bar")]
    if "pressure" in values and len(pressures) == 1 and pressures[0] not in values:
        values = {pressures[0] if name == "pressure" else name: value for name, value in values.items()}
    known = [*["pressure"] * (len(pressures) == 1), *(n for n in protocol.variables() if n != "pressure"), *SETTINGS]
    for name in values:
        if name not in known:
            raise InputError("field", name, f"{protocol.name} has", known=known)

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


def shipped_text(name: str) -> str:
    """Text of the file of a shipped protocol."""
    folder = STIMULATION if name in stimulation_protocol_names() else "protocols"
    return resources.files(__package__).joinpath(folder, f"{name}.toml").read_text(encoding="utf-8")


@functools.cache
def _shipped(name: str) -> Protocol:
    return parse_protocol(shipped_text(name), where=f"{name}.toml")
