"""The next points to measure: what a reading tells, optimal designs, budget and order."""

import dataclasses

import numpy as np
import pytest
from test_posterior import LENGTHS, PRESSURES, posterior

from mckibben.errors import InputError
from mckibben.experiments import read
from mckibben.identification.next_points import (
    Candidates,
    LawContrast,
    candidates_of,
    choose,
    continuous_optimum,
    law_test,
    next_experiment,
)


def line(places, noise=1.0, discrepancy=0.0):
    """Candidates of a straight line with two parameters of unit variance."""
    slopes = np.stack([np.ones_like(places), places], axis=1)
    return Candidates(
        length=places,
        pressure=np.zeros_like(places),
        predicted=slopes @ slopes.T,
        discrepancy=discrepancy**2 * np.eye(len(places)),
        parameters=slopes,
        spread=np.eye(2),
        noise=noise,
    )


def test_the_information_is_that_of_linear_least_squares():
    places = np.linspace(-1.0, 1.0, 5)
    some = [0, 2, 4]
    slopes = np.stack([np.ones(3), places[some]], axis=1)
    exact = 0.5 * np.linalg.slogdet(np.eye(2) + slopes.T @ slopes / 0.25)[1]
    # the same determinant in the space of points and of parameters (Sylvester), to its rounding
    assert line(places, noise=0.5).information(some) == pytest.approx(exact, rel=1e-12)


def test_an_error_that_all_readings_share_hides_the_height_of_a_line_and_not_its_slope():
    places = np.array([-1.0, 1.0])
    plain = line(places, noise=1e-3)
    shared = dataclasses.replace(plain, runs=np.full((2, 2), 9.0))
    height, slope = shared.widths([0, 1])
    # of a height of variance 1 and an error of variance 9, both seen as their sum: 9/10 of the variance are left
    assert height == pytest.approx(np.sqrt(0.9), rel=1e-4)
    assert slope == pytest.approx(plain.widths([0, 1])[1], rel=1e-4)  # noise of 1e-3 is left of either


def test_a_line_is_measured_at_its_ends():
    chosen = choose(line(np.linspace(-1.0, 1.0, 5), noise=0.1), budget=2 * 3.0 + 4 * 6.0 + 1.0, wait=3.0)
    # two lengths and four readings fill the budget; the D-optimal design of a line has its points at the ends
    assert sorted(chosen) == [0, 0, 4, 4]


def test_points_of_a_parabola_come_to_the_optimum_by_exchanges():
    places = np.linspace(-1.0, 1.0, 9)
    slopes = np.stack([np.ones(9), places, places**2], axis=1)
    some = Candidates(
        length=np.zeros(9), pressure=places, predicted=1e6 * slopes @ slopes.T, discrepancy=np.zeros((9, 9)),
        parameters=1e6 * slopes, spread=1e6 * np.eye(3), noise=1.0,
    )  # fmt: skip
    chosen = choose(some, budget=3.0 + 6 * 3.0 + 1.0, wait=0.0)
    assert sorted(chosen) == [0, 0, 4, 4, 8, 8]  # the known optimum: a third each at -1, 0 and 1


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


def test_information_does_not_depend_on_the_units_of_the_parameters():
    plain, scaled = (line(np.linspace(-1.0, 1.0, 5)) for _ in range(2))
    factor = np.array([1e-3, 1e7])
    scaled = dataclasses.replace(
        scaled, parameters=scaled.parameters * factor, spread=scaled.spread * np.outer(factor, factor)
    )
    # exact but for the rounding of solving and scaling
    assert scaled.information([0, 4]) == pytest.approx(plain.information([0, 4]), rel=1e-9)
    assert scaled.widths([0, 4]) == pytest.approx(plain.widths([0, 4]), rel=1e-9)


def test_information_is_exact_however_much_readings_tell():
    places = np.linspace(-1.0, 1.0, 5)
    slopes = np.stack([np.ones(5), places], axis=1)
    known = line(places)
    wide = dataclasses.replace(
        known, predicted=1e8 * known.predicted, parameters=1e8 * known.parameters, spread=1e8 * known.spread
    )
    exact = 0.5 * np.linalg.slogdet(np.eye(2) + 1e8 * slopes.T @ slopes)[1]
    # a difference of covariances 1e8 times the noise keeps eight of sixteen digits
    assert wide.information([0, 1, 2, 3, 4]) == pytest.approx(exact, abs=1e-6)


def test_a_parameter_that_the_discrepancy_makes_up_for_is_not_learned():
    # a discrepancy that the data tie to the offset, so that every sample predicts the same tension there
    places = np.linspace(-1.0, 1.0, 5)
    slopes = np.stack([np.zeros(5), places], axis=1)
    tied = dataclasses.replace(line(places), predicted=slopes @ slopes.T, parameters=slopes)
    # readings at both ends: 1 + 1/noise^2 * 2 times the information about the slope, none about the offset
    assert tied.widths([0, 4]) == pytest.approx([1.0, 3.0**-0.5], rel=1e-12)
    assert tied.information([0, 4]) == pytest.approx(0.5 * np.log(3.0), rel=1e-12)


def test_where_no_parameter_becomes_narrower_the_tension_over_the_map_decides():
    # a discrepancy far beyond what the parameters do, which therefore says nothing of them
    plan = next_experiment(posterior(50.0, spread=1e-5), budget=40.0)
    assert not plan.narrows and plan.deviation[1] < plan.deviation[0]


def test_the_distance_of_two_laws_is_that_of_their_readings():
    contrast = LawContrast(
        length=np.arange(3.0),
        pressure=np.zeros(3),
        tensions=np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]]),
        open=np.zeros((3, 3)),
        noise=0.5,
    )
    # independent errors: squares add, (3^2 + 4^2) / 0.5^2; a point at which the laws agree adds nothing
    assert contrast.distance([0, 1, 2]) == pytest.approx(100.0, rel=1e-12)
    # an offset that all readings share leaves only their differences: (4 - 3)^2 / (2 noise^2)
    shared = dataclasses.replace(contrast, open=np.full((3, 3), 1e9))
    assert shared.distance([0, 2]) == pytest.approx(2.0, rel=1e-4)  # to the share of the noise in the offset


def test_two_laws_are_told_apart_where_they_differ():
    near, far = posterior(0.0, spread=0.01), posterior(0.0, spread=0.01)
    # the other law is the same spring with a stiffness 10 % larger, so that it differs most where it pulls most
    stiffer = {**far.samples, "stiffness_per_pressure": 1.1 * far.samples["stiffness_per_pressure"]}
    test = law_test([near, dataclasses.replace(far, samples=stiffer)], budget=60.0)
    assert test.duration <= 60.0 and 0.95 < test.recognised <= 1.0
    assert np.all(test.deviations > 0.0) and test.length.max() == LENGTHS.max()
    same = law_test([near, near], budget=30.0)
    assert same.distance == 0.0 and same.recognised == 0.5


def test_two_laws_of_different_measurements_are_refused():
    other = posterior(0.0, points=np.full(len(LENGTHS), 20.0))
    with pytest.raises(InputError, match="laws must be fitted to the same points"):
        law_test([posterior(0.0), other], budget=30.0)


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
    assert sum(str(step["label"]).startswith("point") for step in read.protocol(path).steps) == len(plan)


def test_a_budget_too_short_for_a_point_is_refused():
    some = candidates_of(posterior(0.0, spread=0.05), LENGTHS, PRESSURES)
    with pytest.raises(InputError, match="budget must be 10 s or more"):
        choose(some, budget=5.0, wait=3.0)
