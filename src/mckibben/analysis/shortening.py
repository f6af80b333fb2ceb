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
from ..estimation import descend
from ..muscles.biological import velocity_curve
from ..recordings import Recording
from .channels import (
    Interval,
    cycle_frequency,
    find_cycles,
    finite,
    known,
    linear_fit,
    positive,
    smoothed,
    t_quantile,
    uniform_period,
)
from .loops import path_work

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
        frequency: frequency of the cycles [Hz]; from the length where it is left out.
        window: window of the parabola that gives velocities [s]; a fiftieth of a cycle by default.
        skip: cycles left out at the beginning.

    Raises:
        InputError: a channel is missing, the clock is uneven, or there is no full cycle.
    """
    x, y = known(record, length), known(record, tension)
    period = uniform_period(record)
    name = f"channel {length}"
    cycles = find_cycles(x, skip=skip, subject=name)
    rate = (
        cycle_frequency(record.time, x, subject=name) if frequency is None else positive("frequency", frequency, "Hz")
    )
    width = max(_WINDOW / rate, 3.0 * period) if window is None else positive("window", window, "s")
    velocity = -smoothed(x, period=period, window=width, derivative=1)
    power = smoothed(y, period=period, window=width) * velocity
    works, positives, peaks, strokes, speeds = [], [], [], [], []
    for c in cycles:
        longest, shortest = (c.start, c.turn) if c.begins_high else (c.turn, c.end)
        part = slice(longest, shortest + 1)
        works.append(path_work(x[part], y[part]))
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
        cycles=len(cycles),
    )


class TensionError(NamedTuple):
    """Deviation of a controlled tension from its set-point."""

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
    cycles = find_cycles(x, skip=skip, subject=f"channel {length}")
    off = np.concatenate([y[c.start : c.end] for c in cycles]) - goal
    short = [slice(c.start, c.turn) if c.begins_high else slice(c.turn, c.end) for c in cycles]
    shortening = np.concatenate([y[part] for part in short]) - goal
    rms, rms_short = (float(np.sqrt(np.mean(e**2))) for e in (off, shortening))
    return TensionError(rms, rms / goal, rms_short / goal, float(off.min() + goal), float(off.max() + goal))


def power_density(power: float, *, section_area: float, rest_length: float) -> float:
    """Power over section area times rest length [W/m^3]; power [W], area at maximal shortening [m^2], length [m]."""
    if not np.isfinite(power):
        raise InputError("power", power, "must be a finite number [W]")
    return power / (positive("section_area", section_area, "m^2") * positive("rest_length", rest_length, "m"))


class ForceVelocityPoint(NamedTuple):
    """State of a muscle while it passes a length shortening."""

    velocity: float  # shortening velocity [m/s], positive
    tension: float  # [N]
    time: float  # [s]


def force_velocity_point(
    record: Recording,
    *,
    at_length: float,
    length: str = "muscle.length",
    tension: str = "muscle.tension",
    window: float = 0.01,
) -> ForceVelocityPoint:
    """Velocity and tension where the length is first passed shortening: a release, an isotonic or an isokinetic run.

    Args:
        record: on a uniform clock.
        at_length: where [m].
        length: name of the length.
        tension: name of the tension.
        window: window of the parabola through both [s].

    Raises:
        InputError: a channel is missing, or the length is never passed shortening.
    """
    x, y = known(record, length), known(record, tension)
    period = uniform_period(record)
    smooth = smoothed(x, period=period, window=window)
    passing = np.flatnonzero((smooth[:-1] > at_length) & (smooth[1:] <= at_length))
    if not passing.size:
        problem = f"must be passed in shortening; {length} has {x.min():.6g} to {x.max():.6g} m"
        raise InputError("at_length", float(at_length), problem)
    i = int(passing[0])
    part = float((smooth[i] - at_length) / (smooth[i] - smooth[i + 1]))
    velocity = -smoothed(x, period=period, window=window, derivative=1)
    pulls = smoothed(y, period=period, window=window)
    speed, pull, when = (float(v[i] + part * (v[i + 1] - v[i])) for v in (velocity, pulls, record.time))
    return ForceVelocityPoint(speed, pull, when)


class HillFit(NamedTuple):
    """Hill's three numbers and derived ones, with 95 % intervals by default [SI]."""

    isometric_tension: Interval  # F0 [N]
    a: Interval  # [N]
    b: Interval  # [m/s]
    maximum_velocity: Interval  # F0 b/a [m/s]
    curvature: Interval  # a/F0 [1]
    rms: float  # of the residual tension [N]
    points: int

    def tension(self, velocity: np.ndarray | float) -> np.ndarray:
        """Tension [N] at shortening velocities [m/s], any shape."""
        return _hill(velocity, self.isometric_tension.value, self.maximum_velocity.value, self.curvature.value)


def _hill(velocity: np.ndarray | float, f0: float, vmax: float, curvature: float) -> np.ndarray:
    relative = -np.asarray(velocity, float) / vmax
    return f0 * np.asarray(velocity_curve(relative, curvature=curvature))


def fit_hill(velocity: np.ndarray, tension: np.ndarray, *, confidence: float = 0.95) -> HillFit:
    """Fit Hill's hyperbola by least squares of the tension.

    It starts from the hyperbola multiplied out, F v = (F0 b) - a v - b F, which is linear, and searches logarithms, so
    that all numbers stay positive. Intervals are to first order in those logarithms: never negative, not symmetric.

    Args:
        velocity: shortening velocities [m/s], (n,), 0 or more.
        tension: [N], (n,).
        confidence: confidence of the intervals.

    Raises:
        InputError: fewer than four points, lengthening, all of one velocity, or no tension.
    """
    v, f = finite(velocity, "velocity"), finite(tension, "tension")
    if v.shape != f.shape:
        raise InputError("velocity and tension", None, f"must be two of one length, got {v.size} and {f.size}")
    if v.size < 4 or np.unique(v).size < 3:
        raise InputError(
            "points", None, f"must be 4 or more at 3 velocities or more, got {v.size} at {np.unique(v).size}"
        )
    if v.min() < 0.0:
        raise InputError("velocity", float(v.min()), "must be shortening, 0 m/s or more")
    if not f.max() > 0.0:
        raise InputError("tension", float(f.max()), "must be above 0 N, of a pulling muscle")
    # Scaled: every number sought is then near one.
    vs, fs = float(v.max()), float(f.max())
    solution = descend(
        lambda p: _hill(v / vs, *np.exp(p)) - f / fs,
        _start(v / vs, f / fs),
        bounds=(-14.0, 14.0),
        x_scale=1.0,
        xtol=1e-14,
        ftol=1e-14,
    )
    f0, vmax, curvature = np.exp(solution.x) * (fs, vs, 1.0)
    u, strength, directions = np.linalg.svd(solution.jacobian, full_matrices=False)
    size = np.where(strength > 1e-9 * strength[0], strength, np.nan)
    root = directions.T / size * np.sqrt(2.0 * solution.cost / (v.size - 3))
    covariance = np.nan_to_num(root @ root.T, nan=np.inf)
    quantile = t_quantile(v.size - 3, confidence)

    def interval(value: float, gradient: tuple[int, int, int]) -> Interval:
        g = np.array(gradient, float)
        used = np.ix_(g != 0.0, g != 0.0)
        half = quantile * np.sqrt(max(float(g[g != 0.0] @ covariance[used] @ g[g != 0.0]), 0.0))
        return Interval(float(value), float(value * np.exp(-half)), float(value * np.exp(min(half, 700.0))))

    return HillFit(
        interval(f0, (1, 0, 0)),
        interval(f0 * curvature, (1, 0, 1)),
        interval(vmax * curvature, (0, 1, 1)),
        interval(vmax, (0, 1, 0)),
        interval(curvature, (0, 0, 1)),
        fs * float(np.sqrt(np.mean(solution.residual**2))),
        v.size,
    )


def _start(v: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Logarithms of F0, vmax and curvature to begin with, scaled points (n,)."""
    try:
        c, a, b = linear_fit(np.stack([np.ones_like(v), -v, -f], axis=1), f * v, subject="points").values
    except InputError:
        a = b = c = -1.0
    if min(a, b, c) > 0.0:
        return np.clip(np.log([c / b, c / a, a * b / c]), -10.0, 10.0)
    return np.log([1.0, 1.5, 0.25])


def peak_power(fit: HillFit) -> tuple[float, float]:
    """Largest power of the hyperbola [W] and the shortening velocity at which it is reached [m/s]."""
    # d(F v)/dv = 0 of the hyperbola, solved: u = c (sqrt(1 + 1/c) - 1) over vmax.
    c = positive("curvature", fit.curvature.value, "1")
    velocity = fit.maximum_velocity.value * c * (np.sqrt(1.0 + 1.0 / c) - 1.0)
    return float(fit.tension(velocity) * velocity), float(velocity)
