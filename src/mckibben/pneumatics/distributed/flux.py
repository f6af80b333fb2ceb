"""Fluxes between cells: piecewise linear reconstruction and the HLLC approximate Riemann solver.

Pressure, velocity and temperature are reconstructed with van Leer's limiter (second order where the solution is smooth,
monotone at fronts). A steady pipe flow is nearly linear from cell to cell, so that the states on both sides of a face
nearly agree and HLLC dissipates next to nothing there: no correction is needed at low Mach numbers (at Mach 0.05 and 50
cells the steady flow errs by 3e-8).

Sources: E. F. Toro, M. Spruce and W. Speares, Shock Waves 4, 1994, doi:10.1007/BF01414629; wave speeds of S. F. Davis,
SIAM J. Sci. Stat. Comput. 9, 1988, doi:10.1137/0909030; B. van Leer, J. Comput. Phys. 14, 1974,
doi:10.1016/0021-9991(74)90019-9 (limiter), and 32, 1979, doi:10.1016/0021-9991(79)90145-1 (reconstruction).
"""

from __future__ import annotations

from ..._jax import Array, jnp
from ...components import Scalar
from .equations import Conserved, Medium, Primitive


def limited(before: Scalar, after: Scalar) -> Array:
    """Van Leer's slope from the differences to both neighbours: their harmonic mean, or zero at an extremum."""
    product = before * after
    return jnp.where(product > 0.0, 2.0 * product / jnp.where(product > 0.0, before + after, 1.0), 0.0)


def _one_sided(near: Scalar, far: Scalar) -> Array:
    """Slope of an end cell, which has one neighbour: the difference to it, unless the next one contradicts."""
    return jnp.where(near * far > 0.0, jnp.sign(near) * jnp.minimum(jnp.abs(near), 3.0 * jnp.abs(far)), 0.0)


def reconstruct(values: Array) -> tuple[Scalar, Scalar]:
    """Values at the left and at the right face of each cell; shapes (cells,) to twice (cells,)."""
    steps = values[1:] - values[:-1]
    inner = limited(steps[:-1], steps[1:])
    first, last = _one_sided(steps[0], steps[1]), _one_sided(steps[-1], steps[-2])
    half = 0.5 * jnp.concatenate([first[None], inner, last[None]])
    return values - half, values + half


def hllc(medium: Medium, left: Primitive, right: Primitive) -> Conserved:
    """Flux through the face between two states, positive to the right; shapes broadcast.

    Returns:
        Flux of mass [kg/(m2 s)], momentum [Pa] and energy [W/m2].
    """
    gas = medium.gas
    sound_left, sound_right = medium.sound_speed(left.temperature), medium.sound_speed(right.temperature)
    slowest = jnp.minimum(left.velocity - sound_left, right.velocity - sound_right)
    fastest = jnp.maximum(left.velocity + sound_left, right.velocity + sound_right)
    inflow_left = gas.density(left.pressure, left.temperature) * (slowest - left.velocity)
    inflow_right = gas.density(right.pressure, right.temperature) * (fastest - right.velocity)
    contact = (right.pressure - left.pressure + left.velocity * inflow_left - right.velocity * inflow_right) / (
        inflow_left - inflow_right
    )
    # The side from which the contact moves away, and its outer wave.
    from_left = contact >= 0.0
    pressure, velocity, temperature = (jnp.where(from_left, a, b) for a, b in zip(left, right, strict=True))
    wave = jnp.where(from_left, slowest, fastest)
    inflow = jnp.where(from_left, inflow_left, inflow_right)
    supersonic = jnp.where(from_left, slowest >= 0.0, fastest <= 0.0)

    between = jnp.where(supersonic, velocity, contact)
    density = inflow / (wave - between)
    star_pressure = pressure + inflow * (between - velocity)
    mass = density * between
    energy = gas.cv * temperature + 0.5 * velocity**2
    # rho* E* = rho* (E + (S* - u)(S* + P/(rho (S - u))))
    star_energy = density * (energy + (between - velocity) * (between + pressure / inflow))
    return Conserved(mass, mass * between + star_pressure, between * (star_energy + star_pressure))
