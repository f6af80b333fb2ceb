"""Viscoelastic creep and relaxation: springs and dampers with a spread of time constants.

Maxwell elements in parallel with the muscle, each a spring in series with a damper, pull against a change of length
and let go of it in time; at constant pressure an unloaded muscle so creeps towards its length:

    dz_i/dt = v - z_i/tau_i,   F = sum k_i z_i                                                          (`MaxwellChain`)

Kelvin-Voigt elements in series, each a spring with a damper beside it, add an extension that follows a force in time:

    tau_i de_i/dt = J_i F - e_i,   e = sum e_i                                                     (`KelvinVoigtChain`)

Both are stepped by the exact exponential for a constant velocity or force during the step, so any step is stable, and
the ledgers are the exact integrals of that step. Range: linear, small strains, time constants within the span of the
record they were identified from; a muscle's creep is close to linear in the logarithm of time, which elements one or
two per decade follow. The exponentials depend on the step alone and cost nothing if the step is constant.
Source: W. N. Findley, J. S. Lai and K. Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials,
North-Holland 1976, chapter 5 (the generalised models).
"""

from __future__ import annotations

import numpy as np

from .._jax import jnp
from ..components import Module, Scalar
from ..components.element import Advanced, MemoryElement
from ..errors import InputError
from ..quantities import quantity
from .hysteresis.slip import contact_energy, contact_force, per_contact


class MaxwellChain(MemoryElement):
    """Maxwell elements in parallel; the state is the deflection of each spring [m], shape (..., elements).

    With a spring beside it, such as the muscle itself, one element is the standard linear solid.
    """

    stiffness: Scalar = quantity(
        "N/m", (0.0, 1e9), "spring of each element, shape (elements,)", symbol="k_i", typical=(1e1, 1e4)
    )
    time_constant: Scalar = quantity(
        "s", (1e-4, 1e6), "relaxation time of each element, shape (elements,)", symbol="tau_i", typical=(1e-1, 1e2)
    )

    title = "Maxwell chain"
    cites = ("findley1976",)

    @classmethod
    def geometric(cls, *, stiffness: Scalar, shortest: Scalar, longest: Scalar, elements: int = 3) -> MaxwellChain:
        """Elements of equal stiffness, together `stiffness` [N/m], with times from `shortest` to `longest` [s]."""
        times = _geometric(shortest, longest, elements, where=cls.__name__)
        return cls(stiffness=jnp.asarray(stiffness, float) / elements * np.ones(elements), time_constant=times)

    def initial(self) -> Scalar:
        """Fully relaxed state, shape (elements,) [m]."""
        return jnp.zeros(jnp.broadcast_shapes(jnp.shape(self.stiffness), jnp.shape(self.time_constant), (1,)))

    def advance(
        self,
        state: Scalar,
        displacement: Scalar,
        *,
        start_pressure: Scalar = 0.0,
        end_pressure: Scalar = 0.0,
        duration: Scalar,
    ) -> Advanced:
        """Move at constant velocity for a duration [s]; in no time at all the elements are springs."""
        dx = per_contact(displacement)
        x = per_contact(duration) / self.time_constant
        decay, mean_decay, mean_growth, spread = _exponentials(x)
        mean = state * mean_decay + dx * mean_growth
        after = state * decay + dx * mean_decay
        # k/tau times the integral of z^2 over the step: its mean squared, and its variance.
        lost = self.stiffness * x * (mean * mean + (state * x - dx) ** 2 * spread)
        dissipated = jnp.sum(lost, axis=-1)
        gained = jnp.sum(0.5 * self.stiffness * (after - state) * (after + state), axis=-1)
        return Advanced(after, gained + dissipated, dissipated)

    def force(self, state: Scalar, velocity: Scalar = 0.0, pressure: Scalar = 0.0) -> Scalar:
        """Sum of the springs' forces, positive after lengthening [N]."""
        return contact_force(self.stiffness, state)

    def stored_energy(self, state: Scalar) -> Scalar:
        """Elastic energy of the springs [J]."""
        return contact_energy(self.stiffness, state)


class KelvinVoigtChain(Module):
    """Kelvin-Voigt elements in series; the state is the extension of each [m], shape (..., elements)."""

    compliance: Scalar = quantity(
        "m/N", (1e-12, 10.0), "compliance of each element, shape (elements,)", symbol="J_i", typical=(1e-6, 1e-3)
    )
    time_constant: Scalar = quantity(
        "s", (1e-4, 1e6), "retardation time of each element, shape (elements,)", symbol="tau_i", typical=(1e-1, 1e2)
    )

    title = "Kelvin-Voigt chain"
    cites = ("findley1976",)

    @classmethod
    def geometric(cls, *, compliance: Scalar, shortest: Scalar, longest: Scalar, elements: int = 3) -> KelvinVoigtChain:
        """Elements of equal compliance, together `compliance` [m/N], with times from `shortest` to `longest` [s]."""
        times = _geometric(shortest, longest, elements, where=cls.__name__)
        return cls(compliance=jnp.asarray(compliance, float) / elements * np.ones(elements), time_constant=times)

    def initial(self) -> Scalar:
        """State without extension, shape (elements,) [m]."""
        return jnp.zeros(jnp.broadcast_shapes(jnp.shape(self.compliance), jnp.shape(self.time_constant), (1,)))

    def advance(self, state: Scalar, force: Scalar, *, duration: Scalar) -> Advanced:
        """Pull with a constant force [N] for a duration [s]; the mean of a varying one makes second order."""
        pull = per_contact(force)
        lag = state - self.compliance * pull
        kept = jnp.exp(-per_contact(duration) / self.time_constant)
        after = self.compliance * pull + lag * kept
        dissipated = jnp.sum(0.5 * lag * lag * (1.0 - kept * kept) / self.compliance, axis=-1)
        return Advanced(after, jnp.sum(pull * (after - state), axis=-1), dissipated)

    def extension(self, state: Scalar) -> Scalar:
        """Sum of the extensions [m]."""
        return jnp.sum(state, axis=-1)

    def stored_energy(self, state: Scalar) -> Scalar:
        """Elastic energy of the springs [J]."""
        return contact_energy(1.0 / self.compliance, state)


def _geometric(shortest: Scalar, longest: Scalar, elements: int, *, where: str) -> Scalar:
    if elements < 1:
        raise InputError("elements", elements, "must be 1 or more", where=where)
    place = np.linspace(0.0, 1.0, elements) if elements > 1 else np.array([0.5])
    return jnp.asarray(shortest, float) * jnp.exp(place * jnp.log(jnp.asarray(longest, float) / shortest))


def _exponentials(x: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Of s from 0 to x >= 0: exp(-x), mean of exp(-s), mean of 1 - exp(-s) over x, variance of exp(-s) over x^2."""
    decay = jnp.exp(-x)
    small = x < 0.1  # series there, to 1e-10 of the value, since the differences cancel
    safe = jnp.where(small, 1.0, x)
    series = 0.5 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720 - x / 5040))))
    mean = (1.0 - decay) / safe
    mean_growth = jnp.where(small, series, (1.0 - mean) / safe)
    mean_decay = 1.0 - x * mean_growth
    variance = decay * (1 / 12 + x * x * (1 / 180 + x * x / 6720))
    spread = jnp.where(small, variance, mean * (0.5 * (1.0 + decay) - mean) / (safe * safe))
    return decay, mean_decay, mean_growth, spread
