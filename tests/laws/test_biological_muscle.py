"""The biological muscle: never pushes, finite everywhere, straight-line, and asked like a tension law."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.components import derivative
from mckibben.errors import InputError, NoVolumeError, UnreachableError
from mckibben.muscles.biological import BiologicalMuscle
from mckibben.muscles.law import LawState, TensionLaw

REST = 0.14
# Tension 33.25 N: 35 N/cm^2 on 0.95 cm^2.
MUSCLE = BiologicalMuscle(rest_length=REST, section_area=0.95e-4, maximum_tension_intensity=35e4, maximum_velocity=8.0)
FMAX = 33.25

# Domain and well outside it: 0 to 3 L0, 50 L0/s either way, activations that must be limited.
LENGTHS = st.floats(0.0, 3.0 * REST)
VELOCITIES = st.floats(-50.0 * REST, 50.0 * REST)
ACTIVATIONS = st.floats(-1.0, 2.0)
NODES = REST * np.array([0.0, 0.635, 0.835, 1.0, 1.125, 1.6, 1.825, 3.0])
SPEEDS = 8.0 * REST * np.array([-6.25, -1.0, -0.5, 0.0, 0.5, 1.0, 6.25])
DRIVES = np.array([-1.0, 0.0, 1e-12, 0.5, 1.0, 2.0])


def muscles():
    """Muscles anywhere inside the declared bounds of their shape."""
    return st.builds(
        MUSCLE.replace,
        shortest_active_length=st.floats(0.1, 0.75),
        knee_length=st.floats(0.76, 0.99),
        knee_tension=st.floats(0.0, 1.0),
        plateau_end=st.floats(1.0, 1.4),
        longest_active_length=st.floats(1.41, 3.0),
        passive_onset=st.floats(0.5, 2.0),
        passive_strain=st.floats(0.05, 5.0),
        curvature=st.floats(0.02, 5.0),
        lengthening_tension=st.floats(1.01, 3.0),
        maximum_velocity=st.floats(1e-3, 1e3),
    )


def primitives(closed):
    """Names of all primitives, those of nested programs included."""
    found = set()
    for equation in closed.jaxpr.eqns:
        found.add(equation.primitive.name)
        for value in equation.params.values():
            if hasattr(value, "jaxpr") and hasattr(value.jaxpr, "eqns"):
                found |= primitives(value)
    return found


tension = jax.jit(lambda muscle, x, a, v: muscle.tension(x, a, v))
partials = jax.jit(jax.grad(lambda x, a, v: MUSCLE.tension(x, a, v), argnums=(0, 1, 2)))


@settings(max_examples=200, deadline=None)
@given(muscles(), LENGTHS, ACTIVATIONS, VELOCITIES)
def test_never_pushes_and_is_finite(muscle, length, activation, velocity):
    force = float(tension(muscle, length, activation, velocity))
    assert force >= 0.0 and np.isfinite(force)


@settings(max_examples=200, deadline=None)
@given(LENGTHS, ACTIVATIONS, VELOCITIES)
def test_derivatives_are_finite(length, activation, velocity):
    assert np.isfinite(partials(length, activation, velocity)).all()


def test_derivatives_are_finite_at_every_kink():
    grid = np.stack(np.meshgrid(NODES, DRIVES, SPEEDS), axis=-1).reshape(-1, 3)
    values = jax.vmap(lambda row: jnp.stack(jax.grad(MUSCLE.tension, argnums=(0, 1, 2))(*row)))(grid)
    assert np.isfinite(values).all()


def test_derivatives_with_respect_to_every_parameter_are_finite_at_every_kink():
    grid = np.stack(np.meshgrid(NODES, DRIVES, SPEEDS), axis=-1).reshape(-1, 3)
    of_parameters = jax.vmap(lambda row: jax.grad(lambda m: m.tension(*row))(MUSCLE))(grid)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(of_parameters))


def test_straight_line_without_loops_branches_or_transcendental_functions():
    def step(x, a, u, v):
        return MUSCLE.state(x, a, v), MUSCLE.damping(x, a, v), MUSCLE.activation_rate(a, u)

    used = primitives(jax.make_jaxpr(step)(*[jnp.float64(1.0)] * 4))
    assert {"max", "select_n"} <= used  # nested programs were looked into
    assert not used & {"while", "cond", "scan", "switch", "rem", "argmin", "scatter", "pow", "exp", "gather"}


def test_jit_vmap_and_broadcasting_agree_with_scalars():
    lengths, drives = NODES[:, None], DRIVES[None, :]
    table = np.asarray(MUSCLE.tension(lengths, drives))
    mapped = jax.vmap(jax.vmap(MUSCLE.tension, (None, 0)), (0, None))(NODES, DRIVES)
    compiled = jax.jit(lambda x, a: MUSCLE.tension(x, a))(lengths, drives)
    assert table.shape == (8, 6)
    # The same float64 operations, but compiled code may fuse a product and a sum: a few last bits.
    np.testing.assert_allclose(mapped, table, rtol=1e-14, atol=1e-13)
    np.testing.assert_allclose(compiled, table, rtol=1e-14, atol=1e-13)
    one = [[float(MUSCLE.tension(x, a)) for a in DRIVES] for x in NODES]
    np.testing.assert_allclose(one, table, rtol=1e-14, atol=1e-13)


@settings(max_examples=50, deadline=None)
@given(LENGTHS, ACTIVATIONS, VELOCITIES)
def test_tension_is_the_sum_of_its_parts_and_activation_is_limited(length, activation, velocity):
    state = MUSCLE.state(length, activation, velocity)
    assert isinstance(state, LawState)
    assert float(state.tension) == float(state.active) + float(state.passive)
    limited = MUSCLE.tension(length, min(max(activation, 0.0), 1.0), velocity)
    assert float(state.tension) == float(limited)


def test_without_activation_only_the_passive_part_is_left():
    # Two compilations of the same operations: last bits.
    np.testing.assert_allclose(MUSCLE.tension(NODES, 0.0, -0.3), MUSCLE.elastic_tension(NODES), rtol=1e-13)


def test_largest_isometric_tension_at_rest_length():
    # 35e4 * 0.95e-4 in float64: last bits.
    assert float(MUSCLE.tension(REST, 1.0)) == pytest.approx(FMAX, rel=1e-14)
    assert float(MUSCLE.maximum_tension) == pytest.approx(FMAX, rel=1e-14)


def test_stiffness_and_damping_are_the_slopes_of_tension():
    # Central differences of pieces that are polynomials or one hyperbola: h^2 error below 1e-6 of the scale.
    h = 1e-6 * REST
    for x in REST * np.array([0.7, 0.9, 1.05, 1.3, 1.7]):
        difference = (MUSCLE.tension(x + h, 0.6, -0.1) - MUSCLE.tension(x - h, 0.6, -0.1)) / (2 * h)
        assert float(MUSCLE.stiffness(x, 0.6, -0.1)) == pytest.approx(float(difference), rel=1e-6, abs=1e-4)
        for v in (-0.5, -0.1, 0.2):
            difference = (MUSCLE.tension(x, 0.6, v + h) - MUSCLE.tension(x, 0.6, v - h)) / (2 * h)
            assert float(MUSCLE.damping(x, 0.6, v)) == pytest.approx(float(difference), rel=1e-6)


@settings(max_examples=100, deadline=None)
@given(muscles(), LENGTHS, ACTIVATIONS, VELOCITIES)
def test_damping_is_never_negative(muscle, length, activation, velocity):
    # Sums of non-negative terms; rounding of 1/(c+u)^2 terms cannot change their sign.
    assert float(muscle.damping(length, activation, velocity)) >= 0.0


def test_slack_below_the_free_length_and_taut_above():
    for activation, free in ((0.0, 1.0), (0.3, 0.635), (1.0, 0.635)):
        length = float(MUSCLE.free_length(activation))
        assert length == pytest.approx(free * REST, rel=1e-15)
        below, above = MUSCLE.state(length * 0.99, activation), MUSCLE.state(length * 1.01, activation)
        assert bool(below.slack) and float(below.tension) == 0.0 and float(below.stiffness) == 0.0
        assert float(below.braid_length) == length
        assert not bool(above.slack) and float(above.braid_length) == length * 1.01


def test_overstretched_where_the_filaments_no_longer_overlap():
    assert MUSCLE.overstretched(REST * np.array([1.0, 1.82, 1.83])).tolist() == [False, False, True]
    low, high = MUSCLE.length_range()
    assert float(MUSCLE.active_tension(low, 1.0)) == 0.0
    assert float(MUSCLE.active_tension(high, 1.0)) == 0.0


def test_is_no_tension_law_and_says_that_it_has_no_volume():
    assert not isinstance(MUSCLE, TensionLaw)
    assert not MUSCLE.has_volume()
    assert np.isnan(float(MUSCLE.state(REST, 0.5).volume))
    with pytest.raises(NoVolumeError, match="no gas"):
        MUSCLE.volume(REST, 0.5)


def test_activation_for_a_tension_is_the_inverse_of_tension():
    for x in REST * np.array([0.7, 1.0, 1.3]):
        for wanted in (0.0, 0.37, 1.0):
            pulled = float(MUSCLE.tension(x, wanted, -0.2))
            # Linear in activation: the inverse loses only the bits of one subtraction.
            assert MUSCLE.activation_for(pulled, x, -0.2) == pytest.approx(wanted, abs=1e-9)


def test_unreachable_tensions_are_named():
    with pytest.raises(UnreachableError, match="0 to 33.25 N"):
        MUSCLE.activation_for(34.0, REST)
    with pytest.raises(UnreachableError, match="not reached"):
        MUSCLE.activation_for(1.0, 1.5 * REST)  # the passive part alone pulls more
    for wrong in (-1.0, float("nan")):
        with pytest.raises(InputError, match="0 N or more"):
            MUSCLE.activation_for(wrong, REST)


def test_parameters_out_of_bounds_are_refused():
    with pytest.raises(InputError, match="knee_length"):
        MUSCLE.replace(knee_length=0.5)
    with pytest.raises(InputError, match="lengthening_tension"):
        MUSCLE.replace(lengthening_tension=1.0)


# ---- activation dynamics

EXCITATIONS = st.floats(-1.0, 2.0)
STATES = st.floats(0.0, 1.0)


@settings(max_examples=200, deadline=None)
@given(STATES, EXCITATIONS, st.floats(0.0, 10.0))
def test_activation_stays_between_where_it_was_and_where_it_is_driven(activation, excitation, dt):
    target = min(max(excitation, 0.0), 1.0)
    after = float(MUSCLE.advance_activation(activation, excitation, dt))
    # One rounding of a product of numbers up to 1.
    assert min(activation, target) - 1e-15 <= after <= max(activation, target) + 1e-15


@settings(max_examples=100, deadline=None)
@given(STATES, EXCITATIONS, st.floats(0.0, 0.3), st.floats(0.0, 0.3))
def test_two_steps_of_activation_are_one_long_step(activation, excitation, first, second):
    halfway = MUSCLE.advance_activation(activation, excitation, first)
    twice = float(MUSCLE.advance_activation(halfway, excitation, second))
    # Exact solution of a linear equation: rounding only.
    assert twice == pytest.approx(float(MUSCLE.advance_activation(activation, excitation, first + second)), abs=1e-14)


@pytest.mark.parametrize(("start", "drive", "tau"), [(0.2, 0.9, 0.015), (0.9, 0.2, 0.05)])
def test_activation_rises_and_falls_with_its_own_time_constant(start, drive, tau):
    expected = drive + (start - drive) * np.exp(-1.0)
    assert float(MUSCLE.advance_activation(start, drive, tau)) == pytest.approx(expected, abs=1e-15)
    assert float(MUSCLE.activation_rate(start, drive)) == pytest.approx((drive - start) / tau, rel=1e-14)


def test_rate_is_the_derivative_of_advance_and_finite_at_rest():
    for start, drive in ((0.2, 0.9), (0.9, 0.2), (0.5, 0.5), (0.0, -1.0), (1.0, 2.0)):
        rate = float(derivative(lambda dt, a=start, u=drive: MUSCLE.advance_activation(a, u, dt), 0.0))
        assert rate == pytest.approx(float(MUSCLE.activation_rate(start, drive)), rel=1e-14)
        gradients = jax.grad(MUSCLE.advance_activation, argnums=(0, 1, 2))(start, drive, 0.001)
        assert np.isfinite(gradients).all()
    assert float(MUSCLE.activation_rate(0.5, 0.5)) == 0.0
