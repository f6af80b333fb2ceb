"""Predictions and their derivatives: those of XLA, whatever is given to a known function."""

import jax.numpy as jnp
import numpy as np
from rubbing_systems import positions, rubbing

from mckibben.engine.prediction import prediction

SAMPLES, INNER = 40, 4
RUN, (SYSTEM, STATE, MEMORY, SIGNALS) = positions(SAMPLES, INNER), rubbing(SAMPLES)
VALUES = jnp.array([0.5, 0.02, 2.1e5])  # mass, position, pressure


def test_a_prediction_by_a_kernel_is_that_by_xla():
    def function(values, system):
        return RUN(system.replace(mass=values[0]), {**STATE, "x": values[1], "p": values[2]}, MEMORY, SIGNALS)

    by_kernel, by_xla = (prediction(function, 3, SYSTEM, engine=e) for e in ("native", "xla"))
    values = np.asarray(VALUES)
    np.testing.assert_allclose(by_kernel.predict(values), by_xla.predict(values), rtol=0.0, atol=1e-14)
    found, want = by_kernel.slopes(values), by_xla.slopes(values)
    assert found.shape == (SAMPLES + 1, 3)
    np.testing.assert_allclose(found / np.abs(want).max(0), want / np.abs(want).max(0), rtol=0.0, atol=1e-12)


def test_a_prediction_of_a_known_name_follows_what_is_given():
    function = lambda values, rows: jnp.sum(values) * rows  # noqa: E731
    first = prediction(function, 2, np.arange(3.0), name="sums")
    second = prediction(function, 2, 10.0 * np.arange(3.0), name="sums")
    np.testing.assert_allclose(second.predict(np.ones(2)), 10.0 * first.predict(np.ones(2)))
    np.testing.assert_allclose(second.slopes(np.ones(2)), np.outer(10.0 * np.arange(3.0), np.ones(2)))
