"""The next points to measure: what a reading tells, optimal designs, budget and order."""

import numpy as np
import pytest
from test_posterior import LENGTHS, PRESSURES, posterior

from mckibben.errors import InputError
from mckibben.experiments import read
from mckibben.identification.next_points import (
    Candidates,
    candidates_of,
    choose,
    continuous_optimum,
    next_experiment,
)


def line(places, noise=1.0, discrepancy=0.0):
    """Candidates of a straight line with two parameters of unit variance."""
    slopes = np.stack([np.ones_like(places), places], axis=1)
    return Candidates(
        length=places,
        pressure=np.zeros_like(places),
        law=slopes @ slopes.T,
        discrepancy=discrepancy**2 * np.eye(len(places)),
        parameters=slopes,
        noise=noise,
    )


def test_the_information_is_that_of_linear_least_squares():
    places = np.linspace(-1.0, 1.0, 5)
    some = [0, 2, 4]
    slopes = np.stack([np.ones(3), places[some]], axis=1)
    exact = 0.5 * np.linalg.slogdet(np.eye(2) + slopes.T @ slopes / 0.25)[1]
    # the same determinant in the space of points and of parameters (Sylvester), to its rounding
    assert line(places, noise=0.5).information(some) == pytest.approx(exact, rel=1e-12)


def test_a_line_is_measured_at_its_ends():
    chosen = choose(line(np.linspace(-1.0, 1.0, 5), noise=0.1), budget=2 * 3.0 + 4 * 6.0 + 1.0, wait=3.0)
    # two lengths and four readings fill the budget; the D-optimal design of a line has its points at the ends
    assert sorted(chosen) == [0, 0, 4, 4]


def test_the_continuous_optimum_of_a_parabola_has_three_equal_points():
    places = np.linspace(-1.0, 1.0, 9)
    weights = continuous_optimum(np.stack([np.ones(9), places, places**2], axis=1))
    # the known optimum: a third each at -1, 0 and 1; the algorithm comes near at a rate of one over its iterations
    assert weights[[0, 4, 8]] == pytest.approx([1.0 / 3.0] * 3, abs=2e-3)


def test_a_reading_under_a_discrepancy_tells_less():
    places = np.linspace(-1.0, 1.0, 5)
    sure, unsure = line(places), line(places, discrepancy=2.0)
    assert unsure.information([0, 4]) < sure.information([0, 4])
    assert sure.left([0, 4], np.arange(5)) < sure.left([], np.arange(5))


def test_points_stay_within_budget_map_and_what_the_rig_bears(tmp_path):
    samples = posterior(1.0, spread=0.05)
    plan = next_experiment(samples, budget=60.0, highest_pressure=4e5, highest_tension=60.0, lengths=(0.125, 0.2))
    assert 0 < plan.duration <= 60.0
    assert plan.length.min() >= 0.125 and plan.length.max() <= LENGTHS.max()
    assert plan.pressure.min() >= PRESSURES.min() and plan.pressure.max() <= 4e5
    assert samples.tension(plan.length, plan.pressure).high.max() < 60.0
    assert plan.deviation[1] < plan.deviation[0] and all(0.0 < left < 1.0 for left in plan.expected.values())
    # the longest length first, and at each length only rising pressures
    assert np.all(np.diff(plan.length) <= 0.0)
    same = np.diff(plan.length) == 0.0
    assert np.all(np.diff(plan.pressure)[same] >= 0.0)
    path = tmp_path / "next.toml"
    path.write_text(plan.protocol())
    assert sum(str(step["label"]).startswith("point") for step in read.read_protocol(path).steps) == len(plan)


def test_a_budget_too_short_for_a_point_is_refused():
    some = candidates_of(posterior(0.0, spread=0.05), LENGTHS, PRESSURES)
    with pytest.raises(InputError, match="budget must be 10 s or more"):
        choose(some, budget=5.0, wait=3.0)
