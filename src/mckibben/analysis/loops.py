"""Tension-length loops: width, height, area, stiffness, and what they say about friction.

With the turns and paths of `cycles` and `paths`, of one cycle:
    width      length of the falling path less that of the rising one, both at mid-range of the tension [m]
    height     tension of the rising path less that of the falling one, both at mid-range of the length [N]
    area       integral of F dL around the closed cycle, the polygon through its samples (shoelace) [J]
    stiffness  mean of the two paths' least-squares slopes over the middle half of the length range [N/m]
All three are positive where the muscle takes work in, as friction does, and change their sign with the direction of time.
The work of a cycle is what the muscle does, -area: whatever is shown to a person as work has that sign (`nomenclature`).
The mid-range lies halfway between the largest and the smallest sample. A polygon of n samples loses (2 pi/n)^2/6 of the
area of an ellipse: 1 % at 25 samples in a cycle. Half the height is the friction by which C.-P. Chou and B. Hannaford, IEEE
Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753, describe their muscles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import finite, known
from .cycles import Cycle, cycle_frequency, find_cycles
from .paths import Path, paths_of


class Loop(NamedTuple):
    """Shape of one loop, or the mean of several [SI]."""

    width: float  # at mid-range of tension [m]; NaN where a path does not reach it
    height: float  # at mid-range of length [N]
    area: float  # [J]
    stiffness: float  # [N/m]
    length_low: float  # [m]
    length_high: float  # [m]
    tension_low: float  # [N]
    tension_high: float  # [N]
    closure: float  # tension at the end less that at the beginning [N]

    @property
    def work(self) -> float:
        """Work that the muscle does in the cycle, as work loops count it: positive where the muscle gives it [J]."""
        return -self.area

    @property
    def friction(self) -> float:
        """Half the height: the Coulomb friction of a loop that has no other [N]."""
        return 0.5 * self.height

    @property
    def mean_height(self) -> float:
        """Area over the length range [N]: noise averages over the whole cycle."""
        return self.area / (self.length_high - self.length_low)


class LoopRatio(NamedTuple):
    """One loop over another [1]."""

    width: float
    height: float
    area: float
    range: float  # of the lengths


def loops(
    record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0
) -> tuple[Loop, ...]:
    """The loop of every full cycle.

    Args:
        record: with both channels.
        length: name of the driven channel [m].
        tension: name of the other [N].
        skip: cycles left out at the beginning, such as the first after rest, whose history is another.

    Raises:
        InputError: a channel is missing or not finite, or there is no full cycle.
    """
    x, y = known(record, length), known(record, tension)
    return tuple(_loop(x, y, cycle) for cycle in find_cycles(x, skip=skip, what=f"channel {length}"))


def loop(record: Recording, *, length: str = "muscle.length", tension: str = "muscle.tension", skip: int = 0) -> Loop:
    """The mean of the loops of all full cycles; arguments and errors as in `loops`."""
    return mean_loop(loops(record, length=length, tension=tension, skip=skip))


def mean_loop(each: Sequence[Loop]) -> Loop:
    """Mean of every number over loops."""
    if not each:
        raise InputError("loops", "none", "needed is one or more")
    return Loop(*(float(v) for v in np.mean(np.array(each), axis=0)))


def _loop(length: np.ndarray, tension: np.ndarray, cycle: Cycle) -> Loop:
    # The sample at the end repeats the beginning: what closes the polygon is the line to it.
    x, y = length[cycle.start : cycle.end + 1], tension[cycle.start : cycle.end + 1]
    rising, falling = paths_of(length, tension, cycle)
    ends = (float(x.min()), float(x.max()), float(y.min()), float(y.max()))
    middle, halfway = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[2] + ends[3])
    slopes = [_slope(path, middle, 0.25 * (ends[1] - ends[0])) for path in (rising, falling)]
    return Loop(
        falling.length_at(halfway) - rising.length_at(halfway),
        rising.read(middle)[0] - falling.read(middle)[0],
        closed_area(x, y),
        float(np.mean(slopes)),
        *ends,
        float(y[-1] - y[0]),
    )


def _slope(path: Path, middle: float, half: float) -> float:
    near = np.abs(path.length - middle) <= half
    if np.count_nonzero(near) < 3 or not np.ptp(path.length[near]) > 0.0:
        return path.read(middle)[1]
    return float(np.polyfit((path.length[near] - middle) / half, path.tension[near], 1)[0]) / half


def closed_area(length: np.ndarray, tension: np.ndarray) -> float:
    """Integral of F dL around the polygon through all points, closed from the last to the first [J].

    Args:
        length: (n,) [m] in order of time.
        tension: (n,) [N].
    """
    x, y = finite(length, "length"), finite(tension, "tension")
    if x.shape != y.shape:
        raise InputError("length and tension", f"{x.shape} and {y.shape}", "allowed are two of one length")
    # From their means, so that a small loop far from zero keeps its digits.
    x, y = x - x.mean(), y - y.mean()
    return float(0.5 * np.sum((np.roll(x, -1) - x) * (np.roll(y, -1) + y)))


def loop_ratio(part: Loop, whole: Loop) -> LoopRatio:
    """A loop over another: of a smaller range, a lower frequency, or a lubricated muscle."""
    if 0.0 in (whole.width, whole.height, whole.area):
        raise InputError("loop", "without width, height or area", "a ratio needs one that encloses something")
    return LoopRatio(
        part.width / whole.width,
        part.height / whole.height,
        part.area / whole.area,
        (part.length_high - part.length_low) / (whole.length_high - whole.length_low),
    )


class Variation(NamedTuple):
    """How far a channel that should be constant moves within the cycles [its unit]."""

    largest: float  # largest less smallest, the worst cycle
    around_mean: float  # largest distance from the mean of the cycle, the worst cycle
    mean: float  # over all cycles


def variation(
    record: Recording, *, channel: str = "muscle.pressure", drive: str = "muscle.length", skip: int = 0
) -> Variation:
    """Variation of a channel over the full cycles of another; single samples count, so noise adds to it."""
    x, y = known(record, drive), known(record, channel)
    parts = [y[c.start : c.end + 1] for c in find_cycles(x, skip=skip, what=f"channel {drive}")]
    return Variation(
        max(float(np.ptp(p)) for p in parts),
        max(float(np.abs(p - p.mean()).max()) for p in parts),
        float(np.mean([p.mean() for p in parts])),
    )


def peak_velocity(record: Recording, *, length: str = "muscle.length", skip: int = 0) -> float:
    """Largest speed of a sine of the range and frequency of the cycles: pi f (longest - shortest) [m/s].

    For a triangle, whose speed is constant, it is pi/2 times that speed. No derivative is taken of noise.
    """
    x = known(record, length)
    found = find_cycles(x, skip=skip, what=f"channel {length}")
    span = float(np.mean([np.ptp(x[c.start : c.end + 1]) for c in found]))
    return np.pi * cycle_frequency(record.time, x, what=f"channel {length}") * span
