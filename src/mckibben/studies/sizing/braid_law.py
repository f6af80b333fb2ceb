"""From the dimensions of a braid to its law: the chain of the paper, eq. 10 to eq. 11 to eq. 12.

    F = Kg (P' - Pth)(L - Lmin) + Kp (L - L0)

Kg and Lmin are the straight line through the force per pressure of the virtual-work law with wall (eq. 10) over the stroke,
as the paper takes Kg (0.461 cm of it for the nylon muscle, 0.466 measured). What a braid does not tell is the bladder's:
threshold, and passive stiffness over Kg, which are pressures, are those of the nylon muscle, and the wall keeps its share
of the diameter. So all forces go with the square of the diameter, and the stress in the wall is that of the nylon muscle.
The laws `thick_wall` and `ideal` leave threshold and bladder out. Range: braid angles of 20.5-45 degrees at the long end,
less than 54.7 at the short one; a muscle at least four diameters long, for ends are no cylinders.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from ...muscles import braid
from ...muscles.law import TensionLaw
from ...muscles.laws.ideal import Ideal
from ...muscles.laws.linear_threshold import LinearThreshold
from ...muscles.laws.thick_wall import ThickWall

BRAID_LAWS = ("linear_threshold", "thick_wall", "ideal")


class Inferred(NamedTuple):
    """A number that no source prints for a braid to be made: value [SI], range, and where it comes from."""

    value: float
    range: tuple[float, float]
    note: str


INFERRED: dict[str, Inferred] = {
    "wall_share": Inferred(0.0762 / 1.66, (0.02, 0.1), "wall over the diameter at 90 degrees, of the nylon muscle"),
    "threshold_pressure": Inferred(0.903e5, (0.3e5, 1.5e5), "Pa; of the nylon muscle"),
    "threshold_width": Inferred(0.85e5, (0.7e5, 1e5), "Pa; of the nylon muscle"),
    "passive_pressure": Inferred(392.0 / 0.466e-2, (0.0, 2e5), "Pa; Kp/Kg of the nylon muscle"),
    "rest_share": Inferred(1.0 / 1.1, (0.85, 1.0), "length at rest over the longest, of the nylon muscle"),
    "friction_share": Inferred(2.5 / 110.0, (0.01, 0.09), "friction over the largest tension, of the nylon muscle"),
    "fitting_share": Inferred(1.0, (0.5, 3.0), "length of each fitting over the contracted diameter"),
    "wall_density": Inferred(1150.0, (950.0, 1300.0), "kg/m3; rubber and nylon"),
    "fitting_density": Inferred(1400.0, (600.0, 2700.0), "kg/m3; half of a fitting's cylinder is aluminium"),
    "slenderness": Inferred(4.0, (3.0, 10.0), "least length over diameter, when contracted"),
}


def usual(name: str) -> float:
    """The value of an inferred number [SI]."""
    return INFERRED[name].value


def braid_law(name: str, *, thread_length: Any, diameter: Any, longest: Any, shortest: Any) -> TensionLaw:
    """The law of a braid; arrays broadcast.

    Args:
        name: of `BRAID_LAWS`.
        thread_length: b [m].
        diameter: D0 at 90 degrees, b/(n pi) [m].
        longest: length from which it shortens [m].
        shortest: to which the straight line is taken [m].
    """
    turns = thread_length / (jnp.pi * diameter)
    if name == "ideal":
        return Ideal(thread_length=thread_length, turns=turns)
    wall = usual("wall_share") * diameter
    thick = ThickWall(thread_length=thread_length, turns=turns, wall_thickness=wall, upper_length=longest)
    if name == "thick_wall":
        return thick
    per_pressure, zero = _line(thick, longest, shortest)
    rest = usual("rest_share") * longest
    volume = braid.inner_volume(rest, thread_length=thread_length, turns=turns, wall_thickness=wall)
    return LinearThreshold(
        stiffness_per_pressure=per_pressure,
        shortest_length=zero,
        threshold_pressure=usual("threshold_pressure"),
        threshold_width=usual("threshold_width"),
        passive_stiffness=usual("passive_pressure") * per_pressure,
        rest_length=rest,
        upper_length=longest,
        rest_volume=volume,
        stop_stiffness=3e7 * (diameter / 0.0166) ** 2,
    )


def _line(law: ThickWall, longest: Any, shortest: Any) -> tuple[Any, Any]:
    """Least-squares slope of the force per pressure over five lengths of the stroke, Kg [m], and its zero, Lmin [m]."""
    pressure = 1e6  # the law is proportional to it
    shares = jnp.linspace(0.0, 1.0, 5) - 0.5
    middle, span = 0.5 * (longest + shortest), longest - shortest
    pull = [law.braid_tension(middle + s * span, pressure) / pressure for s in shares]
    mean = sum(pull) / 5.0
    slope = sum(s * f for s, f in zip(shares, pull, strict=True)) / (jnp.sum(shares**2) * span)
    return slope, middle - mean / slope
