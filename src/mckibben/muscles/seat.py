"""Seats of a braid: its two ends settle into their fittings by a distance u = q sqrt(F), whatever the braid's length.

The muscle is as long as its braid and its seats together, and their energy is the least that the two can have:

    Psi(L, P') = min over u >= 0 of  Psi_braid(L - u, P') + u^3/(3 q^2)

F and V are derivatives of this one function, so that no cycle yields work. The inner minimum is found by five fixed steps
that linearise the braid and solve the spring exactly; the last carries the derivative. They leave 1e-9 of the largest force
at ten times the compliance that was measured.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from .._jax import jax, jnp
from ..components import Scalar, derivative

STEPS = 5


class BraidPotential(Protocol):
    """A braid between its seats, a pytree of parameters."""

    def potential(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Psi_braid(L, P') [J]."""


@runtime_checkable
class SeatedLaw(Protocol):
    """A tension law whose ends settle, so that its braid moves while the muscle is held at constant length."""

    def take_up(self, length: Scalar, pressure: Scalar) -> Scalar:
        """How far both ends have settled together [m], by which the braid is shorter than the muscle."""


def seated_potential(braid: BraidPotential, compliance: Scalar, length: Scalar, pressure: Scalar) -> Scalar:
    """Potential of a braid together with its seats [J].

    Args:
        braid: between the seats.
        compliance: take-up of both ends per square root of load q [m/N^0.5], above zero.
        length: of the muscle, with its seats [m].
        pressure: gauge pressure [Pa].
    """
    u = take_up(braid, compliance, length, pressure)
    return braid.potential(length - u, pressure) + u * (u / compliance) ** 2 / 3.0


def take_up(braid: BraidPotential, compliance: Scalar, length: Scalar, pressure: Scalar) -> Scalar:
    """Take-up u of the seats [m]; only the last step of the iteration is differentiated."""
    held_braid, held_q, held_length, held_pressure = jax.lax.stop_gradient((braid, compliance, length, pressure))

    def step(u: Scalar, force: Scalar, stiffness: Scalar, q: Scalar) -> Scalar:
        # Where the braid has no positive stiffness the step is short instead of wrong.
        soft = jnp.maximum(stiffness, 1.0) * q * q
        reach = jnp.maximum(force + jnp.maximum(stiffness, 1.0) * u, 0.0) * q * q
        bare = reach <= 1e-24  # there the square root has no derivative, and the ends carry nothing
        return jnp.where(bare, 0.0, 2.0 * reach / (soft + jnp.sqrt(soft * soft + 4.0 * jnp.where(bare, 1.0, reach))))

    def forces(u: Scalar) -> tuple[Scalar, Scalar]:
        at = held_length - u
        pull = lambda x: derivative(lambda y: held_braid.potential(y, held_pressure), x)  # noqa: E731
        return jax.jvp(pull, (at,), (jnp.ones_like(at),))

    u = jax.lax.fori_loop(0, STEPS - 1, lambda _, u: step(u, *forces(u), held_q), jnp.zeros_like(held_length))
    force = derivative(lambda x: braid.potential(x, pressure), length - u)
    return step(u, force, forces(u)[1], compliance)
