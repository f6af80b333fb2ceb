"""One estimation for every fit: what is searched is what was declared, and many starts at once end where single ones do."""

import numpy as np
import pytest

from mckibben.errors import ConvergenceError, InputError
from mckibben.estimation import (
    NAMED,
    Estimation,
    Parameter,
    PartialFit,
    Search,
    akaike,
    at_bounds,
    bounds_of,
    conclude,
    descend,
    descend_in_lanes,
    descend_linear,
    listed,
    posterior_uncertainty,
    require_influence,
    require_progress,
    uncertainty,
    widening,
)

TIME = np.linspace(0.0, 3.0, 40)
TRUE = np.array([2.0, 0.7])  # amplitude and time constant
DECAY = {"amplitude": Parameter(1.0, 0.0, 10.0, "m"), "time": Parameter(1.0, 1e-2, 1e2, "s", search="log")}


def decay(x: np.ndarray) -> np.ndarray:
    """A decay less the true one, by amplitude and logarithm of the time constant."""
    return x[..., :1] * np.exp(-TIME / np.exp(x[..., 1:])) - TRUE[0] * np.exp(-TIME / TRUE[1])


def slopes(x: np.ndarray) -> np.ndarray:
    part = np.exp(-TIME / np.exp(x[1]))
    return np.stack([part, x[0] * part * TIME / np.exp(x[1])], axis=1)


@pytest.mark.parametrize("search", ["share", "log", "log1p"])
def test_a_value_comes_back_from_what_is_searched(search: Search) -> None:
    p = Parameter(3.0, 0.5, 40.0, "N", size=7.0, search=search)
    assert p.value(p.scaled(3.0)) == pytest.approx(3.0, rel=1e-15)  # rounding of one logarithm
    low, high = bounds_of({"force": p})
    assert low[0] < p.scaled(p.start) < high[0]


def test_the_best_of_several_descents_finds_what_made_the_data_and_its_interval_holds_it() -> None:
    estimation = Estimation(DECAY, decay, slopes)
    best = estimation.search([np.array([0.5, 2.0]), np.array([5.0, -2.0])])
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(TIME))
    found = conclude(DECAY, best, slopes(best.x), decay(best.x) + noise, subject="a decay")
    for e, truth in zip(found.parameters.values(), TRUE, strict=True):
        assert e.value == pytest.approx(truth, rel=1e-6)  # xtol of the solver is 1e-8
        assert e.low < truth < e.high
    assert found.parameters["time"].unit == "s"


def test_many_starts_at_once_end_where_single_descents_do() -> None:
    starts = np.array([[1.0, 0.0], [3.0, -1.0], [2.0, 1.0], [np.nan, 0.0]])
    low, high = bounds_of(DECAY)
    best, squares = descend_in_lanes(decay, starts, step=np.full(2, 1e-6), bounds=(low, high), rounds=12)
    alone = descend(decay, starts[0], jacobian=slopes, bounds=(low, high))
    # Gauss-Newton converges as its square where nothing is left; differences of 1e-6 are off by as much.
    np.testing.assert_allclose(best[:3], np.tile(alone.x, (3, 1)), atol=1e-6)
    assert (squares[:3] < 1e-12).all()
    assert np.isinf(squares[3])  # a lane that cannot be predicted says so


def test_an_interval_within_the_bounds_ends_on_the_bound_itself() -> None:
    parameters = {"share": Parameter(0.5, 0.0, 1.0, "1"), "rest": Parameter(0.0, -np.inf, np.inf, "1")}
    matrix = np.stack([np.ones(20), np.linspace(-1.0, 1.0, 20)], axis=1)
    noise = np.random.default_rng(2).standard_normal(20)
    best = descend_linear(matrix, -1.0 + noise, np.array([0.0, -np.inf]))
    found = conclude(parameters, best, matrix, best.residual, within=True)
    assert found.parameters["share"].value == found.parameters["share"].low == 0.0
    assert at_bounds(parameters, best.x) == ("share",)


@pytest.mark.parametrize("place", [0.0, 1.0])
def test_a_parameter_is_on_either_of_its_bounds_to_rounding_or_to_a_share_of_its_range(place) -> None:
    parameters = {"a": Parameter(0.5, 0.0, 1.0, "1"), "b": Parameter(0.5, 0.0, 1.0, "1")}
    inward = 1.0 - 2.0 * place
    assert at_bounds(parameters, np.array([place + 0.9e-6 * inward, 0.5])) == ("a",)
    assert at_bounds(parameters, np.array([0.5, place + 1.1e-6 * inward])) == ()
    assert at_bounds(parameters, np.array([place + 0.019 * inward, place + 0.021 * inward]), share=0.02) == ("a",)


def test_a_parameter_that_no_sample_shows_is_refused_by_its_name() -> None:
    best = descend(lambda x: x[:1] - 1.0, np.zeros(2))
    parameters = {"seen": Parameter(0.0, -5.0, 5.0, "1"), "hidden": Parameter(0.0, -5.0, 5.0, "1")}
    with pytest.raises(InputError, match="free is 'hidden': the data of a line do not depend on it"):
        conclude(parameters, best, best.jacobian, best.residual, subject="a line")


def test_intervals_of_a_covariance_scale_with_their_parameters_and_name_what_cannot_be_told_apart() -> None:
    scales, shared = np.array([2.0, 5e3, 1.0]), np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 0.0]])
    found = posterior_uncertainty(shared * scales * scales[:, None], ("a", "b", "c"))
    # roots and quotients of products round
    np.testing.assert_allclose(found.standard_error, [2.0, 5e3, 0.0], rtol=1e-14)
    np.testing.assert_allclose(found.correlation, shared, rtol=1e-14)
    assert found.warnings == ()
    shared[0, 1] = shared[1, 0] = -0.9999
    (said,) = posterior_uncertainty(shared, ("a", "b", "c")).warnings
    assert said == "the data can hardly tell a and b apart (correlation -0.9999)"


@pytest.mark.parametrize(
    ("end", "residual", "bound", "sound"),
    [
        ([1.0, 2.0], [1.0, 1.0], 9.0, False),  # it stayed on a slope
        ([1.1, 2.0], [1.0, 1.0], 9.0, True),  # it moved
        ([1.0, 2.0], [0.0, 0.0], 9.0, True),  # it began at a minimum
        ([1.0, 2.0], [1.0, 0.0], 1.0, False),  # the bound is on the other side of the descent
        ([1.0, 2.0], [-1.0, 0.0], 1.0, True),  # the bound holds it
    ],
)
def test_a_fit_that_ends_where_it_began_is_refused_unless_it_began_at_a_minimum(end, residual, bound, sound) -> None:
    start, bounds = np.array([1.0, 2.0]), (np.array([-9.0, -9.0]), np.array([bound, 9.0]))
    arguments = (start, np.array(end), np.eye(2), np.array(residual), bounds)
    if sound:
        require_progress(*arguments, subject="a law")
    else:
        with pytest.raises(ConvergenceError, match="The fit of a law ended where it began"):
            require_progress(*arguments, subject="a law")


def test_intervals_of_a_straight_line_are_the_textbooks() -> None:
    """Slope and offset of five points: variances s^2/Sxx and s^2 (1/n + x^2/Sxx), correlation of theirs, Student's t."""
    x, residual = np.array([0.0, 1.0, 2.0, 4.0, 5.0]), np.array([0.1, -0.2, 0.05, 0.15, -0.1])
    found = uncertainty(np.stack([x, np.ones(5)], axis=1), residual, ("slope", "offset"))
    spread, variance = float(((x - x.mean()) ** 2).sum()), float(residual @ residual) / 3.0
    errors = np.sqrt([variance / spread, variance * (1.0 / 5.0 + x.mean() ** 2 / spread)])
    np.testing.assert_allclose(found.standard_error, errors, rtol=1e-12)  # a decomposition of condition 10
    assert found.correlation[0, 1] == pytest.approx(-x.mean() / np.sqrt((x**2).mean()), rel=1e-12)
    assert found.quantile == pytest.approx(3.182446305284263, rel=1e-9) and found.warnings == ()  # t(3, 0.975), tables
    one = uncertainty(np.ones((1, 1)), np.array([0.5]), ("a",))  # no degree of freedom is left: that of one
    assert (one.quantile, one.standard_error[0]) == (pytest.approx(12.706204736174698, rel=1e-9), 0.5)


def test_what_data_do_not_hold_or_cannot_tell_apart_is_named_and_has_no_interval() -> None:
    x = np.linspace(1.0, 2.0, 7)
    found = uncertainty(np.stack([x, 0.0 * x, 2.0 * x, x**2], axis=1), 0.1 * np.cos(9.0 * x), ("a", "b", "c", "d"))
    assert np.isinf(found.standard_error).tolist() == [True, True, True, False]
    assert found.warnings[:2] == ("the data do not contain b", "the data cannot tell a and c apart")
    with pytest.raises(InputError, match="the data of a law do not depend on it"):
        require_influence(np.array([[1.0, 0.0]]), ("a", "b"), subject="a law")
    require_influence(np.eye(2), ("a", "b"), subject="a law")


def test_the_criterion_is_akaikes_with_hurvich_and_tsais_correction() -> None:
    error = np.array([0.1, -0.3, 0.2, 0.5, -0.1, 0.2])
    plain = 6.0 * np.log(np.mean(error**2)) + 2.0 * 2.0
    assert akaike(error, 2) == pytest.approx(
        plain + 2.0 * 2.0 * 3.0 / (6.0 - 2.0 - 1.0), rel=1e-14
    )  # a logarithm rounds
    assert akaike(error, 4) < akaike(error, 5) == np.inf
    assert akaike(0.0 * error, 2, resolution=1e-3) == akaike(1e-3 + 0.0 * error, 2, resolution=1e-6)
    assert akaike(np.zeros(0), 1) == np.inf


def test_errors_widen_by_the_correlation_of_residuals_that_follow_one_another() -> None:
    assert widening([np.array([1.0, -1.0, 1.0, -1.0])]) == 1.0  # none where they alternate
    assert widening([np.zeros(3)]) == 1.0 and widening([]) == 1.0
    one, two = np.array([1.0, 1.0, 1.0]), np.array([2.0, 0.0, 2.0])
    r = (2.0 + 0.0) / (3.0 + 8.0)
    assert widening([one, two]) == pytest.approx(np.sqrt((1.0 + r) / (1.0 - r)), rel=1e-14)  # a quotient and a root
    assert widening([np.ones(10**5)]) == pytest.approx(np.sqrt(1.9999 / 1e-4), rel=1e-9)  # 1 - 0.9999 loses four digits


class Halves(PartialFit):
    train = np.array([True, True, False, False])
    error = np.array([3.0, -4.0, 1.0, -2.0])


def test_errors_of_what_a_fit_saw_and_of_what_it_did_not_are_told_apart() -> None:
    fit = Halves()
    assert (fit.rmse(seen=True), fit.rmse(seen=False)) == (np.sqrt(12.5), np.sqrt(2.5))
    assert (fit.max_error(seen=True), fit.max_error(seen=False)) == (4.0, 2.0)
    fit.train = np.ones(4, bool)
    assert np.isnan(fit.rmse(seen=False)) and np.isnan(fit.max_error(seen=False))


def test_some_names_are_listed_and_the_others_counted() -> None:
    names = [str(k) for k in range(NAMED + 2)]
    assert listed(names[:NAMED]) == ", ".join(names[:NAMED])
    assert listed(names) == f"{', '.join(names[:NAMED])} and 2 more"
