"""Gas volume of a braided muscle: of the bladder, and from its threshold on of the braid.

Below the threshold pressure the bladder bounds the gas, so the volume does not depend on the length; above it the braid
does. Slices of the bladder reach the braid each at its own threshold, spread over ``threshold_width``. Tension and
volume follow from one function, the gas energy G, so that the muscle can neither make nor lose energy:

    G(L, P') = P' Vb + s(P') C(L),   F_active = -dG/dL,   V = dG/dP'
    C = R(V_braid(L) - Vb; wC)   room between bladder and braid
    s = R(P' - Pth; w)           pressure carried by the braid

R is max(x, 0) rounded over a width by a polynomial of degree 7, convex, with three continuous derivatives, exact outside
the rounding. So eq. 12a of Chou and Hannaford (1996) holds exactly above Pth + w/2 and eq. 12b below Pth - w/2.
"""

from __future__ import annotations

from typing import Any

from .._jax import custom_jvp, jit, jnp
from ..components import Scalar
from . import threads

# Share of the braid's volume at the upper working length: the bladder's own volume, and the width of the rounding.
# Their choice makes Vb + wC/2 exactly that volume, so that nothing is rounded inside the working range.
BLADDER_SHARE = 0.6
ROUNDING_SHARE = 0.8


def ramp(x: Scalar, width: Scalar) -> Scalar:
    """max(x, 0), rounded between -width/2 and width/2 (same unit as x, width > 0)."""
    y = x / width + 0.5
    smooth: Scalar = width * _rounded(y)
    return smooth


@custom_jvp
def _rounded(y: Scalar) -> Scalar:
    """The ramp over its width, of y = x/width + 1/2.

    Its slope and its curvature are written out: derived, they would be many times longer, and the pieces that meet at a seam
    would have to be told apart in each of them.
    """
    u = _within(y)
    u2 = u * u
    u4 = u2 * u2
    beyond = y - 1.0
    return (u4 * u) * ((7.0 - 14.0 * u) + u2 * (10.0 - 2.5 * u)) + jnp.where(beyond <= 0.0, 0.0, beyond)


@custom_jvp
def _slope(y: Scalar) -> Scalar:
    u = _within(y)
    u2 = u * u
    return (u2 * u2) * ((35.0 - 84.0 * u) + u2 * (70.0 - 20.0 * u))


def _within(y: Scalar) -> Scalar:
    above = jnp.where(y <= 0.0, 0.0, y)  # what is no number stays none
    return jnp.where(above >= 1.0, 1.0, above)


@_rounded.defjvp
def _(primals: Any, tangents: Any) -> tuple[Scalar, Scalar]:
    return _rounded(*primals), _slope(*primals) * tangents[0]


@_slope.defjvp
def _(primals: Any, tangents: Any) -> tuple[Scalar, Scalar]:
    value, u = _slope(*primals), _within(*primals)
    bell = u - u * u
    return value, 140.0 * (bell * bell * bell) * tangents[0]


# traced once, however often a step calls them
_rounded, _slope = jit(_rounded), jit(_slope)


def least_upper_volume(slope: Scalar, upper_length: Scalar, thread_strain: Scalar) -> Scalar:
    """Volume at the upper working length with which the braid still holds gas where its threads are straight [m^3].

    Six times what it loses on the way: the rounding of the room then lowers the tension there by 4 % at most.

    Args:
        slope: dV/dL at the upper working length [m^2], negative where the gas pulls.
        upper_length: [m].
        thread_strain: see `threads` [1].
    """
    return -6.0 * slope * upper_length * threads.furthest(thread_strain)


def gas_energy(
    pressure: Scalar,
    braid_volume: Scalar,
    *,
    upper_volume: Scalar,
    threshold_pressure: Scalar = 0.0,
    threshold_width: Scalar,
) -> Scalar:
    """The gas energy G(L, P') [J], the integral of the volume over the gauge pressure.

    Args:
        pressure: gauge pressure [Pa], any sign.
        braid_volume: volume enclosed by the braid at the present length [m^3]; may be negative beyond its domain.
        upper_volume: the same at the upper working length [m^3].
        threshold_pressure: mean gauge pressure at which the bladder reaches the braid [Pa].
        threshold_width: spread of that threshold [Pa].
    """
    bladder = BLADDER_SHARE * upper_volume
    room = ramp(braid_volume - bladder, ROUNDING_SHARE * upper_volume)
    return pressure * bladder + ramp(pressure - threshold_pressure, threshold_width) * room
