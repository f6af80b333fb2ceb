"""Gain and zero from readings and a reference, and the skew of channels, with the uncertainty of each.

    I_j = z + s x_j + e_j,   gain = 1/s,   zero = z,   var e_j = (u_r^2 + u_h^2)/m_j + u_q^2 + s^2 u_x^2

A least-squares line of the indicated means I over the true values x, one of each setting j of the reference, with m_j
readings on the way up and down; the errors of the reference enter as effective errors of the reading. u_r: of the mean of a
reading's samples, from the scatter of the means of its blocks, so that noise that follows itself is not taken for
independent; pooled over all readings. u_h: by how much the readings of one setting differ beyond that, hysteresis. u_q: what
averaging over whole counts leaves, see `of_counts`; a quiet signal lies on the same count twice. u_x: of each value of the
reference; a mass that is hung twice has the same error twice. A share that all values of the reference have in common, such
as of gravity, enters the gain only. Where the settings scatter about the line more than all these explain, the variances
grow by chi^2/(n - 2). Degrees of freedom by Welch and Satterthwaite; intervals are Student's (Evaluation of measurement
data: Guide to the expression of uncertainty in measurement, JCGM 100:2008, 4.2, 4.3, 5.2, G.4).

Range: straight sensors; references whose errors are small against the range. The buoyancy of air, 1.5e-4 of steel masses,
is not corrected: state masses by their conventional value less that, or let the scale's uncertainty cover it.

The skew of channels that record the same sine or sweep is the delay of each behind the first:

    y_i(t) = c_i + g_i (A cos phi(t - T_i) + B sin phi(t - T_i)),   phi(t) = 2 pi (f t + k t^2/2),   g_1 = 1,   T_1 = 0

All of f, A, B, c, g, T, and k of a sweep, are fitted at once by least squares, each channel in units of its own amplitude:
the lag is found far below a sample. The uncertainty is that of a fit whose residuals follow one another: the gradients of
`STRETCHES` stretches of the record are taken as independent, not their samples.

Range: a lag below half a period, amplitudes of four counts and more, three periods and more; a sweep begins with the record.
A filter delays slow signals by 1/(2 pi fc) and fast ones by less: the skew is that of the frequency used.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mckibben.errors import InputError
from mckibben.estimation import descend
from mckibben.recordings.calibration import CorrectionTerm

GRAVITY = 9.80665  # standard [m/s^2]
# Of gravity where nobody states it: evenly between equator and poles, 9.780 to 9.832 m/s^2.
GRAVITY_UNCERTAINTY = 0.015
BLOCKS = 16  # into which the samples of a point are divided
EXACT = 1e-12  # of a reading; points without any error at all still have weights
MOST_DEGREES = 1e6  # beyond, Student's t is the normal law
HARMONICS = 12  # of the error of counts over its period, a count


class ReferenceReading(NamedTuple):
    """Samples of a channel at one point [unit of the channel]."""

    mean: float  # mean of all samples
    scatter: float  # standard deviation of the samples
    error: float  # standard uncertainty of the mean, from that of the blocks' means
    degrees: float  # degrees of freedom of that


class Point(NamedTuple):
    """A reading and its true value by the reference [unit of the channel]; readings at one `setting` share its error."""

    setting: float
    true: float
    reading: ReferenceReading


class Reference(NamedTuple):
    """A reference that readings are compared with."""

    name: str = ""  # for the file
    uncertainty: float = 0.0  # standard, of each of its values [their unit]
    scale: float = 0.0  # standard, of all its values alike, as a share [1]
    exact_nothing: bool = False  # whether nothing is nothing, as where no mass hangs


class CalibrationLine(NamedTuple):
    """The line fitted to the points of a calibration, with the uncertainties of its gain and zero."""

    gain: CorrectionTerm  # true over indicated [1]
    zero: CorrectionTerm  # reading at zero [unit]
    correlation: float  # correlation of the two [1]
    residuals: np.ndarray  # residuals of each point, true value by the line less that by the reference [unit]
    hysteresis: float  # largest difference of the residuals at one value of the reference [unit]
    misfit: float  # chi^2 over its degrees of freedom, NaN for two points [1]

    @property
    def linearity(self) -> float:
        """Largest deviation of a point from the line [unit]."""
        return float(np.abs(self.residuals).max())


def reading(samples: np.ndarray) -> ReferenceReading:
    """Mean, scatter and standard uncertainty of samples (n,); n at least 4."""
    values = np.asarray(samples, float)
    if values.ndim != 1 or len(values) < 4 or not np.isfinite(values).all():
        raise InputError("samples", None, f"must be 4 finite ones or more, got {values.size}, some of them not finite")
    blocks = np.array([b.mean() for b in np.array_split(values, min(BLOCKS, len(values)))])
    error = float(blocks.std(ddof=1) / math.sqrt(len(blocks)))
    return ReferenceReading(float(values.mean()), float(values.std(ddof=1)), error, len(blocks) - 1.0)


def of_counts(scatter: float, resolution: float) -> float:
    """Standard uncertainty due to whole counts in the mean of many samples [unit].

    q/sqrt 12 for a signal without noise; noise of half a count and more lets averaging see between the counts. For a true
    value evenly anywhere on a count, sum over k of q^2/(2 pi^2 k^2) exp(-4 pi^2 k^2 s^2/q^2), with the noise s before the
    converter from scatter^2 = s^2 + q^2/12 less that (B. Widrow and I. Kollar, Quantization Noise, Cambridge 2008,
    doi:10.1017/CBO9780511754661).

    Args:
        scatter: standard deviation of the samples [unit], rms over several points where there are.
        resolution: q, one count [unit].
    """
    if not resolution > 0.0:
        return 0.0
    k = np.arange(1, HARMONICS + 1)
    counts = (scatter / resolution) ** 2

    def left(noise: float) -> float:  # in counts^2; without noise the sum has 1/12, which its end must not miss
        if noise == 0.0:
            return 1.0 / 12.0
        return float((np.exp(-4.0 * math.pi**2 * (k * noise) ** 2) / (2.0 * math.pi**2 * k**2)).sum())

    low, high = 0.0, math.sqrt(counts) + 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle**2 + 1.0 / 12.0 - left(middle) < counts else (low, middle)
    return resolution * math.sqrt(left(low if low > 1e-9 else 0.0))


def zero(nothing: ReferenceReading, *, resolution: float, uncertainty: float = 0.0) -> CorrectionTerm:
    """Compute the zero correction from readings at a true value of zero.

    Args:
        nothing: the reading.
        resolution: one count [unit].
        uncertainty: standard, of the nothing itself, such as of a hook [unit].
    """
    variances = (nothing.error**2, of_counts(nothing.scatter, resolution) ** 2 + uncertainty**2)
    return CorrectionTerm(
        nothing.mean, math.sqrt(sum(variances)), _degrees((variances[0], nothing.degrees), total=sum(variances))
    )


def line(
    points: Sequence[Point], *, resolution: float, reference: Reference, subject: str = "points"
) -> CalibrationLine:
    """Fit a line through points, for any sensor.

    Args:
        points: two different settings or more.
        resolution: one count [unit].
        reference: source of the true values [unit].
        subject: what the settings are called in an error message.

    Raises:
        InputError: if no line follows from the points.
    """
    settings = np.array([p.setting for p in points])
    if len(np.unique(settings)) < 2:
        known = f"{len(points)} of one value" if len(points) else None
        raise InputError(subject, known, "must be two different ones or more, for there are a gain and a zero to find")
    x, y = np.array([p.true for p in points]), np.array([p.reading.mean for p in points])
    each, which, times = np.unique(settings, return_inverse=True, return_counts=True)
    xs, ys = (np.bincount(which, v) / times for v in (x, y))
    if not np.ptp(xs) > 0.0:
        raise InputError(subject, None, f"must be at values of the reference that differ, got all at {xs[0]:g}")
    rough = abs(np.ptp(ys) / np.ptp(xs))
    apart = (y - rough * x) - ((ys - rough * xs)[which])
    exact = (each == 0.0) & reference.exact_nothing
    parts = _variances(points, apart, times, resolution, np.where(exact, 0.0, rough * reference.uncertainty))
    a = np.stack([np.ones_like(xs), xs / np.abs(xs).max()], axis=1)
    variance = sum(value for value, _ in parts) + (EXACT * np.abs(ys).max()) ** 2
    h = np.linalg.solve((a / variance[:, None]).T @ a, (a / variance[:, None]).T)
    h[1] /= np.abs(xs).max()
    z, slope = (float(b) for b in h @ ys)
    if not slope > 0.0:
        allowed = f"is a slope of {slope:.3g}: the reading does not rise with the reference: is a wire crossed?"
        raise InputError(subject, None, allowed)
    free = len(xs) - 2
    misfit = float((((ys - z - slope * xs) ** 2) / variance).sum()) / free if free else math.nan
    of = [(h @ np.diag(value) @ h.T, degrees) for value, degrees in parts]
    whole = sum(one for one, _ in of)
    of.append((np.asarray(whole) * max((misfit if free else 1.0) - 1.0, 0.0), float(free)))
    covariance, gain = whole + of[-1][0], 1.0 / slope
    common = (slope * reference.scale) ** 2
    total = covariance[0, 0], covariance[1, 1] + common
    degrees = [_degrees(*((float(one[i, i]), free) for one, free in of), total=total[i]) for i in (0, 1)]
    residuals = (y - z) / slope - x
    together = math.sqrt(total[0] * total[1])
    return CalibrationLine(
        CorrectionTerm(gain, gain**2 * math.sqrt(total[1]), degrees[1]),
        CorrectionTerm(z, math.sqrt(total[0]), degrees[0]),
        float(-covariance[0, 1] / together) if together > 0.0 else 0.0,
        residuals,
        max(float(np.ptp(residuals[settings == setting])) for setting in each),
        misfit,
    )


def _variances(
    points: Sequence[Point], apart: np.ndarray, times: np.ndarray, resolution: float, by_reference: np.ndarray
) -> list[tuple[np.ndarray, float]]:
    """Variances of the settings' means due to reading, hysteresis, and counts and reference, with their degrees."""
    read = float(np.mean([p.reading.error**2 for p in points]))
    scatter = math.sqrt(np.mean([p.reading.scatter**2 for p in points]))
    again = int((times - 1).sum())
    beyond = max(float(apart @ apart) / again - read, 0.0) if again else 0.0
    return [
        (read / times, sum(p.reading.degrees for p in points)),
        (beyond / times, again),
        (of_counts(scatter, resolution) ** 2 + by_reference**2, math.inf),
    ]


def _degrees(*parts: tuple[float, float], total: float) -> float:
    """Effective degrees of freedom by Welch and Satterthwaite: parts are variances with finite degrees of freedom."""
    known = sum(variance**2 / degrees for variance, degrees in parts if degrees > 0.0)
    return math.inf if known <= total**2 / MOST_DEGREES else max(float(total**2 / known), 1.0)


STRETCHES = 24
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
    edges = np.array_split(np.arange(len(model.time)), STRETCHES)
    gradients = np.array([np.einsum("cnp,cn->p", d[:, e], left[:, e]) for e in edges])
    covariance = inverse @ (gradients.T @ gradients) @ inverse * STRETCHES / (STRETCHES - 1.0)
    deviation = np.sqrt(np.diag(covariance)) * scale[free]
    first = 2 + 2 * model.channels
    lags = {n: first + i for i, n in enumerate(names) if i}
    where = {int(j): i for i, j in enumerate(free)}
    terms = {n: CorrectionTerm(float(p[j]), float(deviation[where[j]]), STRETCHES - 1.0) for n, j in lags.items()}
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
