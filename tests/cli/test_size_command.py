"""``mckibben size``: its tables, its JSON in SI, its exit codes, and one line for what is wrong."""

import json

import pytest

from mckibben.cli import main

ASKED = ("size", "--force", "35 N", "--stroke", "2.8 cm", "--pressure", "5 bar", "--no-lines")


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(list(words))
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_the_json_is_one_object_in_si(run):
    code, out, err = run(*ASKED, "--cycles", "1 Hz", "--top", "20", "--json")
    found = json.loads(out)
    assert code == 0 and err == "" and found["reached"]
    assert found["wish"] == pytest.approx(
        {"force": 35.0, "stroke": 0.028, "pressure": 5e5, "frequency": 1.0, "tube_length": 0.5}
    )
    muscles = {m["id"]: m for m in found["muscles"]}
    assert {"braid-mass", "nylon", "DMSP-20-300"} <= set(muscles)
    keys = {
        "law",
        "verdict",
        "error",
        "promised_force",
        "margins",
        "nominal",
        "dimensions",
        "air",
        "inferred",
        "sources",
    }
    assert all(keys <= set(m) for m in muscles.values())
    assert muscles["nylon"]["verdict"] == "yes"
    braid = muscles["braid-mass"]["dimensions"]
    assert 0.05 < braid["thread_length"] < 1.0 and 0.3 < braid["braid_angle"] < 0.8  # metres and radians
    assert {s["form"] for s in found["sources"]} == {"bottle", "compressor", "heated"}
    assert all(s["energy"] > 0.0 for s in found["sources"])
    assert found["lines"] == [] and found["misses"] == []


def test_the_tables_name_muscles_and_sources(run):
    code, out, _ = run(*ASKED, "--cycles", "1 Hz", "--working-time", "8 h", "--tank", "1 l at 100 bar")
    assert code == 0
    assert "A day of 8 h: 28800 cycles" in out and "own tank of 1 l at 100 bar" in out and "a day, W h" in out
    assert "braid-mass" in out and "turns" in out and "CO2 cartridge" in out and "accumulator" in out


def test_an_unreachable_wish_ends_with_one_and_says_the_nearest_miss(run):
    words = (
        "size",
        "--force",
        "5 kN",
        "--stroke",
        "5 cm",
        "--pressure",
        "3 bar",
        "--space",
        "20 cm x 3 cm",
        "--no-lines",
    )
    code, out, err = run(*words, "--json")
    found = json.loads(out)
    assert code == 2 and not found["reached"] and not found["sources"]
    assert err.count("\n") == 1 and "nearest is" in err and found["sentence"] in err
    assert {m["part"] for m in found["misses"]} >= {"force", "stroke", "pressure", "length", "diameter"}


@pytest.mark.slow
def test_valves_and_a_figure(run, tmp_path):
    path = tmp_path / "size.svg"
    words = [w for w in ASKED if w != "--no-lines"]
    code, out, _ = run(*words, "--out", str(path), "--json", "--top", "3")
    found = json.loads(out)
    assert code == 0 and path.stat().st_size > 5000
    assert len(found["lines"]) == 3
    first = found["lines"][0]
    assert first["pareto"] and 0.0 < first["to_force"] < 1.0 and first["air"] > 0.0
    assert {"rise", "fall", "mass", "power", "stiffness", "leak", "speed"} <= set(first)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"--force": "35 bar"}, "--force"),
        ({"--force": "0 N"}, "--force must be above 0 N"),
        ({"--stroke": "3"}, "unit is missing"),
        ({"--pressure": "-1 bar"}, "--pressure"),
        ({"--space": "20 cm x 3 cm x 1 cm"}, "--space"),
        ({"--space": "2 cm"}, "more than the stroke"),
        ({"--space": "20 x 3 cm"}, "unit is missing"),
        ({"--cycles": "1 s"}, "--cycles"),
        ({"--speed": "10 cm/s"}, "without --no-lines"),
        ({"--top": "0"}, "--top"),
        ({"--law": "linear"}, "Known are linear_threshold"),
        ({"--muscle": "nylonn"}, "The candidates are"),
        ({"--load": "3 kg"}, "--load must be given without a force"),
        ({"--valve": "MHE2-3-2"}, "without --no-lines"),
        ({"--working-time": "8 h"}, "--working-time needs a frequency"),
        ({"--battery": "100 W"}, "--battery"),
        ({"--tank": "2 l"}, "--tank must be a volume and a gauge pressure"),
        ({"--from-posterior": "none.json"}, "--from-posterior is allowed only with --muscle"),
        ({"--from-posterior": "none.json", "--muscle": "nylon"}, "File not found: none.json"),
        ({"--out": "size.gif"}, "--out"),
    ],
)
def test_bad_input_is_one_line_and_two(run, change, says):
    words = list(ASKED)
    for option, value in change.items():
        if option in words:
            words[words.index(option) + 1] = value
        else:
            words += [option, value]
    code, out, err = run(*words, "--json")
    assert code == 2 and out == ""
    assert err.count("\n") == 1 and says in err
