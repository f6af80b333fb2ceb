"""Static points sampled from loops, and eq. 13 through them.

    F = Kg (P' - Pa)(L - Lmin) + Fa                                                                              (eq. 13)
    Kp = Fa/(Lmin - L0),  Pth = Pa + Kp/Kg                                                       (from the rest length)

The "hypothetical static" tension at a length is the mean of the rising and the falling path, so that friction, which has
opposite signs on them, leaves no trace. Multiplied out, eq. 13 is linear in P'L, P', L and 1: one least squares without a
first guess, whose four coefficients give the four numbers. It holds above the threshold pressure: where a law rounds
the threshold over a width, points must lie above its upper end, 1.33 bar for the nylon muscle; two points at 1 bar halve
Pa. Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753, Part I (4).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..recordings import Recording
from .channels import finite, positive
from .paths import paths
from .regression import Interval, linear_fit


class StaticPoint(NamedTuple):
    """A length with the tension and pressure that friction and motion have been averaged out of."""

    length: float  # [m]
    pressure: float  # gauge [Pa]
    tension: float  # [N]


def static_points(
    record: Recording,
    lengths: Sequence[float] | np.ndarray,
    *,
    length: str = "muscle.length",
    tension: str = "muscle.tension",
    pressure: str = "muscle.pressure",
    skip: int = 0,
) -> tuple[StaticPoint, ...]:
    """Points of one quasi-static recording at constant pressure.

    Args:
        record: with the three channels.
        lengths: where to sample [m].
        length: name of the driven channel.
        tension: name of the tension.
        pressure: name of the pressure.
        skip: cycles left out at the beginning.

    Raises:
        InputError: a channel is missing, there is no full cycle, or a length is not reached on both paths.
    """
    at = finite(lengths, "lengths")
    found = {
        name: paths(record, length=length, tension=channel, skip=skip)
        for name, channel in (("pressure", pressure), ("tension", tension))
    }
    rising, falling = found["tension"]
    low, high = max(rising.length[0], falling.length[0]), min(rising.length[-1], falling.length[-1])
    for x in at:
        if not low <= x <= high:
            raise InputError("lengths", float(x), f"allowed is {low:.6g} to {high:.6g} m, which both paths reach")
    mean = {name: 0.5 * (p.rising.at(at) + p.falling.at(at)) for name, p in found.items()}
    return tuple(
        StaticPoint(float(x), float(p), float(f)) for x, p, f in zip(at, mean["pressure"], mean["tension"], strict=True)
    )


class LinearTensionFit(NamedTuple):
    """The four numbers of eq. 13 with 95 % intervals unless asked otherwise [SI]."""

    stiffness_per_pressure: Interval  # Kg [m]
    offset_pressure: Interval  # Pa [Pa]
    shortest_length: Interval  # Lmin [m]
    offset_tension: Interval  # Fa [N]
    rms: float  # of the residual tension [N]
    points: int

    def tension(self, length: np.ndarray | float, pressure: np.ndarray | float) -> np.ndarray:
        """Eq. 13 [N] at lengths [m] and gauge pressures [Pa], of one shape."""
        active = self.stiffness_per_pressure.value * (np.asarray(pressure, float) - self.offset_pressure.value)
        return active * (np.asarray(length, float) - self.shortest_length.value) + self.offset_tension.value

    def passive_stiffness(self, rest_length: float) -> float:
        """Kp that goes with a rest length [N/m]; the rest length in [m]."""
        return self.offset_tension.value / (self.shortest_length.value - positive("rest_length", rest_length, "m"))

    def threshold_pressure(self, rest_length: float) -> float:
        """Pth that goes with a rest length [Pa]; the rest length in [m]."""
        return self.offset_pressure.value + self.passive_stiffness(rest_length) / self.stiffness_per_pressure.value


def fit_linear_tension(points: Sequence[StaticPoint], *, confidence: float = 0.95) -> LinearTensionFit:
    """Eq. 13 through points, by linear least squares of the tension.

    Args:
        points: five or more, of two or more lengths at each of two or more pressures; the paper took ten.
        confidence: of the intervals, to first order.

    Raises:
        InputError: too few points, or points that do not tell the four numbers apart.
    """
    table = np.array(points, float).reshape(-1, 3)
    # About their middle: the products then differ, and the four columns stay independent in float64.
    middle = table.mean(axis=0) if len(table) else np.zeros(3)
    x, p = table[:, 0] - middle[0], table[:, 1] - middle[1]
    matrix = np.stack([p * x, p, x, np.ones_like(x)], axis=1)
    fit = linear_fit(matrix, table[:, 2], what="points of eq. 13", confidence=confidence)
    kg, c_p, c_x, c_1 = fit.values
    if kg == 0.0:
        raise InputError(
            "points of eq. 13", "without stiffness", "needed is a tension that grows with pressure and length"
        )
    lever, rise = c_p / kg, c_x / kg  # length above Lmin, pressure above Pa at the middle
    return LinearTensionFit(
        fit.coefficient(0),
        fit.interval(middle[1] - rise, np.array([rise, 0.0, -1.0, 0.0]) / kg),
        fit.interval(middle[0] - lever, np.array([lever, -1.0, 0.0, 0.0]) / kg),
        fit.interval(c_1 - kg * lever * rise, np.array([lever * rise, -rise, -lever, 1.0])),
        fit.rms,
        len(table),
    )
