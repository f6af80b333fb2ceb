"""Whatever a function is made of, its kernel gives JAX's numbers: loops, tables, choices, shapes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lanewise
from lanewise import lower

CHANCE = np.random.default_rng(5)
TABLE = jnp.asarray(CHANCE.uniform(size=200))


def nested(a, xs):
    def sample(carry, row):
        inner = jax.lax.fori_loop(0, 7, lambda i, c: c * 0.9 + row[0] * i / 7.0 + TABLE[i], carry)
        return inner, (inner + row[1], carry * 2.0)

    return jax.lax.scan(sample, a, xs)


def backwards(a, xs):
    return jax.lax.scan(lambda c, x: (0.5 * c + x.sum(), c), a, xs, reverse=True)


def counted(a, n):
    return jax.lax.fori_loop(0, n, lambda i, c: c * 1.1 + i, a)


def chosen(a, k):
    branches = [lambda x: x, lambda x: x * x, lambda x: jnp.sqrt(jnp.abs(x))]
    return jax.lax.switch(k, branches, a), jnp.select([a > 1.0, a > 0.5], [1.0, 2.0], 3.0)


def looked_up(a, k):
    own = jnp.stack([a, a + 1.0, a * 2.0, a - 3.0, a * a, -a])
    return own[k], TABLE[5 * k], own[k + 4], jnp.argmax(own), jnp.argmin(own)


def history(a, xs):
    def sample(past, x):
        past = jnp.append(past[1:], x)
        return past, past[jnp.floor(3.0 * jnp.abs(x)).astype(int)] + past.max() + past.min()

    return jax.lax.scan(sample, jnp.full((5,), a), xs[:, 0])


def shapes(a, xs):
    top = xs[:4]
    return (
        top @ top.T, jnp.concatenate([xs[:, 0], a[None]]), top.reshape(-1)[::-1], jnp.cumsum(top, 0),
        jnp.pad(top[0], (1, 2)), top.T[1], jnp.sum(xs), xs.max(), jnp.sort(top[:, 0]), xs * a + 1.0,
        jnp.linalg.solve(top[:2, :2] + 3.0 * jnp.eye(2), top[:2, 1]), jnp.zeros(4).at[1].set(a).at[2].add(3.0),
    )  # fmt: skip


def elementary(a, xs):
    x = xs[:3, 0]
    any_sign = (jnp.exp, jnp.expm1, jnp.sin, jnp.cos, jnp.tan, jnp.tanh, jnp.sign, jnp.round, jnp.floor, jnp.ceil)
    positive = (jnp.log, jnp.log1p, jnp.sqrt, jax.lax.rsqrt, jax.nn.sigmoid, lambda v: v**1.11, lambda v: v**-3)
    return [f(x) for f in any_sign], [f(jnp.abs(x) + a) for f in positive]


CASES = {
    "nested": (nested, (1.0, (30, 2))), "backwards": (backwards, (1.0, (30, 2))), "history": (history, (0.3, (30, 2))),
    "shapes": (shapes, (0.7, (90, 2))), "elementary": (elementary, (0.2, (3, 1))), "counted": (counted, (1.0, 13)),
    "chosen": (chosen, (0.8, 1)), "looked up": (looked_up, (0.8, 1)),
}  # fmt: skip


def example(kind):
    if isinstance(kind, tuple):
        return np.random.default_rng(6).uniform(-1.0, 1.0, kind)
    return np.asarray(kind)


@pytest.mark.parametrize("mode", ["strict", "default", "fast"])
@pytest.mark.parametrize("name", CASES)
def test_a_kernel_gives_what_jax_gives(name, mode):
    function, kinds = CASES[name]
    arguments = [example(k) for k in kinds]
    want = jax.tree.leaves(jax.jit(function)(*arguments))
    found = jax.tree.leaves(lanewise.compile(function, *arguments, engine="native")(*arguments, mode=mode))
    for a, b in zip(found, want, strict=True):
        # some tens of roundings, of numbers near one
        np.testing.assert_allclose(a, b, rtol=2e-14, atol=2e-15)


@pytest.mark.parametrize("name", ["nested", "history", "shapes", "looked up", "chosen"])
def test_lanes_may_differ_in_numbers_in_rows_and_in_what_they_look_up(name):
    function, kinds = CASES[name]
    lanes = 11
    arguments = [example(k) for k in kinds]
    chance = np.random.default_rng(7)
    spread = [
        np.repeat(a[..., None], lanes, -1) + (chance.uniform(-0.2, 0.2, (*a.shape, lanes)) if a.dtype == float else 0)
        for a in arguments
    ]
    if kinds[1] == 1:
        spread[1] = np.arange(lanes) % 3  # places in a table, or branches
    run, by_xla = (lanewise.compile(function, *arguments, engine=e) for e in ("native", "xla"))
    for a, b in zip(
        jax.tree.leaves(run(*spread, lanes=lanes)), jax.tree.leaves(by_xla(*spread, lanes=lanes)), strict=True
    ):
        np.testing.assert_allclose(a, b, rtol=2e-13, atol=2e-14)  # as above; a small system is solved


def test_a_count_of_trips_is_an_argument():
    program, _ = lower(counted, 1.0, 3)
    for n in (0, 1, 5, 40):
        assert program.call([1.0, n])[0] == pytest.approx(float(counted(1.0, n)), rel=1e-14)


def test_float32_kernels_agree_to_float32_rounding():
    arguments = [example(k) for k in CASES["elementary"][1]]
    run = lanewise.compile(elementary, *arguments, engine="native")
    for a, b in zip(jax.tree.leaves(run(*arguments, real="float32")), jax.tree.leaves(run(*arguments)), strict=True):
        assert a.dtype == np.float32
        np.testing.assert_allclose(a, b, rtol=2e-6, atol=1e-6)


def test_what_nobody_asks_for_is_not_computed():
    """A carried value that feeds nothing but itself, and what is computed for it, vanish; so do rows that nobody reads."""

    def whole(a, xs):
        def sample(carry, x):
            x, cost = carry[0] + x, carry[1] + jnp.exp(carry[0])
            return (x, cost), jnp.sqrt(jnp.abs(cost))

        return jax.lax.scan(sample, (a, 0.0), xs)

    arguments = 0.5, np.ones(300)
    graph = lower(lambda *a: whole(*a)[0][0], *arguments)[0].graph
    assert {"exp", "sqrt"} <= {n.op for n in lower(whole, *arguments)[0].graph.nodes}
    assert not {"exp", "sqrt"} & {n.op for n in graph.nodes}
    assert [len(x.phis) for x in graph.loops] == [1]
    assert not any(x.stores for x in graph.loops)


def test_what_a_loop_does_not_change_is_computed_before_it():
    def slow(a, xs):
        return jax.lax.scan(lambda c, x: (c * jnp.exp(a) + jnp.sqrt(a) / a * x, c), a, xs)

    graph, plan = lower(slow, 0.5, np.ones(300))[0].prepared()
    (loop,) = plan.live.loops
    inside = {e.op for e in plan.bodies[loop] if hasattr(e, "op")}
    assert inside <= {"load", "mul", "add", "fma"}


def test_equal_operations_are_one():
    def twice(a, b):
        return jnp.sin(a * b) + 1.0, 2.0 * jnp.sin(b * a)

    assert sum(n.op == "sin" for n in lower(twice, 1.0, 2.0)[0].graph.nodes) == 1


def test_what_is_called_twice_alike_is_followed_once():
    """Without it this one is followed 2^40 times; it is what derivatives of functions that call others look like."""

    def called(function):
        return jax.jit(lambda x: 0.5 * function(x) + 0.25 * function(x))

    outer = jnp.sin
    for _ in range(40):
        outer = called(outer)
    program, _ = lower(outer, 1.0)
    np.testing.assert_allclose(program.call([0.3])[0], 0.75**40 * np.sin(0.3), rtol=1e-14)  # exact but for the sine


def test_a_loop_that_is_called_twice_alike_gives_its_result_twice():
    """Its nodes belong to the loop that is open where it is called, so it is made anew: within one, and behind it."""

    @jax.jit
    def grown(x):
        return jax.lax.fori_loop(0, 50, lambda i, c: c * 1.01 + i, x)

    def inside(x, n):
        return jax.lax.fori_loop(0, n, lambda i, c: c + grown(x), 0.0), grown(x), grown(x)

    program, _ = lower(inside, 1.0, 3)
    summed, first, second = program.call([0.5, 3])
    assert first == second == pytest.approx(float(grown(0.5)), rel=1e-14)  # rounding of 50 products
    assert summed == pytest.approx(3.0 * first, rel=1e-15)  # and of two sums
