"""Skew of channels that record the same sine or sweep: the delay of each behind the first.

    y_i(t) = c_i + g_i (A cos phi(t - T_i) + B sin phi(t - T_i)),   phi(t) = 2 pi (f t + k t^2/2),   g_1 = 1,   T_1 = 0

All of f, A, B, c, g, T, and k of a sweep, are fitted at once by least squares, each channel in units of its own amplitude:
the lag is found far below a sample. The uncertainty is that of a fit whose residuals follow one another: the gradients of
BLOCKS stretches of the record are taken as independent, not their samples.

Range: a lag below half a period, amplitudes of four counts and more, three periods and more; a sweep begins with the record.
A filter delays slow signals by 1/(2 pi fc) and fast ones by less: the skew is that of the frequency used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ...estimation import descend
from ...recordings.calibration import CorrectionTerm

BLOCKS = 24
LEAST_PERIODS = 3.0
LEAST_COUNTS = 4.0
MOST_LEFT = 0.5  # of a channel's rms value that the sine may leave unexplained


class SkewModel(NamedTuple):
    """Model of channels at sample times; its parameters are a flat vector, see `parts`."""

    time: np.ndarray
    channels: int
    sweep: bool

    def parts(self, p: np.ndarray) -> tuple[float, float, float, float, np.ndarray, np.ndarray, np.ndarray]:
        """f, k, A, B, and of each channel c, g and T."""
        n = self.channels
        phases = p[4 : 4 + n], np.append(1.0, p[4 + n : 3 + 2 * n]), np.append(0.0, p[3 + 2 * n : 2 + 3 * n])
        return float(p[0]), float(p[1]), float(p[2]), float(p[3]), *phases

    def both(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Channels (channels, n), and their derivatives by the parameters (channels, n, parameters)."""
        f, k, a, b, c, g, lag = self.parts(p)
        n = self.channels
        t = self.time[None, :] - lag[:, None]
        phase = 2.0 * np.pi * (f * t + 0.5 * k * t * t)
        cos, sin = np.cos(phase), np.sin(phase)
        wave, slope = a * cos + b * sin, b * cos - a * sin
        d = np.zeros((*wave.shape, len(p)))
        d[:, :, 0] = g[:, None] * slope * 2.0 * np.pi * t
        d[:, :, 1] = g[:, None] * slope * np.pi * t * t if self.sweep else 0.0
        d[:, :, 2], d[:, :, 3] = g[:, None] * cos, g[:, None] * sin
        for i in range(n):
            d[i, :, 4 + i] = 1.0
            if i:
                d[i, :, 3 + n + i] = wave[i]
                d[i, :, 2 + 2 * n + i] = -g[i] * slope[i] * 2.0 * np.pi * (f + k * t[i])
        return c[:, None] + g[:, None] * wave, d


def skew(
    time: np.ndarray,
    signals: Mapping[str, np.ndarray],
    *,
    frequency: float,
    to: float | None = None,
    resolution: Mapping[str, float] | None = None,
) -> dict[str, CorrectionTerm]:
    """Compute the delay of each channel behind the first one [s].

    Args:
        time: uniform, from 0 s on, (n,) [s].
        signals: by channel (n,), the first one first [any unit].
        frequency: frequency of the sine, or of the sweep at its beginning, to a period of the record or better [Hz].
        to: of a linear sweep, the frequency at the end of the record [Hz]; None for a sine.
        resolution: one count of each channel, if known [unit of the channel].

    Raises:
        InputError: if a channel does not show it, or the record cannot tell.
    """
    names = list(signals)
    if len(names) < 2:
        raise InputError("channels", ", ".join(names) or None, "must be two or more, for one is compared with another")
    period = (time[-1] - time[0]) / (len(time) - 1)
    highest, length = max(frequency, to or 0.0), len(time) * period
    if not (min(frequency, highest if to is None else to) * length >= LEAST_PERIODS and highest < 0.4 / period):
        allowed = (
            f"must be between {LEAST_PERIODS / length:.4g} Hz and {0.4 / period:.4g} Hz for {length:.4g} s of samples"
        )
        raise InputError("frequency", f"{frequency:g} Hz" + ("" if to is None else f" to {to:g} Hz"), allowed)
    y, least = [], resolution or {}
    for name in names:
        values = np.asarray(signals[name], float)
        spread = float(values.std())
        if not (
            np.isfinite(spread) and spread * math.sqrt(2.0) >= LEAST_COUNTS * least.get(name, 0.0) and spread > 0.0
        ):
            raise InputError(
                f"signal of {name}", None, f"must be 4 counts or more, got an amplitude of {1.4142 * spread:.3g}"
            )
        y.append((values - values.mean()) / spread)
    return _fitted(
        SkewModel(np.asarray(time, float) - time[0], len(names), to is not None), np.array(y), names, frequency, to
    )


def _fitted(
    model: SkewModel, y: np.ndarray, names: list[str], frequency: float, to: float | None
) -> dict[str, CorrectionTerm]:
    rate = 0.0 if to is None else (to - frequency) / model.time[-1]
    start = _start(model, y, frequency, rate)
    # slow and quick parameters of one size
    scale = np.ones(len(start))
    scale[0], scale[1] = 0.1 / model.time[-1], 0.1 / model.time[-1] ** 2
    scale[2 + 2 * model.channels :] = 0.1 / (2.0 * np.pi * frequency)
    free = np.array([i for i in range(len(start)) if model.sweep or i != 1])

    def put(q: np.ndarray) -> np.ndarray:
        p = start.copy()
        p[free] = start[free] + scale[free] * q
        return p

    solution = descend(
        lambda q: (model.both(put(q))[0] - y).ravel(),
        np.zeros(len(free)),
        jacobian=lambda q: (model.both(put(q))[1][:, :, free] * scale[free]).reshape(-1, len(free)),
    )
    p = put(solution.x)
    modelled, d = model.both(p)
    left = y - modelled
    for name, rms in zip(names, np.sqrt((left**2).mean(axis=1)), strict=True):
        if rms > MOST_LEFT:
            wave = f"a sine of {frequency:g} Hz" if to is None else f"a sweep from {frequency:g} Hz to {to:g} Hz"
            raise InputError(f"signal of {name}", None, f"must be {wave}, got {100.0 * rms:.0f} % something else")
    d = d[:, :, free] * scale[free]
    inverse = np.linalg.inv(np.einsum("cnp,cnq->pq", d, d))
    edges = np.array_split(np.arange(len(model.time)), BLOCKS)
    gradients = np.array([np.einsum("cnp,cn->p", d[:, e], left[:, e]) for e in edges])
    covariance = inverse @ (gradients.T @ gradients) @ inverse * BLOCKS / (BLOCKS - 1.0)
    deviation = np.sqrt(np.diag(covariance)) * scale[free]
    first = 2 + 2 * model.channels
    lags = {n: first + i for i, n in enumerate(names) if i}
    where = {int(j): i for i, j in enumerate(free)}
    terms = {n: CorrectionTerm(float(p[j]), float(deviation[where[j]]), BLOCKS - 1.0) for n, j in lags.items()}
    return {names[0]: CorrectionTerm(0.0, 0.0), **terms}


def _start(model: SkewModel, y: np.ndarray, frequency: float, rate: float) -> np.ndarray:
    """Parameters near the solution: the frequency by a search, the amplitudes and lags by projection."""
    t = model.time
    chirp = np.exp(-1j * np.pi * rate * t * t) * np.hanning(len(t))
    tries = frequency + np.linspace(-1.0, 1.0, 41) / t[-1]
    spectrum = np.abs(np.exp(-2j * np.pi * tries[:, None] * t[None, :]) @ (chirp * y[0]))
    f = float(tries[np.argmax(spectrum)])
    amplitude = y @ (np.exp(-2j * np.pi * f * t) * chirp) * 2.0 / np.hanning(len(t)).sum()
    # about the middle of a sweep, where the window looks
    middle = f + rate * 0.5 * t[-1]
    lag = -np.angle(amplitude[1:] / amplitude[0]) / (2.0 * np.pi * middle)
    gain = np.abs(amplitude[1:]) / np.abs(amplitude[0])
    return np.concatenate([[f, rate, amplitude[0].real, -amplitude[0].imag], np.zeros(len(y)), gain, lag])
