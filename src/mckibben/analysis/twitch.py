"""Twitch times: how fast a single short activation makes and loses tension.

    contraction time      from the onset (2 % of the peak above rest) to the peak
    half-relaxation time  from the peak until half of it is lost
These are the usual measures of muscle physiology, for instance R. E. Burke and others, Journal of Physiology 234, 1973.
The rest level is the median before the stimulus. The onset lies where a running median of five samples passes its
threshold for the last time before half the peak, as in `steps`; the peak is that of a cubic through all samples around it
above 85 % of it, so that noise does not choose the sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import held_against_spikes, known

_ONSET = 0.02
_NOISE = 4.0
_NEAR_PEAK = 0.85


class Twitch(NamedTuple):
    """One twitch [SI]."""

    rest: float  # tension before [N]
    peak: float  # tension above rest [N]
    onset: float  # [s]
    peak_time: float  # [s]
    contraction_time: float  # [s]
    half_relaxation_time: float  # [s]
    delay: float  # stimulus to onset [s]
    threshold: float  # of the onset over the peak [1]


def twitch(record: Recording, *, stimulus: float, tension: str = "muscle.tension", median: int = 5) -> Twitch:
    """The twitch after a stimulus; later ones must be cut off with `Recording.select`.

    Args:
        record: with the channel, from before the stimulus until half the tension is lost.
        stimulus: when [s].
        tension: name of the channel.
        median: samples of the running median against spikes, odd; 1 for none.

    Raises:
        InputError: the channel is missing, there is no rest before, no twitch above the noise, or it does not relax.
    """
    time, y = record.time, known(record, tension)
    before = time < stimulus
    if np.count_nonzero(before) < 3 or before.all():
        raise InputError("stimulus", float(stimulus), "needed are 3 samples or more before it, and some after it")
    rest, noise = float(np.median(y[before])), float(np.std(y[before]))
    clean = held_against_spikes(y, median)[~before] - rest
    t, raw = time[~before], y[~before] - rest
    top = int(clean.argmax())
    if not clean[top] > 3.0 * _NOISE * noise:
        raise InputError(
            f"channel {tension}", f"{clean[top]:.3g} N at most", "needed is a twitch of 12 times its noise"
        )
    peak_time, peak = _peak(t, raw, clean, top)
    threshold = max(_ONSET, _NOISE * noise / peak)
    share = clean / peak
    half_up = int(np.argmax(share >= 0.5))
    below = np.flatnonzero(share[: half_up + 1] < threshold)
    lost = np.flatnonzero(share[top:] <= 0.5)
    if not lost.size:
        raise InputError(f"channel {tension}", "not relaxing", "the record must go on until half the peak is lost")
    # A record that begins with the stimulus may already rise in its first sample.
    onset = _passing(t, share, int(below[-1]) + 1, threshold) if below.size else float(t[0])
    relaxed = _passing(t, share, top + int(lost[0]), 0.5)
    return Twitch(
        rest, peak, onset, peak_time, peak_time - onset, relaxed - peak_time, onset - float(stimulus), threshold
    )


def _peak(time: np.ndarray, raw: np.ndarray, clean: np.ndarray, top: int) -> tuple[float, float]:
    """Time [s] and height of the peak by a cubic through the samples around it."""
    low = clean < _NEAR_PEAK * clean[top]
    first = top - int(np.argmax(low[top::-1])) + 1 if low[: top + 1].any() else 0
    last = top + int(np.argmax(low[top:])) if low[top:].any() else len(clean)
    if last - first < 6:
        return float(time[top]), float(clean[top])
    half = 0.5 * (time[last - 1] - time[first])
    x = (time[first:last] - time[first]) / half - 1.0
    cubic = np.polynomial.Polynomial.fit(x, raw[first:last], 3, domain=[-1.0, 1.0])
    grid = np.linspace(-1.0, 1.0, 2001)
    best = int(np.argmax(cubic(grid)))
    return float(time[first] + (grid[best] + 1.0) * half), float(cubic(grid[best]))


def _passing(time: np.ndarray, share: np.ndarray, after: int, level: float) -> float:
    return float(
        time[after - 1]
        + (level - share[after - 1]) / (share[after] - share[after - 1]) * (time[after] - time[after - 1])
    )
