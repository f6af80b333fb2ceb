"""Conditions that end a step early: tests of measured channels, as text and as a pure function on the sample clock.

The channels are pressure, span, velocity and tension, and those of the sensors that installed packages declare.

tension >= 60 N
span <= 0.8 L0 for 10 ms
pressure settled within 0.02 bar for 0.2 s        it has kept still
pressure within 0.02 bar of its set-point for 0.2 s
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from .._jax import Scalar, Tree, jnp
from ..components.system import SENSORS
from ..errors import InputError
from .amounts import CHANNELS, Amount, read_amount
from .waveforms import time_words

_COMPARE = re.compile(r"(\w+)\s*(>=|<=|>|<)\s*(.+?)(?:\s+for\s+(.+))?")
_STILL = re.compile(r"(\w+)\s+settled\s+within\s+(.+?)\s+for\s+(.+)")
_CLOSE = re.compile(r"(\w+)\s+within\s+(.+?)\s+of\s+its\s+set-point(?:\s+for\s+(.+))?")
_ALLOWED = (
    "must be a test such as 'tension >= 60 N', 'span <= 0.8 L0 for 10 ms', 'pressure settled within 0.02 bar for 0.2 s', "
    "'pressure within 0.02 bar of its set-point for 0.2 s'"
)

KINDS = (">=", "<=", "settled", "close")
START = (float("inf"), 0.0)  # the state before the first sample


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
        return START

    def step(self, state: Tree, measured: Mapping[str, Scalar], command: Scalar, dt: float, rest_length: float) -> Tree:
        """Advance by one sample; return the new state, and whether the step ends; see `advance`.

        Args:
            state: state of `start` or of the sample before.
            measured: channels by name [SI].
            command: set-point of this channel [SI]; only ``close`` looks at it.
            dt: sampling period [s].
            rest_length: rest length of the muscle [m].
        """
        limit = self.amount.si(rest_length)
        return advance(KINDS.index(self.kind), state, measured[self.channel], limit, self.lasting, command, dt)

    def sentence(self) -> str:
        """Describe the test."""
        lasting = f" for {time_words(self.lasting)}" if self.lasting else ""
        if self.kind == "settled":
            return f"{self.channel} settled within {self.amount.sentence()}{lasting}"
        if self.kind == "close":
            return f"{self.channel} within {self.amount.sentence()} of its set-point{lasting}"
        return f"{self.channel} {self.kind} {self.amount.sentence()}{lasting}"


def advance(kind: Scalar, state: Tree, x: Scalar, limit: Scalar, lasting: Scalar, command: Scalar, dt: Scalar) -> Tree:
    """Advance a test by one sample; return the new state, and whether it holds.

    Straight-line; for floats, arrays and traces.

    Args:
        kind: index into `KINDS`.
        state: where the channel was when it last left the band, and for how long the test has been true [s].
        x: the channel, measured [SI].
        limit: threshold, or half the width of the band [SI].
        lasting: for how long it has to be true [s].
        command: set-point of the channel [SI].
        dt: sampling period [s].
    """
    place, held = state
    above, below, still, close = (KINDS.index(k) for k in (">=", "<=", "settled", "close"))
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
