"""Where the gas of a braided muscle lives: the bladder, and from its threshold on the braid.

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

import jax.numpy as jnp

from ..components import Scalar

# Share of the braid's volume at the upper working length: the bladder's own volume, and the width of the rounding.
# Their choice makes Vb + wC/2 exactly that volume, so that nothing is rounded inside the working range.
BLADDER_SHARE = 0.6
ROUNDING_SHARE = 0.8


def ramp(x: Any, width: Any) -> Scalar:
    """max(x, 0), rounded between -width/2 and width/2 (same unit as x, width > 0)."""
    # A choice between pieces that meet with three derivatives: whichever is taken at a seam, value and slope are right.
    # With clip and max, a compiler that computes y twice could count the slope at y = 1 never, half or twice.
    y = x / width + 0.5
    y2 = y * y
    rounded = width * y2 * y2 * y * (7.0 + y * (-14.0 + y * (10.0 - 2.5 * y)))
    return jnp.where(y >= 1.0, x, jnp.where(y <= 0.0, 0.0, rounded))


def gas_energy(
    pressure: Any, braid_volume: Any, *, upper_volume: Any, threshold_pressure: Any, threshold_width: Any
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
