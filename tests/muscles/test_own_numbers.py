"""What a specimen states of errors and intervals is of its numbers: a muscle with others says so, and has no interval."""

import dataclasses
import json

import numpy as np
import pytest

import mckibben as mk
from mckibben.assembly.build import with_parameters
from mckibben.batch.sweep import read_sweep
from mckibben.bench.prepare import prepare
from mckibben.bench.recorder import initial_metadata
from mckibben.cli.app import main
from mckibben.errors import InputError, MckibbenError, PlausibilityWarning
from mckibben.muscles.build import law_from_specimen
from mckibben.muscles.evidence import (
    error_of,
    interval_words,
    law_cautions,
    law_error,
    make_spread,
    own_numbers,
    tension_interval,
)
from mckibben.quantities import declared
from mckibben.specimens import specimen, specimens
from mckibben.studies.sweep_run import SweepResults

LAWS = [(spec.id, law) for spec in specimens() if spec.kind == "mckibben" for law in spec.laws]
# Of no law do these enter the tension within its range: volumes, and what holds only beyond it.
BESIDE = {"rest_volume", "thread_strain"}
NUMBER = {"festo-10mm": "seat_compliance", "DMSP-20-300": "wall_thickness", "nylon": "passive_stiffness"}


@pytest.mark.parametrize(("name", "law"), LAWS)
def test_a_law_with_the_numbers_of_its_specimen_has_none_of_its_own_and_with_another_that_one(name, law):
    spec = specimen(name)
    whole = law_from_specimen(spec, law)
    assert own_numbers(spec, whole) == ()
    for key, quantity in declared(whole).items():
        value = getattr(whole, key)
        if value is None or key == "rest_length":
            continue
        low, high = quantity.bounds
        tried = (1.03 * float(value), 0.97 * float(value), quantity.typical[1], 0.5 * (low + high))
        moved = next(one for one in tried if low <= one <= high and one != value)
        try:
            other = whole.replace(**{key: moved})
        except MckibbenError:
            continue  # no such muscle
        at = np.linspace(*map(float, other.length_range()), 9)[1:-1, None], np.array([0.0, 1e5, 5e5])
        pulls = [np.asarray(one.tension(*np.broadcast_arrays(*at))) for one in (whole, other)]
        # half a percent of the largest: what is less is not told from a number that does not enter
        if key in BESIDE:
            assert own_numbers(spec, other) == (), key
        elif np.abs(pulls[0] - pulls[1]).max() > 5e-3 * pulls[0].max():
            assert own_numbers(spec, other) == (key,)
            assert make_spread(spec, other) is tension_interval(spec, other, at[0][3], 3e5) is None
            assert key in interval_words(spec, other) and interval_words(spec, other).startswith("no interval")
            said = [one for one in law_cautions(spec, other) if key in one.text]
            assert len(said) == 1 and error_of(spec, other).own == (key,)


@pytest.mark.parametrize("name", ["festo-10mm", "DMSP-40-400", "SM20", "nylon"])
def test_a_muscle_that_was_only_cut_has_no_numbers_of_its_own(name):
    """By its specimen, and beside the file of the whole one, as a size has it."""
    rest = 0.6 * mk.muscle(name).rest_length
    cut = mk.muscle(name, rest_length=rest)
    assert own_numbers(cut.specimen, cut.law) == own_numbers(specimen(name), cut.law) == ()
    law = dataclasses.replace(cut.law, **{n: 1.1 * float(getattr(cut.law, n)) for n in ("thread_strain",)})
    assert own_numbers(cut.specimen, law) == ()


@pytest.mark.parametrize(("name", "key"), NUMBER.items())
def test_a_number_is_ones_own_in_every_face(name, key, capsys, tmp_path):
    value = 1.3 * float(getattr(mk.muscle(name).law, key))
    unit = declared(mk.muscle(name).law)[key].unit
    muscle = mk.muscle(name, **{key: value})
    words = f"its own {key} in place of that of {muscle.specimen.id}"
    with pytest.warns(PlausibilityWarning, match=words):
        muscle.tension(0.95 * muscle.rest_length, 3e5)
    assert f"not with its own {key}" in str(muscle.error)
    expected = law_error(muscle.specimen, muscle.law)
    assert words in expected["interval"] and expected["own"] == [key] and "between_muscles" not in expected
    # the command line and JSON
    command = ["tension", name, "--set", f"{key}={value!r} {unit}", "--contraction", "5 %", "--pressure", "3 bar"]
    with pytest.raises(SystemExit):
        main(command)
    said = capsys.readouterr()
    assert words in said.err and words in " ".join(said.out.split()) and "(95 %)" not in said.out
    with pytest.raises(SystemExit):
        main([*command, "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert answer["law_error"]["interval"] == expected["interval"] and any(words in one for one in answer["warnings"])
    assert "between_muscles" not in answer["law_error"]
    # a run on a rig, whoever changed the number
    spec, unit_of = with_parameters(*_bench(name), {f"law.{key}": value})
    about = initial_metadata(prepare("isometric-step", muscle=spec, unit=unit_of, rig="modern"))
    assert about["law_error"]["interval"] == expected["interval"] and any(words in one for one in about["warnings"])
    # a system that is stepped
    with pytest.warns(PlausibilityWarning, match=words):
        simulation = mk.Simulation(mk.Weight(muscle, mass=2.0), mk.Air(supply=5e5))
        simulation.reset(pressure=1e5)
        simulation.step()
    meta = simulation.recording().meta
    assert meta["law_error"]["muscle"]["interval"] == expected["interval"]
    assert any(words in one for one in meta["warnings"])
    # and its file, which states no more what was found of other numbers
    again = mk.muscle(muscle.save(tmp_path / "mine.toml"))
    assert again.error is None and make_spread(again.specimen, again.law) is None
    assert "nothing says how far" in interval_words(again.specimen, again.law)


def _bench(name):
    bench = prepare("isometric-step", muscle=name, rig="modern")
    return bench.specimen, bench.unit


def test_readings_are_of_muscles_with_the_numbers_of_their_make():
    said = r"seated_braid.seat_compliance must be that of festo-10mm.* got 0.0002"
    with pytest.raises(InputError, match=said):
        mk.muscle("festo-10mm", seat_compliance=2e-4).calibrate("281 mm, 5.5 bar, 500 N")


def test_a_sweep_says_it_of_the_numbers_that_its_variants_have(tmp_path):
    """Of a number that is swept; and of rest lengths as at the end where least is known."""
    path = tmp_path / "sweep.toml"

    def errors(parameter, words):
        lines = [
            "schema = 1", 'protocol = "isometric-step"', 'muscle = "DMSP-40-400"', 'rig = "modern"', "[grid]",
            f'"muscle.law.{parameter}" = {words}',
        ]  # fmt: skip
        path.write_text("\n".join(lines))
        return SweepResults(read_sweep(path), None)._law_errors()["DMSP-40-400"]

    assert errors("shear_modulus", '["0.46 MPa", "0.5 MPa"]')["own"] == ["shear_modulus"]
    cut = mk.muscle("DMSP-40-400", rest_length=0.15)
    assert errors("rest_length", '["15 cm", "40 cm"]') == law_error(cut.specimen, cut.law)
