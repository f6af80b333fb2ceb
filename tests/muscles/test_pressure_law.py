"""A law that is published as the pressure that a force needs."""

import jax.numpy as jnp
import numpy as np
import pytest

import mckibben as mk


class Published(mk.PressureLaw):
    """Pressure that grows more than linearly with the force."""

    title, cites, fitted = "published", (), ("per_force",)
    per_force = mk.quantity("1/m^2", (1.0, 1e9), "pressure per force")
    walls = mk.quantity("Pa", (0.0, 1e9), "pressure per contraction")

    def pressure(self, force, contraction):
        bent = 0.02 * force**2 / (100.0 + jnp.abs(force))
        return self.per_force * (force * jnp.exp(4.0 * contraction) + bent) + self.walls * contraction

    def length_range(self):
        return 0.7 * self.rest_length, 1.02 * self.rest_length


LAW = Published(per_force=3000.0, walls=5e5, rest_length=0.3)
LENGTHS = np.array([0.24, 0.27, 0.3])


def test_the_tension_is_the_force_that_needs_the_pressure():
    force = LAW.braid_tension(LENGTHS, np.full(3, 3e5))
    # 1e-9: of the quadrature, whose derivative to the length is the force
    assert LAW.pressure(np.asarray(force), 1.0 - LENGTHS / 0.3) == pytest.approx(np.full(3, 3e5), rel=1e-9)


def test_force_and_volume_come_from_one_potential():
    """dF/dP = -dV/dL, by central differences, whose error is of the square of their width."""
    at, p, dl, dp = LENGTHS[:2], np.full(2, 3e5), 1e-5, 10.0
    by_pressure = (LAW.braid_tension(at, p + dp) - LAW.braid_tension(at, p - dp)) / (2.0 * dp)
    by_length = (LAW.braid_volume(at + dl, p) - LAW.braid_volume(at - dl, p)) / (2.0 * dl)
    assert np.asarray(by_pressure) == pytest.approx(-np.asarray(by_length), rel=1e-6)


def test_the_volume_at_rest_is_the_stated_one():
    assert float(LAW.braid_volume(0.3, 3e5)) == pytest.approx(1e-4, rel=1e-12)
