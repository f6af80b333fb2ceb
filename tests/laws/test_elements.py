"""Springs, dampers, tendons and delays: passive each, and passive together in parallel and in series."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.components import derivative
from mckibben.errors import InputError
from mckibben.muscles.elements import Delay, Parallel, PassiveSpring, Series, SeriesState, Tendon, Viscous
from mckibben.quantities import declared, to_si

TRIES = settings(max_examples=100, deadline=None, database=None, derandomize=True)
SPRING = PassiveSpring(rest_length=0.1, stiffness=400.0, cubic_stiffness=1e6)
TENDON = Tendon(stiffness=1e5, slack_length=0.02, toe_length=5e-4, loss=0.2)
BESIDE = Parallel((SPRING, Viscous(damping=3.0), Tendon(stiffness=1e3, slack_length=0.11)))
ONE_LENGTH = [SPRING, Viscous(damping=3.0), TENDON, BESIDE]
LENGTHS = np.concatenate([np.linspace(0.0, 0.2, 401), [0.02, 0.0205, 0.1, 0.11, 0.1105]])


@pytest.mark.parametrize("element", ONE_LENGTH)
def test_force_at_rest_is_the_slope_of_the_stored_energy(element):
    force, energy = element.force(LENGTHS), element.stored_energy(LENGTHS)
    np.testing.assert_allclose(force, derivative(element.stored_energy, LENGTHS), rtol=1e-12, atol=1e-12)  # rounding
    assert np.all(np.asarray(energy) >= 0.0)


@TRIES
@given(st.floats(0.0, 0.3), st.floats(-50.0, 50.0), st.floats(0.0, 1e6), st.floats(0.0, 100.0), st.floats(1e-6, 0.05))
def test_velocity_only_ever_opposes_the_motion(length, velocity, stiffness, loss, toe):
    tendon = Tendon(stiffness=stiffness, slack_length=0.1, toe_length=toe, loss=loss)
    for element in (tendon, Viscous(damping=stiffness), Parallel((SPRING, tendon, Viscous(damping=loss)))):
        power = (element.force(length, velocity) - element.force(length)) * velocity
        assert float(power) >= -1e-12 * abs(float(element.force(length)) * velocity)  # rounding of the difference
    assert float(tendon.force(length, velocity)) >= 0.0
    if length <= 0.1:
        assert float(tendon.force(length, velocity)) == 0.0


def test_a_tendon_has_a_soft_toe_and_then_its_stiffness():
    np.testing.assert_allclose(
        TENDON.force(jnp.array([0.0, 0.02, 0.02025, 0.0205, 0.0215])), [0, 0, 6.25, 25, 125], rtol=1e-10
    )
    np.testing.assert_allclose(
        derivative(TENDON.force, jnp.array([0.0199, 0.0201, 0.0206, 0.03])), [0, 2e4, 1e5, 1e5], rtol=1e-9
    )
    # 1 + 0.2 s/m * v; below -5 m/s it has let go (tolerance: 0.0215 - 0.02 keeps 13 digits)
    np.testing.assert_allclose(TENDON.force(0.0215, jnp.array([1.0, -1.0, -5.0, -6.0])), [150, 100, 0, 0], rtol=1e-10)


def test_a_parallel_adds_forces():
    at, v = jnp.array([0.09, 0.112]), jnp.array([0.5, -0.5])
    np.testing.assert_allclose(BESIDE.force(at, v), sum(e.force(at, v) for e in BESIDE.elements), rtol=1e-15)
    nested = Parallel((Parallel((SPRING,)), *BESIDE.elements[1:]))
    np.testing.assert_allclose(nested.force(at, v), BESIDE.force(at, v), rtol=1e-15)
    assert float(Parallel(()).force(0.1)) == 0.0


def rk4(series, state, ends, step):
    """One classic step; `ends` gives length and velocity of the whole at a fraction of the step."""

    def rate(z, at):
        return series.rate(z, *ends(at))

    def add(z, k, w):
        return jax.tree.map(lambda a, b: a + w * step * b, z, k)

    k1 = rate(state, 0.0)
    k2 = rate(add(state, k1, 0.5), 0.5)
    k3 = rate(add(state, k2, 0.5), 0.5)
    k4 = rate(add(state, k3, 1.0), 1.0)
    return jax.tree.map(lambda z, a, b, c, d: z + step / 6 * (a + 2 * b + 2 * c + d), state, k1, k2, k3, k4)


def ring(series, state, length, *, steps, step):
    def one(z, _):
        z = rk4(series, z, lambda _: (length, 0.0), step)
        return z, (series.stored_energy(z, length), series.force(z, length))

    return jax.jit(lambda z: jax.lax.scan(one, z, None, length=steps))(state)


def test_series_without_loss_keeps_its_energy_and_with_a_damper_comes_to_rest():
    lossless = Series((SPRING, PassiveSpring(rest_length=0.02, stiffness=2e3)), mass=0.02)
    start = lossless.initial([0.105])
    before = float(lossless.stored_energy(start, 0.125))
    _, (energy, _) = ring(lossless, start, 0.125, steps=4000, step=1e-4)
    # RK4 at w h = 0.035 loses about (w h)^6/72 a step: 4000 steps make 1e-7.
    np.testing.assert_allclose(energy, before, rtol=1e-6)

    damped = Series((BESIDE, TENDON), mass=0.02)
    start = damped.initial([0.1])
    before = float(damped.stored_energy(start, 0.125))
    state, (energy, force) = ring(damped, start, 0.125, steps=8000, step=1e-4)
    assert float(energy[0]) < before
    assert np.all(np.diff(energy) <= 1e-9 * before)  # rounding and the integrator's error
    pulls = damped.forces(state, 0.125)
    np.testing.assert_allclose(pulls[0], pulls[1], rtol=1e-6)  # at rest all carry the same; 0.8 s of decay
    np.testing.assert_allclose(force[-1], pulls[1], rtol=1e-6)


def test_series_takes_in_the_work_of_its_end():
    """Pulled at its end through slack and back: work = stored + lost, lost >= 0, to the integrator's error."""
    series = Series((BESIDE, TENDON), mass=0.02)
    step, steps = 5e-5, 8000

    def ends(t):
        return 0.115 + 0.015 * jnp.sin(2 * jnp.pi * 5 * t), 0.015 * 2 * jnp.pi * 5 * jnp.cos(2 * jnp.pi * 5 * t)

    def one(z, t):
        after = rk4(series, z, lambda f: ends(t + f * step), step)
        before_power, after_power = (series.force(s, *ends(u)) * ends(u)[1] for s, u in ((z, t), (after, t + step)))
        return after, (0.5 * step * (before_power + after_power), series.stored_energy(after, ends(t + step)[0]))

    start = series.initial([0.1])
    _, (work, energy) = jax.jit(lambda z: jax.lax.scan(one, z, step * jnp.arange(steps)))(start)
    lost = np.cumsum(work) + float(series.stored_energy(start, ends(0.0)[0])) - np.asarray(energy)
    assert lost[-1] > 0.02
    assert np.min(np.diff(lost)) > -1e-9  # J per step: the trapezoid of the power where the tendon comes taut


def test_three_elements_in_series_share_one_force_at_equilibrium():
    springs = [PassiveSpring(rest_length=0.1, stiffness=k) for k in (100.0, 200.0, 400.0)]
    series = Series(tuple(springs), mass=[0.01, 0.03])
    pull = 0.03 / (1 / 100 + 1 / 200 + 1 / 400)
    state = series.initial([0.1 + pull / 100, 0.1 + pull / 200])
    np.testing.assert_allclose(series.forces(state, 0.33), [pull] * 3, rtol=1e-12)
    rate = series.rate(state, 0.33)
    np.testing.assert_allclose(rate.velocity, 0.0, atol=1e-10)  # N rounded, over 10 g
    np.testing.assert_allclose(series.stored_energy(state, 0.33), 0.5 * pull * 0.03, rtol=1e-12)


def test_a_delay_is_whole_samples_of_history():
    for samples in (0, 1, 5):
        delay = Delay(samples)
        buffer, out = delay.initial(7.0), []
        for value in range(10):
            buffer, late = delay.step(buffer, float(value))
            out.append(float(late))
        assert out == [7.0] * samples + [float(v) for v in range(10 - samples)]
    assert Delay.of(time=0.012, sample_period=1e-3).samples == 12
    wide = Delay(2)
    buffer, late = wide.step(wide.initial(jnp.zeros(3)), jnp.arange(3.0))
    assert buffer.shape == (2, 3)
    assert late.shape == (3,)
    for bad in (-1, 1.5, True):
        with pytest.raises(InputError, match="samples"):
            Delay(bad)
    with pytest.raises(InputError, match="multiple"):
        Delay.of(time=0.0123, sample_period=1e-3)
    with pytest.raises(InputError, match="time"):
        Delay.of(time=-1.0, sample_period=1e-3)


def test_batches_derivatives_and_straight_lines():
    series = Series((BESIDE, TENDON), mass=0.02)
    states = SeriesState(jnp.full((4, 1), 0.1), jnp.zeros((4, 1)))
    ends = jnp.linspace(0.1, 0.14, 4), jnp.linspace(-1.0, 1.0, 4)
    batch = series.rate(states, *ends)
    mapped = jax.jit(jax.vmap(series.rate))(states, *ends)
    np.testing.assert_allclose(batch.velocity, mapped.velocity, rtol=1e-12)  # fused multiply-adds
    for element in ONE_LENGTH:
        assert element.force(LENGTHS[:, None], jnp.array([-1.0, 0.0, 1.0])).shape == (len(LENGTHS), 3)
        for length in (0.0, 0.02, 0.0205, 0.1, 0.11, 5.0):
            slopes = jax.tree.leaves(jax.grad(lambda e, x, v: e.force(x, v), argnums=(0, 1, 2))(element, length, -5.0))
            assert all(np.all(np.isfinite(x)) for x in slopes)
    delay = Delay(3)
    for code in (
        jax.make_jaxpr(series.rate)(SeriesState(jnp.full(1, 0.1), jnp.zeros(1)), 0.12, 0.1),
        jax.make_jaxpr(delay.step)(delay.initial(), 1.0),
    ):
        assert not any(word in str(code) for word in ("while", "cond", "scan", "scatter", " pow ", " rem ", "arg"))


def test_parameters_carry_units_and_bounds():
    for kind in (PassiveSpring, Viscous, Tendon, Series):
        for name, q in declared(kind).items():
            assert to_si(1.0, q.unit, q.unit, field=name) == 1.0
            assert q.doc
    with pytest.raises(InputError, match="toe_length"):
        Tendon(stiffness=1e5, toe_length=0.0)
    with pytest.raises(InputError, match="damping"):
        Viscous(damping=-1.0)
