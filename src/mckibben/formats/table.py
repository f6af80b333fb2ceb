"""What files hold as plain tables: channels with SI units over one time with metadata, or the columns of another program.

Nothing here knows what a recording is asked. A format turns a file into a `StoredRecording`, where mckibben wrote it, or
into a `ForeignTable`, of which `columns` makes one.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tokenize import TokenError
from typing import Any, NamedTuple, NoReturn, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..documents import JsonValue
from ..errors import InputError
from ..extras import library
from ..isolation import carried
from ..quantities import to_si

KINDS = ("true", "measured", "command", "estimated")
_NAME = re.compile(r"\w[^/\\\[\],;\"#]*")


@carried
@dataclass(frozen=True, eq=False, repr=False)
class Channel:
    """A quantity over the time of a recording.

    Args:
        values: float64 (n,), copied and read-only; NaN is allowed and means that nothing is known there.
        unit: SI unit as text, without prefixes: ``"Pa"``, ``"kg/s"``, ``"1"`` for a pure number.
        kind: ``"true"`` for the state of a simulation, ``"measured"`` behind a sensor, ``"command"`` for what was asked,
            ``"estimated"`` for what follows from measured channels.
        meaning: one phrase for a person.

    Raises:
        InputError: names what is wrong and what is allowed.

    Examples:
        >>> import mckibben as mk
        >>> mk.Channel([1e5, 2e5], "Pa", "measured", "gauge pressure at the valve")
        Channel(2 values, unit='Pa', kind='measured', meaning='gauge pressure at the valve')
    """

    values: np.ndarray
    unit: str = "Pa"
    kind: str = "true"
    meaning: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", _column(self.values, "values of a channel"))
        if not isinstance(self.unit, str) or not is_si(self.unit):
            raise InputError("unit of a channel", self.unit, "must be an SI unit such as 'Pa', 'kg/s' or '1'")
        if self.kind not in KINDS:
            raise InputError("kind of a channel", self.kind, known=KINDS)
        if not isinstance(self.meaning, str) or not self.meaning.isprintable():
            raise InputError("meaning of a channel", repr(self.meaning), "must be one line of text")

    def __len__(self) -> int:
        return len(self.values)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Channel):
            return NotImplemented
        same = (self.unit, self.kind, self.meaning) == (other.unit, other.kind, other.meaning)
        return same and np.array_equal(self.values, other.values, equal_nan=True)

    __hash__ = None  # type: ignore[assignment]  # arrays have no cheap hash

    def __repr__(self) -> str:
        return f"Channel({len(self)} values, unit={self.unit!r}, kind={self.kind!r}, meaning={self.meaning!r})"

    def scaled(self, scale: str) -> Channel:
        """Return the quantity that a raw signal stands for.

        Args:
            scale: the quantity per raw unit, with an offset or without: ``"2 bar/V"``, ``"0.5 N/mV - 3 N"``; of a channel
                of counts, in ``"1"``, ``"4.9 mbar/count"``.

        Raises:
            InputError: the scale is none, or is not for the unit of this channel.

        Examples:
            >>> import mckibben as mk
            >>> mk.Channel([0.5, 1.0], "V").scaled("2 bar/V - 1 bar").values.tolist()
            [0.0, 100000.0]
        """
        known = parse_scale(scale, field="scale")
        unit, by, _ = si_of(known.raw, field="scale")
        if unit != self.unit:
            raise InputError("scale", scale, f"must be for a channel in {self.unit}, such as '2 bar/{self.unit}'")
        return Channel(self.values * (known.gain / by) + known.offset, known.unit, self.kind, self.meaning)

    def with_values(self, values: ArrayLike) -> Channel:
        """Return a copy with other values (n,) [unit]."""
        return Channel(np.asarray(values), self.unit, self.kind, self.meaning)


class Samples(Protocol):
    """Channels over one time with metadata: a recording, or what is stored of one."""

    @property
    def time(self) -> np.ndarray:
        """Times (n,) [s]."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Channels by dotted name."""

    @property
    def meta(self) -> Mapping[str, Any]:
        """What JSON can hold, nested."""


@carried
@dataclass(frozen=True, eq=False)
class StoredRecording:
    """What a file of mckibben holds of a recording, and a line for each thing that was not taken over as it is.

    Raises:
        InputError: as a recording of these would.
    """

    time: np.ndarray
    channels: Mapping[str, Channel]
    meta: Mapping[str, Any]
    remarks: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        check_samples(self)


def check_samples(samples: Samples) -> None:
    """Check the fields of a frozen recording when it is made, and make them unchangeable.

    Raises:
        InputError: names the sample, the channel or the dotted path of the metadata, and what is allowed.
    """
    time = _column(samples.time, "time")
    _check_clock(time)
    if not isinstance(samples.channels, Mapping):
        raise InputError("channels", type(samples.channels).__name__, "must be a mapping of names to channels")
    kept: dict[str, Channel] = {}
    for name, channel in samples.channels.items():
        check_name(name)
        if not isinstance(channel, Channel):
            raise InputError(f"channel {name}", type(channel).__name__, "must be a Channel")
        if len(channel) != len(time):
            raise InputError(
                f"channel {name}", None, f"must have {len(time)} values, as the time has, got {len(channel)}"
            )
        # A meaning that only repeats the name says nothing.
        said = channel.meaning != name
        kept[name] = channel if said else Channel(channel.values, channel.unit, channel.kind)
    object.__setattr__(samples, "time", time)
    object.__setattr__(samples, "channels", Frozen(kept))
    object.__setattr__(samples, "meta", freeze(samples.meta))


def check_name(name: object, where: str | None = None) -> None:
    """Refuse a channel name that a file could not hold."""
    plain = isinstance(name, str) and name.isprintable() and name.strip() == name and _NAME.fullmatch(name)
    if not plain or name == "time":
        allowed = "must be a name such as 'tank.pressure', without / \\ [ ] , ; \" # and not 'time'"
        raise InputError("name of a channel", name if isinstance(name, str) else repr(name), allowed, where=where)


def _column(values: Any, name: str) -> np.ndarray:
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise InputError(name, None, f"must be real numbers, got none ({error})") from None
    if array.dtype.kind not in "fiub":
        raise InputError(name, None, f"must be real numbers, got type {array.dtype}")
    if array.ndim != 1:
        raise InputError(name, None, f"must have one dimension, got shape {array.shape}")
    column = np.array(array, dtype=np.float64)
    column.flags.writeable = False
    return column


def _check_clock(time: np.ndarray) -> None:
    if not len(time):
        raise InputError("time", None, "must have at least one sample")
    if not np.isfinite(time).all():
        i = int(np.argmin(np.isfinite(time)))
        raise InputError(f"time of sample {i}", float(time[i]), "must be a finite time")
    late = np.diff(time) > 0.0
    if not late.all():
        i = int(np.argmin(late))
        raise InputError(
            f"time of sample {i + 1}",
            None,
            f"must be later than the one before, got {time[i + 1]!s} s after {time[i]!s} s",
        )


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


def channel_attributes(name: str, channel: Channel) -> dict[str, str]:
    """The attributes of a channel's variable in a netCDF file."""
    return {"units": channel.unit, "long_name": channel.meaning or name, "kind": channel.kind}


# Whole SI units without prefixes. Coulomb, farad, tesla and henry are left out: "C" and "F" are temperatures in most files.
_SI_WORDS = frozenset("1 m kg s A K mol cd rad sr N Pa J W V Hz Ohm S Wb lx lm".split())
_PRESSURES = ("Pa", "N/m^2", "J/m^3")
# What a unit that is not SI may become, tried in order; angles apart, as they have no dimension of their own.
_TARGETS = (
    *("Pa", "s", "m", "N", "kg/s", "m^3/s", "K", "V", "A", "m^3", "m^2", "m/s", "m/s^2", "kg", "J", "W", "Hz"),
    *("Ohm", "Pa/s", "N/s", "N/m", "kg/m^3", "1"),
)
_ANGLES = ("rad", "rad/s", "rad/s^2")
_ANGLE_WORDS = re.compile(r"deg(rees?)?\b|°(?![CF])|rpm|rev|turn|rad\b|arcmin|arcsec")
# Units as files print them: kilograms on gauges are forces, and a digit behind a letter is an exponent.
_AS_PRINTED = tuple(
    (re.compile(printed), plain)
    for printed, plain in (
        (r"kgf?/cm(2|\^2|²)", "kgf/cm^2"), (r"lbf?[-.* ](in|ft)", r"lbf*\1"), (r"(in|ft)[-.* ]lbf?", r"lbf*\1"),
        ("RPM", "rpm"), (r"(?i:deg\.? ?c|celsius)", "degC"), ("Fahrenheit", "degF"), ("rev", "turn"),
        (r"(?i:sekunden?|secondes?|segundos?|secondi|secondo)", "s"),
        (r"(?i:mil+i?-?(sekunden?|secondes?|segundos?|secondi))", "ms"), (r"(.*[A-Za-z])([23])", r"\1^\2"),
    )
)  # fmt: skip
_TORQUE = re.compile(r"([mk]?N|lbf)[-.·* ]?([mc]?m|in|ft)")  # no energy, though it has the same dimension
_TEMPERATURES = {"°C": "degC", "C": "degC", "°F": "degF", "F": "degF"}


def is_si(unit: str) -> bool:
    """Whether every word of a unit such as ``m^3/(s Pa)`` is an SI unit without a prefix."""
    words = re.split(r"[ */()^]+", unit.removesuffix(")"))
    return words[0] in _SI_WORDS and all(word in _SI_WORDS or re.fullmatch(r"-?\d+(\.\d+)?", word) for word in words)


def is_pressure(si_unit: str) -> bool:
    """Whether an SI unit is that of a pressure."""
    return si_unit in _PRESSURES


# Volumes of air at a standard state, which flow meters state per minute: its density [kg/m^3], and words for a person.
_NORMAL = (1.2929, "at 0 °C and 1.01325 bar (DIN 1343, SEMI E12)")
_STANDARDS = {
    "sl": _NORMAL,
    "nl": _NORMAL,
    "scc": _NORMAL,
    "ncc": _NORMAL,
    "l_anr": (1.185, "at 20 °C, 1 bar and 65 % (ISO 8778)"),
}
_FLOW = re.compile(r"(s|n)(l)(?:pm|/min|m)|(s|n)(cc)(?:m|pm|/min)|(l)/min ?\(?(anr)\)?")


def standard_flow(unit: str) -> tuple[float, str] | None:
    """Mass flow of air [kg/s] of one standard litre or cubic centimetre a minute, and the state that it is at.

    Examples:
        >>> standard_flow("SLPM")
        (2.1548333333333332e-05, 'at 0 °C and 1.01325 bar (DIN 1343, SEMI E12)')
    """
    match = _FLOW.fullmatch(unit.strip().lower())
    if match is None:
        return None
    parts = [part for part in match.groups() if part]
    density, state = _STANDARDS["l_anr" if parts[-1] == "anr" else "".join(parts)]
    return density * (1e-6 if parts[-1] == "cc" else 1e-3) / 60.0, state


class Scale(NamedTuple):
    """How a raw signal becomes a quantity: value [unit] = gain * raw + offset, raw in `raw`.

    Args:
        gain: [unit/raw].
        offset: [unit].
        unit: SI unit of the quantity.
        raw: unit of the raw signal in words, ``1`` for counts.
    """

    gain: float
    offset: float
    unit: str
    raw: str


_SCALE = re.compile(
    r"\s*(?P<gain>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>[^-+]+?)(?:\s*(?P<sign>[-+])\s*(?P<offset>\d.*))?\s*"
)
_COUNTS = ("1", "count", "counts", "digit", "digits", "lsb", "bit", "step")


def parse_scale(text: str, *, field: str, where: str | None = None) -> Scale:
    """Read the scale of a raw signal: ``2 bar/V``, ``0.5 N/mV - 3 N``, ``4.9 mbar/count``.

    Raises:
        InputError: says what would do.

    Examples:
        >>> parse_scale("2 bar/V - 1 bar", field="scale")
        Scale(gain=200000.0, offset=-100000.0, unit='Pa', raw='V')
    """
    match = _SCALE.fullmatch(text)
    if match is None:
        problem = (
            "must be a quantity per raw unit, with an offset or without: '2 bar/V', '0.5 N/mV - 3 N', '4.9 mbar/count'"
        )
        raise InputError(field, text, problem, where=where)
    top, slash, raw = match["unit"].strip().rpartition("/")
    if not slash:
        top, raw = match["unit"].strip(), "1"
    unit, scale, _ = si_of(top, field=field, where=where)
    offset = 0.0
    if match["offset"]:
        number, _, word = match["offset"].strip().partition(" ")
        other, by, _ = si_of(word.strip() or top, field=field, where=where)
        if other != unit or not number.replace(".", "", 1).isdigit():
            raise InputError(field, text, f"must have an offset in a unit such as {top}", where=where)
        offset = float(f"{match['sign']}{number}") * by
    return Scale(float(match["gain"]) * scale, offset, unit, "1" if raw.strip().lower() in _COUNTS else raw.strip())


def si_of(unit: str, *, field: str, where: str | None = None) -> tuple[str, float, float]:
    """SI unit of a unit, and the conversion: value [SI] = value * scale + offset.

    Raises:
        InputError: the unit is unknown.
    """
    if is_pressure(unit):
        return "Pa", 1.0, 0.0
    if is_si(unit):
        return unit, 1.0, 0.0
    if (standard := standard_flow(unit)) is not None:
        return "kg/s", standard[0], 0.0
    torque = _TORQUE.fullmatch(unit)
    word = f"{torque[1]}*{torque[2]}" if torque else _TEMPERATURES.get(unit, unit)
    for target in ("N*m",) if torque else _ANGLES if _ANGLE_WORDS.search(word) else _TARGETS:
        try:
            offset = to_si(0.0, word, target, field=field)
        except (InputError, SyntaxError, TokenError):  # pint meets "m mm)" with the latter two
            continue
        # Only temperatures have an offset; a thousand degrees apart leave no rounding in the scale.
        scale = (
            to_si(1.0, word, target, field=field)
            if offset == 0.0
            else round((to_si(1000.0, word, target, field=field) - offset) / 1000.0, 12)
        )
        return target, scale, offset
    plain = next((p.sub(word, unit) for p, word in _AS_PRINTED if p.fullmatch(unit)), None) or (
        unit.lower() if unit.isalpha() and len(unit) > 3 else unit
    )
    if plain != unit:  # "Volts", "MILLIMETERS"; of short ones the letters' case counts
        with contextlib.suppress(InputError):
            return si_of(plain, field=field)
    raise InputError(field, unit, "must be a unit such as kPa, bar, psi, ms, mm, V, degC or 1", where=where)


@carried
class ForeignColumn(NamedTuple):
    """A column of a file that another program wrote.

    Args:
        label: its name in the file.
        values: (n,) numbers, flags or dates; cells in words (object) of a table of text.
        unit: as text, where the file states one beside the name.
        clock: columns that share their samples share this word.
        time: (n,) [s] where the file implies it, by a rate or by stamps.
    """

    label: str
    values: np.ndarray
    unit: str | None = None
    clock: str = ""
    time: np.ndarray | None = None


@carried
class ForeignTable(NamedTuple):
    """The columns of a file that another program wrote, what else it says for the meta, and a line for each loss.

    Args:
        columns: the columns.
        notes: what else the file says, for the meta.
        remarks: a line for each thing that is left out.
        rows: of a table of cells, the number in the file of each row, which messages name.
        named: whether the labels are those of the file.
    """

    columns: list[ForeignColumn]
    notes: Mapping[str, Any] = {}
    remarks: list[str] = []
    rows: Sequence[int] | None = None
    named: bool = True

    def place(self, index: int) -> str:
        """Value `index` in the words of a message, such as ``, row 7`` or ``, sample 7``."""
        return f", sample {index + 1}" if self.rows is None else f", row {self.rows[index]}"


@dataclass(frozen=True, kw_only=True)
class FileFormat:
    """A file format.

    Attributes:
        title: its name in the plural, for sentences, such as ``"TDMS files"``.
        read: reads a file, as a recording of mckibben or as the columns of another program's table; raises `InputError`.
        write: writes a recording and returns a line for each thing that the format holds otherwise; None if the format
            is only read.
        requires: library without which nothing is written, a key of `extras.LIBRARIES`.
        options: names of further keywords of `read`, such as ``gear_ratio``.
        parts: names of the parts of a file of which the first of `options` chooses one, such as the sheets of a spreadsheet.
    """

    title: str
    read: Callable[..., StoredRecording | ForeignTable]
    write: Callable[[Samples, Path], list[str]] | None = field(default=None)
    requires: str = ""
    options: tuple[str, ...] = ()
    parts: Callable[[Path], list[str]] | None = None

    def check_libraries(self, where: str) -> None:
        """Refuse to write where a library is missing, before a long file is read.

        Raises:
            MissingLibraryError: names the library and how to install it.
        """
        if self.requires:
            library(self.requires, f"{self.title} need", where=where)
