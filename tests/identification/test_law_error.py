"""Intervals of predicted tensions: as wide as noise and parameters ask near the points, and wider where a law errs."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from test_priors import NOISE, SHORTEST, SLOPE, STIFFNESS, SpringInGas

import mckibben as mk
from mckibben.identification import Fit, fit
from mckibben.identification.discrepancy import _mixture_half_width
from mckibben.recordings import ForceMap

LENGTH, PRESSURE = np.linspace(0.11, 0.14, 7), np.linspace(1e5, 5e5, 9)


def true_tension(length: np.ndarray, pressure: np.ndarray, wavy: float = 0.0, phase: float = 0.0) -> np.ndarray:
    """Of `SpringInGas`, with waves of so many newtons over the length that no parameter of it can make."""
    return (SLOPE * pressure + STIFFNESS) * (length - SHORTEST) + wavy * np.sin(length / 0.012 + phase)


@functools.cache
def found(wavy: float, phase: float = 0.0, seed: int = 3) -> Fit:
    length, pressure = np.broadcast_arrays(LENGTH[:, None], PRESSURE)
    tension = true_tension(length, pressure, wavy, phase)
    tension = tension + NOISE * np.random.default_rng(seed).standard_normal(tension.shape)
    return fit(ForceMap("made", length.ravel(), pressure.ravel(), tension.ravel()), SpringInGas, schemes=())


def test_where_the_law_is_right_an_interval_is_that_of_noise_and_parameters() -> None:
    at = found(0.0).predict(LENGTH[:, None], PRESSURE)
    half = 0.5 * (at.high - at.low)
    # Three parameters of 63 points add a fifth to the noise at most; a discrepancy that noise feigns adds as much again.
    assert half.min() > 1.96 * NOISE * 0.85
    assert half.max() < 1.96 * NOISE * 1.5


def test_intervals_hold_tensions_beyond_the_measured_lengths_where_the_law_is_wrong() -> None:
    beyond, inside, by_residuals = np.array([0.104, 0.107, 0.143, 0.146])[:, None], [], []
    for phase in np.arange(8) * np.pi / 4.0:
        law, true = found(1.5, phase), true_tension(beyond, PRESSURE, 1.5, phase)
        at = law.predict(beyond, PRESSURE)
        inside.append((at.low < true) & (true < at.high))
        by_residuals.append(np.abs(at.tension - true) < 1.96 * law.rmse)
    # What the law leaves of its points says too little of this: else the test would mean nothing.
    assert np.mean(by_residuals) < 0.7
    # 95 %, of eight phases whose four lengths are as good as one or two: two standard errors
    assert np.mean(inside) > 0.85


def test_an_interval_grows_with_the_distance_from_the_points() -> None:
    law = found(1.5)
    among = law.predict(LENGTH, 3e5)
    for length, pressure in ((np.array([0.145, 0.15, 0.16]), 3e5), (0.125, np.array([7e5, 9e5, 12e5]))):
        at = law.predict(length, pressure)
        assert (np.diff(at.high - at.low) > 0.0).all()
        assert at.high[0] - at.low[0] > (among.high - among.low).min()


def test_a_reading_that_the_fit_was_not_shown_lies_within_in_95_of_100_cases() -> None:
    inside = []
    for seed in range(8):
        law, chance = found(0.0, 0.0, seed), np.random.default_rng(100 + seed)
        length, pressure = chance.uniform(0.11, 0.14, 50), chance.uniform(1e5, 5e5, 50)
        reading = true_tension(length, pressure) + NOISE * chance.standard_normal(50)
        at = law.predict(length, pressure)
        inside.append((at.low < reading) & (reading < at.high))
    assert 0.925 < np.mean(inside) < 0.985  # three standard errors of 400 readings


def test_the_half_width_of_a_mixture_holds_95_per_cent_of_it() -> None:
    alone = _mixture_half_width(np.ones(1), np.zeros((1, 1)), np.full((1, 1), 2.0))
    assert alone[0] == pytest.approx(1.959964 * 2.0, rel=1e-6)  # of the quantile's digits
    weights, means, deviations = np.array([0.3, 0.7]), np.array([[1.0], [-2.0]]), np.array([[0.5], [3.0]])
    half = _mixture_half_width(weights, means, deviations)[0]
    chance = np.random.default_rng(1)
    which = chance.choice(2, 200_000, p=weights)
    drawn = means[which, 0] + deviations[which, 0] * chance.standard_normal(200_000)
    assert np.mean(np.abs(drawn) < half) == pytest.approx(0.95, abs=0.002)  # four standard errors of 200,000 draws


def test_errors_of_a_law_lie_at_contractions() -> None:
    points, known = mk.specimen("DMSP-20-300").force_map(), {"rest_diameter": 0.02, "wall_thickness": 1.8e-3}
    labelled = fit("hyperelastic_braid", points.with_rest_length(0.3), known=known, schemes=())
    stated = fit(
        "hyperelastic_braid", replace(points, rest_length=None), known=known | {"rest_length": 0.3}, schemes=()
    )
    slopes, pressure = np.zeros((2, len(labelled.parameters))), np.full(2, 3e5)
    own = labelled._law_error.half_width(np.array([0.25, 0.28]), pressure, slopes, None)
    half = labelled._law_error.half_width(np.array([0.125, 0.14]), pressure, slopes, 0.15)
    np.testing.assert_allclose(half, own, rtol=1e-9)  # the same places but for rounding
    # the same points with the rest length as a column and as one number; derivatives by steps of a hundredth
    other = [law.predict(np.array([0.125, 0.14]), 3e5, rest_length=0.15) for law in (labelled, stated)]
    np.testing.assert_allclose(other[0].high - other[0].low, other[1].high - other[1].low, rtol=1e-3)
