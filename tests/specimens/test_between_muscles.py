"""How far another muscle of a specimen's make is from its law, and a muscle that was calibrated by readings."""

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.identification.between import Between
from mckibben.identification.calibration import new_muscle
from mckibben.muscles.evidence import law_error, make_spread
from mckibben.specimens.model import BETWEEN_COMPONENTS
from mckibben.studies.tension import tension

READINGS = "132 mm, 5.5 bar, 320 N", "126.75 mm, 5.5 bar, 160 N"


@pytest.fixture(scope="module")
def calibrated() -> mk.Muscle:
    with pytest.warns(PlausibilityWarning, match="correcting one number"):
        return mk.muscle("festo-10mm", rest_length="132 mm").calibrate(*READINGS)


def test_specimens_state_how_far_another_muscle_of_the_make_is_and_metadata_have_it() -> None:
    spec = mk.specimen("festo-10mm")
    assert make_spread(spec).to_dict()["elsewhere"] == 0.2
    assert law_error(spec, spec.law)["between_muscles"]["after_two_readings"] == 0.03
    stated, usual = ({n: getattr(one, n) for n in BETWEEN_COMPONENTS} for one in (Between.of(spec), Between()))
    assert stated == pytest.approx(usual, rel=1e-12)  # 0.45 mm to rounding
    assert make_spread(mk.specimen("DMSP-40-400")).elsewhere == 0.2
    assert make_spread(mk.specimen("nylon")) is None
    assert "between_muscles" not in law_error(mk.specimen("nylon"), "linear_threshold")


def test_an_answer_has_the_interval_of_the_make_around_the_same_tension() -> None:
    with pytest.warns(PlausibilityWarning):
        answer = tension("festo-10mm", length="27 cm", pressure="5 bar")
    low, high = answer.interval
    assert low < answer.points[0]["tension"] < high
    law = answer.muscle.law
    # a share of the largest tension, which is at rest and at the highest measured pressure, to rounding
    assert high - answer.points[0]["tension"] == pytest.approx(0.2 * float(law.tension(0.281, 6.15e5)), rel=1e-9)


def test_readings_move_an_answer_and_narrow_its_interval() -> None:
    at = {"length": "12.4 cm", "pressure": "5 bar", "parameters": {"rest_length": "132 mm"}}
    with pytest.warns(PlausibilityWarning):
        whole, read = tension("festo-10mm", **at), tension("festo-10mm", **at, reading=READINGS)
    widths = [float((answer.interval[1] - answer.interval[0])[0]) for answer in (whole, read)]
    assert widths[1] < 0.7 * widths[0]
    assert whole.points[0]["tension"] != read.points[0]["tension"]


def test_a_calibrated_muscle_is_saved_with_its_readings_and_answers_alike(calibrated, tmp_path) -> None:
    again = mk.muscle(calibrated.save(tmp_path / "mine.toml"))
    at = np.linspace(0.118, 0.132, 5), np.full(5, 5e5)
    assert np.asarray(again.law.tension(*at)).tobytes() == np.asarray(calibrated.law.tension(*at)).tobytes()
    ours, theirs = new_muscle(calibrated), new_muscle(again)
    assert ours.readings == theirs.readings
    for one, other in zip(ours.predict(*at), theirs.predict(*at), strict=True):
        assert one == pytest.approx(other, rel=1e-12)  # digits of the file
    assert make_spread(again.specimen).calibrated < make_spread(mk.specimen("festo-10mm")).elsewhere


def test_a_calibrated_muscle_is_one_and_is_not_cut(calibrated) -> None:
    with pytest.raises(InputError, match="is one muscle, calibrated by readings, got 20 cm; cut its make instead"):
        mk.muscle(calibrated.specimen, rest_length="20 cm")


def test_a_muscle_whose_make_is_not_known_is_not_calibrated() -> None:
    with pytest.raises(InputError, match="nylon does not state how far muscles of its make differ"):
        mk.muscle("nylon").calibrate("12 cm, 5 bar, 50 N")
