"""Time lag between two records."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import known, positive
from .cycles import cycle_frequency
from .loops import TensionLoop, loop


class Lead(NamedTuple):
    """Time by which the first record leads [s], and the correlation there [1]."""

    time: float
    correlation: float


def time_lead(first: np.ndarray, second: np.ndarray, *, period: float, longest: float = 0.1) -> Lead:
    """Time by which `first` leads `second`, by cross-correlation.

    The shift at which the normalised correlation of the overlapping parts is largest, refined by the parabola through its
    neighbours, so that it is not bound to the sample clock. Good to about a hundredth of a sample for records that are
    smooth on that clock.

    Args:
        first: values on a uniform clock, (n,).
        second: the same of the other, (n,).
        period: period of the clock [s].
        longest: largest lead or lag looked for [s].

    Raises:
        InputError: if the records differ in length, are shorter than the search, hold what is not finite, or one of them is
            constant; and for times that are none.
    """
    a, b = np.asarray(first, float), np.asarray(second, float)
    for name, value, sound in (("period", period, period > 0.0), ("longest", longest, longest >= 0.0)):
        if not (sound and np.isfinite(value)):
            raise InputError(name, value, "must be a time [s] above 0")
    reach = round(longest / period)
    if a.shape != b.shape or a.ndim != 1:
        raise InputError("records", None, f"must be two of one length, got {a.shape} and {b.shape}")
    if len(a) < 4 * max(reach, 1):
        raise InputError(
            "records", None, f"must have {4 * max(reach, 1)} samples to look {longest:g} s far, got {len(a)}"
        )
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise InputError("records", None, "must be finite")
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        raise InputError("records", None, "must change: a constant record has no time lead")
    shifts = np.arange(-reach, reach + 1)
    match = np.array([_correlation(a, b, int(s)) for s in shifts])
    best = int(match.argmax())
    if 0 < best < len(shifts) - 1:
        left, middle, right = match[best - 1 : best + 2]
        bend = left - 2.0 * middle + right
        part = 0.0 if bend == 0.0 else 0.5 * (left - right) / bend
        return Lead(float((shifts[best] + part) * period), float(middle - 0.25 * (left - right) * part))
    return Lead(float(shifts[best] * period), float(match[best]))


def _correlation(a: np.ndarray, b: np.ndarray, shift: int) -> float:
    """Correlation of a(t) with b(t + shift), over their common time."""
    u, v = (a[: len(a) - shift], b[shift:]) if shift >= 0 else (a[-shift:], b[:shift])
    u, v = u - u.mean(), v - v.mean()
    size = np.sqrt((u @ u) * (v @ v))
    return float(u @ v / size) if size > 0.0 else -1.0


class FilterEffect(NamedTuple):
    """Gain and delay of a first-order low-pass for a sine."""

    phase: float  # [rad], negative
    gain: float  # [1]
    lag: float  # [s], the phase as a time


def filter_effect(frequency: float, *, cutoff: float) -> FilterEffect:
    """Phase, gain and lag of a first-order filter at a frequency [Hz]; its cut-off [Hz]."""
    ratio = positive("frequency", frequency, "Hz") / positive("cutoff", cutoff, "Hz")
    phase = -float(np.arctan(ratio))
    return FilterEffect(phase, float(1.0 / np.hypot(1.0, ratio)), -phase / (2.0 * np.pi * frequency))


def advanced(record: Recording, lag: float, *, channels: str | list[str]) -> Recording:
    """Return a recording with channels advanced in time: their value at t + lag moves to t.

    Between samples by a cubic spline. What the moved channels do not cover is cut off all channels.

    Args:
        record: any clock.
        lag: by which the channels come late [s]; negative where they run ahead.
        channels: their names.

    Raises:
        InputError: a channel is missing or not finite, or the lag is longer than the recording.
    """
    from scipy.interpolate import CubicSpline

    names = [channels] if isinstance(channels, str) else list(channels)
    time = record.time
    if not (np.isfinite(lag) and len(record) > 3 and abs(lag) < record.duration):
        raise InputError("lag", lag, "must be a time [s] shorter than the recording, of 4 samples or more")
    room = 1e-6 * record.period
    inside = (time + lag >= time[0] - room) & (time + lag <= time[-1] + room)
    at = np.clip(time[inside] + lag, time[0], time[-1])
    kept = {n: c.with_values(c.values[inside]) for n, c in record.channels.items()}
    for name in names:
        values = CubicSpline(time, known(record, name))(at)
        kept[name] = record.channels[name].with_values(values)
    return Recording(time[inside], kept, record.meta)


class CorrectedLoop(NamedTuple):
    """A loop as recorded, the same with the lag taken out of the tension, and that lag [s]."""

    raw: TensionLoop
    corrected: TensionLoop
    lag: float

    @property
    def width_change(self) -> float:
        """Corrected less raw width [m]: what the lag had taken."""
        return self.corrected.width - self.raw.width


def corrected_loop(
    record: Recording,
    *,
    lag: float = 0.0,
    cutoff: float | None = None,
    length: str = "muscle.length",
    tension: str = "muscle.tension",
    skip: int = 0,
) -> CorrectedLoop:
    """The loop raw and with the tension moved forward by a known lag and by that of a filter at the cycles' frequency.

    Args:
        record: with both channels.
        lag: dead time of the tension behind the length [s].
        cutoff: cutoff of a first-order filter before the tension [Hz], or none.
        length: name of the driven channel.
        tension: name of the other.
        skip: cycles left out at the beginning.
    """
    total = float(lag)
    if cutoff is not None:
        drive = known(record, length)
        total += filter_effect(cycle_frequency(record.time, drive, subject=f"channel {length}"), cutoff=cutoff).lag
    names = {"length": length, "tension": tension}
    raw = loop(record, **names, skip=skip)
    return CorrectedLoop(raw, loop(advanced(record, total, channels=tension), **names, skip=skip), total)
