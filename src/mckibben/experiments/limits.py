"""What a rig and a muscle allow, for the check before anything moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InputError

# The tension of a muscle [N] at spans [m] and pressures [Pa], of the same shape: a law, or a table that was measured.
Estimate = Callable[[Any, Any], Any]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """The limits of one rig with one muscle, all inclusive; a rig without a part has no limit for it.

    Pressures are gauge.
    """

    pressure: tuple[float, float]  # of the valve's set-point [Pa]
    pressure_rate: float  # steepest change that the valve can follow [Pa/s]
    burst_pressure: float = float("inf")  # of the muscle [Pa]
    tension: float  # largest that the cell reads [N]
    motor_force: float = float("inf")  # largest pull of the motor [N]
    span: tuple[float, float]  # of the frame and the motor [m]
    speed: float  # of the motor [m/s]
    acceleration: float = float("inf")  # of the motor [m/s^2]
    rounding: float = 5e-3  # time over which the motor may round a corner of its path [s]
    sample_rates: tuple[float, float] = (1.0, 5000.0)  # [1/s]
    resolution: Mapping[str, float] = field(default_factory=dict)  # smallest step of a measured channel [SI]
    has: frozenset[str] = frozenset(
        ("valve", "motor", "person", "pressure sensor", "span sensor", "tension sensor")
    )  # sensors and parts, in the words of `read.NEEDS`


@dataclass(frozen=True)
class TensionTable:
    """Tension by bilinear interpolation; outside the table as at its nearest edge.

    Args:
        spans: rising [m], (n,).
        pressures: rising, gauge [Pa], (m,).
        tensions: [N], (n, m).
    """

    spans: tuple[float, ...]
    pressures: tuple[float, ...]
    tensions: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        shape = (len(self.spans), len(self.pressures))
        for name, values in (("spans", self.spans), ("pressures", self.pressures)):
            if len(values) < 2 or not np.all(np.diff(values) > 0.0):
                raise InputError(name, f"{len(values)} values", "allowed are two or more that rise")
        if len(self.tensions) != shape[0] or any(len(row) != shape[1] for row in self.tensions):
            raise InputError("tensions", "another shape", f"allowed is {shape[0]} rows of {shape[1]}")

    def __call__(self, span: Any, pressure: Any) -> np.ndarray:
        """Tension [N], shape of the arguments."""
        i, u = _place(self.spans, span)
        j, v = _place(self.pressures, pressure)
        table = np.asarray(self.tensions, float)
        low = table[i, j] * (1.0 - v) + table[i, j + 1] * v
        high = table[i + 1, j] * (1.0 - v) + table[i + 1, j + 1] * v
        return low * (1.0 - u) + high * u


def _place(knots: tuple[float, ...], x: Any) -> tuple[np.ndarray, np.ndarray]:
    known = np.asarray(knots, float)
    inside = np.clip(np.asarray(x, float), known[0], known[-1])
    i = np.clip(np.searchsorted(known, inside, side="right") - 1, 0, len(known) - 2)
    return i, (inside - known[i]) / (known[i + 1] - known[i])
