"""Channels that come late: by a dead time, or behind a first-order filter.

A sensor behind a filter of cut-off fc lags a sine of frequency f by atan(f/fc), that is by atan(f/fc)/(2 pi f) in time, and
shows 1/sqrt(1 + (f/fc)^2) of it. A lag t of the tension behind the length narrows a friction loop: at mid-range, passed
at the speed v, it takes 2 v t off the width and, times the stiffness, off the height. So widths are given raw and
corrected.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import known, positive, smoothed, uniform_period
from .cycles import cycle_frequency
from .loops import Loop, loop
from .timing import Lead, time_lead


class FilterEffect(NamedTuple):
    """What a first-order low-pass does to a sine."""

    phase: float  # [rad], negative
    gain: float  # [1]
    lag: float  # [s], the phase as a time


def filter_effect(frequency: float, *, cutoff: float) -> FilterEffect:
    """Phase, gain and lag of a first-order filter at a frequency [Hz]; its cut-off [Hz]."""
    ratio = positive("frequency", frequency, "Hz") / positive("cutoff", cutoff, "Hz")
    phase = -float(np.arctan(ratio))
    return FilterEffect(phase, float(1.0 / np.hypot(1.0, ratio)), -phase / (2.0 * np.pi * frequency))


def advanced(record: Recording, lag: float, *, channels: str | list[str]) -> Recording:
    """The recording with channels moved forward in time: what they showed at t + lag stands at t.

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
        raise InputError("lag", lag, "allowed is a time [s] shorter than the recording, of 4 samples or more")
    room = 1e-6 * record.period
    inside = (time + lag >= time[0] - room) & (time + lag <= time[-1] + room)
    at = np.clip(time[inside] + lag, time[0], time[-1])
    kept = {n: c.with_values(c.values[inside]) for n, c in record.channels.items()}
    for name in names:
        values = CubicSpline(time, known(record, name))(at)
        kept[name] = record.channels[name].with_values(values)
    return Recording(time[inside], kept, record.meta)


def unfiltered(
    record: Recording, *, cutoff: float, channels: str | list[str], window: float | None = None
) -> Recording:
    """The recording with a first-order filter of channels undone: y + dy/dt/(2 pi fc).

    Value and derivative come from a sliding parabola; noise grows by about 1/(2 pi fc period m^1.5), m samples in the
    window, against what a sine of frequency f loses: (pi f window)^2/10 of it.

    Args:
        record: on a uniform clock.
        cutoff: of the filter [Hz].
        channels: their names.
        window: of the parabola [s]; five samples where it is left out.
    """
    period = uniform_period(record)
    width = 5.0 * period if window is None else positive("window", window, "s")
    delay = 1.0 / (2.0 * np.pi * positive("cutoff", cutoff, "Hz"))
    moved = {}
    for name in [channels] if isinstance(channels, str) else channels:
        y = known(record, name)
        value = smoothed(y, period=period, window=width)
        slope = smoothed(y, period=period, window=width, derivative=1)
        moved[name] = record.channels[name].with_values(value + delay * slope)
    return record.with_channels(moved)


def channel_lag(record: Recording, *, late: str, early: str, longest: float = 0.1) -> Lead:
    """By how much a channel comes after another that shows the same [s], by cross-correlation.

    Args:
        record: on a uniform clock.
        late: the channel behind the sensor.
        early: the other.
        longest: lag looked for, either way [s].
    """
    return time_lead(known(record, early), known(record, late), period=uniform_period(record), longest=longest)


class CorrectedLoop(NamedTuple):
    """A loop as recorded, the same with the lag taken out of the tension, and that lag [s]."""

    raw: Loop
    corrected: Loop
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
        cutoff: of a first-order filter before the tension [Hz], or none.
        length: name of the driven channel.
        tension: name of the other.
        skip: cycles left out at the beginning.
    """
    total = float(lag)
    if cutoff is not None:
        drive = known(record, length)
        total += filter_effect(cycle_frequency(record.time, drive, what=f"channel {length}"), cutoff=cutoff).lag
    names = {"length": length, "tension": tension}
    raw = loop(record, **names, skip=skip)
    return CorrectedLoop(raw, loop(advanced(record, total, channels=tension), **names, skip=skip), total)
