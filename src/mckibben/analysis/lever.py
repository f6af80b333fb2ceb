"""Experiments with biological muscle: contractions and work loops on a muscle lever, and those of stimulated steps.

On a lever, twitch and tetanus are timed, and loops cut at a chosen point. The conventions are those of workloopR (V. B.
Baliga and S. Senthivasan, J. Open Source Softw. 5(50), 2020, doi:10.21105/joss.01856), so that numbers published with it
can be compared:

    contraction   from the first sample with a stimulus to the largest force; a set point of the rise is the first sample
                  above its level, one of the relaxation the last, where the level is a share of the development of force
    cut           a cycle reaches from peak to peak or from trough to trough of the smoothed length, or begins half-way
                  between a trough and the peak after it, at the length "L0" about which the lever moves
    work          - integral of F dL by trapezoids, positive if the muscle delivers it
    power         work over the duration of the cycle; beside it the mean of force times smoothed shortening velocity

Lengths and velocities are smoothed by a Butterworth filter that is applied forwards and backwards, to the positions before
peaks are sought and to the velocity of each cycle. Range: recordings with ten or more samples in a quarter cycle.

In a protocol with stimulation, for every recorded step at constant length in which the excitation is not zero:

    peak                  largest tension less that at the first stimulus
    time to peak          from the first stimulus until the tension first is within 0.1 % of the peak
    half relaxation       from the end of the last excitation until half of the active tension then is left
    mean, ripple          between the last two stimuli: mean active tension, and (largest - smallest)/largest; the ripple is
                          0 of a fused contraction and 1 of twitches that relax completely

For every recorded step in which length cycles with stimulation, the net work of a cycle, the integral of -F dL, and the
power, work over the duration of the cycle, as R. K. Josephson, Journal of Experimental Biology 114(1), 1985,
doi:10.1242/jeb.114.1.493. Range: tension well above the noise of the sensor; nothing is filtered.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..answers import brief
from ..errors import InputError
from ..recordings import Recording
from .channels import find_cycles, known
from .loops import loop, path_work
from .segments import segments, steps_of

CUTS = ("L0", "peak", "trough")
ABOVE = ("rest", "zero")
SMOOTHING = 0.05  # cut-off of the filter over half the sampling frequency [1]
LEAST_RISE = 0.25  # of a cycle, over which the length must rise before a peak and fall after it [1]
LATE = 0.1  # of a cycle, by which the sine of a protocol may end after the recording
STIMULI = {"Stimulus-Twitch": "twitch", "Stimulus-Tetanus": "tetanus", "Stimulus-Train": "work loop"}
_PARAMETERS = {
    "twitch": ("offset", "width"),
    "tetanus": ("offset", "frequency", "width", "duration"),
    "work loop": ("offset", "frequency", "width", "pulses", "cycle_frequency"),
}
_WIDTH = 1e-3  # unit in which the protocol states the width of a pulse [s]


class LeverProtocol(NamedTuple):
    """Protocol of a file of a muscle lever; None what it does not state."""

    kind: str  # twitch, tetanus or work loop
    offset: float  # first stimulus after its line of the protocol [s]
    pulse_width: float  # [s]
    pulse_frequency: float | None  # [1/s]
    pulses: int | None  # of one train
    cycle_frequency: float | None  # of the lever's sine [1/s]
    amplitude: float | None  # of the lever's sine, half its stroke [m]
    cycles: float | None  # of the lever's sine


class TensionShare(NamedTuple):
    """A point on the rise or on the relaxation of a contraction; NaN where its level lies below the force at rest."""

    share: float  # of the development of force [1]
    time: float  # [s]
    force: float  # as recorded [N]


class ContractionTiming(NamedTuple):
    """Timing of a twitch or a tetanus; times on the clock of the recording, forces as recorded."""

    stimulus_time: float  # [s]
    stimulus_force: float  # [N]
    peak_time: float  # [s]
    peak_force: float  # [N]
    above: str  # rest or zero, from which set points count
    rising: tuple[TensionShare, ...]
    relaxing: tuple[TensionShare, ...]

    def __repr__(self) -> str:
        return brief(self)

    @property
    def time_to_peak(self) -> float:
        """Time from the stimulus to the peak [s]."""
        return self.peak_time - self.stimulus_time

    @property
    def developed_force(self) -> float:
        """Peak force above rest or above zero, whichever was chosen [N]."""
        return self.peak_force - (self.stimulus_force if self.above == "rest" else 0.0)


class LeverLoop(NamedTuple):
    """A work loop of a muscle on a lever."""

    cycle: int  # from 1 on
    start: int  # first sample
    end: int  # last sample
    work: float  # net, positive if the muscle delivers it [J]
    duration: float  # [s]
    power: float  # work over duration [W]
    mean_power: float  # mean of force times smoothed shortening velocity [W]


def lever_protocol(record: Recording) -> LeverProtocol:
    """Read the protocol that a file of a muscle lever states.

    Raises:
        InputError: the recording has no such protocol, or a number of it is missing.
    """
    lines = record.meta.get("source", {}).get("protocol", [])
    words = [str(line).split(maxsplit=2) for line in lines]
    stated = next((w for w in words if len(w) > 1 and w[1] in STIMULI), None)
    if stated is None:
        raise InputError("protocol", None, f"must have a line with one of {', '.join(STIMULI)}")
    kind = STIMULI[stated[1]]
    numbers = dict(zip(_PARAMETERS[kind], _numbers(stated, len(_PARAMETERS[kind])), strict=True))
    sine = next((w for w in words if len(w) > 2 and w[1] == "Sine"), None)
    cycle = _numbers(sine, 3) if sine is not None else (None, None, None)
    pulses = numbers.get("pulses")
    if kind == "tetanus":
        pulses = float(np.floor(numbers["frequency"] * numbers["duration"]))
    ratio = float(record.meta.get("source", {}).get("gear_ratio", 1.0))
    return LeverProtocol(
        kind,
        numbers["offset"],
        numbers["width"] * _WIDTH,
        numbers.get("frequency"),
        1 if kind == "twitch" else None if pulses is None else int(pulses),
        cycle[0],
        None if cycle[1] is None else cycle[1] * 1e-3 / ratio,
        cycle[2],
    )


def contraction_timing(
    record: Recording,
    *,
    rising: Sequence[float] = (0.1, 0.9),
    relaxing: Sequence[float] | None = None,
    above: str = "rest",
    force: str = "force",
    stimulus: str = "stimulus",
) -> ContractionTiming:
    """Time the stimulus, the peak, and set points of a twitch or tetanus.

    Args:
        record: one contraction.
        rising: shares of the development of force at which the rise is timed, 0 to 1.
        relaxing: the same for the relaxation; by default 0.9 and 0.5, and none where a protocol says that it is a tetanus.
        above: ``rest``, the force at the stimulus, or ``zero``, from which shares count.
        force: name of the channel with the force.
        stimulus: name of the channel with the stimulus.

    Raises:
        InputError: a channel is missing, there is no stimulus, or the force does not rise after it.

    Examples:
        >>> import numpy as np
        >>> from mckibben.recordings import Channel, Recording
        >>> force = np.array([1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 3.5, 2.0, 1.0])
        >>> stimulus = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        >>> channels = {"force": Channel(force, "N"), "stimulus": Channel(stimulus, "1")}
        >>> timing = contraction_timing(Recording(np.arange(9) * 1e-3, channels))
        >>> timing.peak_force, timing.developed_force
        (5.0, 4.0)
    """
    if above not in ABOVE:
        raise InputError("above", above, known=ABOVE)
    pulls, stimuli = known(record, force), known(record, stimulus)
    if not np.ptp(stimuli) > 0.0:
        raise InputError(f"channel {stimulus}", None, "has no stimulus")
    if relaxing is None:
        protocol = stated_protocol(record)
        relaxing = () if protocol is not None and protocol.kind == "tetanus" else (0.9, 0.5)
    first, peak = int(np.argmax(stimuli)), int(np.argmax(pulls))
    base = float(pulls[first]) if above == "rest" else 0.0
    if not (peak > first and pulls[peak] > pulls[first]):
        raise InputError(f"channel {force}", None, "must have its largest value after the first stimulus")

    def point(share: float, *, last: bool) -> TensionShare:
        if not 0.0 <= share < 1.0:
            raise InputError("set point", share, "must be from 0 % to below 100 % of the development of force")
        level = base + share * (pulls[peak] - base)
        if level < pulls[first]:
            return TensionShare(share, float("nan"), float("nan"))
        beyond = np.flatnonzero(pulls > level)
        at = int(beyond[-1] if last else beyond[0])
        return TensionShare(share, float(record.time[at]), float(pulls[at]))

    return ContractionTiming(
        float(record.time[first]),
        float(pulls[first]),
        float(record.time[peak]),
        float(pulls[peak]),
        above,
        tuple(point(share, last=False) for share in rising),
        tuple(point(share, last=True) for share in relaxing),
    )


def lever_cycles(
    record: Recording,
    *,
    cut: str = "L0",
    frequency: float | None = None,
    length: str = "length",
    smoothing: float = SMOOTHING,
) -> tuple[slice, ...]:
    """Cut a recording of cyclic lengths into whole cycles.

    Args:
        record: with the length.
        cut: ``peak``, ``trough``, or ``L0``: half-way between a trough and the next peak, counted in samples. The first
            cycle cut at L0 begins at the trough before the first peak, and the last ends at the last peak.
        frequency: of the cycles [1/s]; by default that of the protocol.
        length: name of the channel with the length.
        smoothing: cut-off of the filter over half the sampling frequency, 0 to 1.

    Returns:
        Samples of each cycle, in order.

    Raises:
        InputError: there is no such cut, no frequency is stated, or no whole cycle.
    """
    if cut not in CUTS:
        raise InputError("cut", cut, known=CUTS)
    if not 0.0 < smoothing < 1.0:
        raise InputError("smoothing", smoothing, "must be between 0 and 1, in half the sampling frequency")
    per_second = _cycle_frequency(record) if frequency is None else float(frequency)
    if not per_second > 0.0:
        raise InputError("frequency", frequency, "must be greater than 0 Hz")
    rate = _rate(record)
    least = int(LEAST_RISE * rate / per_second) - 1
    if least < 1:
        raise InputError(
            "frequency", per_second, f"must leave several samples in a cycle, which has {rate / per_second:.3g}"
        )
    starts, peaks, ends = _peaks(_smooth(known(record, length), smoothing), least)
    if cut == "peak":
        marks = peaks
    elif cut == "trough":
        marks = np.append(starts, ends[-1:])
    else:
        marks = np.round((starts + peaks) / 2.0).astype(int)
        marks[:1], marks[-1:] = starts[:1], peaks[-1:]
    if len(marks) < 2:
        problem = f"must have two peaks at {per_second:g} Hz or more, got {len(peaks)}"
        problem += "; cut at trough, one peak makes a cycle" if len(peaks) == 1 else ""
        raise InputError(f"channel {length}", None, problem)
    return tuple(slice(int(a), int(b)) for a, b in zip(marks[:-1], marks[1:], strict=True))


def missing_cycles(record: Recording, *, length: str = "length", smoothing: float = SMOOTHING) -> str:
    """Say where the protocol asks for more cycles than the recording has; empty where it does not, or states none.

    A sine of N cycles has N peaks, the first or last of which is at an end if it does not begin at rest: one less is taken
    for all of them, unless the recording ends before they are over.

    Args:
        record: with the length.
        length: name of the channel with the length.
        smoothing: as for `lever_cycles`.
    """
    stated = stated_protocol(record)
    if stated is None or stated.cycles is None or not stated.cycle_frequency:
        return ""
    rate = _rate(record)
    least = max(int(LEAST_RISE * rate / stated.cycle_frequency) - 1, 1)
    count = len(_peaks(_smooth(known(record, length), smoothing), least)[1])
    ends = _sine_begin(record) + stated.cycles / stated.cycle_frequency
    cut_off = ends - float(record.time[-1] - record.time[0]) > LATE / stated.cycle_frequency
    if count >= stated.cycles or (count >= stated.cycles - 1.0 and not cut_off):
        return ""
    why = f": it ends at {record.time[-1]:.4g} s, and they would at {ends:.4g} s" if cut_off else ""
    return f"the protocol asks for {stated.cycles:g} cycles, and the recording has {count} peaks of the length{why}"


def lever_loops(
    record: Recording,
    *,
    cut: str = "L0",
    keep: Sequence[int] | None = None,
    frequency: float | None = None,
    length: str = "length",
    force: str = "force",
    smoothing: float = SMOOTHING,
) -> tuple[LeverLoop, ...]:
    """Compute work and power of the cycles of a muscle on a lever.

    Args:
        record: with length and force.
        cut: as for `lever_cycles`.
        keep: numbers of the cycles, from 1 on; all by default.
        frequency: of the cycles [1/s]; by default that of the protocol.
        length: name of the channel with the length, which grows as the muscle is stretched.
        force: name of the channel with the force.
        smoothing: cut-off of the filters over half the sampling frequency.

    Raises:
        InputError: as `lever_cycles`, or a cycle that is to be kept is not there.
    """
    cycles = lever_cycles(record, cut=cut, frequency=frequency, length=length, smoothing=smoothing)
    numbers = range(1, len(cycles) + 1) if keep is None else keep
    for number in numbers:
        if not 1 <= number <= len(cycles):
            raise InputError("keep", number, f"must be from 1 to {len(cycles)}, the cycles cut at {cut}")
    lengths, pulls, rate, loops = known(record, length), known(record, force), _rate(record), []
    for number in numbers:
        cycle = cycles[number - 1]
        along, pull = lengths[cycle], pulls[cycle]
        work, duration = path_work(along, pull), len(along) / rate
        velocity = -_smooth(np.diff(along) * rate, smoothing)
        mean = float(np.mean(pull[1:] * velocity))  # each velocity belongs to the sample at its end
        loops.append(LeverLoop(number, cycle.start, cycle.stop - 1, work, duration, work / duration, mean))
    return tuple(loops)


def stimulus_phase(
    record: Recording, *, frequency: float | None = None, length: str = "length", stimulus: str = "stimulus"
) -> float:
    """Phase of the first stimulus after the longest length, in cycles from -0.5 to 0.5.

    Raises:
        InputError: a channel is missing, there is no stimulus, or no frequency is stated.
    """
    stimuli = known(record, stimulus)
    if not np.ptp(stimuli) > 0.0:
        raise InputError(f"channel {stimulus}", None, "has no stimulus")
    per_second = _cycle_frequency(record) if frequency is None else float(frequency)
    behind = (int(np.argmax(stimuli)) - int(np.argmax(known(record, length)))) / _rate(record) * per_second
    return float((behind + 0.5) % 1.0 - 0.5)


def _smooth(values: np.ndarray, cutoff: float) -> np.ndarray:
    """Apply a Butterworth filter of order 2 forwards and backwards, from rest at zero, as workloopR does."""
    from scipy.signal import butter, lfilter

    over, under = butter(2, cutoff)
    padded = np.append(values, np.zeros(2 * max(len(over), len(under))))
    forward = lfilter(over, under, padded)
    smooth: np.ndarray = lfilter(over, under, forward[::-1])[::-1][: len(values)]
    return smooth


def _peaks(values: np.ndarray, least: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Troughs before, peaks, and troughs after all peaks with at least so many rises before and falls after.

    As numbers of samples from 1 on, so that a cycle begins with the sample behind its first end.
    """
    signs = np.sign(np.diff(values))
    edges = np.flatnonzero(np.diff(signs)) + 1
    begins, stops = np.append(0, edges), np.append(edges, len(signs))
    runs = [(int(signs[a]), int(a), int(b)) for a, b in zip(begins, stops, strict=True)]
    kept = [
        (up[1], up[2], down[2])
        for up, down in zip(runs[:-1], runs[1:], strict=True)
        if up[0] > 0 and down[0] < 0 and up[2] - up[1] >= least and down[2] - down[1] >= least
    ]
    starts, peaks, ends = 1 + np.array(kept, int).reshape(-1, 3).T
    return starts, peaks, ends


def _cycle_frequency(record: Recording) -> float:
    stated = lever_protocol(record).cycle_frequency
    if stated is None:
        problem = "must be given: the protocol states no sine of the length"
        raise InputError("frequency", None, problem, remedy="frequency")
    return stated


def partial_cycles(loops: Sequence[LeverLoop]) -> tuple[int, ...]:
    """Numbers of the cycles that last longer or shorter than the median one by more than `LATE` of it.

    Of cycles cut at L0 the first and the last may be such. Of two cycles or less nothing is said.
    """
    usual = float(np.median([one.duration for one in loops]))
    return tuple(one.cycle for one in loops if len(loops) > 2 and abs(one.duration - usual) > LATE * usual)


def _sine_begin(record: Recording) -> float:
    """Time at which the protocol begins the sine of the length: each of its lines waits for some time first [s]."""
    begin = 0.0
    for line in record.meta["source"]["protocol"]:
        words = str(line).split(maxsplit=2)
        try:
            begin += float(words[0])
        except (ValueError, IndexError):
            continue
        if words[1:2] == ["Sine"]:
            break
    return begin


def _rate(record: Recording) -> float:
    if len(record.time) < 2:
        raise InputError("recording", None, "must have two samples or more")
    return float((len(record.time) - 1) / (record.time[-1] - record.time[0]))


def _numbers(words: Sequence[str], count: int) -> tuple[float, ...]:
    """Numbers behind the last word of a line of the protocol, which names the port."""
    text = words[2] if len(words) > 2 else ""
    digits = text.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz -")
    try:
        values = tuple(float(word) for word in digits.replace(" ", "").split(","))
    except ValueError:
        values = ()
    if len(values) != count:
        raise InputError("protocol", " ".join(words), f"must state {count} numbers, separated by commas")
    return values


def stated_protocol(record: Recording) -> LeverProtocol | None:
    """The protocol that a recording states; None if it states none, or not whole."""
    try:
        return lever_protocol(record)
    except InputError:
        return None


CONSTANT = 1e-3  # share of the mean length within which it counts as constant [1]
LEAST = 1e-6  # excitation that counts as a stimulus [1]
NEAR = 1e-3  # share of the peak within which it counts as reached [1]
FUSED = 0.2  # of an excitation without gaps, over which mean and ripple are taken [1]


class StimulatedContraction(NamedTuple):
    """A contraction; NaN where the recording does not show it."""

    label: str
    case: Mapping[str, str]  # values of the parameters, as text
    stimulus: float  # first stimulus [s]
    rest: float  # tension then [N]
    peak: float  # [N]
    time_to_peak: float  # [s]
    half_relaxation_time: float  # [s]
    mean: float  # NaN of a single stimulus [N]
    ripple: float  # NaN of a single stimulus [1]

    def __repr__(self) -> str:
        return brief(self)


class StimulatedLoop(NamedTuple):
    """The mean work loop of a stimulated muscle."""

    label: str
    case: Mapping[str, str]  # values of the parameters, as text
    cycles: int
    work: float  # net, of one cycle, positive if the muscle delivers it [J]
    power: float  # mean over the cycle [W]

    def __repr__(self) -> str:
        return brief(self)


def stimulated_loops(
    record: Recording, *, tension: str = "tension", length: str = "span", excitation: str = "excitation"
) -> tuple[StimulatedLoop, ...]:
    """The mean work loop of every recorded step whose length goes through full cycles.

    Arguments as in `stimulated_contractions`.

    Raises:
        InputError: a channel is missing or not finite, or there is no such step.
    """
    for name in (tension, length, excitation):
        known(record, name)
    each = []
    for part in segments(record):
        if np.ptp(part[length]) <= CONSTANT * part[length].mean():
            continue
        cycles = find_cycles(part[length], subject=f"channel {length}")
        work = loop(part, length=length, tension=tension).work
        lasted = float(np.mean([part.time[c.end] - part.time[c.start] for c in cycles]))
        step = steps_of(part)[0]
        each.append(StimulatedLoop(str(step["label"]), dict(step["case"]), len(cycles), work, work / lasted))
    if not each:
        raise InputError(f"channel {length}", None, "has no cycle in a recorded step")
    return tuple(each)


def stimulated_contractions(
    record: Recording, *, tension: str = "tension", length: str = "span", excitation: str = "excitation"
) -> tuple[StimulatedContraction, ...]:
    """The contraction in every recorded step with stimulation at constant length.

    Args:
        record: with the channels.
        tension: name of the channel with the tension [N].
        length: name of the channel with the length [m].
        excitation: name of the channel with the excitation [1].

    Raises:
        InputError: a channel is missing or not finite, or there is no such step.
    """
    for name in (tension, length, excitation):
        known(record, name)
    each = [
        _contraction(part, tension, excitation)
        for part in segments(record)
        if part[excitation].max() > LEAST and np.ptp(part[length]) <= CONSTANT * part[length].mean()
    ]
    if not each:
        raise InputError(f"channel {excitation}", None, "has no stimulus in a recorded step at constant length")
    return tuple(each)


def _contraction(part: Recording, tension: str, excitation: str) -> StimulatedContraction:
    step = steps_of(part)[0]
    time, excited = part.time, part[excitation] > LEAST
    first, last = int(np.argmax(excited)), len(excited) - 1 - int(np.argmax(excited[::-1]))
    rest = float(part[tension][first])
    active = part[tension] - rest
    peak = float(active.max())
    reached = int(np.argmax(active >= (1.0 - NEAR) * peak))
    # the excitation of a sample lasts to the next one
    end = min(last + 1, len(time) - 1)
    relaxed = np.flatnonzero(active[end:] <= 0.5 * active[end])
    half = float("nan")
    if relaxed.size and relaxed[0] > 0:
        after = end + int(relaxed[0])
        low, high = active[after], active[after - 1]
        share = (high - 0.5 * active[end]) / (high - low)
        half = float(time[after - 1] + share * (time[after] - time[after - 1]) - time[end])
    mean, ripple = _steady(active, excited, first, end)
    return StimulatedContraction(
        str(step["label"]),
        dict(step["case"]),
        float(time[first]),
        rest,
        peak,
        float(time[reached] - time[first]),
        half,
        mean,
        ripple,
    )


def _steady(active: np.ndarray, excited: np.ndarray, first: int, end: int) -> tuple[float, float]:
    """Mean and ripple of the active tension between the last two stimuli; NaN if there was only one."""
    onsets = first + np.flatnonzero(np.diff(excited[first:end].astype(int)) > 0) + 1
    if onsets.size:
        begins = [first, *onsets]
        part = active[begins[-2] : begins[-1]]
    elif excited[first:end].all() and end - first > 1 and active[end] < 1.02 * active[end - max((end - first) // 4, 1)]:
        part = active[end - max(int(FUSED * (end - first)), 1) : end]
    else:
        return float("nan"), float("nan")
    return float(part.mean()), float(np.ptp(part) / part.max())
