"""Passive tension of an unexcited muscle: none up to a length, then of increasing stiffness.

    f = (max(x - onset, 0) / strain)^4,   x = L/L0

The ends are Thelen's for young adults: it begins at L0 and reaches the largest isometric tension at a strain of 0.6.
The fourth power is a choice of this package: it stays within 0.06 of Thelen's exponential of shape 5 between these
ends, and needs no exponential. Range: 0 to 1.6 L0; beyond, it only keeps growing (123 times the largest tension at 3
L0). Passive tension differs widely between muscles: take it as an order of magnitude.
Source of the ends: D. G. Thelen, Journal of Biomechanical Engineering 125(1), 2003, doi:10.1115/1.1531112.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar


def passive_curve(relative_length: Scalar, *, onset: Scalar = 1.0, strain: Scalar = 0.6) -> Scalar:
    """Passive tension over the largest isometric tension [1], never negative.

    Args:
        relative_length: length over the rest length [1], any shape.
        onset: length at which the passive tension begins [1].
        strain: how far beyond it equals the largest isometric tension [1], positive.
    """
    stretch = jnp.maximum(relative_length - onset, 0.0) / strain
    square = stretch * stretch
    return square * square
