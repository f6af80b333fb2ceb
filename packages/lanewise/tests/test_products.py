"""Products and straight lines put together anew: the same numbers, with fewer operations where it counts."""

from collections import Counter

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lanewise import lower

FIXED = np.array([0.7, -1.3, 2.1])  # what stays the same in the loop
ROWS = np.random.default_rng(5).uniform(0.5, 2.0, (60, 3)) * np.array([1.0, -1.0, 1.0])


def looped(body):
    """A function of (fixed, rows) that adds up `body(fixed, row)` over the rows, in a loop."""

    def run(fixed, rows):
        return jax.lax.scan(lambda total, row: (total + body(fixed, row), None), jnp.zeros(()), rows)[0]

    return run


def inside(body, mode="default"):
    """The operations of a trip of the loop."""
    program, _ = lower(looped(body), FIXED, ROWS)
    _, plan = program.prepared(mode)
    (nodes,) = plan.bodies.values()
    return Counter(n.op for n in nodes if n.op != "load")


def found(body, mode="default"):
    program, _ = lower(looped(body), FIXED, ROWS)
    return float(program.call([FIXED, ROWS], mode=mode)[0])


def test_nested_quotients_need_one_division():
    count = inside(lambda c, x: x[0] / (c[0] * (x[1] / (c[1] * x[2]))))
    # x0 x2/x1 times what stays the same, and the sum
    assert count["div"] + count["rcp"] == 1 and count["mul"] + count["fma"] + count["add"] <= 3, count


def test_what_stays_the_same_is_multiplied_before_the_loop():
    count = inside(lambda c, x: c[0] * (x[0] * (c[1] * (x[1] * c[2])) * 3.0))
    assert count["mul"] + count["fma"] == 2 and not count["neg"], count


def test_divisors_that_change_share_a_reciprocal_and_one_that_is_wanted_twice_is_taken_once():
    assert sum(inside(lambda c, x: c[0] / x[0] / x[1] / x[2])[op] for op in ("div", "rcp")) == 1
    twice = inside(lambda c, x: jnp.sqrt(c[0] + x[1] / x[0]) + jnp.sqrt(c[2] + x[2] / x[0]))
    assert twice["div"] + twice["rcp"] == 1, twice


def test_what_stands_above_and_below_goes():
    count = inside(lambda c, x: c[0] * (jnp.sqrt(x[0]) / c[0]))
    assert sum(count[op] for op in ("mul", "fma", "div", "rcp")) == 0, count


def test_factors_in_common_are_multiplied_once():
    def body(c, x):
        return jnp.sqrt(jnp.abs(x[0] * (c[0] * x[1]) - 1.0)) + jnp.sqrt(jnp.abs(x[1] * (c[1] * x[0]) + 2.0))

    # x0 x1, and once each what stays the same with the sum
    assert inside(body)["mul"] == 1 and inside(body)["fma"] == 2, inside(body)


def test_a_chain_that_ends_with_a_sum_becomes_one_product_and_one_sum():
    count = inside(lambda c, x: jnp.sqrt(jnp.abs((c[0] - (x[0] - c[1]) * c[2]) / c[0] + 0.5)))
    assert count["fma"] == 1 and count["sub"] + count["div"] + count["mul"] == 0 and count["add"] == 1, count


def test_a_difference_is_zero_where_it_was_zero():
    """What has no sum behind it keeps its difference: two equal pressures drive nothing."""
    same = np.full((60, 3), 0.7)
    program, _ = lower(looped(lambda c, x: (x[0] - c[0]) * c[1] / c[2]), FIXED, same)
    assert float(program.call([FIXED, same])[0]) == 0.0


names = st.sampled_from([f"{kind}{i}" for kind in "cx" for i in range(3)])
expressions = st.recursive(
    names,
    lambda inner: st.one_of(st.tuples(st.sampled_from("+-*/"), inner, inner), st.tuples(st.sampled_from("nqk"), inner)),
    max_leaves=16,
)


def value(tree, c, x):
    """An expression's value, all positive under divisions and roots."""
    if isinstance(tree, str):
        return (c if tree[0] == "c" else x)[int(tree[1])]
    a = value(tree[1], c, x)
    if tree[0] == "n":
        return -a
    if tree[0] == "k":
        return 1.5 * a
    if tree[0] == "q":
        return jnp.sqrt(1.0 + a * a)
    b = value(tree[2], c, x)
    if tree[0] == "/":
        return a / (jnp.abs(b) + 0.5)
    return {"+": a + b, "-": a - b, "*": a * b}[tree[0]]


@settings(max_examples=25, deadline=None)
@given(tree=expressions)
def test_any_expression_keeps_its_value(tree):
    def body(c, x):
        return value(tree, c, x)

    exact = found(body, "strict")
    size = found(lambda c, x: value_of_sizes(tree, c, x), "strict")
    for mode in ("default", "fast"):
        # a few units for each of at most 40 operations, of the sum of all that is added in 60 trips
        assert found(body, mode) == pytest.approx(exact, abs=1e-14 * size)


def value_of_sizes(tree, c, x):
    """The value with every difference as a sum of sizes: what its rounding is measured by."""
    if isinstance(tree, str):
        return jnp.abs((c if tree[0] == "c" else x)[int(tree[1])])
    a = value_of_sizes(tree[1], c, x)
    if tree[0] in "nkq":
        return {"n": a, "k": 1.5 * a, "q": 1.0 + a}[tree[0]]
    b = value_of_sizes(tree[2], c, x)
    if tree[0] == "/":
        return a * (1.0 + b) / (jnp.abs(value(tree[2], c, x)) + 0.5) ** 2
    return a * b if tree[0] == "*" else a + b
