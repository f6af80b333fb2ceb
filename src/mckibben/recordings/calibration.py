"""Calibrations: gain, zero and skew per channel, with uncertainties and origins.

    true = gain (indicated - zero),   true(t) = recorded(t + skew)

*Indicated* is what the nominal scale of the rig's converter gives; of an encoder, the travel since it was zeroed. The skew
is the time by which a channel lags the first one. A recording carries its calibration in its meta, under ``calibration``,
as the plain table of `Calibration.plain`, in SI, which `read_plain` checks; `bench.calibrate` finds it and
keeps it in files.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .. import schema
from .._jax import Scalar
from ..answers import brief
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import Quantity
from ..schema import FileTable, Place, read_table
from .units import is_si

SCHEMA = 1
DAY = 86400.0  # [s]
LONGEST = 36525.0 * DAY  # for which a calibration may be said to be valid [s]; without an end is infinite
# Value where nobody determined it, and bounds [unit of the channel; gain 1, skew s].
TERMS = {"gain": (1.0, 1e-3, 1e3), "zero": (0.0, -1e9, 1e9), "skew": (0.0, -1.0, 1.0)}
Moment = datetime.datetime | str


def moment(value: Moment) -> datetime.datetime:
    """A date and time in UTC, which is meant where a text names no zone.

    Raises:
        InputError: it is none.
    """
    try:
        time = datetime.datetime.fromisoformat(value) if isinstance(value, str) else value
        return time.replace(tzinfo=datetime.UTC) if time.tzinfo is None else time.astimezone(datetime.UTC)
    except (TypeError, ValueError, AttributeError, OverflowError):
        raise InputError("date", str(value), "must be a date such as 2026-03-31T12:00:00+00:00") from None


def _read_line(raw: Any, place: Place) -> str:
    if not isinstance(raw, str) or not raw.isprintable():
        raise place.fail(raw, "must be one line of text")
    return raw


def _read_date(raw: Any, place: Place) -> str:
    line = _read_line(raw, place)
    try:
        moment(line)
    except InputError as error:
        raise error.changed(field=place.field, where=place.where) from None
    return line


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Origin of a number.

    Attributes:
        method: such as ``weights``.
        date: in ISO 8601.
        reference: what it was compared with, such as ``M1 masses, S/N 7``.
        reference_uncertainty: of the reference, standard, of each of its values [unit of the channel].
        scale_uncertainty: scale uncertainty of the reference, standard, of all its values alike, as a share [1].
        valid_for: time after the date [s], or infinite.
        points: how many were compared.
    """

    method: str = schema.entry(_read_line)
    date: str = schema.entry(_read_date)
    reference: str = schema.entry(_read_line, default="")
    reference_uncertainty: float = schema.number("channel", (0.0, 1e9), default=0.0)
    scale_uncertainty: float = schema.number("1", (0.0, 1.0), default=0.0)
    valid_for: float = schema.number("s", (1.0, LONGEST), default=math.inf, endless=True)
    points: int = schema.whole(0, 10**9, default=0)

    @property
    def expires(self) -> datetime.datetime | None:
        """Time of expiry, in UTC; None if it never expires."""
        if math.isinf(self.valid_for):
            return None
        try:
            return moment(self.date) + datetime.timedelta(seconds=self.valid_for)
        except OverflowError:  # beyond the year 9999
            return None


@dataclass(frozen=True)
class CorrectionTerm:
    """A number of a correction, its standard uncertainty with degrees of freedom, and its origin.

    The uncertainty is NaN, and the origin None, where nobody determined it.
    """

    value: float = schema.number("term")
    uncertainty: float = schema.number("term", (0.0, 1e9), default=math.nan)
    degrees: float = schema.number("1", (0.5, 1e12), default=math.inf, endless=True)
    origin: Origin | None = None

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Two-sided interval, by Student's t [unit]; NaN if it was never determined."""
        half = coverage(self.degrees, confidence) * self.uncertainty
        return self.value - half, self.value + half


@dataclass(frozen=True, kw_only=True)
class Correction:
    """Correction of a channel.

    Attributes:
        unit: SI unit of the channel.
        terms: ``gain`` [1], ``zero`` [unit], ``skew`` [s]; those that were determined.
        sensor: serial number or name.
        correlation: correlation of gain and zero [1].
        linearity: largest departure of a compared point from the line [unit]; NaN if none were compared.
    """

    unit: str
    terms: Mapping[str, CorrectionTerm] = field(default_factory=dict)
    sensor: str = schema.entry(_read_line, default="")
    correlation: float = schema.number("1", (-1.0, 1.0), default=0.0)
    linearity: float = schema.number("channel", (0.0, 1e9), default=math.nan)

    __repr__ = brief

    def term(self, name: str) -> CorrectionTerm:
        """One of `TERMS`; the neutral value if it was never determined."""
        return self.terms.get(name, CorrectionTerm(TERMS[name][0]))

    @property
    def gain(self) -> float:
        """Ratio of true to indicated values [1]."""
        return self.term("gain").value

    @property
    def zero(self) -> float:
        """Indication at a true value of zero [unit]."""
        return self.term("zero").value

    @property
    def skew(self) -> float:
        """Time by which the channel lags the first one [s]."""
        return self.term("skew").value

    def true(self, indicated: Scalar) -> Scalar:
        """Convert indicated values to true ones [unit]."""
        return self.gain * (indicated - self.zero)

    def indicated(self, true: Scalar) -> Scalar:
        """Indicated values of true ones [unit]; the inverse of `true` to rounding."""
        return true / self.gain + self.zero

    def uncertainty(self, indicated: Scalar) -> Scalar:
        """Standard uncertainty of the true values [unit], of gain, zero and their correlation; NaN without both."""
        gain, zero = self.term("gain"), self.term("zero")
        by_gain, by_zero = gain.uncertainty * (indicated - self.zero), -self.gain * zero.uncertainty
        return (by_gain**2 + by_zero**2 + 2.0 * self.correlation * by_gain * by_zero) ** 0.5

    def expired(self, now: Moment) -> tuple[str, ...]:
        """The terms whose validity has expired."""
        ends = {n: t.origin.expires for n, t in self.terms.items() if t.origin is not None}
        return tuple(n for n, end in ends.items() if end is not None and moment(now) > end)

    def updated(self, correction: Correction) -> Correction:
        """Update by newly determined terms; a sensor by another name inherits nothing.

        Raises:
            InputError: if the unit differs.
        """
        if correction.unit != self.unit:
            raise InputError("unit", correction.unit, f"the calibration has {self.unit}")
        if correction.sensor and self.sensor and correction.sensor != self.sensor:
            return correction
        lined = {"gain", "zero"} & set(correction.terms)
        return Correction(
            unit=self.unit,
            terms={**self.terms, **correction.terms},
            sensor=correction.sensor or self.sensor,
            correlation=correction.correlation if lined else self.correlation,
            linearity=correction.linearity if "gain" in correction.terms else self.linearity,
        )


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Corrections of the channels of a rig, with the date of the last change in ISO 8601."""

    rig: str = schema.entry(_read_line)
    created: str = schema.entry(_read_date)
    corrections: Mapping[str, Correction] = field(default_factory=dict)

    __repr__ = brief

    def correction(self, channel: str) -> Correction:
        """Correction of a channel.

        Raises:
            InputError: if it is not calibrated.
        """
        if channel not in self.corrections:
            known = ", ".join(self.corrections) or "none"
            raise InputError("channel", channel, f"calibrated are {known}")
        return self.corrections[channel]

    def apply(self, channel: str, indicated: Scalar) -> Scalar:
        """Convert indicated values of a channel to true ones [its unit]."""
        return self.correction(channel).true(indicated)

    def indicated(self, channel: str, true: Scalar) -> Scalar:
        """Indicated values of a channel for true ones [its unit]."""
        return self.correction(channel).indicated(true)

    def updated(self, corrections: Mapping[str, Correction], date: str) -> Calibration:
        """Update by terms determined at a date; other channels, and other terms of the same sensor, are kept."""
        kept = dict(self.corrections)
        for name, one in corrections.items():
            kept[name] = kept[name].updated(one) if name in kept else one
        return Calibration(rig=self.rig, created=date, corrections=kept)

    def expired(self, now: Moment) -> tuple[str, ...]:
        """Sentences for the channels of which a term is older than its validity."""
        said = []
        for name, one in self.corrections.items():
            over = one.expired(now)
            for method in dict.fromkeys(one.terms[term].origin.method for term in over):  # type: ignore[union-attr]
                which = [term for term in over if one.terms[term].origin.method == method]  # type: ignore[union-attr]
                origin = one.terms[which[0]].origin
                assert origin is not None
                said.append(
                    f"the calibration of {name} ({' and '.join(which)} by {method} on {origin.date[:10]}, valid for "
                    f"{origin.valid_for / DAY:.4g} days) expired on {origin.expires:%Y-%m-%d}"
                )
        return tuple(said)

    def plain(self) -> dict[str, JsonValue]:
        """Return the calibration as a table of JSON's own types, in SI, which `read_plain` takes."""
        channels = {name: correction_table(one, bare=True) for name, one in self.corrections.items()}
        return {"schema": SCHEMA, "rig": self.rig, "created": self.created, "channels": channels}


def coverage(degrees: float, confidence: float = 0.95) -> float:
    """Coverage factor of an interval: Student's t."""
    from scipy import stats

    share = 0.5 + confidence / 2.0
    return float(stats.norm.ppf(share) if math.isinf(degrees) else stats.t.ppf(share, degrees))


def correction_table(one: Correction, *, bare: bool) -> dict[str, JsonValue]:
    """Table of a correction that `read_plain` reads: SI numbers if `bare`, else text with units."""
    units = {"channel": one.unit}
    out = {"unit": one.unit, "sensor": one.sensor, "correlation": one.correlation} if bare else {}
    out |= schema.write_table(one, units=units, bare=bare, skip=("terms",))
    for name, term in one.terms.items():
        term_units = {**units, "term": {"gain": "1", "zero": one.unit, "skew": "s"}[name]}
        number: dict[str, Any] = {"value": term.value}
        if not math.isnan(term.uncertainty):
            number |= {"uncertainty": term.uncertainty, "degrees": term.degrees}
        if not bare:
            number = schema.write_table(term, units=term_units, skip=("origin",))
        if term.origin is not None:
            number |= dict(vars(term.origin)) if bare else schema.write_table(term.origin, units=term_units)
        out[name] = number
    return out


ORIGIN = tuple(Origin.__dataclass_fields__)


def read_plain(table: object, *, where: str = "calibration", bare: bool = True) -> Calibration:
    """Make a calibration of a table, as `Calibration.plain` makes it and a recording's meta has it.

    Args:
        table: table of words and numbers.
        where: file for error messages.
        bare: take numbers without a unit as SI; a file states units.

    Raises:
        InputError: names the dotted path, the value and what it must be; a newer schema is refused.
    """
    top = FileTable.of(table, "calibration" if not isinstance(table, Mapping) else "", where)
    schema = top.values.get("schema")
    if isinstance(schema, int) and not isinstance(schema, bool) and schema > SCHEMA:
        raise top.fail("schema", schema, f"must be {SCHEMA} for this version of mckibben; a newer one wrote it")
    top.schema(SCHEMA)
    top.only(("schema", "rig", "created", "channels"))
    channels = top.table("channels")
    corrections = {name: _read_correction(channels.table(name), bare) for name in channels.values}
    return read_table(Calibration, top.without("schema", "channels"), bare=bare, corrections=corrections)


def _read_correction(at: FileTable, bare: bool) -> Correction:
    at.only(("unit", "sensor", "correlation", "linearity", *TERMS), "a channel has")
    unit = at.word("unit")
    if not is_si(unit):
        raise at.fail("unit", unit, "must be an SI unit such as 'Pa' or 'N'")
    terms = {name: _read_term(at.table(name), name, unit, bare) for name in TERMS if name in at}
    return read_table(Correction, at.without(*TERMS), units={"channel": unit}, bare=bare, terms=terms)


def _read_term(at: FileTable, name: str, unit: str, bare: bool) -> CorrectionTerm:
    at.only(("value", "uncertainty", "degrees", *ORIGIN), f"{name} has")
    units = {"channel": unit, "term": {"gain": "1", "zero": unit, "skew": "s"}[name]}
    stated = at.derived({k: v for k, v in at.values.items() if k in ORIGIN})
    origin = read_table(Origin, stated, units=units, bare=bare) if "method" in at else None
    term = read_table(CorrectionTerm, at.without(*ORIGIN), units=units, bare=bare, origin=origin)
    _, low, high = TERMS[name]
    if not low <= term.value <= high:
        Quantity(units["term"], (low, high), "", "", (low, high)).check(at.field("value"), term.value, where=at.where)
    return term
