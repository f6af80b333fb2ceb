"""Priors of parameters and errors of set lengths: what the data say and what they do not."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import mckibben as mk
from mckibben.components import Scalar
from mckibben.errors import ConvergenceError, InputError
from mckibben.estimation import Estimate
from mckibben.identification import Fit, fit
from mckibben.identification.problem import Problem
from mckibben.muscles.law import TensionLaw
from mckibben.quantities import quantity
from mckibben.recordings import ForceMap

SLOPE, SHORTEST, STIFFNESS = 4e-3, 0.1, 500.0
ADDED = np.array([0.6e-3, -0.4e-3, 0.2e-3, -0.3e-3, 0.5e-3])  # to the set lengths [m]
NOISE = 0.1  # N


class SpringInGas(TensionLaw):
    """A gas spring with a passive one beside it; the rate of a third part is not in the data."""

    title, cites, fitted = "spring in gas", (), ("gain", "wall", "shortest")
    gain = quantity("m", (0.0, 1.0), "force per pressure and length", typical=(1e-3, 1e-2))
    wall = quantity("N/m", (0.0, 1e5), "passive stiffness", typical=(100.0, 1000.0))
    shortest = quantity("m", (1e-3, 10.0), "length without pull", typical=(0.08, 0.12))
    priors = {"shortest": (SHORTEST, 2e-4)}

    def elastic_tension(self, length: Scalar) -> Scalar:
        """Force of the passive spring [N]."""
        return self.wall * (length - self.shortest)

    def gas_energy(self, length: Scalar, pressure: Scalar) -> Scalar:
        """Energy of the gas [J]."""
        return -0.5 * pressure * self.gain * (length - self.shortest) ** 2

    def length_range(self) -> tuple[Scalar, Scalar]:
        """Lengths between which an equilibrium is sought [m]."""
        return self.shortest, 2.0 * self.shortest


def measured() -> ForceMap:
    """A table of five set lengths, each off by `ADDED`."""
    length, pressure = np.linspace(0.11, 0.14, 5)[:, None], np.linspace(1e5, 5e5, 9)
    true = length + ADDED[:, None] - SHORTEST
    tension = SLOPE * pressure * true + STIFFNESS * true
    tension = tension + NOISE * np.random.default_rng(3).standard_normal(tension.shape)
    whole = np.broadcast_arrays(length, pressure, tension)
    return ForceMap("made", *(column.ravel() for column in whole))


@functools.cache
def found(length_error: str | None) -> Fit:
    return fit(measured(), SpringInGas, schemes=(), length_error=length_error)


def test_errors_of_set_lengths_are_found_within_their_intervals() -> None:
    errors = found("0.5 mm").length_errors
    assert [round(e.length, 4) for e in errors] == [0.11, 0.1175, 0.125, 0.1325, 0.14]
    assert all(e.low < added < e.high for e, added in zip(errors, ADDED, strict=True))
    # The noise of 0.1 N over 9 pressures at 1.7 N/mm says 0.02 mm; the rest is the common shift, held by the priors.
    assert all(0.0 < e.high - e.low < 1.5e-3 for e in errors)


def test_errors_of_set_lengths_leave_the_noise() -> None:
    # 45 points, some 8 parameters: the standard error of the noise is 12 %, three times that are allowed
    assert found("0.5 mm").rmse == pytest.approx(NOISE, rel=0.35)
    assert found(None).rmse > 4.0 * NOISE
    assert found("0.5 mm").aicc < found(None).aicc - 50.0


def test_the_effective_number_of_parameters_lies_between_the_free_ones_and_all() -> None:
    without, including = found(None).effective, found("0.5 mm").effective
    assert without is not None
    assert including is not None
    assert 2.0 < without <= 3.0 + 1e-9  # gain and wall have no prior
    assert 2.0 < including < 3.0 + 5.0


def test_a_parameter_that_the_data_do_not_contain_keeps_its_prior() -> None:
    table = measured()
    one = table.select(table.length == table.length.min())
    shortest = fit(one, SpringInGas, schemes=()).parameters["shortest"]
    # at one length, gain and wall make up for any shift
    assert shortest.value == pytest.approx(SHORTEST, abs=1e-6)
    assert 0.5 * (shortest.high - shortest.low) == pytest.approx(1.96 * 2e-4, rel=1e-2)


def test_the_errors_are_part_of_what_is_kept_as_plain_values() -> None:
    kept = found("0.5 mm").to_dict()
    assert kept["effective"] == found("0.5 mm").effective
    assert kept["length_errors"][0]["added"] == found("0.5 mm").length_errors[0].added  # type: ignore[index,call-overload]


@pytest.mark.parametrize("wrong", ["0 mm", "-1 mm", "2 cm", "5 bar"])
def test_an_error_of_lengths_that_is_none_is_refused(wrong: str) -> None:
    with pytest.raises(InputError, match="length_error"):
        fit(measured(), SpringInGas, schemes=(), length_error=wrong)


def test_a_predicted_interval_holds_the_true_tension_between_and_beside_the_points() -> None:
    length, pressure = np.linspace(0.108, 0.145, 7)[:, None], np.linspace(0.5e5, 6e5, 5)
    one = found("0.5 mm").predict(length, pressure)
    true = (SLOPE * pressure + STIFFNESS) * (length - SHORTEST)
    assert one.tension.shape == (7, 5)
    # an interval of 95 % of parameters that all points share: they miss together or, as here, not at all
    assert ((one.low < true) & (true < one.high)).all()


def test_a_predicted_interval_is_as_wide_as_the_error_of_the_set_length_makes_it() -> None:
    law, length, pressure = found("0.5 mm"), 0.125, 4e5
    one = law.predict(length, pressure)
    stiffness = float(law.build().stiffness(length, pressure))
    sure = law.predict(length, pressure, **{name: e.value for name, e in law.parameters.items()})
    # Without errors of parameters, the ruler and the noise remain, as independent errors; the law is straight in its length.
    expected = np.hypot(law.length_reach[0] * stiffness, 1.96 * law.rmse)
    assert 0.5 * (sure.high - sure.low) == pytest.approx(expected, rel=1e-3)  # of the quantiles
    assert one.high - one.low > sure.high - sure.low
    # The five errors have a root mean square of 0.42 mm of 0.5 stated; so few leave room for half as much again.
    assert 1.96 * 4.2e-4 < law.length_reach[0] < 1.96 * 7.5e-4


def test_a_muscle_of_another_length_is_used_as_far_in_proportion_as_those_of_the_table() -> None:
    rest = np.array([0.1, 0.2])
    known = {"rest_length": rest, "upper_length": 1.02 * rest, "rest_diameter": 0.01, "wall_thickness": 1.8e-3}
    values = {"rest_angle": 0.48, "shear_modulus": 1e6, "seat_compliance": 1e-4}
    law = replace(
        found(None), law="seated_braid", known=known, parameters={n: Estimate(v, v, v, "1") for n, v in values.items()}
    )
    # products of two numbers, rounded
    assert float(law.build(rest_length=0.05).upper_length) == pytest.approx(0.051, rel=1e-12)
    assert float(law.build(rest_length=0.05, upper_length=0.05).upper_length) == 0.05
    assert float(law.build().upper_length) == pytest.approx(0.204, rel=1e-12)


def test_the_interval_of_a_muscle_that_was_not_fitted_holds_how_far_muscles_differ_in_length() -> None:
    values = {
        "stiffness_per_pressure": 0.01,
        "shortest_length": 0.05,
        "threshold_pressure": 2e4,
        "passive_stiffness": 1e3,
    }
    law = replace(
        found(None),
        law="linear_threshold",
        known={"rest_length": np.array([0.1, 0.2]), "upper_length": 0.3},
        parameters={n: Estimate(v, v, v, "1") for n, v in values.items()},
        correlation=None,
        error=np.zeros(1),
        length_reach=(1e-3, 2e-3),
    )
    for rest, reach in ((0.2, 1e-3), (0.15, 2e-3)):
        one = law.predict(0.95 * rest, 4e5, rest_length=rest, upper_length=0.3)
        stiffness = float(law.build(rest_length=rest, upper_length=0.3).stiffness(0.95 * rest, 4e5))
        # The parameters are known, the law leaves nothing, and is straight here: only the length remains. Rounding.
        assert 0.5 * (one.high - one.low) == pytest.approx(reach * stiffness, rel=1e-9)


def test_a_fit_that_leaves_a_parameter_open_predicts_no_interval() -> None:
    law = found("0.5 mm")
    open_gain = law.parameters["gain"]._replace(low=-np.inf, high=np.inf)
    for lost in (
        replace(law, converged=False),
        replace(law, parameters=law.parameters | {"gain": open_gain}),
    ):
        with pytest.raises(ConvergenceError, match="does not determine"):
            lost.predict(0.13, 3e5)


def test_the_error_of_one_ruler_is_fitted_to_one_muscle_only() -> None:
    one = mk.specimen("DMSP-10-250").force_map().with_rest_length(0.25)
    half = one.select(one.pressure > 3e5)
    both = ForceMap.joined([one, replace(half, length=0.5 * half.length).with_rest_length(0.125)])
    known = {"rest_diameter": 0.01, "wall_thickness": 1.8e-3}
    single, several = (Problem.of("seated_hyperelastic_braid", points, known=known) for points in (one, both))
    assert set(single.free) - set(several.free) == {"length_factor"}
    assert set(several.free) < set(single.free)
