"""``mckibben next``: points and what they teach, two laws told apart, its files, and one line for what is wrong."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from test_broken_input import POSTERIOR

import mckibben as mk
from mckibben.cli import main
from mckibben.identification.calibration import new_muscle
from mckibben.identification.next_points import LawTest
from mckibben.quantities import with_unit
from mckibben.studies import fitting
from mckibben.studies.next_measurement import readings_to_take

# the spring's own numbers, with a threshold of which the spring has none, at the same points
OTHER = POSTERIOR | {
    "law": "linear_threshold",
    "samples": POSTERIOR["samples"]
    | {"threshold_pressure": [2e4, 3e4, 1e4], "passive_stiffness": [100.0, 90.0, 110.0]},
}


@pytest.fixture
def fit(tmp_path):
    path = tmp_path / "fit.json"
    fits = [{"law": one["law"], "posterior": one} for one in (POSTERIOR, OTHER)]
    path.write_text(json.dumps({"fits": fits}))
    return str(path)


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["next", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_two_laws_of_a_fit_are_told_apart_in_words_and_numbers(run, fit, tmp_path):
    laws = ("--from", fit, "--laws", "gas_spring,linear_threshold", "--budget", "40 s")
    code, out, _ = run(*laws)
    sentence = " ".join(out.split())
    assert code == 0 and "gas_spring and linear_threshold expect them" in sentence
    assert "speak for it with a probability of" in sentence
    code, out, _ = run(*laws, "--json", "--out", str(tmp_path / "next.csv"), "--out", str(tmp_path / "next.toml"))
    found = json.loads(out)
    assert code == 0 and found["laws"] == ["gas_spring", "linear_threshold"] and found["duration"] <= 40.0
    assert 0.5 <= found["recognised"] <= 1.0 and found["distance"] >= abs(found["points"][0]["deviations"])
    head = (tmp_path / "next.csv").read_text().splitlines()[0]
    assert "tension_gas_spring" in head and "deviations" in head
    assert (tmp_path / "next.toml").read_text().count('label = "point') == len(found["points"])


def test_the_first_law_of_a_fit_is_the_one_that_is_asked_about(run, fit):
    code, out, _ = run("--from", fit, "--budget", "30 s", "--json")
    assert code == 0 and set(json.loads(out)["expected"]) == set(POSTERIOR["samples"])


def test_a_question_outside_of_the_measured_map_is_answered_with_a_caution(run, fit):
    asked = ("--from", fit, "--budget", "30 s", "--length", "18 cm", "--pressure", "3 bar")
    code, _, err = run(*asked)
    assert code == 0 and "caution: a length of 18 cm is outside of the measured 12 cm to 14 cm" in err
    code, out, _ = run(*asked, "--json")
    assert code == 0 and "where the intervals are a guess" in json.loads(out)["warnings"][0]


def test_readings_that_are_repeated_stand_in_one_row(run, fit):
    asked = ("--from", fit, "--budget", "3 min", "--length", "13 cm", "--pressure", "3 bar")
    points = json.loads(run(*asked, "--json")[1])["points"]
    places = [(point["length"], point["pressure"]) for point in points]
    changes = 1 + sum(a != b for a, b in zip(places[:-1], places[1:], strict=True))
    _, out, _ = run(*asked)
    rows = [line for line in out.partition("What they teach")[0].splitlines() if " cm " in line and " bar" in line]
    assert changes < len(points) and len(rows) == changes and rows[0].split()[:2] == ["1", "to"]


def test_the_protocol_is_one_that_the_slowest_rig_takes(run, fit, tmp_path):
    place = tmp_path / "next.toml"
    code, _, _ = run("--from", fit, "--budget", "30 s", "--rig", "uno", "--out", str(place))
    low, high = mk.rig("uno").limits("direct").sample_rates
    assert code == 0 and low <= mk.protocol(place).sample_rate <= high


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--laws", "gas_spring"), "--laws must be two laws, such as gas_spring,linear_threshold"),
        (("--laws", "gas_spring,gas_spring"), "--laws must be two laws"),
        (("--laws", "gas_spring,linear_threshold", "--law", "gas_spring"), "--law is allowed only without --laws"),
        (("--laws", "gas_spring,ideal"), "Known are gas_spring, linear_threshold"),
    ],
)
def test_wrong_laws_are_refused_in_one_line(run, fit, words, said):
    code, _, err = run("--from", fit, *words)
    assert code == 2 and err.count("\n") == 1 and said in err


def test_readings_find_the_right_law_as_often_as_two_normal_distributions_are_parted():
    test = LawTest(
        ("a", "b"), *(np.zeros(1),) * 2, np.zeros((2, 1)), np.zeros(1), distance=3.29, duration=0.0, wait=0.0
    )
    # half the distance lies between each law and the middle; 1.645 standard deviations are 95 %, to three digits
    assert test.recognised == pytest.approx(0.95, abs=5e-4)


def test_each_of_several_named_laws_has_samples_of_its_own():
    def fitted(law, *, converged=True):
        return SimpleNamespace(law=law, converged=converged, posterior=lambda **_: law)

    fits = (fitted("b"), fitted("a"), fitted("c", converged=False))
    points = SimpleNamespace(informative_slack=[], select=lambda _: [])
    ranking = SimpleNamespace(best=fits[0], fits=fits, points=points)
    assert fitting._posteriors(ranking, None, 100, every=False) == {"b": "b"}
    assert fitting._posteriors(ranking, None, 100, every=True) == {"b": "b", "a": "a"}


@pytest.mark.parametrize(("stiffness", "said"), [("4.9 mm", True), (None, False)])
def test_a_tension_outside_of_the_interval_beside_it_is_explained(capsys, fit, stiffness, said):
    # 4.9 mm is 4 % more than the samples have, 2 N of 57 N, and they and their discrepancy of 0.5 N leave less open.
    words = [
        "tension",
        "nylon",
        "--law",
        "gas_spring",
        "--length",
        "13 cm",
        "--pressure",
        "4 bar",
        "--from-posterior",
        fit,
    ]
    with pytest.raises(SystemExit) as stop:
        main([*words, *(["--set", f"stiffness_per_pressure={stiffness}"] if stiffness else [])])
    _, err = capsys.readouterr()
    assert stop.value.code == 0 and ("lies outside of the 95 % of the posterior" in " ".join(err.split())) == said


def test_the_readings_of_a_muscle_like_others_are_at_rest_and_shortened_and_each_narrows_it(run) -> None:
    rigs = {}
    for words in ((), ("--same-rig",)):
        code, out, _ = run("--like", "festo-10mm", "--set", "rest_length=132 mm", *words, "--json")
        found = json.loads(out)
        first, second = found["readings"]
        assert code == 0 and first["length"] == pytest.approx(0.132, rel=1e-12)
        assert first["pressure"] == second["pressure"] == 5.5e5
        assert found["half_width_now"] > first["half_width"] > second["half_width"] > 0.0
        assert all(0.0 < one["low"] <= one["tension"] <= one["high"] for one in (first, second))
        rigs[bool(words)] = found
    assert rigs[True]["readings"][1]["length"] == pytest.approx(0.96 * 0.132, rel=1e-12)
    # the most contracted that was measured, in proportion, would leave one muscle in six slack
    assert 0.132 * 244.25 / 281.0 < rigs[False]["readings"][1]["length"] < 0.95 * 0.132
    assert rigs[False]["half_width_now"] > rigs[True]["half_width_now"]
    used = run("--like", "festo-10mm", "--set", "rest_length=132 mm", "--length", "118 mm", "--json")[1]
    assert json.loads(used)["readings"][1]["length"] == pytest.approx(0.118, rel=1e-12)


@pytest.mark.parametrize("rest", ["90 mm", "132 mm", "281 mm"])
@pytest.mark.parametrize("same_rig", [True, False])
def test_no_reading_is_asked_for_where_a_muscle_of_the_make_may_hang_slack(rest, same_rig) -> None:
    muscle = mk.muscle("festo-10mm", rest_length=rest)
    for used, highest in ((None, math.inf), (0.8 * muscle.rest_length, 4.5e5)):
        asked = readings_to_take(muscle, same_rig=same_rig, shortest=used, highest=highest)
        new = new_muscle(muscle.specimen, muscle.law, same_rig=same_rig)
        for place in asked.places:
            at = np.array([place["length"]]), np.array([place["pressure"]])
            tension, half = new.predict(*at)
            assert tension > half  # of 95 %: 39 of 40 muscles pull there
            new = new.conditioned([(*map(float, np.ravel(at)), float(tension[0]))])
        assert place["length"] < muscle.rest_length
        assert bool(asked.cautions) == (used is not None and not same_rig)
        # the sentence behind a first reading names the same place as the plan
        one = asked.places[0]
        new = new_muscle(muscle.specimen, muscle.law, same_rig=same_rig)
        read = new.conditioned([(one["length"], one["pressure"], one["tension"])])
        if used is None:
            assert read.next_reading().startswith(with_unit(place["length"], "m", 4))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "--from is missing: the result of a fit with samples, or --like the specimen of a muscle's make"),
        (("--like", "nylon"), "nylon does not state how far muscles of its make differ"),
        (("--like", "festo-10mm", "--rig", "modern"), "--rig is allowed only without --like"),
        (("--like", "festo-10mm", "--length", "30 cm"), "between"),
    ],
)
def test_readings_that_cannot_be_chosen_are_refused_in_a_sentence(run, words, said) -> None:
    code, _, err = run(*words)
    assert code == 2 and said in err
