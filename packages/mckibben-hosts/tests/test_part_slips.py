"""Laws of values where they enter a part: what cannot be is refused, what can hardly be meant stands with its export."""

import json
import warnings

import pytest

import mckibben as mk
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.muscles.evidence import law_error
from mckibben_hosts import Part, export
from mckibben_hosts.targets import export_cautions


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ({"span": "50 cm"}, "span must be from 1 mm to 20.02 cm for a muscle of 14 cm at rest"),
        ({"span": -1.0}, "span must be from"),
        ({"span": 0.0}, "span must be from"),
        ({"span": "5 bar"}, "must be a length"),
        ({"pressure": float("nan")}, "finite"),
    ],
)
def test_a_part_that_cannot_be_is_refused(words, sentence):
    with pytest.raises(InputError, match=sentence):
        Part("nylon", **words)


@pytest.mark.parametrize(
    "words",
    [
        {"span": "16 cm"},
        {"span": "5 cm"},
        {"pressure": 2.0},
        {"pressure": 2e8},
        {"substep": 5e-3},
        {"air": mk.Air(supply=6)},
    ],
)
def test_what_can_hardly_be_meant_of_a_part_stands_with_its_export(words, tmp_path):
    with pytest.warns(PlausibilityWarning) as caught:
        part = Part("nylon", **words)
    said = [str(w.message) for w in caught]
    assert said == [str(one) for one in part.cautions] and said == export_cautions(part, "c")[: len(said)]


def test_the_description_of_an_export_has_the_cautions(tmp_path):
    with pytest.warns(PlausibilityWarning):
        part = Part("nylon", mk.Air(supply=6))
    export(part, "c", tmp_path, name="slip")
    described = json.loads((tmp_path / "slip.json").read_text())
    assert described["warnings"] == [str(one) for one in part.cautions]
    (span,) = (one for one in described["inputs"] if one["path"] == "span.muscle")
    assert 0.0 < span["least"] < 0.126 < span["most"] < 0.21


def test_a_step_that_cannot_be_is_refused_and_a_command_beyond_its_range_is_said_once():
    part = Part("nylon")
    state = part.rest()
    usual = {"period": 1e-3, "span": 0.126, "rate": 0.0, "muscle": 0.1}
    slips = (("span", -1.0), ("span", 0.5), ("period", 0.0), ("period", 5.0), ("rate", 1e3), ("muscle", float("nan")))
    for name, value in slips:
        with pytest.raises(InputError, match=name):
            part.step(state, **usual | {name: value})
    with pytest.warns(PlausibilityWarning, match="it acts as 1") as caught:
        for _ in range(3):
            state, _ = part.step(state, **usual | {"muscle": 3e5})
    assert len(caught) == 1


@pytest.mark.parametrize(("muscle", "words"), [("festo-10mm", "(95 %)"), ("nylon", "no interval")])
def test_a_part_states_how_far_the_tension_of_its_muscle_may_be_off(muscle, words, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)
        part = Part(muscle)
    assert words in part.statement
    made = mk.muscle(muscle)
    assert part.law_error == {"muscle": law_error(made.specimen, made.law)}  # as every other answer about it
    about = next(path for path in export(part, "c", tmp_path) if path.suffix == ".json" and "schema" not in path.name)
    assert words in json.loads(about.read_text(encoding="utf-8"))["law_error"]["muscle"]["interval"]
