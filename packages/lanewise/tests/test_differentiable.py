"""A kernel as a JAX function: whatever JAX does with the function itself, it does with the kernel, to rounding."""

import functools
import time
from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from lanewise import ArgumentError, LoweringError, _in_xla, differentiable
from lowered_systems import positions, rubbing

SAMPLES, INNER = 40, 4
RUN, (SYSTEM, STATE, MEMORY, SIGNALS) = positions(SAMPLES, INNER), rubbing(SAMPLES)
VALUES = jnp.array([0.5, 0.02, 2.1e5])  # mass, position, pressure


@functools.cache
def kernel():
    return differentiable(RUN, SYSTEM, STATE, MEMORY, SIGNALS, engine="native")


def predicted(run, values):
    mass, x, p = values
    return run(SYSTEM.replace(mass=mass), {**STATE, "x": x, "p": p}, MEMORY, SIGNALS)


def cost(run, values):
    return jnp.sum(predicted(run, values) ** 2)


def scaled(run, scale, values):
    return scale * predicted(run, scale * values)


MANY = VALUES * jnp.linspace(0.9, 1.1, 6)[:, None]
SCALES = jnp.array([0.95, 1.05])
SLOW = ("one for all", "twice mapped forwards", "more directions than a kernel takes")  # XLA compiles long for these
USES = {
    "itself": lambda run: predicted(run, VALUES),
    "compiled": lambda run: jax.jit(lambda v: predicted(run, v))(VALUES),
    "mapped": lambda run: jax.vmap(lambda v: predicted(run, v))(MANY),
    "gradient": lambda run: jax.jit(jax.grad(lambda v: cost(run, v)))(VALUES),
    "gradients": lambda run: jax.vmap(jax.grad(lambda v: cost(run, v)))(MANY),
    "one for all": lambda run: jax.grad(lambda v: jax.vmap(lambda s: jnp.sum(scaled(run, s, v)))(SCALES).sum())(VALUES),
    "shared": lambda run: jax.vmap(
        jax.grad(lambda m, x: cost(run, jnp.stack([m, x, 2e5])), (0, 1)), (0, None)
    )(MANY[:, 0], 0.02),
    "direction": lambda run: jax.jvp(lambda v: predicted(run, v), (VALUES,), (0.1 * VALUES,)),
    "forwards": lambda run: jax.jacfwd(lambda v: predicted(run, v))(VALUES),
    "backwards": lambda run: jax.jacrev(lambda v: predicted(run, v))(VALUES),
    "mapped forwards": lambda run: jax.jit(jax.vmap(jax.jacfwd(lambda v: predicted(run, v))))(MANY),
    "twice mapped forwards": lambda run: jax.vmap(
        lambda s: jax.vmap(jax.jacfwd(lambda v: scaled(run, s, v)))(MANY)
    )(SCALES),
    "more directions than a kernel takes": lambda run: jax.vmap(
        lambda v: jax.vmap(lambda t: jax.jvp(lambda w: predicted(run, w), (v,), (t,))[1])(MANY)
    )(MANY[:2]),
}  # fmt: skip


@pytest.mark.parametrize("use", [pytest.param(use, marks=pytest.mark.slow) if use in SLOW else use for use in USES])
def test_it_is_used_as_the_function_is(use):
    found, want = (jax.tree.leaves(USES[use](run)) for run in (kernel(), RUN))
    for a, b in zip(found, want, strict=True):
        assert a.shape == b.shape
        scale = np.abs(b).max(axis=tuple(range(b.ndim - 1)), keepdims=True) if b.ndim > 1 else np.abs(b).max()
        # 160 steps of rounding; of the columns of a Jacobian each by its own largest
        np.testing.assert_allclose(a / scale, b / scale, rtol=0.0, atol=1e-12)


def test_without_a_kernel_it_is_the_function_itself():
    chosen = differentiable(lambda x: jnp.sort(jnp.outer(x, x).ravel()), jnp.arange(9.0))

    np.testing.assert_array_equal(chosen(jnp.arange(9.0))[-1], 64.0)


def test_whole_numbers_among_the_results_have_no_derivative():
    run = differentiable(lambda x, n: (x * n, (3.0 * x).astype(int) + n), 0.5, 3, engine="native")
    found, changed = jax.jvp(lambda x: run(x, 3), (0.7,), (1.0,))
    assert (float(found[0]), int(found[1])) == (0.7 * 3, 5)
    assert float(changed[0]) == 3.0
    assert changed[1].dtype == jax.dtypes.float0


def test_what_no_kernel_does_is_refused():
    with pytest.raises(LoweringError, match="derivative of a derivative"):
        jax.hessian(lambda v: cost(kernel(), v))(VALUES)
    with pytest.raises(ArgumentError, match="trees like the examples"):
        kernel()(SYSTEM, STATE, MEMORY)
    with pytest.raises(ArgumentError, match="must have the shape"):
        predicted(kernel(), jnp.ones((3, 2)))


def test_a_run_of_one_is_called_by_xla_itself_with_the_bits_of_the_kernel():
    # a call of Python costs more than a short kernel: neither the run nor its gradient has one
    forward = jax.jit(lambda v: predicted(kernel(), v))
    backward = jax.jit(jax.grad(lambda v: cost(kernel(), v)))
    for function in (forward, backward):
        text = function.lower(VALUES).as_text()
        assert "lanewise_" in text and "callback" not in text
    assert np.array_equal(forward(VALUES), predicted(kernel(), VALUES))  # that without jit is by a call of Python
    mapped = jax.jit(jax.vmap(lambda v: predicted(kernel(), v)))
    assert "callback" in mapped.lower(MANY).as_text()  # lanes are spread over threads there


def test_threads_that_compile_the_same_call_at_once_do_not_hinder_each_other(monkeypatch):
    made, usual = [], _in_xla._frame_reader

    def slowly(*given):
        made.append(given)
        time.sleep(0.05)  # a moment in which all threads ask
        return usual(*given)

    monkeypatch.setattr(_in_xla, "_frame_reader", slowly)
    own = differentiable(lambda v: jnp.sin(3.0 * v), VALUES, engine="native")  # that no other test has called
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: jax.jit(lambda v: own(v))(VALUES), range(4)))
    assert len(made) == 1 and all(np.array_equal(one, found[0]) for one in found)
