"""``protocols``: what ships, what one of them does in numbers, and one line for what is wrong."""

import json
import subprocess
import sys

import pytest

from mckibben.cli import main
from mckibben.experiments.read import parse_protocol, protocol, protocol_names, shipped, stimulation_protocol_names


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["protocols", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_the_list_holds_every_shipped_protocol(run):
    code, out, err = run("--json")
    found = json.loads(out)["protocols"]
    assert (code, err) == (0, "")
    assert [p["name"] for p in found] == [*protocol_names(), *stimulation_protocol_names()]
    assert all(p["title"] and set(p) == {"name", "title", "source"} for p in found)
    shown = run()[1]
    assert all(p["name"] in shown and p["title"] in shown for p in found)


@pytest.mark.parametrize("name", protocol_names())
def test_each_of_them_is_described_as_it_is(run, name):
    code, out, _ = run(name, "--json")
    found, known = json.loads(out), shipped(name)
    assert code == 0
    assert found["sentence"] == known.sentence()
    assert found["hash"] == known.digest
    assert found["needs"] == list(known.required())
    assert found["duration"]["longest"] == known.expand(rest_length=0.14).duration
    assert set(found["parameters"]) == {p.name for p in known.parameters}
    assert all(p["values"] for p in found["parameters"].values())
    # its text and its document both are that experiment
    assert parse_protocol(found["toml"], where="text").digest == known.digest
    assert run(name)[0] == 0


def test_parameters_say_value_unit_bounds_and_what_is_inferred(run):
    found = json.loads(run("quasi-static", "--json")[1])["parameters"]
    assert found["pressure"]["values"][5] == {"value": 5e5, "unit": "Pa", "words": "5 bar", "inferred": False}
    assert [b["value"] for b in found["pressure"]["bounds"]] == [0.0, 1e7]
    assert found["cycles"]["values"][0]["inferred"] is True
    # it has no value of its own: an inferred option of a choice sets it
    assert found["shortest"]["set_by"] == "range"
    assert found["shortest"]["values"] == [{"value": 0.75, "unit": "L0", "words": "0.75 L0", "inferred": True}]


def test_a_person_reads_sentence_parameters_duration_and_hash(run):
    out = run("quasi-static")[1]
    for words in ("For each pressure of 0, 1, 2, 3, 4, 5 bar", "0 bar to 100 bar", "3 (inferred)", "set by range",
                  "Duration: at most 1 min 43 s in 31 steps, for a rest length of 14 cm.", "Needs: accumulators, motor",
                  "doi:10.1109/70.481753", shipped("quasi-static").digest):  # fmt: skip
        assert words in out


def test_set_replaces_values_and_the_hash_is_that_of_the_experiment(run):
    found = json.loads(run("quasi-static", "--set", "pressure=1 bar, 300 kPa", "--set", "cycles=5", "--json")[1])
    assert [v["value"] for v in found["parameters"]["pressure"]["values"]] == [1e5, 3e5]
    # the words differ, the experiment does not
    assert found["hash"] == protocol("quasi-static", pressure=["1 bar", "3 bar"], cycles=5).digest
    assert found["hash"] != shipped("quasi-static").digest
    assert parse_protocol(found["toml"], where="text").digest == found["hash"]


def test_toml_is_the_files_text_and_a_file_is_read_like_a_name(run, tmp_path):
    text = run("work-loop", "--out", "-")[1]
    assert text.startswith("schema = 1\n")
    path = tmp_path / "mine.toml"
    path.write_text(text)
    by_file, by_name = (json.loads(run(name, "--json")[1]) for name in (str(path), "work-loop"))
    assert by_file == by_name
    assert run(str(path), "--out", "-")[1] == text


def test_a_length_that_nobody_knows_beforehand_is_told_and_no_error(run, tmp_path):
    path = tmp_path / "free.toml"
    text = 'schema = 1\nname = "free"\n[[steps]]\ntension = "10 N"\nfor = "1 s"\n'
    path.write_text(text + '[[steps]]\nspan = { to = "12 cm", at = "1 cm/s" }\n')
    found = json.loads(run(str(path), "--json")[1])
    assert found["duration"]["longest"] is None
    assert "not known in advance" in found["duration"]["note"]
    assert "Duration not known in advance" in run(str(path))[1]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("quasistatic",), "Did you mean 'quasi-static'?"),
        (("zzz",), "Known are isobaric-map"),
        (("no-such.toml",), "not found"),
        (("quasi-static", "--set", "presure=1 bar"), "Did you mean 'pressure'?"),
        (("quasi-static", "--set", "pressure=1 m"), "--set pressure must be a pressure"),
        (("quasi-static", "--set", "pressure=5"), "unit is missing"),
        (("quasi-static", "--set", "pressure=500 bar"), "must be between 0 bar and 100 bar"),
        (("quasi-static", "--set", "pressure"), "NAME=VALUE"),
        (("quasi-static", "--set", "range=huge"), "Known are large, small"),
        (("quasi-static", "--set", "repeat=0"), "whole number"),
        (("--out", "-"), "--out is allowed only"),
        (("--set", "a=1"), "--set is allowed only"),
    ],
)
def test_wrong_words_give_one_line_and_exit_code_2(run, words, says):
    code, out, err = run(*words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err


def test_the_list_needs_nothing_that_computes():
    code = (
        "import sys; from mckibben.cli import main\ntry: main(['protocols'])\n"
        "except SystemExit: print([m for m in ('jax', 'matplotlib', 'xarray') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
