"""Contractions of a stimulated muscle: twitch, tetanus and force-frequency at constant length, and work loops.

For every recorded step at constant length in which the excitation is not zero:

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

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..answers import brief
from ..errors import InputError
from ..recordings import Recording
from .channels import known
from .cycles import find_cycles
from .loops import loop
from .segments import segments, steps_of

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
