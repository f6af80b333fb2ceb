"""Distance of a measured loop from a simulated one, path by path, in the quantity's unit and relative to its range."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import ForceMap, Recording
from .loops import TensionPath, paths

POINTS = 101  # of a path at which loops are compared
TRIM = 0.02  # share of the common range left out at either end, where turning mixes the paths


class LoopResiduals(NamedTuple):
    """Simulated less measured values of a loop.

    Attributes:
        at: values of the horizontal channel, rising and then falling path (n,).
        error: simulated less measured (n,), in the unit of the channel.
        rising: whether a value is on the rising path (n,).
        span: range of the measured values.
    """

    at: np.ndarray
    error: np.ndarray
    rising: np.ndarray
    span: float

    @property
    def rms(self) -> float:
        """Root of the mean square."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def relative(self) -> float:
        """`rms` over the range of the measured values [1]."""
        return self.rms / self.span if self.span > 0.0 else float("nan")


def loop_residuals(
    simulated: Recording, measured: Recording | ForceMap, *, across: str = "span", channel: str = "tension"
) -> LoopResiduals:
    """Compare a measured loop with a simulated one where both exist.

    Cycles of a recording are taken together, and the rising path is compared with the rising one. Static points have no
    paths and are compared with the mean of both at their length.

    Args:
        simulated: recording with at least one full cycle.
        measured: recording with at least one full cycle, or a table of static points.
        across: channel that turns, such as the span [m].
        channel: channel that is compared.

    Raises:
        InputError: a channel is missing, there is no full cycle, or the loops have no common range.
    """
    model = paths(simulated, length=across, tension=channel)
    if isinstance(measured, ForceMap):
        low, high = _common(model.rising, model.falling)
        inside = (measured.length >= low) & (measured.length <= high)
        if not inside.any():
            raise InputError("measured", None, "must have points within the range of the simulated loop")
        at, values = measured.length[inside], measured.tension[inside]
        middle = 0.5 * (model.rising.at(at) + model.falling.at(at))
        return LoopResiduals(at, middle - values, np.ones(len(at), bool), float(np.ptp(measured.tension)))
    names = measured_channels(measured, across, channel)
    other = paths(measured, length=names[0], tension=names[1])
    places: list[np.ndarray] = []
    errors: list[np.ndarray] = []
    rising: list[np.ndarray] = []
    for one, two, up in ((model.rising, other.rising, True), (model.falling, other.falling, False)):
        low, high = _common(one, two)
        if not low < high:
            raise InputError("measured", None, "must have a range in common with the simulated loop")
        grid = np.linspace(low + TRIM * (high - low), high - TRIM * (high - low), POINTS)
        places.append(grid)
        errors.append(one.at(grid) - two.at(grid))
        rising.append(np.full(POINTS, up))
    span = float(np.nanmax(measured[names[1]]) - np.nanmin(measured[names[1]]))
    return LoopResiduals(np.concatenate(places), np.concatenate(errors), np.concatenate(rising), span)


def measured_channels(measured: Recording, across: str, channel: str) -> tuple[str, str]:
    """Names of both channels in a measured recording, which may call them otherwise.

    Raises:
        InputError: there is no such channel.
    """
    channels = []
    for name in (across, channel):
        last = name.rpartition(".")[2]
        same = {"span": ("span", "length"), "length": ("length", "span"), "tension": ("tension", "force")}
        candidates = [name, last, *(same.get(last, ()))]
        match = next((c for c in candidates if c in measured), None)
        if match is None:
            raise InputError("measured", name, "the measured data have", known=measured.names())
        channels.append(match)
    return channels[0], channels[1]


def _common(one: TensionPath, two: TensionPath) -> tuple[float, float]:
    return float(max(one.length[0], two.length[0])), float(min(one.length[-1], two.length[-1]))
