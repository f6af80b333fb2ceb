"""What stands between a true value and the number that a controller reads: counts, a filter against outliers, and time.

reading_n = median of the last m of round((true + noise)/q) q, as it was `delay` ago
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .mechanisms import Amount, in_si


@dataclass(frozen=True)
class Readout:
    """How a field of the observation is read: rounded to counts, by a median of the last samples, late.

    Args:
        rounding: size of a count, in the unit of the field or in words; 0 for none.
        median: odd number of samples of which the middle one is read; 1 for none.
        delay: whole periods of the simulation by which a reading is late [s]; 0 for none.

    Examples:
        >>> import mckibben as mk
        >>> fine = mk.simulation.Readout(rounding="0.5 mm", median=3)
        >>> sim = mk.Simulation(mk.Weight("nylon"), readouts={"position": fine})
        >>> round(sim.reset().position * 2e3 % 1.0, 9) in (0.0, 1.0)
        True
    """

    rounding: Amount = 0.0
    median: int = 1
    delay: Amount = 0.0


class ReadoutLines:
    """Fields of an observation that are read by a `Readout`, and what these remember; a value may be an array of lanes.

    Args:
        readouts: by field.
        fields: names of all fields, in their order, each with its SI unit.
        period: of the samples [s].

    Raises:
        InputError: names what does not fit.
    """

    def __init__(self, readouts: Mapping[str, Readout], fields: Mapping[str, str], period: float) -> None:
        self._entries: list[tuple[int, float, int, int]] = []  # place, count, median, samples late
        self.stated = dict(readouts)
        for name, readout in readouts.items():
            if name not in fields:
                raise InputError("readouts", name, known=fields)
            if not isinstance(readout, Readout):
                raise InputError(f"readout of {name}", type(readout).__name__, "must be a Readout")
            count = in_si(readout.rounding, fields[name], f"rounding of {name}")
            if count < 0.0:
                raise InputError(f"rounding of {name}", readout.rounding, "must be 0 or more")
            median = readout.median
            if isinstance(median, bool) or not isinstance(median, int) or median < 1 or median % 2 != 1:
                raise InputError(f"median of {name}", median, "must be an odd number of samples, 1 for none")
            late = in_si(readout.delay, "s", f"delay of {name}") / period
            if late < 0.0 or abs(late - round(late)) > 1e-6:
                problem = f"must be a whole number of periods of {period:g} s, 0 or more"
                raise InputError(f"delay of {name}", readout.delay, problem)
            self._entries.append((list(fields).index(name), count, median, round(late)))
        self.lines: list[list[Any]] = []

    def __bool__(self) -> bool:
        return bool(self._entries)

    def copy(self) -> ReadoutLines:
        """The same readouts with a memory of their own."""
        made: ReadoutLines = object.__new__(ReadoutLines)
        made.__dict__.update(self.__dict__, lines=[])
        return made

    def reset(self, values: Any) -> list[Any]:
        """Begin with values of all fields that have lasted, a number or an array of lanes each, and read them."""
        self.lines = [[_counts(values[place], count)] * (median + late) for place, count, median, late in self._entries]
        return self._read(values)

    def read(self, values: Any) -> list[Any]:
        """Take the values of a new sample, and read."""
        for line, (place, count, _, _) in zip(self.lines, self._entries, strict=True):
            del line[0]
            line.append(_counts(values[place], count))
        return self._read(values)

    def _read(self, values: Any) -> list[Any]:
        reading = list(values)
        for line, (place, _, median, _) in zip(self.lines, self._entries, strict=True):
            reading[place] = line[0] if median == 1 else _middle(line[:median])
        return reading


def _counts(value: Any, count: float) -> Any:
    if count == 0.0:
        return value
    return round(value / count) * count if isinstance(value, float) else np.round(value / count) * count


def _middle(values: list[Any]) -> Any:
    if isinstance(values[0], float):
        return sorted(values)[len(values) // 2]
    return np.sort(np.array(values), axis=0)[len(values) // 2]
