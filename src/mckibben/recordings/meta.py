"""What is known about a recording, as JSON: plain, frozen, and with NaN and infinities that standard JSON has not."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NoReturn

from ..documents import parse_json
from ..errors import InputError

# {"$float": "nan"} stands for a number that JSON has no word for; keys that begin with $ are kept for this.
_MARK = "$float"


class Frozen(dict):
    """A dict that cannot be changed in place; JSON, equality, copies and pickles work as for any dict."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a recording cannot be changed in place; with_meta and with_channels make another")

    __setitem__ = __delitem__ = __ior__ = update = pop = popitem = clear = setdefault = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


def frozen(meta: Any) -> Frozen:
    """A deep copy of a mapping in JSON's own types; arrays become lists, their scalars plain numbers.

    Raises:
        InputError: names the dotted path of what JSON cannot hold.
    """
    if not isinstance(meta, Mapping):
        raise InputError("meta", type(meta).__name__, "allowed is a mapping of names to values")
    return _plain(meta, "meta")


def _plain(value: Any, path: str) -> Any:
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
                raise InputError(f"key of {path}", repr(key), "allowed is a text that does not begin with $")
        return Frozen({_text(key, path): _plain(one, f"{path}.{key}") for key, one in value.items()})
    if isinstance(value, list | tuple):
        return [_plain(one, f"{path}.{i}") for i, one in enumerate(value)]
    if hasattr(value, "tolist") and hasattr(value, "dtype"):
        return _plain(value.tolist(), path)
    raise InputError(path, type(value).__name__, "allowed are numbers, texts, true, false, none, lists and mappings")


def _text(value: str, path: str) -> str:
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(path, ascii(value), "allowed is text that UTF-8 can hold") from None
    return str.__str__(value)


def to_json(meta: Mapping[str, Any], *, ascii_only: bool = False) -> str:
    """One line of standard JSON."""
    return json.dumps(_marked(meta), ensure_ascii=ascii_only, allow_nan=False)


def from_json(text: str) -> Any:
    """What `to_json` wrote."""
    return parse_json(text, object_hook=lambda found: float(found[_MARK]) if _MARK in found else found)


def _marked(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return {_MARK: repr(value)}
    if isinstance(value, dict):
        return {key: _marked(one) for key, one in value.items()}
    return [_marked(one) for one in value] if isinstance(value, list) else value
