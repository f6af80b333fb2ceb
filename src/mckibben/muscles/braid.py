"""Geometry of a cylindrical braid of inextensible threads (eqs. 5-7 and 9 of Chou and Hannaford 1996).

One thread of length b makes n turns on a cylinder of length L. With cos(theta) = L/b every formula needs a square root
at most. All functions are elementwise, defined for every length: beyond the thread length the sine is held at
``SMALLEST_SINE`` so that values and derivatives stay finite, and the caller reports "overstretched".

Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._jax import jnp
from ..components import Scalar

SMALLEST_SINE = 1e-3
SHORTEST_SHARE = 3.0**-0.5  # least length over the thread length: at 54.7 degrees a braid encloses most


class BraidShape(NamedTuple):
    """Dimensions of a braid: length of one thread [m] and its turns [1]."""

    thread_length: Any
    turns: Any

    def diameter(self, length: float) -> float:
        """Diameter at a length [m]; a plain number."""
        return float(diameter(length, thread_length=self.thread_length, turns=self.turns))

    def degrees(self, length: float) -> float:
        """Braid angle at a length [m], for people."""
        return float(np.degrees(angle(length, thread_length=self.thread_length)))


def sine(length: Scalar, *, thread_length: Scalar) -> Scalar:
    """sin(theta) of the braid angle, at least ``SMALLEST_SINE`` [1]; lengths [m]."""
    cosine = length / thread_length
    return jnp.sqrt(jnp.maximum(1.0 - cosine * cosine, SMALLEST_SINE**2))


def angle(length: Scalar, *, thread_length: Scalar) -> Scalar:
    """Braid angle theta from the long axis [rad] (eq. 5); for people, no hot formula needs it."""
    return jnp.arccos(jnp.clip(length / thread_length, 0.0, 1.0))


def length_at(braid_angle: Scalar, *, thread_length: Scalar) -> Scalar:
    """Length at a braid angle [m] (eq. 5); angle [rad]."""
    return thread_length * jnp.cos(braid_angle)


def diameter(length: Scalar, *, thread_length: Scalar, turns: Scalar) -> Scalar:
    """Diameter of the braid [m] (eq. 6)."""
    return thread_length * sine(length, thread_length=thread_length) / (turns * jnp.pi)


def volume(length: Scalar, *, thread_length: Scalar, turns: Scalar) -> Scalar:
    """Volume inside a braid without wall [m^3] (eq. 7, as the cubic in L that it is).

    It turns negative beyond the thread length, by design: see `bladder`.
    """
    return length * (thread_length**2 - length**2) / (4.0 * jnp.pi * turns**2)


def through(
    *, rest_length: float, rest_volume: float, shortest_length: float, diameter_shortened: float
) -> BraidShape | None:
    """Braid with a volume at rest [m^3] and diameter when shortened [m], eqs. 6 and 7 solved; None if there is none."""
    slim, full = 4.0 * np.pi * rest_volume / rest_length, (np.pi * diameter_shortened) ** 2
    if not full > slim > 0.0:
        return None
    turns = np.sqrt((rest_length**2 - shortest_length**2) / (full - slim))
    return BraidShape(float(np.sqrt(rest_length**2 + slim * turns**2)), float(turns))


def wound(*, rest_length: Scalar, rest_angle: Scalar, rest_diameter: Scalar) -> BraidShape:
    """The braid with an angle [rad] and a diameter at a length [m], elementwise (eqs. 5 and 6)."""
    return BraidShape(rest_length / jnp.cos(rest_angle), rest_length * jnp.tan(rest_angle) / (jnp.pi * rest_diameter))


def braid_of(law: object) -> BraidShape | None:
    """The braid of a law from its own parameters, as plain numbers; None if the law has no braid."""
    dimensions = {n: float(v) for n in _SHAPE if (v := getattr(law, n, None)) is not None}
    if {"thread_length", "turns"} <= dimensions.keys():
        return BraidShape(dimensions["thread_length"], dimensions["turns"])
    if {"rest_length", "rest_angle"} <= dimensions.keys() and {"rest_diameter", "rest_radius"} & dimensions.keys():
        angle = dimensions["rest_angle"] + dimensions.get("angle_correction", 0.0)
        bore = dimensions.get("rest_diameter", 2.0 * dimensions.get("rest_radius", 0.0))
        shape = wound(rest_length=dimensions["rest_length"], rest_angle=angle, rest_diameter=bore)
        return BraidShape(*(float(x) for x in shape))
    return None


_SHAPE = ("thread_length", "turns", "rest_length", "rest_angle", "angle_correction", "rest_diameter", "rest_radius")


def inner_volume(length: Scalar, *, thread_length: Scalar, turns: Scalar, wall_thickness: Scalar) -> Scalar:
    """Volume inside a wall of constant thickness [m^3] (eq. 9), zero where the wall fills the braid."""
    bore = diameter(length, thread_length=thread_length, turns=turns) - 2.0 * wall_thickness
    return 0.25 * jnp.pi * jnp.maximum(bore, 0.0) ** 2 * length


def inner_diameter(length: Scalar, *, thread_length: Scalar, turns: Scalar, wall_thickness: Scalar) -> Scalar:
    """Inner diameter [m], zero where the wall fills the braid."""
    return jnp.maximum(diameter(length, thread_length=thread_length, turns=turns) - 2.0 * wall_thickness, 0.0)


def stop_tension(length: Scalar, *, begins_at: Scalar, stiffness: Scalar) -> Scalar:
    """The end non-linearity nl(L) = knl max(L - Lnl, 0)^2 of eq. 12 [N]; lengths [m], stiffness knl [N/m^2].

    Chou and Hannaford name it for the stiff end of the stroke, where the braid is no cylinder any more, and leave it out of
    their regular range. Here it is a one-sided parabola: zero with zero slope inside the working range, so that no printed
    value changes, and stiffening beyond.
    """
    return stiffness * jnp.maximum(length - begins_at, 0.0) ** 2
