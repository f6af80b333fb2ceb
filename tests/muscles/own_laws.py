"""Sound laws of users, of many shapes, and unsound ones; `test_check_own_laws.py` tells them apart."""

import jax.numpy as jnp

import mckibben as mk


class GasSpring(mk.TensionLaw):
    """F = k (L - Lw) + P' (A + s x + b x^2), x = L - L0; the range in rest lengths."""

    title, cites, fitted = "bent gas spring", (), ("area",)
    area = mk.quantity("m^2", (-1.0, 1.0), "force per pressure at rest", default=1.2e-3)
    slope = mk.quantity("m", (-10.0, 10.0), "its growth with the length", default=1.2e-2)
    bend = mk.quantity("1", (-1e3, 1e3), "growth of the slope", default=0.1)
    wall_stiffness = mk.quantity("N/m", (0.0, 1e7), "stiffness of the walls", default=1e3)
    wall_length = mk.quantity("m", (1e-5, 1e3), "length without pull of the walls", default=0.2)
    rest_length = mk.quantity("m", (1e-5, 1e3), "rest length", default=0.2)
    rest_volume = mk.quantity("m^3", (1e-15, 1e6), "gas volume at rest", default=94e-6)
    low = mk.quantity("1", (0.01, 3.0), "shortest over rest length", default=0.75)
    high = mk.quantity("1", (0.01, 3.0), "longest over rest length", default=1.05)

    def elastic_tension(self, length):
        return self.wall_stiffness * (length - self.wall_length)

    def gas_energy(self, length, pressure):
        x = length - self.rest_length
        return pressure * (self.rest_volume - self.area * x - 0.5 * self.slope * x**2 - self.bend * x**3 / 3.0)

    def length_range(self):
        return self.low * self.rest_length, self.high * self.rest_length


class Offset(GasSpring):
    """The pressure begins to act at 0.8 bar, as in a bladder that is stiff."""

    threshold_pressure = mk.quantity("Pa", (0.0, 1e6), "pressure at which the bladder yields", default=0.8e5)

    def gas_energy(self, length, pressure):
        carried = jax_softplus((pressure - self.threshold_pressure) / 2e4) * 2e4
        bladder = 0.4 * self.rest_volume
        full = GasSpring.gas_energy(self, length, jnp.ones_like(pressure))
        return pressure * bladder + carried * (full - bladder)


def jax_softplus(x):
    """log(1 + exp x), which does not overflow."""
    return jnp.maximum(x, 0.0) + jnp.log1p(jnp.exp(-jnp.abs(x)))


class Free(GasSpring):
    """Tension stated twice, so that the two differ: the gas pulls, and its volume stays."""

    def braid_tension(self, length, pressure):
        return GasSpring.braid_tension(self, length, pressure) * 1.001


class Lossy(GasSpring):
    """Its volume follows the pressure beside its potential."""

    def braid_volume(self, length, pressure):
        return GasSpring.braid_volume(self, length, pressure) + 1e-11 * pressure * (length / self.rest_length)


class Pushing(GasSpring):
    """A rod."""

    def tension(self, span, pressure):
        return GasSpring.braid_tension(self, span, pressure)


class Root(GasSpring):
    """A derivative that is infinite within the range."""

    def elastic_tension(self, length):
        return 20.0 * jnp.sqrt(jnp.maximum(length - 0.95 * self.rest_length, 0.0))


class Emptied(GasSpring):
    """Loses its gas within the range."""

    def gas_energy(self, length, pressure):
        return GasSpring.gas_energy(self, length, pressure) - 0.99 * pressure * self.rest_volume


class Snapping(GasSpring):
    """Falls slack while it is lengthened, and pulls again."""

    def elastic_tension(self, length):
        return 3e3 * jnp.sin(60.0 * (length / self.rest_length - 0.8))
