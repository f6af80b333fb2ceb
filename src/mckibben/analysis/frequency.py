"""Frequency response and time lag between two channels.

The response is estimated over a band by Welch's method, at known frequencies by sines, or computed of a model:

    H1 = Sxy/Sxx          coherence = |Sxy|^2/(Sxx Syy)
H1 does not see noise of the output that is independent of the input; noise of the input makes it too small by the
coherence. The phase is that of the output before the input, unwrapped over the excited frequencies. Source: P. D. Welch,
IEEE Trans. Audio and Electroacoustics 15(2), 1967.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..answers import Answer, Caution, Column, Table
from ..assembly.linearise import LinearModel
from ..documents import JsonValue
from ..errors import InputError
from ..recordings import Recording, read_any
from ..recordings.files import naming_file, path_of, select_between
from ..verbs import ChannelName, DataFile, Frequencies, Frequency, Reading, Time, typed, verb
from .channels import choose_channel, cycle_frequency, finite, known, positive, uniform_period
from .loops import TensionLoop, loop

RESPONSES = 16  # rows of a frequency response that a person is shown
_EXCITED = 1e-4  # of the largest input density; below, leakage and rounding answer instead of the system


class FrequencyResponse(NamedTuple):
    """Response at frequencies (k,)."""

    frequency: np.ndarray  # [Hz]
    magnitude: np.ndarray  # [unit of the output per unit of the input]
    phase: np.ndarray  # [rad], unwrapped
    coherence: np.ndarray  # [1], 0 to 1
    segments: int  # averaged, overlapping by three quarters; 0 of a model

    @property
    def complex(self) -> np.ndarray:
        """Magnitude and phase as one complex number (k,)."""
        return self.magnitude * np.exp(1j * self.phase)

    def cutoff(self, reference: float | None = None) -> float:
        """First frequency at which the magnitude has fallen by 3 dB [Hz]; NaN if it has not.

        Args:
            reference: the magnitude it has fallen from; that of the lowest frequency where it is left out.
        """
        level = (self.magnitude[0] if reference is None else reference) / np.sqrt(2.0)
        fallen = np.flatnonzero(self.magnitude < level)
        if not fallen.size or fallen[0] == 0:
            return float("nan")
        i = int(fallen[0])
        # Straight over logarithms: first-order slopes are straight there.
        m, f = np.log(self.magnitude[i - 1 : i + 1]), np.log(self.frequency[i - 1 : i + 1])
        return float(np.exp(f[0] + (np.log(level) - m[0]) / (m[1] - m[0]) * (f[1] - f[0])))


def linear_response(model: LinearModel, source: str, target: str, frequencies: np.ndarray) -> FrequencyResponse:
    """Compute the response of a linear model, from one of its inputs to one of its outputs.

    Args:
        model: from `assembly.linearise`.
        source: name of the input.
        target: name of the output.
        frequencies: in rising order (k,) [Hz].
    """
    gain = model.response(source, target, frequencies)
    return FrequencyResponse(frequencies, np.abs(gain), np.unwrap(np.angle(gain)), np.ones(gain.size), 0)


def frequency_response(
    record: Recording,
    *,
    source: str,
    response: str,
    resolution: float | None = None,
    band: tuple[float, float] | None = None,
) -> FrequencyResponse:
    """Estimate a response from a chirp, noise or many sines: detrended Hann windows that overlap by three quarters.

    Args:
        record: on a uniform clock.
        source: name of the input channel.
        response: name of the output channel.
        resolution: distance of the frequencies [Hz], the inverse of a segment; eight over the duration if left out.
        band: frequencies kept [Hz]; else all at which the input has more than 1e-4 of its largest density.

    Returns:
        A delay t takes about t over the segment off the magnitude: keep segments long against it. A response whose
        resonance is narrower than the resolution is flattened.

    Raises:
        InputError: a channel is missing or constant, the clock is uneven, or there are fewer than two segments.
    """
    from scipy import signal

    x, y = known(record, source), known(record, response)
    period = uniform_period(record)
    for name, values in ((source, x), (response, y)):
        if np.ptp(values) == 0.0:
            raise InputError(f"channel {name}", None, "is constant, so it has no frequency response")
    total = len(x) * period
    wish = 8.0 / total if resolution is None else positive("resolution", resolution, "Hz")
    samples = round(1.0 / (wish * period))
    if samples < 8 or 3 * samples > 2 * len(x):
        ends = f"between {1.5 / total:.4g} and {1.0 / (8.0 * period):.4g} Hz"
        raise InputError("resolution", wish, f"must be {ends}; two segments of 8 samples")
    # At three quarters the squared windows add to a constant: when a chirp passes a frequency then does not matter.
    step = max(samples // 4, 1)
    setting: dict[str, Any] = {"fs": 1.0 / period, "window": "hann", "detrend": "linear"}
    setting |= {"nperseg": samples, "noverlap": samples - step}
    f, cross = signal.csd(x, y, **setting)
    inputs, outputs = (np.asarray(signal.welch(v, **setting)[1]) for v in (x, y))
    low, high = (f[1], f[-1]) if band is None else band
    keep = (
        (f > 0.0) & (f >= low) & (f <= high) & (inputs > _EXCITED * inputs[1:].max() if band is None else inputs > 0.0)
    )
    if not keep.any():
        raise InputError("band", None, f"from {low:g} to {high:g} Hz holds no frequency; they are {f[1]:.4g} Hz apart")
    gain = cross[keep] / inputs[keep]
    scale = inputs[keep] * outputs[keep]
    coherence = np.where(scale > 0.0, np.abs(cross[keep]) ** 2 / np.where(scale > 0.0, scale, 1.0), 0.0)
    segments = 1 + (len(x) - samples) // step
    return FrequencyResponse(f[keep], np.abs(gain), np.unwrap(np.angle(gain)), np.clip(coherence, 0.0, 1.0), segments)


def sine_response(
    record: Recording, frequencies: Sequence[float] | np.ndarray, *, source: str, response: str
) -> FrequencyResponse:
    """Estimate a response at the frequencies of sines, by least squares in both channels with mean and trend.

    Exact for any length of record and any clock once the transient has gone. The coherence is the share of the output's
    motion that all sines together explain, the same at every frequency.

    Args:
        record: any clock, without its transient.
        frequencies: frequencies of the input [Hz], (k,).
        source: name of the input channel.
        response: name of the output channel.

    Raises:
        InputError: frequencies the record cannot tell apart, or at which the input has nothing.
    """
    f = finite(frequencies, "frequencies")
    x, y, time = known(record, source), known(record, response), record.time
    if np.ptp(y) == 0.0:
        raise InputError(f"channel {response}", None, "is constant, so it has no frequency response")
    nyquist = 0.5 / record.period
    if f.min() <= 0.0 or f.max() >= nyquist:
        raise InputError(
            "frequencies", None, f"must be above 0 and below {nyquist:g} Hz, got {f.min():g} to {f.max():g} Hz"
        )
    if 2 * f.size + 2 > len(x):
        raise InputError("frequencies", f.size, f"must be fewer for {len(x)} samples")
    angle = 2.0 * np.pi * np.outer(time - time[0], f)
    base = np.stack([np.ones_like(time), np.linspace(-1.0, 1.0, len(time))], axis=1)
    matrix = np.concatenate([np.cos(angle), np.sin(angle), base], axis=1)
    coefficients, _, rank, strength = np.linalg.lstsq(matrix, np.stack([x, y], axis=1), rcond=None)
    if rank < matrix.shape[1] or strength[-1] < 1e-6 * strength[0]:
        raise InputError("frequencies", None, f"cannot be told apart: there are {f.size} in {record.duration:g} s")
    inputs, outputs = (coefficients[: f.size, i] - 1j * coefficients[f.size : 2 * f.size, i] for i in (0, 1))
    if np.abs(inputs).min() <= 1e-9 * np.abs(inputs).max():
        worst = float(f[np.abs(inputs).argmin()])
        raise InputError("frequencies", worst, f"channel {source} has nothing there")
    moved = float(np.sum((y - base @ np.linalg.lstsq(base, y, rcond=None)[0]) ** 2))
    left = float(np.sum((y - matrix @ coefficients[:, 1]) ** 2))
    explained = 1.0 - left / moved if moved > 0.0 else 0.0
    gain = outputs / inputs
    return FrequencyResponse(f, np.abs(gain), np.unwrap(np.angle(gain)), np.full(f.size, max(explained, 0.0)), 1)


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


@dataclass(frozen=True)
class ChannelResponse(Answer):
    """Frequency response between two channels of a recording: what `channel_response` estimates.

    Attributes:
        file: path of the recording; None where it was no file.
        title: of the recording, else the name of its file.
        source: channel that drives.
        target: channel that answers.
        unit: of the magnitude in words; empty where both channels have the same.
        response: at its frequencies.
        averaged: whether it is a mean over segments, not fitted to sines.
        cautions: about values that can only be slips.
        cutoffs: frequency at which each run has fallen by 3 dB [Hz]; NaN of one that has not.
        guessed: ``source`` and ``target`` where they were not named.
    """

    file: str | None
    title: str
    source: str
    target: str
    unit: str
    response: FrequencyResponse
    averaged: bool
    cautions: tuple[Caution, ...] = ()
    cutoffs: tuple[float, ...] = ()
    guessed: tuple[str, ...] = ()

    def data(self) -> dict[str, Any]:
        """Frequency [Hz], magnitude, phase [rad] and coherence."""
        return {name: getattr(self.response, name) for name in ("frequency", "magnitude", "phase", "coherence")}

    def column_units(self) -> Mapping[str, str]:
        """Units of the columns."""
        return {"frequency": "Hz", "magnitude": self.unit or "1", "phase": "rad"}

    def to_dict(self) -> dict[str, JsonValue]:
        """The response in columns, and the frequency at which it has fallen by 3 dB [Hz]."""
        about = {"file": self.file, "input": self.source, "output": self.target, "unit": self.unit}
        of_runs = {"run_cutoffs": list(self.cutoffs)} if len(self.cutoffs) > 1 else {}
        cutoff = {"cutoff": self.response.cutoff(), **of_runs}
        return {**about, **cutoff, **self.data(), "segments": self.response.segments}

    def tables(self) -> list[Table]:
        """The response at some of its frequencies, evenly over their logarithm."""
        count, columns = len(self.response.frequency), self.data()
        chosen = sorted({round(i) - 1 for i in np.geomspace(1, count, min(count, RESPONSES))})
        rows = [{name: float(column[i]) for name, column in columns.items()} for i in chosen]
        magnitude = f"magnitude{f', {self.unit}' if self.unit else ''}"
        heads = (Column("frequency", unit="Hz"), Column("magnitude", magnitude, "1"))
        angles = (Column("phase", None, "rad", "degrees", ".1f"), Column("coherence", unit="1", places=".3f"))
        return [Table(f"{self.target} over {self.source}", (*heads, *angles), rows)]

    def remarks(self) -> list[str]:
        """How many frequencies there are, and where the response has fallen by 3 dB."""
        cutoff = self.response.cutoff()
        averaged = f", {self.response.segments} segments averaged" if self.averaged else ""
        fallen = f"It falls by 3 dB at {cutoff:.4g} Hz." if np.isfinite(cutoff) else "It does not fall by 3 dB."
        lines = [f"{len(self.response.frequency)} frequencies{averaged}. {fallen}"]
        known_cutoffs = [one for one in self.cutoffs if np.isfinite(one)]
        if len(self.cutoffs) > 1 and known_cutoffs:
            ends = f"{min(known_cutoffs):.4g} to {max(known_cutoffs):.4g} Hz"
            lines.append(f"Medians over {len(self.cutoffs)} runs, which fall by 3 dB at {ends}.")
        words = [f"{{{role}}} names another channel than {getattr(self, role)}" for role in self.guessed]
        return [*lines, *([f"Chosen by name and unit: {'; '.join(words)}."] if words else [])]


@verb
def channel_response(
    recording: DataFile,
    *,
    source: ChannelName | None = None,
    target: ChannelName | None = None,
    resolution: Frequency | None = None,
    sines: Frequencies | None = None,
    start: Time | None = None,
    end: Time | None = None,
    read: Reading | None = None,
) -> ChannelResponse:
    """Estimate the frequency response between two channels.

    Chirps, noise and many sines are averaged over a band by Welch's method. At known frequencies the response is fitted
    by least squares of sines, without their transient. Of several runs of a file magnitude and phase are the medians.

    Args:
        recording: recording of mckibben, or a file of another program of any format.
        source: channel that drives, such as valve.command; by default the only command that changes, else the length.
        target: channel that answers, such as tension; by default the tension.
        resolution: spacing of the frequencies [Hz], such as '0.5 Hz'; by default eight over the duration.
        sines: frequencies of sines in the input [Hz], such as '1 Hz, 2 Hz'.
        start: time from which on samples are used [s], such as '2 s'.
        end: time up to which samples are used [s], such as '5 s'.
        read: how the file of another program is understood, with parameters of `analysis.description.describe_file`.

    Raises:
        InputError: a channel is missing, not clear or constant, the recording cannot tell the frequencies apart, or runs
            have other sample intervals.
    """
    if sines is not None and resolution is not None:
        raise InputError("resolution", None, "is allowed only without {sines}, which states the frequencies")
    if sines is not None and not len(sines):
        raise InputError("sines", typed(sines), "must be one frequency or several, such as '1 Hz, 2 Hz'")
    record = read_any(recording, **(read or {})).recording
    runs = [select_between(run, start, end) for run in record.runs]
    with naming_file(recording):
        commands = [n for n, c in record.channels.items() if c.kind == "command" and np.ptp(c.values) > 0.0]
        usual = commands[0] if len(commands) == 1 else None
        guessed = tuple(role for role, name in (("source", source), ("target", target)) if name is None)
        source = choose_channel(record, "length", usual) if source is None else source
        target = choose_channel(record, "tension", target)
        if sines is None:
            # one spacing for all, a little off so that no clock's rounding decides between two numbers of samples
            spacing = None if len(runs) == 1 else (1.0 - 1e-6) * min(8.0 / (len(run) * run.period) for run in runs)
            spacing = spacing if resolution is None else float(resolution)
            each = [frequency_response(run, source=source, response=target, resolution=spacing) for run in runs]
        else:
            tones = sorted(float(one) for one in sines)
            each = [sine_response(run, tones, source=source, response=target) for run in runs]
        response = each[0] if len(each) == 1 else _median_response(each)
    above, below = (record.channels[name].unit for name in (target, source))
    unit = "" if above == below else above if below == "1" else f"{above} per {below}"
    file = path_of(recording)
    title = str(record.meta.get("title") or Path(file or "").name)
    cutoffs = tuple(one.cutoff() for one in each)
    return ChannelResponse(file, title, source, target, unit, response, sines is None, (), cutoffs, guessed)


def _median_response(each: Sequence[FrequencyResponse]) -> FrequencyResponse:
    """Medians of magnitude, phase and coherence over runs, at the frequencies that all have."""
    each = [one._replace(frequency=np.round(one.frequency, 9)) for one in each]  # clocks of runs differ by rounding
    shared = functools.reduce(np.intersect1d, [one.frequency for one in each])
    if not shared.size:
        raise InputError(
            "runs", None, "must have one sample interval; state the period, or choose one run by its times"
        )
    at = [np.isin(one.frequency, shared) for one in each]

    def median(name: str) -> np.ndarray:
        middle: np.ndarray = np.median([getattr(one, name)[keep] for one, keep in zip(each, at, strict=True)], axis=0)
        return middle

    parts = sum(one.segments for one in each)
    return FrequencyResponse(shared, median("magnitude"), median("phase"), median("coherence"), parts)
