"""Working cycles over the supply's pressure, and as closed paths of piston and tendon (Figs. 12 and 13)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...answers import brief
from ...errors import InputError, UnreachableError
from ...quantities import with_unit
from .cycles import CYCLES, Conditions, EnergyCycle, computed, energy_cycle, isotonic_pressure
from .muscle import CycleMuscle, Probe

POINTS = 61
LEG_POINTS = 257  # of each curved leg of a path


class EnergyCurve(NamedTuple):
    """Cycles over the gauge pressure of the supply [Pa]; every entry of ``cycles`` is an array of its shape.

    Not a number where the muscle does not shorten.
    """

    name: str
    pressure: np.ndarray
    cycles: EnergyCycle


def energy_curve(
    muscle: CycleMuscle, name: str, pressures: Sequence[float] | np.ndarray, conditions: Conditions
) -> EnergyCurve:
    """A cycle at many pressures.

    Args:
        muscle: from `cycle_muscle`.
        name: name of `CYCLES`.
        pressures: gauge pressures above the threshold and the exchange (n,) [Pa].
        conditions: all else; its own pressure must be allowed and is otherwise not used.
    """
    if name not in CYCLES:
        raise InputError("cycle", name, known=CYCLES)
    conditions.check(muscle)
    at = np.atleast_1d(np.asarray(pressures, float))
    floor = max(float(muscle.threshold()), conditions.exchange_pressure)
    if not np.all(np.isfinite(at) & (at > floor)):
        raise InputError("pressures", with_unit(float(at.min()), "Pa"), f"must be above {with_unit(floor, 'Pa')}")
    cycles = computed(muscle, name, conditions, at)
    shortens = Probe(muscle).tension(conditions.stretched_length, at) > conditions.friction
    return EnergyCurve(name, at, EnergyCycle(*(np.where(shortens, v, np.nan) for v in cycles)))


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


CORNERS = {"maximal": ("A", "B", "C", "D"), "isotonic": ("E", "F", "G", "H"), "valve": ("E", "F", "G", "H")}


class CyclePath(NamedTuple):
    """A closed path; its last point is its first.

    Attributes:
        x: volume [m^3] or length [m], shape (n,).
        y: absolute pressure [Pa] or tension [N], shape (n,).
        corners: index of each named corner.
    """

    x: np.ndarray
    y: np.ndarray
    corners: dict[str, int]

    def __repr__(self) -> str:
        return brief(self)

    def area(self) -> float:
        """Work done along it, the integral of y dx by the trapezoid rule [J]."""
        return float(np.sum(0.5 * (self.y[1:] + self.y[:-1]) * np.diff(self.x)))


class CycleLoops(NamedTuple):
    """A cycle as two paths, both in the order of time.

    Attributes:
        name: name of the cycle.
        cycle: numbers of the cycle.
        conditions: that it was run between.
        piston: absolute pressure over the volume of the piston plus that of the stretched muscle.
        tendon: tension over length.
    """

    name: str
    cycle: EnergyCycle
    conditions: Conditions
    piston: CyclePath
    tendon: CyclePath

    def __repr__(self) -> str:
        return brief(self)


def cycle_loops(muscle: CycleMuscle, name: str, conditions: Conditions, *, points: int = LEG_POINTS) -> CycleLoops:
    """The paths of a cycle.

    The area of the piston's is the negative of the input, that of the tendon's the negative of the output. Corners have the
    paper's names; with an accumulator those on its line have a prime (A', D'), and so has the corner at which the supply of
    a valve is full (F').

    Args:
        muscle: from `cycle_muscle`.
        name: name of `CYCLES`.
        conditions: between which pressures and lengths.
        points: points of each curved leg.
    """
    cycle = energy_cycle(muscle, name, conditions)
    probe = Probe(muscle)
    piston = _piston(probe, name, conditions, cycle, points)
    return CycleLoops(name, cycle, conditions, piston, _tendon(probe, name, conditions, cycle, points))


def _piston(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, points: int) -> CyclePath:
    ambient = float(c.ambient.pressure_abs)
    low, high, rest = c.exchange_pressure + ambient, c.pressure + ambient, cycle.stretched_volume
    air = high * cycle.shortened_volume  # pressure times volume of all air in piston and muscle
    begins = high if name == "valve" else cycle.start_pressure + ambient
    rising = np.geomspace(low, begins, points)
    held = rest if name == "valve" else probe.volume(c.stretched_length, rising - ambient)
    first = np.stack([air / rising - held + rest, rising])
    if name == "valve":
        second = np.array([[rest], [high]])
    else:
        lengths = np.linspace(c.stretched_length, cycle.shortened_length, points)
        gauge = _pressures(probe, name, c, cycle, lengths)
        inside = probe.volume(lengths, gauge)
        second = np.stack([air / (gauge + ambient) - inside + rest, gauge + ambient])[:, 1:]
    back = np.array([[rest, first[0, 0]], [low, low]])
    x, y = np.concatenate([first, second, back], axis=1)
    full = points - 1 + second.shape[1]  # the piston is empty, all air in the muscle
    return CyclePath(x, y, dict(zip(_names(name, c), (0, points - 1, full, full + 1), strict=True)))


def _pressures(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, lengths: np.ndarray) -> np.ndarray:
    if name == "maximal":
        return np.full_like(lengths, c.pressure)
    return isotonic_pressure(probe, lengths, cycle.load + c.friction, c.exchange_pressure, c.pressure)


def _tendon(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, points: int) -> CyclePath:
    lengths = np.linspace(c.stretched_length, cycle.shortened_length, points)
    if name == "maximal":
        pull = probe.tension(lengths, c.pressure) - c.friction
    else:
        pull = np.full_like(lengths, cycle.load)
    down = np.linspace(cycle.taut_length, c.stretched_length, points)
    taken = probe.tension(down, c.exchange_pressure) + c.return_friction
    slack = cycle.taut_length > cycle.shortened_length + 1e-12
    # The air leaves at a held length, and a slack muscle is drawn out without force before it is taut.
    limp = np.array([[cycle.shortened_length, cycle.taut_length], [0.0, 0.0]]) if slack else np.empty((2, 0))
    start = np.array([[c.stretched_length], [taken[-1]]])
    x, y = np.concatenate([start, np.stack([lengths, pull]), limp, np.stack([down, taken])], axis=1)
    last = (
        points + 1 + int(slack and name == "maximal")
    )  # the paper's D is where the muscle is taut, its H where it ended
    names = [n if n[0] in "ADEH" else n[0] for n in _names(name, c)]
    return CyclePath(x, y, dict(zip(names, (0, 1, points, last), strict=True)))


def _names(name: str, c: Conditions) -> list[str]:
    prime = "'" if c.exchange_pressure else ""
    first, second, third, fourth = CORNERS[name]
    return [first + prime, second + ("'" if name == "valve" else ""), third, fourth + prime]
