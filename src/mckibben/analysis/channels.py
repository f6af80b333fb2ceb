"""What every analysis asks of a recording first: finite channels, a uniform clock, arguments in their range."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError
from ..recordings import Recording

# Clocks of real loops jitter; a local fit over uneven samples would need the times themselves beyond this share.
_JITTER = 1e-2
# Squares and products of sums must stay within float64; no quantity of a laboratory is near it.
_LARGEST = 1e100


def known(record: Recording, name: str) -> np.ndarray:
    """Values of a channel (n,) [its unit], all finite.

    Raises:
        InputError: the recording lacks the channel, or something is not known in it.
    """
    values = record[name]
    return finite(values, f"channel {name}")


def finite(values: Any, what: str) -> np.ndarray:
    """An array (n,) of finite numbers, or `InputError` with the first sample that is none."""
    array = np.asarray(values, float)
    if array.ndim != 1 or not array.size:
        raise InputError(what, f"of shape {array.shape}", "allowed is one dimension with at least one value")
    sound = np.abs(array) <= _LARGEST
    if not sound.all():
        i = int(np.argmin(sound))
        raise InputError(
            f"{what}, sample {i}", float(array[i]), "allowed are finite values; select a part without gaps"
        )
    return array


def uniform_period(record: Recording) -> float:
    """Period of the clock [s], which may jitter by a hundredth of it.

    Raises:
        InputError: the samples are not evenly spaced.
    """
    period = record.period
    steps = np.diff(record.time)
    worst = int(np.argmax(np.abs(steps - period)))
    if abs(steps[worst] - period) > _JITTER * period:
        raise InputError(
            f"interval after sample {worst}", float(steps[worst]), f"allowed is {period:.6g} s; use Recording.uniform()"
        )
    return period


def positive(name: str, value: Any, unit: str, *, zero: bool = False) -> float:
    """A finite number above zero, or at least zero."""
    number = float(value)
    if not np.isfinite(number) or number < 0.0 or (number == 0.0 and not zero):
        raise InputError(name, number, f"allowed is a number [{unit}] {'of 0 or more' if zero else 'above 0'}")
    return number


def held_against_spikes(values: np.ndarray, samples: int) -> np.ndarray:
    """Running median over an odd number of samples (n,): what rises or falls steadily is left as it is.

    The ends are filled with the first and the last value.
    """
    if samples < 1 or samples % 2 == 0:
        raise InputError("samples of the median", samples, "allowed is an odd number, 1 for none")
    if samples == 1:
        return values
    padded = np.pad(values, samples // 2, mode="edge")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, samples), axis=-1)


def window_samples(window: float, period: float, count: int, order: int = 2) -> int:
    """The odd number of samples of a window in time, enough for a polynomial of an order and no more than there are.

    Args:
        window: [s].
        period: of the clock [s].
        count: samples of the record.
        order: of the polynomial.
    """
    wide = 2 * round(0.5 * positive("window", window, "s") / period) + 1
    wide = max(wide, order + 1 + order % 2)
    if wide > count:
        raise InputError("window", window, f"allowed is at most the record, {count * period:.6g} s")
    return wide


def smoothed(values: np.ndarray, *, period: float, window: float, derivative: int = 0) -> np.ndarray:
    """Sliding local parabola (Savitzky and Golay): the value or a derivative (n,) [unit per s^derivative].

    Exact for parabolas; white noise of deviation s leaves about s sqrt(9/(4 m)) in the value and
    s sqrt(12/m^3)/period in the first derivative, m samples in the window.

    Args:
        values: on a uniform clock (n,).
        period: of the clock [s].
        window: width of the parabola [s].
        derivative: 0, 1 or 2.
    """
    from scipy.signal import savgol_filter

    wide = window_samples(window, period, len(values))
    return np.asarray(savgol_filter(values, wide, 2, deriv=derivative, delta=period))
