"""The meta of a recording as JSON: plain, frozen, and with the NaN and infinities that standard JSON lacks."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NoReturn

from ..documents import JsonValue, parse_json
from ..errors import InputError

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
    plain = {key: meta[key] for key in ("title", "created") if _is_line(meta.get(key))}
    return {**plain, "schema": SCHEMA, "meta": to_json(meta)}


def _is_line(text: object) -> bool:
    return isinstance(text, str) and bool(text) and text.isprintable()


def _marked(value: Any) -> JsonValue:
    if isinstance(value, float) and not math.isfinite(value):
        return {_MARK: repr(value)}
    if isinstance(value, dict):
        return {key: _marked(item) for key, item in value.items()}
    return [_marked(item) for item in value] if isinstance(value, list) else value
