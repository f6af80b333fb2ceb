"""Active tension against length: the polygon of Gordon, Huxley and Julian for frog striated muscle.

    sarcomere length [um]      1.27    1.67    2.00    2.25    3.65
    over L0 = 2.00 um          0.635   0.835   1.000   1.125   1.825
    relative active tension    0       0.84    1       1       0

The limb below the plateau has two slopes: the thin filaments begin to overlap at L0, the thick ones meet the Z discs at
the knee. Range: 0 to 3 L0 and beyond, exactly zero outside the outer nodes, exactly one on the plateau. It is their
schematic summary: the measured tension rounds the corners, and they saw the full tension between 2.05 and 2.2 um. At a
node the derivative is the mean of both sides.
Source: A. M. Gordon, A. F. Huxley and F. J. Julian, Journal of Physiology 184(1), 1966,
doi:10.1113/jphysiol.1966.sp007909.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Scalar

# Sarcomere lengths of the polygon over its optimal length of 2.00 um [1].
SHORTEST = 1.27 / 2.00
KNEE = 1.67 / 2.00
PLATEAU_END = 2.25 / 2.00
LONGEST = 3.65 / 2.00
KNEE_TENSION = 0.84


def active_curve(
    relative_length: Scalar,
    *,
    shortest: Scalar = SHORTEST,
    knee: Scalar = KNEE,
    knee_tension: Scalar = KNEE_TENSION,
    plateau_end: Scalar = PLATEAU_END,
    longest: Scalar = LONGEST,
) -> Scalar:
    """Isometric active tension at full activation over its largest value [1], 0 to 1.

    Args:
        relative_length: length over the rest length [1], any shape.
        shortest: length below which there is no active tension [1].
        knee: length at which the ascending limb changes its slope [1], between `shortest` and 1.
        knee_tension: relative tension there [1].
        plateau_end: longest length on the plateau, which begins at 1 [1].
        longest: length beyond which there is no active tension [1].
    """
    steep = knee_tension / (knee - shortest)
    shallow = (1.0 - knee_tension) / (1.0 - knee)
    above_shortest = jnp.maximum(relative_length - shortest, 0.0)
    above_knee = jnp.maximum(relative_length - knee, 0.0)
    ascending = steep * above_shortest + (shallow - steep) * above_knee
    descending = (longest - relative_length) / (longest - plateau_end)
    return jnp.maximum(jnp.minimum(jnp.minimum(ascending, descending), 1.0), 0.0)
