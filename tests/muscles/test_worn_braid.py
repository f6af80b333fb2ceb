"""A worn braid: still one potential, and no wear is no change."""

import jax
import numpy as np

from mckibben.muscles.muscle import muscle
from mckibben.muscles.worn_braid import ROOM, WornBraid

NYLON = muscle("nylon").law
LENGTHS, PRESSURES = np.meshgrid(np.linspace(0.105, 0.15, 7), np.linspace(1e5, 6e5, 5))


def worn(**wear):
    return WornBraid(sound=NYLON, **wear)


def test_a_braid_without_wear_is_the_sound_one():
    # the same operations but for factors of one and sums of zero
    np.testing.assert_allclose(
        worn().braid_tension(LENGTHS, PRESSURES), NYLON.braid_tension(LENGTHS, PRESSURES), rtol=1e-14
    )
    np.testing.assert_allclose(
        worn().braid_volume(LENGTHS, PRESSURES), NYLON.braid_volume(LENGTHS, PRESSURES), rtol=1e-14
    )


def test_tension_and_volume_of_a_worn_braid_are_of_one_potential():
    law = worn(lost_threads=0.2, warming=30.0)
    for length, pressure in ((0.11, 2e5), (0.13, 5e5)):
        force_by_pressure = jax.grad(lambda p, at=length: law.braid_tension(at, p))(pressure)
        volume_by_length = jax.grad(lambda x, at=pressure: law.braid_volume(x, at))(length)
        # mixed derivatives of one function, in float64
        np.testing.assert_allclose(force_by_pressure, -volume_by_length, rtol=1e-10)


def test_a_share_without_threads_does_not_pull():
    law = worn(lost_threads=0.25)
    # exact but for rounding: the gas energy of that share is constant in the length
    np.testing.assert_allclose(
        law.active_tension(LENGTHS, PRESSURES), 0.75 * NYLON.active_tension(LENGTHS, PRESSURES), rtol=1e-13
    )
    np.testing.assert_allclose(law.elastic_tension(LENGTHS), NYLON.elastic_tension(LENGTHS), rtol=1e-14)


def test_the_modulus_of_rubber_grows_with_its_absolute_temperature():
    law = worn(warming=29.315)
    np.testing.assert_allclose(law.elastic_tension(LENGTHS), (1 + 29.315 / ROOM) * NYLON.elastic_tension(LENGTHS))
    np.testing.assert_allclose(law.active_tension(LENGTHS, PRESSURES), NYLON.active_tension(LENGTHS, PRESSURES))
