"""Posterior of records: weights of samples, bands, loops that are read from files, and samples of known distributions."""

import json

import numpy as np
import pytest
from test_hysteresis_fit import NOISE, dahl_fit

from mckibben.errors import ConvergenceError, InputError
from mckibben.estimation import Parameter
from mckibben.identification import sampler
from mckibben.identification.path_record import read_path
from mckibben.identification.record_posterior import (
    RecordPosterior,
    RecordProblem,
    _resampled,
    _weights,
    posterior_of_loop,
    posterior_of_records,
    record_places,
)

COUNT = 30
SLOPES = np.stack([np.ones(COUNT), np.linspace(-1.0, 1.0, COUNT)], axis=1)


def line(measured: np.ndarray) -> RecordProblem:
    """A straight line of two parameters, of which the second is searched in its logarithm."""

    def values(x: np.ndarray) -> np.ndarray:
        return np.array([x[0], np.exp(x[1])])

    offset = Parameter(0.5, -9.0, 9.0, "m")
    slope = Parameter(2.0, np.exp(-9.0), np.exp(9.0), "m", search="log")
    return RecordProblem(
        parameters={"offset": offset, "slope": slope},
        start=np.array([0.5, np.log(2.0)]),
        model=sampler.HostModel(lambda x: SLOPES @ values(x), lambda x: SLOPES * np.array([1.0, np.exp(x[1])])),
        measured=measured,
        group=np.zeros(COUNT, int),
        used=np.ones(COUNT, bool),
        unit="m",
    )


def test_samples_are_weighed_by_the_likelihood_of_their_own_predictions():
    noise, at = 0.1, np.zeros(2)
    evidence = sampler.Evidence(
        model=lambda x, inputs: x,
        inputs={"at": at, "value": np.zeros(COUNT), "slopes": SLOPES},
        measured=SLOPES @ np.array([0.1, 0.2]),
        modes=sampler.ErrorModes.of(noise**2 * np.eye(COUNT), np.eye(COUNT)),
        slack_variance=np.zeros(0), low=at - 1.0, high=at + 1.0, start=at, noise_known=True, amplitude=0.0,
    )  # fmt: skip
    parameters = np.array([[0.1, 0.2], [0.12, 0.2], [0.1, 0.25]])
    drawn = sampler.Draws(parameters, np.ones(3), np.zeros(3), 1.0, 3.0, 0)
    # a prediction that is the linearised one changes no weight, to rounding
    linear = parameters @ SLOPES.T
    assert _weights(evidence, drawn, linear) == pytest.approx(np.full(3, 1.0 / 3.0), rel=1e-9)
    # one that is off by the noise at every value is less likely by the square of its error over twice the variance
    off = linear.copy()
    off[0] += noise
    weights = _weights(evidence, drawn, off)
    assert np.log(weights[0] / weights[1]) == pytest.approx(-0.5 * COUNT, rel=1e-6)


def test_samples_are_drawn_anew_as_often_as_their_weights_say():
    weights = np.array([0.5, 0.0, 0.25, 0.25])
    counts = np.bincount(_resampled(weights, 0), minlength=4)
    assert counts.tolist() == [2, 0, 1, 1]  # systematic: each within one of its weight times the count


def test_values_of_different_records_share_no_discrepancy():
    places = record_places(np.array([0, 0, 0, 1, 1, 1]))
    correlation = sampler.matern(places, places, 0.3)
    assert correlation[0, 1] > 0.2 and np.abs(correlation[:3, 3:]).max() < 1e-12


def test_the_band_holds_discrepancy_and_noise():
    chance = np.random.default_rng(2)
    drawn = RecordPosterior(
        samples={"slope": 1.0 + 0.1 * chance.standard_normal(400)}, units={"slope": "m"}, noise=np.full(400, 3.0),
        amplitude=np.full(400, 4.0), measured=np.zeros(3), group=np.zeros(3, int), predicted=np.zeros((400, 3)),
        discrepancy=np.stack([np.zeros((400, 3)), np.full((400, 3), 4.0)]), unit="m", length=0.1, seed=0, r_hat=1.0,
        effective=400.0, divergences=0,
    )  # fmt: skip
    widths = [band.high - band.low for band in (drawn.band(), drawn.band(measured=True))]
    # 2*1.96 standard deviations, 4 and 5; quantiles of 400 samples to a tenth
    assert widths[0] == pytest.approx(2 * 1.96 * 4.0, rel=0.15) and widths[1] == pytest.approx(2 * 1.96 * 5.0, rel=0.15)
    kept = json.loads(json.dumps(drawn.to_dict()))
    assert kept["intervals"]["slope"]["low"] == drawn.intervals()["slope"].low and kept["warnings"] == []


def test_a_loop_is_read_with_the_units_of_its_columns(tmp_path):
    way = np.concatenate([np.linspace(0.0, 4.0, 17), np.linspace(4.0, 0.0, 17)])
    rows = "\n".join(f"{p:.3f},{10.0 * p:.3f},{250.0 - 10.0 * p:.3f}" for p in way)
    path = tmp_path / "loop.csv"
    path.write_text(f"pressure [bar],stroke [mm],length [mm]\n{rows}\n")
    record = read_path(path, pressure_zero=1e4)
    assert record.pressure == pytest.approx(1e5 * way - 1e4) and record.stroke == pytest.approx(0.01 * way)
    path.write_text(f"pressure [bar],other,length [mm]\n{rows}\n")
    assert read_path(path).stroke == pytest.approx(0.01 * way)  # the length shortens by the stroke
    path.write_text(f"p_sensor,w,other\n{rows}\n")
    with pytest.raises(InputError, match="pressure"):
        read_path(path)
    named = read_path(path, columns={"pressure": 1, "stroke": "w"}, units={"pressure": "bar", "stroke": "mm"})
    assert named.stroke == pytest.approx(0.01 * way)
    with pytest.raises(InputError, match="between 1 and 3"):
        read_path(path, columns={"pressure": 4})


@pytest.mark.slow
def test_samples_of_a_record_have_the_exact_distribution():
    pytest.importorskip("numpyro")
    noise = 0.05
    measured = SLOPES @ np.array([0.5, 2.0]) + noise * np.random.default_rng(5).standard_normal(COUNT)
    drawn = posterior_of_records(line(measured), noise=noise, draws=2000, warm_up=300, seed=0)
    inverse = np.linalg.inv(SLOPES.T @ SLOPES)
    exact = inverse @ SLOPES.T @ measured
    deviation = noise * np.sqrt(np.diag(inverse))
    for i, name in enumerate(("offset", "slope")):
        column = drawn.samples[name]
        # 2000 samples of which a third are independent: four standard errors of the mean; the discrepancy adds to the width
        assert abs(column.mean() - exact[i]) < 0.5 * deviation[i]
        assert 0.8 * deviation[i] < column.std() < 2.0 * deviation[i]


@pytest.mark.slow
def test_a_friction_has_a_posterior_around_its_fit():
    pytest.importorskip("numpyro")
    fit = dahl_fit("all")
    problem = fit.problem()
    # the same prediction from the same parameters, through their scaling and back
    assert problem.model.predict(problem.start) == pytest.approx(fit.predicted, abs=1e-9)
    drawn = fit.posterior(draws=600)
    assert drawn.warnings == () and drawn.noise_size == pytest.approx(NOISE, rel=0.3)
    for name, e in drawn.intervals().items():
        if name in fit.parameters:
            known = fit.parameters[name]
            # noise without correlation: the linearised interval is right, and 600 samples know their ends to a quarter
            assert (e.high - e.low) / (known.high - known.low) == pytest.approx(1.0, abs=0.35)
    band = drawn.band(measured=True)
    inside = (band.low <= drawn.measured) & (drawn.measured <= band.high)
    assert 0.88 <= inside.mean() <= 1.0  # 95 % of 81 samples, three standard errors


def test_a_fit_that_did_not_converge_has_no_posterior():
    class Lost:
        converged, model = False, "dahl"

    with pytest.raises(ConvergenceError, match="did not converge, so there is nothing to sample"):
        posterior_of_loop(Lost())  # type: ignore[arg-type]
