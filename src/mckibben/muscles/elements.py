"""Elements that make a braided muscle more like a biological one: springs, damper, tendon, delay, in any arrangement.

A muscle between bones has passive tissue beside it and a tendon behind it, and answers a nerve late; Chou and
Hannaford propose to add all of these to the artificial one. `PassiveSpring`, `Viscous` and `Tendon` are forces of
length and velocity, `Parallel` adds forces, `Series` adds lengths through small masses, `Delay` holds a command back
by whole samples.
Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753
(discussion).
"""

from __future__ import annotations

from typing import NamedTuple

from .._jax import Array, jnp
from ..components import ForceElement, Module, Scalar, field
from ..errors import InputError
from ..quantities import quantity


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
            raise InputError(
                "time", time, f"must be a multiple of the sample period of {sample_period:g} s", where=cls.__name__
            )
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
