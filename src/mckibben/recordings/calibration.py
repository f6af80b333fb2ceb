"""Calibrations: gain, zero and skew per channel, with uncertainties and origins.

    true = gain (indicated - zero),   true(t) = recorded(t + skew)

*Indicated* is what the nominal scale of the rig's converter gives; of an encoder, the travel since it was zeroed. The skew
is the time by which a channel lags the first one. A recording carries its calibration in its meta, under ``calibration``,
as the plain table of `Calibration.plain`, in SI, which `read_plain` checks; `calibration_file` keeps it in files.

Recalibration goes from corrected values back to indicated ones, and to another calibration:

    indicated = low + n q,   n = round((indicated - low)/q)        of the metadata's ``converters``: low, high, bits
    travel = n r                                                   of the metadata's ``encoder``: resolution, mounted

The counts n are recovered from the recorded values, so nothing is lost by rounding, however often it is done. The meta's
``converters`` and ``saturation`` go on to speak of counts and stay as they are. ``encoder`` has the travel per count [m],
and ``mounted``: the span [m] at which it was zeroed, or a list of ``[from time, span]`` where that changed. A channel that
does not lie on its counts, since somebody resampled it, is taken back to rounding, and the metadata's ``warnings`` say so.
"""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .. import schema
from .._jax import Scalar
from ..answers import brief
from ..documents import JsonValue
from ..errors import InputError
from ..formats.table import Channel, is_si
from ..quantities import Quantity
from ..schema import FileTable, Place, read_table
from .recording import Recording

SCHEMA = 1
DAY = 86400.0  # [s]
LONGEST = 36525.0 * DAY  # for which a calibration may be said to be valid [s]; without an end is infinite
# Value where nobody determined it, and bounds [unit of the channel; gain 1, skew s].
TERMS = {"gain": (1.0, 1e-3, 1e3), "zero": (0.0, -1e9, 1e9), "skew": (0.0, -1.0, 1.0)}
UNITS = {"gain": "1", "skew": "s"}  # that of the channel for the rest
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
        term_units = {**units, "term": UNITS.get(name, one.unit)}
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
    units = {"channel": unit, "term": UNITS.get(name, unit)}
    stated = at.derived({k: v for k, v in at.values.items() if k in ORIGIN})
    origin = read_table(Origin, stated, units=units, bare=bare) if "method" in at else None
    term = read_table(CorrectionTerm, at.without(*ORIGIN), units=units, bare=bare, origin=origin)
    _, low, high = TERMS[name]
    if not low <= term.value <= high:
        Quantity(units["term"], (low, high), "", "", (low, high)).check(at.field("value"), term.value, where=at.where)
    return term


# Ends the name of a channel that holds what was indicated, beside one that was shifted in time.
INDICATED = ".indicated"
OFF = 1e-3  # of a count; farther from a whole count is no rounding
LONGEST_GAP = 1.5  # samples; across more, nothing is interpolated
NONE = Correction(unit="1")


class Indicated(NamedTuple):
    """Indicated values of a channel.

    Attributes:
        values: (n,) [unit of the channel]; of an encoder the travel since it was zeroed.
        base: what is added to the true travel of an encoder [m], (n,) or 0.
        counts: (n,), whole numbers, or None if the values do not lie on counts.
        low_end: whether the lowest count is an end of the range, rather than nothing at all.
        last: the highest count, or None for an encoder.
    """

    values: np.ndarray
    base: Any
    counts: np.ndarray | None
    low_end: bool
    last: float | None


def carried(recording: Recording) -> Calibration | None:
    """The calibration that a recording carries, or None.

    Raises:
        InputError: it cannot be read, for instance because a newer version wrote it.
    """
    table = recording.meta.get("calibration")
    return None if not table else read_plain(table, where="calibration of the recording")


def indicated(recording: Recording, channel: str) -> Indicated:
    """Recover the indicated values of a channel, with or without a calibration in its metadata.

    Raises:
        InputError: there is no such channel; or an encoder was calibrated, and the meta does not say where it was zeroed.
    """
    held = channel + INDICATED
    raw = held in recording
    old = carried(recording)
    correction = old.corrections.get(channel) if old is not None and not raw else None
    values = recording[held if raw else channel]
    base, low, q, low_end, last = _grid(recording, channel)
    if correction is not None:
        values = np.asarray(correction.indicated(values - base))
    elif not raw:
        values = values - base
    if q is None:
        return Indicated(values, base, None, False, None)
    exact = (values - low) / q
    counts = np.floor(exact + 0.5)
    known = np.isfinite(exact)
    if np.abs(exact[known] - counts[known]).max(initial=0.0) > OFF:
        return Indicated(values, base, None, low_end, last)
    return Indicated(low + counts * q, base, counts, low_end, last)


def saturated(recording: Recording, channel: str) -> np.ndarray:
    """Mask of the samples at an end of their converter (n,), regardless of later calibrations.

    The lower end of a range that begins at zero is no limit. A sample that was shifted in time counts where one that it is
    interpolated from does.
    """
    values = indicated(recording, channel)
    counts = values.counts
    if counts is None or values.last is None:
        return np.zeros(len(recording), bool)
    marked: np.ndarray = (counts >= values.last) | ((counts <= 0.0) & values.low_end)
    if channel + INDICATED not in recording:
        return marked
    old = carried(recording)
    skew = 0.0 if old is None or channel not in old.corrections else old.corrections[channel].skew
    saturated_samples: np.ndarray = np.nan_to_num(_shifted(recording.time, marked.astype(float), skew), nan=0.0) > 0.0
    return saturated_samples


def recalibrate(recording: Recording, calibration: Calibration | None, *, skew: bool = False) -> Recording:
    """The recording with another calibration, or with none.

    Channels that the new calibration does not know become what they indicated. The old calibration goes to the list
    ``calibration_history`` in the metadata.

    Args:
        recording: with or without a calibration in its meta.
        calibration: the new one; None takes the old one off.
        skew: also shift the channels by their skews, by straight lines between samples; NaN if that leaves the recording.
            The meta lists them under ``skew_corrected``, and ``<channel>.indicated`` keeps what was indicated.

    Raises:
        InputError: if the calibration is of another rig, unit or channels, or the old one cannot be read.
    """
    old = carried(recording)
    _check(recording, calibration, old)
    corrections = {} if calibration is None else dict(calibration.corrections)
    before = {} if old is None else dict(old.corrections)
    measured = [n for n in recording.names("measured") if not n.endswith(INDICATED)]
    channels = {n: c for n, c in recording.channels.items() if not n.endswith(INDICATED)}
    shifted, remarks = [], []
    for name in measured:
        if name not in corrections and name not in before:
            continue
        counted = name in (recording.meta.get("converters") or {}) or "encoder" in recording.meta
        if recording.unit(name) == "m" and not counted:
            remarks.append(f"{name} is left as it is: the recording does not say where its encoder was zeroed")
            continue
        found, new = indicated(recording, name), corrections.get(name, NONE)
        if found.counts is None:
            remarks.append(f"{name} does not lie on the counts of a converter: it was taken back to rounding only")
        values = found.base + (new.true(found.values) if name in corrections else found.values)
        if skew and new.skew != 0.0:
            kept = Channel(found.values, recording.unit(name), "measured", f"what {name} indicated, not shifted")
            channels[name + INDICATED] = kept
            values = _shifted(recording.time, values, new.skew)
            shifted.append(name)
        channels[name] = recording.channels[name].with_values(values)
    return Recording(recording.time, channels, _meta(recording, calibration, shifted, remarks))


def _meta(
    recording: Recording, calibration: Calibration | None, shifted: list[str], remarks: list[str]
) -> dict[str, JsonValue]:
    old, meta = recording.meta.get("calibration"), dict(recording.meta)
    if old:
        meta["calibration_history"] = [*(meta.get("calibration_history") or []), old]
    for key in ("calibration", "skew_corrected"):
        meta.pop(key, None)
    if calibration is not None:
        meta["calibration"] = calibration.plain()
    if shifted:
        meta["skew_corrected"] = shifted
    when = recording.meta.get("created")
    if calibration is not None and isinstance(when, str):
        remarks = [*remarks, *calibration.expired(when)]
    if remarks:
        meta["warnings"] = list(dict.fromkeys([*(meta.get("warnings") or []), *remarks]))
    return meta


def _check(recording: Recording, calibration: Calibration | None, old: Calibration | None) -> None:
    if calibration is None:
        if old is None:
            raise InputError("calibration", None, "is not in the recording, so none can be taken off")
        return
    rig = recording.meta.get("rig")
    if isinstance(rig, str) and rig != calibration.rig:
        raise InputError("rig", calibration.rig, f"the recording is of {rig}")
    measured = recording.names("measured")
    common = [n for n in calibration.corrections if n in measured]
    if not common:
        known = ", ".join(measured) or "none"
        raise InputError(
            "channels", ", ".join(calibration.corrections) or "none", f"measured in the recording: {known}"
        )
    for name in common:
        if calibration.corrections[name].unit != recording.unit(name):
            unit = calibration.corrections[name].unit
            raise InputError(f"unit of {name}", unit, f"the recording has {recording.unit(name)}")


def _grid(recording: Recording, channel: str) -> tuple[Any, float, float | None, bool, float | None]:
    """Offset of a travel, value at count zero, value per count, whether zero is an end, and the last count."""
    converters, encoder = recording.meta.get("converters"), recording.meta.get("encoder")
    one = converters.get(channel) if isinstance(converters, Mapping) else None
    if one is not None:
        low, high, bits = (_number(one, key, f"converters.{channel}") for key in ("low", "high", "bits"))
        last = 2.0**bits - 1.0
        if not (1.0 <= bits <= 64.0 and low < high):
            raise InputError(
                f"converters.{channel}", None, f"must be a rising range, got {bits:g} bits, {low:g} to {high:g}"
            )
        return 0.0, low, (high - low) / last, low < 0.0, last
    if recording.unit(channel) == "m" and isinstance(encoder, Mapping):
        return _mounted(recording, encoder.get("mounted")), 0.0, _number(encoder, "resolution", "encoder"), False, None
    return 0.0, 0.0, None, False, None


def _mounted(recording: Recording, said: Any) -> Any:
    """The span at which the encoder was zeroed [m], at every sample where it changed."""
    if isinstance(said, int | float) and not isinstance(said, bool):
        return float(said)
    try:
        times, spans = np.array(said, float).reshape(-1, 2).T
    except (TypeError, ValueError):
        allowed = "must be a span [m], or a list of [from time, span]"
        raise InputError("encoder.mounted", str(said), allowed, where="meta of the recording") from None
    return spans[np.clip(np.searchsorted(times, recording.time + 1e-9, side="right") - 1, 0, len(spans) - 1)]


def _number(table: Any, key: str, path: str) -> float:
    value = table.get(key) if isinstance(table, Mapping) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"{path}.{key}", str(value), "must be a number", where="meta of the recording")
    return float(value)


def _shifted(time: np.ndarray, values: np.ndarray, skew: float) -> np.ndarray:
    """Values at a time later by the skew [s]; NaN beyond the ends, in gaps, and next to NaN."""
    if len(time) < 2:
        return np.full(len(time), np.nan)
    at = time + skew
    shifted = np.interp(at, time, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(time, at, side="left"), 1, len(time) - 1)
    period = np.median(np.diff(time))
    gap = (time[after] - time[after - 1] > LONGEST_GAP * period) & (at < time[after])
    return np.where(gap, np.nan, shifted)
