"""What friction remembers: the rising path is kept and the loop narrowed when the range is halved, as in Fig. 3b."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.muscles.hysteresis import BoucWen, Coulomb, Dahl, FrictionLimit, MaxwellSlip, PlayMap, PrandtlIshlinskii

TRIES = settings(max_examples=40, deadline=None, database=None, derandomize=True)
LIMIT = FrictionLimit(constant=0.5, per_pressure=4e-6)  # 2.5 N at 5 bar
PRESSURE, TRAVEL = 5e5, 4e-3
RANGE, STEPS = 8 * TRAVEL, 400  # from the lower end, and the steps in one rise over the whole range
GRADUAL = [
    Dahl(limit=LIMIT, stiffness=2.5 / TRAVEL),
    BoucWen(limit=LIMIT, stiffness=2.5 / TRAVEL, share=0.7, exponent=1),
    BoucWen(limit=LIMIT, stiffness=2.5 / TRAVEL, exponent=2),
]
SLIPPING = [
    MaxwellSlip.geometric(LIMIT),
    MaxwellSlip.geometric(LIMIT, elements=3, longest=RANGE / 4),
    PrandtlIshlinskii(weight=[500.0, 100.0, 30.0], threshold=[1e-3, 5e-3, 12e-3]),
]


@jax.jit
def forces(friction, moves):
    """Friction force after each displacement at constant pressure, from a relaxed start."""

    def one(state, dx):
        state = friction.advance(state, dx, start_pressure=PRESSURE, end_pressure=PRESSURE, duration=1e-3).state
        return state, friction.force(state, dx / 1e-3, PRESSURE)

    return jax.lax.scan(one, friction.initial(), moves)[1]


def large_then_small(friction):
    """The rising and falling path of the large loop, then of the small one; falls are turned round, shortest first."""
    step, half = RANGE / STEPS, STEPS // 2
    large = [np.full(STEPS, step), np.full(STEPS, -step)]
    small = [np.full(half, step), np.full(half, -step)]
    force = np.asarray(forces(friction, np.concatenate(large * 3 + small * 3)))
    last_large, last_small = force[4 * STEPS : 6 * STEPS], force[-STEPS:]
    return (last_large[:STEPS], last_large[STEPS:][::-1]), (last_small[:half], last_small[half:][::-1])


def height(loop) -> float:
    """Rise over fall in the middle of the loop; the rise's first point is one step up, the fall's none."""
    rise, fall = loop
    middle = len(rise) // 2
    return float(rise[middle] - fall[middle + 1])


def kept(large, small) -> float:
    """The largest difference of the rising paths on the lengths of the small loop [N]."""
    return float(np.max(np.abs(small[0] - large[0][: STEPS // 2])))


@pytest.mark.parametrize("friction", SLIPPING)
def test_slipping_contacts_keep_the_rising_path_exactly_and_narrow_the_loop(friction):
    large, small = large_then_small(friction)
    assert kept(large, small) < 1e-9  # return-point memory; 400 roundings of 32 mm times the stiffness
    assert height(small) < 0.9 * height(large)
    assert np.all(small[1][:-1] >= large[1][: STEPS // 2 - 1])  # another falling path, nearer to the rising one


@pytest.mark.parametrize("friction", GRADUAL)
def test_gradual_friction_keeps_the_rising_path_as_far_as_it_was_saturated(friction):
    large, small = large_then_small(friction)
    # The fall over half the range, four travels, leaves exp(-3) of the limit: one travel to let go, three to load.
    assert kept(large, small) < np.exp(-3.0) * 2.5
    assert height(small) < 0.9 * height(large)


def test_dahls_loops_are_as_high_as_its_exponential_says():
    """A steady loop over X turns at tanh(X/2d) of the limit: height 2 - 2 (1 + tanh(X/2d)) exp(-X/2d) in its middle."""
    for loop, travels in zip(large_then_small(GRADUAL[0]), (8.0, 4.0), strict=True):
        end = np.tanh(travels / 2)
        # The middle is a step off the centre, where both paths are parallel; steps of d/50 err by 1/50^2/12.
        assert height(loop) == pytest.approx(2.5 * (2 - 2 * (1 + end) * np.exp(-travels / 2)), rel=1e-3)


def test_coulomb_friction_has_no_memory_to_narrow_a_loop_with():
    large, small = large_then_small(Coulomb(limit=LIMIT))
    assert kept(large, small) == 0.0
    assert height(small) == height(large) == 5.0


@pytest.mark.parametrize("friction", SLIPPING)
def test_slipping_contacts_close_minor_loops_and_gradual_friction_does_not(friction):
    """Up, a little back, and up to the same length again: the same force; Dahl and Bouc-Wen come back elsewhere."""
    path = np.concatenate([np.full(60, 1e-4), np.full(10, -1e-4), np.full(10, 1e-4)])
    force = forces(friction, path)
    np.testing.assert_allclose(force[-1], force[59], rtol=1e-12)  # roundings of 80 steps
    for gradual in GRADUAL:
        drifted = forces(gradual, path)
        assert abs(float(drifted[-1] - drifted[59])) > 1e-3


@TRIES
@given(st.lists(st.floats(-30e-3, 30e-3), min_size=8, max_size=8))
def test_a_larger_turning_point_wipes_out_the_smaller_ones(moves):
    """After a motion beyond every travel the past is forgotten, whatever it was."""
    friction = SLIPPING[0]
    far = 2 * 8e-3  # from one side of the longest travel to the other
    force = forces(friction, np.array([*moves, far, -1e-3, 0.5e-3]))
    fresh = forces(friction, np.array([0.0] * 8 + [far, -1e-3, 0.5e-3]))
    np.testing.assert_allclose(force[-3:], fresh[-3:], rtol=1e-12)  # roundings


# ---- the map from pressure to stroke

MAP = PlayMap(
    weight=[2e-8, 3e-8, 2e-8],
    threshold=[0.0, 0.4e5, 1e5],
    widening=1e-6,
    hinge=[0.01, 0.02],
    bend=[0.5, -0.8],
)


@jax.jit
def strokes(play, pressures, state):
    def one(state, ends):
        state = play.advance(state, start_pressure=ends[0], end_pressure=ends[1])
        return state, play.output(state, ends[1])

    return jax.lax.scan(one, state, (pressures[:-1], pressures[1:]))[1]


@TRIES
@given(st.lists(st.floats(0.0, 8e5), min_size=6, max_size=6))
def test_the_stroke_map_knows_no_step_and_never_falls_while_the_pressure_rises(turns):
    turns = np.array([0.0, *turns])
    fine = np.interp(np.arange(121), np.arange(7) * 20, turns)
    coarse, all_of = strokes(MAP, turns, MAP.initial()), strokes(MAP, fine, MAP.initial())
    np.testing.assert_allclose(all_of[19::20], coarse, rtol=0.0, atol=1e-14)  # 20 roundings of 1e6 Pa times 1e-7 m/Pa
    rises = np.sign(np.diff(fine[1:]))
    assert np.all(np.diff(all_of) * rises >= -1e-15)


def test_the_stroke_map_is_the_input_without_its_stops():
    play = PlayMap(weight=[1e-8], threshold=[1e5])
    stop = PrandtlIshlinskii(weight=[1.0], threshold=[1e5 / 1e6])  # the same numbers in other units
    moves = np.array([3e5, -1e5, 0.5e5, -4e5, 2e5])
    state = np.zeros(1)
    deflection = forces(stop, moves / 1e6) * 1e6
    stroke = strokes(play, np.concatenate([[0.0], np.cumsum(moves)]), state)
    np.testing.assert_allclose(stroke, 1e-8 * (np.cumsum(moves) - deflection), rtol=1e-12)


def test_the_stroke_loop_is_as_wide_as_its_thresholds_and_closes():
    up, down = np.linspace(0.0, 8e5, 801), np.linspace(8e5, 0.0, 801)
    play = MAP.replace(hinge=[], bend=[])
    loop = np.asarray(strokes(play, np.concatenate([up, down[1:], up[1:]]), play.initial()))
    rise, fall, again = loop[:800], loop[800:1600], loop[1600:]
    at = 400  # 4 bar: every play has moved through on both branches
    width = 2 * (3e-8 * 0.4e5 + 2e-8 * 1e5) * (1.0 + 1e-6 * 4e5)
    assert fall[::-1][at] - rise[at - 1] == pytest.approx(width, rel=1e-12)
    np.testing.assert_allclose(again, rise, atol=1e-15)  # roundings; `initial` is the state after a long fall
    assert np.all(fall[::-1][1:] >= rise[:-1])


def test_the_stroke_map_works_in_batches_and_has_finite_derivatives():
    states = MAP.initial(jnp.array([0.0, 1e5]))
    assert states.shape == (2, 3)
    ends = jnp.array([2e5, 0.5e5])
    moved = MAP.advance(states, start_pressure=jnp.array([0.0, 1e5]), end_pressure=ends)
    assert MAP.output(moved, ends).shape == (2,)
    slope = jax.jit(jax.grad(lambda m, p: jnp.sum(strokes(m, p, m.initial())), argnums=(0, 1)))
    for pressures in (np.zeros(9), np.linspace(0.0, 8e5, 9), np.array([0.0, 8e5, -0.9e5] * 3)):
        assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(slope(MAP, pressures)))
