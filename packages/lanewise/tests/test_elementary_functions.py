"""exp, log and their like against more digits, and what they make of zeros, infinities and NaN."""

import jax.numpy as jnp
import numpy as np
import pytest

from lanewise import lower

CHANCE = np.random.default_rng(8)
WIDE, SMALL = CHANCE.uniform(-20.0, 20.0, 2000), CHANCE.normal(size=2000) * 10.0 ** CHANCE.uniform(-8, 0, 2000)
ABOVE, NEAR = 10.0 ** CHANCE.uniform(-30, 30, 2000), np.abs(1.0 + 0.1 * CHANCE.normal(size=2000))
ODD = np.array([0.0, np.inf, -np.inf, np.nan, -1.0, 1e-320, 800.0, -800.0])


def run(function, *arrays):
    program, _ = lower(function, *(1.0 for _ in arrays))
    return program.call(arrays, lanes=len(arrays[0]))[0]


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("exp", WIDE),
        ("exp", SMALL),
        ("expm1", WIDE),
        ("expm1", SMALL),
        ("log", ABOVE),
        ("log", NEAR),
        ("log1p", np.abs(SMALL)),
    ],
)
def test_functions_are_right_to_two_units_in_the_last_place(name, values):
    exact = getattr(np, name)(values.astype(np.longdouble))
    error = np.abs((run(getattr(jnp, name), values) - exact) / np.spacing(np.abs(exact).astype(float)))
    assert error.max() < 1.6  # measured against 120 bits: 0.9 at most, expm1 1.4


@pytest.mark.parametrize("base", [NEAR, 10.0 ** CHANCE.uniform(-3, 3, 2000)])
def test_powers_are_right_to_two_units_in_the_last_place(base):
    y = CHANCE.uniform(-9.0, 9.0, 2000)
    exact = base.astype(np.longdouble) ** y.astype(np.longdouble)
    error = np.abs((run(lambda a, b: a**b, base, y) - exact) / np.spacing(exact.astype(float)))
    assert error.max() < 1.7  # measured against 120 bits: 1.4


@pytest.mark.parametrize("y", [-3, -2, -1, 0, 1, 2, 7])
def test_whole_powers_are_products_and_of_a_negative_one_the_reciprocal(y):
    np.testing.assert_allclose(run(lambda a: a**y, NEAR), NEAR.astype(np.longdouble) ** y, rtol=2e-15)  # 9 roundings


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine_are_right_for_many_turns(name):
    values = 1000.0 * WIDE
    np.testing.assert_allclose(run(getattr(jnp, name), values), getattr(np, name)(values), rtol=0.0, atol=2e-15)


@pytest.mark.parametrize("name", ["exp", "expm1", "log", "log1p", "sin"])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_zeros_infinities_and_nan_are_as_in_numpy(name):
    np.testing.assert_allclose(run(getattr(jnp, name), ODD), getattr(np, name)(ODD), rtol=1e-13, atol=1e-307)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_powers_of_zero_infinity_and_nan_are_as_in_numpy():
    bases = np.array([0.0, np.inf, np.nan, -1.0, 1.0, 2.0])
    for y in (1.11, -1.5, 0.0):
        want = np.where(np.isnan(bases) & (y == 0.0), np.nan, np.power(bases, y))
        want[3] = np.nan  # of a base below 0, even for an exponent of 0
        np.testing.assert_allclose(run(lambda a, b: a**b, bases, np.full(6, y)), want, rtol=1e-15)
