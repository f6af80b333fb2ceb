"""Metadata of a recording: as plain, frozen JSON with NaN and infinities, and the cautions that follow from them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NoReturn, TypeGuard

from ..answers import Caution, collect
from ..documents import JsonValue, parse_json
from ..errors import InputError
from ..quantities import with_unit

# {"$float": "nan"} stands for a number that JSON has no word for; keys that begin with $ are kept for this.
_MARK = "$float"
SCHEMA = 1  # of recordings in files


class Frozen(dict[str, Any]):
    """A dict that cannot be changed in place; JSON, equality, copies and pickles work as for any dict."""

    def _refuse(self, *_: Any, **__: object) -> NoReturn:
        raise TypeError("a recording cannot be changed in place; with_meta and with_channels make another")

    __setitem__ = __delitem__ = __ior__ = update = pop = popitem = clear = setdefault = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


def freeze(meta: Mapping[str, JsonValue]) -> Frozen:
    """A deep copy of a mapping in JSON's own types; arrays become lists, their scalars plain numbers.

    Raises:
        InputError: names the dotted path of what JSON cannot hold.
    """
    if not isinstance(meta, Mapping):
        raise InputError("meta", type(meta).__name__, "must be a mapping of names to values")
    plain: Frozen = _plain(meta, "meta")
    return plain


def _plain(value: Any, path: str) -> JsonValue:
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return _text(value, path)
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value)
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str) or key.startswith("$"):
                raise InputError(f"key of {path}", repr(key), "must be a text that does not begin with $")
        return Frozen({_text(key, path): _plain(item, f"{path}.{key}") for key, item in value.items()})
    if isinstance(value, list | tuple):
        return [_plain(item, f"{path}.{i}") for i, item in enumerate(value)]
    if hasattr(value, "tolist") and hasattr(value, "dtype"):
        return _plain(value.tolist(), path)
    raise InputError(path, type(value).__name__, "must be numbers, texts, true, false, none, lists and mappings")


def _text(value: str, path: str) -> str:
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(path, ascii(value), "must be text that UTF-8 can hold") from None
    return str.__str__(value)


def to_json(meta: Mapping[str, JsonValue], *, ascii_only: bool = False) -> str:
    """Format the metadata as one line of standard JSON."""
    return json.dumps(_marked(meta), ensure_ascii=ascii_only, allow_nan=False)


def from_json(text: str) -> JsonValue:
    """Parse what `to_json` wrote."""
    return parse_json(text, object_hook=lambda table: float(table[_MARK]) if _MARK in table else table)


def file_attributes(meta: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
    """The global attributes of a netCDF file: the metadata as JSON, and title and date once more for other programs."""
    lines = {key: meta[key] for key in ("title", "created") if isinstance(meta.get(key), str)}
    plain = {key: text for key, text in lines.items() if text and text.isprintable()}
    return {**plain, "schema": SCHEMA, "meta": to_json(meta)}


def _marked(value: Any) -> JsonValue:
    if isinstance(value, float) and not math.isfinite(value):
        return {_MARK: repr(value)}
    if isinstance(value, dict):
        return {key: _marked(item) for key, item in value.items()}
    return [_marked(item) for item in value] if isinstance(value, list) else value


# Counts of a machine that mean something for the samples, in words after the number; others of a hardware of one's own are
# said by their name. What is dropped without loss, as a frame that came twice, is none of them.
COUNTS = {
    "lost": "did not arrive, or damaged: what was recorded in their place is no measurement",
    "overruns": "overruns: samples were lost there",
    "late": "came more than a period late",
    "answers_late": "were taken by the device before its new command had come",
    "answers_damaged": "had a command that arrived damaged",
    "skipped": "were skipped",
    "missed": "were missed",
    "retries": "needed another try",
}
TAKEN = ("samples", "reads")  # names of the count of all samples
MACHINE = ("hardware", "deadlines")  # parameters of the cautions that a machine has counted
HARMLESS = ("repeated", "bad_checksum", "undecodable", *TAKEN)  # what is lost by them is among the lost


def cautions_of(meta: Mapping[str, JsonValue]) -> tuple[Caution, ...]:
    """What metadata say against the samples of a recording: lost and late ones, saturation, warnings, rows left out."""
    sentences = [(text, "hardware") for text in _lines(_table(meta.get("hardware")))]
    timing = _table(meta.get("deadlines"))
    if behind := _count(timing, "behind"):
        sentences.append(
            (f"{behind:,} of {_count(timing, 'samples'):,} samples began more than a period late", "deadlines")
        )
    sentences += [
        (f"{name} {_saturated(_table(one))}", name) for name, one in _table(meta.get("saturation")).items() if one
    ]
    source = _table(meta.get("source")).get("left_out")
    sentences += (
        [(str(text).rstrip("."), "source") for text in source or ()] if isinstance(source, list | tuple) else []
    )
    warnings = meta.get("warnings")
    listed = warnings if isinstance(warnings, list | tuple) else ()
    sentences += [(str(_table(one).get("text", one)), "warnings") for one in listed]
    return collect(*(Caution(text, parameter) for text, parameter in sentences))


def _lines(hardware: Mapping[str, Any]) -> list[str]:
    taken = max((_count(hardware, name) for name in TAKEN), default=0)
    of = f" of {taken:,} samples" if taken else " samples"
    return [
        f"{number:,}{of} {COUNTS.get(name, name.replace('_', ' '))}"
        for name in hardware
        if name not in HARMLESS and (number := _count(hardware, name))
    ]


def _saturated(one: Mapping[str, Any]) -> str:
    if one.get("sentence"):
        return str(one["sentence"]).rstrip(".")
    words = ["was at an end of its range"]
    words += [f"{100.0 * one['share']:.3g} % of its samples"] if _number(one.get("share")) else []
    words += [f"first at {one['first']:.6g} s"] if _number(one.get("first")) else []
    words += [f"at most {with_unit(float(one['longest']), 's')} on end"] if _number(one.get("longest")) else []
    return ", ".join(words)


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _count(table: Mapping[str, Any], name: str) -> int:
    value = table.get(name)
    return int(value) if _number(value) and value == value else 0


def _number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
