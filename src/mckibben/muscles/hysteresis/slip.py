"""What all friction models share: the force at which friction yields, and the contact that deflects and lets go.

    Fc(P') = Fc0 + c max(P', 0)

The threads of a braid are pressed on each other and on the bladder by the gas, so their friction grows with it; Chou
and Hannaford print one constant, which their loops show to be a value for 5 bar. Vacuum presses nothing together.

A contact of constant stiffness k carries the force k z at the deflection z. It is moved by the displacement, and what
the deflection does not take up has slipped. Only the yield travel d(P') = Fc(P')/k depends on pressure, never the
stiffness: a force Fc(P') z/d would give energy back when the pressure rises.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..._jax import is_traced, jnp
from ...components import AbstractVar, Module, Scalar
from ...components.element import Advanced, Hysteresis
from ...errors import InputError
from ...quantities import quantity


class FrictionLimit(Module):
    """Largest force of a friction of one contact, or of each of its elements where the parameters are arrays (elements,).

    It is never the limit of all elements together: ``limit.scaled(np.full(4, 0.25))`` shares that among four.
    """

    constant: Scalar = quantity("N", (0.0, 1e5), "friction without pressure", symbol="Fc0", typical=(0.0, 20.0))
    per_pressure: Scalar = quantity(
        "m^2", (0.0, 1.0), "friction per gauge pressure", symbol="c", typical=(0.0, 5e-5), default=0.0
    )

    def force(self, pressure: Scalar, xp: Any = jnp) -> Scalar:
        """Fc(P') [N] at a gauge pressure [Pa]; by `xp`, NumPy or JAX's."""
        limit: Scalar = self.constant + self.per_pressure * xp.maximum(pressure, 0.0)
        return limit

    def scaled(self, factor: Scalar) -> FrictionLimit:
        """Return the limit multiplied by a factor >= 0."""
        return FrictionLimit(constant=factor * self.constant, per_pressure=factor * self.per_pressure)


# A yield travel below this [m] is none: it keeps a friction of zero, and its derivative, finite.
LEAST_TRAVEL = 1e-12


def slip(deflection: Scalar, displacement: Scalar, travel: Scalar) -> Scalar:
    """The stop operator: deflection after a displacement, held within the yield travel of the end (all one unit)."""
    moved = deflection + displacement
    moved = jnp.where(moved < -travel, -travel, moved)  # a choice is cheaper; a travel that is no number counts below
    return jnp.minimum(moved, travel)


def contact_force(stiffness: Scalar, deflection: Scalar) -> Scalar:
    """Sum of the contacts' forces over the last axis [N]."""
    return jnp.sum(stiffness * deflection, axis=-1)


def contact_energy(stiffness: Scalar, deflection: Scalar) -> Scalar:
    """Elastic energy of the contacts, summed over the last axis [J]."""
    return jnp.sum(0.5 * stiffness * deflection * deflection, axis=-1)


def advanced(stiffness: Scalar, before: Scalar, displacement: Scalar, after: Scalar) -> Advanced:
    """The state after a straight piece of path, with its ledger.

        W = k (z + z')/2 dx,   D = k (z + z')/2 (z + dx - z') >= 0,   so that W = U' - U + D with U = k z^2/2

    The mean of the end forces makes both of second order in the length of the piece. Where it would yield D < 0, D is
    zero and W = U' - U. That takes a piece longer than twice the yield travel, run while that travel shrinks: there the
    mean force of the ends says nothing. At rest W is zero, and a shrinking yield dissipates what it releases.

    Args:
        stiffness: stiffness of each contact [N/m].
        before: deflections before, last axis the contacts [m].
        displacement: displacement of all contacts, with a last axis of one [m].
        after: deflections after [m].
    """
    mean = 0.5 * stiffness * (before + after)
    dissipated = jnp.sum(jnp.maximum(mean * (before + displacement - after), 0.0), axis=-1)
    return Advanced(after, jnp.sum(mean * (after - before), axis=-1) + dissipated, dissipated)


def per_contact(value: Scalar) -> Scalar:
    """A number per muscle as one per contact: with a last axis of one."""
    return jnp.asarray(value, float)[..., None]


def require_each(where: str, amounts: Mapping[str, Scalar], *others: Scalar) -> None:
    """Refuse one number for an amount that adds up over elements: each would have it, and all together many times as much.

    Args:
        where: type that has the elements.
        amounts: forces, stiffnesses and weights by name, a number or (..., elements).
        *others: further parameters that may have an axis of elements.

    Raises:
        InputError: names the amount, or one that has another number of elements.
    """
    sizes = {np.shape(value)[-1] for value in (*amounts.values(), *others) if np.ndim(value)}
    count = max(sizes, default=1)
    for name, value in amounts.items():
        if count > 1 and np.ndim(value) == 0 and (is_traced(value) or float(value) != 0.0):
            problem = f"must have a value for each of {count} elements, or all have {count} times as much together"
            raise InputError(name, None, f"{problem}: share it, as by np.full({count}, 1/{count})", where=where)
    if len(sizes - {1}) > 1:
        problem = f"must have as many elements as the others, got {' and '.join(map(str, sorted(sizes)))}"
        raise InputError(next(iter(amounts)), None, problem, where=where)


class Contacts(Hysteresis):
    """Friction of one contact or several; the state is the deflection of each [m], shape (..., contacts)."""

    limit: AbstractVar[FrictionLimit]
    stiffness: AbstractVar[Scalar]

    def __check_init__(self) -> None:
        """Limit and stiffness are those of each contact."""
        limit = self.limit
        amounts = {"limit.constant": limit.constant, "limit.per_pressure": limit.per_pressure}
        require_each(type(self).__name__, {**amounts, "stiffness": self.stiffness})

    def initial(self) -> Scalar:
        """State without deflections, shape (contacts,) [m]."""
        return jnp.zeros(jnp.broadcast_shapes(jnp.shape(self.limit.constant), jnp.shape(self.stiffness), (1,)))

    def force(self, state: Scalar, velocity: Scalar = 0.0, pressure: Scalar = 0.0) -> Scalar:
        """Sum of the contacts' forces [N]."""
        return contact_force(self.stiffness, state)

    def stored_energy(self, state: Scalar) -> Scalar:
        """Elastic energy of the contacts [J]."""
        return contact_energy(self.stiffness, state)

    def travel(self, pressure: Scalar) -> Scalar:
        """Yield travel d(P') of each contact [m]."""
        # a limit of travels: what does not change is divided before the steps of a run, and not in each of them
        return self.limit.scaled(1.0 / self.stiffness).force(per_contact(pressure))

    def largest_force(self, pressure: Scalar) -> Scalar:
        """Sum of the contacts' limits [N]."""
        limits = self.limit.force(per_contact(pressure))
        return jnp.sum(jnp.broadcast_to(limits, jnp.shape(self.travel(pressure))), axis=-1)

    def lubricated(self, factor: float = 0.9) -> Hysteresis:
        """Return the friction with every limit scaled."""
        changed: Hysteresis = self.replace(limit=self.limit.scaled(factor))
        return changed


class RelaxingContacts(Contacts):
    """Contacts that relax on their way: by the implicit mean, with the mean yield travel of a piece's two ends.

    Afterwards they are limited once, with the travel at the end.
    """

    @abc.abstractmethod
    def relaxed(self, deflection: Scalar, displacement: Scalar, travel: Scalar) -> Scalar:
        """Deflection after a displacement with one yield travel, not yet limited, shape (..., contacts) [m]."""

    def advance(
        self,
        state: Scalar,
        displacement: Scalar,
        *,
        start_pressure: Scalar,
        end_pressure: Scalar,
        duration: Scalar = 0.0,
    ) -> Advanced:
        """Move along a straight piece of path."""
        dx = per_contact(displacement)
        end = self.travel(end_pressure)
        travel = jnp.maximum(0.5 * (self.travel(start_pressure) + end), LEAST_TRAVEL)
        return advanced(self.stiffness, state, dx, slip(self.relaxed(state, dx, travel), 0.0, end))
