"""``sweep``: the contract's JSON, exit codes, resuming, and bad input in one line before anything runs."""

import json

import numpy as np
import pytest

from mckibben.batch.store import read_results
from mckibben.cli import main

PROTOCOL = """
schema = 1
name = "short"
sample_rate = "1 kHz"
[parameters.high]
unit = "Pa"
value = "3 bar"
[[steps]]
label = "high"
span = "1 L0"
pressure = "$high"
for = "0.1 s"
"""
FILE = """
schema = 1
protocol = "short.toml"
muscle = "nylon"
[list_or_grid]
[outputs.peak]
channel = "tension"
reduce = "max"
"""


@pytest.fixture
def run(capsys, tmp_path):
    def call(values, *words, text=FILE, varied="high"):
        (tmp_path / "short.toml").write_text(PROTOCOL)
        file = tmp_path / "sweep.toml"
        file.write_text(text.replace("[list_or_grid]", f"[grid]\n{varied} = {values}"))
        with pytest.raises(SystemExit) as stop:
            main(["sweep", str(file), "--out", str(tmp_path / "out"), "--scheduler", "serial", *words])
        out, err = capsys.readouterr()
        return stop.value.code or 0, out, err

    return call


def test_a_sweep_prints_the_contracts_json_and_goes_on_where_it_stopped(run, tmp_path):
    code, out, err = run('["1 bar", "2 bar", "3 bar"]', "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert {"runs", "failed", "store", "muscle_seconds_per_second"} <= set(found)
    assert (found["runs"], found["failed"], found["new"]) == (3, 0, 3)
    assert found["muscle_seconds_per_second"] > 0.0
    variants, results = read_results(found["store"])
    assert list(variants.columns["high"]) == [1e5, 2e5, 3e5]
    assert (results.outputs["peak"][1:] > results.outputs["peak"][:-1]).all()  # more pressure pulls harder
    code, out, _ = run('["1 bar", "2 bar", "3 bar"]', "--json")
    assert code == 0 and (json.loads(out)["runs"], json.loads(out)["new"]) == (3, 0)
    code, out, err = run('["1 bar", "4 bar"]')
    assert (code, out) == (2, "") and "another sweep" in err and err.count("\n") == 1


def test_variants_that_fail_are_results_and_the_exit_code_tells(run):
    code, out, err = run('["1 bar", "99 bar"]', "--json")
    found = json.loads(out)
    assert (code, err) == (1, "")
    assert (found["runs"], found["failed"], found["codes"]) == (2, 1, {"done": 1, "refused": 1})
    _, results = read_results(found["store"])
    assert "regulator" in results.message[1]


@pytest.mark.parametrize(
    ("values", "words", "said"),
    [
        ('["1 m"]', [], "high"),
        (
            '["1 bar"]',
            ["--scheduler", "slurm"],
            "--scheduler must be",
        ),
        ('["1 bar"]', ["--out", "/proc/nowhere"], "--out is '/proc/nowhere'"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(run, values, words, said, tmp_path):
    code, out, err = run(values, *words)
    assert (code, out) == (2, "")
    assert said in err and err.startswith("mckibben: ") and err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_dry_run_says_what_would_be_run_and_writes_nothing(run, tmp_path):
    code, out, _ = run('["1 bar", "3 bar"]', "--dry-run", "--json")
    found = json.loads(out)
    assert code == 0 and found["variants"] == 2 and found["parameters"]["high"]["range"] == [1e5, 3e5]
    code, out, _ = run('["1 bar", "3 bar"]', "--dry-run")
    assert "2 variants" in out and "1 bar to 3 bar" in out
    assert not (tmp_path / "out").exists()


def test_ctrl_c_leaves_a_store_that_goes_on(run, monkeypatch):
    from mckibben.batch.drive import SerialTeam

    def interrupted(self, work, blocks, tell):
        for block in blocks[:1]:
            yield block, work.run(block, tell)
        raise KeyboardInterrupt

    text = FILE + "[run]\nblock = 2\n"
    with monkeypatch.context() as patch:
        patch.setattr(SerialTeam, "run", interrupted)
        code, out, err = run('["1 bar", "2 bar", "3 bar"]', "--json", text=text)
    # two of three were stored when it came
    assert (code, out) == (130, "") and "2 of 3 variants are in" in err and "the same command goes on" in err
    code, out, _ = run('["1 bar", "2 bar", "3 bar"]', "--json", text=text)
    assert code == 0 and (json.loads(out)["runs"], json.loads(out)["new"]) == (3, 1)


def test_ctrl_c_before_a_block_is_done_says_that_nothing_was(run, monkeypatch):
    from mckibben.batch.drive import SerialTeam

    def interrupted(self, work, blocks, tell):
        raise KeyboardInterrupt

    monkeypatch.setattr(SerialTeam, "run", interrupted)
    code, out, err = run('["1 bar", "2 bar"]')
    assert (code, out) == (130, "") and err == "mckibben: interrupted; no variant was done\n"


BACK = (
    FILE
    + """
[outputs.rise]
channel = "muscle.pressure"
reduce = "time_to"
"""
)
THERE_AND_BACK = (
    PROTOCOL
    + """
[[steps]]
label = "low"
span = "1 L0"
pressure = "0 bar"
for = "0.5 s"
"""
)


def test_a_measure_that_means_nothing_has_no_value_and_every_face_says_why(run, monkeypatch):
    """After a step up and back the pressure ends where it began: no share of its way is ever a rise."""
    monkeypatch.setattr("test_sweep_command.PROTOCOL", THERE_AND_BACK)
    code, out, err = run('["1 bar", "2 bar"]', "--json", text=BACK)
    found = json.loads(out)
    assert code == 1 and found["codes"] == {"done": 2} and found["unmeasured"] == {"rise": [0, 1]}
    (said,) = found["warnings"]
    assert said.startswith("rise has no value in 2 of 2 variants (0 to 1); in the first, muscle.pressure ends ")
    assert said in err
    _, results = read_results(found["store"])
    assert np.isnan(results.outputs["rise"]).all() and np.isfinite(results.outputs["peak"]).all()
    assert [c.text for c in results.cautions] == [said] and "2 without rise" in repr(results)
    assert all("rise: muscle.pressure ends" in message for message in results.message)


def test_a_step_that_stays_has_a_rise_and_no_word(run):
    code, out, err = run('["1 bar", "2 bar"]', "--json", text=BACK)
    found = json.loads(out)
    assert (code, found["unmeasured"], found["warnings"]) == (0, {}, [])
    _, results = read_results(found["store"])
    assert (results.outputs["rise"] > 0.0).all() and "without" not in repr(results)


def test_what_can_hardly_be_meant_of_a_variant_is_said_with_it_by_every_face(run):
    """Three pascal among pressures of some bar: in the warnings of the command, in the results, and with the variant."""
    code, out, err = run('["1 bar", "3 Pa", "2 bar"]', "--json")
    (said,) = json.loads(out)["warnings"]
    assert code == 0 and said.endswith("inflates no muscle; was 3 bar meant? (variant 1)") and said in err
    _, results = read_results(json.loads(out)["store"])
    assert [c.text for c in results.cautions] == [said]
    assert [" Caution: " in message for message in results.message] == [False, True, False]


LONG = PROTOCOL.replace('span = "1 L0"', 'span = "$long"').replace(
    "[[steps]]", '[parameters.long]\nunit = "m"\nvalue = "14 cm"\n[[steps]]'
)


def test_a_variant_whose_threads_break_ends_by_a_code_of_its_own(run, monkeypatch):
    """Threads that may give by one per cent beyond 15.4 cm break; the cord of the rig takes its share of the 15.9 cm."""
    monkeypatch.setattr("test_sweep_command.PROTOCOL", LONG)
    monkeypatch.setattr("mckibben.assembly.build.largest_strain", lambda specimen: 0.01)
    text = FILE.replace("[list_or_grid]", '[set]\nhigh = "0 bar"\n[list_or_grid]').replace(
        'muscle = "nylon"', 'muscle = "nylon"\nrig = "modern"'
    )
    code, out, _ = run('["14 cm", "15.9 cm"]', "--json", text=text, varied="long")
    found = json.loads(out)
    assert code == 1 and found["codes"] == {"done": 1, "broken": 1}
    _, results = read_results(found["store"])
    assert results.message[1].startswith("A muscle is longer than its threads bear")
    assert np.isnan(results.outputs["peak"][1]) and results.outputs["peak"][0] >= 0.0
