"""Elements beside and behind a braided muscle: springs, damper, tendon, delay, and viscoelastic creep and relaxation.

A muscle between bones has passive tissue beside it and a tendon behind it, and answers a nerve late; Chou and
Hannaford propose to add all of these to the artificial one. `PassiveSpring`, `Viscous` and `Tendon` are forces of
length and velocity, `Parallel` adds forces, `Series` adds lengths through small masses, `Delay` holds a command back
by whole samples.

Maxwell elements in parallel with the muscle, each a spring in series with a damper, pull against a change of length
and let go of it in time; at constant pressure an unloaded muscle so creeps towards its length:

    dz_i/dt = v - z_i/tau_i,   F = sum k_i z_i                                                          (`MaxwellChain`)

Kelvin-Voigt elements in series, each a spring with a damper beside it, add an extension that follows a force in time:

    tau_i de_i/dt = J_i F - e_i,   e = sum e_i                                                     (`KelvinVoigtChain`)

Both are stepped by the exact exponential for a constant velocity or force during the step, so any step is stable, and
the ledgers are the exact integrals of that step. Range: linear, small strains, time constants within the span of the
record they were identified from; a muscle's creep is close to linear in the logarithm of time, which elements one or
two per decade follow. The exponentials depend on the step alone and cost nothing if the step is constant.
Sources: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753
(discussion); W. N. Findley, J. S. Lai and K. Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials,
North-Holland 1976, chapter 5 (the generalised models).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jax import Array, jnp
from ..components import ForceElement, Module, Scalar, field
from ..components.element import Advanced, MemoryElement
from ..errors import InputError
from ..quantities import quantity
from .hysteresis.slip import contact_energy, contact_force, per_contact, require_each


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

    def __check_init__(self) -> None:
        """Springs are those of each element."""
        require_each(type(self).__name__, {"stiffness": self.stiffness}, self.time_constant)

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


class PassiveSpring(ForceElement):
    """A spring with a cubic term: F = k x + k3 x^3 with x = L - L0, both ways.

    Range: any length; with k3 = 0 it is linear.
    """

    rest_length: Scalar = quantity("m", (0.0, 100.0), "length without force", symbol="L0")
    stiffness: Scalar = quantity("N/m", (0.0, 1e9), "stiffness at rest length", symbol="k", typical=(1e1, 1e4))
    cubic_stiffness: Scalar = quantity(
        "N/m^3", (0.0, 1e15), "coefficient of the cubic term", symbol="k3", typical=(0.0, 1e7), default=0.0
    )

    def force(self, length: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Tension [N], negative when compressed."""
        x = length - self.rest_length
        return x * (self.stiffness + self.cubic_stiffness * x * x) + 0.0 * jnp.asarray(velocity)

    def stored_energy(self, length: Scalar) -> Scalar:
        """The energy k x^2/2 + k3 x^4/4 [J]."""
        square = (length - self.rest_length) ** 2
        return square * (0.5 * self.stiffness + 0.25 * self.cubic_stiffness * square)


class Viscous(ForceElement):
    """A damper: F = c v."""

    damping: Scalar = quantity("N*s/m", (0.0, 1e7), "force per velocity", symbol="c", typical=(0.1, 1e3))

    def force(self, length: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Tension [N], positive while lengthening."""
        return self.damping * jnp.asarray(velocity, float) + 0.0 * jnp.asarray(length)

    def stored_energy(self, length: Scalar) -> Scalar:
        """Stored energy, zero [J]."""
        return 0.0 * jnp.asarray(length, float)


class Tendon(ForceElement):
    """A cord that pulls and cannot push, with a soft toe: T = f(d) max(1 + c v, 0), d = L - Ls.

        f(d) = 0 below d = 0,   k d^2/(2 t) in the toe 0 < d < t,   k (d - t/2) beyond

    The loss grows with the force, as in the contact law of Hunt and Crossley, so that nothing jumps where it gets taut.
    Passive at any velocity: T is never below f while it lengthens nor above while it shortens. Without the toe a free
    load that comes taut costs a fixed-step integrator an order.
    Source of the loss: K. H. Hunt and F. R. E. Crossley, J. Applied Mechanics 42(2), 1975, doi:10.1115/1.3423596.
    """

    stiffness: Scalar = quantity("N/m", (0.0, 1e9), "stiffness beyond the toe", symbol="k", typical=(1e4, 1e6))
    slack_length: Scalar = quantity("m", (0.0, 100.0), "length at which it gets taut", symbol="Ls", default=0.0)
    toe_length: Scalar = quantity("m", (1e-9, 1.0), "stretch over which it stiffens", symbol="t", default=5e-4)
    loss: Scalar = quantity("s/m", (0.0, 1e3), "loss factor", symbol="c", typical=(0.0, 1.0), default=0.0)

    def force(self, length: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Tension [N], never negative."""
        stretch = length - self.slack_length
        toe = jnp.clip(stretch, 0.0, self.toe_length)
        elastic = self.stiffness * (0.5 * toe * toe / self.toe_length + jnp.maximum(stretch - self.toe_length, 0.0))
        return elastic * jnp.maximum(1.0 + self.loss * jnp.asarray(velocity, float), 0.0)

    def stretch(self, force: Scalar) -> Scalar:
        """Stretch at which it pulls with a force at rest [m], force [N]."""
        pulled = force / self.stiffness
        in_toe = jnp.sqrt(2.0 * self.toe_length * jnp.maximum(pulled, 0.0))
        return jnp.where(pulled < 0.5 * self.toe_length, in_toe, pulled + 0.5 * self.toe_length)

    def stored_energy(self, length: Scalar) -> Scalar:
        """Integral of f over the stretch [J]."""
        stretch = length - self.slack_length
        toe = jnp.clip(stretch, 0.0, self.toe_length)
        beyond = jnp.maximum(stretch - self.toe_length, 0.0)
        return self.stiffness * (toe**3 / (6.0 * self.toe_length) + 0.5 * beyond * (self.toe_length + beyond))


class Parallel(ForceElement):
    """Elements side by side: one length, one velocity, the forces add."""

    elements: tuple[ForceElement, ...]

    def force(self, length: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Sum of the tensions [N]."""
        return sum((e.force(length, velocity) for e in self.elements), start=jnp.zeros(()))

    def stored_energy(self, length: Scalar) -> Scalar:
        """Sum of the energies [J]."""
        return sum((e.stored_energy(length) for e in self.elements), start=jnp.zeros(()))


class SeriesState(NamedTuple):
    """The nodes between elements in series: distance from the first end and its rate, shape (..., elements - 1)."""

    position: Array  # [m]
    velocity: Array  # [m/s]


class Series(Module):
    """Elements in series, with a small mass at every node between two.

    The masses make it a state equation: no force balance has to be solved inside a step, and an element may go slack.
    The fastest rate is about sqrt((k1 + k2)/m) and bounds the integrator's step.
    """

    elements: tuple[ForceElement, ...]
    mass: Scalar = quantity("kg", (1e-6, 1e3), "mass of each node, shape (elements - 1,)", symbol="m", default=0.02)

    def initial(self, lengths: Scalar) -> SeriesState:
        """State at rest, given the lengths of all elements but the last, shape (..., elements - 1) [m]."""
        position = jnp.cumsum(jnp.asarray(lengths, float), axis=-1)
        return SeriesState(position, jnp.zeros_like(position))

    def forces(self, state: SeriesState, length: Scalar, velocity: Scalar = 0.0) -> Array:
        """Tension of each element [N], last axis the elements, for the whole's length [m] and velocity [m/s]."""
        lengths, rates = _pieces(state.position, length), _pieces(state.velocity, velocity)
        return jnp.stack([e.force(lengths[..., i], rates[..., i]) for i, e in enumerate(self.elements)], axis=-1)

    def force(self, state: SeriesState, length: Scalar, velocity: Scalar = 0.0) -> Scalar:
        """Tension at the far end, that of the last element [N]."""
        return self.forces(state, length, velocity)[..., -1]

    def rate(self, state: SeriesState, length: Scalar, velocity: Scalar = 0.0) -> SeriesState:
        """Time derivative of the state [m/s, m/s^2]."""
        pull = self.forces(state, length, velocity)
        return SeriesState(state.velocity, (pull[..., 1:] - pull[..., :-1]) / self.mass)

    def stored_energy(self, state: SeriesState, length: Scalar) -> Scalar:
        """Elastic energy of the elements and kinetic energy of the nodes [J]."""
        lengths = _pieces(state.position, length)
        elastic = sum((e.stored_energy(lengths[..., i]) for i, e in enumerate(self.elements)), start=jnp.zeros(()))
        return elastic + jnp.sum(0.5 * self.mass * state.velocity**2, axis=-1)


class Delay(Module):
    """A command held back by a whole number of samples, on the sample clock.

    The buffer keeps the values under way, the oldest first, shape (samples, ...).
    """

    samples: int = field(static=True)

    def __check_init__(self) -> None:
        """Only whole, non-negative numbers of samples."""
        if isinstance(self.samples, bool) or not isinstance(self.samples, int) or self.samples < 0:
            raise InputError("samples", self.samples, "must be a whole number, 0 or more", where=type(self).__name__)

    @classmethod
    def of(cls, *, time: float, sample_period: float) -> Delay:
        """A delay of `time` [s] on a clock of `sample_period` [s], which must divide it."""
        if not (time >= 0.0 and sample_period > 0.0):
            raise InputError("time", time, "must be 0 s or more, with a sample period above 0 s", where=cls.__name__)
        samples = round(time / sample_period)
        if abs(samples * sample_period - time) > 1e-6 * sample_period:
            said = f"must be a multiple of the sample period of {sample_period:g} s"
            raise InputError("time", time, said, where=cls.__name__)
        return cls(samples)

    def initial(self, value: Scalar = 0.0) -> Scalar:
        """Buffer filled with one value."""
        value = jnp.asarray(value, float)
        return jnp.broadcast_to(value, (self.samples, *value.shape))

    def step(self, buffer: Scalar, value: Scalar) -> tuple[Scalar, Scalar]:
        """Advance by one sample; return the buffer and the delayed value."""
        line = jnp.concatenate([buffer, jnp.asarray(value, float)[None]])
        return line[1:], line[0]


def _pieces(nodes: Array, end: Scalar) -> Array:
    """Differences along 0, the nodes and the end, last axis."""
    whole = jnp.broadcast_to(jnp.asarray(end, float), nodes.shape[:-1])[..., None]
    line = jnp.concatenate([jnp.zeros_like(whole), nodes, whole], axis=-1)
    return line[..., 1:] - line[..., :-1]
