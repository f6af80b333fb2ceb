"""Steps: dead time, rise and fall of a channel after each step of a command.

For every step of the command, with the level before it and the level at which the channel ends before the next:
    onset       when 2 % of the step is passed for good (the last passing before half the step)
    delay       from the command to the onset
    transition  from the onset until 90 % of the step is reached for the first time: "rise 0-90 %" and, of a falling
                step, "fall 100-10 %"
    settling    from the command until the channel stays within 5 % of the step about its final level
Levels are medians over the last fifth of the time before the step and before the next one. Spikes are kept out by a
running median of five samples, which leaves steady rises as they are; where noise is larger than the threshold allows, the
threshold is four standard deviations of the level before the step, and it is reported. Passings lie between samples
by a straight line. A command that takes several samples to step is timed at half its step, a sudden one at its first
new sample.

The median is the level at which the channel ends only if it has *settled*: over the last fifth a straight line through it
changes by no more than 1 % of the step, or by no more than noise makes it (four standard errors of that change). Of an
exponential approach, that long after the step is 5.2 time constants or more: the level is then within 1 % of the one that
is never passed, and the time to 90 % within 4 %. A ripple of many periods is settled, for the median is its level; a few
slow swings in the last fifth are not, unless they are small. What has not settled says so (`StepResponse.settled`):
its level and its times are of a step still under way.

Thresholds: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753, print 0-90 %
and 100-10 %; onsets are not defined there, 2 % is our choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..estimation import Estimate, uncertainty, widening
from ..recordings import Recording
from .channels import held_against_spikes, known

ONSET = 0.02
REACHED = 0.9
SETTLED = 0.01
SETTLING_BAND = 0.05  # of the step about its final level, within which a channel has settled [1]
LAST = 0.2  # of the time after a step, over which its level is taken [1]
_NOISE = 4.0


class CommandStep(NamedTuple):
    """A step of a command: time, values before and after [unit of the command], and time of the next step [s]."""

    time: float
    before: float
    after: float
    until: float


class StepResponse(NamedTuple):
    """Response of a channel to one step of the command."""

    command_time: float  # [s]
    onset: float  # [s], on the clock of the recording
    delay: float  # onset less command [s]
    transition: float  # onset to 90 % of the step: rise 0-90 % or fall 100-10 % [s]
    before: float  # level [unit of the channel]
    after: float  # level [unit of the channel]
    threshold: float  # of the onset, over the step [1]
    until: float  # when the next step or the end of the record comes [s]
    drift: float  # change over the last fifth before that, over the step [1]
    settled: bool  # whether that is nothing, or noise
    # command until the channel stays within 5 % of the step; NaN if not settled [s]
    settling_time: float = float("nan")

    @property
    def step(self) -> float:
        """Change of the channel [unit of the channel]."""
        return self.after - self.before

    @property
    def rising(self) -> bool:
        """Whether the channel rose."""
        return self.after > self.before


def find_steps(record: Recording, command: str, *, share: float = 0.1) -> tuple[CommandStep, ...]:
    """The steps of a command, in order.

    Args:
        record: with the channel.
        command: name of the channel with the command.
        share: smallest change from one sample to the next that is part of a step, over the range of the command [1].

    Raises:
        InputError: the channel is missing or not finite, or it never steps.
    """
    u, time = known(record, command), record.time
    span = float(np.ptp(u))
    jumps = np.flatnonzero(np.abs(np.diff(u)) > share * span) if span > 0.0 else np.array([], int)
    if not jumps.size:
        raise InputError(f"channel {command}", None, f"has no step: it must change by {100 * share:g} % of its range")
    groups = np.split(jumps, np.flatnonzero(np.diff(jumps) > 1) + 1)
    starts = [g[0] for g in groups] + [len(u) - 1]
    steps = []
    for group, following in zip(groups, starts[1:], strict=True):
        before, after = float(u[group[0]]), float(u[group[-1] + 1])
        if abs(after - before) <= share * span:  # there and back within a few samples: a pulse or noise, no step
            continue
        steps.append(
            CommandStep(_moment(time, u, group, 0.5 * (before + after)), before, after, float(time[following]))
        )
    if not steps:
        raise InputError(f"channel {command}", None, "has no step after which a level is held")
    return tuple(steps)


def _moment(time: np.ndarray, u: np.ndarray, group: np.ndarray, half: float) -> float:
    if len(group) == 1:
        return float(time[group[0] + 1])
    part = slice(group[0], group[-1] + 2)
    side = np.sign(u[part.stop - 1] - u[part.start])
    return float(np.interp(0.0, side * (u[part] - half), time[part]))


def step_responses(
    record: Recording,
    *,
    command: str = "valve.command",
    channel: str = "muscle.tension",
    onset: float = ONSET,
    reached: float = REACHED,
    median: int = 5,
) -> tuple[StepResponse, ...]:
    """The response of a channel to every step of a command.

    Args:
        record: with both channels.
        command: name of the channel that steps.
        channel: name of the channel that follows.
        onset: threshold of the onset over the step [1].
        reached: threshold of the end over the step [1].
        median: samples of the running median against spikes, odd; 1 for none.

    Raises:
        InputError: a channel is missing, there is no step, or the channel does not follow one.
    """
    if not 0.0 < onset < 0.5 < reached < 1.0:
        raise InputError("onset and reached", None, f"must be 0 to 0.5 and 0.5 to 1, got {onset} and {reached}")
    y = known(record, channel)
    clean = held_against_spikes(y, median)
    steps = find_steps(record, command)
    begins = [float(record.time[0])] + [step.time for step in steps[:-1]]
    return tuple(
        _response(record.time, y, clean, begin, step, (onset, reached), f"channel {channel}")
        for begin, step in zip(begins, steps, strict=True)
    )


def _response(
    time: np.ndarray,
    raw: np.ndarray,
    clean: np.ndarray,
    begin: float,
    step: CommandStep,
    shares: tuple[float, float],
    subject: str,
) -> StepResponse:
    quiet = (time >= step.time - LAST * (step.time - begin)) & (time < step.time)
    final = (time > step.until - LAST * (step.until - step.time)) & (time <= step.until)
    if np.count_nonzero(quiet) < 3 or np.count_nonzero(final) < 3:
        raise InputError(subject, None, f"must have 15 samples before and after the step at {step.time:.6g} s")
    before, after = float(np.median(raw[quiet])), float(np.median(raw[final]))
    noise = float(np.std(clean[quiet]))
    size = after - before
    if not abs(size) > 3.0 * _NOISE * noise:
        raise InputError(subject, None, f"must step by 12 times its noise or more at {step.time:.6g} s, got {size:.3g}")
    threshold = max(shares[0], _NOISE * noise / abs(size))
    # From the last sample before the command: a channel that follows at once passes its threshold just after it.
    first = max(int(np.searchsorted(time, step.time, side="left")) - 1, 0)
    last = int(np.searchsorted(time, step.until, side="right"))
    t, share = time[first:last], (clean[first:last] - before) / size
    half = int(np.argmax(share >= 0.5))
    below = np.flatnonzero(share[: half + 1] < threshold)
    done = int(np.argmax(share >= shares[1]))
    if not below.size or not share[done] >= shares[1] or not share[half] >= 0.5:
        raise InputError(
            subject, None, f"does not follow the step at {step.time:.6g} s: its change must begin after it"
        )
    start = _between(t, share, int(below[-1]) + 1, threshold)
    end = _between(t, share, done, shares[1])
    drift, settled = settling(time[final], raw[final], size)
    # noise that reaches further than the band would keep it from ever settling
    outside = np.flatnonzero(np.abs(share - 1.0) > max(SETTLING_BAND, threshold))
    last_out = int(outside[-1]) if outside.size else 0
    rests = settled and last_out + 1 < len(t)
    at = _between(t, np.abs(share - 1.0), last_out + 1, max(SETTLING_BAND, threshold)) if rests else float("nan")
    return StepResponse(
        step.time, start, start - step.time, end - start, before, after, threshold, step.until, drift, settled,
        at - step.time,
    )  # fmt: skip


def settling(time: np.ndarray, values: np.ndarray, step: float) -> tuple[float, bool]:
    """Whether a channel keeps its level over a while.

    Args:
        time: time of the while (n,), three samples or more [s].
        values: values of the channel (n,).
        step: by which it changed before [unit of the channel].

    Returns:
        The change along a straight line through the values over the step [1], and whether that is nothing: no more than
        `SETTLED`, or than four of its own standard errors.
    """
    clock = time - time.mean()
    spread = float(np.sum(clock**2))
    slope = float(np.sum(clock * values)) / spread
    rest = values - values.mean() - slope * clock
    error = np.sqrt(float(np.sum(rest**2)) / max(len(time) - 2, 1) / spread)
    width = float(time[-1] - time[0])
    # rounding of equal values is no change either
    least = max(SETTLED * abs(step), 1e-12 * float(np.abs(values).max()), _NOISE * error * width)
    return slope * width / step, abs(slope * width) <= least


def unsettled(response: StepResponse, channel: str) -> str:
    """A sentence about a channel that has not settled after a step; nothing if it has."""
    if response.settled:
        return ""
    return (
        f"{channel} has not settled {response.until - response.command_time:.3g} s after the step at "
        f"{response.command_time:.4g} s: in the last fifth of that it still changes by {abs(response.drift):.1%} of the "
        "step, so its final value and its times are those of a step under way"
    )


def unsettled_at_end(record: Recording, channels: Sequence[str], since: float) -> list[str]:
    """A sentence for every channel that is still under way where a record ends.

    Args:
        record: with the channels.
        channels: channels of one cause; those that change by less than 1 % of the largest change are left out.
        since: when they were last driven to another value [s].

    Returns:
        The sentences; none if the record holds fewer than 15 samples from then on.
    """
    after = record.time >= since
    late = record.time >= record.time[-1] - LAST * (record.time[-1] - since)
    if np.count_nonzero(after) < 15:
        return []
    moved = {name: float(record[name][-1] - record[name][after][0]) for name in channels}
    most = max((abs(step) for step in moved.values()), default=0.0)
    sentences = []
    for name, step in moved.items():
        if not abs(step) > SETTLED * most:
            continue
        drift, settled = settling(record.time[late], record[name][late], step)
        if not settled:
            sentences.append(
                f"{name} has not settled at the end of the run: in the last fifth of the {record.time[-1] - since:.3g} s "
                f"before it changes by {abs(drift):.1%} of its step; a longer run shows where it ends"
            )
    return sentences


def _between(time: np.ndarray, share: np.ndarray, after: int, level: float) -> float:
    """Time at which the line from the sample before `after` to it passes a level [s]."""
    low, high = share[after - 1], share[after]
    return float(time[after - 1] + (level - low) / (high - low) * (time[after] - time[after - 1]))


def pressure_decay(time: np.ndarray, pressure: np.ndarray) -> Estimate:
    """Share of its pressure that a shut muscle loses per second: a straight line through it over its mean [1/s].

    Args:
        time: (n,) [s].
        pressure: gauge pressure (n,) [Pa].

    Returns:
        The share, none below zero, with its 95 % interval, which is wider where residuals follow one another.
    """
    clock = time - time[0]
    matrix = np.column_stack([np.ones(len(clock)), clock])
    solution = np.linalg.lstsq(matrix, pressure, rcond=None)[0]
    error = matrix @ solution - pressure
    spread = uncertainty(matrix, error, ("pressure", "slope"))
    half = float(spread.quantile * spread.standard_error[1] * widening([error]))
    mean = float(np.mean(pressure))
    value, low, high = (max(float(-(solution[1] + side * half) / mean), 0.0) for side in (0.0, 1.0, -1.0))
    return Estimate(value, low, high, "1/s")


class IsometricTiming(NamedTuple):
    """Delays of one command step along the chain of valve, pressure and tension [s]."""

    valve_delay: float  # command to onset of the pressure
    pressure_to_tension: float  # onset of the pressure to onset of the tension
    total_delay: float  # command to onset of the tension
    transition: float  # of the tension: rise 0-90 % or fall 100-10 %
    rising: bool
    tension_step: float  # [N]
    command_step: float  # [unit of the command]
    settled: bool  # whether pressure and tension were at rest before the next step


def isometric_timing(
    record: Recording,
    *,
    command: str = "valve.command",
    pressure: str = "muscle.pressure",
    tension: str = "muscle.tension",
    median: int = 5,
) -> tuple[IsometricTiming, ...]:
    """Delays and transition of pressure and tension after every step of the command; arguments as in `step_responses`."""
    steps = find_steps(record, command)
    of_pressure = step_responses(record, command=command, channel=pressure, median=median)
    of_tension = step_responses(record, command=command, channel=tension, median=median)
    return tuple(
        IsometricTiming(
            p.delay,
            f.onset - p.onset,
            f.delay,
            f.transition,
            f.rising,
            f.step,
            s.after - s.before,
            p.settled and f.settled,
        )
        for s, p, f in zip(steps, of_pressure, of_tension, strict=True)
    )


_NEAR_PEAK = 0.85


class Twitch(NamedTuple):
    """A twitch [SI]."""

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
        raise InputError("stimulus", float(stimulus), "must have 3 samples or more before it, and some after it")
    rest, noise = float(np.median(y[before])), float(np.std(y[before]))
    clean = held_against_spikes(y, median)[~before] - rest
    t, raw = time[~before], y[~before] - rest
    top = int(clean.argmax())
    if not clean[top] > 3.0 * _NOISE * noise:
        raise InputError(
            f"channel {tension}", None, f"must have a twitch of 12 times its noise, got {clean[top]:.3g} N at most"
        )
    peak_time, peak = _peak(t, raw, clean, top)
    threshold = max(ONSET, _NOISE * noise / peak)
    share = clean / peak
    half_up = int(np.argmax(share >= 0.5))
    below = np.flatnonzero(share[: half_up + 1] < threshold)
    lost = np.flatnonzero(share[top:] <= 0.5)
    if not lost.size:
        raise InputError(f"channel {tension}", None, "must be recorded until half the peak is lost")
    # A record that begins with the stimulus may already rise in its first sample.
    onset = _between(t, share, int(below[-1]) + 1, threshold) if below.size else float(t[0])
    relaxed = _between(t, share, top + int(lost[0]), 0.5)
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
