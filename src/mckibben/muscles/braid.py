"""Geometry of a cylindrical braid of inextensible threads (eqs. 5-7 and 9 of Chou and Hannaford 1996).

One thread of length b makes n turns on a cylinder of length L. With cos(theta) = L/b every formula needs a square root
at most. All functions are elementwise, defined for every length: beyond the thread length the sine is held at
``SMALLEST_SINE`` so that values and derivatives stay finite, and the caller reports "overstretched".

Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from ..components import Scalar

SMALLEST_SINE = 1e-3


def sine(length: Any, *, thread_length: Any) -> Scalar:
    """sin(theta) of the braid angle, at least ``SMALLEST_SINE`` [1]; lengths [m]."""
    cosine = length / thread_length
    return jnp.sqrt(jnp.maximum(1.0 - cosine * cosine, SMALLEST_SINE**2))


def angle(length: Any, *, thread_length: Any) -> Scalar:
    """Braid angle theta from the long axis [rad] (eq. 5); for people, no hot formula needs it."""
    return jnp.arccos(jnp.clip(length / thread_length, 0.0, 1.0))


def length_at(braid_angle: Any, *, thread_length: Any) -> Scalar:
    """Length at a braid angle [m] (eq. 5); angle [rad]."""
    return thread_length * jnp.cos(braid_angle)


def diameter(length: Any, *, thread_length: Any, turns: Any) -> Scalar:
    """Diameter of the braid [m] (eq. 6)."""
    return thread_length * sine(length, thread_length=thread_length) / (turns * jnp.pi)


def volume(length: Any, *, thread_length: Any, turns: Any) -> Scalar:
    """Volume inside a braid without wall [m^3] (eq. 7, as the cubic in L that it is).

    It turns negative beyond the thread length, by design: see `bladder`.
    """
    return length * (thread_length**2 - length**2) / (4.0 * jnp.pi * turns**2)


def inner_volume(length: Any, *, thread_length: Any, turns: Any, wall_thickness: Any) -> Scalar:
    """Volume inside a wall of constant thickness [m^3] (eq. 9), zero where the wall fills the braid."""
    bore = diameter(length, thread_length=thread_length, turns=turns) - 2.0 * wall_thickness
    return 0.25 * jnp.pi * jnp.maximum(bore, 0.0) ** 2 * length


def inner_diameter(length: Any, *, thread_length: Any, turns: Any, wall_thickness: Any) -> Scalar:
    """Inner diameter [m], zero where the wall fills the braid."""
    return jnp.maximum(diameter(length, thread_length=thread_length, turns=turns) - 2.0 * wall_thickness, 0.0)
