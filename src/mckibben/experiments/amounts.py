"""Amounts of a protocol: in SI or in the rest length of a muscle that is not chosen yet, and tests of them that end a step.

A test is one of a measured channel: pressure, span, velocity, tension, or that of a sensor of an installed package.

tension >= 60 N
span <= 0.8 L0 for 10 ms
pressure settled within 0.02 bar for 0.2 s        it has kept still
pressure within 0.02 bar of its set-point for 0.2 s
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from .._jax import Scalar, Tree, jnp
from ..components.system import SENSORS
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import Quantity, has_dimension, parse
from ..schema import shown
from .waveforms import time_words
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
    if isinstance(entry, Mapping):
        return {key: _rewritten(value, write) for key, value in entry.items()}
    if isinstance(entry, list | tuple):
        return [_rewritten(value, write) for value in entry]
    return write(entry) if isinstance(entry, str) else entry


# ---- tests


_COMPARE = re.compile(r"(\w+)\s*(>=|<=|>|<)\s*(.+?)(?:\s+for\s+(.+))?")
_STILL = re.compile(r"(\w+)\s+settled\s+within\s+(.+?)\s+for\s+(.+)")
_CLOSE = re.compile(r"(\w+)\s+within\s+(.+?)\s+of\s+its\s+set-point(?:\s+for\s+(.+))?")
_ALLOWED = (
    "must be a test such as 'tension >= 60 N', 'span <= 0.8 L0 for 10 ms', 'pressure settled within 0.02 bar for 0.2 s', "
    "'pressure within 0.02 bar of its set-point for 0.2 s'"
)

TESTS = (">=", "<=", "settled", "close")
TEST_START = (float("inf"), 0.0)  # the state before the first sample


@dataclass(frozen=True)
class Until:
    """A test of one measured channel.

    ``kind`` is ``>=`` or ``<=`` (a threshold), ``settled`` (it has stayed within `amount` of where it was when it last left
    that band) or ``close`` (within `amount` of its set-point). It holds once it was true for `lasting` [s] without a break.
    """

    channel: str
    kind: str
    amount: Amount
    lasting: float = 0.0

    @property
    def unit(self) -> str:
        """SI unit of the channel."""
        return CHANNELS[self.channel] if self.channel in CHANNELS else SENSORS[self.channel].unit

    def start(self) -> tuple[float, float]:
        """The state before the first sample: where the channel was, and for how long it has been true [s]."""
        return TEST_START

    def step(self, state: Tree, measured: Mapping[str, Scalar], command: Scalar, dt: float, rest_length: float) -> Tree:
        """Advance by one sample; return the new state, and whether the step ends; see `advance_test`.

        Args:
            state: state of `start` or of the sample before.
            measured: channels by name [SI].
            command: set-point of this channel [SI]; only ``close`` looks at it.
            dt: sampling period [s].
            rest_length: rest length of the muscle [m].
        """
        limit = self.amount.si(rest_length)
        return advance_test(TESTS.index(self.kind), state, measured[self.channel], limit, self.lasting, command, dt)

    def sentence(self) -> str:
        """Describe the test."""
        lasting = f" for {time_words(self.lasting)}" if self.lasting else ""
        if self.kind == "settled":
            return f"{self.channel} settled within {self.amount.sentence()}{lasting}"
        if self.kind == "close":
            return f"{self.channel} within {self.amount.sentence()} of its set-point{lasting}"
        return f"{self.channel} {self.kind} {self.amount.sentence()}{lasting}"


def advance_test(
    kind: Scalar, state: Tree, x: Scalar, limit: Scalar, lasting: Scalar, command: Scalar, dt: Scalar
) -> Tree:
    """Advance a test by one sample; return the new state, and whether it holds.

    Straight-line; for floats, arrays and traces.

    Args:
        kind: index into `TESTS`.
        state: where the channel was when it last left the band, and for how long the test has been true [s].
        x: the channel, measured [SI].
        limit: threshold, or half the width of the band [SI].
        lasting: for how long it has to be true [s].
        command: set-point of the channel [SI].
        dt: sampling period [s].
    """
    place, held = state
    above, below, still, close = (TESTS.index(k) for k in (">=", "<=", "settled", "close"))
    stays = jnp.abs(x - place) <= limit
    true = jnp.where(kind == above, x >= limit, jnp.where(kind == below, x <= limit, stays))
    true = jnp.where(kind == close, jnp.abs(x - command) <= limit, true)
    place = jnp.where((kind == still) & ~stays, x, place)
    held = jnp.where(true, held + dt, 0.0)
    # a single true sample does where nothing is said; else the samples between the first and the last true one count
    long_enough = held >= lasting + dt * jnp.where(lasting > 0.0, 0.5, 0.0)
    return (place, held), true & long_enough


def read_until(raw: object, *, field: str, where: str | None = None) -> Until:
    """Read a test from text.

    Raises:
        InputError: names the field, the words and what is allowed.
    """
    text = raw.strip() if isinstance(raw, str) else ""
    still, close, compare = _STILL.fullmatch(text), _CLOSE.fullmatch(text), _COMPARE.fullmatch(text)
    if still:
        channel, amount, lasting, kind = still[1], still[2], still[3], "settled"
    elif close:
        channel, amount, lasting, kind = close[1], close[2], close[3], "close"
    elif compare:
        channel, amount, lasting, kind = compare[1], compare[3], compare[4], compare[2][0] + "="
    else:
        raise InputError(field, raw if isinstance(raw, str) else f"{type(raw).__name__} {raw}", _ALLOWED, where=where)
    if channel not in CHANNELS and channel not in SENSORS:
        names = [*CHANNELS, *(name for name in SENSORS if name not in CHANNELS)]
        raise InputError(field, channel, "measured are", known=names, where=where)
    if kind == "close" and channel not in CHANNELS:
        problem = f"must be a test without a set-point; only {', '.join(CHANNELS)} have one"
        raise InputError(field, text, problem, where=where)
    band = None if kind in (">=", "<=") else (0.0, float("inf"))
    unit = CHANNELS[channel] if channel in CHANNELS else SENSORS[channel].unit
    value = read_amount(amount, unit, field=field, where=where, bounds=band)
    seconds = read_amount(lasting, "s", field=field, where=where, bounds=(0.0, 1e6)).value if lasting else 0.0
    return Until(channel, kind, value, seconds)
