"""Long arrays that loops replace, and loops of a single run that do several trips at once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lanewise
from lanewise import lower
from lanewise._adjoint import adjoint

CHANCE = np.random.default_rng(8)


def oscillators(stiffness, places, velocities, level):
    """Oscillators that draw on one level: a step evaluates them one after the other and adds up what they draw."""

    def rate(places, velocities, level):
        def one(drawn, row):
            k, x, v = row
            return drawn + 0.01 * x * v, (v, level - k * x - 0.1 * v * jnp.abs(v))

        drawn, rates = jax.lax.scan(one, jnp.zeros(()), (stiffness, places, velocities))
        return *rates, -drawn

    def step(_, state):
        middle = [y + 0.005 * d for y, d in zip(state, rate(*state), strict=True)]
        return tuple(y + 0.01 * d for y, d in zip(state, rate(*middle), strict=True))

    def sample(state, _):
        return jax.lax.fori_loop(0, 5, step, state), (state[0], state[2])

    return jax.lax.scan(sample, (places, velocities, level), None, length=7)


def many(count):
    return CHANCE.uniform(1.0, 2.0, count), CHANCE.uniform(size=count), np.zeros(count), np.float64(0.3)


def switches(levels, marks, limit):
    """Whole numbers, truth values and rows of numbers, replaced in every trip; some begin as zeros."""

    def step(i, state):
        counts, over, rows, seen = state
        over = rows[0] + levels > limit
        counts = counts + jnp.where(over, 1, i)
        return counts, over, jnp.stack([rows[1], 0.5 * rows[0] + levels]), jnp.where(over, seen + 1.0, seen[::-1])

    zeros = jnp.zeros(levels.shape)
    return jax.lax.fori_loop(0, 6, step, (marks, marks > 2, jnp.stack([levels, zeros]), zeros))


def counted(levels, trips):
    return jax.lax.fori_loop(0, trips, lambda i, x: 0.5 * x[::-1] + i, levels)


def strided(table):
    return jax.lax.scan(lambda s, row: (s + row[0] * row[2], row * row[1]), jnp.zeros(()), table)


@pytest.mark.parametrize("count", [80, 100, 131])
def test_arrays_that_loops_replace_are_those_of_jax(count):
    arguments = many(count)
    program, tree = lower(oscillators, *arguments)
    found = jax.tree.unflatten(tree, program.call(list(arguments), mode="strict"))
    # 70 evaluations, each rounded otherwise
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-13), found, jax.jit(oscillators)(*arguments))


def test_several_trips_at_once_give_the_bits_of_one_after_the_other():
    arguments = list(many(96))
    program, _ = lower(oscillators, *arguments)
    assert "x double>" in program.assembly()[0]
    for mode in ("default", "strict"):
        once = program.call(arguments, mode=mode)
        lane = program.call(arguments, lanes=1, mode=mode)  # a run per lane does one trip after the other
        for a, b in zip(once, lane, strict=True):
            np.testing.assert_array_equal(a, b[..., 0])


def test_arrays_of_every_kind_are_replaced():
    arguments = CHANCE.uniform(size=80), np.arange(80) % 5, np.float64(1.2)
    program, _ = lower(switches, *arguments)
    want = jax.jit(switches)(*arguments)
    for found, exact in zip(program.call(list(arguments), mode="strict"), want, strict=True):
        np.testing.assert_allclose(found, exact, rtol=1e-15)  # a fused sum may round once


@pytest.mark.parametrize("trips", [0, 1, 4])
def test_a_loop_of_any_number_of_trips_leaves_its_last_array(trips):
    levels = CHANCE.uniform(size=70)
    program, _ = lower(counted, levels, 3)
    np.testing.assert_array_equal(program.call([levels, trips], mode="strict")[0], jax.jit(counted)(levels, trips))


def test_rows_that_do_not_stand_side_by_side_are_read_and_written_by_vectors():
    table = CHANCE.uniform(size=(128, 3))
    program, _ = lower(strided, table)
    total, rows = program.call([table], mode="strict")
    assert "masked" in program.assembly(mode="strict")[0]
    np.testing.assert_array_equal(rows, table * table[:, 1:2])
    lane = program.call([table], lanes=1, mode="strict")
    np.testing.assert_array_equal(total, lane[0][0])


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("length", [2, 50])
def test_the_rows_of_an_array_are_its_slices(axis, length):
    table = CHANCE.uniform(size=(3, length) if axis == 0 else (length, 3))

    def rows(table):
        stacked = jnp.stack([2.0 * table, jnp.zeros(table.shape)])  # held as given, made by a loop, and constant
        return [*jax.lax.unstack(table, axis), *stacked[0], *jax.lax.unstack(stacked[1], axis), *table.sum(axis)]

    program, _ = lower(rows, table)
    for found, exact in zip(program.call([table], mode="strict"), jax.jit(rows)(table), strict=True):
        np.testing.assert_allclose(found, exact, rtol=1e-15)  # a sum may be ordered otherwise


def test_there_is_no_way_back_through_replaced_arrays():
    arguments = many(80)

    def end(*given):
        return oscillators(*given)[0][2]

    with pytest.raises(lanewise.LoweringError, match="replaces a long array"):
        adjoint(lower(end, *arguments)[0], (3,))
    by_jax = jax.grad(end, 3)(*arguments)
    np.testing.assert_allclose(jax.grad(lanewise.differentiable(end, *arguments), 3)(*arguments), by_jax, rtol=1e-14)
