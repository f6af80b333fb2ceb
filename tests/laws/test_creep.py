"""Viscoelastic elements: passive, exact for any step, and slow in the way of their time constants."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from mckibben.errors import InputError
from mckibben.muscles.elements import KelvinVoigtChain, MaxwellChain
from mckibben.quantities import declared, to_si

TRIES = settings(max_examples=50, deadline=None, database=None, derandomize=True)
MAXWELL = MaxwellChain(stiffness=[500.0, 300.0, 100.0], time_constant=[0.05, 0.7, 9.0])
KELVIN = KelvinVoigtChain(compliance=[1e-5, 2e-5, 3e-5], time_constant=[0.05, 0.7, 9.0])
STEPS = st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-6.0, 2.0)), min_size=20, max_size=20)


def chains(kind, value):
    return st.builds(
        lambda a, t: kind(**{value: a, "time_constant": t}),
        st.lists(st.floats(1e-6, 10.0), min_size=3, max_size=3),
        st.lists(st.floats(1e-3, 1e3), min_size=3, max_size=3),
    )


@jax.jit
def follow(chain, drives, durations):
    """Ledger, stored energy and state along a path of displacements [m] or forces [N]."""

    def one(state, piece):
        out = chain.advance(state, piece[0], duration=piece[1])
        return out.state, (out.work, out.dissipated, chain.stored_energy(out.state), out.state)

    return jax.lax.scan(one, chain.initial(), (drives, durations))[1]


@pytest.mark.parametrize(("kind", "value"), [(MaxwellChain, "stiffness"), (KelvinVoigtChain, "compliance")])
def test_no_path_yields_work(kind, value):
    @TRIES
    @given(chains(kind, value), STEPS)
    def check(chain, pieces):
        drives, durations = np.array([d for d, _ in pieces]), 10.0 ** np.array([t for _, t in pieces])
        work, lost, energy, _ = (np.asarray(x) for x in follow(chain, drives, durations))
        scale = 1e-12 * np.sum(np.abs(work) + energy)  # rounding of sums of such terms
        assert np.all(lost >= 0.0)
        assert np.all(np.cumsum(work) >= energy - scale)
        np.testing.assert_allclose(np.cumsum(work - lost), energy, rtol=0.0, atol=scale)

    check()


@pytest.mark.parametrize("duration", [1e-6, 5e-5, 1e-3, 0.004, 0.0051, 0.06, 0.08, 0.2, 5.0, 1e3])
def test_maxwell_work_is_force_times_displacement(duration):
    """The closed ledger against the integral of the force over a step, on both sides of its series."""
    dx, start = 2e-3, np.array([1e-3, -0.5e-3, 0.2e-3])
    out = MAXWELL.advance(start, dx, duration=duration)

    def force(t):
        return float(MAXWELL.force(MAXWELL.advance(start, dx * t / duration, duration=t).state))

    edges = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 25) * duration])  # resolves every time constant
    parts = [quad(force, a, b, epsrel=1e-10, epsabs=1e-18)[0] for a, b in zip(edges, edges[1:], strict=False)]
    assert float(out.work) == pytest.approx(sum(parts) * dx / duration, rel=1e-9)  # quadrature; the series is 1e-10


@pytest.mark.parametrize("chain", [MAXWELL, KELVIN])
def test_one_step_is_many(chain):
    """Exact for a constant velocity or force, so that the step does not matter; ledger included."""
    start = np.array([1e-3, -0.5e-3, 0.2e-3])
    for duration, drive in [(0.02, 1e-3), (3.0, 5e-3), (100.0, -5e-3)]:
        parts = 64
        share = drive / parts if chain is MAXWELL else drive * 1e4
        whole = chain.advance(start, drive if chain is MAXWELL else drive * 1e4, duration=duration)
        state, work, lost = start, 0.0, 0.0
        for _ in range(parts):
            out = chain.advance(state, share, duration=duration / parts)
            state, work, lost = out.state, work + out.work, lost + out.dissipated
        np.testing.assert_allclose(state, whole.state, rtol=1e-11, atol=1e-16)  # 64 roundings
        np.testing.assert_allclose([work, lost], [whole.work, whole.dissipated], rtol=1e-9)  # the series' 1e-10


def test_the_equations_are_those_of_an_independent_solver():
    k, tau = np.asarray(MAXWELL.stiffness), np.asarray(MAXWELL.time_constant)
    compliance = np.asarray(KELVIN.compliance)
    options = {"rtol": 1e-10, "atol": 1e-14, "method": "Radau"}
    maxwell = solve_ivp(lambda t, z: 0.01 - z / tau, (0, 2.0), np.zeros(3), **options)
    kelvin = solve_ivp(lambda t, e: (compliance * 50.0 - e) / tau, (0, 2.0), np.zeros(3), **options)
    ours = MAXWELL.advance(MAXWELL.initial(), 0.02, duration=2.0).state
    np.testing.assert_allclose(ours, maxwell.y[:, -1], rtol=1e-8)  # the solver's tolerance
    np.testing.assert_allclose(MAXWELL.force(ours), np.sum(k * maxwell.y[:, -1]), rtol=1e-8)
    other = KELVIN.advance(KELVIN.initial(), 50.0, duration=2.0).state
    np.testing.assert_allclose(KELVIN.extension(other), np.sum(kelvin.y[:, -1]), rtol=1e-8)


def test_without_time_maxwell_elements_are_springs_and_kelvin_voigt_elements_are_rigid():
    out = MAXWELL.advance(MAXWELL.initial(), 2e-3, duration=0.0)
    np.testing.assert_allclose(MAXWELL.force(out.state), 900.0 * 2e-3, rtol=1e-15)
    np.testing.assert_allclose(out.work, 0.5 * 900.0 * 4e-6, rtol=1e-15)
    assert float(out.dissipated) == 0.0
    rigid = KELVIN.advance(KELVIN.initial(), 50.0, duration=0.0)
    assert float(KELVIN.extension(rigid.state)) == float(rigid.work) == 0.0


def test_after_a_long_time_maxwell_elements_let_go_and_kelvin_voigt_elements_give_way():
    held = MAXWELL.advance(MAXWELL.initial(), 2e-3, duration=0.0).state
    relaxed = MAXWELL.advance(held, 0.0, duration=1e4)
    assert float(MAXWELL.force(relaxed.state)) == 0.0  # exp(-1100) is zero
    np.testing.assert_allclose(relaxed.dissipated, MAXWELL.stored_energy(held), rtol=1e-12)
    assert float(relaxed.work) == pytest.approx(0.0, abs=1e-18)
    given_way = KELVIN.advance(KELVIN.initial(), 50.0, duration=1e4).state
    np.testing.assert_allclose(KELVIN.extension(given_way), 50.0 * 6e-5, rtol=1e-12)


def test_second_order_for_a_varying_drive():
    """A sine in steps of constant velocity, or of its mean force: halving the step quarters the error."""
    for chain, read in [(MAXWELL, MAXWELL.force), (KELVIN, KELVIN.extension)]:
        ends = []
        for steps in (50, 100, 200, 3200):
            t = np.linspace(0.0, 2.0, steps + 1)
            x = np.sin(3.0 * t)
            drive = np.diff(x) if chain is MAXWELL else 0.5 * (x[1:] + x[:-1])
            ends.append(float(read(follow(chain, drive, np.diff(t))[3][-1])))
        errors = np.abs(np.array(ends[:3]) - ends[3])
        assert np.all(np.abs(np.log2(errors[:-1] / errors[1:]) - 2.0) < 0.1)  # the next term is two orders smaller


def test_a_muscle_at_constant_pressure_creeps_from_8_2_to_9_98_mm_in_four_seconds():
    """Standard linear solid, a muscle with one Maxwell element beside it, pulled by the gas alone: its closed form."""
    stiffness, pull, first, settled = 1e3, 10.2, 8.2e-3, 10.2e-3  # the stroke at once, and after a long time
    creep_time = 4.0 / np.log((settled - first) / (settled - 9.98e-3))
    chain = MaxwellChain(stiffness=[stiffness * (settled / first - 1.0)], time_constant=[creep_time * first / settled])
    state, stroke, steps = chain.initial(), 0.0, 400
    for duration in [0.0] + [4.0 / steps] * steps:
        # Balance of forces at the end of the step; linear in the displacement, so two trials give it.
        trials = [float(chain.force(chain.advance(state, dx, duration=duration).state)) for dx in (0.0, 1.0)]
        dx = (pull - stiffness * stroke - trials[0]) / (stiffness + trials[1] - trials[0])
        state, stroke = chain.advance(state, dx, duration=duration).state, stroke + dx
        if duration == 0.0:
            assert stroke == pytest.approx(first, rel=1e-12)
    assert stroke == pytest.approx(9.98e-3, rel=1e-6)  # second order: (4 s/400/1.8 s)^2/12 of the creep of 1.8 mm


def test_geometric_times():
    chain = MaxwellChain.geometric(stiffness=600.0, shortest=0.1, longest=10.0, elements=3)
    np.testing.assert_allclose(chain.time_constant, [0.1, 1.0, 10.0], rtol=1e-14)
    np.testing.assert_allclose(jnp.sum(chain.stiffness), 600.0, rtol=1e-15)
    one = KelvinVoigtChain.geometric(compliance=1e-4, shortest=0.1, longest=10.0, elements=1)
    np.testing.assert_allclose(one.time_constant, [1.0], rtol=1e-14)
    with pytest.raises(InputError, match="elements"):
        MaxwellChain.geometric(stiffness=1.0, shortest=0.1, longest=1.0, elements=0)
    with pytest.raises(InputError, match="time_constant"):
        MaxwellChain(stiffness=[1.0], time_constant=[0.0])


@pytest.mark.parametrize("chain", [MAXWELL, KELVIN])
def test_batches_derivatives_and_straight_lines(chain):
    drives, durations = jnp.array([1e-3, -2e-3, 0.0]), jnp.array([0.0, 1e-3, 50.0])
    states = jnp.broadcast_to(chain.initial(), (3, 3)) + 1e-4
    batch = chain.advance(states, drives, duration=durations)
    mapped = jax.jit(jax.vmap(lambda z, d, t: chain.advance(z, d, duration=t)))(states, drives, durations)
    for a, b in zip(batch, mapped, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-20)  # fused multiply-adds

    def total(c, d, t):
        out = follow(c, d, t)
        return jnp.sum(out[0]) + jnp.sum(out[1]) + jnp.sum(out[3])

    for d, t in [(np.zeros(4), np.zeros(4)), (np.full(4, 1e-3), np.zeros(4)), (np.full(4, 1.0), np.full(4, 1e5))]:
        slopes = jax.tree.leaves(jax.grad(total, argnums=(0, 1, 2))(chain, d, t))
        assert all(np.all(np.isfinite(x)) for x in slopes)
    text = str(jax.make_jaxpr(lambda z, d, t: chain.advance(z, d, duration=t))(chain.initial(), 1e-3, 1e-3))
    assert not any(word in text for word in ("while", "cond", "scan", "scatter", " pow ", " rem ", "arg"))
    for name, q in declared(chain).items():
        assert to_si(1.0, q.unit, q.unit, field=name) == 1.0
