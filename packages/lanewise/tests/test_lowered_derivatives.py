"""Derivatives by JAX of a whole run are runs themselves, and are lowered like them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lanewise
from lowered_systems import positions, rubbing

SAMPLES, INNER = 70, 5  # the signal is long enough to stand in memory, where its derivative is added up in place


def both(function, *arguments):
    by_kernel, by_xla = (lanewise.compile(function, *arguments, engine=e) for e in ("native", "xla"))
    return jax.tree.leaves(by_kernel(*arguments)), jax.tree.leaves(by_xla(*arguments))


def agree(found, want):
    for a, b in zip(found, want, strict=True):
        if a.dtype != jax.dtypes.float0:
            # 350 steps of rounding; the largest of a leaf counts, since a tangent passes through zero
            np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12 * (np.abs(b).max() + 1e-30))


def test_tangents_of_a_run_are_those_of_jax():
    run, arguments = positions(SAMPLES, INNER), rubbing(SAMPLES)
    ones = jax.tree.map(jnp.ones_like, arguments)
    agree(*both(lambda *given: jax.jvp(run, given[:4], given[4:]), *arguments, *ones))


@pytest.mark.slow  # compiles the adjoint by XLA
@pytest.mark.parametrize("recomputed", [False, True])
def test_the_adjoint_of_a_run_is_that_of_jax_signals_included(recomputed):
    run, arguments = positions(SAMPLES, INNER), rubbing(SAMPLES)
    if recomputed:
        run = jax.checkpoint(run)
    bar = jnp.asarray(np.random.default_rng(9).normal(size=SAMPLES + 1))
    found, want = both(lambda *given: jax.vjp(run, *given[:4])[1](given[4]), *arguments, bar)
    agree(found, want)
    assert max(np.abs(a).max() for a in found) > 0.0


def test_a_gradient_per_lane_is_that_of_each_lane():
    run, arguments = positions(20, INNER), rubbing(20)

    def loss(mass, system, *rest):
        return jnp.sum(run(system.replace(mass=mass), *rest) ** 2)

    masses = np.linspace(0.3, 0.7, 5)
    found = lanewise.compile(jax.grad(loss), arguments[0].mass, *arguments, engine="native")(
        masses, *arguments, lanes=5
    )
    by_xla = jax.jit(jax.grad(loss))
    want = [float(by_xla(jnp.asarray(m), *arguments)) for m in masses]
    np.testing.assert_allclose(
        found, want, rtol=1e-10
    )  # 100 steps, amplified by the derivative of a friction's corners
