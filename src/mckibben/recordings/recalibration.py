"""Recalibration of recordings: from corrected values back to indicated ones, and to another calibration.

    indicated = low + n q,   n = round((indicated - low)/q)        of the metadata's ``converters``: low, high, bits
    travel = n r                                                   of the metadata's ``encoder``: resolution, mounted

The counts n are recovered from the recorded values, so nothing is lost by rounding, however often it is done. The meta's
``converters`` and ``saturation`` go on to speak of counts and stay as they are. ``encoder`` has the travel per count [m],
and ``mounted``: the span [m] at which it was zeroed, or a list of ``[from time, span]`` where that changed. A channel that
does not lie on its counts, since somebody resampled it, is taken back to rounding, and the metadata's ``warnings`` say so.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..documents import JsonValue
from ..errors import InputError
from .calibration import Calibration, Correction, read_plain
from .recording import Channel, Recording

INDICATED = (
    ".indicated"  # ends the name of a channel that holds what was indicated, beside one that was shifted in time
)
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
        if recording.unit(name) == "m" and not _has_grid(recording, name):
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


def _has_grid(recording: Recording, channel: str) -> bool:
    return channel in (recording.meta.get("converters") or {}) or "encoder" in recording.meta


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
