"""A muscle cut to another length: one number is enough, and what it cannot do it refuses or says."""

import dataclasses
import functools
import json
import warnings

import numpy as np
import pytest

import mckibben as mk
from mckibben.batch.run_template import RunFactory, make_template
from mckibben.cli.app import main
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.experiments.read import shipped
from mckibben.identification.fit import evaluate, fit
from mckibben.muscles.build import at_rest_length, law_from_specimen
from mckibben.muscles.laws import LAWS
from mckibben.recordings import ForceMap
from mckibben.specimens import Specimen, SpecimenNumber, specimen, specimens

SHARES, PRESSURES = np.array([0.78, 0.85, 0.92, 0.97, 1.0]), np.array([0.3e5, 2e5, 4e5, 5e5])


def without_ends() -> list[tuple[str, str, dict[str, float]]]:
    """Every shipped muscle with every law that goes with the length and has no seat, its inactive ends taken off."""
    return [
        (spec.id, law, {"inactive_share": 0.0} if law == "hyperelastic_braid" else {})
        for spec in specimens()
        if spec.kind == "mckibben"
        for law in spec.laws
        if LAWS[law].any_length and "seated" not in law and (spec.id, law) != ("DMSP-10-250", "linear_threshold")
    ]  # its shortest length of 1 mm is at its bound, and no shorter muscle of it is allowed


@pytest.mark.parametrize(("name", "law", "changes"), without_ends())
@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_a_muscle_without_ends_pulls_alike_at_the_same_contraction_and_holds_gas_in_proportion(
    name, law, changes, ratio
):
    spec = specimen(name)
    rest = spec.property_si("rest_length", "m")
    whole = law_from_specimen(spec, law, changes=changes)
    cut = law_from_specimen(spec, law, changes=changes | {"rest_length": ratio * rest})
    lengths, pressures = (a.ravel() for a in np.meshgrid(SHARES * rest, PRESSURES))
    pull = np.asarray(whole.tension(lengths, pressures))
    assert pull.max() > 0.0
    # rounding of a dozen products, and of the difference of two large forces
    assert np.asarray(cut.tension(ratio * lengths, pressures)) == pytest.approx(pull, rel=1e-9, abs=1e-9 * pull.max())
    stiffness = np.asarray(whole.stiffness(lengths, pressures))
    assert ratio * np.asarray(cut.stiffness(ratio * lengths, pressures)) == pytest.approx(stiffness, rel=1e-8, abs=1e-6)
    if whole.has_volume():
        volume = np.asarray(whole.braid_volume(lengths, pressures))
        assert np.asarray(cut.braid_volume(ratio * lengths, pressures)) / ratio == pytest.approx(volume, rel=1e-9)


def test_ends_stay_so_that_a_short_muscle_is_weaker_at_the_same_contraction():
    rests = (0.083, 0.14, 0.281, 0.56)
    laws = [law_from_specimen(specimen("festo-10mm"), changes={"rest_length": rest}) for rest in rests]
    pulls = [float(law.tension(0.95 * rest, 4e5)) for law, rest in zip(laws, rests, strict=True)]
    assert np.diff(pulls).min() > 0.0
    for law, rest in zip(laws, rests, strict=True):  # the seat is that of the fittings: q sqrt(F), to its five steps
        taken = float(law.take_up(rest, 4e5))
        assert taken == pytest.approx(0.159513e-3 * float(law.tension(rest, 4e5)) ** 0.5, rel=1e-6)


@pytest.mark.parametrize("name", ["DMSP-10-250", "DMSP-20-300"])
def test_coefficients_of_one_length_refuse_another_and_name_what_does_it(name):
    for law in ("martens_boblan", "sarosi", "three_element"):
        with pytest.raises(InputError) as error:
            mk.muscle(name, law=law, rest_length=0.2)
        assert f"the coefficients of {law} are of one length. Use the law hyperelastic_braid of {name}" in str(
            error.value
        )
        assert ("festo-10mm" in str(error.value)) == (name == "DMSP-10-250")  # of that bore, fitted to three lengths
    whole = mk.muscle(name)
    assert mk.muscle(name, rest_length=whole.law.rest_length).law == whole.law  # its own length is none


def test_a_law_shared_by_measured_lengths_takes_any_of_them():
    shared = specimen("DMSP-20-300")
    lengths = SpecimenNumber(value=[0.2, 0.3], unit="m")
    pooled = Specimen(**{**vars(shared), "properties": shared.properties | {"measured_rest_lengths": lengths}})
    law = law_from_specimen(pooled, "sarosi", changes={"rest_length": 0.2})
    own = law_from_specimen(shared, "sarosi")
    assert float(law.tension(0.19, 4e5)) == pytest.approx(float(own.tension(0.285, 4e5)))  # a law of the contraction


def test_friction_creep_and_working_lengths_go_with_the_rest_length():
    spec = specimen("nylon")
    creep = {
        "creep_stiffness": SpecimenNumber(value=[200.0, 400.0], unit="N/m"),
        "creep_time_constants": SpecimenNumber(value=[1.0, 10.0], unit="s"),
    }
    spec = Specimen(**{**vars(spec), "properties": spec.properties | creep})
    half, left = at_rest_length(spec, "linear_threshold", {"rest_length": 0.07, "turns": 3.0})
    assert left == {"turns": 3.0}
    for name in ("upper_length", "stretched_length", "shortest_measured_length"):
        assert half.property_si(name, "m") == pytest.approx(0.5 * spec.property_si(name, "m"))
    assert half.property_si("diameter_shortened", "m") == spec.property_si("diameter_shortened", "m")
    whole, cut = mk.muscle(spec), mk.muscle(spec, rest_length="7 cm")
    # elements of equal force over half the travel; springs of half the length
    assert np.asarray(cut.friction.stiffness) == pytest.approx(2.0 * np.asarray(whole.friction.stiffness))
    assert float(cut.friction.largest_force(3e5)) == float(whole.friction.largest_force(3e5))
    assert np.asarray(cut.creep.stiffness) == pytest.approx([400.0, 800.0])
    springs = {
        "stiffness": SpecimenNumber(value=[1.0, 2.0], unit="N/mm"),
        "constant": SpecimenNumber(value=2.0, unit="N"),
    }
    measured = Specimen(**{**vars(spec), "friction": {"maxwell_slip": springs}})
    of_half, _ = at_rest_length(measured, "linear_threshold", {"rest_length": 0.07})
    assert of_half.friction["maxwell_slip"]["stiffness"].value == [2.0, 4.0]
    assert of_half.friction["maxwell_slip"]["constant"].value == 2.0
    assert np.asarray(cut.creep.time_constant) == pytest.approx([1.0, 10.0])


def test_a_stated_parameter_stands_and_a_law_without_a_rest_length_takes_one(tmp_path):
    own = mk.muscle("nylon", rest_length=0.07, shortest_length=0.06)
    assert float(own.law.shortest_length) == 0.06 and float(own.law.upper_length) == pytest.approx(0.077)
    ideal = mk.muscle("nylon", law="ideal", rest_length="7 cm")
    assert float(ideal.law.thread_length) == pytest.approx(0.0821) and ideal.rest_length == 0.07
    path = own.save(tmp_path / "short.toml")
    assert mk.muscle(str(path)).rest_length == 0.07
    assert mk.muscle(str(path)).law == own.law
    at_rest = mk.muscle("festo-10mm", rest_length=0.15)
    assert not at_rest.law.overstretched(0.15)  # to the last bit


def test_half_a_muscle_does_half_the_work():
    whole = mk.energy("nylon", cycles="maximal")["maximal"]
    with pytest.warns(PlausibilityWarning, match="a rest length of 7 cm is beyond the measured ones of nylon"):
        halves = (
            mk.energy("nylon", parameters={"rest_length": 0.07}, cycles="maximal"),
            mk.energy(mk.muscle("nylon", rest_length=0.07), cycles="maximal"),
        )
    for half in halves:
        assert half["maximal"].output == pytest.approx(0.5 * whole.output, rel=1e-9)  # rounding
        assert half["maximal"].efficiency == pytest.approx(whole.efficiency, rel=1e-9)
    with pytest.warns(PlausibilityWarning, match="with its own stiffness_per_pressure"):
        weaker = mk.energy(mk.muscle("nylon", stiffness_per_pressure=0.5 * 0.466e-2), cycles="maximal")["maximal"]
    assert weaker.output < 0.6 * whole.output  # what was changed of a muscle counts


def test_runs_and_sweeps_cut_the_muscle_too():
    one = mk.prepare("isometric-step", muscle="festo-10mm", rig="modern", changes={"muscle.law.rest_length": "15 cm"})
    template = make_template(
        shipped("isometric-step"), "festo-10mm", "modern", given={"muscle.law.rest_length": "15 cm"}
    )
    for bench in (one, RunFactory(template).bench({})):
        assert bench.plan.rest_length == 0.15 == float(bench.unit.law.upper_length)
    with pytest.raises(InputError, match="Use the law hyperelastic_braid"):
        mk.prepare("isometric-step", muscle="DMSP-20-300", rig="modern", changes={"muscle.law.rest_length": "15 cm"})


def test_a_rest_length_beyond_the_measured_ones_is_said_with_the_error_that_was_found_there():
    for rest, said in ((0.14, False), (0.281, False), (0.06, True), (0.5, True)):
        sentences = [str(one) for one in mk.muscle("festo-10mm", rest_length=rest).cautions]
        assert any("is beyond the measured ones of festo-10mm, 8.3 cm to 28.1 cm" in s for s in sentences) == said
        assert not said or any(
            "more than at these, as it was off by 14 % at 13.2 cm (three rest lengths" in s for s in sentences
        )
    short = mk.muscle("DMSP-20-300", law="hyperelastic_braid", rest_length="10 cm")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        short.tension("9.5 cm", "4 bar")
    assert any("more than at these, as it was off by 61 % at 9.8 cm" in str(one.message) for one in said)
    assert not any(
        "rest length" in str(one) for one in mk.muscle("SM20", rest_length=0.05).cautions
    )  # sold by the metre


def test_the_command_takes_one_number(capsys):
    words = ["festo-10mm", "--set", "rest_length=15 cm", "--length", "14 cm", "--pressure", "4 bar", "--json"]
    with pytest.raises(SystemExit) as end:
        main(["tension", *words])
    answer = json.loads(capsys.readouterr().out)
    assert end.value.code == 0 and not answer["slack"] and not answer["overstretched"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert answer["tension"] == mk.muscle("festo-10mm", rest_length=0.15).tension(0.14, 4e5)
    assert answer["free_length"] < 0.14 and answer["volume"] > 0.0


@functools.cache
def fitted_nylon():
    """Points on the nylon muscle's law, and a fit to them."""
    nylon = law_from_specimen(specimen("nylon"))
    length, pressure = (a.ravel() for a in np.meshgrid(np.linspace(0.115, 0.15, 6), np.linspace(2e5, 5e5, 4)))
    points = ForceMap(
        "own", length, pressure, np.asarray(nylon.tension(length, pressure)), rest_length=np.full(24, 0.14)
    )
    known = {"upper_length": 0.154, "threshold_width": 0.85e5, "stop_stiffness": 3e7}
    return points, fit("linear_threshold", points, known=known, schemes=())


def test_a_law_fitted_to_one_length_is_cut_with_it():
    points, found = fitted_nylon()
    length, pressure = points.length, points.pressure
    half = found.build(rest_length=0.07)
    expected = np.asarray(found.build().tension(length, pressure))
    assert np.asarray(half.tension(0.5 * length, pressure)) == pytest.approx(expected, rel=1e-9)
    assert float(found.predict(0.06, 3e5, rest_length=0.07).tension) == pytest.approx(float(half.tension(0.06, 3e5)))
    with pytest.raises(InputError, match="coefficients of sarosi are of one length"):
        fit("sarosi", points, known={"upper_length": 0.154}, schemes=()).build(rest_length=0.07)


def test_of_measured_lengths_another_is_used_as_far_in_proportion_and_only_what_is_one_number_is_told_as_one():
    _, found = fitted_nylon()
    lengths = {"rest_length": np.array([0.13, 0.15]), "upper_length": np.array([0.143, 0.172])}
    several = dataclasses.replace(found, known=found.known | lengths)
    assert float(several.build(rest_length=0.14).upper_length) == pytest.approx(0.14 * 0.172 / 0.15)
    assert float(several.build().upper_length) == 0.172
    assert float(several.build(rest_length=0.14, shortest_length=0.09).shortest_length) == 0.09
    told = several.to_dict()["known"]
    assert told["rest_length"] is told["upper_length"] is None and told["threshold_width"] == 0.85e5
    alike = dataclasses.replace(found, known=found.known | {"rest_length": np.full(3, 0.14)})
    assert alike.to_dict()["known"]["rest_length"] == 0.14


def test_the_error_of_a_law_is_what_it_says_less_what_was_measured_where_the_muscle_was_taut():
    points, _ = fitted_nylon()
    nylon = law_from_specimen(specimen("nylon"))
    slack = points.tension <= 0.0
    assert np.array_equal(evaluate(nylon, points), np.zeros(np.count_nonzero(~slack)))
    stronger = ForceMap("own", points.length, points.pressure, points.tension + np.where(slack, 0.0, 1.5))
    assert evaluate(nylon, stronger) == pytest.approx(np.full(np.count_nonzero(~slack), -1.5))
