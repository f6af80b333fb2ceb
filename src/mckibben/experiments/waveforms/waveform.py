"""Interface of waveforms, and their conversion from and to tables."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

import numpy as np

from ..._jax import Scalar
from ...documents import JsonValue
from ...errors import InputError
from ...quantities import with_unit
from ...schema import FileTable, Place, read_table

VALUE = "value"  # the unit of the signal, which only the table that names the waveform knows
RELATIVE = {"L0": "m", "L0/s": "m/s"}  # a muscle's own units, and what they are once its rest length is known
JUMP = 1e-9  # [s]; a sample so close before a jump stands for it: 0.3 is no whole number of milliseconds in binary
KINDS: dict[str, type[Waveform]] = {}  # every waveform by the word that names it in a file

# Reads the points of a file: (file, time column, value column, unit) -> times [s], values [unit].
ReadTable = Callable[[str, str | None, str | None, str], tuple[Any, Any]]
W = TypeVar("W", bound="Waveform")


def register(kind: type[W]) -> type[W]:
    """Make a waveform readable by its ``kind``."""
    KINDS[kind.kind] = kind
    return kind


@dataclass(frozen=True, kw_only=True)
class Waveform(abc.ABC):
    """Values over time from 0 s on."""

    kind: ClassVar[str]

    @property
    @abc.abstractmethod
    def straight(self) -> bool:
        """Whether values between samples are interpolated linearly; else each sample is held."""

    @abc.abstractmethod
    def at(self, times: Scalar) -> np.ndarray:
        """Values at times [s], in the unit of the signal; shape of the times."""

    @abc.abstractmethod
    def sentence(self, unit: str) -> str:
        """Describe the waveform, for a signal of an SI unit."""

    @property
    def fastest(self) -> float:
        """Highest frequency that samples must resolve [1/s]; zero where only jumps would ask for one."""
        return 0.0

    @classmethod
    def prepared(cls, table: FileTable, unit: str, files: ReadTable | None) -> tuple[FileTable, dict[str, JsonValue]]:
        """Rewrite a table that states the waveform by other keys than its fields: the table, and fields derived from it."""
        return table, {}


def read_waveform(
    entry: object, unit: str, *, field: str, where: str | None = None, table: ReadTable | None = None
) -> Waveform:
    """Read a waveform from its table, or a constant from a value alone.

    Args:
        entry: such as ``{"kind": "ramp", "from": "0 bar", "to": "5 bar", "duration": "2 s"}`` or ``"3 bar"``.
        unit: SI unit of the signal.
        field: dotted path for error messages.
        where: file for error messages.
        table: reads the file that a table names.

    Raises:
        InputError: names what is unknown, missing, out of bounds or in the wrong unit.
    """
    stated = entry if isinstance(entry, Mapping) else {"kind": "constant", "value": entry}
    whole = FileTable(stated, field, where or "")
    kind = KINDS[whole.word("kind", among=KINDS)]
    prepared, fields = kind.prepared(whole.without("kind"), unit, table)
    return read_table(kind, prepared, units={VALUE: unit}, files=table, owner=f"{kind.kind} has", **fields)


def read_parts(raw: object, place: Place) -> tuple[Waveform, ...]:
    """Read a list of waveforms in the unit of the signal, their places counted from 1."""
    if not isinstance(raw, list | tuple) or not raw:
        raise place.fail(raw, "must be a list of one or more")
    return tuple(_read_below(one, place.unit(VALUE), place.below(i)) for i, one in enumerate(raw, 1))


def read_share(raw: object, place: Place) -> Waveform:
    """Read a waveform that is a pure number."""
    return _read_below(raw, "1", place)


def _read_below(raw: object, unit: str, place: Place) -> Waveform:
    files: Any = place.files
    return read_waveform(raw, unit, field=place.field, where=place.where, table=files)


def words(value: float, unit: str) -> str:
    """Format a value with its unit; in rest lengths if the unit is one of `RELATIVE`."""
    if unit in RELATIVE:
        return f"{float(value):.4g} {unit}"
    return with_unit(float(value), unit)


def time_words(seconds: float) -> str:
    """A time in the unit that fits: ``50 us``, ``1 ms``, ``2 s``."""
    for limit, factor, unit in ((1e-3, 1e6, "us"), (1.0, 1e3, "ms")):
        if 0.0 < abs(seconds) < limit * (1.0 - 1e-9):
            return f"{seconds * factor:.6g} {unit}"
    return f"{seconds:.6g} s"


def check_rising(times: tuple[float, ...], values: tuple[float, ...]) -> None:
    """Refuse a table whose times do not rise from 0 s, or that has not as many values."""
    if len(times) != len(values):
        raise InputError("values", len(values), f"must be {len(times)}, one for each of the times")
    if times[0] != 0.0:
        raise InputError("times", time_words(times[0]), "must begin with 0 s")
    for a, b in zip(times, times[1:], strict=False):
        if not b > a:
            raise InputError("times", time_words(b), f"must be a time after {time_words(a)}; they rise")
