"""Law of what a residual learns of holds: of a hold that is not shown it is told the pressure, and nothing else."""

import functools
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import learned_on_holds  # noqa: E402

PRESSURES = np.array([0.0, 3e5, 1.5e5, 4e5, 2e5])
LENGTHS = np.array([0.2519, 0.2362, 0.2441, 0.2311])  # of the holds that are shown [m]
PRIOR = np.full(8, learned_on_holds.RESERVE)


@pytest.fixture(scope="module")
def compiled():
    """Lengths of five holds, with a residual of two weights, and their derivatives."""
    model = functools.partial(learned_on_holds.positions, pressures=PRESSURES, slow=False, order=(2, 1))
    return jax.jit(model), jax.jit(jax.jacfwd(model))


def test_what_is_hidden_of_the_holds_moves_no_bit_of_what_is_learned_and_what_is_shown_does(compiled):
    def learned(last, shown):
        return learned_on_holds.fitted(*compiled, PRIOR, np.append(LENGTHS, last), np.array([True] * 4 + [shown]))

    plain = learned(0.24, False)
    assert np.isfinite(plain).all()
    for poison in (np.nan, np.inf, 1e9, -0.24):
        np.testing.assert_array_equal(learned(poison, False), plain)
    assert abs(learned(plain[-1] + 1e-4, True)[-1] - plain[-1]) > 1e-6  # so that the law can fail
