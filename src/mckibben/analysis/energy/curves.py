"""A working cycle over the pressure of the supply: where it is best, and where it gives nothing."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, UnreachableError
from ...quantities import with_unit
from .cycles import CYCLES, Conditions, EnergyCycle, computed
from .volumes import CycleMuscle, Probe

POINTS = 61


class EnergyCurve(NamedTuple):
    """Cycles over the gauge pressure of the supply [Pa]; every entry of ``cycles`` is an array of its shape.

    Not a number where the muscle does not shorten.
    """

    name: str
    pressure: np.ndarray
    cycles: EnergyCycle


def energy_curve(muscle: CycleMuscle, name: str, pressures: Any, conditions: Conditions) -> EnergyCurve:
    """A cycle at many pressures.

    Args:
        muscle: from `cycle_muscle`.
        name: of `CYCLES`.
        pressures: gauge pressures above the threshold and the exchange (n,) [Pa].
        conditions: all else; its own pressure must be allowed and is otherwise not used.
    """
    if name not in CYCLES:
        raise InputError("cycle", name, f"known are {', '.join(CYCLES)}")
    conditions.check(muscle)
    at = np.atleast_1d(np.asarray(pressures, float))
    floor = max(float(muscle.threshold()), conditions.exchange_pressure)
    if not np.all(np.isfinite(at) & (at > floor)):
        raise InputError("pressures", with_unit(float(at.min()), "Pa"), f"allowed is above {with_unit(floor, 'Pa')}")
    found = computed(muscle, name, conditions, at)
    shortens = Probe(muscle).tension(conditions.stretched_length, at) > conditions.friction
    return EnergyCurve(name, at, EnergyCycle(*(np.where(shortens, v, np.nan) for v in found)))


def best_pressure(
    muscle: CycleMuscle, name: str, conditions: Conditions, *, highest: float = 10e5
) -> tuple[float, float]:
    """Gauge pressure of the largest efficiency up to ``highest`` [Pa], and that efficiency [1].

    Raises:
        UnreachableError: if the efficiency still grows at ``highest``.
    """
    low, high = max(float(muscle.threshold()), conditions.exchange_pressure), highest
    at = low + (high - low) * np.linspace(0.0, 1.0, POINTS)[1:]
    for _ in range(5):  # each narrows the range thirtyfold; a maximum is flat, so that its place is known to 1e-8 of it
        share = energy_curve(muscle, name, at, conditions).cycles.efficiency
        if np.all(np.isnan(share)):
            raise UnreachableError(f"up to {with_unit(highest, 'Pa')} the muscle does no work in the cycle '{name}'")
        i = int(np.nanargmax(share))
        if at[i] >= highest:
            raise UnreachableError(f"the efficiency of the cycle '{name}' still grows at {with_unit(highest, 'Pa')}")
        best = float(at[i]), float(share[i])
        at = np.linspace(at[max(i - 1, 0)], at[min(i + 1, len(at) - 1)], len(at))
    return best


def zero_pressure(muscle: CycleMuscle, name: str, conditions: Conditions, *, highest: float = 10e5) -> float:
    """Gauge pressure at which the output passes zero, between the threshold and ``highest`` [Pa].

    Raises:
        UnreachableError: if there is none, as without friction.
    """
    low, high = max(float(muscle.threshold()), conditions.exchange_pressure), highest
    at = low + (high - low) * np.linspace(0.0, 1.0, 4 * POINTS)[1:]
    for _ in range(8):
        output = energy_curve(muscle, name, at, conditions).cycles.output
        rises = np.flatnonzero((output[:-1] < 0.0) & (output[1:] >= 0.0))
        if not rises.size:
            raise UnreachableError(
                f"the output of the cycle '{name}' does not pass zero between {with_unit(low, 'Pa')} and "
                f"{with_unit(highest, 'Pa')}"
            )
        i = int(rises[0])
        at = np.linspace(at[i], at[i + 1], len(at))
    return float(at[len(at) // 2])
