"""Tension against velocity: Hill's hyperbola for shortening, and its continuation for lengthening.

    f = (1 - u) / (1 + u/c)                            shortening at u = -v/vmax, zero from u = 1 on        (Hill)
    f = 1 + (m - 1) w / (w + s)                        lengthening at w = v/vmax, towards the plateau m
        with s = (m - 1) c / (1 + c)

c = a/F0 is Hill's curvature, 0.25 for typical skeletal muscle; the power f u then peaks at 0.095 Fmax vmax, which is
the "about 0.1" of McMahon. The scale s makes the slope continuous at v = 0. That is a choice: Katz found the slope on
the lengthening side several times steeper. Range: all velocities, finite and never negative; lengthening faster than
about vmax is extrapolation. At -vmax, where the tension ends, the derivative is the mean of both sides.
Sources: A. V. Hill, Proceedings of the Royal Society B 126, 1938, doi:10.1098/rspb.1938.0050; B. Katz, Journal of
Physiology 96, 1939; T. A. McMahon, Muscles, Reflexes, and Locomotion, Princeton University Press, 1984; plateau 1.4 for
young adults from D. G. Thelen, Journal of Biomechanical Engineering 125(1), 2003, doi:10.1115/1.1531112.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar


def velocity_curve(relative_velocity: Scalar, *, curvature: Scalar = 0.25, lengthening_tension: Scalar = 1.4) -> Scalar:
    """Tension over the isometric tension at the same length and activation [1], 0 up to `lengthening_tension`.

    Args:
        relative_velocity: dL/dt over the largest shortening velocity [1], positive while lengthening, any shape.
        curvature: Hill's a/F0 [1], positive.
        lengthening_tension: the plateau while lengthening fast [1], above 1.
    """
    shortening = jnp.maximum(-relative_velocity, 0.0)
    lengthening = jnp.maximum(relative_velocity, 0.0)
    hyperbola = curvature * jnp.maximum(1.0 - shortening, 0.0) / (curvature + shortening)
    above = lengthening_tension - 1.0
    scaled = lengthening * (1.0 + curvature)
    return hyperbola + above * scaled / (scaled + above * curvature)
