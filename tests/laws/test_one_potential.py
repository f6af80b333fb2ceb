"""Tension and volume follow from one potential: dF/dP' = -dV/dL, threshold and slack included, for every law."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from law_examples import DRAWS, SEATED, SHIPPED, example, examples, muscle_like
from mckibben.muscles.check import evaluate, pressures, thread_length
from mckibben.muscles.law import TensionLaw, law_name

AMBIENT = 101325.0  # Pa
# Their geometry depends on the pressure, so that at a fixed length the volume may fall a little while it rises.
PRESSURE_DEPENDENT = ("tondu_lopez", "hyperelastic_braid", "seated_hyperelastic_braid")
NEWEST = "seated_hyperelastic_braid"  # compiles longest; `test_limits` holds it to the laws that are its limits
DRAW = st.lists(st.floats(0.0, 1.0), min_size=DRAWS, max_size=DRAWS)


def later(names: Iterable[str]) -> list[object]:
    """The names, the newest law among the slow tests."""
    return [pytest.param(name, marks=pytest.mark.slow) if name == NEWEST else name for name in names]


def tries(law: str) -> settings:
    """Each draw is a grid of 64 x 64 states; the seated braid takes a second for one."""
    return settings(max_examples=6 if law in SEATED else 30, deadline=None, database=None, derandomize=True)


def grid(law: TensionLaw, shortest: float = 0.2, longest: float = 1.5) -> dict[str, np.ndarray]:
    """The law at 64 lengths (of the thread or rest length) by 64 pressures from -0.95 to 10 bar."""
    length = np.linspace(shortest, longest, 64) * thread_length(law)
    pressure = pressures(law)
    return evaluate(law, length[:, None], pressure[None, :]) | {"pressure": pressure}


def assert_one_potential(law: TensionLaw) -> None:
    at = grid(law)
    assert all(np.isfinite(value).all() for value in at.values())
    assert (at["F"] >= 0.0).all()  # a braid cannot push
    # Both sides are the same mixed derivative in float64 (3e-14 for the seated braid, whose inner minimum is iterated,
    # 1e-15 for the others). Relative to the largest dF/dP' at the same length, since that of an exponential law grows by
    # nine orders over the grid; where a length is slack at every pressure both must vanish exactly.
    largest = np.abs(at["F_P"]).max(axis=1, keepdims=True)
    assert largest.max() > 0.0
    wrong = np.abs(at["F_P"] + at["V_L"])
    assert (wrong <= 1e-10 * largest).all(), (wrong / np.maximum(largest, 1e-300)).max()


def assert_volume_is_a_volume(law: TensionLaw) -> None:
    # From 0.6 of the rest length on: all published free contractions are below 0.4.
    at = grid(law, 0.6, 1.0)
    assert (at["V"] > 0.0).all(), at["V"].min()
    if law_name(law) in PRESSURE_DEPENDENT:
        # Not dV/dP' >= 0, but what the gas needs: a positive capacitance d(P V)/dP, so that its state has a rate.
        assert (at["V"] + (at["pressure"] + AMBIENT) * at["V_P"] > 0.0).all()
    else:
        # The second derivative of the rounded threshold is a sum that cancels at its ends: 1e-15 of V/w each term.
        assert (at["V_P"] >= -1e-13 * at["V"].max() / float(law.threshold_width)).all(), at["V_P"].min()


def mixes_slack_and_taut(law: TensionLaw) -> bool:
    F = grid(law)["F"]
    return bool((F == 0.0).any() and (F > 0.0).any())


@pytest.mark.parametrize("name", later(examples()))
def test_tension_and_volume_share_one_potential(name: str) -> None:
    law = examples()[name]
    assert mixes_slack_and_taut(law)  # else the grid would leave slack untried
    assert_one_potential(law)


@pytest.mark.parametrize("law", later(SHIPPED))
def test_tension_and_volume_share_one_potential_for_random_parameters(law: str) -> None:
    @tries(law)
    @given(DRAW)
    def check(draw: list[float]) -> None:
        assert_one_potential(muscle_like(law, draw))

    check()


# k grows to 5-20 towards zero pressure and enters the volume: beyond a contraction of 1/k the law pulls again, and the
# volume that belongs to it jumps and turns negative.


def with_volume() -> list[str]:
    return [name for name, law in examples().items() if law.has_volume()]


@pytest.mark.parametrize("name", later(with_volume()))
def test_volume_is_positive_and_grows_with_pressure(name: str) -> None:
    law = examples()[name]
    if law_name(law) in ("sarosi", "three_element"):
        # A volume by virtual work alone has no bladder below it: it is positive in the range of the fit, which ends at
        # a quarter of contraction, and does not depend on the pressure while taut.
        at = grid(law, 0.75, 1.0)
        assert (at["V"] > 0.0).all()
        taut = at["F"] > 0.0
        assert taut.any()
        assert (at["V_P"][taut] == 0.0).all()
    else:
        assert_volume_is_a_volume(law)


@pytest.mark.parametrize("law", later(law for law in SHIPPED if law not in ("sarosi", "three_element")))
def test_volume_is_positive_and_grows_with_pressure_for_random_parameters(law: str) -> None:
    @tries(law)
    @given(DRAW)
    def check(draw: list[float]) -> None:
        assert_volume_is_a_volume(muscle_like(law, draw))

    check()


@pytest.mark.parametrize("law", later(SHIPPED))
def test_the_test_sees_a_volume_that_is_not_conjugate(law: str) -> None:
    # One per mille more tension with the same volume: the criterion above must refuse it.
    at = grid(example(law))
    largest = np.abs(at["F_P"]).max(axis=1, keepdims=True)
    assert not (np.abs(1.001 * at["F_P"] + at["V_L"]) <= 1e-10 * largest).all()


@pytest.mark.parametrize("name", ["ideal nylon", "linear_threshold nylon", "gas_spring", "tondu_lopez"])
def test_the_volume_changes_with_the_length_as_soon_as_the_braid_pulls_and_not_before(name: str) -> None:
    law, pressure = examples()[name], 3e5
    free = float(law.free_length(pressure))
    stiffness = float(law.stiffness(free * 1.001, pressure))
    for force in (1e-3, 0.5, 2.0):  # [N]
        length = free + force / stiffness
        assert 0.2 * force < float(law.tension(length, pressure)) < 5.0 * force
        by_pressure = (float(law.tension(length, pressure + 1.0)) - float(law.tension(length, pressure - 1.0))) / 2.0
        # a difference of second order over 2 Pa of 3 bar: 1e-10; tensions of 100 N round by 1e-14 of them
        assert float(law.volume_change(length, pressure)) == pytest.approx(-by_pressure, rel=1e-6)
    assert float(law.volume_change(free - 1e-3 * free, pressure)) == 0.0 == float(law.tension(free * 0.999, pressure))
