"""From a table of words, as TOML gives it, to a waveform; everything that is wrong is named by its dotted path."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Mapping
from typing import Any

from ...errors import InputError
from ...quantities import Quantity, parse
from .combined import Sequence, Sum, Table
from .smooth import Chirp, MultiSine, Noise, Ramp, Sine, Triangle
from .switched import Binary, Constant, Pulse, PulseWidth, Square, Steps
from .waveform import PARTS, VALUE, WHOLE, WORD, Waveform

KINDS: dict[str, type[Waveform]] = {
    k.kind: k
    for k in (
        Constant, Steps, Pulse, Square, PulseWidth, Binary, Ramp, Triangle, Sine, Chirp, MultiSine, Noise,
        Table, Sum, Sequence,
    )
}  # fmt: skip

# How the points of a file are had: (file, time column, value column, unit) -> times [s], values [unit].
ReadTable = Callable[[str, str | None, str | None, str], tuple[Any, Any]]


def read_waveform(
    entry: Any, unit: str, *, field: str, where: str | None = None, table: ReadTable | None = None
) -> Waveform:
    """A waveform from its table, or a constant from a value alone.

    Args:
        entry: such as ``{"kind": "ramp", "from": "0 bar", "to": "5 bar", "duration": "2 s"}`` or ``"3 bar"``.
        unit: SI unit of the signal.
        field: dotted path, used in complaints.
        where: file, used in complaints.
        table: reads the file that a table names.

    Raises:
        InputError: names what is unknown, missing, out of bounds or in the wrong unit.
    """
    if not isinstance(entry, Mapping):
        entry = {"kind": "constant", "value": entry}
    name = entry.get("kind", "missing")
    if not isinstance(name, str) or name not in KINDS:
        raise InputError(f"{field}.kind", _shown(name), f"{near(name, KINDS)}known are {', '.join(KINDS)}", where=where)
    context = _Context(unit, field, where, table)
    kind = KINDS[name]
    given = {str(key): value for key, value in entry.items() if key != "kind"}
    if kind is Table and "file" in given:
        return _build(kind, context, _points(given, context))
    if kind is Sequence:
        return _build(kind, context, _timed(given, context))
    keys = {f.metadata["key"] or f.name: f for f in dataclasses.fields(kind) if (kind, f.name) != (Table, "file")}
    for key in given:
        if key not in keys:
            raise InputError(f"{field}.{key}", "unknown", f"{near(key, keys)}{name} has {', '.join(keys)}", where=where)
    values = {}
    for key, f in keys.items():
        if key in given:
            values[f.name] = _value(given[key], f, context, key)
        elif f.default is dataclasses.MISSING:
            raise InputError(f"{field}.{key}", "missing", f"{name} has {', '.join(keys)}", where=where)
    return _build(kind, context, values)


def near(word: Any, known: Any) -> str:
    """``did you mean ...? `` for a word that is nearly a known one, else nothing."""
    close = difflib.get_close_matches(str(word), list(known), n=1)
    return f"did you mean {close[0]}? " if close else ""


@dataclasses.dataclass(frozen=True)
class _Context:
    unit: str
    field: str
    where: str | None
    table: ReadTable | None

    def under(self, key: str, unit: str | None = None) -> _Context:
        return dataclasses.replace(self, field=f"{self.field}.{key}", unit=unit or self.unit)

    def waveform(self, entry: Any) -> Waveform:
        return read_waveform(entry, self.unit, field=self.field, where=self.where, table=self.table)


def _build(kind: type[Waveform], context: _Context, values: dict[str, Any]) -> Waveform:
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{context.field}.{error.field}", error.value, error.allowed, where=context.where) from None


def _value(raw: Any, f: Any, context: _Context, key: str) -> Any:
    unit, place = f.metadata["unit"], context.under(key)
    if unit == PARTS:
        if key == "duty":
            return context.under(key, "1").waveform(raw)
        return tuple(context.under(f"{key}.{i}").waveform(p) for i, p in enumerate(_list(raw, place), 1))
    if unit == WORD:
        if not isinstance(raw, str):
            raise InputError(place.field, _shown(raw), "allowed is a word", where=place.where)
        return raw
    if unit == WHOLE and (isinstance(raw, bool) or not isinstance(raw, int)):
        try:
            raw = int(raw) if isinstance(raw, str) else int("")
        except ValueError:
            raise InputError(place.field, _shown(raw), "allowed is a whole number", where=place.where) from None
    if unit == WHOLE:
        low, high = (int(b) for b in f.metadata["bounds"])
        if not low <= raw <= high:
            raise InputError(place.field, raw, f"allowed is {low} to {high}", where=place.where)
        return raw
    if "tuple" in str(f.type):
        return tuple(_number(v, f, place) for v in _list(raw, place))
    return _number(raw, f, place)


def _number(raw: Any, f: Any, place: _Context) -> float:
    unit = place.unit if f.metadata["unit"] == VALUE else f.metadata["unit"]
    if isinstance(raw, bool) or not isinstance(raw, str | int | float):
        raise InputError(place.field, _shown(raw), "allowed is a number with its unit in words", where=place.where)
    value = parse(str(raw), unit, field=place.field, where=place.where)
    Quantity(unit, f.metadata["bounds"], "", "", f.metadata["bounds"]).check(place.field, value, where=place.where)
    return value


def _list(raw: Any, place: _Context) -> list[Any]:
    if not isinstance(raw, list | tuple) or not raw:
        raise InputError(place.field, _shown(raw), "allowed is a list of one or more", where=place.where)
    return list(raw)


def _timed(given: dict[str, Any], context: _Context) -> dict[str, Any]:
    """Parts of a sequence; each states its own duration beside its kind."""
    for key in given:
        if key != "parts":
            raise InputError(f"{context.field}.{key}", "unknown", "sequence has parts", where=context.where)
    parts, lasting = [], []
    (duration,) = [f for f in dataclasses.fields(Sequence) if f.name == "lasting"]
    for i, entry in enumerate(_list(given.get("parts"), context.under("parts")), 1):
        place = context.under(f"parts.{i}")
        if not isinstance(entry, Mapping) or "lasts" not in entry:
            raise InputError(
                f"{place.field}.lasts", "missing", "every part of a sequence says how long", where=place.where
            )
        parts.append(place.waveform({k: v for k, v in entry.items() if k != "lasts"}))
        lasting.append(_number(entry["lasts"], duration, place.under("lasts")))
    return {"parts": tuple(parts), "lasting": tuple(lasting)}


def _points(given: dict[str, Any], context: _Context) -> dict[str, Any]:
    """Points of a table that lies in a file; its time begins at 0 s."""
    known = ("file", "time", "column", "between")
    for key, raw in given.items():
        if key not in known:
            raise InputError(
                f"{context.field}.{key}", "unknown", f"a table from a file has {', '.join(known)}", where=context.where
            )
        if not isinstance(raw, str):
            raise InputError(f"{context.field}.{key}", _shown(raw), "allowed is a word", where=context.where)
    if context.table is None:
        raise InputError(f"{context.field}.file", given["file"], "no files can be read here", where=context.where)
    times, values = context.table(given["file"], given.get("time"), given.get("column"), context.unit)
    return {
        "times": tuple(float(t) - float(times[0]) for t in times),
        "values": tuple(float(v) for v in values),
        "between": given.get("between", "straight"),
        "file": given["file"],
    }


def _shown(raw: Any) -> Any:
    return raw if isinstance(raw, str | int | float) and not isinstance(raw, bool) else f"{type(raw).__name__} {raw}"
