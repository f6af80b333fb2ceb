"""Numbers of a protocol: in SI, or in the rest length of the muscle that is not chosen yet."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..quantities import Quantity, parse
from .waveforms.waveform import RELATIVE, words
from .words import shown

# What a protocol drives: SI unit, and the unit relative to the muscle if there is one.
CHANNELS = {"pressure": "Pa", "span": "m", "velocity": "m/s", "tension": "N"}
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
        """As a person reads it."""
        return words(self.value, self.unit)


def read_amount(
    raw: Any, unit: str, *, field: str, where: str | None = None, bounds: tuple[float, float] | None = None
) -> Amount:
    """A number with its unit in words; lengths and velocities may be in rest lengths, such as ``0.75 L0``.

    Args:
        raw: the words.
        unit: SI unit that is wanted.
        field: dotted path, for complaints.
        where: file, for complaints.
        bounds: smallest and largest allowed value, inclusive [SI; or rest lengths, if it is stated so].

    Raises:
        InputError: names the field and what is allowed.
    """
    if isinstance(raw, bool) or not isinstance(raw, str | int | float):
        raise InputError(field, shown(raw), "allowed is a number with its unit in words", where=where)
    match = _RELATIVE.fullmatch(str(raw))
    if match and RELATIVE[match[2]] == unit:
        found = Amount(float(match[1]), match[2])
    elif match:
        raise InputError(field, raw, f"allowed is a value in {unit} or a unit of the same dimension", where=where)
    else:
        found = Amount(parse(str(raw), unit, field=field, where=where), unit)
    if not math.isfinite(found.value):
        raise InputError(field, raw, "allowed is a finite number", where=where)
    low, high = bounds or (float("-inf"), float("inf"))
    if not low <= found.value <= high:
        allowed = Quantity(unit, (low, high), "", "", (low, high)).allowed()
        raise InputError(field, raw, f"allowed is {allowed}", where=where)
    return found


def relative_unit(entry: Any, unit: str) -> tuple[Any, str]:
    """A waveform's table whose lengths are in rest lengths, freed of them, and its unit; else both as they are."""
    changed = False

    def free(value: Any) -> Any:
        nonlocal changed
        if isinstance(value, Mapping):
            return {k: free(v) for k, v in value.items()}
        if isinstance(value, list | tuple):
            return [free(v) for v in value]
        match = _RELATIVE.fullmatch(value) if isinstance(value, str) else None
        if match and RELATIVE[match[2]] == unit:
            changed = True
            return match[1]
        return value

    freed = free(entry)
    own = {si: own for own, si in RELATIVE.items()}
    return (freed, own[unit]) if changed else (entry, unit)
