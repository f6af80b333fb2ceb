"""Numbers of a static law and of a straight line, against a law that is a straight line: closed forms of both."""

import numpy as np
import pytest
from scipy.stats import linregress, t

from mckibben.analysis.channels import LinearFit, linear_fit
from mckibben.analysis.characteristics import (
    circle_area,
    static_characteristics,
    stiffness_per_pressure,
    work_of_shortening,
)
from mckibben.errors import InputError
from mckibben.muscles.laws.linear_threshold import LinearThreshold

REST, PRESSURE, LONGEST = 0.14, 4e5, 0.15
LAW = LinearThreshold(
    stiffness_per_pressure=4e-3, shortest_length=0.1, threshold_pressure=1e5, passive_stiffness=400.0,
    rest_length=REST, upper_length=0.154, rest_volume=5e-6,
)  # fmt: skip
ROUNDING = 1e-9  # of a slack length that is searched, and of least squares


def test_the_characteristics_of_a_straight_law_are_those_of_a_triangle():
    shortest, area = float(LAW.free_length(PRESSURE)), circle_area(0.02)
    assert area == pytest.approx(np.pi * 1e-4, rel=1e-15)
    stroke = LONGEST - shortest
    stiffness = float(LAW.tension(LONGEST, PRESSURE) - LAW.tension(LONGEST - 0.01, PRESSURE)) / 0.01
    work = 0.5 * stiffness * stroke**2
    assert work_of_shortening(LAW, pressure=PRESSURE, longest=LONGEST, shortest=shortest) == pytest.approx(
        work, rel=ROUNDING
    )
    slope = stiffness_per_pressure(LAW, lengths=(0.12, 0.13, LONGEST), pressure=PRESSURE)
    assert slope == pytest.approx(stiffness / PRESSURE, rel=ROUNDING)
    found = static_characteristics(
        LAW, pressure=PRESSURE, rest_length=REST, upper_length=LONGEST, section_area=area
    )._asdict()
    assert found == pytest.approx(
        {
            "rest_length": REST,
            "zero_tension_length": shortest,
            "upper_length": LONGEST,
            "dynamic_range": stroke / REST,
            "maximum_tension": stiffness * stroke,
            "stiffness": stiffness * REST,
            "work": work / REST,
            "section_area": area,
            "tension_intensity": stiffness * stroke / area,
            "stiffness_intensity": stiffness * REST / area,
            "work_density": work / (area * REST),
        },
        rel=ROUNDING,
    )


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_line_and_its_intervals_are_those_of_the_textbook_in_any_unit(scale):
    x = scale * np.array([0.0, 1.0, 2.0, 4.0, 7.0])
    y = 3.0 + 2.0 * x / scale + np.array([0.1, -0.2, 0.05, 0.15, -0.1])
    book = linregress(x, y)
    for confidence in (0.5, 0.95):
        found = linear_fit(np.stack([np.ones(5), x], 1), y, subject="points", confidence=confidence)
        quantile = t.ppf(0.5 + 0.5 * confidence, 3)
        for index, (value, error) in enumerate([(book.intercept, book.intercept_stderr), (book.slope, book.stderr)]):
            one = found.coefficient(index)
            expected = (value, value - quantile * error, value + quantile * error)
            assert one == pytest.approx(expected, rel=ROUNDING)
        assert found.rms == pytest.approx(np.sqrt(np.mean((y - book.intercept - book.slope * x) ** 2)), rel=ROUNDING)
    # of their sum at x: the variance of the mean response
    at = np.array([1.0, 3.0 * scale])
    spread = np.sum((x - x.mean()) ** 2)
    variance = found.rms**2 * 5.0 / 3.0 * (0.2 + (3.0 * scale - x.mean()) ** 2 / spread)
    half = found.interval(float(found.values @ at), at).high - float(found.values @ at)
    assert half == pytest.approx(quantile * np.sqrt(variance), rel=1e-8)


def test_a_variance_that_rounding_made_negative_is_none():
    one = LinearFit(np.array([2.0]), np.array([[-1e-30]]), 0.0, 3.0)
    assert one.coefficient(0) == (2.0, 2.0, 2.0)


def test_points_that_do_not_determine_a_line_are_refused_with_the_reason():
    ones, x = np.ones(4), np.arange(4.0)
    for matrix, target, said in (
        (np.stack([ones, x], 1)[:2], x[:2], "must be 3 or more, got 2"),
        (np.stack([ones, ones], 1), x, "do not vary enough to tell 2 numbers apart"),
        (np.stack([ones, 0.0 * x], 1), x, "do not vary enough"),
        (np.stack([ones, x], 1), np.array([0.0, 1.0, np.nan, 2.0]), "must be finite"),
        (np.stack([ones, np.full(4, np.inf)], 1), x, "must be finite"),
    ):
        with pytest.raises(InputError, match=said):
            linear_fit(matrix, target, subject="points")
    assert linear_fit(np.stack([ones, x], 1)[:3], x[:3], subject="points").rms < ROUNDING
    for confidence in (0.0, 1.0, np.nan):
        with pytest.raises(InputError, match="confidence"):
            linear_fit(np.stack([ones, x], 1), x, subject="points", confidence=confidence)
