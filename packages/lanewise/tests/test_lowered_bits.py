"""The default arithmetic has the same bits in any lane, at any width, alone or in a batch."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lanewise
from lanewise import lower
from lowered_systems import per_lane, positions, rubbing


@pytest.fixture(scope="module")
def run():
    return lanewise.compile(positions(), *rubbing(), engine="native")


def test_every_width_every_lane_and_every_batch_size_give_the_same_bits(run):
    example = rubbing()
    many = per_lane(example, 37, np.random.default_rng(1))
    whole = run(*many, lanes=37)
    assert np.ptp(whole[-1]) > 1e-3  # the lanes do differ
    program, leaves = run.program, jax.tree.leaves(many)
    for width in (1, 2, 4, 16):
        np.testing.assert_array_equal(program.call(leaves, lanes=37, width=width)[0], whole)
    for lanes in (1, 3, 8, 19):
        part = jax.tree.map(lambda leaf, n=lanes: leaf[..., :n], many)
        np.testing.assert_array_equal(run(*part, lanes=lanes), whole[:, :lanes])
    alone = jax.tree.map(lambda leaf: leaf[..., 5], many)
    np.testing.assert_array_equal(run(*alone), whole[:, 5])


def test_what_is_given_once_or_per_lane_gives_the_same_bits(run):
    system, *rest = rubbing()
    masses = np.linspace(0.3, 0.7, 11)
    once = run(system.replace(mass=masses), *rest, lanes=11)
    spread = jax.tree.map(lambda leaf: np.repeat(np.asarray(leaf)[..., None], 11, -1), (system, *rest))
    each = run(spread[0].replace(mass=masses), *spread[1:], lanes=11)
    np.testing.assert_array_equal(once, each)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_threads_change_nothing(run, threads):
    many = per_lane(rubbing(), 100, np.random.default_rng(2))
    np.testing.assert_array_equal(run(*many, lanes=100, threads=threads), run(*many, lanes=100))


def test_a_lane_that_is_not_finite_touches_no_other(run):
    many = per_lane(rubbing(), 24, np.random.default_rng(3))
    sound = run(*many, lanes=24)
    for bad in (np.nan, 0.0):
        system = many[0].replace(mass=np.where(np.arange(24) == 7, bad, many[0].mass))
        found = run(system, *many[1:], lanes=24)
        assert not np.isfinite(found[-1, 7])
        np.testing.assert_array_equal(np.delete(found, 7, 1), np.delete(sound, 7, 1))


def test_reciprocals_taken_together_are_those_taken_apart_where_one_is_not_normal():
    """Four denominators of one step share a division; a zero, an infinity or a NaN must not reach its neighbours.

    So it is in mode ``fast`` without the processor's estimates: those need eight lanes.
    """

    def quotients(a):
        def body(total, row):
            return total, [1.0 / row[k] for k in range(4)]

        return jax.lax.scan(body, 0.0, a)[1]

    program, _ = lower(quotients, np.ones((12, 4)))
    chance = np.random.default_rng(4)
    values = chance.uniform(0.5, 2.0, (12, 4, 16))
    odd = [0.0, -0.0, np.inf, -np.inf, np.nan, 1e-308, 1e300, -1e-300]
    for k, value in enumerate(odd):
        values[k, k % 4, k] = value
    found = program.call([values], lanes=16, mode="fast", width=4)
    assert "invert" in [n.op for n in program.prepared("fast")[0].nodes]
    with np.errstate(divide="ignore"):
        for k in range(4):
            # three products and one division more than a plain one: each half a unit
            np.testing.assert_allclose(found[k], 1.0 / values[:, k], rtol=1e-15)


def test_no_fold_loses_what_is_not_finite_in_a_comparison():
    program, _ = lower(lambda x: (jnp.isfinite(x), jnp.maximum(x, 0.0), jnp.minimum(x, x * 2.0), jnp.isnan(x)), 1.0)
    values = np.array([1.0, np.nan, np.inf, -np.inf, 0.0])
    finite, most, least, nan = program.call([values], lanes=5)
    np.testing.assert_array_equal(finite, np.isfinite(values))
    np.testing.assert_array_equal(nan, np.isnan(values))
    np.testing.assert_array_equal(most, np.maximum(values, 0.0))
    np.testing.assert_array_equal(least, np.minimum(values, 2.0 * values))
