"""Seated braid: a braid with a rubber wall whose two ends settle into their fittings under load.

Short muscles are weaker and softer than long ones of the same make: 305 N at 83 mm against 421 N at 281 mm, at rest
length and 6 bar. A rigid inactive length, lost volume in tapered ends or a thread stretch do not explain it, for they act
in proportion to the contraction; a length-independent element in series does, because it takes up millimetres that a
short muscle misses more. Measured on three lengths it stiffens with load, and its take-up follows the square root:

    Psi(L, P') = min over u >= 0 of  Psi_braid(L - u, P') + u^3/(3 q^2),     so that u = q sqrt(F)

with Psi_braid the neo-Hookean hyperelastic braid (Ogden exponent 2) without inactive ends. Only the rest length changes
from muscle to muscle. The muscle is as long as its braid and its seats together, and their energy is the least that the two
can have. F and V are derivatives of this one function, so that no cycle yields work. The inner minimum is found by five
fixed steps that linearise the braid and solve the spring exactly; the last carries the derivative. They leave 1e-9 of the
largest force at ten times the compliance that was measured.

Range: 0.8-1.0 of the rest length, 0-6.2 bar, lengths of 80-280 mm of the 10 mm muscle it was made for. Left out one
length at a time it errs by about 5 % of the largest force, which is the force that half a millimetre of rest length makes
(24-43 N/mm). Whether q belongs to the muscle or to the mounting, three lengths of one make cannot tell.
Source of the parts: the law `hyperelastic_braid`; the seat is this project's.
"""

from __future__ import annotations

import abc
from typing import Protocol, runtime_checkable

from ..._jax import jax, jit, jnp
from ...components import AbstractVar, Scalar, derivative
from ...quantities import quantity
from .. import dimensions
from ..law import TensionLaw
from .hyperelastic_braid import HyperelasticBraid

STEPS = 5


@runtime_checkable
class SeatedLaw(Protocol):
    """A tension law whose ends settle, so that its braid moves while the muscle is held at constant length."""

    def take_up(self, length: Scalar, pressure: Scalar) -> Scalar:
        """How far both ends have settled together [m], by which the braid is shorter than the muscle."""


class BraidInSeats(TensionLaw):
    """A law of a hyperelastic braid between ends that settle with the square root of the load."""

    rest_length: AbstractVar[Scalar]  # type: ignore[misc]
    seat_compliance: AbstractVar[Scalar]  # type: ignore[misc]
    upper_length: AbstractVar[Scalar]  # type: ignore[misc]

    @abc.abstractmethod
    def braid(self) -> HyperelasticBraid:
        """The braid between the seats."""

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Force of the rubber wall without gas [N]."""
        return derivative(lambda x: self._potential(x, jnp.zeros_like(x)), length)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Gas energy [J]: what the potential loses by the pressure."""
        return self._potential(length, jnp.zeros_like(pressure)) - self._potential(length, pressure)

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Range from 0.6 of the rest length to the upper working length [m]."""
        return 0.6 * self.rest_length, self.upper_length

    def take_up(self, length: Scalar, pressure: Scalar) -> Scalar:
        """How far both ends have settled together [m], by which the braid is shorter than the muscle."""
        u: Scalar = _take_up(self.braid(), self.seat_compliance, length, pressure)
        return u

    def formula_tension(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Slope of the potential [N]."""
        # the parts, each by itself, would settle once more without gas
        return derivative(lambda x: self._potential(x, pressure), length)

    def _potential(self, length: Scalar, pressure: Scalar) -> Scalar:
        energy: Scalar = _potential(self.braid(), self.seat_compliance, length, pressure)
        return energy


# Tension, volume, stiffness and the threads' stiffness ask for slopes up to the third of one potential at a few lengths and
# pressures. Written out for each, that is half a million operations, nearly all alike; as functions they are traced once.


@jit
def _energy(braid: HyperelasticBraid, length: Scalar, pressure: Scalar) -> Scalar:
    return braid.potential(length, pressure)


@jit
def _potential(braid: HyperelasticBraid, compliance: Scalar, length: Scalar, pressure: Scalar) -> Scalar:
    u = _take_up(braid, compliance, length, pressure)
    energy: Scalar = _energy(braid, length - u, pressure) + u * (u / compliance) ** 2 / 3.0
    return energy


@jit
def _take_up(braid: HyperelasticBraid, compliance: Scalar, length: Scalar, pressure: Scalar) -> Scalar:
    held_braid, held_q, held_length, held_pressure = jax.lax.stop_gradient((braid, compliance, length, pressure))

    def step(u: Scalar, force: Scalar, stiffness: Scalar, q: Scalar) -> Scalar:
        # Where the braid has no positive stiffness the step is short instead of wrong.
        soft = jnp.maximum(stiffness, 1.0) * q * q
        reach = jnp.maximum(force + jnp.maximum(stiffness, 1.0) * u, 0.0) * q * q
        bare = reach <= 1e-24  # there the square root has no derivative, and the ends carry nothing
        return jnp.where(bare, 0.0, 2.0 * reach / (soft + jnp.sqrt(soft * soft + 4.0 * jnp.where(bare, 1.0, reach))))

    def forces(u: Scalar) -> tuple[Scalar, Scalar]:
        at = held_length - u
        pull = lambda x: derivative(lambda y: _energy(held_braid, y, held_pressure), x)  # noqa: E731
        return jax.jvp(pull, (at,), (jnp.ones_like(at),))

    u = jax.lax.fori_loop(0, STEPS - 1, lambda _, u: step(u, *forces(u), held_q), jnp.zeros_like(held_length))
    # Only this last step is differentiated: the ones before have converged to where it begins.
    force = derivative(lambda x: _energy(braid, x, pressure), length - u)
    return step(u, force, forces(u)[1], compliance)


class SeatedBraid(BraidInSeats):
    """Neo-Hookean braid between ends that settle with the square root of the load."""

    rest_length: Scalar = dimensions.rest_length()
    rest_diameter: Scalar = dimensions.rest_diameter()
    wall_thickness: Scalar = dimensions.rubber_wall()
    rest_angle: Scalar = dimensions.rest_angle((0.33, 0.55))
    shear_modulus: Scalar = quantity("Pa", (1e4, 1e8), "shear modulus of the rubber", symbol="mu", typical=(4e5, 3e6))
    seat_compliance: Scalar = dimensions.seat_compliance()
    upper_length: Scalar = dimensions.upper_length()
    threshold_width: Scalar = dimensions.threshold_width()

    title = "Seated braid"
    cites = ("ogden1972", "chou1996")
    any_length = True
    fitted_if_unknown = {"rest_diameter": ()}
    fitted = ("rest_angle", "shear_modulus", "seat_compliance")

    def braid(self) -> HyperelasticBraid:
        """The wall without inactive ends, with threads in the bore that do not stretch."""
        return HyperelasticBraid(
            rest_length=self.rest_length,
            rest_diameter=self.rest_diameter,
            wall_thickness=self.wall_thickness,
            thread_depth=0.0,
            thread_compliance=0.0,
            rest_angle=self.rest_angle,
            shear_modulus=self.shear_modulus,
            inactive_share=0.0,
            upper_length=self.upper_length,
            threshold_width=self.threshold_width,
            ogden_exponent=2,
        )
