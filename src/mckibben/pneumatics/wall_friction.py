"""Friction of developed flow in a pipe, for the lumped and the distributed tube alike.

    f = 64/Re                                                      laminar
    1/sqrt(f) = -1.8 log10((eps/(3.7 D))^1.11 + 6.9/Re)            turbulent (Haaland)

f is Darcy's factor. Between Re = 2300 and 4000 it passes smoothly from one to the other. Range: Re below 1e8, roughness up
to 5 % of the diameter; Haaland's formula is within 2 % of Colebrook's. Source: S. E. Haaland, J. Fluids Eng. 105, 1983,
doi:10.1115/1.3240948.
"""

from __future__ import annotations

from .._jax import jnp
from ..components import Scalar

LAMINAR_END, TURBULENT_START = 2300.0, 4000.0


def turbulence(reynolds_number: Scalar) -> Scalar:
    """Share of the turbulent law: 0 up to Re = 2300, 1 from 4000, smooth between."""
    x = jnp.clip((reynolds_number - LAMINAR_END) / (TURBULENT_START - LAMINAR_END), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def haaland(reynolds_number: Scalar, relative_roughness: Scalar) -> Scalar:
    """Darcy's friction factor of turbulent flow; below Re = 2300 its value there."""
    re = jnp.maximum(reynolds_number, LAMINAR_END)
    argument = (relative_roughness / 3.7) ** 1.11 + 6.9 / re
    return 1.0 / (1.8 * jnp.log10(argument)) ** 2


def friction_factor(reynolds_number: Scalar, relative_roughness: Scalar) -> Scalar:
    """Darcy's friction factor at any Reynolds number above zero."""
    share = turbulence(reynolds_number)
    return (1.0 - share) * 64.0 / reynolds_number + share * haaland(reynolds_number, relative_roughness)
