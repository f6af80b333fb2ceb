"""A muscle as one object: questions with units, warnings of slips, and what it is made of."""

import dataclasses
import pickle
import warnings
from pathlib import Path

import jax
import numpy as np
import pytest

import mckibben as mk
from mckibben.assembly.build import unit_from_muscle, unit_from_specimen
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.identification.fit import measured_range
from mckibben.muscles.elements import MaxwellChain
from mckibben.muscles.hysteresis import BoucWen, Coulomb, Dahl, FrictionLimit, MaxwellSlip, PrandtlIshlinskii
from mckibben.muscles.plausible import usual_pressure
from mckibben.specimens import specimen


@pytest.fixture(scope="module")
def muscle():
    return mk.muscle("nylon")


def test_a_muscle_answers_as_its_law_does(muscle):
    law = mk.law("linear_threshold", {row.name.removeprefix("law."): row.value for row in law_rows(muscle)})
    # the same function compiled twice may round differently in the last bits
    assert muscle.tension(0.12, 5e5) == pytest.approx(float(law.tension(0.12, 5e5)), rel=1e-12)
    assert muscle.volume(0.12, 5e5) == pytest.approx(float(law.volume(0.12, 5e5)), rel=1e-12)


def law_rows(muscle):
    return [row for row in muscle.parameters() if row.name.startswith("law.")]


def test_text_with_units_and_si_numbers_ask_the_same(muscle):
    assert muscle.tension("12 cm", "5 bar") == muscle.tension(0.12, 5e5)
    assert muscle.pressure_for("30 N", "12 cm") == muscle.pressure_for(30.0, 0.12)
    assert muscle.stiffness("120 mm", "500 kPa") == muscle.stiffness(0.12, 5e5)


def test_the_pressure_for_a_tension_gives_that_tension(muscle):
    # the root is bracketed to 1e-6 Pa, which moves the tension by less than 1e-9 N
    assert muscle.tension(0.12, muscle.pressure_for(30.0, 0.12)) == pytest.approx(30.0, abs=1e-8)


@pytest.mark.parametrize("several", ["tension", "length", "highest"])
def test_the_pressure_for_a_tension_is_of_one_state_and_several_of_anything_are_refused(muscle, several):
    asked = {"tension": 50.0, "length": 0.12, "highest": 10e5}
    for value in ([asked[several]], np.full(3, asked[several])):
        with pytest.raises(InputError, match=f"{several} must be one number, got {len(value)} of them"):
            muscle.pressure_for(**asked | {several: value})


def test_what_goes_in_decides_what_comes_out(muscle):
    assert type(muscle.tension(0.12, 5e5)) is float
    lengths = np.array([0.11, 0.12])
    assert type(muscle.tension(lengths, 5e5)) is np.ndarray and muscle.tension(lengths, 5e5).shape == (2,)
    assert isinstance(muscle.tension(jax.numpy.asarray(0.12), 5e5), jax.Array)
    # the derivative by JAX is the stiffness, which is that derivative; to rounding
    assert jax.grad(lambda x: muscle.tension(x, 5e5))(0.12) == pytest.approx(muscle.stiffness(0.12, 5e5), rel=1e-12)


@pytest.mark.parametrize(
    ("length", "pressure", "meant"),
    [(0.12, 5.0, "5 bar"), (120.0, 5e5, "120 mm"), ("12 m", "5 bar", "12 cm"), (0.12, "5 Pa", "5 bar")],
)
def test_a_slip_of_the_unit_is_named_once_with_the_likely_unit(muscle, length, pressure, meant):
    with pytest.warns(PlausibilityWarning, match=f"was {meant} meant") as caught:
        muscle.tension(length, pressure)
    assert len(caught) == 1 and caught[0].filename == __file__


def test_no_usual_value_warns(muscle):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        muscle.tension(np.linspace(0.105, 0.15, 3), 0.0)
        muscle.tension("14 cm", "5 bar")  # the measured ones end there


def test_a_fitted_muscle_warns_where_its_law_answers_beyond_the_measured_points():
    points = mk.ForceMap("map", np.array([0.11, 0.14]), np.array([2e5, 4e5]), np.array([8.0, 70.0]))
    nylon = mk.specimen("nylon")
    fitted = mk.muscle(dataclasses.replace(nylon, id="mine", properties=nylon.properties | measured_range(points)))
    assert fitted.tension("12 cm", "4 bar") == mk.muscle("nylon").tension("12 cm", "4 bar")  # warnings are errors
    with pytest.warns(
        PlausibilityWarning, match="a pressure of 5 bar is beyond the measured ones of mine, up to 4 bar"
    ):
        fitted.tension("12 cm", "5 bar")
    for length in (0.105, 0.15):
        with pytest.warns(PlausibilityWarning, match=f"a length of {100 * length:g} cm .* of mine, 11 cm to 14 cm"):
            fitted.tension(np.array([0.12, length]), 3e5)
    assert usual_pressure(fitted.specimen) == 4e5  # less than the usual 5 bar: nothing was measured there


@pytest.mark.parametrize("what", ["rated_pressure", "burst_pressure"])
def test_the_usual_pressure_of_a_muscle_is_none_that_it_does_not_bear(what):
    """Even where somebody measured beyond."""
    spec = mk.muscle("nylon").specimen
    numbers = {what: (3e5, "Pa"), "highest_measured_pressure": (4.5e5, "Pa")}
    rest = dataclasses.replace(spec.properties["rest_length"], range=None)
    stated = {name: dataclasses.replace(rest, value=v, unit=unit) for name, (v, unit) in numbers.items()}
    bare = {name: p for name, p in spec.properties.items() if name not in ("rated_pressure", "burst_pressure")}
    assert usual_pressure(dataclasses.replace(spec, properties={**bare, **stated})) == 3e5
    assert usual_pressure(dataclasses.replace(spec, properties=bare)) <= 5e5


def test_a_text_without_a_unit_is_refused(muscle):
    with pytest.raises(InputError, match="length must be a length such as '12 cm'.*the unit is missing"):
        muscle.tension("0.12", 5e5)


def test_a_muscle_of_a_specimen_is_the_one_that_is_simulated():
    for name in ("nylon", "bridgestone", "DMSP-10-250"):
        assert unit_from_muscle(mk.muscle(name)) == unit_from_specimen(name)


def test_friction_without_memory_is_simulated_with_its_limit_unless_it_is_named(muscle):
    assert isinstance(muscle.friction, MaxwellSlip)
    assert isinstance(mk.muscle("nylon", friction="coulomb").friction, Coulomb)
    own = Coulomb(limit=FrictionLimit(constant=1.0, per_pressure=0.0))
    assert mk.muscle("nylon", friction=own).friction is own
    with pytest.raises(InputError, match="must be a friction"):
        mk.muscle("ideal", thread_length=0.16, turns=3.2, friction="coulomb")


def test_parameters_replace_those_of_the_specimen_with_units(muscle):
    stiffer = mk.muscle("nylon", passive_stiffness="5 N/cm")
    assert float(stiffer.law.passive_stiffness) == 500.0
    with pytest.raises(InputError, match="stifness"):
        mk.muscle("nylon", stifness=1.0)


def test_a_law_alone_is_a_muscle_and_one_line():
    muscle = mk.muscle("ideal", thread_length="16 cm", turns=3.2)
    assert muscle == mk.Muscle(mk.law("ideal", {"thread_length": 0.16, "turns": 3.2}))
    assert repr(muscle) == "Muscle(own, ideal)" and "\n" not in repr(mk.muscle("nylon"))


@pytest.mark.parametrize("name", ["nylon", Path("nylon.toml"), specimen("nylon")])
def test_what_names_a_muscle_is_no_law(name):
    with pytest.raises(InputError, match=r"^law must be a tension law, got '?nylon.*; mckibben\.muscle\(\.\.\) makes"):
        mk.Muscle(name)


@pytest.mark.parametrize("activation", [50, -0.1, [0.0, 1.2], "120 %"])
def test_an_activation_beyond_its_range_is_refused(activation):
    with pytest.raises(InputError, match="activation must be between 0 and 1, got"):
        mk.muscle("slow-fibre").tension("10 cm", activation)


def test_a_biological_muscle_that_is_overstretched_has_no_threads():
    with pytest.warns(UserWarning, match="overstretched: .* there its filaments do not overlap"):
        mk.muscle("slow-fibre").tension("30 cm", 1.0)


def test_a_biological_muscle_is_driven_by_its_activation():
    fibre = mk.muscle("fast-fibre")
    assert fibre.tension("14 cm", 0.5) == pytest.approx(0.5 * fibre.tension("14 cm", 1.0))
    with pytest.raises(InputError, match="it is biological"):
        unit_from_muscle(fibre)


def test_every_parameter_has_its_source(muscle):
    rows = {row.name: row for row in muscle.parameters()}
    assert rows["law.rest_length"].source == "chou1996" and rows["law.rest_volume"].source == "inferred"
    assert {"friction.limit.constant", "law.rest_length"} <= muscle.to_dict()["parameters"].keys()


def test_a_muscle_survives_pickling_and_passes_through_jax(muscle):
    assert pickle.loads(pickle.dumps(muscle)) == muscle
    assert float(jax.jit(lambda m: m.tension(0.12, 5e5))(muscle)) == pytest.approx(muscle.tension(0.12, 5e5), rel=1e-12)


def test_a_braid_that_nothing_was_measured_of_is_a_muscle_that_can_be_saved(tmp_path):
    braid = mk.muscle.from_braid(
        rest_length="300 mm",
        diameter="12 mm",
        braid_angle="25 deg",
        thread_diameter="0.25 mm",
        bladder_thickness="1 mm",
    )
    assert mk.muscle(braid.save(tmp_path / "braid.toml")).law == braid.law
    with pytest.raises(InputError, match="incomplete without diameter, braid_angle"):
        mk.muscle.from_braid(rest_length="300 mm")


def test_of_many_lengths_the_longest_is_judged(muscle):
    for lengths in ([0.12, 1.0], [1.0, 0.12], [0.11, 0.12, 1.0]):
        with pytest.warns(PlausibilityWarning, match="a length of 100 cm is far from those of this muscle"):
            muscle.tension(np.array(lengths), 3e5)


def test_a_muscle_has_the_title_of_its_specimen_or_of_its_law(muscle):
    assert muscle.title == muscle.specimen.title != muscle.law.title
    alone = mk.muscle("ideal", thread_length=0.16, turns=3.2)
    assert alone.specimen is None and alone.title == alone.law.title


def test_a_muscle_is_read_again_as_it_was_saved_with_all_of_its_parts(tmp_path):
    limit = FrictionLimit(constant=3.0, per_pressure=1e-5)
    frictions = [
        None,
        MaxwellSlip.geometric(limit, elements=3),
        MaxwellSlip(limit=limit.scaled(np.array([0.2, 0.8])), stiffness=np.array([1e3, 5e3])),
        Dahl(limit=limit, stiffness=2e3),
        BoucWen(limit=limit, stiffness=2e3, exponent=2),
        PrandtlIshlinskii(weight=np.array([2e3, 1e3]), threshold=np.array([1e-4, 1e-3])),
    ]
    chain = MaxwellChain(stiffness=np.array([100.0, 50.0]), time_constant=np.array([1.0, 10.0]))
    muscle = mk.muscle("nylon")
    for friction in frictions:
        for creep in (None, chain):
            own = muscle.with_fields(friction=friction, creep=creep)
            again = mk.muscle(own.save(tmp_path / "own.toml"))
            assert again == own.with_fields(specimen=again.specimen)  # bit for bit
    # what a file cannot say is refused: a muscle with another friction, or another law, is not what was saved
    for part in ({"friction": Coulomb(limit=limit)}, {"law": mk.law("ideal", {"thread_length": 0.2, "turns": 3.2})}):
        with pytest.raises(InputError, match="cannot be saved: read again"):
            muscle.with_fields(**part).with_fields(specimen=mk.specimen("bridgestone")).save(tmp_path / "other.toml")
    assert mk.muscle(tmp_path / "own.toml") == again
