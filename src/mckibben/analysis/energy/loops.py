"""Working cycles as closed paths: pressure over volume of the piston, tension over length (Figs. 12 and 13)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .cycles import Conditions, EnergyCycle, energy_cycle, isotonic_pressure
from .volumes import CycleMuscle, Probe

CORNERS = {"maximal": ("A", "B", "C", "D"), "isotonic": ("E", "F", "G", "H"), "valve": ("E", "F", "G", "H")}


class Path(NamedTuple):
    """A closed path; its last point is its first.

    Attributes:
        x: volume [m^3] or length [m], shape (n,).
        y: absolute pressure [Pa] or tension [N], shape (n,).
        corners: index of each named corner.
    """

    x: np.ndarray
    y: np.ndarray
    corners: dict[str, int]

    def area(self) -> float:
        """Work done along it, the integral of y dx by the trapezoid rule [J]."""
        return float(np.sum(0.5 * (self.y[1:] + self.y[:-1]) * np.diff(self.x)))


class CycleLoops(NamedTuple):
    """A cycle as two paths, both in the order of time.

    Attributes:
        name: of the cycle.
        cycle: its numbers.
        conditions: that it was run between.
        piston: absolute pressure over the volume of the piston plus that of the stretched muscle.
        tendon: tension over length.
    """

    name: str
    cycle: EnergyCycle
    conditions: Conditions
    piston: Path
    tendon: Path


def cycle_loops(muscle: CycleMuscle, name: str, conditions: Conditions, *, points: int = 257) -> CycleLoops:
    """The paths of a cycle.

    The area of the piston's is the negative of the input, that of the tendon's the negative of the output. Corners have the
    paper's names; with an accumulator those on its line have a prime (A', D'), and so has the corner at which the supply of
    a valve is full (F').

    Args:
        muscle: from `cycle_muscle`.
        name: of `CYCLES`.
        conditions: between which pressures and lengths.
        points: of each curved leg.
    """
    cycle = energy_cycle(muscle, name, conditions)
    probe = Probe(muscle)
    piston = _piston(probe, name, conditions, cycle, points)
    return CycleLoops(name, cycle, conditions, piston, _tendon(probe, name, conditions, cycle, points))


def _piston(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, points: int) -> Path:
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
    return Path(x, y, dict(zip(_names(name, c), (0, points - 1, full, full + 1), strict=True)))


def _pressures(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, lengths: np.ndarray) -> np.ndarray:
    if name == "maximal":
        return np.full_like(lengths, c.pressure)
    return isotonic_pressure(probe, lengths, cycle.load + c.friction, c.exchange_pressure, c.pressure)


def _tendon(probe: Probe, name: str, c: Conditions, cycle: EnergyCycle, points: int) -> Path:
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
    return Path(x, y, dict(zip(names, (0, 1, points, last), strict=True)))


def _names(name: str, c: Conditions) -> list[str]:
    prime = "'" if c.exchange_pressure else ""
    first, second, third, fourth = CORNERS[name]
    return [first + prime, second + ("'" if name == "valve" else ""), third, fourth + prime]
