"""Plants drawn for lanes: within what was stated, together where they belong together, equal for equal seeds."""

import numpy as np
import pytest

import mckibben as mk
from mckibben.batch.randomise import randomise
from mckibben.errors import InputError
from mckibben.identification.fit import fit
from mckibben.muscles import law_from_specimen

MASS, VALVE = "load.mass", "circuit.elements.muscle.valve.set_pressure"


@pytest.fixture(scope="module")
def sim():
    return mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="regulator"), period=5e-3)


@pytest.mark.parametrize(
    ("spread", "low", "high"),
    [("25 %", 1.5, 2.5), ("+-100 g", 1.9, 2.1), (("1 kg", "1500 g"), 1.0, 1.5), ((2.0, 4.0), 2.0, 4.0)],
)
def test_numbers_lie_in_what_was_stated_and_fill_it(sim, spread, low, high):
    drawn = randomise(sim, 400, {MASS: spread})[MASS]
    assert low <= drawn.min() and drawn.max() <= high
    # the ends of 400 even draws are within 2 % of the range with probability 1 - 2 exp(-8)
    assert drawn.min() < low + 0.02 * (high - low) and drawn.max() > high - 0.02 * (high - low)


def test_a_pattern_draws_each_number_by_itself_and_a_seed_draws_them_again():
    joint = mk.Simulation(mk.Joint("nylon", arm="2 cm", inertia=2e-3), mk.Air(supply="6 bar"), period=5e-3)
    drawn = randomise(joint, 5, {"units.*.law.rest_length": "2 %"}, seed=1)
    assert sorted(drawn) == ["units.extensor.law.rest_length", "units.flexor.law.rest_length"]
    assert not np.any(drawn["units.extensor.law.rest_length"] == drawn["units.flexor.law.rest_length"])
    again, other = (randomise(joint, 5, {"units.*.law.rest_length": "2 %"}, seed=s) for s in (1, 2))
    assert all(np.array_equal(again[p], v) and not np.array_equal(other[p], v) for p, v in drawn.items())


def test_numbers_that_stand_together_are_scaled_together(sim):
    path = "units.muscle.friction.limit.constant"
    drawn, whole = randomise(sim, 6, {path: "30 %"})[path], np.asarray(sim.units["muscle"].friction.limit.constant)
    shares = drawn / whole[:, None]
    assert drawn.shape == (len(whole), 6) and np.ptp(shares[0]) > 0.1
    np.testing.assert_allclose(shares, np.tile(shares[0], (len(whole), 1)), rtol=1e-15)  # of one product
    batch = sim.batch(6, {path: drawn})
    batch.reset()
    assert len({*[batch.step(muscle=2e5) for _ in range(20)][-1].position}) == 6


def test_draws_of_a_law_keep_their_rows_together_and_are_those_of_each_muscle(sim):
    rows = {"rest_length": np.array([0.139, 0.140, 0.141]), "rest_volume": np.array([5e-6, 6e-6, 7e-6])}
    drawn = randomise(sim, 50, muscles=rows)
    places = [np.searchsorted(rows[n], drawn[f"units.muscle.law.{n}"]) for n in rows]
    assert np.array_equal(*places) and set(places[0]) == {0, 1, 2}


@pytest.mark.parametrize(
    ("muscles", "said"),
    [
        ({}, "draws of each parameter .* got none"),
        ({"rest_length": []}, r"as many of each, got rest_length: \(0,\)"),
        ({"rest_length": [0.14], "rest_volume": [5e-6, 6e-6]}, "as many of each"),
        ({"rest_length": np.full((2, 2), 0.14)}, "as many of each"),
        ({"rest_length": ["long", "short"]}, "rest_length must be a length"),
        ({"rest_length": [0.14, np.nan, 0.14, 0.14, 0.14, 0.14]}, "rest_length must be between"),
    ],
)
def test_draws_of_a_law_that_are_none_are_refused(sim, muscles, said):
    with pytest.raises(InputError, match=said):
        randomise(sim, 1, muscles=muscles)


def test_draws_take_words_with_a_unit_and_a_tolerance_has_no_sign(sim):
    drawn = randomise(sim, 3, {MASS: "-5 %"}, muscles={"rest_length": ["140 mm", "14 cm"]})
    assert np.allclose(drawn["units.muscle.law.rest_length"], 0.14) and abs(drawn[MASS] / 2.0 - 1.0).max() <= 0.05
    for seed in (-1, "a", 1.5):
        with pytest.raises(InputError, match="seed must be a whole number from 0"):
            randomise(sim, 3, seed=seed)


def test_a_fit_is_drawn_with_its_correlations():
    law = law_from_specimen(mk.specimen("nylon"), "thick_wall")
    length, pressure = (x.ravel() for x in np.meshgrid(np.linspace(0.11, 0.14, 7), np.linspace(1e5, 5e5, 5)))
    noise = 0.5 * np.random.default_rng(0).standard_normal(length.size)
    points = mk.ForceMap("map", length, pressure, np.asarray(law.tension(length, pressure)) + noise)
    found = fit("thick_wall", points, schemes=())
    joined = mk.Simulation(mk.Weight(found.muscle, mass="2 kg"), mk.Air(valve="regulator"), period=5e-3)
    drawn = randomise(joined, 800, muscles=found)
    names = list(found.parameters)
    samples = np.array([drawn[f"units.muscle.law.{n}"] for n in names])
    # 800 draws tell a correlation to 1/sqrt(800), 4 of these
    np.testing.assert_allclose(np.corrcoef(samples), found.correlation, atol=4.0 / np.sqrt(800))


@pytest.mark.parametrize(
    ("vary", "word"),
    [
        ({"load.masss": "5 %"}, "load.mass"),
        ({MASS: "5 bar"}, "a range of two ends"),
        ({MASS: ("3 kg", "1 kg")}, "rises"),
        ({MASS: ("-1 kg", "1 kg")}, "load.mass must be between"),
        ({MASS: np.ones(3)}, "each of 4 plants"),
        ({"load.stiffness": "5 %"}, "nothing of 0"),
        ({"units.muscle.friction.limit.constant": "+-1 N"}, "holds 8 numbers, which a share"),
    ],
)
def test_what_is_no_spread_is_refused(sim, vary, word):
    with pytest.raises(InputError, match=word):
        randomise(sim, 4, vary)
