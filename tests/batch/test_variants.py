"""Tables of variants: nothing missing, nothing twice, every part of a range met, words that come back bit for bit."""

import functools
import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lanes_and_runs import step_protocol, template

from mckibben.batch import crossed, grid, latin, listed
from mckibben.batch.posterior import draws, of_json, of_samples
from mckibben.batch.variants import power
from mckibben.errors import InputError
from mckibben.quantities import parse


def test_a_grid_has_every_combination_once_and_the_last_path_varies_fastest():
    table = grid({"a": [1.0, 2.0, 3.0], "b": ["x", "y"]})
    rows = [tuple(r.values()) for r in table.rows()]
    assert rows == [(1.0, "x"), (1.0, "y"), (2.0, "x"), (2.0, "y"), (3.0, "x"), (3.0, "y")]


@settings(max_examples=20)
@given(st.integers(1, 40), st.integers(0, 5))
def test_a_latin_hypercube_meets_every_part_of_every_range_once(count, seed):
    table = latin({"a": (2.0, 5.0, "linear"), "b": (1.0, 1e4, "log")}, count, seed=seed)
    shares = {"a": (table.columns["a"] - 2.0) / 3.0, "b": np.log(table.columns["b"]) / np.log(1e4)}
    for share in shares.values():
        assert sorted(np.minimum(np.floor(share * count + 1e-9), count - 1)) == list(range(count))
    same = latin({"a": (2.0, 5.0, "linear"), "b": (1.0, 1e4, "log")}, count, seed=seed)
    np.testing.assert_array_equal(table.columns["a"], same.columns["a"])


def test_crossing_makes_every_pair_of_rows_and_no_path_varies_twice():
    table = crossed(listed([{"a": 1.0, "b": "x"}, {"a": 2.0, "b": "y"}]), grid({"c": [5.0, 6.0, 7.0]}))
    assert [tuple(r.values()) for r in table.rows()][:4] == [
        (1.0, "x", 5.0),
        (1.0, "x", 6.0),
        (1.0, "x", 7.0),
        (2.0, "y", 5.0),
    ]
    with pytest.raises(InputError, match="varied twice"):
        crossed(grid({"a": [1.0]}), grid({"a": [2.0]}))


@functools.cache
def made():
    return template(step_protocol(), ["muscle.law.passive_stiffness", "rig.control.force.kp", "high"])


@given(st.floats(1e-9, 1e9))
def test_words_of_a_value_come_back_bit_for_bit(value):
    for one in made().settings.values():
        assert parse(one.words(value), one.unit, field="x") == value


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("muscle.law.pasive_stiffness", "3 N/cm", "law.passive_stiffness"),
        ("muscle.law.passive_stiffness", "-3 N/cm", "must be"),
        ("muscle.law.passive_stiffness", "3 bar", "a stiffness"),
        ("rig.plumbing.direct.tube.lenght", "1 m", "rig.plumbing.direct.tube.length"),
        ("rig.plumbing.direct.tube.length", "1", "unit is missing"),
        ("rig.sensors.pressure.low", "3 N", "pressure"),
        ("hihg", "3 bar", "Did you mean 'high'"),
        ("high", "3 m", "pressure"),
    ],
)
def test_unknown_paths_and_values_out_of_bounds_are_named(path, value, said):
    with pytest.raises(InputError, match=said) as error:
        made().setting(path, where="s.toml").read(value, where="s.toml")
    assert str(error.value).startswith("s.toml: ") and path in str(error.value)


def leaves(table, path=""):
    for key, value in table.items():
        yield from leaves(value, f"{path}{key}.") if isinstance(value, dict) else [(f"{path}{key}", value)]


def test_every_amount_of_a_rigs_file_is_a_setting_of_its_dimension_that_reads_what_stands_there():
    amounts = 0
    for path, value in leaves(made().first_rig.document):
        one = made().setting(f"rig.{path}")
        if re.fullmatch(r"-?[\d.e-]+ [^ ]+", str(value)) and not path.endswith(("title", "source", "note", "heat")):
            amounts += 1
            assert one.unit, f"{path} = {value}"
        if one.unit:
            assert one.read(value) == parse(str(value), one.unit, field=path)
            assert one.quantity.bounds[0] <= one.read(value) <= one.quantity.bounds[1]
            assert parse(one.words(one.read(value)), one.unit, field=path) == one.read(value)
        if path != "hands":  # tables of what a person does there
            words = ", ".join(map(str, value if isinstance(value, list) else [value]))
            assert one.text(value) == words.replace("False", "false")
    assert amounts > 60
    assert made().setting("rig.sensors.pressure.low").unit == "Pa" != made().setting("rig.sensors.tension.low").unit
    assert made().setting("sample_rate").unit == "1/s" and made().setting("muscle").unit == ""
    for path, near in (("sensors.pressur.low", "rig.sensors.pressure.low"), ("sensors", "rig."), ("qqqq", "rig.")):
        with pytest.raises(InputError, match=f"is not a path of the rig: no such parameter; near are {near}"):
            made().setting(f"rig.{path}")


def test_a_range_of_a_setting_keeps_its_bounds_and_has_ends():
    one = made().setting("rig.frame.shortest")
    one.check(*one.quantity.bounds)
    for low, high in ((0.0, 1.0), (1e-3, 101.0), (1e-3, np.inf), (np.nan, 1.0)):
        with pytest.raises(InputError, match="rig.frame.shortest"):
            one.check(low, high)
    for raw, said in (
        ({}, "must be a number with its unit in words"),
        ("", "must be a number"),
        (None, "must be a number"),
    ):
        with pytest.raises(InputError, match=said):
            one.text(raw)
    assert made().setting("rig.name").text(True) == "true" and made().setting("rig.name").text(False) == "false"


def test_draws_have_the_mean_and_covariance_of_their_posterior_and_keep_its_bounds():
    mean, covariance = np.array([1.0, -2.0]), np.array([[0.04, 0.03], [0.03, 0.09]])
    low, high = np.array([-1e9, -1e9]), np.array([1e9, 1e9])
    found = draws(mean, covariance, (low, high), 20_000, seed=1)
    # standard errors of 20,000 draws are 0.7 % of a deviation and 1 % of a variance; four of them
    np.testing.assert_allclose(found.mean(axis=0), mean, atol=4 * 0.3 / np.sqrt(20_000))
    np.testing.assert_allclose(np.cov(found.T), covariance, rtol=0.06)
    cut = draws(mean, covariance, (np.array([0.9, -1e9]), high), 500, seed=1)
    assert len(cut) == 500 and cut[:, 0].min() >= 0.9
    with pytest.raises(InputError, match="bounds"):
        draws(mean, covariance, (np.array([99.0, 99.0]), np.array([100.0, 100.0])), 10)


def test_draws_of_a_seed_depend_on_no_sign_of_an_eigenvector(monkeypatch):
    bounds = (np.full(3, -np.inf), np.full(3, np.inf))
    root = np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.5], [0.2, 0.0, 1.0]])
    found, real = draws(np.zeros(3), root @ root.T, bounds, 5, seed=1), np.linalg.eigh

    def other(matrix):
        values, vectors = real(matrix)
        return values, vectors * np.array([-1.0, 1.0, -1.0])

    monkeypatch.setattr(np.linalg, "eigh", other)
    np.testing.assert_allclose(draws(np.zeros(3), root @ root.T, bounds, 5, seed=1), found, rtol=1e-12)


def test_a_fits_intervals_become_draws_about_its_values(tmp_path):
    parameters = {"passive_stiffness": {"value": 392.0, "low": 372.4, "high": 411.6, "unit": "N/m"}}
    path = tmp_path / "fit.json"
    path.write_text(json.dumps({"fits": [{"law": "linear_threshold", "n": 200, "parameters": parameters}]}))
    found = of_json(path, "", 4000, made().setting, seed=2).columns["muscle.law.passive_stiffness"]
    # 95 % of a normal distribution lie within 1.96 deviations; four standard errors of 4,000 draws are 1.4 %
    assert abs(np.mean(np.abs(found - 392.0) < 19.6) - 0.95) < 0.014
    parameters["passive_stiffness"]["high"] = None
    path.write_text(json.dumps({"fits": [{"law": "linear_threshold", "n": 200, "parameters": parameters}]}))
    with pytest.raises(InputError, match="the data do not fix it"):
        of_json(path, "", 10, made().setting)
    path.write_text("{}")
    with pytest.raises(InputError, match="mckibben fit --json"):
        of_json(path, "", 10, made().setting)


def test_samples_of_a_table_are_rows_of_it_with_their_units(tmp_path):
    path = tmp_path / "samples.csv"
    path.write_text("muscle.law.passive_stiffness [N/cm],muscle.end_mass [g]\n3.5,20\n3.9,25\n4.1,18\n")
    table = of_samples(path, None, made().setting)
    np.testing.assert_allclose(table.columns["muscle.law.passive_stiffness"], [350.0, 390.0, 410.0], rtol=1e-14)
    some = of_samples(path, 2, made().setting, seed=3)
    assert len(some) == 2 and set(some.columns["muscle.end_mass"]) < set(table.columns["muscle.end_mass"])
    path.write_text("muscle.end_mass [g]\n-3\n")
    with pytest.raises(InputError, match="muscle.end_mass"):
        of_samples(path, None, made().setting)


@given(st.integers(0, 10**6))
def test_sizes_of_calls_are_powers_of_two(count):
    assert max(count, 1) <= power(count) < 2 * max(count, 1) and power(count).bit_count() == 1
