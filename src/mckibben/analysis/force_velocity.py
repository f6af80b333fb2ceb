"""Tension against shortening velocity: points from recordings, and Hill's hyperbola through them.

    (F + a)(v + b) = (F0 + a) b          vmax = F0 b/a, curvature c = a/F0

The curve is `muscles.biological.hill.velocity_curve`; here its three numbers are found. Range: shortening, v >= 0; points
beyond vmax are compared with zero tension. A McKibben muscle need not follow it: look at the residual beside the
intervals. Source: A. V. Hill, Proceedings of the Royal Society B 126, 1938, doi:10.1098/rspb.1938.0050.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import finite, known, positive, smoothed, uniform_period
from .regression import Interval, linear_fit, t_quantile


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
        window: of the parabola through both [s].

    Raises:
        InputError: a channel is missing, or the length is never passed shortening.
    """
    x, y = known(record, length), known(record, tension)
    period = uniform_period(record)
    smooth = smoothed(x, period=period, window=window)
    passing = np.flatnonzero((smooth[:-1] > at_length) & (smooth[1:] <= at_length))
    if not passing.size:
        raise InputError(
            "at_length", float(at_length), f"not passed shortening; {length} has {x.min():.6g} to {x.max():.6g} m"
        )
    i = int(passing[0])
    part = float((smooth[i] - at_length) / (smooth[i] - smooth[i + 1]))
    velocity = -smoothed(x, period=period, window=window, derivative=1)
    pulls = smoothed(y, period=period, window=window)
    speed, pull, when = (float(v[i] + part * (v[i + 1] - v[i])) for v in (velocity, pulls, record.time))
    return ForceVelocityPoint(speed, pull, when)


class HillFit(NamedTuple):
    """Hill's three numbers and what follows from them, with 95 % intervals unless asked otherwise [SI]."""

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
    from ..muscles.biological.hill import velocity_curve

    relative = -np.asarray(velocity, float) / vmax
    return f0 * np.asarray(velocity_curve(relative, curvature=curvature))


def fit_hill(velocity: np.ndarray, tension: np.ndarray, *, confidence: float = 0.95) -> HillFit:
    """Hill's hyperbola by least squares of the tension.

    It starts from the hyperbola multiplied out, F v = (F0 b) - a v - b F, which is linear, and searches logarithms, so
    that all numbers stay positive. Intervals are to first order in those logarithms: never negative, not symmetric.

    Args:
        velocity: shortening velocities [m/s], (n,), 0 or more.
        tension: [N], (n,).
        confidence: of the intervals.

    Raises:
        InputError: fewer than four points, lengthening, all of one velocity, or no tension.
    """
    from scipy.optimize import least_squares

    v, f = finite(velocity, "velocity"), finite(tension, "tension")
    if v.shape != f.shape:
        raise InputError("velocity and tension", f"{v.size} and {f.size}", "allowed are two of one length")
    if v.size < 4 or np.unique(v).size < 3:
        raise InputError("points", f"{v.size} of {np.unique(v).size} velocities", "needed are 4 or more of 3 or more")
    if v.min() < 0.0:
        raise InputError("velocity", float(v.min()), "allowed is shortening, 0 m/s or more")
    if not f.max() > 0.0:
        raise InputError("tension", float(f.max()), "needed is a pulling muscle, above 0 N")
    # Scaled: every number sought is then near one.
    vs, fs = float(v.max()), float(f.max())
    found = least_squares(
        lambda p: _hill(v / vs, *np.exp(p)) - f / fs,
        _start(v / vs, f / fs),
        bounds=(-14.0, 14.0),
        xtol=1e-14,
        ftol=1e-14,
    )
    f0, vmax, curvature = np.exp(found.x) * (fs, vs, 1.0)
    u, strength, directions = np.linalg.svd(found.jac, full_matrices=False)
    size = np.where(strength > 1e-9 * strength[0], strength, np.nan)
    root = directions.T / size * np.sqrt(2.0 * found.cost / (v.size - 3))
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
        fs * float(np.sqrt(np.mean(found.fun**2))),
        v.size,
    )


def _start(v: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Logarithms of F0, vmax and curvature to begin with, scaled points (n,)."""
    try:
        c, a, b = linear_fit(np.stack([np.ones_like(v), -v, -f], axis=1), f * v, what="points").values
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
