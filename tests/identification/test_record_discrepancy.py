"""Prediction of records with a discrepancy: kriging with a trend, which follows what is shown and ends where nothing is."""

from dataclasses import replace

import numpy as np
import pytest
from test_hysteresis_fit import dahl_fit, loop_of

from mckibben.errors import ConvergenceError, InputError
from mckibben.estimation import Parameter
from mckibben.identification import sampler
from mckibben.identification.discrepancy import _Shown, predict_records
from mckibben.identification.hysteresis_fit import fit_loop
from mckibben.identification.record_posterior import RecordProblem
from mckibben.muscles.hysteresis import Dahl, FrictionLimit

COUNT, NOISE, SWELL = 200, 0.02, 0.1
AT = np.linspace(0.0, 1.0, COUNT)
SLOPES = np.stack([np.ones(COUNT), AT], axis=1)
SHOWN = np.arange(COUNT) // 10 % 2 == 0


def fitted_line(errors: np.ndarray, used: np.ndarray = SHOWN) -> RecordProblem:
    """A straight line at its least squares fit to the shown samples of 1 + 2 t and errors."""
    measured = SLOPES @ np.array([1.0, 2.0]) + errors
    start = np.linalg.lstsq(SLOPES[used], measured[used], rcond=None)[0]
    return RecordProblem(
        parameters={name: Parameter(0.0, -9.0, 9.0, "m") for name in ("offset", "slope")},
        start=start,
        model=sampler.HostModel(lambda x: SLOPES @ x, lambda x: SLOPES),
        measured=measured,
        group=np.zeros(COUNT, int),
        used=used,
        unit="m",
    )


def noise(seed: int) -> np.ndarray:
    return NOISE * np.random.default_rng(seed).standard_normal(COUNT)


SMOOTH = SWELL * np.sin(9.0 * AT)


def test_the_prediction_is_that_of_kriging_with_the_derivatives_as_its_trend():
    problem = fitted_line(SMOOTH + noise(1))
    found = predict_records(problem)
    # the same by dense matrices: R. Christensen, Plane Answers to Complex Questions, chapter 6 (best linear prediction)
    correlation = sampler.matern(AT[:, None], AT[:, None], found.length)
    across = found.discrepancy**2 * correlation[:, SHOWN]
    inverse = np.linalg.inv(across[SHOWN] + found.noise**2 * np.eye(SHOWN.sum()))
    trend, measured = SLOPES[SHOWN], problem.measured[SHOWN]
    information = trend.T @ inverse @ trend
    change = np.linalg.solve(information, trend.T @ inverse @ measured)
    mean = SLOPES @ change + across @ inverse @ (measured - trend @ change)
    rest = SLOPES - across @ inverse @ trend
    variance = found.discrepancy**2 - np.einsum("ij,jk,ik->i", across, inverse, across)
    variance += np.einsum("ij,jk,ik->i", rest, np.linalg.inv(information), rest)
    # rounding of matrices whose condition is (discrepancy over noise)^2 times the count, 1e4
    np.testing.assert_allclose(found.predicted, mean, atol=1e-9)
    np.testing.assert_allclose(found.deviation, np.sqrt(variance), atol=1e-8)


def test_hidden_samples_between_shown_ones_are_predicted_to_the_noise_where_the_model_is_wrong():
    problem = fitted_line(SMOOTH + noise(2))
    found, truth = predict_records(problem), problem.measured - noise(2)
    fitted = problem.model.predict(problem.start)
    # A line leaves most of the sine; the mean of the ten shown samples on both sides leaves less than half of the noise.
    assert np.sqrt(np.mean((fitted - truth)[~SHOWN] ** 2)) > 2.0 * NOISE
    assert np.sqrt(np.mean((found.predicted - truth)[~SHOWN] ** 2)) < 0.5 * NOISE
    assert found.noise == pytest.approx(NOISE, rel=0.3)  # of 100 samples, four standard errors
    assert found.evidence > 20.0
    band = found.band(measured=True)
    inside = (band.low <= problem.measured) & (problem.measured <= band.high)
    assert inside[~SHOWN].mean() > 0.88  # 95 % of 100 samples, three standard errors


def test_a_model_that_is_right_predicts_as_its_fit_does():
    gains = []
    for seed in range(5):
        problem = fitted_line(noise(seed))
        found = predict_records(problem)
        gains.append(found.evidence)
        # A discrepancy that noise feigns is smaller than the noise and less certain: it moves nothing by half of it.
        assert np.abs(found.predicted - problem.model.predict(problem.start)).max() < 0.5 * NOISE
    # Without a discrepancy twice the gain is near chi-squared of one degree, for half of the data 0: above 2 in 2 of 100.
    assert np.median(gains) < 2.0


def test_sizes_are_judged_by_what_no_parameter_can_take_up():
    places, measured, size = AT[SHOWN][:, None], (SMOOTH + noise(4))[SHOWN], 0.5 * NOISE
    trend = np.linalg.qr(SLOPES[SHOWN])[0]
    shown = _Shown(places, size**2 * np.eye(len(places)), measured, trend, False)
    # Patterson and Thompson: the likelihood of the contrasts, which the trend does not move
    contrasts = np.linalg.svd(trend)[0][:, trend.shape[1] :].T
    sizes, scores, exact = ((1.0, 0.1), (2.5, 0.03)), [], []
    for factor, amplitude in sizes:
        scores.append(shown.errors(0.1).score(factor, amplitude))
        correlation = sampler.matern(places, places, 0.1)
        covariance = contrasts @ (amplitude**2 * correlation + (factor * size) ** 2 * np.eye(len(places))) @ contrasts.T
        left = contrasts @ measured
        exact.append(-0.5 * (left @ np.linalg.solve(covariance, left) + np.linalg.slogdet(covariance)[1]))
    # rounding of matrices of condition 1e4
    assert scores[0] - scores[1] == pytest.approx(exact[0] - exact[1], rel=1e-8)


def test_far_from_what_is_shown_the_model_is_left():
    used = AT < 0.3
    problem = fitted_line(0.3 * SWELL * np.sin(60.0 * AT) + 0.1 * noise(3), used)
    found = predict_records(problem)
    far = AT > 0.3 + 4.0 * found.length
    assert found.length < 0.15 and far.any()
    change = np.linalg.lstsq(SLOPES[far], found.predicted[far], rcond=None)[0]
    # a Matern correlation at four lengths is 0.4 % of the discrepancy
    np.testing.assert_allclose(found.predicted[far], SLOPES[far] @ change, atol=0.01 * found.discrepancy)
    assert found.deviation[far].min() > 0.99 * found.discrepancy


def test_a_loop_with_friction_is_predicted_with_its_discrepancy():
    fit = dahl_fit("blocks")
    found = fit.with_discrepancy()
    # The friction is right, so that a discrepancy changes the prediction by less than its error, 1.5 NOISE at most.
    assert found.unit == "m" and np.sqrt(np.mean((found.predicted - fit.predicted) ** 2)) < 2e-5
    with pytest.raises(InputError, match="noise"):
        fit.with_discrepancy(noise=0.0)


def test_a_fit_that_frees_creep_states_the_prediction_that_it_made():
    record = loop_of(Dahl(limit=FrictionLimit(constant=30.0), stiffness=2e4))
    fit = fit_loop(record, model="dahl", known={"per_pressure": 0.0, "creep": float("nan")}, knots=4)
    problem = fit.problem()
    assert "creep" in problem.parameters
    # the same parameters, through their scaling and back
    np.testing.assert_allclose(problem.model.predict(problem.start), fit.predicted, atol=1e-9)


def test_a_fit_that_did_not_converge_predicts_no_discrepancy():
    with pytest.raises(ConvergenceError, match="did not converge, so there is nothing to predict with"):
        replace(dahl_fit("blocks"), converged=False).with_discrepancy()
