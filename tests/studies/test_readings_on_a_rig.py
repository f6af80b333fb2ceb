"""One muscle of a make read on a rig, and what holds a muscle measured by a rod: of simulated rigs whose truth is known."""

import json

import numpy as np
import pytest

import mckibben as mk
from mckibben.cli import main
from mckibben.errors import InputError, PlausibilityWarning, StageError
from mckibben.muscles.elements import Tendon
from mckibben.studies.characterisation import characterise_like, measure_cord
from mckibben.studies.characterisation.readings import cord_of
from mckibben.studies.characterisation.stages import Bounds
from mckibben.studies.characterisation.verb import make_settings, place_of, recording_folder, settings_of

REST = "140 mm"


def test_two_readings_on_a_rig_find_a_muscle_that_differs_from_its_make():
    like = mk.muscle("festo-10mm", rest_length=REST)
    stiffer = like.law.replace(shear_modulus=1.1 * like.law.shear_modulus)
    with pytest.warns(PlausibilityWarning, match="all parameters of the law together"):
        found = characterise_like("festo-10mm", muscle=like.with_fields(law=stiffer), same_rig=True)
    assert [one.length for one in found.readings] == pytest.approx(
        [0.14, 0.96 * 0.14], abs=5e-4
    )  # of the muscle itself
    assert found.after < 0.7 * found.before
    assert found.seconds < 120.0  # the two minutes that it is for
    length, pressure = (a.ravel() for a in np.meshgrid(np.linspace(0.126, 0.14, 5), np.linspace(2e5, 6e5, 4)))
    true = np.asarray(stiffer.tension(length, pressure))
    mean, half = found.new.predict(length, pressure)
    assert (np.abs(true - mean) <= half).all()
    off = [np.abs(np.asarray(one.law.tension(length, pressure)) - true).mean() for one in (like, found.muscle)]
    assert off[1] < 0.5 * off[0]  # of the file of the make, and of this muscle
    assert found.to_dict()["half_width"]["after"] == found.after and len(found.tables()[0].rows) == 2
    assert found.muscle.specimen.between["calibrated"].value == pytest.approx(found.after, rel=0.05)  # two digits


def test_a_make_that_states_no_differences_is_refused():
    with pytest.raises(InputError, match="does not state how far muscles of its make differ"):
        characterise_like("nylon", muscle="nylon")


@pytest.mark.parametrize("stiffness", [6e4, 2e5])
def test_a_rod_in_the_muscles_place_shows_cord_and_frame(stiffness):
    found = measure_cord("modern", tendon=Tendon(stiffness=stiffness, toe_length=1e-3))
    series = 1.0 / (1.0 / stiffness + 1.0 / float(mk.rig("modern").frame.stiffness))
    assert found.stiffness.low <= series <= found.stiffness.high
    # the rod stretches by 17 um at 300 N, a cord of the softer kind by 5 mm
    assert found.stiffness.value == pytest.approx(series, rel=0.01)


def test_what_gives_otherwise_than_a_cord_is_refused():
    time = np.arange(0.0, 8.0, 0.01)
    span = 0.14 + 1e-4 * np.maximum(time - 2.0, 0.0)
    force = np.where(time < 5.0, 1e5 * (span - 0.14), 8.0)  # it slips
    parts = ("zero", 0.0, 2.0), ("pull", 2.0, 8.0)
    steps = [
        {"label": name, "start": start, "end": end, "recorded": True, "case": {}, "path": f"steps.{i}", "index": i}
        for i, (name, start, end) in enumerate(parts, 1)
    ]
    channels = {
        "span": mk.Channel(span, "m", "measured", "span"),
        "tension": mk.Channel(force, "N", "measured", "tension"),
    }
    with pytest.raises(StageError, match="no cord"):
        cord_of(mk.Recording(time, channels, {"steps": steps}))


def test_readings_are_planned_for_the_highest_pressure_that_is_stated(capsys):
    asked = "characterise --like festo-10mm --muscle festo-10mm --same-rig --max-pressure 3bar --dry-run --json"
    with pytest.raises(SystemExit) as stop:
        main(asked.split())
    content = json.loads(capsys.readouterr().out)
    assert not stop.value.code and [*content["stages"]] == ["seat", "readings"]
    law = mk.muscle("festo-10mm").law
    for place in content["readings"]:  # what is expected is expected there, not at the usual pressure of readings
        assert place["pressure"] == 3e5 and place["tension"] == pytest.approx(float(law.tension(place["length"], 3e5)))


def test_a_make_that_pulls_more_than_the_rig_bears_is_read_at_a_lower_pressure():
    with pytest.raises(
        InputError, match="max_pressure must be one at which it pulls 100 N at most: such a muscle pulls"
    ):
        characterise_like("festo-10mm", muscle="festo-10mm", max_tension="100 N")


def test_a_folder_with_readings_of_a_make_is_no_other_questions(tmp_path):
    rig, spec = mk.rig("modern"), mk.specimen("festo-10mm")
    whole = settings_of(rig, "direct", Bounds.of(rig, "direct", rest_length=0.14), 0, spec)
    recording_folder(tmp_path, whole | make_settings(spec, same_rig=True))
    place_of(tmp_path, "readings").touch()
    recording_folder(tmp_path, whole | make_settings(spec, same_rig=True))
    for other in (whole, whole | make_settings(spec, same_rig=False)):
        with pytest.raises(InputError, match="has stages of another characterisation: its (make|same_rig) is"):
            recording_folder(tmp_path, other)


def test_a_rest_length_that_is_not_that_of_the_simulated_muscle_is_refused_before_anything_moves():
    with pytest.raises(
        InputError, match=r"rest_length must be about 28.1 cm, that of the simulated muscle, got 14 cm; simulate"
    ):
        characterise_like("festo-10mm", muscle="festo-10mm", rest_length="14 cm")
