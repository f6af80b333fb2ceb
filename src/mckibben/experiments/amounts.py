"""Numbers of a protocol: in SI, or in the rest length of the muscle that is not chosen yet."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..documents import JsonValue
from ..errors import InputError
from ..quantities import Quantity, has_dimension, parse
from ..schema import shown
from .waveforms.waveform import RELATIVE, words

# What a protocol drives: SI unit, and the unit relative to the muscle if there is one.
CHANNELS = {"pressure": "Pa", "span": "m", "velocity": "m/s", "tension": "N"}
COMMANDED = {**CHANNELS, "stimulation": "1"}  # with what only biological muscles take
_RELATIVE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(L0/s|L0)\s*")


@dataclass(frozen=True)
class Amount:
    """A value and its unit: SI, ``L0`` or ``L0/s``."""

    value: float
    unit: str

    def si(self, rest_length: float) -> float:
        """The value [SI] for a muscle of a rest length [m]."""
        return self.value * rest_length if self.unit in RELATIVE else self.value

    def sentence(self) -> str:
        """Format the amount for a person."""
        return words(self.value, self.unit)


def read_amount(
    raw: object, unit: str, *, field: str, where: str | None = None, bounds: tuple[float, float] | None = None
) -> Amount:
    """Read a number with its unit; lengths and velocities may be in rest lengths, such as ``0.75 L0``.

    Args:
        raw: the words.
        unit: SI unit that is wanted.
        field: dotted path, for error messages.
        where: file, for error messages.
        bounds: smallest and largest allowed value, inclusive [SI; or rest lengths, if it is stated so].

    Raises:
        InputError: names the field and what is allowed.
    """
    if isinstance(raw, bool) or not isinstance(raw, str | int | float):
        raise InputError(field, shown(raw), "must be a number with its unit in words", where=where)
    match = _RELATIVE.fullmatch(str(raw))
    if match and RELATIVE[match[2]] == unit:
        amount = Amount(float(match[1]), match[2])
    elif match:
        raise InputError(field, raw, f"must be a value in {unit} or a unit of the same dimension", where=where)
    else:
        amount = Amount(parse(str(raw), unit, field=field, where=where), unit)
    if not math.isfinite(amount.value):
        raise InputError(field, raw, "must be a finite number", where=where)
    low, high = bounds or (float("-inf"), float("inf"))
    if not low <= amount.value <= high:
        allowed = Quantity(unit, (low, high), "", "", (low, high)).allowed()
        raise InputError(field, raw, f"must be {allowed}", where=where)
    return amount


def relative_unit(entry: object, unit: str) -> tuple[JsonValue, str]:
    """Rewrite a waveform's table whose lengths are all in rest lengths, with its unit; else return both unchanged."""
    relative = [text for text in _texts(entry) if _is_relative(text, unit)]
    if not relative or has_both(entry, unit):
        return entry, unit
    own = {si: own for own, si in RELATIVE.items()}

    def write(text: str) -> str:
        match = _RELATIVE.fullmatch(text)
        return match[1] if match and RELATIVE[match[2]] == unit else text

    return _rewritten(entry, write), own[unit]


def has_both(entry: object, unit: str) -> bool:
    """Whether some values of a waveform's table are in rest lengths, and others have another unit of the same dimension."""
    texts = _texts(entry)
    relative = [text for text in texts if _is_relative(text, unit)]
    return bool(relative) and any(has_dimension(text, unit) for text in texts if text not in relative)


def in_metres(entry: object, unit: str, rest_length: float) -> JsonValue:
    """A waveform's table with every value in rest lengths as one in `unit`, for a rest length [m]."""

    def write(text: str) -> str:
        match = _RELATIVE.fullmatch(text)
        return f"{float(match[1]) * rest_length!r} {unit}" if match and RELATIVE[match[2]] == unit else text

    return _rewritten(entry, write)


def in_si(entry: object, unit: str) -> JsonValue:
    """A waveform's table with every value of the dimension of `unit` in it; those in rest lengths stay."""

    def write(text: str) -> str:
        has_unit = not _is_relative(text, unit) and has_dimension(text, unit)
        return f"{parse(text, unit, field=''):.12g} {unit}" if has_unit else text

    return _rewritten(entry, write)


def table_words(entry: JsonValue, unit: str) -> str:
    """Describe a waveform's table: ``sine, amplitude 1.2 cm, mean 0.9 L0``; numbers are in `unit` or named."""
    if isinstance(entry, Mapping):
        named = [f"{key.replace('_', ' ')} {table_words(value, unit)}" for key, value in entry.items() if key != "kind"]
        return ", ".join([str(entry["kind"]), *named] if "kind" in entry else named)
    if isinstance(entry, list | tuple):
        return f"({'; '.join(table_words(value, unit) for value in entry)})"
    has_unit = isinstance(entry, str) and not _is_relative(entry, unit) and has_dimension(entry, unit)
    return words(parse(entry, unit, field=""), unit) if has_unit else str(entry)


def _texts(entry: object) -> list[str]:
    if isinstance(entry, Mapping):
        return [text for value in entry.values() for text in _texts(value)]
    if isinstance(entry, list | tuple):
        return [text for value in entry for text in _texts(value)]
    return [entry] if isinstance(entry, str) else []


def _is_relative(text: str, unit: str) -> bool:
    match = _RELATIVE.fullmatch(text)
    return match is not None and RELATIVE[match[2]] == unit


def _rewritten(entry: object, write: Callable[[str], str]) -> JsonValue:
    """Rewrite all texts of a table."""
    if isinstance(entry, Mapping):
        return {key: _rewritten(value, write) for key, value in entry.items()}
    if isinstance(entry, list | tuple):
        return [_rewritten(value, write) for value in entry]
    return write(entry) if isinstance(entry, str) else entry
