"""Posterior of a fit: the likelihood with its discrepancy, bands, files, and samples of a known distribution."""

import json

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.identification import sampler
from mckibben.identification._samples import mixing_warnings
from mckibben.identification.posterior import MapSensors, Posterior, SensorErrors, read_posterior

LENGTHS, PRESSURES = (a.ravel() for a in np.meshgrid(np.linspace(0.12, 0.15, 4), np.linspace(2e5, 5e5, 3)))


def posterior(amplitude, *, count=200, spread=0.0, points=None):
    """Samples of a gas spring made by hand, around the parameters of the map."""
    law = mk.muscle("nylon", law="gas_spring").law
    tension = np.asarray(law.tension(LENGTHS, PRESSURES)) if points is None else points
    chance = np.random.default_rng(0)
    samples = {
        name: float(getattr(law, name)) * (1.0 + spread * chance.standard_normal(count))
        for name in ("stiffness_per_pressure", "shortest_length")
    }
    return Posterior(
        law="gas_spring",
        samples=samples,
        noise=np.ones(count),
        amplitude=np.full(count, amplitude),
        known={"rest_length": 0.14, "upper_length": 0.154, "rest_volume": 5.63e-6},
        points=mk.ForceMap("virtual", LENGTHS, PRESSURES, tension),
        errors=SensorErrors(np.full(len(LENGTHS), 0.5), np.zeros((0, len(LENGTHS)))),
        length=0.3,
        seed=0,
        r_hat=1.0,
        effective=float(count),
        divergences=0,
    )


def test_the_likelihood_by_modes_is_that_of_the_whole_covariance():
    chance = np.random.default_rng(1)
    places = chance.uniform(size=(9, 2))
    root = np.tril(chance.uniform(0.1, 1.0, (9, 9))) + np.eye(9)
    covariance, correlation = root @ root.T, sampler.matern(places, places, 0.3)
    values, directions = sampler.ErrorModes.of(covariance, correlation)
    scores = []
    for noise, amplitude in ((1.0, 0.5), (1.3, 2.0)):
        residual = chance.standard_normal(9)
        whole = noise**2 * covariance + amplitude**2 * correlation
        exact = -0.5 * (residual @ np.linalg.solve(whole, residual) + np.linalg.slogdet(whole)[1])
        scores.append(exact - sampler.marginal(values, directions @ residual, noise, amplitude))
    # equal up to a constant, to the rounding of two factorisations
    assert scores[0] == pytest.approx(scores[1], abs=1e-9)


def test_the_prior_reaches_eight_deviations_of_the_linearised_fit_and_no_bound_further():
    chance = np.random.default_rng(4)
    slopes, start = chance.standard_normal((20, 2)) * [1.0, 1e3], np.array([1.0, 1e-3])
    low, high = sampler.around(start, slopes, 0.04 * np.eye(20), np.array([0.9, -9.0]), np.array([9.0, 9.0]))
    deviation = 0.2 * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    # the inverse by eigenvalues of the scaled matrix and by elimination agree to rounding
    assert high - start == pytest.approx(sampler.REACH * deviation, rel=1e-9)
    assert low[0] == 0.9 and start[1] - low[1] == pytest.approx(sampler.REACH * deviation[1], rel=1e-9)
    unseen = sampler.around(start, slopes * [1.0, 0.0], np.eye(20), np.array([0.9, -9.0]), np.array([9.0, 9.0]))
    assert (unseen[0][1], unseen[1][1]) == (-9.0, 9.0)  # a parameter that no point shows keeps its bounds


def test_residuals_tell_noise_from_a_discrepancy():
    x = np.linspace(0.0, 1.0, 40)[:, None]
    noise = np.random.default_rng(5).standard_normal(40)
    for residual, smooth in ((noise, False), (5.0 * np.sin(7.0 * x[:, 0]) + 0.1 * noise, True)):
        sizes = sampler.error_sizes(residual, x, np.eye(40), 10.0, noise_known=False)
        # a smooth residual has the size of its sine, and noise of 1 no discrepancy of half its size
        assert (sizes.amplitude > 2.0) == smooth and (sizes.amplitude > 0.5) == smooth
        assert (sizes.noise > 0.5) != smooth


def test_a_warning_names_the_parameter_about_which_chains_disagree():
    assert mixing_warnings(1.01, 500.0, 0, 1000, "stiffness") == ()
    (disagree,) = mixing_warnings(1.30, 9.0, 0, 1000, "stiffness")
    assert "about stiffness (R-hat 1.30)" in disagree and "fix stiffness" in disagree
    (few,) = mixing_warnings(1.01, 90.0, 0, 1000)
    assert few == "only 90 samples are independent: draw more"


def test_errors_that_all_points_share_are_correlated():
    tension, slope = np.array([10.0, 20.0]), np.array([1e-4, 2e-4])
    errors = MapSensors(tension=0.3, pressure=1e3, tension_gain=0.01, pressure_zero=2e3).errors(
        tension, 0.0 * slope, slope
    )
    covariance = errors.covariance
    # by hand: gain 0.01*10*0.01*20 + zero 0.2*0.4; noise 0.3^2 + (1e-4*1e3)^2 on the diagonal besides
    assert covariance[0, 1] == pytest.approx(0.1 * 0.2 + 0.2 * 0.4, rel=1e-12)
    assert covariance[0, 0] == pytest.approx(0.09 + 0.01 + 0.01 + 0.04, rel=1e-12)


def test_without_discrepancy_and_spread_the_band_is_the_law():
    sure = posterior(0.0)
    law = mk.muscle("nylon", law="gas_spring").law
    band = sure.tension(0.137, 3e5)
    # the same kernel with the same parameters
    assert band.low == band.median == band.high == pytest.approx(float(law.tension(0.137, 3e5)), rel=1e-12)


def test_a_discrepancy_follows_the_points_and_opens_away_from_them():
    law = mk.muscle("nylon", law="gas_spring").law
    shifted = np.asarray(law.tension(LENGTHS, PRESSURES)) + 8.0
    wrong = posterior(10.0, points=shifted)
    at, away = wrong.tension(LENGTHS[5], PRESSURES[5]), wrong.tension(0.12, 9e5)
    # the sensor has 0.5 N: four of it hold the point, and the median of 200 draws is within one
    assert at.low < shifted[5] < at.high and at.high - at.low < 4.0 * 0.5
    assert abs(at.median - shifted[5]) < 0.5
    # beyond a correlation length the discrepancy is as large as its prior: 2*1.96*10 N, of 200 draws within a fifth
    assert away.high - away.low == pytest.approx(39.2, rel=0.2)
    assert wrong.tension(0.12, 9e5, measured=True).high > away.low


def test_joint_intervals_hold_all_parameters_at_once():
    drawn = posterior(0.0, spread=0.05)
    both, each = drawn.joint_intervals(), drawn.intervals()
    inside = np.ones(len(drawn), bool)
    for name, e in both.items():
        inside &= (drawn.samples[name] >= e.low) & (drawn.samples[name] <= e.high)
        assert e.low < each[name].low < each[name].high < e.high
    # 95 % of 200 samples, up to the two samples at the ends
    assert inside.mean() == pytest.approx(0.95, abs=0.015)


def test_a_posterior_of_a_file_gives_the_same_bands(tmp_path):
    drawn = posterior(3.0, spread=0.02)
    path = tmp_path / "fit.json"
    path.write_text(json.dumps({"fits": [{"law": "ideal"}, {"law": "gas_spring", "posterior": drawn.to_dict()}]}))
    back = read_posterior(path)
    assert np.array_equal(back.tension(0.131, 3e5), drawn.tension(0.131, 3e5))
    assert back.laws(3)[1] == drawn.laws(3)[1]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[]", "is no file of a fit with its posterior; the command fit writes one"),
        ('{"fits": [{"law": "ideal"}]}', "is a fit without a posterior"),
        ('{"fits": [{"law": "ideal", "posterior": {"law": "ideal"}}]}', "must be a posterior as"),
    ],
)
def test_a_file_without_a_posterior_is_refused_by_its_name(tmp_path, content, words):
    path = tmp_path / "fit.json"
    path.write_text(content)
    with pytest.raises(InputError, match=words) as error:
        read_posterior(path)
    assert "fit.json" in str(error.value)


def test_impossible_sensors_and_counts_are_refused():
    with pytest.raises(InputError, match="must be more than 0 N"):
        MapSensors(tension=0.0)
    with pytest.raises(InputError, match="sensors.pressure must be 0 or more"):
        MapSensors(tension=1.0, pressure=-1.0)
    with pytest.raises(InputError, match="between 1 and 200"):
        posterior(0.0).rows(201)


@pytest.mark.slow
def test_samples_of_a_straight_line_have_the_exact_distribution():
    pytest.importorskip("numpyro")
    chance = np.random.default_rng(3)
    x = np.linspace(-1.0, 1.0, 12)
    slopes = np.stack([np.ones(12), x], axis=1)
    noise = 0.2
    measured = slopes @ np.array([0.5, -0.3]) + noise * chance.standard_normal(12)
    evidence = sampler.Evidence(
        model=sampler.host_model(12, 2),
        inputs={},
        measured=measured,
        modes=sampler.ErrorModes.of(noise**2 * np.eye(12), np.eye(12)),
        slack_variance=np.zeros(0),
        low=np.full(2, -5.0),
        high=np.full(2, 5.0),
        start=np.array([0.1, 0.1]),
        noise_known=True,
        amplitude=0.0,
        host=sampler.HostModel(lambda p: slopes @ p, lambda p: slopes),
    )
    drawn = sampler.sample(evidence, draws=2000, warm_up=300)
    inverse = np.linalg.inv(slopes.T @ slopes)
    exact = inverse @ slopes.T @ measured
    deviation = np.sqrt(np.diag(inverse)) * np.median(drawn.noise) * noise
    # 2000 samples of which a third are independent: four standard errors of a mean, and of a deviation
    assert drawn.r_hat < 1.05 and drawn.divergences == 0
    assert np.abs(drawn.parameters.mean(axis=0) - exact).max() < 4.0 * deviation.max() / np.sqrt(600.0)
    assert drawn.parameters.std(axis=0) == pytest.approx(deviation, rel=0.15)


@pytest.mark.slow
def test_chains_that_begin_in_two_basins_say_so_or_agree():
    pytest.importorskip("numpyro")
    # the square of the parameter is measured, so both signs are as probable, and a chain does not pass between them
    evidence = sampler.Evidence(
        model=sampler.host_model(6, 1),
        inputs={},
        measured=np.full(6, 4.0),
        modes=sampler.ErrorModes.of(0.01 * np.eye(6), np.eye(6)),
        slack_variance=np.zeros(0),
        low=np.array([-5.0]),
        high=np.array([5.0]),
        start=np.array([0.1]),
        noise_known=True,
        amplitude=0.0,
        host=sampler.HostModel(lambda p: np.full(6, p[0] ** 2), lambda p: np.full((6, 1), 2.0 * p[0])),
    )
    drawn = sampler.sample(evidence, draws=400, warm_up=200)
    assert np.abs(np.abs(drawn.parameters) - 2.0).max() < 0.1  # six standard errors of 0.1/(2*2*sqrt(6))
    both = 0.0 < (drawn.parameters > 0.0).mean() < 1.0
    assert not both or bool(mixing_warnings(drawn.r_hat, drawn.effective, drawn.divergences, len(drawn.parameters)))
