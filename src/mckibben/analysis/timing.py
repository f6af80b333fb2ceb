"""How far one record runs ahead of another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError


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
        period: of the clock [s].
        longest: largest lead or lag looked for [s].

    Raises:
        InputError: if the records differ in length, are shorter than the search, hold what is not finite, or one of them is
            constant; and for times that are none.
    """
    a, b = np.asarray(first, float), np.asarray(second, float)
    for name, value, sound in (("period", period, period > 0.0), ("longest", longest, longest >= 0.0)):
        if not (sound and np.isfinite(value)):
            raise InputError(name, value, "allowed is a time [s] above 0")
    reach = round(longest / period)
    if a.shape != b.shape or a.ndim != 1:
        raise InputError("records", f"{a.shape} and {b.shape}", "allowed are two of one length")
    if len(a) < 4 * max(reach, 1):
        raise InputError("records", f"{len(a)} samples", f"needed are {4 * max(reach, 1)} to look {longest:g} s far")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        raise InputError("records", "not finite", "allowed are finite values")
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        raise InputError("records", "constant", "a record that never changes has no time lead")
    shifts = np.arange(-reach, reach + 1)
    match = np.array([_correlation(a, b, int(s)) for s in shifts])
    best = int(match.argmax())
    if 0 < best < len(shifts) - 1:
        left, here, right = match[best - 1 : best + 2]
        bend = left - 2.0 * here + right
        part = 0.0 if bend == 0.0 else 0.5 * (left - right) / bend
        return Lead(float((shifts[best] + part) * period), float(here - 0.25 * (left - right) * part))
    return Lead(float(shifts[best] * period), float(match[best]))


def _correlation(a: np.ndarray, b: np.ndarray, shift: int) -> float:
    """Of a(t) with b(t + shift), over what both cover."""
    u, v = (a[: len(a) - shift], b[shift:]) if shift >= 0 else (a[-shift:], b[:shift])
    u, v = u - u.mean(), v - v.mean()
    size = np.sqrt((u @ u) * (v @ v))
    return float(u @ v / size) if size > 0.0 else -1.0
