"""Laws with a deliberate fault each, and one without; `test_check.py` finds them out."""

import jax
import jax.numpy as jnp

import mckibben as mk
from mckibben.components import Advanced, Hysteresis, Scalar


class Sound(mk.TensionLaw):
    """A gas spring in parallel with a spring."""

    title = "gas and spring"
    cites = ()
    fitted = ("gain", "wall_stiffness")

    gain = mk.quantity("m^2", (1e-6, 1e-1), "force per pressure at rest", typical=(1e-4, 5e-3))
    wall_stiffness = mk.quantity("N/m", (0.0, 1e5), "stiffness of the walls", typical=(1e2, 1e4))
    rest_length = mk.quantity("m", (1e-3, 10.0), "rest length")

    def elastic_tension(self, length):
        return self.wall_stiffness * (length - 0.95 * self.rest_length)

    def gas_energy(self, length, pressure):
        x = 1.2 * self.rest_length - length
        return pressure * self.gain * (self.rest_length + x - 0.5 * x * x / self.rest_length)

    def length_range(self):
        return 0.5 * self.rest_length, 1.1 * self.rest_length


class MakesEnergy(Sound):
    """Pulls with more than its volume pays for: the pressure acts on the tension alone."""

    def braid_tension(self, length, pressure):
        return Sound.braid_tension(self, length, pressure) + 1e-9 * pressure * pressure


class Pushes(Sound):
    """Hangs on a rod instead of a braid."""

    def tension(self, span, pressure):
        return self.braid_tension(span, pressure)


class NotFinite(Sound):
    """A square root whose derivative is infinite where the muscle is at rest."""

    def elastic_tension(self, length):
        return jnp.sqrt(jnp.maximum(length - self.rest_length, 0.0))


@jax.custom_jvp
def _square(x):
    return x * x


@_square.defjvp
def _(primals, tangents):
    return _square(*primals), 1.9 * primals[0] * tangents[0]


class WrongDerivative(Sound):
    """A derivative written by hand, five per cent off."""

    def elastic_tension(self, length):
        return self.wall_stiffness * _square(length) / self.rest_length


class Branches(Sound):
    """Asks Python for the value of a pressure."""

    def gas_energy(self, length, pressure):
        return Sound.gas_energy(self, length, pressure) if pressure > 0.0 else 0.0 * length


class Sorts(Sound):
    """Works, but on operations that no kernel has."""

    def elastic_tension(self, length):
        return self.wall_stiffness * (length - jnp.linalg.svd(jnp.eye(3))[1][0] * 0.95 * self.rest_length)


class Undeclared(Sound):
    """A parameter without unit and bounds, and one of a unit that is none."""

    factor: float = 1.0
    strange = mk.quantity("furlong^^2", (2.0, 1.0), "", default=1.5)


class Shrinks(Sound):
    """Its volume vanishes within the working range."""

    def gas_energy(self, length, pressure):
        return Sound.gas_energy(self, length, pressure) - 1.5 * self.gain * self.rest_length * pressure


class Perpetual(Hysteresis):
    """A friction that pushes on: it pulls in the direction of motion."""

    title = "perpetual"
    cites = ()
    strength: Scalar = mk.quantity("N", (0.0, 10.0), "force in the direction of motion", default=1.0)

    def initial(self):
        return jnp.zeros(1)

    def advance(self, state, displacement, *, start_pressure, end_pressure, duration):
        work = -self.strength * jnp.abs(displacement)
        return Advanced(state, work, work)

    def force(self, state, velocity=0.0, pressure=0.0):
        return -self.strength * jnp.sign(velocity)

    def stored_energy(self, state):
        return jnp.sum(state) * 0.0

    def largest_force(self, pressure):
        return self.strength + 0.0 * pressure

    def lubricated(self, factor=0.9):
        return Perpetual(strength=factor * self.strength)
