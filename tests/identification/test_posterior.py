"""Posterior of a fit: the likelihood with its discrepancy, bands, files, and samples of a known distribution."""

import dataclasses
import functools
import json

import numpy as np
import pytest

import mckibben as mk
from mckibben._jax import jax, jnp
from mckibben.errors import InputError
from mckibben.identification import sampler
from mckibben.identification.posterior import (
    MapSensors,
    Posterior,
    SensorErrors,
    _model_of,
    posterior_of_fit,
    read_posterior,
    run_columns,
)
from mckibben.identification.problem import Problem

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


def test_a_posterior_refuses_the_muscle_of_another_fit_and_says_which_points_lie_outside_of_its_map():
    samples = posterior(0.5)
    samples.check_muscle(mk.muscle("nylon", law="gas_spring").law, "nylon")
    with pytest.raises(
        InputError, match="not that of the muscle festo-10mm, whose tensions miss the 12 measured points"
    ):
        samples.check_muscle(mk.muscle("festo-10mm").law, "festo-10mm")
    assert samples.beyond([0.12, 0.15], [2e5, 5e5]) is None
    said = samples.beyond([0.13, 0.17], 3e5)
    assert said == "a length of 17 cm is outside of the measured 12 cm to 15 cm, where the intervals are a guess"
    assert "a pressure of 8 bar is outside of the measured 2 bar to 5 bar" in str(samples.beyond(0.13, 8e5))


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


def runs_of_a_map():
    """Points of a map in three runs: labels (12,), columns (12, 3), modes of their errors and the places."""
    labels = np.array(["a", "b", "c"])[np.arange(len(LENGTHS)) % 3]
    places = np.stack([LENGTHS / 0.03, PRESSURES / 3e5], axis=1)
    covariance = 0.25 * np.eye(len(LENGTHS)) + 0.01
    return labels, run_columns(labels)[1], covariance, sampler.matern(places, places, 0.3)


def test_the_likelihood_of_runs_is_that_of_the_whole_covariance_with_its_derivatives():
    chance = np.random.default_rng(1)
    _, columns, covariance, correlation = runs_of_a_map()
    values, directions = sampler.ErrorModes.of(covariance, correlation)
    differences, residual = [], chance.standard_normal(len(LENGTHS))
    slope_by_run = jax.jit(jax.grad(functools.partial(sampler.marginal, xp=jnp), argnums=5))
    z, padded = directions @ residual, np.pad(directions @ columns, ((0, 0), (0, 3)))
    for noise, amplitude, run in ((1.0, 0.5, 0.0), (1.3, 2.0, 0.7), (0.8, 1.0, 30.0)):
        whole = noise**2 * covariance + amplitude**2 * correlation + run**2 * columns @ columns.T
        exact = -0.5 * (residual @ np.linalg.solve(whole, residual) + np.linalg.slogdet(whole)[1])
        differences.append(exact - sampler.marginal(values, z, noise, amplitude, padded, run))
        inverse = np.linalg.inv(whole)
        pull = inverse @ residual
        slope = run * (np.sum((columns.T @ pull) ** 2) - np.trace(columns.T @ inverse @ columns))
        by_run = slope_by_run(values, z, noise, amplitude, padded, run)
        # the derivative of a Gaussian's logarithm, to the rounding of an inverse
        assert float(by_run) == pytest.approx(slope, rel=1e-8, abs=1e-12)
        sizes = [np.array([size]) for size in (noise, amplitude)]
        precision = sampler.Precision.of(values, *sizes, padded, np.array([run]))
        assert directions.T @ precision.times(z[None])[0] == pytest.approx(pull, rel=1e-9)
        onto = correlation[:2] @ directions.T
        squares = np.diag(correlation[:2] @ inverse @ correlation[:2].T)
        assert precision.squares(onto)[0] == pytest.approx(squares, rel=1e-9)
    # equal up to a constant, to the rounding of two factorisations
    assert differences == pytest.approx([differences[0]] * 3, abs=1e-9)


def test_intervals_of_the_discrepancy_hold_it_where_runs_differ_and_not_where_they_pass_for_one():
    chance, (_, columns, covariance, correlation) = np.random.default_rng(7), runs_of_a_map()
    modes = sampler.ErrorModes.of(covariance, correlation)
    count, amplitude, run = 500, 1.0, 2.0
    roots = [np.linalg.cholesky(x) for x in (covariance, correlation + 1e-12 * np.eye(len(LENGTHS)))]
    errors, truth = (chance.standard_normal((count, len(LENGTHS))) @ root.T for root in roots)
    measured = truth + errors + run * chance.standard_normal((count, 3)) @ columns.T
    onto, sizes = correlation @ modes.directions.T, (np.ones(count), np.full(count, amplitude))
    shares = []
    for told in (modes.directions @ columns, None):
        precision = sampler.Precision.of(modes.values, *sizes, told, np.full(count, run))
        mean, deviation = sampler.discrepancy_given(precision, onto, measured @ modes.directions.T, sizes[1])
        shares.append(float((np.abs(truth - mean) < 1.96 * deviation).mean()))
    # 500 maps of 12 points that share three errors: at least 1500 independent, a standard error below 0.6 %
    assert shares[0] == pytest.approx(0.95, abs=0.02)
    assert shares[1] < 0.7  # runs off by four times the noise pass for independent points


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
    assert sampler.mixing_warnings(1.01, 500.0, 0, 1000, "stiffness") == ()
    (disagree,) = sampler.mixing_warnings(1.30, 9.0, 0, 1000, "stiffness")
    assert "about stiffness (R-hat 1.30)" in disagree and "fix stiffness" in disagree
    (few,) = sampler.mixing_warnings(1.01, 90.0, 0, 1000)
    assert few == "only 90 samples are independent: draw more"


def test_samples_are_enough_exactly_where_each_number_is_within_its_limit():
    count, most, beyond = 1000, int(1000 * sampler.LOST), np.nextafter
    limits = {
        "r_hat": (1.0, sampler.MIXED, beyond(sampler.MIXED, 2.0), np.inf, np.nan),
        "effective": (np.inf, sampler.FEW, beyond(sampler.FEW, 0.0), 0.0, np.nan),
        "divergences": (0, most, most + 1, count),
    }
    for name, (*good, bad) in ((name, (*values[:2], value)) for name, values in limits.items() for value in values[2:]):
        sound = {key: values[0] for key, values in limits.items()}
        for value, enough in ((good[0], True), (good[1], True), (bad, False)):
            numbers = sound | {name: value}
            assert sampler._Mixing(**numbers, worst=0).enough(count) is enough
            assert len(sampler.mixing_warnings(**numbers, count=count)) == (not enough)


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


def test_readings_of_a_known_run_share_its_error_and_a_new_run_adds_one():
    """Against the conditional Gaussian of the dense covariance of discrepancy and errors."""
    labels, columns, _, _ = runs_of_a_map()
    tension = np.asarray(mk.muscle("nylon", law="gas_spring").law.tension(LENGTHS, PRESSURES)) + columns @ [
        3.0,
        -2.0,
        0.0,
    ]
    one = posterior(4.0, points=tension)
    one = dataclasses.replace(one, run=np.full(len(one), 2.5), points=dataclasses.replace(one.points, run=labels))
    at = LENGTHS[:4] + 1e-3, PRESSURES[:4]
    some = one.run_covariance(*at, runs=["a", "b", "new", "new"])
    places, there = one._places(LENGTHS, PRESSURES, None), one._places(*at, None)  # noqa: SLF001
    data = 0.25 * np.eye(12) + 16.0 * sampler.matern(places, places, 0.3) + 6.25 * columns @ columns.T
    member = np.zeros((4, 12))
    member[0], member[1] = 6.25 * (labels == "a"), 6.25 * (labels == "b")
    smooth = 16.0 * sampler.matern(there, places, 0.3)
    prior = 6.25 * np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 1, 1]])
    # the same Gaussian by another factorisation, to its rounding
    assert some.errors == pytest.approx(prior - member @ np.linalg.solve(data, member.T), abs=1e-9)
    assert some.across == pytest.approx(-smooth @ np.linalg.solve(data, member.T), abs=1e-9)
    residual = tension - one.signed_tensions(LENGTHS, PRESSURES)[0]
    assert some.mean[0] == pytest.approx(member @ np.linalg.solve(data, residual), abs=1e-9)
    mean, _ = one._discrepancy(*at, None)  # noqa: SLF001
    assert mean[0] == pytest.approx(smooth @ np.linalg.solve(data, residual), abs=1e-8)
    assert np.array_equal(one.run_covariance(*at).errors, np.full((4, 4), 6.25))
    # a further run shows more than the noise: twice 1.96 times sqrt(0.5^2 + 2.5^2) at least, of 200 draws within a fifth
    wide, narrow = one.tension(*at, measured=True), one.tension(*at)
    added = np.sqrt((wide.high - wide.low) ** 2 - (narrow.high - narrow.low) ** 2)
    assert added == pytest.approx(2.0 * 1.96 * np.hypot(0.5, 2.5), rel=0.2)


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
    runs = dataclasses.replace(drawn.points, run=runs_of_a_map()[0])
    drawn = dataclasses.replace(drawn, run=np.full(len(drawn), 1.5), points=runs)
    path = tmp_path / "fit.json"
    path.write_text(json.dumps({"fits": [{"law": "ideal"}, {"law": "gas_spring", "posterior": drawn.to_dict()}]}))
    back = read_posterior(path)
    assert np.array_equal(back.tension(0.131, 3e5, measured=True), drawn.tension(0.131, 3e5, measured=True))
    assert back.run_error == 1.5
    assert back.laws(3)[1] == drawn.laws(3)[1]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            "[]",
            "is not the result of a fit with samples of its posterior; save a fit",
        ),
        ('{"fits": [{"law": "ideal"}]}', "is the result of a fit without samples of its posterior"),
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


def test_kernels_predict_and_slope_as_the_law_does_by_xla(monkeypatch):
    """One law, lowered or compiled by XLA: they differ by the order of additions only, and neither calls Python."""
    fitted = mk.fit("DMSP-20-300", law="linear_threshold", schemes=())
    problem = Problem(fitted.law, tuple(fitted.parameters), dict(fitted.known), fitted.points)
    kernels = _model_of(problem)
    monkeypatch.setattr(Problem, "runs_by_xla", True)
    rows = np.array([p.value for p in fitted.parameters.values()]) / problem.scale * [[1.0], [0.97], [1.02]]
    weights = np.random.default_rng(0).standard_normal(len(fitted.points))

    def both(of):
        return jax.jit(lambda x: jax.lax.map(jax.value_and_grad(lambda x: weights @ of["model"](x, of["inputs"])), x))

    for mine, exact in zip(both(kernels)(rows), both(_model_of(problem))(rows), strict=True):
        np.testing.assert_allclose(mine, exact, rtol=1e-9)  # sums of many terms of both signs
    # Each step of a chain would wait for Python, and a program that calls it is compiled anew by every process.
    said = both(kernels).lower(rows).as_text()
    assert "lanewise_" in said and "callback" not in said


def two_basins(x, inputs):
    """A prediction that meets a measured 0 at the normal scores -4, 0 and 4 of its parameter."""
    return 30.0 * jnp.sin(0.25 * jnp.pi * jnp.clip(jax.scipy.special.ndtri(x), -6.0, 6.0))


def test_chains_of_a_fit_that_ended_at_a_bound_begin_at_the_mode_and_not_in_its_corner():
    evidence = sampler.Evidence(
        model=two_basins,
        inputs={},
        measured=np.zeros(1),
        modes=sampler.ErrorModes.of(np.eye(1), np.eye(1)),
        slack_variance=np.zeros(0),
        low=np.zeros(1),
        high=np.ones(1),
        start=np.zeros(1),  # at its bound: a score of -4.8 where the search begins
        noise_known=True,
        amplitude=0.0,
    )
    centre, _ = sampler._mode(evidence, sampler._data(evidence))  # noqa: SLF001
    # the prior is exp(8) times as probable at 0 as at -4, and likelihood and prior are largest there, to the search's end
    assert centre[0] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.slow
def test_points_of_one_run_are_drawn_as_points_without_runs():
    pytest.importorskip("numpyro")
    law = mk.muscle("nylon", law="gas_spring").law
    noise = np.random.default_rng(0).standard_normal(len(LENGTHS))
    points = mk.ForceMap("virtual", LENGTHS, PRESSURES, np.asarray(law.tension(LENGTHS, PRESSURES)) + noise)
    fit = mk.fit(points.with_rest_length(0.14), law="gas_spring", schemes=())
    options = {"draws": 200, "warm_up": 100}
    plain, one = posterior_of_fit(fit, **options), posterior_of_fit(fit, runs=["a"] * len(LENGTHS), **options)
    several = posterior_of_fit(fit, runs=runs_of_a_map()[0], **options)
    assert one.run is None and several.run is not None and several.run_error > 0.0
    assert all(np.array_equal(one.samples[name], plain.samples[name]) for name in plain.samples)  # to the last bit
    with pytest.raises(InputError, match="runs must be 12 labels"):
        posterior_of_fit(fit, runs=["a"], **options)


STRAIGHT_NOISE = 0.2


def straight_line():
    """Twelve measured values of a straight line, its slopes (12, 2), and the evidence of a model that is right."""
    chance = np.random.default_rng(3)
    x = np.linspace(-1.0, 1.0, 12)
    slopes = np.stack([np.ones(12), x], axis=1)
    measured = slopes @ np.array([0.5, -0.3]) + STRAIGHT_NOISE * chance.standard_normal(12)
    evidence = sampler.Evidence(
        model=sampler.host_model(12, 2),
        inputs={},
        measured=measured,
        modes=sampler.ErrorModes.of(STRAIGHT_NOISE**2 * np.eye(12), np.eye(12)),
        slack_variance=np.zeros(0),
        low=np.full(2, -5.0),
        high=np.full(2, 5.0),
        start=np.array([0.1, 0.1]),
        noise_known=True,
        amplitude=0.0,
        host=sampler.HostModel(lambda p: slopes @ p, lambda p: slopes),
    )
    return measured, slopes, evidence


def test_few_samples_come_from_one_round_of_chains_long_enough_to_be_judged(monkeypatch):
    pytest.importorskip("numpyro")
    chance, rounds = np.random.default_rng(5), []

    def perfect(model, chains, warm_up, each):
        def kernel(keys, z, data):
            rounds.append(each)
            return chance.standard_normal((chains, each, z.shape[1])), np.zeros((chains, each), bool)

        return kernel

    monkeypatch.setattr(sampler, "_kernel", perfect)
    for draws in (100, 2000):
        rounds.clear()
        drawn = sampler.sample(straight_line()[2], draws=draws)
        assert len(drawn.parameters) == draws
        assert len(rounds) == 1  # another would warm up anew, although every sample is independent
        assert drawn.r_hat < sampler.MIXED


@pytest.mark.slow
def test_samples_of_a_straight_line_have_the_exact_distribution():
    pytest.importorskip("numpyro")
    measured, slopes, evidence = straight_line()
    drawn = sampler.sample(evidence, draws=2000, warm_up=300)
    inverse = np.linalg.inv(slopes.T @ slopes)
    exact = inverse @ slopes.T @ measured
    deviation = np.sqrt(np.diag(inverse)) * np.median(drawn.noise) * STRAIGHT_NOISE
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
    assert not both or bool(
        sampler.mixing_warnings(drawn.r_hat, drawn.effective, drawn.divergences, len(drawn.parameters))
    )
