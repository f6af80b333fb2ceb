"""Work and power of shortening, from length and tension.

    work                    integral of -T dL from the longest to the shortest length of a cycle, by trapezoids [J]
    positive_velocity_work  integral of T v dt over the whole cycle wherever it shortens, v = -dL/dt > 0: bounces count [J]
    mean_power              work times twice the frequency, the power while it shortens if that takes half the cycle [W]
    peak_power              largest T v of the cycle [W]
`work` needs no derivative: it does not see noise that is independent from sample to sample. The two numbers that need the
velocity take it, and the tension, from a sliding parabola over `window`; they depend on it, so it is reported. C.-P. Chou
and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753, integrate over "positive shortening
velocity" and print mean powers that are their work times twice the frequency.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import known, positive, smoothed, uniform_period
from .cycles import cycle_frequency, find_cycles

_WINDOW = 0.02  # of a cycle


class ShorteningPower(NamedTuple):
    """Means over the full cycles, and the largest of the peaks [SI]."""

    work: float  # [J]
    positive_velocity_work: float  # [J]
    frequency: float  # [Hz]
    mean_power: float  # [W]
    peak_power: float  # mean over cycles of the largest power [W]
    largest_power: float  # of all cycles [W]
    stroke: float  # longest less shortest [m]
    peak_velocity: float  # mean over cycles of the largest shortening velocity [m/s]
    mean_tension: float  # over the shortening, by length: work over stroke [N]
    window: float  # of the velocity [s]
    cycles: int


def shortening_power(
    record: Recording,
    *,
    length: str = "muscle.length",
    tension: str = "muscle.tension",
    frequency: float | None = None,
    window: float | None = None,
    skip: int = 0,
) -> ShorteningPower:
    """Work and power of the full cycles.

    Args:
        record: on a uniform clock, with both channels.
        length: name of the length, or of the span where the muscle hangs in series with a tendon [m].
        tension: name of the tension [N].
        frequency: of the cycles [Hz]; from the length where it is left out.
        window: of the parabola that gives velocities [s]; a fiftieth of a cycle where it is left out.
        skip: cycles left out at the beginning.

    Raises:
        InputError: a channel is missing, the clock is uneven, or there is no full cycle.
    """
    x, y = known(record, length), known(record, tension)
    period = uniform_period(record)
    what = f"channel {length}"
    found = find_cycles(x, skip=skip, what=what)
    rate = cycle_frequency(record.time, x, what=what) if frequency is None else positive("frequency", frequency, "Hz")
    width = max(_WINDOW / rate, 3.0 * period) if window is None else positive("window", window, "s")
    velocity = -smoothed(x, period=period, window=width, derivative=1)
    power = smoothed(y, period=period, window=width) * velocity
    works, positives, peaks, strokes, speeds = [], [], [], [], []
    for c in found:
        longest, shortest = (c.start, c.turn) if c.begins_high else (c.turn, c.end)
        part = slice(longest, shortest + 1)
        works.append(work_between(x[part], y[part]))
        whole = power[c.start : c.end + 1]
        positives.append(float(np.trapezoid(np.where(whole > 0.0, whole, 0.0), dx=period)))
        peaks.append(float(whole.max()))
        strokes.append(float(x[longest] - x[shortest]))
        speeds.append(float(velocity[c.start : c.end + 1].max()))
    work, stroke = float(np.mean(works)), float(np.mean(strokes))
    return ShorteningPower(
        work=work,
        positive_velocity_work=float(np.mean(positives)),
        frequency=rate,
        mean_power=2.0 * rate * work,
        peak_power=float(np.mean(peaks)),
        largest_power=max(peaks),
        stroke=stroke,
        peak_velocity=float(np.mean(speeds)),
        mean_tension=work / stroke,
        window=width,
        cycles=len(found),
    )


def work_between(length: np.ndarray, tension: np.ndarray) -> float:
    """Integral of -T dL along a path [J], positive where a pulling muscle shortens; lengths [m] and tensions [N], (n,)."""
    return float(-np.trapezoid(tension, length))


class TensionError(NamedTuple):
    """How far a controlled tension was off its set-point."""

    rms: float  # over the full cycles [N]
    relative_rms: float  # over the set-point [1]
    relative_rms_shortening: float  # the same while shortening only [1]
    lowest: float  # [N]
    highest: float  # [N]


def tension_error(
    record: Recording,
    *,
    set_point: float,
    length: str = "muscle.length",
    tension: str = "muscle.tension",
    skip: int = 0,
) -> TensionError:
    """Error of a tension that should be constant, over the full cycles of the length; the set-point in [N]."""
    goal = positive("set_point", set_point, "N")
    x, y = known(record, length), known(record, tension)
    found = find_cycles(x, skip=skip, what=f"channel {length}")
    off = np.concatenate([y[c.start : c.end] for c in found]) - goal
    short = [slice(c.start, c.turn) if c.begins_high else slice(c.turn, c.end) for c in found]
    shortening = np.concatenate([y[part] for part in short]) - goal
    rms, rms_short = (float(np.sqrt(np.mean(e**2))) for e in (off, shortening))
    return TensionError(rms, rms / goal, rms_short / goal, float(off.min() + goal), float(off.max() + goal))


def power_density(power: float, *, section_area: float, rest_length: float) -> float:
    """Power over section area times rest length [W/m^3]; power [W], area at maximal shortening [m^2], length [m]."""
    if not np.isfinite(power):
        raise InputError("power", power, "allowed is a finite number [W]")
    return power / (positive("section_area", section_area, "m^2") * positive("rest_length", rest_length, "m"))
