"""Asked the other way round: the pressure for a tension, and the length without one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from law_examples import SEATED, SHIPPED, example, examples
from mckibben.errors import InputError, UnreachableError
from mckibben.muscles.bladder import ramp
from mckibben.muscles.law import TensionLaw

TENSION = jax.jit(lambda law, span, pressure: law.tension(span, pressure))
# Compiled once more inside each call of `pressure_for`: seconds for the seated braid, which has its own test.
QUICK = [law for law in SHIPPED if law not in SEATED]
SEATED_LATER = [pytest.param(law, marks=pytest.mark.slow) for law in SEATED]  # half a minute of compilation


def states(law: TensionLaw, count: int, seed: int) -> list[tuple[float, float]]:
    """Random spans and pressures at which a muscle pulls."""
    rng = np.random.default_rng(seed)
    span = float(law.length_range()[1]) * rng.uniform(0.8, 0.99, 40)
    pressure = rng.uniform(0.2e5, 9.9e5, 40)
    taut = np.asarray(TENSION(law, span, pressure)) > 1.0  # N
    assert taut.sum() >= count
    return list(zip(span[taut][:count].tolist(), pressure[taut][:count].tolist(), strict=True))


def assert_lowest(law: TensionLaw, span: float, wanted: float, found: float) -> None:
    """No lower pressure gives the tension: a scan in steps of 20 Pa crosses it nowhere before."""
    below = np.linspace(0.0, found, max(int(found / 20.0), 2))[:-1]
    given = np.asarray(TENSION(law, span, np.pad(below, (0, 50_000 - below.size), mode="edge")))[: below.size] - wanted
    assert (given < 0.0).all() or (given > 0.0).all()


@pytest.mark.parametrize("law", QUICK)
def test_pressure_for_inverts_tension(law: str) -> None:
    muscle = example(law)
    for span, pressure in states(muscle, 4, seed=1):
        wanted = float(TENSION(muscle, span, pressure))
        found = muscle.pressure_for(wanted, span)
        # The search ends within 1e-6 Pa; the tension then agrees to that times dF/dP', far below 1e-9 of it.
        assert float(TENSION(muscle, span, found)) == pytest.approx(wanted, rel=1e-9)
        assert found <= pressure + 1e-3
        assert_lowest(muscle, span, wanted, found)


@pytest.mark.slow
def test_pressure_for_inverts_the_tension_of_the_seated_braid() -> None:
    muscle = example("seated_braid")
    assert muscle.pressure_for(float(TENSION(muscle, 0.175, 3.3333e5)), 0.175) == pytest.approx(3.3333e5, abs=1e-3)


@pytest.mark.parametrize("law", QUICK)
def test_pressure_for_inverts_tensions_of_round_pressures(law: str) -> None:
    # What a person tries first; these pressures are nodes of the search grid.
    muscle = example(law)
    for bar in range(1, 10):
        span = (0.85, 0.9, 0.95)[bar % 3] * float(muscle.length_range()[1])
        wanted = float(muscle.tension(span, bar * 1e5))
        if wanted > 1.0:
            assert muscle.pressure_for(wanted, span) <= bar * 1e5 + 1e-3


def test_pressure_for_finds_the_lowest_of_two() -> None:
    # An end factor that grows with pressure makes the tension of a contracted muscle rise, and fall to nothing again.
    muscle = examples()["tondu_lopez"].replace(end_factor=2.0, end_factor_gain=-1.2, end_factor_pressure=1.5e5)
    span = 0.75 * 0.3
    scan = np.linspace(0.0, 9.9e5, 99_001)
    tension = np.asarray(TENSION(muscle, span, scan))
    first = int(np.argmax(tension))
    wanted = 0.5 * float(tension[first])
    crossings = np.flatnonzero(np.diff(np.sign(tension - wanted)))
    assert crossings.size >= 2  # else the case does not show what it is for
    found = muscle.pressure_for(wanted, span)
    assert scan[crossings[0]] <= found <= scan[crossings[0] + 1]


@pytest.mark.parametrize("law", QUICK)
def test_a_tension_out_of_reach_is_named(law: str) -> None:
    muscle = example(law)
    span = 0.95 * float(muscle.length_range()[1])
    most = float(np.asarray(TENSION(muscle, span, np.linspace(0.0, 10e5, 1001))).max())
    with pytest.raises(UnreachableError, match="is not reached between 0") as refused:
        muscle.pressure_for(1.01 * most, span)
    assert "\n" not in str(refused.value)
    assert f"{most:.4g}" in str(refused.value)  # says what can be had


@pytest.mark.parametrize("wanted", [-1.0, float("nan"), float("inf")])
def test_a_tension_that_is_none_is_refused(wanted: float) -> None:
    with pytest.raises(InputError, match="must be 0 N or more"):
        example("ideal").pressure_for(wanted, 0.15)


def test_no_tension_needs_no_pressure() -> None:
    muscle = example("linear_threshold")
    assert muscle.pressure_for(0.0, 0.12) == 0.0
    with pytest.raises(UnreachableError):  # the passive spring pulls already
        muscle.pressure_for(0.0, 0.15)


LENGTH = jax.jit(lambda law, p: law.free_length(p))
FREE = jax.jit(lambda law, p: jax.jvp(law.free_length, (p,), (jnp.ones_like(p),)))  # and its slope
BRAID = jax.jit(lambda law, length, pressure: law.braid_tension(length, pressure))


def hanging(law: TensionLaw) -> tuple[np.ndarray, np.ndarray]:
    """16 pressures, and those of them at which the free length is inside the range of the law."""
    pressure = np.linspace(0.7e5, 8e5, 16)
    free = np.asarray(LENGTH(law, pressure))
    low, high = (float(end) for end in law.length_range())
    inside = (free > low) & (free < high)
    # an ideal muscle has its free length inside at every pressure, a stiff one above a few bar
    assert inside.sum() >= 12
    return pressure, inside


@pytest.mark.parametrize("law", [*QUICK, *SEATED_LATER])
def test_at_the_free_length_the_tension_vanishes_and_just_beyond_the_muscle_pulls(law: str) -> None:
    muscle = example(law)
    pressure, inside = hanging(muscle)
    free, high = np.asarray(LENGTH(muscle, pressure)), float(muscle.length_range()[1])
    largest = float(TENSION(muscle, np.full(16, 0.97 * high), np.full(16, 8e5))[0])
    assert largest > 0.0
    # 60 halvings reach the last bit of the length: 1e-16 L dF/dL, and dF/dL (high - free) is about the largest tension.
    assert (np.abs(np.asarray(BRAID(muscle, free, pressure)))[inside] <= 1e-12 * largest).all()
    assert (np.asarray(TENSION(muscle, free * (1.0 + 1e-9), pressure))[inside] > 0.0).all()
    assert (np.asarray(TENSION(muscle, free * (1.0 - 1e-9), pressure))[inside] == 0.0).all()


@pytest.mark.parametrize("law", [*QUICK, *SEATED_LATER])
def test_the_slope_of_the_free_length_is_that_of_a_difference(law: str) -> None:
    muscle = example(law)
    pressure, inside = hanging(muscle)
    slope, high = np.asarray(FREE(muscle, pressure)[1]), float(muscle.length_range()[1])
    # Central difference over 2 x 20 Pa: its truncation is (20 Pa/50 kPa)^2 = 1e-7 of the slope, its rounding
    # 1e-16 L/40 Pa = 1e-18 L/Pa.
    step = 20.0
    above, below = (np.asarray(LENGTH(muscle, pressure + s)) for s in (step, -step))
    difference = (above - below) / (2.0 * step)
    # The seats of the seated braid begin to give at zero force, so its stiffness has a kink just there.
    rtol = 5e-5 if law in SEATED else 1e-5
    np.testing.assert_allclose(slope[inside], difference[inside], rtol=rtol, atol=1e-17 * high)


def test_the_free_length_of_the_linear_law_is_known_in_closed_form() -> None:
    muscle = examples()["linear_threshold nylon"]
    pressure = np.linspace(-0.9e5, 10e5, 200)
    carried = np.asarray(ramp(pressure - 0.903e5, 0.85e5))
    pull = carried * 4.66e-3
    closed = (pull * 0.0991 + 392.0 * 0.14) / (pull + 392.0)
    np.testing.assert_allclose(muscle.free_length(pressure), closed, rtol=1e-13)  # the last bits of 60 halvings


def test_a_muscle_that_never_hangs_free_within_its_range_stays_at_the_end_of_it() -> None:
    ideal = example("ideal")
    low, high = (float(end) for end in ideal.length_range())
    # Without pressure nothing pulls at any length; the muscle may be as long as it can.
    np.testing.assert_allclose(ideal.free_length(np.array([-0.9e5, -1e4])), high, rtol=1e-14)
    assert low < float(ideal.free_length(1e5)) < high
